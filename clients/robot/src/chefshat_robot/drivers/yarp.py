"""The driver `yarp`: a YARP robot, for instance iCub. It speaks YARP's text protocol; no YARP installation is needed here.

The robot's module has an RPC port, by default `/chefshat/robot/rpc:i`. The driver asks the name server where it is, connects in
text mode, and sends a bottle for each act; the module replies `ok` when the act has ended, or `failed "reason"` (vocabs `[ok]` and
`[failed]` do as well). Lengths are millimetres of the playing field, angles degrees clockwise:

    say "I pass." "en"
    pick ("9" (230.0 530.0 0.0) (97.5 151.0 0.0)) ("pass" () (280.0 348.0 90.0))      piece, from, to; () if only the robot knows
    point 280.0 200.0
    gaze 280.0 -350.0 450.0
    express "joy" 0.8 0.5                                                            valence and arousal, -1..1
    stop                                                                             the act took too long
    event 12 3456 "play" "{...}"                                                     sequence, elapsed_ms, kind, fields as JSON

Events need no reply. If the module has an output port, by default `/chefshat/robot/events:o`, the driver reads from it
while it is there, also if it starts later or again

    heard "words" 0.9
    button "name"
    affect "joy" 0.8 0.5 "face" 2                                                    valence, arousal, source, seat
"""

from __future__ import annotations

import asyncio
import json
import re

from chefshat import pb

from chefshat_robot import wire
from chefshat_robot.drivers import bottle
from chefshat_robot.drivers.bottle import BottleError, Item, Word
from chefshat_robot.drivers.driver import (
    LOG,
    Act,
    CardMove,
    Done,
    Driver,
    Express,
    Failed,
    Gaze,
    Outcome,
    Pick,
    Point,
    Pose,
    RobotError,
    RobotEvent,
    Say,
)

OWN_NAME = "/chefshat/driver"
_REGISTRATION = re.compile(r"registration name (\S+) ip (\S+) port (\d+)")
# Seconds for finding a port and connecting to it.
CONNECT_S = 5.0
# Seconds until the port with what the robot perceives is looked for again.
REOPEN_S = 5.0


class YarpDriver(Driver):
    """A YARP robot with an RPC port for acts."""

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 10000,
        rpc: str = "/chefshat/robot/rpc:i",
        events: str = "/chefshat/robot/events:o",
    ) -> None:
        """Sets the ports.

        Args:
            host: where the name server runs.
            port: its port.
            rpc: name of the robot's port for acts.
            events: name of the robot's port with what it perceives.
        """
        super().__init__()
        self._name_server = (host, port)
        self._rpc = rpc
        self._events_port = events
        self._reader: asyncio.StreamReader | None = None
        self._writer: asyncio.StreamWriter | None = None
        self._listener: asyncio.Task[None] | None = None
        # The port answers requests in order, so only one may be on its way.
        self._turn = asyncio.Lock()

    @property
    def connected(self) -> bool:
        """Whether the connection to the RPC port is open."""
        reader = self._reader
        return reader is not None and not reader.at_eof() and reader.exception() is None

    async def connect(self) -> None:
        """Finds the robot's ports, and connects to them."""
        self._hang_up()
        self._reader, self._writer = await self._open(self._rpc)
        if self._listener is None or self._listener.done():
            self._listener = asyncio.create_task(self._listen(), name="yarp events")

    async def perform(self, act: Act) -> Outcome:
        """Sends the act's bottle, and waits for the reply."""
        reply = await self._ask(_act(act))
        match reply:
            case ["ok", *_]:
                return Done()
            case ["failed" | "fail", reason, *_]:
                return Failed(str(reason))
            case _:
                return Failed(f"the robot replied {bottle.write(reply)}")

    async def stop(self) -> None:
        """Sends `stop`, over a new connection: the reply to the act may still come on the old one."""
        if not self.connected:
            await self.connect()
        await self._ask([Word("stop")])

    async def show_event(self, event: pb.GameEvent) -> None:
        """Sends the event."""
        if self._writer is None:
            return
        message = wire.event_to_json(event)
        fields = json.dumps(message.pop("fields"), ensure_ascii=False)
        text = bottle.write([Word("event"), *message.values(), fields])
        self._writer.write(f"do\n{text}\n".encode())
        await self._writer.drain()

    async def close(self) -> None:
        """Closes the connections."""
        self._hang_up()
        if self._listener is not None:
            self._listener.cancel()
            await asyncio.gather(self._listener, return_exceptions=True)

    async def _ask(self, items: list[Item]) -> list[Item]:
        """Sends a request and returns the reply."""
        async with self._turn:
            reader, writer = self._reader, self._writer
            if reader is None or writer is None:
                raise RobotError(f"the connection to {self._rpc} was lost")
            try:
                writer.write(f"d\n{bottle.write(items)}\n".encode())
                await writer.drain()
                line = await reader.readline()
                if not line:
                    raise RobotError(f"{self._rpc} closed the connection")
                return bottle.parse(line.decode(errors="replace"))
            except OSError as error:
                self._hang_up()
                raise RobotError(f"{self._rpc} closed the connection ({error})") from error
            except BaseException:
                # Otherwise the next request would get the reply to this one.
                self._hang_up()
                raise

    def _hang_up(self) -> None:
        writer, self._writer, self._reader = self._writer, None, None
        if writer is not None:
            writer.close()

    async def _listen(self) -> None:
        """Reads what the robot perceives, whenever it has a port for it: the module may start later, and again."""
        is_missing = False
        while True:
            try:
                reader, writer = await self._open(self._events_port)
            except (OSError, RobotError) as error:
                # Once: a robot need not have such a port.
                if not is_missing:
                    LOG.info("the robot's perception is not available: %s", error)
                is_missing = True
            else:
                is_missing = False
                await self._hear(reader, writer)
            await asyncio.sleep(REOPEN_S)

    async def _hear(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Reads what the robot perceives until the connection ends."""
        reason = "it was closed"
        try:
            writer.write(b"r\n")
            while line := await reader.readline():
                # Each bottle follows a line with "do" or "d", and perhaps a number and a time.
                if line.split()[:1] in ([b"do"], [b"d"]):
                    self._receive((await reader.readline()).decode(errors="replace"))
        except (OSError, ValueError) as error:
            reason = str(error)
        finally:
            writer.close()
        LOG.warning("the connection to %s was lost and is tried again: %s", self._events_port, reason)

    def _receive(self, line: str) -> None:
        try:
            self.report(_robot_event(bottle.parse(line)))
        except ValueError as error:
            LOG.warning("ignored an event of the robot: %s", error)

    async def _open(self, name: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """Connects to a port in text mode.

        Raises:
            RobotError: the name server or the port cannot be reached; the message says what to do.
        """
        host, port = await self._find(name)
        try:
            async with asyncio.timeout(CONNECT_S):
                reader, writer = await asyncio.open_connection(host, port)
                writer.write(f"CONNECT {OWN_NAME}\r\n".encode())
                welcome = await reader.readline()
        except (OSError, TimeoutError) as error:
            raise RobotError(f"{name} at {host}:{port} cannot be reached ({error or 'no answer'}): restart the module") from error
        if not welcome.startswith(b"Welcome"):
            writer.close()
            raise RobotError(f"{name} at {host}:{port} is not a YARP port: it answered {welcome!r}")
        return reader, writer

    async def _find(self, name: str) -> tuple[str, int]:
        """Asks the name server for a port."""
        host, port = self._name_server
        found = None
        try:
            async with asyncio.timeout(CONNECT_S):
                reader, writer = await asyncio.open_connection(host, port)
                writer.write(f"NAME_SERVER query {name}\n".encode())
                while (line := (await reader.readline()).decode()) and not line.startswith("*"):
                    found = found or _REGISTRATION.search(line)
                writer.close()
        except (OSError, TimeoutError) as error:
            hint = "start `yarp server`, or give host= and port="
            raise RobotError(f"no YARP name server at {host}:{port} ({error or 'no answer'}): {hint}") from error
        if found is None or found[3] == "0":
            raise RobotError(f"the name server at {host}:{port} knows no port {name}: start the robot's module, or give rpc=")
        return found[2], int(found[3])


def _act(act: Act) -> list[Item]:
    """Returns an act's bottle."""
    match act:
        case Say(text, language):
            return [Word("say"), text, language]
        case Pick(moves):
            return [Word("pick"), *(_move(move) for move in moves)]
        case Point(x, y):
            return [Word("point"), x, y]
        case Gaze(x, y, z):
            return [Word("gaze"), x, y, z]
        case Express(label, valence, arousal):
            return [Word("express"), label, valence, arousal]


def _move(move: CardMove) -> list[Item]:
    def pose(place: Pose) -> list[Item]:
        return [place.x, place.y, place.angle]

    return [move.piece, pose(move.start) if move.start is not None else [], pose(move.end)]


def _robot_event(items: list[Item]) -> RobotEvent:
    """Converts a bottle of the events port.

    Raises:
        BottleError, WireError: it is none of those that this file describes.
    """
    names = {"heard": ("text", "confidence"), "button": ("name",), "affect": ("label", "valence", "arousal", "source", "seat")}
    kind = str(items[0]) if items else ""
    if kind not in names or len(items) > len(names[kind]) + 1:
        raise BottleError(f"{bottle.write(items)} is not a heard, button or affect")
    return wire.robot_event_from_json({"type": kind, **dict(zip(names[kind], items[1:], strict=False))})
