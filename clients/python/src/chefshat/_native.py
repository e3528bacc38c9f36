"""Games that this process plays for a `VectorEnv`, with the native engine (the package `chefshat-native`)."""

import contextlib
import importlib.metadata
import threading
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Literal, NoReturn, TypeVar, cast

import chefshat_native
import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import pb
from chefshat._games import checked
from chefshat.address import ServerAddress
from chefshat.batch import Batch, GameRecord, Situation
from chefshat.columns import Beginnings, Endings, Packed, ShiftStatistics, Sizes, Table, Totals
from chefshat.errors import ChefsHatError

AnyTable = TypeVar("AnyTable", bound=Table)
Value = TypeVar("Value")


def _check_version(native: str) -> None:
    """Refuses an engine of another version: it would have other columns, or other rules."""
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        own = importlib.metadata.version("chefshat")
        if own != native:
            raise ImportError(f"chefshat-native {native} does not fit chefshat {own}: install chefshat_native-{own}-*.whl")


_check_version(chefshat_native.__version__)


class _once(cached_property[Value]):
    """A cached property that is computed once, also if threads ask for it at the same time: the engine hands a table over once."""

    # One for all batches: what it protects takes microseconds.
    _lock = threading.RLock()

    def __get__(self, batch: Any, owner: type[Any] | None = None) -> Any:  # noqa: ANN401 - As the class above.
        if batch is None:
            return self
        with self._lock:
            name = self.attrname
            return batch.__dict__[name] if name in batch.__dict__ else super().__get__(batch, owner)


class NativeBatch(Batch):
    """A batch of the engine. Its tables are created on first use."""

    def __init__(
        self,
        native: chefshat_native.Batch,
        sizes: Sizes,
        layouts: Mapping[str, Mapping[str, int]],
        empty: dict[str, Table],
    ) -> None:
        # Not the constructor of the class above: a step in this process takes about as long as one.
        self.sizes = sizes
        self.step = native.step
        self.done = native.done
        self._rows = native.rows
        self._native = native
        self._layouts = layouts
        # Tables without rows, which all batches of the games share.
        self._empty = empty

    @property
    def ended(self) -> int:
        """Number of episodes of the client's seats that have ended."""
        return self._native.ended

    def first(self, form: Literal["table", "classic"] | None, *, ended: bool) -> Situation | None:
        """Returns the first open decision, or the end of the first episode; None once a column of its table has been used."""
        seen = self._native.first(form, ended)
        return None if seen is None else Situation(*seen)

    @classmethod
    def of(cls, rows: int, sizes: Sizes, columns: Mapping[str, Any]) -> Batch:  # type: ignore[override] # Arrays are not the engine's.
        """Creates a batch from arrays."""
        return Batch.of(rows, sizes, columns)

    @property
    def _made_of_arrays(self) -> type[Table]:
        return Batch

    @_once
    def packed(self) -> Packed:  # Only tables with few rows are packed before they are used.
        """The columns of the open decisions."""
        _, columns = self._native.decisions()
        return Packed(columns, self._layouts["decisions"])

    @_once
    def endings(self) -> Endings:
        """The episodes of the client's seats that have ended."""
        return self._table(Endings, "endings", *self._native.endings())

    @_once
    def beginnings(self) -> Beginnings:
        """The games that have begun."""
        return self._table(Beginnings, "beginnings", *self._native.beginnings())

    @_once
    def shifts(self) -> ShiftStatistics | None:
        """The Shifts that have ended, with statistics."""
        found = self._native.shifts()
        return None if found is None else self._table(ShiftStatistics, "shifts", *found)

    @cached_property
    def totals(self) -> Totals:
        """Counts since the games began."""
        return Totals(*self._native.totals())

    def _table(self, kind: type[AnyTable], name: str, rows: int, columns: NDArray[np.uint8]) -> AnyTable:
        found = None if rows else self._empty.get(name)
        if found is None:
            found = kind(rows, self.sizes)
            found.packed = Packed(columns, self._layouts[name])
            if not rows:
                self._empty[name] = found
        return cast(AnyTable, found)


class NativeGames:
    """Games of this process. See `_games.Games`."""

    server: ServerAddress | None = None

    def __init__(self, setup: pb.VectorSetup, threads: int) -> None:
        try:
            self._games, self._first = chefshat_native.Games.begin(setup.SerializeToString(), threads)
        except chefshat_native.Refused as error:
            _raise(error)
        self.started = pb.VectorStarted.FromString(self._games.started)
        self._sizes = Sizes.of(self.started)
        self._layouts = self._games.layouts
        self._records = setup.records
        self._empty: dict[str, Table] = {}

    def first(self) -> Batch:
        """Returns the first batch."""
        return self._batch(self._first)

    def step(self, actions: ArrayLike, batch: Batch) -> Batch:
        """Takes the action of each row of the latest batch and returns the next batch."""
        try:
            try:
                return self._batch(self._games.step(actions))
            except (TypeError, ValueError):
                return self._batch(self._games.step(checked(actions, batch)))
        except chefshat_native.Refused as error:
            _raise(error)

    def take(self, actions: NDArray[np.uint16]) -> Batch:
        """Takes actions, of which `LEAVE_OPEN` takes none, and returns the next batch."""
        try:
            return self._batch(self._games.step(actions, True))
        except chefshat_native.Refused as error:
            _raise(error)

    def reset(self, request: pb.VectorReset) -> Batch:
        """Abandons games, starts new ones and returns the next batch."""
        try:
            return self._batch(self._games.reset(request.SerializeToString()))
        except chefshat_native.Refused as error:
            _raise(error)

    def save(self, games: NDArray[np.uint32]) -> list[bytes]:
        """Returns the states of games."""
        request = pb.VectorSave(games=games.tobytes())
        try:
            saved = self._games.save(request.SerializeToString())
        except chefshat_native.Refused as error:
            _raise(error)
        return list(pb.VectorStates.FromString(saved).states)

    def restore(self, games: NDArray[np.uint32], states: Sequence[bytes]) -> Batch:
        """Replaces games, in ascending order, by saved ones and returns the next batch."""
        request = pb.VectorRestore(games=games.tobytes(), states=states)
        try:
            return self._batch(self._games.restore(request.SerializeToString()))
        except chefshat_native.Refused as error:
            _raise(error)

    def sample(self, batch: Batch, seed: int, first: int) -> NDArray[np.uint16]:
        """Draws a legal action for each row of the latest batch."""
        try:
            return self._games.sample(seed, first)
        except chefshat_native.Refused as error:
            _raise(error)

    def action_texts(self, faces: int) -> Sequence[str]:
        """Returns the texts of all actions."""
        return chefshat_native.action_texts(faces)

    def close(self) -> None:
        """Frees the games."""
        vars(self).pop("_games", None)

    def _batch(self, native: chefshat_native.Batch) -> Batch:
        batch = NativeBatch(native, self._sizes, self._layouts, self._empty)
        if self._records:
            records = native.records()
            batch.records = tuple(
                GameRecord(game, index, tuple(map(pb.RecordLine.FromString, lines))) for game, index, lines in records
            )
        return batch


def _raise(error: chefshat_native.Refused) -> NoReturn:
    reason, message, metadata = error.args
    raise ChefsHatError(reason, message, metadata) from None
