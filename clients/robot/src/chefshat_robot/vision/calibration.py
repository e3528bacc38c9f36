"""Calibration of a camera with the printed calibration sheet.

The sheet (`chefshat_robot.charuco`) is held before the camera at different angles and places. Calibration collects the pictures
that add something, and refuses a result that would not do, with what to do better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from chefshat_robot.charuco import board

from .camera import Camera
from .events import Picture
from .frames import Frame

MIN_CORNERS = 15
"""Corners of the sheet that must be seen in a picture."""
NEW_VIEW = 0.04
"""A picture adds something if the sheet's corners moved by this part of the picture's width."""
STEADY = 0.004
"""A picture is steady if the corners moved by less than this part of its width since the frame before."""
MIN_VIEWS = 10
"""Pictures that a calibration needs."""
ENOUGH_VIEWS = 25
"""Pictures after which collecting ends."""
MAX_ERROR = 1.0
"""Biggest root mean square error that is accepted, in pixels at a width of 1280."""
MAX_FOCAL_UNCERTAINTY = 0.01
"""Biggest standard deviation of the focal length that is accepted, as a part of it."""
COVERAGE_GRID = (4, 3)
"""Columns and rows into which the picture is divided to see whether the sheet was everywhere."""
MIN_COVERAGE = 9
"""Cells of the grid in which corners must have been seen."""


class CalibrationError(Exception):
    """The pictures are not good enough; the message says what to do."""


@dataclass(frozen=True)
class View:
    """The sheet in one picture.

    Attributes:
        corners: Where its corners were seen; shape (n, 2), pixels.
        numbers: The number of each corner; shape (n,).
    """

    corners: NDArray[np.float32]
    numbers: NDArray[np.int32]


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera and what it was calibrated from.

    Attributes:
        camera: The camera.
        views: The pictures of the sheet that were used.
        picture: The last of them, with the corners of all drawn in.
    """

    camera: Camera
    views: tuple[View, ...]
    picture: Picture


def calibrate(frames: Iterable[Frame], progress: Callable[[int], None] = lambda views: None) -> Calibration:
    """Calibrates a camera from frames that show the calibration sheet.

    Takes frames until there are `ENOUGH_VIEWS` different views of the sheet, or no frames are left.

    Args:
        frames: The frames, all of one size.
        progress: Called after each new view with how many there are.

    Raises:
        CalibrationError: The pictures are too few or too alike, or do not fit a camera.
    """
    views, last = _collect(frames, progress)
    if last is None or len(views) < MIN_VIEWS:
        raise CalibrationError(
            f"the sheet was seen in {len(views)} different positions, {MIN_VIEWS} are needed; "
            "print it with `chefshat-robot print`, hold it flat and still before the camera, and move it between pictures"
        )
    height, width = last.shape[:2]
    covered = _coverage(views, width, height)
    if covered < MIN_COVERAGE:
        raise CalibrationError(
            f"the sheet was seen in {covered} of {COVERAGE_GRID[0] * COVERAGE_GRID[1]} parts of the picture, "
            f"{MIN_COVERAGE} are needed; move it to the edges and corners of the picture too"
        )
    charuco = board()
    points = [charuco.matchImagePoints([*view.corners.reshape(-1, 1, 2)], view.numbers) for view in views]
    result = cv2.calibrateCameraExtended(
        [np.asarray(true, dtype=np.float32) for true, _ in points],
        [np.asarray(seen, dtype=np.float32) for _, seen in points],
        (width, height),
        np.eye(3),
        np.zeros(5),
    )
    error, matrix, distortion, deviations = float(result[0]), np.asarray(result[1]), np.asarray(result[2]), np.asarray(result[5])
    uncertainty = float(np.ravel(deviations)[:2].max()) / float(matrix[0, 0])
    if error > MAX_ERROR * width / 1280:
        raise CalibrationError(
            f"the error is {error:.2f} pixels, at most {MAX_ERROR * width / 1280:.2f} are accepted; "
            "glue the sheet to something flat, check that it was printed in its real size, and hold it still in good light"
        )
    if not uncertainty <= MAX_FOCAL_UNCERTAINTY:
        raise CalibrationError(
            f"the focal length is only known to {100 * uncertainty:.1f} %, {100 * MAX_FOCAL_UNCERTAINTY:.0f} % are needed; "
            "tilt the sheet more, by 30 to 45 degrees to all sides"
        )
    camera = Camera(width, height, matrix.astype(np.float64), np.ravel(distortion).astype(np.float64)[:5], error)
    return Calibration(camera, tuple(views), _drawing(views, last, camera))


def _collect(frames: Iterable[Frame], progress: Callable[[int], None]) -> tuple[list[View], Picture | None]:
    """The views that add something, and the picture of the last of them."""
    detector = cv2.aruco.CharucoDetector(board())
    views: list[View] = []
    picture: Picture | None = None
    before: View | None = None
    for frame in frames:
        if picture is not None and picture.shape != frame.image.shape:
            raise CalibrationError("the pictures have different sizes; give pictures of one camera in one resolution")
        grey = cv2.cvtColor(frame.image, cv2.COLOR_BGR2GRAY)
        corners, numbers, _, _ = detector.detectBoard(grey)
        if corners is None or numbers is None or len(numbers) < MIN_CORNERS:
            before = None
            continue
        view = View(np.asarray(corners, dtype=np.float32).reshape(-1, 2), np.asarray(numbers, dtype=np.int32).ravel())
        width = frame.image.shape[1]
        steady = before is None or _motion(view, before) < STEADY * width or _motion(view, before) > NEW_VIEW * width
        before = view
        if steady and all(_motion(view, other) > NEW_VIEW * width for other in views):
            views.append(view)
            picture = frame.image
            progress(len(views))
            if len(views) >= ENOUGH_VIEWS:
                break
    return views, picture


def _motion(one: View, other: View) -> float:
    """How far the corners that both views have lie apart on the average, in pixels; infinite if they share none."""
    _, first, second = np.intersect1d(one.numbers, other.numbers, return_indices=True)
    if not len(first):
        return math.inf
    return float(np.hypot(*(one.corners[first] - other.corners[second]).T).mean())


def _coverage(views: list[View], width: int, height: int) -> int:
    """In how many cells of the grid corners were seen."""
    columns, rows = COVERAGE_GRID
    corners = np.concatenate([view.corners for view in views])
    cells = np.floor(corners / np.array([width / columns, height / rows])).astype(int)
    return len({(int(x), int(y)) for x, y in cells})


def _drawing(views: list[View], picture: Picture, camera: Camera) -> Picture:
    """The last picture with the corners of all views, one colour for each view, and the numbers of the result."""
    drawing = picture.copy()
    for number, view in enumerate(views):
        hue = np.array([[[number * 180 // len(views), 220, 255]]], dtype=np.uint8)
        colour = [int(part) for part in np.ravel(cv2.cvtColor(hue, cv2.COLOR_HSV2BGR))]
        for x, y in view.corners:
            cv2.circle(drawing, (round(float(x)), round(float(y))), 4, colour, -1, cv2.LINE_AA)
    text = f"{len(views)} views, error {camera.error:.2f} px, focal length {camera.matrix[0, 0]:.0f} px"
    cv2.putText(drawing, text, (12, 32), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (0, 0, 0), 5, cv2.LINE_AA)
    cv2.putText(drawing, text, (12, 32), cv2.FONT_HERSHEY_SIMPLEX, 0.9, (255, 255, 255), 2, cv2.LINE_AA)
    return drawing
