"""Figures as data: panels with lines, points and levels. Drawing them is in `plots`."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Line:
    """A line of a figure, with a band if `low` and `high` are given. All have the same length."""

    label: str
    x: Sequence[float]
    y: Sequence[float]
    low: Sequence[float] = ()
    high: Sequence[float] = ()


@dataclass(frozen=True)
class Points:
    """A point for each category of a panel, with an error bar from low to high if given; NaN omits a category."""

    label: str
    y: Sequence[float]
    low: Sequence[float] = ()
    high: Sequence[float] = ()


@dataclass(frozen=True)
class Level:
    """A horizontal dashed line, for a figure of the paper."""

    label: str
    y: float


@dataclass(frozen=True)
class Panel:
    """One pair of axes: lines over numbers, or points over categories.

    Attributes:
        title: one line.
        x_label: name and unit of x; may be empty over categories.
        y_label: name and unit of y.
        lines: lines, in the order of the palette.
        points: points over `categories`.
        levels: horizontal lines.
        categories: names along x, for `points`.
        y_range: minimum and maximum of y; None: automatic.
    """

    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line] = ()
    points: Sequence[Points] = ()
    levels: Sequence[Level] = ()
    categories: Sequence[str] = ()
    y_range: tuple[float, float] | None = None


@dataclass(frozen=True)
class Figure:
    """A picture of one or more panels.

    Attributes:
        name: short name in lower case, unique within the result; part of the picture's file name.
        title: one line.
        panels: at least one.
        columns: panels in a row.
    """

    name: str
    title: str
    panels: Sequence[Panel]
    columns: int = 2
