"""Many games at once, with numpy arrays, over one stream of `VectorService.Run`.

`VectorEnv` steps games in lock-step. Batches are in `batch`, columns in `columns`, sampling of legal actions in `masks`,
transitions in `transitions`, and environments with the interfaces of Gymnasium and PettingZoo in `envs`.
"""

import queue
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Self, TypeAlias, Unpack

import grpc
import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import channels, local_server, pb
from chefshat._gen.chefshat.v1.vector_service_pb2_grpc import VectorServiceStub
from chefshat.address import ServerAddress, server_address
from chefshat.batch import Batch, GameRecord
from chefshat.columns import Beginnings, Endings, Observations, ShiftStatistics, Situations, Sizes, Table, Totals
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.masks import sample_legal
from chefshat.transitions import Memory, RewardFunction, Transitions
from chefshat.vector_setup import Rules, Seed, VectorOptions, put_seed, vector_setup

__all__ = [
    "Batch",
    "Beginnings",
    "Endings",
    "GameRecord",
    "Observations",
    "Rules",
    "Seed",
    "ShiftStatistics",
    "Situations",
    "Sizes",
    "Table",
    "Totals",
    "Transitions",
    "VectorEnv",
    "VectorOptions",
    "sample_legal",
]

# Maximum bytes of a message: the largest batch has a quarter of them (`max_vector_batch_bytes`), a part of a record far fewer.
MAX_BATCH_BYTES = 64 * 1024 * 1024
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


class VectorEnv:
    """Parallel games on a server, stepped in batches. Close it, or use it as a context manager. Not thread-safe.

    The server ends an environment after an hour without an answer (CLIENT_IDLE), and serves 64 of them at a time.

    Every method raises `ChefsHatError` with the server's reason if the server refuses. Then the environment has ended, and every
    further call raises an error: create a new one.

    Attributes:
        server: the server.
        sizes: the numbers that determine the widths of columns; some of them are attributes, too.
        games: n, the number of parallel games.
        client_seats: the seats that the client plays, ascending.
        built_in_agents: names of the built-in agents by seat; empty where the client plays.
        base_seed: the base seed in use; None if the games' seeds were given.
        rules: the rule set, every field set.
        batch: the latest batch.
    """

    def __init__(
        self,
        address: str | ServerAddress | None = None,
        games: int = 1,
        *,
        token: str | None = None,
        ca: Path | str | None = None,
        transitions: bool = False,
        reward_function: RewardFunction | None = None,
        **options: Unpack[VectorOptions],
    ) -> None:
        """Starts the games and fetches the first batch.

        Args:
            address: "host:port", "http://host:port" or, for TLS, "https://host:port"; None: the server shared by this process,
                which is started on demand (see `LocalServer`).
            token: sent with every call; None: that of the environment variable CHEFSHAT_TOKEN, if set.
            ca: PEM file of the certificate authorities to trust; None: that of CHEFSHAT_CA, or else the system's.
            games: n. Games times client seats is limited by the server (`max_vector_seats`).
            transitions: whether batches have `transitions`. They take some 200 bytes for each seat of each game.
            reward_function: computes rewards from the columns of the transitions, instead of the server's.
            options: see `VectorOptions`.
        """
        setup = vector_setup(games, options)
        self._ended: ChefsHatError | None = None
        self._parts: list[pb.RecordLine] = []
        # A server of this process knows no tokens.
        own = ServerAddress(local_server.shared_address(), token="") if address is None else address
        self.server = server_address(own, token, ca)
        channel = channels.channel(self.server, PATIENT_CHANNEL)
        # gRPC takes requests from the queue in a thread of its own.
        outbox: Requests = queue.SimpleQueue()
        self._outbox = outbox
        outbox.put(pb.RunRequest(setup=setup))
        self._call: RunCall = VectorServiceStub(channel).Run(_until_none(outbox))
        self._finalizer = weakref.finalize(self, _end, outbox, self._call, channel)
        try:
            started = self._receive()
            if not started.HasField("started"):
                raise self._fail(ChefsHatError("PROTOCOL_VIOLATED", "the server did not begin with the start message"))
            self._set_attributes(started.started, games)
            self._memory = Memory(games, self.sizes) if transitions or reward_function is not None else None
            self._reward_function = reward_function
            self.batch = self._receive_batch()
        except BaseException:
            self._finalizer()
            raise
        self._fresh = True

    def _set_attributes(self, started: pb.VectorStarted, games: int) -> None:
        self.rules = started.rules
        self.client_seats = tuple(started.client_seats)
        self.built_in_agents = tuple(started.built_in_agents)
        self.base_seed = started.base_seed if started.HasField("base_seed") else None
        self.games = games
        self.sizes = Sizes(
            players=started.rules.players,
            faces=started.rules.faces,
            jokers=started.rules.jokers,
            hand_size=started.hand_size,
            num_actions=started.action_space.size,
            turn_actions=started.action_space.turn_actions,
        )
        self.players = self.sizes.players
        self.faces = self.sizes.faces
        self.jokers = self.sizes.jokers
        self.hand_size = self.sizes.hand_size
        self.num_actions = self.sizes.num_actions
        self.turn_actions = self.sizes.turn_actions
        self.mask_bytes = self.sizes.mask_bytes

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def closed(self) -> bool:
        """Whether `close` has been called."""
        return self._ended is not None and self._ended.reason == "ENV_CLOSED"

    def __repr__(self) -> str:
        state = "open" if self._ended is None else self._ended.reason
        return f"VectorEnv(games={self.games}, client_seats={self.client_seats}, {state})"

    def step(self, actions: ArrayLike) -> Batch:
        """Takes the decisions of the latest batch and returns the next batch.

        Args:
            actions: (R,) integers, the action of each row of `batch`, in order. See `sample_legal`.
        """
        self._check_open()
        batch = self.batch
        if batch.done:
            raise ChefsHatError("GAMES_OVER", "all games are over; call reset(seed) to start new ones")
        array = self._checked(actions, len(batch))
        if self._memory is not None:
            self._memory.remember(batch.games, batch.attempts, batch, array)
        self._fresh = False
        self._outbox.put(pb.RunRequest(actions=pb.VectorActions(actions=array.tobytes())))
        self.batch = self._receive_batch()
        return self.batch

    def reset(self, seed: Seed = None, *, games: ArrayLike | None = None) -> Batch:
        """Abandons games, starts new ones in their place and returns the next batch. Rewards of abandoned games are lost.

        Before the first step, reset() without arguments returns the current batch.

        Args:
            seed: the new seeds, with indices from 0; None: every game continues with its next index. Excludes `games`.
            games: the games; None: all.
        """
        self._check_open()
        if self._fresh and seed is None and games is None:
            return self.batch
        if seed is not None and games is not None:
            raise ValueError("a seed resets all games: leave games out")
        request = pb.VectorReset(all=games is None)
        put_seed(request, seed)
        chosen = None
        if games is not None:
            chosen = np.unique(np.asarray(games))
            if chosen.size == 0:
                return self.batch
            if chosen.dtype.kind not in "iu" or chosen[0] < 0 or chosen[-1] >= self.games:
                raise ValueError(f"games are integers 0..={self.games - 1}")
            chosen = chosen.astype("<u4")
            request.games = chosen.tobytes()
        if self._memory is not None:
            self._memory.forget(chosen)
        if seed is not None:
            self.base_seed = request.base_seed if request.HasField("base_seed") else None
        self._outbox.put(pb.RunRequest(reset=request))
        self.batch = self._receive_batch()
        self._fresh = games is None
        return self.batch

    def close(self) -> None:
        """Ends the stream and the games. Does nothing if it is closed."""
        if self._ended is None:
            self._ended = ChefsHatError("ENV_CLOSED", "this VectorEnv has been closed; make a new one")
        self._finalizer()

    def _check_open(self) -> None:
        if self._ended is None:
            return
        if self.closed:
            raise self._ended
        raise ChefsHatError("ENV_ENDED", f"this VectorEnv has ended ({self._ended}); make a new one") from self._ended

    def _checked(self, actions: ArrayLike, rows: int) -> NDArray[np.uint16]:
        """Checks and encodes actions."""
        array = np.asarray(actions)
        if array.shape != (rows,) or (rows and array.dtype.kind not in "iu"):
            given = f"{array.dtype} of the shape {array.shape}"
            raise ValueError(f"give one action for each row of the batch: integers of the shape ({rows},), not {given}")
        if rows:
            wrong = int(array.argmax())
            if array[wrong] < self.num_actions:
                wrong = int(array.argmin())
            if not 0 <= array[wrong] < self.num_actions:
                raise ValueError(f"row {wrong} has the action {array[wrong]}; actions are 0..={self.num_actions - 1}")
        return array.astype("<u2", copy=False)

    def _receive_batch(self) -> Batch:
        records: list[GameRecord] = []
        while True:
            response = self._receive()
            if response.HasField("batch"):
                message = response.batch
                batch = Batch(message.rows, self.sizes, message)
                batch.records = tuple(records)
                if self._memory is not None:
                    self._complete(batch, self._memory)
                return batch
            if not response.HasField("record"):
                raise self._fail(ChefsHatError("PROTOCOL_VIOLATED", "the server sent neither a batch nor a record"))
            part = response.record
            self._parts.extend(part.lines)
            if part.last:
                records.append(GameRecord(part.game, part.index, tuple(self._parts)))
                self._parts.clear()

    def _complete(self, batch: Batch, memory: Memory) -> None:
        try:
            batch.complete(memory, self._reward_function)
        except BaseException:
            # The server waits for the actions of a batch that the caller never got.
            self._fail(ChefsHatError("REWARDS_FAILED", "the reward function failed"))
            raise

    def _receive(self) -> pb.RunResponse:
        try:
            return next(self._call)
        except grpc.RpcError as error:
            raise self._fail(from_rpc_error(error)) from error
        except StopIteration:
            raise self._fail(connection_lost("the server ended the stream; make a new VectorEnv")) from None
        except BaseException:
            # An interrupt: the response may still come.
            self._fail(ChefsHatError("INTERRUPTED", "a step was interrupted"))
            raise

    def _fail(self, error: ChefsHatError) -> ChefsHatError:
        """Ends the environment with an error."""
        self._ended = error
        self._finalizer()
        return error


def _until_none(outbox: Requests) -> Iterator[pb.RunRequest]:
    """Iterates over the queue until None. Does not reference the env, which can then be garbage-collected."""
    return iter(outbox.get, None)


def _end(outbox: Requests, call: RunCall, channel: grpc.Channel) -> None:
    """Ends a stream and closes its channel."""
    outbox.put(None)
    call.cancel()
    channel.close()
