"""The driver `jsonlines` with a robot on the other end of a socket."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from chefshat import RandomAgent, aio, pb

from chefshat_robot import drivers
from chefshat_robot.body import Notice
from chefshat_robot.drivers.driver import (
    Act,
    Affect,
    Button,
    CardMove,
    Done,
    Express,
    Failed,
    Gaze,
    Heard,
    Pick,
    Point,
    Pose,
    RobotError,
    Say,
    attempt,
)
from chefshat_robot.drivers.jsonlines import JsonLinesDriver
from chefshat_robot.robot import play_seat
from chefshat_robot.table import TableState, follow
from chefshat_robot.words import Words
from tests.loop import until
from tests.robots import game_started, numbered, shift_started

FAR_S = 3600.0


class Robot:
    """A robot's program: a server for one connection after another.

    Attributes:
        got: the lines received.
        port: where it listens.
    """

    def __init__(self) -> None:
        self.got: list[dict[str, Any]] = []
        self.port = 0
        self.connections = 0
        self._writer: asyncio.StreamWriter | None = None

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writer = writer
        self.connections += 1
        while line := await reader.readline():
            self.got.append(json.loads(line))

    def send(self, line: str) -> None:
        assert self._writer is not None
        self._writer.write(line.encode() + b"\n")

    def hang_up(self) -> None:
        assert self._writer is not None
        self._writer.close()

    def acts(self) -> list[dict[str, Any]]:
        return [line for line in self.got if line["type"] == "act"]

    async def act(self, number: int) -> str:
        """Waits for an act, the first has number 1, and returns its id."""
        await until(lambda: len(self.acts()) >= number)
        return str(self.acts()[number - 1]["id"])


@asynccontextmanager
async def robot() -> AsyncIterator[Robot]:
    peer = Robot()
    server = await asyncio.start_server(peer.serve, "127.0.0.1", 0)
    peer.port = server.sockets[0].getsockname()[1]
    try:
        yield peer
    finally:
        server.close()


async def test_every_act_goes_out_and_its_outcome_comes_back() -> None:
    acts: list[Act] = [
        Say("Passo.", "it"),
        Pick((CardMove("9", Pose(1.5, 2.0, 90.0), Pose(3.0, 4.0)), CardMove("joker", None, Pose(5.0, 6.0)))),
        Point(1.0, 2.0),
        Gaze(1.0, 2.0, 3.0),
        Express("joy", 0.5, -0.5),
    ]
    async with robot() as peer, drivers.create(f"jsonlines:port={peer.port}") as driver:
        for number, act in enumerate(acts, 1):
            performing = asyncio.create_task(attempt(driver, act, FAR_S))
            identity = await peer.act(number)
            peer.send(json.dumps({"type": "done", "id": identity}))
            assert await performing == Done()
        sent = [{name: value for name, value in line.items() if name not in ("type", "id")} for line in peer.acts()]
    assert sent == [
        {"act": "say", "text": "Passo.", "language": "it"},
        {
            "act": "pick",
            "moves": [
                {"piece": "9", "start": {"x": 1.5, "y": 2.0, "angle": 90.0}, "end": {"x": 3.0, "y": 4.0, "angle": 0.0}},
                {"piece": "joker", "start": None, "end": {"x": 5.0, "y": 6.0, "angle": 0.0}},
            ],
        },
        {"act": "point", "x": 1.0, "y": 2.0},
        {"act": "gaze", "x": 1.0, "y": 2.0, "z": 3.0},
        {"act": "express", "label": "joy", "valence": 0.5, "arousal": -0.5},
    ]


async def test_the_robot_can_fail_hang_leave_and_come_back() -> None:
    async with robot() as peer, JsonLinesDriver(port=peer.port) as driver:
        performing = asyncio.create_task(attempt(driver, Say("one"), FAR_S))
        identity = await peer.act(1)
        peer.send(json.dumps({"type": "failed", "id": identity, "reason": "no voice"}))
        assert await performing == Failed("no voice")

        assert await attempt(driver, Say("two"), 0.01) == Failed("the robot did not finish within 0.01 s")
        await until(lambda: peer.got[-1] == {"type": "stop"})
        peer.send(json.dumps({"type": "done", "id": peer.acts()[1]["id"]}))  # Too late: nobody waits.

        performing = asyncio.create_task(attempt(driver, Say("three"), FAR_S))
        await peer.act(3)
        peer.hang_up()
        assert await performing == Failed("the robot has closed its socket")

        performing = asyncio.create_task(attempt(driver, Say("four"), FAR_S))
        identity = await peer.act(4)
        peer.send(json.dumps({"type": "done", "id": identity}))
        assert await performing == Done()
        assert peer.connections == 2


async def test_a_robot_that_is_not_there_is_named_with_its_address() -> None:
    driver = JsonLinesDriver(port=1)
    with pytest.raises(RobotError, match=r"no robot listens at 127\.0\.0\.1:1"):
        await driver.connect()
    outcome = await attempt(driver, Say("anyone?"), FAR_S)
    assert isinstance(outcome, Failed)
    assert "no robot listens" in outcome.reason


async def test_what_the_robot_perceives_is_reported_and_bad_lines_are_ignored(caplog: pytest.LogCaptureFixture) -> None:
    bad = {
        "nonsense": "ignored a line",
        "[1]": "must be a JSON object",
        '{"type": "dance"}': "'heard', 'affect' or 'button'",
        '{"type": "affect", "label": "joy", "valence": 2}': "`valence` is 2: it must be a number in -1..1",
        '{"type": "affect", "label": "joy", "source": "tea leaves"}': "`source` is 'tea leaves'",
        '{"type": "affect", "label": "joy", "seat": -1}': "`seat` is -1",
        '{"type": "heard"}': "`text` is None",
        # More than a floating-point number, than a time of the protocol, and than can be nested.
        f'{{"type": "affect", "label": "joy", "valence": {"9" * 400}}}': "it must be a number in -1..1",
        '{"type": "affect", "label": "joy", "taken_at": 1e300}': "it must be seconds since the Unix epoch",
        "[" * 50_000: "ignored a line of the robot: not JSON: maximum recursion depth",
    }
    good = {
        '{"type": "heard", "text": "hi", "confidence": 0.5}': Heard("hi", 0.5),
        '{"type": "button", "name": "chest"}': Button("chest"),
        '{"type": "affect", "label": "joy", "valence": 0.5, "source": "face", "seat": 2}': Affect(
            "joy", valence=0.5, source="face", seat=2
        ),
    }
    async with robot() as peer, JsonLinesDriver(port=peer.port) as driver:
        await until(lambda: peer.connections)
        for line in [*bad, *good]:
            peer.send(line)
        events = driver.events()
        assert [await anext(events) for _ in good] == list(good.values())
    for text in bad.values():
        assert text in caplog.text


async def test_events_and_states_of_the_game_are_shown() -> None:
    async with robot() as peer, JsonLinesDriver(port=peer.port) as driver:
        state = TableState(seat=1)
        for event in numbered(game_started(), shift_started()):
            state = follow(state, event)
            await driver.show_event(event)
        await driver.show_state(state)
        await until(lambda: len(peer.got) == 3)
    dealt, shown = peer.got[1:]
    assert (dealt["type"], dealt["kind"], dealt["sequence"], dealt["elapsed_ms"]) == ("event", "shift_started", 2, 200)
    assert dealt["fields"]["hands"][0]["golden"] is True
    assert (shown["type"], shown["seat"], shown["hand"][10], shown["golden"]) == ("state", 1, 5, True)


@pytest.mark.server
async def test_a_game_with_a_robot_that_leaves_in_the_middle_and_comes_back(server_address: str) -> None:
    notices: list[Notice] = []

    async def serve(peer: Robot, leave_after: int) -> None:
        """Does every act, but hangs up instead of one of them."""
        number = 0
        while True:
            number += 1
            identity = await peer.act(number)
            if number == leave_after:
                peer.hang_up()
            else:
                peer.send(json.dumps({"type": "done", "id": identity}))

    async with robot() as peer, aio.Client(server_address) as client:
        serving = asyncio.create_task(serve(peer, leave_after=6))
        made = await client.rooms.create("lines", seats=[None, "greedy", "random", "greedy"], rules=pb.RuleSet(target_shifts=1))
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT)
        driver = JsonLinesDriver(port=peer.port)
        result = await play_seat(client, seat.ticket, RandomAgent(7), driver, words=Words("en"), notify=notices.append)
        assert result.finished
        assert (result.late, result.invalid) == (0, 0)
        serving.cancel()
        assert peer.connections == 2
        lines = peer.got
    acts = [line for line in lines if line["type"] == "act"]
    lost = acts[5]
    assert [notice.reason for notice in notices if notice.kind in ("help", "unsaid")] == (
        ["the robot has closed its socket"] if lost["act"] in ("pick", "say") else []
    )
    # It heard of every event until it left, and again from when it was back.
    sequences = [line["sequence"] for line in lines if line["type"] == "event"]
    assert sequences == sorted(set(sequences))
    assert sequences[0] == 1
    assert [line["kind"] for line in lines if line["type"] == "event"][-1] == "game_ended"
