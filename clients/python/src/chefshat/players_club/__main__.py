"""The command `python -m chefshat.players_club`: joins rooms with a player of the reference implementation, prints the standings.

How the player is run and understood is in `process` and `agent`; here are the arguments and what is printed.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from chefshat import Client
from chefshat.agent import as_json, as_table
from chefshat.errors import ChefsHatError, failed
from chefshat.players_club.agent import ATTEMPTS, PlayersClubAgent, RulesDoNotFit, check_rules
from chefshat.players_club.process import AgentError, AgentProcess, AgentSpec
from chefshat.result import SeatResult

EXAMPLE = """example:
  python -m chefshat.players_club --server 127.0.0.1:50051 --code BCDF2345 \\
    --agent ChefsHatGym.agents.agent_random:AgentRandon --python ~/venv-chefshatgym/bin/python --name Rolf
  python -m chefshat.players_club --server 127.0.0.1:50051 --code BCDF2345 --code GHJK6789 \\
    --agent my_players:Cautious --path ~/players --arguments '{"verbose_console": false}'

The player runs with all your rights, like any program that you start. What it chooses illegally is sent, counted by the server as a
wrong action, and the player is asked again. Where it raises, hangs or dies, the default decision of the rules is taken; a process
that is gone is started anew at the next call.

exit code: 0 every game was finished, 1 one was refused, lost or aborted, or the player was given up, 2 the arguments are wrong,
130 interrupted
"""
# Characters of the longest name a server shows.
MAX_NAME = 64


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    options = parse(arguments)
    spec = AgentSpec(
        agent=options.agent,
        name=options.name or options.agent.rpartition(":")[2],
        arguments=options.arguments,
        python=options.python,
        paths=tuple(options.path),
        start_limit_s=options.start_limit,
        call_limit_s=options.limit,
        restarts=options.restarts,
        log=options.log,
    )
    try:
        # First the player, then the room: nobody waits for a player that cannot be made.
        with AgentProcess(spec) as process, Client(options.address) as client:
            finished = [play(client, process, code, options) for code in options.code]
            return 0 if all(finished) and not process.given_up else 1
    except (ChefsHatError, AgentError, RulesDoNotFit) as error:
        return failed(error, as_json=options.json)
    except KeyboardInterrupt:
        print("interrupted; the seat is the server's to fill", file=sys.stderr)
        return 130


def play(client: Client, process: AgentProcess, code: str, options: argparse.Namespace) -> bool:
    """Plays the game of one room. Returns whether it was finished."""
    joined = client.join_room(code, options.name or process.name[:MAX_NAME], seat=options.seat)
    check_rules(joined.room.rules)
    agent = PlayersClubAgent(process, attempts=options.attempts)
    restarts = process.restarts
    result = client.play(agent, joined.ticket)
    report(result, agent, process.restarts - restarts, as_json_line=options.json)
    return result.finished


def report(result: SeatResult, agent: PlayersClubAgent, restarts: int, *, as_json_line: bool) -> None:
    """Prints how the game ended and how much of it was the player's own."""
    if as_json_line:
        own = {"failures": agent.failures, "replaced": agent.replaced, "restarts": restarts}
        print(json.dumps({**as_json(result), **own}), flush=True)
        return
    print(as_table(result))
    print(f"{agent.failures} failures of the player, {agent.replaced} decisions taken for it, {restarts} restarts", flush=True)


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The arguments, checked."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.players_club",
        description="Joins a room of a Chef's Hat server with a player written for the reference implementation's second version "
        "(ChefsHatGym 2, Chef's Hat Players Club), unchanged.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--server", "--address", dest="address", required=True, help="the server, HOST:PORT")
    parser.add_argument(
        "--code", action="append", required=True, help="a room's join code; several times: rooms played one after the other"
    )
    parser.add_argument("--agent", required=True, type=class_name, help="the player, module.path:Class")
    parser.add_argument("--python", default=sys.executable, help="the Python that has what the player needs (default: this one)")
    parser.add_argument(
        "--path", action="append", default=[], metavar="DIR", help="a folder to look for its modules in; may be repeated"
    )
    parser.add_argument("--name", help="name to show, and to give to the player (default: what the player calls itself)")
    parser.add_argument(
        "--arguments", type=json_object, default={}, metavar="JSON", help="arguments of its constructor, as an object"
    )
    parser.add_argument("--seat", type=int, help="a certain seat (default: the first free one)")
    parser.add_argument(
        "--attempts",
        type=count,
        default=ATTEMPTS,
        help="illegal choices sent for one decision before the best legal one is taken (default: %(default)s, as in the reference)",
    )
    parser.add_argument(
        "--limit", type=seconds, default=60.0, metavar="S", help="seconds a call may take before the player counts as hanging"
    )
    parser.add_argument("--start-limit", type=seconds, default=120.0, metavar="S", help="seconds it may take to be made")
    parser.add_argument("--restarts", type=count, default=3, help="how often its process is started anew (default: %(default)s)")
    parser.add_argument("--log", type=Path, metavar="FILE", help="a file to append what the player prints to (default: not kept)")
    parser.add_argument("--json", action="store_true", help="print one line of JSON a game instead of a table")
    return parser.parse_args(arguments)


def class_name(text: str) -> str:
    """Checks that it has the form module.path:Class."""
    module, _, name = text.partition(":")
    if not (module and name.isidentifier()):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form module.path:Class")
    return text


def json_object(text: str) -> dict[str, Any]:
    """Reads an object with the arguments of a constructor."""
    try:
        read = json.loads(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"no JSON: {error}") from error
    if not isinstance(read, dict):
        raise argparse.ArgumentTypeError('an object was expected, for instance {"verbose_console": false}')
    return read


def seconds(text: str) -> float:
    """Reads a number of seconds above 0."""
    value = float(text)
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError("must be above 0")
    return value


def count(text: str) -> int:
    """Reads a number from 0."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError("must be 0 or more")
    return value


if __name__ == "__main__":
    sys.exit(main())
