"""`chefshat-robot bridge`: reports what a camera sees to a physical table."""

from __future__ import annotations

import argparse
import asyncio
import json
from collections.abc import Callable, Mapping

from chefshat import aio, pb
from chefshat.errors import first_error
from chefshat.join_options import add_server_options, server_of

from chefshat_robot.bridge import Bridge
from chefshat_robot.running import SERVER, run_command
from chefshat_robot.vision.frames import SOURCE_HELP, open_source, wish_of
from chefshat_robot.vision.hand import HandReader
from chefshat_robot.vision.watching import add_options, watched

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
    add_options(parser)
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
    with watched(arguments) as (perception, frames):
        hands = [
            (seat, HandReader(deck=arguments.deck), open_source(source, wish_of(arguments))) for seat, source in arguments.hand
        ]

        async def watch() -> int:
            async with aio.Client(server_of(arguments)) as client:
                bridge = Bridge(client.tables, arguments.ticket, perception, on_report=report_printer(arguments.json))
                with first_error():
                    async with asyncio.TaskGroup() as group:
                        watching = [group.create_task(bridge.watch_hand(*hand)) for hand in hands]
                        await bridge.run(frames)
                        for task in watching:
                            task.cancel()
                return 0

        return run_command(watch)


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
