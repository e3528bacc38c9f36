"""`chefshat-robot rehearse`: a game at a synthetic table on a real server, to try everything without cards, camera or robot."""

from __future__ import annotations

import argparse

from chefshat import aio, pb
from chefshat.join_options import add_server_options, server_of

from chefshat_robot.bridge import Bridge
from chefshat_robot.cli import CommandError
from chefshat_robot.command_bridge import report_printer, say
from chefshat_robot.rehearsal import Rehearsal
from chefshat_robot.running import SERVER, run_command
from chefshat_robot.synthetic import DIFFICULTIES, SyntheticTable
from chefshat_robot.vision.frames import Frame
from chefshat_robot.vision.perception import Perception

DESCRIPTION = """\
Plays a game with simulated people at a simulated table, seen by a simulated camera, in a physical room of a real server. What the
camera reads is reported as at a real table; robots, agents and people on the page take the other seats.

Examples:
  chefshat-robot rehearse --shifts 1                      two people and two built-in agents
  chefshat-robot rehearse --open 1 --mistakes 0.1         prints a join code for a robot, and waits for it
  chefshat-robot rehearse --ticket TICKET                 as the table of a room that exists
"""
PEOPLE = ("Ada", "Bo", "Cy", "Di")
PLAYERS = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of the subcommand."""
    parser.description = DESCRIPTION
    add_server_options(parser, default=SERVER)
    parser.add_argument("--ticket", help="the ticket of the table of a room that exists; otherwise a room is created")
    parser.add_argument("--people", type=int, default=2, help="people at the table, 1..4 (default: %(default)s)")
    parser.add_argument("--open", type=int, default=0, help="seats left open for robots, agents or the page (default: %(default)s)")
    parser.add_argument("--agent", default="greedy", help="the built-in agent that has the other seats (default: %(default)s)")
    parser.add_argument("--shifts", type=int, default=1, help="Shifts of the game (default: %(default)s)")
    parser.add_argument("--difficulty", choices=list(DIFFICULTIES), default="easy", help="default: easy")
    parser.add_argument("--seed", type=int, default=0, help="decides the deals, the plays and the pictures (default: 0)")
    parser.add_argument("--mistakes", type=float, default=0.0, help="how often people break a rule, 0..1 (default: %(default)s)")
    parser.add_argument("--face-down", type=float, default=0.0, help="how often a card cannot be read, 0..1 (default: %(default)s)")
    parser.add_argument("--no-answers", action="store_true", help="leave questions to an attendant on the page or in the terminal")
    parser.add_argument("--json", action="store_true", help="print the room and each report as a line of JSON")


def run(arguments: argparse.Namespace) -> int:
    """Runs the subcommand. Returns 0 when the game has ended."""
    if not 1 <= arguments.people <= PLAYERS or not 0 <= arguments.open <= PLAYERS - arguments.people:
        raise CommandError(f"a table has {PLAYERS} seats: people at the table and open seats together are at most {PLAYERS}")
    for option, share in (("--mistakes", arguments.mistakes), ("--face-down", arguments.face_down)):
        if not 0 <= share <= 1:
            raise CommandError(f"{option} is from 0 to 1, not {share}")

    async def play() -> int:
        async with aio.Client(server_of(arguments)) as client:
            ticket = arguments.ticket or await _create(client, arguments)
            table = SyntheticTable([], DIFFICULTIES[arguments.difficulty], seed=arguments.seed)
            rehearsal = Rehearsal(
                table,
                client.tables,
                ticket,
                seed=arguments.seed,
                mistakes=arguments.mistakes,
                face_down=arguments.face_down,
                answers=not arguments.no_answers,
            )
            bridge = Bridge(client.tables, ticket, Perception(table.camera, deck=0), on_report=report_printer(arguments.json))

            async def after(frame: Frame) -> None:
                if bridge.state is not None:
                    await rehearsal.step(bridge.state, frame.time)

            await bridge.run(rehearsal.frames(), after)
            say(arguments.json, {"over": True, "violations": rehearsal.violations}, "The game is over.")
            return 0

    return run_command(play)


async def _create(client: aio.Client, arguments: argparse.Namespace) -> str:
    """Creates a physical room, prints how to join it, and returns the ticket of its table."""
    people = [pb.SeatConfig(at_table=pb.PARTICIPANT_KIND_HUMAN, name=name) for name in PEOPLE[: arguments.people]]
    others = [arguments.agent] * (PLAYERS - arguments.people - arguments.open)
    created = await client.rooms.create(
        "Rehearsal",
        rules=pb.RuleSet(target_shifts=arguments.shifts),
        seats=[*people, *[None] * arguments.open, *others],
        physical=True,
    )
    room = created.room.room_id
    page = arguments.address if "://" in arguments.address else f"http://{arguments.address}"
    link = f"{page.rstrip('/')}/rooms/{room}/table#ticket={created.table_ticket}"
    values = {"room": room, "join_code": created.join_code, "table_ticket": created.table_ticket, "attendant_link": link}
    names = {"room": "room", "join_code": "join code", "table_ticket": "table ticket", "attendant_link": "attendant"}
    say(arguments.json, values, "\n".join(f"{names[key]:12} {value}" for key, value in values.items()))
    return created.table_ticket
