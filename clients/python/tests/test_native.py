"""`VectorEnv` in this process: it equals a server's, and works or refuses with a reason where processes and threads are shared."""

import copy
import os
import pickle
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest
from waiting import LIMIT_S

import chefshat
from chefshat import ChefsHatError, VectorEnv, pb
from chefshat.columns import Table
from chefshat.vector import Batch

chefshat_native = pytest.importorskip("chefshat_native")

SOURCE = Path(chefshat.__file__).parents[1]
# Pause in seconds in which the other of two threads may call.
BETWEEN_CALLS_S = 0.001

AGENTS = ["random", "greedy", "random_unmasked", "trained"]


def random_options(rng: np.random.Generator) -> dict[str, Any]:
    """Draws options that a setup accepts."""
    players = int(rng.integers(2, 7))
    seats = sorted(rng.permutation(players)[: rng.integers(1, players + 1)].tolist())
    decisions = str(rng.choice(["all", "turns"]))
    options: dict[str, Any] = {
        "games": int(rng.integers(1, 6)),
        "client_seats": seats,
        "opponents": str(rng.choice(AGENTS)) if rng.random() < 0.5 else rng.choice(AGENTS, players - len(seats)).tolist(),
        "rewards": str(rng.choice(["validity", "paper", "paper_intended", "winning", "points"])),
        "episode": str(rng.choice(["shift", "game"])),
        "decisions": decisions,
        "skip_forced": bool(rng.integers(2)),
        "invalid": "ask_again",
        "max_invalid_attempts": int(rng.integers(1, 30)),
        "seed": int(rng.integers(2**63)),
        "rules": {"players": players, "faces": int(rng.integers(7, 12)), "target_shifts": int(rng.integers(1, 4))},
        "shift_statistics": bool(rng.integers(2)),
        "records": True,
        "transitions": True,
    }
    if decisions == "turns" and rng.random() < 0.5:
        options["other_decisions"] = "greedy"
    if rng.random() < 0.3:
        options["total_games"] = options["games"] + int(rng.integers(5))
    return options


def columns(table: Table | None) -> dict[str, bytes]:
    """Returns the columns of a table as bytes, with their types and shapes in the names."""
    if table is None:
        return {}
    return {f"{name} {array.dtype} {array.shape}": array.tobytes() for name, array in table.as_dict().items()}


def content(batch: Batch) -> dict[str, Any]:
    """Returns everything in a batch, comparable."""
    transitions = batch.transitions
    return {
        "step": batch.step,
        "done": batch.done,
        "rows": columns(batch),
        "observations": columns(batch.observations),
        "endings": columns(batch.endings),
        "final": columns(batch.endings.observations),
        "beginnings": columns(batch.beginnings),
        "shifts": columns(batch.shifts),
        "totals": batch.totals,
        "records": batch.records,
        "transitions": columns(transitions),
        "before": columns(transitions.before) | columns(transitions.before.observations),
        "after": columns(transitions.after) | columns(transitions.after.observations),
    }


@pytest.mark.server
@pytest.mark.parametrize("number", range(12))
def test_both_ways_to_the_games_are_equal(real_address: str, number: int) -> None:
    rng = np.random.default_rng(number)
    options = random_options(rng)
    with VectorEnv(**options) as here, VectorEnv(real_address, **options) as there:
        assert here.server is None
        assert str(there.server) == real_address
        for name in ("rules", "sizes", "client_seats", "built_in_agents", "base_seed"):
            assert getattr(here, name) == getattr(there, name)
        assert here.action_texts == there.action_texts
        ended = 0
        for step in range(150):
            assert content(here.batch) == content(there.batch), (options, step)
            ended += len(here.batch.records)
            if here.batch.done or rng.random() < 0.02:
                seed = int(rng.integers(2**63)) if rng.random() < 0.5 or here.batch.done else None
                games = None if seed is not None else rng.integers(0, here.games, 2)
                here.reset(seed, games=games)
                there.reset(seed, games=games)
                continue
            actions = here.sample(step)
            assert (actions == there.sample(step)).all()
            wild = rng.random(len(actions)) < 0.1
            actions[wild] = rng.integers(0, here.num_actions, wild.sum())
            here.step(actions)
            there.step(actions)
        assert ended > 0 or options["rules"]["target_shifts"] > 1


@pytest.mark.server
@pytest.mark.parametrize(
    "options",
    [
        {"games": 0},
        {"client_seats": [1, 0]},
        {"client_seats": [0], "opponents": "nobody"},
        {"client_seats": [0], "opponents": ["greedy", "greedy"]},
        {"max_invalid_attempts": 3},
        {"total_games": 1, "games": 2},
        {"records": True, "invalid": "ask_again"},
        {"rules": {"faces": 40}},
        {"rules": "nothing"},
        {"hands": pb.ScriptedShift(hands=[pb.SeatCards(seat=9)])},
    ],
    ids=lambda options: "-".join(options),
)
def test_refusals_have_the_same_words(real_address: str, options: dict[str, Any]) -> None:
    refusals = []
    for address in (None, real_address):
        with pytest.raises(ChefsHatError) as refused:
            VectorEnv(address, **options)
        refusals.append((refused.value.reason, refused.value.message, refused.value.metadata))
    assert refusals[0] == refusals[1]


@pytest.mark.server
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"games": 16385, "client_seats": [0]}, "play at most 16384 games times seats"),
        ({"games": 1025, "history": 512, "client_seats": [0]}, "choose at most 524288 actions"),
        ({"records": True, "games": 257}, "at most 256 parallel games can be recorded"),
        ({"records": True, "rules": {"target_points": 1001}}, "ends after at most 1000 points or Shifts"),
        ({"seed": [bytes(32)] * 16385}, "16385 seeds; give 1 to 16384"),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, dict) else "",
)
def test_what_a_server_limits_is_free_in_this_process(real_address: str, options: dict[str, Any], words: str) -> None:
    with pytest.raises(ChefsHatError, match=words):
        VectorEnv(real_address, **options)
    VectorEnv(**options).close()


def test_draws_are_legal_uniform_and_repeatable() -> None:
    with VectorEnv(games=1000, seed=[b"x" * 32]) as env:
        # All games are the same one.
        while env.batch.masks[0].sum() < 5:
            env.step(env.batch.masks.argmax(axis=1))
        drawn = np.concatenate([env.sample(1), *(env.sample() for _ in range(99))])
        again = np.concatenate([env.sample(1), *(env.sample() for _ in range(99))])
        assert (drawn == again).all()
        assert (env.sample(2) != drawn[:1000]).any()
        legal = np.flatnonzero(env.batch.masks[0])
        counts = np.bincount(drawn, minlength=env.num_actions)
        assert counts.sum() == counts[legal].sum() == 100_000
        expected = 100_000 / len(legal)
        # Chi-square of the fixed draws: far below a limit of mean plus six standard deviations.
        assert ((counts[legal] - expected) ** 2 / expected).sum() < len(legal) + 6 * np.sqrt(2 * len(legal))
        with pytest.raises(ValueError, match="seed is 0"):
            env.sample(2**64)


def test_columns_are_read_only() -> None:
    with VectorEnv(games=2) as env:
        for array in (env.batch.games, env.batch.observations.hands, env.batch.beginnings.seeds):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 0


def test_batches_outlive_their_games() -> None:
    with VectorEnv(games=3, seed=4) as env:
        first = env.batch
        env.step(env.sample(1))
    with VectorEnv(games=3, seed=4) as env:
        assert columns(first.observations) == columns(env.batch.observations)
        assert columns(first.beginnings) == columns(env.batch.beginnings)


def test_a_recorded_game_needs_its_server() -> None:
    with pytest.raises(ChefsHatError, match=r"BRANCH_REFUSED.*address"):
        VectorEnv(branch=pb.BranchPoint(game_id="0" * 32, decisions=1))


def test_an_env_cannot_be_copied() -> None:
    with VectorEnv() as env:
        for copied in (pickle.dumps, copy.copy, copy.deepcopy):
            with pytest.raises(TypeError, match=r"fork\(\)"):
                copied(env)
        env.step(env.sample())


def test_the_way_to_the_games_is_visible() -> None:
    with VectorEnv() as env:
        assert env.server is None
        assert "in process, open" in repr(env)
    assert "in process, ENV_CLOSED" in repr(env)


def test_threads_play_side_by_side() -> None:
    found: dict[int, list[int]] = {}

    def play(number: int) -> None:
        with VectorEnv(games=64, seed=9) as env:
            env.sample(9)
            found[number] = [int(env.step(env.sample()).observations.hands.sum()) for _ in range(200)]

    threads = [threading.Thread(target=play, args=(number,)) for number in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(LIMIT_S)
    assert len(found) == 4
    assert all(found[number] == found[0] for number in found)


class InUse:
    """Stands for games that another thread is stepping."""

    def refuse(self, *_: Any) -> NoReturn:
        """Refuses a request as the engine does."""
        raise chefshat_native.Refused("GAMES_IN_USE", "another thread is stepping these games", {})

    step = reset = save = restore = sample = refuse


@pytest.mark.parametrize("method", ["step", "reset", "save", "restore", "sample"])
def test_a_call_while_the_games_are_in_use_changes_nothing(method: str) -> None:
    options: dict[str, Any] = {"games": 2, "client_seats": [0], "seed": 3, "transitions": True}
    with VectorEnv(**options) as env, VectorEnv(**options) as undisturbed:
        for one in (env, undisturbed):
            one.sample(8)
            one.step(one.sample())
        calls: dict[str, Callable[[], object]] = {
            "step": lambda: env.step(env.batch.masks.argmax(axis=1)),
            "reset": lambda: env.reset(9),
            "save": env.save,
            "restore": lambda: env.restore([0], [b"anything"]),
            "sample": lambda: env.sample(7),
        }
        games = vars(env)["_games"]
        native, games._games = games._games, InUse()
        with pytest.raises(ChefsHatError, match="another thread") as refused:
            calls[method]()
        assert refused.value.reason == "GAMES_IN_USE"
        games._games = native
        assert env.base_seed == 3
        for _ in range(20):
            assert content(env.step(env.sample())) == content(undisturbed.step(undisturbed.sample()))


def test_two_threads_on_one_env_do_not_end_it() -> None:
    # Enough games for steps and states to be long.
    options: dict[str, Any] = {"games": 2048, "client_seats": [0], "opponents": "greedy", "seed": 9}
    refusals: list[str] = []
    done = threading.Event()

    def again(call: Callable[[], object]) -> None:
        """Calls until the other thread lets it."""
        while True:
            try:
                call()
                return
            except ChefsHatError as error:
                refusals.append(error.reason)
                if error.reason != "GAMES_IN_USE":
                    raise
                time.sleep(BETWEEN_CALLS_S)

    def look() -> None:
        while not done.wait(BETWEEN_CALLS_S):
            again(env.save)

    steps = 0
    with VectorEnv(**options) as env:
        looking = threading.Thread(target=look)
        looking.start()
        until = time.monotonic() + LIMIT_S
        while (steps < 20 or not refusals) and time.monotonic() < until:
            actions = env.batch.masks.argmax(axis=1)
            again(lambda: env.step(actions))  # noqa: B023 - Called at once.
            steps += 1
        done.set()
        looking.join(LIMIT_S)
        assert set(refusals) == {"GAMES_IN_USE"}
        with VectorEnv(**options) as alone:
            for _ in range(steps):
                alone.step(alone.batch.masks.argmax(axis=1))
            assert env.save() == alone.save()


FORKED = """
import os, numpy as np
from chefshat import VectorEnv

def play(env, steps):
    for _ in range(steps):
        env.step(env.sample())
    return env.batch.observations.hands.tobytes()

parent = VectorEnv(games=4096, seed=1, client_seats=[0], opponents="greedy")
parent.sample(1)
play(parent, 3)
child = os.fork()
continued = play(parent, 3)
with VectorEnv(games=4096, seed=2, client_seats=[0], opponents="greedy") as env:
    env.sample(2)
    other = play(env, 3)
if child == 0:
    os.write(1, b"child " + str(hash(continued) ^ hash(other)).encode() + b"\\n")
    os._exit(0)
assert os.waitpid(child, 0)[1] == 0
os.write(1, b"parent " + str(hash(continued) ^ hash(other)).encode() + b"\\n")
"""


def test_a_forked_process_plays_on() -> None:
    paths = os.pathsep.join([str(SOURCE), *sys.path])
    environment = {**os.environ, "PYTHONHASHSEED": "0", "PYTHONPATH": paths}
    done = subprocess.run(
        [sys.executable, "-c", FORKED], env=environment, capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert done.returncode == 0, done.stderr
    lines = dict(line.split() for line in done.stdout.splitlines())
    assert lines["child"] == lines["parent"]


def test_games_in_process_need_neither_grpc_nor_a_server() -> None:
    program = (
        "import sys; sys.modules['grpc'] = None; sys.path[:0] = sys.argv[1:]\n"
        "import chefshat\nwith chefshat.make('vector', games=2) as env:\n    env.step(env.sample())\n"
        "print(env, 'chefshat.channels' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program, str(SOURCE), *sys.path], capture_output=True, text=True, timeout=LIMIT_S, check=False
    )
    assert "in process" in done.stdout, done.stderr
    assert done.stdout.endswith("False\n")


@pytest.mark.server
def test_without_the_module_a_local_server_plays(monkeypatch: pytest.MonkeyPatch, real_binary: Path) -> None:
    monkeypatch.setattr("chefshat.vector.importlib.util.find_spec", lambda _: None)
    with VectorEnv(games=2) as env:
        assert str(env.server).startswith("127.0.0.1:")
        assert f"on {env.server}" in repr(env)
        env.step(env.sample())


def contents(table: Table) -> dict[str, Any]:
    """All columns of a table, as lists."""
    return {name: array.tolist() for name, array in table.as_dict().items()}


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda table: pickle.loads(pickle.dumps(table))])
def test_batches_are_copied_with_all_their_tables(again: Callable[[Batch], Batch]) -> None:
    with VectorEnv(games=4, seed=1, episode="shift", shift_statistics=True, transitions=True, history=3) as env:
        while not (len(env.batch.endings) and len(env.batch.transitions)):
            env.step(env.sample())
        batch = env.batch
        copied = again(batch)
        assert (copied.step, copied.done, copied.totals) == (batch.step, batch.done, batch.totals)
        for one, other in (
            (batch, copied),
            (batch.observations, copied.observations),
            (batch.endings, copied.endings),
            (batch.endings.observations, copied.endings.observations),
            (batch.beginnings, copied.beginnings),
            (batch.shifts, copied.shifts),
            (batch.transitions, copied.transitions),
            (batch.transitions.before, copied.transitions.before),
        ):
            assert one is not None
            assert other is not None
            assert contents(one) == contents(other)
        assert contents(copied.take(np.array([0]))) == contents(batch.take(np.array([0])))


def test_threads_that_read_one_batch_see_the_same() -> None:
    with VectorEnv(games=64, seed=2) as env, ThreadPoolExecutor(8) as threads:
        for _ in range(50):
            batch = env.step(env.sample())
            found = list(threads.map(lambda _: (batch.games.tolist(), len(batch.beginnings)), range(8)))  # noqa: B023 - Awaited.
            assert all(one == found[0] for one in found)
            assert len(found[0][0]) == len(batch)


def test_an_engine_of_another_version_is_refused() -> None:
    from chefshat import _native

    _native._check_version(chefshat_native.__version__)
    with pytest.raises(ImportError, match=r"chefshat-native 0\.0\.1 does not fit chefshat .*: install chefshat_native-"):
        _native._check_version("0.0.1")
