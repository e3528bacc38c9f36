"""Streams of samples of a seat, such as thirty a second of affect: `SampleStream`."""

from collections.abc import Sequence

from chefshat import pb
from chefshat.client import Client
from chefshat.clock import TIME_OF_DAY, ClockReading, LocalClock

# Most samples of a chunk.
MAX_SAMPLES = 512
# Seconds between two chunks.
INTERVAL_S = 1.0
# Seconds between two readings of the server's clock.
CLOCK_INTERVAL_S = 30.0


class SampleStream:
    """Collects samples of a seat and sends them about once a second, in the thread that pushes them. Not thread-safe."""

    def __init__(
        self,
        client: Client,
        ticket: str,
        room_id: str,
        stream: str,
        channels: Sequence[str],
        *,
        seat: int | None = None,
        local: LocalClock = TIME_OF_DAY,
    ) -> None:
        """Reads the clock of the room.

        Args:
            client: a connection to the server.
            ticket: the ticket of the seat; with `seat` the owner's token of the room, or of the study whose game it is.
            room_id: its room.
            stream: name of the stream, 1..=32 ASCII letters, digits, `_`, `-` or `.`.
            channels: names of its 1..=16 channels.
            seat: the seat, from 0, if the token of the owner is given.
            local: the clock of this machine that times are from, in seconds; default: the time of day.
        """
        self._client = client
        self._seat = ticket if seat is None else pb.OwnedSeat(room_id=room_id, owner_token=ticket, seat=seat)
        self._room_id = room_id
        self._local = local
        self._chunk = pb.SampleChunk(stream=stream, channels=channels)
        self._reading, self._read_at = self._read()
        self._sent_at = self._read_at
        self._last_us = -1

    def push(self, values: Sequence[float], at: float | None = None) -> None:
        """Adds a sample, and sends those that wait if the last were sent a second ago.

        Args:
            values: one for each channel; NaN where there is none.
            at: when it was taken, on the local clock; None: now.

        Raises:
            ChefsHatError: the server refuses, or cannot be reached. The samples are sent again with the next ones.
        """
        if len(values) != len(self._chunk.channels):
            raise ValueError(f"{len(values)} values for {len(self._chunk.channels)} channels")
        now = self._local()
        if now - self._read_at > CLOCK_INTERVAL_S:
            self._reading, self._read_at = self._read()
        offset = self._reading.room_offset or 0.0
        # Times ascend, also if the clocks were read anew meanwhile.
        moment = max(round(((now if at is None else at) + offset) * 1e6), self._last_us + 1, 0)
        self._last_us = moment
        self._chunk.elapsed_us.append(moment)
        self._chunk.values.extend(values)
        if now - self._sent_at >= INTERVAL_S or len(self._chunk.elapsed_us) >= MAX_SAMPLES:
            self.flush()

    def flush(self) -> None:
        """Sends the samples that wait."""
        while self._chunk.elapsed_us:
            width = len(self._chunk.channels)
            first = pb.SampleChunk(
                stream=self._chunk.stream,
                channels=self._chunk.channels,
                elapsed_us=self._chunk.elapsed_us[:MAX_SAMPLES],
                values=self._chunk.values[: MAX_SAMPLES * width],
            )
            self._client.add_samples(self._seat, first)
            del self._chunk.elapsed_us[:MAX_SAMPLES]
            del self._chunk.values[: MAX_SAMPLES * width]
        self._sent_at = self._local()

    def _read(self) -> tuple[ClockReading, float]:
        return self._client.clock(self._room_id, local=self._local), self._local()
