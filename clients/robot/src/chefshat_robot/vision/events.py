"""The events of the table: what perception reports, and their form as JSON.

Every event has the number of the frame that completed it and the time of that frame in seconds from the first frame. The events of
one table arrive in order. Nothing is reported twice and nothing is guessed: what cannot be read for sure becomes a `Doubt`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefshat_robot.deck import Card

Picture: TypeAlias = NDArray[np.uint8]
"""A picture: shape (height, width, 3) in BGR, or (height, width) in grey; values 0..255."""


@dataclass(frozen=True)
class Laid:
    """Cards came to rest on the field and can be read.

    Cards laid with one movement of a hand, or without a pause between, are one event. Cards that are added to a play later are
    an event of their own.

    Attributes:
        cards: The cards, in order of their places.
        places: The place of each card, 1..11, in the same order.
        side: The side of the field from which an arm reached in as they were laid: 0 the bottom, where seat 0 sits, then clockwise.
            None if the picture shows none, or several.
        found: Whether some of them may have lain there before perception began: the field had not been at rest, or nothing else was
            seen at their places until then.
    """

    frame: int
    time: float
    cards: tuple[Card, ...]
    places: tuple[int, ...]
    side: int | None = None
    found: bool = False


@dataclass(frozen=True)
class TakenBack:
    """Cards on top were taken away again, while others stay on the field.

    Attributes:
        cards: The cards, in order of their places.
        places: The place of each card, 1..11, in the same order.
    """

    frame: int
    time: float
    cards: tuple[Card, ...]
    places: tuple[int, ...]


@dataclass(frozen=True)
class Cleared:
    """All cards were swept off the field."""

    frame: int
    time: float


@dataclass(frozen=True)
class PassShown:
    """The pass card of a seat lies at its place.

    Attributes:
        seat: The seat, 0..3.
        found: Whether it may have lain there before perception began.
    """

    frame: int
    time: float
    seat: int
    found: bool = False


@dataclass(frozen=True)
class PassWithdrawn:
    """The pass card of a seat was taken from its place.

    Attributes:
        seat: The seat, 0..3.
    """

    frame: int
    time: float
    seat: int


@dataclass(frozen=True)
class Doubt:
    """Something new lies at a place and cannot be read for sure. Ask, then call `Perception.answer`.

    Until the doubt is answered or resolved, the other cards laid with it are held back.

    Attributes:
        number: Identifies the doubt, from 1.
        place: The place, as `field.Place.name`: `1`..`11`, or `pass 0`..`pass 3`.
        seen: When it was last seen, in s. Earlier than `time` if it was covered or taken away in the meantime.
        options: What it may be, the likeliest first; empty if nothing is known. At a pass place always empty: the question is
            whether the pass card lies there.
        picture: The place, cut out of the rectified frame; None when a recording without frames is run again.
    """

    frame: int
    time: float
    number: int
    place: str
    seen: float
    options: tuple[Card, ...]
    picture: Picture | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class DoubtResolved:
    """A doubt needs no answer any more: it was answered, or the camera could read the place after all.

    Attributes:
        number: The number of the doubt.
    """

    frame: int
    time: float
    number: int


class FieldState(Enum):
    """Whether the camera sees the field."""

    FOUND = "found"
    """The field was found, at first or again."""
    MOVED = "moved"
    """The camera or the field was moved; the new position is known and reading resumes."""
    LOST = "lost"
    """The corners of the field are no longer where they were and were not found elsewhere. Nothing is read until `FOUND`."""


@dataclass(frozen=True)
class FieldChanged:
    """The field was found, lost or moved.

    Attributes:
        state: Which of them.
    """

    frame: int
    time: float
    state: FieldState


Observed: TypeAlias = Laid | TakenBack | Cleared | PassShown | PassWithdrawn | Doubt | DoubtResolved | FieldChanged
"""Any event of the table."""

_KINDS: dict[str, type[Observed]] = {
    "laid": Laid,
    "taken_back": TakenBack,
    "cleared": Cleared,
    "pass_shown": PassShown,
    "pass_withdrawn": PassWithdrawn,
    "doubt": Doubt,
    "doubt_resolved": DoubtResolved,
    "field_changed": FieldChanged,
}
_NAMES = {kind: name for name, kind in _KINDS.items()}


def to_json(event: Observed) -> dict[str, Any]:
    """The event as a JSON object: its kind as `event`, then its attributes, without a picture. A card has `deck` and `index`."""
    values = {key: value for key, value in asdict(event).items() if key != "picture"}
    if isinstance(event, FieldChanged):
        values["state"] = event.state.value
    return {"event": _NAMES[type(event)], **values}


def from_json(values: Mapping[str, Any]) -> Observed:
    """The event of a JSON object that `to_json` made.

    Raises:
        ValueError: It is not such an object.
    """
    rest = dict(values)
    try:
        kind = _KINDS[rest.pop("event")]
        for name in ("cards", "options"):
            if name in rest:
                rest[name] = tuple(Card(**card) for card in rest[name])
        if "places" in rest:
            rest["places"] = tuple(rest["places"])
        if "state" in rest:
            rest["state"] = FieldState(rest["state"])
        return kind(**rest)
    except (KeyError, TypeError) as error:
        raise ValueError(f"not an event of the table: {values!r}") from error
