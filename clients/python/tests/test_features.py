"""Features compared with a row-by-row computation in plain Python."""

import numpy as np
import pytest
from hand_made import HandMade, hand_made

from chefshat.learn import features

DECKS = [(4, 11, 2), (2, 4, 0), (6, 15, 2), (3, 5, 1)]


def plain_table(case: HandMade, row: int, hand_size: int) -> list[float]:
    """Computes `features.table` for one row, as documented."""
    players, faces = case.sizes.players, case.sizes.faces
    around = [(int(case.seats[row]) + step) % players for step in range(players)]
    deck = [*range(1, faces + 1), 2]
    face, size, jokers = (int(number) for number in case.boards[row])
    hand, played = case.hands[row].tolist(), case.played[row].tolist()
    numbers: list[float] = [count / most for count, most in zip(hand, deck, strict=True)]
    numbers += [float(case.golden[row])]
    numbers += [float(face == value) for value in range(faces + 2)]
    numbers += [size / faces, jokers / 2]
    numbers += [case.cards_left[row, seat] / hand_size for seat in around]
    numbers += [float(case.passed[row, seat]) for seat in around]
    numbers += [case.places[row, seat] / players for seat in around]
    numbers += [float(case.roles[row, seat] == role) for seat in around for role in range(6)]
    numbers += [min(int(case.points[row, seat]), 15) / 15 for seat in around]
    numbers += [count / most for count, most in zip(played, deck, strict=True)]
    numbers += [max(most - mine - gone, 0) / most for most, mine, gone in zip(deck, hand, played, strict=True)]
    numbers += [count / 2 for count in case.gave[row]] + [count / 2 for count in case.received[row]]
    numbers += [float(case.kinds[row] == kind) for kind in (1, 2, 3)]
    numbers += [min(int(case.pizzas[row]), 30) / 30]
    return numbers + legal(case, row, features.num_actions(faces))


def plain_classic(case: HandMade, row: int, hand_size: int) -> list[float]:
    """Computes `features.classic` for one row, as documented."""
    faces = case.sizes.faces
    face, size, jokers = (int(number) for number in case.boards[row])
    board = [face] * (size - jokers) + [faces + 1] * jokers if face else [faces + 2]
    hand = [index + 1 for index, count in enumerate(case.hands[row]) for _ in range(count)]
    slots = (board + [0] * faces)[:faces] + [0] * (hand_size - len(hand)) + hand
    return [slot / (faces + 2) for slot in slots] + legal(case, row, features.turn_actions(faces))


def legal(case: HandMade, row: int, count: int) -> list[float]:
    """Returns the first bits of the mask."""
    return [float(case.mask_bits[row, action // 8] >> action % 8 & 1) for action in range(count)]


@pytest.mark.parametrize(("players", "faces", "jokers"), DECKS)
def test_table_has_the_documented_numbers(players: int, faces: int, jokers: int) -> None:
    case = hand_made(40, seed=1, players=players, faces=faces, jokers=jokers)
    size = features.dealt(players, faces, jokers)
    rows = features.table(case, case.seats, case.kinds, case.mask_bits, players=players, faces=faces, hand_size=size)
    assert rows.dtype == np.float32
    assert rows.shape == (40, features.table_width(players, faces))
    np.testing.assert_array_equal(rows, np.array([plain_table(case, row, size) for row in range(40)], np.float32))


@pytest.mark.parametrize(("players", "faces", "jokers"), DECKS)
def test_classic_has_the_documented_numbers(players: int, faces: int, jokers: int) -> None:
    case = hand_made(40, seed=2, players=players, faces=faces, jokers=jokers)
    size = features.dealt(players, faces, jokers)
    rows = features.classic(case, case.mask_bits, faces=faces, hand_size=size)
    assert rows.dtype == np.float32
    np.testing.assert_array_equal(rows, np.array([plain_classic(case, row, size) for row in range(40)], np.float32))


def test_a_play_larger_than_the_board_has_slots_is_cut_off() -> None:
    case = hand_made(1, seed=3)
    boards = np.array([[11, 13, 2]], np.uint8)
    object.__setattr__(case, "boards", boards)
    row = features.classic(case, case.mask_bits, faces=11, hand_size=17)[0]
    np.testing.assert_array_equal(row[:11], np.full(11, 11, np.float32) / np.float32(13))


def test_the_default_widths() -> None:
    assert features.dealt(4, 11, 2) == 17
    assert features.turn_actions(11) == 200
    assert features.num_actions(11) == 214
    assert features.classic_width(11, 17) == 228
    assert features.table_width(4, 11) == 334


def test_a_given_buffer_is_filled_and_no_rows_give_no_features() -> None:
    case = hand_made(5, seed=4)
    buffer = np.full((5, 334), np.nan, np.float32)
    result = features.table(case, case.seats, case.kinds, case.mask_bits, players=4, faces=11, hand_size=17, out=buffer)
    assert result is buffer
    assert np.isfinite(buffer).all()
    none = hand_made(5, seed=4)
    for name in ("pizzas", "hands", "golden", "boards", "cards_left", "passed", "places", "roles", "points"):
        object.__setattr__(none, name, getattr(none, name)[:0])
    for name in ("played", "gave", "received", "seats", "kinds", "mask_bits"):
        object.__setattr__(none, name, getattr(none, name)[:0])
    assert features.table(none, none.seats, none.kinds, none.mask_bits, players=4, faces=11, hand_size=17).shape == (0, 334)
    assert features.classic(none, none.mask_bits, faces=11, hand_size=17).shape == (0, 228)
