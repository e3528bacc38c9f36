"""A robot as the body of a seat that a person on the page, or a built-in agent, plays: `chefshat-robot wizard`."""

from __future__ import annotations

import asyncio

import chefshat
import pytest
from chefshat import Decision, aio, pb

from chefshat_robot import cli, speech
from chefshat_robot.drivers.driver import Express, Pick, Say
from chefshat_robot.wizard import follow_seat
from chefshat_robot.words import Words
from tests.loop import until
from tests.robots import ScriptedRobot

ONE_SHIFT = pb.RuleSet(target_shifts=1)


class Wizard(chefshat.Agent):
    """A person on the page: says a line and shows a feeling before the first turn, and plays the first legal action."""

    def __init__(self, client: aio.Client) -> None:
        self.client = client
        self.ticket = ""
        self.start = asyncio.Event()
        self.said = False

    async def decide(self, request: Decision) -> int:
        await self.start.wait()
        if not self.said:
            self.said = True
            await self.client.send_expression(self.ticket, speech.line("Che bella pizza!", by_person=True))
            await self.client.send_expression(self.ticket, pb.Expression(label="joy", valence=0.75, arousal=0.5))
        return int(request.legal_actions[0])


@pytest.mark.server
async def test_the_robot_says_lays_and_shows_what_the_wizard_sends(server_address: str) -> None:
    robot = ScriptedRobot()
    async with aio.Client(server_address) as client:
        made = await client.rooms.create("oz", seats=[None, "greedy", "random", "greedy"], rules=ONE_SHIFT)
        wizard = Wizard(client)
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT)
        wizard.ticket = seat.ticket
        room = made.room.room_id
        playing = asyncio.create_task(client.play(wizard, seat.ticket))
        following = asyncio.create_task(follow_seat(client, room, seat.seat, robot, words=Words("it")))
        await until(lambda: robot.seen)
        wizard.start.set()
        result = await playing
        await following
        record = [line async for line in client.records.read(result.game_id)]
    said = [act.text for act in robot.acts if isinstance(act, Say)]
    assert "Che bella pizza!" in said
    assert Express("joy", 0.75, 0.5) in robot.acts
    plays = [line.event.play for line in record if line.event.HasField("play") and line.event.play.seat == 0]
    laid = [[move for move in act.moves if move.piece != "pass"] for act in robot.acts if isinstance(act, Pick)]
    assert [len(moves) for moves in laid if moves] == [play.quantity + play.jokers for play in plays]
    # A spectator does not know where the cards are in the robot's stand.
    assert all(move.start is None for moves in laid for move in moves)
    assert sum(text.startswith("Gioco") for text in said) == len(plays)
    # The record has the line as a person's.
    lines = [line.event.expression_shown.expression for line in record if line.event.HasField("expression_shown")]
    assert (lines[0].source, speech.text_of(lines[0])) == (pb.EXPRESSION_SOURCE_SELF_REPORT, "Che bella pizza!")


@pytest.mark.server
async def test_a_built_in_agent_has_a_body_and_the_past_is_not_performed(server_address: str) -> None:
    robot = ScriptedRobot()
    async with aio.Client(server_address) as client:
        made = await client.rooms.create("past", seats=[None, "greedy", "random", "greedy"], rules=pb.RuleSet(target_shifts=2))
        person = Wizard(client)
        person.said = True
        seat = await client.rooms.join(made.join_code, "Ada")
        playing = asyncio.create_task(client.play(person, seat.ticket))
        room = made.room.room_id
        past: list[pb.GameEvent] = []
        async for event in client.rooms.watch(room):
            past.append(event)
            if event.HasField("shift_started"):
                break
        following = asyncio.create_task(
            follow_seat(client, room, 1, robot, words=Words("en"), announces=False, handles_cards=False)
        )
        await until(lambda: robot.seen)
        person.start.set()
        await playing
        await following
    assert robot.seen[0].sequence == 1 <= past[-1].sequence
    # It neither speaks nor carries: it only looks at who is to act.
    assert robot.acts
    assert not any(isinstance(act, Say | Pick | Express) for act in robot.acts)
    assert robot.state is not None
    assert robot.state.over


@pytest.mark.server
def test_a_room_that_is_not_there_is_an_error(server_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["wizard", "--address", server_address, "--room", "0" * 32, "--seat", "0"]) == 1
    assert "ROOM_UNKNOWN" in capsys.readouterr().err


def test_room_and_seat_are_required(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["wizard", "--seat", "0"]) == 1
    assert "give the room (--room ROOM-ID) and the seat (--seat)" in capsys.readouterr().err
