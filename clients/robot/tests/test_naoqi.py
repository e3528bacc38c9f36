"""The driver `naoqi` with mock services of NAOqi, in a standalone session of qi on loopback."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from chefshat_robot.drivers.driver import (
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
from chefshat_robot.drivers.naoqi import NaoqiDriver
from chefshat_robot.table import TableState
from tests.loop import until

qi = pytest.importorskip("qi")
FAR_S = 3600.0
PICK = Pick((CardMove("9", None, Pose(1.0, 2.0)),))


class Log:
    """What the robot was asked to do, as (method, arguments)."""

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []


@qi.multiThreaded()
class TextToSpeech(Log):
    """Speech. A sentence with "wait" takes until it is stopped; one with "hoarse" fails."""

    def __init__(self) -> None:
        super().__init__()
        self.stopped = threading.Event()

    def say(self, text: str) -> None:
        self.calls.append(("say", text))
        if "wait" in text:
            self.stopped.wait(60)
        if "hoarse" in text:
            raise RuntimeError("no voice")

    def setLanguage(self, language: str) -> None:
        self.calls.append(("setLanguage", language))

    def stopAll(self) -> None:
        self.calls.append(("stopAll",))
        self.stopped.set()


class Tracker(Log):
    """Looks and points."""

    def lookAt(self, position: list[float], frame: int, speed: float, body: bool) -> None:
        self.calls.append(("lookAt", position, frame, body))

    def pointAt(self, arm: str, position: list[float], frame: int, speed: float) -> None:
        self.calls.append(("pointAt", arm, position, frame))

    def stopTracker(self) -> None:
        self.calls.append(("stopTracker",))


class AnimationPlayer(Log):
    """Animations. Sadness is not installed."""

    def run(self, animation: str) -> None:
        self.calls.append(("run", animation))
        if "Sad" in animation:
            raise RuntimeError("not installed")


class Leds(Log):
    """The eyes."""

    def fadeRGB(self, group: str, colour: int, seconds: float) -> None:
        self.calls.append(("fadeRGB", group, colour))


class Motion(Log):
    """The joints."""

    def wakeUp(self) -> None:
        self.calls.append(("wakeUp",))


class Awareness(Log):
    """Turns to whoever moves or speaks."""

    def __init__(self) -> None:
        super().__init__()
        self.enabled = True

    def isEnabled(self) -> bool:
        return self.enabled

    def setEnabled(self, enabled: bool) -> None:
        self.enabled = enabled


class Recognition(Log):
    """Understands words. The vocabulary can be changed only while it is paused."""

    def __init__(self) -> None:
        super().__init__()
        self.paused = False

    def pause(self, paused: bool) -> None:
        self.paused = paused

    def setVocabulary(self, words: list[str], spotting: bool) -> None:
        if not self.paused:
            raise RuntimeError("a grammar is in use")
        self.calls.append(("setVocabulary", words, spotting))

    def subscribe(self, name: str) -> None:
        self.calls.append(("subscribe", name))

    def unsubscribe(self, name: str) -> None:
        self.calls.append(("unsubscribe", name))


class Subscriber:
    """Values of one event, for those who subscribe."""

    def __init__(self) -> None:
        self.signal = qi.Signal("(m)")


class Memory:
    """Events."""

    def __init__(self) -> None:
        self.subscribers: dict[str, Subscriber] = {}

    def subscriber(self, event: str) -> Subscriber:
        return self.subscribers.setdefault(event, Subscriber())


class Arm(Log):
    """Carries cards, once."""

    def pick(self, moves: str) -> str:
        self.calls.append(("pick", json.loads(moves)))
        return "" if len(self.calls) == 1 else "the card slipped"


class Pepper:
    """A robot's session with its services."""

    def __init__(self, *, arm: bool = True, animated: bool = False, awareness: object | None = None) -> None:
        self.session = qi.Session()
        self.session.listenStandalone("tcp://127.0.0.1:0")
        self.url = str(self.session.endpoints()[0])
        self.speech, self.tracker, self.animations, self.leds = TextToSpeech(), Tracker(), AnimationPlayer(), Leds()
        self.memory, self.arm, self.animated = Memory(), Arm(), TextToSpeech()
        self.motion, self.awareness, self.recognition = Motion(), Awareness(), Recognition()
        self.session.registerService("ALMotion", self.motion)
        self.session.registerService("ALBasicAwareness", awareness or self.awareness)
        self.session.registerService("ALSpeechRecognition", self.recognition)
        self.session.registerService("ALTextToSpeech", self.speech)
        self.session.registerService("ALTracker", self.tracker)
        self.session.registerService("ALAnimationPlayer", self.animations)
        self.session.registerService("ALLeds", self.leds)
        self.session.registerService("ALMemory", self.memory)
        if arm:
            self.session.registerService("ChefsHatArm", self.arm)
        if animated:
            self.session.registerService("ALAnimatedSpeech", self.animated)


@asynccontextmanager
async def pair(**options: bool) -> AsyncIterator[tuple[NaoqiDriver, Pepper]]:
    pepper = await asyncio.to_thread(Pepper, **options)
    try:
        async with NaoqiDriver(url=pepper.url) as driver:
            yield driver, pepper
    finally:
        await asyncio.to_thread(pepper.session.close)


async def test_acts_are_calls_of_services() -> None:
    async with pair() as (driver, pepper):
        await driver.show_state(TableState(seat=1, names=("Ada", "Pepe", "Cleo", "Dan")))
        for said in (Say("Passo.", "it"), Say("Ancora.", "it")):
            assert await attempt(driver, said, FAR_S) == Done()
        assert pepper.speech.calls == [("setLanguage", "Italian"), ("say", "Passo."), ("say", "Ancora.")]

        # Seat 1 sits at the left, 300 mm from the field: it looks along x, and its left is away from seat 0.
        assert await attempt(driver, Gaze(280.0, 200.0, 100.0), FAR_S) == Done()
        assert await attempt(driver, Point(280.0, 50.0), FAR_S) == Done()
        assert await attempt(driver, Point(280.0, 350.0), FAR_S) == Done()
        looked, left, right = pepper.tracker.calls
        assert looked == ("lookAt", [0.58, 0.0, 0.8], 2, False)
        assert left == ("pointAt", "LArm", [0.58, 0.15, 0.7], 2)
        assert right == ("pointAt", "RArm", [0.58, -0.15, 0.7], 2)

        assert await attempt(driver, Express("joy"), FAR_S) == Done()
        assert await attempt(driver, Express("gloom", -0.8, -0.5), FAR_S) == Done()  # By the eyes: it has no such animation.
        assert [call[1].rpartition("/")[2] for call in pepper.animations.calls] == ["Happy_4", "Sad_1"]
        assert [call[2] for call in pepper.leds.calls] == [0xFFD040, 0x2040FF]

        assert await attempt(driver, PICK, FAR_S) == Done()
        assert pepper.arm.calls[0][1][0]["end"] == {"x": 1.0, "y": 2.0, "angle": 0.0}
        assert await attempt(driver, PICK, FAR_S) == Failed("the card slipped")


async def test_speech_with_gestures_is_preferred_and_without_an_arm_the_people_are_asked() -> None:
    async with pair(arm=False, animated=True) as (driver, pepper):
        assert await attempt(driver, Say("Hello"), FAR_S) == Done()
        assert pepper.animated.calls == [("say", "Hello")]
        assert await attempt(driver, PICK, FAR_S) == Failed("this robot has no service ChefsHatArm that carries cards")


async def test_the_robot_can_fail_hang_and_leave() -> None:
    async with pair() as (driver, pepper):
        outcome = await attempt(driver, Say("hoarse"), FAR_S)
        assert isinstance(outcome, Failed)
        assert "no voice" in outcome.reason

        assert await attempt(driver, Say("wait"), 0.3) == Failed("the robot did not finish within 0.3 s")
        assert pepper.speech.calls[-1] == ("stopAll",)
        assert pepper.tracker.calls == [("stopTracker",)]

        pepper.speech.stopped.clear()
        waiting = asyncio.create_task(attempt(driver, Say("wait for ever"), FAR_S))
        await until(lambda: pepper.speech.calls[-1] == ("say", "wait for ever"))
        closing = asyncio.create_task(asyncio.to_thread(pepper.session.close))
        assert isinstance(await waiting, Failed)
        pepper.speech.stopped.set()
        await closing
        await until(lambda: not driver.connected)
        outcome = await attempt(driver, Say("anyone?"), FAR_S)
        assert isinstance(outcome, Failed)
        assert f"no NAOqi at {pepper.url}" in outcome.reason


async def test_the_robot_wakes_up_attends_to_the_game_and_listens_for_words_until_it_is_given_back() -> None:
    pepper = await asyncio.to_thread(Pepper)
    try:
        async with NaoqiDriver(url=pepper.url, words="passo; tocca a me;") as driver:
            assert driver.connected
            assert pepper.motion.calls == [("wakeUp",)]
            assert not pepper.awareness.enabled
            assert pepper.recognition.calls == [("setVocabulary", ["passo", "tocca a me"], True), ("subscribe", "ChefsHat")]
            assert not pepper.recognition.paused
        assert pepper.awareness.enabled
        assert pepper.recognition.calls[-1] == ("unsubscribe", "ChefsHat")
        # One that did not turn to people before does not afterwards.
        pepper.awareness.enabled = False
        async with NaoqiDriver(url=pepper.url):
            pass
        assert not pepper.awareness.enabled
    finally:
        await asyncio.to_thread(pepper.session.close)


async def test_a_robot_that_cannot_say_whether_it_turns_to_people_plays() -> None:
    class Older:
        """Has neither isEnabled nor setEnabled."""

    pepper = await asyncio.to_thread(Pepper, awareness=Older())
    try:
        async with NaoqiDriver(url=pepper.url) as driver:
            assert await attempt(driver, Say("Hello"), FAR_S) == Done()
    finally:
        await asyncio.to_thread(pepper.session.close)


async def test_words_and_touches_are_reported() -> None:
    async with pair() as (driver, pepper):
        await asyncio.to_thread(pepper.memory.subscribers["WordRecognized"].signal, ["<...> passo <...>", 0.5, "gioco", 0.1])
        await asyncio.to_thread(pepper.memory.subscribers["FrontTactilTouched"].signal, 0.0)
        await asyncio.to_thread(pepper.memory.subscribers["FrontTactilTouched"].signal, 1.0)
        events = driver.events()
        assert {await anext(events), await anext(events)} == {Heard("passo", 0.5), Button("FrontTactilTouched")}


async def test_a_robot_that_is_not_there_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(RobotError, match="switch the robot on, or give host="):
        await NaoqiDriver(port=1).connect()
