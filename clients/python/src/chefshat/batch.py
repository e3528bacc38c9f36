"""The batch that each step of a `VectorEnv` returns: open decisions, what happened since the last step, and transitions.

Columns are in `columns`; the stream of batches is in `vector`.
"""

import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.columns import Beginnings, Column, Endings, ShiftStatistics, Situations, Sizes, Totals
from chefshat.files import write_record
from chefshat.transitions import Memory, RewardFunction, Transitions


@dataclass(frozen=True, slots=True)
class GameRecord:
    """The record of a game that has ended.

    Attributes:
        game: the game, 0..n-1.
        index: its index.
        lines: the record, header first.
    """

    game: int
    index: int
    lines: tuple[pb.RecordLine, ...]

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes the record to a file atomically, for `chefshat verify` and `replay.from_records`.

        Raises `OSError` if it cannot be written.
        """
        write_record(path, self.lines)


class Situation(NamedTuple):
    """What an environment of one game shows of a row.

    Attributes:
        observation: of the form asked for.
        mask: (A,): 1 where an action is legal; zeros at an end.
        reward: the reward.
        seat: the seat.
        kind: the kind of the decision; 0 at an end.
        attempts: the invalid attempts at the decision; 0 at an end.
    """

    observation: Any
    mask: NDArray[np.int8]
    reward: float
    seat: int
    kind: int
    attempts: int


class Content(Protocol):
    """What a batch is made from: a message of a server, or a batch of the native engine."""

    @property
    def step(self) -> int:
        """Number of the batch, from 1."""

    @property
    def done(self) -> bool:
        """Whether all games are over and no other follows."""

    def endings(self, sizes: Sizes) -> Endings:
        """Returns the episodes that have ended."""

    def beginnings(self, sizes: Sizes) -> Beginnings:
        """Returns the games that have begun."""

    def shifts(self, sizes: Sizes) -> ShiftStatistics | None:
        """Returns the Shifts that have ended; None without statistics."""

    def totals(self) -> Totals:
        """Returns the counts."""


class NoContent:
    """The content of a batch that was made from arrays: nothing beyond its rows."""

    step = 0
    done = False

    def endings(self, sizes: Sizes) -> Endings:
        """Returns an empty table."""
        return Endings(0, sizes)

    def beginnings(self, sizes: Sizes) -> Beginnings:
        """Returns an empty table."""
        return Beginnings(0, sizes)

    def shifts(self, sizes: Sizes) -> None:
        """Returns None."""

    def totals(self) -> Totals:
        """Returns zeros."""
        return Totals(0, 0, 0, 0, 0)


class Batch(Situations):
    """The open decisions of the client, one row each, and what happened since the last batch.

    A game has at most one row. It has none when it is over and no other follows, and in the rare case that its other seats have so
    many decisions that some are left for the next step.

    Besides the columns there are the tables `endings` and `beginnings`, and optionally `shifts` and `transitions`; the counts
    `totals`; and with `records=True` the `records`, a `GameRecord` of each game that has ended since.
    """

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1, ascending."""
    attempts = Column[np.uint32]("<u4")
    """(R,): invalid attempts at this decision so far."""
    rewards = Column[np.float32]("<f4")
    """(R,): sum of the seat's rewards since it last decided and since its episode began."""

    all_hands = Column[np.uint8]("u1", "all_hands")
    """(R, N(F+1)): the cards in the hand of each seat, one seat after the other, with `all_hands=True`: more than the row's seat
    may know. `all_hands.reshape(-1, N, F+1)` has a dimension for the seats."""

    #: The records of the games that have ended, if the env was created with `records=True`.
    records: tuple[GameRecord, ...] = ()
    _transitions: Transitions | None = None

    def __init__(self, rows: int, sizes: Sizes, content: Content | None = None) -> None:
        super().__init__(rows, sizes)
        self._content = content = content or NoContent()
        #: Number of the batch, from 1.
        self.step = content.step
        #: Whether all games are over and no other follows; only a reset with a seed starts new ones.
        self.done = content.done

    @property
    def ended(self) -> int:
        """Number of episodes of the client's seats that have ended."""
        return len(self.endings)

    def first(self, form: Literal["table", "classic"] | None, *, ended: bool) -> Situation | None:
        """Returns the first open decision, or the end of the first episode, of games in this process.

        What makes one game fast: reading one number through a column costs as much as a step of the game.

        Args:
            form: the observation it has; None: none.
            ended: the end of an episode.

        Returns:
            None for games on a server, and once a column of the table has been used, for instance by a reward function.
        """

    @cached_property
    def endings(self) -> Endings:
        """The episodes of the client's seats that have ended."""
        return self._content.endings(self.sizes)

    @cached_property
    def beginnings(self) -> Beginnings:
        """The games that have begun."""
        return self._content.beginnings(self.sizes)

    @cached_property
    def shifts(self) -> ShiftStatistics | None:
        """The Shifts that have ended, if the env was created with `shift_statistics=True`."""
        return self._content.shifts(self.sizes)

    @cached_property
    def totals(self) -> Totals:
        """Counts since the stream began."""
        return self._content.totals()

    @property
    def transitions(self) -> Transitions:
        """The outcomes of earlier decisions of the client; requires `transitions=True` or a `reward_function`."""
        if self._transitions is None:
            raise AttributeError("there are no transitions: create the VectorEnv with transitions=True")
        return self._transitions

    def _contents(self) -> dict[str, Any]:
        names = ("endings", "beginnings", "shifts", "totals", "step", "done", "records", "_transitions")
        return super()._contents() | {name: getattr(self, name) for name in names}

    def complete(self, memory: Memory, reward_function: RewardFunction | None) -> None:
        """Computes the transitions, and the rewards of a `reward_function`. The env calls it once."""
        transitions, ended, follow = memory.complete(self.endings, self.games, self, self.rewards)
        if reward_function is not None:
            rewards = np.asarray(reward_function(transitions), np.float32)
            if rewards.shape != (len(transitions),):
                wanted = f"({len(transitions)},)"
                raise ValueError(f"the reward function returned the shape {rewards.shape}, not {wanted}: one reward for each row")
            transitions.__dict__["rewards"] = rewards
            # Rows without an earlier decision have no reward.
            of_endings = np.zeros(len(self.endings), np.float32)
            of_endings[ended] = rewards[: len(ended)]
            self.endings.__dict__["rewards"] = of_endings
            of_rows = np.zeros(len(self), np.float32)
            of_rows[follow] = rewards[len(ended) :]
            self.__dict__["rewards"] = of_rows
        self._transitions = transitions
