"""The calls to a player of the reference implementation, compared with calls written by hand."""

from typing import Any, TypeAlias

import pytest
from chefshat import pb

from chefshat_paper.players_club.table import ACTIONS, Call, Table

OWN, HIS, HERS, ITS = range(4)
HAND = [1, 2, 3, 4, 4, 5, 6, 7, 8, 9, 10, 10, 11, 11, 11, 12, 12]
EMPTY = [13] + [0] * 10
Source: TypeAlias = pb.DecisionSource.ValueType
AGENT = pb.DECISION_SOURCE_AGENT


def apply(table: Table, **kind: Any) -> list[Call]:
    return table.event(pb.GameEvent(**kind))


def play(seat: int, face: int, quantity: int, jokers: int = 0, left: int = 9, source: Source = AGENT) -> dict[str, Any]:
    action = ACTIONS.index(f"C{face};Q{quantity};J{jokers}" if quantity else "C0;Q0;J1")
    return {"play": pb.Play(seat=seat, action=action, face=face, quantity=quantity, jokers=jokers, cards_left=left, source=source)}


def passes(seat: int, source: Source = AGENT) -> dict[str, Any]:
    return {"pass": pb.Pass(seat=seat, source=source)}


def dealt(shift: int = 1, names: tuple[str, ...] = ("me", "Bob", "Cleo", "greedy")) -> Table:
    table = Table(OWN, "RANDOM_me")
    seats = [pb.Participant(seat=seat, name=name) for seat, name in enumerate(names)]
    assert apply(table, game_started=pb.GameStarted(seats=seats, hand_size=17)) == []
    hands = [pb.SeatCards(seat=OWN, cards=HAND)]
    assert apply(table, shift_started=pb.ShiftStarted(shift=shift, hands=hands)) == []
    return table


def test_the_actions_are_the_two_hundred() -> None:
    assert len(ACTIONS) == len(set(ACTIONS)) == 200
    assert (ACTIONS[0], ACTIONS[1], ACTIONS[3], ACTIONS[197], ACTIONS[198], ACTIONS[199]) == (
        "C1;Q1;J0",
        "C1;Q1;J1",
        "C2;Q1;J0",
        "C11;Q11;J2",
        "C0;Q0;J1",
        "pass",
    )


def test_a_match_begins_when_the_first_player_is_known() -> None:
    table = dealt()
    (begins,) = apply(table, **play(HERS, 11, 2, left=15))
    assert begins == Call("update_start_match", [HAND, ["RANDOM_me", "Bob", "Cleo", "greedy"], "Cleo"])
    # The turn is also known when the player itself decides next.
    assert dealt().turn_of(OWN)[0].arguments[2] == "RANDOM_me"


def test_names_are_made_unique() -> None:
    (begins,) = dealt(names=("me", "greedy", "RANDOM_me", "greedy")).turn_of(HIS)
    assert begins.arguments[1:] == [["RANDOM_me", "greedy", "RANDOM_me (2)", "greedy (3)"], "greedy"]


def test_other_seats_actions_are_reported_with_their_consequences() -> None:
    table = dealt()
    apply(table, **play(HERS, 11, 2, 1, left=14))
    calls = apply(table, **passes(ITS))
    assert [call.method for call in calls] == ["update_action_others"]
    assert calls[0].arguments == [
        {
            "Matches": 1,
            "Rounds": 1,
            "Player_Names": ["RANDOM_me", "Bob", "Cleo", "greedy"],
            "Author_Index": HERS,
            "Author_Possible_Actions": "",
            "Action_Valid": True,
            "Action_Random": "",
            "Action_Index": ACTIONS.index("C11;Q2;J1"),
            "Action_Decoded": "C11;Q2;J1",
            "Is_Pizza": False,
            "Pizza_Author": -1,
            "Finished_Players": [False] * 4,
            "Cards_Per_Player": [17, 17, 14, 17],
            "Last_action_Per_Player": ["", "", "C11;Q2;J1", ""],
            "Next_Player": ITS,
            "Board_Before": EMPTY,
            "Board_After": [11, 11, 12] + [0] * 8,
            "Current_Roles": [""] * 4,
            "Match_Score": [-1] * 4,
            "Game_Score": [0] * 4,
            "Game_Performance_Score": [0.0] * 4,
            "Observation_Before": "",
            "Observation_After": "",
        }
    ]


def vector(board: list[int], hand: list[int], *legal: int) -> object:
    cards = [*board, *[0] * (17 - len(hand)), *hand]
    return pytest.approx([card / 13 for card in cards] + [float(action in legal) for action in range(200)])


def test_own_actions_are_reported_with_both_observations() -> None:
    table = dealt()
    asked = [0.25] * 28 + [1.0, 0.0] * 100
    table.turn_of(OWN)
    table.asked(asked, replaced=False)
    apply(table, **play(OWN, 11, 3, 1, left=13))
    (calls,) = apply(table, **passes(HIS))
    info = calls.arguments[0]
    assert calls.method == "update_my_action"
    assert info["Author_Index"] == OWN
    assert info["Action_Random"] is False
    assert info["Observation_Before"] == asked
    assert info["Author_Possible_Actions"] == list(ACTIONS[::2])
    # Outside of its turn the mask has only passing.
    assert info["Observation_After"] == vector([11, 11, 11, 12] + [0] * 7, [*HAND[:12], 12], 199)
    assert info["Next_Player"] == HIS


@pytest.mark.parametrize(("source", "replaced"), [(pb.DECISION_SOURCE_TIMEOUT, False), (AGENT, True)])
def test_replaced_choices_count_as_random(source: Source, replaced: bool) -> None:
    table = dealt()
    table.asked([0.0] * 228, replaced=replaced)
    apply(table, **passes(OWN, source))
    assert table.turn_of(HIS)[0].arguments[0]["Action_Random"] is True


def test_actions_of_a_substitute_are_reported() -> None:
    table = dealt()
    apply(table, **play(OWN, 11, 3, left=14, source=pb.DECISION_SOURCE_SUBSTITUTE))
    info = table.turn_of(HIS)[0].arguments[0]
    assert info["Action_Random"] is True
    assert info["Observation_Before"] == vector(EMPTY, HAND, info["Action_Index"])
    assert info["Author_Possible_Actions"] == ["C11;Q3;J0"]


def test_a_pizza_is_reported_with_the_action_that_ended_it() -> None:
    table = dealt()
    for what in (play(HIS, 11, 1, left=16), play(HERS, 10, 1, left=16), passes(ITS), passes(OWN)):
        apply(table, **what)
    apply(table, **passes(HIS))
    assert apply(table, pizza_done=pb.PizzaDone(pizza=1, last_to_play=HERS, next_leader=HERS)) == []
    (calls,) = table.turn_of(HERS)
    info = calls.arguments[0]
    assert (info["Is_Pizza"], info["Pizza_Author"], info["Rounds"], info["Next_Player"]) == (True, HERS, 2, HERS)
    assert info["Board_Before"] == info["Board_After"] == [10] + [0] * 10
    assert info["Last_action_Per_Player"] == [""] * 4
    apply(table, **play(HERS, 0, 0, 1, left=15))
    info = table.turn_of(ITS)[0].arguments[0]
    assert (info["Is_Pizza"], info["Pizza_Author"], info["Board_Before"]) == (False, -1, EMPTY)
    assert info["Board_After"] == [12] + [0] * 10
    assert (info["Action_Index"], info["Action_Decoded"]) == (198, "C0;Q0;J1")


def test_a_board_with_too_many_cards_is_cut_off() -> None:
    table = dealt()
    apply(table, **play(HIS, 11, 11, 2, left=4))
    assert table.turn_of(HERS)[-1].arguments[0]["Board_After"] == [11] * 11


def end(table: Table, shift: int, order: tuple[int, ...], pizzas: int) -> list[Call]:
    for place, seat in enumerate(order[:3], 1):
        apply(table, seat_finished=pb.SeatFinished(seat=seat, place=place))
    ended = pb.ShiftEnded(shift=shift, order=order, shift_points=[0] * 4, points=[0] * 4, pizzas=pizzas)
    return apply(table, shift_ended=ended)


def test_a_match_ends_with_the_points_of_the_reference() -> None:
    table = dealt()
    apply(table, **play(HIS, 11, 1, left=0))
    action, over = end(table, 1, (HERS, OWN, HIS, ITS), pizzas=4)
    assert action.method == "update_action_others"
    assert over == Call("update_end_match", action.arguments)
    info = over.arguments[0]
    assert info["Match_Score"] == info["Game_Score"] == [2, 1, 3, 0]
    assert info["Game_Performance_Score"] == [5.0, 2.5, 7.5, 0.0]
    assert info["Current_Roles"] == ["Souschef", "Waiter", "Chef", "Dishwasher"]
    assert info["Finished_Players"] == [True] * 4
    assert info["Next_Player"] == ITS
    assert info["Observation_After"] == ""

    apply(table, shift_started=pb.ShiftStarted(shift=2, hands=[pb.SeatCards(seat=OWN, cards=HAND)]))
    apply(table, **play(ITS, 11, 1, left=16))
    info = table.turn_of(OWN)[0].arguments[0]
    assert (info["Matches"], info["Rounds"], info["Match_Score"]) == (2, 1, [-1] * 4)
    assert info["Finished_Players"] == [False] * 4
    apply(table, **passes(OWN))
    info = end(table, 2, (HERS, HIS, OWN, ITS), pizzas=10)[-1].arguments[0]
    assert info["Match_Score"] == [1, 2, 3, 0]
    assert info["Game_Score"] == [3, 3, 6, 0]
    assert info["Game_Performance_Score"] == pytest.approx([3.0, 2.25, 5.25, 0.0])


def test_an_exchange_is_reported_before_the_match_begins() -> None:
    table = dealt(shift=2)
    roles = [pb.ROLE_CHEF, pb.ROLE_SOUS_CHEF, pb.ROLE_WAITER, pb.ROLE_DISHWASHER]
    assert apply(table, roles_assigned=pb.RolesAssigned(roles=roles)) == []
    for giver, receiver, cards in ((ITS, OWN, [1, 2]), (OWN, ITS, [12]), (OWN, ITS, [11]), (HERS, HIS, []), (HIS, HERS, [])):
        exchanged = pb.CardsExchanged(giver=giver, receiver=receiver, count=len(cards) or 1, cards=cards)
        assert apply(table, cards_exchanged=exchanged) == []
    exchange, begins = table.turn_of(HIS)
    assert exchange == Call("update_exchange_cards", [[11, 12], [1, 2]])
    assert begins.arguments[0] == sorted([1, 2, *HAND[:14], 12])
    apply(table, **passes(HIS))
    info = table.turn_of(HERS)[0].arguments[0]
    assert info["Current_Roles"] == ["Chef", "Souschef", "Waiter", "Dishwasher"]


@pytest.mark.parametrize(
    ("action", "text"),
    [(pb.SPECIAL_ACTION_FOOD_FIGHT, "It is food fight!"), (pb.SPECIAL_ACTION_DINNER_IS_SERVED, "Dinner served!")],
)
def test_a_special_action_is_reported_with_its_seat(action: pb.SpecialAction.ValueType, text: str) -> None:
    declared = pb.SpecialActionDeclared(seat=ITS, action=action, source=pb.DECISION_SOURCE_AGENT)
    assert apply(dealt(shift=2), special_action_declared=declared) == [Call("observe_special_action", [text, ITS])]


def test_the_end_of_an_aborted_game_is_reported_too() -> None:
    assert apply(dealt(), game_ended=pb.GameEnded()) == [Call("update_game_over", [])]
    table = dealt()
    apply(table, **passes(HIS))
    calls = apply(table, game_aborted=pb.GameAborted(reason=pb.ABORT_REASON_CLOSED))
    assert [call.method for call in calls] == ["update_action_others", "update_game_over"]
    assert calls[0].arguments[0]["Next_Player"] == -1
