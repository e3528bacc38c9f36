"""The blocking client: rooms, records and spectating as plain calls and iterators, and the loop that plays agents' games.

The protocol of playing is not here but in `session`; here are the connection, its loss, and the threads.
"""

import random
import threading
import time
from collections import deque
from collections.abc import Awaitable, Coroutine, Iterator, Mapping, Sequence
from typing import Self, TypeAlias

import grpc

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
from chefshat.requests import called
from chefshat.result import SeatResult
from chefshat.session import PlayOptions, PlaySession
from chefshat.tournaments import TournamentCalls

# Seconds an answer waits for those of the stream's other seats before it is sent.
FLUSH_AFTER_S = 0.002
# Seconds the server has to end a stream whose seats are all done.
FAREWELL_S = 1.0

# The name exists in grpc's type stubs alone.
PlayCall: TypeAlias = "grpc._CallIterator[pb.PlayResponse]"


class Client(TournamentCalls):
    """A connection to a server, made when first needed. Close it, or use it as a context manager. Threads may share it.

    Every method raises `ChefsHatError` with the server's reason when the server refuses, or "UNAVAILABLE" when there is none.
    """

    def __init__(self, address: str, *, backoff: Backoff | None = None) -> None:
        """Names the server.

        Args:
            address: "host:port", "http://host:port" or, for TLS, "https://host:port".
            backoff: the waits between attempts to connect while playing or watching.
        """
        self._channel = requests.channel(address)
        self._backoff = backoff or Backoff()
        self._chance = random.Random()
        self._rooms = RoomServiceStub(self._channel)
        self._play = PlayServiceStub(self._channel)
        self._server = ServerServiceStub(self._channel)
        self._records = RecordServiceStub(self._channel)
        self._spectators = SpectatorServiceStub(self._channel)
        self._tournaments = TournamentServiceStub(self._channel)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connection; whatever still runs on it fails."""
        self._channel.close()

    def create_room(
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
        """Makes a room.

        Args:
            name: name to show.
            rules: the rule set, or the name of a preset; the standard rules if None.
            seats: how each seat is filled, index = seat; all open if empty. See `SeatSpec`.
            policy: times, limits and manners; standard where unset.
            game_seed: 32 bytes that fix all deals, for experiments; the server draws them if empty.
            branch: the point of a recorded game from which this one goes on, by its rules (leave `rules` out).
            hands: the hands to begin with instead of a deal.
            durability: what the game outlives, in place of what the policy says; standard: the server.

        Returns:
            The room, its join code, and the token that closes it.
        """
        request = requests.create_room(name, rules, seats, policy, game_seed, branch, hands, durability)
        return called(lambda: self._rooms.CreateRoom(request))

    def join_room(
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
        return called(lambda: self._rooms.JoinRoom(request))

    def get_room(self, room_id: str) -> pb.Room:
        """The room as everybody sees it."""
        return called(lambda: self._rooms.GetRoom(pb.GetRoomRequest(room_id=room_id))).room

    def list_rooms(self, state: pb.RoomState.ValueType = pb.ROOM_STATE_UNSPECIFIED) -> Iterator[pb.Room]:
        """The server's rooms, newest first; those in one state alone if it is given. Pages are fetched as they are needed."""
        token = ""
        while True:
            page = self._rooms_page(pb.ListRoomsRequest(state=state, page_token=token))
            yield from page.rooms
            token = page.next_page_token
            if not token:
                return

    def _rooms_page(self, request: pb.ListRoomsRequest) -> pb.ListRoomsResponse:
        return called(lambda: self._rooms.ListRooms(request))

    def leave_room(self, ticket: str) -> pb.Room:
        """Gives back a seat before the game begins: others can take it, and its ticket opens nothing any more."""
        return called(lambda: self._rooms.LeaveRoom(pb.LeaveRoomRequest(ticket=ticket))).room

    def close_room(self, room_id: str, owner_token: str) -> pb.Room:
        """Closes a room with the token its creator got; a running game is aborted."""
        request = pb.CloseRoomRequest(room_id=room_id, owner_token=owner_token)
        return called(lambda: self._rooms.CloseRoom(request)).room

    def server_info(self) -> pb.GetServerInfoResponse:
        """Version, limits, presets and built-in agents of the server."""
        return called(lambda: self._server.GetServerInfo(pb.GetServerInfoRequest()))

    def action_table(self, faces: int = 0) -> pb.GetActionTableResponse:
        """The text of every action for decks of so many faces (0: the standard 11)."""
        return called(lambda: self._server.GetActionTable(pb.GetActionTableRequest(faces=faces)))

    def records(self, wanted: pb.RecordFilter | None = None, *, newest_first: bool = False) -> Iterator[pb.RecordSummary]:
        """The records the server holds, oldest first unless asked otherwise; those a filter lets through if one is given.

        Pages are fetched as they are needed.
        """
        token = ""
        while True:
            request = pb.ListRecordsRequest(filter=wanted, page_token=token, newest_first=newest_first)
            page = self._records_page(request)
            yield from page.records
            token = page.next_page_token
            if not token:
                return

    def _records_page(self, request: pb.ListRecordsRequest) -> pb.ListRecordsResponse:
        return called(lambda: self._records.ListRecords(request))

    def record(self, game_id: str) -> Iterator[pb.RecordLine]:
        """The record of a game that has ended, line by line."""
        call = self._records.GetRecord(pb.GetRecordRequest(game_id=game_id))
        try:
            for response in call:
                yield from response.lines
        except grpc.RpcError as error:
            raise from_rpc_error(error) from error
        finally:
            call.cancel()

    def watch(self, room_id: str, *, from_sequence: int = 0) -> Iterator[pb.GameEvent]:
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
                for response in call:
                    for event in response.events:
                        last = event.sequence
                        failures = 0
                        yield event
                return
            except grpc.RpcError as error:
                failures += 1
                self._wait(failures, from_rpc_error(error))
            finally:
                call.cancel()

    def express(self, ticket: str, expression: pb.Expression) -> None:
        """Expresses something for the seat of the ticket, at any time and from any thread."""
        called(lambda: self._play.Act(pb.ActRequest(ticket=ticket, express=expression)))

    def resume_seat(self, ticket: str) -> None:
        """Says that the seat's agent plays itself again after a substitute has."""
        called(lambda: self._play.Act(pb.ActRequest(ticket=ticket, resume=pb.ResumeSeat())))

    def play(self, agent: Agent, ticket: str, *, options: PlayOptions | None = None) -> SeatResult:
        """Plays one seat until its game is over. Raises the seat's error if it leaves before that."""
        result = self.play_many({ticket: agent}, options=options)[ticket]
        result.raise_for_error()
        return result

    def play_many(self, agents: Mapping[str, Agent], *, options: PlayOptions | None = None) -> dict[str, SeatResult]:
        """Plays several seats, of any rooms, over one stream until all their games are over.

        A lost connection is made again, and the seats resume where they were. Agents decide one after the other, in a
        thread of the stream's; what they raise is raised here. A seat that cannot go on has its `error` set in its result; the
        others play on.

        Args:
            agents: the agent for each ticket.
            options: how the seats attach.

        Returns:
            The result of each ticket.
        """
        session = PlaySession(agents, options)
        self._play_session(session)
        return session.results()

    def play_tournament(
        self, ticket: str, make_agent: MakeAgent, *, options: PlayOptions | None = None, on_entered: OnEntered | None = None
    ) -> list[SeatResult]:
        """Takes part in a tournament until it is over, in as many games at a time as the participant said it can play.

        The server seats the participant in its games; all are played over one stream. A lost connection is made again, and the
        agents go on with their games. They decide one after the other, as in `play_many`.

        Args:
            ticket: the participant's, from `join_tournament`. With that of a seat, this seat's game alone is played.
            make_agent: called with the seat for every game the participant is seated in; gives the game's agent.
            options: how the seats attach.
            on_entered: told of the tournament and the participant's number, on each connection; not where the ticket is a seat's.

        Returns:
            What came of each game, in the order in which the participant was seated. One that was aborted, or that could not be
            played to its end here (`error`), is among them; the server counts it as it ended, or calls it again.

        Raises:
            ChefsHatError: the ticket was refused, a newer connection takes part in this one's place ("SUPERSEDED"), or the server
                stayed unreachable. What had come of games by then their agents were told (`on_game_over`).
        """
        session = PlaySession.of_participant(ticket, make_agent, options, on_entered)
        self._play_session(session)
        return session.played()

    def _play_session(self, session: PlaySession) -> None:
        """Plays until the session is done, over as many connections as it takes."""
        failures = 0
        while not session.done:
            before = session.progress
            error = self._play_connection(session)
            if error is None:
                break
            failures = 1 if session.progress > before else failures + 1
            try:
                self._wait(failures, error)
            except ChefsHatError as final:
                session.give_up(final)

    def _wait(self, failures: int, error: ChefsHatError) -> None:
        """Waits before the next attempt to connect, or raises the error if there is to be none."""
        if not error.retryable or failures > self._backoff.attempts:
            raise error
        time.sleep(self._backoff.delay_s(failures, self._chance))

    def _play_connection(self, session: PlaySession) -> ChefsHatError | None:
        """Plays over one connection. Returns why it was lost, or None if the session is done."""
        session.connected()
        pump = _Pump(session)
        with pump.busy:
            # The stream's thread may ask the pump for its second request before `Play` has returned.
            pump.call = call = self._play.Play(pump)
        try:
            if not call.add_callback(pump.stopped.set):
                pump.stopped.set()
            pump.stopped.wait()
        except BaseException:
            call.cancel()
            raise
        # An agent that is still thinking finishes first: nobody else may touch the session until then.
        with pump.busy:
            pump.closed = True
            session.lost(pump.asks)
        failure = pump.failure
        if failure is not None and not isinstance(failure, grpc.RpcError):
            call.cancel()
            raise failure
        if session.done:
            _part(call)
            return None
        # The call ends without this side having noticed where an agent was thinking meanwhile; its status tells why all the same.
        call.cancel()
        if failure is None and isinstance(call, grpc.RpcError) and call.code() is not grpc.StatusCode.OK:
            failure = call
        return connection_lost() if failure is None else from_rpc_error(failure)


class _Pump(Iterator[pb.PlayRequest]):
    """The stream's requests, made while the stream asks for them.

    gRPC takes a stream's requests from an iterator, in a thread of its own. This iterator reads the responses in that same thread
    and lets the agents decide there. Compared with a queue between two threads that saves a change of threads for every decision.
    """

    def __init__(self, session: PlaySession) -> None:
        self.call: PlayCall
        #: Held while the session is in use.
        self.busy = threading.Lock()
        #: Set when nothing more will come: the session is done, something failed, or the call has ended.
        self.stopped = threading.Event()
        #: Makes the iterator end; set under `busy`.
        self.closed = False
        #: What the call or an agent raised.
        self.failure: BaseException | None = None
        self._session = session
        self._ready = deque(session.take_requests())
        #: Decisions that no agent has been asked for yet.
        self.asks: deque[Ask] = deque()

    def __next__(self) -> pb.PlayRequest:
        with self.busy:
            if not self.closed:
                try:
                    request = self._next_request()
                except BaseException as failure:  # Raised again by whoever runs the session.
                    self.failure = failure
                else:
                    if request is not None:
                        return request
            self.closed = True
            self.stopped.set()
            raise StopIteration

    def _next_request(self) -> pb.PlayRequest | None:
        """The next request; None when there is none because the session is done or the call has ended without an error."""
        session = self._session
        while not self._ready:
            if self.asks:
                self._decide()
            elif session.done:
                return None
            else:
                response = next(self.call, None)
                if response is None:
                    return None
                self.asks.extend(session.receive(response))
                if self.asks:
                    self._decide()
            self._ready.extend(session.take_requests())
        return self._ready.popleft()

    def _decide(self) -> None:
        """Has decisions made until there are none, or until the first answer has waited for long enough."""
        asks = self.asks
        until = time.monotonic() + FLUSH_AFTER_S
        while asks:
            ask = asks.popleft()
            action = ask.place.agent.decide(ask.decision)
            if type(action) is not int and isinstance(action, Awaitable):
                if isinstance(action, Coroutine):
                    action.close()  # Or Python warns that nobody awaited it.
                raise TypeError("an agent with an async `decide` plays under chefshat.aio")
            self._session.answer(ask, action)
            if time.monotonic() > until:
                return


def _part(call: "PlayCall") -> None:
    """Gives the server the time to end a stream that this side has half-closed. What it still says is of no interest."""
    limit = threading.Timer(FAREWELL_S, call.cancel)
    limit.start()
    try:
        # Without reading, the end of the stream would never be seen behind an unread message.
        for _ in call:
            pass
    except grpc.RpcError:
        return  # However the stream ended, the games are over.
    finally:
        limit.cancel()
