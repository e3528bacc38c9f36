"""`chefshat-robot robot`: takes a seat for a robot, whose decisions an agent makes, and plays the game to its end.

Acts are in `body`, decisions in `player`, robots in `drivers`.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import sys
from collections.abc import Callable
from contextlib import nullcontext

from chefshat import Agent, ChefsHatError, PlayOptions, SeatResult, aio, pb
from chefshat.agent import make_agent
from chefshat.join_options import TICKET, add_name_key_option, add_server_options, name_key, server_of
from chefshat.outcome import Played
from chefshat.outcome import report as report_result

from chefshat_robot import drivers, speech, wire
from chefshat_robot.affect import Forwarder, tickets
from chefshat_robot.body import Body, Notice, Times
from chefshat_robot.cli import CommandError
from chefshat_robot.drivers.driver import LOG, Act, Affect, Done, Driver, Express, Heard, Outcome, Pick, RobotEvent, Say
from chefshat_robot.player import RobotPlayer
from chefshat_robot.questions import Questions
from chefshat_robot.reporting import Reporter
from chefshat_robot.running import SERVER, run_command
from chefshat_robot.words import LANGUAGES, Words

DESCRIPTION = """\
Plays a seat with a robot: an agent decides, and the robot says, shows and lays what it decided. What the robot cannot do, it asks
the people at the table to do; such requests also appear here and in the room.

Examples:
  chefshat-robot robot --address 127.0.0.1:50051 --room ABCDEF --name Pepe --driver simulated:frames=frames,png=true
  chefshat-robot robot --room ABCDEF --name Pepe --language it --agent strong.safetensors --driver jsonlines:host=10.0.0.7

The driver is NAME[:option=value,...]; --list-drivers shows all with their options.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the subcommand."""
    parser.description = DESCRIPTION
    add_robot_arguments(parser)
    parser.add_argument("--code", "--room", dest="room", metavar="CODE", help="the room's join code")
    parser.add_argument(
        "--ticket", help=f"resume a seat with its ticket, instead of --code; also from the environment variable {TICKET}"
    )
    parser.add_argument("--seat", type=int, help="the seat, from 0 (default: the first free one)")
    parser.add_argument("--name", default="Robot", help="the robot's name, 1 to 64 characters (default: %(default)s)")
    add_name_key_option(parser)
    parser.add_argument(
        "--agent",
        default="random",
        help="who decides: 'random', module:Class of a chefshat.Agent, or a trained network, FILE.safetensors (default: random)",
    )
    parser.add_argument("--seed", type=int, help="seed of the agent")
    parser.add_argument(
        "--table-ticket",
        default="",
        metavar="TICKET",
        help="of a physical room: report what the robot has laid, passed and given, so that no camera or attendant has to",
    )
    parser.add_argument(
        "--referee",
        action="store_true",
        help="in a physical room: say what the referee says of violations and, with --table-ticket, ask its questions",
    )
    parser.add_argument(
        "--people",
        action="append",
        metavar="SEAT=TICKET",
        help="send what the robot reads in the face of a seat's player as that seat's expression; repeat it for several seats",
    )
    parser.add_argument(
        "--hold", type=float, metavar="SECONDS", help="answer at the latest after so many seconds, while the robot is still moving"
    )


def add_robot_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments that all commands with a robot share."""
    add_server_options(parser, default=SERVER)
    parser.add_argument("--driver", default="simulated", metavar="SPEC", help="the robot (default: %(default)s)")
    parser.add_argument("--list-drivers", action="store_true", help="list the drivers and their options, and exit")
    parser.add_argument("--language", choices=LANGUAGES, default="en", help="what the robot speaks (default: %(default)s)")
    parser.add_argument("--no-cards", action="store_true", help="there are no real cards: the robot only speaks, looks and shows")
    parser.add_argument(
        "--patience", type=float, default=1.0, metavar="FACTOR", help="multiply the time limits of the robot's acts (default: 1)"
    )
    parser.add_argument("--json", action="store_true", help="print requests for help and the result as lines of JSON")
    parser.add_argument("--quiet", action="store_true", help="do not print what the robot says and does")


def run(arguments: argparse.Namespace) -> int:
    """Runs the subcommand. Returns 0 if the game finished."""
    if arguments.list_drivers:
        return print_drivers()
    ticket = arguments.ticket or os.environ.get(TICKET)

    async def play() -> int:
        if bool(ticket) == bool(arguments.room):
            raise CommandError("give the room's join code (--code), or the ticket of a seat to resume (--ticket)")
        agent = _agent(arguments.agent, arguments.seed)
        driver = drivers.create(arguments.driver)
        async with driver:
            pass  # The robot is there: only then a seat is taken.
        async with aio.Client(server_of(arguments)) as client:
            taken = ticket or await _join(client, arguments)
            result = await play_seat(
                client,
                taken,
                agent,
                driver,
                words=Words(arguments.language),
                handles_cards=not arguments.no_cards,
                hold_s=arguments.hold,
                times=Times().times(arguments.patience),
                table_ticket=arguments.table_ticket,
                referee=arguments.referee,
                people=Forwarder(client, tickets(arguments.people)) if arguments.people else None,
                notify=attendant(arguments.json),
            )
            return report_result(Played([result]), as_json=arguments.json)

    return run_command(play, quiet=arguments.quiet)


async def play_seat(
    client: aio.Client,
    ticket: str,
    agent: Agent,
    driver: Driver,
    *,
    words: Words,
    handles_cards: bool = True,
    hold_s: float | None = None,
    times: Times | None = None,
    people: Forwarder | None = None,
    table_ticket: str = "",
    referee: bool = False,
    notify: Callable[[Notice], None] = lambda notice: None,
) -> SeatResult:
    """Plays one seat with a robot until its game is over.

    What the robot says is recorded with the game (`speech`); what it shows, and its requests for help, appear in the room.

    Args:
        client: the connection to the server.
        ticket: of the seat.
        agent: decides.
        driver: the robot, not connected yet.
        words: what it says.
        handles_cards: whether there are real cards.
        hold_s: most seconds by which the robot's acts may delay an answer.
        times: limits of its acts.
        people: where to send the expressions that the robot reads in people's faces and voices; None: nowhere.
        table_ticket: of a physical table, to which the robot reports what it has laid, passed and given; empty: it does not report.
        referee: whether it says the referee's words at a physical table: violations and, with the table's ticket, questions,
            whose answers it reports if it hears them.
        notify: called with messages to the attendant, in addition.

    Raises:
        RobotError: the robot cannot be reached at the start.
        ChefsHatError: the seat was refused or lost.
    """
    outbox = speech.Outbox(client, ticket)
    readings: set[asyncio.Task[None]] = set()
    reporter = Reporter(client, table_ticket) if table_ticket else None

    def noticed(notice: Notice) -> None:
        notify(notice)
        if notice.kind == "help":
            outbox.send(speech.line(notice.text, label=speech.HELP))

    def acted(act: Act, outcome: Outcome) -> None:
        if isinstance(act, Say) and isinstance(outcome, Done):
            outbox.send(speech.line(act.text, record_only=True))
        elif isinstance(act, Pick) and isinstance(outcome, Done) and reporter is not None:
            reporter.carried(act, body.state)
        elif isinstance(act, Express) and isinstance(outcome, Done):
            outbox.send(pb.Expression(label=act.label, valence=act.valence, arousal=act.arousal, source=pb.EXPRESSION_SOURCE_MODEL))

    def perceived(event: RobotEvent) -> None:
        LOG.info("the robot perceived %s", event)
        hook = getattr(agent, "on_robot_event", None)
        if hook is not None:
            hook(event)
        if isinstance(event, Affect) and people is not None:
            reading = asyncio.create_task(_forward(people, event))
            readings.add(reading)
            reading.add_done_callback(readings.discard)
        if isinstance(event, Heard) and questions is not None:
            answer = asyncio.create_task(questions.heard(event))
            readings.add(answer)
            answer.add_done_callback(readings.discard)

    body = Body(driver, words, notify=noticed, on_act=acted, times=times, handles_cards=handles_cards)
    questions = Questions(client, table_ticket, body) if referee and table_ticket else None
    async with outbox, reporter or nullcontext(), body:
        player = RobotPlayer(agent, body, hold_s=hold_s, on_robot_event=perceived, says_violations=referee)
        if questions is not None:
            asking = asyncio.create_task(questions.follow())
            readings.add(asking)
        result = await client.play(player, ticket, options=PlayOptions(delivery=pb.EVENT_DELIVERY_AT_ONCE))
    await asyncio.gather(*readings)
    return result


async def _forward(people: Forwarder, affect: Affect) -> None:
    """Sends what the robot read in a person's face. A failure is logged: the game is more important."""
    try:
        await people.forward(affect)
    except (ValueError, ChefsHatError) as error:
        LOG.warning("a reading was not sent: %s", error)


def attendant(as_json: bool) -> Callable[[Notice], None]:
    """Returns a function that prints messages to the attendant: words on standard error, or JSON on standard output."""

    def show(notice: Notice) -> None:
        if as_json:
            cards = [wire.move_to_json(move) for move in notice.cards]
            line = {"event": notice.kind, "text": notice.text, "reason": notice.reason, "cards": cards}
            print(json.dumps(line, ensure_ascii=False), flush=True)
        else:
            kind = "HELP" if notice.kind == "help" else "NOT SAID"
            pieces = f" [{', '.join(move.piece for move in notice.cards)}]" if notice.cards else ""
            print(f"{kind}: {notice.text}{pieces} ({notice.reason})", file=sys.stderr, flush=True)

    return show


def print_drivers() -> int:
    """Prints every driver with its options. Returns 0."""
    for name in drivers.names():
        print(f"{name:12} {drivers.summary(name)}")
        for option, (kind, default) in drivers.options_of(drivers.find(name)).items():
            print(f"{'':12}   {option}={kind.__name__.upper()}  (default: {default})")
    return 0


async def _join(client: aio.Client, arguments: argparse.Namespace) -> str:
    try:
        key = name_key(arguments.name_key)
    except (OSError, ValueError) as error:
        raise CommandError(f"--name-key: {error}") from error
    joined = await client.rooms.join(
        arguments.room, arguments.name, kind=pb.PARTICIPANT_KIND_ROBOT, seat=arguments.seat, name_key=key
    )
    print(f"if this process ends before the game, resume with --ticket {joined.ticket}", file=sys.stderr)
    return joined.ticket


def _agent(name: str, seed: int | None) -> Agent:
    """Creates the agent that decides."""
    try:
        if name.endswith(".safetensors"):
            from chefshat.learn import network
            from chefshat.learn.play import NetworkAgent

            return NetworkAgent(network.load(name))
        return make_agent(name, seed)
    except ImportError as error:
        hint = ": a network needs  pip install 'chefshat[learn]'" if name.endswith(".safetensors") else ""
        raise CommandError(f"--agent {name}: {error}{hint}") from error
    except (AttributeError, TypeError, ValueError, OSError) as error:
        raise CommandError(f"--agent {name}: {error}") from error
