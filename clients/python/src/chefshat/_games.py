"""The interface between a `VectorEnv` and its games, which a server plays (`_remote`) or this process (`_native`)."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.address import ServerAddress
from chefshat.batch import Batch


class Games(Protocol):
    """Games stepped in batches. A method that raises an error has ended them.

    Attributes:
        server: the server that plays them; None: this process.
        started: the accepted setup.
    """

    server: ServerAddress | None
    started: pb.VectorStarted

    def first(self) -> Batch:
        """Returns the first batch. Call it once, before the other methods."""

    def step(self, actions: NDArray[np.uint16]) -> Batch:
        """Takes the action of each row of the latest batch and returns the next batch."""

    def reset(self, request: pb.VectorReset) -> Batch:
        """Abandons games, starts new ones and returns the next batch."""

    def save(self, games: NDArray[np.uint32]) -> list[bytes]:
        """Returns the states of games."""

    def restore(self, games: NDArray[np.uint32], states: Sequence[bytes]) -> Batch:
        """Replaces games, in ascending order, by saved ones and returns the next batch."""

    def sample(self, batch: Batch, seed: int, first: int) -> NDArray[np.uint16]:
        """Draws a legal action for each row of the latest batch; see `masks.sample_by`."""

    def action_texts(self, faces: int) -> Sequence[str]:
        """Returns the texts of all actions."""

    def close(self) -> None:
        """Ends the games."""
