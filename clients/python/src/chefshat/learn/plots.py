"""Draws a `Figure` as PNG, in one style with a colour-blind-safe palette, without a display."""

import io
import json
import textwrap
from collections.abc import Callable, Mapping, Sequence
from math import ceil
from pathlib import Path
from typing import Any, TypeVar

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas
from matplotlib.transforms import ScaledTranslation

from chefshat.errors import ChefsHatError, failed
from chefshat.files import check_readable, write_atomically
from chefshat.learn.figures import Figure, Panel

Read = TypeVar("Read")

# The palette of Okabe and Ito, strongest contrasts first, without yellow, which is too pale on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# Distinguishable without colour.
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
GREY = "#555555"
LEVEL_STYLES = ("--", ":", "-.")
DOTS_PER_INCH = 110
# Inches.
PANEL_SIZE = (4.6, 3.2)
TITLE_HEIGHT = 0.4
# Total width of the points of a category; categories are 1 apart.
DODGE = 0.5
# Columns of a legend below two or more panels, and below one, at most.
LEGEND_COLUMNS = 3
PANEL_LEGEND_COLUMNS = 2
# Inches of a legend: beside a label, and of a letter, on average.
LEGEND_MARK = 0.6
LEGEND_LETTER = 0.062
# Inches: a line of a legend; ticks and x label, below which a panel's legend is placed.
LEGEND_LINE = 0.2
BELOW_TICKS = 0.45

# Any, because the stubs of matplotlib require literal keys.
STYLE: Any = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.labelsize": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.7,
    "legend.frameon": False,
    # Inches around a panel.
    "figure.constrained_layout.w_pad": 0.08,
    "figure.constrained_layout.h_pad": 0.06,
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
}


def png(figure: Figure) -> bytes:
    """Returns the figure as a PNG; equal figures give equal bytes (with the same matplotlib)."""
    with mpl.rc_context(STYLE):
        out = io.BytesIO()
        # Omits the version of matplotlib, for reproducible bytes.
        drawn(figure).savefig(out, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return out.getvalue()


def draw_files(
    sources: Sequence[Path],
    what: str,
    origin: str,
    read: Callable[[str], Read],
    figure: Callable[[list[Read]], Figure],
    out: Path,
    *,
    summary: Callable[[Figure], Sequence[Mapping[str, Any]]] = lambda figure: (),
    as_json: bool,
) -> int:
    """Draws a figure of text files, for a command. Returns the exit code.

    Args:
        sources: the files.
        what: the kind of file, and `origin`, what writes it; see `check_readable`.
        origin: see `what`.
        read: reads the text of a file. Raises ValueError if it is wrong.
        figure: creates the figure from what was read. Raises ValueError if it does not fit together.
        out: the picture to write.
        summary: returns what to print of the figure: texts and numbers by name.
        as_json: whether to print JSON.
    """
    found: list[Read] = []
    try:
        for source in sources:
            check_readable(source, what, origin)
            try:
                found.append(read(source.read_text(encoding="utf-8")))
            except ValueError as error:
                raise ValueError(f"{source}: {error}") from error
        drawing = figure(found)
        write_atomically(out, png(drawing))
    except (ChefsHatError, OSError, ValueError) as error:
        return failed(error, as_json=as_json)
    rows = summary(drawing)
    if as_json:
        print(json.dumps({"out": str(out), **({"summary": rows} if rows else {})}))
        return 0
    print(f"wrote {out}")
    for row in rows:
        print("  " + ", ".join(f"{name} {value:.3f}" if isinstance(value, float) else str(value) for name, value in row.items()))
    return 0


def drawn(figure: Figure) -> Canvas:
    """Returns the figure as matplotlib's. The size of panels does not depend on the legends below them."""
    columns = min(figure.columns, len(figure.panels))
    rows = ceil(len(figure.panels) / columns)
    canvas = Canvas(figsize=(PANEL_SIZE[0] * columns, PANEL_SIZE[1] * rows + TITLE_HEIGHT), layout="constrained")
    FigureCanvasAgg(canvas)
    canvas.suptitle(figure.title, fontsize=11)
    panels = [canvas.add_subplot(rows, columns, number + 1) for number in range(len(figure.panels))]
    for panel, axes in zip(figure.panels, panels, strict=True):
        _draw(panel, axes)
    if _one_legend_serves(figure):
        lines = _explain_all(figure, canvas, panels, columns)
    else:
        lines = rows * max(_explain(axes) for axes in panels)
    canvas.set_figheight(canvas.get_figheight() + LEGEND_LINE * lines)
    return canvas


def _draw(panel: Panel, axes: Axes) -> None:
    axes.set_title(panel.title)
    axes.set_xlabel(panel.x_label)
    axes.set_ylabel(panel.y_label)
    for number, line in enumerate(panel.lines):
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(line.x, line.y, color=colour, label=line.label)
        if line.low:
            axes.fill_between(line.x, line.low, line.high, color=colour, alpha=0.18, linewidth=0)
    if panel.points:
        _draw_points(panel, axes)
    for number, level in enumerate(panel.levels):
        axes.axhline(level.y, color=GREY, linestyle=LEVEL_STYLES[number % len(LEVEL_STYLES)], linewidth=1.0, label=level.label)
    if panel.y_range is not None:
        axes.set_ylim(panel.y_range)


def _one_legend_serves(figure: Figure) -> bool:
    """Whether label and style correspond one to one across all panels."""
    pairs: set[tuple[str, str]] = set()
    for panel in figure.panels:
        pairs |= {(line.label, f"colour {number}") for number, line in enumerate(panel.lines)}
        pairs |= {(points.label, f"colour {number}") for number, points in enumerate(panel.points)}
        pairs |= {(level.label, f"level {number}") for number, level in enumerate(panel.levels)}
    return len({name for name, _ in pairs}) == len({look for _, look in pairs}) == len(pairs)


def _explain_all(figure: Figure, canvas: Canvas, panels: Sequence[Axes], columns: int) -> int:
    """Adds one legend below all panels. Returns its number of lines."""
    handles: dict[str, Any] = {}
    for axes in panels:
        handles |= _handles(axes)
    levels = {level.label for panel in figure.panels for level in panel.levels}
    names = sorted(handles, key=lambda name: name in levels)
    lines, labels = _laid_out(names, PANEL_LEGEND_COLUMNS if columns == 1 else LEGEND_COLUMNS, PANEL_SIZE[0] * columns)
    canvas.legend([handles[name] for name in names], labels, loc="outside lower center", ncols=ceil(len(names) / lines))
    return lines * _most_lines(labels)


def _explain(axes: Axes) -> int:
    """Adds a legend below one panel, where it hides no line. Returns its number of lines."""
    handles = _handles(axes)
    lines, labels = _laid_out(list(handles), PANEL_LEGEND_COLUMNS, PANEL_SIZE[0])
    below = ScaledTranslation(0, -BELOW_TICKS, axes.figure.dpi_scale_trans)
    axes.legend(
        list(handles.values()),
        labels,
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=axes.transAxes + below,
        ncols=ceil(len(handles) / lines),
    )
    return lines * _most_lines(labels)


def _laid_out(names: Sequence[str], columns: int, width: float) -> tuple[int, list[str]]:
    """Returns the rows of a legend of at most this width in inches, and its labels, with line breaks where one alone is wider."""
    longest = max(map(len, names), default=0)
    columns = max(1, min(columns, int(width / (LEGEND_MARK + LEGEND_LETTER * longest))))
    letters = int((width / columns - LEGEND_MARK) / LEGEND_LETTER)
    return ceil(len(names) / columns) or 1, [textwrap.fill(name, letters) for name in names]


def _most_lines(labels: Sequence[str]) -> int:
    return max((label.count("\n") + 1 for label in labels), default=0)


def _handles(axes: Axes) -> dict[str, Any]:
    """Returns the legend handles by label."""
    handles, labels = axes.get_legend_handles_labels()
    return dict(zip(labels, handles, strict=True))


def _draw_points(panel: Panel, axes: Axes) -> None:
    axes.set_xticks(range(len(panel.categories)), panel.categories)
    axes.grid(visible=False, axis="x")
    for number, points in enumerate(panel.points):
        offset = 0.0 if len(panel.points) == 1 else DODGE * (number / (len(panel.points) - 1) - 0.5)
        x = [category + offset for category in range(len(panel.categories))]
        errors = None
        if points.low:
            below = [max(y - low, 0.0) for y, low in zip(points.y, points.low, strict=True)]
            above = [max(high - y, 0.0) for y, high in zip(points.y, points.high, strict=True)]
            errors = [below, above]
        axes.errorbar(
            x,
            points.y,
            yerr=errors,
            fmt=MARKERS[number % len(MARKERS)],
            color=COLOURS[number % len(COLOURS)],
            markersize=4.5,
            capsize=2.5,
            label=points.label,
        )
