"""A training by PPO as a value and as a file: its plan, its progress, and the state to resume from.

The file format is in `training_file`, the training loop in `ppo_training`.
"""

import dataclasses
import hashlib
import json
import os
from dataclasses import dataclass, field
from typing import Any, Self

import jax

from chefshat import pb
from chefshat.files import check_readable
from chefshat.learn import all_hands, mlp, ppo, training_file
from chefshat.learn.features import num_actions, table_width
from chefshat.learn.mlp import Params
from chefshat.learn.network import Network
from chefshat.learn.ppo import Hyperparameters, Learner
from chefshat.learn.training_file import network_info, opened
from chefshat.learn.training_log import Progress
from chefshat.vector_setup import NETWORK_SUFFIX

FORMAT = "chefshat-ppo-training-2"
# With weights as (out, in), and with older names in the plan.
OLD_FORMAT = "chefshat-ppo-training-1"


@dataclass(frozen=True)
class Opponent:
    """An opponent of a training.

    Attributes:
        name: a built-in agent, the path of a network file, or "KIND:NAME", an opponent of a plug-in; see `plugins`.
        sha256: the SHA-256 of the file in hexadecimal; empty: not known yet, or not a file.
        python: the Python of an opponent of a plug-in; empty: this program's.
        arguments: the arguments of that opponent, a JSON object; empty: none.
    """

    name: str
    sha256: str = ""
    python: str = ""
    arguments: str = ""

    def checked(self) -> Self:
        """Returns the opponent with the digest of its file.

        Raises OSError if the file cannot be read, ValueError if it is another file than before.
        """
        if not self.name.endswith(NETWORK_SUFFIX):
            return self
        check_readable(self.name, "network", "this training plays against")
        with open(self.name, "rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        if self.sha256 not in ("", sha256):
            raise ValueError(
                f"{self.name} is not the network that this training played against so far: put that back (SHA-256 {self.sha256}), "
                "or start another training"
            )
        return dataclasses.replace(self, sha256=sha256)


@dataclass(frozen=True)
class Plan:
    """The settings of a training.

    Attributes:
        games: parallel games of self-play; 0: only those against the opponents, for a best response to them.
        opponent_games: further games, in which the policy plays only seat 0, or with `coalition` the seats 0 and 2.
        opponents: who plays the other seats of these, one for all or one for each.
        coalition: both seats have the mean of their rewards.
        value_updates: first updates, which learn only the value network.
        steps: decisions in each game between two updates.
        epochs: passes over the samples of an update.
        learning_rate: initial; it decays linearly to a twentieth.
        value_learning_rate: that of the value network, which decays likewise; 0: the same.
        entropy_bonus: initial; it decays linearly to a tenth.
        discount: factor of a reward one decision later, gamma.
        gae_lambda: lambda of the generalised advantage estimation.
        evaluation_games: games against each opponent in an evaluation.
        evaluations: number of evaluations and checkpoints, besides the one before the first update.
        begin_with: the file of the initial policy; empty: a new one.
        hyper: the networks and what else is compiled in.
    """

    games: int = 256
    opponent_games: int = 0
    opponents: tuple[Opponent, ...] = (Opponent("greedy"),)
    coalition: bool = False
    value_updates: int = 0
    steps: int = 128
    epochs: int = 2
    learning_rate: float = 5e-4
    value_learning_rate: float = 0.0
    entropy_bonus: float = 0.01
    discount: float = 1.0
    gae_lambda: float = 0.95
    evaluation_games: int = 400
    evaluations: int = 20
    begin_with: str = ""
    hyper: Hyperparameters = field(default_factory=Hyperparameters)

    def __post_init__(self) -> None:
        if self.hyper.all_hands and self.opponent_games:
            raise ValueError("hands of opponents are not shown: leave out --all-hands or --opponent-games")

    def checked(self) -> Self:
        """Returns the plan with the digests of its network files. Raises OSError and ValueError as `Opponent.checked`."""
        if not self.opponent_games:
            return self
        return dataclasses.replace(self, opponents=tuple(opponent.checked() for opponent in self.opponents))

    @classmethod
    def of(cls, plain: dict[str, Any]) -> Self:
        """Restores a plan from the JSON of `dataclasses.asdict`, also of older versions."""
        opponents = plain["opponents"]
        # In older versions they were names, separated by commas.
        listed = [{"name": name} for name in opponents.split(",")] if isinstance(opponents, str) else opponents
        hyper: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in plain["hyper"].items()}
        renamed = {"trace": "gae_lambda"}
        restored = {"opponents": tuple(Opponent(**opponent) for opponent in listed), "hyper": Hyperparameters(**hyper)}
        return cls(**{renamed.get(key, key): value for key, value in plain.items()} | restored)


@dataclass(frozen=True)
class Training:
    """The state to resume a training from. Its games start anew.

    Attributes:
        plan: the settings.
        seed: the seed.
        rules: the rule set, every field set.
        learner: the networks and the optimiser.
        progress: the progress so far.
        trained_by: the command, or the commands.
    """

    plan: Plan
    seed: int
    rules: pb.RuleSet
    learner: Learner
    progress: Progress
    trained_by: str

    def network(self, name: str) -> Network:
        """Returns the policy network."""
        layers = mlp.to_layers(self.learner.params.policy)
        return Network(layers, network_info(self.rules, name, self.trained_by, input="table", output="actions", masked=True))


def begin(plan: Plan, seed: int, rules: pb.RuleSet, trained_by: str, begin_with: Network | None = None) -> Training:
    """Returns a new training.

    Args:
        plan: the settings.
        seed: the seed.
        rules: the rule set, every field set.
        trained_by: the command.
        begin_with: the initial policy, with the hidden layers of the plan; None: a new one.
    """
    hidden = all_hands.width(rules.players, rules.faces) if plan.hyper.all_hands else 0
    learner = ppo.start(seed, table_width(rules.players, rules.faces), num_actions(rules.faces), plan.hyper, hidden)
    if begin_with is not None:
        policy: Params = jax.tree.map(lambda leaf: leaf[0], mlp.stack([begin_with.layers]))
        learner = learner._replace(params=learner.params._replace(policy=policy))
    return Training(plan, seed, rules, learner, Progress(), trained_by)


def save(path: str | os.PathLike[str], training: Training) -> None:
    """Writes a training to a file atomically. Raises OSError if it cannot be written."""
    texts = {
        "plan": json.dumps(dataclasses.asdict(training.plan)),
        "progress": json.dumps(dataclasses.asdict(training.progress)),
        "seed": str(training.seed),
        "trained_by": training.trained_by,
    }
    training_file.save(path, FORMAT, training.learner, training.rules, texts)


def load(path: str | os.PathLike[str]) -> Training:
    """Reads a training from a file. Raises `TrainingFileError` if it is not one, OSError if it cannot be read."""
    with opened(path, FORMAT, OLD_FORMAT) as contents:
        texts = contents.texts
        plan, progress = Plan.of(json.loads(texts["plan"])), Progress(**json.loads(texts["progress"]))
        seed, rules = int(texts["seed"]), contents.rules
        learner = contents.state(lambda: begin(plan, seed, rules, "").learner, transposed=contents.form == OLD_FORMAT)
        return Training(plan, seed, rules, learner, progress, texts["trained_by"])
