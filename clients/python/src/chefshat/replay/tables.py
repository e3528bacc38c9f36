"""Reads the table of decisions of a dataset from Parquet, JSON Lines or CSV, as numpy arrays.

The columns are described in docs/datasets.md; `recorded` converts them to transitions.
"""

import csv
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

TABLE = "decisions"
# In order of preference.
SUFFIXES = (".parquet", ".jsonl", ".csv")


class Decisions(ABC):
    """A table of R rows."""

    rows: int

    @abstractmethod
    def has(self, name: str) -> bool:
        """Whether there is such a column: datasets of earlier versions lack later ones."""

    @abstractmethod
    def numbers(self, name: str, dtype: DTypeLike) -> NDArray[Any]:
        """Returns a column of numbers or booleans, (R,); null is 0."""

    @abstractmethod
    def lists(self, name: str, width: int, dtype: DTypeLike) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """Returns a column of lists of one length, (R, width), and whether each is known, (R,); null is zeros."""

    @abstractmethod
    def ragged(self, name: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Returns a column of lists of any length: all items in order, and the lengths, (R,)."""

    @abstractmethod
    def packed(self, name: str, width: int) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        """Returns a column of bytes of one length, (R, width), and whether each is known, (R,)."""

    @abstractmethod
    def coded(self, name: str) -> tuple[list[str], NDArray[np.intp]]:
        """Returns the distinct texts of a column, and the index of each row's text, (R,); null is empty.

        Texts repeat in many rows: an array of them would take several times as much memory as all numbers of the table.
        """

    def is_in(self, name: str, texts: Collection[str]) -> NDArray[np.bool_]:
        """Returns whether the text of each row of a column is one of these, (R,)."""
        distinct, codes = self.coded(name)
        return np.array([text in texts for text in distinct], np.bool_)[codes]


def read(path: Path) -> Decisions:
    """Reads a file, or the preferred file in a dataset's folder.

    Raises:
        FileNotFoundError: there is no table of decisions.
        ImportError: it is a Parquet file, and pyarrow is not installed.
        ValueError: it is not a table of decisions, or it has no rows.
    """
    file = _file_of(path)
    table = _Arrow(file) if file.suffix == ".parquet" else _Rows(file)
    if table.rows == 0:
        raise ValueError(f"{file} has no rows; is there a game in the dataset?")
    return table


def _file_of(path: Path) -> Path:
    if path.is_file():
        if path.suffix not in SUFFIXES:
            raise ValueError(f"{path} is not one of {', '.join(SUFFIXES)}: give a dataset made by `chefshat export`")
        return path
    found = [path / f"{TABLE}{suffix}" for suffix in SUFFIXES if (path / f"{TABLE}{suffix}").is_file()]
    if not found:
        raise FileNotFoundError(f"{path} has no table of decisions: make a dataset with `chefshat export`, and give its folder")
    if found[0].suffix == ".parquet" and len(found) > 1 and not has_pyarrow():
        return found[1]
    return found[0]


def has_pyarrow() -> bool:
    """Whether Parquet files can be read."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError:
        return False
    return True


class _Arrow(Decisions):
    """A Parquet file. Each column is read when it is asked for, and not kept: most are not needed."""

    def __init__(self, file: Path) -> None:
        try:
            from pyarrow import parquet
        except ImportError as error:
            hint = "pip install pyarrow, or export with --format jsonl"
            raise ImportError(f"{file} is a Parquet file, which needs pyarrow: {hint}") from error
        self._file = file
        self._read_table = parquet.read_table
        metadata = parquet.read_metadata(file)
        self.rows = metadata.num_rows
        self._names = set(metadata.schema.to_arrow_schema().names)

    def has(self, name: str) -> bool:
        return name in self._names

    def _chunks(self, name: str, **options: Any) -> Any:  # noqa: ANN401 - pyarrow has no types.
        if not self.has(name):
            raise _lacks(self._file, name)
        return self._read_table(self._file, columns=[name], **options).column(0)

    def _column(self, name: str) -> Any:  # noqa: ANN401 - pyarrow has no types.
        column = self._chunks(name)
        return column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)

    def numbers(self, name: str, dtype: DTypeLike) -> NDArray[Any]:
        column = self._column(name)
        filled = column.fill_null(False) if str(column.type) == "bool" else column.fill_null(0)
        return np.asarray(filled.to_numpy(zero_copy_only=False)).astype(dtype)

    def lists(self, name: str, width: int, dtype: DTypeLike) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        column = self._column(name)
        known = np.asarray(column.is_valid().to_numpy(zero_copy_only=False), np.bool_)
        return _filled(known, column.flatten().to_numpy(zero_copy_only=False), width, dtype), known

    def ragged(self, name: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        column = self._column(name)
        lengths = column.value_lengths().fill_null(0).to_numpy(zero_copy_only=False)
        return np.asarray(column.flatten().to_numpy(zero_copy_only=False), np.int64), np.asarray(lengths, np.int64)

    def packed(self, name: str, width: int) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        column = self._column(name)
        known = np.asarray(column.is_valid().to_numpy(zero_copy_only=False), np.bool_)
        joined = np.frombuffer(b"".join(filter(None, column.to_pylist())), np.uint8)
        return _filled(known, joined, width, np.uint8), known

    def coded(self, name: str) -> tuple[list[str], NDArray[np.intp]]:
        column = self._chunks(name, read_dictionary=[name]).unify_dictionaries()
        texts = column.chunk(0).dictionary.to_pylist()
        codes = np.concatenate([chunk.indices.fill_null(len(texts)).to_numpy() for chunk in column.chunks])
        return texts + [""] * (column.null_count > 0), codes.astype(np.intp)


class _Rows(Decisions):
    """A file of JSON Lines or CSV. Slower than Parquet, but without dependencies."""

    def __init__(self, file: Path) -> None:
        self._file = file
        with file.open(encoding="utf-8", newline="") as lines:
            if file.suffix == ".csv":
                rows = list(csv.reader(lines))
                # A cell has JSON or a plain text; an empty one is null.
                self._parse: Callable[[str], Any] | None = json.loads
                names = rows[0] if rows else []
                self._cells = {name: [row[number] or None for row in rows[1:]] for number, name in enumerate(names)}
            else:
                objects = [json.loads(line) for line in lines]
                self._parse = None
                self._cells = {name: [row[name] for row in objects] for name in (objects[0] if objects else {})}
        self.rows = len(next(iter(self._cells.values()), []))

    def has(self, name: str) -> bool:
        return name in self._cells

    def _column(self, name: str, *, text: bool = False) -> list[Any]:
        if not self.has(name):
            raise _lacks(self._file, name)
        cells = self._cells[name]
        if self._parse is None or text:
            return cells
        return [None if cell is None else self._parse(cell) for cell in cells]

    def numbers(self, name: str, dtype: DTypeLike) -> NDArray[Any]:
        return np.array([cell or 0 for cell in self._column(name)]).astype(dtype)

    def lists(self, name: str, width: int, dtype: DTypeLike) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        cells = self._column(name)
        known = np.array([cell is not None for cell in cells], np.bool_)
        return _filled(known, np.array([cell for cell in cells if cell is not None]), width, dtype), known

    def ragged(self, name: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        cells = [cell or [] for cell in self._column(name)]
        return np.array([item for cell in cells for item in cell], np.int64), np.array([len(cell) for cell in cells], np.int64)

    def packed(self, name: str, width: int) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
        cells = self._column(name, text=True)
        known = np.array([cell is not None for cell in cells], np.bool_)
        joined = np.frombuffer(bytes.fromhex("".join(filter(None, cells))), np.uint8)
        return _filled(known, joined, width, np.uint8), known

    def coded(self, name: str) -> tuple[list[str], NDArray[np.intp]]:
        numbers: dict[str, int] = {}
        codes = [numbers.setdefault(cell or "", len(numbers)) for cell in self._column(name, text=True)]
        return list(numbers), np.array(codes, np.intp)


def _filled(known: NDArray[np.bool_], items: NDArray[Any], width: int, dtype: DTypeLike) -> NDArray[Any]:
    """Returns rows of one width; zeros where they are unknown."""
    array = np.zeros((len(known), width), dtype)
    array[known] = items.reshape(-1, width)
    return array


def _lacks(file: Path, name: str) -> ValueError:
    return ValueError(f"{file} has no column {name}: is it a table of decisions made by `chefshat export`?")
