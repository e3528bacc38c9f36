"""The driver `naoqi`: Pepper and NAO, through NAOqi's services.

| act | what is called |
|---|---|
| say | ALAnimatedSpeech.say, which adds gestures; without it ALTextToSpeech.say |
| gaze | ALTracker.lookAt |
| point | ALTracker.pointAt, with the arm on that side |
| express | ALAnimationPlayer.run; without it, or without the animation, the colour of the eyes by ALLeds.fadeRGB |
| pick | `pick(moves)` of a service of your own, by default `ChefsHatArm` |

Its argument is a text, the moves as JSON (`chefshat_robot.wire`); it returns "", or why it failed. The hands of Pepper and NAO do
not pick up cards: without such a service, the robot asks the people to lay its cards. Touches are reported, and the words that
speech recognition understands (`WordRecognized`): those of `words=`, such as "pass;my turn", or of a vocabulary of your own.

When it connects, the robot wakes up (ALMotion.wakeUp), and no longer turns to people who move or speak (ALBasicAwareness), which
would fight with the gazes of the game; when it is closed, it does again if it did before.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from functools import partial
from typing import Any

from chefshat_robot import wire
from chefshat_robot.drivers.driver import (
    LOG,
    Act,
    Button,
    Done,
    Driver,
    Express,
    Failed,
    Gaze,
    Heard,
    Outcome,
    Pick,
    Point,
    RobotError,
    Say,
    describe,
    require,
)
from chefshat_robot.drivers.standpoint import Standpoint, mood_of
from chefshat_robot.table import TableState

LANGUAGES = {"en": "English", "it": "Italian"}
FRAME_ROBOT = 2
# Fraction of the joints' greatest speed.
SPEED = 0.3
TOUCHES = ("FrontTactilTouched", "MiddleTactilTouched", "RearTactilTouched", "RightBumperPressed", "LeftBumperPressed")
#: Animations and colours of the eyes (0xRRGGBB) of moods.
MOODS = {
    "joy": ("animations/Stand/Emotions/Positive/Happy_4", 0xFFD040),
    "amusement": ("animations/Stand/Emotions/Positive/Laugh_1", 0xFFA040),
    "surprise": ("animations/Stand/Emotions/Negative/Surprise_1", 0x40D0FF),
    "concentration": ("animations/Stand/Waiting/Think_1", 0xFFFFFF),
    "annoyance": ("animations/Stand/Emotions/Negative/Frustrated_1", 0xFF4020),
    "sadness": ("animations/Stand/Emotions/Negative/Sad_1", 0x2040FF),
}
FADE_S = 0.5
#: The name under which speech recognition is subscribed to.
SUBSCRIBER = "ChefsHat"


class NaoqiDriver(Driver):
    """Pepper and NAO."""

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 9559,
        distance: float = 300.0,
        table: float = 700.0,
        arm: str = "ChefsHatArm",
        words: str = "",
        url: str = "",
    ) -> None:
        """Sets the robot and where it stands.

        Args:
            host: the robot.
            port: of NAOqi.
            distance: from the edge of the field to the robot's axis, mm.
            table: height of the table above the floor, mm.
            arm: name of the service that carries cards.
            words: what speech recognition listens for, separated by semicolons; empty: its vocabulary is left as it is.
            url: NAOqi's address in full, instead of host and port.
        """
        super().__init__()
        self._qi = require("qi", "naoqi")
        self._url = url or f"tcp://{host}:{port}"
        self._distance, self._table = distance, table
        self._arm = arm
        self._words = [word for part in words.split(";") if (word := part.strip())]
        # Whether the robot turned to people who move or speak before it played.
        self._was_aware = False
        self._session: Any = None
        self._language = ""
        self._state = TableState()
        self._loop: asyncio.AbstractEventLoop | None = None
        # References keep the subscriptions alive.
        self._subscribers: list[Any] = []

    @property
    def connected(self) -> bool:
        """Whether the session is connected."""
        return self._session is not None and self._session.isConnected()

    async def connect(self) -> None:
        """Connects to NAOqi, and subscribes to what the robot perceives."""
        self._loop = asyncio.get_running_loop()
        session = self._qi.Session()
        try:
            await self._result(session.connect(self._url, _async=True))
        except RobotError as error:
            raise RobotError(f"no NAOqi at {self._url} ({error}): switch the robot on, or give host=") from error
        self._session = session
        self._language = ""
        memory = await self._service("ALMemory")
        self._subscribers.clear()
        if memory is not None:
            await self._subscribe(memory, "WordRecognized", self._recognized)
            for name in TOUCHES:
                await self._subscribe(memory, name, partial(self._touched, name))
        await self._prepare()

    async def _prepare(self) -> None:
        """Wakes the robot up, lets it attend to the game alone, and listens for words. What it cannot do is logged."""
        await self._try("ALMotion", "wakeUp")
        awareness = await self._service("ALBasicAwareness")
        if awareness is not None:
            # Older versions of NAOqi do not say whether it did.
            with contextlib.suppress(AttributeError, RobotError):
                self._was_aware = self._was_aware or bool(await self._result(awareness.isEnabled(_async=True)))
            await self._try("ALBasicAwareness", "setEnabled", False)
        if self._words:
            await self._try("ALSpeechRecognition", "pause", True)
            await self._try("ALSpeechRecognition", "setVocabulary", self._words, True)
            await self._try("ALSpeechRecognition", "pause", False)
            await self._try("ALSpeechRecognition", "subscribe", SUBSCRIBER)

    async def _try(self, service: str, method: str, *arguments: object) -> None:
        outcome = await self._call(service, method, *arguments)
        if isinstance(outcome, Failed):
            LOG.warning("%s", outcome.reason)

    async def perform(self, act: Act) -> Outcome:
        """Calls the service for the act, and waits until it returns."""
        match act:
            case Say(text, language):
                return await self._say(text, language)
            case Gaze(x, y, z):
                target = list(self._standpoint.before(x, y, z))
                return await self._call("ALTracker", "lookAt", target, FRAME_ROBOT, SPEED, False)
            case Point(x, y):
                target = list(self._standpoint.before(x, y))
                return await self._call("ALTracker", "pointAt", "LArm" if target[1] > 0 else "RArm", target, FRAME_ROBOT, SPEED)
            case Express():
                return await self._express(act)
            case Pick():
                return await self._pick(act)

    async def stop(self) -> None:
        """Stops speaking and moving."""
        for service, method in (("ALTextToSpeech", "stopAll"), ("ALTracker", "stopTracker")):
            await self._call(service, method)

    async def show_state(self, state: TableState) -> None:
        """Notes the robot's seat."""
        self._state = state

    async def close(self) -> None:
        """Gives the robot back as it was, and closes the session."""
        with contextlib.suppress(RobotError):
            if self._was_aware:
                await self._try("ALBasicAwareness", "setEnabled", True)
            if self._words:
                await self._try("ALSpeechRecognition", "unsubscribe", SUBSCRIBER)
        session, self._session = self._session, None
        self._was_aware = False
        self._subscribers.clear()
        if session is not None:
            await asyncio.to_thread(session.close)

    @property
    def _standpoint(self) -> Standpoint:
        return Standpoint.at(self._state, self._distance, self._table)

    async def _say(self, text: str, language: str) -> Outcome:
        name = LANGUAGES.get(language)
        if name is not None and name != self._language:
            outcome = await self._call("ALTextToSpeech", "setLanguage", name)
            if isinstance(outcome, Failed):
                LOG.warning("the robot does not speak %s: %s", name, outcome.reason)
            self._language = name
        if await self._service("ALAnimatedSpeech") is not None:
            return await self._call("ALAnimatedSpeech", "say", text)
        return await self._call("ALTextToSpeech", "say", text)

    async def _express(self, express: Express) -> Outcome:
        animation, colour = MOODS[mood_of(express)]
        moved = await self._call("ALAnimationPlayer", "run", animation)
        lit = await self._call("ALLeds", "fadeRGB", "FaceLeds", colour, FADE_S)
        return moved if isinstance(moved, Done) else lit

    async def _pick(self, pick: Pick) -> Outcome:
        arm = await self._service(self._arm)
        if arm is None:
            return Failed(f"this robot has no service {self._arm} that carries cards")
        reason = await self._result(arm.pick(json.dumps([wire.move_to_json(move) for move in pick.moves]), _async=True))
        return Failed(str(reason)) if reason else Done()

    async def _call(self, service: str, method: str, *arguments: object) -> Outcome:
        """Calls a method of a service. A missing service or an error of it is a failure."""
        found = await self._service(service)
        if found is None:
            return Failed(f"this robot has no service {service}")
        try:
            await self._result(getattr(found, method)(*arguments, _async=True))
        except (AttributeError, RobotError) as error:
            return Failed(f"{service}.{method}: {describe(error)}")
        return Done()

    async def _service(self, name: str) -> Any | None:  # noqa: ANN401 (qi has no types)
        """Returns a service; None if the robot does not have it."""
        if not self.connected:
            raise RobotError("the connection to NAOqi was lost")
        try:
            return await self._result(self._session.service(name, _async=True))
        except RobotError:
            return None

    async def _result(self, future: Any) -> Any:  # noqa: ANN401 (qi has no types)
        """Waits for a future of qi. Raises RobotError if it failed."""
        loop = asyncio.get_running_loop()
        waiting: asyncio.Future[Any] = loop.create_future()

        def settle() -> None:
            if waiting.done():
                return
            if future.hasError(0):
                waiting.set_exception(RobotError(str(future.error(0))))
            elif future.isCanceled():
                waiting.set_exception(RobotError("cancelled"))
            else:
                waiting.set_result(future.value(0))

        # Called in a thread of qi.
        future.addCallback(lambda _: loop.call_soon_threadsafe(settle) if not loop.is_closed() else None)
        return await waiting

    async def _subscribe(self, memory: Any, event: str, react: Callable[[Any], object]) -> None:  # noqa: ANN401 (qi has no types)
        loop = asyncio.get_running_loop()
        subscriber = await self._result(memory.subscriber(event, _async=True))
        subscriber.signal.connect(lambda value: loop.call_soon_threadsafe(react, value) if not loop.is_closed() else None)
        self._subscribers.append(subscriber)

    def _touched(self, name: str, value: object) -> None:
        """Reports a touch; its end has the value 0."""
        if value:
            self.report(Button(name))

    def _recognized(self, value: Any) -> None:  # noqa: ANN401 (qi has no types)
        """Reports recognized words: a list of words and confidences, the best first."""
        if isinstance(value, list | tuple) and len(value) >= 2 and value[0]:
            self.report(Heard(str(value[0]).strip("<.> "), float(value[1])))
