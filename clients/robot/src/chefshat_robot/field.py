"""The playing field: where its places lie on the table, in millimetres.

The origin is the top left corner of the field as the camera (and the seat at the bottom, seat 0) sees it; x grows to the right,
y towards seat 0. Robots and the camera share these coordinates. Seats sit clockwise: 0 at the bottom, 1 left, 2 top, 3 right.
"""

from __future__ import annotations

from dataclasses import dataclass

CARD_WIDTH = 63.0
CARD_HEIGHT = 88.0
CARD_TAG_SIZE = 17.0
"""Edge of the AprilTag on a card, outer edge of its black border to the other, in mm. Same tag in the top left corner and,
turned by 180 degrees, in the bottom right corner."""
CARD_TAG_CENTRE = (13.5, 13.5)
"""Centre of the tag in the top left corner, from that corner of the card."""
FIELD_TAG_SIZE = 30.0
"""Edge of the AprilTags in the corners of the field, in mm."""

WIDTH = 560.0
HEIGHT = 400.0


@dataclass(frozen=True)
class Place:
    """A marked place.

    Attributes:
        name: What is printed beside it: `1`..`11` for the places of a pizza, `pass 0`..`pass 3` for the seats' pass cards.
        x: Centre, mm from the left edge of the field.
        y: Centre, mm from the top edge.
        angle: Degrees by which a card lying there is turned clockwise, 0 or 90.
    """

    name: str
    x: float
    y: float
    angle: float = 0.0


def places() -> list[Place]:
    """The eleven places for cards, in two rows: six above, five below."""
    top = [Place(str(number + 1), 97.5 + 73.0 * number, 151.0) for number in range(6)]
    bottom = [Place(str(number + 7), 134.0 + 73.0 * number, 249.0) for number in range(5)]
    return top + bottom


def pass_places() -> list[Place]:
    """The place of each seat's pass card, index = seat: bottom, left, top, right."""
    return [
        Place("pass 0", 280.0, 348.0, 90.0),
        Place("pass 1", 45.0, 256.0, 0.0),
        Place("pass 2", 280.0, 52.0, 90.0),
        Place("pass 3", 515.0, 256.0, 0.0),
    ]


def corner_tags() -> list[tuple[float, float]]:
    """The centres of the four corner tags, clockwise from the top left."""
    inset = 24.0
    return [(inset, inset), (WIDTH - inset, inset), (WIDTH - inset, HEIGHT - inset), (inset, HEIGHT - inset)]


HAND_WIDTH = 520.0
HAND_HEIGHT = 104.0
"""Size of the strip behind a robot's own hand of cards, in mm. Its origin is its top left corner."""
HAND_CARDS = 17
"""Cards that a row in front of the strip holds, each with its left 25 mm to be seen."""


def hand_tags() -> list[tuple[float, float]]:
    """The centres of the strip's four corner tags, of `CARD_TAG_SIZE`, clockwise from the top left."""
    inset = 14.0
    return [(inset, inset), (HAND_WIDTH - inset, inset), (HAND_WIDTH - inset, HAND_HEIGHT - inset), (inset, HAND_HEIGHT - inset)]


def hand_places() -> list[Place]:
    """The places of the cards before the strip, named `hand 1` on. Each card lies over the right part of the one before it."""
    first, step, middle = 60.0, 25.0, HAND_HEIGHT / 2
    return [Place(f"hand {number + 1}", first + step * number, middle) for number in range(HAND_CARDS)]
