"""`chefshat-robot perceive`: prints what happens on the table before a camera."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import cv2

from chefshat_robot.cli import CommandError
from chefshat_robot.deck import Card

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
from .frames import SOURCE_HELP, Frame
from .perception import Perception
from .recording import replay
from .watching import add_options, in_words, watched

PATIENCE_S = 5.0
"""A doubt is left out after so long, in s."""
FIELD_PATIENCE_S = 5.0
"""A field that is not found for so long is asked for, in s."""
NO_FIELD = (
    "the field is not found: show the camera all of it, with the marks of its four corners, in enough light and without glare"
)

_DESCRIPTION = """\
Watch the table and print what happens, each event with the time at which it became certain. Cards that lie there already are
printed as found.
A doubt is a place that cannot be read for sure; events after it wait until it can be read, at most 5 seconds.

Examples:
  chefshat-robot perceive 0 --camera camera.json
  chefshat-robot perceive evening.mp4 --record recording/ --json
  chefshat-robot perceive --replay recording/
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `perceive`."""
    parser.description = _DESCRIPTION
    parser.add_argument("source", nargs="?", help=SOURCE_HELP)
    parser.add_argument("--replay", type=Path, metavar="DIR", help="decide again from the recording in this folder")
    add_options(parser)
    parser.add_argument("--doubts", type=Path, metavar="DIR", help="write the picture of each doubt to this folder")
    parser.add_argument("--json", action="store_true", help="print one JSON object a line")


def run(arguments: argparse.Namespace) -> int:
    """Runs `perceive`."""
    if (arguments.source is None) == (arguments.replay is None):
        raise CommandError("give a camera's number, a video or a folder of pictures, or --replay with a recording")
    try:
        if arguments.replay is not None:
            with in_words():
                return _end(_print_all(replay(arguments.replay), arguments.json, None))
        with watched(arguments) as (perception, frames):
            if arguments.doubts is not None:
                arguments.doubts.mkdir(parents=True, exist_ok=True)
            return _end(_print_all(_watch(perception, frames), arguments.json, arguments.doubts))
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return 0


def _end(is_found: bool) -> int:
    """The end of what there was to see; the field was found, or never."""
    if not is_found:
        raise CommandError(NO_FIELD)
    return 0


def _watch(perception: Perception, frames: Iterable[Frame]) -> Iterator[Observed]:
    """The events of the frames. Nobody answers here, so what cannot be read in time is left out."""
    asked: dict[int, float] = {}
    began: float | None = None
    missed = True
    for frame in frames:
        events = perception.see(frame)
        began = frame.time if began is None else began
        missed = missed and not any(isinstance(event, FieldChanged) for event in events)
        if missed and frame.time - began >= FIELD_PATIENCE_S:
            print(NO_FIELD, file=sys.stderr)
            missed = False
        for number in [number for number, time in asked.items() if frame.time - time >= PATIENCE_S]:
            print(f"doubt {number} is left out: nobody answers here, as people do with `chefshat-robot bridge`", file=sys.stderr)
            events += perception.answer(number, False)
        for event in events:
            match event:
                case Doubt(number=number):
                    asked[number] = frame.time
                case DoubtResolved(number=number):
                    asked.pop(number, None)
            yield event


def _print_all(events: Iterable[Observed], as_json: bool, doubts: Path | None) -> bool:
    """Prints events as they come. Returns whether the field was ever found."""
    is_found = False
    for event in events:
        is_found = is_found or isinstance(event, FieldChanged)
        print(json.dumps(to_json(event)) if as_json else f"{event.time:8.2f} s  {_text(event)}", flush=True)
        if doubts is not None and isinstance(event, Doubt) and event.picture is not None:
            cv2.imwrite(str(doubts / f"doubt-{event.number}.png"), event.picture)
    return is_found


def _text(event: Observed) -> str:
    """An event in words."""
    match event:
        case Laid(cards=cards, places=places, found=found):
            return ("found: " if found else "laid: ") + _at_places(cards, places)
        case TakenBack(cards=cards, places=places):
            return "taken back: " + _at_places(cards, places)
        case Cleared():
            return "cleared"
        case PassShown(seat=seat, found=found):
            return f"the pass card of seat {seat} is found" if found else f"seat {seat} passes"
        case PassWithdrawn(seat=seat):
            return f"seat {seat} takes its pass card back"
        case Doubt(number=number, place=place, options=options):
            question = " or ".join(_card(card) for card in options) + "?" if options else "what lies there?"
            return f"doubt {number} at {place}: {question}"
        case DoubtResolved(number=number):
            return f"doubt {number} is resolved"
        case FieldChanged(state=state):
            return f"the field: {state.value}"


def _at_places(cards: Iterable[Card], places: Iterable[int]) -> str:
    """Cards and their places in words."""
    return ", ".join(f"{_card(card)} at {place}" for card, place in zip(cards, places, strict=True))


def _card(card: Card) -> str:
    """A card in words."""
    return "joker" if card.is_joker else "Golden 11" if card.is_golden else str(card.face)
