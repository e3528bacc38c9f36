"""Where pictures come from: a camera, a video file, a folder of pictures, or any iterator of frames."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from .events import Picture

PICTURE_ENDINGS = (".jpg", ".jpeg", ".png", ".bmp", ".webp")
STREAMS = ("rtsp://", "rtsps://", "http://", "https://")
"""How the addresses of cameras in a network begin."""
DEFAULT_SIZE = (1280, 720)
"""Width and height that a camera is asked for."""
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


@dataclass(frozen=True)
class Wish:
    """What a camera is asked for.

    Attributes:
        fps: Frames per second; of files, what to assume instead of what the video says.
        size: Width and height in pixels. A calibration holds for one size.
        mjpg: Whether pictures come compressed: many USB cameras send large ones only so, or else slowly.
    """

    fps: float | None = None
    size: tuple[int, int] | None = None
    mjpg: bool = False


SOURCE_HELP = "number, device or address (rtsp://, http://) of a camera, video file, or folder of pictures"


def add_source_options(parser: argparse.ArgumentParser) -> None:
    """Adds what a camera can be asked for to a command line."""
    parser.add_argument("--fps", type=float, help="frames per second of the camera, or of pictures")
    parser.add_argument(
        "--size", type=_size, metavar="WxH", help="pictures of the camera, by default 1280x720; the same as when calibrating"
    )
    parser.add_argument(
        "--mjpg", action="store_true", help="let the camera compress its pictures: many USB cameras are faster then"
    )


def wish_of(arguments: argparse.Namespace) -> Wish:
    """Returns what the options of `add_source_options` ask for."""
    return Wish(arguments.fps, arguments.size, arguments.mjpg)


def _size(text: str) -> tuple[int, int]:
    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) and int(height)):
        raise argparse.ArgumentTypeError(f"{text!r}: give width and height in pixels, for instance 1920x1080")
    return int(width), int(height)


def open_source(source: str, wish: Wish = Wish()) -> Iterator[Frame]:
    """Opens a source of frames.

    Args:
        source: The number (`0`), the device (`/dev/video2`) or the address (`rtsp://…`, `http://…`) of a camera, or the path of a
            video file or of a folder of pictures, read by name.
        wish: What to ask a camera for. One with an address sends what it is set to.

    Raises:
        SourceError: There is no such source, it has no pictures, or it has none of the size asked for.
    """
    if source.startswith(STREAMS):
        return _stream_frames(source)
    path = Path(source)
    if source.isdigit():
        return _camera_frames(int(source), wish)
    if path.is_char_device():
        return _camera_frames(source, wish)
    if path.is_dir():
        pictures = sorted(entry for entry in path.iterdir() if entry.suffix.lower() in PICTURE_ENDINGS)
        if not pictures:
            raise SourceError(f"no pictures in {path}; give a folder with {', '.join(PICTURE_ENDINGS)} files")
        return _folder_frames(pictures, wish.fps or DEFAULT_FPS)
    if not path.is_file():
        raise SourceError(f"no file or folder {path}; give a path, or the number of a camera, for instance 0")
    return _video_frames(path, wish.fps)


def _camera_frames(camera: int | str, wish: Wish) -> Iterator[Frame]:
    capture = cv2.VideoCapture(camera)
    if not capture.isOpened():
        raise SourceError(
            f"camera {camera} does not open; check that it is plugged in, that no other program uses it, or try another one"
        )
    # The format first: it decides which sizes there are.
    if wish.mjpg:
        capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
    width, height = wish.size or DEFAULT_SIZE
    capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
    capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    if wish.fps:
        capture.set(cv2.CAP_PROP_FPS, wish.fps)
    sent = int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)), int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT))
    if wish.size and sent != wish.size:
        capture.release()
        hint = "" if wish.mjpg else ", or try --mjpg"
        raise SourceError(f"camera {camera} sends {sent[0]}x{sent[1]}, not {width}x{height}; give a size that it has{hint}")
    return _live_frames(capture, f"camera {camera} sends no more pictures; check its cable")


def _stream_frames(address: str) -> Iterator[Frame]:
    capture = cv2.VideoCapture(address, cv2.CAP_FFMPEG)
    if not capture.isOpened():
        raise SourceError(f"no camera answers at {address}; check the address, and whether a video player shows it")
    return _live_frames(capture, f"the camera at {address} sends no more pictures; check its network")


def _live_frames(capture: cv2.VideoCapture, ended: str) -> Iterator[Frame]:
    """The frames of a camera, by when they arrive; `ended` says why there are no more."""
    started = time.monotonic()
    for index, image in enumerate(_pictures(capture)):
        yield Frame(index, time.monotonic() - started, image)
    raise SourceError(ended)


def _pictures(capture: cv2.VideoCapture) -> Iterator[Picture]:
    """The pictures of a camera or video, until it has no more."""
    try:
        while True:
            read, image = capture.read()
            if not read:
                return
            yield np.asarray(image, dtype=np.uint8)
    finally:
        capture.release()


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
    return (Frame(index, index / rate, image) for index, image in enumerate(_pictures(capture)))
