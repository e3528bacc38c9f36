"""Reads printed pages as a camera and a phone would: rasterises a PDF at 150 dpi and decodes it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pypdfium2
import zxingcpp
from numpy.typing import ArrayLike, NDArray

from chefshat_robot.printing.canvas import Canvas

DPI = 150
MM = DPI / 25.4
"""Pixels of a millimetre, nearly: see `Page.pixels_per_mm`."""


@dataclass(frozen=True)
class Tag:
    """An AprilTag found on a page.

    Attributes:
        number: Its number.
        x: Its centre, mm from the left edge.
        y: Its centre, mm from the top edge.
        angle: Degrees by which it is turned clockwise, 0..359.
        size: Mean length of its edges, in mm.
    """

    number: int
    x: float
    y: float
    angle: float
    size: float


class Page:
    """A rasterised page."""

    def __init__(self, image: NDArray[np.uint8], size: tuple[float, float]) -> None:
        self.image = image
        self.size = size
        """Width and height, in mm."""
        self.pixels_per_mm: NDArray[np.float64] = np.array([image.shape[1] / size[0], image.shape[0] / size[1]])
        """Along x and y: a page is stretched to whole pixels."""
        self.grey: NDArray[np.uint8] = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), dtype=np.uint8)

    def tags(self) -> list[Tag]:
        """The AprilTags, by number and then from top to bottom."""
        parameters = cv2.aruco.DetectorParameters()
        parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
        corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary, parameters).detectMarkers(self.grey)
        found = []
        for number, quad in zip([] if numbers is None else np.ravel(numbers), corners, strict=True):
            points = self.points(quad)
            x, y = points.mean(axis=0)
            right, down = points[1] - points[0]
            edges = np.linalg.norm(points - np.roll(points, 1, axis=0), axis=1)
            found.append(
                Tag(int(number), float(x), float(y), float(np.degrees(np.arctan2(down, right)) % 360), float(edges.mean()))
            )
        return sorted(found, key=lambda tag: (tag.number, tag.y))

    def qr_codes(self) -> dict[str, tuple[float, float]]:
        """The texts of the QR codes and their centres, in mm."""
        found = {}
        for code in zxingcpp.read_barcodes(self.grey, formats=zxingcpp.BarcodeFormats([zxingcpp.BarcodeFormat.QRCode])):
            corners = [code.position.top_left, code.position.top_right, code.position.bottom_right, code.position.bottom_left]
            x, y = self.points([(point.x, point.y) for point in corners]).mean(axis=0)
            found[code.text] = (float(x), float(y))
        return found

    def points(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """Points in mm, shape (n, 2), of points in pixels, whose coordinates are those of their centres."""
        return (np.asarray(pixels, dtype=np.float64).reshape(-1, 2) + 0.5) / self.pixels_per_mm

    def colour(self, x: float, y: float) -> tuple[int, int, int]:
        """The colour at a point in mm."""
        column, row = (np.array([x, y]) * self.pixels_per_mm).astype(int)
        red, green, blue = self.image[row, column]
        return int(red), int(green), int(blue)


def pages_of(canvas: Canvas, folder: Path) -> list[Page]:
    """Saves a document and rasterises its pages."""
    file = folder / "printed.pdf"
    canvas.save(file)
    with pypdfium2.PdfDocument(file) as document:
        images = [page.render(scale=DPI / 72, rev_byteorder=True).to_numpy().copy() for page in document]
        sizes = [(page.get_width() / 72 * 25.4, page.get_height() / 72 * 25.4) for page in document]
    return [Page(image, size) for image, size in zip(images, sizes, strict=True)]
