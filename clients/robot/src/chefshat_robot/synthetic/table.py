"""The synthetic table: plays a script before a camera and gives the frames, each with the truth.

A lens, its place above the table, light and noise are drawn from the seed. The still part of a frame is kept between changes, and
what moves is painted over it, so that a frame costs a few milliseconds.
"""

from __future__ import annotations

import itertools
import math
from bisect import insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from chefshat_robot import field
from chefshat_robot.deck import Card, Piece, PieceKind
from chefshat_robot.vision.camera import Camera
from chefshat_robot.vision.events import Picture
from chefshat_robot.vision.frames import Frame

from . import artwork
from .difficulty import Difficulty
from .script import NEXT_PLACE_TIME, REACH_TIME, SWEEP_TIME, Act, Clear, Hover, LayCards, ShowPass, TakeBack, WithdrawPass, duration

_SHOULDERS = ((280.0, 760.0), (-360.0, 200.0), (280.0, -360.0), (920.0, 200.0))
"""Where the arms of the seats come from, mm on the table."""
_GRIP = 22.0
"""Distance from the finger tips to the centre of a card they hold, in mm."""
_CARRY_HEIGHT = 45.0
"""Height of a hand on its way, in mm above the table."""
_TREMBLE = 1.2
"""How far a hand that holds still moves about, in mm."""
_MAP_STEP = 8.0
"""The lens is computed for one pixel in so many, in each direction, and interpolated between."""
_LIGHT_UNIT = 150.0
"""Grey level of the light map at which the light is as painted."""


@dataclass(frozen=True)
class Lying:
    """A piece that lies on the table.

    Attributes:
        piece: The piece.
        place: The place it was laid at: 1..11, or the seat for a pass card.
        x: Centre, mm on the field.
        y: Centre, mm on the field.
        angle: Degrees it is turned clockwise.
        since: When it came to rest, in s.
        face_down: Whether its back is up.
        smudged: Whether its two tags cannot be read.
    """

    piece: Piece
    place: int
    x: float
    y: float
    angle: float
    since: float
    face_down: bool = False
    smudged: tuple[bool, bool] = (False, False)


@dataclass(frozen=True)
class TrueEvent:
    """Something that truly happened.

    Attributes:
        kind: `laid`, `taken_back`, `cleared`, `pass_shown` or `pass_withdrawn`, as events are named.
        time: When it was complete, in s: the last card at rest, or the last card taken from its place.
        cards: The cards laid or taken back.
        places: The place of each card, 1..11.
        seat: Whose hand did it.
    """

    kind: str
    time: float
    seat: int
    cards: tuple[Card, ...] = ()
    places: tuple[int, ...] = ()


@dataclass(frozen=True)
class FrameTruth:
    """What is true while a frame is taken.

    Attributes:
        index: Number of the frame.
        time: Its time, in s.
        lying: What lies on the table, the lowest first.
        hands: How many hands are over the table.
    """

    index: int
    time: float
    lying: tuple[Lying, ...]
    hands: int


@dataclass(frozen=True)
class Bump:
    """The camera is pushed: from `time` on it stands `shift` mm elsewhere and is turned by `turn` degrees."""

    time: float
    shift: tuple[float, float]
    turn: float = 0.0


@dataclass
class _Gesture:
    """A hand's way over the table: key points (time, x, y, height) of its finger tips, and the pieces that move with it."""

    seat: int
    keys: list[tuple[float, float, float, float]]
    carried: list[tuple[Lying, float, float, tuple[float, float] | None]] = dataclass_field(default_factory=list)
    """Piece, from when, until when, and its offset from the finger tips (None: held in the grip)."""

    def at(self, time: float) -> tuple[float, float, float]:
        """Where the finger tips are; x, y and height, mm."""
        times = [key[0] for key in self.keys]
        after = next((number for number, key_time in enumerate(times) if key_time > time), len(times) - 1)
        before = max(after - 1, 0)
        span = times[after] - times[before]
        part = min(max((time - times[before]) / span if span else 1.0, 0.0), 1.0)
        part = part * part * (3 - 2 * part)
        x, y, height = (a + (b - a) * part for a, b in zip(self.keys[before][1:], self.keys[after][1:], strict=True))
        x += _TREMBLE * (math.sin(time * 11.0) + math.sin(time * 17.3 + 1)) / 2
        y += _TREMBLE * (math.cos(time * 13.1) + math.sin(time * 19.7 + 2)) / 2
        return x, y, height


def _direction(seat: int, x: float, y: float) -> tuple[float, float]:
    """The unit vector from a seat's shoulder to a point."""
    dx, dy = x - _SHOULDERS[seat][0], y - _SHOULDERS[seat][1]
    length = math.hypot(dx, dy)
    return dx / length, dy / length


def _grip(seat: int, x: float, y: float) -> tuple[float, float]:
    """Where the finger tips are when they hold a card whose centre is at a point."""
    dx, dy = _direction(seat, x, y)
    return x - dx * _GRIP, y - dy * _GRIP


def _outside(seat: int, x: float, y: float) -> tuple[float, float]:
    """Where a hand on its way to a point comes from: on the line to the shoulder, well off the field."""
    dx, dy = _direction(seat, x, y)
    distance = 0.0
    margin = 110.0
    while -margin < x - dx * distance < field.WIDTH + margin and -margin < y - dy * distance < field.HEIGHT + margin:
        distance += 10.0
    return x - dx * distance, y - dy * distance


class SyntheticTable:
    """A table on which a script is played, seen by a camera.

    The same arguments give the same frames.

    Args:
        acts: What happens, in the order of the times.
        difficulty: The disturbances.
        seed: Decides the camera's place, how cards lie, light and noise.
        size: Width and height of the frames in pixels: (1280, 720) or (1920, 1080), or others.
        fps: Frames per second.
        bumps: Pushes of the camera.
        deck_number: Deck of the pass cards.
        tail: How long the frames go on after the last act, in s.

    Attributes:
        camera: The intrinsics of its camera.
        true_events: What truly happens, in the order of the times.
    """

    def __init__(
        self,
        acts: Sequence[Act],
        difficulty: Difficulty,
        seed: int = 0,
        size: tuple[int, int] = (1280, 720),
        fps: float = 15.0,
        bumps: Sequence[Bump] = (),
        deck_number: int = 0,
        tail: float = 2.0,
    ) -> None:
        self.difficulty = difficulty
        self.seed = seed
        self.fps = fps
        self.size = size
        self.true_events: list[TrueEvent] = []
        self._deck = deck_number
        self._bumps = sorted(bumps, key=lambda bump: bump.time)
        self._gestures: list[_Gesture] = []
        self._changes: list[tuple[float, bool, Lying]] = []
        """Time, whether the piece is laid (else taken), and the piece."""
        self._lying: list[Lying] = []
        """What lies on the table when all acts are done."""
        self._rng = np.random.default_rng((seed, 1))
        for act in sorted(acts, key=lambda act: act.start):
            self.perform(act)
        self.duration = self.busy_until + tail
        rng = np.random.default_rng((seed, 2))
        width, height = size
        focal = width * rng.uniform(0.88, 1.0)
        matrix = np.array(
            [[focal, 0, width * rng.uniform(0.49, 0.51)], [0, focal, height * rng.uniform(0.49, 0.51)], [0, 0, 1]], dtype=np.float64
        )
        k1 = difficulty.distortion
        lens = np.array([k1, k1 * k1 * 0.4, rng.uniform(-1, 1) * 0.002, rng.uniform(-1, 1) * 0.002, 0.0])
        self.camera = Camera(width, height, matrix, lens)
        axis = rng.uniform(-0.6, 0.6) + rng.choice([0.0, math.pi])
        tilt = math.radians(difficulty.tilt)
        tilted = cv2.Rodrigues(np.array([math.cos(axis), math.sin(axis), 0.0]) * tilt)[0]
        self._rotation = np.asarray(tilted @ cv2.Rodrigues(np.array([0.0, 0.0, rng.uniform(-0.05, 0.05)]))[0], dtype=np.float64)
        self._centre = np.array([field.WIDTH / 2, field.HEIGHT / 2, 0.0])
        self._distance = self._fitting_distance()
        self._table = artwork.table_picture(seed)
        self._light = _Light(difficulty, size, seed)

    # The plan: acts become ways of hands and changes of what lies there.

    @property
    def busy_until(self) -> float:
        """When the last hand has left the table, in s."""
        return max((gesture.keys[-1][0] for gesture in self._gestures), default=0.0)

    def perform(self, act: Act) -> None:
        """Adds an act, which must not start before those added so far. While frames are taken, it starts after the last frame."""
        rng, lying = self._rng, self._lying
        places, pass_places = field.places(), field.pass_places()
        if isinstance(act, LayCards):
            pieces = [
                (Piece(PieceKind.CARD, card.deck, card.index), place) for card, place in zip(act.cards, act.places, strict=True)
            ]
            laid = self._lay(
                act.start, act.seat, [(piece, place, places[place - 1]) for piece, place in pieces], act.face_down, rng
            )
            lying += laid
            self._happened("laid", laid[-1].since, act.seat, act.cards, act.places)
        elif isinstance(act, ShowPass):
            pass_card = Piece(PieceKind.PASS, self._deck, act.seat)
            laid = self._lay(act.start, act.seat, [(pass_card, act.seat, pass_places[act.seat])], act.face_down, rng)
            lying += laid
            self._happened("pass_shown", laid[-1].since, act.seat)
        elif isinstance(act, Hover):
            place = places[act.place - 1]
            start, held = _outside(act.seat, place.x, place.y), _grip(act.seat, place.x, place.y)
            arrived = act.start + REACH_TIME
            keys = [
                (act.start, *start, _CARRY_HEIGHT),
                (arrived, *held, _CARRY_HEIGHT / 2),
                (arrived + act.duration, *held, _CARRY_HEIGHT / 2),
                (arrived + act.duration + REACH_TIME, *start, _CARRY_HEIGHT),
            ]
            gesture = _Gesture(act.seat, keys)
            if act.card is not None:
                piece = Piece(PieceKind.CARD, act.card.deck, act.card.index)
                gesture.carried.append((Lying(piece, act.place, place.x, place.y, 0.0, 0.0), act.start, keys[-1][0], None))
            self._gestures.append(gesture)
        else:
            taken = self._taken(act, lying)
            lying[:] = [piece for piece in lying if piece not in taken]
            self._take(act, taken)

    def _happened(self, kind: str, time: float, seat: int, cards: tuple[Card, ...] = (), places: tuple[int, ...] = ()) -> None:
        self.true_events.append(TrueEvent(kind, time, seat, cards, places))
        self.true_events.sort(key=lambda true_event: true_event.time)

    def _lay(
        self, start: float, seat: int, pieces: list[tuple[Piece, int, field.Place]], face_down: bool, rng: np.random.Generator
    ) -> list[Lying]:
        """Plans a hand that lays pieces one after the other, and returns how they lie."""
        difficulty = self.difficulty
        keys = [(start, *_outside(seat, pieces[0][2].x, pieces[0][2].y), _CARRY_HEIGHT)]
        laid: list[Lying] = []
        gesture = _Gesture(seat, keys)
        for number, (piece, place_number, place) in enumerate(pieces):
            time = start + REACH_TIME + NEXT_PLACE_TIME * number
            dx, dy = np.clip(rng.normal(0, difficulty.shift, 2), -2.2 * difficulty.shift, 2.2 * difficulty.shift)
            angle = place.angle + float(np.clip(rng.normal(0, difficulty.turn), -2.2 * difficulty.turn, 2.2 * difficulty.turn))
            angle += 180.0 * float(rng.random() < difficulty.upside_down)
            first, second = (bool(smudge) for smudge in rng.random(2) < difficulty.smudged)
            lies = Lying(piece, place_number, place.x + float(dx), place.y + float(dy), angle, time, face_down, (first, second))
            laid.append(lies)
            keys.append((time, *_grip(seat, lies.x, lies.y), 2.0))
            gesture.carried.append((lies, start, time, None))
            insort(self._changes, (time, True, lies), key=lambda change: change[0])
        end = keys[-1][0] + REACH_TIME
        last = pieces[-1][2]
        keys.append((end, *_outside(seat, last.x, last.y), _CARRY_HEIGHT))
        self._gestures.append(gesture)
        return laid

    @staticmethod
    def _taken(act: Clear | WithdrawPass | TakeBack, lying: list[Lying]) -> list[Lying]:
        """What an act takes off the table, in the order of places."""
        if isinstance(act, WithdrawPass):
            return [piece for piece in lying if piece.piece.kind is PieceKind.PASS and piece.place == act.seat]
        cards = [piece for piece in lying if piece.piece.kind is PieceKind.CARD]
        if isinstance(act, TakeBack):
            return [[card for card in cards if card.place == place][-1] for place in act.places]
        return sorted(cards, key=lambda card: card.place)

    def _take(self, act: Clear | WithdrawPass | TakeBack, taken: list[Lying]) -> None:
        """Plans a hand that takes pieces away with it."""
        stops = sorted({(piece.place, piece.piece.kind) for piece in taken}, key=lambda stop: stop[0])
        span = duration(act) - 2 * REACH_TIME
        first = taken[0]
        keys = [(act.start, *_outside(act.seat, first.x, first.y), _CARRY_HEIGHT)]
        gesture = _Gesture(act.seat, keys)
        times: dict[int, float] = {}
        for number, (place, _) in enumerate(stops):
            stack = [piece for piece in taken if piece.place == place]
            time = act.start + REACH_TIME + span * number / max(len(stops) - 1, 1)
            times[place] = time
            keys.append((time, *_grip(act.seat, stack[-1].x, stack[-1].y), 2.0))
        if isinstance(act, Clear) and len(stops) == 1:
            keys.append((act.start + REACH_TIME + SWEEP_TIME, keys[-1][1], keys[-1][2], 2.0))
            times = {stops[0][0]: keys[-1][0]}
        last = taken[-1]
        end = keys[-1][0] + REACH_TIME
        keys.append((end, *_outside(act.seat, last.x, last.y), _CARRY_HEIGHT / 3))
        for piece in taken:
            time = times[piece.place]
            x, y, _ = gesture.at(time)
            gesture.carried.append((piece, time, end, (piece.x - x, piece.y - y)))
            insort(self._changes, (time, False, piece), key=lambda change: change[0])
        self._gestures.append(gesture)
        cards = tuple(card for piece in taken if (card := piece.piece.card) is not None)
        places = tuple(piece.place for piece in taken)
        if isinstance(act, WithdrawPass):
            self._happened("pass_withdrawn", times[act.seat], act.seat)
        elif isinstance(act, TakeBack):
            self._happened("taken_back", max(times.values()), act.seat, cards, places)
        else:
            self._happened("cleared", max(times.values()), act.seat)

    # The camera.

    def _project(self, points: NDArray[np.float64], height: float = 0.0) -> NDArray[np.float64]:
        """Where the camera shows points of the table; shape (n, 2), mm to pixels. The height is in mm above the table."""
        world = np.column_stack([points, np.full(len(points), -height)]) - self._centre
        seen = world @ self._rotation.T + np.array([0.0, 0.0, self._distance])
        zero = np.zeros(3)
        found, _ = cv2.projectPoints(np.ascontiguousarray(seen), zero, zero, self.camera.matrix, self.camera.distortion)
        return np.asarray(found, dtype=np.float64).reshape(-1, 2)

    def _fitting_distance(self) -> float:
        """The distance from the field at which the camera just shows all of it, in mm."""
        edge = 12.0
        corners = np.array(
            [[-edge, -edge], [field.WIDTH + edge, -edge], [field.WIDTH + edge, field.HEIGHT + edge], [-edge, field.HEIGHT + edge]]
        )
        near, far = 300.0, 4000.0
        for _ in range(30):
            self._distance = (near + far) / 2
            inside = self._project(corners)
            fits = bool(np.all(inside > 0) and np.all(inside < np.array(self.size)))
            near, far = (near, self._distance) if fits else (self._distance, far)
        return far

    def _table_maps(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """For each pixel, where in the picture of the table it looks."""
        width, height = self.size
        xs, ys = np.meshgrid(np.arange(0.0, width + _MAP_STEP, _MAP_STEP), np.arange(0.0, height + _MAP_STEP, _MAP_STEP))
        pixels = self.camera.undistort(np.column_stack([xs.ravel(), ys.ravel()]))
        rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(self.camera.matrix).T @ self._rotation
        eye = -np.array([0.0, 0.0, self._distance]) @ self._rotation
        reach = -eye[2] / rays[:, 2]
        points = (eye[:2] + rays[:, :2] * reach[:, None] + self._centre[:2] + artwork.TABLE_MARGIN) * artwork.TABLE_SCALE
        coarse = points.reshape(*xs.shape, 2).astype(np.float32)
        enlarge = np.diag([1 / _MAP_STEP, 1 / _MAP_STEP])
        between = cv2.warpAffine(
            coarse, np.column_stack([enlarge, [0.0, 0.0]]), (width, height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        )
        first, second = cv2.split(between)
        map_xy, map_fraction = cv2.convertMaps(first, second, cv2.CV_16SC2)
        return np.asarray(map_xy), np.asarray(map_fraction)

    def _push(self, bump: Bump) -> None:
        """Moves the camera."""
        self._centre = self._centre + np.array([*bump.shift, 0.0])
        self._rotation = np.asarray(
            cv2.Rodrigues(np.array([0.0, 0.0, math.radians(bump.turn)]))[0] @ self._rotation, dtype=np.float64
        )

    # Painting.

    @property
    def _scale(self) -> float:
        """Pixels per mm about the middle of the field."""
        middle = np.array([[280.0, 200.0], [330.0, 200.0], [280.0, 250.0]])
        points = self._project(middle)
        return float(max(np.linalg.norm(points[1] - points[0]), np.linalg.norm(points[2] - points[0])) / 50.0)

    def _paint_piece(
        self, image: Picture, lies: Lying, height: float, smear: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[int, int, int, int] | None:
        """Paints a piece and returns the changed rectangle (left, top, right, bottom), or None if it is out of sight."""
        art = _scaled_piece(lies.piece, lies.face_down, lies.smudged, round(min(self._scale * 1.5, artwork.PIECE_SCALE), 1))
        half = (field.CARD_WIDTH / 2 + artwork.PIECE_MARGIN, field.CARD_HEIGHT / 2 + artwork.PIECE_MARGIN)
        outline = np.array([[-half[0], -half[1]], [half[0], -half[1]], [half[0], half[1]], [-half[0], half[1]]])
        target = self._project(artwork.placed((lies.x, lies.y), lies.angle, outline), height)
        art_height, art_width = art.shape[:2]
        source = np.array([[0, 0], [art_width, 0], [art_width, art_height], [0, art_height]], np.float32) - 0.5
        warp = cv2.getPerspectiveTransform(source, target.astype(np.float32))
        return _blend(image, art, np.asarray(warp, dtype=np.float64), target, smear)

    def _paint_hand(
        self, image: Picture, gesture: _Gesture, time: float, smear: tuple[float, float]
    ) -> tuple[int, int, int, int] | None:
        """Paints a hand with its shadow and returns the changed rectangle."""
        art = artwork.hand_picture(gesture.seat)
        x, y, height = gesture.at(time)
        dx, dy = _direction(gesture.seat, x, y)
        near = np.array([[x, y], [x - dx * 100, y - dy * 100], [x - dy * 50, y + dx * 50]])
        target = self._project(near, height + 15.0)
        middle = artwork.HAND_SIZE[0] / 2
        source = np.array([[middle, 0], [middle, 100], [middle + 50, 0]], np.float32) * artwork.HAND_SCALE
        warp = np.vstack([cv2.getAffineTransform(source, target.astype(np.float32)), [0, 0, 1]])
        width, length = artwork.HAND_SIZE[0] * artwork.HAND_SCALE, artwork.HAND_SIZE[1] * artwork.HAND_SCALE
        corners = np.array([[0, 0, 1], [width, 0, 1], [width, length, 1], [0, length, 1]]) @ warp.T
        return _blend(image, art, warp, corners[:, :2], smear, shadow=0.3 + height / 300)

    def frames(self) -> Iterator[tuple[Frame, FrameTruth]]:
        """The frames with their truth, from the start."""
        _width, height = self.size
        blur = self.difficulty.blur * height / 720
        maps = self._table_maps()
        done = 0
        bumps = list(self._bumps)
        lying: list[Lying] = []
        still, sharp = self._still(maps, lying, blur)
        for index in itertools.count():
            if index + 1 > self.duration * self.fps:
                return
            time = index / self.fps
            changed = False
            while bumps and bumps[0].time <= time:
                self._push(bumps.pop(0))
                maps = self._table_maps()
                changed = True
            laid: list[Lying] = []
            while done < len(self._changes) and self._changes[done][0] <= time:
                _, is_laid, piece = self._changes[done]
                done += 1
                if is_laid:
                    lying.append(piece)
                    laid.append(piece)
                else:
                    lying.remove(piece)
                    changed = True
            if changed:
                still, sharp = self._still(maps, lying, blur)
            else:
                for piece in laid:
                    _soften(still, sharp, self._paint_piece(sharp, piece, 0.0), blur)
            image = still
            active = [gesture for gesture in self._gestures if gesture.keys[0][0] <= time < gesture.keys[-1][0]]
            if active:
                image = still.copy()
                moving = sharp.copy()
                for gesture in active:
                    for rectangle in self._paint_gesture(moving, gesture, time):
                        _soften(image, moving, rectangle, blur)
            yield (
                Frame(index, time, self._light.apply(image, index, time)),
                FrameTruth(index, time, tuple(lying), len(active)),
            )

    def _still(self, maps: tuple[NDArray[Any], NDArray[Any]], lying: Sequence[Lying], blur: float) -> tuple[Picture, Picture]:
        """The table with what lies on it, as the lens shows it, and the same without blur."""
        sharp = np.asarray(
            cv2.remap(self._table, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT), dtype=np.uint8
        )
        for piece in lying:
            self._paint_piece(sharp, piece, 0.0)
        return np.asarray(cv2.GaussianBlur(sharp, (0, 0), blur), dtype=np.uint8), sharp

    def _paint_gesture(self, image: Picture, gesture: _Gesture, time: float) -> list[tuple[int, int, int, int]]:
        """Paints a hand and what it carries, and returns the changed rectangles."""
        x, y, height = gesture.at(time)
        before = gesture.at(time - self.difficulty.exposure)
        ends = self._project(np.array([[before[0], before[1]], [x, y]]))
        smear = (float(abs(ends[1, 0] - ends[0, 0])), float(abs(ends[1, 1] - ends[0, 1])))
        dx, dy = _direction(gesture.seat, x, y)
        rectangles = []
        held = [entry for entry in gesture.carried if entry[1] <= time < entry[2]]
        for number, (piece, _, _, offset) in enumerate(held):
            at = (x + dx * _GRIP, y + dy * _GRIP) if offset is None else (x + offset[0], y + offset[1])
            carried = replace(piece, x=at[0] + number * 1.5, y=at[1])
            rectangles.append(self._paint_piece(image, carried, height + number * 0.4, smear))
        rectangles.append(self._paint_hand(image, gesture, time, smear))
        return [rectangle for rectangle in rectangles if rectangle is not None]


@lru_cache(maxsize=400)
def _scaled_piece(piece: Piece, face_down: bool, smudged: tuple[bool, bool], scale: float) -> Picture:
    """A piece's picture at a scale in pixels per mm."""
    art = artwork.piece_picture(piece, face_down, smudged)
    factor = scale / artwork.PIECE_SCALE
    return np.asarray(cv2.resize(art, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _blend(
    image: Picture,
    art: Picture,
    warp: NDArray[np.float64],
    corners: NDArray[np.float64],
    smear: tuple[float, float],
    shadow: float = 0.0,
) -> tuple[int, int, int, int] | None:
    """Paints a warped BGRA picture over an image; `smear` is how far it moves while the shutter is open, in pixels."""
    reach = 40 if shadow else 3
    extra = (round(smear[0]) + reach, round(smear[1]) + reach)
    left, top = (max(math.floor(corners[:, axis].min()) - extra[axis], 0) for axis in (0, 1))
    right = min(math.ceil(corners[:, 0].max()) + extra[0], image.shape[1])
    bottom = min(math.ceil(corners[:, 1].max()) + extra[1], image.shape[0])
    if right - left < 8 or bottom - top < 8:
        return None
    moved = np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1]], dtype=np.float64) @ warp
    layer = cv2.warpPerspective(art, moved, (right - left, bottom - top), flags=cv2.INTER_LINEAR)
    if max(smear) > 1.5:
        layer = cv2.blur(layer, (max(round(smear[0]), 1), max(round(smear[1]), 1)))
    region = image[top:bottom, left:right]
    alpha = layer[..., 3]
    if shadow:
        small = cv2.resize(alpha, None, fx=0.125, fy=0.125, interpolation=cv2.INTER_AREA)
        small = cv2.GaussianBlur(small, (0, 0), 2.0)
        soft = cv2.resize(small, (right - left, bottom - top))
        soft = cv2.warpAffine(soft, np.array([[1, 0, 16.0], [0, 1, 12.0]]), (right - left, bottom - top))
        darker = cv2.convertScaleAbs(soft, alpha=-min(shadow, 0.6), beta=255.0)
        cv2.multiply(region, cv2.merge([darker, darker, darker]), region, scale=1 / 255)
    inverse = cv2.bitwise_not(alpha)
    cv2.multiply(region, cv2.merge([inverse, inverse, inverse]), region, scale=1 / 255)
    cv2.add(region, layer[..., :3], region)
    return left, top, right, bottom


def _soften(target: Picture, sharp: Picture, rectangle: tuple[int, int, int, int] | None, blur: float) -> None:
    """Copies a rectangle of the sharp picture to the target, blurred as by the lens."""
    if rectangle is None:
        return
    edge = math.ceil(3 * blur)
    height, width = sharp.shape[:2]
    left, top, right, bottom = rectangle
    outer = (max(left - 2 * edge, 0), max(top - 2 * edge, 0), min(right + 2 * edge, width), min(bottom + 2 * edge, height))
    inner = (max(left - edge, 0), max(top - edge, 0), min(right + edge, width), min(bottom + edge, height))
    soft = cv2.GaussianBlur(sharp[outer[1] : outer[3], outer[0] : outer[2]], (0, 0), blur)
    target[inner[1] : inner[3], inner[0] : inner[2]] = soft[
        inner[1] - outer[1] : inner[3] - outer[1], inner[0] - outer[0] : inner[2] - outer[0]
    ]


class _Light:
    """Light, shadows, reflections and noise over time."""

    _GRID = (64, 36)

    def __init__(self, difficulty: Difficulty, size: tuple[int, int], seed: int) -> None:
        self._difficulty = difficulty
        self._size = size
        self._seed = seed
        rng = np.random.default_rng((seed, 3))
        width, height = self._GRID
        xs, ys = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
        corner = (xs**2 + ys**2) / 2
        slope = rng.uniform(-0.12, 0.12, 2)
        self._vignette = (1 - difficulty.vignette * corner) * (1 + slope[0] * xs + slope[1] * ys)
        self._xs, self._ys = xs, ys
        self._phases = rng.uniform(0, 2 * math.pi, 12)
        self._steps = rng.uniform(-0.5, 0.5, 200)
        self._step_length = rng.uniform(9.0, 15.0)
        self._lamps = [self._lamp(rng, size) for _ in range(3)] if difficulty.glare else []
        tile = (
            rng.normal(0, difficulty.noise, (size[1] + 64, size[0] + 64, 3))
            if difficulty.noise
            else np.zeros((size[1] + 64, size[0] + 64, 3))
        )
        self._more = np.clip(np.round(tile), 0, 255).astype(np.uint8)
        self._less = np.clip(np.round(-tile), 0, 255).astype(np.uint8)

    @staticmethod
    def _lamp(rng: np.random.Generator, size: tuple[int, int]) -> tuple[int, int, Picture]:
        """A reflection: its left, top, and picture at full strength."""
        unit = size[1] / 720
        radius = rng.uniform(28, 50) * unit
        reach = round(radius * 2.5)
        xs, ys = np.meshgrid(np.arange(-reach, reach), np.arange(-reach, reach))
        angle, aspect = rng.uniform(0, math.pi), rng.uniform(0.5, 1.0)
        across = xs * math.cos(angle) + ys * math.sin(angle)
        along = (ys * math.cos(angle) - xs * math.sin(angle)) / aspect
        spot = np.clip(340.0 * np.exp(-(across**2 + along**2) / (2 * (radius * 0.55) ** 2)) - 4.0, 0, 255)
        x = round(rng.uniform(0.2, 0.8) * size[0]) - reach
        y = round(rng.uniform(0.25, 0.75) * size[1]) - reach
        return max(x, 0), max(y, 0), np.repeat(spot[..., None], 3, axis=2).astype(np.uint8)

    def apply(self, image: Picture, index: int, time: float) -> Picture:
        """The image as the sensor sees it."""
        difficulty = self._difficulty
        rng = np.random.default_rng((self._seed, 4, index))
        phases = self._phases
        gain = 1 + difficulty.light_change * 0.35 * math.sin(time * 0.37 + phases[0])
        gain += difficulty.light_change * float(self._steps[int(time / self._step_length) % len(self._steps)])
        gain += difficulty.flicker * float(rng.normal())
        light = self._vignette * gain
        if difficulty.shadows:
            for number in range(2):
                x = 1.2 * math.sin(time * (0.21 + 0.13 * number) + phases[1 + number])
                y = 1.2 * math.cos(time * (0.17 + 0.11 * number) + phases[3 + number])
                distance = ((self._xs - x) / 0.5) ** 2 + ((self._ys - y) / 0.7) ** 2
                light = light * (1 - difficulty.shadows * np.exp(-(distance**2)))
        grey = cv2.resize(np.clip(light * _LIGHT_UNIT, 0, 255).astype(np.uint8), self._size, interpolation=cv2.INTER_LINEAR)
        lit = np.asarray(cv2.multiply(image, cv2.merge([grey, grey, grey]), scale=1 / _LIGHT_UNIT), dtype=np.uint8)
        for number, (left, top, spot) in enumerate(self._lamps):
            strength = difficulty.glare * max(0.0, math.sin(time * (0.31 + 0.07 * number) + phases[6 + number]))
            region = lit[top : top + spot.shape[0], left : left + spot.shape[1]]
            cv2.addWeighted(region, 1.0, spot[: region.shape[0], : region.shape[1]], strength, 0.0, dst=region)
        if difficulty.noise:
            x, y = (int(offset) for offset in rng.integers(0, 64, 2))
            width, height = self._size
            cv2.add(lit, self._more[y : y + height, x : x + width], lit)
            cv2.subtract(lit, self._less[y : y + height, x : x + width], lit)
        return lit
