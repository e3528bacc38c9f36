"""Many games at once: numpy in, numpy out, over one stream of `VectorService.Run`.

`VectorEnv` steps games that nobody else takes part in, in lock-step. What it hands out is in `batch`, its columns in `columns`,
drawing legal actions in `masks`, what decisions led to in `transitions`; environments with the interfaces of Gymnasium and
PettingZoo in `envs`.
"""

import queue
import weakref
from collections.abc import Iterator, Sequence
from typing import Self, TypeAlias

import grpc
import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import local_server, pb, requests
from chefshat._gen.chefshat.v1.vector_service_pb2_grpc import VectorServiceStub
from chefshat.batch import Batch, GameRecord
from chefshat.columns import Beginnings, Endings, Observations, ShiftStatistics, Situations, Sizes, Table, Totals
from chefshat.errors import ChefsHatError, connection_lost, from_rpc_error
from chefshat.masks import sample_legal
from chefshat.transitions import Memory, RewardFunction, Transitions
from chefshat.vector_setup import Rules, Seed, put_seed, vector_setup

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
    "sample_legal",
]

# Bytes a message may have: the largest batch has a quarter of them (`max_vector_batch_bytes`), and a part of a record far less.
MAX_BATCH_BYTES = 64 * 1024 * 1024

# The name exists in grpc's type stubs alone.
RunCall: TypeAlias = "grpc._CallIterator[pb.RunResponse]"
Requests: TypeAlias = "queue.SimpleQueue[pb.RunRequest | None]"


class VectorEnv:
    """Games of one's own, stepped side by side. Close it, or use it as a context manager. For one thread at a time.

    The server ends games that nobody has answered for an hour (CLIENT_IDLE), and serves 64 such environments at a time.

    Every method raises `ChefsHatError` with the server's reason when the server refuses, and so does every further call: make a new
    one then.

    Attributes:
        address: the server.
        sizes: the numbers that the widths of columns follow from; those below are shortcuts.
        games: n, the number of games side by side.
        client_seats: the seats that the client plays, ascending.
        built_in_agents: names of the built-in agents by seat; empty where the client plays.
        base_seed: the base seed in use; None if the games' seeds were given one by one.
        rules: the rule set, every field set.
        batch: the latest batch.
    """

    def __init__(
        self,
        address: str | None = None,
        games: int = 1,
        *,
        client_seats: Sequence[int] | None = None,
        opponents: str | Sequence[str] = "random",
        rewards: str | None = None,
        episode: str = "shift",
        decisions: str = "all",
        other_decisions: str | None = None,
        skip_forced: bool = False,
        invalid: str = "error",
        max_invalid_attempts: int = 0,
        total_games: int = 0,
        seed: Seed = None,
        rules: Rules = None,
        hands: pb.ScriptedShift | None = None,
        branch: pb.BranchPoint | None = None,
        shift_statistics: bool = False,
        records: bool = False,
        transitions: bool = False,
        reward_function: RewardFunction | None = None,
    ) -> None:
        """Begins the games and fetches the first batch.

        Args:
            address: "host:port", "http://host:port" or, for TLS, "https://host:port"; None: a server of this process's own, which
                is started if need be (see `LocalServer`).
            games: n. Games times client seats is limited by the server (`max_vector_seats`).
            client_seats: the seats played here; None: all.
            opponents: the built-in agents of the other seats: one for each in the order of the seats, or one for all.
            rewards: "validity", "paper", "paper_intended", "winning" or "points"; None: all rewards are 0.
            episode: "shift" or "game".
            decisions: "all", or "turns": the first T actions alone.
            other_decisions: with "turns": the built-in agent that takes the others; None: the default decision is taken.
            skip_forced: whether decisions with one legal action are taken without asking.
            invalid: what an illegal action does: "error" ends the stream; "ask_again" counts it, rewards it and asks again.
            max_invalid_attempts: with "ask_again": invalid attempts after which the default decision is taken; 0: unlimited.
            total_games: games to play in all; 0: without end.
            seed: a base seed, the games' own seeds, or None for chance. See `Seed`.
            rules: the rule set; None: the standard. See `Rules`.
            hands: the hands each game begins with, instead of a deal.
            branch: the point of a recorded game that each game begins from.
            shift_statistics: whether batches have `shifts`.
            records: whether batches have the `records` of games that have ended.
            transitions: whether batches have `transitions`. It takes some 200 bytes for each seat of each game.
            reward_function: rewards of one's own, from the columns of the transitions, in place of the server's.
        """
        setup = vector_setup(
            games=games,
            client_seats=client_seats,
            opponents=opponents,
            rewards=rewards,
            episode=episode,
            decisions=decisions,
            other_decisions=other_decisions,
            skip_forced=skip_forced,
            invalid=invalid,
            max_invalid_attempts=max_invalid_attempts,
            total_games=total_games,
            seed=seed,
            rules=rules,
            hands=hands,
            branch=branch,
            shift_statistics=shift_statistics,
            records=records,
        )
        self._ended: ChefsHatError | None = None
        self._parts: list[pb.RecordLine] = []
        self.address = local_server.shared_address() if address is None else address
        channel = requests.channel(self.address, [("grpc.max_receive_message_length", MAX_BATCH_BYTES)])
        # Requests are taken from the queue in a thread of gRPC's own.
        outbox: Requests = queue.SimpleQueue()
        self._outbox = outbox
        outbox.put(pb.RunRequest(setup=setup))
        self._call: RunCall = VectorServiceStub(channel).Run(_until_none(outbox))
        self._finalizer = weakref.finalize(self, _end, outbox, self._call, channel)
        try:
            started = self._receive()
            if not started.HasField("started"):
                raise self._fail(ChefsHatError("PROTOCOL_VIOLATED", "the server did not begin with what it made of the setup"))
            self._understand(started.started, games)
            self._memory = Memory(games, self.sizes) if transitions or reward_function is not None else None
            self._reward_function = reward_function
            self.batch = self._receive_batch()
        except BaseException:
            self._finalizer()
            raise
        self._fresh = True

    def _understand(self, started: pb.VectorStarted, games: int) -> None:
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
        """Takes the decisions of the latest batch and returns the next.

        Args:
            actions: (R,) integers, the action of each row of `batch`, in the same order. See `sample_legal`.
        """
        self._check_open()
        batch = self.batch
        if batch.done:
            raise ChefsHatError("GAMES_OVER", "all games are over and no other follows; reset(seed) begins anew")
        array = self._checked(actions, len(batch))
        if self._memory is not None:
            self._memory.remember(batch.games, batch.attempts, batch, array)
        self._fresh = False
        self._outbox.put(pb.RunRequest(actions=pb.VectorActions(actions=array.tobytes())))
        self.batch = self._receive_batch()
        return self.batch

    def reset(self, seed: Seed = None, *, games: ArrayLike | None = None) -> Batch:
        """Gives games up, begins them anew and returns the next batch. What they were rewarded with is lost.

        Before the first step, reset() without arguments is the batch which is there already.

        Args:
            seed: seeds from here on, indices beginning at 0 again; None: every game goes on with its next index. Not together with
                `games`.
            games: the games; None: all.
        """
        self._check_open()
        if self._fresh and seed is None and games is None:
            return self.batch
        if seed is not None and games is not None:
            raise ValueError("seeds can be given only where all games begin anew: leave games out")
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
        """Ends the stream and the games. More than once does no harm."""
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
        """The actions as they are sent."""
        array = np.asarray(actions)
        if array.shape != (rows,) or (rows and array.dtype.kind not in "iu"):
            told = f"{array.dtype} of the shape {array.shape}"
            raise ValueError(f"one action is wanted for each row of the batch: integers of the shape ({rows},), not {told}")
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
                raise self._fail(ChefsHatError("PROTOCOL_VIOLATED", "the server sent something other than a batch or a record"))
            part = response.record
            self._parts.extend(part.lines)
            if part.last:
                records.append(GameRecord(part.game, part.index, tuple(self._parts)))
                self._parts.clear()

    def _complete(self, batch: Batch, memory: Memory) -> None:
        try:
            batch.complete(memory, self._reward_function)
        except BaseException:
            # The batch is not the latest, and the server waits for its actions.
            self._fail(ChefsHatError("REWARDS_FAILED", "the rewards of a batch could not be worked out"))
            raise

    def _receive(self) -> pb.RunResponse:
        try:
            return next(self._call)
        except grpc.RpcError as error:
            raise self._fail(from_rpc_error(error)) from error
        except StopIteration:
            raise self._fail(connection_lost("the server ended the stream; make a new VectorEnv")) from None
        except BaseException:
            # An interrupt: whether the answer comes nobody will know.
            self._fail(ChefsHatError("INTERRUPTED", "a step was interrupted"))
            raise

    def _fail(self, error: ChefsHatError) -> ChefsHatError:
        """Notes why there will be no further batch."""
        self._ended = error
        self._finalizer()
        return error


def _until_none(outbox: Requests) -> Iterator[pb.RunRequest]:
    """What is put into the queue, until None is. It does not refer to the env, so that one nobody uses any more can go."""
    return iter(outbox.get, None)


def _end(outbox: Requests, call: RunCall, channel: grpc.Channel) -> None:
    """Ends a stream and everything that belongs to it."""
    outbox.put(None)
    call.cancel()
    channel.close()
