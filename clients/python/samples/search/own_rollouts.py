"""Search with an own policy: tries every legal action in deals that the seat cannot tell apart, and plays them on with any policy.

Run `python samples/search/own_rollouts.py`. It plays one seat against three greedy agents, in this process.
"""

import sys
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from chefshat import VectorEnv, search
from chefshat.vector import Batch


def lowest(batch: Batch) -> NDArray[np.intp]:
    """A policy: the legal action with the lowest index, which plays the rarest cards first."""
    return np.asarray(batch.masks.argmax(axis=1))


def search_action(env: VectorEnv, row: int, policy: Callable[[Batch], NDArray[np.intp]], deals: int) -> int:
    """Returns the legal action that brings most points on average if the policy plays all seats from there."""
    position = search.position(env, row)
    legal = position.legal_actions
    starts = position.starts(deals, seed=env.batch.step)
    # Game i begins with the start i % deals.
    with VectorEnv(games=deals * len(legal), starts=starts, rules=position.rules, rewards="points", seed=0) as worlds:
        batch = worlds.step(np.repeat(legal, deals))
        points = np.full(worlds.games, np.nan)
        while np.isnan(points).any():
            own = batch.endings.seats == position.seat
            first = np.isnan(points[batch.endings.games[own]])
            points[batch.endings.games[own][first]] = batch.endings.rewards[own][first]
            batch = worlds.step(policy(batch))
    return int(legal[points.reshape(len(legal), deals).mean(axis=1).argmax()])


def main(games: int = 4, deals: int = 20) -> None:
    """Plays a Shift of each game and prints the mean points."""
    rules = {"target_shifts": 1}
    with VectorEnv(
        games=games, total_games=games, client_seats=[0], opponents="greedy", rules=rules, history=512, rewards="points", seed=1
    ) as env:
        ended: list[float] = []
        while not env.batch.done:
            env.step([search_action(env, row, lowest, deals) for row in range(len(env.batch))])
            ended.extend(env.batch.endings.rewards.tolist())
    print(f"{np.mean(ended):.2f} points a Shift, where a greedy agent gets 2.25")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
