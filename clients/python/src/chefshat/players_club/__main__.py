"""The command `python -m chefshat.players_club`: plays in rooms or a tournament with a player of the reference implementation.

Here are the arguments and the output. Running and understanding the player is in `process` and `agent`, joining in `join_options`.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from chefshat import Client, join_options, outcome
from chefshat.errors import exit_code
from chefshat.join_options import JoinOptions
from chefshat.players_club.agent import ATTEMPTS, RulesDoNotFit, check_rules
from chefshat.players_club.players import Players
from chefshat.players_club.process import AgentError, AgentSpec

EXAMPLE = """examples:
  python -m chefshat.players_club --server 127.0.0.1:50051 --code BCDF2345 \\
    --agent ChefsHatGym.agents.agent_random:AgentRandon --python ~/venv-chefshatgym/bin/python --name Rolf
  python -m chefshat.players_club --server 127.0.0.1:50051 --code BCDF2345 --code GHJK6789 \\
    --agent my_players:Cautious --path ~/players --arguments '{"verbose_console": false}'
  python -m chefshat.players_club --server 127.0.0.1:50051 --tournament BCDF2345 --games 2 --name Dora \\
    --agent my_players:Cautious --path ~/players --ticket-file dora.ticket

The player runs with all your rights, like any program that you start. What it chooses illegally is sent, counted by the server as a
wrong action, and the player is asked again. Where it raises, hangs or dies, the default decision of the rules is taken; a process
that is gone is started anew at the next call. With --games N it plays in N processes, which know nothing of each other but have
the same --arguments and --log: where these say {process}, each has its own number, from 0.

If this command itself dies, another goes on in its place with the ticket that it printed, or with the same --ticket-file. The
player is told the game from the beginning, but knows nothing else of before.

exit code: 0 every game or the tournament was finished, 1 one was refused, lost or aborted, or the player was given up, 2 the
arguments are wrong, 130 interrupted
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

    def play_all() -> int:
        # First the player, then the place: nobody waits for a player that cannot be made.
        with Players(spec, options.games or 1, attempts=options.attempts) as players, Client(options.address) as client:
            codes = [play(client, players, way, as_json=options.json) for way in options.ways]
            return max(*codes, int(players.given_up))

    return exit_code(play_all, AgentError, RulesDoNotFit, as_json=options.json)


def play(client: Client, players: Players, way: JoinOptions, *, as_json: bool) -> int:
    """Plays the game of one room, or a tournament, and prints what came of it. Returns 0 if it was finished, else 1."""
    way = replace(way, name=way.name or players.name[:MAX_NAME])
    before = own_counts(players)
    played = join_options.take_part(client, way, players.seat, check_rules=check_rules, prepare=players.prepare)
    own = {what: count - before[what] for what, count in own_counts(players).items()}
    words = "{failures} failures of the player, {replaced} decisions taken for it, {restarts} restarts".format(**own)
    if own["crowded"]:
        words += ", {crowded} games begun with a process that had one already".format(**own)
    return outcome.report(played, as_json=as_json, own=own, own_words=words)


def own_counts(players: Players) -> dict[str, int]:
    """What was not the player's own in all games so far."""
    return {**asdict(players.counts), "restarts": players.restarts, "crowded": players.crowded}


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The arguments, checked; the places they name are in `ways`."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.players_club",
        description="Joins a room or a tournament of a Chef's Hat server with a player written for the reference implementation's "
        "second version (ChefsHatGym 2, Chef's Hat Players Club), unchanged.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--server", "--address", dest="address", required=True, help="the server, HOST:PORT")
    join_options.add_options(parser, several_codes=True)
    parser.add_argument("--agent", required=True, type=class_name, help="the player, module.path:Class")
    parser.add_argument("--python", default=sys.executable, help="the Python that has what the player needs (default: this one)")
    parser.add_argument(
        "--path", action="append", default=[], metavar="DIR", help="a folder to look for its modules in; may be repeated"
    )
    parser.add_argument("--name", help="name to show, and to give to the player (default: what the player calls itself)")
    parser.add_argument(
        "--arguments", type=json_object, default={}, metavar="JSON", help="arguments of its constructor, as an object"
    )
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
    parser.add_argument("--restarts", type=count, default=3, help="how often a process is started anew (default: %(default)s)")
    parser.add_argument("--log", type=Path, metavar="FILE", help="a file to append what the player prints to (default: not kept)")
    parser.add_argument("--json", action="store_true", help="print one line of JSON a game or tournament instead of a table")
    options = parser.parse_args(arguments)
    options.ways = join_options.ways(parser, options, needs_name=False)
    return options


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
