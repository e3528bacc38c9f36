"""`chefshat-robot bridge`: reports what a camera sees to a physical table."""

from __future__ import annotations

import argparse
import asyncio
import json
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

from chefshat import aio, pb
from chefshat.errors import first_error
from chefshat.join_options import add_server_options, server_of

from chefshat_robot.bridge import Bridge
from chefshat_robot.cli import CommandError
from chefshat_robot.running import SERVER, run_command
from chefshat_robot.vision import Camera, Perception, Recorder, SourceError, open_source
from chefshat_robot.vision.frames import SOURCE_HELP, add_source_options, wish_of
from chefshat_robot.vision.hand import HandReader

DESCRIPTION = """\
Watches a table with real cards through a camera and reports what happens to its physical room. What the camera cannot decide is
asked on the page, in the terminal, or by a robot. Start while the field is empty if you can: it may ask about
cards that lie there already.

Examples:
  chefshat-robot bridge 0 --ticket TICKET --camera camera.json --deck 0
  chefshat-robot bridge 0 --ticket TICKET --hand 2=1 --record recording/
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the subcommand."""
    parser.description = DESCRIPTION
    parser.add_argument("source", help=SOURCE_HELP)
    parser.add_argument("--ticket", required=True, help="the ticket of the table, from creating the room")
    add_server_options(parser, default=SERVER)
    parser.add_argument("--camera", type=Path, metavar="FILE", help="the camera's calibration, from `chefshat-robot calibrate`")
    parser.add_argument("--deck", type=int, choices=range(7), metavar="0..6", help="ignore the cards of other decks")
    add_source_options(parser)
    parser.add_argument("--record", type=Path, metavar="DIR", help="write what is seen to this folder, for `perceive --replay`")
    parser.add_argument("--record-frames", action="store_true", help="with --record: write the frames too")
    parser.add_argument(
        "--hand",
        type=_seat_and_source,
        action="append",
        default=[],
        metavar="SEAT=SOURCE",
        help="a camera that looks at the hand strip of a seat; repeat it for several seats",
    )
    parser.add_argument("--json", action="store_true", help="print each report as a line of JSON")


def _seat_and_source(text: str) -> tuple[int, str]:
    seat, equals, source = text.partition("=")
    if not equals or not seat.isdigit() or not source:
        raise argparse.ArgumentTypeError(f"{text!r}: give the seat, from 0, and the source, for instance 2=1")
    return int(seat), source


def run(arguments: argparse.Namespace) -> int:
    """Runs the subcommand. Returns 0 when the game or the frames have ended."""
    if arguments.record_frames and arguments.record is None:
        raise CommandError("--record-frames needs --record with a folder")
    try:
        with ExitStack() as stack:
            camera = Camera.load(arguments.camera) if arguments.camera is not None else None
            recorder = None
            if arguments.record is not None:
                recorder = stack.enter_context(Recorder(arguments.record, arguments.deck, arguments.record_frames))
            frames = open_source(arguments.source, wish_of(arguments))
            hands = [(seat, open_source(source, wish_of(arguments))) for seat, source in arguments.hand]

            async def watch() -> int:
                async with aio.Client(server_of(arguments)) as client:
                    perception = Perception(camera, arguments.deck, recorder)
                    bridge = Bridge(client.tables, arguments.ticket, perception, on_report=report_printer(arguments.json))
                    readers = [(seat, HandReader(deck=arguments.deck), source) for seat, source in hands]
                    with first_error():
                        async with asyncio.TaskGroup() as group:
                            watched = [group.create_task(bridge.watch_hand(*reader)) for reader in readers]
                            await bridge.run(frames)
                            for task in watched:
                                task.cancel()
                    return 0

            return run_command(watch)
    except FileExistsError as error:
        raise CommandError(f"{error.filename} exists; give a folder without a recording") from error
    except (SourceError, ValueError) as error:
        raise CommandError(str(error)) from error


def report_printer(as_json: bool) -> Callable[[pb.TableReport, pb.ReportResponse], None]:
    """What prints each report and what the table says to it."""

    def print_report(report: pb.TableReport, response: pb.ReportResponse) -> None:
        kind = report.WhichOneof("kind") or ""
        verdict = pb.ReportVerdict.Name(response.verdict).removeprefix("REPORT_VERDICT_").lower()
        values = {"report": response.report, "kind": kind, "verdict": verdict, "detail": response.detail}
        text = f"{kind} {verdict}"
        if kind == "laid":
            text = f"{kind} {list(report.laid.cards.cards)} {verdict}"
        elif kind == "question":
            text = f"{kind} {verdict}: {report.question.text}"
        detail = f": {response.detail}" if response.detail and verdict != "known" else ""
        say(as_json, values, f"{text}{detail} — {response.state.waiting_for}")

    return print_report


def say(as_json: bool, values: Mapping[str, object], text: str) -> None:
    """Prints values as a line of JSON, or a text."""
    print(json.dumps(values) if as_json else text, flush=True)
