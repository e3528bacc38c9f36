"""The command `python -m chefshat_paper.players_club`: plays in rooms or a tournament with a player of the reference.

The player's process is in `process`, its translation in `agent`, joining in `join_options`.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from chefshat import Client, join_options, outcome
from chefshat.errors import exit_code
from chefshat.join_options import JoinOptions
from chefshat.learn.command import above_zero, json_object, natural

from chefshat_paper.players_club.agent import ATTEMPTS, RulesDoNotFit, check_rules
from chefshat_paper.players_club.players import Players
from chefshat_paper.players_club.process import AgentSpec

EXAMPLE = """examples:
  python -m chefshat_paper.players_club --server 127.0.0.1:50051 --code BCDF2345 \\
    --agent ChefsHatGym.agents.agent_random:AgentRandon --python ~/venv-chefshatgym/bin/python --name Rolf
  python -m chefshat_paper.players_club --server 127.0.0.1:50051 --code BCDF2345 --code GHJK6789 \\
    --agent my_players:Cautious --path ~/players --arguments '{"verbose_console": false}'
  python -m chefshat_paper.players_club --server 127.0.0.1:50051 --tournament BCDF2345 --games 2 --name Dora \\
    --agent my_players:Cautious --path ~/players --ticket-file dora.ticket

The player runs with all your rights, like any program that you start. An illegal choice is sent, counted by the server as an
invalid attempt, and the player is asked again. If it raises, hangs or dies, the default action is taken; a lost process restarts at
the next call. With --games N it plays in N separate processes with the same --arguments and --log; {process} in these is replaced
by the number of the process, from 0.

If this command dies, run it again with the ticket that it printed, or with the same --ticket-file, to resume. The player receives
all events of the game again; any other state is lost.

exit code: 0 every game or the tournament finished, 1 one was refused, lost or aborted, or the player was given up, 2 wrong
arguments, 130 interrupted
"""
# Maximum characters of a display name.
MAX_NAME = 64


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    options = parse(arguments)
    spec = AgentSpec(
        agent=options.agent,
        name=options.name or options.agent.rpartition(":")[2],
        arguments=json.loads(options.arguments),
        python=options.python,
        paths=tuple(options.path),
        start_limit_s=options.start_limit,
        call_limit_s=options.limit,
        restarts=options.restarts,
        log=options.log,
    )

    def play_all() -> int:
        # Starts the player before joining, so that nobody waits for a player that fails to start.
        with (
            Players(spec, options.games or 1, attempts=options.attempts) as players,
            Client(join_options.server_of(options)) as client,
        ):
            codes = [play(client, players, way, as_json=options.json) for way in options.ways]
            return max(*codes, int(players.given_up))

    return exit_code(play_all, RulesDoNotFit, as_json=options.json)


def play(client: Client, players: Players, way: JoinOptions, *, as_json: bool) -> int:
    """Plays the game of one room, or a tournament, and prints the result. Returns 0 if it was finished, else 1."""
    way = replace(way, name=way.name or players.name[:MAX_NAME])
    before = own_counts(players)
    played = join_options.take_part(client, way, lambda _: players.agent(), check_rules=check_rules, prepare=players.prepare)
    own = {what: count - before[what] for what, count in own_counts(players).items()}
    words = "{failures} failures of the player, {replaced} decisions taken for it, {restarts} restarts".format(**own)
    if own["crowded"]:
        words += ", {crowded} games started with a busy process".format(**own)
    return outcome.report(played, as_json=as_json, own=own, own_words=words)


def own_counts(players: Players) -> dict[str, int]:
    """Counts the failures and replaced decisions of all games so far."""
    return {**asdict(players.counts), "restarts": players.restarts, "crowded": players.crowded}


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Parses the arguments; the places they name are in `ways`."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat_paper.players_club",
        description="Joins a room or a tournament of a Chef's Hat server with a player written for the reference implementation's "
        "second version (ChefsHatGym 2, Chef's Hat Players Club), unchanged.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    join_options.add_server_options(parser, "--server", required=True)
    join_options.add_options(parser, several_codes=True)
    parser.add_argument("--agent", required=True, type=class_name, help="the player, module.path:Class")
    parser.add_argument("--python", default=sys.executable, help="the Python with the player's dependencies (default: this one)")
    parser.add_argument(
        "--path", action="append", default=[], metavar="DIR", help="a folder to search for its modules; may be repeated"
    )
    parser.add_argument("--name", help="display name, also passed to the player (default: the player's own name)")
    parser.add_argument(
        "--arguments", type=json_object, default="{}", metavar="JSON", help="arguments of its constructor, as an object"
    )
    parser.add_argument(
        "--attempts",
        type=natural,
        default=ATTEMPTS,
        help="illegal choices sent for one decision before the best legal one is taken (default: %(default)s, as in the reference)",
    )
    parser.add_argument(
        "--limit", type=above_zero, default=60.0, metavar="S", help="time limit of a call, in seconds (default: %(default)s)"
    )
    parser.add_argument(
        "--start-limit",
        type=above_zero,
        default=120.0,
        metavar="S",
        help="time limit of starting, in seconds (default: %(default)s)",
    )
    parser.add_argument("--restarts", type=natural, default=3, help="maximum restarts of a process (default: %(default)s)")
    parser.add_argument("--log", type=Path, metavar="FILE", help="a file to append the player's output to")
    parser.add_argument("--json", action="store_true", help="print one line of JSON for each game or tournament instead of a table")
    options = parser.parse_args(arguments)
    options.ways = join_options.ways(parser, options, needs_name=False)
    return options


def class_name(text: str) -> str:
    """Checks the form module.path:Class."""
    module, _, name = text.partition(":")
    if not (module and name.isidentifier()):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form module.path:Class")
    return text


if __name__ == "__main__":
    sys.exit(main())
