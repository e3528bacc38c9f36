"""The calibration sheet: a ChArUco board, whose corners are found even when part of it is hidden.

Printing and calibration of a camera both take it from here. Its markers are of another dictionary than the tags of the game, so
that a sheet left on the table is never mistaken for cards.
"""

from __future__ import annotations

import cv2

COLUMNS = 10
ROWS = 7
SQUARE_SIZE = 26.0
"""Edge of a square, in mm."""
MARKER_SIZE = 19.5
"""Edge of a marker, outer edge of its black border to the other, in mm."""
DICTIONARY = "DICT_4X4_50"
"""The dictionary of the markers, as OpenCV names it. Their numbers are 0..34, row by row."""


def board() -> cv2.aruco.CharucoBoard:
    """The board as OpenCV's detector and calibration expect it, in mm from the outer corner of its top left square."""
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    return cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE_SIZE, MARKER_SIZE, dictionary)
