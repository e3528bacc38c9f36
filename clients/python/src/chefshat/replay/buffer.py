"""A replay buffer of fixed capacity with uniform sampling."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chefshat.columns import Sizes
from chefshat.transitions import Transitions


class ReplayBuffer:
    """The latest transitions, up to a capacity, in columns. The seed determines the samples. A transition takes some 350 bytes.

    Attributes:
        capacity: maximum number of transitions; new ones replace the oldest.
    """

    def __init__(self, capacity: int, *, seed: int | None = None) -> None:
        """Creates an empty buffer.

        Args:
            capacity: at least 1.
            seed: seed of sampling; None: random.
        """
        if capacity < 1:
            raise ValueError(f"the capacity must be at least 1, not {capacity}")
        self.capacity = capacity
        self._rng = np.random.default_rng(seed)
        self._columns: dict[str, NDArray[Any]] = {}
        self._sizes: Sizes | None = None
        self._stored = 0
        # The slot to write next.
        self._next = 0

    def __len__(self) -> int:
        return self._stored

    def add(self, transitions: Transitions) -> None:
        """Adds transitions, in order. All must have the same sizes of decks and tables."""
        columns = transitions.flatten()
        if self._sizes is None:
            self._sizes = transitions.sizes
            self._columns = {name: np.zeros((self.capacity, *array.shape[1:]), array.dtype) for name, array in columns.items()}
        elif self._sizes != transitions.sizes:
            raise ValueError(
                f"the buffer has transitions of {self._sizes}, these are of {transitions.sizes}: use a buffer for each"
            )
        count = len(transitions)
        # The last ones, if there are more than the capacity.
        first = max(count - self.capacity, 0)
        slots = (self._next + np.arange(first, count)) % self.capacity
        for name, array in columns.items():
            self._columns[name][slots] = array[first:]
        self._next = (self._next + count) % self.capacity
        self._stored = min(self._stored + count, self.capacity)

    def sample(self, count: int) -> Transitions:
        """Draws transitions uniformly, with replacement."""
        if self._sizes is None or self._stored == 0:
            raise ValueError("the buffer is empty: add transitions before sampling")
        rows = self._rng.integers(self._stored, size=count)
        return Transitions.unflatten(self._sizes, {name: array[rows] for name, array in self._columns.items()})
