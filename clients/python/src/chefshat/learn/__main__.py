"""The command line `python -m chefshat.learn`: its commands and their options. Each command is the function `run` of a module."""

import argparse
from pathlib import Path

from chefshat import join_options
from chefshat.learn.command import (
    Given,
    Program,
    above_zero,
    add_evaluations,
    add_force,
    add_games,
    add_log,
    add_rules,
    count,
    json_object,
    natural,
    share,
    units,
    zero_or_more,
)

EXAMPLES = """examples:
  python -m chefshat.learn ppo --out strong.safetensors --minutes 30 --seed 1
  python -m chefshat.learn ppo --out exploiter.safetensors --games 0 --opponent-games 256 --opponents trained --minutes 30
  python -m chefshat.learn curve seed-*.jsonl --out curve.png
  python -m chefshat.learn value strong.safetensors --out points.safetensors
  python -m chefshat.learn evaluate strong.safetensors --opponents greedy --games 2000
  python -m chefshat.learn play strong.safetensors --address 127.0.0.1:50051 --code CODE --name Strong

The paper's `deep-q` and `tune` are in the package chefshat-paper: python -m chefshat_paper.learn

Without --address the games are played in this process (chefshat-native), or by a server that the command starts.

exit code: 0 success, 1 failure (the last line gives the reason), 2 wrong arguments, 130 interrupted
"""


def _ppo(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    budget = command.add_mutually_exclusive_group(required=True)
    budget.add_argument("--minutes", type=above_zero, help="stop after this many minutes")
    budget.add_argument("--decisions", type=count, help="stop after this many decisions")
    add_games(command)
    command.add_argument("--name", default="ppo", help="name of the agent, written into the network")
    add_rules(command)
    command.add_argument("--begin-with", type=Path, metavar="FILE", help="a network of `ppo` to begin with (default: a new one)")
    command.add_argument(
        "--resume", action="store_true", help="resume from the checkpoint, with its plan; the budget counts from the first start"
    )
    add_force(command)
    command.add_argument("--checkpoint", type=Path, metavar="FILE", help="the checkpoint (default: OUT as .training)")
    add_log(command)
    command.add_argument("--tensorboard", type=Path, metavar="DIR", help="write losses and evaluations there, for TensorBoard")
    plan = command.add_argument_group("plan (stored in the checkpoint)")
    add_evaluations(plan)
    plan.add_argument("--games", type=natural, default=256, help="parallel games of self-play; 0: learn a best response")
    plan.add_argument("--opponent-games", type=natural, default=0, help="further games with one seat against other agents")
    plan.add_argument(
        "--opponents",
        nargs="+",
        default=["greedy"],
        metavar="NAME",
        help="who plays the other seats of these: built-in agents, network files or opponents of plug-ins (with chefshat-paper "
        "club:module.path:Class), one or one for each seat; for instance past.safetensors trained greedy",
    )
    plan.add_argument(
        "--coalition",
        action=Given,
        nargs=0,
        const=True,
        default=False,
        help="play two seats of these, 0 and 2, for the points of both",
    )
    plan.add_argument(
        "--opponent-python",
        "--club-python",
        default="",
        metavar="PYTHON",
        help="the Python of opponents of plug-ins (default: this one)",
    )
    plan.add_argument(
        "--opponent-arguments",
        "--club-arguments",
        type=json_object,
        default="{}",
        metavar="JSON",
        help="their arguments, as an object",
    )
    plan.add_argument("--steps", type=count, default=128, help="decisions in each game between two updates")
    plan.add_argument("--epochs", type=count, default=2, help="passes over them in an update")
    plan.add_argument("--minibatches", type=count, default=16, help="number of parts they are split into")
    plan.add_argument("--width", type=units, default=256, help="units of each of the policy network's two hidden layers")
    plan.add_argument("--value-width", type=count, default=128, help="units of each of the value network's two hidden layers")
    plan.add_argument(
        "--all-hands",
        action=Given,
        nargs=0,
        const=True,
        default=False,
        help="show the hands of all seats to the value network, which no game needs; with self-play only",
    )
    plan.add_argument(
        "--value-updates", type=natural, default=0, help="first updates, which learn only the value network; see --begin-with"
    )
    plan.add_argument("--learning-rate", type=above_zero, default=5e-4, help="initial learning rate; decays to a twentieth")
    plan.add_argument(
        "--value-learning-rate", type=zero_or_more, default=0.0, help="initial learning rate of the value network; 0: the same"
    )
    plan.add_argument("--entropy-bonus", type=zero_or_more, default=0.01, help="initial weight of the entropy; decays to a tenth")
    plan.add_argument("--gae-lambda", "--trace", type=share, default=0.95, help="lambda of the advantage estimation")
    plan.add_argument("--clip", type=above_zero, default=0.2, help="clip range of the probability ratio")


def _evaluate(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="the network, or trained: that of the built-in agent")
    command.add_argument(
        "--opponents",
        nargs="+",
        default=["greedy"],
        metavar="NAME",
        help="built-in agents or network files, one or one for each seat",
    )
    command.add_argument("--games", type=count, default=2000, help="games to play")
    add_games(command)
    add_rules(command)


def _value(command: argparse.ArgumentParser) -> None:
    command.add_argument("policy", type=Path, help="the network of the policy, or trained: that of the built-in agent")
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    command.add_argument("--decisions", type=count, default=500_000, help="decisions to learn from, of some 700 bytes each")
    command.add_argument("--epochs", type=count, default=10, help="passes over them")
    command.add_argument("--width", type=units, default=128, help="units of each of the two hidden layers")
    add_games(command)
    add_rules(command)
    add_force(command)


def _curve(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "logs",
        type=Path,
        nargs="+",
        metavar="LOG",
        help="logs of `ppo` or `deep-q`; those that differ in nothing but their seed are one line, the interquartile mean of "
        "the runs",
    )
    command.add_argument(
        "--baselines",
        nargs="+",
        default=[],
        metavar="NAME",
        help="built-in agents or network files that play the same games, as horizontal lines; built-in ones need chefshat-native",
    )
    command.add_argument("--out", type=Path, required=True, metavar="PNG", help="the picture to write")


def _play(command: argparse.ArgumentParser) -> None:
    command.add_argument("file", type=Path, help="the network, or trained: that of the built-in agent")
    join_options.add_server_options(command, required=True)
    join_options.add_options(command)
    command.add_argument("--name", help="display name, 1 to 64 characters; not needed with a ticket")
    # Conflicts between options are checked after parsing.
    command.set_defaults(parser=command)


PROGRAM = Program(
    module="chefshat.learn",
    description="Trains agents, evaluates them, and plays with them.",
    examples=EXAMPLES,
    commands={
        "ppo": ("ppo_command", "trains an agent by self-play with proximal policy optimisation", _ppo),
        "value": ("value", "trains a value network: the expected points of a policy", _value),
        "evaluate": ("evaluation", "plays a trained network on one seat against built-in agents", _evaluate),
        "curve": ("curve", "draws the learning curves of trainings, from their logs", _curve),
        "play": ("play", "plays a game in a room, or a whole tournament, with a trained network", _play),
    },
    extra="chefshat[learn]",
    packages=("flax", "jax", "jaxlib", "optax", "safetensors", "tensorboardX", "tqdm"),
)
main, parse = PROGRAM.main, PROGRAM.parse

if __name__ == "__main__":
    raise SystemExit(main())
