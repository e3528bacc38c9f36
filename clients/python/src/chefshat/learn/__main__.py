"""The command line `python -m chefshat.learn`: its commands and their options. Each command is the function `run` of a module.

Nothing that an extra brings is imported before the options are read, so that `--help` always answers.
"""

import argparse
import importlib
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chefshat import join_options

EXAMPLES = """examples:
  python -m chefshat.learn ppo --out strong.safetensors --minutes 30 --seed 1
  python -m chefshat.learn curve strong.jsonl --out strong.png
  python -m chefshat.learn deep-q --out deep_q.safetensors --shifts 1000 --mask
  python -m chefshat.learn tune --out tuned.json --trials 50 --shifts 250
  python -m chefshat.learn evaluate strong.safetensors --opponents greedy --games 2000
  python -m chefshat.learn play strong.safetensors --address 127.0.0.1:50051 --code CODE --name Strong

Without --address a server is started for as long as it is needed.

exit code: 0 done, 1 it failed and the last line says why, 2 the arguments are wrong, 130 interrupted
"""
# Packages of the extra; another one that is missing is a fault of ours.
EXTRA = ("jax", "jaxlib", "optax", "optuna", "safetensors", "tqdm")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command and returns its exit code."""
    options = parse(arguments)
    options.trained_by = shlex.join(["python", "-m", "chefshat.learn", *(sys.argv[1:] if arguments is None else arguments)])
    try:
        return int(importlib.import_module(options.module).run(options))
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in EXTRA:
            raise
        print(f"error: the package {error.name} is missing; pip install 'chefshat[learn]'", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return 130


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Reads the options; ends the process with 2 where they are wrong, with 0 after --help.

    Those that were given, rather than left at their defaults, are also in `given`, by name.
    """
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.learn",
        description="Trains agents, and lets them play.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for name, (module, summary, add_options) in COMMANDS.items():
        example = next(line for line in EXAMPLES.splitlines() if f"chefshat.learn {name} " in line)
        command = commands.add_parser(
            name, help=summary, description=summary, epilog=f"example:\n{example}", formatter_class=_WithDefaults
        )
        command.register("action", None, _Given)
        command.set_defaults(module=f"chefshat.learn.{module}", given={})
        command.add_argument("--json", action="store_true", help="print one line of JSON instead of text")
        add_options(command)
    return parser.parse_args(arguments)


class _Given(argparse.Action):
    """Stores a value, and that it was given: a training that goes on must not be contradicted. With nargs=0 it stores `const`."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option: str | None = None) -> None:  # noqa: ANN401 - argparse's.
        value = self.const if self.nargs == 0 else values
        setattr(namespace, self.dest, value)
        namespace.given = {**namespace.given, self.dest: value}


class _WithDefaults(argparse.RawDescriptionHelpFormatter, argparse.ArgumentDefaultsHelpFormatter):
    """Says the default of every option that has one."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default is None or action.default is False else super()._get_help_string(action)


def _ppo(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    budget = command.add_mutually_exclusive_group(required=True)
    budget.add_argument("--minutes", type=_above_zero, help="stop after so many minutes")
    budget.add_argument("--decisions", type=_count, help="stop after so many decisions")
    command.add_argument("--seed", type=_natural, default=1, help="where chance comes from")
    command.add_argument("--name", default="ppo", help="name of the agent, written into the network")
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")
    command.add_argument("--address", metavar="HOST:PORT", help="a server that runs already")
    command.add_argument(
        "--resume", action="store_true", help="go on from the checkpoint, by its plan; the budget counts from the start"
    )
    command.add_argument("--checkpoint", type=Path, metavar="FILE", help="what a training goes on from (default: OUT as .training)")
    command.add_argument("--log", type=Path, metavar="FILE", help="JSON lines of what happened (default: OUT as .jsonl)")
    command.add_argument("--looks", type=_count, default=20, help="how often the policy is evaluated and saved")
    plan = command.add_argument_group("the plan, which a checkpoint keeps")
    plan.add_argument("--evaluation-games", type=_count, default=400, help="games against greedy and random at each look")
    plan.add_argument("--games", type=_count, default=256, help="games of self-play side by side")
    plan.add_argument("--opponent-games", type=_natural, default=0, help="further games with one seat against built-in agents")
    plan.add_argument("--opponents", default="greedy", help="the built-in agent of these")
    plan.add_argument("--steps", type=_count, default=128, help="decisions in each game between two times of learning")
    plan.add_argument("--epochs", type=_count, default=2, help="how often these are gone through")
    plan.add_argument("--minibatches", type=_count, default=16, help="into how many parts they are split")
    plan.add_argument("--width", type=_count, default=256, help="units of each of the policy network's two hidden layers")
    plan.add_argument("--value-width", type=_count, default=128, help="units of each of the value network's two hidden layers")
    plan.add_argument("--learning-rate", type=_above_zero, default=5e-4, help="at the beginning")
    plan.add_argument("--entropy-bonus", type=float, default=0.01, help="at the beginning")
    plan.add_argument("--gae-lambda", "--trace", type=float, default=0.95, help="lambda of the advantage estimation")
    plan.add_argument("--clip", type=_above_zero, default=0.2, help="how far probabilities may move")


def _evaluate(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="the network")
    command.add_argument(
        "--opponents", nargs="+", default=["greedy"], metavar="NAME", help="built-in agents, one name or one for each seat"
    )
    command.add_argument("--games", type=_count, default=2000, help="games to play")
    command.add_argument("--seed", type=_natural, default=1, help="where deals come from")
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")
    command.add_argument("--address", metavar="HOST:PORT", help="a server that runs already")


def _curve(command: argparse.ArgumentParser) -> None:
    command.add_argument("log", type=Path, metavar="LOG", help="the log that `ppo` wrote")
    command.add_argument("--out", type=Path, required=True, metavar="PNG", help="the picture to write")


def _deep_q(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    command.add_argument("--shifts", type=_count, default=250, help="Shifts to play")
    _deep_q_games(command)
    command.add_argument("--name", default="deep-q", help="name of the agent, written into the network")
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")
    command.add_argument(
        "--parameters", type=Path, metavar="FILE", help="hyper-parameters that `tune` found (default: the paper's)"
    )
    command.add_argument(
        "--resume",
        action="store_true",
        help="go on from the checkpoint, by what it was begun with; the Shifts count from the start",
    )
    command.add_argument("--save-every", type=_count, default=50, metavar="SHIFTS", help="how often both files are written")
    command.add_argument("--checkpoint", type=Path, metavar="FILE", help="what a training goes on from (default: OUT as .training)")


def _tune(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="where to write what was found, as JSON")
    command.add_argument("--trials", type=_count, default=20, help="sets of hyper-parameters to try")
    command.add_argument("--agents", type=_count, default=3, help="agents trained with each of them, side by side")
    command.add_argument("--shifts", type=_count, default=100, help="Shifts that each of them plays; the second half counts")
    _deep_q_games(command)


def _deep_q_games(command: argparse.ArgumentParser) -> None:
    command.add_argument("--seed", type=_natural, default=1, help="where chance comes from")
    command.add_argument("--opponents", default="random", metavar="NAME", help="the built-in agent of the three other seats")
    command.add_argument("--rewards", default="paper", metavar="SCHEME", help="how turns are rewarded")
    command.add_argument(
        "--mask", action=_Given, nargs=0, const=True, default=False, help="choose and learn among legal actions alone"
    )
    command.add_argument("--address", metavar="HOST:PORT", help="a server that runs already")


def _play(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="the network")
    command.add_argument("--address", required=True, metavar="HOST:PORT", help="the server")
    join_options.add_options(command)
    command.add_argument("--name", help="name to show, 1 to 64 characters; not needed with a ticket")
    # Which of these go together is checked when all have been read.
    command.set_defaults(parser=command)


def _count(text: str) -> int:
    number = _natural(text)
    if number == 0:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def _natural(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) < 2**31):
        raise argparse.ArgumentTypeError("must be a number from 0 to 2147483647")
    return int(text)


def _above_zero(text: str) -> float:
    number = float(text)
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError("must be above 0")
    return number


# Name: module, what it does, its options.
COMMANDS: dict[str, tuple[str, str, Callable[[argparse.ArgumentParser], None]]] = {
    "ppo": ("ppo_command", "trains an agent by self-play with proximal policy optimisation", _ppo),
    "evaluate": ("evaluation", "plays a trained network on one seat against built-in agents", _evaluate),
    "deep-q": ("deep_q_command", "trains a Deep Q agent, the 2020 paper's, against built-in agents", _deep_q),
    "tune": ("tune", "looks for good hyper-parameters of the Deep Q agent", _tune),
    "curve": ("curve", "draws how a training went, from its log", _curve),
    "play": ("play", "joins a room with a trained network and plays one game, or a tournament to its end", _play),
}

if __name__ == "__main__":
    raise SystemExit(main())
