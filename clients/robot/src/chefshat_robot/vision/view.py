"""Where the camera sees the field: from the tags in its corners to millimetres, also after the camera was moved."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from chefshat_robot import field
from chefshat_robot.deck import FIELD_TAGS

from .camera import Camera
from .events import FieldState, Picture
from .tags import Tag, TagReader

MAP_SCALE = 1.0
"""Pixels per mm of the rectified picture of the field (the *map*)."""
MIN_CORNERS = 3
"""Corner tags that must be seen to find the field."""
CHECK_SECONDS = 0.25
"""How often the corners are looked at, in s."""
MOVED_MM = 2.0
"""A corner tag is displaced if it is seen this far from where it was, in mm."""
MOVED_CHECKS = 2
"""In so many checks in a row two corners must be displaced before the camera counts as moved."""
LOST_SECONDS = 2.0
"""Time without any corner tag until the field counts as lost, in s."""
MAX_FIT_ERROR_MM = 3.0
"""Corner tags that do not fit the field better than this are not believed, in mm. An uncalibrated wide-angle lens needs it."""
_CORNER_REACH = 55.0
"""A corner tag is looked for this far around its centre, in mm."""


_OUTLINE = np.array([[0.0, 0.0], [field.WIDTH, 0.0], [field.WIDTH, field.HEIGHT], [0.0, field.HEIGHT]])


class FieldView:
    """The field as one camera sees it.

    While corners are covered, the last position stays valid.

    Args:
        camera: The intrinsics; None: a lens without distortion is assumed.
    """

    def __init__(self, camera: Camera | None = None) -> None:
        self._camera = camera
        self._undistort: Callable[[NDArray[np.float64]], NDArray[np.float64]] = lambda points: points
        self._distort = self._undistort
        self._reader = TagReader(30.0)
        self._to_table: NDArray[np.float64] | None = None
        self._maps: tuple[NDArray[np.int16], NDArray[np.uint16]] | None = None
        self._checked_at = 0.0
        self._seen_at = 0.0
        self._displaced_checks = 0
        self._lost = False
        self._size = (0, 0)

    @property
    def found(self) -> bool:
        """Whether the field was found and is not lost."""
        return self._to_table is not None and not self._lost

    @property
    def scale(self) -> float:
        """Pixels of the camera's picture per mm, on the average over the field."""
        corners = self.to_pixels(_OUTLINE)
        area = float(cv2.contourArea(corners.astype(np.float32)))
        return float(np.sqrt(area / (field.WIDTH * field.HEIGHT)))

    def update(self, grey: Picture, time: float) -> FieldState | None:
        """Looks for the field in the picture where needed.

        Args:
            grey: The camera's picture in grey, shape (height, width).
            time: Its time in s.

        Returns:
            The change of the field's state, if any.

        Raises:
            ValueError: The camera was calibrated for pictures of other proportions.
        """
        self._set_size(grey.shape[1], grey.shape[0])
        if self._to_table is None or self._lost:
            if not self._locate(grey):
                return None
            self._lost = False
            self._seen_at = time
            return FieldState.FOUND
        if time - self._checked_at < CHECK_SECONDS:
            return None
        self._checked_at = time
        displacements = self._displacements(grey)
        if displacements:
            self._seen_at = time
        displaced = sum(displacement > MOVED_MM for displacement in displacements) >= 2
        gone = not displacements and time - self._seen_at > CHECK_SECONDS * MOVED_CHECKS
        self._displaced_checks = self._displaced_checks + 1 if displaced else 0
        if self._displaced_checks >= MOVED_CHECKS or gone:
            before = self._to_table
            if self._locate(grey):
                self._displaced_checks = 0
                self._seen_at = time
                moved = _apply(before, _apply(_inverse(self._to_table), _OUTLINE)) - _OUTLINE
                return FieldState.MOVED if float(np.abs(moved).max()) > MOVED_MM / 2 else None
        if time - self._seen_at > LOST_SECONDS:
            self._lost = True
            return FieldState.LOST
        return None

    def to_table(self, pixels: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where on the table points of the picture are; shape (n, 2), pixels to mm."""
        assert self._to_table is not None, "the field was found"
        return _apply(self._to_table, self._undistort(pixels))

    def to_pixels(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the picture shows points of the table; shape (n, 2), mm to pixels."""
        assert self._to_table is not None, "the field was found"
        return self._distort(_apply(_inverse(self._to_table), points))

    def rectified(self, picture: Picture) -> Picture:
        """The field seen from straight above: `MAP_SCALE` pixels per mm, in the colours of the picture."""
        assert self._maps is not None, "the field was found"
        return np.asarray(
            cv2.remap(picture, self._maps[0], self._maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8
        )

    def _set_size(self, width: int, height: int) -> None:
        """Fits the intrinsics to the size of the pictures."""
        if self._size == (width, height):
            return
        self._size = (width, height)
        if self._camera is not None:
            camera = self._camera.scaled(width, height)
            self._undistort, self._distort = camera.undistort, camera.distort

    def _locate(self, grey: Picture) -> bool:
        """Finds the field anywhere in the picture; returns whether it was found."""
        tags = _corner_tags(self._reader.read(grey))
        if len(tags) < MIN_CORNERS:
            return False
        seen = self._undistort(np.concatenate([tag.corners for tag in tags.values()]))
        true = np.concatenate([_tag_outline(corner) for corner in tags])
        solution, _ = cv2.findHomography(seen, true)
        if solution is None:
            return False
        found = np.asarray(solution, dtype=np.float64)
        if float(np.abs(_apply(found, seen) - true).max()) > MAX_FIT_ERROR_MM:
            return False
        self._to_table = found
        width, height = round(field.WIDTH * MAP_SCALE), round(field.HEIGHT * MAP_SCALE)
        xs, ys = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        pixels = self.to_pixels(np.column_stack([xs.ravel(), ys.ravel()]) / MAP_SCALE).astype(np.float32)
        maps = cv2.convertMaps(pixels[:, 0].reshape(height, width), pixels[:, 1].reshape(height, width), cv2.CV_16SC2)
        self._maps = (np.asarray(maps[0], dtype=np.int16), np.asarray(maps[1], dtype=np.uint16))
        return True

    def _displacements(self, grey: Picture) -> list[float]:
        """How far each visible corner tag is from where it belongs, in mm."""
        found = []
        for corner, centre in enumerate(field.corner_tags()):
            around = self.to_pixels(_OUTLINE / np.array([field.WIDTH, field.HEIGHT]) * 2 * _CORNER_REACH - _CORNER_REACH + centre)
            left, top = np.maximum(around.min(axis=0), 0).astype(int)
            right, bottom = np.maximum(around.max(axis=0), 0).astype(int)
            tags = _corner_tags(self._reader.read(grey, left, top, right, bottom))
            if corner in tags:
                seen = self.to_table(tags[corner].corners).mean(axis=0)
                found.append(float(np.hypot(*(seen - centre))))
        return found


def _inverse(homography: NDArray[np.float64]) -> NDArray[np.float64]:
    """The homography back."""
    return np.asarray(np.linalg.inv(homography), dtype=np.float64)


def _apply(homography: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Maps points by a homography; shape (n, 2)."""
    mapped: NDArray[np.float64] = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return np.asarray(mapped[:, :2] / mapped[:, 2:], dtype=np.float64)


def _corner_tags(tags: list[Tag]) -> dict[int, Tag]:
    """The tags of the field's corners by corner, 0..3 clockwise from the top left."""
    return {tag.number - FIELD_TAGS: tag for tag in tags if 0 <= tag.number - FIELD_TAGS < 4 and tag.hamming <= 1}


def _tag_outline(corner: int) -> NDArray[np.float64]:
    """The corners of a corner tag, clockwise from its top left; shape (4, 2), mm."""
    half = field.FIELD_TAG_SIZE / 2
    corners = np.array([[-half, -half], [half, -half], [half, half], [-half, half]], dtype=np.float64)
    return np.asarray(corners + np.array(field.corner_tags()[corner]), dtype=np.float64)
