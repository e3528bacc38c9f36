"""The result of a game or a tournament as commands print it: as a table or as JSON.

Joining is in `join_options`; the result of a single seat is in `result`.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from chefshat import pb
from chefshat.result import SeatResult


@dataclass(frozen=True)
class Played:
    """The result of a place in a room or a tournament.

    Attributes:
        games: the games played here, in order; only one for a room.
        tournament: the final results of the tournament; None for a room.
        participant: number of the participant in the tournament; 0 for a room.
    """

    games: Sequence[SeatResult]
    tournament: pb.GetTournamentResultsResponse | None = None
    participant: int = 0

    @property
    def finished(self) -> bool:
        """Whether the tournament ended by itself, or the room's game with a result."""
        if self.tournament is None:
            return self.games[0].finished
        return self.tournament.tournament.state == pb.TOURNAMENT_STATE_FINISHED


def report(played: Played, *, as_json: bool, own: Mapping[str, object] | None = None, own_words: str = "") -> int:
    """Prints a result, as a line of JSON or a table.

    Args:
        played: the result.
        as_json: whether to print JSON.
        own: further fields of the JSON.
        own_words: a further line below the table.

    Returns:
        The exit code: 0 if the game or tournament was finished, else 1.
    """
    if as_json:
        print(json.dumps({**plain(played), **(own or {})}), flush=True)
    else:
        print("\n".join([as_table(played), *filter(None, [own_words])]), flush=True)
    return 0 if played.finished else 1


def plain(played: Played) -> dict[str, object]:
    """Converts a result to JSON values."""
    if played.tournament is None:
        return _game_plain(played.games[0])
    games = [
        {**_game_plain(result), **({"event": "error", "reason": result.error.reason} if result.error else {})}
        for result in played.games
    ]
    standings = played.tournament.standings
    return {
        "event": "finished" if played.finished else "closed",
        "tournament_id": played.tournament.tournament.tournament_id,
        "participant": played.participant,
        "place": next((line.place or None for line in standings if line.participant == played.participant), None),
        "standings": [
            {"participant": line.participant, "place": line.place, "score": line.score, "points": line.points, "games": line.games}
            for line in standings
        ],
        "games": games,
    }


def as_table(played: Played) -> str:
    """Formats a result as a table."""
    if played.tournament is None:
        return _game_as_table(played.games[0])
    return _tournament_as_table(played.tournament, played.participant)


def _game_plain(result: SeatResult) -> dict[str, object]:
    return {
        "event": "finished" if result.finished else "aborted",
        "abort_reason": result.abort_reason,
        "room_id": result.room_id,
        "game_id": result.game_id,
        "seat": result.seat,
        "place": result.place,
        "points": result.points,
        "standings": [{"seat": line.seat, "points": line.points, "place": line.place} for line in result.standings],
        "decisions": result.decisions,
        "invalid": result.invalid,
        "late": result.late,
        "annotations_dropped": result.annotations_dropped,
        "reconnects": result.reconnects,
        "entropy": result.entropy.hex(),
    }


def _game_as_table(result: SeatResult) -> str:
    if not result.finished:
        return f"The game was aborted ({result.abort_reason}) and has no result."
    lines = ["place  seat  points"]
    for line in result.standings:
        mine = "  <- this agent" if line.seat == result.seat else ""
        lines.append(f"{line.place:>5}  {line.seat:>4}  {line.points:>6}{mine}")
    lines.append(f"{result.decisions} decisions, {result.invalid} invalid answers, {result.late} too late")
    return "\n".join(lines)


def _tournament_as_table(results: pb.GetTournamentResultsResponse, participant: int) -> str:
    """Formats standings. Scores and points are means per game, which determine the order. Places need at least one counted game."""
    lines = ["place  score  points  games  name"]
    names = [entrant.name for entrant in results.tournament.participants]
    for line in results.standings:
        mine = "  <- this agent" if line.participant == participant else ""
        games = max(line.games, 1)
        means = f"{line.score / games:>5.2f}  {line.points / games:>6.2f}"
        lines.append(f"{line.place or '-':>5}  {means}  {line.games:>5}  {names[line.participant]}{mine}")
    if results.tournament.state != pb.TOURNAMENT_STATE_FINISHED:
        lines.append("The tournament was closed before its end.")
    return "\n".join(lines)
