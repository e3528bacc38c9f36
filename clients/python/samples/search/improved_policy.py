"""Policy improvement: the network `trained` proposes actions, rollouts in deals that its seat cannot tell apart correct it.

Run `python samples/search/improved_policy.py`. It plays one seat against three `trained`, in this process, and beside it `trained`
plays the same deals from the same seat. It needs the extra `learn`.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from chefshat import Batch, VectorEnv, search
from chefshat.learn import network

TRAINED = network.load("trained")


def proposed(batch: Batch, legal: NDArray[np.uint16]) -> NDArray[np.float64]:
    """Returns the probability that the network gives each legal action of the first row."""
    logits = TRAINED.logits_of(batch)[0, legal].astype(np.float64)
    chances: NDArray[np.float64] = np.exp(logits - logits.max())
    chances /= chances.sum()
    return chances


def play(shifts: int, rollouts: int, considered: int = 4, seed: int = 1) -> NDArray[np.float64]:
    """Returns the points of Shifts, each in a game of its own; without rollouts those of `trained`."""
    points: list[float] = []
    rules = {"target_shifts": 1}
    with VectorEnv(client_seats=[0], opponents="trained", rules=rules, rewards="points", history=512, seed=seed) as env:
        worth = np.array(env.rules.points, np.float64)
        while len(points) < shifts:
            legal = np.flatnonzero(env.batch.masks[0]).astype(np.uint16)
            policy = proposed(env.batch, legal)
            if rollouts and len(legal) > 1:
                known = search.position(env)
                found = known.evaluate(rollouts, agent="trained", prior=policy, considered=considered, seed=env.batch.step)
                policy = found.improved(policy)
            env.step([legal[policy.argmax()]])
            points.extend(worth[env.batch.endings.places_taken - 1])
    return np.array(points)


def main(shifts: int = 100, rollouts: int = 64, considered: int = 4) -> None:
    """Plays and prints the difference."""
    improved, prior = play(shifts, rollouts, considered), play(shifts, 0)
    gain = improved - prior
    error = gain.std(ddof=1) / np.sqrt(len(gain))
    print(f"{improved.mean():.3f} points a Shift, `trained` {prior.mean():.3f}: {gain.mean():+.3f} ± {error:.3f}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
