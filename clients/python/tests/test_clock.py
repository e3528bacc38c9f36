"""Reading a server's clocks: the offset, the round trip, and the local times of events."""

import asyncio
import itertools
import time
from typing import Any

import pytest
from fake_server import CLOCK_AHEAD_S, FakeServer

import chefshat
from chefshat import ChefsHatError, ClockReading, aio, pb
from chefshat.clock import RoomClock


def test_four_times_give_the_offset_and_the_round_trip() -> None:
    # Ten milliseconds there, one to answer, twenty back; ten seconds ahead.
    room = pb.RoomClock(game_id="game", created_at_ms=1_005_000, received_us=5_010_000, sent_us=5_011_000)
    response = pb.GetClockResponse(received_at_us=1_010_010_000, sent_at_us=1_010_011_000, room=room)
    clock = ClockReading.of(response, 1000.0, 1000.031)
    assert clock.round_trip == pytest.approx(0.030)
    assert clock.error == pytest.approx(0.015)
    # The way there was shorter: five milliseconds wrong, of at most fifteen.
    assert clock.offset == pytest.approx(9.995)
    assert clock.room_offset == pytest.approx(-995.005)
    assert clock.local(5_010) == pytest.approx(1000.015)
    assert (clock.created_at_ms, clock.game_id) == (1_005_000, "game")


def test_the_reading_with_the_shortest_round_trip_is_returned(fake: FakeServer) -> None:
    # The local clock says when each of three requests was sent and answered: two, one and three seconds.
    times = itertools.chain([0.0, 2.0, 5.0, 6.0, 7.0, 10.0])
    with chefshat.Client(fake.address) as client:
        clock = client.read_clock(local=lambda: next(times), readings=3)
    assert clock.round_trip == 1.0
    assert next(times, None) is None


def test_the_offset_is_known_to_half_the_round_trip(fake: FakeServer) -> None:
    with chefshat.Client(fake.address) as client:
        clock = client.read_clock()
        # In microseconds, and as precise as numbers of this size are.
        assert abs(clock.offset - CLOCK_AHEAD_S) <= clock.error + 2e-6
        assert clock.room_offset is None
        with pytest.raises(ValueError, match="without a room"):
            clock.local(0)
        room = client.rooms.create("clock").room
        clock = client.read_clock(room.room_id)
        assert clock.room_offset is not None
        assert abs(clock.room_offset) <= clock.error + 2e-6
        assert clock.game_id == room.game_id
        with pytest.raises(ChefsHatError) as caught:
            client.read_clock("nobody's")
        assert caught.value.reason == "ROOM_UNKNOWN"


def test_a_reading_that_contradicts_the_one_in_use_replaces_it() -> None:
    # Offset of the room and error of each reading, and the local time after it.
    readings = [(100.0, 0.001, 50.0), (100.01, 0.02, 51.0), (3700.0, 0.02, 52.0), (7300.0, 0.03, -3548.0)]
    times = iter([time for _, _, time in readings])

    class Server:
        def __init__(self) -> None:
            self.left = [ClockReading(0.0, 2 * error, offset) for offset, error, _ in readings]

        def read_clock(self, room_id: str, *, local: object) -> ClockReading:
            return self.left.pop(0)

    server: Any = Server()
    with RoomClock(server, "room", local=lambda: next(times), interval_s=3600.0) as clock:
        offsets = [clock.reading.room_offset]
        for _ in readings[1:]:
            clock.read()
            offsets.append(clock.reading.room_offset)
    # One is less precise, this machine sleeps for an hour, and its clock is set back by one.
    assert offsets == [100.0, 100.0, 3700.0, 7300.0]


@pytest.mark.server
def test_events_are_placed_between_what_came_before_and_after(real_address: str) -> None:
    async def joined() -> None:
        async with aio.Client(real_address) as client:
            before = time.monotonic()
            created = await client.rooms.create("clock")
            joined = time.monotonic()
            await client.rooms.join(created.join_code, "agent")
            after = time.monotonic()
            clock = await client.read_clock(created.room.room_id, local=time.monotonic)
            assert clock.game_id == created.room.game_id
            assert clock.created_at_ms == created.room.created_at_ms
            # The time of an event is rounded to a millisecond.
            error = clock.error + 1e-3
            assert before - error <= clock.local(0) <= joined + error
            async for event in client.rooms.watch(created.room.room_id):
                assert joined - error <= clock.local(event.elapsed_ms) <= after + error
                break

    asyncio.run(joined())
