"""From frames of the synthetic table to events: short Shifts, each disturbance alone, doubts, a moved camera, and recordings."""

from __future__ import annotations

import errno
import io
import json
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import cv2
import numpy as np
import pytest

from chefshat_robot import cli
from chefshat_robot.deck import Card
from chefshat_robot.synthetic import (
    DIFFICULTIES,
    EASY,
    HARD,
    MEDIUM,
    Act,
    Bump,
    Clear,
    Difficulty,
    FrameTruth,
    Hover,
    LayCards,
    ShowPass,
    SyntheticTable,
    TakeBack,
    TrueEvent,
    WithdrawPass,
    acts_of_steps,
    random_shift,
)
from chefshat_robot.vision import (
    Camera,
    Cleared,
    Doubt,
    DoubtResolved,
    FieldChanged,
    FieldState,
    Frame,
    Laid,
    Observed,
    PassShown,
    PassWithdrawn,
    Perception,
    Recorder,
    SourceError,
    TakenBack,
    from_json,
    open_source,
    replay,
    to_json,
)
from chefshat_robot.vision.frames import Wish

ROUND: list[Act] = [
    LayCards(0.6, 0, (Card(0, 65), Card(0, 58)), (1, 2)),
    ShowPass(2.0, 1),
    LayCards(3.2, 2, (Card(0, 20), Card(0, 66)), (1, 2)),
    Clear(5.0, 3),
    WithdrawPass(5.2, 1),
]
"""A short pizza: a play, a pass, a play on top of it, and clearing."""


def said(event: Observed | TrueEvent) -> tuple[Any, ...]:
    """What a reported or a true event says, without its time."""
    match event:
        case TrueEvent(kind="laid" | "taken_back" as kind, cards=cards, places=places):
            return (kind, *sorted(zip(places, cards, strict=True)))
        case TrueEvent(kind="cleared" as kind):
            return (kind,)
        case TrueEvent(kind=kind, seat=seat):
            return (kind, seat)
        case Laid(cards=cards, places=places):
            return ("laid", *sorted(zip(places, cards, strict=True)))
        case TakenBack(cards=cards, places=places):
            return ("taken_back", *sorted(zip(places, cards, strict=True)))
        case Cleared():
            return ("cleared",)
        case PassShown(seat=seat):
            return ("pass_shown", seat)
        case PassWithdrawn(seat=seat):
            return ("pass_withdrawn", seat)
        case _:
            return (type(event).__name__,)


def the_truth(doubt: Doubt, truth: FrameTruth, perception: Perception) -> Card | bool:
    """The true answer to a doubt."""
    if doubt.place.startswith("pass"):
        return any(lying.piece.card is None and f"pass {lying.place}" == doubt.place for lying in truth.lying)
    there = [card for lying in truth.lying if (card := lying.piece.card) is not None and str(lying.place) == doubt.place]
    return there[-1] if there and there[-1] not in perception.on_table else False


def watch(
    table: SyntheticTable,
    perception: Perception | None = None,
    answer: Callable[[Doubt, FrameTruth, Perception], Card | bool] | None = the_truth,
) -> list[Observed]:
    """The events of a table; each doubt is answered at once, unless `answer` is None."""
    perception = perception or Perception(table.camera)
    events: list[Observed] = []
    truths: list[FrameTruth] = []
    for frame, truth in table.frames():
        truths.append(truth)
        seen = perception.see(frame)
        events += seen
        for event in seen:
            if isinstance(event, Doubt) and answer is not None:
                events += perception.answer(event.number, answer(event, truths[round(event.seen * table.fps)], perception))
    return events


def happened(events: Sequence[Observed]) -> list[tuple[Any, ...]]:
    """What events say happened at the table."""
    return [said(event) for event in events if not isinstance(event, FieldChanged | Doubt | DoubtResolved)]


def assert_true(table: SyntheticTable, events: Sequence[Observed]) -> None:
    """The events are what truly happened; withdrawn pass cards may come before or after the clearing beside them.

    From which side cards were laid is right, or not known.
    """
    by_cards = {true_event.cards: true_event.seat for true_event in table.true_events if true_event.kind == "laid"}
    wrong = [event for event in events if isinstance(event, Laid) and event.side not in (None, by_cards.get(event.cards))]
    assert not wrong
    assert sorted(map(str, happened(events))) == sorted(str(said(true_event)) for true_event in table.true_events)
    laid = [event for event in happened(events) if event[0] in ("laid", "cleared")]
    assert laid == [said(true_event) for true_event in table.true_events if true_event.kind in ("laid", "cleared")]


@cache
def first_pizzas(difficulty: Difficulty) -> tuple[SyntheticTable, list[Observed]]:
    """The first pizzas of a Shift, and the events of their table."""
    acts = [act for act in acts_of_steps(random_shift(11), 11, difficulty.pause, difficulty.hovers) if act.start < 18.0]
    table = SyntheticTable(acts, difficulty, seed=11)
    return table, watch(table)


SHORT_RUNS = (EASY, HARD)


@pytest.mark.parametrize(
    "difficulty",
    [pytest.param(it, id=name, marks=[] if it in SHORT_RUNS else pytest.mark.slow) for name, it in DIFFICULTIES.items()],
)
def test_the_first_pizzas_of_a_shift(difficulty: Difficulty) -> None:
    table, events = first_pizzas(difficulty)
    assert len(table.true_events) >= 8
    assert_true(table, events)


def test_most_plays_show_from_which_side_they_were_laid() -> None:
    laid = [event for event in first_pizzas(EASY)[1] if isinstance(event, Laid)]
    assert sum(event.side is not None for event in laid) >= 0.8 * len(laid)


DISTURBANCES: dict[str, Difficulty] = {
    "tilt": replace(EASY, tilt=HARD.tilt),
    "distortion": replace(EASY, distortion=HARD.distortion),
    "blur": replace(EASY, blur=HARD.blur),
    "noise": replace(EASY, noise=HARD.noise),
    "light": replace(EASY, light_change=HARD.light_change, flicker=HARD.flicker, vignette=HARD.vignette),
    "shadows": replace(EASY, shadows=HARD.shadows),
    "glare": replace(EASY, glare=HARD.glare),
    "crooked": replace(EASY, shift=HARD.shift, turn=HARD.turn),
    "upside down": replace(EASY, upside_down=1.0),
    "one tag a card": replace(EASY, smudged=0.3),
}


# All of them at once are in the first pizzas of the hard table.
@pytest.mark.slow
@pytest.mark.parametrize("name", list(DISTURBANCES))
def test_each_disturbance_alone(name: str) -> None:
    table = SyntheticTable(ROUND, DISTURBANCES[name], seed=3)
    assert_true(table, watch(table))


def test_big_frames() -> None:
    table = SyntheticTable(ROUND[:2], MEDIUM, seed=3, size=(1920, 1080))
    assert_true(table, watch(table))


def test_a_camera_that_is_not_calibrated() -> None:
    table = SyntheticTable(ROUND, MEDIUM, seed=3)
    assert_true(table, watch(table, Perception()))


def test_hands_that_pass_over_are_nothing() -> None:
    acts: list[Act] = [
        LayCards(0.6, 0, (Card(0, 65),), (1,)),
        Hover(2.2, 1, 1, 0.6),
        Hover(4.0, 2, 3, 0.8, card=Card(0, 40)),
        Hover(6.0, 3, 1, 0.8, card=Card(0, 41)),
    ]
    table = SyntheticTable(acts, MEDIUM, seed=6)
    assert_true(table, watch(table))


@pytest.mark.parametrize("seat", [1, *(pytest.param(seat, marks=pytest.mark.slow) for seat in (2, 3))])
def test_an_arm_that_rests_over_the_cards_is_nothing(seat: int) -> None:
    acts: list[Act] = [
        LayCards(0.6, 0, (Card(0, 50), Card(0, 51), Card(0, 52)), (1, 2, 3)),
        Hover(2.6, seat, 2, 5.0),
        LayCards(9.2, 1, (Card(0, 20), Card(0, 21), Card(0, 22)), (1, 2, 3)),
        Clear(11.4, 1),
    ]
    table = SyntheticTable(acts, MEDIUM, seed=6)
    assert_true(table, watch(table))


def test_a_card_taken_back() -> None:
    acts: list[Act] = [
        LayCards(0.6, 0, (Card(0, 50), Card(0, 51)), (1, 2)),
        LayCards(2.2, 1, (Card(0, 20), Card(0, 21), Card(0, 22)), (1, 2, 3)),
        TakeBack(4.2, 1, (3,)),
    ]
    table = SyntheticTable(acts, EASY, seed=6)
    assert_true(table, watch(table))


def test_a_sweep_in_three_strokes_clears_the_field() -> None:
    cards = (Card(0, 50), Card(0, 51), Card(0, 52))
    # Between the strokes the hand leaves the field.
    strokes = [TakeBack(2.4 + 1.3 * number, 1, (number + 1,)) for number in range(3)]
    table = SyntheticTable([LayCards(0.6, 0, cards, (1, 2, 3)), *strokes], EASY, seed=8)
    _, laid, cleared = watch(table)
    assert isinstance(laid, Laid)
    assert isinstance(cleared, Cleared)


def test_a_card_that_cannot_be_read_is_asked_about() -> None:
    unreadable = replace(EASY, smudged=1.0)
    table = SyntheticTable([LayCards(0.6, 0, (Card(0, 30),), (4,))], unreadable, seed=7)
    events = watch(table)
    doubt = next(event for event in events if isinstance(event, Doubt))
    assert doubt.place == "4"
    assert doubt.picture is not None
    assert doubt.picture.shape == (112, 87, 3)
    assert happened(events) == [("laid", (4, Card(0, 30)))]
    assert any(isinstance(event, DoubtResolved) and event.number == doubt.number for event in events)


def test_cards_laid_with_an_unreadable_one_wait_for_the_answer() -> None:
    down: list[Act] = [
        LayCards(0.6, 0, (Card(0, 30), Card(0, 31)), (1, 2)),
        LayCards(0.7, 1, (Card(0, 32),), (3,), face_down=True),
    ]
    table = SyntheticTable(down, EASY, seed=7)
    assert happened(watch(table, answer=None)) == []
    assert happened(watch(table)) == [("laid", (1, Card(0, 30)), (2, Card(0, 31)), (3, Card(0, 32)))]
    assert happened(watch(table, answer=lambda *_: False)) == [("laid", (1, Card(0, 30)), (2, Card(0, 31)))]


def test_a_pass_card_that_cannot_be_read_is_asked_about() -> None:
    table = SyntheticTable([ShowPass(0.6, 2), WithdrawPass(3.5, 2)], replace(EASY, smudged=1.0), seed=7)
    events = watch(table)
    assert [event.place for event in events if isinstance(event, Doubt)] == ["pass 2"]
    assert happened(events) == [("pass_shown", 2), ("pass_withdrawn", 2)]


@pytest.mark.parametrize("seat", [*(pytest.param(seat, marks=pytest.mark.slow) for seat in range(3)), 3])
def test_a_pass_card_that_lies_face_down_is_asked_about_at_every_place(seat: int) -> None:
    for difficulty in (EASY, MEDIUM):
        table = SyntheticTable([ShowPass(0.6, seat, face_down=True), WithdrawPass(3.5, seat)], difficulty, seed=7)
        events = watch(table)
        assert [event.place for event in events if isinstance(event, Doubt)] == [f"pass {seat}"]
        assert happened(events) == [("pass_shown", seat), ("pass_withdrawn", seat)]


def begin_in_the_middle(table: SyntheticTable, begin: float) -> list[Observed]:
    """What a perception says that sees only the frames from a time on; each doubt is answered with the truth."""
    perception = Perception(table.camera)
    events: list[Observed] = []
    for frame, truth in table.frames():
        seen = perception.see(frame) if frame.time >= begin else []
        events += seen
        for event in seen:
            if isinstance(event, Doubt):
                events += perception.answer(event.number, the_truth(event, truth, perception))
    return events


@pytest.mark.parametrize(
    ("difficulty", "face_down"),
    [
        (EASY, False),
        (MEDIUM, True),
        pytest.param(EASY, True, marks=pytest.mark.slow),
        pytest.param(MEDIUM, False, marks=pytest.mark.slow),
    ],
)
def test_what_lies_there_when_perception_begins_was_found(difficulty: Difficulty, face_down: bool) -> None:
    acts: list[Act] = [
        LayCards(0.6, 0, (Card(0, 65), Card(0, 58)), (1, 2), face_down),
        ShowPass(2.0, 1),
        Clear(9.0, 3),
        WithdrawPass(9.2, 1),
        LayCards(11.0, 2, (Card(0, 20),), (1,)),
    ]
    events = begin_in_the_middle(SyntheticTable(acts, difficulty, seed=7), 4.0)
    found = [(said(event)[0], event.found) for event in events if isinstance(event, Laid | PassShown)]
    assert set(found[:-1]) == {("laid", True), ("pass_shown", True)}
    assert found[-1] == ("laid", False)
    assert [event.place for event in events if isinstance(event, Doubt)] == ["1", "2"] * face_down
    assert {kind for kind, *_ in happened(events)[-3:-1]} == {"cleared", "pass_withdrawn"}


def test_a_place_that_is_said_to_be_empty_is_known_to_be_so() -> None:
    dirty = [LayCards(0.2, 0, (Card(0, 30),), (4,), face_down=True)]
    table = SyntheticTable(dirty, EASY, seed=7, tail=8.0)
    perception = Perception(table.camera)
    number = 0
    for frame, _ in table.frames():
        if frame.time < 2.0:
            continue
        for event in perception.see(frame):
            assert not (number and isinstance(event, Doubt))
            if isinstance(event, Doubt):
                number = event.number
                perception.answer(number, False)
    assert number
    assert perception.sighting is not None
    assert perception.sighting.places[3].empty


def test_answers_must_fit() -> None:
    table = SyntheticTable([LayCards(0.6, 0, (Card(0, 30),), (4,))], replace(EASY, smudged=1.0), seed=7)
    perception = Perception(table.camera)
    events = watch(table, perception, answer=None)
    number = next(event.number for event in events if isinstance(event, Doubt))
    with pytest.raises(ValueError, match="with a card or False"):
        perception.answer(number, True)
    with pytest.raises(ValueError, match="not open"):
        perception.answer(number + 1, False)
    card = perception.answers(1)[-1]
    assert card.is_joker
    assert happened(perception.answer(number, card)) == [("laid", (4, card))]
    assert perception.on_table == {card: 4}


def test_a_moved_camera_is_noticed_and_reading_resumes() -> None:
    acts: list[Act] = [LayCards(0.6, 0, (Card(0, 65),), (1,)), LayCards(5.0, 1, (Card(0, 30),), (1,)), Clear(7.0, 2)]
    table = SyntheticTable(acts, EASY, seed=8, bumps=[Bump(2.5, (15.0, -8.0), 1.5)])
    events = watch(table)
    assert [event.state for event in events if isinstance(event, FieldChanged)] == [FieldState.FOUND, FieldState.MOVED]
    assert_true(table, events)


def test_a_field_out_of_sight_is_reported() -> None:
    table = SyntheticTable([LayCards(0.6, 0, (Card(0, 65),), (1,))], EASY, seed=8, tail=1.0)
    frames = [frame for frame, _ in table.frames()]

    def covered() -> Iterator[Frame]:
        dark = np.zeros_like(frames[0].image)
        for index, image in enumerate([frame.image for frame in frames] + [dark] * 60 + [frames[-1].image] * 30):
            yield Frame(index, index / 15.0, image)

    events = list(Perception(table.camera).watch(covered()))
    states = [event.state for event in events if isinstance(event, FieldChanged)]
    assert states == [FieldState.FOUND, FieldState.LOST, FieldState.FOUND]
    assert happened(events) == [("laid", (1, Card(0, 65)))]


def test_cards_of_another_deck_are_ignored() -> None:
    acts: list[Act] = [LayCards(0.6, 0, (Card(1, 30),), (4,)), LayCards(0.8, 1, (Card(0, 40),), (1,))]
    table = SyntheticTable(acts, EASY, seed=9)
    events = watch(table, Perception(table.camera, deck=0), answer=lambda *_: False)
    assert happened(events) == [("laid", (1, Card(0, 40)))]


def test_a_recording_gives_the_same_events_again(tmp_path: Path) -> None:
    acts = [*ROUND, LayCards(7.2, 0, (Card(0, 40),), (5,), face_down=True)]
    table = SyntheticTable(acts, MEDIUM, seed=12)
    with Recorder(tmp_path, frames=True) as recorder:
        events = watch(table, Perception(table.camera, recorder=recorder))
    assert any(isinstance(event, Doubt) for event in events)
    assert list(replay(tmp_path)) == events
    lines = (tmp_path / "events.jsonl").read_text().splitlines()
    assert len(lines) == len(events)
    again = list(Perception(table.camera).watch(open_source(str(tmp_path / "frames"))))
    before_doubt = happened(events[: next(i for i, event in enumerate(events) if isinstance(event, Doubt))])
    assert happened(again) == before_doubt
    with pytest.raises(FileExistsError):
        Recorder(tmp_path)


class FullDisk(io.StringIO):
    """A file that cannot be written to."""

    def write(self, text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    def close(self) -> None:
        super().close()
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("lost", ["lines", "frames"])
def test_a_full_disk_ends_the_recording_and_not_what_it_records(
    lost: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    table = SyntheticTable([LayCards(0.6, 1, (Card(0, 40),), (1,))], EASY, seed=9)
    with Recorder(tmp_path, frames=True) as recorder:
        if lost == "lines":
            recorder._sightings.close()
            recorder._sightings = FullDisk()
        else:
            shutil.rmtree(tmp_path / "frames")
        assert happened(watch(table, Perception(table.camera, recorder=recorder))) == [("laid", (1, Card(0, 40)))]
    assert caplog.text.count(f"the recording in {tmp_path} ends here") == 1
    assert (tmp_path / "events.jsonl").read_text() == "", "nothing follows"


def test_a_recording_ends_before_a_line_that_was_not_written_to_its_end(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    table = SyntheticTable([LayCards(0.6, 1, (Card(0, 40),), (1,))], EASY, seed=9)
    with Recorder(tmp_path) as recorder:
        events = happened(watch(table, Perception(table.camera, recorder=recorder)))
    with (tmp_path / "sightings.jsonl").open("a") as file:
        file.write('{"frame":')
    assert happened(list(replay(tmp_path))) == events
    assert "was not written to its end" in caplog.text


def test_a_damaged_recording_is_refused(tmp_path: Path) -> None:
    (tmp_path / "sightings.jsonl").write_text('{"recording":1,"deck":null}\n{"frame":0}\n')
    with pytest.raises(ValueError, match="line 2"):
        list(replay(tmp_path))
    (tmp_path / "sightings.jsonl").write_text('{"recording":99,"deck":null}\n')
    with pytest.raises(ValueError, match="version 99"):
        list(replay(tmp_path))


def test_events_survive_json() -> None:
    events: list[Observed] = [
        Laid(1, 0.1, (Card(0, 3), Card(0, 4)), (1, 2)),
        TakenBack(2, 0.2, (Card(0, 3),), (1,)),
        Cleared(3, 0.3),
        PassShown(4, 0.4, 2),
        PassWithdrawn(5, 0.5, 2),
        Doubt(6, 0.6, 1, "4", 0.5, (Card(0, 5),), np.zeros((2, 2, 3), np.uint8)),
        DoubtResolved(7, 0.7, 1),
        FieldChanged(8, 0.8, FieldState.MOVED),
    ]
    assert [from_json(to_json(event)) for event in events] == events
    with pytest.raises(ValueError, match="not an event"):
        from_json({"event": "dance"})


def test_sources_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(SourceError, match="no pictures"):
        open_source(str(tmp_path))
    with pytest.raises(SourceError, match="no file or folder"):
        open_source(str(tmp_path / "missing.mp4"))
    (tmp_path / "notes.mp4").write_text("hello")
    with pytest.raises(SourceError, match="not a video"):
        open_source(str(tmp_path / "notes.mp4"))


def test_a_video_is_read(tmp_path: Path) -> None:
    path = tmp_path / "video.mp4"
    video = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 10.0, (64, 48))
    for grey in (0, 100, 200):
        video.write(np.full((48, 64, 3), grey, np.uint8))
    video.release()
    frames = list(open_source(str(path)))
    assert [frame.index for frame in frames] == [0, 1, 2]
    assert [round(frame.time, 3) for frame in frames] == [0.0, 0.1, 0.2]
    assert abs(int(frames[2].image.mean()) - 200) < 8


class _Webcam:
    """Stands for a camera that sends 640x480, or compressed 1920x1080."""

    def __init__(self, camera: int | str) -> None:
        self.camera = camera
        self.asked: list[int] = []

    def isOpened(self) -> bool:
        return self.camera != 9

    def set(self, what: int, value: float) -> bool:
        self.asked.append(what)
        return value > 0

    def get(self, what: int) -> float:
        large = self.asked[0] == cv2.CAP_PROP_FOURCC
        sizes = {cv2.CAP_PROP_FRAME_WIDTH: (640, 1920), cv2.CAP_PROP_FRAME_HEIGHT: (480, 1080)}
        return sizes[what][large]

    def read(self) -> tuple[bool, np.ndarray | None]:
        return False, None

    def release(self) -> None:
        self.camera = 9


def test_a_camera_is_asked_for_what_is_needed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "VideoCapture", _Webcam)
    with pytest.raises(SourceError, match="camera 9 does not open"):
        open_source("9")
    with pytest.raises(SourceError, match="sends 640x480, not 1920x1080; give a size that it has, or try --mjpg"):
        open_source("0", Wish(size=(1920, 1080)))
    for source in ("0", os.devnull):  # A number, and a device.
        frames = open_source(source, Wish(size=(1920, 1080), mjpg=True))
        with pytest.raises(SourceError, match=f"camera {source} sends no more pictures"):
            next(frames)


def test_a_camera_in_the_network_is_read() -> None:
    picture = cv2.imencode(".jpg", np.full((48, 64, 3), 200, np.uint8))[1].tobytes()

    class Camera(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
            self.end_headers()
            for _ in range(12):
                self.wfile.write(b"--frame\r\nContent-Type: image/jpeg\r\n\r\n" + picture + b"\r\n")

        def log_message(self, format: str, *values: object) -> None:
            """Prints nothing."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Camera) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        address = f"http://127.0.0.1:{server.server_port}/video.mjpg"
        frames = open_source(address)
        seen = [next(frames) for _ in range(5)]
        with pytest.raises(SourceError, match="sends no more pictures"):
            for _ in frames:
                pass
        server.shutdown()
    assert [frame.index for frame in seen] == [0, 1, 2, 3, 4]
    assert all(frame.image.shape == (48, 64, 3) and abs(int(frame.image.mean()) - 200) < 8 for frame in seen)
    with pytest.raises(SourceError, match="no camera answers"):
        open_source(address)


def test_the_commands_show_record_and_repeat_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    evening, recording = tmp_path / "evening", tmp_path / "recording"
    assert cli.main(["table", str(evening), "--difficulty", "easy", "--seed", "2", "--seconds", "4"]) == 0
    camera = ["--camera", str(evening / "camera.json")]
    assert f"perceive {evening / 'video.mp4'}" in capsys.readouterr().out
    assert cli.main(["perceive", str(evening / "video.mp4"), *camera, "--record", str(recording), "--json"]) == 0
    seen = capsys.readouterr().out
    assert cli.main(["perceive", "--replay", str(recording), "--json"]) == 0
    assert capsys.readouterr().out == seen
    events = happened([from_json(json.loads(line)) for line in seen.splitlines()])
    truth = [json.loads(line) for line in (evening / "events.jsonl").read_text().splitlines()]
    assert events
    assert [event[0] for event in events] == [true_event["kind"] for true_event in truth][: len(events)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bridge", "{}", "--ticket", "T", "--camera", "{}/none.json"], "none.json: give a camera's calibration"),
        (["bridge", "{}", "--ticket", "T", "--record", "{}/0.png"], "0.png"),
        (["perceive", "{}", "--camera", "{}/none.json"], "none.json: give a camera's calibration"),
        (["perceive", "--replay", "{}"], "sightings.jsonl: give a recording"),
    ],
)
def test_files_that_cannot_be_read_or_written_are_named(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cv2.imwrite(str(tmp_path / "0.png"), np.zeros((8, 8, 3), np.uint8))
    assert cli.main([word.format(tmp_path) for word in arguments]) == 1
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("command", [["bridge", "--ticket", "T"], ["perceive"]])
def test_a_source_that_cannot_be_opened_leaves_no_recording(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*command, str(tmp_path / "no.mp4"), "--record", str(tmp_path / "recording")]) == 1
    assert "no.mp4" in capsys.readouterr().err
    assert not (tmp_path / "recording").exists()


def test_a_full_disk_ends_a_command_with_its_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(camera: Camera, path: Path) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Camera, "save", full)
    assert cli.main(["table", str(tmp_path / "evening"), "--seconds", "1"]) == 1
    assert capsys.readouterr().err == "chefshat-robot: [Errno 28] No space left on device\n"


def test_the_command_says_that_it_never_found_the_field(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    frames = tmp_path / "frames"
    frames.mkdir()
    for index in range(100):
        cv2.imwrite(str(frames / f"{index:05}.jpg"), np.full((480, 640, 3), 90, np.uint8))
    assert cli.main(["perceive", str(frames)]) != 0
    seen = capsys.readouterr()
    assert seen.out == ""
    # While it watches, and at the end.
    assert seen.err.count("the field is not found: show the camera all of it") == 2


def test_the_command_leaves_out_what_nobody_can_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stained = LayCards(1.0, 0, (Card(0, 20),), (1,), face_down=True)
    later = ShowPass(8.5, 1)
    table = SyntheticTable([stained, later], DIFFICULTIES["easy"], seed=2)
    frames = tmp_path / "frames"
    frames.mkdir()
    for frame, _ in table.frames():
        cv2.imwrite(str(frames / f"{frame.index:05}.jpg"), frame.image)
    assert cli.main(["perceive", str(frames), "--json"]) == 0
    seen = capsys.readouterr()
    kinds = [json.loads(line)["event"] for line in seen.out.splitlines()]
    assert kinds == ["field_changed", "doubt", "doubt_resolved", "pass_shown"]
    assert "doubt 1 is left out" in seen.err
