"""Tables as text for a terminal and as Markdown for a page. Numbers stand to the right, words to the left."""

import textwrap
from collections.abc import Sequence

from chefshat.experiments.results import Cell, Estimate, Table

# An en dash.
DASH = "\u2013"
# Width in which notes below a table are broken.
NOTE_WIDTH = 100


def text(table: Table) -> str:
    """The table as aligned lines, the title first, the note last."""
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
    """The table in GitHub's Markdown, the title in bold above it, the note below."""
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
    """A cell as text: an estimate as "28.4% (27.9 to 28.9)", with a dash between the two."""
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
        # Without "-0.0", which a small negative number would be rounded to.
        return f"{round(value * factor, estimate.digits) + 0.0:.{estimate.digits}f}"

    unit = "%" if estimate.percent else ""
    shown = number(estimate.value) + unit
    if estimate.low is None or estimate.high is None:
        return shown
    # Beside a minus sign a dash would be hard to read.
    between = " to " if estimate.low < 0 or estimate.high < 0 else DASH
    return f"{shown} ({number(estimate.low)}{between}{number(estimate.high)})"


def _word_columns(table: Table) -> set[int]:
    """The columns that hold words: those with a text in them."""
    return {column for column in range(len(table.columns)) if any(isinstance(row[column], str) for row in table.rows)}


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _escaped(words: str) -> str:
    return words.replace("|", "\\|")


def _wrapped(note: str) -> list[str]:
    return ["", *textwrap.wrap(note, NOTE_WIDTH)] if note else []
