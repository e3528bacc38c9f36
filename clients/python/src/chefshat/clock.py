"""A server's clocks in terms of a clock of this machine: `ClockReading`, which `Client.clock` returns."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from chefshat import pb

# Returns the time of a clock in seconds.
LocalClock = Callable[[], float]

# This machine's time of day, seconds since the Unix epoch.
TIME_OF_DAY: LocalClock = time.time
# Readings of which the one with the shortest round trip is kept.
READINGS = 8


@dataclass(frozen=True)
class ClockReading:
    """What the clocks of a server showed at a time of a clock of this machine, in seconds.

    Clocks drift apart, so read them again from time to time, and after a `ServerRestarted` event.

    Attributes:
        offset: how far the server's time of day (seconds since the Unix epoch) is ahead of the local clock.
        round_trip: time that the request and its response took on the way.
        room_offset: how far the clock of the room, which starts at 0 when the room is created, is ahead of the local clock; None
            without a room.
        created_at_ms: milliseconds since the Unix epoch when the room was created; 0 without a room.
        game_id: the game of the room; empty without a room.
    """

    offset: float
    round_trip: float
    room_offset: float | None = None
    created_at_ms: int = 0
    game_id: str = ""

    @property
    def error(self) -> float:
        """How much the offsets can be wrong, in seconds: half the round trip."""
        return self.round_trip / 2

    def local(self, elapsed_ms: float) -> float:
        """The local time of something that happened in the room, `elapsed_ms` (of an event or record) after its creation."""
        if self.room_offset is None:
            raise ValueError("this clock was read without a room: client.clock(room_id)")
        return elapsed_ms / 1e3 - self.room_offset

    @classmethod
    def of(cls, response: pb.GetClockResponse, sent: float, arrived: float) -> "ClockReading":
        """Relates a response to the local times at which the request was sent and the response arrived."""
        middle = (sent + arrived) / 2
        offset = (response.received_at_us + response.sent_at_us) / 2e6 - middle
        answering = (response.sent_at_us - response.received_at_us) / 1e6
        room_offset = None
        if response.HasField("room"):
            room_offset = (response.room.received_us + response.room.sent_us) / 2e6 - middle
        return cls(
            offset=offset,
            round_trip=max(arrived - sent - answering, 0.0),
            room_offset=room_offset,
            created_at_ms=response.room.created_at_ms,
            game_id=response.room.game_id,
        )
