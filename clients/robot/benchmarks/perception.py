"""Measures perception on the synthetic table: whole Shifts at three difficulties, against the truth.

    taskset -c 0 python benchmarks/perception.py
    taskset -c 0 python benchmarks/perception.py --shifts 2 --difficulty hard --json

Every happening (cards laid, field cleared, pass card shown or withdrawn) is one of:

- *first*: reported exactly, and without a doubt;
- *asked*: reported exactly, after a doubt about it was answered with the truth;
- *wrong*: missing, or reported otherwise than it was.

A *false* event is one that was reported without a doubt and did not happen like this. *Needless* doubts are about places where
nothing new lies. The latency is the time from the last card at rest to the event, in the frames' own time. Frames per second count
processor time for reading and deciding, on one thread and without painting the frames. *Naive* is how often a reader that believes
each single frame (OpenCV's detector, on frames without a hand over the table) finds a tag of every piece that lies on top.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from chefshat_robot.deck import Card
from chefshat_robot.synthetic import DIFFICULTIES, Difficulty, FrameTruth, Happening, SyntheticTable, acts_of_steps, random_shift
from chefshat_robot.vision import (
    Doubt,
    DoubtResolved,
    FieldChanged,
    Laid,
    Observed,
    PassShown,
    PassWithdrawn,
    Perception,
    TakenBack,
)
from chefshat_robot.vision.frames import Frame

ANSWER_SECONDS = 0.5
"""A doubt is answered so long after it was asked, in s: the synthetic players do not wait for a slow answer."""
NAIVE_EVERY = 15
"""The naive reader looks at one frame of so many."""


@dataclass
class Result:
    """What was counted in some Shifts."""

    happenings: int = 0
    first: int = 0
    asked: int = 0
    wrong: int = 0
    false: int = 0
    doubts: int = 0
    needless: int = 0
    frames: int = 0
    seconds: float = 0.0
    slowest: float = 0.0
    latencies: list[float] = field(default_factory=list)
    naive_frames: int = 0
    naive_right: int = 0
    mistakes: list[str] = field(default_factory=list)

    def add(self, other: Result) -> None:
        """Adds what was counted elsewhere."""
        for name, value in vars(other).items():
            if name == "slowest":
                self.slowest = max(self.slowest, value)
            else:
                setattr(self, name, getattr(self, name) + value)

    def summary(self, fps: float) -> dict[str, Any]:
        """The numbers as a JSON object."""
        latencies = np.array(self.latencies or [0.0])
        count = max(self.happenings, 1)
        return {
            "happenings": self.happenings,
            "first_percent": round(100 * self.first / count, 2),
            "after_asking_percent": round(100 * (self.first + self.asked) / count, 2),
            "wrong": self.wrong,
            "false": self.false,
            "doubts": self.doubts,
            "needless_doubts": self.needless,
            "frames": self.frames,
            "frames_per_second": round(self.frames / self.seconds, 1) if self.seconds else 0.0,
            "slowest_frame_ms": round(self.slowest * 1000, 1),
            "latency_seconds": {
                "median": round(float(np.median(latencies)), 2),
                "p95": round(float(np.percentile(latencies, 95)), 2),
                "p99": round(float(np.percentile(latencies, 99)), 2),
                "max": round(float(latencies.max()), 2),
            },
            "latency_frames_median": round(float(np.median(latencies)) * fps, 1),
            "naive_percent": round(100 * self.naive_right / max(self.naive_frames, 1), 1),
            "mistakes": self.mistakes,
        }


def key(event: Observed | Happening) -> tuple[Any, ...]:
    """What an event or a happening says, comparably."""
    if isinstance(event, Happening):
        cards = tuple(sorted(zip(event.places, event.cards, strict=True))) if event.kind != "cleared" else ()
        return (event.kind, event.seat if event.kind.startswith("pass") else None, cards)
    if isinstance(event, Laid | TakenBack):
        kind = "laid" if isinstance(event, Laid) else "taken_back"
        return (kind, None, tuple(sorted(zip(event.places, event.cards, strict=True))))
    if isinstance(event, PassShown | PassWithdrawn):
        return ("pass_shown" if isinstance(event, PassShown) else "pass_withdrawn", event.seat, ())
    return ("cleared", None, ())


def answer(doubt: Doubt, asked: FrameTruth, known: dict[Card, int]) -> Card | bool:
    """The true answer to a doubt: the card on top that perception does not know yet."""
    if doubt.place.startswith("pass"):
        seat = int(doubt.place.split()[1])
        return any(lying.piece.card is None and lying.place == seat for lying in asked.lying)
    there = [card for lying in asked.lying if (card := lying.piece.card) is not None and lying.place == int(doubt.place)]
    return there[-1] if there and there[-1] not in known else False


def run_shift(seed: int, difficulty: Difficulty, size: tuple[int, int], fps: float, max_frames: int | None = None) -> Result:
    """Plays and watches one Shift."""
    acts = acts_of_steps(random_shift(seed), seed, difficulty.pause, difficulty.hovers)
    table = SyntheticTable(acts, difficulty, seed=seed, size=size, fps=fps)
    perception = Perception(table.camera)
    naive = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    result = Result()
    events: list[tuple[Observed, bool]] = []
    """Each event with whether an answer made it certain."""
    open_doubts: list[tuple[float, Doubt]] = []
    truths: list[FrameTruth] = []
    last = 0.0
    for frame, truth in table.frames():
        if max_frames is not None and frame.index >= max_frames:
            break
        started = time.process_time()
        seen = perception.see(frame)
        took = time.process_time() - started
        result.frames += 1
        result.seconds += took
        result.slowest = max(result.slowest, took if frame.index else 0.0)
        last = truth.time
        truths.append(truth)
        for event in seen:
            if isinstance(event, Doubt):
                result.doubts += 1
                open_doubts.append((frame.time + ANSWER_SECONDS, event))
            elif isinstance(event, DoubtResolved):
                open_doubts = [entry for entry in open_doubts if entry[1].number != event.number]
            else:
                events.append((event, False))
        while open_doubts and open_doubts[0][0] <= frame.time:
            _, doubt = open_doubts.pop(0)
            reading = answer(doubt, truths[round(doubt.seen * fps)], perception.on_table)
            result.needless += reading is False
            events += [(event, True) for event in perception.answer(doubt.number, reading) if not isinstance(event, DoubtResolved)]
        if frame.index % NAIVE_EVERY == 0 and truth.lying and not truth.hands:
            result.naive_frames += 1
            result.naive_right += naive_is_right(naive, frame, truth)
    judge(result, [happening for happening in table.happenings if happening.time < last - 1.0], events, seed)
    return result


def naive_is_right(detector: cv2.aruco.ArucoDetector, frame: Frame, truth: FrameTruth) -> bool:
    """Whether a tag of every piece on top is read in this frame."""
    _, numbers, _ = detector.detectMarkers(frame.image)
    read = Counter([] if numbers is None else np.asarray(numbers).ravel().tolist())
    top = {(lying.piece.kind, lying.place): lying.piece.tag for lying in truth.lying}
    return all(read[tag] >= 1 for tag in top.values())


def judge(result: Result, happenings: list[Happening], events: list[tuple[Observed, bool]], seed: int) -> None:
    """Compares events with what happened."""
    rest = [(event, asked) for event, asked in events if not isinstance(event, FieldChanged)]
    for happening in happenings:
        result.happenings += 1
        found = next((entry for entry in rest if key(entry[0]) == key(happening) and entry[0].time > happening.time - 1.0), None)
        if found is None:
            result.wrong += 1
            result.mistakes.append(f"Shift {seed}, {happening.time:.1f} s: missed {happening}")
            continue
        rest.remove(found)
        event, asked = found
        if asked:
            result.asked += 1
        else:
            result.first += 1
            result.latencies.append(event.time - happening.time)
    late = happenings[-1].time + 0.5 if happenings else 0.0
    for event, asked in rest:
        if event.time <= late:
            result.false += not asked
            result.mistakes.append(f"Shift {seed}, {event.time:.1f} s: false {event}")


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shifts", type=int, default=20, help="Shifts at each difficulty")
    parser.add_argument("--difficulty", choices=list(DIFFICULTIES), action="append", help="only this difficulty; may be repeated")
    parser.add_argument("--first", type=int, default=0, help="seed of the first Shift")
    parser.add_argument("--fps", type=float, default=15.0, help="frames per second of the camera")
    parser.add_argument("--height", type=int, choices=(720, 1080), default=720, help="height of the frames")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    size = (arguments.height * 16 // 9, arguments.height)
    summaries = {}
    for name in arguments.difficulty or DIFFICULTIES:
        total = Result()
        for seed in range(arguments.first, arguments.first + arguments.shifts):
            total.add(run_shift(seed, DIFFICULTIES[name], size, arguments.fps))
            print(f"\r{name}: {seed + 1 - arguments.first} of {arguments.shifts} Shifts", end="", file=sys.stderr, flush=True)
        print(file=sys.stderr)
        assert total.happenings > 20 * arguments.shifts, "a Shift has more happenings than this"
        summaries[name] = total.summary(arguments.fps)
        if not arguments.json:
            print(f"{name}: {json.dumps(summaries[name], indent=2)}")
    if arguments.json:
        print(json.dumps(summaries))
    return 0


if __name__ == "__main__":
    sys.exit(main())
