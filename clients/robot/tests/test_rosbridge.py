"""The driver `rosbridge` with a server of rosbridge's JSON protocol on loopback."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from chefshat_robot.drivers.driver import Button, CardMove, Done, Failed, Pick, Pose, RobotError, Say, attempt
from chefshat_robot.drivers.rosbridge import RosbridgeDriver
from chefshat_robot.table import TableState, follow
from tests.loop import until
from tests.robots import game_started, numbered, shift_started

pytest.importorskip("roslibpy")
server = pytest.importorskip("websockets.asyncio.server")
FAR_S = 3600.0
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


class Rosbridge:
    """What rosbridge does for one robot.

    Attributes:
        got: the messages received.
        port: where it listens.
        connections: how many clients have connected.
    """

    def __init__(self) -> None:
        self.got: list[dict[str, Any]] = []
        self.port = 0
        self.connections = 0
        self._socket: Any = None

    async def serve(self, socket: Any) -> None:
        self._socket = socket
        self.connections += 1
        async for message in socket:
            self.got.append(json.loads(message))

    def of(self, operation: str) -> list[dict[str, Any]]:
        return [message for message in self.got if message["op"] == operation]

    async def find(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Waits for a message."""
        await until(lambda: any(map(wanted, self.got)))
        return next(filter(wanted, self.got))

    async def goal(self, text: str) -> dict[str, Any]:
        """Waits for the goal that says a text."""
        return await self.find(lambda message: message["op"] == "send_action_goal" and message["args"]["acts"][0]["text"] == text)

    async def send(self, **message: Any) -> None:
        await self._socket.send(json.dumps(message))

    async def finish(self, goal: dict[str, Any], status: int, values: object, *, result: bool = True) -> None:
        await self.send(op="action_result", id=goal["id"], action=goal["action"], values=values, status=status, result=result)

    async def hang_up(self) -> None:
        await self._socket.close()


@asynccontextmanager
async def pair() -> AsyncIterator[tuple[RosbridgeDriver, Rosbridge]]:
    bridge = Rosbridge()
    async with server.serve(bridge.serve, "127.0.0.1", 0) as listening:
        bridge.port = listening.sockets[0].getsockname()[1]
        async with RosbridgeDriver(port=bridge.port) as driver:
            await until(lambda: bridge.of("advertise_service"))
            yield driver, bridge


async def test_everything_is_declared_with_its_type() -> None:
    async with pair() as (_, bridge):
        (service,) = bridge.of("advertise_service")
        assert (service["service"], service["type"]) == ("/chefshat/get_table", "chefshat_msgs/srv/GetTable")
        advertised = {message["topic"]: message["type"] for message in bridge.of("advertise")}
        types = "chefshat_msgs/msg"
        assert advertised == {"/chefshat/event": f"{types}/GameEvent", "/chefshat/state": f"{types}/TableState"}
        (subscribed,) = bridge.of("subscribe")
        assert (subscribed["topic"], subscribed["type"]) == ("/chefshat/robot_event", "chefshat_msgs/msg/RobotEvent")


async def test_acts_are_goals_and_can_succeed_fail_hang_and_be_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chefshat_robot.drivers.rosbridge.CONNECT_S", FAR_S)
    async with pair() as (driver, bridge):
        performing = asyncio.create_task(attempt(driver, Say("one"), FAR_S))
        goal = await bridge.goal("one")
        assert (goal["action"], goal["action_type"]) == ("/chefshat/play_turn", "chefshat_msgs/action/PlayTurn")
        await bridge.send(op="action_feedback", id=goal["id"], action=goal["action"], values={"act": 0})
        await bridge.finish(goal, SUCCEEDED, {"done": True, "performed": 1, "reason": ""})
        assert await performing == Done()

        for text, values, result in (("two", {"done": False, "reason": "no voice"}, True), ("three", "no voice", False)):
            performing = asyncio.create_task(attempt(driver, Say(text), FAR_S))
            await bridge.finish(await bridge.goal(text), ABORTED, values, result=result)
            assert await performing == Failed("no voice")

        assert await attempt(driver, Say("four"), 0.2) == Failed("the robot did not finish within 0.2 s")
        goal = await bridge.goal("four")
        cancelled = await bridge.find(lambda message: message["op"] == "cancel_action_goal")
        assert cancelled["id"] == goal["id"]
        await bridge.finish(goal, CANCELED, {"done": False, "reason": "cancelled"})  # Nobody waits for it.

        performing = asyncio.create_task(attempt(driver, Say("five"), FAR_S))
        await bridge.goal("five")
        await bridge.hang_up()
        assert await performing == Failed("the connection to rosbridge was lost")

        pick = Pick((CardMove("9", Pose(0.0, 0.0), Pose(0.0, 0.0)),))
        performing = asyncio.create_task(attempt(driver, pick, FAR_S))
        goal = await bridge.goal("")
        assert goal["args"]["acts"][0]["moves"][0]["piece"] == "9"
        await bridge.finish(goal, SUCCEEDED, {"done": True})
        assert await performing == Done()
        assert bridge.connections == 2


async def test_events_states_and_the_table_are_served_and_the_robot_is_heard(caplog: pytest.LogCaptureFixture) -> None:
    async with pair() as (driver, bridge):
        state = TableState(seat=1)
        for event in numbered(game_started(), shift_started()):
            state = follow(state, event)
            await driver.show_event(event)
        await driver.show_state(state)
        shown = await bridge.find(lambda message: message["op"] == "publish" and message["topic"] == "/chefshat/state")
        assert (shown["msg"]["seat"], shown["msg"]["hand"][10]) == (1, 5)
        events = [message["msg"] for message in bridge.of("publish") if message["topic"] == "/chefshat/event"]
        assert [event["kind"] for event in events] == ["game_started", "shift_started"]

        await bridge.send(op="call_service", id="q1", service="/chefshat/get_table", args={})
        reply = await bridge.find(lambda message: message["op"] == "service_response")
        assert (reply["id"], reply["result"], reply["values"]["state"]) == ("q1", True, shown["msg"])

        bad = {"kind": "affect", "label": "joy", "valence": 7.0, "arousal": None, "dominance": None, "confidence": None}
        good = {"kind": "button", "name": "chest", "text": "", "label": "", "source": "", "seat": -1}
        for message in (bad, good):
            await bridge.send(op="publish", topic="/chefshat/robot_event", msg=message)
        assert await anext(driver.events()) == Button("chest")
    assert "`valence` is 7.0" in caplog.text


async def test_a_bridge_that_is_not_there_is_an_error_that_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chefshat_robot.drivers.rosbridge.CONNECT_S", 0.2)

    with pytest.raises(RobotError, match=r"no rosbridge answers at 127\.0\.0\.1:1: start it"):
        await RosbridgeDriver(port=1).connect()
