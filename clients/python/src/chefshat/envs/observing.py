"""The observations of environments: named forms or a custom function, and their spaces.

A form converts all rows of `Situations` at once. The mask of legal actions is not part of it: each environment adds it according to
its interface.
"""

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chefshat.batch import Batch, Situation
from chefshat.columns import Column, Endings, Observations, Situations, Sizes
from chefshat.learn import features

ObservationFunction: TypeAlias = Callable[[Situations], NDArray[Any]]
"""Computes custom observations: (R, ...) numbers from the columns of R situations, each row from one situation."""

Observed: TypeAlias = "NDArray[Any] | dict[str, NDArray[Any]]"
"""Observations of R situations: an array of R rows, or a dictionary of such arrays."""

FORMS = ("table", "columns", "classic")
# Columns of `Situations` in the form "columns", besides those of `Observations`.
_DECISION = ("seats", "kinds")


class Form:
    """A form of observations.

    Attributes:
        space: the space of one observation.
        space_with_mask: the same, with "action_mask" if observations are dictionaries, for Gymnasium.
        has_parts: whether an observation is a dictionary.
        is_table: whether it is that of `chefshat.learn.features.table`.
    """

    space: "spaces.Space[Any]"
    space_with_mask: "spaces.Space[Any]"

    def __init__(self, observation: str | ObservationFunction, sizes: Sizes, sample: Situations) -> None:
        """Chooses a form.

        Args:
            observation: "table" (everything a seat may know at the moment as numbers, default 334; see
                `chefshat.learn.features.table`), "columns" (a dictionary of the columns), "classic" (the paper's vector: F + H + T
                numbers, default 228; it hides the kind of the decision and more, see `chefshat.learn.features.classic`), or
                a function.
            sizes: the numbers that determine shapes.
            sample: some situations, to determine the space of a function.
        """
        self._function: ObservationFunction | None = None
        # What the engine computes itself for a single row.
        self._known: Literal["table", "classic"] | None = None
        self.has_parts = observation == "columns"
        self.is_table = observation == "table"
        if callable(observation):
            self._function = observation
            self.space = _space_of(np.asarray(observation(sample)), len(sample))
        elif observation == "classic":
            self._function, self._known = features.classic_of, "classic"
            width = features.classic_width(sizes.faces, sizes.hand_size)
            self.space = spaces.Box(0.0, 1.0, (width,), np.float32)
        elif observation == "table":
            self._function, self._known = features.table_of, "table"
            # A play of all F cards of face F with both jokers exceeds 1.
            self.space = spaces.Box(0.0, 2.0, (features.table_width(sizes.players, sizes.faces),), np.float32)
        elif observation == "columns":
            self.space = spaces.Dict({name: _column_space(column, sizes) for name, column in _columns(sizes).items()})
        else:
            known = ", ".join(map(repr, FORMS))
            raise ValueError(f"observation={observation!r}: choose one of {known}, or give a function")
        self.space_with_mask = self.space
        if isinstance(self.space, spaces.Dict):
            self.space_with_mask = spaces.Dict({**self.space, "action_mask": mask_space(sizes)})

    def of(self, situations: Situations) -> Observed:
        """Returns the observations of all rows."""
        if self._function is not None:
            return np.asarray(self._function(situations))
        seen = situations.observations
        found = {name: getattr(situations if name in _DECISION else seen, name) for name in _columns(situations.sizes)}
        return {name: array.reshape(len(situations), -1) for name, array in found.items()}

    def first(self, batch: Batch, *, ended: bool = False) -> Situation:
        """Returns the first open decision of a batch, or the end of its first episode."""
        seen = batch.first(self._known, ended=ended)
        if seen is not None and self._known is not None:
            return seen
        now: Batch | Endings = batch.endings if ended else batch
        observation = self.row(self.of(now), 0)
        if seen is not None:
            return seen._replace(observation=observation)
        attempts = int(now.attempts[0]) if isinstance(now, Batch) else 0
        mask = np.array(now.masks[0], np.int8)
        return Situation(observation, mask, float(now.rewards[0]), int(now.seats[0]), int(now.kinds[0]), attempts)

    def row(self, observed: Observed, row: int) -> Any:  # noqa: ANN401 - An array or a dictionary of them.
        """Returns a copy of one observation."""
        if isinstance(observed, dict):
            return {name: array[row].copy() for name, array in observed.items()}
        return observed[row].copy()


def mask_space(sizes: Sizes) -> spaces.Box:
    """Returns the space of a mask for Gymnasium's `Discrete.sample`: A numbers, 1 where an action is legal."""
    return spaces.Box(0, 1, (sizes.num_actions,), np.int8)


def _columns(sizes: Sizes) -> dict[str, Column[Any]]:
    mine = Situations.columns()
    return {**{name: mine[name] for name in _DECISION}, **Observations.columns_of(sizes)}


def _column_space(column: Column[Any], sizes: Sizes) -> spaces.Box:
    """Returns the space of a column's row; a single number is an array of one."""
    shape = column.shape(1, sizes)[1:] or (1,)
    limits = np.iinfo(column.dtype)
    return spaces.Box(limits.min, limits.max, shape, column.dtype.type)


def _space_of(made: NDArray[Any], rows: int) -> spaces.Box:
    """Returns the space of a custom function's rows, with the range of its type."""
    if made.ndim == 0 or len(made) != rows:
        raise ValueError(f"the observation function returned the shape {made.shape} for {rows} situations: return one row for each")
    if made.dtype.kind == "f":
        return spaces.Box(-np.inf, np.inf, made.shape[1:], made.dtype.type)
    if made.dtype.kind == "b":
        raise ValueError("the observation function returned booleans: convert them to numbers, for example by .astype(numpy.int8)")
    limits = np.iinfo(made.dtype)
    return spaces.Box(limits.min, limits.max, made.shape[1:], made.dtype.type)
