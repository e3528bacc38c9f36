"""The driver `yarp` with a name server and a robot's ports, as the text protocol has them."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from chefshat_robot.drivers import bottle
from chefshat_robot.drivers.driver import (
    Act,
    Affect,
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
from chefshat_robot.drivers.yarp import YarpDriver
from tests.loop import until
from tests.robots import game_started, numbered

FAR_S = 3600.0
RPC = "/icub/chefshat/rpc:i"
EVENTS = "/icub/chefshat/events:o"


class Icub:
    """A name server, and a module with two ports.

    Attributes:
        asked: names of ports that the name server was asked for.
        got: bottles that arrived, with "d" or "do" before them.
        reply: what the module replies; None: nothing.
        listeners: connections that read events.
    """

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.got: list[tuple[str, str]] = []
        self.reply: str | None = "[ok]"
        self.listeners: list[asyncio.StreamWriter] = []
        self.talkers: list[asyncio.StreamWriter] = []
        self.ports: dict[str, int] = {}
        self.name_server_port = 0

    async def name_server(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        line = (await reader.readline()).decode().split()
        if line[:2] != ["NAME_SERVER", "query"]:
            return
        self.asked.append(line[2])
        port = self.ports.get(line[2], 0)
        ip, kind = ("127.0.0.1", "tcp") if port else ("none", "none")
        writer.write(f"registration name {line[2]} ip {ip} port {port} type {kind}\r\n*** end of message\r\n".encode())
        writer.close()

    async def port(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        header = (await reader.readline()).decode()
        assert header.startswith("CONNECT ")
        writer.write(f"Welcome {header.removeprefix('CONNECT ').strip()}\r\n".encode())
        self.talkers.append(writer)
        while command := (await reader.readline()).decode().strip():
            if command == "r":
                self.listeners.append(writer)
                continue
            self.got.append((command, (await reader.readline()).decode().strip()))
            if command == "d" and self.reply is not None:
                writer.write(f"{self.reply}\r\n".encode())

    def perceive(self, *bottles: str) -> None:
        for number, line in enumerate(bottles):
            self.listeners[0].write(f"do {number} 12.5\r\n{line}\r\n".encode())


@asynccontextmanager
async def pair() -> AsyncIterator[tuple[YarpDriver, Icub]]:
    icub = Icub()
    names = await asyncio.start_server(icub.name_server, "127.0.0.1", 0)
    ports = [await asyncio.start_server(icub.port, "127.0.0.1", 0) for _ in range(2)]
    icub.ports = {name: port.sockets[0].getsockname()[1] for name, port in zip((RPC, EVENTS), ports, strict=True)}
    icub.name_server_port = names.sockets[0].getsockname()[1]
    try:
        async with YarpDriver(port=icub.name_server_port, rpc=RPC, events=EVENTS) as driver:
            yield driver, icub
    finally:
        for listening in (names, *ports):
            listening.close()


async def test_acts_are_bottles_with_replies() -> None:
    pick = Pick((CardMove("9", Pose(230.0, 530.0), Pose(97.5, 151.0, 90.0)), CardMove("pass", None, Pose(1.0, 2.0))))
    acts: dict[str, Act] = {
        r'say "Allora: \"Passo\".\nSì" "it"': Say('Allora: "Passo".\nSì', "it"),
        'pick ("9" (230.0 530.0 0.0) (97.5 151.0 90.0)) ("pass" () (1.0 2.0 0.0))': pick,
        "point 1.0 2.0": Point(1.0, 2.0),
        "gaze 1.0 2.0 3.0": Gaze(1.0, 2.0, 3.0),
        'express "joy" 0.5 -0.5': Express("joy", 0.5, -0.5),
    }
    async with pair() as (driver, icub):
        for act in acts.values():
            assert await attempt(driver, act, FAR_S) == Done()
        assert icub.got == [("d", text) for text in acts]
        for event in numbered(game_started()):
            await driver.show_event(event)
        await until(lambda: len(icub.got) == len(acts) + 1)
        command, event_text = icub.got[-1]
        assert command == "do"
        assert bottle.parse(event_text)[:4] == ["event", 1, 100, "game_started"]


async def test_the_robot_can_fail_hang_and_come_back_and_late_replies_are_not_mixed_up() -> None:
    async with pair() as (driver, icub):
        for reply, reason in (
            ('failed "no voice"', "no voice"),
            ("[fail] tired", "tired"),
            ("[nack]", 'the robot replied "nack"'),
        ):
            icub.reply = reply
            assert await attempt(driver, Say("one"), FAR_S) == Failed(reason)

        icub.reply = None
        hanging = asyncio.create_task(attempt(driver, Say("two"), 0.2))
        await until(lambda: ("d", 'say "two" "en"') in icub.got)
        old = icub.talkers[0]
        icub.reply = "[ok]"
        assert await hanging == Failed("the robot did not finish within 0.2 s")
        assert icub.got[-1] == ("d", "stop")
        old.write(b'failed "late"\r\n')
        assert await attempt(driver, Say("three"), FAR_S) == Done()

        # Found out at the latest by the next act, after which it is connected anew.
        for writer in icub.talkers:
            writer.close()
        await until(lambda: not driver.connected)
        assert await attempt(driver, Say("four"), FAR_S) == Done()

        icub.reply = None
        performing = asyncio.create_task(attempt(driver, Say("five"), FAR_S))
        await until(lambda: ("d", 'say "five" "en"') in icub.got)
        icub.talkers[-1].close()
        icub.talkers[-2].close()
        outcome = await performing
        assert isinstance(outcome, Failed)
        assert outcome.reason.startswith(f"{RPC} closed the connection")


async def test_what_the_robot_perceives_is_read_from_its_port(caplog: pytest.LogCaptureFixture) -> None:
    async with pair() as (driver, icub):
        await until(lambda: icub.listeners)
        icub.perceive("dance 1", "(", 'heard "ciao a tutti" 0.5', "button chest", 'affect "joy" 0.25 -0.5 "face" 2')
        events = driver.events()
        assert await anext(events) == Heard("ciao a tutti", 0.5)
        assert await anext(events) == Button("chest")
        assert await anext(events) == Affect("joy", valence=0.25, arousal=-0.5, source="face", seat=2)
    assert '"dance" 1 is not a heard, button or affect' in caplog.text
    assert "a parenthesis is not closed" in caplog.text


async def test_a_port_of_events_that_was_away_is_read_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("chefshat_robot.drivers.yarp.REOPEN_S", 0.01)
    caplog.set_level(logging.INFO)
    async with pair() as (driver, icub):
        await until(lambda: icub.listeners)
        # The module with this port ends, and starts again after a while.
        there, icub.ports[EVENTS] = icub.ports[EVENTS], 0
        icub.listeners.pop().close()
        asked = len(icub.asked)
        await until(lambda: icub.asked[asked:].count(EVENTS) >= 3)
        icub.ports[EVENTS] = there
        await until(lambda: icub.listeners)
        icub.perceive("button chest")
        assert await anext(driver.events()) == Button("chest")
    assert caplog.text.count(f"the connection to {EVENTS} was lost") == 1
    assert caplog.text.count("perception is not available") == 1


async def test_missing_name_servers_and_ports_are_explained() -> None:
    async with pair() as (_, icub):
        missing = YarpDriver(port=icub.name_server_port, rpc="/nobody")
        with pytest.raises(RobotError, match="knows no port /nobody: start the robot's module"):
            await missing.connect()
    with pytest.raises(RobotError, match="start `yarp server`"):
        await YarpDriver(port=1, rpc=RPC).connect()


@pytest.mark.parametrize(
    ("text", "items"),
    [
        ("", []),
        ('say "hi there" 3 -2.5', ["say", "hi there", 3, -2.5]),
        ("[is] [enc] -10.0 [ok]", ["is", "enc", -10.0, "ok"]),
        ('((a "b") ()) "\\\\\\"\\n"', [[["a", "b"], []], '\\"\n']),
    ],
)
def test_bottles_are_parsed_and_written(text: str, items: list[bottle.Item]) -> None:
    assert bottle.parse(text) == items
    assert bottle.parse(bottle.write(items)) == items


@pytest.mark.parametrize("text", ["(", "a)", '"open', "[open"])
def test_texts_that_are_no_bottles_are_refused(text: str) -> None:
    with pytest.raises(bottle.BottleError):
        bottle.parse(text)
