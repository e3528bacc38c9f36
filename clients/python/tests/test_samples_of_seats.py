"""Streams of samples of a seat: their times, their chunks, and what happens after a refusal."""

import itertools
import math

import pytest
from fake_server import FakeServer

import chefshat
from chefshat import ChefsHatError
from chefshat.samples import MAX_SAMPLES, SampleStream


def test_samples_are_sent_once_a_second_with_times_of_the_room(fake: FakeServer) -> None:
    now = 100.0
    with chefshat.Client(fake.address) as client:
        created = client.create_room("samples")
        ticket = client.join_room(created.join_code, "Ada").ticket
        # The clock of this machine stands still, except between samples.
        stream = SampleStream(client, ticket, created.room.room_id, "affect", ["valence", "arousal"], local=lambda: now)
        for number in range(60):
            stream.push([number / 60, math.nan])
            now += 1 / 30
        assert len(fake.samples) == 1
        stream.flush()
        first, second = fake.samples
        assert (first.stream, list(first.channels)) == ("affect", ["valence", "arousal"])
        times = [*first.elapsed_us, *second.elapsed_us]
        assert len(times) == 60
        steps = [later - earlier for earlier, later in itertools.pairwise(times)]
        assert all(33_332 <= step <= 33_335 for step in steps)
        assert first.values[2] == pytest.approx(1 / 60)
        assert math.isnan(first.values[1])
        stream.push([0.0, 0.0], at=0.0)
        stream.flush()
        assert fake.samples[2].elapsed_us[0] == times[-1] + 1, "times ascend"
        with pytest.raises(ValueError, match="1 values for 2 channels"):
            stream.push([0.0])


def test_what_was_not_received_is_sent_again_in_chunks(fake: FakeServer) -> None:
    now = 100.0
    with chefshat.Client(fake.address) as client:
        created = client.create_room("samples")
        ticket = client.join_room(created.join_code, "Ada").ticket
        stream = SampleStream(client, "nobody's", created.room.room_id, "affect", ["valence"], local=lambda: now)
        refused = 0
        for number in range(MAX_SAMPLES + 10):
            now += 1e-4
            try:
                stream.push([float(number)])
            except ChefsHatError:
                refused += 1
        assert refused == 11
        stream._seat = ticket
        stream.flush()
        assert [len(chunk.elapsed_us) for chunk in fake.samples] == [MAX_SAMPLES, 10]
        assert [value for chunk in fake.samples for value in chunk.values] == [float(number) for number in range(MAX_SAMPLES + 10)]
