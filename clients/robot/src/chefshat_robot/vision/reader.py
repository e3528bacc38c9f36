"""What one frame shows: tags in mm, and for each place whether something moves there, how it looks, and whether it is empty.

The reader knows nothing about cards or the game. It spends little: a map of the field at 1 mm tells where something changes, and
tags are only read where nothing moves any more, for a few frames after each change and then in turn.

A **look** is the number of a place's appearance. After a movement a place gets a new one, unless it looks as it did shortly before.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from dataclasses import field as dataclass_field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from chefshat_robot import field
from chefshat_robot.deck import FIELD_TAGS

from .camera import Camera
from .events import FieldState, Picture
from .frames import Frame
from .tags import Tag, TagReader
from .view import FieldView

STILL_FRAMES = 2
"""A place is still when nothing has moved there for so many frames."""
READ_FRAMES = 6
"""For so many frames after it became still, a place is read in each frame."""
REFRESH_FRAMES = 15
"""After that a place is read once in so many frames; places take turns."""
BLOCK = 4
"""Edge of the blocks in which movement is looked for, in mm."""
MOVEMENT = 0.07
"""A block moves if its brightness, relative to its surroundings, changes by more than this from one frame to the next..."""
MOVEMENT_SIGMAS = 7.0
"""...and by more than so many standard deviations of the noise, which counts for more in the dark."""
MOVING_BLOCKS = 3
"""A place moves if so many of its blocks do."""
NEAR = 8.0
"""Movement this close to a card's outline at a place counts for the place, in mm."""
CELL = 2
"""Edge of the cells whose brightness makes a look, in mm."""
CORE = (15.0, 15.0)
"""The look of a place is that of its core: without this much on both sides, across and along, in mm. Cards at other places do not
reach it."""
DIFFERENT = 0.085
"""Mean difference of two looks, relative to the local brightness, from which on they are different."""
LOOKS = 3
"""So many looks of a place are remembered: a hand that rests over a card is a look too, and then the card's look returns."""
EMPTY = 0.06
"""Mean difference from the empty place up to which a place is empty."""
PLAIN = 0.07
"""Mean difference of a place from its own mean, relative to the local brightness, up to which it can be the empty place, whose
print is faint. Faces and backs of cards differ more."""
EMPTY_FRAMES = 4
"""Frames for which a place must be still and plain to be remembered as empty, at first."""
AVERAGE_FRAMES = 4
"""The appearance of a still place is averaged over so many frames, against noise."""
ADAPT = 0.03
"""How quickly the memory of a look follows the light: the weight of each new frame."""
EDGE = 2
"""Breadth of the edge of the field that is watched for arms, and length of its pieces, in blocks."""
EDGE_BLOCKS = 2
"""Something reaches over the edge if so many pieces of it look otherwise."""
EDGE_CHANGE = 0.12
"""Something reaches over the edge where its brightness, relative to its surroundings, changed by more than this."""
EDGE_ADAPT = 0.01
"""How quickly the memory of the edge takes in what lies there: the weight of each new frame."""
SURROUNDINGS = 31
"""Edge of the surroundings brightness is relative to, in mm; odd."""
READ_MARGIN = 22.0
"""Tags are read this far around a place, in mm."""
TAG_SIZES = (0.8, 1.25)
"""Smallest and biggest size of a card's tag that is believed, as a part of the printed size."""


@dataclass(frozen=True)
class SeenTag:
    """A tag of a piece on the field.

    Attributes:
        number: Its number, 0..559.
        x: Centre, mm on the field.
        y: Centre, mm on the field.
        angle: Degrees by which it is turned clockwise, -180..180.
        hamming: Corrected bits.
        margin: Contrast, in grey levels.
    """

    number: int
    x: float
    y: float
    angle: float
    hamming: int
    margin: float


@dataclass(frozen=True)
class SeenPlace:
    """A place in one frame.

    Attributes:
        still: For how many frames nothing has moved there; 0 while something moves.
        look: Number of its look; the last one while something moves.
        empty: Whether it looks as it did when it was empty; False until it was seen empty. None while something moves, or before it
            was still for long enough to tell.
        read: Whether tags were read there in this frame.
    """

    still: int
    look: int
    empty: bool | None
    read: bool


@dataclass(frozen=True)
class Sighting:
    """What one frame shows.

    Attributes:
        frame: Number of the frame.
        time: Its time in s.
        field: The change of the field's state, if any.
        tags: The tags read, each once.
        reaching: Whether an arm or something else reaches over the edge of the field.
        sides: The sides over whose edges it reaches: 0 the bottom, where seat 0 sits, then clockwise. Empty in recordings that were
            made before there were sides.
        places: The eleven places for cards, then the four for pass cards; empty while the field is not found.
    """

    frame: int
    time: float
    field: FieldState | None
    tags: tuple[SeenTag, ...]
    reaching: bool
    places: tuple[SeenPlace, ...]
    sides: tuple[int, ...] = ()

    def to_json(self) -> dict[str, Any]:
        """The sighting as a JSON object."""
        values = asdict(self)
        values["field"] = self.field.value if self.field else None
        values["places"] = [[place.still, place.look, place.empty, place.read] for place in self.places]
        values["tags"] = [[tag.number, tag.x, tag.y, tag.angle, tag.hamming, tag.margin] for tag in self.tags]
        return values

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Sighting:
        """The sighting of a JSON object that `to_json` made.

        Raises:
            ValueError: It is not such an object.
        """
        try:
            return cls(
                frame=int(values["frame"]),
                time=float(values["time"]),
                field=FieldState(values["field"]) if values["field"] else None,
                tags=tuple(SeenTag(*tag) for tag in values["tags"]),
                reaching=bool(values["reaching"]),
                places=tuple(SeenPlace(*place) for place in values["places"]),
                sides=tuple(values.get("sides", ())),
            )
        except (KeyError, TypeError) as error:
            raise ValueError(f"not a line of a recording: {values!r}") from error


SPOTS: Sequence[field.Place] = (*field.places(), *field.pass_places())
"""All places in the order of `Sighting.places`."""


def half_size(place: field.Place) -> tuple[float, float]:
    """Half the width and height of a card lying at a place, in mm on the field."""
    width, height = field.CARD_WIDTH / 2, field.CARD_HEIGHT / 2
    return (height, width) if place.angle % 180 == 90 else (width, height)


@dataclass
class _Spot:
    """What the reader remembers of a place."""

    still: int = 0
    look: int = 0
    looks: dict[int, NDArray[np.float32]] = dataclass_field(default_factory=dict)
    """The latest looks by their numbers, the present one last."""
    new_look: int = 1
    """The number of the next new look."""
    average: NDArray[np.float32] | None = None
    """Its appearance since it became still, averaged; None while something moves."""
    empty: NDArray[np.float32] | None = None
    """The look of the empty place."""

    def recognize(self, appearance: NDArray[np.float32]) -> None:
        """Finds the look of an appearance, or makes a new one."""
        differences = {look: difference(appearance, remembered) for look, remembered in self.looks.items()}
        self.look = min(differences, key=lambda look: differences[look], default=0)
        if differences.get(self.look, math.inf) > DIFFERENT:
            self.look, self.new_look = self.new_look, self.new_look + 1
        self.looks[self.look] = self.looks.pop(self.look, appearance.copy())
        if len(self.looks) > LOOKS:
            del self.looks[next(iter(self.looks))]


class Reader:
    """Reads frames one after the other.

    Args:
        camera: The intrinsics of the camera; None: a lens without distortion is assumed.
    """

    def __init__(self, camera: Camera | None = None) -> None:
        self.view = FieldView(camera)
        self._tags: TagReader | None = None
        self._spots = [_Spot() for _ in SPOTS]
        self._before: NDArray[np.float32] | None = None
        self._edge: NDArray[np.float32] | None = None

    def read(self, frame: Frame, attention: Collection[int] = ()) -> Sighting:
        """Reads the next frame.

        Args:
            frame: The frame.
            attention: Places to read closely in this frame, although they have been still for long; indices of `SPOTS`.

        Raises:
            ValueError: The camera was calibrated for pictures of other proportions.
        """
        grey = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        changed = self.view.update(grey, frame.time)
        if not self.view.found:
            self._before = None
            return Sighting(frame.index, frame.time, changed, (), False, ())
        if changed is not None:
            self._tags = TagReader(self.view.scale * field.CARD_TAG_SIZE)
            self._before = self._edge = None
        relative, around = _relative(self.view.rectified(grey))
        blocks = _shrunk(relative, BLOCK)
        moving = self._movement(blocks, _shrunk(around, BLOCK))
        cells = _shrunk(relative, CELL)
        to_read = [number for number in range(len(SPOTS)) if self._follow(number, moving, cells, frame.index)]
        closely = [number for number in attention if self._spots[number].still]
        to_read += [number for number in closely if number not in to_read]
        tags = self._read_tags(grey, [number for number in to_read if number not in closely], closely)
        places = tuple(self._seen(number, number in to_read) for number in range(len(SPOTS)))
        reaching, sides = self._reached(blocks)
        return Sighting(frame.index, frame.time, changed, tuple(tags), reaching, places, sides)

    def cut_out(self, image: Picture, spot: int) -> Picture:
        """The picture of a place, seen from straight above, `view.MAP_SCALE` pixels per mm."""
        place, (half_width, half_height) = SPOTS[spot], half_size(SPOTS[spot])
        return self.view.rectified(image)[
            max(round(place.y - half_height - 12), 0) : round(place.y + half_height + 12),
            max(round(place.x - half_width - 12), 0) : round(place.x + half_width + 12),
        ].copy()

    def _reached(self, blocks: NDArray[np.float32]) -> tuple[bool, tuple[int, ...]]:
        """Whether something reaches over the edge of the field, and over which sides: the edge looks otherwise than it did."""
        coarse = _shrunk(blocks, EDGE)
        sides = [coarse[-1], coarse[:, 0], coarse[0], coarse[:, -1]]
        edge = np.concatenate(sides)
        if self._edge is None:
            self._edge = edge
        change = np.abs(edge - self._edge)
        self._edge += EDGE_ADAPT * (edge - self._edge)
        noise = float(np.median(change)) / 0.6745
        changed = change > max(EDGE_CHANGE, MOVEMENT_SIGMAS * noise)
        of_sides = np.split(changed, np.cumsum([len(side) for side in sides])[:-1])
        reached = tuple(number for number, side in enumerate(of_sides) if np.count_nonzero(side) >= EDGE_BLOCKS)
        return int(np.count_nonzero(changed)) >= EDGE_BLOCKS, reached

    def _movement(self, blocks: NDArray[np.float32], around: NDArray[np.float32]) -> NDArray[np.bool_] | None:
        """Which blocks of the map, with the brightness of their surroundings, moved since the last frame; None: all of them."""
        before, self._before = self._before, blocks
        if before is None:
            return None
        change = cv2.absdiff(blocks, before)
        noise = float(np.median(change * around)) / 0.6745
        return np.asarray(change > np.maximum(MOVEMENT, MOVEMENT_SIGMAS * noise / around))

    def _follow(self, number: int, moving: NDArray[np.bool_] | None, cells: NDArray[np.float32], frame: int) -> bool:
        """Follows a place through the frame, and returns whether its tags should be read."""
        spot = self._spots[number]
        if moving is None or np.count_nonzero(moving[_OUTER[number]]) >= MOVING_BLOCKS:
            spot.still, spot.average = 0, None
            return False
        spot.still += 1
        seen = cells[_CORE[number]]
        if spot.average is None:
            spot.average = seen.copy()
        else:
            spot.average += (seen - spot.average) / min(spot.still, AVERAGE_FRAMES)
        if spot.still == STILL_FRAMES:
            spot.recognize(spot.average)
        elif spot.still > STILL_FRAMES:
            spot.looks[spot.look] += ADAPT * (seen - spot.looks[spot.look])
        return spot.still <= READ_FRAMES or frame % REFRESH_FRAMES == number

    def _read_tags(self, grey: Picture, spots: list[int], closely: list[int]) -> list[SeenTag]:
        """The tags around some places, each once."""
        assert self._tags is not None, "the field was found"
        found: list[SeenTag] = []
        areas = [(area, False) for area in _merged([_AREA[number] for number in spots])]
        areas += [(area, True) for area in _merged([_AREA[number] for number in closely])]
        for (left, top, right, bottom), fine in areas:
            outline = np.array([[left, top], [right, top], [right, bottom], [left, bottom]])
            pixels = self.view.to_pixels(outline)
            first, last = np.maximum(pixels.min(axis=0), 0).astype(int), np.maximum(pixels.max(axis=0), 0).astype(int)
            for tag in self._tags.read(grey, first[0], first[1], last[0], last[1], fine):
                seen = self._on_table(tag)
                if seen is not None and all(
                    other.number != seen.number or np.hypot(other.x - seen.x, other.y - seen.y) > 5 for other in found
                ):
                    found.append(seen)
        return found

    def _on_table(self, tag: Tag) -> SeenTag | None:
        """A tag in mm; None if it has not the size of a card's tag."""
        corners = self.view.to_table(tag.corners)
        edges = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T) / field.CARD_TAG_SIZE
        if tag.number >= FIELD_TAGS or edges.min() < TAG_SIZES[0] or edges.max() > TAG_SIZES[1]:
            return None
        x, y = corners.mean(axis=0)
        across = corners[1] - corners[0]
        angle = float(np.degrees(np.arctan2(across[1], across[0])))
        return SeenTag(tag.number, round(float(x), 2), round(float(y), 2), round(angle, 1), tag.hamming, round(tag.margin, 1))

    def learn_empty(self, number: int) -> None:
        """Remembers the present look of a place, an index of `SPOTS`, as that of the empty place."""
        spot = self._spots[number]
        spot.empty = None if spot.average is None else spot.average.copy()

    def _seen(self, number: int, read: bool) -> SeenPlace:
        """What a place shows in this frame."""
        spot = self._spots[number]
        if spot.average is None or spot.still < STILL_FRAMES:
            return SeenPlace(spot.still, spot.look, None, read)
        if spot.empty is None:
            if spot.still < EMPTY_FRAMES:
                return SeenPlace(spot.still, spot.look, None, read)
            if float(np.abs(spot.average - spot.average.mean()).mean()) > PLAIN:
                return SeenPlace(spot.still, spot.look, False, read)
            self.learn_empty(number)
            return SeenPlace(spot.still, spot.look, True, read)
        empty = difference(spot.average, spot.empty) <= EMPTY
        if empty:
            spot.empty += ADAPT * (spot.average - spot.empty)
        return SeenPlace(spot.still, spot.look, empty, read)


def difference(one: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """The mean difference of two looks, relative to the local brightness."""
    return float(cv2.norm(one, other, cv2.NORM_L1)) / one.size


def _relative(grey: Picture) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The map relative to the brightness of its surroundings (about 1: without shadows and changes of light), and the latter."""
    values = grey.astype(np.float32)
    around = np.asarray(cv2.blur(values, (SURROUNDINGS, SURROUNDINGS)), dtype=np.float32) + np.float32(8.0)
    return np.asarray(cv2.divide(values, around), dtype=np.float32), around


def _shrunk(relative: NDArray[np.float32], step: int) -> NDArray[np.float32]:
    """The map with pixels of `step` mm."""
    return np.asarray(cv2.resize(relative, None, fx=1 / step, fy=1 / step, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _slices(place: field.Place, grow: tuple[float, float], step: int) -> tuple[slice, slice]:
    """The part of a map with cells of `step` mm that shows a place, made bigger by `grow` mm on each side."""
    half_width, half_height = half_size(place)
    if place.angle % 180 == 90:
        grow = (grow[1], grow[0])
    left, right = place.x - half_width - grow[0], place.x + half_width + grow[0]
    top, bottom = place.y - half_height - grow[1], place.y + half_height + grow[1]
    return (
        slice(max(round(top / step), 0), min(round(bottom / step), round(field.HEIGHT) // step)),
        slice(max(round(left / step), 0), min(round(right / step), round(field.WIDTH) // step)),
    )


_OUTER = [_slices(place, (NEAR, NEAR), BLOCK) for place in SPOTS]
_CORE = [_slices(place, (-CORE[0], -CORE[1]), CELL) for place in SPOTS]
_AREA = [
    (
        place.x - half_size(place)[0] - READ_MARGIN,
        place.y - half_size(place)[1] - READ_MARGIN,
        place.x + half_size(place)[0] + READ_MARGIN,
        place.y + half_size(place)[1] + READ_MARGIN,
    )
    for place in SPOTS
]


def _merged(areas: list[tuple[float, float, float, float]]) -> list[tuple[float, float, float, float]]:
    """Rectangles that overlap much, joined: each part of a picture should be searched only once."""
    joined: list[tuple[float, float, float, float]] = []
    for area in sorted(areas):
        for number, other in enumerate(joined):
            union = (min(area[0], other[0]), min(area[1], other[1]), max(area[2], other[2]), max(area[3], other[3]))
            if _surface(union) < _surface(area) + _surface(other):
                joined[number] = union
                break
        else:
            joined.append(area)
    return joined


def _surface(area: tuple[float, float, float, float]) -> float:
    """The surface of a rectangle, in mm²."""
    return (area[2] - area[0]) * (area[3] - area[1])
