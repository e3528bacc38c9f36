"""The driver `furhat`: a Furhat robot, or the virtual one of its SDK, through the Realtime API (a websocket, port 9000).

It speaks, looks, and shows moods by Furhat's gestures. It has no arms: it looks where it should point, and asks the people to lay
its cards. With `listen=true` it listens, and what it understands is reported.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Coroutine
from typing import Any

from chefshat_robot.drivers.driver import (
    LOG,
    Act,
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

# Seconds for the client's own waiting; acts have shorter limits.
WAIT_S = 600.0
LANGUAGES = {"en": "en-US", "it": "it-IT"}
#: Furhat's gestures for moods.
GESTURES = {
    "joy": "BigSmile",
    "amusement": "Smile",
    "surprise": "Surprise",
    "concentration": "Thoughtful",
    "annoyance": "BrowFrown",
    "sadness": "ExpressSad",
}


class FurhatDriver(Driver):
    """A Furhat robot."""

    def __init__(
        self,
        host: str = "127.0.0.1",
        port: int = 9000,
        key: str = "",
        distance: float = 300.0,
        head: float = 350.0,
        listen: bool = False,
    ) -> None:
        """Sets the robot and where it stands.

        Args:
            host: the robot.
            port: of the Realtime API.
            key: its authentication key, if it has one.
            distance: from the edge of the field to the robot's axis, mm.
            head: height of the robot's head above the table, mm.
            listen: whether to listen to people.
        """
        super().__init__()
        self._library = require("furhat_realtime_api", "furhat")
        self._host, self._port, self._key = host, port, key
        self._distance, self._head = distance, head
        self._listens = listen
        self._client: Any = None
        self._language = ""
        self._state = TableState()

    @property
    def connected(self) -> bool:
        """Whether the websocket is open."""
        return self._client is not None and self._client.is_connected

    async def connect(self) -> None:
        """Connects and authenticates."""
        client = self._library.AsyncFurhatClient(self._host, self._key or None)
        client.set_logging_level(logging.WARNING)
        # The client knows only the default port.
        client.ws_url = f"ws://{self._host}:{self._port}/v1/events"
        events = self._library.Events
        client.add_handler(events.response_hear_end, self._heard)
        try:
            await client.connect()
        except RuntimeError as error:
            await client.disconnect()
            raise RobotError(f"Furhat at {self._host}:{self._port} refused the key: give key=") from error
        except (OSError, TimeoutError) as error:
            hint = "switch it on, enable the Realtime API, or give host="
            raise RobotError(f"no Furhat at {self._host}:{self._port} ({describe(error)}): {hint}") from error
        self._client = client
        self._language = ""
        if self._listens:
            await client.request_listen_start(stop_no_speech=False, stop_user_end=False, resume_robot_end=True)

    async def perform(self, act: Act) -> Outcome:
        """Sends the request for the act, and waits until the robot reports its end."""
        events = self._library.Events
        match act:
            case Say(text, language):
                await self._speak(language)
                request = {"type": events.request_speak_text, "text": text, "abort": False, "monitor_words": False}
                end = await self._while_there(self._client.send_event_and_wait(request, events.response_speak_end, WAIT_S))
                return Failed("the speech was interrupted") if end.get("aborted") else Done()
            case Gaze(x, y, z):
                await self._look(x, y, z)
            case Point(x, y):
                await self._look(x, y, 0.0)
            case Express():
                name = GESTURES[mood_of(act)]
                request = {"type": events.request_gesture_start, "name": name, "intensity": 1.0, "duration": 1.0, "monitor": True}
                await self._while_there(self._client.send_event_and_wait(request, events.response_gesture_end, WAIT_S))
            case Pick():
                return Failed("Furhat has no arms")
        return Done()

    async def stop(self) -> None:
        """Stops speaking."""
        await self._client.request_speak_stop()

    async def show_state(self, state: TableState) -> None:
        """Notes the robot's seat."""
        self._state = state

    async def close(self) -> None:
        """Closes the websocket."""
        client, self._client = self._client, None
        if client is not None:
            await client.disconnect()

    async def _speak(self, language: str) -> None:
        """Chooses a voice of the language."""
        if language == self._language:
            return
        events = self._library.Events
        request = {"type": events.request_voice_config, "language": LANGUAGES.get(language, language), "input_language": True}
        await self._while_there(self._client.send_event_and_wait(request, events.response_voice_status, WAIT_S))
        self._language = language

    async def _look(self, x: float, y: float, z: float) -> None:
        """Looks at a point. Furhat counts x to its right, y up from its head, and z forward."""
        standpoint = Standpoint.at(self._state, self._distance, -self._head)
        forward, left, up = standpoint.before(x, y, z)
        await self._client.request_attend_location(-left, up, forward)

    async def _while_there(self, answer: Coroutine[Any, Any, dict[str, Any]]) -> dict[str, Any]:
        """Waits for an answer. Raises RobotError if the websocket closes before."""
        waiting = asyncio.ensure_future(answer)
        closed = asyncio.ensure_future(self._client.ws.wait_closed())
        try:
            await asyncio.wait({waiting, closed}, return_when=asyncio.FIRST_COMPLETED)
            if not waiting.done():
                self._client.is_connected = False
                raise RobotError("the connection to Furhat was lost")
            return waiting.result()
        finally:
            for task in (waiting, closed):
                task.cancel()
            await asyncio.gather(waiting, closed, return_exceptions=True)

    async def _heard(self, event: dict[str, Any]) -> None:
        text = event.get("text")
        if isinstance(text, str) and text:
            self.report(Heard(text))
        else:
            LOG.debug("Furhat understood nothing: %s", event)
