"""The command `python -m chefshat.learn ppo`: trains until the decisions or the minutes are used up, and writes what remains.

Three files: the network, in float16; a log, one JSON object in each line (the setup, then what each look at the policy found); and
what a training goes on from. The training itself is in `ppo_training`.
"""

import argparse
import contextlib
import dataclasses
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from google.protobuf import json_format
from tqdm import tqdm

from chefshat.errors import ChefsHatError, failed
from chefshat.learn import network, ppo_checkpoint, runs
from chefshat.learn.evaluation import Evaluation, evaluate
from chefshat.learn.network import Network
from chefshat.learn.ppo import Hyperparameters
from chefshat.learn.ppo_checkpoint import Plan, Training
from chefshat.learn.ppo_training import Trainer
from chefshat.learn.training_file import TrainingFileError

OPPONENTS = ("greedy", "random")


class Budget:
    """How much of a training is done, by decisions or by minutes."""

    def __init__(self, decisions: int | None, minutes: float | None) -> None:
        self._decisions = decisions
        self._minutes = minutes

    def done(self, progress: ppo_checkpoint.Progress) -> float:
        """Share that is used up, 0..=1."""
        share = progress.decisions / self._decisions if self._decisions else 1.0
        if self._minutes:
            share = progress.seconds / (60 * self._minutes)
        return min(share, 1.0)


def run(options: argparse.Namespace) -> int:
    """The command. Returns the exit code."""
    out: Path = options.out
    state: Path = options.checkpoint or out.with_suffix(".training")
    log: Path = options.log or out.with_suffix(".jsonl")
    try:
        if not out.parent.is_dir():
            raise ValueError(f"there is no folder {out.parent} to write {out.name} to")
        training = _resumed(state, options) if options.resume else _begun(options)
        with Trainer(training, address=options.address) as trainer, log.open("a" if options.resume else "w") as lines:
            _tell(lines, _setup(trainer.training))
            evaluations = _train(trainer, options, lines, state)
    except (ChefsHatError, TrainingFileError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    if options.json:
        print(json.dumps({"event": "trained", "file": str(out), **_told(trainer.training, evaluations)}))
    else:
        print(f"{out}: {trainer.training.progress.decisions:,} decisions")
        for evaluation in evaluations:
            print(f"  {evaluation}")
    return 0


def _begun(options: argparse.Namespace) -> Training:
    plan = Plan(
        games=options.games,
        opponent_games=options.opponent_games,
        opponents=options.opponents,
        steps=options.steps,
        epochs=options.epochs,
        learning_rate=options.learning_rate,
        entropy_bonus=options.entropy_bonus,
        gae_lambda=options.gae_lambda,
        evaluation_games=options.evaluation_games,
        hyper=Hyperparameters(
            policy_widths=(options.width,) * 2,
            value_widths=(options.value_width,) * 2,
            clip=options.clip,
            minibatches=options.minibatches,
        ),
    )
    if plan.steps * (plan.games + plan.opponent_games) % plan.hyper.minibatches:
        raise ValueError(
            f"{plan.steps} steps of {plan.games + plan.opponent_games} games do not split into {plan.hyper.minibatches} parts"
        )
    rules = runs.full_rules(options.rules, options.address)
    return ppo_checkpoint.begin(plan, options.seed, rules, runs.trained_by("", options.trained_by))


def _resumed(state: Path, options: argparse.Namespace) -> Training:
    training = ppo_checkpoint.load(runs.existing(state))
    plan, hyper = training.plan, training.plan.hyper
    kept = {"seed": training.seed, "width": hyper.policy_widths[0], "value_width": hyper.value_widths[0]}
    runs.refuse_contradictions(options.given, {**dataclasses.asdict(plan), **dataclasses.asdict(hyper), **kept})
    if "rules" in options.given:
        runs.refuse_other_rules(runs.full_rules(options.rules, options.address), training.rules)
    return dataclasses.replace(training, trained_by=runs.trained_by(training.trained_by, options.trained_by))


def _train(trainer: Trainer, options: argparse.Namespace, lines: TextIO, state: Path) -> list[Evaluation]:
    """Trains to the end of the budget, or until it is interrupted. Returns the last evaluations."""
    budget = Budget(options.decisions, options.minutes)
    looks = budget.done(trainer.training.progress)
    losses: dict[str, float] = {}
    with _bar() as bar, contextlib.suppress(KeyboardInterrupt):
        while (done := budget.done(trainer.training.progress)) < 1:
            if done >= looks:
                looks += 1 / options.looks
                _look(trainer, options, lines, losses)
                ppo_checkpoint.save(state, trainer.training)
            losses = trainer.update(done)
            bar.n = round(1000 * done)
            bar.set_postfix_str(f"{trainer.training.progress.decisions:,} decisions, entropy {losses['entropy']:.2f}")
    # First of all what was learned: whoever is in a hurry may interrupt the last look as well.
    ppo_checkpoint.save(state, trainer.training)
    _write_network(options.out, trainer.training, options.name)
    evaluations = _look(trainer, options, lines, losses)
    ppo_checkpoint.save(state, trainer.training)
    return evaluations


def _look(trainer: Trainer, options: argparse.Namespace, lines: TextIO, losses: dict[str, float]) -> list[Evaluation]:
    """Plays against the built-in agents, and writes down what came out."""
    began = time.monotonic()
    training = trainer.training
    current = training.network(options.name)
    games = training.plan.evaluation_games
    evaluations = [
        evaluate(current, opponents, games=games, seed=runs.EVALUATION_SEED, rules=training.rules, address=options.address)
        for opponents in OPPONENTS
    ]
    progress = dataclasses.replace(training.progress, seconds=training.progress.seconds + time.monotonic() - began)
    trainer.training = dataclasses.replace(training, progress=progress)
    _tell(lines, {"event": "evaluation", **_told(trainer.training, evaluations), "losses": losses})
    return evaluations


def _told(training: Training, evaluations: list[Evaluation]) -> dict[str, Any]:
    progress = dataclasses.asdict(training.progress)
    return {**progress, "evaluations": [dataclasses.asdict(evaluation) for evaluation in evaluations]}


def _setup(training: Training) -> dict[str, Any]:
    return {
        "event": "setup",
        "plan": dataclasses.asdict(training.plan),
        "seed": training.seed,
        "rules": json_format.MessageToDict(training.rules),
        "trained_by": training.trained_by,
    }


def _tell(lines: TextIO, said: dict[str, Any]) -> None:
    lines.write(json.dumps(said) + "\n")
    lines.flush()


def _write_network(out: Path, training: Training, name: str) -> None:
    trained: Network = training.network(name)
    network.save(out, trained.layers, trained.info, dtype=np.float16)


@contextlib.contextmanager
def _bar() -> Iterator["tqdm[Any]"]:
    shape = "{desc} {percentage:3.0f} %|{bar}| {elapsed}<{remaining} {postfix}"
    with tqdm(total=1000, desc="ppo", bar_format=shape, file=sys.stderr, disable=not sys.stderr.isatty()) as bar:
        yield bar
