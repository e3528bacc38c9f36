"""A training by PPO as a value and as a file: its plan, how far it has come, and all that it goes on from.

The network alone, which is what an agent needs, is in a file of its own (see `network`). Training is in `ppo_training`.
"""

import dataclasses
import json
import os
from dataclasses import dataclass, field
from typing import Any, Self

import jax
import jax.numpy as jnp
import numpy as np
import safetensors
import safetensors.numpy
from google.protobuf import json_format

from chefshat import pb
from chefshat.files import write_whole
from chefshat.learn import ppo
from chefshat.learn.features import num_actions, table_width
from chefshat.learn.network import Layer, Network, NetworkInfo
from chefshat.learn.ppo import Hyper, Learner

FORMAT = "chefshat-ppo-training-1"


class TrainingFileError(ValueError):
    """A file is not a training of this format. The message names the file and what is wrong with it."""


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
        trained_by: the command.
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
        rules = self.rules
        return Network(
            layers,
            NetworkInfo(
                input="table",
                output="actions",
                output_activation="none",
                masked=True,
                players=rules.players,
                faces=rules.faces,
                jokers=rules.jokers,
                rules=json_format.MessageToJson(rules, indent=None),
                name=name,
                trained_by=self.trained_by,
            ),
        )


def begin(plan: Plan, seed: int, rules: pb.RuleSet, trained_by: str) -> Training:
    """A training that has learned nothing yet. `rules` has every field set."""
    learner = ppo.start(seed, table_width(rules.players, rules.faces), num_actions(rules.faces), plan.hyper)
    return Training(plan, seed, rules, learner, Progress(), trained_by)


def save(path: str | os.PathLike[str], training: Training) -> None:
    """Writes a training to a file, whole or not at all. Raises OSError if it cannot be written."""
    metadata = {
        "format": FORMAT,
        "plan": json.dumps(dataclasses.asdict(training.plan)),
        "progress": json.dumps(dataclasses.asdict(training.progress)),
        "seed": str(training.seed),
        "rules": json_format.MessageToJson(training.rules, indent=None),
        "trained_by": training.trained_by,
    }
    tensors = {name: np.asarray(leaf) for name, leaf in _named(_plain(training.learner))}
    write_whole(path, safetensors.numpy.save(tensors, metadata=metadata))


def load(path: str | os.PathLike[str]) -> Training:
    """Reads a training from a file. Raises `TrainingFileError` if it is none, OSError if it cannot be read."""
    with open(path, "rb"):
        pass  # What cannot be read is an OSError in its own words, not safetensors'.
    try:
        with safetensors.safe_open(path, framework="np") as file:
            metadata = file.metadata() or {}
            if metadata.get("format") != FORMAT:
                raise ValueError(f"its format is {metadata.get('format')!r}, not {FORMAT!r}")
            plan = Plan.of(json.loads(metadata["plan"]))
            progress = Progress(**json.loads(metadata["progress"]))
            rules = json_format.Parse(metadata["rules"], pb.RuleSet())
            seed = int(metadata["seed"])
            # What the arrays must look like, without making them.
            template = jax.eval_shape(lambda: _plain(begin(plan, seed, rules, "").learner))
            leaves = []
            for name, leaf in _named(template):
                tensor = file.get_tensor(name)
                if (tensor.shape, tensor.dtype) != (leaf.shape, leaf.dtype):
                    raise ValueError(f"its {name} is {tensor.dtype}{list(tensor.shape)}, not {leaf.dtype}{list(leaf.shape)}")
                leaves.append(jnp.asarray(tensor))
        learner: Learner = jax.tree.unflatten(jax.tree.structure(template), leaves)
        learner = learner._replace(key=jax.random.wrap_key_data(learner.key))
        return Training(plan, seed, rules, learner, progress, metadata.get("trained_by", ""))
    except KeyError as missing:
        raise TrainingFileError(f"{os.fspath(path)} is no training: it has no {missing}") from missing
    except (ValueError, TypeError, safetensors.SafetensorError, json_format.ParseError) as error:
        raise TrainingFileError(f"{os.fspath(path)} is no training: {error}") from error


def _plain(learner: Learner) -> Learner:
    """With the key as plain numbers, which a file can hold."""
    return learner._replace(key=jax.random.key_data(learner.key))


def _named(learner: Learner) -> list[tuple[str, jax.Array]]:
    """The arrays with their names, such as "params.policy.0.1"."""
    leaves = jax.tree_util.tree_leaves_with_path(learner)
    return [(jax.tree_util.keystr(path, simple=True, separator="."), leaf) for path, leaf in leaves]
