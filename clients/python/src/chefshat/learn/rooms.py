"""Games in rooms of a server, for players that connect to one: agents as objects, and programs in any language.

`evaluation` says which games these are. `chefshat bench run` plays the tasks of the benchmark in the same way.
"""

import asyncio
import contextlib
import os
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from chefshat import local_server, pb
from chefshat.address import CA, TOKEN, ServerAddress, server_address
from chefshat.agents import Agent
from chefshat.aio import Client
from chefshat.errors import ChefsHatError, first_error
from chefshat.local_server import LocalServer
from chefshat.result import abort_reason_of
from chefshat.vector import LOCAL

# Time for a decision, and for all players to take their seats: generous, because other games may slow them down.
DECISION_TIME_MS = 300_000
WAITING_TIME_MS = 600_000
# Seconds a game may take to end after the process of its agent has ended well.
END_S = 5.0
# The same, if the exit code says that the process has failed.
FAILED_S = 0.5
# Seconds a process may take to exit after its last game.
EXIT_S = 10.0
# Seconds a server may take to create a room that is no longer wanted, and to close it.
CLOSE_S = 30.0
# Seconds before each further attempt to read the record of a game that has just ended.
RECORD_PAUSES_S = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
# Seconds between looks at a thread that begins.
PAUSE_S = 0.01
# Lines of a program's output that an error shows, and the bytes of it that are kept for them.
LAST_LINES = 8
LAST_BYTES = 4096
# Bytes read at a time.
CHUNK_BYTES = 64 << 10
# Seconds to wait for the end of the output, which another process may hold open.
OUTPUT_S = 0.5
MAX_NAME = 64
#: Reason of the error of a player: what it raised, or why its program could not play.
AGENT_FAILED = "AGENT_FAILED"
_POLICY = pb.RoomPolicy(
    decision_time_ms=DECISION_TIME_MS,
    bank_ms=0,
    max_timeouts=1,
    abort=pb.ABORT_POLICY_NEVER,
    waiting_time_ms=WAITING_TIME_MS,
)
_LATE = "did not decide in time"


@dataclass(frozen=True)
class Command:
    """A program that plays over the protocol, in any language: the commands that `chefshat bench run` takes.

    If the command mentions {code}, it is started for each game: {code} stands for the join code, {address} for host:port of the
    server, {url} for its URL and {name} for the name. Otherwise it is started once for its seat, and reads a line for each game
    from its standard input: address, join code and name, separated by spaces; in Python, `chefshat.benchmark.play` does that.

    Attributes:
        words: the program and its arguments. A text is split as a shell would, but no shell runs it.
        name: the name in results and in the rooms; default: that of the program.

    Raises:
        ValueError: the command is empty, mentions {tournament}, or has {code} without {address} or {url}.
    """

    words: str | Sequence[str]
    name: str = ""

    def __post_init__(self) -> None:
        words = tuple(shlex.split(self.words) if isinstance(self.words, str) else self.words)
        if not words:
            raise ValueError("the command is empty: name a program")
        if any("{tournament}" in word for word in words):
            raise ValueError("{tournament} has no value here: the games are those of rooms")
        object.__setattr__(self, "words", words)
        object.__setattr__(self, "name", (self.name or Path(words[0]).name)[:MAX_NAME])
        if not self.reads_games and not any("{address}" in word or "{url}" in word for word in words):
            raise ValueError("the command needs {address} (host:port) or {url} (http://host:port) in place of the server's address")

    @property
    def reads_games(self) -> bool:
        """Whether it reads from its standard input which games to play."""
        return not any("{code}" in word for word in self.words)

    def filled(self, address: str, code: str) -> list[str]:
        """Returns the words with their values."""
        url = address if "://" in address else f"http://{address}"
        values = {"{address}": address, "{url}": url, "{code}": code, "{name}": self.name}

        def fill(word: str) -> str:
            for place, value in values.items():
                word = word.replace(place, value)
            return word

        return [fill(word) for word in self.words]


MakeAgent: TypeAlias = Callable[[], Agent]
"""Makes the agent of a game."""


@dataclass(frozen=True)
class Seat:
    """Who plays a seat: the name of a built-in agent, what makes the agent of each game, or a program."""

    name: str
    player: str | MakeAgent | Command


def play(
    seats: Sequence[Seat],
    seeds: Sequence[bytes],
    rules: pb.RuleSet,
    address: str | ServerAddress | None,
    *,
    parallel: int,
    on_game: Callable[[], object],
) -> list[list[pb.ShiftEnded]]:
    """Plays a game for each seed.

    Args:
        seats: who plays each seat.
        seeds: the games' seeds.
        rules: the rule set.
        address: the server; "local": the one shared by this process; None: one of its own, which forgets the games.
        parallel: games at a time.
        on_game: called after each game.

    Returns:
        The ends of the Shifts of each game.

    Raises:
        ChefsHatError: the server refuses the games or does not answer; AGENT_FAILED: a player failed. The message names the game.
    """
    with contextlib.ExitStack() as stack:
        # Servers of this process know no tokens.
        if address is None:
            program = local_server.find_binary("play in rooms of a server", "; or give the address of a running server")
            address = ServerAddress(stack.enter_context(LocalServer(program)).address, token="")
        elif address == LOCAL:
            address = ServerAddress(local_server.shared_address(), token="")
        return _run(_Games(seats, rules, server_address(address)).play(seeds, parallel, on_game))


def _run(playing: Coroutine[Any, Any, list[list[pb.ShiftEnded]]]) -> list[list[pb.ShiftEnded]]:
    """Runs a coroutine; in a thread if this one has an event loop, as in a notebook."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return asyncio.run(playing)
    running: list[tuple[asyncio.AbstractEventLoop, asyncio.Task[Any] | None]] = []

    async def noted() -> list[list[pb.ShiftEnded]]:
        running.append((asyncio.get_running_loop(), asyncio.current_task()))
        return await playing

    with ThreadPoolExecutor(1) as thread:
        done = thread.submit(asyncio.run, noted())
        try:
            return done.result()
        except BaseException:
            # Ctrl-C arrives here, and the executor waits for the thread.
            while not running and not done.done():
                time.sleep(PAUSE_S)
            for loop, task in running if not done.done() else ():
                if task is not None:
                    loop.call_soon_threadsafe(task.cancel)
            raise


class _Games:
    """Games of the same players, each in a room of its own."""

    def __init__(self, seats: Sequence[Seat], rules: pb.RuleSet, server: ServerAddress) -> None:
        self.seats = seats
        self.rules = rules
        self.server = server
        # The processes that read games, by seat.
        self.readers: dict[int, _Process] = {}

    async def play(self, seeds: Sequence[bytes], parallel: int, on_game: Callable[[], object]) -> list[list[pb.ShiftEnded]]:
        """Plays a game for each seed. See the function `play`."""
        permits = asyncio.Semaphore(parallel)

        async def one(number: int, seed: bytes) -> list[pb.ShiftEnded]:
            async with permits:
                shifts = await _Game(self, client, number, seed).play()
            on_game()
            return shifts

        # The processes end before the connection does, and all of them if there is an error.
        async with contextlib.AsyncExitStack() as stack:
            client = await stack.enter_async_context(Client(self.server))
            for number, seat in enumerate(self.seats):
                if isinstance(seat.player, Command) and seat.player.reads_games:
                    self.readers[number] = await stack.enter_async_context(_Process(seat.player, self.server))
            played = await _together([one(number, seed) for number, seed in enumerate(seeds)])
            # They read no more games, and exit.
            await asyncio.gather(*(process.finish() for process in self.readers.values()))
        return played


class _Game:
    """A game in a room."""

    def __init__(self, games: _Games, client: Client, number: int, seed: bytes) -> None:
        self._games = games
        self._client = client
        self._number = number
        self._seed = seed
        # By seat of a client: whether it has been taken.
        self._taken = {number: asyncio.Event() for number, seat in enumerate(games.seats) if not isinstance(seat.player, str)}
        self._over = asyncio.Event()

    async def play(self) -> list[pb.ShiftEnded]:
        """Plays it to its end."""
        seats = [seat.player if isinstance(seat.player, str) else None for seat in self._games.seats]
        creating = asyncio.ensure_future(
            self._client.rooms.create(
                f"game {self._number}", rules=self._games.rules, seats=seats, policy=_POLICY, game_seed=self._seed
            )
        )
        try:
            # When this is cancelled, the server may have the room, and only its answer says how to close it.
            created = await asyncio.shield(creating)
            await _together([self._follow(created.room.room_id), self._fill(created.join_code)])
            return await self._shifts(created.room.game_id)
        except BaseException:
            closing = asyncio.ensure_future(self._close(creating))
            try:
                await asyncio.shield(closing)
            except asyncio.CancelledError:
                # Another game has failed, too.
                await closing
                raise
            raise

    async def _close(self, creating: asyncio.Future[pb.CreateRoomResponse]) -> None:
        """Closes the room, which would be one of the server's for as long as it waits for its players."""
        with contextlib.suppress(ChefsHatError, TimeoutError):
            async with asyncio.timeout(CLOSE_S):
                created = await creating
                await self._client.rooms.close(created.room.room_id, created.owner_token)

    async def _follow(self, room_id: str) -> None:
        """Follows the game to its end, if there are programs, which do not say whether they have their seats and have played."""
        if not any(isinstance(seat.player, Command) for seat in self._games.seats):
            return
        async for event in self._client.rooms.watch(room_id):
            kind = event.WhichOneof("kind")
            if kind == "seated":
                self._taken[event.seated.seat].set()
            elif kind == "substituted":
                raise self._failed(event.substituted.seat, _LATE)
            elif kind == "game_aborted":
                missing = [number for number, taken in self._taken.items() if not taken.is_set()]
                if missing and event.game_aborted.reason == pb.ABORT_REASON_NEVER_STARTED:
                    raise self._failed(missing[0], f"did not take its seat within {WAITING_TIME_MS // 60_000} minutes")
                raise self._aborted(abort_reason_of(event.game_aborted))
            elif kind == "game_ended":
                self._over.set()
        if not self._over.is_set():
            raise self._aborted("the server has removed the room")

    async def _shifts(self, game_id: str) -> list[pb.ShiftEnded]:
        """Returns the ends of the Shifts from the record. Nobody but the players may have decided for them."""
        lines = await self._record(game_id)
        for decision in (line.decision for line in lines if line.HasField("decision")):
            if decision.source == pb.DECISION_SOURCE_INVALID:
                raise self._failed(decision.seat, f"answered a decision with {len(decision.invalid_attempts)} illegal actions")
            if decision.source != pb.DECISION_SOURCE_AGENT:
                raise self._failed(decision.seat, _LATE)
        return [line.event.shift_ended for line in lines if line.event.HasField("shift_ended")]

    async def _record(self, game_id: str) -> list[pb.RecordLine]:
        """Reads the record. The server may need a moment to have it."""
        for pause in RECORD_PAUSES_S:
            try:
                return [line async for line in self._client.records.read(game_id)]
            except ChefsHatError as error:
                if error.reason != "GAME_RUNNING":
                    raise
            await asyncio.sleep(pause)
        return [line async for line in self._client.records.read(game_id)]

    async def _fill(self, code: str) -> None:
        """Lets the players take their seats, and play to the end."""
        players = {number: seat.player for number, seat in enumerate(self._games.seats)}
        programs = {number: player for number, player in players.items() if isinstance(player, Command)}
        processes: dict[int, _Process] = {}
        # Programs take the first free seat: first the agents have theirs, and then one program after the other.
        tickets = {number: await self._join(code, number) for number in self._taken if number not in programs}
        async with contextlib.AsyncExitStack() as stack:
            for number, command in programs.items():
                process = self._games.readers.get(number)
                if process is None:
                    process = await stack.enter_async_context(_Process(command, self._games.server, code))
                else:
                    process.give(code)
                await self._unless_ended(number, process, self._taken[number])
                processes[number] = process
            playing = [self._program(number, process) for number, process in processes.items()]
            await _together([*playing, *(self._agent(number, ticket) for number, ticket in tickets.items())])

    async def _join(self, code: str, number: int) -> str:
        """Takes the seat of an agent. Returns its ticket."""
        return (await self._client.rooms.join(code, self._games.seats[number].name[:MAX_NAME], seat=number)).ticket

    async def _agent(self, number: int, ticket: str) -> None:
        """Lets an agent play."""
        make = self._games.seats[number].player
        assert not isinstance(make, str | Command), "they have no tickets"
        try:
            result = await self._client.play(make(), ticket)
        except ChefsHatError:
            # The server's, or the connection's.
            raise
        except Exception as error:
            raise self._failed(number, f"raised {error!r}") from error
        if not result.finished:
            raise self._aborted(result.abort_reason)

    async def _program(self, number: int, process: "_Process") -> None:
        """Waits until a program has played."""
        await self._unless_ended(number, process, self._over)
        if number not in self._games.readers:
            await process.finish()

    async def _unless_ended(self, number: int, process: "_Process", event: asyncio.Event) -> None:
        """Waits for an event. Raises an error if the process ends, and the event does not follow soon."""
        waiting, ending = asyncio.ensure_future(event.wait()), asyncio.ensure_future(process.wait())
        try:
            await asyncio.wait([waiting, ending], return_when=asyncio.FIRST_COMPLETED)
            if ending.done() and not waiting.done():
                await asyncio.wait([waiting], timeout=END_S if ending.result() == 0 else FAILED_S)
                if not waiting.done():
                    raise self._failed(number, f"exited before the end: exit code {ending.result()}{process.last_lines()}")
        finally:
            waiting.cancel()
            ending.cancel()

    def _aborted(self, why: str) -> ChefsHatError:
        return ChefsHatError("GAME_ABORTED", f"{self._named()} was aborted: {why}")

    def _failed(self, number: int, words: str) -> ChefsHatError:
        return ChefsHatError(AGENT_FAILED, f"{self._games.seats[number].name}, on seat {number} in {self._named()}, {words}")

    def _named(self) -> str:
        return f"game {self._number} (seed {self._seed.hex()})"


class _Process:
    """The process of a program, in a process group of its own, so that all of it ends with its games; a context manager."""

    def __init__(self, command: Command, server: ServerAddress, code: str = "") -> None:
        self._command = command
        self._server = server
        self._code = code
        # With TLS a program must see the scheme.
        self._address = server.address.removeprefix("http://").rstrip("/")
        self._process: asyncio.subprocess.Process
        self._output = b""

    async def __aenter__(self) -> "_Process":
        words = self._command.filled(self._address, self._code)
        environment = {name: value for name, value in os.environ.items() if name != TOKEN or self._server.token is None}
        given = {TOKEN: self._server.token, CA: self._server.ca}
        environment |= {name: str(value) for name, value in given.items() if value}
        # Not one of asyncio's pipes: it would wait for all processes that have the pipe, not for this one alone.
        reading, writing = os.pipe()
        self._reader = threading.Thread(target=self._read, args=[reading], daemon=True)
        self._reader.start()
        try:
            self._process = await asyncio.create_subprocess_exec(
                *words,
                stdin=asyncio.subprocess.PIPE if self._command.reads_games else asyncio.subprocess.DEVNULL,
                stdout=writing,
                stderr=writing,
                env=environment,
                process_group=0,
            )
        except OSError as error:
            raise ChefsHatError(AGENT_FAILED, f"{words[0]} cannot be started: {error}") from error
        finally:
            os.close(writing)
        return self

    def _read(self, reading: int) -> None:
        """Reads the output to its end, and keeps the last bytes."""
        with open(reading, "rb", buffering=0) as output:
            while some := output.read(CHUNK_BYTES):
                self._output = (self._output + some)[-LAST_BYTES:]

    async def __aexit__(self, *_: object) -> None:
        """Kills what is left of it."""
        with contextlib.suppress(ProcessLookupError):
            if sys.platform == "win32":
                self._process.kill()
            else:
                os.killpg(self._process.pid, signal.SIGKILL)
        await self._process.wait()

    def give(self, code: str) -> None:
        """Lets it read of a game."""
        assert self._process.stdin is not None, "it reads games"
        self._process.stdin.write(f"{self._address} {code} {self._command.name}\n".encode())

    async def wait(self) -> int:
        """Waits until it has ended and returns its exit code."""
        return await self._process.wait()

    async def finish(self) -> None:
        """Waits until it has ended, after its last game, but not for long."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self._process.wait(), EXIT_S)

    def last_lines(self) -> str:
        """Returns the last lines of the output of a process that has ended, for an error message."""
        self._reader.join(OUTPUT_S)
        lines = self._output.decode(errors="replace").splitlines()[-LAST_LINES:]
        # A terminal must not receive control characters.
        plain = ["".join(character for character in line if character.isprintable()) for line in lines]
        return "".join(["; its last lines:", *(f"\n  | {line}" for line in plain)] if plain else [])


async def _together(coroutines: Sequence[Coroutine[Any, Any, Any]]) -> list[Any]:
    """Runs coroutines and returns their results. Ends all with the first error, which it raises."""
    with first_error():
        async with asyncio.TaskGroup() as group:
            tasks = [group.create_task(coroutine) for coroutine in coroutines]
    return [task.result() for task in tasks]
