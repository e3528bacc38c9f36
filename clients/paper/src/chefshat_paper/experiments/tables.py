"""Formats tables as text and as Markdown. Numbers are right-aligned, words left-aligned."""

import textwrap
from collections.abc import Sequence

from chefshat_paper.experiments.results import Cell, Estimate, Table

# An en dash.
DASH = "\u2013"
# Width at which notes below a table are wrapped.
NOTE_WIDTH = 100


def text(table: Table) -> str:
    """Formats a table as aligned lines, the title first, the note last."""
    cells = [list(table.columns), *([show(cell) for cell in row] for row in table.rows)]
    words = _word_columns(table)
    widths = [max(len(row[column]) for row in cells) for column in range(len(table.columns))]
    lines = [
        "  ".join(
            cell.ljust(width) if column in words else cell.rjust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    ]
    rule = "─" * max(len(line) for line in lines)
    return "\n".join([table.title, "", lines[0], rule, *lines[1:], *_wrapped(table.note)])


def markdown(table: Table) -> str:
    """Formats a table as GitHub's Markdown, with the title in bold above and the note below."""
    words = _word_columns(table)
    lines = [
        f"**{_escaped(table.title)}**",
        "",
        _row([_escaped(heading) for heading in table.columns]),
        _row([":---" if column in words else "---:" for column in range(len(table.columns))]),
        *(_row([_escaped(show(cell)) for cell in row]) for row in table.rows),
    ]
    if table.note:
        lines += ["", _escaped(table.note)]
    return "\n".join(lines)


def show(cell: Cell) -> str:
    """Formats a cell: an estimate as "28.4% (27.9-28.9)", with an en dash, or as "28.4 ± 0.3%"."""
    if cell is None:
        return DASH
    if isinstance(cell, Estimate):
        return _estimate(cell)
    if isinstance(cell, float):
        return f"{cell:g}"
    if isinstance(cell, int):
        return f"{cell:,}"
    return cell


def _estimate(estimate: Estimate) -> str:
    factor = 100 if estimate.percent else 1

    def number(value: float) -> str:
        # Adding 0 turns -0.0, the rounding of a small negative number, into 0.0.
        return f"{round(value * factor, estimate.digits) + 0.0:.{estimate.digits}f}"

    unit = "%" if estimate.percent else ""
    shown = number(estimate.value) + unit
    if estimate.error is not None:
        shown = f"{number(estimate.value)} ± {number(estimate.error)}{unit}"
    if estimate.low is None or estimate.high is None:
        return shown
    # A dash next to a minus sign is hard to read.
    between = " to " if estimate.low < 0 or estimate.high < 0 else DASH
    return f"{shown} ({number(estimate.low)}{between}{number(estimate.high)})"


def _word_columns(table: Table) -> set[int]:
    """Returns the columns that contain texts."""
    return {column for column in range(len(table.columns)) if any(isinstance(row[column], str) for row in table.rows)}


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _escaped(words: str) -> str:
    return words.replace("|", "\\|")


def _wrapped(note: str) -> list[str]:
    return ["", *textwrap.wrap(note, NOTE_WIDTH)] if note else []
