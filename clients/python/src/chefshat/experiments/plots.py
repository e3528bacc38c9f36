"""Figures as PNG: one quiet style, colours that the colour-blind can tell apart, drawn without a screen.

What is shown is a `Figure`, made by an experiment; nothing is computed here.
"""

import io
from collections.abc import Sequence
from math import ceil
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure as Canvas

from chefshat.experiments.results import Figure, Panel

# The palette of Okabe and Ito, darkest contrasts first; yellow is left out, which is too pale on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# Told apart without colour, too.
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
GREY = "#555555"
LEVEL_STYLES = ("--", ":", "-.")
DOTS_PER_INCH = 110
# Inches.
PANEL_SIZE = (4.6, 3.2)
# How far the points of a category stand apart, in all, where categories are 1 apart.
DODGE = 0.5
# What fits side by side below two panels.
MAX_LEGEND_COLUMNS = 3

# Of no type, because the stubs of matplotlib want every key spelled out.
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
    # Words stay readable where lines pass behind them.
    "legend.framealpha": 0.8,
    "legend.edgecolor": "none",
    "legend.fontsize": 8,
    "lines.linewidth": 1.4,
}


def png(figure: Figure) -> bytes:
    """The figure as a PNG; the same figure gives the same bytes (with the same matplotlib)."""
    columns = min(figure.columns, len(figure.panels))
    rows = ceil(len(figure.panels) / columns)
    with mpl.rc_context(STYLE):
        canvas = Canvas(figsize=(PANEL_SIZE[0] * columns, PANEL_SIZE[1] * rows + 0.6), layout="constrained")
        FigureCanvasAgg(canvas)
        canvas.suptitle(figure.title, fontsize=11)
        drawn = [canvas.add_subplot(rows, columns, number + 1) for number in range(len(figure.panels))]
        for panel, axes in zip(figure.panels, drawn, strict=True):
            _draw(panel, axes)
        _explain(figure, canvas, drawn)
        out = io.BytesIO()
        # Without the version of matplotlib, which is all that would differ.
        canvas.savefig(out, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return out.getvalue()


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


def _explain(figure: Figure, canvas: Canvas, drawn: Sequence[Axes]) -> None:
    """Adds the legend: one below all panels where they show the same, else one in each."""
    shown = [[line.label for line in panel.lines] + [points.label for points in panel.points] for panel in figure.panels]
    if len(shown) == 1 or any(labels != shown[0] for labels in shown):
        for axes in drawn:
            if axes.get_legend_handles_labels()[0]:
                axes.legend()
        return
    handles: dict[str, Any] = {}
    for axes in drawn:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    columns = min(len(handles), MAX_LEGEND_COLUMNS)
    canvas.legend(list(handles.values()), list(handles), loc="outside lower center", ncols=columns)


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
