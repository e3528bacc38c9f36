"""`chefshat-robot calibrate`: measures the lens of a camera with the printed calibration sheet."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import cv2

from chefshat_robot.cli import CommandError

from .calibration import ENOUGH_VIEWS, CalibrationError, calibrate
from .frames import SOURCE_HELP, SourceError, add_source_options, open_source, wish_of

_DESCRIPTION = """\
Measure the lens of a camera. Print the calibration sheet in its real size (`chefshat-robot print`), glue it to
something flat, and hold it before the camera: near and far, in the middle and in all corners of the picture,
tilted to all sides. Hold it still for a moment in each position.

Examples:
  chefshat-robot calibrate 0 --output camera.json
  chefshat-robot calibrate pictures/ --output camera.json --picture found.png
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `calibrate`."""
    parser.description = _DESCRIPTION
    parser.add_argument("source", help=SOURCE_HELP)
    add_source_options(parser)
    parser.add_argument("--output", type=Path, default=Path("camera.json"), metavar="FILE", help="default: camera.json")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="default: the output's name with .png")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Runs `calibrate`."""
    picture = arguments.picture or arguments.output.with_suffix(".png")

    def progress(views: int) -> None:
        print(f"\r{views} of {ENOUGH_VIEWS} positions", end="", file=sys.stderr, flush=True)

    try:
        calibration = calibrate(open_source(arguments.source, wish_of(arguments)), progress)
        calibration.camera.save(arguments.output)
        if not cv2.imwrite(str(picture), calibration.picture):
            raise CommandError(f"cannot write {picture}")
    except (CalibrationError, OSError, SourceError) as error:
        print(file=sys.stderr)
        raise CommandError(str(error)) from error
    print(file=sys.stderr)
    camera = calibration.camera
    if arguments.json:
        focal = float(camera.matrix[0, 0])
        print(
            json.dumps(
                {"views": len(calibration.views), "error": camera.error, "focal_length": focal, "output": str(arguments.output)}
            )
        )
    else:
        print(f"{arguments.output}: {len(calibration.views)} positions, error {camera.error:.2f} pixels; see {picture}")
    return 0
