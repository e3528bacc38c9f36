"""A memory of transitions with a fixed capacity, drawn from uniformly. Weighted drawing is not here."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chefshat.columns import Sizes
from chefshat.transitions import Transitions


class ReplayBuffer:
    """The latest transitions, up to a capacity, in columns.

    What is added and drawn depends on the seed alone. A transition takes some 350 bytes.

    Attributes:
        capacity: transitions it holds at most; the oldest give way.
    """

    def __init__(self, capacity: int, *, seed: int | None = None) -> None:
        """Makes an empty buffer.

        Args:
            capacity: at least 1.
            seed: of what is drawn; None: chance.
        """
        if capacity < 1:
            raise ValueError(f"a buffer holds at least 1 transition, not {capacity}")
        self.capacity = capacity
        self._chance = np.random.default_rng(seed)
        self._columns: dict[str, NDArray[Any]] = {}
        self._sizes: Sizes | None = None
        self._held = 0
        # The slot to be written next.
        self._next = 0

    def __len__(self) -> int:
        return self._held

    def add(self, transitions: Transitions) -> None:
        """Adds transitions, in order; all must be of decks and tables of one size."""
        columns = transitions.flatten()
        if self._sizes is None:
            self._sizes = transitions.sizes
            self._columns = {name: np.zeros((self.capacity, *array.shape[1:]), array.dtype) for name, array in columns.items()}
        elif self._sizes != transitions.sizes:
            raise ValueError(
                f"the buffer has transitions of {self._sizes}, these are of {transitions.sizes}: use a buffer for each"
            )
        count = len(transitions)
        kept = min(count, self.capacity)
        # Of more than the capacity only the last remain.
        slots = (self._next + np.arange(count - kept, count)) % self.capacity
        for name, array in columns.items():
            self._columns[name][slots] = array[count - kept :]
        self._next = (self._next + count) % self.capacity
        self._held = min(self._held + count, self.capacity)

    def sample(self, count: int) -> Transitions:
        """Draws so many transitions, each time any of those held, all alike likely."""
        if self._sizes is None or self._held == 0:
            raise ValueError("the buffer is empty: add transitions before drawing some")
        rows = self._chance.integers(self._held, size=count)
        return Transitions.unflatten(self._sizes, {name: array[rows] for name, array in self._columns.items()})
