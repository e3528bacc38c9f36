"""Views of a decision request, compared with values computed by hand."""

from typing import Any

import numpy as np
import pytest

from chefshat import Decision, SeatInfo, pb

F, H, T = 11, 17, 200
#                 1  2  3  4  5  6  7  8  9 10 11  J
HAND = bytes([0, 1, 0, 2, 0, 0, 0, 0, 0, 0, 3, 1])


def decision(hand: bytes = HAND, legal: tuple[int, ...] = (0, 8, 199, 213), dealt: int = H, **board: Any) -> Decision:
    size = 3 * (len(hand) - 1) * len(hand) // 2 + len(hand) - 1 + 5
    mask = np.zeros(-(-size // 8), np.uint8)
    for action in legal:
        mask[action // 8] |= 1 << (action % 8)
    observation = pb.Observation(
        shift=2,
        pizza=3,
        hand=hand,
        golden=True,
        cards_left=bytes([7, 5, 0, 17]),
        passed=bytes([0, 1, 0, 0]),
        places=bytes([0, 0, 1, 0]),
        roles=bytes([1, 2, 4, 5]),
        points=[5, 3, 1, 300],
        played=bytes([1, 2, 3, 0, 0, 0, 0, 0, 0, 0, 4, 1]),
        received=bytes([1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]),
        **board,
    )
    request = pb.DecisionRequest(
        decision_id=9,
        kind=pb.DECISION_KIND_TURN,
        observation=observation,
        action_mask=mask.tobytes(),
        time_left_ms=9_000,
        bank_left_ms=60_000,
    )
    info = SeatInfo("room", "game", 2)
    if dealt:
        info.game_started = pb.GameStarted(hand_size=dealt)
    return Decision(request, info)


def test_views_show_the_message() -> None:
    view = decision(board_face=4, board_size=3, board_jokers=1, board_owner=0)
    assert view.hand.tolist() == list(HAND)
    assert view.hand.dtype == np.uint8
    assert view.played.tolist() == [1, 2, 3, 0, 0, 0, 0, 0, 0, 0, 4, 1]
    assert view.cards_left.tolist() == [7, 5, 0, 17]
    assert view.passed.tolist() == [0, 1, 0, 0]
    assert view.places.tolist() == [0, 0, 1, 0]
    assert view.roles.tolist() == [pb.ROLE_CHEF, pb.ROLE_SOUS_CHEF, pb.ROLE_WAITER, pb.ROLE_DISHWASHER]
    assert view.points.tolist() == [5, 3, 1, 300]
    assert view.gave.tolist() == []
    assert view.received.tolist() == [1, 1, *[0] * 10]
    assert (view.board_face, view.board_size, view.board_jokers, view.board_owner) == (4, 3, 1, 0)
    assert (view.shift, view.pizza, view.golden, view.seat) == (2, 3, True, 2)
    assert (view.decision_id, view.kind, view.time_left_ms, view.bank_left_ms) == (9, pb.DECISION_KIND_TURN, 9_000, 60_000)
    assert repr(view) == "Decision(seat=2, decision_id=9, kind=TURN)"


def test_a_decision_has_the_requirements_of_the_rules() -> None:
    play = pb.PlayRequirement(lowest_face=1, highest_face=6, fewest_cards=3, may_pass=True)
    turn = Decision(pb.DecisionRequest(play_requirement=play, default_action=199), SeatInfo("", "", 0))
    assert (turn.play_requirement, turn.gift_requirement, turn.default_action) == (play, None, 199)
    gift = pb.GiftRequirement(number=1, total=2, receiver=3)
    exchange = Decision(pb.DecisionRequest(gift_requirement=gift, default_action=210), SeatInfo("", "", 0))
    assert (exchange.play_requirement, exchange.gift_requirement) == (None, gift)
    offer = Decision(pb.DecisionRequest(special_action=pb.SPECIAL_ACTION_FOOD_FIGHT), SeatInfo("", "", 0))
    assert offer.special_action == pb.SPECIAL_ACTION_FOOD_FIGHT


def test_views_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        decision().hand[0] = 1


@pytest.mark.parametrize(("faces", "size", "turn_actions"), [(4, 39, 32), (11, 214, 200), (15, 380, 362)])
def test_the_action_space_follows_from_the_faces(faces: int, size: int, turn_actions: int) -> None:
    view = decision(hand=bytes([1] * (faces + 1)), legal=(0, size - 1))
    assert (view.faces, view.size, view.turn_actions) == (faces, size, turn_actions)
    assert view.mask.shape == (size,)
    assert view.legal_actions.tolist() == [0, size - 1]


def test_the_mask_reads_bits_from_the_lowest() -> None:
    view = decision(legal=(0, 8, 199, 213))
    assert view.mask.dtype == np.bool_
    assert view.mask.sum() == 4
    assert view.legal_actions.tolist() == [0, 8, 199, 213]
    assert view.mask_bytes[0] == 1
    assert view.mask_bytes[1] == 1


def test_attempts_left_may_be_unlimited() -> None:
    view = decision()
    assert view.invalid_attempts_left is None
    view.request.invalid_attempts_left = 10
    assert view.invalid_attempts_left == 10
    assert Decision(view.request, view.seat_info, attempts_left=0).invalid_attempts_left == 0


@pytest.mark.parametrize(
    ("board", "slots"),
    [
        ({}, [13]),
        ({"board_face": 4, "board_size": 3, "board_jokers": 1}, [4, 4, 12]),
        ({"board_face": 12, "board_size": 1, "board_jokers": 1}, [12]),
        # Eleven 11s and two jokers are thirteen cards; the board shows eleven of them.
        ({"board_face": 11, "board_size": 13, "board_jokers": 2}, [11] * 11),
        ({"board_face": 10, "board_size": 12, "board_jokers": 2}, [10] * 10 + [12]),
    ],
)
def test_classic_vector(board: dict[str, Any], slots: list[int]) -> None:
    vector = decision(**board).classic_vector()
    hand = [0] * 10 + [2, 4, 4, 11, 11, 11, 12]
    cards = slots + [0] * (F - len(slots)) + hand
    assert vector.dtype == np.float32
    assert vector.shape == (228,)
    np.testing.assert_array_equal(vector[: F + H], np.array([card / 13 for card in cards], np.float32))
    # Action 213 is not an action of a turn and has no slot.
    assert np.flatnonzero(vector[F + H :]).tolist() == [0, 8, 199]
    assert set(vector[F + H :].tolist()) == {0.0, 1.0}


def test_classic_vector_of_a_full_and_of_an_empty_hand() -> None:
    full = decision(hand=bytes([0, 0, 0, 0, 0, 0, 0, 0, 0, 10, 7, 0])).classic_vector()
    np.testing.assert_array_equal(full[F : F + H], np.array([10] * 10 + [11] * 7, np.float32) / np.float32(13))
    empty = decision(hand=bytes(12)).classic_vector()
    assert not empty[F : F + H].any()


def test_classic_vector_of_another_deck() -> None:
    vector = decision(hand=bytes([1, 0, 0, 1, 0]), legal=(31,), dealt=5).classic_vector()
    np.testing.assert_array_equal(vector[:9], np.array([6, 0, 0, 0, 0, 0, 0, 1, 4], np.float32) / np.float32(6))
    assert vector.shape == (4 + 5 + 32,)
    assert np.flatnonzero(vector[9:]).tolist() == [31]


def test_classic_vector_needs_the_start_of_the_game() -> None:
    with pytest.raises(ValueError, match="start of the game"):
        decision(dealt=0).classic_vector()


def test_annotations_are_stored_for_the_answer() -> None:
    view = decision()
    assert view.annotations is None
    view.annotate(value_estimate=0.5, action_scores=[1.0, 2.0], extra={"why": "because"})
    assert view.annotations == pb.Annotations(value_estimate=0.5, action_scores=[1.0, 2.0], extra={"why": "because"})
