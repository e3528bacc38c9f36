"""What agents learn from: a decision, what came of it, and what the same seat saw next, in columns.

`Memory` keeps the last decision of every seat of every game, so that each batch can be turned into the transitions it completes.
How batches come about is not here (see `vector`), nor where transitions are kept for later (see `replay`).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.columns import Column, Endings, Observations, Situations, Sizes, Table
from chefshat.masks import is_legal


class Transitions(Table):
    """Decisions and what came of them, a row for each. R is their number, A the number of actions.

    An invalid attempt that is asked again is a transition, too: to the same decision, which then has one more attempt.
    """

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1."""
    attempts = Column[np.uint32]("<u4")
    """(R,): invalid attempts at the decision before this action."""
    actions = Column[np.uint16]("<u2")
    """(R,): the action chosen."""
    invalid = Column[np.bool_]("?")
    """(R,): whether the action was illegal."""
    rewards = Column[np.float32]("<f4")
    """(R,): what the seat was given from this decision to its next, or to the end of the episode."""
    ended = Column[np.bool_]("?")
    """(R,): whether the episode ended before the seat decided again. Nothing is to be gained after that, and `after` has no legal
    action."""
    cut_short = Column[np.bool_]("?")
    """(R,): whether it was the limit of turns that ended it."""
    game_over = Column[np.bool_]("?")
    """(R,): whether the game ended with it."""
    places_taken = Column[np.uint8]("u1")
    """(R,): the seat's place at the end of the episode, from 1; 0 if it goes on."""

    def __init__(self, rows: int, sizes: Sizes, message: None = None) -> None:
        super().__init__(rows, sizes, message)
        #: The decision: what the seat saw, and what it might do.
        self.before = Situations(rows, sizes)
        #: The seat's next decision, or what it saw at the end of the episode.
        self.after = Situations(rows, sizes)

    @property
    def seats(self) -> NDArray[np.uint8]:
        """(R,): the seat that decided."""
        return self.before.seats

    @property
    def kinds(self) -> NDArray[np.uint8]:
        """(R,): what was decided, values of `pb.DecisionKind`."""
        return self.before.kinds

    def take(self, rows: NDArray[Any]) -> Self:
        """The rows of these numbers, or where this mask is true."""
        taken = super().take(rows)
        taken.before = self.before.take(rows)
        taken.after = self.after.take(rows)
        return taken

    def flatten(self) -> dict[str, NDArray[Any]]:
        """All columns by name; those of both sides as `before.hands`, `after.mask_bits` and so on."""
        columns = self.as_dict()
        for side, situations in (("before", self.before), ("after", self.after)):
            for part in (situations.as_dict(), situations.observations.as_dict()):
                columns.update({f"{side}.{name}": array for name, array in part.items()})
        return columns

    @classmethod
    def unflatten(cls, sizes: Sizes, columns: Mapping[str, NDArray[Any]]) -> Self:
        """The opposite of `flatten`. Columns that are left out are all zeros."""
        rows = len(next(iter(columns.values()))) if columns else 0
        own = {name: array for name, array in columns.items() if "." not in name}
        transitions = cls.of(rows, sizes, own)
        for side in ("before", "after"):
            parts = {name.removeprefix(f"{side}."): array for name, array in columns.items() if name.startswith(f"{side}.")}
            setattr(transitions, side, situations(rows, sizes, parts))
        return transitions


_OBSERVED = frozenset(Observations.columns())

RewardFunction: TypeAlias = Callable[[Transitions], NDArray[np.floating]]
"""Rewards of one's own: (R,) numbers from the transitions' columns."""


def situations(rows: int, sizes: Sizes, columns: Mapping[str, NDArray[Any]]) -> Situations:
    """Situations put together from arrays, those of the observations among them."""
    made = Situations.of(rows, sizes, {name: array for name, array in columns.items() if name not in _OBSERVED})
    inner = {name: array for name, array in columns.items() if name in _OBSERVED}
    made.__dict__["observations"] = Observations.of(rows, sizes, inner)
    return made


def concatenate(parts: Sequence[Transitions]) -> Transitions:
    """The rows of several, in order; at least one is needed to know the sizes."""
    if not parts:
        raise ValueError("there are no transitions to put together, not even empty ones")
    flat = [part.flatten() for part in parts]
    columns = {name: np.concatenate([columns[name] for columns in flat]) for name in flat[0]}
    return Transitions.unflatten(parts[0].sizes, columns)


class Memory:
    """The last decision of every seat of every game that nothing has come of yet."""

    def __init__(self, games: int, sizes: Sizes) -> None:
        self._sizes = sizes
        slots = games * sizes.players
        self._waiting = np.zeros(slots, np.bool_)
        # What was chosen, and what was seen before: a row for each seat of each game.
        self._actions = np.zeros(slots, np.uint16)
        self._attempts = np.zeros(slots, np.uint32)
        self._layout = _Layout(sizes)
        self._before = np.zeros((slots, self._layout.width), np.uint8)

    def remember(
        self, games: NDArray[np.uint32], attempts: NDArray[np.uint32], seen: Situations, actions: NDArray[np.uint16]
    ) -> None:
        """Notes decisions that are being taken: what was seen, and what was chosen."""
        slots = self._slots(games, seen.seats)
        self._waiting[slots] = True
        self._actions[slots] = actions
        self._attempts[slots] = attempts
        self._before[slots] = self._layout.packed(seen)

    def forget(self, games: NDArray[np.uint32] | None = None) -> None:
        """Forgets the decisions of games that are given up; of all if None."""
        if games is None:
            self._waiting[:] = False
        else:
            self._waiting.reshape(-1, self._sizes.players)[games] = False

    def complete(
        self, endings: Endings, games: NDArray[np.uint32], seen: Situations, rewards: NDArray[np.float32]
    ) -> tuple[Transitions, NDArray[np.intp], NDArray[np.intp]]:
        """What a batch completes: first the transitions to an end, then those to a next decision.

        Args:
            endings: the batch's endings.
            games: the game of each row of the batch.
            seen: the rows themselves.
            rewards: their rewards.

        Returns:
            The transitions, the rows of `endings` that the first of them end at, the rows of the batch that the others lead to.
        """
        end_slots = self._slots(endings.games, endings.seats)
        ended = np.flatnonzero(self._waiting[end_slots])
        if len(ended):
            # An episode in which a seat decided nothing follows the one it did decide in, and may have ended in the same step.
            ended = ended[np.sort(np.unique(end_slots[ended], return_index=True)[1])]
        end_slots = end_slots[ended]
        self._waiting[end_slots] = False
        next_slots = self._slots(games, seen.seats)
        follow = np.flatnonzero(self._waiting[next_slots])
        next_slots = next_slots[follow]
        self._waiting[next_slots] = False
        slots = np.concatenate([end_slots, next_slots])
        rows, many = len(slots), len(ended)
        # Taken out now, because the rows are written over; columns are cut out of it when they are asked for.
        before = self._layout.source(self._before[slots])

        def after(name: str) -> NDArray[Any]:
            last, next_ = (endings.observations, seen.observations) if name in _OBSERVED else (endings, seen)
            return np.concatenate([getattr(last, name)[ended], getattr(next_, name)[follow]])

        columns: dict[str, NDArray[Any]] = {
            "games": (slots // self._sizes.players).astype(np.uint32),
            "attempts": self._attempts[slots],
            "actions": self._actions[slots],
            "rewards": np.concatenate([endings.rewards[ended], rewards[follow]]),
        }
        columns["invalid"] = ~is_legal(before("mask_bits"), columns["actions"])
        for name in ("ended", "cut_short", "game_over"):
            columns[name] = np.zeros(rows, np.bool_)
        columns["ended"][:many] = True
        columns["cut_short"][:many] = endings.ends[ended] == pb.EPISODE_END_CUT_SHORT
        columns["game_over"][:many] = endings.game_over[ended]
        columns["places_taken"] = np.zeros(rows, np.uint8)
        columns["places_taken"][:many] = endings.places_taken[ended]
        transitions = Transitions.of(rows, self._sizes, columns)
        transitions.before = _lazy(rows, self._sizes, before)
        transitions.after = _lazy(rows, self._sizes, after)
        return transitions, ended, follow

    def _slots(self, games: NDArray[np.uint32], seats: NDArray[np.uint8]) -> NDArray[np.intp]:
        return games.astype(np.intp) * self._sizes.players + seats


class _Layout:
    """All columns of situations in rows of bytes, so that a row is written and read at once."""

    def __init__(self, sizes: Sizes) -> None:
        columns = {**Situations.columns(), **Observations.columns()}
        # The wide numbers first, so that all of them are aligned.
        ordered = sorted(columns.items(), key=lambda item: -item[1].dtype.itemsize)
        self._places: dict[str, tuple[slice, Column[Any], int]] = {}
        at = 0
        for name, column in ordered:
            (_, *width) = column.shape(1, sizes)
            count = column.dtype.itemsize * (width[0] if width else 1)
            self._places[name] = (slice(at, at + count), column, len(width))
            at += count
        # Bytes of a row.
        self.width = -(-at // 8) * 8
        self._padding = self.width - at

    def packed(self, seen: Situations) -> NDArray[np.uint8]:
        """The rows of bytes."""
        rows = len(seen)
        parts = [np.zeros((rows, self._padding), np.uint8)]
        for name in reversed(self._places):
            array = np.ascontiguousarray(getattr(seen.observations if name in _OBSERVED else seen, name))
            parts.append(array.view(np.uint8).reshape(rows, -1))
        return np.concatenate(parts[::-1], axis=1)

    def source(self, packed: NDArray[np.uint8]) -> Callable[[str], NDArray[Any]]:
        """Columns cut out of such rows, by name."""

        def column(name: str) -> NDArray[Any]:
            place, column, dimensions = self._places[name]
            array = packed[:, place].view(column.dtype)
            return array if dimensions else array[:, 0]

        return column


def _lazy(rows: int, sizes: Sizes, source: Callable[[str], NDArray[Any]]) -> Situations:
    """Situations whose columns are made when they are asked for."""
    made = Situations(rows, sizes)
    made.source = made.observations.source = source
    return made
