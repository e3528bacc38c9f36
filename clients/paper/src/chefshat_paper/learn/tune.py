"""The command `python -m chefshat_paper.learn tune`: searches hyper-parameters of the Deep Q agent by TPE, as the 2020 paper did.

Every trial trains a few agents, each in its own game, with one set of parameters. Its value is the mean of the agents' scores in
the second half of their Shifts. The tree-structured Parzen estimator proposes the next set. The results are written after every
trial, so an interrupted run loses nothing.

The best of many values is partly luck. So at the end the best set and the paper's are trained once more, with other seeds: these
values are not selected, and can be compared.
"""

import argparse
import dataclasses
import json
import sys
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import optuna
from chefshat import join_options
from chefshat.errors import ChefsHatError, failed
from chefshat.files import write_atomically
from chefshat.learn import runs
from chefshat.vector import VectorEnv
from tqdm import tqdm

from chefshat_paper.learn import deep_q, deep_q_training
from chefshat_paper.learn.deep_q import DeepQConfig
from chefshat_paper.learn.deep_q_command import TUNED_FOR
from chefshat_paper.learn.deep_q_training import Played

FORMAT = "chefshat-tune-1"


@dataclass(frozen=True)
class Trial:
    """One set of parameters and the result of training with it.

    Attributes:
        number: from 0.
        parameters: the searched parameters, by the names of `DeepQConfig`.
        value: the objective, to be maximised: the mean over the agents.
        least: the lowest score of an agent.
        most: the highest.
    """

    number: int
    parameters: dict[str, Any]
    value: float
    least: float
    most: float

    @classmethod
    def of(cls, number: int, config: DeepQConfig, values: list[float]) -> Self:
        """Summarises the scores of the agents."""
        return cls(number, _searched(config), float(np.mean(values)), min(values), max(values))


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    study = optuna.create_study(direction="maximize", sampler=optuna.samplers.TPESampler(seed=options.seed))
    # The paper's own parameters are tried first.
    study.enqueue_trial(_as_proposed(DeepQConfig()))
    trials: list[Trial] = []
    configs: list[DeepQConfig] = []
    again: list[Trial] = []
    try:
        with (
            runs.reserved(options.out, replace=options.force, can_resume=False),
            tqdm(total=options.trials + 2, unit=" trials", file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar,
        ):
            for _ in range(options.trials):
                asked = study.ask()
                configs.append(dataclasses.replace(_proposed(asked), mask=options.mask))
                trials.append(Trial.of(asked.number, configs[-1], evaluate(options, configs[-1])))
                study.tell(asked, trials[-1].value)
                _write(options, trials, again)
                bar.update()
                bar.set_postfix(best=f"{best(trials).value:.3f}")
            for number in sorted({0, best(trials).number}):
                again.append(Trial.of(number, configs[number], evaluate(options, configs[number], afresh=True)))
                bar.update()
            _write(options, trials, again)
    except (ChefsHatError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    if options.json:
        print(json.dumps({"event": "tuned", "file": str(options.out), **_as_json(options, trials, again)}))
    else:
        print(as_table(trials, goal(options)))
        print("Trained once more, with other seeds:")
        for trial in again:
            whose = "the paper's parameters" if trial.number == 0 else "the best parameters"
            print(f"  {trial.value:.1%} ({trial.least:.1%} to {trial.most:.1%}): trial {trial.number}, {whose}")
        print(f"wrote {options.out}; train with it: python -m chefshat_paper.learn deep-q --parameters {options.out} --out FILE")
    return 0


def evaluate(options: argparse.Namespace, config: DeepQConfig, *, afresh: bool = False) -> list[float]:
    """Trains agents with these parameters. Returns the score of each in the second half of its Shifts, 0..=1.

    All trials have the same seeds; `afresh` has others.
    """
    first = options.seed + options.agents * afresh
    seeds = [first + number for number in range(options.agents)]
    env = VectorEnv(
        join_options.server_if_any(options),
        len(seeds),
        client_seats=[0],
        opponents=options.opponents,
        rewards=options.rewards,
        episode="shift",
        decisions="turns",
        invalid="ask_again",
        total_games=len(seeds),
        # The games of seeds below the step are for evaluations.
        seed=options.seed + runs.SEED_STEP * (1 + afresh),
        rules={"preset": "paper", "target_shifts": options.shifts},
        shift_statistics=True,
    )
    with env:
        _, played = deep_q_training.play(env, config, deep_q.start(config, seeds))
    return achieved(options, played)


def achieved(options: argparse.Namespace, played: Played) -> list[float]:
    """Returns the scores: the share of valid actions with the rewards "validity", else the share of Shifts won."""
    second = slice(options.shifts // 2, None)
    seats = {name: counted[:, second, 0] for name, counted in played.of_seats.items()}
    if options.rewards == "validity":
        valid, wrong = seats["valid"].sum(axis=1), seats["wrong"].sum(axis=1)
        return [float(share) for share in valid / (valid + wrong)]
    return [float(share) for share in (seats["places"] == 1).mean(axis=1)]


def goal(options: argparse.Namespace) -> str:
    """Names the score."""
    return "valid actions" if options.rewards == "validity" else "Shifts won"


def best(trials: list[Trial]) -> Trial:
    """Returns the trial with the highest value, the first of equal ones."""
    return max(trials, key=lambda trial: trial.value)


def as_table(trials: list[Trial], what: str) -> str:
    """Formats the trials, best first."""
    names = list(trials[0].parameters)
    rows = [["trial", what, "least to most", *names]]
    for trial in sorted(trials, key=lambda trial: -trial.value):
        shown = [f"{value:.3g}" if isinstance(value, float) else str(value) for value in trial.parameters.values()]
        rows.append([str(trial.number), f"{trial.value:.1%}", f"{trial.least:.1%} to {trial.most:.1%}", *shown])
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([lines[0], "─" * len(lines[0]), *lines[1:], "", "Trial 0 has the paper's parameters."])


def _proposed(trial: optuna.Trial) -> DeepQConfig:
    """Returns the parameters that the estimator proposes."""
    return DeepQConfig(
        hidden=(
            trial.suggest_categorical("first_layer", [64, 128, 256]),
            trial.suggest_categorical("second_layer", [64, 128, 256]),
        ),
        batch_size=trial.suggest_categorical("batch_size", [16, 32, 64, 128]),
        memory_size=trial.suggest_categorical("memory_size", [1_000, 2_000, 5_000, 20_000]),
        discount=trial.suggest_float("discount", 0.5, 0.99),
        learning_rate=trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True),
        epsilon_decay=trial.suggest_float("epsilon_decay", 0.98, 0.9995),
        epsilon_end=trial.suggest_float("epsilon_end", 0.01, 0.2),
        target_every=trial.suggest_int("target_every", 10, 1_000, log=True),
    )


def _as_proposed(config: DeepQConfig) -> dict[str, Any]:
    """Returns the parameters under the names that `_proposed` uses."""
    found = _searched(config)
    found["first_layer"], found["second_layer"] = found.pop("hidden")
    return found


def _searched(config: DeepQConfig) -> dict[str, Any]:
    """Returns the searched parameters of a config."""
    names = ("hidden", "batch_size", "memory_size", "discount", "learning_rate", "epsilon_decay", "epsilon_end", "target_every")
    return {name: getattr(config, name) for name in names}


def _write(options: argparse.Namespace, trials: list[Trial], again: list[Trial]) -> None:
    write_atomically(options.out, json.dumps(_as_json(options, trials, again), indent=1) + "\n")


def _as_json(options: argparse.Namespace, trials: list[Trial], again: list[Trial]) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "command": options.trained_by,
        "goal": goal(options),
        "best": best(trials).number,
        # `deep-q --parameters` reads these keys: the parameters are those of agents with these settings.
        "parameters": best(trials).parameters,
        **{name: getattr(options, name) for name in TUNED_FOR},
        "trials": [dataclasses.asdict(trial) for trial in trials],
        # Empty until the last trial has ended.
        "trained_afresh": [dataclasses.asdict(trial) for trial in again],
    }
