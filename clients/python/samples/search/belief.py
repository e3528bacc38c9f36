"""How much do the decisions of others say about their hands? Compares guesses of the cards in three hidden hands with the truth.

Run `python samples/search/belief.py`. A seat that plays as `trained` guesses at every third of its decisions with a choice: as if
all possible deals were equally likely, and with deals of which each is drawn among 8 or 64 by `Position.log_likelihoods`. The agent
`monte_carlo:50ms:belief` draws among 8. It needs the extra `learn`.
"""

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from chefshat import VectorEnv, search
from chefshat.learn import network

TEMPER = 0.5
DEALS = 256
GROUPS = 1, 8, 64


def squared_errors(opponents: str, positions: int) -> Iterator[list[float]]:
    """Yields the squared error of each kind of guess, summed over the kinds of cards in the hidden hands, at each position."""
    trained, decisions = network.load("trained"), 0
    with VectorEnv(client_seats=[0], opponents=opponents, history=512, all_hands=True, skip_forced=True, seed=77) as env:
        while positions:
            decisions += 1
            if decisions % 3 == 0:
                known = search.position(env)
                truth = env.batch.all_hands[0].reshape(known.rules.players, -1)
                hands = known.sample(DEALS, seed=decisions).astype(np.float64)
                logs = TEMPER * known.log_likelihoods(DEALS, seed=decisions)
                yield [float(np.square(guess(hands, logs, group) - truth).sum()) for group in GROUPS]
                positions -= 1
            env.step(trained.actions_of(env.batch))


def guess(hands: NDArray[np.float64], logs: NDArray[np.float64], group: int) -> NDArray[np.float64]:
    """Redecisions the expected hands if one of each group of deals is drawn by its likelihood."""
    of_groups = logs.reshape(-1, group)
    weights = np.exp(of_groups - of_groups.max(axis=1, keepdims=True))
    weights /= weights.sum(axis=1, keepdims=True)
    expected: NDArray[np.float64] = np.tensordot(weights.ravel(), hands, axes=1) / len(of_groups)
    return expected


def main(positions: int = 700) -> None:
    """Prints the mean squared errors."""
    for opponents in ("trained", "greedy", "random"):
        errors = np.mean(list(squared_errors(opponents, positions)), axis=0)
        words = (f"one of {group} {error:.2f}" for group, error in zip(GROUPS, errors, strict=True))
        print(f"{opponents}: {', '.join(words)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
