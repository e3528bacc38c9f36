"""Something larger than a page, printed on several sheets to be glued together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from chefshat_robot.printing.canvas import FAINT, INK, MARGIN, NOTE_HEIGHT, SOFT, Canvas

FLAP = 8.0
"""Width of the strip by which a sheet reaches under its right and its lower neighbour, in mm."""
TOP = 13.0
"""From the upper edge of the page to the tile, in mm."""
PLAN_WIDTH = 36.0
"""Width of the plan of the sheets, in mm."""


@dataclass(frozen=True)
class Tiling:
    """How something is cut into sheets.

    Attributes:
        name: What it is, for the notes on the sheets.
        width: Its width, in mm.
        height: Its height, in mm.
        columns: Number of sheets beside each other.
        rows: Number of sheets above each other.
        landscape: Whether the sheets lie on their long edge.
    """

    name: str
    width: float
    height: float
    columns: int
    rows: int
    landscape: bool = False

    @property
    def tile(self) -> tuple[float, float]:
        """Width and height of a sheet's part, without flaps, in mm."""
        return self.width / self.columns, self.height / self.rows


def draw_tiles(canvas: Canvas, tiling: Tiling, draw: Callable[[Canvas], None], advice: Sequence[str]) -> None:
    """Adds the sheets of something that `draw` draws at the origin; `advice` are lines of text on each sheet."""
    width, height = tiling.tile
    sheets = tiling.columns * tiling.rows
    for sheet in range(sheets):
        row, column = divmod(sheet, tiling.columns)
        flap_right = FLAP if column + 1 < tiling.columns else 0.0
        flap_below = FLAP if row + 1 < tiling.rows else 0.0
        canvas.add_page(tiling.landscape)
        left = (canvas.width - width - FLAP) / 2
        with canvas.at(left, TOP):
            with canvas.clip(0, 0, width + flap_right, height + flap_below), canvas.at(-column * width, -row * height):
                draw(canvas)
            if flap_right:
                _hatch(canvas, width, 0, FLAP, height + flap_below)
                _label(canvas, width + FLAP / 2, height / 2, -90, f"glue under sheet {sheet + 2}")
            if flap_below:
                _hatch(canvas, 0, height, width, FLAP)
                _label(canvas, width / 2, height + FLAP / 2, 0, f"glue under sheet {sheet + 1 + tiling.columns}")
            canvas.rect(0, 0, width, height, line=FAINT, line_width=0.15)
        _crop_marks(canvas, (left, left + width), (TOP, TOP + height))
        _plan(canvas, tiling, sheet, left, TOP + height + FLAP + 7, advice)
        canvas.note(f"Chef's Hat · {tiling.name}, sheet {sheet + 1} of {sheets} · {canvas.paper.name}")


def _hatch(canvas: Canvas, x: float, y: float, width: float, height: float) -> None:
    """Oblique lines over a flap."""
    with canvas.clip(x, y, width, height):
        step = 3.0
        for number in range(int((width + height) / step) + 1):
            start = number * step
            canvas.line(x + start, y, x + start - height, y + height, colour=FAINT, width=0.2)


def _label(canvas: Canvas, x: float, y: float, angle: float, text: str) -> None:
    """A label on a flap, around its middle."""
    with canvas.at(x, y, angle):
        canvas.rect(-16, -2.2, 32, 4.4, fill="#ffffff", radius=1.5)
        canvas.text(0, 0.9, text, 7, colour=SOFT, align="middle")


def _crop_marks(canvas: Canvas, xs: tuple[float, float], ys: tuple[float, float]) -> None:
    """Lines outside the tile along which to cut: above it, and beside it if there is room."""
    for x in xs:
        canvas.line(x, MARGIN + 1, x, ys[0] - 1, colour=INK)
    if xs[0] - MARGIN > 2:
        for y in ys:
            canvas.line(MARGIN + 0.2, y, xs[0] - 0.7, y, colour=INK)


def _plan(canvas: Canvas, tiling: Tiling, sheet: int, x: float, y: float, advice: Sequence[str]) -> None:
    """A small plan of all sheets with this one marked, and what to do."""
    scale = PLAN_WIDTH / tiling.width
    width, height = (edge * scale for edge in tiling.tile)
    for number in range(tiling.columns * tiling.rows):
        row, column = divmod(number, tiling.columns)
        here = number == sheet
        canvas.rect(x + column * width, y + row * height, width, height, fill=INK if here else None, line=INK, line_width=0.2)
        canvas.text(
            x + (column + 0.5) * width,
            y + (row + 0.5) * height + 1.2,
            str(number + 1),
            9,
            bold=True,
            colour="#ffffff" if here else SOFT,
            align="middle",
        )
    text_x = x + PLAN_WIDTH + 7
    canvas.text(text_x, y + 2.6, tiling.name.capitalize(), 11, bold=True)
    lines = [
        "Cut along the grey lines, but leave the hatched flaps.",
        "Glue each flap under the sheet that it names"
        + (": the rows first, then one row to the next." if tiling.rows > 1 else "."),
        *advice,
    ]
    for number, text in enumerate(lines):
        canvas.text(text_x, y + 7.6 + 4.2 * number, f"{number + 1}", 8, bold=True, colour=SOFT)
        canvas.text(text_x + 4, y + 7.6 + 4.2 * number, text, 8)
    assert y + 7.6 + 4.2 * len(lines) < canvas.height - MARGIN - NOTE_HEIGHT, "the advice fits above the note"
