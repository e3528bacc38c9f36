"""The driver `ros2`: two Zenoh sessions on loopback, one of them a ROS 2 robot as zenoh-bridge-ros2dds presents it."""

from __future__ import annotations

import asyncio
import math
import socket
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from chefshat_robot.drivers import ros2
from chefshat_robot.drivers.cdr import FOLDER, Cdr
from chefshat_robot.drivers.driver import (
    Affect,
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
from chefshat_robot.drivers.ros2 import Ros2Driver
from chefshat_robot.table import TableState, follow
from tests.loop import until
from tests.robots import game_started, numbered, shift_started

zenoh = pytest.importorskip("zenoh")
FAR_S = 3600.0
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
GREETING = "hello?"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class RosRobot:
    """A robot's action server, topics and service client.

    Attributes:
        greeted: whether a greeting has reached it, which it refuses.
        goals: the other goals received.
        cancelled: ids of those that were cancelled.
        heard: what it received on the topics, as (type, message).
    """

    def __init__(self, port: int) -> None:
        config = zenoh.Config()
        config.insert_json5("connect/endpoints", f'["tcp/127.0.0.1:{port}"]')
        config.insert_json5("scouting/multicast/enabled", "false")
        self.session = zenoh.open(config)
        self.cdr = Cdr()
        self.goals: list[dict[str, Any]] = []
        self.cancelled: list[list[int]] = []
        self.heard: list[tuple[str, dict[str, Any]]] = []
        self.accepts = True
        self.hesitates = False
        self.greeted = False
        self._results: list[tuple[Any, dict[str, Any]]] = []
        self._lock = threading.Lock()
        # Declared in this order: when the first act arrives, the driver knows the subscribers, too.
        self.session.declare_subscriber("chefshat/event", lambda sample: self._hear("GameEvent", sample))
        self.session.declare_subscriber("chefshat/state", lambda sample: self._hear("TableState", sample))
        action = "chefshat/play_turn/_action"
        self.session.declare_queryable(f"{action}/cancel_goal", self._cancel)
        self.session.declare_queryable(f"{action}/get_result", self._wait)
        self.session.declare_queryable(f"{action}/send_goal", self._goal)

    def _hear(self, kind: str, sample: Any) -> None:
        self.heard.append((kind, self.cdr.decode(kind, bytes(sample.payload))))

    def _goal(self, query: Any) -> None:
        goal = self.cdr.decode("PlayTurn_SendGoal_Request", bytes(query.payload))
        # However late a greeting arrives, it is not one of the goals.
        greets = goal["goal"]["acts"][0]["text"] == GREETING
        if greets:
            self.greeted = True
        else:
            self.goals.append(goal)
        if self.hesitates and not greets:
            self._results.append((query, goal))
            return
        reply = {"accepted": self.accepts and not greets, "stamp": {"sec": 1, "nanosec": 2}}
        query.reply(query.key_expr, self.cdr.encode("PlayTurn_SendGoal_Response", reply))
        query.drop()

    def _wait(self, query: Any) -> None:
        with self._lock:
            self._results.append((query, self.cdr.decode("PlayTurn_GetResult_Request", bytes(query.payload))))

    def _cancel(self, query: Any) -> None:
        request = self.cdr.decode("CancelGoal_Request", bytes(query.payload))
        cancelled = request["goal_info"]["goal_id"]["uuid"]
        if any(goal["goal_id"]["uuid"] == cancelled for goal in self.goals):
            self.cancelled.append(cancelled)
        query.reply(query.key_expr, self.cdr.encode("CancelGoal_Response", {"return_code": 0, "goals_canceling": []}))
        query.drop()

    @property
    def waits(self) -> int:
        return len(self._results)

    def finish(self, status: int, *, done: bool, reason: str = "") -> None:
        """Answers the oldest wait for a result."""
        with self._lock:
            query, request = self._results.pop(0)
        assert request["goal_id"] == self.goals[-1]["goal_id"]
        result = {"done": done, "performed": int(done), "reason": reason}
        query.reply(query.key_expr, self.cdr.encode("PlayTurn_GetResult_Response", {"status": status, "result": result}))
        query.drop()

    def forget_waits(self) -> None:
        with self._lock:
            for query, _ in self._results:
                query.drop()
            self._results.clear()

    def close(self) -> None:
        self.forget_waits()
        self.session.close()


@asynccontextmanager
async def pair() -> AsyncIterator[tuple[Ros2Driver, RosRobot]]:
    """A driver and a robot that know each other."""
    port = free_port()
    async with Ros2Driver(listen=f"tcp/127.0.0.1:{port}", multicast=False) as driver:
        robot = await asyncio.to_thread(RosRobot, port)
        try:
            # Declarations travel; the robot is there when a first act reaches it.
            while not robot.greeted:
                await attempt(driver, Say(GREETING), 0.05)
                await asyncio.sleep(0.005)
            yield driver, robot
        finally:
            await asyncio.to_thread(robot.close)


async def test_acts_are_goals_of_the_action_in_metres_and_radians() -> None:
    async with pair() as (driver, robot):
        pick = Pick((CardMove("golden", Pose(100.0, 200.0, 90.0), Pose(300.0, 400.0)), CardMove("pass", None, Pose(0.0, 0.0))))
        for act in (Say("Ciao", "it"), pick, Point(10.0, 20.0), Gaze(10.0, 20.0, 30.0), Express("joy", 0.5, -0.25)):
            performing = asyncio.create_task(attempt(driver, act, FAR_S))
            await until(lambda: robot.waits)
            robot.finish(SUCCEEDED, done=True)
            assert await performing == Done()
        say, laid, point, gaze, express = [goal["goal"]["acts"][0] for goal in robot.goals]
        assert (say["kind"], say["text"], say["language"]) == (1, "Ciao", "it")
        first, second = laid["moves"]
        assert (first["piece"], first["start_known"], second["start_known"]) == ("golden", True, False)
        assert first["start"]["position"] == {"x": 0.1, "y": -0.2, "z": 0.0}
        assert first["start"]["orientation"]["z"] == pytest.approx(-math.sqrt(0.5))
        assert first["end"]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
        assert point["target"] == {"x": 0.01, "y": -0.02, "z": 0.0}
        assert (gaze["kind"], gaze["target"]["z"]) == (4, 0.03)
        assert (express["label"], express["valence"], express["arousal"]) == ("joy", 0.5, -0.25)


async def test_the_robot_can_fail_refuse_hang_and_leave() -> None:
    async with pair() as (driver, robot):
        performing = asyncio.create_task(attempt(driver, Say("one"), FAR_S))
        await until(lambda: robot.waits)
        robot.finish(ABORTED, done=False, reason="no voice")
        assert await performing == Failed("no voice")

        assert await attempt(driver, Say("two"), 0.3) == Failed("the robot did not finish within 0.3 s")
        await until(lambda: len(robot.goals) == 2 and robot.cancelled == [robot.goals[1]["goal_id"]["uuid"]])
        robot.forget_waits()

        robot.accepts = False
        assert await attempt(driver, Say("three"), FAR_S) == Failed("the robot refused the goal")
        robot.accepts = True

        performing = asyncio.create_task(attempt(driver, Say("four"), FAR_S))
        await until(lambda: robot.waits)
        await asyncio.to_thread(robot.close)
        outcome = await performing
        assert isinstance(outcome, Failed)
        assert "no robot answers at chefshat/play_turn/_action/get_result" in outcome.reason


async def test_an_act_that_is_not_accepted_in_time_is_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    async with pair() as (driver, robot):
        monkeypatch.setattr(ros2, "ACCEPT_S", 0.3)
        robot.hesitates = True
        outcome = await attempt(driver, Say("one"), FAR_S)
        assert isinstance(outcome, Failed)
        await until(lambda: robot.goals and robot.cancelled == [robot.goals[0]["goal_id"]["uuid"]])


async def test_events_and_states_are_topics_and_the_table_is_a_service() -> None:
    async with pair() as (driver, robot):
        state = TableState(seat=1)
        for event in numbered(game_started(), shift_started()):
            state = follow(state, event)
            await driver.show_event(event)
            await driver.show_state(state)
        await until(lambda: len(robot.heard) == 4)
        # Topics keep their order, but not among each other.
        _, dealt = [message for kind, message in robot.heard if kind == "GameEvent"]
        _, shown = [message for kind, message in robot.heard if kind == "TableState"]
        assert (dealt["sequence"], dealt["elapsed_ms"], dealt["kind"]) == (2, 200, "shift_started")
        assert '"golden": true' in dealt["fields"]
        hand = [0, 2, 0, 0, 1, 0, 1, 0, 3, 3, 5, 2]
        assert (shown["seat"], shown["hand"], shown["golden"], shown["to_act"]) == (1, hand, True, -1)
        replies = await asyncio.to_thread(
            lambda: list(robot.session.get("chefshat/get_table", payload=robot.cdr.encode("GetTable_Request", {})))
        )
        table = robot.cdr.decode("GetTable_Response", bytes(replies[0].ok.payload))["state"]
        assert table == shown
        assert table["names"] == ["Ada", "Pepe", "Cleo", "Dan"]


async def test_what_the_robot_perceives_is_a_topic(caplog: pytest.LogCaptureFixture) -> None:
    unknown = {"text": "", "name": "", "label": "", "source": "", "seat": -1}
    unknown |= dict.fromkeys(("valence", "arousal", "dominance", "confidence"), math.nan)
    async with pair() as (driver, robot):
        events = driver.events()
        robot.session.put("chefshat/robot_event", b"nonsense")
        for message in (
            {"kind": "heard", "text": "ciao", "confidence": 0.5},
            {"kind": "affect", "label": "joy", "valence": 0.25, "source": "face", "seat": 2},
        ):
            robot.session.put("chefshat/robot_event", robot.cdr.encode("RobotEvent", {**unknown, **message}))
        assert await anext(events) == Heard("ciao", 0.5)
        assert await anext(events) == Affect("joy", valence=0.25, source="face", seat=2)
    assert "are not a message RobotEvent" in caplog.text


async def test_a_robot_that_is_not_there_is_an_error_that_says_what_to_do() -> None:
    async with Ros2Driver(listen=f"tcp/127.0.0.1:{free_port()}", multicast=False) as driver:
        outcome = await attempt(driver, Say("anyone?"), FAR_S)
        assert isinstance(outcome, Failed)
        assert "start its node and the bridge" in outcome.reason
    with pytest.raises(RobotError, match="no Zenoh session"):
        await Ros2Driver(connect="carrier-pigeon/7447", multicast=False).connect()


def test_cdr_is_that_of_ros_2() -> None:
    cdr = Cdr()
    # Header, then "hi" with its length and its zero byte, "it", and so on: written by hand after the CDR rules.
    expected = bytes.fromhex(
        "00010000"  # CDR, little-endian
        "01000000"  # kind, padded to the next length
        "03000000686900"  # text
        "00"
        "03000000697400"  # language
        "00"
        "00000000"  # no moves
    )
    message = {"kind": 1, "text": "hi", "language": "it", "moves": [], "target": {"x": 0.0, "y": 0.0, "z": 0.0}, "label": ""}
    assert cdr.encode("Act", {**message, "valence": 0.0, "arousal": 0.0}).startswith(expected)
    assert cdr.encode("GetTable_Request", {}) == bytes.fromhex("0001000000")


def test_the_types_are_listed_for_the_ros_build() -> None:
    listed = (FOLDER / "CMakeLists.txt").read_text()
    for folder in ("msg", "srv", "action"):
        for file in (FOLDER / folder).iterdir():
            assert f'"{folder}/{file.name}"' in listed
