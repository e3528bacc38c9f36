"""The driver `ros2`: a ROS 2 robot, through Zenoh. No ROS installation is needed here.

The robot's side runs `zenoh-bridge-ros2dds`, and any RMW on DDS. This driver follows that bridge's convention: a topic, service or
action `/chefshat/x` has the key `chefshat/x`, and payloads are CDR with its header of four bytes, without the bridge's optional
attachments. (`rmw_zenoh` uses other keys, with type hashes; with it, use `rosbridge`.)

| name | kind | type (`ros2/chefshat_msgs`) | who offers it |
|---|---|---|---|
| `/chefshat/play_turn` | action | PlayTurn | the robot: performs acts |
| `/chefshat/robot_event` | topic | RobotEvent | the robot: what it hears, reads in faces, its buttons |
| `/chefshat/event` | topic | GameEvent | this driver: every event of the game |
| `/chefshat/state` | topic | TableState | this driver: the table after each event |
| `/chefshat/get_table` | service | GetTable | this driver: the table now |

An act that takes too long is cancelled as an action.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import uuid
from typing import Any

from chefshat import pb

from chefshat_robot.drivers import ros_messages
from chefshat_robot.drivers.cdr import Cdr
from chefshat_robot.drivers.driver import LOG, Act, Driver, Failed, Outcome, RobotError, describe, require
from chefshat_robot.table import TableState

# Seconds in which the robot must accept a goal, and answer a cancellation.
ACCEPT_S = 5.0
# Seconds for a result. Acts have shorter limits of their own.
RESULT_S = 600.0
# action_msgs/msg/GoalStatus.
SUCCEEDED = 4


class Ros2Driver(Driver):
    """A ROS 2 robot behind zenoh-bridge-ros2dds."""

    def __init__(self, connect: str = "", listen: str = "", namespace: str = "chefshat", multicast: bool = True) -> None:
        """Configures the Zenoh session.

        Args:
            connect: endpoint of the bridge or a router, for instance tcp/192.168.1.7:7447; empty: found by multicast.
            listen: endpoint to listen on, for a bridge that connects to this driver; empty: any.
            namespace: first part of all names.
            multicast: whether to look for others on the local network.
        """
        super().__init__()
        self._zenoh = require("zenoh", "ros2")
        self._cdr = Cdr()
        self._config = self._zenoh.Config()
        for endpoints, where in ((connect, "connect"), (listen, "listen")):
            if endpoints:
                self._config.insert_json5(f"{where}/endpoints", json.dumps([endpoints]))
        self._config.insert_json5("scouting/multicast/enabled", json.dumps(multicast))
        self._namespace = namespace
        self._session: Any = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._goal = bytes(16)
        self._state = TableState()

    @property
    def connected(self) -> bool:
        """Whether the session is open. Zenoh finds the robot again by itself."""
        return self._session is not None

    async def connect(self) -> None:
        """Opens the session, and offers the service."""
        self._loop = asyncio.get_running_loop()
        try:
            session = await asyncio.to_thread(self._zenoh.open, self._config)
        except Exception as error:
            raise RobotError(f"no Zenoh session: {describe(error)}. Check the endpoints connect= and listen=") from error
        self._session = session
        session.declare_subscriber(self._key("robot_event"), self._perceived)
        session.declare_queryable(self._key("get_table"), self._asked)

    async def perform(self, act: Act) -> Outcome:
        """Sends a goal of one act, and waits for its result."""
        self._goal = uuid.uuid4().bytes
        goal_id = {"uuid": list(self._goal)}
        request = {"goal_id": goal_id, "goal": {"acts": [ros_messages.act_message(act)]}}
        try:
            reply = await self._call("play_turn/_action/send_goal", "PlayTurn_SendGoal", request, ACCEPT_S)
        except RobotError:
            # The robot may only be slow, and would do later what people are asked for now.
            with contextlib.suppress(RobotError):
                await self.stop()
            raise
        if not reply["accepted"]:
            return Failed("the robot refused the goal")
        answer = await self._call("play_turn/_action/get_result", "PlayTurn_GetResult", {"goal_id": goal_id}, RESULT_S)
        result = answer["result"]
        return ros_messages.outcome_of({**result, "done": result["done"] and answer["status"] == SUCCEEDED})

    async def stop(self) -> None:
        """Cancels the goal."""
        info = {"goal_id": {"uuid": list(self._goal)}, "stamp": {"sec": 0, "nanosec": 0}}
        await self._call("play_turn/_action/cancel_goal", "CancelGoal", {"goal_info": info}, ACCEPT_S)

    async def show_event(self, event: pb.GameEvent) -> None:
        """Publishes the event."""
        await self._publish("event", "GameEvent", ros_messages.event_message(event))

    async def show_state(self, state: TableState) -> None:
        """Publishes the state."""
        self._state = state
        await self._publish("state", "TableState", ros_messages.state_message(state))

    async def close(self) -> None:
        """Closes the session."""
        session, self._session = self._session, None
        if session is not None:
            await asyncio.to_thread(session.close)

    def _key(self, name: str) -> str:
        return f"{self._namespace}/{name}"

    async def _publish(self, topic: str, kind: str, message: dict[str, Any]) -> None:
        if self._session is not None:
            await asyncio.to_thread(self._session.put, self._key(topic), self._cdr.encode(kind, message))

    async def _call(self, service: str, kind: str, request: dict[str, Any], timeout_s: float) -> dict[str, Any]:
        """Calls a service of the robot.

        Raises:
            RobotError: nobody offers it, it did not answer in time, or the robot left.
        """
        loop = asyncio.get_running_loop()
        answered: asyncio.Future[bytes] = loop.create_future()

        def settle(data: bytes | None) -> None:
            if answered.done():
                return
            if data is None:
                answered.set_exception(RobotError(f"no robot answers at {self._key(service)}: start its node and the bridge"))
            else:
                answered.set_result(data)

        # Both are called by Zenoh's threads; the second after the last reply, or if there is none.
        def replied(reply: Any) -> None:  # noqa: ANN401 (zenoh.Reply)
            if reply.ok is not None:
                loop.call_soon_threadsafe(settle, reply.ok.payload.to_bytes())

        def ended() -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(settle, None)

        payload = self._cdr.encode(f"{kind}_Request", request)
        handler = self._zenoh.handlers.Callback(replied, ended)
        await asyncio.to_thread(self._session.get, self._key(service), handler, payload=payload, timeout=timeout_s)
        return self._cdr.decode(f"{kind}_Response", await answered)

    def _perceived(self, sample: Any) -> None:  # noqa: ANN401 (zenoh.Sample)
        """Receives a message of the topic `robot_event`. Called by Zenoh's threads."""
        try:
            event = ros_messages.robot_event_of(self._cdr.decode("RobotEvent", sample.payload.to_bytes()))
        except (RobotError, ValueError) as error:
            LOG.warning("ignored an event of the robot: %s", error)
            return
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self.report, event)

    def _asked(self, query: Any) -> None:  # noqa: ANN401 (zenoh.Query)
        """Answers a call of the service `get_table`. Called by Zenoh's threads."""
        state = {"state": ros_messages.state_message(self._state)}
        query.reply(self._key("get_table"), self._cdr.encode("GetTable_Response", state))
        query.drop()
