"""Many games at once, with numpy arrays, in this process or over one stream of `VectorService.Run`.

`VectorEnv` steps games in lock-step. What plays the games is in `_native` and `_remote`, behind the interface in `_games`. Batches
are in `batch`, columns in `columns`, sampling of legal actions in `masks`, transitions in `transitions`, and environments with the
interfaces of Gymnasium and PettingZoo in `envs`.
"""

import importlib.util
import secrets
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import NoReturn, Self, TypeAlias, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import local_server, pb
from chefshat._games import LEAVE_OPEN, MAX_MESSAGE_BYTES, MAX_STATES_BYTES, Games, checked, checked_rows
from chefshat.address import ServerAddress, server_address
from chefshat.batch import Batch, GameRecord
from chefshat.columns import Beginnings, Endings, Observations, ShiftStatistics, Situations, Sizes, Table, Totals
from chefshat.errors import ChefsHatError
from chefshat.masks import sample_legal
from chefshat.opponents import Policies, Policy, PolicyGames, split
from chefshat.transitions import Memory, RewardFunction, Transitions
from chefshat.vector_setup import GameOptions, Rules, Seed, VectorOptions, put_seed, thread_count, vector_setup, whole

__all__ = [
    "Batch",
    "Beginnings",
    "Endings",
    "GameOptions",
    "GameRecord",
    "Observations",
    "Policy",
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

#: The address of the server shared by this process, which is started on demand.
LOCAL = "local"


# The arguments that say where games are played: address, token, certificates, threads of this process.
_Place: TypeAlias = "tuple[str | ServerAddress | None, str | None, Path | str | None, int]"
# Errors after which the games are as they were.
_UNCHANGED = ("GAMES_IN_USE", "ILLEGAL_ACTION")


class VectorEnv:
    """Parallel games, stepped in batches. Close it, or use it as a context manager. Not thread-safe.

    The games are played in this process if the package `chefshat-native` is installed, or else, and with an address, by a server.
    A server ends an environment after an hour without an answer (CLIENT_IDLE), and serves 64 of them at a time.

    Every method raises `ChefsHatError` with a reason if a request is refused. Then the environment has ended, and every further
    call raises an error: create a new one. Only GAMES_IN_USE, for a call while another thread steps the games, and ILLEGAL_ACTION,
    which names the row and its game, change nothing. An environment cannot be pickled or copied: `fork` copies its games, `save`
    returns their states.

    Attributes:
        server: the server that plays the games; None: this process.
        sizes: the numbers that determine the widths of columns; some of them are attributes, too.
        games: n, the number of parallel games.
        client_seats: the seats that the client plays, ascending.
        built_in_agents: names of the built-in agents by seat; empty where the client or a function plays.
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
        threads: int = 0,
        **options: Unpack[VectorOptions],
    ) -> None:
        """Starts the games and fetches the first batch.

        Args:
            address: "host:port", "http://host:port" or, for TLS, "https://host:port"; "local": the server shared by this process,
                which is started on demand (see `LocalServer`); None: this process without a server, if `chefshat-native` is
                installed, or else as "local".
            token: sent with every call; None: that of the environment variable CHEFSHAT_TOKEN, if set.
            ca: PEM file of the certificate authorities to trust; None: that of CHEFSHAT_CA, or else the system's.
            games: n. Games times client seats is limited by the server (`max_vector_seats`), and in this process by the memory.
            transitions: whether batches have `transitions`. They take some 200 bytes for each seat of each game.
            reward_function: computes rewards from the columns of the transitions, instead of the server's.
            threads: how many of this process step the games, at most 256; 0: one for each core. They do not change what is played.
            options: see `VectorOptions` and `GameOptions`.
        """
        place = address, token, ca, thread_count(threads)
        inside, policies = split(options)
        self._start(vector_setup(games, inside), policies, place, transitions, reward_function)

    def _start(
        self,
        setup: pb.VectorSetup,
        policies: Policies | None,
        place: _Place,
        transitions: bool,
        reward_function: RewardFunction | None,
    ) -> None:
        """Starts the games of a setup."""
        self._setup = setup
        self._policies = policies
        self._place = place
        self._ended: ChefsHatError | None = None
        self._games = _begin(setup, policies, *place)
        try:
            self._set_attributes(self._games.started, setup.games)
            if not setup.opponents and len(self.client_seats) < self.players:
                raise ValueError("opponents is empty: give one for each of the other seats, or one for all")
            self.server = self._games.server
            keeps = transitions or reward_function is not None
            self._memory = Memory(setup.games, self.sizes) if keeps else None
            self._reward_function = reward_function
            self.batch = self._completed(self._games.first())
        except BaseException:
            self._games.close()
            raise
        self._fresh = True
        # The sequence of `sample`, and the number of its next draw.
        self._sampling_seed = secrets.randbits(64)
        self._drawn = 0

    def _set_attributes(self, started: pb.VectorStarted, games: int) -> None:
        self.rules = started.rules
        self.client_seats = tuple(started.client_seats)
        self.built_in_agents = tuple(started.built_in_agents)
        self.base_seed = started.base_seed if started.HasField("base_seed") else None
        self.games = games
        self.sizes = Sizes.of(started)
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
        where = "in process" if self.server is None else f"on {self.server}"
        return f"VectorEnv(games={self.games}, client_seats={self.client_seats}, {where}, {state})"

    def __reduce__(self) -> NoReturn:
        raise TypeError("a VectorEnv cannot be pickled or copied: copy its games with fork(), or save() and restore() their states")

    def step(self, actions: ArrayLike, *, leave_open: ArrayLike | None = None) -> Batch:
        """Takes the decisions of the latest batch and returns the next batch.

        Args:
            actions: (R,) integers, the action of each row of `batch`, in order. See `sample_legal`.
            leave_open: (R,) booleans: decisions that are not taken; the next batch has them again, unchanged. None: none of them.
        """
        if self._ended is not None:
            self._check_open()
        batch = self.batch
        if batch.done:
            raise ChefsHatError("GAMES_OVER", "all games are over; call reset(seed) to start new ones")
        if self._memory is not None or leave_open is not None:
            actions = checked(actions, batch)
        taken, chosen = batch, actions
        left = None if leave_open is None else checked_rows("leave_open", leave_open, batch)
        if self._memory is not None and left is not None:
            taken, chosen = batch.take(~left), np.asarray(actions)[~left]
        try:
            if left is None:
                stepped = self._games.step(actions, batch)
            else:
                stepped = self._games.take(np.where(left, np.uint16(LEAVE_OPEN), actions))
            if self._memory is not None:
                self._memory.remember(taken.games, taken.attempts, taken, np.asarray(chosen))
        except (TypeError, ValueError):
            # Wrong arguments: nothing has changed.
            raise
        except BaseException as error:
            self._fail(error)
            raise
        self._fresh = False
        self.batch = stepped if self._memory is None else self._completed(stepped)
        return self.batch

    def sample(self, seed: int | None = None) -> NDArray[np.uint16]:
        """Draws one legal action for each row of the latest batch, uniformly.

        Args:
            seed: begins a new sequence of draws, 0..2**64-1; None: continues the sequence, which initially is a random one.
        """
        self._check_open()
        chosen, first = (self._sampling_seed, self._drawn) if seed is None else (whole("a seed", seed, 0, 2**64 - 1), 0)
        actions = self._games.sample(self.batch, chosen, first)
        self._sampling_seed, self._drawn = chosen, first + len(self.batch)
        return actions

    @cached_property
    def action_texts(self) -> tuple[str, ...]:
        """The texts of all actions, for people."""
        self._check_open()
        return tuple(self._games.action_texts(self.faces))

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
            chosen = self._numbers(chosen)
            request.games = chosen.tobytes()
        try:
            batch = self._games.reset(request)
            if self._memory is not None:
                self._memory.forget(chosen)
        except BaseException as error:
            self._fail(error)
            raise
        if seed is not None:
            self.base_seed = request.base_seed if request.HasField("base_seed") else None
        self.batch = self._completed(batch)
        self._fresh = games is None
        return self.batch

    def save(self, games: ArrayLike | None = None) -> list[bytes]:
        """Returns the complete states of games: everything that determines how they continue.

        A state has the cards of all seats: keep it from the agents that play. It is opaque, and the same on all platforms and on
        both ways to the games. It has less than 2 KB (by default some 420 bytes), and 5 bytes for each action of a history; with
        `records=True` also the decisions so far.

        Args:
            games: the games, 0..n-1, in any order, for instance `batch.games[rows]`; None: all.
        """
        self._check_open()
        chosen = np.arange(self.games, dtype="<u4") if games is None else self._numbers(games)
        try:
            return self._games.save(chosen)
        except BaseException as error:
            self._fail(error)
            raise

    def restore(self, games: ArrayLike, states: Sequence[bytes]) -> Batch:
        """Replaces games by saved ones and returns the next batch, which has every game that waits for a decision.

        A restored game continues exactly as the saved one would: the same deals, and the same random choices of built-in agents.
        The game after it has the saved index plus `games`, and the seed that this environment has for that index. Transitions that
        had begun in a replaced game are not completed.

        Args:
            games: the games to replace, each once.
            states: the state of each, of an environment that differs at most in the number of games, seed, start (hands, branch),
                episode, skip_forced and, without `records`, in who plays which seat: the new player of a seat decides from here on.
                Rewards of a seat that a built-in agent or a network file played, or plays here, begin with 0. STATES_REFUSED says
                what else differs.
        """
        self._check_open()
        chosen = self._numbers(games)
        order = np.argsort(chosen)
        if len(np.unique(chosen)) != len(chosen) or len(states) != len(chosen):
            raise ValueError(f"name each game once and give one state for each: {len(chosen)} games and {len(states)} states")
        if not len(chosen):
            return self.batch
        for number, state in enumerate(states):
            if not isinstance(state, bytes):
                raise TypeError(f"state {number} is not bytes, as `save` returns them, but a {type(state).__name__}")
        largest = max(len(state) for state in states)
        if self.server is not None and largest > MAX_STATES_BYTES:
            raise ValueError(f"a state of {largest} bytes is too large for a server: restore it in this process, without `address`")
        try:
            batch = self._games.restore(chosen[order], [states[place] for place in order])
            if self._memory is not None:
                self._memory.forget(chosen)
        except BaseException as error:
            self._fail(error)
            raise
        self.batch = self._completed(batch)
        self._fresh = False
        return self.batch

    def fork(self, games: ArrayLike | None = None, times: int = 1, *, seed: Seed = None) -> Self:
        """Returns another environment with `times` copies of each of these games, and the same options otherwise.

        Game i of it is a copy of `games[i % len(games)]`. After a reset, a copy begins again from the same state; likewise when its
        game is over, unless `total_games` is set. Records are not kept. This environment is unchanged.

        Args:
            games: the games to copy, for instance `batch.games[rows]`; None: all. Their games must be running.
            times: copies of each.
            seed: later Shifts are dealt, and built-in agents choose at random, by these seeds, so that copies differ; the cards of
                the current Shift stay the same. None: each copy continues exactly as its original would.
        """
        states = self.save(games)
        setup = pb.VectorSetup()
        setup.CopyFrom(self._setup)
        setup.rules.CopyFrom(self.rules)
        setup.games = len(states) * times
        setup.saved.CopyFrom(pb.SavedStart(states=states, same_deals=seed is None))
        setup.records = False
        if setup.total_games:
            setup.total_games = setup.games
        put_seed(setup, seed)
        if self.server is not None and setup.ByteSize() > MAX_MESSAGE_BYTES:
            raise ValueError(f"{len(states)} games are too many to fork on a server at once: fork some of them at a time")
        env = type(self).__new__(type(self))
        env._start(setup, self._policies, self._place, self._memory is not None, self._reward_function)
        return env

    def _numbers(self, games: ArrayLike) -> NDArray[np.uint32]:
        """Checks and encodes numbers of games."""
        chosen = np.atleast_1d(np.asarray(games))
        if chosen.size and (chosen.ndim != 1 or chosen.dtype.kind not in "iu" or chosen.min() < 0 or chosen.max() >= self.games):
            raise ValueError(f"games are integers 0..={self.games - 1}")
        return chosen.astype("<u4")

    def close(self) -> None:
        """Ends the games. Does nothing if it is closed."""
        if self._ended is None:
            self._ended = ChefsHatError("ENV_CLOSED", "this VectorEnv has been closed; make a new one")
        self._games.close()

    def _check_open(self) -> None:
        if self._ended is None:
            return
        if self.closed:
            raise self._ended
        raise ChefsHatError("ENV_ENDED", f"this VectorEnv has ended ({self._ended}); make a new one") from self._ended

    def _completed(self, batch: Batch) -> Batch:
        """Computes the transitions of a batch, if they are enabled."""
        if self._memory is not None:
            try:
                batch.complete(self._memory, self._reward_function)
            except BaseException:
                # The games wait for the actions of a batch that the caller never got.
                self._fail(ChefsHatError("REWARDS_FAILED", "the reward function failed"))
                raise
        return batch

    def _fail(self, error: BaseException) -> None:
        """Ends the environment with an error, unless the games are as they were."""
        if isinstance(error, ChefsHatError) and error.reason in _UNCHANGED:
            return
        # After an interrupt the response may still come.
        known = error if isinstance(error, ChefsHatError) else ChefsHatError("INTERRUPTED", "a step was interrupted")
        self._ended = known
        self._games.close()


def _begin(
    setup: pb.VectorSetup,
    policies: Policies | None,
    address: str | ServerAddress | None,
    token: str | None,
    ca: Path | str | None,
    threads: int,
) -> Games:
    """Begins games in this process or on a server."""
    if policies is not None:
        inside = _begin(setup, None, address, token, ca, threads)
        try:
            return PolicyGames(inside, policies)
        except BaseException:
            inside.close()
            raise
    if address is None and importlib.util.find_spec("chefshat_native") is not None:
        from chefshat._native import NativeGames

        return NativeGames(setup, threads)
    if threads:
        raise ValueError("threads are those of games in this process: a server chooses its own")
    from chefshat._remote import RemoteGames

    if address is None or address == LOCAL:
        # A server of this process knows no tokens.
        address = ServerAddress(local_server.shared_address(), token="")
    if setup.networks and setup.ByteSize() > MAX_MESSAGE_BYTES:
        size = sum(len(file.content) for file in setup.networks)
        raise ValueError(
            f"the network files have {size >> 10} KiB, and a server takes less than {MAX_MESSAGE_BYTES >> 10}: save them as 16-bit "
            "floats (`network.save(..., dtype=numpy.float16)`), or leave the address out to play in this process"
        )
    return RemoteGames(server_address(address, token, ca), setup)
