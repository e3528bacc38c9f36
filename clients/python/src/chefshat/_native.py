"""Games that this process plays for a `VectorEnv`, with the native engine (the package `chefshat-native`)."""

from collections.abc import Mapping, Sequence
from typing import NoReturn, TypeVar

import chefshat_native
import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.address import ServerAddress
from chefshat.batch import Batch, GameRecord
from chefshat.columns import Beginnings, Endings, Packed, ShiftStatistics, Sizes, Table, Totals
from chefshat.errors import ChefsHatError

AnyTable = TypeVar("AnyTable", bound=Table)


class NativeContent:
    """The content of a batch of the engine."""

    def __init__(self, batch: chefshat_native.Batch) -> None:
        self._batch = batch
        self.step = batch.step
        self.done = batch.done

    def endings(self, sizes: Sizes) -> Endings:
        """Returns the episodes that have ended."""
        return _table(Endings, sizes, *self._batch.endings())

    def beginnings(self, sizes: Sizes) -> Beginnings:
        """Returns the games that have begun."""
        return _table(Beginnings, sizes, *self._batch.beginnings())

    def shifts(self, sizes: Sizes) -> ShiftStatistics | None:
        """Returns the Shifts that have ended; None without statistics."""
        found = self._batch.shifts()
        return None if found is None else _table(ShiftStatistics, sizes, *found)

    def totals(self) -> Totals:
        """Returns the counts."""
        return Totals(*self._batch.totals())


class NativeGames:
    """Games of this process. See `_games.Games`."""

    server: ServerAddress | None = None

    def __init__(self, setup: pb.VectorSetup) -> None:
        try:
            self._games, self._first = chefshat_native.Games.begin(setup.SerializeToString())
        except chefshat_native.Refused as error:
            _raise(error)
        self.started = pb.VectorStarted.FromString(self._games.started)
        self._sizes = Sizes.of(self.started)
        self._records = setup.records

    def first(self) -> Batch:
        """Returns the first batch."""
        return self._batch(self._first)

    def step(self, actions: NDArray[np.uint16]) -> Batch:
        """Takes the action of each row of the latest batch and returns the next batch."""
        try:
            return self._batch(self._games.step(actions))
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
        return self._games.sample(seed, first)

    def action_texts(self, faces: int) -> Sequence[str]:
        """Returns the texts of all actions."""
        return chefshat_native.action_texts(faces)

    def close(self) -> None:
        """Frees the games."""
        vars(self).pop("_games", None)

    def _batch(self, native: chefshat_native.Batch) -> Batch:
        batch = Batch(native.rows, self._sizes, NativeContent(native))
        _, columns, offsets = native.decisions()
        batch.packed = Packed(columns, offsets)
        if self._records:
            records = native.records()
            batch.records = tuple(
                GameRecord(game, index, tuple(map(pb.RecordLine.FromString, lines))) for game, index, lines in records
            )
        return batch


def _table(kind: type[AnyTable], sizes: Sizes, rows: int, columns: NDArray[np.uint8], offsets: Mapping[str, int]) -> AnyTable:
    table = kind(rows, sizes)
    table.packed = Packed(columns, offsets)
    return table


def _raise(error: chefshat_native.Refused) -> NoReturn:
    reason, message, metadata = error.args
    raise ChefsHatError(reason, message, metadata) from None
