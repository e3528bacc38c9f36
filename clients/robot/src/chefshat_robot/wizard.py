"""`chefshat-robot wizard`: a robot does what a seat does that somebody else plays, for instance a person on the page.

In a Wizard-of-Oz study a person holds the robot's seat in the browser. The robot follows that seat as a spectator: it says and
lays what the seat plays, says the lines that the wizard sends, and shows the wizard's expressions. All of this is in the game's
record already, as that seat's events: lines as in `speech`, with a person as their source. In the same way a robot is the body
of a built-in agent.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

from chefshat import aio, pb
from chefshat.join_options import server_of

from chefshat_robot import drivers, speech
from chefshat_robot.body import Body, Notice, Times
from chefshat_robot.cli import CommandError
from chefshat_robot.drivers.driver import Driver
from chefshat_robot.robot import add_robot_arguments, attendant, print_drivers
from chefshat_robot.running import live_from, run_command
from chefshat_robot.words import Words

DESCRIPTION = """\
Lets a robot do what a seat does that somebody else plays: a person on the page (Wizard of Oz), or a built-in agent. The robot says
and lays what the seat plays, says the lines and shows the expressions that the person sends for the seat.

Example:
  chefshat-robot wizard --room ROOM-ID --seat 2 --driver naoqi:host=pepper.local --language it

A line is an expression with the label "say" and the words as its media; any other expression is shown.
"""


async def follow_seat(
    client: aio.Client,
    room_id: str,
    seat: int,
    driver: Driver,
    *,
    words: Words,
    handles_cards: bool = True,
    small_talk: bool = False,
    announces: bool = True,
    times: Times | None = None,
    notify: Callable[[Notice], None] = lambda notice: None,
) -> None:
    """Performs the events of a seat, from now on until the game is over.

    Args:
        client: the connection to the server.
        room_id: the room.
        seat: the seat.
        driver: the robot, not connected yet.
        words: what it says of its own accord.
        handles_cards: whether there are real cards.
        small_talk: whether it comments on the game by itself.
        announces: whether it says what it plays.
        times: limits of the robot's acts.
        notify: called with messages to the attendant.

    Raises:
        RobotError: the robot cannot be reached at the start.
        ChefsHatError: the room cannot be watched.
    """
    live = await live_from(client, room_id)
    body = Body(driver, words, notify=notify, times=times, handles_cards=handles_cards, small_talk=small_talk, announces=announces)
    async with body:
        body.seat_at(seat, live)
        async for event in client.rooms.watch(room_id):
            body.on_event(event)
            if event.HasField("expression_shown") and event.expression_shown.seat == seat and event.sequence >= live:
                show(body, event.expression_shown.expression)


def show(body: Body, expression: pb.Expression) -> None:
    """Says a line or shows an expression of the robot's seat."""
    line = speech.text_of(expression)
    if line is not None:
        body.say(line)
    elif expression.label not in (speech.SAY, speech.HELP):
        body.express(expression.label, expression.valence, expression.arousal)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the subcommand."""
    parser.description = DESCRIPTION
    add_robot_arguments(parser)
    parser.add_argument("--room", metavar="ROOM-ID", help="the id of the room")
    parser.add_argument("--seat", type=int, help="the seat whose body the robot is, from 0")
    parser.add_argument("--small-talk", action="store_true", help="let the robot comment on the game by itself, too")
    parser.add_argument("--silent-plays", action="store_true", help="do not say what the seat plays: the wizard says it")


def run(arguments: argparse.Namespace) -> int:
    """Runs the subcommand."""
    if arguments.list_drivers:
        return print_drivers()
    if arguments.room is None or arguments.seat is None:
        raise CommandError("give the room (--room ROOM-ID) and the seat (--seat)")

    async def follow() -> int:
        driver = drivers.create(arguments.driver)
        async with aio.Client(server_of(arguments)) as client:
            await follow_seat(
                client,
                arguments.room,
                arguments.seat,
                driver,
                words=Words(arguments.language),
                handles_cards=not arguments.no_cards,
                small_talk=arguments.small_talk,
                announces=not arguments.silent_plays,
                times=Times().times(arguments.patience),
                notify=attendant(arguments.json),
            )
        return 0

    return run_command(follow, quiet=arguments.quiet)
