"""The bridge alone: what it reports and asks, with a table in this process."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import AsyncIterator, Iterator
from dataclasses import replace
from typing import cast

import grpc
import numpy as np
import pytest
from chefshat import ChefsHatError, pb
from waiting import LIMIT_S

from chefshat_robot.bridge import Bridge
from chefshat_robot.deck import Card, deck
from chefshat_robot.vision import (
    Cleared,
    Doubt,
    DoubtResolved,
    FieldChanged,
    FieldState,
    Frame,
    Laid,
    PassShown,
    PassWithdrawn,
    SourceError,
    TakenBack,
)
from chefshat_robot.vision.hand import HandReader, HandSeen
from chefshat_robot.vision.perception import Perception
from tests.loop import until

CARDS = {face: [card for card in deck(0) if card.face == face] for face in range(1, 13)}
FRAME = Frame(0, 0.0, np.zeros((4, 4, 3), dtype=np.uint8))


class Table:
    """Accepts every report, unless a test says otherwise.

    Attributes:
        reports: what was reported.
        verdicts: verdicts of the next reports; then all are accepted.
        calls: how often something was reported, also in vain.
        state: returned with each response.
    """

    def __init__(self) -> None:
        self.reports: list[pb.TableReport] = []
        self.calls = 0
        self.verdicts: list[pb.ReportVerdict.ValueType] = []
        self.state = pb.TableState(version=1)
        self.error: ChefsHatError | None = None

    async def report(self, table_ticket: str, report: pb.TableReport, *, report_id: str = "") -> pb.ReportResponse:
        assert table_ticket == "ticket"
        assert report_id
        self.calls += 1
        if self.error is not None:
            raise self.error
        self.reports.append(report)
        verdict = self.verdicts.pop(0) if self.verdicts else pb.REPORT_VERDICT_ACCEPTED
        return pb.ReportResponse(report=len(self.reports), verdict=verdict, state=self.state)

    async def watch(self, table_ticket: str) -> AsyncIterator[pb.TableState]:
        yield self.state
        await asyncio.Event().wait()

    def kinds(self) -> list[str | None]:
        return [report.WhichOneof("kind") for report in self.reports]


class Eyes:
    """Perception that sees what a test says.

    Attributes:
        events: what the next frames show.
        answered: the answers to doubts.
        resolved: doubts that need no answer any more.
    """

    def __init__(self) -> None:
        self.events: list[list[Laid]] = []
        self.answered: list[tuple[int, Card | bool | None]] = []
        self.resolved: set[int] = set()

    def see(self, frame: Frame) -> list[Laid]:
        return self.events.pop(0) if self.events else []

    def answers(self, place: int) -> list[Card]:
        return [cards[0] for cards in CARDS.values()]

    def answer(self, number: int, reading: Card | bool | None) -> list[Laid]:
        self.answered.append((number, reading))
        return [laid([reading])] if isinstance(reading, Card) else []

    def is_open(self, number: int) -> bool:
        return number not in self.resolved


@pytest.fixture
def table() -> Table:
    return Table()


@pytest.fixture
def eyes() -> Eyes:
    return Eyes()


@pytest.fixture
def bridge(table: Table, eyes: Eyes) -> Bridge:
    return Bridge(table, "ticket", cast("Perception", eyes))


def laid(cards: list[Card], first: int = 1) -> Laid:
    return Laid(0, 0.0, tuple(cards), tuple(range(first, first + len(cards))))


async def answer(table: Table, bridge: Bridge, option: int | None) -> None:
    """Answers the newest question, as the page does."""
    question = next(report.question for report in reversed(table.reports) if report.HasField("question"))
    table.state = pb.TableState(version=table.state.version + 1)
    table.state.answers.add(question_id=question.question_id, option=option)
    await bridge.run(iter([FRAME]))


async def test_events_become_reports(table: Table, bridge: Bridge) -> None:
    await bridge.observed(laid([*CARDS[9][:2], CARDS[12][0]]))
    await bridge.observed(PassShown(0, 0.0, 2))
    await bridge.observed(Cleared(0, 0.0))
    await bridge.observed(laid([CARDS[11][-1]]))
    assert table.kinds() == ["laid", "pass", "cleared", "laid"]
    assert [list(report.laid.cards.cards) for report in table.reports] == [[9, 9, 12], [], [], [11]]
    assert [report.laid.cards.golden for report in table.reports] == [False, False, False, True]
    assert all(report.source == pb.REPORT_SOURCE_CAMERA for report in table.reports)


async def test_a_pass_card_is_withdrawn_only_from_a_pizza_in_progress(table: Table, bridge: Bridge) -> None:
    table.state.observation.passed = bytes([0, 1, 0, 0])

    for seat in (1, 2):
        await bridge.observed(PassShown(0, 0.0, seat))
        await bridge.observed(PassWithdrawn(0, 0.0, seat))
    assert table.kinds() == ["pass", "pass_withdrawn", "pass"]


@pytest.mark.parametrize(("option", "kind", "faces"), [(0, "correction", [9, 9, 9]), (1, "laid", [9])])
async def test_cards_of_one_face_beside_a_play_are_asked_about(
    table: Table, bridge: Bridge, option: int, kind: str, faces: list[int]
) -> None:
    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(laid([CARDS[9][2]], first=3))
    assert table.kinds() == ["laid", "question"]
    await answer(table, bridge, option)
    last = table.reports[-1]
    assert last.WhichOneof("kind") == kind
    assert list((last.correction.instead if option == 0 else last).laid.cards.cards) == faces


async def test_cards_of_one_face_on_a_play_are_a_play_of_their_own(table: Table, bridge: Bridge) -> None:
    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(laid([CARDS[9][2]]))
    assert [list(report.laid.cards.cards) for report in table.reports] == [[9, 9], [9]]


async def test_who_laid_cards_is_named_if_its_side_of_the_field_shows_it(table: Table, bridge: Bridge) -> None:
    table.state.seats.extend(pb.TableSeat(at_table=seat != 3) for seat in range(4))

    # The bridge learns of the seats from the answer to its first report.
    await bridge.observed(PassShown(0, 0.0, 0))
    await bridge.observed(replace(laid(CARDS[9][:2]), side=2))
    await bridge.observed(replace(laid(CARDS[8][:2]), side=None))
    # A remote seat lays nothing itself, and its cards may be laid from any side.
    table.state.to_lay.add(seat=3, pizza=1, cards=pb.SeenCards(cards=[6, 6]))
    await bridge.observed(replace(laid(CARDS[7][:2]), side=3))
    await bridge.observed(replace(laid(CARDS[6][:2]), side=1))
    assert [report.laid.seat if report.laid.HasField("seat") else None for report in table.reports[1:]] == [2, None, None, None]


async def test_nothing_is_added_to_what_a_remote_seat_decided(table: Table, bridge: Bridge) -> None:
    wanted = pb.CardsToLay(seat=3, pizza=1, cards=pb.SeenCards(cards=[9, 9]))
    table.state.to_lay.append(wanted)

    await bridge.observed(PassShown(0, 0.0, 2))
    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(laid([CARDS[9][2]], first=3))
    assert table.kinds() == ["pass", "laid", "laid"]


async def test_a_play_that_does_not_count_is_taken_back_without_a_question(table: Table, bridge: Bridge) -> None:
    table.verdicts = [pb.REPORT_VERDICT_VIOLATION]

    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(TakenBack(0, 0.0, tuple(CARDS[9][:2]), (1, 2)))
    await bridge.observed(laid(CARDS[7][:2]))
    assert [list(report.laid.cards.cards) for report in table.reports] == [[9, 9], [7, 7]]


async def test_a_play_that_counts_is_taken_back_if_somebody_says_so(table: Table, bridge: Bridge) -> None:
    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(TakenBack(0, 0.0, tuple(CARDS[9][:2]), (1, 2)))
    assert table.kinds() == ["laid", "question"]
    await answer(table, bridge, 0)
    assert table.reports[-1].correction.report == 1
    assert not table.reports[-1].correction.HasField("instead")


async def test_what_happens_while_an_addition_is_asked_about_waits_for_the_answer(table: Table, bridge: Bridge) -> None:
    await bridge.observed(laid(CARDS[9][:1]))
    await bridge.observed(laid(CARDS[9][1:3], first=2))
    await bridge.observed(laid(CARDS[5][:3]))
    await bridge.observed(Cleared(0, 0.0))
    assert table.kinds() == ["laid", "question"]
    await answer(table, bridge, 0)
    assert table.kinds() == ["laid", "question", "correction", "laid", "cleared"]
    assert list(table.reports[2].correction.instead.laid.cards.cards) == [9, 9, 9]


async def test_a_play_taken_back_is_asked_about_before_the_next_is_reported(table: Table, bridge: Bridge) -> None:
    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(TakenBack(0, 0.0, tuple(CARDS[9][:2]), (1, 2)))
    await bridge.observed(laid(CARDS[7][:2]))
    assert table.kinds() == ["laid", "question"]
    await answer(table, bridge, 0)
    assert table.kinds() == ["laid", "question", "correction", "laid"]


async def test_what_was_taken_from_a_board_that_is_then_cleared_was_swept_away(table: Table, bridge: Bridge) -> None:
    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(TakenBack(0, 0.0, (CARDS[9][0],), (1,)))
    await bridge.observed(Cleared(0, 0.0))
    assert table.kinds() == ["laid", "question", "answer", "cleared"]
    assert not table.reports[2].answer.HasField("option"), "the question is withdrawn"


async def test_a_doubt_is_a_question_whose_answer_perception_gets(table: Table, eyes: Eyes, bridge: Bridge) -> None:
    picture = np.full((80, 60, 3), 200, dtype=np.uint8)
    await bridge.observed(Doubt(0, 0.0, 4, "1", 0.0, (CARDS[7][0], CARDS[9][0]), picture))
    question = table.reports[-1].question
    assert (question.text, list(question.options)) == ("7 or 9 at place 1?", ["7", "9", "No new card"])
    assert question.picture.startswith(b"\xff\xd8")
    await answer(table, bridge, 1)
    assert eyes.answered == [(4, CARDS[9][0])]
    assert list(table.reports[-1].laid.cards.cards) == [9]


async def test_a_doubt_without_candidates_offers_every_face(table: Table, eyes: Eyes, bridge: Bridge) -> None:
    await bridge.observed(Doubt(0, 0.0, 4, "1", 0.0, ()))
    assert list(table.reports[-1].question.options) == [*map(str, range(1, 12)), "Joker", "No new card"]
    await answer(table, bridge, 12)
    assert eyes.answered == [(4, False)]


@pytest.mark.parametrize("place", ["1", "pass 2"])
async def test_a_doubt_whose_question_somebody_withdraws_leaves_all_as_it_was(
    place: str, table: Table, eyes: Eyes, bridge: Bridge
) -> None:
    await bridge.observed(Doubt(0, 0.0, 4, place, 0.0, ()))
    await answer(table, bridge, None)
    assert eyes.answered == [(4, None)]


async def test_an_answer_to_what_the_camera_could_read_after_all_changes_nothing(table: Table, eyes: Eyes, bridge: Bridge) -> None:
    await bridge.observed(Doubt(0, 0.0, 4, "1", 0.0, ()))
    eyes.resolved.add(4)
    await answer(table, bridge, 1)
    assert eyes.answered == []


async def test_questions_of_a_bridge_that_was_killed_are_withdrawn(table: Table, bridge: Bridge) -> None:
    table.state.questions.add(question_id="bridge-0001-doubt-1-1", text="Which card lies at place 1?")
    table.state.questions.add(question_id="referee-3", text="Did Bo pass?")
    await bridge.run(iter([FRAME]))
    assert [report.answer.question_id for report in table.reports] == ["bridge-0001-doubt-1-1"]
    assert not table.reports[0].answer.HasField("option")


def found(cards: list[Card]) -> Laid:
    return replace(laid(cards), found=True)


@pytest.mark.parametrize("is_new", [True, False])
async def test_cards_that_were_found_before_anybody_played_are_asked_about(is_new: bool, table: Table, bridge: Bridge) -> None:
    await bridge.observed(found(CARDS[8][:1]))
    assert table.reports[-1].question.text == "8 found on the field: is it a new play?"
    await answer(table, bridge, 0 if is_new else 1)
    assert table.kinds() == ["question"] + ["laid"] * is_new


async def test_cards_that_are_found_one_after_the_other_are_one_question(table: Table, bridge: Bridge) -> None:
    await bridge.observed(found(CARDS[8][:1]))
    await bridge.observed(replace(found(CARDS[8][1:2]), places=(2,)))
    assert table.kinds() == ["question", "answer", "question"]
    await answer(table, bridge, 0)
    assert list(table.reports[-1].laid.cards.cards) == [8, 8]


async def test_what_happens_after_something_was_found_waits_for_the_answer(table: Table, bridge: Bridge) -> None:
    await bridge.observed(found(CARDS[8][:1]))
    await bridge.observed(laid(CARDS[5][:1]))
    await bridge.observed(PassShown(0, 0.0, 2))
    await bridge.observed(Cleared(0, 0.0))
    assert table.kinds() == ["question"]
    await answer(table, bridge, 0)
    assert table.kinds() == ["question", "laid", "laid", "pass", "cleared"]
    assert [list(report.laid.cards.cards) for report in table.reports[1:3]] == [[8], [5]]


async def test_cards_that_were_found_and_are_swept_away_need_no_answer(table: Table, bridge: Bridge) -> None:
    await bridge.observed(found(CARDS[8][:1]))
    await bridge.observed(PassShown(0, 0.0, 1, found=True))
    await bridge.observed(PassWithdrawn(0, 0.0, 1))
    await bridge.observed(Cleared(0, 0.0))
    assert table.kinds() == ["question", "question", "answer", "answer", "cleared"]
    assert table.reports[2].answer.question_id == table.reports[1].question.question_id
    assert table.reports[3].answer.question_id == table.reports[0].question.question_id


@pytest.mark.parametrize(("pending", "asked"), [(False, False), (True, True)])
async def test_cards_that_were_found_in_a_pizza_are_asked_about_if_a_remote_seat_may_have_opened_it(
    pending: bool, asked: bool, table: Table, bridge: Bridge
) -> None:
    table.state = pb.TableState(version=2)
    table.state.observation.board_size = 2
    if pending:
        table.state.to_lay.add(seat=2, pizza=4, cards=pb.SeenCards(cards=[9, 9]))
    await bridge.observed(Cleared(0, 0.0))
    await bridge.observed(replace(found(CARDS[8][:2]), side=1))
    assert table.kinds() == ["cleared", "question" if asked else "laid"]
    assert not table.reports[-1].laid.HasField("seat")


@pytest.mark.parametrize("shown", [True, False])
async def test_a_pass_card_that_was_found_before_anybody_played_is_asked_about(shown: bool, table: Table, bridge: Bridge) -> None:
    await bridge.observed(PassShown(0, 0.0, 1, found=True))
    assert table.reports[-1].question.text == "The pass card of seat 1 lies at its place: is it shown in this pizza?"
    await answer(table, bridge, 0 if shown else 1)
    assert table.kinds() == ["question"] + ["pass"] * shown


async def test_questions_that_need_no_answer_any_more_are_withdrawn(table: Table, bridge: Bridge) -> None:
    await bridge.observed(Doubt(0, 0.0, 4, "pass 2", 0.0, ()))
    await bridge.observed(DoubtResolved(0, 0.0, 4))
    await bridge.observed(FieldChanged(0, 0.0, FieldState.LOST))
    await bridge.observed(FieldChanged(0, 0.0, FieldState.FOUND))
    asked = [report.question.question_id for report in table.reports if report.HasField("question")]
    withdrawn = [report.answer.question_id for report in table.reports if report.HasField("answer")]
    assert len(asked) == 2
    assert withdrawn == asked


async def test_a_game_that_a_remote_seat_ended_ends_the_bridge(table: Table, eyes: Eyes, bridge: Bridge) -> None:
    table.error = ChefsHatError("GAME_OVER", "the game is over")
    eyes.events = [[laid(CARDS[9][:2])]]
    await bridge.run(iter([FRAME]))
    assert table.reports == []


async def test_no_two_questions_have_one_id_and_the_open_ones_end_with_the_bridge(table: Table, bridge: Bridge) -> None:
    await bridge.observed(laid(CARDS[9][:2]))
    await bridge.observed(laid([CARDS[12][0]], first=5))
    await bridge.observed(Doubt(0, 0.0, 4, "pass 2", 0.0, ()))
    await bridge.observed(Doubt(0, 0.0, 5, "pass 3", 0.0, ()))
    await bridge.run(iter([FRAME]))
    asked = [report.question.question_id for report in table.reports if report.HasField("question")]
    withdrawn = [report.answer.question_id for report in table.reports if report.HasField("answer")]
    assert len(set(asked)) == len(asked) == 3
    assert withdrawn == asked


class Away(Table):
    """A table whose server is away until the test says otherwise: a report waits."""

    def __init__(self) -> None:
        super().__init__()
        self.asked = threading.Event()
        self.back = threading.Event()

    async def report(self, table_ticket: str, report: pb.TableReport, *, report_id: str = "") -> pb.ReportResponse:
        self.asked.set()
        await until(self.back.is_set)
        return await super().report(table_ticket, report, report_id=report_id)


async def test_frames_are_watched_while_a_report_waits(eyes: Eyes) -> None:
    table = Away()
    bridge = Bridge(table, "ticket", cast("Perception", eyes))
    eyes.events = [[laid(CARDS[9][:2])], [], [laid(CARDS[7][:2])]]
    watched: list[int] = []

    def frames() -> Iterator[Frame]:
        for number in range(4):
            if number == 2:
                assert table.asked.wait(LIMIT_S)
            watched.append(len(table.reports))
            yield FRAME
        table.back.set()

    await bridge.run(frames())
    assert watched == [0, 0, 0, 0]
    assert [list(report.laid.cards.cards) for report in table.reports] == [[9, 9], [7, 7]]


async def test_a_server_that_is_away_is_reported(
    bridge: Bridge, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("chefshat_robot.bridge.AWAY_S", 0.0)
    bridge.table = away = Away()

    reporting = asyncio.create_task(bridge.observed(laid(CARDS[9][:2])))
    await until(lambda: "the server is away" in caplog.text)
    away.back.set()
    await reporting
    assert away.kinds() == ["laid"]


async def test_a_report_that_the_table_gives_up_is_not_tried_again(table: Table, bridge: Bridge) -> None:
    table.error = ChefsHatError("UNAVAILABLE", "no server answers", code=grpc.StatusCode.UNAVAILABLE)
    with pytest.raises(ChefsHatError, match="UNAVAILABLE"):
        await bridge.observed(laid(CARDS[9][:2]))
    assert table.calls == 1


async def test_a_bridge_that_is_cancelled_ends_although_the_server_is_away(bridge: Bridge, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chefshat_robot.bridge.WITHDRAW_S", 0.01)
    away, watching = Away(), threading.Event()

    def frames() -> Iterator[Frame]:
        watching.set()
        yield from itertools.repeat(FRAME)

    await bridge.observed(Doubt(0, 0.0, 4, "pass 2", 0.0, ()))
    bridge.table = away
    running = asyncio.create_task(bridge.run(frames()))
    await until(watching.is_set)
    running.cancel()
    await asyncio.wait([running])
    assert running.cancelled()
    assert away.asked.is_set(), "it has tried to withdraw its question"


class Hand:
    """A hand reader that sees one more card in each frame."""

    def __init__(self) -> None:
        self._seen = 0

    def see(self, frame: Frame) -> HandSeen:
        self._seen += 1
        return HandSeen(frame.index, frame.time, tuple(deck(0)[: self._seen]))


async def test_a_whole_hand_is_reported_when_the_table_waits_for_it(table: Table, bridge: Bridge) -> None:
    table.state = pb.TableState(version=1, stage=pb.TABLE_STAGE_HAND, seat=2)
    table.state.observation.cards_left = bytes([17, 17, 3, 17])
    bridge.state = table.state

    def frames() -> Iterator[Frame]:
        yield from [FRAME] * 4

    await bridge.watch_hand(2, cast("HandReader", Hand()), frames())
    (report,) = table.reports
    assert (report.hand.seat, list(report.hand.cards.cards)) == (2, [1, 2, 2])


class Same:
    """A hand reader that sees the same three cards in each frame."""

    def see(self, frame: Frame) -> HandSeen:
        return HandSeen(frame.index, frame.time, tuple(deck(0)[:3]))


async def test_a_hand_that_was_refused_is_not_reported_in_each_frame(
    table: Table, bridge: Bridge, caplog: pytest.LogCaptureFixture
) -> None:
    table.state = pb.TableState(version=1, stage=pb.TABLE_STAGE_HAND, seat=2)
    table.state.observation.cards_left = bytes([17, 17, 3, 17])
    table.verdicts = [pb.REPORT_VERDICT_VIOLATION] * 9
    bridge.state = table.state

    def frames() -> Iterator[Frame]:
        yield from [FRAME] * 4
        table.state.observation.shift = 2
        bridge.state = table.state
        yield from [FRAME] * 4

    await bridge.watch_hand(2, cast("HandReader", Same()), frames())
    assert table.kinds() == ["hand", "hand"]
    # The camera ended before the game.
    assert "no more pictures" in caplog.text


async def test_a_hand_whose_camera_fails_ends_only_its_own_watching(
    table: Table, bridge: Bridge, caplog: pytest.LogCaptureFixture
) -> None:
    bridge.state = table.state

    def frames() -> Iterator[Frame]:
        yield FRAME
        raise SourceError("camera 1 sends no more pictures; check its cable")

    await bridge.watch_hand(2, cast("HandReader", Same()), frames())
    assert "the hand of seat 2 gives no more pictures: camera 1 sends no more pictures; check its cable" in caplog.text
