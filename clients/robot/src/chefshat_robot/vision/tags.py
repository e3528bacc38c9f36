"""AprilTags in a grey picture.

The library of the tags' inventors (pupil-apriltags) reads tags in blurred, noisy pictures that OpenCV's detector misses. On a hard
synthetic table (166 pieces in three Shifts), OpenCV's detector found a tag of 79 in 100 in pictures enlarged twice, the library of
94 in 100 in a third of the time, and of all when the pictures are sharpened and enlarged.
"""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from pupil_apriltags import Detector

from .events import Picture

_DECIMATION = ((60.0, 3.0), (36.0, 2.0), (22.0, 1.5))
"""From which edge of a tag in pixels on, and how many times smaller, pictures are searched. Bits are always read in full."""
_ENLARGEMENT = 2.0
"""How many times a picture is enlarged for fine reading, which then searches for squares in the original size."""
_SHARPENED_PART = 13.0
"""Details smaller than this part of a tag's edge are sharpened."""
_MIN_PIXELS = 24
"""Smallest edge of a picture that is searched: the library fails on much smaller ones."""
MAX_HAMMING = 2
"""Wrong bits of a tag that the detector corrects at most."""


@dataclass(frozen=True)
class Tag:
    """A tag in a picture.

    Attributes:
        number: Its number, 0..586.
        corners: The outer corners of its black border, clockwise from its own top left; shape (4, 2), pixels.
        hamming: How many of its 36 bits were corrected, 0..`MAX_HAMMING`.
        margin: Contrast between the bits and the threshold that decided them, in grey levels: below 20 it is hardly readable.
    """

    number: int
    corners: NDArray[np.float64]
    hamming: int
    margin: float


class _LastingDetector(Detector):  # type: ignore[misc]
    """A detector that is never destroyed.

    `Detector.__del__` of pupil-apriltags 1.0.4 frees the family of tags before the detector that still writes to it, which corrupts
    the heap. Readers that come later use it again.
    """

    def __del__(self) -> None:
        """Does nothing."""


#: Detectors that no reader uses, by decimation: a detector can be used by one thread at a time.
_IDLE: dict[float, list[_LastingDetector]] = {}


def _detector(decimate: float, owner: object) -> _LastingDetector:
    """A detector for an owner alone, until the owner is gone."""
    idle = _IDLE.setdefault(decimate, [])
    try:
        detector = idle.pop()
    except IndexError:
        detector = _LastingDetector(families="tag36h11", nthreads=1, quad_decimate=decimate)
    weakref.finalize(owner, idle.append, detector)
    return detector


class TagReader:
    """Reads the AprilTags 36h11 of pictures, in one thread at a time.

    Args:
        tag_pixels: About how long the edge of a tag is in the pictures. Big tags are searched for in fewer pixels, which is faster.
    """

    def __init__(self, tag_pixels: float) -> None:
        self._detector = _detector(next((factor for pixels, factor in _DECIMATION if tag_pixels >= pixels), 1.0), self)
        self._fine_detector = _detector(_ENLARGEMENT, self)
        self._sharpness = tag_pixels / _SHARPENED_PART

    def read(
        self,
        grey: Picture,
        left: int = 0,
        top: int = 0,
        right: int | None = None,
        bottom: int | None = None,
        fine: bool = False,
    ) -> list[Tag]:
        """Reads the tags in a rectangle of a picture.

        Args:
            grey: The picture, shape (height, width).
            left: First column of the rectangle.
            top: First row of the rectangle.
            right: Column after the last one; None: the picture's edge.
            bottom: Row after the last one; None: the picture's edge.
            fine: Whether to enlarge the picture: finds more, and takes three times as long.
        """
        region = np.ascontiguousarray(grey[top:bottom, left:right])
        if min(region.shape) < _MIN_PIXELS:
            return []
        soft = cv2.GaussianBlur(region, (0, 0), self._sharpness)
        region = np.asarray(cv2.addWeighted(region, 2.0, soft, -1.0, 0.0), dtype=np.uint8)
        factor = 1.0
        if fine:
            factor = _ENLARGEMENT
            region = np.asarray(cv2.resize(region, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC), dtype=np.uint8)
        found = (self._fine_detector if fine else self._detector).detect(region)
        # The library's corners run counter-clockwise from the top right of a tag as it is printed.
        return [
            Tag(
                int(tag.tag_id),
                np.roll(np.asarray(tag.corners, dtype=np.float64)[::-1], -2, axis=0) / factor + np.array([left, top]),
                int(tag.hamming),
                float(tag.decision_margin),
            )
            for tag in found
        ]
