"""What a robot does at the table, and what happens when it cannot."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from typing import Any

import chefshat
import pytest
from chefshat import ChefsHatError, Decision, SeatInfo, pb

from chefshat_robot.body import PASS, Body, Notice, Times, Turn
from chefshat_robot.drivers.driver import (
    Act,
    Button,
    CardMove,
    Done,
    Express,
    Failed,
    Gaze,
    Outcome,
    Pick,
    Point,
    Pose,
    RobotError,
    RobotEvent,
    Say,
)
from chefshat_robot.player import RobotPlayer, limit_s, turn_of
from chefshat_robot.words import Words
from tests.loop import until
from tests.robots import HAND, ScriptedRobot, game_started, numbered, passed, pizza_done, play, shift_started

# The action of two 9s.
TWO_NINES = 3 * (36 + 1)
# `HAND` in an observation.
HAND_COUNTS = bytes([0, 2, 0, 0, 1, 0, 1, 0, 3, 3, 5, 2])


def said(robot: ScriptedRobot) -> list[str]:
    return [act.text for act in robot.acts if isinstance(act, Say)]


def carried(robot: ScriptedRobot) -> list[CardMove]:
    return [move for act in robot.acts if isinstance(act, Pick) for move in act.moves]


@asynccontextmanager
async def table(robot: ScriptedRobot, notices: list[Notice], times: Times | None = None) -> AsyncIterator[Body]:
    """A body at seat 1, after the deal."""
    async with Body(robot, Words("en"), seat=1, notify=notices.append, times=times) as body:
        for event in numbered(game_started(), shift_started()):
            body.on_event(event)
        await body.idle()
        robot.acts.clear()
        notices.clear()
        yield body


async def test_a_turn_is_said_looked_at_and_laid_from_the_stand_to_the_field() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        assert await body.take_turn(Turn(11, 2, 1)).wait()
        assert [type(act) for act in robot.acts] == [Say, Gaze, Pick]
        assert said(robot) == ["I play two 11s and a joker."]
        moves = carried(robot)
        # The opening plays the Golden card first; the hand is in the stand in order, the Golden card behind the other 11s.
        assert [move.piece for move in moves] == ["golden", "11", "joker"]
        starts = [move.start for move in moves]
        # Seat 1 sits at the left: its stand runs along the left side of the field, slot 14 (golden), 10 (first 11), 15 (joker).
        assert [start.y for start in starts if start] == [200 - 200 + 25 * slot for slot in (14, 10, 15)]
        assert {(start.x, start.angle) for start in starts if start} == {(-130.0, 90.0)}
        assert [(move.end.x, move.end.y) for move in moves] == [(97.5, 151.0), (170.5, 151.0), (243.5, 151.0)]
        assert notices == []


@pytest.mark.parametrize(
    "end",
    [pizza_done(0, 0), {"shift_ended": pb.ShiftEnded(shift=1, order=[0, 1, 2, 3], shift_points=[0] * 4, points=[0] * 4)}],
)
async def test_a_pass_puts_the_pass_card_down_and_takes_it_back_at_the_end_of_the_pizza(end: dict[str, object]) -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        await body.take_turn(PASS).wait()
        for event in list(numbered({}, {}, passed(1), end))[2:]:
            body.on_event(event)
        await body.idle()
        there, back = carried(robot)
        assert (there.piece, there.end) == ("pass", Pose(45.0, 256.0, 0.0))
        assert (back.start, back.end) == (there.end, there.start)


async def test_a_failed_pick_is_asked_of_the_people_aloud_and_reported() -> None:
    def drops(act: Act) -> Outcome:
        return Failed("the gripper is jammed") if isinstance(act, Pick) else Done()

    robot, notices = ScriptedRobot(drops), list[Notice]()
    async with table(robot, notices) as body:
        await body.take_turn(Turn(9, 2, 0)).wait()
        assert said(robot) == ["I play two 9s.", "Please lay my two 9s for me."]
        assert robot.acts[-1] == Point(97.5, 151.0)
        (notice,) = notices
        assert (notice.kind, notice.text, notice.reason) == ("help", "Please lay my two 9s for me.", "the gripper is jammed")
        assert [move.piece for move in notice.cards] == ["9", "9"]


@pytest.mark.parametrize(
    ("failure", "reason"),
    [(RobotError("the robot has closed its socket"), "closed its socket"), (ZeroDivisionError("a bug"), "a bug"), (None, "0.01 s")],
)
async def test_a_robot_that_is_gone_or_hangs_is_reported_and_stopped(failure: Exception | None, reason: str) -> None:
    robot, notices = ScriptedRobot(lambda act: failure), list[Notice]()
    async with table(robot, notices, Times(say=0.01, pick=0.005, point=0.01, gaze=0.01, express=0.01)) as body:
        assert await body.take_turn(Turn(9, 2, 0)).wait()
        assert [(notice.kind, notice.text) for notice in notices] == [
            ("unsaid", "I play two 9s."),
            ("help", "Please lay my two 9s for me."),
            ("unsaid", "Please lay my two 9s for me."),
        ]
        assert all(reason in notice.reason for notice in notices)
        assert bool(robot.stops) == (failure is None)


async def test_a_default_decision_is_performed_and_the_cards_laid_too_late_are_asked_back() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        await body.take_turn(Turn(9, 2, 0)).wait()
        for event in list(numbered({}, {}, passed(1)))[2:]:
            body.on_event(event)
        await body.idle()
        take_back = "I was too late, so that does not count. Please put my two 9s back into my stand."
        assert said(robot) == ["I play two 9s.", take_back, "I pass."]
        assert [(notice.kind, notice.text) for notice in notices] == [("help", take_back)]
        assert [move.piece for move in carried(robot)] == ["9", "9", "pass"]


async def test_own_turns_that_nobody_announced_are_performed_once_and_announced_ones_not_again() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        await body.take_turn(Turn(9, 1, 0)).wait()
        for event in list(numbered({}, {}, play(1, 9, 1, cards_left=16), play(1, 7, 1, cards_left=15)))[2:]:
            body.on_event(event)
        await body.idle()
        assert said(robot) == ["I play one 9.", "I play one 7."]


async def test_events_of_the_past_are_followed_without_acts() -> None:
    robot = ScriptedRobot()
    async with Body(robot, Words("en")) as body:
        body.seat_at(1, live_from=4)
        for event in numbered(game_started(), shift_started(), play(1, 11, 1, cards_left=16), passed(2)):
            body.on_event(event)
        await body.idle()
        assert [type(act) for act in robot.acts] == [Gaze]
        assert body.state.hand[10] == 4
        assert not body.state.golden
        await body.take_turn(Turn(11, 1, 0)).wait()
        assert [move.piece for move in carried(robot)] == ["11"]


Step = pb.GameEvent | tuple[pb.Observation, Turn | int]


def own_shift() -> list[Step]:
    """A Shift of seat 1 as Chef: events, and decisions, with what the seat sees and its turn or the face of its gift."""

    def seen(*cards: int, gave: bytes = b"") -> pb.Observation:
        hand = bytes(cards.count(face) for face in range(1, 13))
        return pb.Observation(shift=1, hand=hand, golden=True, cards_left=bytes(4), passed=bytes(4), gave=gave)

    jokers_and_11s = [11, 11, 11, 11, 11, 12, 12]
    received, gifts = pb.CardsExchanged(giver=3, receiver=1, cards=[1, 3]), pb.CardsExchanged(giver=1, receiver=3, cards=[2, 9])
    after_two_turns = seen(1, 2, 3, 5, 7, 9, 10, 10, 10, *jokers_and_11s)
    steps: list[dict[str, object] | tuple[pb.Observation, Turn | int]] = [
        game_started(),
        shift_started(),
        (seen(*HAND), 9),
        (seen(2, 2, 5, 7, 9, 9, 10, 10, 10, *jokers_and_11s, gave=bytes([0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0])), 2),
        {"cards_exchanged": received},
        {"cards_exchanged": gifts},
        (seen(1, 2, 3, 5, 7, 9, 9, 10, 10, 10, *jokers_and_11s), Turn(9, 1)),
        play(1, 9, 1, cards_left=16),
        passed(2),
        play(3, 8, 1),
        passed(0),
        (after_two_turns, PASS),
        passed(1),
        pizza_done(3, 1),
        (after_two_turns, Turn(9, 1)),
        play(1, 9, 1, cards_left=15),
        (seen(1, 2, 3, 5, 7, 10, 10, 10, *jokers_and_11s), Turn(1, 1, 1)),
        play(1, 1, 1, 1, cards_left=13),
    ]
    events = numbered(*(step for step in steps if isinstance(step, dict)))
    return [next(events) if isinstance(step, dict) else step for step in steps]


async def carries_from(first: int) -> list[list[CardMove]]:
    """What a robot carries at each step of `own_shift`, if those before `first` are of the past."""
    robot, steps, moves = ScriptedRobot(), own_shift(), list[list[CardMove]]()
    past = sum(isinstance(step, pb.GameEvent) for step in steps[:first])
    async with Body(robot, Words("en")) as body:
        body.seat_at(1, live_from=past + 1)
        for number, step in enumerate(steps):
            if isinstance(step, pb.GameEvent):
                body.on_event(step)
            elif number >= first:
                observation, decided = step
                body.observe(observation)
                if isinstance(decided, Turn):
                    body.take_turn(decided)
                else:
                    body.give(decided, 3)
            await body.idle()
            moves.append(carried(robot))
            robot.acts.clear()
        assert body.state.hand == (0, 1, 1, 0, 1, 0, 1, 0, 0, 3, 5, 1)
    return moves


async def test_a_resumed_robot_knows_where_its_cards_are() -> None:
    uninterrupted = await carries_from(0)
    taken = [move for moves in uninterrupted for move in moves if move.piece != "pass"]
    # The gifts leave slots 4 and 0, into which the 1 and the 3 are put.
    slots = [(move.piece, move.start.y / 25) for move in taken if move.start]
    assert slots == [("9", 4), ("2", 0), ("9", 5), ("9", 6), ("1", 0), ("joker", 15)]
    # Between a decision and its events it is not known whether the cards have been carried: they are carried again.
    between = (4, 5, 7, 12, 15, 17)
    for first in range(len(uninterrupted)):
        if first not in between:
            assert (await carries_from(first))[first:] == uninterrupted[first:], first


async def test_turns_that_a_correction_repeats_are_not_performed_again() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        hand = body.state.hand
        opened, played = play(0, 11, 1, cards_left=16), play(1, 9, 1, cards_left=16)
        corrected: dict[str, object] = {"correction": pb.Correction(first_void=3, text="Ada laid two 11s, not one")}
        turns = (opened, played, corrected, play(0, 11, 2, cards_left=15), played, play(1, 7, 1, cards_left=15))
        events = list(numbered({}, {}, *turns))[2:]
        for event in events[:3]:
            body.on_event(event)
        assert body.state.hand == hand
        assert body.state.board_size == 0
        for event in events[3:]:
            body.on_event(event)
        await body.idle()
        assert said(robot) == ["I play one 9.", "I play one 7."]
        assert [move.piece for move in carried(robot)] == ["9", "7"]
        assert sum(body.state.hand) == 15


async def test_a_turn_that_a_correction_changes_is_performed() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        corrected: dict[str, object] = {"correction": pb.Correction(first_void=3, text="not a 9")}
        for event in list(numbered({}, {}, play(1, 9, 1, cards_left=16), corrected, play(1, 7, 1, cards_left=16)))[2:]:
            body.on_event(event)
        await body.idle()
        assert [move.piece for move in carried(robot)] == ["9", "7"]


async def test_a_pass_for_one_turn_is_taken_back_before_the_next_play() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        body.state = replace(body.state, pass_scope_turn=True)
        await body.take_turn(PASS).wait()
        await body.take_turn(Turn(9, 1, 0)).wait()
        await body.idle()
        down, back, played = carried(robot)
        assert (down.piece, back.piece, played.piece) == ("pass", "pass", "9")
        assert back.end == down.start


async def test_it_looks_at_the_seat_that_is_to_act() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        for event in list(numbered({}, {}, play(2, 11, 1)))[2:]:
            body.on_event(event)
        await body.idle()
        # Seat 3 sits at the right.
        assert robot.acts == [Gaze(910.0, 200.0, 450.0)]


async def test_gifts_are_carried_without_saying_what_they_are() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        gift = pb.CardsExchanged(giver=1, receiver=3, count=2, cards=[10, 11], golden=True)
        got = pb.CardsExchanged(giver=3, receiver=1, count=2, cards=[1, 3])
        for event in list(numbered({}, {}, {"cards_exchanged": gift}, {"cards_exchanged": got}))[2:]:
            body.on_event(event)
        await body.idle()
        assert said(robot) == ["I give two cards to Dan."]
        assert [move.piece for move in carried(robot)] == ["10", "golden"]
        assert {(move.end.x, move.end.y) for move in carried(robot)} == {(630.0, 200.0)}
        # What it received lies in the slots that became free, and is found there.
        await body.take_turn(Turn(1, 1, 0)).wait()
        start = carried(robot)[-1].start
        assert start is not None
        assert start.y == 25 * HAND.index(10)


async def test_gifts_that_were_decided_are_carried_once_and_wrong_ones_asked_back() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        assert await body.give(12, 3).wait()
        assert await body.give(2, 3).wait()
        # The second was too late: the server gave an 11 instead.
        gift = pb.CardsExchanged(giver=1, receiver=3, count=2, cards=[11, 12])
        for event in list(numbered({}, {}, {"cards_exchanged": gift}))[2:]:
            body.on_event(event)
        await body.idle()
        assert [move.piece for move in carried(robot)] == ["joker", "2", "11"]
        assert [notice.text for notice in notices] == [
            "I was too late, so that does not count. Please put a card back into my stand."
        ]
        assert body.state.hand == (0, 2, 0, 0, 1, 0, 1, 0, 3, 3, 4, 1)


async def test_winning_and_losing_show() -> None:
    async def ends(order: list[int], winner: int) -> list[Act]:
        robot, notices = ScriptedRobot(), list[Notice]()
        async with table(robot, notices) as body:
            shift = pb.ShiftEnded(shift=1, order=order, shift_points=[0] * 4, points=[0] * 4)
            game = pb.GameEnded(standings=[pb.Standing(seat=winner, points=5, place=1)])
            for event in list(numbered({}, {}, {"shift_ended": shift}, {"game_ended": game}))[2:]:
                body.on_event(event)
            await body.idle()
        return robot.acts

    won = await ends([1, 0, 2, 3], 1)
    assert [act.valence > 0 for act in won if isinstance(act, Express)] == [True, True]
    assert Say("I won the game! Thank you for playing.") in won
    lost = await ends([0, 2, 3, 1], 2)
    assert [act.valence < 0 for act in lost if isinstance(act, Express)] == [True, True]
    assert Say("Cleo has won. Well played!") in lost


class Takes(chefshat.Agent):
    """Takes an action, legal or not."""

    def __init__(self, action: int) -> None:
        self.action = action

    def decide(self, request: Decision) -> int:
        return self.action


def request(legal: list[int], time_left_ms: int = 3_600_000, seat: SeatInfo | None = None, **seen: Any) -> Decision:
    """A turn of seat 1."""
    mask = bytearray(27)
    for action in legal:
        mask[action // 8] |= 1 << action % 8
    message = pb.DecisionRequest(
        decision_id=1,
        kind=pb.DECISION_KIND_TURN,
        action_mask=bytes(mask),
        observation=pb.Observation(**{"shift": 1, "hand": bytes(12), "cards_left": bytes(4), "passed": bytes(4), **seen}),
        time_left_ms=time_left_ms,
    )
    return Decision(message, seat or SeatInfo("room", "game", 1))


async def test_a_decision_is_answered_after_its_acts_or_at_its_deadline_whatever_the_robot_does() -> None:
    for behaviour, time_left_ms in [(Done(), 3_600_000), (Failed("no"), 3_600_000), (None, 1100), (None, 0)]:
        robot, notices = ScriptedRobot(lambda act, outcome=behaviour: outcome), list[Notice]()  # type: ignore[misc]
        async with Body(robot, Words("en"), notify=notices.append, finish_s=0) as body:
            player = RobotPlayer(Takes(199), body)
            player.on_attached(SeatInfo("room", "game", 1))
            assert await player.decide(request([0, 199], time_left_ms)) == 199
            assert said(robot)[:1] == (["I pass."] if time_left_ms else [])


class Waits(chefshat.Agent):
    """An agent that computes until somebody lets it, and notes what it hears."""

    def __init__(self, action: int = 199) -> None:
        self.action = action
        self.may_end = threading.Event()
        self.heard: list[str] = []

    def decide(self, request: Decision) -> int:
        assert self.may_end.wait(60)
        self.heard.append("decision")
        return self.action

    def on_event(self, event: pb.GameEvent) -> None:
        self.heard.append(f"event {event.sequence}")
        if event.sequence == 9:
            raise ValueError("a ninth event")


async def test_an_agent_that_computes_stops_nobody_hears_everything_in_order_and_its_exceptions_are_raised() -> None:
    robot, agent = ScriptedRobot(), Waits()
    async with Body(robot, Words("en"), seat=1, finish_s=0) as body:
        player = RobotPlayer(agent, body)
        player.on_attached(SeatInfo("room", "game", 1))
        player.on_event(pb.GameEvent(sequence=1))
        deciding = asyncio.create_task(player.decide(request([0, 199])))
        # The body and the loop go on meanwhile.
        body.say("One moment.", "en")
        await until(lambda: said(robot) == ["One moment."])
        player.on_event(pb.GameEvent(sequence=2))
        assert not deciding.done()
        agent.may_end.set()
        assert await deciding == 199
        player.on_game_over(chefshat.SeatResult(room_id="room", game_id="game", seat=1))
        assert agent.heard == ["event 1", "decision", "event 2"]
        player.on_event(pb.GameEvent(sequence=9))
        with pytest.raises(ValueError, match="a ninth event"):
            await player.decide(request([0, 199]))


async def test_an_answer_to_a_decision_that_has_closed_is_not_performed() -> None:
    robot, notices, agent = ScriptedRobot(), list[Notice](), Waits(TWO_NINES)
    async with table(robot, notices) as body:
        player = RobotPlayer(agent, body)
        player.on_attached(SeatInfo("room", "game", 1))
        deciding = [asyncio.create_task(player.decide(request([TWO_NINES, 199]))) for _ in range(2)]
        await asyncio.sleep(0)
        # The time of both decisions runs out.
        for event in list(numbered({}, {}, passed(1), pizza_done(0, 1)))[2:]:
            player.on_event(event)
        state = body.state
        agent.may_end.set()
        assert await asyncio.gather(*deciding) == [TWO_NINES, TWO_NINES]
        await body.idle()
        assert body.state == state
        assert said(robot) == ["I pass."]
        assert [move.piece for move in carried(robot)] == ["pass", "pass"]
        assert notices == []


async def test_of_two_open_decisions_only_the_newer_is_performed() -> None:
    robot, notices, agent = ScriptedRobot(), list[Notice](), Waits(TWO_NINES)
    async with table(robot, notices) as body:
        player = RobotPlayer(agent, body)
        player.on_attached(SeatInfo("room", "game", 1))
        deciding = [asyncio.create_task(player.decide(request([TWO_NINES, 199], hand=HAND_COUNTS))) for _ in range(2)]
        await asyncio.sleep(0)
        # An event of the room closes no decision.
        player.on_event(pb.GameEvent(sequence=3, expression_shown=pb.ExpressionShown(seat=2)))
        agent.may_end.set()
        await asyncio.gather(*deciding)
        await body.idle()
        assert said(robot) == ["I play two 9s."]
        assert [move.piece for move in carried(robot)] == ["9", "9"]


async def test_at_a_physical_table_the_decision_comes_before_the_cards() -> None:
    robot = ScriptedRobot()
    async with Body(robot, Words("en"), seat=1, finish_s=0) as body:
        hand = pb.SeatCards(seat=1, cards=[9, 9, 11, 12], golden=True)
        dealt: dict[str, object] = {"shift_started": pb.ShiftStarted(shift=1)}
        for event in numbered(game_started(), dealt, {"hand_reported": pb.HandReported(hand=hand)}):
            body.on_event(event)
        assert body.state.real_cards
        assert (body.state.hand[8], body.state.golden) == (2, True)
        await body.idle()
        robot.acts.clear()
        player = RobotPlayer(Takes(199), body)
        assert await player.decide(request([199])) == 199
        assert said(robot) == []
        for event in list(numbered({}, {}, {}, passed(1)))[3:]:
            player.on_event(event)
        await until(lambda: said(robot) == ["I pass."])


async def test_at_a_physical_table_a_gift_is_carried_when_its_decision_counts() -> None:
    robot = ScriptedRobot()
    async with Body(robot, Words("en"), seat=1) as body:
        dealt: dict[str, object] = {"shift_started": pb.ShiftStarted(shift=2)}
        hand = pb.SeatCards(seat=1, cards=[9, 9, 11, 12])
        for event in numbered(game_started(), dealt, {"hand_reported": pb.HandReported(hand=hand)}):
            body.on_event(event)
        player = RobotPlayer(Takes(200 + 8), body)
        gift = pb.GiftRequirement(number=1, total=1, receiver=2)
        seen = bytes([0] * 8 + [2, 0, 1, 1])
        decision = request([208], hand=seen, cards_left=bytes([4] * 4))
        decision.request.kind = pb.DECISION_KIND_EXCHANGE
        decision.request.gift_requirement.CopyFrom(gift)
        assert await player.decide(decision) == 208
        await body.idle()
        assert carried(robot) == []
        player.on_result(pb.AnswerResult(decision_id=1, status=pb.ANSWER_STATUS_ACCEPTED))
        await body.idle()
        (move,) = carried(robot)
        assert (move.piece, move.end.y) == ("9", -70.0)


async def test_a_decision_says_which_cards_the_robot_has_when_events_did_not() -> None:
    robot = ScriptedRobot()
    async with Body(robot, Words("en"), seat=1) as body:
        for event in numbered(game_started(), {"shift_started": pb.ShiftStarted(shift=1)}):
            body.on_event(event)
        hand = bytes([0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 1, 1])
        player = RobotPlayer(Takes(TWO_NINES), body)
        await player.decide(request([TWO_NINES], hand=hand, golden=True, cards_left=bytes([5, 5, 5, 5])))
        # In the stand lie a 5, two 9s, the Golden card and a joker, in this order.
        assert [(move.piece, move.start.y if move.start else None) for move in carried(robot)] == [("9", 25.0), ("9", 50.0)]


async def test_an_illegal_action_is_answered_without_an_act() -> None:
    robot = ScriptedRobot()
    async with Body(robot, Words("en"), seat=1) as body:
        assert await RobotPlayer(Takes(5), body).decide(request([0, 199])) == 5
    assert robot.acts == []


def test_answers_are_held_back_no_longer_than_the_time_of_the_decision() -> None:
    assert limit_s(60_000, 0) == pytest.approx(51)
    assert limit_s(60_000, 20) == pytest.approx(31)
    assert limit_s(2_000, 0) == pytest.approx(1)
    assert limit_s(500, 0) < 0


def test_actions_are_turns() -> None:
    assert turn_of(0, 11) == Turn(1, 1, 0)
    assert turn_of(199, 11) == PASS
    assert turn_of(198, 11) == Turn(jokers=1)
    assert turn_of(197, 11) == Turn(11, 11, 2)
    indices = [3 * (face * (face - 1) // 2 + quantity - 1) + jokers
               for face in range(1, 12) for quantity in range(1, face + 1) for jokers in range(3)]  # fmt: skip
    turns = [Turn(face, quantity, jokers) for face in range(1, 12) for quantity in range(1, face + 1) for jokers in range(3)]
    assert [turn_of(index, 11) for index in indices] == turns


def test_limits_of_acts_are_by_their_kind_and_can_be_multiplied() -> None:
    move = CardMove("9", None, Pose(0.0, 0.0))
    times = Times(say=1, pick=2, point=3, gaze=4, express=5).times(2)
    acts: list[Act] = [Say(""), Pick((move, move, move)), Point(0.0, 0.0), Gaze(0.0, 0.0), Express("joy")]
    assert [times.of(act) for act in acts] == [2, 12, 6, 8, 10]


async def test_a_turn_is_not_delayed_by_reactions_that_wait() -> None:
    robot, notices = ScriptedRobot(), list[Notice]()
    async with table(robot, notices) as body:
        for event in list(numbered({}, {}, play(2, 11, 1), passed(3), play(0, 10, 1)))[2:]:
            body.on_event(event)
        await body.take_turn(PASS).wait()
        assert [type(act) for act in robot.acts] == [Say, Gaze, Pick]


async def test_an_agent_that_fails_at_what_the_robot_perceives_perceives_further(caplog: pytest.LogCaptureFixture) -> None:
    heard: list[RobotEvent] = []

    def fail(event: RobotEvent) -> None:
        heard.append(event)
        raise KeyError("no idea")

    robot = ScriptedRobot()
    async with Body(robot, Words("en")) as body:
        player = RobotPlayer(Takes(199), body, on_robot_event=fail)
        player.on_attached(SeatInfo("room", "game", 1))
        for name in ("chest", "head"):
            robot.report(Button(name))
        await until(lambda: len(heard) == 2)
        player.on_seat_lost(ChefsHatError("SUPERSEDED", "a newer connection has taken the seat"))
    assert caplog.text.count("KeyError: 'no idea'") == 2


async def test_a_robot_that_is_interrupted_at_the_end_is_given_back() -> None:
    class Returned(ScriptedRobot):
        closed = False

        async def close(self) -> None:
            self.closed = True

    async def use(robot: ScriptedRobot) -> None:
        async with Body(robot, Words("en")) as body:
            body.say("One moment.", "en")

    robot = Returned(lambda act: None)
    using = asyncio.create_task(use(robot))
    await until(lambda: robot.acts)
    using.cancel()
    with pytest.raises(asyncio.CancelledError):
        await using
    assert robot.closed
