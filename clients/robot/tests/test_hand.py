"""The second camera: a robot's own hand of cards before its strip, read from synthetic frames."""

from __future__ import annotations

import gc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from chefshat_robot.deck import Card
from chefshat_robot.synthetic.sheets import hand_frames
from chefshat_robot.vision import Camera, Frame
from chefshat_robot.vision.hand import HAND_FRAMES, HandReader, HandSeen
from chefshat_robot.vision.tags import TagReader

CAMERA = Camera(
    960,
    540,
    np.array([[825.0, 0.0, 480.0], [0.0, 825.0, 270.0], [0.0, 0.0, 1.0]]),
    np.array([-0.1, 0.02, 0.0, 0.0, 0.0]),
)
FULL = [Card(0, index) for index in (0, 2, 5, 9, 12, 20, 21, 30, 33, 41, 44, 50, 58, 60, 65, 66, 67)]
"""Seventeen cards: as many as the strip holds."""


def hands_seen(reader: HandReader, hands: list[list[Card]], frames_each: int = HAND_FRAMES) -> list[HandSeen]:
    """What a reader reports of hands shown one after the other."""
    seen = [reader.see(frame) for frame, _ in hand_frames(CAMERA, hands, frames_each, seed=1)]
    return [hand for hand in seen if hand is not None]


def test_each_hand_is_reported_once_and_exactly() -> None:
    played = [card for card in FULL if card.face != 11]
    hands = hands_seen(HandReader(CAMERA), [FULL, played], HAND_FRAMES + 1)
    assert [list(hand.cards) for hand in hands] == [FULL, played]
    assert [hand.frame for hand in hands] == [number * (HAND_FRAMES + 1) + HAND_FRAMES - 1 for number in range(2)]


def test_a_hand_shown_too_shortly_is_not_reported() -> None:
    assert hands_seen(HandReader(CAMERA), [FULL[:5]], HAND_FRAMES - 1) == []


def test_cards_of_other_decks_are_not_of_the_hand() -> None:
    mixed = [Card(0, 12), Card(3, 12), Card(0, 13)]
    hands = hands_seen(HandReader(CAMERA, deck=0), [mixed])
    assert [list(hand.cards) for hand in hands] == [[Card(0, 12), Card(0, 13)]]


def test_nothing_is_reported_while_the_strip_is_hidden() -> None:
    reader = HandReader(CAMERA)
    (frame, _), *_ = hand_frames(CAMERA, [FULL[:4]], 1, seed=1)
    hidden = frame.image.copy()
    hidden[:, :300] = 80
    assert [reader.see(Frame(index, index / 15.0, hidden)) for index in range(2 * HAND_FRAMES)] == [None] * 2 * HAND_FRAMES


def test_frames_of_other_proportions_are_refused() -> None:
    (frame, _), *_ = hand_frames(CAMERA, [FULL[:4]], 1, seed=1)
    with pytest.raises(ValueError, match="calibrate again"):
        HandReader(CAMERA).see(Frame(0, 0.0, np.ascontiguousarray(frame.image[:, 100:])))


def test_two_cameras_are_read_at_the_same_time() -> None:
    # One detector in two threads corrupts the memory of the process.
    seen = [frame for frame, _ in hand_frames(CAMERA, [FULL], HAND_FRAMES, seed=1)]

    def hands() -> list[list[Card]]:
        reader = HandReader(CAMERA)
        return [list(hand.cards) for frame in seen if (hand := reader.see(frame)) is not None]

    with ThreadPoolExecutor(2) as threads:
        both = [threads.submit(hands) for _ in range(2)]
        assert [each.result() for each in both] == [[FULL]] * 2


def test_a_detector_has_one_reader_at_a_time() -> None:
    first, second = TagReader(70.0), TagReader(70.0)
    detectors = {first._detector, first._fine_detector, second._detector, second._fine_detector}
    assert len(detectors) == 4
    del second
    gc.collect()
    third = TagReader(70.0)
    assert third._detector in detectors
    assert third._detector is not first._detector
