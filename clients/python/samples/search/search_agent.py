"""A search agent: draws deals that its seat cannot tell apart, plays every legal action on in them, and takes the best.

Run `python samples/search/search_agent.py`. It plays one seat against three greedy agents, in this process.
"""

import sys

import numpy as np

from chefshat import VectorEnv, search


def play(games: int, rollouts: int, seed: int = 1) -> list[int]:
    """Returns the places that the agent reached in games of some Shifts, from 1."""
    places: list[int] = []
    with VectorEnv(client_seats=[0], opponents="greedy", episode="game", history=512, seed=seed) as env:
        while len(places) < games:
            position = search.position(env)
            estimates = position.evaluate(rollouts, agent="greedy", halving=True, seed=env.batch.step)
            env.step([estimates.best])
            places.extend(env.batch.endings.places_taken.tolist())
    return places


def main(games: int = 10, rollouts: int = 1000) -> None:
    """Plays and prints how often the agent won."""
    places = play(games, rollouts)
    print(f"won {places.count(1)} of {games} games, mean place {np.mean(places):.2f}; chance is 1 in 4 and 2.5")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
