"""`chefshat-robot table`: writes a video of a synthetic table, with the truth."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2

from chefshat_robot.cli import CommandError

from .difficulty import DIFFICULTIES
from .script import acts_of_steps, random_shift, shifts_of_record
from .table import SyntheticTable

_DESCRIPTION = """\
Write a video of a Shift at a synthetic table, as a camera above it would see it, and the truth:
  video.mp4          the frames (or frames/*.png with --pictures, without loss)
  events.jsonl       what happens: cards laid, pass cards shown and withdrawn, the field cleared
  truth.jsonl        for each frame what lies where
  camera.json        the camera's calibration, for `chefshat-robot perceive --camera`

A minute of video takes about 10 MB if easy, 200 MB if hard, because of the noise.

Examples:
  chefshat-robot table evening/ --difficulty medium --seed 7
  chefshat-robot table evening/ --record records/GAME-ID.jsonl --shift 2
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the arguments of `table`."""
    parser.description = _DESCRIPTION
    parser.add_argument("output", type=Path, metavar="DIR", help="folder to write to; it must not exist")
    parser.add_argument("--difficulty", choices=list(DIFFICULTIES), default="medium", help="default: medium")
    parser.add_argument("--seed", type=int, default=0, help="seed of the Shift and of all disturbances; default: 0")
    parser.add_argument("--record", type=Path, metavar="FILE", help="show a Shift of this recorded game instead of a random one")
    parser.add_argument("--shift", type=int, default=1, help="which Shift of the record, from 1; default: 1")
    parser.add_argument("--height", type=int, choices=(720, 1080), default=720, help="height of the frames; default: 720")
    parser.add_argument("--fps", type=float, default=15.0, help="frames per second; default: 15")
    parser.add_argument("--seconds", type=float, help="end after this time")
    parser.add_argument("--pictures", action="store_true", help="write PNG pictures instead of a video")


def run(arguments: argparse.Namespace) -> int:
    """Runs `table`."""
    if arguments.seconds is not None and arguments.seconds <= 0:
        raise CommandError("--seconds: give a time above 0")
    difficulty = DIFFICULTIES[arguments.difficulty]
    steps = random_shift(arguments.seed)
    try:
        if arguments.record is not None:
            shifts = shifts_of_record(arguments.record)
            if not 1 <= arguments.shift <= len(shifts):
                raise CommandError(f"{arguments.record} has {len(shifts)} Shifts; give --shift 1..{len(shifts)}")
            steps = shifts[arguments.shift - 1]
        (arguments.output / "frames" if arguments.pictures else arguments.output).mkdir(parents=True)
    except FileExistsError as error:
        raise CommandError(f"{arguments.output} exists; give a new folder") from error
    except ValueError as error:
        raise CommandError(str(error)) from error
    size = (arguments.height * 16 // 9, arguments.height)
    acts = acts_of_steps(steps, arguments.seed, difficulty.pause, difficulty.hovers)
    table = SyntheticTable(acts, difficulty, seed=arguments.seed, size=size, fps=arguments.fps)
    table.camera.save(arguments.output / "camera.json")
    end = min(table.duration, arguments.seconds) if arguments.seconds is not None else table.duration
    _write_lines(
        arguments.output / "events.jsonl", (asdict(true_event) for true_event in table.true_events if true_event.time < end)
    )
    _write_frames(table, arguments.output, end, arguments.pictures)
    source = arguments.output / ("frames" if arguments.pictures else "video.mp4")
    print(f"Read it with: chefshat-robot perceive {source} --camera {arguments.output / 'camera.json'}")
    return 0


def _write_frames(table: SyntheticTable, output: Path, end: float, pictures: bool) -> None:
    """Writes the frames and the truth of each."""
    video = None if pictures else cv2.VideoWriter(str(output / "video.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), table.fps, table.size)
    with (output / "truth.jsonl").open("w", encoding="utf-8") as file:
        for frame, truth in table.frames():
            if frame.time >= end:
                break
            if video is not None:
                video.write(frame.image)
            else:
                cv2.imwrite(str(output / "frames" / f"{frame.index:08}.png"), frame.image)
            lying = [{**asdict(piece), "piece": {**asdict(piece.piece), "kind": piece.piece.kind.value}} for piece in truth.lying]
            file.write(json.dumps({"frame": truth.index, "time": truth.time, "hands": truth.hands, "lying": lying}) + "\n")
            if frame.index % 15 == 0 and sys.stderr.isatty():
                print(f"\r{frame.time:.0f} of {end:.0f} s", end="", file=sys.stderr, flush=True)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    if video is not None:
        video.release()


def _write_lines(path: Path, lines: Iterable[dict[str, Any]]) -> None:
    """Writes JSON Lines."""
    path.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")
