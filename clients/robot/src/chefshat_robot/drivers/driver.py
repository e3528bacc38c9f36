"""The interface between the game and a robot: acts go out, outcomes and events come back.

A driver turns acts into whatever its robot understands. To support another robot, subclass `Driver` with `connect`, `perform` and
`close`; everything else has a default. Lengths are millimetres on the table (`chefshat_robot.field`), z upwards from it; angles are
degrees clockwise as seen from above. What a robot does when, and what happens if it fails, is in `body`; the JSON form of acts,
which several drivers share, is in `wire`.
"""

from __future__ import annotations

import asyncio
import importlib
import logging
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator
from dataclasses import dataclass
from types import ModuleType
from typing import Self, TypeAlias

from chefshat import pb

from chefshat_robot.table import TableState

LOG = logging.getLogger("chefshat_robot")
# Events of a robot that nobody has read yet; beyond that the oldest are dropped.
MAX_EVENTS = 1000
# Seconds for telling a robot to stop, and for closing its connection.
FAREWELL_S = 2.0


@dataclass(frozen=True)
class Pose:
    """Where a piece lies on the table.

    Attributes:
        x: of its centre, mm.
        y: of its centre, mm.
        angle: by which it is turned, degrees clockwise.
    """

    x: float
    y: float
    angle: float = 0.0


@dataclass(frozen=True)
class CardMove:
    """One piece to carry.

    Attributes:
        piece: "1".."15" an ingredient by its face, "golden", "joker", or "pass" for the robot's pass card.
        start: where it is; None: in the robot's stand, at a place that the game does not know.
        end: where it goes.
    """

    piece: str
    start: Pose | None
    end: Pose


@dataclass(frozen=True)
class Say:
    """Speak.

    Attributes:
        text: the sentence.
        language: ISO 639-1 code: "en" or "it".
    """

    text: str
    language: str = "en"


@dataclass(frozen=True)
class Pick:
    """Carry pieces, one after another.

    Attributes:
        moves: the pieces; at least one.
    """

    moves: tuple[CardMove, ...]


@dataclass(frozen=True)
class Point:
    """Point at a place on the table.

    Attributes:
        x: mm.
        y: mm.
    """

    x: float
    y: float


@dataclass(frozen=True)
class Gaze:
    """Look at a point.

    Attributes:
        x: mm.
        y: mm.
        z: mm above the table.
    """

    x: float
    y: float
    z: float = 0.0


@dataclass(frozen=True)
class Express:
    """Show a feeling with face, body or lights.

    Attributes:
        label: for instance "joy", "sadness", "surprise".
        valence: -1..1, unpleasant to pleasant.
        arousal: -1..1, calm to excited.
    """

    label: str
    valence: float = 0.0
    arousal: float = 0.0


Act: TypeAlias = Say | Pick | Point | Gaze | Express


@dataclass(frozen=True)
class Done:
    """The robot finished the act."""


@dataclass(frozen=True)
class Failed:
    """The robot did not finish the act.

    Attributes:
        reason: in words.
    """

    reason: str


Outcome: TypeAlias = Done | Failed


@dataclass(frozen=True)
class Heard:
    """The robot understood speech.

    Attributes:
        text: the words.
        confidence: 0..1.
    """

    text: str
    confidence: float = 1.0


@dataclass(frozen=True)
class Affect:
    """The robot, or an analyser, read a person's expression.

    Attributes:
        label: for instance "joy".
        valence: -1..1, or None.
        arousal: -1..1, or None.
        dominance: -1..1, or None.
        confidence: 0..1, or None.
        source: "face", "voice", "self_report" or "model".
        seat: the seat of the person; None if unknown.
        taken_at: when it was captured, seconds since the Unix epoch, or None.
    """

    label: str
    valence: float | None = None
    arousal: float | None = None
    dominance: float | None = None
    confidence: float | None = None
    source: str = "model"
    seat: int | None = None
    taken_at: float | None = None


@dataclass(frozen=True)
class Button:
    """A button or touch sensor of the robot was pressed.

    Attributes:
        name: of the button.
    """

    name: str


RobotEvent: TypeAlias = Heard | Affect | Button


class RobotError(Exception):
    """The robot cannot be reached, or a driver cannot be used. The message says what to do."""


class Driver(ABC):
    """A robot. Create it where the event loop runs; use it as an asynchronous context manager."""

    def __init__(self) -> None:
        self._robot_events: asyncio.Queue[RobotEvent] = asyncio.Queue(MAX_EVENTS)

    @property
    def connected(self) -> bool:
        """Whether the robot can be reached, as far as the driver knows. If not, `connect` is called before the next act."""
        return True

    @abstractmethod
    async def connect(self) -> None:
        """Connects to the robot. Raises RobotError or OSError."""

    @abstractmethod
    async def perform(self, act: Act) -> Outcome:
        """Lets the robot act, and returns when it reports the end of the act.

        One act at a time. The caller bounds the time by cancelling; then `stop` follows. An exception counts as `Failed`.
        """

    @abstractmethod
    async def close(self) -> None:
        """Ends the connection. May be called more than once."""

    async def stop(self) -> None:  # noqa: B027
        """Lets the robot stop what it is doing, after an act took too long."""

    async def show_event(self, event: pb.GameEvent) -> None:  # noqa: B027
        """Forwards an event of the game to robots that want to know."""

    async def show_state(self, state: TableState) -> None:  # noqa: B027
        """Forwards the state of the table, as far as the robot's seat may know it, after each event."""

    async def events(self) -> AsyncIterator[RobotEvent]:
        """Iterates over what the robot perceives. For one reader; never ends."""
        while True:
            yield await self._robot_events.get()

    def report(self, event: RobotEvent) -> None:
        """Queues an event for the reader of `events`. For subclasses, in the event loop's thread."""
        if self._robot_events.full():
            self._robot_events.get_nowait()
        self._robot_events.put_nowait(event)

    async def __aenter__(self) -> Self:
        await self.connect()
        return self

    async def __aexit__(self, *_: object) -> None:
        try:
            async with asyncio.timeout(FAREWELL_S):
                await self.close()
        except Exception as error:
            LOG.warning("the robot's connection did not close: %s", describe(error))


class Replies:
    """Acts that wait for the robot's reply, by number. For drivers whose robots answer in messages."""

    def __init__(self) -> None:
        self._waiting: dict[str, asyncio.Future[Outcome]] = {}
        self._last = 0

    def expect(self) -> tuple[str, asyncio.Future[Outcome]]:
        """Returns the number of a new act, and its future outcome."""
        self._last += 1
        number = str(self._last)
        future: asyncio.Future[Outcome] = asyncio.get_running_loop().create_future()
        self._waiting[number] = future
        future.add_done_callback(lambda _: self._waiting.pop(number, None))
        return number, future

    def settle(self, number: str, outcome: Outcome) -> bool:
        """Sets the outcome of an act. Returns False if none waits under this number."""
        future = self._waiting.get(number)
        if future is None or future.done():
            return False
        future.set_result(outcome)
        return True

    def lost(self, reason: str) -> None:
        """Fails all waiting acts: the robot is gone."""
        for number in list(self._waiting):
            self.settle(number, Failed(reason))


async def attempt(driver: Driver, act: Act, timeout_s: float) -> Outcome:
    """Lets a robot act, and returns how it ended. Never raises, except when cancelled.

    Args:
        driver: the robot; connected anew if its connection was lost.
        act: what to do.
        timeout_s: seconds for connecting and acting, after which the robot is asked to stop.
    """
    try:
        async with asyncio.timeout(timeout_s):
            if not driver.connected:
                await driver.connect()
            return await driver.perform(act)
    except TimeoutError:
        await _stop(driver)
        return Failed(f"the robot did not finish within {timeout_s:g} s")
    except Exception as error:
        LOG.debug("act failed", exc_info=error)
        return Failed(describe(error))


async def _stop(driver: Driver) -> None:
    """Tells the robot to stop, as far as it can be reached."""
    try:
        async with asyncio.timeout(FAREWELL_S):
            await driver.stop()
    except Exception as error:
        LOG.debug("the robot could not be stopped: %s", describe(error))


def describe(error: BaseException) -> str:
    """Returns the words of an error; its kind if it has none."""
    return str(error) or type(error).__name__


def require(module: str, extra: str) -> ModuleType:
    """Imports a package that only one driver needs.

    Raises:
        RobotError: it is not installed; the message names the extra.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise RobotError(f"{error}: install it with  pip install 'chefshat-robot[{extra}]'") from error
