"""Calibration from synthetic pictures of the calibration sheet: the camera is found, and pictures that would not do are refused."""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from chefshat_robot import cli
from chefshat_robot.synthetic.sheets import calibration_frames
from chefshat_robot.vision import Camera, Frame
from chefshat_robot.vision.calibration import CalibrationError, calibrate

CAMERA = Camera(
    640,
    360,
    np.array([[600.0, 0.0, 325.0], [0.0, 600.0, 176.0], [0.0, 0.0, 1.0]]),
    np.array([-0.18, 0.03, 0.001, -0.001, 0.0]),
)


@cache
def enough_frames() -> tuple[Frame, ...]:
    return tuple(calibration_frames(CAMERA, 20))


def test_the_camera_is_found() -> None:
    counts: list[int] = []
    calibration = calibrate(enough_frames(), counts.append)
    assert counts == list(range(1, len(calibration.views) + 1))
    camera = calibration.camera
    assert (camera.width, camera.height) == (640, 360)
    assert np.allclose(camera.matrix, CAMERA.matrix, atol=8)
    corners = np.array([[20.0, 20.0], [620.0, 20.0], [620.0, 340.0], [20.0, 340.0]])
    there = camera.undistort(corners) - camera.matrix[:2, 2]
    truly = CAMERA.undistort(corners) - CAMERA.matrix[:2, 2]
    assert np.allclose(there, truly, atol=10)
    assert 0 < camera.error < 0.5
    assert calibration.picture.shape == (360, 640, 3)


def test_too_few_positions_are_refused() -> None:
    with pytest.raises(CalibrationError, match="in 3 different positions, 10 are needed"):
        calibrate(calibration_frames(CAMERA, 3))


def test_a_sheet_that_stays_in_the_middle_is_refused() -> None:
    with pytest.raises(CalibrationError, match="edges and corners"):
        calibrate(calibration_frames(CAMERA, 20, spread=0.2))


def test_pictures_of_different_sizes_are_refused() -> None:
    def frames() -> Iterator[Frame]:
        yield from calibration_frames(CAMERA, 1)
        yield from calibration_frames(CAMERA.scaled(1280, 720), 1)

    with pytest.raises(CalibrationError, match="different sizes"):
        calibrate(frames())


def test_the_command_writes_the_camera_and_its_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for frame in enough_frames():
        cv2.imwrite(str(pictures / f"{frame.index:02}.png"), frame.image)
    output = tmp_path / "camera.json"
    assert cli.main(["calibrate", str(pictures), "--output", str(output), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    camera = Camera.load(output)
    assert np.allclose(camera.matrix, CAMERA.matrix, atol=8)
    assert result["error"] == pytest.approx(camera.error)
    picture = cv2.imread(str(tmp_path / "camera.png"))
    assert picture is not None
    assert picture.shape == (360, 640, 3)


def test_what_is_not_a_camera_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.json").write_text('{"width": 3}')
    with pytest.raises(ValueError, match="not a camera's calibration"):
        Camera.load(tmp_path / "notes.json")


def test_a_calibration_is_replaced_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(descriptor: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    file = tmp_path / "camera.json"
    CAMERA.save(file)
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        CAMERA.scaled(1280, 720).save(file)
    assert Camera.load(file).width == CAMERA.width
    assert list(tmp_path.iterdir()) == [file]
