"""The command line `python -m chefshat_paper.learn`: its commands and their options."""

import argparse
from pathlib import Path

from chefshat.learn.command import Given, Program, add_evaluations, add_force, add_games, add_log, add_rules, count

EXAMPLES = """examples:
  python -m chefshat_paper.learn deep-q --out deep_q.safetensors --shifts 1000 --mask
  python -m chefshat_paper.learn tune --out tuned.json --trials 50 --shifts 250

Without --address the games are played in this process (chefshat-native), or by a server that the command starts.

exit code: 0 success, 1 failure (the last line gives the reason), 2 wrong arguments, 130 interrupted
"""


def _deep_q(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the network to write")
    budget = command.add_mutually_exclusive_group()
    budget.add_argument("--shifts", type=count, default=250, help="Shifts to play")
    budget.add_argument("--decisions", type=count, help="stop after this many decisions among several legal actions instead")
    _deep_q_games(command)
    command.add_argument("--name", default="deep-q", help="name of the agent, written into the network")
    add_rules(command)
    command.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE",
        help="hyper-parameters found by `tune`, with its --mask, --opponents and --rewards unless they are given here "
        "(default: the paper's)",
    )
    command.add_argument(
        "--resume",
        action="store_true",
        help="resume from the checkpoint, with its settings; the budget counts from the first start",
    )
    add_force(command)
    command.add_argument("--save-every", type=count, default=50, metavar="SHIFTS", help="Shifts between two writes of both files")
    command.add_argument("--checkpoint", type=Path, metavar="FILE", help="the checkpoint (default: OUT as .training)")
    add_log(command)
    add_evaluations(command)


def _tune(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=Path, required=True, metavar="FILE", help="the results to write, as JSON")
    command.add_argument("--trials", type=count, default=20, help="sets of hyper-parameters to try")
    command.add_argument("--agents", type=count, default=3, help="agents trained in parallel with each set")
    command.add_argument("--shifts", type=count, default=100, help="Shifts that each agent plays; the second half counts")
    _deep_q_games(command)
    add_force(command)


def _deep_q_games(command: argparse.ArgumentParser) -> None:
    add_games(command)
    command.add_argument(
        "--opponents", default="random", metavar="NAME", help="the built-in agent or network file of the three other seats"
    )
    command.add_argument("--rewards", default="paper", metavar="SCHEME", help="the reward scheme of turns")
    command.add_argument(
        "--mask", action=Given, nargs=0, const=True, default=False, help="choose and learn only among legal actions"
    )


PROGRAM = Program(
    module="chefshat_paper.learn",
    description="Trains the Deep Q agent of the 2020 paper.",
    examples=EXAMPLES,
    commands={
        "deep-q": ("deep_q_command", "trains a Deep Q agent against built-in agents", _deep_q),
        "tune": ("tune", "searches its hyper-parameters", _tune),
    },
    extra="chefshat-paper[learn]",
    packages=("flax", "jax", "jaxlib", "optax", "optuna", "safetensors", "tqdm"),
)
main, parse = PROGRAM.main, PROGRAM.parse

if __name__ == "__main__":
    raise SystemExit(main())
