"""Streams of samples of a seat: their times, their chunks, and what happens while the server is away or refuses."""

import itertools
import math
import os
import time
from collections.abc import Callable

import pytest
from fake_server import FakeServer

import chefshat
from chefshat import ChefsHatError
from chefshat.samples import MAX_SAMPLES, SampleStream

# The stream sends when the test flushes.
NEVER_S = 3_600.0


def seated(client: chefshat.Client) -> tuple[str, str]:
    """A room, and the ticket of a seat in it."""
    created = client.rooms.create("samples")
    return created.room.room_id, client.rooms.join(created.join_code, "Ada").ticket


def test_samples_are_sent_with_times_of_the_room(fake: FakeServer) -> None:
    now = 100.0
    with chefshat.Client(fake.address) as client:
        room_id, ticket = seated(client)
        channels = ["valence", "arousal"]
        # The clock of this machine stands still, except between samples.
        with SampleStream(client, ticket, room_id, "affect", channels, local=lambda: now, interval_s=NEVER_S) as stream:
            for number in range(60):
                stream.push([number / 60, math.nan])
                now += 1 / 30
            assert fake.samples == []
            stream.flush()
            (chunk,) = fake.samples
            assert (chunk.stream, list(chunk.channels)) == ("affect", channels)
            times = list(chunk.elapsed_us)
            assert len(times) == 60
            steps = [later - earlier for earlier, later in itertools.pairwise(times)]
            assert all(33_332 <= step <= 33_335 for step in steps)
            assert chunk.values[2] == pytest.approx(1 / 60)
            assert math.isnan(chunk.values[1])
            stream.push([0.0, 0.0], at=0.0)
            with pytest.raises(ValueError, match="1 values for 2 channels"):
                stream.push([0.0])
        assert fake.samples[1].elapsed_us[0] == times[-1] + 1, "times ascend, and the end of the stream sends what waits"


@pytest.mark.parametrize(
    ("values", "at", "error"),
    [
        ([None, 0.0], None, TypeError),
        ([0.0, math.inf], None, ValueError),
        ([-1e300, 0.0], None, ValueError),  # Infinite as a 32-bit number.
        ([0.0, 0.0], 102.0, ValueError),
        ([0.0, 0.0], math.nan, ValueError),
    ],
)
def test_a_wrong_sample_does_not_harm_the_others(
    fake: FakeServer, values: list[float], at: float | None, error: type[Exception]
) -> None:
    channels = ["valence", "arousal"]
    with chefshat.Client(fake.address) as client:
        room_id, ticket = seated(client)
        with SampleStream(client, ticket, room_id, "affect", channels, local=lambda: 100.0, interval_s=NEVER_S) as stream:
            stream.push([0.25, math.nan])
            with pytest.raises(error):
                stream.push(values, at)
            stream.push([0.5, 0.75], at=100.9)
        (chunk,) = fake.samples
        first, second = chunk.elapsed_us
        assert second - first == pytest.approx(900_000, abs=1)
        assert list(chunk.values) == [0.25, pytest.approx(math.nan, nan_ok=True), 0.5, 0.75]


def test_samples_are_sent_in_a_thread(fake: FakeServer) -> None:
    with chefshat.Client(fake.address) as client:
        room_id, ticket = seated(client)
        with SampleStream(client, ticket, room_id, "affect", ["valence"], interval_s=0.01) as stream:
            stream.push([1.0])
            wait_for(lambda: bool(fake.samples))


def test_what_was_not_received_is_sent_again_in_chunks(fake: FakeServer) -> None:
    count = MAX_SAMPLES + 10
    with chefshat.Client(fake.address) as client:
        room_id, ticket = seated(client)
        stream = SampleStream(client, "nobody's", room_id, "affect", ["valence"], interval_s=NEVER_S)
        for number in range(count):
            stream.push([float(number)])
        with pytest.raises(ChefsHatError, match="TICKET_UNKNOWN"):
            stream.flush()
        stream._seat = ticket
        stream.close()
        assert [len(chunk.elapsed_us) for chunk in fake.samples] == [MAX_SAMPLES, 10]
        assert [value for chunk in fake.samples for value in chunk.values] == [float(number) for number in range(count)]


def test_a_refusal_in_the_thread_is_raised_by_a_push(fake: FakeServer) -> None:
    with chefshat.Client(fake.address) as client:
        room_id, ticket = seated(client)
        stream = SampleStream(client, "nobody's", room_id, "affect", ["valence"], interval_s=0.01)
        pushed, refusal = 0, None
        while refusal is None:
            pushed += 1
            try:
                stream.push([0.0])
            except ChefsHatError as error:
                refusal = error.reason
            time.sleep(0.01)
        assert refusal == "TICKET_UNKNOWN"
        stream._seat = ticket
        stream.close()
        assert sum(len(chunk.elapsed_us) for chunk in fake.samples) == pushed


def test_an_outage_loses_no_sample_and_moves_none() -> None:
    begun = time.monotonic() - 12
    taken = [begun + number / 100 for number in range(1_200)]
    # Nobody else listens there, also while this server is away.
    host, port = f"127.195.{(os.getpid() >> 8) & 255}.{os.getpid() & 255}", 25_051
    with chefshat.Client(f"{host}:{port}", timeout=1.0) as client:
        with FakeServer(host=host, port=port) as before:
            room_id, ticket = seated(client)
            stream = SampleStream(client, ticket, room_id, "affect", ["valence"], interval_s=0.01)
            for at in taken[:100]:
                stream.push([at - begun], at)
            stream.flush()
        for at in taken[100:1_100]:
            stream.push([at - begun], at)
        with pytest.raises(ChefsHatError, match="UNAVAILABLE"):
            stream.flush()
        with FakeServer(host=host, port=port) as after:
            after.games.extend(before.games)
            for at in taken[1_100:]:
                stream.push([at - begun], at)
            wait_for(lambda: sum(len(chunk.elapsed_us) for chunk in after.samples) >= 1_100)
            stream.close()
    chunks = [*before.samples, *after.samples]
    # What was received before its acknowledgement was lost comes twice; the server ignores it.
    received = dict(pair for chunk in chunks for pair in zip(chunk.elapsed_us, chunk.values, strict=True))
    assert len(received) == len(taken)
    first = min(received)
    for moment, at in zip(sorted(received), taken, strict=True):
        assert received[moment] == pytest.approx(at - begun)
        # As precise as the clock of the room is known.
        assert (moment - first) / 1e6 == pytest.approx(at - begun, abs=0.1)


def wait_for(condition: Callable[[], bool]) -> None:
    """Waits until a condition holds."""
    while not condition():
        time.sleep(0.01)
