"""Where a robot finds things around the playing field: seats, the stand with its cards, its pass card, in millimetres of the field.

The printed places are in `field`. What lies on them is in `table`.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field

from chefshat_robot import field
from chefshat_robot.drivers.driver import CardMove, Pose

# From the edge of the field outwards: cards given to a seat, the stand, and the face of a person who sits there.
GIFT_MM = 70.0
STAND_MM = 130.0
FACE_MM = 350.0
FACE_HEIGHT_MM = 450.0
# Where a pass card rests: outside the field, beside the stand.
PASS_REST_MM = 310.0
# Cards of a play beyond the last place lie on that place, each shifted by this.
OVERLAP_MM = 18.0
# Degrees by which pieces are turned for the seat at each side, so that their top points away from it: bottom, left, top, right.
_ANGLES = (0.0, 90.0, 180.0, 270.0)


@dataclass(frozen=True)
class Point3:
    """A point above the table: mm, z upwards."""

    x: float
    y: float
    z: float = 0.0


def beside(seat: int, players: int, outwards: float, along: float = 0.0) -> tuple[float, float]:
    """Returns a point beside the field at a seat.

    Args:
        seat: seat number. Seats 0..3 sit at the bottom, left, top and right; five or six sit around in equal angles.
        players: number of seats.
        outwards: distance from the edge of the field, mm.
        along: distance to the right of the seat's middle, as the person who sits there sees it, mm.
    """
    turn = seat / players if players > 4 else seat / 4
    angle = math.tau * turn
    # Outwards is down for seat 0, then clockwise: left, up, right.
    out_x, out_y = -math.sin(angle), math.cos(angle)
    right_x, right_y = math.cos(angle), math.sin(angle)
    reach = min(
        field.WIDTH / 2 / abs(out_x) if abs(out_x) > 1e-9 else math.inf,
        field.HEIGHT / 2 / abs(out_y) if abs(out_y) > 1e-9 else math.inf,
    )
    distance = reach + outwards
    return (
        round(field.WIDTH / 2 + out_x * distance + right_x * along, 1),
        round(field.HEIGHT / 2 + out_y * distance + right_y * along, 1),
    )


def facing(seat: int, players: int) -> float:
    """Returns the angle of pieces that the seat reads upright, degrees clockwise."""
    return _ANGLES[seat] if players <= 4 else 360.0 * seat / players


def face_of(seat: int, players: int) -> Point3:
    """Returns where the face of the person at a seat is."""
    x, y = beside(seat, players, FACE_MM)
    return Point3(x, y, FACE_HEIGHT_MM)


def gift_place(seat: int, players: int) -> Pose:
    """Returns where cards given to a seat are put."""
    x, y = beside(seat, players, GIFT_MM)
    return Pose(x, y, facing(seat, players))


def play_places(cards: int) -> list[Pose]:
    """Returns where the cards of a play are put: the field's places in order, over the cards of the play before."""
    spots = [Pose(place.x, place.y, place.angle) for place in field.places()]
    last = spots[-1]
    spots += [Pose(last.x + OVERLAP_MM * more, last.y, last.angle) for more in range(1, cards - len(spots) + 1)]
    return spots[:cards]


def pass_place(seat: int) -> Pose | None:
    """Returns the printed place of a seat's pass card; None if the field has none."""
    printed = field.pass_places()
    if seat >= len(printed):
        return None
    return Pose(printed[seat].x, printed[seat].y, printed[seat].angle)


def pass_rest(seat: int, players: int) -> Pose:
    """Returns where a seat's pass card rests while the seat has not passed."""
    x, y = beside(seat, players, STAND_MM, PASS_REST_MM)
    return Pose(x, y, facing(seat, players))


@dataclass
class Stand:
    """The robot's rack of cards, the strip of `field.hand_places`: which slot holds which piece.

    Slots count from the left, as the robot sees them. When cards are dealt they are put in ascending order, jokers last and the
    Golden card after the other cards of its face; cards received later go to the free slots from the left, in the same order.

    Attributes:
        x: of the middle of the strip, mm.
        y: of the middle of the strip, mm.
        angle: of the strip and the cards in it, degrees clockwise.
        slots: the pieces, as in `CardMove.piece`; None for an empty slot.
    """

    x: float
    y: float
    angle: float = 0.0
    slots: list[str | None] = dataclass_field(default_factory=list)

    @classmethod
    def at(cls, seat: int, players: int) -> Stand:
        """Returns the rack in front of a seat."""
        x, y = beside(seat, players, STAND_MM)
        return cls(x, y, facing(seat, players))

    def fill(self, hand: Sequence[int], golden: bool) -> None:
        """Puts a dealt hand into the rack.

        Args:
            hand: F+1 counts, the jokers last; empty if unknown.
            golden: whether one card of face F is the Golden card.
        """
        self.slots = list(pieces_of(hand, golden))

    def settle(self, hand: Sequence[int], golden: bool) -> None:
        """Makes the rack agree with a hand: takes out what is not in it, and puts what is missing into free slots.

        As in `take`, the leftmost of several pieces of one kind are taken out.
        """
        pieces = pieces_of(hand, golden)
        surplus = Counter(filter(None, self.slots)) - Counter(pieces)
        for slot, piece in enumerate(self.slots):
            if piece is not None and surplus[piece]:
                surplus[piece] -= 1
                self.slots[slot] = None
        missing = Counter(pieces) - Counter(filter(None, self.slots))
        wanted = [piece for piece in dict.fromkeys(pieces) for _ in range(missing[piece])]
        for slot, piece in enumerate(self.slots):
            if piece is None and wanted:
                self.slots[slot] = wanted.pop(0)
        self.slots += wanted

    def take(self, pieces: Sequence[str], ends: Sequence[Pose]) -> tuple[CardMove, ...]:
        """Takes pieces out of the rack, each from the leftmost slot with one.

        Args:
            pieces: the pieces; those that are not in the rack get no start.
            ends: where each goes.
        """
        moves = []
        for piece, end in zip(pieces, ends, strict=True):
            start = None
            if piece in self.slots:
                slot = self.slots.index(piece)
                self.slots[slot] = None
                start = self.pose(slot)
            moves.append(CardMove(piece, start, end))
        return tuple(moves)

    def pose(self, slot: int) -> Pose:
        """Returns where the card in a slot is. More slots than the strip has places continue it to the right."""
        first, second = field.hand_places()[:2]
        along = first.x + (second.x - first.x) * slot - field.HAND_WIDTH / 2
        turn = math.radians(self.angle)
        return Pose(round(self.x + math.cos(turn) * along, 1), round(self.y + math.sin(turn) * along, 1), self.angle)


def pieces_of(hand: Sequence[int], golden: bool) -> list[str]:
    """Names the pieces of a hand in order: faces ascending, the Golden card, then jokers."""
    if not hand:
        return []
    top = len(hand) - 1
    pieces = [str(face) for face in range(1, top + 1) for _ in range(hand[face - 1])]
    if golden:
        pieces[-1] = "golden"
    return pieces + ["joker"] * hand[top]


def piece_of(face: int, faces: int) -> str:
    """Names a card: 1..F an ingredient, F+1 a joker."""
    return str(face) if face <= faces else "joker"


def pieces_of_play(face: int, quantity: int, jokers: int, golden: bool) -> list[str]:
    """Names the pieces of a play.

    Args:
        face: the face.
        quantity: cards of that face; 0 for a lone joker.
        jokers: jokers.
        golden: whether one of the cards is the Golden card.
    """
    plain = quantity - golden
    return ["golden"] * golden + [str(face)] * plain + ["joker"] * jokers
