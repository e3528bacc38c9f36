"""A second camera that looks at a robot's own hand: the cards in the row before its strip.

Print the strip, stand it behind the row, and point the camera at it. Each card shows its left part with one tag.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from chefshat_robot import field
from chefshat_robot.deck import HAND_TAGS, Card, piece_of_tag

from .camera import Camera
from .events import Picture
from .frames import Frame
from .tags import Tag, TagReader

HAND_FRAMES = 5
"""A hand is reported when the same cards were seen in so many frames in a row."""
MIN_CORNERS = 3
"""Corner tags of the strip that must be seen: fewer, and an arm is before it."""
TAG_SIZES = (0.75, 1.4)
"""Smallest and biggest size of a tag that is believed, as a part of the printed size. Cards stand nearer than the strip."""


@dataclass(frozen=True)
class HandSeen:
    """The hand holds these cards.

    A card that cannot be read is missing here: compare the count with the one the game knows, and look again if it differs.

    Attributes:
        frame: Number of the frame that made it certain.
        time: Time of that frame in s.
        cards: The cards, in their order.
    """

    frame: int
    time: float
    cards: tuple[Card, ...]


class HandReader:
    """Reads the hand from frames of its camera.

    Args:
        camera: The intrinsics of the camera; None: a lens without distortion is assumed.
        deck: The deck that is played with, 0..6. None: any deck.
    """

    def __init__(self, camera: Camera | None = None, deck: int | None = None) -> None:
        self._camera = camera
        self._deck = deck
        self._reader = TagReader(40.0)
        self._recent: deque[frozenset[Card]] = deque(maxlen=HAND_FRAMES)
        self._reported: frozenset[Card] | None = None

    def see(self, frame: Frame) -> HandSeen | None:
        """Takes in the next frame, and returns the hand if it changed and is certain.

        Raises:
            ValueError: The camera was calibrated for pictures of other proportions.
        """
        grey = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        tags = self._reader.read(grey, fine=True)
        to_strip = self._find_strip(tags, grey)
        if to_strip is None:
            self._recent.clear()
            return None
        seen = self._cards(tags, to_strip, grey)
        self._recent.append(seen)
        if len(self._recent) < HAND_FRAMES or any(other != seen for other in self._recent) or seen == self._reported:
            return None
        self._reported = seen
        return HandSeen(frame.index, frame.time, tuple(sorted(seen)))

    def _flat(self, points: NDArray[np.float64], grey: Picture) -> NDArray[np.float64]:
        """Points of the picture without the lens's distortion; shape (n, 2), pixels."""
        if self._camera is None:
            return points
        return self._camera.scaled(grey.shape[1], grey.shape[0]).undistort(points)

    def _find_strip(self, tags: list[Tag], grey: Picture) -> NDArray[np.float64] | None:
        """The homography from pixels without distortion to mm on the strip; None if an arm or something else hides it."""
        corners = {tag.number - HAND_TAGS: tag for tag in tags if 0 <= tag.number - HAND_TAGS < len(field.hand_tags())}
        if len(corners) < MIN_CORNERS:
            return None
        half = field.CARD_TAG_SIZE / 2
        outline = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
        seen = self._flat(np.concatenate([tag.corners for tag in corners.values()]), grey)
        true = np.concatenate([outline + np.array(field.hand_tags()[corner]) for corner in corners])
        found, _ = cv2.findHomography(seen, true)
        return None if found is None else np.asarray(found, dtype=np.float64)

    def _cards(self, tags: list[Tag], to_strip: NDArray[np.float64], grey: Picture) -> frozenset[Card]:
        """The cards whose tags lie before the strip."""
        found: set[Card] = set()
        for tag in tags:
            piece = piece_of_tag(tag.number)
            card = piece.card if piece is not None else None
            if card is None or self._deck not in (None, card.deck) or tag.hamming > 1:
                continue
            corners = np.asarray(
                cv2.perspectiveTransform(self._flat(tag.corners, grey).reshape(-1, 1, 2), to_strip), dtype=np.float64
            ).reshape(4, 2)
            edges = np.hypot(*(np.roll(corners, -1, axis=0) - corners).T) / field.CARD_TAG_SIZE
            x, y = corners.mean(axis=0)
            inside = -field.CARD_WIDTH < x < field.HAND_WIDTH + field.CARD_WIDTH and -field.CARD_HEIGHT < y < 2 * field.CARD_HEIGHT
            if inside and edges.min() > TAG_SIZES[0] and edges.max() < TAG_SIZES[1]:
                found.add(card)
        return frozenset(found)
