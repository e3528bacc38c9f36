"""A robot at a physical table: it decides first, lays then, and reports what it has laid."""

from __future__ import annotations

import asyncio
import random

import pytest
from chefshat import ChefsHatError, RandomAgent, aio, pb

from chefshat_robot import layout
from chefshat_robot.drivers.driver import CardMove, Heard, Pick, Pose, Say
from chefshat_robot.questions import option_said
from chefshat_robot.reporting import report_of
from chefshat_robot.robot import play_seat
from chefshat_robot.table import TableState
from chefshat_robot.words import Words
from tests.loop import until
from tests.robots import SEATS, ScriptedRobot

ROBOT, DAN = 0, 3
GOLDEN = 65


class Attendant:
    """Reports the hands that were dealt, lays the cards of the built-in agents, and reports the turns of Dan.

    Dan sits at the table. He passes whenever he may, and else lays one card.

    Attributes:
        refused: what the referee said of reports that it did not accept.
    """

    def __init__(self, client: aio.Client, ticket: str) -> None:
        faces = [face for face in range(1, 12) for _ in range(face)] + [12, 12]
        order = list(range(68))
        random.Random(3).shuffle(order)
        hands = [sorted(order[17 * seat : 17 * seat + 17]) for seat in range(4)]
        # The last of the 11s is the Golden card.
        self._hands = [pb.SeenCards(cards=[faces[index] for index in hand], golden=GOLDEN in hand) for hand in hands]
        self._client = client
        self._ticket = ticket
        self.refused: list[str] = []

    async def attend(self) -> None:
        done = 0
        async for state in self._client.tables.watch(self._ticket):
            if state.version <= done:
                continue  # A report has returned a later one.
            while (report := self._next(state)) is not None:
                try:
                    response = await self._client.tables.report(self._ticket, report)
                except ChefsHatError as error:
                    if error.reason != "GAME_OVER":
                        raise
                    return
                if response.verdict not in (pb.REPORT_VERDICT_ACCEPTED, pb.REPORT_VERDICT_KNOWN):
                    self.refused.append(response.detail)
                    return
                state = response.state
            done = state.version

    def _next(self, state: pb.TableState) -> pb.TableReport | None:
        """What to report now; None if others have to do something."""
        if state.stage == pb.TABLE_STAGE_HAND:
            return pb.TableReport(hand=pb.HandSeen(seat=state.seat, cards=self._hands[state.seat]))
        if state.to_lay:
            wanted = state.to_lay[0]
            return None if wanted.seat == ROBOT else _turn(wanted.seat, wanted.cards)
        opening = state.stage == pb.TABLE_STAGE_OPENING
        if not opening and (state.stage != pb.TABLE_STAGE_TURN or state.seat != DAN):
            return None
        required = state.play_requirement
        if required.may_pass and not opening:
            return _turn(DAN, pb.SeenCards())
        golden = required.golden_card or opening
        face = 11 if golden else self._hands[DAN].cards[0]
        self._hands[DAN].cards.remove(face)
        return _turn(DAN, pb.SeenCards(cards=[face], golden=golden))


def _turn(seat: int, cards: pb.SeenCards) -> pb.TableReport:
    if cards.cards:
        return pb.TableReport(laid=pb.CardsLaid(seat=seat, cards=cards))
    return pb.TableReport(**{"pass": pb.PassShown(seat=seat)})  # type: ignore[arg-type]


@pytest.mark.server
async def test_a_robot_plays_a_shift_at_a_physical_table(server_address: str, caplog: pytest.LogCaptureFixture) -> None:
    robot = ScriptedRobot()
    async with aio.Client(server_address) as client:
        rules = pb.RuleSet(target_shifts=1)
        dan = pb.SeatConfig(at_table=pb.PARTICIPANT_KIND_HUMAN, name="Dan")
        policy = pb.RoomPolicy(pace_ms=0)
        seats = [None, "greedy", "random", dan]
        made = await client.rooms.create("real", seats=seats, rules=rules, policy=policy, physical=True)
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT, seat=ROBOT)
        attendant = Attendant(client, made.table_ticket)
        attending = asyncio.create_task(attendant.attend())
        result = await play_seat(client, seat.ticket, RandomAgent(7), robot, words=Words("en"), table_ticket=made.table_ticket)
        assert result.finished
        await attending
        assert attendant.refused == []
        record = [line async for line in client.records.read(result.game_id)]
    assert "did not accept" not in caplog.text
    assert not any(line.event.HasField("violation") for line in record)
    plays = [line.event.play for line in record if line.event.HasField("play") and line.event.play.seat == ROBOT]
    laid = [[move for move in act.moves if move.piece != "pass"] for act in robot.acts if isinstance(act, Pick)]
    assert [len(moves) for moves in laid if moves] == [play.quantity + play.jokers for play in plays]
    assert all(move.start is not None for moves in laid for move in moves)


def test_what_a_robot_carries_is_a_report() -> None:
    state = TableState(seat=1, names=SEATS)
    place = layout.pass_place(1)
    assert place is not None
    rest = layout.pass_rest(1, 4)

    def carried(pieces: list[str], ends: list[Pose]) -> pb.TableReport | None:
        return report_of(Pick(tuple(CardMove(piece, None, end) for piece, end in zip(pieces, ends, strict=True))), state)

    laid = carried(["golden", "11", "joker"], layout.play_places(3))
    assert laid is not None
    assert (laid.source, laid.laid.seat, list(laid.laid.cards.cards)) == (pb.REPORT_SOURCE_ROBOT, 1, [11, 11, 12])
    assert laid.laid.cards.golden
    gift = carried(["9"], [layout.gift_place(3, 4)])
    assert gift is not None
    assert (gift.gift.seat, list(gift.gift.cards.cards), gift.gift.cards.golden) == (1, [9], False)
    shown = carried(["pass"], [place])
    assert shown is not None
    assert getattr(shown, "pass").seat == 1
    assert carried(["pass"], [rest]) is None


@pytest.mark.server
async def test_a_robot_says_violations_and_asks_the_tables_questions(server_address: str) -> None:
    robot = ScriptedRobot()
    question = pb.TableQuestion(question_id="q1", text="7 or 9 at place 4?", options=["7", "9"])

    def said(text: str) -> bool:
        return any(isinstance(act, Say) and act.text == text for act in robot.acts)

    async with aio.Client(server_address) as client:
        rules = pb.RuleSet(target_shifts=1)
        dan = pb.SeatConfig(at_table=pb.PARTICIPANT_KIND_HUMAN, name="Dan")
        made = await client.rooms.create("doubt", seats=[None, dan, dan, dan], rules=rules, physical=True)
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT, seat=ROBOT)
        ticket = made.table_ticket
        playing = asyncio.create_task(
            play_seat(client, seat.ticket, RandomAgent(7), robot, words=Words("it"), table_ticket=ticket, referee=True)
        )
        await until(lambda: robot.seen)
        hand = pb.SeenCards(cards=[2, 2, 5, 7, 9, 9, 9, 10, 10, 10, 11, 11, 11, 11, 11, 12, 12], golden=False)
        assert (await client.tables.report(ticket, pb.TableReport(hand=pb.HandSeen(seat=ROBOT, cards=hand)))).verdict == 1
        # Nobody may open a Shift with a 3.
        wrong = pb.TableReport(laid=pb.CardsLaid(seat=1, cards=pb.SeenCards(cards=[3], golden=False)))
        violation = await client.tables.report(ticket, wrong)
        assert violation.verdict == pb.REPORT_VERDICT_VIOLATION
        await until(lambda: said(violation.detail))

        await client.tables.report(ticket, pb.TableReport(question=question))
        await until(lambda: said("7 or 9 at place 4?"))
        for heard in (Heard("seven or nine?"), Heard("nine", 0.2), Heard("It is a nine.", 0.9)):
            robot.report(heard)
        async for state in client.tables.watch(ticket):
            if not state.questions:
                break
        await client.rooms.close(made.room.room_id, made.owner_token)
        assert (await playing).abort_reason == "CLOSED"


@pytest.mark.parametrize(
    ("text", "option"),
    [
        ("nine", 1),
        ("It's a 9, I think", 1),
        ("credo che sia un sette", 0),
        ("seven or nine?", None),
        ("no idea", None),
        ("", None),
        ("the golden one", 2),
        ("79", None),
    ],
)
def test_an_answer_is_one_option_that_was_said(text: str, option: int | None) -> None:
    assert option_said(text, ["7", "9", "golden"]) == option
