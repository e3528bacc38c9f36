"""The command `python -m chefshat.agent`: joins a room, plays one game, prints the standings.

What an agent is stands in `agents`, not here.
"""

import argparse
import importlib
import inspect
import json
import os
import sys
from collections.abc import Sequence

import chefshat
from chefshat.agents import Agent, RandomAgent
from chefshat.errors import ChefsHatError
from chefshat.result import SeatResult

EXAMPLE = """example:
  python -m chefshat.agent --address 127.0.0.1:50051 --code ABCDEF --name Ada --agent random --seed 7
  python -m chefshat.agent --address 127.0.0.1:50051 --code ABCDEF --name Bob --agent my_module:MyAgent

exit code: 0 the game was finished, 1 it was refused, lost or aborted, 2 the arguments are wrong
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.agent",
        description="Joins a room of a Chef's Hat server, plays one game and prints the standings.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--address", required=True, help="the server, HOST:PORT")
    parser.add_argument("--code", required=True, help="the room's join code")
    parser.add_argument("--name", required=True, help="name to show, 1 to 64 characters")
    parser.add_argument("--agent", default="random", help="'random', or module:Class of an Agent (default: random)")
    parser.add_argument("--seed", type=int, help="seed of the agent's chance")
    parser.add_argument("--seat", type=int, help="a certain seat (default: the first free one)")
    parser.add_argument("--json", action="store_true", help="print one line of JSON instead of a table")
    options = parser.parse_args(arguments)
    try:
        agent = make_agent(options.agent, options.seed)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        parser.error(f"--agent {options.agent}: {error}")
    try:
        result = chefshat.play(agent, options.address, join_code=options.code, name=options.name, seat=options.seat)
    except ChefsHatError as error:
        if options.json:
            print(json.dumps({"event": "error", "reason": error.reason, "message": error.message, "metadata": error.metadata}))
        else:
            print(f"error: {error}", file=sys.stderr)
        return 1
    print(json.dumps(as_json(result)) if options.json else as_table(result), flush=True)
    return 0 if result.finished else 1


def make_agent(name: str, seed: int | None) -> Agent:
    """Makes the agent called "random" or "module:Class"; a class whose constructor takes `seed` gets it."""
    if name == "random":
        return RandomAgent(seed)
    module_name, separator, class_name = name.partition(":")
    if not separator:
        raise ValueError("neither 'random' nor module:Class")
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    found = getattr(importlib.import_module(module_name), class_name)
    if not (isinstance(found, type) and issubclass(found, Agent)):
        raise TypeError(f"{class_name} is not a subclass of chefshat.Agent")
    takes_seed = "seed" in inspect.signature(found).parameters
    if seed is not None and not takes_seed:
        raise ValueError(f"--seed is given, but {class_name} takes no argument `seed`")
    arguments = {"seed": seed} if takes_seed else {}
    return found(**arguments)


def as_json(result: SeatResult) -> dict[str, object]:
    """The result as plain values."""
    return {
        "event": "finished" if result.finished else "aborted",
        "abort_reason": result.abort_reason,
        "room_id": result.room_id,
        "game_id": result.game_id,
        "seat": result.seat,
        "place": result.place,
        "points": result.points,
        "standings": [{"seat": line.seat, "points": line.points, "place": line.place} for line in result.standings],
        "decisions": result.decisions,
        "invalid": result.invalid,
        "late": result.late,
        "annotations_dropped": result.annotations_dropped,
        "reconnects": result.reconnects,
        "entropy": result.entropy.hex(),
    }


def as_table(result: SeatResult) -> str:
    """The result for people."""
    if not result.finished:
        return f"The game was aborted ({result.abort_reason}) and has no result."
    lines = ["place  seat  points"]
    for line in result.standings:
        mine = "  <- this agent" if line.seat == result.seat else ""
        lines.append(f"{line.place:>5}  {line.seat:>4}  {line.points:>6}{mine}")
    lines.append(f"{result.decisions} decisions, {result.invalid} invalid answers, {result.late} too late")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
