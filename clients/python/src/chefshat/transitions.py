"""Transitions in columns: a decision, its reward, and the same seat's next observation.

`Memory` stores the last decision of every seat of every game, to compute the transitions that each batch completes. Batches are in
`vector`, a replay buffer is in `replay`.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chefshat.columns import Column, Endings, Observations, Situations, Sizes, Table
from chefshat.masks import is_legal


class Transitions(Table):
    """Decisions and their outcomes, one row each. R is their number, A the number of actions.

    An invalid attempt that is asked again is a transition to the same decision with one more attempt.
    """

    games = Column[np.uint32]("<u4")
    """(R,): the game, 0..n-1."""
    attempts = Column[np.uint32]("<u4")
    """(R,): invalid attempts at the decision before this action."""
    actions = Column[np.uint16]("<u2")
    """(R,): the action taken."""
    invalid = Column[np.bool_]("?")
    """(R,): whether the action was illegal."""
    rewards = Column[np.float32]("<f4")
    """(R,): the seat's rewards from this decision to its next, or to the end of the episode."""
    ended = Column[np.bool_]("?")
    """(R,): whether the episode ended before the seat's next decision. Then `after` is terminal and has no legal action."""
    truncated = Column[np.bool_]("?")
    """(R,): whether the episode was cut off without a result; see `Endings.truncated`."""
    game_over = Column[np.bool_]("?")
    """(R,): whether the game ended with the episode."""
    places_taken = Column[np.uint8]("u1")
    """(R,): the seat's place at the end of the episode, from 1; 0 if the episode continues."""

    def __init__(self, rows: int, sizes: Sizes, message: None = None) -> None:
        super().__init__(rows, sizes, message)
        #: The seat's situation at the decision.
        self.before = Situations(rows, sizes)
        #: The seat's situation at its next decision, or at the end of the episode.
        self.after = Situations(rows, sizes)

    @property
    def seats(self) -> NDArray[np.uint8]:
        """(R,): the deciding seat."""
        return self.before.seats

    @property
    def kinds(self) -> NDArray[np.uint8]:
        """(R,): kind of the decision, values of `pb.DecisionKind`."""
        return self.before.kinds

    def _contents(self) -> dict[str, Any]:
        return super()._contents() | {"before": self.before, "after": self.after}

    def take(self, rows: NDArray[Any]) -> Self:
        """Returns the rows with these indices (or where this mask is true)."""
        taken = super().take(rows)
        taken.before = self.before.take(rows)
        taken.after = self.after.take(rows)
        return taken

    def flatten(self) -> dict[str, NDArray[Any]]:
        """Returns all columns by name; those of both sides as `before.hands`, `after.mask_bits` and so on."""
        columns = self.as_dict()
        for side, situations in (("before", self.before), ("after", self.after)):
            for part in (situations.as_dict(), situations.observations.as_dict()):
                columns.update({f"{side}.{name}": array for name, array in part.items()})
        return columns

    @classmethod
    def unflatten(cls, sizes: Sizes, columns: Mapping[str, NDArray[Any]]) -> Self:
        """Inverts `flatten`. Omitted columns are all zeros."""
        rows = len(next(iter(columns.values()))) if columns else 0
        own = {name: array for name, array in columns.items() if "." not in name}
        transitions = cls.of(rows, sizes, own)
        for side in ("before", "after"):
            parts = {name.removeprefix(f"{side}."): array for name, array in columns.items() if name.startswith(f"{side}.")}
            setattr(transitions, side, situations(rows, sizes, parts))
        return transitions


_OBSERVED = frozenset(Observations.columns())

RewardFunction: TypeAlias = Callable[[Transitions], NDArray[np.floating]]
"""Computes custom rewards, (R,) numbers, from the transitions' columns."""


def situations(rows: int, sizes: Sizes, columns: Mapping[str, NDArray[Any]]) -> Situations:
    """Creates situations from arrays, including those of the observations."""
    made = Situations.of(rows, sizes, {name: array for name, array in columns.items() if name not in _OBSERVED})
    inner = {name: array for name, array in columns.items() if name in _OBSERVED}
    made.__dict__["observations"] = Observations.of(rows, sizes, inner)
    return made


def concatenate(parts: Sequence[Transitions]) -> Transitions:
    """Concatenates one or more transitions."""
    if not parts:
        raise ValueError("there is nothing to concatenate: give at least one Transitions, which may be empty")
    flat = [part.flatten() for part in parts]
    columns = {name: np.concatenate([columns[name] for columns in flat]) for name in flat[0]}
    return Transitions.unflatten(parts[0].sizes, columns)


class Memory:
    """The open decisions: the last one of every seat of every game, while its outcome is unknown."""

    def __init__(self, games: int, sizes: Sizes) -> None:
        self._sizes = sizes
        slots = games * sizes.players
        self._waiting = np.zeros(slots, np.bool_)
        # The action taken and the situation before it: a row for each seat of each game.
        self._actions = np.zeros(slots, np.uint16)
        self._attempts = np.zeros(slots, np.uint32)
        self._layout = _Layout(sizes)
        self._before = np.zeros((slots, self._layout.width), np.uint8)

    def remember(
        self, games: NDArray[np.uint32], attempts: NDArray[np.uint32], seen: Situations, actions: NDArray[np.uint16]
    ) -> None:
        """Stores decisions: the situation and the action."""
        slots = self._slots(games, seen.seats)
        self._waiting[slots] = True
        self._actions[slots] = actions
        self._attempts[slots] = attempts
        self._before[slots] = self._layout.packed(seen)

    def forget(self, games: NDArray[np.uint32] | None = None) -> None:
        """Drops the decisions of abandoned games; None: of all games."""
        if games is None:
            self._waiting[:] = False
        else:
            self._waiting.reshape(-1, self._sizes.players)[games] = False

    def complete(
        self, endings: Endings, games: NDArray[np.uint32], seen: Situations, rewards: NDArray[np.float32]
    ) -> tuple[Transitions, NDArray[np.intp], NDArray[np.intp]]:
        """Computes the transitions that a batch completes: first those to an end, then those to a next decision.

        Args:
            endings: the batch's endings.
            games: the game of each row of the batch.
            seen: the rows themselves.
            rewards: their rewards.

        Returns:
            The transitions, the rows of `endings` of the first ones, and the rows of the batch of the others.
        """
        end_slots = self._slots(endings.games, endings.seats)
        ended = np.flatnonzero(self._waiting[end_slots])
        if len(ended):
            # A further episode of a seat, without a decision of it, may have ended in the same step.
            ended = ended[np.sort(np.unique(end_slots[ended], return_index=True)[1])]
        end_slots = end_slots[ended]
        self._waiting[end_slots] = False
        next_slots = self._slots(games, seen.seats)
        follow = np.flatnonzero(self._waiting[next_slots])
        next_slots = next_slots[follow]
        self._waiting[next_slots] = False
        slots = np.concatenate([end_slots, next_slots])
        rows, many = len(slots), len(ended)
        # Copies the rows, which will be overwritten; columns are extracted on demand.
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
        for name in ("ended", "truncated", "game_over"):
            columns[name] = np.zeros(rows, np.bool_)
        columns["ended"][:many] = True
        columns["truncated"][:many] = endings.truncated[ended]
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
    """Packs all columns of situations into rows of bytes, so that a row is one copy."""

    def __init__(self, sizes: Sizes) -> None:
        columns = {**Situations.columns(), **Observations.columns()}
        # Wide numbers first, for alignment.
        ordered = sorted(columns.items(), key=lambda item: -item[1].dtype.itemsize)
        self._slices: dict[str, tuple[slice, Column[Any], int]] = {}
        at = 0
        for name, column in ordered:
            (_, *width) = column.shape(1, sizes)
            count = column.dtype.itemsize * (width[0] if width else 1)
            self._slices[name] = (slice(at, at + count), column, len(width))
            at += count
        # Bytes of a row.
        self.width = -(-at // 8) * 8
        self._padding = self.width - at

    def packed(self, seen: Situations) -> NDArray[np.uint8]:
        """Packs rows."""
        rows = len(seen)
        parts = [np.zeros((rows, self._padding), np.uint8)]
        for name in reversed(self._slices):
            array = np.ascontiguousarray(getattr(seen.observations if name in _OBSERVED else seen, name))
            parts.append(array.view(np.uint8).reshape(rows, -1))
        return np.concatenate(parts[::-1], axis=1)

    def source(self, packed: NDArray[np.uint8]) -> Callable[[str], NDArray[Any]]:
        """Returns a function that extracts columns from packed rows, by name."""

        def column(name: str) -> NDArray[Any]:
            at, column, dimensions = self._slices[name]
            array = packed[:, at].view(column.dtype)
            return array if dimensions else array[:, 0]

        return column


def _lazy(rows: int, sizes: Sizes, source: Callable[[str], NDArray[Any]]) -> Situations:
    """Creates situations whose columns are extracted on demand."""
    made = Situations(rows, sizes)
    made.source = made.observations.source = source
    return made
