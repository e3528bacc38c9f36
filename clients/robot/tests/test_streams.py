"""Affect: analysers on a socket or on Lab Streaming Layer."""

from __future__ import annotations

import asyncio
import json
import math
import uuid
from typing import Any

import chefshat
import pytest
from chefshat import Decision, aio, pb

from chefshat_robot import cli
from chefshat_robot.affect import Forwarder, expression_of, forward_stream, serve_lines, stream_affects
from chefshat_robot.drivers.driver import Affect, RobotError

pylsl = pytest.importorskip("pylsl")
ONE_SHIFT = pb.RuleSet(target_shifts=1)
FAR_S = 3600.0


class Told(chefshat.Agent):
    """Notes the expressions that its seat sees, and waits for the test before its first turn."""

    def __init__(self) -> None:
        self.seen: asyncio.Queue[pb.ExpressionShown] = asyncio.Queue()
        self.start = asyncio.Event()
        self.attached = asyncio.Event()

    def on_event(self, event: pb.GameEvent) -> None:
        self.attached.set()
        if event.HasField("expression_shown"):
            self.seen.put_nowait(event.expression_shown)

    async def decide(self, request: Decision) -> int:
        await self.start.wait()
        return int(request.legal_actions[0])


class Game:
    """A game with a seat that waits; a context manager that plays it to its end."""

    def __init__(self, client: aio.Client) -> None:
        self.client = client
        self.agent = Told()
        self.ticket = self.room_id = self.game_id = ""

    async def __aenter__(self) -> Game:
        made = await self.client.rooms.create("streams", seats=[None, "greedy", "random", "greedy"], rules=ONE_SHIFT)
        self.room_id, self.game_id = made.room.room_id, made.room.game_id
        self.ticket = (await self.client.rooms.join(made.join_code, "Ada")).ticket
        options = chefshat.PlayOptions(delivery=pb.EVENT_DELIVERY_AT_ONCE)
        self.playing = asyncio.create_task(self.client.play(self.agent, self.ticket, options=options))
        await self.agent.attached.wait()
        return self

    async def __aexit__(self, *_: object) -> None:
        self.agent.start.set()
        await self.playing


@pytest.mark.server
async def test_lines_of_an_analyser_become_expressions_of_the_seat(server_address: str) -> None:
    async with aio.Client(server_address) as client:
        async with Game(client) as game:
            ports: asyncio.Queue[int] = asyncio.Queue()
            forwarder = Forwarder(client, {0: game.ticket}, interval_s=0)
            serving = asyncio.create_task(serve_lines(forwarder, "127.0.0.1", 0, ready=ports.put_nowait))
            reader, writer = await asyncio.open_connection("127.0.0.1", await ports.get())
            good = {"label": "joy", "valence": 0.5, "confidence": 0.75, "source": "face", "seat": 0, "taken_at": 1763712000.5}
            lines: list[object] = [good, {"label": "joy", "seat": 3}, {"label": "joy"}, [], {"label": "joy", "valence": -3}]
            for line in lines:
                writer.write(json.dumps(line).encode() + b"\n")
            answers = [json.loads(await reader.readline())["error"] for _ in range(4)]
            shown = (await game.agent.seen.get()).expression
            assert (shown.label, shown.valence, shown.confidence) == ("joy", 0.5, 0.75)
            assert shown.source == pb.EXPRESSION_SOURCE_FACE
            assert shown.taken_at.ToNanoseconds() == 1763712000_500_000_000
            assert not shown.HasField("arousal")
            assert "no ticket for seat 3" in answers[0]
            assert "no ticket for a reading without `seat`" in answers[1]
            assert "must be a JSON object" in answers[2]
            assert "`valence` is -3" in answers[3]
            writer.close()
            serving.cancel()
        record = [line async for line in client.records.read(game.game_id)]
    assert [line.event.expression_shown.expression.label for line in record if line.event.HasField("expression_shown")] == ["joy"]


@pytest.mark.server
async def test_streams_of_text_and_of_numbers_become_expressions(server_address: str) -> None:
    async with aio.Client(server_address) as client, Game(client) as game:
        forwarder = Forwarder(client, {None: game.ticket}, interval_s=0)
        texts, numbers = uuid.uuid4().hex, uuid.uuid4().hex
        text_outlet = pylsl.StreamOutlet(pylsl.StreamInfo("Faces", "Affect", 1, 0, pylsl.cf_string, texts))
        info = pylsl.StreamInfo("tension", "Affect", 2, 0, pylsl.cf_float32, numbers)
        info.set_channel_labels(["arousal", "pupil"])
        number_outlet = pylsl.StreamOutlet(info)
        streams = [asyncio.create_task(forward_stream(forwarder, "source_id", source)) for source in (texts, numbers)]
        for outlet in (text_outlet, number_outlet):
            assert await asyncio.to_thread(outlet.wait_for_consumers, 60)
        text_outlet.push_sample(["nonsense"])
        text_outlet.push_sample([json.dumps({"label": "joy", "source": "voice"})])
        voice = (await game.agent.seen.get()).expression
        assert (voice.label, voice.source) == ("joy", pb.EXPRESSION_SOURCE_VOICE)
        assert voice.HasField("taken_at")
        number_outlet.push_sample([0.5, 3.0])
        tension = (await game.agent.seen.get()).expression
        assert (tension.label, tension.arousal, tension.HasField("valence")) == ("tension", 0.5, False)
        for stream in streams:
            stream.cancel()
        await asyncio.gather(*streams, return_exceptions=True)


async def test_what_an_analyser_does_not_know_is_left_out(caplog: pytest.LogCaptureFixture) -> None:
    source = uuid.uuid4().hex
    info = pylsl.StreamInfo("tension", "Affect", 3, 0, pylsl.cf_float32, source)
    info.set_channel_labels(["valence", "arousal", "pupil"])
    outlet = pylsl.StreamOutlet(info)
    reading = asyncio.ensure_future(anext(stream_affects("source_id", source)))
    assert await asyncio.to_thread(outlet.wait_for_consumers, 60)
    outlet.push_sample([math.nan, math.nan, 3.0])
    outlet.push_sample([0.5, math.nan, 3.0])
    affect = await reading
    assert (affect.label, affect.valence, affect.arousal) == ("tension", 0.5, None)
    assert "ignored a sample" not in caplog.text


async def test_a_stream_without_the_channels_is_refused() -> None:
    source = uuid.uuid4().hex
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo("EEG", "EEG", 2, 0, pylsl.cf_float32, source))
    with pytest.raises(RobotError, match="it needs labels among valence, arousal"):
        await anext(stream_affects("source_id", source))
    del outlet


async def test_readings_that_follow_too_soon_are_dropped() -> None:
    class Server:
        def __init__(self) -> None:
            self.got: list[tuple[str, str]] = []

        async def send_expression(self, ticket: str, expression: pb.Expression) -> None:
            self.got.append((ticket, expression.label))

    server = Server()
    client: Any = server
    forwarder = Forwarder(client, {0: "a", 1: "b"}, interval_s=FAR_S)
    for label, seat in (("joy", 0), ("anger", 0), ("joy", 1), ("fear", 1)):
        await forwarder.forward(Affect(label, seat=seat))
    assert server.got == [("a", "joy"), ("b", "joy")]


def test_readings_are_complete_expressions() -> None:
    affect = Affect("joy", 0.5, -0.5, 0.25, 0.75, "self_report", 2, 12.5)
    expression = expression_of(affect, record_only=True)
    assert (expression.valence, expression.arousal, expression.dominance, expression.confidence) == (0.5, -0.5, 0.25, 0.75)
    assert (expression.source, expression.record_only) == (pb.EXPRESSION_SOURCE_SELF_REPORT, True)
    assert expression.taken_at.ToNanoseconds() == 12_500_000_000


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give the ticket of at least one seat"),
        (["--ticket", "0=T"], "give --listen HOST:PORT, --lsl KEY=VALUE, or both"),
        (["--ticket", "Ada=T", "--listen", "127.0.0.1:0"], "the seat of a ticket must be a number"),
        (["--ticket", "0=T", "--listen", "7701"], "--listen 7701: give HOST:PORT"),
        (["--ticket", "0=T", "--lsl", "Faces"], "--lsl Faces: give name=..., type=... or source_id=..."),
    ],
)
def test_wrong_arguments_are_explained(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["affect", *arguments]) == 1
    assert message in capsys.readouterr().err
