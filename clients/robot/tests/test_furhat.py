"""The driver `furhat` with a server of Furhat's Realtime API on loopback."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from chefshat_robot.drivers.driver import CardMove, Done, Express, Failed, Gaze, Heard, Pick, Point, Pose, RobotError, Say, attempt
from chefshat_robot.drivers.furhat import FurhatDriver
from tests.loop import until

pytest.importorskip("furhat_realtime_api")
server = pytest.importorskip("websockets.asyncio.server")
FAR_S = 3600.0


class Furhat:
    """The robot.

    Attributes:
        got: the requests, without those for authentication.
        speaks: whether it ends what it is asked to say.
    """

    def __init__(self, key: str = "") -> None:
        self.got: list[dict[str, Any]] = []
        self.speaks = True
        self.aborts = False
        self.port = 0
        self._key = key
        self._socket: Any = None

    async def serve(self, socket: Any) -> None:
        self._socket = socket
        assert socket.request.path == "/v1/events"
        async for text in socket:
            message = json.loads(text)
            kind = message["type"]
            if kind == "request.auth":
                access = message.get("key", "") == self._key
                await self.send(message, type="response.auth", access=access, scope="all")
                continue
            self.got.append(message)
            if kind == "request.voice.config":
                await self.send(message, type="response.voice.status", voice_id="any")
            elif kind == "request.speak.text" and self.speaks:
                await self.send(message, type="response.speak.start", text=message["text"])
                await self.send(message, type="response.speak.end", text=message["text"], aborted=self.aborts)
            elif kind == "request.gesture.start":
                await self.send(message, type="response.gesture.end", name=message["name"])

    async def send(self, request: dict[str, Any], **message: Any) -> None:
        await self._socket.send(json.dumps({"request_id": request.get("request_id"), **message}))

    async def hears(self, text: str) -> None:
        await self._socket.send(json.dumps({"type": "response.hear.end", "text": text}))

    async def hang_up(self) -> None:
        await self._socket.close()

    def of(self, kind: str) -> list[dict[str, Any]]:
        return [message for message in self.got if message["type"] == kind]


@asynccontextmanager
async def pair(*, listen: bool = False) -> AsyncIterator[tuple[FurhatDriver, Furhat]]:
    furhat = Furhat()
    async with server.serve(furhat.serve, "127.0.0.1", 0) as listening:
        furhat.port = listening.sockets[0].getsockname()[1]
        async with FurhatDriver(port=furhat.port, listen=listen) as driver:
            yield driver, furhat


async def test_it_speaks_looks_and_shows_moods_and_has_no_arms() -> None:
    async with pair() as (driver, furhat):
        for said in (Say("Passo.", "it"), Say("Ancora.", "it")):
            assert await attempt(driver, said, FAR_S) == Done()
        assert [message["language"] for message in furhat.of("request.voice.config")] == ["it-IT"]
        assert [message["text"] for message in furhat.of("request.speak.text")] == ["Passo.", "Ancora."]

        # At seat 0, 300 mm before the field, its head 350 mm above the table; x to its right, y up, z forward.
        assert await attempt(driver, Gaze(380.0, 200.0, 450.0), FAR_S) == Done()
        assert await attempt(driver, Point(280.0, 100.0), FAR_S) == Done()
        await until(lambda: len(furhat.of("request.attend.location")) == 2)
        places = [(message["x"], message["y"], message["z"]) for message in furhat.of("request.attend.location")]
        assert places == [(0.1, 0.1, 0.5), (0.0, -0.35, 0.6)]

        assert await attempt(driver, Express("joy"), FAR_S) == Done()
        assert await attempt(driver, Express("gloom", -0.8, -0.5), FAR_S) == Done()
        assert [message["name"] for message in furhat.of("request.gesture.start")] == ["BigSmile", "ExpressSad"]

        pick = Pick((CardMove("9", None, Pose(0.0, 0.0)),))
        assert await attempt(driver, pick, FAR_S) == Failed("Furhat has no arms")


async def test_the_robot_can_fail_hang_leave_and_come_back() -> None:
    async with pair() as (driver, furhat):
        furhat.aborts = True
        assert await attempt(driver, Say("one"), FAR_S) == Failed("the speech was interrupted")

        furhat.speaks = furhat.aborts = False
        assert await attempt(driver, Say("two"), 0.2) == Failed("the robot did not finish within 0.2 s")
        await until(lambda: furhat.of("request.speak.stop"))

        performing = asyncio.create_task(attempt(driver, Say("three"), FAR_S))
        await until(lambda: any(message["text"] == "three" for message in furhat.of("request.speak.text")))
        await furhat.hang_up()
        assert await performing == Failed("the connection to Furhat was lost")

        furhat.speaks = True
        assert await attempt(driver, Say("four"), FAR_S) == Done()


async def test_it_listens() -> None:
    async with pair(listen=True) as (driver, furhat):
        await until(lambda: furhat.of("request.listen.start"))
        await furhat.hears("")
        await furhat.hears("buongiorno")
        assert await anext(driver.events()) == Heard("buongiorno")


async def test_a_missing_robot_and_a_wrong_key_are_explained() -> None:
    async with server.serve(Furhat("secret").serve, "127.0.0.1", 0) as listening:
        port = listening.sockets[0].getsockname()[1]
        with pytest.raises(RobotError, match="refused the key: give key="):
            await FurhatDriver(port=port, key="guess").connect()
        async with FurhatDriver(port=port, key="secret") as driver:
            assert driver.connected
    with pytest.raises(RobotError, match=r"no Furhat at 127\.0\.0\.1:1"):
        await FurhatDriver(port=1).connect()
