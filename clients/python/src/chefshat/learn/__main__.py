"""The command line `python -m chefshat.learn`: its commands and their options. Each command is the function `run` of a module.

Imports packages of the extra only after parsing the options, so that `--help` works without them.
"""

import argparse
import importlib
import json
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from chefshat import join_options

EXAMPLES = """examples:
  python -m chefshat.learn ppo --out strong.safetensors --minutes 30 --seed 1
  python -m chefshat.learn ppo --out exploiter.safetensors --games 0 --opponent-games 256 --opponents trained --minutes 30
  python -m chefshat.learn curve seed-*.jsonl --out curve.png
  python -m chefshat.learn value strong.safetensors --out points.safetensors
  python -m chefshat.learn deep-q --out deep_q.safetensors --shifts 1000 --mask
  python -m chefshat.learn tune --out tuned.json --trials 50 --shifts 250
  python -m chefshat.learn evaluate strong.safetensors --opponents greedy --games 2000
  python -m chefshat.learn play strong.safetensors --address 127.0.0.1:50051 --code CODE --name Strong

Without --address the games are played in this process (chefshat-native), or by a server that the command starts.

exit code: 0 success, 1 failure (the last line gives the reason), 2 wrong arguments, 130 interrupted
"""
# Packages of the extra. A missing module of any other package is a bug.
EXTRA = ("flax", "jax", "jaxlib", "optax", "optuna", "safetensors", "tensorboardX", "tqdm")


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
    """Parses the options. Exits with 2 if they are wrong, with 0 after --help.

    Options given explicitly are also in `given`, by name.
    """
    parser = argparse.ArgumentParser(
        prog="python -m chefshat.learn",
        description="Trains agents, evaluates them, and plays with them.",
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
    """Stores a value and records it in `given`, so that a resumed training can refuse contradictions. nargs=0 stores `const`."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option: str | None = None) -> None:  # noqa: ANN401 - argparse's.
        value = self.const if self.nargs == 0 else values
        setattr(namespace, self.dest, value)
        namespace.given = {**namespace.given, self.dest: value}


class _WithDefaults(argparse.RawDescriptionHelpFormatter, argparse.ArgumentDefaultsHelpFormatter):
    """Shows the default of every option that has one."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default is None or action.default is False else super()._get_help_string(action)


def _ppo(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    budget = command.add_mutually_exclusive_group(required=True)
    budget.add_argument("--minutes", type=_above_zero, help="stop after this many minutes")
    budget.add_argument("--decisions", type=_count, help="stop after this many decisions")
    _common(command)
    command.add_argument("--name", default="ppo", help="name of the agent, written into the network")
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")
    command.add_argument("--begin-with", type=Path, metavar="FILE", help="a network of `ppo` to begin with (default: a new one)")
    command.add_argument(
        "--resume", action="store_true", help="resume from the checkpoint, with its plan; the budget counts from the first start"
    )
    _force(command)
    command.add_argument("--checkpoint", type=Path, metavar="FILE", help="the checkpoint (default: OUT as .training)")
    command.add_argument(
        "--log", type=Path, metavar="FILE", help="JSON lines of the setup and the evaluations (default: OUT as .jsonl)"
    )
    command.add_argument("--evaluations", "--looks", type=_count, default=20, help="number of evaluations and checkpoints")
    command.add_argument("--tensorboard", type=Path, metavar="DIR", help="write losses and evaluations there, for TensorBoard")
    plan = command.add_argument_group("plan (stored in the checkpoint)")
    plan.add_argument("--evaluation-games", type=_count, default=400, help="games against greedy and random in each evaluation")
    plan.add_argument("--games", type=_natural, default=256, help="parallel games of self-play; 0: learn a best response")
    plan.add_argument("--opponent-games", type=_natural, default=0, help="further games with one seat against built-in agents")
    plan.add_argument(
        "--opponents",
        nargs="+",
        default=["greedy"],
        metavar="NAME",
        help="who plays the other seats of these: built-in agents, network files or players of the Players Club "
        "(club:module.path:Class), one or one for each seat; for instance past.safetensors trained greedy",
    )
    plan.add_argument("--club-python", default="", metavar="PYTHON", help="the Python with these players (default: this one)")
    plan.add_argument(
        "--club-arguments", type=_json_object, default="{}", metavar="JSON", help="arguments of their constructors, as an object"
    )
    plan.add_argument("--steps", type=_count, default=128, help="decisions in each game between two updates")
    plan.add_argument("--epochs", type=_count, default=2, help="passes over them in an update")
    plan.add_argument("--minibatches", type=_count, default=16, help="number of parts they are split into")
    plan.add_argument("--width", type=_count, default=256, help="units of each of the policy network's two hidden layers")
    plan.add_argument("--value-width", type=_count, default=128, help="units of each of the value network's two hidden layers")
    plan.add_argument(
        "--all-hands",
        action=_Given,
        nargs=0,
        const=True,
        default=False,
        help="show the hands of all seats to the value network, which no game needs; with self-play only",
    )
    plan.add_argument(
        "--value-updates", type=_natural, default=0, help="first updates, which learn only the value network; see --begin-with"
    )
    plan.add_argument("--learning-rate", type=_above_zero, default=5e-4, help="initial learning rate; decays to a twentieth")
    plan.add_argument(
        "--value-learning-rate", type=float, default=0.0, help="initial learning rate of the value network; 0: the same"
    )
    plan.add_argument("--entropy-bonus", type=float, default=0.01, help="initial weight of the entropy; decays to a tenth")
    plan.add_argument("--gae-lambda", "--trace", type=float, default=0.95, help="lambda of the advantage estimation")
    plan.add_argument("--clip", type=_above_zero, default=0.2, help="clip range of the probability ratio")


def _force(command: argparse.ArgumentParser) -> None:
    command.add_argument("--force", action="store_true", help="replace existing files")


def _common(command: argparse.ArgumentParser) -> None:
    command.add_argument("--seed", type=_natural, default=1, help="seed of deals and of random choices")
    join_options.add_server_options(command)


def _evaluate(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="the network, or trained: that of the built-in agent")
    command.add_argument(
        "--opponents",
        nargs="+",
        default=["greedy"],
        metavar="NAME",
        help="built-in agents or network files, one or one for each seat",
    )
    command.add_argument("--games", type=_count, default=2000, help="games to play")
    _common(command)
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")


def _value(command: argparse.ArgumentParser) -> None:
    command.add_argument("policy", type=Path, help="the network of the policy, or trained: that of the built-in agent")
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    command.add_argument("--decisions", type=_count, default=500_000, help="decisions to learn from")
    command.add_argument("--epochs", type=_count, default=10, help="passes over them")
    command.add_argument("--width", type=_count, default=128, help="units of each of the two hidden layers")
    _common(command)
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")
    _force(command)


def _curve(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "logs",
        type=Path,
        nargs="+",
        metavar="LOG",
        help="logs written by `ppo`; those that differ in nothing but their seed are one line, the interquartile mean of the runs",
    )
    command.add_argument("--out", type=Path, required=True, metavar="PNG", help="the picture to write")


def _deep_q(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    command.add_argument("--shifts", type=_count, default=250, help="Shifts to play")
    _deep_q_games(command)
    command.add_argument("--name", default="deep-q", help="name of the agent, written into the network")
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")
    command.add_argument("--parameters", type=Path, metavar="FILE", help="hyper-parameters found by `tune` (default: the paper's)")
    command.add_argument(
        "--resume",
        action="store_true",
        help="resume from the checkpoint, with its settings; --shifts counts from the first start",
    )
    _force(command)
    command.add_argument("--save-every", type=_count, default=50, metavar="SHIFTS", help="Shifts between two writes of both files")
    command.add_argument("--checkpoint", type=Path, metavar="FILE", help="the checkpoint (default: OUT as .training)")


def _tune(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the results to write, as JSON")
    command.add_argument("--trials", type=_count, default=20, help="sets of hyper-parameters to try")
    command.add_argument("--agents", type=_count, default=3, help="agents trained in parallel with each set")
    command.add_argument("--shifts", type=_count, default=100, help="Shifts that each agent plays; the second half counts")
    _deep_q_games(command)


def _deep_q_games(command: argparse.ArgumentParser) -> None:
    _common(command)
    command.add_argument(
        "--opponents", default="random", metavar="NAME", help="the built-in agent or network file of the three other seats"
    )
    command.add_argument("--rewards", default="paper", metavar="SCHEME", help="the reward scheme of turns")
    command.add_argument(
        "--mask", action=_Given, nargs=0, const=True, default=False, help="choose and learn only among legal actions"
    )


def _play(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="the network, or trained: that of the built-in agent")
    join_options.add_server_options(command, required=True)
    join_options.add_options(command)
    command.add_argument("--name", help="display name, 1 to 64 characters; not needed with a ticket")
    # Conflicts between options are checked after parsing.
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


def _json_object(text: str) -> str:
    try:
        read = json.loads(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"is not JSON: {error}") from error
    if not isinstance(read, dict):
        raise argparse.ArgumentTypeError('must be a JSON object, such as {"agentType": "vsSelf"}')
    return text


def _above_zero(text: str) -> float:
    number = float(text)
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError("must be above 0")
    return number


# Name: module, summary, options.
COMMANDS: dict[str, tuple[str, str, Callable[[argparse.ArgumentParser], None]]] = {
    "ppo": ("ppo_command", "trains an agent by self-play with proximal policy optimisation", _ppo),
    "value": ("value", "trains a value network: the expected points of a policy", _value),
    "evaluate": ("evaluation", "plays a trained network on one seat against built-in agents", _evaluate),
    "deep-q": ("deep_q_command", "trains a Deep Q agent, the 2020 paper's, against built-in agents", _deep_q),
    "tune": ("tune", "searches hyper-parameters of the Deep Q agent", _tune),
    "curve": ("curve", "draws the learning curve of a training, from its log", _curve),
    "play": ("play", "plays a game in a room, or a whole tournament, with a trained network", _play),
}

if __name__ == "__main__":
    raise SystemExit(main())
