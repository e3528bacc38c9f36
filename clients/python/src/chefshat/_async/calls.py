"""The calls of a client: rooms, records, spectating, tournaments, and the entry points for playing.

The asyncio form in `_async` is the source; `tools/generate.py` generates the blocking form in `_sync` from it. How a stream of
decisions is played differs between the two and is in `chefshat.aio` and `chefshat.client`.
"""

import asyncio
import random
import secrets
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from typing import Self

from chefshat import pb, requests
from chefshat._gen.chefshat.v1.analysis_service_pb2_grpc import AnalysisServiceStub
from chefshat._gen.chefshat.v1.instrument_service_pb2_grpc import InstrumentServiceStub
from chefshat._gen.chefshat.v1.play_service_pb2_grpc import PlayServiceStub
from chefshat._gen.chefshat.v1.record_service_pb2_grpc import RecordServiceStub
from chefshat._gen.chefshat.v1.room_service_pb2_grpc import RoomServiceStub
from chefshat._gen.chefshat.v1.server_service_pb2_grpc import ServerServiceStub
from chefshat._gen.chefshat.v1.spectator_service_pb2_grpc import SpectatorServiceStub
from chefshat._gen.chefshat.v1.study_service_pb2_grpc import StudyServiceStub
from chefshat._gen.chefshat.v1.table_service_pb2_grpc import TableServiceStub
from chefshat._gen.chefshat.v1.tournament_service_pb2_grpc import TournamentServiceStub
from chefshat.address import ServerAddress, server_address
from chefshat.agents import Agent
from chefshat.backoff import Backoff
from chefshat.channels import TIMEOUT_S, async_channel
from chefshat.clock import READINGS, TIME_OF_DAY, ClockReading, LocalClock
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.network import grpc
from chefshat.participant import MakeAgent, OnEntered
from chefshat.requests import async_pages, async_streamed, awaited
from chefshat.result import SeatResult
from chefshat.session import PlayOptions, PlaySession

# The final states of a tournament.
OVER = (pb.TOURNAMENT_STATE_FINISHED, pb.TOURNAMENT_STATE_CLOSED)


class AsyncCalls(ABC):
    """A connection to a server, opened on first use. Close it, or use it as a context manager.

    Every method raises `ChefsHatError`: with the server's reason if the server refuses, with "UNAVAILABLE" if it cannot be reached.
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
        #: The address of the server, without what it requires.
        self.address = server.address
        self._channel = async_channel(server, timeout=timeout)
        self._backoff = backoff or Backoff()
        self._rng = random.Random()
        self._rooms = RoomServiceStub(self._channel)
        self._play = PlayServiceStub(self._channel)
        self._server = ServerServiceStub(self._channel)
        self._records = RecordServiceStub(self._channel)
        self._spectators = SpectatorServiceStub(self._channel)
        self._table = TableServiceStub(self._channel)
        self._instruments = InstrumentServiceStub(self._channel)
        self._studies = StudyServiceStub(self._channel)
        self._tournaments = TournamentServiceStub(self._channel)
        self._analysis = AnalysisServiceStub(self._channel)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def close(self) -> None:
        """Closes the connection. Calls still in progress fail."""
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
        visibility: pb.Visibility.ValueType | None = None,
        physical: bool = False,
    ) -> pb.CreateRoomResponse:
        """Creates a room.

        Args:
            name: display name.
            rules: the rule set or the name of a preset; None: the default rules.
            seats: how each seat is filled, index = seat; empty: all seats are open. See `SeatSpec`.
            policy: times and limits; unset fields take their defaults.
            game_seed: 32 bytes that fix all deals, for experiments; empty: the server draws them.
            branch: the point of a recorded game to continue from, under the rules of that game (leave out `rules`).
            hands: the hands of the first Shift, instead of a deal.
            durability: what the game survives, overriding the policy; default: a restart of the server.
            visibility: who sees the room and its record, overriding the policy; default: everybody. See `secrets` of the client.
            physical: the cards are real: nothing is dealt, and what happens at the table is reported (`report`).

        Returns:
            The room, its join code, the token that closes it and, if it is physical, the ticket of its table.
        """
        request = requests.create_room(name, rules, seats, policy, game_seed, branch, hands, durability, visibility, physical)
        return await awaited(self._rooms.CreateRoom, request)

    async def join_room(
        self,
        join_code: str,
        name: str,
        *,
        room_id: str = "",
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_AGENT,
        seat: int | None = None,
        name_key: bytes = b"",
    ) -> pb.JoinRoomResponse:
        """Takes `seat`, or the first free seat that admits `kind`. Returns the room, the seat and its ticket.

        `name_key` is empty, or 32 secret bytes that tell this name from the same name of others in ratings.
        """
        request = pb.JoinRoomRequest(room_id=room_id, join_code=join_code, name=name, kind=kind, seat=seat, name_key=name_key)
        return await awaited(self._rooms.JoinRoom, request)

    async def get_room(self, room_id: str = "", *, join_code: str = "") -> pb.Room:
        """Returns the public view of a room, by its id or its join code."""
        return (await awaited(self._rooms.GetRoom, pb.GetRoomRequest(room_id=room_id, join_code=join_code))).room

    def list_rooms(self, state: pb.RoomState.ValueType = pb.ROOM_STATE_UNSPECIFIED) -> AsyncIterator[pb.Room]:
        """Iterates over the server's rooms, newest first, optionally only those in one state. Fetches pages on demand."""
        return async_pages(self._rooms.ListRooms, pb.ListRoomsRequest(state=state), lambda page: page.rooms)

    async def leave_room(self, ticket: str) -> pb.Room:
        """Gives up a seat before the game begins. The seat becomes free and the ticket invalid."""
        return (await awaited(self._rooms.LeaveRoom, pb.LeaveRoomRequest(ticket=ticket))).room

    async def close_room(self, room_id: str, owner_token: str) -> pb.Room:
        """Closes a room with its creator's token. A running game is aborted."""
        request = pb.CloseRoomRequest(room_id=room_id, owner_token=owner_token)
        return (await awaited(self._rooms.CloseRoom, request)).room

    async def server_info(self) -> pb.GetServerInfoResponse:
        """Returns the server's version, limits, presets and built-in agents."""
        return await awaited(self._server.GetServerInfo, pb.GetServerInfoRequest())

    async def action_table(self, faces: int = 0) -> pb.GetActionTableResponse:
        """Returns the text of every action for decks of `faces` faces (0: the default, 11)."""
        return await awaited(self._server.GetActionTable, pb.GetActionTableRequest(faces=faces))

    async def clock(self, room_id: str = "", *, local: LocalClock = TIME_OF_DAY, readings: int = READINGS) -> ClockReading:
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

    def records(self, wanted: pb.RecordFilter | None = None, *, newest_first: bool = False) -> AsyncIterator[pb.RecordSummary]:
        """Iterates over the server's records that match a filter, oldest first by default. Fetches pages on demand."""
        request = pb.ListRecordsRequest(filter=wanted, newest_first=newest_first)
        return async_pages(self._records.ListRecords, request, lambda page: page.records)

    async def record(self, game_id: str) -> AsyncIterator[pb.RecordLine]:
        """Iterates over the lines of a finished game's record."""
        async for response in async_streamed(self._records.GetRecord, pb.GetRecordRequest(game_id=game_id)):
            for line in response.lines:
                yield line

    async def evaluate(self, request: pb.EvaluateRequest) -> AsyncIterator[pb.EvaluateResponse]:
        """Iterates over estimates of the actions of a decision, each from more rollouts than the one before.

        Args:
            request: the decision, of a recorded game (`moment`) or as its seat sees it (`situation`: see `Decision.situation`), and
                what the analysis may cost.
        """
        call = self._analysis.Evaluate(request)
        try:
            async for response in call:
                yield response
        except grpc.RpcError as error:
            raise from_rpc_error(error) from error
        finally:
            call.cancel()

    async def watch(self, room_id: str, *, from_sequence: int = 0) -> AsyncIterator[pb.GameEvent]:
        """Iterates over a room's public events until its game is over. Reconnects; each event arrives once and in order.

        Where numbers are missing, the room no longer has these events: of a long game it keeps the last ones alone.

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
                    if response.HasField("snapshot"):
                        last = max(last, response.snapshot.next_sequence - 1)
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

    async def add_marker(self, room_id: str, owner_token: str, label: str, *, elapsed_us: int | None = None) -> pb.Marker:
        """Puts a marker into the record of a room. Nobody but the owner of the room learns of it.

        Args:
            room_id: the room.
            owner_token: its creator's token, or that of the study whose game it is.
            label: what the marker says, 1..=128 characters.
            elapsed_us: the marked moment on the room's clock, microseconds since the room was created (see `clock`); None: when the
                server reads the request.
        """
        request = pb.AddMarkerRequest(room_id=room_id, owner_token=owner_token, label=label, elapsed_us=elapsed_us)
        return (await awaited(self._instruments.AddMarker, request)).marker

    async def follow_markers(self, room_id: str, owner_token: str, *, from_number: int = 0) -> AsyncIterator[pb.Marker]:
        """Iterates over the markers of a room until its game is over. Reconnects; each marker arrives once and in order.

        Args:
            room_id: the room.
            owner_token: its creator's token.
            from_number: number of the first marker wanted; 0: all.
        """
        last = max(from_number - 1, 0)
        failures = 0
        while True:
            request = pb.FollowMarkersRequest(room_id=room_id, owner_token=owner_token, from_number=last + 1)
            call = self._instruments.FollowMarkers(request)
            try:
                async for response in call:
                    failures = 0
                    for marker in response.markers:
                        last = marker.number
                        yield marker
                return
            except grpc.RpcError as error:
                failures += 1
                await self._wait(failures, from_rpc_error(error))
            finally:
                call.cancel()

    async def add_samples(self, ticket: str | pb.OwnedSeat, chunk: pb.SampleChunk) -> int:
        """Records samples of a seat beside its game. See `chefshat.samples.SampleStream`.

        Args:
            ticket: the ticket of the seat, or for the owner of a room or study the seat itself.
            chunk: the samples.

        Returns:
            How many were new. Samples that are not later than the last one of their stream are ignored.
        """
        if isinstance(ticket, pb.OwnedSeat):
            request = pb.AddSamplesRequest(owned_seat=ticket, chunk=chunk)
        else:
            request = pb.AddSamplesRequest(ticket=ticket, chunk=chunk)
        return (await awaited(self._instruments.AddSamples, request)).recorded

    async def follow_study(self, study_id: str, owner_token: str) -> AsyncIterator[pb.StudyParticipant]:
        """Iterates over the participants of a study, then over each one that changes, until the study is over. Reconnects.

        Args:
            study_id: the study.
            owner_token: its owner's token.
        """
        failures = 0
        while True:
            call = self._studies.FollowStudy(pb.FollowStudyRequest(study_id=study_id, owner_token=owner_token))
            try:
                async for response in call:
                    failures = 0
                    for participant in response.participants:
                        yield participant
                return
            except grpc.RpcError as error:
                failures += 1
                await self._wait(failures, from_rpc_error(error))
            finally:
                call.cancel()

    async def report(self, table_ticket: str, report: pb.TableReport, *, report_id: str = "") -> pb.ReportResponse:
        """Reports something that happened at a physical table.

        Args:
            table_ticket: the ticket of the table, from `create_room`.
            report: what happened.
            report_id: identifies the report, 1..=64 characters, so that it can be repeated safely; empty: a random one.

        Returns:
            The verdict of the referee, and the state of the table afterwards. A report that the rules or the cards do not allow is
            no error: see `verdict` and `detail`. Repeats the report while the server cannot be reached.
        """
        request = pb.ReportRequest(table_ticket=table_ticket, report_id=report_id or secrets.token_hex(16), report=report)
        failures = 0
        while True:
            try:
                return await awaited(self._table.Report, request)
            except ChefsHatError as error:
                failures += 1
                await self._wait(failures, error)

    async def watch_table(self, table_ticket: str) -> AsyncIterator[pb.TableState]:
        """Iterates over the state of a physical table: now, and after every change, until its game is over. Reconnects.

        Args:
            table_ticket: the ticket of the table, from `create_room`.
        """
        failures = 0
        while True:
            call = self._table.Watch(pb.TableServiceWatchRequest(table_ticket=table_ticket))
            error = connection_lost("the server ended the stream before the game was over")
            try:
                async for response in call:
                    failures = 0
                    if not response.HasField("state"):
                        continue  # A heartbeat.
                    yield response.state
                    if response.state.stage == pb.TABLE_STAGE_OVER:
                        return
            except grpc.RpcError as failure:
                error = from_rpc_error(failure)
            finally:
                call.cancel()
            failures += 1
            await self._wait(failures, error)

    async def create_tournament(
        self, settings: pb.TournamentSettings, *, visibility: pb.Visibility.ValueType | None = None
    ) -> pb.CreateTournamentResponse:
        """Creates a tournament.

        Args:
            settings: a name and a format are required; other unset fields take their defaults.
            visibility: who sees the tournament and its games, overriding the policy; default: everybody.

        Returns:
            The tournament, its join code, and the token that starts and closes it.
        """
        request = requests.create_tournament(settings, visibility)
        return await awaited(self._tournaments.CreateTournament, request)

    async def join_tournament(
        self,
        join_code: str,
        name: str,
        *,
        tournament_id: str = "",
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_AGENT,
        max_games: int = 1,
        stateless: bool = False,
        name_key: bytes = b"",
    ) -> pb.JoinTournamentResponse:
        """Joins a tournament. The join code identifies it.

        Args:
            join_code: the tournament's join code.
            name: display name, 1..=64 characters, unique among the participants.
            tournament_id: if given, the join code must belong to this tournament.
            kind: kind of the participant.
            max_games: games it can play at a time, 1..=64.
            stateless: declares that it remembers nothing from one game to the next.
            name_key: empty, or 32 secret bytes that tell this name from the same name of others in ratings.

        Returns:
            The tournament, the participant's number in it, and the ticket to play with.
        """
        request = requests.join_tournament(join_code, name, tournament_id, kind, max_games, stateless, name_key)
        return await awaited(self._tournaments.JoinTournament, request)

    async def add_table_participant(
        self,
        tournament_id: str,
        owner_token: str,
        name: str,
        *,
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_HUMAN,
    ) -> pb.AddTableParticipantResponse:
        """Adds a participant who plays at a physical table with real cards. Nobody connects for it.

        Args:
            tournament_id: a tournament with physical tables that has not started.
            owner_token: its creator's token.
            name: display name, 1..=64 characters, unique among the participants.
            kind: kind of the participant.

        Returns:
            The tournament, and the participant's number in it.
        """
        request = pb.AddTableParticipantRequest(tournament_id=tournament_id, owner_token=owner_token, name=name, kind=kind)
        return await awaited(self._tournaments.AddTableParticipant, request)

    async def physical_table(self, tournament_id: str, owner_token: str, game: int) -> pb.GetPhysicalTableResponse:
        """Returns the secrets of the physical table at which a game is being played.

        Args:
            tournament_id: the tournament.
            owner_token: its creator's token.
            game: number of the game in the tournament.

        Returns:
            The room, the ticket for :meth:`report` and :meth:`watch_table`, and the token that closes the room.
        """
        request = pb.GetPhysicalTableRequest(tournament_id=tournament_id, owner_token=owner_token, game=game)
        return await awaited(self._tournaments.GetPhysicalTable, request)

    async def start_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Starts a tournament with its creator's token."""
        request = pb.StartTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (await awaited(self._tournaments.StartTournament, request)).tournament

    async def close_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Closes a tournament with its creator's token. Running games are aborted; counted results remain."""
        request = pb.CloseTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (await awaited(self._tournaments.CloseTournament, request)).tournament

    async def pause_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Pauses a tournament: no game is called until it is resumed. Games in progress continue."""
        request = pb.PauseTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (await awaited(self._tournaments.PauseTournament, request)).tournament

    async def resume_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Resumes a paused tournament."""
        request = pb.ResumeTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (await awaited(self._tournaments.ResumeTournament, request)).tournament

    async def withdraw_participant(
        self, tournament_id: str, *, ticket: str = "", owner_token: str = "", participant: int = 0
    ) -> pb.Tournament:
        """Withdraws a participant: the one with `ticket`, or with `owner_token` the one with this number.

        Before the start its place is free again. After that a substitute plays its games in progress, and it forfeits the others.
        """
        request = pb.WithdrawParticipantRequest(
            tournament_id=tournament_id, ticket=ticket, owner_token=owner_token, participant=participant
        )
        return (await awaited(self._tournaments.WithdrawParticipant, request)).tournament

    async def remove_participant(self, tournament_id: str, owner_token: str, participant: int) -> pb.Tournament:
        """Removes a participant: it is withdrawn, and its ticket ends."""
        request = pb.RemoveParticipantRequest(tournament_id=tournament_id, owner_token=owner_token, participant=participant)
        return (await awaited(self._tournaments.RemoveParticipant, request)).tournament

    async def replace_participant(
        self,
        tournament_id: str,
        owner_token: str,
        participant: int,
        *,
        built_in_agent: str = "",
        name: str = "",
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_UNSPECIFIED,
        max_games: int = 1,
        stateless: bool = False,
    ) -> pb.ReplaceParticipantResponse:
        """Gives the place of a participant, with its results, to a built-in agent or to somebody else.

        Args:
            tournament_id: a tournament that is not over.
            owner_token: its creator's token.
            participant: number of the participant.
            built_in_agent: the agent that takes the place; empty: somebody else does.
            name: display name of the new participant; a built-in agent needs none.
            kind: kind of the new participant; by default that of the former one.
            max_games: number of games that it can play at a time.
            stateless: whether it remembers nothing between games.

        Returns:
            The tournament, and the ticket of somebody else, to be passed on.
        """
        request = pb.ReplaceParticipantRequest(
            tournament_id=tournament_id,
            owner_token=owner_token,
            participant=participant,
            built_in_agent=built_in_agent,
            name=name,
            kind=kind,
            max_games=max_games,
            stateless=stateless,
        )
        return await awaited(self._tournaments.ReplaceParticipant, request)

    async def postpone_game(self, tournament_id: str, game: int, *, ticket: str = "", owner_token: str = "") -> pb.TournamentGame:
        """Moves a game that is not in progress to the end of the queue, with a ticket of it or the owner token."""
        request = pb.PostponeGameRequest(tournament_id=tournament_id, ticket=ticket, owner_token=owner_token, game=game)
        return (await awaited(self._tournaments.PostponeGame, request)).game

    async def call_game(self, tournament_id: str, owner_token: str, game: int) -> pb.TournamentGame:
        """Calls a due or void game before all others, with as many calls as at first."""
        request = pb.CallGameRequest(tournament_id=tournament_id, owner_token=owner_token, game=game)
        return (await awaited(self._tournaments.CallGame, request)).game

    async def get_tournament(self, tournament_id: str) -> pb.Tournament:
        """Returns the public view of a tournament."""
        request = pb.GetTournamentRequest(tournament_id=tournament_id)
        return (await awaited(self._tournaments.GetTournament, request)).tournament

    def list_tournaments(
        self, state: pb.TournamentState.ValueType = pb.TOURNAMENT_STATE_UNSPECIFIED
    ) -> AsyncIterator[pb.Tournament]:
        """Iterates over the server's tournaments, newest first, without participants, optionally only those in one state.

        Fetches pages on demand.
        """
        request = pb.ListTournamentsRequest(state=state)
        return async_pages(self._tournaments.ListTournaments, request, lambda page: page.tournaments)

    async def follow_tournament(self, tournament_id: str) -> AsyncIterator[pb.FollowTournamentResponse]:
        """Iterates over the state of a tournament: now, and after every change, until it is over. Reconnects."""
        failures = 0
        while True:
            call = self._tournaments.FollowTournament(pb.FollowTournamentRequest(tournament_id=tournament_id))
            error = connection_lost("the server ended the stream before the tournament was over")
            try:
                async for report in call:
                    failures = 0
                    if not report.HasField("tournament"):
                        continue  # A heartbeat.
                    yield report
                    if report.tournament.state in OVER:
                        return
            except grpc.RpcError as failure:
                error = from_rpc_error(failure)
            finally:
                call.cancel()
            failures += 1
            await self._wait(failures, error)

    async def tournament_results(self, tournament_id: str) -> pb.GetTournamentResultsResponse:
        """Returns standings, ratings and the certainty of the order; final once the tournament is over."""
        request = pb.GetTournamentResultsRequest(tournament_id=tournament_id)
        return await awaited(self._tournaments.GetTournamentResults, request)

    def tournament_games(self, tournament_id: str) -> AsyncIterator[pb.TournamentGame]:
        """Iterates over the games of a tournament, in order. Fetches pages on demand."""
        request = pb.ListTournamentGamesRequest(tournament_id=tournament_id)
        return async_pages(self._tournaments.ListTournamentGames, request, lambda page: page.games)

    async def leaderboard(
        self,
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_UNSPECIFIED,
        *,
        min_games: int = 0,
        limit: int = 0,
    ) -> pb.GetLeaderboardResponse:
        """Returns the ratings of all players of rated games on the server, best first.

        Args:
            kind: only participants of this kind.
            min_games: only participants with at least this many rated games.
            limit: maximum number of entries, 1..=1000; 0: the server's default.
        """
        request = pb.GetLeaderboardRequest(kind=kind, min_games=min_games, limit=limit)
        return await awaited(self._tournaments.GetLeaderboard, request)

    async def express(self, ticket: str, expression: pb.Expression) -> None:
        """Sends an expression of affect for the seat of the ticket. Allowed at any time."""
        await awaited(self._play.Act, pb.ActRequest(ticket=ticket, express=expression))

    async def resume_seat(self, ticket: str) -> None:
        """Takes the seat back from its substitute."""
        await awaited(self._play.Act, pb.ActRequest(ticket=ticket, resume=pb.ResumeSeat()))

    async def hint(self, ticket: str, decision_id: int) -> pb.Hint:
        """Asks for a hint for the open decision of the ticket's seat, where the room's policy allows hints.

        It takes about half a second of the seat's time, and the record says that it was given. Raises an error with the reason
        HINTS_OFF, DECISION_CLOSED or TOO_MANY_HINTS.
        """
        request = pb.ActRequest(ticket=ticket, hint=pb.AskHint(decision_id=decision_id))
        return (await awaited(self._play.Act, request)).hint

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
            ticket: the participant's, from `join_tournament`. With the ticket of a seat, only that seat's game is played.
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

    @abstractmethod
    async def _play_session(self, session: PlaySession) -> None:
        """Plays until the session is done, reconnecting as needed."""

    async def _wait(self, failures: int, error: ChefsHatError) -> None:
        """Waits before the next connection attempt. Raises the error if there is to be none."""
        if not error.retryable or failures > self._backoff.attempts:
            raise error
        await asyncio.sleep(self._backoff.delay_s(failures, self._rng))
