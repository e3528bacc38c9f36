"""Advantages compared with a plain loop over each seat's chain, rewards of places, and those of a coalition."""

import itertools
from collections import defaultdict

import numpy as np
import numpy.typing as npt
import pytest

from chefshat.learn.features import num_actions
from chefshat.learn.self_play import Collector, Ends, Floats, Rollout, advantages, place_rewards
from chefshat.vector import VectorEnv

STEPS, GAMES, PLAYERS, FACES = 40, 6, 4, 11


def made_up(seed: int) -> tuple[Rollout, Floats]:
    """Returns a rollout and its values. Deciding seats, skipped games and ends are random; some Shifts end twice in a step."""
    chance = np.random.default_rng(seed)
    shape = (STEPS, GAMES)
    ends = []
    for _ in range(STEPS):
        ended = [game for game in range(GAMES) for _ in range(int(chance.choice([0, 1, 2], p=[0.85, 0.12, 0.03])))]
        games = np.repeat(np.array(ended, np.uint32), PLAYERS)
        seats = np.tile(np.arange(PLAYERS, dtype=np.uint8), len(ended))
        ends.append(Ends(games, seats, chance.normal(size=len(games)).astype(np.float32)))
    rollout = Rollout(
        inputs=np.zeros((*shape, 1), np.float32),
        actions=np.zeros(shape, np.int32),
        log_probabilities=np.zeros(shape, np.float32),
        seats=chance.integers(0, PLAYERS, shape, dtype=np.uint8),
        present=chance.random(shape) < 0.9,
        ends=ends,
    )
    return rollout, chance.normal(size=shape).astype(np.float32)


def first_legal(inputs: Floats) -> tuple[npt.NDArray[np.integer], Floats]:
    """Takes the first legal action."""
    return (inputs[:, -num_actions(FACES) :] > 0).argmax(axis=1), np.zeros(len(inputs), np.float32)


def plain(rollout: Rollout, estimates: Floats, discount: float, gae_lambda: float) -> dict[tuple[int, int], float]:
    """Returns the advantage of every decision that has one, by step and game."""
    # For each game and seat, in order: its decisions (step) and the rewards of its ends (None, reward).
    stories: dict[tuple[int, int], list[int | float]] = defaultdict(list)
    for step in range(STEPS):
        for game in range(GAMES):
            if rollout.present[step, game]:
                stories[game, int(rollout.seats[step, game])].append(step)
        ends = rollout.ends[step]
        for game, seat, reward in zip(ends.games, ends.seats, ends.rewards, strict=True):
            stories[int(game), int(seat)].append(float(reward))
    found: dict[tuple[int, int], float] = {}
    for (game, _), story in stories.items():
        chain: list[int] = []
        for what in [*story, None]:
            if isinstance(what, int):
                chain.append(what)
                continue
            values = [float(estimates[step, game]) for step in chain]
            # A chain that continues bootstraps from its last decision.
            deltas = [discount * later - value for value, later in itertools.pairwise(values)]
            if what is not None and values:
                deltas.append(what - values[-1])
            for number in range(len(deltas)):
                found[chain[number], game] = sum((discount * gae_lambda) ** k * delta for k, delta in enumerate(deltas[number:]))
            chain = []
    return found


@pytest.mark.parametrize("seed", range(5))
def test_advantages_equal_those_of_a_plain_loop(seed: int) -> None:
    rollout, estimates = made_up(seed)
    found, known = advantages(rollout, estimates, PLAYERS, discount=0.9, gae_lambda=0.8)
    expected = plain(rollout, estimates, 0.9, 0.8)
    assert len(expected) > 100
    assert {(int(step), int(game)) for step, game in np.argwhere(known)} == set(expected)
    for (step, game), advantage in expected.items():
        assert found[step, game] == pytest.approx(advantage, rel=1e-4, abs=1e-5)
    assert not found[~known].any()


def test_place_rewards_add_up_to_zero() -> None:
    worth = place_rewards([5, 3, 1, 0])
    np.testing.assert_allclose(worth, [0.55, 0.15, -0.25, -0.45], rtol=1e-6)
    assert worth.sum() == pytest.approx(0, abs=1e-6)


def test_a_coalition_has_the_points_of_both(anywhere: str | None) -> None:
    settings = {"episode": "shift", "client_seats": [0, 2], "seed": 3, "skip_forced": True}
    ends = []
    for coalition in (1, 2):
        with VectorEnv(anywhere, 16, **settings) as env:  # type: ignore[arg-type]
            found = Collector(env, 16, 120, coalition=coalition).collect(first_legal).ends
            columns = zip(*((end.games, end.seats, end.rewards) for end in found), strict=True)
            ends.append([np.concatenate(column) for column in columns])
    (games, seats, own), (same_games, same_seats, shared) = ends
    np.testing.assert_array_equal(games, same_games)
    np.testing.assert_array_equal(seats, same_seats)
    assert len(seats) > 40
    assert list(seats) == [0, 2] * (len(seats) // 2)
    np.testing.assert_allclose(shared[::2], (own[::2] + own[1::2]) / 2)
    np.testing.assert_array_equal(shared[::2], shared[1::2])
    assert min(shared) < 0 < max(shared)
