"""The whole chain: rendered frames of a table, perception, the bridge, and a physical room of the real server."""

from __future__ import annotations

import asyncio
import os
import subprocess
from collections import Counter
from pathlib import Path

import pytest
from chefshat import RandomAgent, aio, pb
from chefshat.files import write_record
from chefshat.local_server import BINARY

from chefshat_robot.bridge import Bridge
from chefshat_robot.deck import FACES
from chefshat_robot.drivers.driver import Say
from chefshat_robot.rehearsal import Rehearsal
from chefshat_robot.robot import play_seat
from chefshat_robot.synthetic import DIFFICULTIES, Act, LayCards, SyntheticTable, TakeBack
from chefshat_robot.vision import Frame, Perception
from chefshat_robot.words import Words
from tests.robots import ScriptedRobot

PEOPLE = ("Ada", "Bo")
ROBOT, REMOTE = 2, 3
LIMIT_S = 900.0


async def _page(client: aio.Client, ticket: str, answered: list[str], rehearsal: Rehearsal) -> None:
    """Somebody on the page who sees the table and answers its questions."""
    async for state in client.tables.watch(ticket):
        for question in state.questions:
            if question.question_id not in answered:
                answered.append(question.question_id)
                option = rehearsal.right_option(state, question)
                answer = pb.QuestionAnswered(question_id=question.question_id, option=option)
                await client.tables.report(ticket, pb.TableReport(source=pb.REPORT_SOURCE_ATTENDANT, answer=answer))


@pytest.mark.server
@pytest.mark.slow
async def test_people_a_robot_and_a_remote_agent_play_a_game_at_a_synthetic_table(server_address: str, tmp_path: Path) -> None:
    robot = ScriptedRobot()
    answered: list[str] = []
    async with aio.Client(server_address) as client:
        people = [pb.SeatConfig(at_table=pb.PARTICIPANT_KIND_HUMAN, name=name) for name in PEOPLE]
        made = await client.rooms.create("whole", seats=[*people, None, None], rules=pb.RuleSet(target_shifts=1), physical=True)
        ticket = made.table_ticket
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT, seat=ROBOT)
        other = await client.rooms.join(made.join_code, "remote", seat=REMOTE)
        table = SyntheticTable([], DIFFICULTIES["easy"], seed=2)
        rehearsal = Rehearsal(table, client.tables, ticket, seed=2, mistakes=0.25, face_down=0.5, answers=False)
        bridge = Bridge(client.tables, ticket, Perception(table.camera, deck=0))

        async def after(frame: Frame) -> None:
            if bridge.state is not None:
                await rehearsal.step(bridge.state, frame.time)

        page = asyncio.create_task(_page(client, ticket, answered, rehearsal))
        remote = asyncio.create_task(client.play(RandomAgent(5), other.ticket))
        playing = asyncio.create_task(play_seat(client, seat.ticket, RandomAgent(7), robot, words=Words("en"), referee=True))
        async with asyncio.timeout(LIMIT_S):
            await bridge.run(rehearsal.frames(), after)
            result = await playing
            await remote
        page.cancel()
        assert result.finished
        record = [line async for line in client.records.read(result.game_id)]
    events = [line.event for line in record if line.HasField("event")]
    plays = [event.play for event in events if event.HasField("play")]
    recorded = [(play.seat, Counter({play.face: play.quantity}) + Counter({FACES + 1: play.jokers})) for play in plays]
    laid = [(player, Counter(card.face for card in cards)) for player, cards in rehearsal.plays]
    assert recorded[: len(laid)] == laid
    # The last decisions of the remote seats end the game before their cards are laid.
    assert all(player in (ROBOT, REMOTE) for player, _ in recorded[len(laid) :])
    violations = [event.violation.text for event in events if event.HasField("violation")]
    assert rehearsal.violations > 0
    assert violations
    assert answered
    assert set(violations) <= {act.text for act in robot.acts if isinstance(act, Say)}

    file = tmp_path / "game.jsonl"
    write_record(file, record)
    work = [["verify"], ["export", "--out", str(tmp_path / "dataset")], ["render", "--out", str(tmp_path / "game.svg")]]
    for arguments in work:
        subprocess.run([os.environ[BINARY], *arguments, str(file)], check=True)


class Nobody:
    """Has nothing to report."""

    async def report(self, table_ticket: str, report: pb.TableReport, *, report_id: str = "") -> pb.ReportResponse:
        raise AssertionError(f"{table_ticket}, {report_id}: {report}")


@pytest.mark.parametrize("table_says", ["nothing", "violation", "play"])
def test_a_mistake_is_taken_back_unless_the_table_counts_it(table_says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that nobody notices is taken back too, after a while."""
    table = SyntheticTable([], DIFFICULTIES["easy"], seed=2)
    rehearsal = Rehearsal(table, Nobody(), "ticket", seed=2, mistakes=1.0)
    acts: list[Act] = []
    monkeypatch.setattr(table, "perform", acts.append)
    state = pb.TableState(version=1, stage=pb.TABLE_STAGE_TURN, seat=0)
    state.seats.extend([pb.TableSeat(at_table=True)] * 4)
    state.observation.shift, state.observation.pizza = 1, 2
    state.observation.cards_left = bytes([17] * 4)
    state.play_requirement.lowest_face, state.play_requirement.highest_face, state.play_requirement.fewest_cards = 1, 1, 1

    def step(time: float) -> list[Act]:
        before = len(acts)
        asyncio.run(rehearsal.step(state, time))
        return acts[before:]

    (laid,) = step(1.0)
    assert isinstance(laid, LayCards)
    match table_says:
        case "nothing":
            assert step(8.0) == []
        case "violation":
            state.violation.text = "That pizza already shows 2s."
        case "play":
            state.observation.cards_left, state.seat, state.version = bytes([16, 17, 17, 17]), 1, 2
            state.seats[1].at_table = False
    done = step(14.0)
    if table_says == "play":
        assert done == []
        assert rehearsal.plays == [(0, list(laid.cards))]
    else:
        (taken,) = done
        assert isinstance(taken, TakeBack)
        assert (laid.seat, laid.places) == (taken.seat, taken.places)
        assert not rehearsal.plays
