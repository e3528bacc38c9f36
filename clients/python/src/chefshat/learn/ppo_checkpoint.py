"""A training by PPO as a value and as a file: its plan, how far it has come, and all that it goes on from.

What the file looks like is in `training_file`, training in `ppo_training`.
"""

import dataclasses
import json
import os
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from chefshat import pb
from chefshat.learn import ppo, training_file
from chefshat.learn.features import num_actions, table_width
from chefshat.learn.network import Layer, Network
from chefshat.learn.ppo import Hyper, Learner
from chefshat.learn.training_file import network_info, opened

FORMAT = "chefshat-ppo-training-1"


@dataclass(frozen=True)
class Plan:
    """What a training does.

    Attributes:
        games: games of self-play side by side.
        opponent_games: further games, in which the policy holds seat 0 alone.
        opponents: who holds the other seats of these.
        steps: decisions in each game between two times of learning.
        epochs: how often these are gone through.
        learning_rate: at the beginning; it falls to a twentieth at the end.
        entropy_bonus: at the beginning; it falls to a tenth at the end.
        discount: what a decision later is worth, gamma.
        trace: lambda of the advantage estimation.
        evaluation_games: games against each opponent whenever it is looked how good the policy is.
        hyper: the networks and what else is compiled in.
    """

    games: int = 256
    opponent_games: int = 0
    opponents: str = "greedy"
    steps: int = 128
    epochs: int = 2
    learning_rate: float = 5e-4
    entropy_bonus: float = 0.01
    discount: float = 1.0
    trace: float = 0.95
    evaluation_games: int = 400
    hyper: Hyper = field(default_factory=Hyper)

    @classmethod
    def of(cls, plain: dict[str, Any]) -> Self:
        """From what `dataclasses.asdict` and JSON made of it."""
        hyper: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in plain["hyper"].items()}
        return cls(**{**plain, "hyper": Hyper(**hyper)})


@dataclass(frozen=True)
class Progress:
    """How far a training has come.

    Attributes:
        updates: times of learning.
        decisions: decisions taken.
        seconds: seconds it took, evaluations included.
        runs: how often it was begun or gone on with.
    """

    updates: int = 0
    decisions: int = 0
    seconds: float = 0.0
    runs: int = 0


@dataclass(frozen=True)
class Training:
    """All that a training goes on from; its games begin anew.

    Attributes:
        plan: what it does.
        seed: where its chance comes from.
        rules: the rule set, every field set.
        learner: the networks and the optimiser.
        progress: how far it has come.
        trained_by: the command, or the commands.
    """

    plan: Plan
    seed: int
    rules: pb.RuleSet
    learner: Learner
    progress: Progress
    trained_by: str

    def network(self, name: str) -> Network:
        """The policy network."""
        layers = [Layer(np.array(weight), np.array(bias)) for weight, bias in self.learner.params.policy]
        return Network(layers, network_info(self.rules, name, self.trained_by, input="table", output="actions", masked=True))


def begin(plan: Plan, seed: int, rules: pb.RuleSet, trained_by: str) -> Training:
    """A training that has learned nothing yet. `rules` has every field set."""
    learner = ppo.start(seed, table_width(rules.players, rules.faces), num_actions(rules.faces), plan.hyper)
    return Training(plan, seed, rules, learner, Progress(), trained_by)


def save(path: str | os.PathLike[str], training: Training) -> None:
    """Writes a training to a file, whole or not at all. Raises OSError if it cannot be written."""
    texts = {
        "plan": json.dumps(dataclasses.asdict(training.plan)),
        "progress": json.dumps(dataclasses.asdict(training.progress)),
        "seed": str(training.seed),
        "trained_by": training.trained_by,
    }
    training_file.save(path, FORMAT, training.learner, training.rules, texts)


def load(path: str | os.PathLike[str]) -> Training:
    """Reads a training from a file. Raises `TrainingFileError` if it is none, OSError if it cannot be read."""
    with opened(path, FORMAT) as contents:
        texts = contents.texts
        plan, progress = Plan.of(json.loads(texts["plan"])), Progress(**json.loads(texts["progress"]))
        seed, rules = int(texts["seed"]), contents.rules
        learner = contents.state(lambda: begin(plan, seed, rules, "").learner)
        return Training(plan, seed, rules, learner, progress, texts["trained_by"])
