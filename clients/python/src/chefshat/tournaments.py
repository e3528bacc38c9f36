"""The calls about tournaments, blocking and asyncio: holding them, joining, following, and their results.

Taking part is not here: `play_tournament` stands beside the other ways to play, in `client` and `aio`.
"""

from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Iterator
from typing import TYPE_CHECKING

import grpc

from chefshat import pb
from chefshat._gen.chefshat.v1.tournament_service_pb2_grpc import TournamentServiceStub
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.requests import awaited, called

if TYPE_CHECKING:
    # The name exists in the type stubs alone.
    from chefshat._gen.chefshat.v1.tournament_service_pb2_grpc import TournamentServiceAsyncStub

# States in which a tournament moves no more.
OVER = (pb.TOURNAMENT_STATE_FINISHED, pb.TOURNAMENT_STATE_CLOSED)


class TournamentCalls(ABC):
    """The part of the blocking client that is about tournaments."""

    _tournaments: TournamentServiceStub

    @abstractmethod
    def _wait(self, failures: int, error: ChefsHatError) -> None:
        """Waits before the next attempt to connect, or raises the error if there is to be none."""

    def create_tournament(self, settings: pb.TournamentSettings) -> pb.CreateTournamentResponse:
        """Makes a tournament.

        Args:
            settings: what it is to be; a field that is not set takes its standard value. A name and a format must be given.

        Returns:
            The tournament, its join code, and the token that starts and closes it.
        """
        return called(lambda: self._tournaments.CreateTournament(pb.CreateTournamentRequest(settings=settings)))

    def join_tournament(
        self,
        join_code: str,
        name: str,
        *,
        tournament_id: str = "",
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_AGENT,
        max_games: int = 1,
        stateless: bool = False,
    ) -> pb.JoinTournamentResponse:
        """Joins a tournament; its join code is enough to find it.

        Args:
            join_code: the tournament's join code.
            name: name to show, 1..=64 characters; none that another participant has.
            tournament_id: the tournament, if it is to be that one and no other.
            kind: what joins.
            max_games: games it can play at a time, 1..=64.
            stateless: declares that it remembers nothing from one game to the next.

        Returns:
            The tournament, the participant's number in it, and the ticket to play with.
        """
        request = join_request(join_code, name, tournament_id, kind, max_games, stateless)
        return called(lambda: self._tournaments.JoinTournament(request))

    def start_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Begins a tournament with the token its creator got."""
        request = pb.StartTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return called(lambda: self._tournaments.StartTournament(request)).tournament

    def close_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Closes a tournament with the token its creator got; running games are aborted, what has been counted stays."""
        request = pb.CloseTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return called(lambda: self._tournaments.CloseTournament(request)).tournament

    def get_tournament(self, tournament_id: str) -> pb.Tournament:
        """The tournament as everybody sees it."""
        request = pb.GetTournamentRequest(tournament_id=tournament_id)
        return called(lambda: self._tournaments.GetTournament(request)).tournament

    def list_tournaments(self, state: pb.TournamentState.ValueType = pb.TOURNAMENT_STATE_UNSPECIFIED) -> Iterator[pb.Tournament]:
        """The server's tournaments, newest first, without their participants; those in one state alone if it is given.

        Pages are fetched as they are needed.
        """
        token = ""
        while True:
            page = self._tournaments_page(pb.ListTournamentsRequest(state=state, page_token=token))
            yield from page.tournaments
            token = page.next_page_token
            if not token:
                return

    def _tournaments_page(self, request: pb.ListTournamentsRequest) -> pb.ListTournamentsResponse:
        return called(lambda: self._tournaments.ListTournaments(request))

    def follow_tournament(self, tournament_id: str) -> Iterator[pb.FollowTournamentResponse]:
        """How a tournament stands: at once, and whenever that has changed, until it is over, across lost connections."""
        failures = 0
        while True:
            call = self._tournaments.FollowTournament(pb.FollowTournamentRequest(tournament_id=tournament_id))
            error = connection_lost("the server ended the stream before the tournament was over")
            try:
                for report in call:
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
            self._wait(failures, error)

    def tournament_results(self, tournament_id: str) -> pb.GetTournamentResultsResponse:
        """Standings, ratings, and how sure the order is; final once the tournament is over."""
        request = pb.GetTournamentResultsRequest(tournament_id=tournament_id)
        return called(lambda: self._tournaments.GetTournamentResults(request))

    def tournament_games(self, tournament_id: str) -> Iterator[pb.TournamentGame]:
        """The games of a tournament, in order. Pages are fetched as they are needed."""
        token = ""
        while True:
            page = self._games_page(pb.ListTournamentGamesRequest(tournament_id=tournament_id, page_token=token))
            yield from page.games
            token = page.next_page_token
            if not token:
                return

    def _games_page(self, request: pb.ListTournamentGamesRequest) -> pb.ListTournamentGamesResponse:
        return called(lambda: self._tournaments.ListTournamentGames(request))

    def leaderboard(
        self,
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_UNSPECIFIED,
        *,
        min_games: int = 0,
        limit: int = 0,
    ) -> pb.GetLeaderboardResponse:
        """Who has played rated games on the server, best first.

        Args:
            kind: participants of this kind alone.
            min_games: without those who have played fewer rated games.
            limit: at most so many lines, 1..=1000; 0: the server's standard.
        """
        request = pb.GetLeaderboardRequest(kind=kind, min_games=min_games, limit=limit)
        return called(lambda: self._tournaments.GetLeaderboard(request))


class AsyncTournamentCalls(ABC):
    """The part of the asyncio client that is about tournaments; see `TournamentCalls` for what the methods do."""

    _tournaments: "TournamentServiceAsyncStub"

    @abstractmethod
    async def _wait(self, failures: int, error: ChefsHatError) -> None:
        """Waits before the next attempt to connect, or raises the error if there is to be none."""

    async def create_tournament(self, settings: pb.TournamentSettings) -> pb.CreateTournamentResponse:
        """Makes a tournament. Returns it, its join code, and the token that starts and closes it."""
        return await awaited(self._tournaments.CreateTournament(pb.CreateTournamentRequest(settings=settings)))

    async def join_tournament(
        self,
        join_code: str,
        name: str,
        *,
        tournament_id: str = "",
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_AGENT,
        max_games: int = 1,
        stateless: bool = False,
    ) -> pb.JoinTournamentResponse:
        """Joins a tournament; the arguments are those of the blocking client."""
        request = join_request(join_code, name, tournament_id, kind, max_games, stateless)
        return await awaited(self._tournaments.JoinTournament(request))

    async def start_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Begins a tournament with the token its creator got."""
        request = pb.StartTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (await awaited(self._tournaments.StartTournament(request))).tournament

    async def close_tournament(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Closes a tournament with the token its creator got; running games are aborted, what has been counted stays."""
        request = pb.CloseTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (await awaited(self._tournaments.CloseTournament(request))).tournament

    async def get_tournament(self, tournament_id: str) -> pb.Tournament:
        """The tournament as everybody sees it."""
        request = pb.GetTournamentRequest(tournament_id=tournament_id)
        return (await awaited(self._tournaments.GetTournament(request))).tournament

    async def list_tournaments(
        self, state: pb.TournamentState.ValueType = pb.TOURNAMENT_STATE_UNSPECIFIED
    ) -> AsyncIterator[pb.Tournament]:
        """The server's tournaments, newest first, without their participants; those in one state alone if it is given.

        Pages are fetched as they are needed.
        """
        token = ""
        while True:
            request = pb.ListTournamentsRequest(state=state, page_token=token)
            page = await awaited(self._tournaments.ListTournaments(request))
            for tournament in page.tournaments:
                yield tournament
            token = page.next_page_token
            if not token:
                return

    async def follow_tournament(self, tournament_id: str) -> AsyncIterator[pb.FollowTournamentResponse]:
        """How a tournament stands: at once, and whenever that has changed, until it is over, across lost connections."""
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
        """Standings, ratings, and how sure the order is; final once the tournament is over."""
        request = pb.GetTournamentResultsRequest(tournament_id=tournament_id)
        return await awaited(self._tournaments.GetTournamentResults(request))

    async def tournament_games(self, tournament_id: str) -> AsyncIterator[pb.TournamentGame]:
        """The games of a tournament, in order. Pages are fetched as they are needed."""
        token = ""
        while True:
            request = pb.ListTournamentGamesRequest(tournament_id=tournament_id, page_token=token)
            page = await awaited(self._tournaments.ListTournamentGames(request))
            for game in page.games:
                yield game
            token = page.next_page_token
            if not token:
                return

    async def leaderboard(
        self,
        kind: pb.ParticipantKind.ValueType = pb.PARTICIPANT_KIND_UNSPECIFIED,
        *,
        min_games: int = 0,
        limit: int = 0,
    ) -> pb.GetLeaderboardResponse:
        """Who has played rated games on the server, best first; the arguments are those of the blocking client."""
        request = pb.GetLeaderboardRequest(kind=kind, min_games=min_games, limit=limit)
        return await awaited(self._tournaments.GetLeaderboard(request))


def join_request(
    join_code: str,
    name: str,
    tournament_id: str,
    kind: pb.ParticipantKind.ValueType,
    max_games: int,
    stateless: bool,
) -> pb.JoinTournamentRequest:
    """The request to take part."""
    if max_games < 1:
        raise ValueError(f"max_games is {max_games}: a participant plays at least one game at a time")
    return pb.JoinTournamentRequest(
        tournament_id=tournament_id, join_code=join_code, name=name, kind=kind, max_games=max_games, stateless=stateless
    )
