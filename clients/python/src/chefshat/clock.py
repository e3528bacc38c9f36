"""A server's clocks in terms of a clock of this machine.

`Client.read_clock` returns a `ClockReading`; `RoomClock` follows the clock of a room.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import TYPE_CHECKING, Self

from chefshat import pb
from chefshat.errors import ChefsHatError

if TYPE_CHECKING:
    from chefshat.client import Client

# Returns the time of a clock in seconds.
LocalClock = Callable[[], float]

# This machine's time of day, seconds since the Unix epoch.
TIME_OF_DAY: LocalClock = time.time
# A clock of this machine that nobody sets.
MONOTONIC: LocalClock = time.monotonic
# Readings of which the one with the shortest round trip is kept.
READINGS = 8
# Seconds between two readings of the clock of a room.
INTERVAL_S = 5.0
# A clock that is known less precisely is read again at first, this often.
WANTED_ERROR_S = 0.005
FIRST_READINGS = 5
# How much two clocks drift apart at most, seconds per second: a reading becomes less precise with age.
DRIFT = 2e-4


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
            raise ValueError("this clock was read without a room: client.read_clock(room_id)")
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


class RoomClock:
    """The clock of a room in terms of a local clock, read again in a thread of its own, since clocks drift; a context manager."""

    def __init__(self, client: "Client", room_id: str, *, local: LocalClock = MONOTONIC, interval_s: float = INTERVAL_S) -> None:
        """Reads the clock for the first time.

        Args:
            client: a connection to the server.
            room_id: the room.
            local: the clock of this machine, in seconds.
            interval_s: seconds between two readings.

        Raises:
            ChefsHatError: the server refuses, or cannot be reached.
        """
        self._client = client
        self._room_id = room_id
        self._local = local
        self._interval_s = interval_s
        self._lock = threading.Lock()
        self._readings = 1
        self._reading, self._read_at = self._read()
        for _ in range(FIRST_READINGS - 1):
            if self._reading.error <= WANTED_ERROR_S:
                break
            self.read()
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._follow, name="chefshat-clock", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None) -> None:
        self.close()

    @property
    def reading(self) -> ClockReading:
        """The reading in use."""
        with self._lock:
            return self._reading

    @property
    def readings(self) -> int:
        """How often the clock has been read."""
        with self._lock:
            return self._readings

    def local(self, event: pb.GameEvent) -> float:
        """The time of an event on the local clock, in seconds."""
        return self.reading.local(event.elapsed_ms)

    def elapsed_us(self, at: float | None = None) -> int:
        """Microseconds from the creation of the room to a time of the local clock; None: to now. Negative before it."""
        offset = self.reading.room_offset or 0.0
        return round(((self._local() if at is None else at) + offset) * 1e6)

    def read(self, *, jumped: bool = False) -> None:
        """Reads the clock again. A less precise reading does not replace a recent one, unless one of the clocks has jumped.

        That is so if `jumped` says it, or if the readings contradict each other, as after this machine has slept.
        """
        reading, at = self._read()
        with self._lock:
            self._readings += 1
            aged = self._reading.error + DRIFT * (at - self._read_at)
            apart = abs((reading.room_offset or 0.0) - (self._reading.room_offset or 0.0))
            if jumped or reading.error <= aged or apart > reading.error + aged:
                self._reading, self._read_at = reading, at

    def close(self) -> None:
        """Stops reading."""
        self._closed.set()
        self._thread.join()

    def _read(self) -> tuple[ClockReading, float]:
        return self._client.read_clock(self._room_id, local=self._local), self._local()

    def _follow(self) -> None:
        while not self._closed.wait(self._interval_s):
            try:
                self.read()
            except ChefsHatError:
                continue  # The last reading is used until the server answers again. A room that is over is forgotten some time.
