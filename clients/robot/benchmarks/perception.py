"""Measures perception on the synthetic table: whole Shifts at three difficulties, against the truth.

    taskset -c 0 python benchmarks/perception.py
    taskset -c 0 python benchmarks/perception.py --shifts 2 --difficulty hard --json

Every true event (cards laid, field cleared, pass card shown or withdrawn) is one of:

- *first*: reported exactly, and without a doubt about it;
- *asked*: reported exactly, after a doubt about it was answered with the truth;
- *wrong*: missing, out of order, or reported otherwise than it was.

Some of the first are *held*: they wait for the answer about another event, because events keep their order. A *false* event is
one that was reported without a doubt about it and did not happen like this. *Needless* doubts are about places where nothing new
lies. An *unreadable* event is one with a piece both of whose tags are stained: only asking can get it right. The latency is the
time from the last card at rest to the event, in the frames' own time, of the first that were not held. Frames per second count
processor time for reading and deciding, on one thread and without painting the frames.

The naive reader believes each single frame: OpenCV's detector, on one frame in 15, and only on those without a hand over the table.
*Naive* is how often it finds a tag of every piece that lies on top.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from chefshat_robot.deck import Card
from chefshat_robot.synthetic import (
    DIFFICULTIES,
    Difficulty,
    FrameTruth,
    Lying,
    SyntheticTable,
    TrueEvent,
    acts_of_steps,
    random_shift,
)
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
LATE_SECONDS = 0.7
"""Events that come later than this after what they report are listed."""
NAIVE_EVERY = 15
"""The naive reader looks at one frame of so many."""


@dataclass
class Result:
    """What was counted in some Shifts."""

    true_events: int = 0
    first: int = 0
    held: int = 0
    asked: int = 0
    unreadable: int = 0
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
        count = max(self.true_events, 1)
        return {
            "events": self.true_events,
            "first_percent": round(100 * self.first / count, 2),
            "held_percent": round(100 * self.held / count, 2),
            "unreadable_percent": round(100 * self.unreadable / count, 2),
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


@dataclass
class Report:
    """An event, and what was asked about it.

    Attributes:
        event: The event.
        asked: Whether it was completed by the answer to a doubt about it.
    """

    event: Observed
    asked: bool


def key(event: Observed | TrueEvent) -> tuple[Any, ...]:
    """What a reported or a true event says, comparably."""
    if isinstance(event, TrueEvent):
        cards = tuple(sorted(zip(event.places, event.cards, strict=True))) if event.kind != "cleared" else ()
        return (event.kind, event.seat if event.kind.startswith("pass") else None, cards)
    if isinstance(event, Laid | TakenBack):
        kind = "laid" if isinstance(event, Laid) else "taken_back"
        return (kind, None, tuple(sorted(zip(event.places, event.cards, strict=True))))
    if isinstance(event, PassShown | PassWithdrawn):
        return ("pass_shown" if isinstance(event, PassShown) else "pass_withdrawn", event.seat, ())
    return ("cleared", None, ())


def there(place: str, truth: FrameTruth) -> list[Lying]:
    """What lies at a place, the lowest first."""
    return [lying for lying in truth.lying if place == (f"pass {lying.place}" if lying.piece.card is None else str(lying.place))]


def answer(doubt: Doubt, truth: FrameTruth, known: dict[Card, int]) -> Card | bool:
    """The true answer to a doubt: whether a pass card lies there, or the card on top if perception does not know it yet."""
    pieces = there(doubt.place, truth)
    card = pieces[-1].piece.card if pieces else None
    if doubt.place.startswith("pass"):
        return bool(pieces)
    return card if card is not None and card not in known else False


def is_about(event: Observed, doubt: Doubt, reading: Card | bool) -> bool:
    """Whether an event says what the answer to a doubt said."""
    if isinstance(event, Laid):
        return reading in event.cards
    if isinstance(event, PassShown | PassWithdrawn):
        return doubt.place == f"pass {event.seat}" and isinstance(event, PassShown) == reading
    return False


def is_unreadable(true_event: TrueEvent, truth: FrameTruth) -> bool:
    """Whether a true event shows a piece without a tag that can be read; `truth` is that of the first frame after it."""
    if true_event.kind == "pass_shown":
        return any(all(lying.smudged) for lying in there(f"pass {true_event.seat}", truth))
    return true_event.kind == "laid" and any(all(lying.smudged) for lying in truth.lying if lying.piece.card in true_event.cards)


def run_shift(seed: int, difficulty: Difficulty, size: tuple[int, int], fps: float) -> Result:
    """Plays and watches one Shift."""
    acts = acts_of_steps(random_shift(seed), seed, difficulty.pause, difficulty.hovers)
    table = SyntheticTable(acts, difficulty, seed=seed, size=size, fps=fps)
    perception = Perception(table.camera)
    naive = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    result = Result()
    reports: list[Report] = []
    asking: list[tuple[float, Doubt]] = []
    """The open doubts, and when they are answered."""
    answered: list[tuple[Doubt, Card | bool]] = []
    spans: list[tuple[float, float]] = []
    """From when to when events had to wait for a doubt."""
    truths: list[FrameTruth] = []

    def begin(doubt: Doubt) -> float:
        return max((lying.since for lying in there(doubt.place, truths[round(doubt.seen * fps)])), default=doubt.seen)

    def take(events: list[Observed]) -> None:
        for event in events:
            if isinstance(event, Doubt):
                result.doubts += 1
                asking.append((event.time + ANSWER_SECONDS, event))
            elif isinstance(event, DoubtResolved):
                spans.extend((begin(doubt), event.time) for _, doubt in asking if doubt.number == event.number)
                asking[:] = [(due, doubt) for due, doubt in asking if doubt.number != event.number]
            elif not isinstance(event, FieldChanged):
                reports.append(Report(event, any(is_about(event, *entry) for entry in answered)))
                answered[:] = [entry for entry in answered if not is_about(event, *entry)]

    for frame, truth in table.frames():
        started = time.process_time()
        seen = perception.see(frame)
        took = time.process_time() - started
        result.frames += 1
        result.seconds += took
        result.slowest = max(result.slowest, took if frame.index else 0.0)
        truths.append(truth)
        take(seen)
        while asking and asking[0][0] <= frame.time:
            doubt = asking[0][1]
            reading = answer(doubt, truths[round(doubt.seen * fps)], perception.on_table)
            result.needless += reading is False
            answered.append((doubt, reading))
            take(perception.answer(doubt.number, reading))
        if frame.index % NAIVE_EVERY == 0 and truth.lying and not truth.hands:
            result.naive_frames += 1
            result.naive_right += naive_is_right(naive, frame, truth)
    result.unreadable = sum(is_unreadable(true_event, truths[math.ceil(true_event.time * fps)]) for true_event in table.true_events)
    judge(result, table.true_events, reports, spans, seed)
    return result


def naive_is_right(detector: cv2.aruco.ArucoDetector, frame: Frame, truth: FrameTruth) -> bool:
    """Whether a tag of every piece on top is read in this frame."""
    _, numbers, _ = detector.detectMarkers(frame.image)
    read = set() if numbers is None else set(np.asarray(numbers).ravel().tolist())
    top = {(lying.piece.kind, lying.place): lying.piece.tag for lying in truth.lying}
    return read.issuperset(top.values())


def judge(result: Result, true_events: list[TrueEvent], reports: list[Report], spans: list[tuple[float, float]], seed: int) -> None:
    """Compares events with what happened; `spans` says from when to when events had to wait for a doubt."""
    rest = list(reports)
    latest: Counter[str] = Counter()
    for true_event in true_events:
        result.true_events += 1
        exact = [report for report in rest if key(report.event) == key(true_event) and report.event.time > true_event.time - 1.0]
        # Pass cards are taken back while the field is being cleared, in any order.
        orders = [] if true_event.kind == "pass_withdrawn" else ["play"]
        orders += [f"seat {true_event.seat}"] if true_event.kind.startswith("pass") else []
        if not exact or any(reports.index(exact[0]) < latest[order] for order in orders):
            result.wrong += 1
            result.mistakes.append(f"Shift {seed}, {true_event.time:.1f} s: missed {true_event}")
            continue
        latest.update({order: reports.index(exact[0]) - latest[order] for order in orders})
        rest.remove(exact[0])
        event = exact[0].event
        if exact[0].asked:
            result.asked += 1
            continue
        result.first += 1
        if any(begin < event.time and true_event.time < end for begin, end in spans):
            result.held += 1
        else:
            result.latencies.append(event.time - true_event.time)
            if event.time - true_event.time > LATE_SECONDS:
                result.mistakes.append(f"Shift {seed}, {true_event.time:.1f} s: {event.time - true_event.time:.2f} s late {event}")
    for report in rest:
        result.false += not report.asked
        result.mistakes.append(f"Shift {seed}, {report.event.time:.1f} s: false {report.event}")


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
        assert total.true_events > 20 * arguments.shifts, "a Shift has more events than this"
        summaries[name] = total.summary(arguments.fps)
        if not arguments.json:
            print(f"{name}: {json.dumps(summaries[name], indent=2)}")
    if arguments.json:
        print(json.dumps(summaries))
    return 0


if __name__ == "__main__":
    sys.exit(main())
