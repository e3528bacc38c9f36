"""The command `python -m chefshat.learn ppo`: trains until the budget of decisions or minutes is used up.

Writes three files: the network, in float16; a log of JSON lines (the setup, then every evaluation), through the logger
`chefshat.learn`; and a checkpoint to resume from. The training itself is in `ppo_training`.
"""

import argparse
import contextlib
import dataclasses
import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from chefshat import join_options, pb
from chefshat.errors import INTERRUPTED, ChefsHatError, failed
from chefshat.learn import network, plugins, ppo_checkpoint, runs, training_log
from chefshat.learn.evaluation import Evaluation, OneOpponent
from chefshat.learn.network import Network
from chefshat.learn.ppo import Hyperparameters
from chefshat.learn.ppo_checkpoint import Opponent, Plan, Training
from chefshat.learn.ppo_training import Trainer
from chefshat.learn.scalars import Scalars
from chefshat.learn.training_file import TrainingFileError
from chefshat.learn.training_log import ITSELF, Progress

# A coalition has the seats 0 and 2.
COALITION_PLAYERS = 3


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    out: Path = options.out
    state: Path = options.checkpoint or out.with_suffix(".training")
    log: Path = options.log or out.with_suffix(".jsonl")
    try:
        with runs.reserved(out, state, log, replace=options.resume or options.force):
            training = _resume(state, options) if options.resume else _start(options)
            evaluated = training_log.last_evaluated(log) if options.resume else None
            with (
                Trainer(training, address=join_options.server_if_any(options)) as trainer,
                training_log.written(log, append=options.resume),
            ):
                begun = trainer.training
                training_log.log_setup("ppo", dataclasses.asdict(begun.plan), begun.seed, begun.rules, begun.trained_by)
                with Scalars(options.tensorboard, begun.progress.decisions) as scalars:
                    evaluations = _train(trainer, options, state, scalars, evaluated)
                is_stopped = _share_done(options, trainer.training.progress) < 1
    except (ChefsHatError, TrainingFileError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    progress = trainer.training.progress
    if options.json:
        event = "interrupted" if is_stopped else "trained"
        print(json.dumps({"event": event, "file": str(out), **training_log.summary(progress, evaluations)}))
    else:
        print(f"{out}: {progress.decisions:,} decisions")
        for evaluation in evaluations:
            print(f"  {evaluation}")
        if is_stopped:
            print("interrupted: resume by the same command with --resume", file=sys.stderr)
    return INTERRUPTED if is_stopped else 0


def _start(options: argparse.Namespace) -> Training:
    if options.games + options.opponent_games == 0:
        raise ValueError("there are no games to play: --games or --opponent-games must be at least 1")
    rules = runs.full_rules(options.rules, join_options.server_if_any(options))
    if options.coalition and (options.opponent_games == 0 or rules.players < COALITION_PLAYERS):
        raise ValueError(f"--coalition needs --opponent-games, and rules for at least {COALITION_PLAYERS} players")
    begin_with = None if options.begin_with is None else _policy(options.begin_with, rules)
    widths = (options.width,) * 2 if begin_with is None else tuple(len(layer.bias) for layer in begin_with.layers[:-1])
    if "width" in options.given and (options.width,) * len(widths) != widths:
        raise ValueError(f"--width {options.width}: the layers of {options.begin_with} have {', '.join(map(str, widths))} units")
    if options.given.keys() & {"opponent_python", "opponent_arguments"} and not any(map(plugins.find, options.opponents)):
        raise ValueError(
            "--opponent-python and --opponent-arguments are for opponents of plug-ins; none of "
            f"{', '.join(options.opponents)} is one of an installed package"
        )
    plan = Plan(
        games=options.games,
        opponent_games=options.opponent_games,
        opponents=tuple(_opponent(name, options) for name in options.opponents),
        coalition=options.coalition,
        value_updates=options.value_updates,
        steps=options.steps,
        epochs=options.epochs,
        learning_rate=options.learning_rate,
        value_learning_rate=options.value_learning_rate,
        entropy_bonus=options.entropy_bonus,
        gae_lambda=options.gae_lambda,
        evaluation_games=options.evaluation_games,
        evaluations=options.evaluations,
        begin_with="" if options.begin_with is None else str(options.begin_with),
        hyper=Hyperparameters(
            policy_widths=widths,
            value_widths=(options.value_width,) * 2,
            clip=options.clip,
            minibatches=options.minibatches,
            all_hands=options.all_hands,
        ),
    )
    if plan.steps * (plan.games + plan.opponent_games) % plan.hyper.minibatches:
        raise ValueError(
            f"{plan.steps} steps of {plan.games + plan.opponent_games} games do not split into {plan.hyper.minibatches} parts"
        )
    return ppo_checkpoint.begin(plan, options.seed, rules, runs.trained_by("", options.trained_by), begin_with)


def _opponent(name: str, options: argparse.Namespace) -> Opponent:
    if plugins.find(name) is None:
        return Opponent(name)
    return Opponent(name, python=options.opponent_python, arguments=options.opponent_arguments)


def _policy(file: Path, rules: pb.RuleSet) -> Network:
    """Reads the initial policy of a training under these rules."""
    policy = network.load(file)
    info = policy.info
    sizes = info.players, info.faces, info.jokers
    if (info.input, info.output) != ("table", "actions") or sizes != (rules.players, rules.faces, rules.jokers):
        raise ValueError(f"{file} is not a policy of `ppo` for {rules.players} players, {rules.faces} faces, {rules.jokers} jokers")
    return policy


def _resume(state: Path, options: argparse.Namespace) -> Training:
    training = ppo_checkpoint.load(runs.existing(state))
    plan, hyper = training.plan, training.plan.hyper
    opponents = [opponent.name for opponent in plan.opponents]
    added = next((opponent for opponent in plan.opponents if opponent.arguments), Opponent(""))
    fixed: dict[str, object] = {"opponents": opponents, "opponent_python": added.python, "opponent_arguments": added.arguments}
    fixed |= {"seed": training.seed, "width": hyper.policy_widths[0], "value_width": hyper.value_widths[0]}
    fixed = {**dataclasses.asdict(plan), **dataclasses.asdict(hyper), **fixed, "begin_with": Path(plan.begin_with)}
    if not plan.begin_with:
        # Older checkpoints do not say.
        del fixed["begin_with"]
    runs.refuse_contradictions(options.given, fixed)
    if "rules" in options.given:
        runs.refuse_other_rules(runs.full_rules(options.rules, join_options.server_if_any(options)), training.rules)
    return dataclasses.replace(training, trained_by=runs.trained_by(training.trained_by, options.trained_by))


def _train(trainer: Trainer, options: argparse.Namespace, state: Path, scalars: Scalars, evaluated: int | None) -> list[Evaluation]:
    """Trains until the budget is used up, or until Ctrl-C. Returns the last evaluations.

    `evaluated`: after how many decisions the last evaluation was; None: there is none.
    """
    evaluations = trainer.training.plan.evaluations
    done = _share_done(options, trainer.training.progress)
    next_evaluation = training_log.next_evaluation(done, evaluations) if evaluated == trainer.training.progress.decisions else done
    losses: dict[str, float] = {}
    with _bar() as bar, contextlib.suppress(KeyboardInterrupt):
        while (done := _share_done(options, trainer.training.progress)) < 1:
            if done >= next_evaluation:
                next_evaluation = training_log.next_evaluation(done, evaluations)
                # Saves first: an evaluation may fail.
                _save(trainer, options, state)
                _evaluate(trainer, options, losses, scalars)
            losses = trainer.update(done)
            scalars.add("losses", losses, trainer.training.progress.decisions)
            bar.n = round(1000 * done)
            bar.set_postfix_str(f"{trainer.training.progress.decisions:,} decisions, entropy {losses['entropy']:.2f}")
    # Saves first: a second Ctrl-C may interrupt the last evaluation.
    _save(trainer, options, state)
    stopped = _share_done(options, trainer.training.progress) < 1
    last = _evaluate(trainer, options, losses, scalars, stopped=stopped)
    ppo_checkpoint.save(state, trainer.training)
    return last


def _save(trainer: Trainer, options: argparse.Namespace, state: Path) -> None:
    """Writes the checkpoint and the network."""
    ppo_checkpoint.save(state, trainer.training)
    learned = trainer.training.network(options.name)
    network.save(options.out, learned.layers, learned.info, dtype=np.float16)


def _share_done(options: argparse.Namespace, progress: Progress) -> float:
    """Returns the share of the budget that is used up, 0..=1."""
    share = progress.seconds / (60 * options.minutes) if options.minutes else progress.decisions / options.decisions
    return float(min(share, 1.0))


def _evaluate(
    trainer: Trainer, options: argparse.Namespace, losses: dict[str, float], scalars: Scalars, *, stopped: bool = False
) -> list[Evaluation]:
    """Plays against the built-in agents, and logs the results. `stopped`: since Ctrl-C was pressed, not since it was due."""
    began = time.monotonic()
    training = trainer.training
    plan = training.plan.checked()
    learned = training.network(options.name)
    further: list[OneOpponent] = list(trainer.opponents) if plan.opponent_games else []
    if plan.coalition:
        others = further if len(further) > 1 else further * (training.rules.players - 2)
        further = [others[0], training.network(ITSELF), *others[1:]]
    address = join_options.server_if_any(options)
    evaluations = training_log.evaluate_all(learned, plan.evaluation_games, training.rules, address, further=further)
    progress = dataclasses.replace(training.progress, seconds=training.progress.seconds + time.monotonic() - began)
    trainer.training = dataclasses.replace(training, progress=progress)
    points = {",".join(evaluation.opponents): evaluation.points for evaluation in evaluations}
    scalars.add("points_per_shift", points, progress.decisions)
    training_log.log_evaluations(progress, evaluations, losses, stopped=stopped)
    return evaluations


@contextlib.contextmanager
def _bar() -> Iterator["tqdm[Any]"]:
    shape = "{desc} {percentage:3.0f} %|{bar}| {elapsed}<{remaining} {postfix}"
    with tqdm(total=1000, desc="ppo", bar_format=shape, file=sys.stderr, disable=not sys.stderr.isatty()) as bar:
        yield bar
