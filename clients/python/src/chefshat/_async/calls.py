"""The calls of a client: those that play, those about the server or a decision, and the groups of the others.

A group is a file, and has the calls of a service of the protocol, or of several about the same thing. The asyncio form in `_async`
is the source; `tools/generate.py` generates the blocking form in `_sync` from it. How a stream of decisions is played differs
between the two and is in `chefshat.aio` and `chefshat.client`.
"""

from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import Self

from chefshat import pb
from chefshat._async.connection import AsyncConnection
from chefshat._async.records import AsyncRecords
from chefshat._async.rooms import AsyncRooms
from chefshat._async.studies import AsyncStudies
from chefshat._async.tables import AsyncTables
from chefshat._async.tournaments import AsyncTournaments
from chefshat._gen.chefshat.v1.analysis_service_pb2_grpc import AnalysisServiceStub
from chefshat._gen.chefshat.v1.play_service_pb2_grpc import PlayServiceStub
from chefshat._gen.chefshat.v1.server_service_pb2_grpc import ServerServiceStub
from chefshat.address import ServerAddress, server_address
from chefshat.agents import Agent
from chefshat.backoff import Backoff
from chefshat.channels import TIMEOUT_S
from chefshat.clock import READINGS, TIME_OF_DAY, ClockReading, LocalClock
from chefshat.errors import from_rpc_error
from chefshat.network import grpc
from chefshat.participant import MakeAgent, OnEntered
from chefshat.requests import async_received, awaited
from chefshat.result import SeatResult
from chefshat.session import PlayOptions, PlaySession


class AsyncCalls(ABC):
    """A connection to a server, opened on first use. Close it, or use it as a context manager.

    Every method, also of a group, raises `ChefsHatError`: with the server's reason if the server refuses, with "UNAVAILABLE" if it
    cannot be reached.

    Attributes:
        address: the address of the server, without what it requires.
        rooms: creates, joins and watches rooms, and records markers and samples beside their games.
        tournaments: creates, joins, runs and follows tournaments, and reads the leaderboard.
        tables: reports what happens at physical tables, and follows their state.
        records: lists and reads the records of finished games.
        studies: follows studies.
    """

    def __init__(
        self,
        address: str | ServerAddress,
        *,
        token: str | None = None,
        ca: Path | str | None = None,
        secrets: Sequence[str] = (),
        backoff: Backoff | None = None,
        timeout: float | None = TIMEOUT_S,
    ) -> None:
        """Sets the server.

        Args:
            address: "host:port", "http://host:port" or, for TLS, "https://host:port".
            token: sent with every call; None: that of the environment variable CHEFSHAT_TOKEN, if set.
            ca: PEM file of the certificate authorities to trust; None: that of CHEFSHAT_CA, or else the system's.
            secrets: owner tokens and tickets, at most 16, shown with every call: with them private rooms and tournaments can be
                read and watched, lists contain unlisted and private ones, and so do lists of records.
            backoff: delays between connection attempts while playing or watching.
            timeout: seconds that a call with one answer waits for it, then raises "DEADLINE_EXCEEDED"; None: for ever. Playing,
                watching and other streams have no such limit.
        """
        server = server_address(address, token, ca, secrets)
        self.address = server.address
        self._connection = AsyncConnection(server, backoff or Backoff(), timeout)
        self._server = ServerServiceStub(self._connection.channel)
        self._analysis = AnalysisServiceStub(self._connection.channel)
        self._play = PlayServiceStub(self._connection.channel)
        self.rooms = AsyncRooms(self._connection)
        self.tournaments = AsyncTournaments(self._connection)
        self.tables = AsyncTables(self._connection)
        self.records = AsyncRecords(self._connection)
        self.studies = AsyncStudies(self._connection)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Closes the connection. Calls still in progress fail."""
        await self._connection.channel.close()

    async def server_info(self) -> pb.GetServerInfoResponse:
        """Returns the server's version, limits, presets and built-in agents."""
        return await awaited(self._server.GetServerInfo, pb.GetServerInfoRequest())

    async def action_table(self, faces: int = 0) -> pb.GetActionTableResponse:
        """Returns the text of every action for decks of `faces` faces (0: the default, 11)."""
        return await awaited(self._server.GetActionTable, pb.GetActionTableRequest(faces=faces))

    async def read_clock(self, room_id: str = "", *, local: LocalClock = TIME_OF_DAY, readings: int = READINGS) -> ClockReading:
        """Reads the server's clocks several times and returns the reading with the shortest round trip.

        Args:
            room_id: the room whose clock is read, too: the one that measures the times of its events and record. Empty: none.
            local: the clock of this machine to compare with, in seconds; default: the time of day.
            readings: how often the clocks are read.
        """
        best: ClockReading | None = None
        for _ in range(max(readings, 1)):
            sent = local()
            response = await awaited(self._server.GetClock, pb.GetClockRequest(room_id=room_id))
            reading = ClockReading.of(response, sent, local())
            if best is None or reading.round_trip < best.round_trip:
                best = reading
        assert best is not None
        return best

    async def evaluate(self, request: pb.EvaluateRequest) -> AsyncIterator[pb.EvaluateResponse]:
        """Iterates over estimates of the actions of a decision, each from more rollouts than the one before.

        Args:
            request: the decision, of a recorded game (`moment`) or as its seat sees it (`situation`: see `Decision.situation`), and
                what the analysis may cost.
        """
        call = self._analysis.Evaluate(request)
        try:
            async for response in async_received(call):
                yield response
        except grpc.RpcError as error:
            raise from_rpc_error(error) from error
        finally:
            call.cancel()

    async def play(self, agent: Agent, ticket: str, *, options: PlayOptions | None = None) -> SeatResult:
        """Plays one seat until its game is over. Raises the seat's error if the seat is lost before that."""
        result = (await self.play_many({ticket: agent}, options=options))[ticket]
        result.raise_for_error()
        return result

    async def play_many(self, agents: Mapping[str, Agent], *, options: PlayOptions | None = None) -> dict[str, SeatResult]:
        """Plays several seats, of any rooms, over one stream until all their games are over.

        Reconnects after a lost connection, and the seats resume. In the blocking client the agents decide one after another, in a
        thread of the stream; under asyncio, agents whose `decide` is a coroutine decide concurrently and continue during a
        reconnection. Exceptions of agents propagate to the caller. A seat that is lost has its `error` set in its result; the
        others continue.

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
        """Takes part in a tournament until it is over, in up to as many games at a time as declared when joining.

        The server seats the participant in its games; all are played over one stream. Reconnects after a lost connection, and the
        agents resume their games. Agents decide as in `play_many`.

        Args:
            ticket: the participant's, from `tournaments.join`. With the ticket of a seat, only that seat's game is played.
            make_agent: called with the seat of every game the participant is seated in; returns the game's agent.
            options: how the seats attach.
            on_entered: called on each connection with the tournament and the participant's number; not for the ticket of a seat.

        Returns:
            The result of each game, in the order in which the participant was seated. Includes games that were aborted or that
            could not be played to their end here (`error`); the server counts such a game as it ended, or calls it again.

        Raises:
            ChefsHatError: the ticket was refused, a newer connection replaced this one ("SUPERSEDED"), or the server stayed
                unreachable. Agents of games that had ended by then have been notified (`on_game_over`).
        """
        session = PlaySession.of_participant(ticket, make_agent, options, on_entered)
        await self._play_session(session)
        return session.played()

    async def send_expression(self, ticket: str, expression: pb.Expression) -> None:
        """Sends an expression of affect for the seat of the ticket. Allowed at any time."""
        await awaited(self._play.Act, pb.ActRequest(ticket=ticket, express=expression))

    async def get_hint(self, ticket: str, decision_id: int) -> pb.Hint:
        """Asks for a hint for the open decision of the ticket's seat, where the room's policy allows hints.

        It takes about half a second of the seat's time, and the record says that it was given. Raises an error with the reason
        HINTS_OFF, DECISION_CLOSED or TOO_MANY_HINTS.
        """
        request = pb.ActRequest(ticket=ticket, hint=pb.AskHint(decision_id=decision_id))
        return (await awaited(self._play.Act, request)).hint

    async def resume_seat(self, ticket: str) -> None:
        """Takes the seat back from its substitute."""
        await awaited(self._play.Act, pb.ActRequest(ticket=ticket, resume=pb.ResumeSeat()))

    @abstractmethod
    async def _play_session(self, session: PlaySession) -> None:
        """Plays until the session is done, reconnecting as needed."""
