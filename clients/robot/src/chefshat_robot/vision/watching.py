"""What the commands that watch a table share: their options, and the perception and the frames that these ask for."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from chefshat_robot.cli import CommandError

from .camera import Camera
from .frames import Frame, SourceError, add_source_options, open_source, wish_of
from .perception import Perception
from .recording import Recorder


def add_options(parser: argparse.ArgumentParser) -> None:
    """Adds the options, besides the source."""
    parser.add_argument("--camera", type=Path, metavar="FILE", help="the camera's calibration, from `chefshat-robot calibrate`")
    parser.add_argument("--deck", type=int, choices=range(7), metavar="0..6", help="ignore the cards of other decks")
    add_source_options(parser)
    parser.add_argument("--record", type=Path, metavar="DIR", help="write what is seen to this folder, for `perceive --replay`")
    parser.add_argument("--record-frames", action="store_true", help="with --record: write the frames too")


@contextmanager
def watched(arguments: argparse.Namespace) -> Iterator[tuple[Perception, Iterator[Frame]]]:
    """The perception, which records what it sees if that was asked for, and the frames to show it.

    Raises:
        CommandError: The options are wrong, or the source cannot be opened or read.
    """
    if arguments.record_frames and arguments.record is None:
        raise CommandError("--record-frames needs --record with a folder")
    with ExitStack() as stack, in_words():
        camera = Camera.load(arguments.camera) if arguments.camera is not None else None
        # Before the recorder: a source that cannot be opened leaves no recording behind.
        frames = open_source(arguments.source, wish_of(arguments))
        recorder = None
        if arguments.record is not None:
            try:
                recorder = stack.enter_context(Recorder(arguments.record, arguments.deck, arguments.record_frames))
            except FileExistsError as error:
                raise CommandError(f"{error.filename} exists; give a folder without a recording") from error
        yield Perception(camera, arguments.deck, recorder), frames


@contextmanager
def in_words() -> Iterator[None]:
    """Turns errors of a source or a file into those of a command."""
    try:
        yield
    except (SourceError, ValueError) as error:
        raise CommandError(str(error)) from error
