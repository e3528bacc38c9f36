"""Sampling from masks: legal actions only, with equal probabilities, for decks of every size."""

import numpy as np
import pytest

from chefshat.masks import is_legal, sample_legal, unpack

# Actions of decks of 4, 11 and 15 faces, and widths at the edges of words and bytes.
WIDTHS = (39, 64, 65, 128, 214, 380)


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("share", [0.0, 0.05, 0.5, 1.0])
def test_only_legal_actions_are_drawn(width: int, share: float) -> None:
    rng = np.random.default_rng(1)
    masks = rng.random((500, width)) < share
    # Rows with one legal action, at every position in turn.
    masks[np.arange(500), np.arange(500) % width] = True
    bits = np.packbits(masks, axis=1, bitorder="little")
    assert (unpack(bits, width) == masks).all()
    actions = sample_legal(bits, rng)
    assert actions.dtype == np.uint16
    assert actions.shape == (500,)
    assert masks[np.arange(500), actions].all()
    assert is_legal(bits, actions).all()
    if share == 0.0:
        assert (actions == np.arange(500) % width).all()


def test_all_legal_actions_are_equally_likely() -> None:
    legal = [0, 7, 8, 62, 63, 64, 127, 128, 191, 199, 213]
    mask = np.zeros(214, np.bool_)
    mask[legal] = True
    rows = 110_000
    bits = np.tile(np.packbits(mask, bitorder="little"), (rows, 1))
    drawn, counts = np.unique(sample_legal(bits, np.random.default_rng(2)), return_counts=True)
    assert drawn.tolist() == legal
    # Each is drawn 10,000 times on average, with a standard deviation of 95; the bound is five of these.
    assert np.abs(counts - rows / len(legal)).max() < 480


def test_the_same_seed_draws_the_same() -> None:
    bits = np.random.default_rng(3).integers(1, 256, (100, 27), np.uint8)
    first, second = (sample_legal(bits, np.random.default_rng(4)) for _ in range(2))
    assert first.tolist() == second.tolist()
    assert first.tolist() != sample_legal(bits, np.random.default_rng(5)).tolist()


def test_illegal_actions_are_detected() -> None:
    masks = np.zeros((2, 20), np.bool_)
    masks[0, 9] = masks[1, 19] = True
    bits = np.packbits(masks, axis=1, bitorder="little")
    assert is_legal(bits, np.array([9, 9])).tolist() == [True, False]
    assert is_legal(bits, np.array([8, 19])).tolist() == [False, True]


def test_rows_without_a_legal_action_are_named() -> None:
    bits = np.array([[1], [0], [4]], np.uint8)
    with pytest.raises(ValueError, match="row 1 has no legal action"):
        sample_legal(bits, np.random.default_rng(0))
    assert len(sample_legal(bits[:0], np.random.default_rng(0))) == 0
