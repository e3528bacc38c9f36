"""The engine of Chef's Hat: vector environments and search in the process of the client.

`chefshat.VectorEnv` and `chefshat.search` are the documented ways to it. Setups, resets, records and situations are serialized
messages of the protocol.
"""

from collections.abc import Sequence
from typing import Any, Literal, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

class Refused(Exception):
    """A refused request. Its arguments are the reason in UPPER_SNAKE, the reason in words, and metadata."""

    args: tuple[str, str, dict[str, str]]

class Games:
    """Many games of one client, stepped together."""

    @staticmethod
    def begin(setup: bytes, threads: int = 0) -> tuple[Games, Batch]:
        """Begins the games of a serialized `VectorSetup`; returns them with their first batch.

        `threads`: 0 for as many as there are cores. The games are the same with any number of them.
        """

    @property
    def started(self) -> bytes:
        """The serialized `VectorStarted`."""

    @property
    def layouts(self) -> dict[str, dict[str, int]]:
        """For each table the bytes of a row before each column."""

    def step(self, actions: ArrayLike, partial: bool = False) -> Batch:
        """Takes one action for each row of the latest batch and returns the next batch. If `partial`, 65535 leaves a decision open.

        Raises TypeError for anything but an array of uint16 or int64, and ValueError if there is not one action for each row, or a
        number that is no action. Then the games are unchanged.
        """

    def reset(self, reset: bytes) -> Batch:
        """Executes a serialized `VectorReset` and returns the next batch."""

    def save(self, save: bytes) -> bytes:
        """Executes a serialized `VectorSave` and returns serialized `VectorStates`."""

    def restore(self, restore: bytes) -> Batch:
        """Executes a serialized `VectorRestore` and returns the next batch."""

    def sample(self, seed: int, first: int) -> NDArray[np.uint16]:
        """Draws a legal action for each row of the latest batch: row i takes the draw `first + i` of the seed."""

    def __reduce__(self) -> NoReturn: ...

class Batch:
    """The open decisions, and what happened since the previous batch.

    A table is the number of its rows, and its columns one after the other. Every table is handed over once.
    """

    @property
    def step(self) -> int:
        """Number of the batch, from 1."""

    @property
    def rows(self) -> int:
        """Number of open decisions."""

    @property
    def done(self) -> bool:
        """Whether all games are over and none follows."""

    @property
    def ended(self) -> int:
        """Number of episodes that have ended."""

    def first(
        self, form: Literal["table", "classic"] | None, ended: bool
    ) -> tuple[NDArray[np.float32] | None, NDArray[np.int8], float, int, int, int] | None:
        """Returns the first open decision, or the end of the first episode if `ended`.

        These are the observation of the form (None: none), the mask as numbers, the reward, the seat, the kind of the decision and
        the invalid attempts; the last two are 0 at an end. None without rows, and once the table has been handed over.
        """

    def decisions(self) -> tuple[int, NDArray[np.uint8]]:
        """Hands over the open decisions."""

    def endings(self) -> tuple[int, NDArray[np.uint8]]:
        """Hands over the episodes that have ended."""

    def beginnings(self) -> tuple[int, NDArray[np.uint8]]:
        """Hands over the games that have begun."""

    def shifts(self) -> tuple[int, NDArray[np.uint8]] | None:
        """Hands over the Shifts that have ended, if statistics are enabled."""

    def totals(self) -> tuple[int, int, int, int, int]:
        """Returns decisions of the client and of all seats, invalid attempts of the client, Shifts and games."""

    def records(self) -> list[tuple[int, int, list[bytes]]]:
        """Returns the records of games that have ended: game, index and serialized `RecordLine`s of each."""

class Position:
    """What a seat knows at its decision, and all deals that are consistent with it."""

    @staticmethod
    def of_state(state: bytes, max_steps: int) -> Position:
        """The decision that a saved game waits for, from the knowledge of its seat alone."""

    @staticmethod
    def of_situation(situation: bytes, max_steps: int) -> Position:
        """The decision that a serialized `Situation` describes."""

    @property
    def seat(self) -> int:
        """The seat that decides."""

    @property
    def rules(self) -> bytes:
        """The serialized `RuleSet`."""

    @property
    def deals(self) -> float:
        """The number of possible deals."""

    @property
    def legal_actions(self) -> NDArray[np.uint16]:
        """The legal actions, ascending."""

    def sample(self, deals: int, seed: int) -> NDArray[np.uint8]:
        """Draws deals: the cards that each seat then holds, one after the other."""

    def starts(self, deals: int, seed: int, *, first: int = 0) -> list[bytes]:
        """Draws the same deals, from `first` on, as serialized `ListedStart`s."""

    def expected_hands(self, deals: int, seed: int) -> NDArray[np.float64]:
        """The cards that each seat holds on average over these deals, one seat after the other."""

    def log_likelihoods(self, deals: int, seed: int, policy: str | bytes) -> NDArray[np.float64]:
        """The natural logarithm of the likelihood of what the others did, for each of these deals."""

    def evaluate(
        self,
        actions: Sequence[int],
        policy: str | bytes,
        *,
        rollouts: int,
        time_ms: int,
        halving: bool,
        threads: int,
        seed: int,
    ) -> dict[str, NDArray[Any]]:
        """Estimates what actions are worth. `policy`: an agent's name, or the bytes of a network file. 0: no limit."""

    def outcomes(
        self, actions: Sequence[int], policy: str | bytes, *, first: int, deals: int, threads: int, seed: int
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint8]]:
        """Points and places of the seat for each action in `deals` of these deals, from `first` on: a row for each deal."""

    def __reduce__(self) -> NoReturn: ...

def play_states(
    states: Sequence[bytes], policies: Sequence[str | bytes], *, threads: int, seed: int
) -> tuple[NDArray[np.uint32], NDArray[np.uint8]]:
    """Points and places of all seats in the Shift of each state, played on by one agent or one for each seat."""

def choose_actions(states: Sequence[bytes], policy: str | bytes, *, seed: int) -> NDArray[np.uint16]:
    """What an agent of this policy does at the decision of each state."""

def trained_network() -> bytes:
    """The file of the network of the built-in agent "trained". `chefshat.learn.network.load("trained")` reads it."""

def action_texts(faces: int) -> list[str]:
    """Returns the texts of all actions of a deck with this number of faces, 4..=15."""
