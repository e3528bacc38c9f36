"""The asyncio client: the same methods as the blocking `chefshat.Client`, awaited; agents may decide in coroutines.

The protocol of playing is not here but in `session`; here are the connection, its loss, and the tasks of agents that think.
"""

import asyncio
import random
from collections.abc import AsyncIterator, Awaitable, Mapping, Sequence
from typing import Self, TypeAlias

import grpc
import grpc.aio

from chefshat import pb, requests
from chefshat._gen.chefshat.v1.play_service_pb2_grpc import PlayServiceStub
from chefshat._gen.chefshat.v1.record_service_pb2_grpc import RecordServiceStub
from chefshat._gen.chefshat.v1.room_service_pb2_grpc import RoomServiceStub
from chefshat._gen.chefshat.v1.server_service_pb2_grpc import ServerServiceStub
from chefshat._gen.chefshat.v1.spectator_service_pb2_grpc import SpectatorServiceStub
from chefshat._gen.chefshat.v1.tournament_service_pb2_grpc import TournamentServiceStub
from chefshat.agents import Agent
from chefshat.backoff import Backoff
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.participant import MakeAgent, OnEntered
from chefshat.place import Ask
from chefshat.requests import awaited
from chefshat.result import SeatResult
from chefshat.session import PlayOptions, PlaySession
from chefshat.tournaments import AsyncTournamentCalls

# Seconds the server has to end a stream whose seats are all done.
FAREWELL_S = 1.0

PlayCall: TypeAlias = "grpc.aio.StreamStreamCall[pb.PlayRequest, pb.PlayResponse]"


class Client(AsyncTournamentCalls):
    """A connection to a server, made when first needed. Close it, or use it as an asynchronous context manager.

    Make it where the event loop runs. Every method raises `ChefsHatError` with the server's reason when the server refuses, or
    "UNAVAILABLE" when it cannot be reached.
    """

    def __init__(self, address: str, *, backoff: Backoff | None = None) -> None:
        """Names the server; the arguments are those of the blocking client."""
        where = requests.target(address)
        if where.tls:
            credentials = grpc.ssl_channel_credentials()
            self._channel = grpc.aio.secure_channel(where.authority, credentials, requests.CHANNEL_OPTIONS)
        else:
            self._channel = grpc.aio.insecure_channel(where.authority, requests.CHANNEL_OPTIONS)
        self._backoff = backoff or Backoff()
        self._chance = random.Random()
        self._rooms = RoomServiceStub(self._channel)
        self._play = PlayServiceStub(self._channel)
        self._server = ServerServiceStub(self._channel)
        self._records = RecordServiceStub(self._channel)
        self._spectators = SpectatorServiceStub(self._channel)
        self._tournaments = TournamentServiceStub(self._channel)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Closes the connection; whatever still runs on it fails."""
        await self._channel.close()

    async def create_room(
        self,
        name: str = "",
        *,
        rules: pb.RuleSet | str | None = None,
        seats: Sequence[requests.SeatSpec] = (),
        policy: pb.RoomPolicy | None = None,
        game_seed: bytes = b"",
        branch: pb.BranchPoint | None = None,
        hands: pb.ScriptedShift | None = None,
        durability: pb.Durability.ValueType | None = None,
    ) -> pb.CreateRoomResponse:
        """Makes a room; the arguments are those of the blocking client."""
        request = requests.create_room(name, rules, seats, policy, game_seed, branch, hands, durability)
        return await awaited(self._rooms.CreateRoom(request))

    async def join_room(
        self,
        join_code: str,
        name: str,
        *,
        room_id: str = "",
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_AGENT,
        seat: int | None = None,
    ) -> pb.JoinRoomResponse:
        """Takes a seat: the one named, or the first free one that admits the kind. Returns the room, the seat and its ticket."""
        request = pb.JoinRoomRequest(room_id=room_id, join_code=join_code, name=name, kind=kind, seat=seat)
        return await awaited(self._rooms.JoinRoom(request))

    async def get_room(self, room_id: str) -> pb.Room:
        """The room as everybody sees it."""
        return (await awaited(self._rooms.GetRoom(pb.GetRoomRequest(room_id=room_id)))).room

    async def list_rooms(self, state: pb.RoomState.ValueType = pb.ROOM_STATE_UNSPECIFIED) -> AsyncIterator[pb.Room]:
        """The server's rooms, newest first; those in one state alone if it is given. Pages are fetched as they are needed."""
        token = ""
        while True:
            page = await awaited(self._rooms.ListRooms(pb.ListRoomsRequest(state=state, page_token=token)))
            for room in page.rooms:
                yield room
            token = page.next_page_token
            if not token:
                return

    async def leave_room(self, ticket: str) -> pb.Room:
        """Gives back a seat before the game begins: others can take it, and its ticket opens nothing any more."""
        return (await awaited(self._rooms.LeaveRoom(pb.LeaveRoomRequest(ticket=ticket)))).room

    async def close_room(self, room_id: str, owner_token: str) -> pb.Room:
        """Closes a room with the token its creator got; a running game is aborted."""
        request = pb.CloseRoomRequest(room_id=room_id, owner_token=owner_token)
        return (await awaited(self._rooms.CloseRoom(request))).room

    async def server_info(self) -> pb.GetServerInfoResponse:
        """Version, limits, presets and built-in agents of the server."""
        return await awaited(self._server.GetServerInfo(pb.GetServerInfoRequest()))

    async def action_table(self, faces: int = 0) -> pb.GetActionTableResponse:
        """The text of every action for decks of so many faces (0: the standard 11)."""
        return await awaited(self._server.GetActionTable(pb.GetActionTableRequest(faces=faces)))

    async def records(
        self, wanted: pb.RecordFilter | None = None, *, newest_first: bool = False
    ) -> AsyncIterator[pb.RecordSummary]:
        """The records the server holds, oldest first unless asked otherwise; those a filter lets through if one is given.

        Pages are fetched as they are needed.
        """
        token = ""
        while True:
            request = pb.ListRecordsRequest(filter=wanted, page_token=token, newest_first=newest_first)
            page = await awaited(self._records.ListRecords(request))
            for summary in page.records:
                yield summary
            token = page.next_page_token
            if not token:
                return

    async def record(self, game_id: str) -> AsyncIterator[pb.RecordLine]:
        """The record of a game that has ended, line by line."""
        call = self._records.GetRecord(pb.GetRecordRequest(game_id=game_id))
        try:
            async for response in call:
                for line in response.lines:
                    yield line
        except grpc.RpcError as error:
            raise from_rpc_error(error) from error
        finally:
            call.cancel()

    async def watch(self, room_id: str, *, from_sequence: int = 0) -> AsyncIterator[pb.GameEvent]:
        """The public events of a room until its game is over, across lost connections, each once and in order.

        Args:
            room_id: the room.
            from_sequence: number of the first event wanted; 0: all.
        """
        last = max(from_sequence - 1, 0)
        failures = 0
        while True:
            call = self._spectators.Watch(requests.watch_request(room_id, last))
            try:
                async for response in call:
                    for event in response.events:
                        last = event.sequence
                        failures = 0
                        yield event
                return
            except grpc.RpcError as error:
                failures += 1
                await self._wait(failures, from_rpc_error(error))
            finally:
                call.cancel()

    async def express(self, ticket: str, expression: pb.Expression) -> None:
        """Expresses something for the seat of the ticket, at any time."""
        await awaited(self._play.Act(pb.ActRequest(ticket=ticket, express=expression)))

    async def resume_seat(self, ticket: str) -> None:
        """Says that the seat's agent plays itself again after a substitute has."""
        await awaited(self._play.Act(pb.ActRequest(ticket=ticket, resume=pb.ResumeSeat())))

    async def play(self, agent: Agent, ticket: str, *, options: PlayOptions | None = None) -> SeatResult:
        """Plays one seat until its game is over. Raises the seat's error if it leaves before that."""
        result = (await self.play_many({ticket: agent}, options=options))[ticket]
        result.raise_for_error()
        return result

    async def play_many(self, agents: Mapping[str, Agent], *, options: PlayOptions | None = None) -> dict[str, SeatResult]:
        """Plays several seats, of any rooms, over one stream until all their games are over.

        A lost connection is made again, and the seats resume where they were. Agents whose `decide` is a coroutine think at the
        same time, each for its own seat, and go on thinking while a connection is made again. What an agent raises is raised
        here. A seat that cannot go on has its `error` set in its result; the others play on.

        Args:
            agents: the agent for each ticket.
            options: how the seats attach.

        Returns:
            The result of each ticket.
        """
        session = PlaySession(agents, options)
        await self._play_session(session)
        return session.results()

    async def play_tournament(
        self, ticket: str, make_agent: MakeAgent, *, options: PlayOptions | None = None, on_entered: OnEntered | None = None
    ) -> list[SeatResult]:
        """Takes part in a tournament until it is over, in as many games at a time as the participant said it can play.

        The server seats the participant in its games; all are played over one stream. A lost connection is made again, and the
        agents go on with their games. Those whose `decide` is a coroutine think at the same time. The arguments, the results and
        what is raised are those of the blocking client.
        """
        session = PlaySession.of_participant(ticket, make_agent, options, on_entered)
        await self._play_session(session)
        return session.played()

    async def _play_session(self, session: PlaySession) -> None:
        """Plays until the session is done, over as many connections as it takes."""
        failures = 0
        run = _Run(session)
        try:
            while not session.done:
                before = session.progress
                error = await run.connection(self._play.Play())
                session.lost()
                if session.done:
                    break
                failures = 1 if session.progress > before else failures + 1
                try:
                    await self._wait(failures, error)
                except ChefsHatError as final:
                    session.give_up(final)
        finally:
            await run.end()

    async def _wait(self, failures: int, error: ChefsHatError) -> None:
        """Waits before the next attempt to connect, or raises the error if there is to be none."""
        if not error.retryable or failures > self._backoff.attempts:
            raise error
        await asyncio.sleep(self._backoff.delay_s(failures, self._chance))


class _Run:
    """A session being played: the connection of the moment, and the agents that are thinking."""

    def __init__(self, session: PlaySession) -> None:
        self._session = session
        self._call: PlayCall | None = None
        # gRPC takes one message at a time.
        self._writing = asyncio.Lock()
        self._thinking: set[asyncio.Task[None]] = set()
        self._failure: BaseException | None = None

    async def connection(self, call: PlayCall) -> ChefsHatError:
        """Plays over one connection until it is lost or the session is done. Returns why it was lost."""
        session = self._session
        session.connected()
        self._call = call
        try:
            await self._flush(call)
            while not session.done:
                response = await call.read()
                if not isinstance(response, pb.PlayResponse):
                    return connection_lost()
                for ask in session.receive(response):
                    self._decide(ask)
                await self._flush(call)
            await _part(call)
        except grpc.RpcError as error:
            return from_rpc_error(error)
        except asyncio.InvalidStateError:
            return connection_lost()  # The call ended before this side could write to it.
        except asyncio.CancelledError:
            # Cancelling the call (below, for an agent's failure) and cancelling the caller's task look the same from here.
            if self._failure is not None:
                raise self._failure from None
            raise
        finally:
            self._call = None
            call.cancel()
        return connection_lost()

    async def end(self) -> None:
        """Ends whatever agents are still thinking."""
        thinking = list(self._thinking)
        for task in thinking:
            task.cancel()
        await asyncio.gather(*thinking, return_exceptions=True)

    def _decide(self, ask: Ask) -> None:
        """Has the agent decide: at once, or in a task if it takes its time."""
        action = ask.place.agent.decide(ask.decision)
        if type(action) is int or not isinstance(action, Awaitable):
            self._session.answer(ask, action)
            return
        task = asyncio.ensure_future(self._think(ask, action))
        self._thinking.add(task)
        task.add_done_callback(self._thinking.discard)

    async def _think(self, ask: Ask, action: Awaitable[int]) -> None:
        """Waits for an agent's answer and sends it over the connection there is by then."""
        try:
            self._session.answer(ask, await action)
        except Exception as failure:
            self._failure = failure
            if self._call is not None:
                self._call.cancel()
            return
        call = self._call
        if call is None:
            return  # The answer goes out when the seat is attached again.
        try:
            await self._flush(call)
        except (grpc.RpcError, asyncio.InvalidStateError, asyncio.CancelledError):
            # Whoever reads the call sees its end too; the answer is repeated on the next connection.
            if self._call is call:
                call.cancel()

    async def _flush(self, call: PlayCall) -> None:
        """Sends what the session has to say."""
        async with self._writing:
            if call is not self._call:
                return  # The answers of a lost connection are the session's to repeat.
            for request in self._session.take_requests():
                await call.write(request)


async def _part(call: PlayCall) -> None:
    """Half-closes the stream and gives the server the time to end it. What it still says is of no interest."""
    try:
        async with asyncio.timeout(FAREWELL_S):
            await call.done_writing()
            while isinstance(await call.read(), pb.PlayResponse):
                pass
    except TimeoutError:
        return  # The caller cancels the call.
