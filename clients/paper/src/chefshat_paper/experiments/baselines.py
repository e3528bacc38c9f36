"""Agents that do not learn, for the tables of Experiments 2 and 3: what a learner has to beat.

They take the seats of the learners, choose only legal actions, and see nothing but which actions are legal. They play more games
than the learners: `REPETITIONS` for each seed, of which the first has the learners' deals. What a seed gives does not depend on the
other seeds.
"""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from chefshat_paper.experiments import learning, stats
from chefshat_paper.experiments.learning import Counts, Learned
from chefshat_paper.experiments.progress import Progress
from chefshat_paper.experiments.results import Config
from chefshat_paper.learn.deep_q_training import Mask, ShiftLog, without_idle_passes

# Games for each seed.
REPETITIONS = 20
QUICK_REPETITIONS = 2
# Random numbers that a game draws at a time.
BLOCK = 4096

Floats: TypeAlias = npt.NDArray[np.float64]
Actions: TypeAlias = npt.NDArray[np.intp]
Policy: TypeAlias = Callable[[Mask, Floats], Actions]
"""Chooses an action for each row: from the legal ones, (R, T), the last of which is passing, and random numbers in 0..1, (R,)."""

RANDOM = "random"
NEVER_IDLE = "random, never passes idly"


def random(masks: Mask, draws: Floats) -> Actions:
    """Uniform over the legal actions."""
    wanted = np.floor(draws * masks.sum(axis=1))
    return np.asarray(np.argmax(masks.cumsum(axis=1) > wanted[:, np.newaxis], axis=1))


def never_idle(masks: Mask, draws: Floats) -> Actions:
    """Uniform over the legal plays; passes only if nothing can be played."""
    return random(without_idle_passes(masks), draws)


def last_play(masks: Mask, draws: Floats) -> Actions:
    """The last legal action that is not a pass: the lone joker, or else the highest face, with as many cards and jokers as fit."""
    del draws
    masks = without_idle_passes(masks)
    return np.asarray(masks.shape[1] - 1 - np.argmax(masks[:, ::-1], axis=1))


def greedy(masks: Mask, draws: Floats) -> Actions:
    """The turns of the built-in agent `greedy`: no jokers if possible, then the highest face, then many cards."""
    del draws
    return np.asarray(np.argmax(np.where(masks, _greedy_ranks(masks.shape[1]), -1), axis=1))


POLICIES: Mapping[str, Policy] = {
    RANDOM: random,
    NEVER_IDLE: never_idle,
    "last action but passing": last_play,
    "greedy": greedy,
}


def play(
    config: Config,
    progress: Progress,
    name: str,
    *,
    rewards: str,
    seats: Sequence[int],
    gifts: str = learning.DEFAULT_GIFTS,
) -> Counts:
    """Plays the games of all seeds with one agent at the learners' seats.

    Args:
        config: address, seeds, quick or not.
        progress: shows the Shifts.
        name: of the agent, a key of `POLICIES`.
        rewards: the reward scheme.
        seats: the agent's seats; random agents have the others.
        gifts: how these seats decide in the exchange.
    """
    repetitions = range(repetitions_of(config))
    seeds = [learning.game_seed(seed, repetition) for seed in config.seeds for repetition in repetitions]
    draws = _Draws(seeds)
    what = f"{'four' if len(seats) > 1 else 'one'}, {name}, {gifts}, {rewards}"
    env = learning.games(config, seeds, rewards=rewards, seats=seats, gifts=gifts)
    with env, progress.task(what, total=learning.shifts_of(config) * len(seeds), unit="Shifts") as advance:
        log = ShiftLog(env)
        batch = env.reset()
        advance(log.add(batch))
        while not batch.done:
            batch = env.step(POLICIES[name](batch.masks[:, : env.turn_actions], draws.next(batch.games)))
            advance(log.add(batch))
        return Counts(log.played())


def repetitions_of(config: Config) -> int:
    """Returns the games of each seed."""
    return QUICK_REPETITIONS if config.quick else REPETITIONS


def note(config: Config, rows: Iterable[Counts]) -> str:
    """Returns the sentences about agents that do not learn for the note of a table with these rows; others are left out."""
    games = len(config.seeds) * repetitions_of(config)
    text = (
        f"Agents that do not learn: means over {games} games, {len(config.seeds)} of them with the learners' deals. After ±: "
        "standard errors, clustered by game"
    )
    won = [counts.won[:, :, 0] for counts in rows if not isinstance(counts, Learned)]
    # A few games may all have the same number of victories.
    ratios = [stats.cluster_ratio(each) for each in won if np.ptp(each.sum(axis=1))]
    if not ratios:
        return f"{text}."
    return f"{text}; those of seat 1's victories are {min(ratios):.2f} to {max(ratios):.2f} times those of independent Shifts."


def values(config: Config, counts: Counts) -> dict[str, object]:
    """Returns the wins of each game, and other numbers, as JSON values."""
    by_seed = counts.won.sum(axis=1).reshape(len(config.seeds), repetitions_of(config), -1)
    return {
        "wins": {str(seed): wins for seed, wins in zip(config.seeds, by_seed.tolist(), strict=True)},
        "starter_wins": float(np.mean(counts.starter_wins())),
    }


class _Draws:
    """A stream of random numbers for each game."""

    def __init__(self, seeds: Sequence[bytes]) -> None:
        digests = [hashlib.sha256(seed + b" of the agents that do not learn").digest() for seed in seeds]
        self._streams = [np.random.default_rng(int.from_bytes(digest, "little")) for digest in digests]
        self._blocks = np.zeros((len(seeds), BLOCK))
        self._used = np.full(len(seeds), BLOCK)

    def next(self, games: npt.NDArray[np.uint32]) -> Floats:
        """Draws a number for each of these games, each of which is named once."""
        for game in games[self._used[games] == BLOCK]:
            self._blocks[game] = self._streams[game].random(BLOCK)
            self._used[game] = 0
        drawn: Floats = self._blocks[games, self._used[games]]
        self._used[games] += 1
        return drawn


@cache
def _greedy_ranks(turn_actions: int) -> npt.NDArray[np.intp]:
    """Returns the rank of each action of a turn: the legal one with the highest is chosen."""
    keys: list[tuple[int, int, int]] = []
    face = 1
    # By face and number of its cards, each with 0, 1 and 2 jokers; then the lone joker and the pass.
    while len(keys) < turn_actions - 2:
        keys += [(-jokers, face, cards) for cards in range(1, face + 1) for jokers in range(3)]
        face += 1
    keys += [(-1, -1, 0), (-3, 0, 0)]
    ranks = np.zeros(turn_actions, np.intp)
    ranks[sorted(range(turn_actions), key=keys.__getitem__)] = np.arange(turn_actions)
    return ranks
