"""The inner geometry of a camera, as calibration finds it and a file keeps it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from chefshat.files import check_readable, write_atomically
from numpy.typing import NDArray


@dataclass(frozen=True)
class Camera:
    """A camera's intrinsics, for one size of its pictures.

    Attributes:
        width: Width of its pictures in pixels.
        height: Height of its pictures in pixels.
        matrix: Focal lengths and principal point in pixels; shape (3, 3).
        distortion: Distortion of the lens as OpenCV orders it (k1, k2, p1, p2, k3); shape (5,).
        error: Root mean square error of the calibration in pixels; 0 for a synthetic camera.
    """

    width: int
    height: int
    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    error: float = 0.0

    def undistort(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where a lens without distortion would show points; shape (n, 2), pixels."""
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 20, 1e-4)
        found = cv2.undistortPoints(
            np.ascontiguousarray(points, dtype=np.float64).reshape(-1, 1, 2),
            self.matrix,
            self.distortion,
            None,
            np.eye(3),
            self.matrix,
            criteria,
        )
        return np.asarray(found, dtype=np.float64).reshape(-1, 2)

    def distort(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where this lens shows points that a lens without distortion shows at `points`; shape (n, 2), pixels."""
        rays = (
            cv2.convertPointsToHomogeneous(np.ascontiguousarray(points, dtype=np.float64)).reshape(-1, 3)
            @ np.linalg.inv(self.matrix).T
        )
        zero = np.zeros(3)
        found, _ = cv2.projectPoints(np.ascontiguousarray(rays), zero, zero, self.matrix, self.distortion)
        return np.asarray(found, dtype=np.float64).reshape(-1, 2)

    def scaled(self, width: int, height: int) -> Camera:
        """The same camera with pictures of another size.

        Raises:
            ValueError: The size has other proportions: such a picture is cut, and how is not known.
        """
        factor = width / self.width
        if (width, height) == (self.width, self.height):
            return self
        if abs(height - self.height * factor) > 1.0:
            raise ValueError(
                f"the camera was calibrated with pictures of {self.width}x{self.height}, "
                f"these are {width}x{height}; calibrate again"
            )
        matrix = self.matrix * factor
        matrix[2, 2] = 1.0
        return Camera(width, height, matrix, self.distortion, self.error * factor)

    def save(self, path: Path) -> None:
        """Writes the camera to a JSON file atomically. Raises OSError if it cannot be written."""
        values = {
            "width": self.width,
            "height": self.height,
            "matrix": self.matrix.tolist(),
            "distortion": self.distortion.tolist(),
            "error": self.error,
        }
        write_atomically(path, json.dumps(values, indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> Camera:
        """Reads a camera from a JSON file that `save` wrote.

        Raises:
            OSError: The file cannot be read.
            ValueError: It is not the file of a camera.
        """
        check_readable(path, "camera's calibration", "`chefshat-robot calibrate` writes")
        try:
            values = json.loads(path.read_text(encoding="utf-8"))
            matrix = np.asarray(values["matrix"], dtype=np.float64)
            distortion = np.asarray(values["distortion"], dtype=np.float64)
            if matrix.shape != (3, 3) or distortion.shape != (5,):
                raise ValueError("wrong shapes")
            return cls(int(values["width"]), int(values["height"]), matrix, distortion, float(values["error"]))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path} is not a camera's calibration; make one with `chefshat-robot calibrate`") from error
