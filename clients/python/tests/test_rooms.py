"""Players that connect to a server, in evaluations and comparisons."""

import asyncio
import functools
import io
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from tqdm import tqdm
from waiting import LIMIT_S

import chefshat
from chefshat import Agent, Batch, ChefsHatError, Decision, SeatInfo, SeatResult, VectorEnv, pb
from chefshat._async.rooms import AsyncRooms
from chefshat.address import ServerAddress
from chefshat.aio import Client as AsyncClient
from chefshat.learn import network, rooms
from chefshat.learn.evaluation import Evaluation, OneOpponent, Player, PolicyAgent, compare, evaluate, game_seeds
from chefshat.learn.rooms import Command

pytestmark = pytest.mark.server

DEALS = 2
# Two Shifts: with roles, an exchange and special actions.
RULES = {"preset": "paper", "target_shifts": 2}


def preferences() -> NDArray[np.int_]:
    """How much the built-in agent `greedy` likes each action, except that it declares as a Waiter or Dishwasher."""
    liked = []
    with VectorEnv(seed=0) as env:
        texts = env.action_texts
    for text in texts:
        if play := re.fullmatch(r"C(\d+);Q(\d+);J(\d+)", text):
            face, quantity, jokers = map(int, play.groups())
            liked.append(3_0000 - 1000 * (jokers if face else 9) + 20 * face + quantity)
        elif gift := re.fullmatch(r"give C(\d+)", text):
            liked.append(3_0000 + int(gift[1]))
        else:
            liked.append({"give J": 2_0000, "decline": 2_0000, "pass": 1, "declare": 1}[text])
    return np.array(liked)


@functools.cache
def liked() -> NDArray[np.int_]:
    return preferences()


def greedy(batch: Batch) -> NDArray[np.intp]:
    """The built-in agent `greedy`, as a policy."""
    scores = np.where(batch.masks, liked(), 0)
    roles = batch.observations.roles[np.arange(len(batch)), batch.seats]
    scores[np.isin(roles, [pb.ROLE_WAITER, pb.ROLE_DISHWASHER]), -1] *= 5_0000
    return np.asarray(scores.argmax(axis=1), np.intp)


class Greedy(Agent):
    """The same as an agent."""

    def decide(self, request: Decision) -> int:
        return PolicyAgent(greedy).decide(request)


def made(times: int = 1) -> Agent:
    """Makes the same."""
    return [Greedy() for _ in range(times)][-1]


class Coroutine(Agent):
    """The same, in a coroutine."""

    async def decide(self, request: Decision) -> int:
        await asyncio.sleep(0)
        return Greedy().decide(request)


class Lowest(Agent):
    """Takes the first legal action."""

    def decide(self, request: Decision) -> int:
        return int(request.legal_actions[0])


def lowest(batch: Batch) -> NDArray[np.intp]:
    """The same as a policy."""
    return np.asarray(batch.masks.argmax(axis=1), np.intp)


READS_GAMES = """
import chefshat
from chefshat import benchmark

class Lowest(chefshat.Agent):
    def decide(self, request):
        return int(request.legal_actions[0])

benchmark.play(Lowest)
"""


@pytest.fixture
def built_in(real_binary: Path) -> Callable[[str], Command]:
    """Makes the command of a built-in agent that plays from outside."""
    return lambda kind: Command(f"{shlex.quote(str(real_binary))} agent {kind} --server {{url}} --code {{code}}", kind)


def points(
    player: Player, opponents: OneOpponent | list[OneOpponent], address: str, seat: int = 0, games: int = DEALS
) -> tuple[float, ...]:
    """Returns the points, Shifts and places of a player."""
    found = evaluate(player, opponents, games=games, seat=seat, seed=5, rules=RULES, address=address)
    return found.points, found.standard_error, found.shifts, *found.places


def test_every_form_of_a_player_has_the_same_points(real_address: str, built_in: Callable[[str], Command]) -> None:
    pytest.importorskip("chefshat_native")
    forms: list[Player] = [
        greedy,
        Greedy,
        Greedy(),
        lambda: Greedy(),
        functools.partial(Greedy),
        functools.partial(made, times=2),
        Coroutine,
        built_in("greedy"),
    ]
    for form in forms:
        # No error: the points are the same on every deal, not only their mean.
        found = compare(form, "greedy", "trained", deals=DEALS, seats=[1, 2], seed=5, rules=RULES, address=real_address)
        assert (found.difference, found.standard_error) == (0, 0), form
        assert found.opponents == ("trained",) * 3
        assert found.points[0] > 0
    assert points(built_in("trained"), "greedy", real_address, seat=3) == points(
        network.load("trained"), "greedy", real_address, seat=3
    )


def test_everybody_may_sit_at_the_table(real_address: str, built_in: Callable[[str], Command], tmp_path: Path) -> None:
    native = pytest.importorskip("chefshat_native")
    trained = network.load("trained")
    file = tmp_path / "trained.safetensors"
    file.write_bytes(native.trained_network())
    in_batches = points(lowest, ["trained", lowest, "greedy"], real_address, seat=1)
    tables: list[tuple[Player, list[OneOpponent]]] = [
        (Lowest, [trained, Lowest(), greedy]),
        (lowest, [file, lowest, Greedy]),
        (Lowest(), [file.read_bytes(), Lowest(), built_in("greedy")]),
        (lowest, [built_in("trained"), Command([sys.executable, "-c", READS_GAMES]), built_in("greedy")]),
    ]
    for player, opponents in tables:
        assert points(player, opponents, real_address, seat=1) == in_batches
    assert points("greedy", [Lowest], real_address) == points(greedy, [lowest], real_address)
    opponents = [Lowest(), functools.partial(Lowest), built_in("trained")]
    assert evaluate("greedy", opponents, games=1, rules=RULES, address=real_address).opponents == ("Lowest", "Lowest", "trained")


def test_one_process_reads_all_games_of_a_seat(real_address: str) -> None:
    program = Command([sys.executable, "-c", READS_GAMES], "reader")
    in_batches = evaluate(lowest, "greedy", games=5, seat=2, seed=5, rules=RULES, address=real_address)
    assert evaluate(program, "greedy", games=5, seat=2, seed=5, rules=RULES, address=real_address, parallel=3) == in_batches


def test_a_policy_is_asked_as_often_as_in_batches(real_address: str) -> None:
    """One that draws numbers draws the same ones: neither asks for decisions with one legal action."""

    def drawn(opponent: OneOpponent) -> tuple[float, ...]:
        rng = np.random.default_rng(3)
        return points(lambda batch: chefshat.sample_legal(batch.mask_bits, rng), opponent, real_address, games=1)

    assert drawn(Lowest) == drawn(lowest)


class Meets(Agent):
    """Decides only after there have been `wanted` games at a time."""

    wanted = running = most = 0

    def on_attached(self, seat: SeatInfo) -> None:
        Meets.running += 1
        Meets.most = max(Meets.most, Meets.running)

    def on_game_over(self, result: SeatResult) -> None:
        Meets.running -= 1

    async def decide(self, request: Decision) -> int:
        async with asyncio.timeout(LIMIT_S):
            while Meets.most < Meets.wanted:
                await asyncio.sleep(0.01)
        return Lowest().decide(request)


@pytest.mark.parametrize("parallel", [1, 2])
def test_as_many_games_are_open_as_wanted(parallel: int, real_address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Meets, "wanted", parallel)
    monkeypatch.setattr(Meets, "most", 0)
    evaluate(Meets, "greedy", games=4, seed=5, rules=RULES, address=real_address, parallel=parallel)
    assert (Meets.most, Meets.running) == (parallel, 0)


def test_a_terminal_shows_the_progress(real_address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    # However quick the games are.
    monkeypatch.setattr("chefshat.learn.evaluation.tqdm", functools.partial(tqdm, mininterval=0))

    def shown(player: Player) -> str:
        monkeypatch.setattr(sys, "stderr", terminal := Terminal())
        compare(player, lowest, "greedy", deals=2, seats=[0, 3], seed=5, rules=RULES, address=real_address)
        return terminal.getvalue()

    assert "4/4 " in shown(Lowest)
    assert shown(lowest) == ""


def test_rooms_have_the_deals_of_batches(real_address: str) -> None:
    games = 300  # More than play side by side in a batch.
    seeds = game_seeds(7, games, real_address)
    assert len(set(seeds)) == len(seeds) == games
    with VectorEnv(real_address, games, seed=7) as env:
        assert [row.tobytes() for row in env.batch.beginnings.seeds] == seeds
    assert game_seeds(seeds[:2], 4, real_address) == seeds[:2] * 2


@pytest.mark.parametrize("address", [None, "local"])
def test_no_server_is_needed(real_binary: Path, address: str | None) -> None:
    assert evaluate(Lowest, "greedy", games=2, seed=5, address=address) == evaluate(lowest, "greedy", games=2, seed=5)


def test_other_rules_have_other_seats(real_address: str) -> None:
    rules = {"preset": "paper", "players": 3, "faces": 8, "target_shifts": 1}
    found = compare(Lowest, lowest, "greedy", deals=2, seed=5, rules=rules, address=real_address)
    assert (found.difference, found.opponents) == (0, ("greedy", "greedy"))
    with pytest.raises(ValueError, match=r"no seat 3"):
        evaluate(Lowest, "greedy", games=1, seat=3, rules=rules, address=real_address)
    with pytest.raises(ValueError, match="one for each of the 2 other seats"):
        evaluate(Lowest, ["greedy"] * 3, games=1, rules=rules, address=real_address)
    with pytest.raises(ValueError, match="4 players"):
        evaluate(Lowest, network.load("trained"), games=1, rules=rules, address=real_address)


def test_an_agent_plays_one_seat_of_one_game(real_address: str) -> None:
    agent = Lowest()
    with pytest.raises(ValueError, match="give its class"):
        evaluate(agent, agent, games=1, address=real_address)
    with pytest.raises(ValueError, match="one game at a time"):
        evaluate(agent, "greedy", games=2, parallel=2, address=real_address)
    with pytest.raises(ValueError, match="at least one game"):
        evaluate(Lowest, "greedy", games=2, parallel=0, address=real_address)


class Breaks(Agent):
    """Raises an error in its third game."""

    games = 0

    def __init__(self) -> None:
        Breaks.games += 1

    def decide(self, request: Decision) -> int:
        if Breaks.games == 3:
            raise RuntimeError("torn")
        return int(request.legal_actions[0])


class Illegal(Agent):
    """Gives no card in the exchange that it may give."""

    def decide(self, request: Decision) -> int:
        if request.kind == pb.DECISION_KIND_EXCHANGE:
            return int(np.flatnonzero(~request.mask)[0])
        return Greedy().decide(request)


def test_a_room_is_closed_although_another_game_fails_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario() -> list[str]:
        closing, may_close = asyncio.Event(), asyncio.Event()
        closed: list[str] = []

        async def create(*_: object, **__: object) -> pb.CreateRoomResponse:
            return pb.CreateRoomResponse(room=pb.Room(room_id="room"), join_code="code")

        async def join(*_: object, **__: object) -> pb.JoinRoomResponse:
            raise ChefsHatError("ROOM_FULL", "no seat is free")

        async def close(_: object, room_id: str, owner_token: str) -> None:
            closing.set()
            await may_close.wait()
            closed.append(room_id)

        for name, call in [("create", create), ("join", join), ("close", close)]:
            monkeypatch.setattr(AsyncRooms, name, call)
        games = rooms._Games([rooms.Seat("Ada", Agent)], pb.RuleSet(), ServerAddress("127.0.0.1:1"))
        async with AsyncClient(games.server) as client:
            game = asyncio.ensure_future(rooms._Game(games, client, 0, bytes(32)).play())
            await closing.wait()
            game.cancel()
            await asyncio.sleep(0)
            may_close.set()
            with pytest.raises(asyncio.CancelledError):
                await game
        return closed

    assert asyncio.run(scenario()) == ["room"]


def open_rooms(address: str) -> set[str]:
    """The ids of the rooms whose games are not over. Other tests use the same server."""
    with chefshat.Client(address) as client:
        return {room.room_id for room in client.rooms.list() if room.state in (pb.ROOM_STATE_WAITING, pb.ROOM_STATE_PLAYING)}


def test_what_an_agent_raises_is_named_with_its_game(real_address: str) -> None:
    before = open_rooms(real_address)
    (*_, seed) = game_seeds(5, 3, real_address)
    with pytest.raises(ChefsHatError) as failed:
        evaluate(Breaks, "greedy", games=5, seat=1, seed=5, address=real_address)
    assert failed.value.reason == rooms.AGENT_FAILED
    assert failed.value.message == f"Breaks, on seat 1 in game 2 (seed {seed.hex()}), raised RuntimeError('torn')"
    assert isinstance(failed.value.__cause__, RuntimeError)
    assert open_rooms(real_address) <= before
    with pytest.raises(ChefsHatError, match=r"Illegal, on seat 2 in game \d .*, answered a decision with 10 illegal actions"):
        evaluate("random", ["random", Illegal, "random"], games=1, seed=5, address=real_address)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("no-such-program {code} {address}", "no-such-program cannot be started"),
        (
            "sh -c 'echo {name} $0; exit 7' {code}{url}",
            r"seat 0 in game 0 .*exit code 7; its last lines:\n  \| loser \w+http://127",
        ),
        ("sh -c 'read address code name; echo $name; exit 3'", r"seat 0 in game 0 .*exit code 3; its last lines:\n  \| loser"),
    ],
)
def test_a_program_that_ends_is_named_with_its_game(words: str, message: str, real_address: str) -> None:
    with pytest.raises(ChefsHatError, match=message) as failed:
        evaluate(Command(words, "loser"), "greedy", games=2, seed=5, address=real_address)
    assert failed.value.reason == rooms.AGENT_FAILED


def test_what_a_program_has_started_ends_with_its_game(real_address: str, tmp_path: Path) -> None:
    started = tmp_path / "pid"
    program = Command(["sh", "-c", f"sleep 600 & echo $! > {shlex.quote(str(started))}; exit 3 # {{code}}{{url}}"])
    with pytest.raises(ChefsHatError, match="exit code 3"):
        evaluate(program, "greedy", games=1, address=real_address)
    deadline = time.monotonic() + LIMIT_S
    while is_running(int(started.read_text())):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def is_running(pid: int) -> bool:
    """Whether a process runs; it may have ended without its parent having noticed."""
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and ") Z " not in stat.read_text()


def test_commands_are_checked_before_they_run() -> None:
    for words, message in [("", "name a program"), ("run {code}", "needs {address}"), ("run {tournament}", "no value here")]:
        with pytest.raises(ValueError, match=message):
            Command(words)
    assert Command("/usr/bin/python agent.py").name == "python"
    assert Command(["run", "{url} {address} {code}/{name}"], "Ada").filled("127.0.0.1:7", "BCDF") == [
        "run",
        "http://127.0.0.1:7 127.0.0.1:7 BCDF/Ada",
    ]


def test_in_a_notebook_there_is_an_event_loop(real_address: str) -> None:
    async def cell() -> Evaluation:
        return evaluate(Lowest, "greedy", games=1, seed=5, address=real_address)

    assert asyncio.run(cell()) == evaluate(lowest, "greedy", games=1, seed=5, address=real_address)


INTERRUPTED = """
import asyncio, sys
from chefshat.learn.evaluation import Command, evaluate

def play():
    evaluate(Command(["sh", "-c", "echo $$ > pid; exec sleep 600 # {code}{url}"]), "greedy", games=1, address=sys.argv[1])

async def cell():
    play()

if sys.argv[2] == "notebook":
    # As in a notebook, nothing handles the interrupt.
    asyncio.new_event_loop().run_until_complete(cell())
else:
    play()
"""


@pytest.mark.parametrize("where", ["script", "notebook"])
def test_an_interrupt_ends_everything(
    where: str, real_address: str, tmp_path: Path, processes: list[subprocess.Popen[str]]
) -> None:
    before = open_rooms(real_address)
    command = [sys.executable, "-c", INTERRUPTED, real_address, where]
    playing = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    processes.append(playing)
    pid = tmp_path / "pid"
    deadline = time.monotonic() + LIMIT_S
    while not (pid.exists() and pid.read_text().strip()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    playing.send_signal(signal.SIGINT)
    _, printed = playing.communicate(timeout=LIMIT_S)
    assert playing.returncode == -signal.SIGINT
    assert "KeyboardInterrupt" in printed
    assert not is_running(int(pid.read_text()))
    assert open_rooms(real_address) <= before


@pytest.mark.parametrize("child", ["", "import subprocess; subprocess.Popen(['sleep', '60']);"])
async def test_the_output_of_a_program_is_not_kept_but_for_its_end(child: str) -> None:
    written = f"import sys; {child} [print('x' * 1023) for _ in range(4096)]; print('\x1bthe end', file=sys.stderr); sys.exit(3)"

    command = Command(shlex.join([sys.executable, "-c", written]) + " {address} {code}")
    async with rooms._Process(command, ServerAddress("localhost:1", token="")) as process:
        assert await process.wait() == 3
        assert process.last_lines().endswith("x\n  | the end")
    assert len(process._output) == rooms.LAST_BYTES


def test_a_room_that_is_created_while_the_games_end_is_closed(real_address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    create = AsyncRooms.create

    async def interrupted() -> None:
        created, answered = asyncio.Event(), asyncio.Event()

        async def create_slowly(*args: Any, **named: Any) -> pb.CreateRoomResponse:
            response = await create(*args, **named)
            created.set()
            await answered.wait()
            return response

        monkeypatch.setattr(AsyncRooms, "create", create_slowly)
        seats = [rooms.Seat("", player) for player in (Lowest, "greedy", "greedy", "greedy")]
        games = rooms._Games(seats, pb.RuleSet(), ServerAddress(real_address, token=""))
        playing = asyncio.create_task(games.play([bytes(32)], 1, lambda: None))
        await created.wait()
        playing.cancel()
        # The cancellation goes through all tasks before the answer arrives.
        for _ in range(20):
            await asyncio.sleep(0)
        answered.set()
        await playing

    before = open_rooms(real_address)
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(interrupted())
    assert open_rooms(real_address) <= before
