"""`chefshat-robot perceive`: prints what happens on the table before a camera."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from pathlib import Path

import cv2

from chefshat_robot.cli import CommandError
from chefshat_robot.deck import Card

from .camera import Camera
from .events import (
    Cleared,
    Doubt,
    DoubtResolved,
    FieldChanged,
    Laid,
    Observed,
    PassShown,
    PassWithdrawn,
    TakenBack,
    to_json,
)
from .frames import SourceError, open_source
from .perception import Perception
from .recording import Recorder, replay

_DESCRIPTION = """\
Watch the table and print what happens. Start while the field is empty.

Examples:
  chefshat-robot perceive 0 --camera camera.json
  chefshat-robot perceive evening.mp4 --record evening/ --json
  chefshat-robot perceive --replay evening/
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `perceive`."""
    parser.description = _DESCRIPTION
    parser.add_argument("source", nargs="?", help="number of a camera, video file, or folder of pictures")
    parser.add_argument("--replay", type=Path, metavar="DIR", help="decide again from the recording in this folder")
    parser.add_argument("--camera", type=Path, metavar="FILE", help="the camera's calibration, from `chefshat-robot calibrate`")
    parser.add_argument("--deck", type=int, choices=range(7), metavar="0..6", help="ignore the cards of other decks")
    parser.add_argument("--fps", type=float, help="frames per second of the camera, or of pictures")
    parser.add_argument("--record", type=Path, metavar="DIR", help="write what is seen to this folder")
    parser.add_argument("--record-frames", action="store_true", help="with --record: write the frames too")
    parser.add_argument("--doubts", type=Path, metavar="DIR", help="write the picture of each doubt to this folder")
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def run(arguments: argparse.Namespace) -> int:
    """Runs `perceive`."""
    if (arguments.source is None) == (arguments.replay is None):
        raise CommandError("give a camera's number, a video or a folder of pictures, or --replay with a recording")
    if arguments.record_frames and arguments.record is None:
        raise CommandError("--record-frames needs --record with a folder")
    try:
        if arguments.replay is not None:
            _print_all(replay(arguments.replay), arguments.json, None)
            return 0
        camera = Camera.load(arguments.camera) if arguments.camera is not None else None
        frames = open_source(arguments.source, arguments.fps)
        if arguments.doubts is not None:
            arguments.doubts.mkdir(parents=True, exist_ok=True)
        if arguments.record is None:
            _print_all(Perception(camera, arguments.deck).watch(frames), arguments.json, arguments.doubts)
        else:
            with Recorder(arguments.record, arguments.deck, arguments.record_frames) as recorder:
                _print_all(Perception(camera, arguments.deck, recorder).watch(frames), arguments.json, arguments.doubts)
    except FileExistsError as error:
        raise CommandError(f"{error.filename} exists; give a folder without a recording") from error
    except (OSError, SourceError, ValueError) as error:
        raise CommandError(str(error)) from error
    except KeyboardInterrupt:
        print(file=sys.stderr)
    return 0


def _print_all(events: Iterable[Observed], as_json: bool, doubts: Path | None) -> None:
    """Prints events as they come."""
    for event in events:
        print(json.dumps(to_json(event)) if as_json else f"{event.time:8.2f} s  {_text(event)}", flush=True)
        if doubts is not None and isinstance(event, Doubt) and event.picture is not None:
            cv2.imwrite(str(doubts / f"doubt-{event.number}.png"), event.picture)


def _text(event: Observed) -> str:
    """An event in words."""
    match event:
        case Laid(cards=cards, places=places):
            return "laid: " + ", ".join(f"{_card(card)} at {place}" for card, place in zip(cards, places, strict=True))
        case TakenBack(cards=cards, places=places):
            return "taken back: " + ", ".join(f"{_card(card)} at {place}" for card, place in zip(cards, places, strict=True))
        case Cleared():
            return "cleared"
        case PassShown(seat=seat):
            return f"seat {seat} passes"
        case PassWithdrawn(seat=seat):
            return f"seat {seat} takes its pass card back"
        case Doubt(number=number, place=place, options=options):
            question = " or ".join(_card(card) for card in options) + "?" if options else "what lies there?"
            return f"doubt {number} at {place}: {question}"
        case DoubtResolved(number=number):
            return f"doubt {number} is resolved"
        case FieldChanged(state=state):
            return f"the field: {state.value}"


def _card(card: Card) -> str:
    """A card in words."""
    return "joker" if card.is_joker else "Golden 11" if card.is_golden else str(card.face)
