"""The calls of TournamentService. See `calls`."""

from collections.abc import Iterator
from contextlib import closing

from chefshat import pb, requests
from chefshat._gen.chefshat.v1.tournament_service_pb2_grpc import TournamentServiceStub
from chefshat._sync.connection import Connection
from chefshat.requests import called, pages

# The final states of a tournament.
OVER = (pb.TOURNAMENT_STATE_FINISHED, pb.TOURNAMENT_STATE_CLOSED)


class Tournaments:
    """Creates, joins, runs and follows tournaments, and reads the leaderboard."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._tournaments = TournamentServiceStub(connection.channel)

    def create(
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
        return called(self._tournaments.CreateTournament, request)

    def join(
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
        return called(self._tournaments.JoinTournament, request)

    def get(self, tournament_id: str) -> pb.Tournament:
        """Returns the public view of a tournament."""
        request = pb.GetTournamentRequest(tournament_id=tournament_id)
        return (called(self._tournaments.GetTournament, request)).tournament

    def list(self, state: pb.TournamentState.ValueType = pb.TOURNAMENT_STATE_UNSPECIFIED) -> Iterator[pb.Tournament]:
        """Iterates over the server's tournaments, newest first, without participants, optionally only those in one state.

        Fetches pages on demand.
        """
        request = pb.ListTournamentsRequest(state=state)
        return pages(self._tournaments.ListTournaments, request, lambda page: page.tournaments)

    def follow(self, tournament_id: str) -> Iterator[pb.FollowTournamentResponse]:
        """Iterates over the state of a tournament: now, and after every change, until it is over. Reconnects."""
        request = pb.FollowTournamentRequest(tournament_id=tournament_id)
        unfinished = "the server ended the stream before the tournament was over"
        messages = self._connection.messages(lambda: self._tournaments.FollowTournament(request), unfinished)
        with closing(messages):
            for report in messages:
                if report.HasField("tournament"):  # Others are heartbeats.
                    yield report
                    if report.tournament.state in OVER:
                        return

    def results(self, tournament_id: str) -> pb.GetTournamentResultsResponse:
        """Returns standings, ratings and the certainty of the order; final once the tournament is over."""
        request = pb.GetTournamentResultsRequest(tournament_id=tournament_id)
        return called(self._tournaments.GetTournamentResults, request)

    def games(self, tournament_id: str) -> Iterator[pb.TournamentGame]:
        """Iterates over the games of a tournament, in order. Fetches pages on demand."""
        request = pb.ListTournamentGamesRequest(tournament_id=tournament_id)
        return pages(self._tournaments.ListTournamentGames, request, lambda page: page.games)

    def leaderboard(
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
        return called(self._tournaments.GetLeaderboard, request)

    def start(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Starts a tournament with its creator's token."""
        request = pb.StartTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (called(self._tournaments.StartTournament, request)).tournament

    def pause(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Pauses a tournament: no game is called until it is resumed. Games in progress continue."""
        request = pb.PauseTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (called(self._tournaments.PauseTournament, request)).tournament

    def resume(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Resumes a paused tournament."""
        request = pb.ResumeTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (called(self._tournaments.ResumeTournament, request)).tournament

    def close(self, tournament_id: str, owner_token: str) -> pb.Tournament:
        """Closes a tournament with its creator's token. Running games are aborted; counted results remain."""
        request = pb.CloseTournamentRequest(tournament_id=tournament_id, owner_token=owner_token)
        return (called(self._tournaments.CloseTournament, request)).tournament

    def add_table_participant(
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
        return called(self._tournaments.AddTableParticipant, request)

    def physical_table(self, tournament_id: str, owner_token: str, game: int) -> pb.GetPhysicalTableResponse:
        """Returns the secrets of the physical table at which a game is being played.

        Args:
            tournament_id: the tournament.
            owner_token: its creator's token.
            game: number of the game in the tournament.

        Returns:
            The room, the ticket for `tables.report` and `tables.watch`, and the token that closes the room.
        """
        request = pb.GetPhysicalTableRequest(tournament_id=tournament_id, owner_token=owner_token, game=game)
        return called(self._tournaments.GetPhysicalTable, request)

    def withdraw(self, tournament_id: str, *, ticket: str = "", owner_token: str = "", participant: int = 0) -> pb.Tournament:
        """Withdraws a participant: the one with `ticket`, or with `owner_token` the one with this number.

        Before the start its place is free again. After that a substitute plays its games in progress, and it forfeits the others.
        """
        request = pb.WithdrawParticipantRequest(
            tournament_id=tournament_id, ticket=ticket, owner_token=owner_token, participant=participant
        )
        return (called(self._tournaments.WithdrawParticipant, request)).tournament

    def remove_participant(self, tournament_id: str, owner_token: str, participant: int) -> pb.Tournament:
        """Removes a participant: it is withdrawn, and its ticket ends."""
        request = pb.RemoveParticipantRequest(tournament_id=tournament_id, owner_token=owner_token, participant=participant)
        return (called(self._tournaments.RemoveParticipant, request)).tournament

    def replace_participant(
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
        return called(self._tournaments.ReplaceParticipant, request)

    def postpone_game(self, tournament_id: str, game: int, *, ticket: str = "", owner_token: str = "") -> pb.TournamentGame:
        """Moves a game that is not in progress to the end of the queue, with a ticket of it or the owner token."""
        request = pb.PostponeGameRequest(tournament_id=tournament_id, ticket=ticket, owner_token=owner_token, game=game)
        return (called(self._tournaments.PostponeGame, request)).game

    def call_game(self, tournament_id: str, owner_token: str, game: int) -> pb.TournamentGame:
        """Calls a due or void game before all others, with as many calls as at first."""
        request = pb.CallGameRequest(tournament_id=tournament_id, owner_token=owner_token, game=game)
        return (called(self._tournaments.CallGame, request)).game
