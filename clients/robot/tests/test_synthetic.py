"""The synthetic table: legal Shifts, frames that repeat, and a truth that fits them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from chefshat_robot import deck, field
from chefshat_robot.synthetic import (
    EASY,
    HARD,
    Act,
    Clear,
    LayCards,
    ShowPass,
    SyntheticTable,
    WithdrawPass,
    random_shift,
    shifts_of_record,
)
from chefshat_robot.synthetic.script import Pass, PizzaDone, Play

RECORDS = Path(__file__).parents[3] / "tests" / "fixtures" / "records"


@pytest.mark.parametrize("seed", range(20))
def test_random_shifts_are_legal(seed: int) -> None:
    steps = random_shift(seed)
    played: Counter[int] = Counter()
    board: tuple[deck.Card, ...] = ()
    first = steps[0]
    assert isinstance(first, Play)
    assert any(card.is_golden for card in first.cards)
    for step in steps:
        if isinstance(step, PizzaDone):
            board = ()
        elif isinstance(step, Play):
            faces = {card.face for card in step.cards if not card.is_joker} or {12}
            assert len(faces) == 1
            if board:
                assert min(faces) < min(card.face for card in board)
                assert len(step.cards) >= len(board)
            assert len(step.cards) == 1 or faces != {12}
            board = step.cards
            played[step.seat] += len(step.cards)
    cards = [card for step in steps if isinstance(step, Play) for card in step.cards]
    assert len(cards) == len(set(cards))
    assert sorted(played.values())[1:] == [17, 17, 17]


def test_a_record_becomes_steps() -> None:
    shifts = shifts_of_record(RECORDS / "fixed.jsonl")
    assert len(shifts) == 2
    first = shifts[0]
    assert isinstance(first[0], Play)
    assert first[0].seat == 2
    assert [card.face for card in first[0].cards] == [11, 11, 11]
    assert first[0].cards[0].is_golden
    assert any(isinstance(step, Pass) for step in first)
    cards = [card for step in first if isinstance(step, Play) for card in step.cards]
    assert len(cards) == len(set(cards))


def test_what_is_no_record_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "notes.jsonl"
    path.write_text("hello\n")
    with pytest.raises(ValueError, match="line 1"):
        shifts_of_record(path)


def test_frames_repeat_with_the_seed() -> None:
    acts = [LayCards(0.0, 0, (deck.Card(0, 20),), (1,))]
    first, again, other = (
        [frame.image for frame, _ in SyntheticTable(acts, HARD, seed=seed, size=(640, 360), tail=0.1).frames()]
        for seed in (1, 1, 2)
    )
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[-1], other[-1])


def test_the_truth_is_what_lies_there() -> None:
    cards = (deck.Card(0, 30), deck.Card(0, 31))
    acts: list[Act] = [LayCards(0.2, 1, cards, (1, 2)), ShowPass(1.4, 3), Clear(2.5, 0), WithdrawPass(4.2, 3)]
    table = SyntheticTable(acts, EASY, seed=4)
    assert [true_event.kind for true_event in table.true_events] == ["laid", "pass_shown", "cleared", "pass_withdrawn"]
    truths = [truth for _, truth in table.frames()]
    laid = truths[int(1.3 * table.fps)].lying
    assert [lying.piece.card for lying in laid] == list(cards)
    for lying, place in zip(laid, field.places(), strict=False):
        assert abs(lying.x - place.x) < 10
        assert abs(lying.y - place.y) < 10
    assert truths[int(0.3 * table.fps)].hands == 1
    assert truths[-1].lying == ()


def test_tags_on_the_table_are_read_where_they_lie() -> None:
    acts = [LayCards(0.0, 2, (deck.Card(0, 65), deck.Card(0, 3)), (1, 9))]
    frame = [frame for frame, _ in SyntheticTable(acts, EASY, seed=5).frames()][-1]
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    _, numbers, _ = detector.detectMarkers(frame.image)
    assert Counter(numbers.ravel().tolist()) == {65: 2, 3: 2, **{deck.FIELD_TAGS + corner: 1 for corner in range(4)}}


def test_bigger_frames_show_the_same_table() -> None:
    acts = [LayCards(0.0, 2, (deck.Card(0, 65),), (1,))]
    table = SyntheticTable(acts, EASY, seed=5, size=(1920, 1080), tail=0.2)
    frame, _ = next(table.frames())
    assert frame.image.shape == (1080, 1920, 3)
    detector = cv2.aruco.ArucoDetector(cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11))
    assert len(detector.detectMarkers(frame.image)[1]) == 4
