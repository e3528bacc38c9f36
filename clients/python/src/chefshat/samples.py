"""Streams of samples of a seat, such as thirty a second of affect: `SampleStream`."""

import math
import threading
from array import array
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from chefshat import pb
from chefshat.client import Client
from chefshat.clock import MONOTONIC, LocalClock, RoomClock
from chefshat.errors import ChefsHatError

# Most samples of a chunk.
MAX_SAMPLES = 512
# Most samples that wait while the server cannot be reached: nine hours of thirty a second.
MAX_WAITING = 1_000_000
# How far in the future a sample may be, in microseconds: clocks are not known exactly. The server allows the same.
MAX_AHEAD_US = 1_000_000
# Seconds between two chunks.
INTERVAL_S = 1.0


class SampleStream:
    """Collects samples of a seat, and sends them about once a second in a thread of its own; a context manager.

    While the server cannot be reached, samples wait, with the times at which they were taken. One thread pushes.
    """

    def __init__(
        self,
        client: Client,
        ticket: str,
        room_id: str,
        stream: str,
        channels: Sequence[str],
        *,
        seat: int | None = None,
        local: LocalClock = MONOTONIC,
        interval_s: float = INTERVAL_S,
    ) -> None:
        """Reads the clock of the room.

        Args:
            client: a connection to the server.
            ticket: the ticket of the seat; with `seat` the owner's token of the room, or of the study whose game it is.
            room_id: its room.
            stream: name of the stream, 1..=32 ASCII letters, digits, `_`, `-` or `.`.
            channels: names of its 1..=16 channels.
            seat: the seat, from 0, if the token of the owner is given.
            local: the clock of this machine that times are from, in seconds; default: `time.monotonic`, which nobody sets.
            interval_s: seconds between two chunks.

        Raises:
            ChefsHatError: the server refuses, or cannot be reached.
        """
        self._client = client
        self._seat = ticket if seat is None else pb.OwnedSeat(room_id=room_id, owner_token=ticket, seat=seat)
        self._interval_s = interval_s
        self._waiting = pb.SampleChunk(stream=stream, channels=channels)
        self._last_us = -1
        self._refusal: ChefsHatError | None = None
        #: Locks what waits.
        self._lock = threading.Lock()
        #: Held by the thread that sends.
        self._sending = threading.Lock()
        self._closed = threading.Event()
        self.clock = RoomClock(client, room_id, local=local)
        self._thread = threading.Thread(target=self._follow, name="chefshat-samples", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, traceback: TracebackType | None) -> None:
        self.close()

    def push(self, values: Sequence[float], at: float | None = None) -> None:
        """Adds a sample. Never waits for the server.

        Args:
            values: one for each channel, finite as 32-bit numbers; NaN where there is none.
            at: when it was taken, on the local clock; None: now.

        Raises:
            ValueError: the values do not match the channels or are infinite, or the time is in the future. The sample is not added.
            ChefsHatError: the server has refused earlier samples, or was away for so long that no more can wait (SAMPLES_WAITING).
        """
        if len(values) != len(self._waiting.channels):
            raise ValueError(f"{len(values)} values for {len(self._waiting.channels)} channels")
        # The server refuses a whole chunk with a wrong sample, and so all samples after it: it must not get into one.
        sample = array("f", values)
        if any(map(math.isinf, sample)):
            raise ValueError(f"{values} must be finite as 32-bit numbers, or NaN where there is none")
        moment = self.clock.elapsed_us(at)
        if at is not None and moment > self.clock.elapsed_us() + MAX_AHEAD_US:
            raise ValueError(f"{at} is in the future of the local clock")
        with self._lock:
            if len(self._waiting.elapsed_us) >= MAX_WAITING:
                raise ChefsHatError("SAMPLES_WAITING", f"{MAX_WAITING} samples wait for a server that does not answer")
            # Times ascend, also if the clock was read anew meanwhile.
            self._last_us = max(moment, self._last_us + 1, 0)
            self._waiting.elapsed_us.append(self._last_us)
            self._waiting.values.extend(sample)
            refusal, self._refusal = self._refusal, None
        if refusal is not None:
            raise refusal

    def flush(self) -> None:
        """Sends the samples that wait.

        Raises:
            ChefsHatError: the server refuses, or cannot be reached. The samples wait for the next attempt.
        """
        with self._sending:
            while (chunk := self._first()) is not None:
                self._client.rooms.add_samples(self._seat, chunk)
                with self._lock:
                    del self._waiting.elapsed_us[: len(chunk.elapsed_us)]
                    del self._waiting.values[: len(chunk.values)]

    def close(self) -> None:
        """Sends the samples that wait, and ends the stream.

        Raises:
            ChefsHatError: the server refuses, or cannot be reached.
        """
        self._closed.set()
        self._thread.join()
        self.clock.close()
        self.flush()

    def _first(self) -> pb.SampleChunk | None:
        """A chunk of what has waited longest."""
        with self._lock:
            waiting = self._waiting
            if not waiting.elapsed_us:
                return None
            return pb.SampleChunk(
                stream=waiting.stream,
                channels=waiting.channels,
                elapsed_us=waiting.elapsed_us[:MAX_SAMPLES],
                values=waiting.values[: MAX_SAMPLES * len(waiting.channels)],
            )

    def _follow(self) -> None:
        while not self._closed.wait(self._interval_s):
            try:
                self.flush()
            except ChefsHatError as error:
                if error.retryable:
                    continue
                with self._lock:
                    self._refusal = error
