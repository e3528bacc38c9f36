"""Functions as opponents, in this process and on the real server: the games equal those in which the client has all seats."""

from collections import defaultdict
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import chefshat
from chefshat.errors import ChefsHatError
from chefshat.vector import Batch, VectorEnv

GAMES = 5
# What is seen and received at a decision or at an end.
Seen = tuple[object, ...]


def first(batch: Batch) -> Any:
    """The first legal action of each row."""
    return batch.masks.argmax(axis=1)


def last(batch: Batch) -> Any:
    """The last legal action of each row."""
    return batch.sizes.num_actions - 1 - batch.masks[:, ::-1].argmax(axis=1)


def decisions(batch: Batch, seat: int) -> list[tuple[int, Seen]]:
    """The decisions and ends of a seat in a batch, with their games."""
    seen: list[tuple[int, Seen]] = []
    for row, game in enumerate(batch.endings.games.tolist()):
        ending = batch.endings
        if ending.seats[row] == seat:
            points = ending.observations.points[row].tolist()
            seen.append((game, ("end", float(ending.rewards[row]), int(ending.places_taken[row]), points)))
    for row, game in enumerate(batch.games.tolist()):
        if batch.seats[row] == seat:
            hand = batch.observations.hands[row].tolist()
            seen.append((game, (int(batch.kinds[row]), float(batch.rewards[row]), hand, batch.mask_bits[row].tolist())))
    return seen


def story(env: VectorEnv, seat: int, choose: Callable[[Batch], Any], steps: int) -> dict[int, list[Seen]]:
    """Plays, and returns what the seat has seen in each game."""
    found: dict[int, list[Seen]] = defaultdict(list)
    for _ in range(steps):
        for game, seen in decisions(env.batch, seat):
            found[game].append(seen)
        env.step(choose(env.batch))
    return found


@pytest.mark.parametrize("opponents", [first, [first, first, first]])
def test_games_are_those_of_a_client_with_all_seats(anywhere: str | None, opponents: Any) -> None:
    seat = 2
    setup: Any = {"rewards": "winning", "seed": 5, "records": True, "rules": {"target_shifts": 2}}
    with VectorEnv(anywhere, GAMES, client_seats=[seat], opponents=opponents, **setup) as env:
        assert (env.client_seats, env.built_in_agents) == ((seat,), ("", "", "", ""))
        mine = story(env, seat, last, 60)
        assert len(env.batch) == GAMES
        assert set(env.batch.seats.tolist()) == {seat}
        assert env.batch.totals.client_decisions == 60 * GAMES
        assert env.batch.totals.decisions > 120 * GAMES
        assert env.batch.step == 61
        with pytest.raises(ValueError, match=r"actions are 0\.\.=213"):
            env.step(np.full(GAMES, 0xFFFF, np.uint16))

    def both(batch: Batch) -> Any:
        return np.where(batch.seats == seat, last(batch), first(batch))

    with VectorEnv(anywhere, GAMES, **setup) as env:
        expected = story(env, seat, both, 400)
    for game in range(GAMES):
        assert len(mine[game]) > 60
        assert mine[game] == expected[game][: len(mine[game])]


def test_what_happens_between_is_in_one_batch(anywhere: str | None) -> None:
    setup: Any = {"shift_statistics": True, "records": True, "seed": 3, "rules": {"target_shifts": 1}}
    with VectorEnv(anywhere, 8, client_seats=[1, 3], opponents=["greedy", first], transitions=True, **setup) as env:
        assert env.built_in_agents == ("greedy", "", "", "")
        over, begun, records, shifts = 0, len(env.batch.beginnings), 0, 0
        for _ in range(160):
            batch = env.step(env.sample())
            assert set(batch.seats.tolist()) | set(batch.endings.seats.tolist()) <= {1, 3}
            assert (np.diff(batch.endings.games.astype(int)) >= 0).all()
            assert batch.shifts is not None
            over, begun, shifts = over + len(batch.endings), begun + len(batch.beginnings), shifts + len(batch.shifts)
            records += len(batch.records)
            # Every ending of a seat that has decided is the outcome of its last decision.
            assert batch.transitions.ended.sum() == len(batch.endings)
        assert (over, begun, shifts) == (2 * records, 8 + records, records)
        assert (batch.totals.games, batch.totals.shifts) == (records, records)
        assert records > 8


def test_each_function_is_asked_for_all_its_rows(anywhere: str | None) -> None:
    asked: dict[str, list[set[int]]] = {"one": [], "two": []}

    def one(batch: Batch) -> list[int]:
        asked["one"].append(set(batch.seats.tolist()))
        assert len(batch.endings) == len(batch.beginnings) == 0, "endings show the hands of others"
        return [int(action) for action in last(batch)]

    def two(batch: Batch) -> Any:
        asked["two"].append(set(batch.seats.tolist()))
        return batch.masks.argmax(axis=1)

    with VectorEnv(anywhere, 64, client_seats=[1], opponents=[one, two, one], seed=1) as env:
        for _ in range(10):
            env.step(env.sample())
    assert set.union(*asked["one"]) == {0, 3}
    assert {0, 3} in asked["one"]
    assert set.union(*asked["two"]) == {2}


def test_states_continue_with_the_same_opponents(anywhere: str | None) -> None:
    with VectorEnv(anywhere, 3, client_seats=[0], opponents=["random", first, "greedy"], rewards="points", seed=2) as env:
        for _ in range(7):
            env.step(last(env.batch))
        states = env.save()
        expected = story(env, 0, first, 30)
        env.restore([0, 1, 2], states)
        copies = env.fork([1], times=2)
        assert story(env, 0, first, 30) == expected
        env.restore([1], [states[1]])
        assert decisions(env.batch, 0)[1] == (1, expected[1][0])
        env.reset(2)
        assert env.batch.step > 60
        with copies:
            assert copies.client_seats == (0,)
            again = story(copies, 0, first, 30)
            assert again[0] == again[1] == expected[1]


def test_an_opponent_does_not_use_the_games_it_plays_in(anywhere: str | None) -> None:
    def meddling(batch: Batch) -> Any:
        if used:
            used[0].save()
        return first(batch)

    used: list[VectorEnv] = []
    with VectorEnv(anywhere, 1, client_seats=[1], opponents=meddling, seed=1) as env:
        used.append(env)
        with pytest.raises(ChefsHatError, match=r"OPPONENT_FAILED.*GAMES_IN_USE"):
            story(env, 1, last, 20)


def test_a_function_plays_in_the_environments_above() -> None:
    pytest.importorskip("chefshat_native")
    gymnasium = pytest.importorskip("gymnasium")
    one: Any
    for one in (
        chefshat.make(opponents=first),
        gymnasium.make("chefshat.envs:chefshat/ChefsHat-v1", opponents=[first, "random", last]),
    ):
        one.reset(seed=1)
        over = False
        while not over:
            _, _, over, _, info = one.step(int(one.unwrapped.action_masks().argmax()))
        assert 1 <= info["place"] <= 4
        one.close()
    many: Any = gymnasium.make_vec("chefshat.envs:chefshat/ChefsHat-v1", num_envs=3, opponents=last)
    many.reset(seed=1)
    for _ in range(30):
        _, _, _, _, infos = many.step(many.unwrapped.action_masks().argmax(axis=1))
        assert infos["action_mask"].any(axis=1).all()
    many.close()


def failing(batch: Batch) -> Any:
    raise TypeError("no model")


@pytest.mark.parametrize(
    ("opponent", "message"),
    [
        (failing, r"the opponent failing_later of seat [023].* raised TypeError\('no model'\)"),
        (lambda batch: np.zeros(len(batch)), r"returned float64 of the shape \(\d,\): return one action for each row, integers"),
        (lambda batch: first(batch)[1:], r"return one action for each row"),
        (lambda batch: np.full(len(batch), 214), r"chose 214 in row 0 \(game 0, seat [023]\), which is illegal"),
        (lambda batch: batch.masks.argmin(axis=1), r"which is illegal: see batch.masks\[0\]"),
    ],
)
def test_what_an_opponent_does_wrong_is_named(anywhere: str | None, opponent: Any, message: str) -> None:
    chosen = [first]

    def failing_later(batch: Batch) -> Any:
        return chosen[0](batch)

    env = VectorEnv(anywhere, 1, client_seats=[1], opponents=failing_later, seed=1)
    chosen[0] = opponent
    with pytest.raises(ChefsHatError, match=message) as caught:
        story(env, 1, last, 20)
    assert caught.value.reason == "OPPONENT_FAILED"
    with pytest.raises(ChefsHatError, match="ENV_ENDED"):
        env.sample()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"opponents": first}, r"client_seats=\[0\]"),
        ({"opponents": "greedy"}, r"client_seats=\[0\]"),
        ({"opponents": [], "client_seats": [0]}, "opponents is empty"),
        ({"opponents": [first, first], "client_seats": [0]}, "one for each of the 3 other seats, or one for all, not 2"),
        ({"opponents": [first, "greedy"], "client_seats": [0]}, "one for each of the 3 other seats, or one for all, not 2"),
        ({"opponents": first, "client_seats": [4]}, r"0\.\.=3, not \[4\]"),
        ({"opponents": first, "client_seats": [0, 0]}, r"name each of the client's seats once"),
        ({"opponents": first, "client_seats": []}, r"name each of the client's seats once"),
    ],
)
def test_opponents_fit_the_seats(anywhere: str | None, options: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        VectorEnv(anywhere, 1, **options)
