"""Affect in and markers out: analysers on a socket or on Lab Streaming Layer, and the game's events as markers."""

from __future__ import annotations

import asyncio
import json
import uuid
from typing import Any

import chefshat
import pytest
from chefshat import Decision, RandomAgent, aio, pb

from chefshat_robot import cli
from chefshat_robot.affect import Forwarder, expression_of, forward_stream, serve_lines, stream_affects
from chefshat_robot.drivers.driver import Affect, RobotError
from chefshat_robot.markers import send_markers
from tests.loop import run

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
        made = await self.client.create_room("streams", seats=[None, "greedy", "random", "greedy"], rules=ONE_SHIFT)
        self.room_id, self.game_id = made.room.room_id, made.room.game_id
        self.ticket = (await self.client.join_room(made.join_code, "Ada")).ticket
        options = chefshat.PlayOptions(delivery=pb.EVENT_DELIVERY_AT_ONCE)
        self.playing = asyncio.create_task(self.client.play(self.agent, self.ticket, options=options))
        await self.agent.attached.wait()
        return self

    async def __aexit__(self, *_: object) -> None:
        self.agent.start.set()
        await self.playing


@pytest.mark.server
def test_lines_of_an_analyser_become_expressions_of_the_seat(server_address: str) -> None:
    async def test() -> list[pb.RecordLine]:
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
            return [line async for line in client.record(game.game_id)]

    record = run(test())
    assert [line.event.expression_shown.expression.label for line in record if line.event.HasField("expression_shown")] == ["joy"]


@pytest.mark.server
def test_streams_of_text_and_of_numbers_become_expressions(server_address: str) -> None:
    async def test() -> None:
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

    run(test())


def test_a_stream_without_the_channels_is_refused() -> None:
    async def test() -> None:
        source = uuid.uuid4().hex
        outlet = pylsl.StreamOutlet(pylsl.StreamInfo("EEG", "EEG", 2, 0, pylsl.cf_float32, source))
        with pytest.raises(RobotError, match="it needs labels among valence, arousal"):
            await anext(stream_affects("source_id", source))
        del outlet

    run(test())


def test_readings_that_follow_too_soon_are_dropped() -> None:
    class Server:
        def __init__(self) -> None:
            self.got: list[tuple[str, str]] = []

        async def express(self, ticket: str, expression: pb.Expression) -> None:
            self.got.append((ticket, expression.label))

    async def test() -> None:
        server = Server()
        client: Any = server
        forwarder = Forwarder(client, {0: "a", 1: "b"}, interval_s=FAR_S)
        for label, seat in (("joy", 0), ("anger", 0), ("joy", 1), ("fear", 1)):
            await forwarder.forward(Affect(label, seat=seat))
        assert server.got == [("a", "joy"), ("b", "joy")]

    run(test())


def test_readings_are_complete_expressions() -> None:
    affect = Affect("joy", 0.5, -0.5, 0.25, 0.75, "self_report", 2, 12.5)
    expression = expression_of(affect, record_only=True)
    assert (expression.valence, expression.arousal, expression.dominance, expression.confidence) == (0.5, -0.5, 0.25, 0.75)
    assert (expression.source, expression.record_only) == (pb.EXPRESSION_SOURCE_SELF_REPORT, True)
    assert expression.taken_at.ToNanoseconds() == 12_500_000_000


@pytest.mark.server
def test_every_event_of_a_game_is_a_marker(server_address: str) -> None:
    markers: list[tuple[dict[str, Any], float]] = []
    # An outlet that is gone delivers nothing more: this one stays until everything is recorded.
    outlets: list[Any] = []

    async def record(room_id: str) -> None:
        """What a recorder does: finds the stream and fetches its samples until the game's end."""
        found = await asyncio.to_thread(pylsl.resolve_byprop, "source_id", f"chefshat-{room_id}", 1, 60)
        assert (found[0].name(), found[0].type(), found[0].nominal_srate()) == ("ChefsHat streams", "Markers", 0.0)
        inlet = pylsl.StreamInlet(found[0])
        while not markers or markers[-1][0]["kind"] != "game_ended":
            sample, stamp = await asyncio.to_thread(inlet.pull_sample, 60)
            assert sample is not None
            markers.append((json.loads(sample[0]), stamp))

    async def test() -> list[pb.GameEvent]:
        async with aio.Client(server_address) as client:
            async with Game(client) as game:
                recording = asyncio.create_task(record(game.room_id))

                async def recorded(outlet: Any) -> None:
                    outlets.append(outlet)
                    assert await asyncio.to_thread(outlet.wait_for_consumers, 60)

                sending = asyncio.create_task(send_markers(client, game.room_id, linger_s=0, ready=recorded))
                while not markers:
                    await asyncio.sleep(0.005)
                game.agent.start.set()
                await recording
                assert await sending == len(markers)
            return [event async for event in client.watch(game.room_id)]

    events = run(test())
    assert [marker["sequence"] for marker, _ in markers] == [event.sequence for event in events]
    assert [marker["elapsed_ms"] for marker, _ in markers] == [event.elapsed_ms for event in events]
    assert [marker["kind"] for marker, _ in markers] == [event.WhichOneof("kind") for event in events]
    stamps = [stamp for _, stamp in markers]
    assert stamps == sorted(stamps)
    past = [marker["past"] for marker, _ in markers]
    assert past[0] is True
    assert past[-1] is False
    assert past == sorted(past, reverse=True)
    play = next(marker for marker, _ in markers if marker["kind"] == "play")
    assert {"seat", "face", "quantity", "jokers", "cards_left"} <= play["fields"].keys()
    assert isinstance(play["fields"]["decision_time_us"], int)
    # Nobody's cards are in a marker.
    dealt = next(marker for marker, _ in markers if marker["kind"] == "shift_started")
    assert dealt["fields"]["hands"] == []


@pytest.mark.server
def test_the_command_sends_markers_until_the_game_is_over(server_address: str) -> None:
    async def finished() -> str:
        async with aio.Client(server_address) as client:
            made = await client.create_room("done", seats=[None, "greedy", "random", "greedy"], rules=ONE_SHIFT)
            seat = await client.join_room(made.join_code, "Ada")
            await client.play(RandomAgent(1), seat.ticket)
            return made.room.room_id

    assert cli.main(["markers", "--address", server_address, run(finished())]) == 0


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
