"""A PDF in millimetres, with what all sheets draw: text, the project's drawings, tags, QR codes, crop marks, a ruler.

The origin is the top left corner of the page; x grows to the right, y downwards. `Canvas.at` moves and turns it, so that a card
is drawn as if it were alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import segno
from fpdf import FPDF, ViewerPreferences
from fpdf.drawing_primitives import DeviceGray, Transform
from numpy.typing import NDArray

from chefshat_robot.charuco import board

ASSETS = Path(str(resources.files("chefshat_robot.printing") / "assets"))
"""The font and the drawings: copies of those in server/assets."""

INK = "#2b2320"
SOFT = "#655749"
FAINT = "#cdb899"
WHITE = "#ffffff"

MARGIN = 5.0
"""Width of the edges of a page that printers may not reach, in mm: nothing is drawn there."""
RULER = 100.0
"""Length of the ruler on each sheet, in mm."""
NOTE_HEIGHT = 4.8
"""Height of the note with the ruler, in mm."""
NOTE_WIDTH = 190.0
"""Width of the note with the ruler, at most, in mm."""

POINT = 25.4 / 72
"""A typographic point, in mm."""
CAP_HEIGHT = 0.668
"""Height of a capital letter of the font, as a part of its size."""


@dataclass(frozen=True)
class Paper:
    """A size of paper, upright, in mm."""

    name: str
    width: float
    height: float


PAPERS = {"a4": Paper("A4", 210.0, 297.0), "letter": Paper("letter", 215.9, 279.4)}


class Canvas:
    """A document whose last page is being drawn.

    Attributes:
        paper: The paper of all pages.
        width: Width of the page being drawn, in mm.
        height: Its height, in mm.
    """

    def __init__(self, paper: Paper) -> None:
        self.paper = paper
        self.width, self.height = paper.width, paper.height
        self._pdf = FPDF(unit="mm", format=(paper.width, paper.height))
        self._pdf.set_auto_page_break(False)
        self._pdf.set_title("Chef's Hat, to print")
        self._pdf.set_lang("en")
        # A viewer that honours it offers to print at actual size.
        self._pdf.viewer_preferences = ViewerPreferences(print_scaling="None")
        for style, name in (("", "Regular"), ("B", "Bold")):
            self._pdf.add_font("Atkinson", style, ASSETS / f"AtkinsonHyperlegibleNext-{name}.ttf")

    @property
    def pages(self) -> int:
        """The number of pages so far."""
        return self._pdf.page

    def add_page(self, landscape: bool = False) -> None:
        """Starts a page."""
        self._pdf.add_page(orientation="landscape" if landscape else "portrait")
        self.width, self.height = self._pdf.w, self._pdf.h

    def save(self, file: Path) -> None:
        """Writes the document.

        Raises:
            OSError: If the file cannot be written.
        """
        file.write_bytes(bytes(self._pdf.output()))

    @contextmanager
    def at(self, x: float, y: float, angle: float = 0.0) -> Iterator[None]:
        """Moves the origin to (x, y) and turns the axes clockwise by an angle in degrees, within the `with` block."""
        with self._pdf.transform(Transform.rotation_d(angle) @ Transform.translation(x, y)):
            yield

    @contextmanager
    def clip(self, x: float, y: float, width: float, height: float) -> Iterator[None]:
        """Draws only what lies in a rectangle, within the `with` block."""
        with self._pdf.local_context(), self._pdf.rect_clip(x, y, width, height):
            yield

    def text(
        self, x: float, y: float, text: str, size: float, *, bold: bool = False, colour: str = INK, align: str = "left"
    ) -> None:
        """Writes a line of text.

        Args:
            x: Its left end, middle or right end, depending on `align`.
            y: Its baseline.
            text: The text.
            size: Size of the font, in points.
            bold: Whether it is bold.
            colour: Colour as `#rrggbb`.
            align: `left`, `middle` or `right`.
        """
        self._pdf.set_font("Atkinson", "B" if bold else "", size)
        self._pdf.set_text_color(colour)
        shift = {"left": 0.0, "middle": 0.5, "right": 1.0}[align]
        self._pdf.text(x - shift * self._pdf.get_string_width(text), y, text)

    def rect(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        *,
        fill: str | None = None,
        line: str | None = None,
        line_width: float = 0.3,
        radius: float = 0.0,
        dash: float = 0.0,
    ) -> None:
        """Draws a rectangle, filled, outlined or both; `radius` rounds its corners, `dash` is the length of dashes, in mm."""
        style = self._style(fill, line, line_width, dash)
        self._pdf.rect(x, y, width, height, style=style, round_corners=radius > 0, corner_radius=radius)
        self._pdf.set_dash_pattern()

    def circle(
        self, x: float, y: float, radius: float, *, fill: str | None = None, line: str | None = None, line_width: float = 0.3
    ) -> None:
        """Draws a circle around (x, y)."""
        self._pdf.circle(x, y, radius, style=self._style(fill, line, line_width, 0.0))

    def line(self, x1: float, y1: float, x2: float, y2: float, *, colour: str = INK, width: float = 0.2, dash: float = 0.0) -> None:
        """Draws a straight line."""
        self._style(None, colour, width, dash)
        self._pdf.line(x1, y1, x2, y2)
        self._pdf.set_dash_pattern()

    def symbol(self, name: str, x: float, y: float, size: float) -> None:
        """Draws one of the project's drawings as vectors, in a square with its top left corner at (x, y)."""
        self._pdf.image(ASSETS / f"{name}.svg", x, y, size, size)

    def tag(self, number: int, x: float, y: float, size: float) -> None:
        """Draws an AprilTag of the family 36h11 around (x, y), `size` mm wide, on white with a quiet zone of one module."""
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        module = size / 8
        half = size / 2
        self.rect(x - half - module, y - half - module, size + 2 * module, size + 2 * module, fill=WHITE)
        self._modules(_marker(dictionary, number, 8), x - half, y - half, module)

    def qr(self, text: str, x: float, y: float, size: float) -> None:
        """Draws a QR code of the error correction Q with its top left corner at (x, y), `size` mm wide, without a quiet zone."""
        matrix = np.array(segno.make_qr(text, error="q").matrix, dtype=bool)
        self._modules(matrix, x, y, size / len(matrix))

    def calibration_board(self, x: float, y: float) -> None:
        """Draws the ChArUco board with its top left corner at (x, y)."""
        charuco = board()
        columns, rows = charuco.getChessboardSize()
        square = charuco.getSquareLength()
        rows_then_columns = np.indices((rows, columns)).sum(axis=0)
        self._modules(rows_then_columns % 2 == 0, x, y, square)
        dictionary = charuco.getDictionary()
        width = dictionary.markerSize + 2
        for number, corners in zip(np.ravel(charuco.getIds()), charuco.getObjPoints(), strict=True):
            left, top = corners[0][:2]
            self._modules(_marker(dictionary, int(number), width), x + left, y + top, charuco.getMarkerLength() / width)

    def note(self, text: str, edge: str = "bottom") -> None:
        """Draws the ruler and a note about the sheet along the `bottom` or the `left` edge."""
        if edge == "left":
            with self.at(MARGIN, self.height / 2 + NOTE_WIDTH / 2, -90):
                self._note(text)
        else:
            with self.at(self.width / 2 - NOTE_WIDTH / 2, self.height - MARGIN - NOTE_HEIGHT):
                self._note(text)

    def _note(self, text: str) -> None:
        """The note in its own coordinates: `NOTE_WIDTH` by `NOTE_HEIGHT`."""
        self.line(0, 0.2, RULER, 0.2, width=0.2)
        for mm in range(0, int(RULER) + 1, 5):
            self.line(mm, 0.1, mm, 1.8 if mm % 10 == 0 else 1.1, width=0.2)
        for mm in range(10, int(RULER), 10):
            self.text(mm, 3.8, str(mm), 5, colour=SOFT, align="middle")
        self.text(0, 3.8, "mm", 5, colour=SOFT)
        self.text(RULER + 2, 1.9, text, 6.5, bold=True)
        self.text(RULER + 2, 4.0, "Print at 100 % (actual size), then check the ruler: 100 mm.", 5.5, colour=SOFT)

    def _style(self, fill: str | None, line: str | None, line_width: float, dash: float) -> str:
        """Sets the colours of a shape and returns fpdf2's code for what is drawn of it."""
        if fill is not None:
            self._pdf.set_fill_color(fill)
        if line is not None:
            self._pdf.set_draw_color(line)
            self._pdf.set_line_width(line_width)
            self._pdf.set_dash_pattern(dash, dash)
        return ("D" if line is not None else "") + ("F" if fill is not None else "")

    def _modules(self, black: NDArray[np.bool_], x: float, y: float, module: float) -> None:
        """Fills the black modules of a code, as one path: single squares would show hairlines between them."""
        with self._pdf.new_path() as path:
            path.style.fill_color = DeviceGray(0)
            path.style.stroke_color = None
            for row, values in enumerate(black):
                edges = np.flatnonzero(np.diff(values.astype(np.int8), prepend=0, append=0))
                for start, end in edges.reshape(-1, 2).tolist():
                    path.rectangle(x + start * module, y + row * module, (end - start) * module, module)


def _marker(dictionary: cv2.aruco.Dictionary, number: int, width: int) -> NDArray[np.bool_]:
    """The black modules of a marker, its border included: shape (width, width)."""
    return np.equal(cv2.aruco.generateImageMarker(dictionary, number, width, borderBits=1), 0)
