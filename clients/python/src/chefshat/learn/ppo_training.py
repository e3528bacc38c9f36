"""Training by self-play: plays games and learns from them, in turns.

The policy plays all seats of most games and, if the plan says so, one or two seats against other agents in others. Collecting games
is in `self_play`, learning in `ppo`, files are in `ppo_checkpoint`, the command is in `ppo_command`.
"""

import dataclasses
import itertools
import json
import time
from collections.abc import Sequence
from typing import Any, Self

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt

from chefshat.address import ServerAddress
from chefshat.learn import plugins, ppo
from chefshat.learn.all_hands import other_hands
from chefshat.learn.plugins import PluginOpponent
from chefshat.learn.ppo import Params, Samples
from chefshat.learn.ppo_checkpoint import Opponent, Plan, Training
from chefshat.learn.runs import SEED_STEP
from chefshat.learn.self_play import Collector, Floats, advantages
from chefshat.learn.training_log import Progress
from chefshat.vector import VectorEnv


class Trainer:
    """A running training; a context manager that ends its games."""

    def __init__(self, training: Training, *, address: str | ServerAddress | None = None) -> None:
        """Starts the games.

        Raises:
            ChefsHatError: they are refused, or the server does not answer.
            ValueError: a network file among the opponents has changed since the training began.
            OSError: such a file cannot be read, or an opponent of a plug-in could not be created.
        """
        plan = training.plan.checked()
        runs = training.progress.runs + 1
        self.training = dataclasses.replace(training, plan=plan, progress=dataclasses.replace(training.progress, runs=runs))
        # Every resumption plays other games.
        first_seed = training.seed + SEED_STEP * runs
        self._envs: list[VectorEnv] = []
        self._collectors: list[Collector] = []
        #: Who plays against the policy in games that are not self-play: names, and opponents of plug-ins.
        self.opponents: list[str | PluginOpponent] = []
        try:
            for opponent in plan.opponents if plan.opponent_games else ():
                self.opponents.append(seated(opponent))
            seats = [0, 2] if plan.coalition else [0]
            against = {"client_seats": seats, "opponents": self.opponents}
            kinds: list[tuple[int, int, dict[str, Any]]] = [(plan.games, 1, {}), (plan.opponent_games, len(seats), against)]
            for number, (games, coalition, others) in enumerate(kinds):
                if games == 0:
                    continue
                settings = {"episode": "shift", "skip_forced": True, "rules": training.rules, **others}
                # Seeds of trainings are below 2^31, so no two environments share one.
                self._envs.append(VectorEnv(address, games, seed=first_seed + SEED_STEP // 2 * number, **settings))
                self._collectors.append(Collector(self._envs[-1], games, plan.steps, coalition=coalition))
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the games, and the opponents of plug-ins."""
        for env in self._envs:
            env.close()
        for opponent in self.opponents:
            if not isinstance(opponent, str):
                opponent.close()

    def update(self, done: float) -> dict[str, float]:
        """Plays and learns once. Returns the losses of the last epoch by name.

        Args:
            done: share of the training that is done, 0..=1; determines the learning rate and the entropy bonus.
        """
        began = time.monotonic()
        plan, learner = self.training.plan, self.training.learner
        before = sum(collector.decisions for collector in self._collectors)
        key, *keys = jax.random.split(learner.key, 1 + len(self._collectors))
        parts = [play(collector, learner.params, key, plan) for collector, key in zip(self._collectors, keys, strict=True)]
        samples, learner = joined(parts), learner._replace(key=key)
        entropy_bonus = jnp.float32(plan.entropy_bonus * (1 - 0.9 * done))
        progress, decay = self.training.progress, 1 - 0.95 * done
        learns_policy = progress.updates >= plan.value_updates
        rates = ppo.Rates(
            policy=jnp.float32(plan.learning_rate * decay * learns_policy),
            value=jnp.float32((plan.value_learning_rate or plan.learning_rate) * decay),
        )
        for _ in range(plan.epochs):
            learner, losses = ppo.learn(learner, samples, rates, entropy_bonus, plan.hyper)
        # Waits until it has learned, which the time includes.
        found = {name: float(value) for name, value in losses._asdict().items()}
        decisions = sum(collector.decisions for collector in self._collectors) - before
        progress = Progress(
            progress.updates + 1, progress.decisions + decisions, progress.seconds + time.monotonic() - began, progress.runs
        )
        self.training = dataclasses.replace(self.training, learner=learner, progress=progress)
        return found


def seated(opponent: Opponent) -> str | PluginOpponent:
    """Returns an opponent as a `VectorEnv` takes it. Creates one of a plug-in, which the caller closes.

    Raises:
        OSError: it could not be created.
    """
    plugin = plugins.find(opponent.name)
    if plugin is None:
        return opponent.name
    return plugins.create(plugin, opponent.name, json.loads(opponent.arguments or "{}"), opponent.python)


def play(collector: Collector, params: Params, key: jax.Array, plan: Plan) -> Samples:
    """Plays `plan.steps` batches. Returns the samples: numpy arrays, valid until the collector plays again."""
    numbers = itertools.count()

    def act(inputs: Floats) -> tuple[npt.NDArray[np.int32], Floats]:
        actions, log_probabilities = ppo.act(params, jax.random.fold_in(key, next(numbers)), inputs)
        return np.asarray(actions), np.asarray(log_probabilities)

    rollout = collector.collect(act)
    steps, games, _ = rollout.inputs.shape
    hidden = np.zeros((steps, games, 0), np.float32)
    if plan.hyper.all_hands:
        hidden = other_hands(rollout, collector.players, collector.faces)
    values = np.stack([np.asarray(ppo.values(params, *step)) for step in zip(rollout.inputs, hidden, strict=True)])
    gains, known = advantages(rollout, values, collector.players, discount=plan.discount, gae_lambda=plan.gae_lambda)
    returns, weights = gains + values, known.astype(np.float32)
    columns: list[Any] = [rollout.inputs, hidden, rollout.actions, rollout.log_probabilities, gains, returns, weights]
    return Samples(*(column.reshape(steps * games, *column.shape[2:]) for column in columns))


def joined(parts: Sequence[Samples]) -> Samples:
    """Joins samples into one, as numpy arrays, with advantages normalised to mean 0 and standard deviation 1."""
    columns: list[Any] = [np.concatenate(column) if len(parts) > 1 else column[0] for column in zip(*parts, strict=True)]
    samples = Samples(*columns)
    counted = samples.advantages[samples.weights > 0]
    if len(counted) == 0:
        raise ValueError("no decision has an outcome yet: play more steps between two updates (--steps)")
    return samples._replace(advantages=(samples.advantages - counted.mean()) / (counted.std() + 1e-8))
