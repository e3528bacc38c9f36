"""The driver `jsonlines`: a robot behind a TCP socket that speaks JSON, one object a line. The simplest way to connect any robot.

The robot listens; the driver connects. To the robot:

    {"type": "act", "id": "7", "act": "say", "text": "I pass.", "language": "en"}    acts as in `chefshat_robot.wire`
    {"type": "stop"}                                                                 the act took too long: stop it
    {"type": "event", "sequence": 12, "elapsed_ms": 3456, "kind": "play", "fields": {...}}   an event
    {"type": "state", "seat": 2, "hand": [0, 1, ...], "to_act": 3, ...}              the table after it

From the robot, in any order:

    {"type": "done", "id": "7"}
    {"type": "failed", "id": "7", "reason": "the gripper lost the card"}
    {"type": "heard", "text": "..."}, {"type": "affect", "label": "joy", ...}, {"type": "button", "name": "chest"}
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Mapping
from typing import Any

from chefshat import pb

from chefshat_robot import wire
from chefshat_robot.drivers.driver import LOG, Act, Done, Driver, Failed, Outcome, Replies, RobotError
from chefshat_robot.table import TableState


class JsonLinesDriver(Driver):
    """A robot that speaks JSON lines."""

    def __init__(self, host: str = "127.0.0.1", port: int = 7700) -> None:
        """Sets the address.

        Args:
            host: where the robot listens.
            port: its TCP port.
        """
        super().__init__()
        self._address = (host, port)
        self._writer: asyncio.StreamWriter | None = None
        self._reader: asyncio.Task[None] | None = None
        self._replies = Replies()

    @property
    def connected(self) -> bool:
        """Whether the socket is open."""
        return self._writer is not None

    async def connect(self) -> None:
        """Opens the socket."""
        host, port = self._address
        try:
            reader, self._writer = await asyncio.open_connection(host, port)
        except OSError as error:
            raise RobotError(f"no robot listens at {host}:{port} ({error}): start its program, or give host= and port=") from error
        self._reader = asyncio.create_task(self._read(reader, self._writer), name="robot replies")

    async def perform(self, act: Act) -> Outcome:
        """Sends the act, and waits for `done` or `failed`."""
        number, outcome = self._replies.expect()
        try:
            await self._send({"type": "act", "id": number, **wire.act_to_json(act)})
            return await outcome
        finally:
            outcome.cancel()

    async def stop(self) -> None:
        """Sends `stop`."""
        await self._send({"type": "stop"})

    async def show_event(self, event: pb.GameEvent) -> None:
        """Sends the event."""
        if self.connected:
            await self._send({"type": "event", **wire.event_to_json(event)})

    async def show_state(self, state: TableState) -> None:
        """Sends the state."""
        if self.connected:
            await self._send({"type": "state", **wire.state_to_json(state)})

    async def close(self) -> None:
        """Closes the socket."""
        if self._writer is not None:
            self._writer.close()
        if self._reader is not None:
            self._reader.cancel()
            await asyncio.gather(self._reader, return_exceptions=True)

    async def _send(self, message: dict[str, Any]) -> None:
        writer = self._writer
        if writer is None:
            raise RobotError("the robot has closed its socket")
        writer.write(json.dumps(message, ensure_ascii=False).encode() + b"\n")
        await writer.drain()

    async def _read(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Reads the robot's lines until it is gone."""
        try:
            while line := await reader.readline():
                self._receive(line)
        except (OSError, ValueError) as error:
            LOG.warning("the robot's socket failed: %s", error)
        finally:
            if self._writer is writer:
                self._writer = None
            writer.close()
            self._replies.lost("the robot has closed its socket")

    def _receive(self, line: bytes) -> None:
        """Processes a line. A bad one is logged and ignored."""
        try:
            message = wire.parse(line)
            match message.get("type"):
                case "done":
                    self._settle(message, Done())
                case "failed":
                    self._settle(message, Failed(str(message.get("reason") or "the robot gave no reason")))
                case _:
                    self.report(wire.robot_event_from_json(message))
        except ValueError as error:
            LOG.warning("ignored a line of the robot: %s", error)

    def _settle(self, message: Mapping[str, Any], outcome: Outcome) -> None:
        if not self._replies.settle(str(message.get("id")), outcome):
            LOG.info("the robot answered act %r, which nobody waits for", message.get("id"))
