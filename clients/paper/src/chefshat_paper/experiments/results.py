"""The config and the result of an experiment: settings, tables and figures as data, and the results file.

Everything that is printed, drawn or put into a page comes from a `Result`, so that a file can be shown again without running
anything. Formatting is in `tables` and `chefshat.learn.plots`.
"""

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from chefshat.address import ServerAddress
from chefshat.files import write_atomically
from chefshat.learn.figures import Figure, Level, Line, Panel, Points

FORMAT = "chefshat-experiment-1"
# Significant digits of the numbers in figures: more are invisible.
FIGURE_DIGITS = 4

# A JSON object.
Json: TypeAlias = Mapping[str, Any]


@dataclass(frozen=True)
class Config:
    """The settings of a run.

    Attributes:
        address: the server.
        seeds: one for each repetition, ascending. Experiments without repetitions use the first.
        quick: whether to only test that everything works, in seconds.
        out: an existing folder for trained networks. Experiment 3 reads those of Experiment 2 there.
    """

    address: ServerAddress
    seeds: tuple[int, ...]
    quick: bool
    out: Path


@dataclass(frozen=True)
class Estimate:
    """A number with its uncertainty: an interval, or the minimum and maximum of several runs.

    Attributes:
        value: the number; a share is 0..=1.
        low: lower end; None if there is none.
        high: upper end; None if there is none.
        percent: whether it is a share, shown in percent.
        digits: decimal places to show.
        error: standard error; None if it is not shown.
    """

    value: float
    low: float | None = None
    high: float | None = None
    percent: bool = False
    digits: int = 1
    error: float | None = None


# A cell of a table; None is shown as a dash.
Cell: TypeAlias = str | int | float | Estimate | None


@dataclass(frozen=True)
class Table:
    """A table that compares our numbers with the paper's.

    Attributes:
        name: short name in lower case, unique within the result.
        title: one line.
        columns: headings, with units.
        rows: one cell for each column.
        note: how to read it (the kind of intervals); may be empty.
    """

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    note: str = ""

    def __post_init__(self) -> None:
        wrong = [row for row in self.rows if len(row) != len(self.columns)]
        if wrong:
            raise ValueError(f"table {self.name} has {len(self.columns)} columns, but a row is {wrong[0]}")


@dataclass(frozen=True)
class Result:
    """The result of an experiment. Two runs of the same config give equal results, except for `run`.

    Attributes:
        experiment: "mechanics", "rules" or "winning".
        title: one line.
        seeds: the seeds used.
        quick: whether it was a quick run, whose numbers are meaningless.
        settings: numbers of games, parameters of agents and so on, as JSON.
        rules: the rule set of each condition as the JSON of chefshat.v1.RuleSet, every field set.
        tables: the tables.
        figures: the figures.
        values: further numbers as JSON, for example those of every seed.
        run: set by the command: package and server version, commit, command, seconds.
    """

    experiment: str
    title: str
    seeds: Sequence[int]
    quick: bool
    settings: Json
    rules: Mapping[str, Json]
    tables: Sequence[Table]
    figures: Sequence[Figure]
    values: Json = field(default_factory=dict)
    run: Json = field(default_factory=dict)


def as_json(result: Result) -> dict[str, Any]:
    """Converts a result to JSON values."""
    plain = dataclasses.asdict(result)
    plain["tables"] = [
        {**table_plain, "rows": [[_cell(cell) for cell in row] for row in table.rows]}
        for table_plain, table in zip(plain["tables"], result.tables, strict=True)
    ]
    plain["figures"] = _rounded(plain["figures"])
    # Through JSON and back, so that a new result equals the one read from its file.
    plain = json.loads(json.dumps({"format": FORMAT, **plain}))
    return dict(plain)


def from_json(plain: Json) -> Result:
    """Converts JSON values to a result. Raises ValueError if they are not one."""
    if not isinstance(plain, Mapping) or plain.get("format") != FORMAT:
        raise ValueError(f"not a results file of this version ({FORMAT})")
    try:
        tables = [
            Table(**{**table, "rows": [[_uncell(cell) for cell in row] for row in table["rows"]]}) for table in plain["tables"]
        ]
        figures = [Figure(**{**figure, "panels": [_panel(panel) for panel in figure["panels"]]}) for figure in plain["figures"]]
        rest = {key: value for key, value in plain.items() if key not in ("format", "tables", "figures")}
        return Result(tables=tables, figures=figures, **rest)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"a results file with missing or unknown fields: {error}") from error


def write(result: Result, path: Path) -> None:
    """Writes the results file atomically."""
    # One line for each field, since curves have many numbers.
    lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(value, ensure_ascii=False)}" for key, value in as_json(result).items())
    write_atomically(path, f"{{\n{lines}\n}}\n")


def read(path: Path) -> Result:
    """Reads a results file. Raises OSError if it cannot be read, ValueError if it is not one."""
    return from_json(json.loads(path.read_text(encoding="utf-8")))


def _cell(cell: Cell) -> Any:  # noqa: ANN401 - any plain value
    return dataclasses.asdict(cell) if isinstance(cell, Estimate) else cell


def _uncell(plain: Any) -> Cell:  # noqa: ANN401 - any plain value
    return Estimate(**plain) if isinstance(plain, dict) else plain


def _panel(plain: Json) -> Panel:
    read = {
        "lines": [Line(**line) for line in plain["lines"]],
        "points": [Points(**_missing_as_nan(points)) for points in plain["points"]],
        "levels": [Level(**level) for level in plain["levels"]],
        "y_range": tuple(plain["y_range"]) if plain["y_range"] else None,
    }
    return Panel(**{**plain, **read})


def _rounded(plain: Any) -> Any:  # noqa: ANN401 - any plain value
    """Rounds numbers to `FIGURE_DIGITS`; NaN, which JSON lacks, becomes null."""
    if isinstance(plain, dict):
        return {key: _rounded(value) for key, value in plain.items()}
    if isinstance(plain, list | tuple):
        return [_rounded(value) for value in plain]
    if isinstance(plain, float):
        return None if plain != plain else float(f"{plain:.{FIGURE_DIGITS}g}")
    return plain


def _missing_as_nan(points: Json) -> dict[str, Any]:
    numbers = {
        key: [float("nan") if number is None else number for number in points[key]] for key in ("y", "low", "high") if points[key]
    }
    return {**points, **numbers}
