"""What each step of a `VectorEnv` gives: the decisions that wait, what has happened since, and what follows from both.

Columns themselves are in `columns`; the stream that batches come over is in `vector`.
"""

import os
from dataclasses import dataclass
from functools import cached_property

import numpy as np

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
        """Writes it as a file, whole or not at all, in the form that `chefshat verify` and `replay.from_records` read.

        Raises `OSError` if it cannot be written.
        """
        write_record(path, self.lines)


class Batch(Situations):
    """The decisions that wait for the client, a row for each, and what has happened since the batch before.

    A game has one row at most. It has none when it is over and no other follows it, and in the rare case that its other seats took
    so many decisions that they are left for the next step.

    Besides the columns there are tables of their own, `endings` and `beginnings`, and `shifts` and `transitions` if they were asked
    for; the counts `totals`; and with `records=True` the `records`, a `GameRecord` of each game that has ended since.
    """

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1, ascending."""
    attempts = Column[np.uint32]("<u4")
    """(R,): invalid attempts at this decision so far."""
    rewards = Column[np.float32]("<f4")
    """(R,): sum of the seat's rewards since it last decided and since its episode began."""

    def __init__(self, rows: int, sizes: Sizes, message: pb.VectorBatch | None = None) -> None:
        super().__init__(rows, sizes, message)
        self._told = message or pb.VectorBatch()
        #: Number of the batch, from 1.
        self.step = self._told.step
        #: Whether all games are over and no other follows; only a reset with a seed goes on.
        self.done = self._told.done
        #: The records of the games that have ended, if the env was made with `records=True`.
        self.records: tuple[GameRecord, ...] = ()
        self._transitions: Transitions | None = None

    @cached_property
    def endings(self) -> Endings:
        """The episodes of the client's seats that have ended."""
        message = self._told.endings
        return Endings(message.rows, self.sizes, message)

    @cached_property
    def beginnings(self) -> Beginnings:
        """The games that have begun."""
        message = self._told.beginnings
        return Beginnings(message.rows, self.sizes, message)

    @cached_property
    def shifts(self) -> ShiftStatistics | None:
        """The Shifts that have ended, if the env was made with `shift_statistics=True`."""
        if not self._told.HasField("shifts"):
            return None
        message = self._told.shifts
        return ShiftStatistics(message.rows, self.sizes, message)

    @cached_property
    def totals(self) -> Totals:
        """Counts since the stream began."""
        told = self._told.totals
        return Totals(told.client_decisions, told.decisions, told.invalid_attempts, told.shifts, told.games)

    @property
    def transitions(self) -> Transitions:
        """What has come of earlier decisions of the client, if the env was made with `transitions=True` or a `reward_function`."""
        if self._transitions is None:
            raise AttributeError("transitions are not kept: make the VectorEnv with transitions=True")
        return self._transitions

    def complete(self, memory: Memory, reward_function: RewardFunction | None) -> None:
        """Works out the transitions, and the rewards if they are the client's own business. The env calls it, once."""
        transitions, ended, follow = memory.complete(self.endings, self.games, self, self.rewards)
        if reward_function is not None:
            rewards = np.asarray(reward_function(transitions), np.float32)
            if rewards.shape != (len(transitions),):
                wanted = f"({len(transitions)},)"
                raise ValueError(f"the reward function returned {rewards.shape}, and {wanted} is wanted, one for each row")
            transitions.__dict__["rewards"] = rewards
            # Rows that nothing was decided before have no reward.
            of_endings = np.zeros(len(self.endings), np.float32)
            of_endings[ended] = rewards[: len(ended)]
            self.endings.__dict__["rewards"] = of_endings
            of_rows = np.zeros(len(self), np.float32)
            of_rows[follow] = rewards[len(ended) :]
            self.__dict__["rewards"] = of_rows
        self._transitions = transitions
