"""Tournaments of the fake server: all participants play in every game, as many games at a time as each of them can play.

It implements only what the package uses, without pairings.
"""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NoReturn

import grpc
from fake_game import SEATS, FakeGame, FakeSeat, Outbox
from refusing import Context, refuse

from chefshat import pb
from chefshat._gen.chefshat.v1 import tournament_service_pb2_grpc as tournament_grpc

# First handle of the seats that the server attaches.
CALLED = 2**31
OWNER = "owner"


@dataclass
class Stream:
    """One Play stream."""

    outbox: Outbox
    # Seats by handle; every Attach has a handle, including refused ones and those of participants.
    seats: dict[int, tuple[FakeGame, FakeSeat]] = field(default_factory=dict)
    attaches: int = 0
    next_called: int = CALLED

    def send(self, handle: int, **update: object) -> None:
        """Sends an update."""
        self.outbox.put(pb.SeatUpdate(handle=handle, **update))  # type: ignore[arg-type]


@dataclass
class Entrant:
    """A participant that joined."""

    ticket: str
    max_games: int
    stream: Stream | None = None
    handle: int = 0


def refuse_change_by_hand(context: Context) -> NoReturn:
    """Ends a call that the fake server does not implement."""
    context.abort(grpc.StatusCode.UNIMPLEMENTED, "the fake server's tournaments are not changed by hand")
    raise AssertionError("abort always raises")


class FakeTournaments(tournament_grpc.TournamentServiceServicer):
    """The service. `make_game` creates the room of a game from its seats."""

    def __init__(self, make_game: Callable[[list[str]], FakeGame]) -> None:
        self._make_game = make_game
        self._lock = threading.RLock()
        self.breaks = False
        # How often a tournament was followed, and whether one that followed it has left.
        self.followed = 0
        self.follower_left = threading.Event()
        self._all: list[FakeTournament] = []
        self.joins: list[pb.JoinTournamentRequest] = []

    def CreateTournament(self, request: pb.CreateTournamentRequest, context: Context) -> pb.CreateTournamentResponse:
        with self._lock:
            made = FakeTournament(len(self._all) + 1, request.settings, self._make_game)
            self._all.append(made)
            return pb.CreateTournamentResponse(tournament=made.shown, join_code=made.join_code, owner_token=OWNER)

    def GetTournament(self, request: pb.GetTournamentRequest, context: Context) -> pb.GetTournamentResponse:
        return pb.GetTournamentResponse(tournament=self._find(request.tournament_id, context).shown)

    def ListTournaments(self, request: pb.ListTournamentsRequest, context: Context) -> pb.ListTournamentsResponse:
        """Pages of two tournaments, newest first."""
        at = int(request.page_token or "0")
        found = [made.shown for made in reversed(self._all) if request.state in (0, made.shown.state)]
        return pb.ListTournamentsResponse(
            tournaments=found[at : at + 2], next_page_token=str(at + 2) if at + 2 < len(found) else ""
        )

    def JoinTournament(self, request: pb.JoinTournamentRequest, context: Context) -> pb.JoinTournamentResponse:
        found = [tournament for tournament in self._all if tournament.join_code == request.join_code]
        if not found:
            refuse(context, grpc.StatusCode.PERMISSION_DENIED, "JOIN_CODE_WRONG", "no tournament has this join code")
        with self._lock:
            self.joins.append(request)
            number, entrant = found[0].join(request)
            return pb.JoinTournamentResponse(tournament=found[0].shown, participant=number, ticket=entrant.ticket)

    def AddTableParticipant(self, request: pb.AddTableParticipantRequest, context: Context) -> pb.AddTableParticipantResponse:
        self._own(request.tournament_id, request.owner_token, context)
        refuse(context, grpc.StatusCode.FAILED_PRECONDITION, "NO_PHYSICAL_TABLES", "this tournament has no physical tables")

    def GetPhysicalTable(self, request: pb.GetPhysicalTableRequest, context: Context) -> pb.GetPhysicalTableResponse:
        self._own(request.tournament_id, request.owner_token, context)
        refuse(context, grpc.StatusCode.FAILED_PRECONDITION, "GAME_NOT_PHYSICAL", "nobody plays this game at a physical table")

    def StartTournament(self, request: pb.StartTournamentRequest, context: Context) -> pb.StartTournamentResponse:
        tournament = self._own(request.tournament_id, request.owner_token, context)
        with self._lock:
            tournament.begin()
        return pb.StartTournamentResponse(tournament=tournament.shown)

    def CloseTournament(self, request: pb.CloseTournamentRequest, context: Context) -> pb.CloseTournamentResponse:
        tournament = self._own(request.tournament_id, request.owner_token, context)
        with self._lock:
            tournament.end(pb.TOURNAMENT_STATE_CLOSED)
            for game in tournament.games:
                with game.lock:
                    if not game.over:
                        game.end(pb.ABORT_REASON_CLOSED)
        return pb.CloseTournamentResponse(tournament=tournament.shown)

    # Changes by hand, which the fake server does not have.

    def WithdrawParticipant(self, request: pb.WithdrawParticipantRequest, context: Context) -> pb.WithdrawParticipantResponse:
        refuse_change_by_hand(context)

    def RemoveParticipant(self, request: pb.RemoveParticipantRequest, context: Context) -> pb.RemoveParticipantResponse:
        refuse_change_by_hand(context)

    def ReplaceParticipant(self, request: pb.ReplaceParticipantRequest, context: Context) -> pb.ReplaceParticipantResponse:
        refuse_change_by_hand(context)

    def PauseTournament(self, request: pb.PauseTournamentRequest, context: Context) -> pb.PauseTournamentResponse:
        refuse_change_by_hand(context)

    def ResumeTournament(self, request: pb.ResumeTournamentRequest, context: Context) -> pb.ResumeTournamentResponse:
        refuse_change_by_hand(context)

    def PostponeGame(self, request: pb.PostponeGameRequest, context: Context) -> pb.PostponeGameResponse:
        refuse_change_by_hand(context)

    def CallGame(self, request: pb.CallGameRequest, context: Context) -> pb.CallGameResponse:
        refuse_change_by_hand(context)

    def FollowTournament(self, request: pb.FollowTournamentRequest, context: Context) -> Iterator[pb.FollowTournamentResponse]:
        """Reports every 20 ms, with a heartbeat before each report; with `breaks`, each stream breaks after its first report."""
        tournament = self._find(request.tournament_id, context)
        self.followed += 1
        context.add_callback(self.follower_left.set)
        if self.breaks:
            yield pb.FollowTournamentResponse(tournament=tournament.shown)
            context.abort(grpc.StatusCode.UNAVAILABLE, "the connection is lost")
        while context.is_active():
            yield pb.FollowTournamentResponse()
            over = tournament.over
            yield pb.FollowTournamentResponse(tournament=tournament.shown, standings=tournament.standings())
            if over:
                return
            time.sleep(0.02)

    def GetTournamentResults(self, request: pb.GetTournamentResultsRequest, context: Context) -> pb.GetTournamentResultsResponse:
        tournament = self._find(request.tournament_id, context)
        return pb.GetTournamentResultsResponse(tournament=tournament.shown, standings=tournament.standings())

    def ListTournamentGames(self, request: pb.ListTournamentGamesRequest, context: Context) -> pb.ListTournamentGamesResponse:
        """Pages of two games."""
        games = self._find(request.tournament_id, context).listed()
        at = int(request.page_token or "0")
        return pb.ListTournamentGamesResponse(games=games[at : at + 2], next_page_token=str(at + 2) if at + 2 < len(games) else "")

    def GetLeaderboard(self, request: pb.GetLeaderboardRequest, context: Context) -> pb.GetLeaderboardResponse:
        names = [entrant.name for tournament in self._all for entrant in tournament.shown.participants]
        return pb.GetLeaderboardResponse(rated=[pb.Rated(name=name) for name in names], games=len(names))

    # Called by the streams of the server.

    def enter(self, attach: pb.Attach, stream: Stream, handle: int) -> bool:
        """Attaches a stream to the participant with this ticket. Returns False if there is none."""
        with self._lock:
            for tournament in self._all:
                for number, entrant in enumerate(tournament.entrants):
                    if entrant.ticket == attach.ticket:
                        entered = pb.Entered(
                            request_id=attach.request_id, tournament_id=tournament.shown.tournament_id, participant=number
                        )
                        stream.send(handle, entered=entered)
                        tournament.enter(entrant, stream, handle)
                        return True
            return False

    def left(self, stream: Stream) -> None:
        """Handles the end of a stream."""
        with self._lock:
            for tournament in self._all:
                for entrant in tournament.entrants:
                    if entrant.stream is stream:
                        entrant.stream = None

    def settle(self) -> None:
        """Starts further games after a change in one."""
        with self._lock:
            for tournament in self._all:
                tournament.settle()

    def _find(self, tournament_id: str, context: Context) -> "FakeTournament":
        for tournament in self._all:
            if tournament.shown.tournament_id == tournament_id:
                return tournament
        refuse(context, grpc.StatusCode.NOT_FOUND, "TOURNAMENT_UNKNOWN", "there is no such tournament")

    def _own(self, tournament_id: str, owner_token: str, context: Context) -> "FakeTournament":
        if owner_token != OWNER:
            refuse(context, grpc.StatusCode.PERMISSION_DENIED, "OWNER_TOKEN_WRONG", "not the token of its creator")
        return self._find(tournament_id, context)


class FakeTournament:
    """A tournament. The caller holds the service's lock."""

    def __init__(self, number: int, settings: pb.TournamentSettings, make_game: Callable[[list[str]], FakeGame]) -> None:
        self._make_game = make_game
        self.join_code = f"CUP{number}"
        self.entrants: list[Entrant] = []
        self.games: list[FakeGame] = []
        self.shown = pb.Tournament(
            tournament_id=f"{number + 8192:032x}",
            settings=settings,
            state=pb.TOURNAMENT_STATE_OPEN,
            rounds=settings.rounds or SEATS - 1,
        )
        self.shown.games = self.shown.rounds * max(settings.games_per_pairing, 1)

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.shown.state in (pb.TOURNAMENT_STATE_FINISHED, pb.TOURNAMENT_STATE_CLOSED)

    def join(self, request: pb.JoinTournamentRequest) -> tuple[int, Entrant]:
        number = len(self.entrants)
        entrant = Entrant(f"{self.join_code}-{number}", max(request.max_games, 1))
        self.entrants.append(entrant)
        self.shown.participants.add(participant=number, name=request.name, kind=request.kind, max_games=entrant.max_games)
        settings = self.shown.settings
        if number + 1 + len(settings.built_in_agents) == settings.start_when_joined:
            self.begin()
        return number, entrant

    def begin(self) -> None:
        """Starts the tournament, with the built-in agents after the participants."""
        for name in self.shown.settings.built_in_agents:
            self.shown.participants.add(participant=len(self.shown.participants), name=name, built_in_agent=name)
        self.shown.state = pb.TOURNAMENT_STATE_PLAYING
        self.settle()

    def enter(self, entrant: Entrant, stream: Stream, handle: int) -> None:
        """Attaches a stream to a participant and to the seats of its games."""
        if entrant.stream is not None:
            entrant.stream.send(entrant.handle, detached=pb.Detached(reason=pb.DETACH_REASON_SUPERSEDED))
        if self.over:
            stream.send(handle, detached=pb.Detached(reason=pb.DETACH_REASON_TOURNAMENT_OVER))
            return
        entrant.stream, entrant.handle = stream, handle
        for game in self.games:
            self._seat(entrant, game)
        self.settle()

    def settle(self) -> None:
        """Calls the games that can be played now; ends the tournament after the last."""
        if self.shown.state != pb.TOURNAMENT_STATE_PLAYING:
            return
        running = [game for game in self.games if not game.over]
        self.shown.games_over = len(self.games) - len(running)
        self.shown.games_playing = len(running)
        if self.shown.games_over == self.shown.games:
            self.end(pb.TOURNAMENT_STATE_FINISHED)
        here = all(entrant.stream is not None for entrant in self.entrants)
        at_a_time = min((entrant.max_games for entrant in self.entrants), default=0)
        while here and len(self.games) < self.shown.games and len(running) < at_a_time:
            game = self._make_game([entrant.built_in_agent for entrant in self.shown.participants])
            for number, entrant in enumerate(self.entrants):
                game.seats[number].ticket = f"{entrant.ticket}@{len(self.games)}"
            self.games.append(game)
            running.append(game)
            for entrant in self.entrants:
                self._seat(entrant, game)

    def end(self, state: pb.TournamentState.ValueType) -> None:
        """Ends the tournament and notifies the participants."""
        self.shown.state = state
        for entrant in self.entrants:
            if entrant.stream is not None:
                entrant.stream.send(entrant.handle, detached=pb.Detached(reason=pb.DETACH_REASON_TOURNAMENT_OVER))
                entrant.stream = None

    def _seat(self, entrant: Entrant, game: FakeGame) -> None:
        stream = entrant.stream
        seat = game.seats[self.entrants.index(entrant)]
        with game.lock:
            if stream is None or game.over or seat.outbox is stream.outbox:
                return
            handle = stream.next_called
            stream.next_called += 1
            stream.seats[handle] = (game, seat)
            game.attach(seat, pb.Attach(ticket=seat.ticket), stream.outbox, handle, self.shown.tournament_id)

    def listed(self) -> list[pb.TournamentGame]:
        """The public view of the games. Seat and participant have the same number; standings are those of `FakeGame`."""
        listed = []
        for number, game in enumerate(self.games):
            state = pb.TOURNAMENT_GAME_STATE_COUNTED if game.over else pb.TOURNAMENT_GAME_STATE_PLAYING
            seats = [
                pb.TournamentGameSeat(participant=seat, place=seat + 1, points=points, score=points)
                for seat, points in enumerate([5, 3, 1, 0])
            ]
            room = game.room
            listed.append(
                pb.TournamentGame(
                    game=number, round=number + 1, state=state, seats=seats, room_id=room.room_id, game_id=room.game_id
                )
            )
        return listed

    def standings(self) -> list[pb.TournamentStanding]:
        """Participants in the same order as in every game."""
        games = sum(game.over for game in self.games)
        return [
            pb.TournamentStanding(place=entrant.participant + 1, participant=entrant.participant, games=games, score=games * points)
            for entrant, points in zip(self.shown.participants, [5, 3, 1, 0], strict=False)
        ]
