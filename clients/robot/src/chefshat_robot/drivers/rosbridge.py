"""The driver `rosbridge`: a ROS 2 robot behind rosbridge_suite, whose websocket speaks JSON.

Names and types are those of the driver `ros2`: the action `/chefshat/play_turn`, the topics `/chefshat/robot_event`,
`/chefshat/event` and `/chefshat/state`, and the service `/chefshat/get_table`. The robot's workspace needs the package
`chefshat_msgs` (folder `ros2`).
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from chefshat import pb

from chefshat_robot.drivers import ros_messages
from chefshat_robot.drivers.cdr import PACKAGE
from chefshat_robot.drivers.driver import LOG, Act, Driver, Outcome, Replies, RobotError, require
from chefshat_robot.table import TableState

# Seconds in which the connection must be open. A lost one is opened again in the background.
CONNECT_S = 5.0


class RosbridgeDriver(Driver):
    """A ROS 2 robot behind rosbridge."""

    def __init__(self, host: str = "127.0.0.1", port: int = 9090, namespace: str = "/chefshat") -> None:
        """Sets the address.

        Args:
            host: where rosbridge runs.
            port: its port.
            namespace: first part of all names.
        """
        super().__init__()
        self._roslibpy = require("roslibpy", "rosbridge")
        self._address = (host, port)
        self._namespace = namespace
        self._ros: Any = None
        self._action: Any = None
        self._topics: dict[str, Any] = {}
        self._goal: str | None = None
        self._replies = Replies()
        self._state = TableState()
        self._loop: asyncio.AbstractEventLoop | None = None

    @property
    def connected(self) -> bool:
        """Whether the websocket is open."""
        return self._ros is not None and self._ros.is_connected

    async def connect(self) -> None:
        """Opens the websocket, or waits until a lost one is open again."""
        self._loop = asyncio.get_running_loop()
        host, port = self._address
        opened = asyncio.Event()
        first = self._ros is None
        if first:
            # Its own thread runs the connection; it calls back from there.
            self._ros = self._roslibpy.Ros(host, port, transport="asyncio")
        self._ros.on_ready(self._in_loop(opened.set), run_in_thread=False)
        try:
            await asyncio.wait_for(opened.wait(), CONNECT_S)
        except TimeoutError:
            if first:
                await self.close()
            raise RobotError(f"no rosbridge answers at {host}:{port}: start it, or give host= and port=") from None
        if first:
            self._declare()

    async def perform(self, act: Act) -> Outcome:
        """Sends a goal of one act, and waits for its result."""
        number, outcome = self._replies.expect()

        def ended(result: Mapping[str, Any]) -> None:
            values = result["values"]
            # If the action fails, rosbridge may send its reason as a text.
            known = values if isinstance(values, Mapping) else {"reason": str(values)}
            done = known.get("done", False) and result["status"] == self._roslibpy.GoalStatus.SUCCEEDED
            self._replies.settle(number, ros_messages.outcome_of({**known, "done": done}))

        callback = self._in_loop(ended)
        goal = {"acts": [ros_messages.act_message(act)]}
        try:
            self._goal = self._action.send_goal(goal, callback, lambda feedback: None, callback)
            return await outcome
        finally:
            outcome.cancel()

    async def stop(self) -> None:
        """Cancels the goal."""
        if self._goal is not None and self.connected:
            self._action.cancel_goal(self._goal)

    async def show_event(self, event: pb.GameEvent) -> None:
        """Publishes the event."""
        self._publish("event", ros_messages.event_message(event))

    async def show_state(self, state: TableState) -> None:
        """Publishes the state."""
        self._state = state
        self._publish("state", ros_messages.state_message(state))

    async def close(self) -> None:
        """Closes the websocket."""
        ros, self._ros = self._ros, None
        if ros is None:
            return
        if ros.is_connected:
            await asyncio.to_thread(ros.close)
        # Without a connection there is nothing to close, but attempts to open one continue until they are stopped.
        ros.factory._stop = True

    def _declare(self) -> None:
        """Declares the action, topics and service. roslibpy repeats it after a lost connection."""
        ros = self._ros
        self._action = self._roslibpy.ActionClient(ros, self._name("play_turn"), f"{PACKAGE}/action/PlayTurn")
        for topic, kind in (("event", "GameEvent"), ("state", "TableState"), ("robot_event", "RobotEvent")):
            self._topics[topic] = self._roslibpy.Topic(ros, self._name(topic), f"{PACKAGE}/msg/{kind}")
        self._topics["robot_event"].subscribe(self._in_loop(self._perceived))
        for topic in ("event", "state"):
            self._topics[topic].advertise()
        self._service = self._roslibpy.Service(ros, self._name("get_table"), f"{PACKAGE}/srv/GetTable")
        self._service.advertise(self._asked)
        ros.on("close", self._in_loop(lambda _: self._replies.lost("the connection to rosbridge was lost")))

    def _name(self, name: str) -> str:
        return f"{self._namespace}/{name}"

    def _publish(self, topic: str, message: dict[str, Any]) -> None:
        if self.connected:
            self._topics[topic].publish(self._roslibpy.Message(message))

    def _perceived(self, message: Mapping[str, Any]) -> None:
        try:
            self.report(ros_messages.robot_event_of(message))
        except (TypeError, ValueError) as error:
            LOG.warning("ignored an event of the robot: %s", error)

    def _asked(self, request: object, response: dict[str, Any]) -> bool:
        """Answers a call of the service `get_table`, in roslibpy's thread."""
        response["state"] = ros_messages.state_message(self._state)
        return True

    def _in_loop(self, function: Callable[..., object]) -> Callable[..., None]:
        """Returns a function for roslibpy's thread, which calls `function` in this driver's loop."""
        loop = self._loop

        def call(*arguments: object) -> None:
            if loop is not None and not loop.is_closed():
                loop.call_soon_threadsafe(function, *arguments)

        return call
