"""Decisions per second of every way to play with this package, beside other environments of card games, in one run on one machine.

Ours: n games with all seats, and one seat against `greedy` and `trained`, in this process and over the network; one game through
Gymnasium and PettingZoo, with their wrappers. Others, each if it is installed: OpenSpiel's hearts, pgx's Leduc hold'em,
PettingZoo's Leduc hold'em.
Every policy is random over the legal actions. Nothing runs at the same time.
"""

# ruff: noqa: ANN401 - JAX and pgx have no types.
import argparse
import functools
import importlib.util
import random
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import version
from typing import Any

import measure
import numpy as np
from vector import DEFAULT_GAMES, Batches

from chefshat.local_server import shared_address
from chefshat.vector import VectorEnv, VectorOptions

# Decisions between two looks at the clock, where one takes less than a look.
AT_ONCE = 100
OPPONENTS = (None, "greedy", "trained")

Play = Callable[[], int]


def main() -> int:
    """Measures and prints."""
    parser = measure.parser(__doc__.split("\n\n")[0], "python benchmarks/compare.py --seconds 0.5 --rounds 3 --json")
    parser.add_argument("--games", type=int, nargs="+", default=DEFAULT_GAMES, metavar="N", help="games (default: 1 16 64 1024)")
    parser.add_argument("--only", metavar="TEXT", default="", help="only what has this text in its name")
    options = parser.parse_args()
    measured = [measure.measure(name, play, options) for name, play in everything(options) if options.only in name]
    measure.show(measured, options, **{name: version(name) for name in ("chefshat", "gymnasium") if installed(name)})
    return 0


def everything(options: argparse.Namespace) -> Iterator[tuple[str, Play]]:
    """Iterates over all that is measured: its name, and a function that plays briefly and returns its number of decisions."""
    ways: dict[str, Callable[[], str | None]] = {"over the network": shared_address}
    if installed("chefshat_native"):
        ways = {"in process": lambda: None, **ways}
    for way, address in ways.items():
        for opponents in OPPONENTS:
            against = "all seats" if opponents is None else f"one seat against {opponents}"
            for games in options.games:
                yield f"{way}, {against}, n = {games:,}", late(functools.partial(ours, address, games, opponents, options.seed))
    if installed("gymnasium"):
        yield "Gymnasium, one game", late(functools.partial(through_gymnasium, options.seed))
    if installed("pettingzoo"):
        yield "PettingZoo, one game", late(functools.partial(through_pettingzoo, options.seed))
    if installed("pyspiel"):
        yield "OpenSpiel hearts", late(functools.partial(hearts, options.seed))
    if installed("pgx"):
        for games in options.games:
            yield f"pgx Leduc hold'em, n = {games:,}", late(functools.partial(pgx_leduc, games, options.seed))
    if all(map(installed, ("pettingzoo", "rlcard", "pygame"))):
        yield "PettingZoo Leduc hold'em", late(functools.partial(pettingzoo_leduc, options.seed))


def installed(module: str) -> bool:
    """Returns whether a module can be imported."""
    return importlib.util.find_spec(module) is not None


def late(make: Callable[[], Play]) -> Play:
    """Creates what plays when it plays first, so that what is not measured is not created."""
    made: list[Play] = []

    def play() -> int:
        if not made:
            made.append(make())
        return made[0]()

    return play


def ours(address: Callable[[], str | None], games: int, opponents: str | None, seed: int) -> Play:
    """Many games of this package; decisions of the policy count."""
    setup: VectorOptions = {"seed": seed}
    if opponents is not None:
        setup |= {"client_seats": [0], "opponents": opponents}
    batches = Batches(VectorEnv(address(), games, **setup), seed)

    def play() -> int:
        decisions = sum(batches.step() for _ in range(max(1, AT_ONCE // games)))
        batches.check()
        return decisions

    return play


def through_gymnasium(seed: int) -> Play:
    """One game through `gymnasium.make`; decisions of the agent count."""
    import gymnasium

    import chefshat.envs  # noqa: F401 - Registers it.

    env = gymnasium.make("chefshat.envs:chefshat/ChefsHat-v1")
    chance = random.Random(seed)
    info = env.reset(seed=seed)[1]

    def play() -> int:
        nonlocal info
        for _ in range(AT_ONCE):
            legal = info["action_mask"].nonzero()[0]
            _, _, terminated, truncated, info = env.step(legal[int(chance.random() * len(legal))])
            if terminated or truncated:
                info = env.reset()[1]
        return AT_ONCE

    return play


def hearts(seed: int) -> Play:
    """One game of OpenSpiel's hearts at a time, without observations."""
    import pyspiel
    from open_spiel_hearts import play_game

    return functools.partial(play_game, pyspiel.load_game("hearts"), random.Random(seed), False)


def pgx_leduc(games: int, seed: int) -> Play:
    """Many games of pgx; games that are over begin again. Compiled, with `AT_ONCE` steps in a call."""
    import jax
    import pgx
    from pgx.experimental import auto_reset

    env = pgx.make("leduc_holdem")
    step = auto_reset(env.step, env.init)

    def one(state: Any, key: Any) -> tuple[Any, None]:
        drawing, stepping = jax.random.split(key)
        logits = jax.numpy.where(state.legal_action_mask, 0.0, -np.inf)
        actions = jax.random.categorical(drawing, logits)
        return jax.vmap(step)(state, actions, jax.random.split(stepping, games)), None

    def many(state: Any, key: Any) -> Any:
        return jax.lax.scan(one, state, jax.random.split(key, AT_ONCE))[0]

    compiled = jax.jit(many)
    key = jax.random.key(seed)
    state = jax.jit(jax.vmap(env.init))(jax.random.split(key, games))

    def play() -> int:
        nonlocal key, state
        key, now = jax.random.split(key)
        state = compiled(state, now)
        state.rewards.block_until_ready()
        return AT_ONCE * games

    return play


def through_pettingzoo(seed: int) -> Play:
    """One game of this package through PettingZoo; decisions of all agents count."""
    from chefshat.envs import chefshat_v1

    return turns(chefshat_v1.env(), seed)


def pettingzoo_leduc(seed: int) -> Play:
    """One game of PettingZoo at a time."""
    from pettingzoo.classic import leduc_holdem_v4

    return turns(leduc_holdem_v4.env(), seed)


def turns(env: Any, seed: int) -> Play:
    """Episodes of an environment of PettingZoo."""
    chance = random.Random(seed)
    env.reset(seed=seed)

    def play() -> int:
        decisions = 0
        env.reset()
        for _ in env.agent_iter():
            observed, _, terminated, truncated, _ = env.last()
            if terminated or truncated:
                env.step(None)
                continue
            legal = observed["action_mask"].nonzero()[0]
            env.step(int(legal[int(chance.random() * len(legal))]))
            decisions += 1
        return decisions

    return play


if __name__ == "__main__":
    sys.exit(main())
