"""The history column: who did what since the Shift began, as the seat of a row may know it.

It exists in environments with `history=K`. With the hand, the history is an information state with perfect recall of the Shift,
unless `history_counts` exceeds K. `actors` and `actions` take the column apart; `tokens` turns it into sequences for a model.

The vocabulary of `tokens`, for N seats and A actions:

| token | meaning |
|---|---|
| 0 | padding |
| 1..=N | the seat that acts: 1 is the seat of the row, 2 the next to its left, and so on |
| N+1..=N+A | the action with the index token - N - 1 |
| N+A+1 | a gift of a card that the seat may not know |
"""

import numpy as np
from numpy.typing import NDArray

from chefshat.columns import Situations, Sizes

PADDING = 0
#: In `actors` and `actions`: there is no entry.
NONE = -1


def actors(situations: Situations) -> NDArray[np.int32]:
    """Returns (R, K): the seat of each entry, -1 where there is none."""
    return _parts(situations)[0]


def actions(situations: Situations) -> NDArray[np.int32]:
    """Returns (R, K): the action of each entry, A for a gift of an unknown card, -1 where there is none."""
    return _parts(situations)[1]


def tokens(situations: Situations) -> NDArray[np.int32]:
    """Returns (R, 2K): the seat and the action of each entry as tokens, the most recent last, after padding."""
    sizes = situations.sizes
    seats, done = _parts(situations)
    relative = (seats - situations.seats[:, np.newaxis].astype(np.int32)) % sizes.players
    pairs = np.stack([1 + relative, 1 + sizes.players + done], axis=2)
    return np.where((seats == NONE)[:, :, np.newaxis], PADDING, pairs).reshape(len(situations), 2 * sizes.history)


def vocabulary_size(sizes: Sizes) -> int:
    """Returns the number of tokens, N + A + 2."""
    return sizes.players + sizes.num_actions + 2


def _parts(situations: Situations) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Returns the seats and actions of the entries."""
    sizes = situations.sizes
    if not sizes.history:
        raise ValueError("there is no history: create the VectorEnv with history=K, the number of actions to see")
    entries = situations.observations.history.astype(np.int32) - 1
    width = sizes.num_actions + 1
    return np.where(entries < 0, NONE, entries // width), np.where(entries < 0, NONE, entries % width)
