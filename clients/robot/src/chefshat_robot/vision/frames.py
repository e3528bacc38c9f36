"""Where pictures come from: a camera, a video file, a folder of pictures, or any iterator of frames."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from .events import Picture

PICTURE_ENDINGS = (".jpg", ".jpeg", ".png", ".bmp", ".webp")
DEFAULT_FPS = 15.0
"""Frames per second assumed of a folder of pictures, and of a video that does not say."""


@dataclass(frozen=True)
class Frame:
    """One picture of the table.

    Attributes:
        index: Its number from 0, without gaps.
        time: Seconds since the first frame.
        image: The picture in BGR, shape (height, width, 3).
    """

    index: int
    time: float
    image: Picture


class SourceError(Exception):
    """A source of frames cannot be used; the message says what to do."""


def open_source(source: str, fps: float | None = None, size: tuple[int, int] | None = None) -> Iterator[Frame]:
    """Opens a source of frames.

    Args:
        source: The number of a camera (`0`), or the path of a video file or of a folder of pictures, read by name.
        fps: Frames per second: of a camera what to ask it for, of files what to assume instead of what the video says.
        size: Width and height to ask a camera for; files keep theirs.

    Raises:
        SourceError: There is no such source, or it has no pictures.
    """
    if source.isdigit():
        return _camera_frames(int(source), fps, size)
    path = Path(source)
    if path.is_dir():
        pictures = sorted(entry for entry in path.iterdir() if entry.suffix.lower() in PICTURE_ENDINGS)
        if not pictures:
            raise SourceError(f"no pictures in {path}; give a folder with {', '.join(PICTURE_ENDINGS)} files")
        return _folder_frames(pictures, fps or DEFAULT_FPS)
    if not path.is_file():
        raise SourceError(f"no file or folder {path}; give a path, or the number of a camera, for instance 0")
    return _video_frames(path, fps)


def _camera_frames(number: int, fps: float | None, size: tuple[int, int] | None) -> Iterator[Frame]:
    capture = cv2.VideoCapture(number)
    if not capture.isOpened():
        raise SourceError(
            f"camera {number} does not open; check that it is plugged in, that no other program uses it, or try another number"
        )
    width, height = size or (1280, 720)
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    if fps:
        capture.set(cv2.CAP_PROP_FPS, fps)

    def frames() -> Iterator[Frame]:
        started = time.monotonic()
        index = 0
        try:
            while True:
                read, image = capture.read()
                if not read:
                    raise SourceError(f"camera {number} sends no more pictures; check its cable")
                yield Frame(index, time.monotonic() - started, np.asarray(image, dtype=np.uint8))
                index += 1
        finally:
            capture.release()

    return frames()


def _folder_frames(pictures: list[Path], fps: float) -> Iterator[Frame]:
    for index, path in enumerate(pictures):
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
        if image is None:
            raise SourceError(f"{path} is not a picture; remove it from the folder")
        yield Frame(index, index / fps, np.asarray(image, dtype=np.uint8))


def _video_frames(path: Path, fps: float | None) -> Iterator[Frame]:
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise SourceError(f"{path} is not a video that can be read; convert it to MP4 (H.264)")
    rate = fps or capture.get(cv2.CAP_PROP_FPS) or DEFAULT_FPS

    def frames() -> Iterator[Frame]:
        index = 0
        try:
            while True:
                read, image = capture.read()
                if not read:
                    return
                yield Frame(index, index / rate, np.asarray(image, dtype=np.uint8))
                index += 1
        finally:
            capture.release()

    return frames()
