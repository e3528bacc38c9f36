"""Uses the installed packages as someone would who just installed them: `cargo xtask wheels --try` runs it.

It runs in an environment with the wheels and what they require, without Rust and without the repository: games in this process, the
checks of Gymnasium and PettingZoo, then a game on a server. Any failure is an exception.
"""

import importlib
import shutil
import subprocess
import sys
import time
import urllib.request
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

STARTED = time.perf_counter()


@contextmanager
def attempt(what: str) -> Iterator[None]:
    """Prints what succeeds within the block, and when, in seconds since the start."""
    yield
    print(f"{time.perf_counter() - STARTED:6.1f} s  {what}", flush=True)


def in_this_process() -> None:
    """Steps environments in this process, found by name, without gRPC."""
    import gymnasium

    with attempt("first step of an environment, without a server"):
        env = gymnasium.make("chefshat.envs:chefshat/ChefsHat-v1", opponents="greedy")
        _, info = env.reset(seed=1)
        env.step(env.action_space.sample(info["action_mask"]))
        env.close()
    import chefshat

    with attempt("an episode of 64 games at once"):
        envs = gymnasium.make_vec("chefshat.envs:chefshat/ChefsHat-v1", num_envs=64)
        _, infos = envs.reset(seed=1)
        ended = False
        while not ended:
            _, _, terminations, truncations, infos = envs.step(infos["action_mask"].argmax(axis=1))
            ended = bool((terminations | truncations).any())
        envs.close()
    assert "site-packages" in chefshat.__file__, chefshat.__file__
    assert "grpc" not in sys.modules, "environments in this process load gRPC"


def checks() -> None:
    """Runs the checks of Gymnasium and PettingZoo."""
    import chefshat

    with attempt("check_env of Gymnasium"):
        checker = importlib.import_module("gymnasium.utils.env_checker")
        checker.check_env(chefshat.make(opponents="greedy").unwrapped)
    from chefshat.envs import chefshat_v1

    tests = importlib.import_module("pettingzoo.test")
    with attempt("api_test and seed_test of PettingZoo"):
        with warnings.catch_warnings():
            # They warn about observations that are dictionaries, as those with masks are.
            warnings.simplefilter("ignore")
            tests.api_test(chefshat_v1.env(), num_cycles=200)
        tests.seed_test(chefshat_v1.env, num_cycles=50)


def on_a_server() -> None:
    """Plays on the server of the package chefshat-server, and fetches its page."""
    import numpy as np

    import chefshat

    rng = np.random.default_rng(1)
    with chefshat.LocalServer() as server:
        with attempt("a game on the server"), chefshat.Client(server.address) as client:
            room = client.rooms.create("first", seats=[None, "greedy", "greedy", "random"])
            result = client.play(chefshat.RandomAgent(seed=1), client.rooms.join(room.join_code, "Ada").ticket)
            result.raise_for_error()
            assert result.place in (1, 2, 3, 4)
        with attempt("games in batches on the server"), chefshat.VectorEnv(server.address, games=16, seed=1) as env:
            batch = env.batch
            while batch.totals.shifts < 16:
                batch = env.step(chefshat.sample_legal(batch.mask_bits, rng))
        with attempt("the page"), urllib.request.urlopen(f"http://{server.address}/") as page:
            assert b"<script" in page.read()


def commands() -> None:
    """Runs each command that was installed."""
    for command in ("chefshat", "chefshat-agent", "chefshat-experiments", "chefshat-learn", "chefshat-players-club"):
        with attempt(f"{command} --help"):
            subprocess.run([command, "--help"], check=True, stdout=subprocess.DEVNULL)
    with attempt("chefshat_paper.learn --help"):
        subprocess.run([sys.executable, "-I", "-m", "chefshat_paper.learn", "--help"], check=True, stdout=subprocess.DEVNULL)


def main() -> None:
    """Runs everything."""
    assert shutil.which("cargo") is None, "Rust is on the PATH"
    in_this_process()
    checks()
    on_a_server()
    commands()


if __name__ == "__main__":
    main()
