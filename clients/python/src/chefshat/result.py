"""The result of a seat's game."""

from dataclasses import dataclass

from chefshat import pb
from chefshat.errors import ChefsHatError


@dataclass(frozen=True)
class Standing:
    """One line of the final table: a seat (from 0), its points and its place (from 1)."""

    seat: int
    points: int
    place: int


@dataclass(frozen=True)
class SeatResult:
    """The result of a game for one seat: finished (with standings), aborted (without), or an error of the seat.

    Attributes:
        room_id: the room; empty if the seat was never attached.
        game_id: the game; empty if the seat was never attached.
        seat: number of the seat, from 0; -1 if the seat was never attached.
        standings: the final table, best first; empty unless the game finished.
        reveal: what the deals can be checked with, if the server revealed it: `reveal.seat_entropy[seat]` is then this seat's
            `entropy` (unless the game's seed was fixed).
        abort_reason: why the game was aborted, for example "SHUTDOWN"; empty unless it was.
        decisions: accepted answers.
        invalid: illegal answers.
        late: answers to decisions that were already closed.
        annotations_dropped: annotations that were not recorded, because they were too large or not finite.
        reconnects: attachments after a lost connection.
        entropy: the seat's contribution to the game seed, as sent by this session. If the game had begun before, an earlier one
            counts.
        error: why the seat was lost before its game was over (reason "SUPERSEDED": a newer connection took it); None otherwise.
    """

    room_id: str
    game_id: str
    seat: int
    standings: tuple[Standing, ...] = ()
    reveal: pb.SeedReveal | None = None
    abort_reason: str = ""
    decisions: int = 0
    invalid: int = 0
    late: int = 0
    annotations_dropped: int = 0
    reconnects: int = 0
    entropy: bytes = b""
    error: ChefsHatError | None = None

    @property
    def finished(self) -> bool:
        """Whether the game ended with a result."""
        return bool(self.standings)

    @property
    def place(self) -> int | None:
        """This seat's place in the game, from 1; None unless the game finished."""
        return next((standing.place for standing in self.standings if standing.seat == self.seat), None)

    @property
    def points(self) -> int | None:
        """This seat's points; None unless the game finished."""
        return next((standing.points for standing in self.standings if standing.seat == self.seat), None)

    def raise_for_error(self) -> None:
        """Raises `error` if there is one."""
        if self.error is not None:
            raise self.error


def standings_of(ended: pb.GameEnded) -> tuple[Standing, ...]:
    """Returns the final table of a finished game."""
    return tuple(Standing(line.seat, line.points, line.place) for line in ended.standings)


def abort_reason_of(aborted: pb.GameAborted) -> str:
    """Returns the name of the reason, without its prefix."""
    values = pb.AbortReason.values()
    if aborted.reason not in values:
        return str(int(aborted.reason))  # The server is newer than this package.
    return pb.AbortReason.Name(aborted.reason).removeprefix("ABORT_REASON_")
