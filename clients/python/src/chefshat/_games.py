"""The interface between a `VectorEnv` and its games, which a server plays (`_remote`) or this process (`_native`)."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import pb
from chefshat.address import ServerAddress
from chefshat.batch import Batch
from chefshat.errors import ChefsHatError
from chefshat.masks import is_legal

# The most bytes of a message that a server takes (`max_vector_message_bytes`), and of the states in one, beside which their games
# have room.
MAX_MESSAGE_BYTES = 1024 * 1024
MAX_STATES_BYTES = 900_000
# In place of an action: leaves the decision open, so that it comes again.
LEAVE_OPEN = 0xFFFF


class Games(Protocol):
    """Games stepped in batches. A method that raises an error has ended them, unless its reason is GAMES_IN_USE or ILLEGAL_ACTION.

    Attributes:
        server: the server that plays them; None: this process.
        started: the accepted setup.
    """

    server: ServerAddress | None
    started: pb.VectorStarted

    def first(self) -> Batch:
        """Returns the first batch. Call it once, before the other methods."""

    def step(self, actions: ArrayLike, batch: Batch) -> Batch:
        """Takes the action of each row of the latest batch and returns the next batch.

        Raises TypeError or ValueError for actions that are not `checked`. Then the games are unchanged.
        """

    def take(self, actions: NDArray[np.uint16]) -> Batch:
        """Takes the action of each row, unless it is `LEAVE_OPEN`, and returns the next batch. Actions are not `checked`."""

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


def checked(actions: ArrayLike, batch: Batch) -> NDArray[np.uint16]:
    """Checks and encodes the actions for a batch."""
    array, rows, size = np.asarray(actions), len(batch), batch.sizes.num_actions
    if array.shape != (rows,) or (rows and array.dtype.kind not in "iu"):
        given = f"{array.dtype} of the shape {array.shape}"
        raise ValueError(f"give one action for each row of the batch: integers of the shape ({rows},), not {given}")
    if rows:
        wrong = int(array.argmax())
        if array[wrong] < size:
            wrong = int(array.argmin())
        if not 0 <= array[wrong] < size:
            raise ValueError(f"row {wrong} has the action {array[wrong]}; actions are 0..={size - 1}")
    return array.astype("<u2", copy=False)


def check_legal(actions: NDArray[np.uint16], batch: Batch) -> None:
    """Raises ILLEGAL_ACTION if an action is illegal. `LEAVE_OPEN` is none of them."""
    taken = actions != LEAVE_OPEN
    legal = is_legal(batch.mask_bits, np.where(taken, actions, 0)) | ~taken
    if not legal.all():
        row = int(legal.argmin())
        game, seat = batch.games[row], batch.seats[row]
        words = f'choose one of batch.masks[{row}], or let such decisions be asked again (invalid="ask_again")'
        words = f"row {row} (game {game}, seat {seat}): action {actions[row]} is not legal; {words}"
        raise ChefsHatError("ILLEGAL_ACTION", words, {"row": str(row), "game": str(game), "seat": str(seat)})


def checked_rows(argument: str, rows: ArrayLike, batch: Batch) -> NDArray[np.bool_]:
    """Checks an argument that selects rows of a batch by booleans."""
    array = np.asarray(rows)
    if array.shape != (len(batch),) or (len(batch) and array.dtype != np.bool_):
        given = f"{array.dtype} of the shape {array.shape}"
        raise ValueError(f"{argument}: give one boolean for each row of the batch, of the shape ({len(batch)},), not {given}")
    return array.astype(np.bool_, copy=False)
