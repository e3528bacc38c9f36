"""Self-play: one policy on all of a client's seats in many games, and the advantages of its decisions.

An episode is a Shift. The decisions of one seat in it form a chain; the reward comes once, at the end of the Shift, from the place
taken. Acting and learning are in `ppo`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from chefshat.learn import features
from chefshat.vector import Batch, VectorEnv

Floats: TypeAlias = npt.NDArray[np.float32]
# Features (n, width) to actions and their log-probabilities, each (n,).
Act: TypeAlias = Callable[[Floats], tuple[npt.NDArray[np.integer], Floats]]


@dataclass(frozen=True)
class Ends:
    """Chains that ended between two batches, in order.

    Attributes:
        games: (E,) the game.
        seats: (E,) the seat.
        rewards: (E,) the reward for the place taken; in a coalition, the mean of its seats' rewards.
    """

    games: npt.NDArray[np.uint32]
    seats: npt.NDArray[np.uint8]
    rewards: Floats


@dataclass(frozen=True)
class Rollout:
    """`steps` batches of n games. The arrays are reused for the next rollout.

    Attributes:
        inputs: (steps, n, width) features; 1 where a row has never been present.
        actions: (steps, n) the actions taken.
        log_probabilities: (steps, n) of these actions.
        seats: (steps, n) the deciding seats.
        present: (steps, n) whether the game waited for the client.
        ends: for each step, the chains that ended after its decisions and before the next ones.
    """

    inputs: Floats
    actions: npt.NDArray[np.int32]
    log_probabilities: Floats
    seats: npt.NDArray[np.uint8]
    present: npt.NDArray[np.bool_]
    ends: list[Ends]


def place_rewards(points: Sequence[int]) -> Floats:
    """Returns the reward of each place, from 0: its points minus the mean, divided by the winner's points. They add up to 0."""
    worth = np.array(points, np.float64)
    worth -= worth.mean()
    return np.array(worth / points[0], np.float32)


class Collector:
    """Collects rollouts of `steps` batches, each continuing the games of the last.

    Its environment has episodes of a Shift, asks for all decisions and skips forced ones.
    """

    def __init__(self, env: VectorEnv, games: int, steps: int, *, coalition: int = 1) -> None:
        """Starts with the environment's first batch.

        Args:
            env: the environment, of `games` games.
            games: n.
            steps: decisions in each game of a rollout.
            coalition: number of the client's seats if all of them have the mean of their rewards; 1: each has its own.
        """
        self._env = env
        self._coalition = coalition
        self._batch: Batch = env.reset()
        self._rewards = place_rewards(env.rules.points)
        width = features.table_width(env.players, env.faces)
        shape = (steps, games)
        self._rollout = Rollout(
            # A row that has no legal action has no probabilities: padding may do anything.
            inputs=np.ones((*shape, width), np.float32),
            actions=np.zeros(shape, np.int32),
            log_probabilities=np.zeros(shape, np.float32),
            seats=np.zeros(shape, np.uint8),
            present=np.zeros(shape, np.bool_),
            ends=[],
        )
        self._rows = np.empty((games, width), np.float32)
        #: Seats of a game, and faces of its deck.
        self.players, self.faces = env.players, env.faces
        #: Decisions taken so far.
        self.decisions = 0

    def collect(self, act: Act) -> Rollout:
        """Plays one rollout. The result is valid until the next call."""
        rollout = self._rollout
        rollout.ends.clear()
        for step in range(len(rollout.actions)):
            batch = self._batch
            rows = batch.games
            inputs = rollout.inputs[step]
            inputs[rows] = features.table_of(batch, self._rows[: len(batch)])
            actions, rollout.log_probabilities[step] = act(inputs)
            rollout.actions[step] = actions
            rollout.present[step] = False
            rollout.present[step, rows] = True
            rollout.seats[step, rows] = batch.seats
            self._batch = self._env.step(rollout.actions[step, rows])
            self.decisions += len(rows)
            rollout.ends.append(self._ends(self._batch))
        return rollout

    def _ends(self, batch: Batch) -> Ends:
        endings = batch.endings
        rewards = self._rewards[endings.places_taken.astype(np.intp) - 1]
        if self._coalition > 1:
            # The seats of one end follow each other.
            rewards = rewards.reshape(-1, self._coalition).mean(axis=1).repeat(self._coalition)
        return Ends(endings.games, endings.seats, rewards)


def advantages(
    rollout: Rollout, values: Floats, players: int, *, discount: float, gae_lambda: float
) -> tuple[Floats, npt.NDArray[np.bool_]]:
    """Estimates the advantage of each decision by generalised advantage estimation (GAE) along the seat's chain.

    Args:
        rollout: the games.
        values: (steps, n) outputs of the value network.
        players: seats of a game.
        discount: gamma.
        gae_lambda: lambda: 0 trusts the value network alone, 1 the rewards alone.

    Returns:
        (steps, n) advantages; (steps, n) whether they are known: unknown for the last decision of a chain that continues after the
        rollout. The decisions before it bootstrap from its value.
    """
    shape = values.shape
    result, known = np.zeros(shape, np.float32), np.zeros(shape, np.bool_)
    # What follows the current decision, for each game and seat.
    reward, value, advantage = (np.zeros((shape[1], players), np.float32) for _ in range(3))
    follows = np.zeros((shape[1], players), np.bool_)
    for step in reversed(range(shape[0])):
        ends = rollout.ends[step]
        # Of several ends of a seat the first is that of its last decision's chain; `unique` finds the first ones.
        _, first = np.unique(ends.games.astype(np.intp) * players + ends.seats, return_index=True)
        ended = (ends.games[first], ends.seats[first])
        reward[ended] = ends.rewards[first]
        value[ended] = advantage[ended] = 0
        follows[ended] = True

        games = np.flatnonzero(rollout.present[step])
        here = (games, rollout.seats[step, games])
        estimates = values[step, games]
        known[step, games] = follows[here]
        error = reward[here] + discount * value[here] - estimates
        result[step, games] = np.where(follows[here], error + discount * gae_lambda * advantage[here], 0)
        reward[here], value[here], advantage[here], follows[here] = 0, estimates, result[step, games], True
    return result, known
