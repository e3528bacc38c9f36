"""Games that a server plays for a `VectorEnv`, over one stream of `VectorService.Run`."""

import queue
import weakref
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import channels, pb
from chefshat._games import MAX_STATES_BYTES, check_legal, checked
from chefshat._gen.chefshat.v1.vector_service_pb2_grpc import VectorServiceStub
from chefshat.address import ServerAddress
from chefshat.batch import Batch, GameRecord
from chefshat.client import Client
from chefshat.columns import Beginnings, Endings, ShiftStatistics, Sizes, Totals
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.masks import sample_by
from chefshat.network import grpc
from chefshat.opponents import joined

# Maximum bytes of a message: the largest batch has a quarter of them (`max_vector_batch_bytes`), a part of a record far fewer.
MAX_BATCH_BYTES = 64 * 1024 * 1024
# Most games whose states are asked for in one message.
SAVED_AT_ONCE = 4096
# An environment cannot reconnect and has no clock, so it is patient with a busy server. Times in milliseconds.
PATIENT_CHANNEL = [
    ("grpc.max_receive_message_length", MAX_BATCH_BYTES),
    ("grpc.keepalive_time_ms", 30_000),
    ("grpc.keepalive_timeout_ms", 60_000),
    ("grpc.http2.ping_timeout_ms", 60_000),
]

# The name exists only in the type stubs of grpc.
RunCall: TypeAlias = "grpc._CallIterator[pb.RunResponse]"
Requests: TypeAlias = "queue.SimpleQueue[pb.RunRequest | None]"


class MessageContent:
    """The content of a batch, from a message."""

    def __init__(self, message: pb.VectorBatch) -> None:
        self._message = message
        self.step = message.step
        self.done = message.done

    def endings(self, sizes: Sizes) -> Endings:
        """Returns the episodes that have ended."""
        message = self._message.endings
        return Endings(message.rows, sizes, message)

    def beginnings(self, sizes: Sizes) -> Beginnings:
        """Returns the games that have begun."""
        message = self._message.beginnings
        return Beginnings(message.rows, sizes, message)

    def shifts(self, sizes: Sizes) -> ShiftStatistics | None:
        """Returns the Shifts that have ended; None without statistics."""
        if not self._message.HasField("shifts"):
            return None
        message = self._message.shifts
        return ShiftStatistics(message.rows, sizes, message)

    def totals(self) -> Totals:
        """Returns the counts."""
        totals = self._message.totals
        return Totals(totals.client_decisions, totals.decisions, totals.invalid_attempts, totals.shifts, totals.games)


class RemoteGames:
    """Games of a server. See `_games.Games`."""

    def __init__(self, server: ServerAddress, setup: pb.VectorSetup) -> None:
        self.server: ServerAddress | None = server
        self._address = server
        self._parts: list[pb.RecordLine] = []
        channel = channels.channel(server, PATIENT_CHANNEL)
        # gRPC takes requests from the queue in a thread of its own.
        outbox: Requests = queue.SimpleQueue()
        self._outbox = outbox
        outbox.put(pb.RunRequest(setup=setup))
        self._call: RunCall = VectorServiceStub(channel).Run(_until_none(outbox))
        self._finalizer = weakref.finalize(self, _end, outbox, self._call, channel)
        try:
            started = self._receive()
            if not started.HasField("started"):
                raise ChefsHatError("PROTOCOL_VIOLATED", "the server did not begin with the start message")
        except BaseException:
            self.close()
            raise
        self.started = started.started
        self._sizes = Sizes.of(self.started)
        # Whether the server would end the stream for an illegal action.
        self._refuses = setup.invalid_actions != pb.INVALID_ACTION_RULE_ASK_AGAIN
        self._latest: Batch

    def first(self) -> Batch:
        """Returns the first batch."""
        return self._receive_batch()

    def step(self, actions: ArrayLike, batch: Batch) -> Batch:
        """Takes the action of each row of the latest batch and returns the next batch."""
        return self.take(checked(actions, batch))

    def take(self, actions: NDArray[np.uint16]) -> Batch:
        """Takes actions, of which `LEAVE_OPEN` takes none, and returns the next batch."""
        if self._refuses:
            check_legal(actions, self._latest)
        self._outbox.put(pb.RunRequest(actions=pb.VectorActions(actions=actions.tobytes())))
        return self._receive_batch()

    def reset(self, request: pb.VectorReset) -> Batch:
        """Abandons games, starts new ones and returns the next batch."""
        self._outbox.put(pb.RunRequest(reset=request))
        return self._receive_batch()

    def save(self, games: NDArray[np.uint32]) -> list[bytes]:
        """Returns the states of games."""
        states: list[bytes] = []
        for first in range(0, len(games), SAVED_AT_ONCE):
            part = games[first : first + SAVED_AT_ONCE]
            self._outbox.put(pb.RunRequest(save=pb.VectorSave(games=part.tobytes())))
            response = self._receive()
            if not response.HasField("states"):
                raise ChefsHatError("PROTOCOL_VIOLATED", "the server did not send the states")
            states.extend(response.states.states)
        return states

    def restore(self, games: NDArray[np.uint32], states: Sequence[bytes]) -> Batch:
        """Replaces games, in ascending order, by saved ones and returns the next batch."""
        parts, first, size = [], 0, 0
        for place, state in enumerate(states):
            size += len(state)
            if place > first and size > MAX_STATES_BYTES:
                parts.append(self._restore(games[first:place], states[first:place]))
                first, size = place, len(state)
        last = self._restore(games[first:], states[first:])
        if not parts:
            return last
        return joined([*parts, last], self._sizes, last.step, np.ones(self._sizes.players, np.bool_))

    def _restore(self, games: NDArray[np.uint32], states: Sequence[bytes]) -> Batch:
        self._outbox.put(pb.RunRequest(restore=pb.VectorRestore(games=games.tobytes(), states=states)))
        return self._receive_batch()

    def sample(self, batch: Batch, seed: int, first: int) -> NDArray[np.uint16]:
        """Draws a legal action for each row of the latest batch."""
        return sample_by(batch.mask_bits, seed, first)

    def action_texts(self, faces: int) -> Sequence[str]:
        """Returns the texts of all actions."""
        with Client(self._address) as client:
            return tuple(client.action_table(faces).texts)

    def close(self) -> None:
        """Ends the stream."""
        self._finalizer()

    def _receive_batch(self) -> Batch:
        records: list[GameRecord] = []
        while True:
            response = self._receive()
            if response.HasField("batch"):
                message = response.batch
                batch = Batch(message.rows, self._sizes, MessageContent(message))
                batch.message = message
                batch.records = tuple(records)
                self._latest = batch
                return batch
            if not response.HasField("record"):
                raise ChefsHatError("PROTOCOL_VIOLATED", "the server sent neither a batch nor a record")
            part = response.record
            self._parts.extend(part.lines)
            if part.last:
                records.append(GameRecord(part.game, part.index, tuple(self._parts)))
                self._parts.clear()

    def _receive(self) -> pb.RunResponse:
        try:
            return next(self._call)
        except grpc.RpcError as error:
            raise from_rpc_error(error) from error
        except StopIteration:
            raise connection_lost("the server ended the stream; make a new VectorEnv") from None


def _until_none(outbox: Requests) -> Iterator[pb.RunRequest]:
    """Iterates over the queue until None. Does not reference the games, which can then be garbage-collected."""
    return iter(outbox.get, None)


def _end(outbox: Requests, call: RunCall, channel: grpc.Channel) -> None:
    """Ends a stream and closes its channel."""
    outbox.put(None)
    call.cancel()
    channel.close()
