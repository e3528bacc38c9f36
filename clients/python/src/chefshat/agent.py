"""The command `python -m chefshat.agent`: plays a game in a room, or a whole tournament, and prints the standings.

Agents are in `agents`, joining in `join_options`, the output in `outcome`.
"""

import argparse
import importlib
import inspect
import os
import sys
from collections.abc import Sequence

import chefshat
from chefshat import join_options, outcome
from chefshat.agents import Agent, RandomAgent
from chefshat.decision import SeatInfo
from chefshat.errors import exit_code

EXAMPLE = """examples:
  python -m chefshat.agent --address 127.0.0.1:50051 --code ABCDEF --name Ada --agent random --seed 7
  python -m chefshat.agent --address 127.0.0.1:50051 --code ABCDEF --name Bob --agent my_module:MyAgent --ticket-file bob.ticket
  python -m chefshat.agent --address 127.0.0.1:50051 --tournament ABCDEF --games 8 --name Cleo
  CHEFSHAT_TICKET=TICKET python -m chefshat.agent --address 127.0.0.1:50051 --agent my_module:MyAgent

If the process dies, run it again with the ticket that it printed, or with the same --ticket-file, to resume. The agent receives
all events of the game again; any other state is lost.

exit code: 0 the game or tournament finished, 1 it was refused, lost, aborted or closed, 2 wrong arguments, 130 interrupted
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.agent",
        description="Joins a room or a tournament of a Chef's Hat server, plays it to the end, and prints the standings.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    join_options.add_server_options(parser, required=True)
    join_options.add_options(parser)
    parser.add_argument("--name", help="display name, 1 to 64 characters; not needed with a ticket")
    parser.add_argument(
        "--agent",
        default="random",
        help="'random', or module:Class of an Agent (default: random); every game of a tournament gets a new instance",
    )
    parser.add_argument("--seed", type=int, help="seed of the agent, increased by one for each further game of a tournament")
    parser.add_argument("--json", action="store_true", help="print one line of JSON instead of a table")
    options = parser.parse_args(arguments)
    (way,) = join_options.ways(parser, options)
    try:
        agents = [make_agent(options.agent, options.seed)]
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        parser.error(f"--agent {options.agent}: {error}")
    made = 0

    def make(seat: SeatInfo) -> Agent:
        nonlocal made
        seed = None if options.seed is None else options.seed + made
        made += 1
        return agents.pop() if agents else make_agent(options.agent, seed)

    def play() -> int:
        with chefshat.Client(join_options.server_of(options)) as client:
            return outcome.report(join_options.take_part(client, way, make), as_json=options.json)

    return exit_code(play, as_json=options.json)


def make_agent(name: str, seed: int | None) -> Agent:
    """Creates the agent "random" or "module:Class". Passes `seed` to a constructor that takes it."""
    if name == "random":
        return RandomAgent(seed)
    module_name, separator, class_name = name.partition(":")
    if not separator:
        raise ValueError("give 'random' or module:Class")
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


if __name__ == "__main__":
    sys.exit(main())
