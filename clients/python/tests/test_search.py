"""Search from what a seat knows: deals, estimates, and agents that play by them."""

import importlib.util
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import chefshat
from chefshat import ChefsHatError, VectorEnv, history, pb, search
from chefshat.estimates import Estimates, Outcomes
from chefshat.learn import network
from chefshat.learn.evaluation import evaluate
from chefshat.search import Position

pytest.importorskip("chefshat_native")

SAMPLES = Path(__file__).resolve().parents[1] / "samples" / "search"
NETWORK = Path(__file__).resolve().parents[3] / "tests" / "fixtures" / "network"
# Wide enough for the Shifts of these tests.
HISTORY = 1024


def sample_module(name: str) -> ModuleType:
    """Loads a sample as a module."""
    spec = importlib.util.spec_from_file_location(name, SAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def positions(shifts: int, **options: Any) -> Iterator[tuple[VectorEnv, Position]]:
    """Plays random actions and returns every decision of some Shifts."""
    with VectorEnv(history=HISTORY, seed=3, **options) as env:
        env.sample(seed=4)
        while env.batch.totals.shifts < shifts:
            yield env, search.position(env)
            env.step(env.sample())


def same(one: Estimates, other: Estimates) -> bool:
    """Whether all numbers are equal."""
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in Estimates.__dataclass_fields__)


@pytest.mark.parametrize(
    ("shifts", "options"),
    [
        (4, {}),
        # Both jokers are often in one hand, and sometimes declared.
        (30, {"rules": {"players": 2, "faces": 6}}),
        (12, {"rules": {"players": 3, "faces": 7, "opening": "any_top_face", "opening_pass": True, "pass_scope": "turn"}}),
        (2, {"rules": {"players": 5, "faces": 8}, "client_seats": [1, 3]}),
    ],
)
def test_deals_are_consistent_with_every_decision(shifts: int, options: dict[str, Any]) -> None:
    declared = 0
    for env, position in positions(shifts, **options):
        batch = env.batch
        seen = batch.observations
        declare = env.num_actions - 1
        declared += (history.actions(batch)[0] == declare).any()
        assert (position.seat, position.deals >= 1) == (batch.seats[0], True)
        assert position.legal_actions.tolist() == np.flatnonzero(batch.masks[0]).tolist()
        hands = position.sample(5, seed=int(batch.step))
        assert hands.shape == (5, env.players, env.sizes.card_kinds)
        assert (hands[:, position.seat] == seen.hands[0]).all()
        assert (hands.sum(axis=2) == seen.cards_left[0]).all()
        deck = np.array([*range(1, env.faces + 1), env.jokers])
        assert (hands.sum(axis=1) + seen.played[0] <= deck).all()
        expected = position.expected_hands(5, seed=int(batch.step))
        np.testing.assert_allclose(expected, hands.mean(axis=0))
    assert declared or shifts < 30


def test_turns_alone() -> None:
    for env, position in positions(3, decisions="turns", client_seats=[1]):
        assert (position.sample(2).sum(axis=2) == env.batch.observations.cards_left[0]).all()


def test_starts_are_the_deals_drawn() -> None:
    checked = 0
    for env, position in positions(3):
        if env.batch.step % 7:
            continue
        hands = position.sample(3, seed=5)
        with VectorEnv(games=6, starts=position.starts(3, seed=5), rules=position.rules, history=HISTORY, seed=1) as worlds:
            assert (worlds.batch.seats == position.seat).all()
            assert (worlds.batch.mask_bits == env.batch.mask_bits[0]).all()
            # The order of gifts is not among what a seat has to remember.
            seen = worlds.batch.observations.as_dict()
            del seen["history"]
            for name, column in seen.items():
                assert (column == getattr(env.batch.observations, name)[0]).all(), name
            # The hands of the others show when they decide.
            if len(position.legal_actions) > 1 and env.batch.kinds[0] == pb.DECISION_KIND_TURN:
                worlds.step(np.repeat(position.legal_actions[-1], 6))
                batch = worlds.batch
                assert (batch.observations.hands == hands[batch.games % 3, batch.seats]).all()
                checked += 1
    assert checked > 5


def test_hidden_cards_change_nothing() -> None:
    # Two games that look the same to the seat, and differ in the cards of the others.
    compared = 0
    for env, position in positions(4):
        if env.batch.step % 5 or len(position.legal_actions) == 1:
            continue
        drawn = position.sample(2, seed=9)
        if (drawn[0] == drawn[1]).all():
            continue
        starts = position.starts(2, seed=9)
        with VectorEnv(games=2, starts=starts, rules=position.rules, history=HISTORY, seed=[bytes(32), bytes([1]) * 32]) as worlds:
            states = worlds.save()
            both = [search.position(worlds, row) for row in range(2)]
        assert states[0] != states[1]
        for other in (*both, *map(search.position, states)):
            assert other.deals == position.deals
            assert (other.sample(20, seed=1) == position.sample(20, seed=1)).all()
            assert (other.expected_hands(20) == position.expected_hands(20)).all()
            assert same(other.evaluate(60, seed=2), position.evaluate(60, seed=2))
        compared += 1
    assert compared > 20


def test_estimates() -> None:
    position = next(position for _, position in positions(2) if len(position.legal_actions) > 3)
    legal = position.legal_actions
    found = position.evaluate(400, seed=1)
    assert found.actions.tolist() == legal.tolist()
    assert (found.rollouts >= 400 // len(legal)).all()
    assert ((found.points >= 0) & (found.points <= 5) & (found.places >= 1) & (found.places <= 4)).all()
    assert (found.gains[0], found.gain_errors[0]) == (0, 0)
    np.testing.assert_allclose(found.gains, found.points - found.points[0], atol=1e-12)
    assert found.best == legal[found.points.argmax()]
    # A function of the seed on any number of threads.
    assert same(found, position.evaluate(400, seed=1, threads=1))
    assert not same(found, position.evaluate(400, seed=2))
    # Gains refer to the first action; the worse ones are dropped.
    halved = position.evaluate(400, actions=legal[::-1].tolist(), halving=True, agent="random")
    assert (halved.actions.tolist(), halved.gains[0]) == (legal[::-1].tolist(), 0)
    assert halved.rollouts.min() < halved.rollouts.max()
    assert halved.rollouts[halved.actions == halved.best] == halved.rollouts.max()
    assert (position.evaluate(time_ms=1).rollouts >= 4).all()


def test_networks_play_the_rollouts() -> None:
    position = next(position for _, position in positions(2) if len(position.legal_actions) > 3)
    file = NETWORK / "table-actions.safetensors"
    found = position.evaluate(40, agent=file, seed=1)
    assert same(found, position.evaluate(40, agent=str(file), seed=1))
    with pytest.raises(ChefsHatError, match="ANALYSIS_REFUSED"):
        position.evaluate(40, agent=Path(__file__))


def test_environments_of_others() -> None:
    pytest.importorskip("gymnasium")
    pytest.importorskip("pettingzoo")
    env = chefshat.make(opponents="greedy", history=HISTORY)
    _, info = env.reset(seed=1)
    assert search.position(env).legal_actions.tolist() == np.flatnonzero(info["action_mask"]).tolist()
    table = chefshat.make("pettingzoo", history=HISTORY)
    table.reset(seed=1)
    assert f"player_{search.position(table).seat}" == table.agent_selection
    env.close()
    table.close()


def test_what_cannot_be_searched() -> None:
    def refused(reason: str, words: str, env: VectorEnv) -> None:
        with pytest.raises(ChefsHatError, match=words) as error:
            search.position(env)
        assert error.value.reason == reason

    with VectorEnv(seed=1) as env:
        refused("STATES_REFUSED", "history", env)
        with pytest.raises(ValueError, match="there is no row 1"):
            search.position(env, 1)
    with VectorEnv(seed=1, history=4) as env:
        search.position(env)
        for _ in range(20):
            env.step(env.sample(seed=1))
        refused("STATES_REFUSED", "history", env)
    with VectorEnv(seed=1, history=4, rules={"players": 6}) as env, pytest.raises(ChefsHatError, match="more than 10 steps"):
        search.position(env, max_steps=10)
    with VectorEnv(seed=1, history=4) as env:
        position = search.position(env)
        for wrong in ({"rollouts": 0}, {"time_ms": -1}, {"rollouts": 1, "seed": -1}):
            with pytest.raises(ValueError, match=r"budget|seed"):
                position.evaluate(**wrong)  # type: ignore[arg-type]
        illegal = next(action for action in range(env.num_actions) if action not in position.legal_actions)
        for agent, actions in (("clever", None), ("greedy", []), ("greedy", [illegal])):
            with pytest.raises(ChefsHatError, match="ANALYSIS_REFUSED"):
                position.evaluate(10, agent=agent, actions=actions)
        with pytest.raises(ValueError, match="deals"):
            position.sample(0)
    with pytest.raises(ChefsHatError, match="STATES_REFUSED"):
        search.position(b"not a state")


def test_without_the_native_module(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "chefshat_native", None)
    with pytest.raises(ChefsHatError, match=r"Client\.evaluate") as error:
        search.position(b"")
    assert error.value.reason == "NATIVE_MISSING"


class Searcher(chefshat.Agent):
    """Compares what it may know with the situation that it searches, and some estimates with the server's."""

    def __init__(self, client: chefshat.Client) -> None:
        self.client = client
        self.decisions = self.compared = 0

    def decide(self, request: chefshat.Decision) -> int:
        """Takes the best action."""
        position = search.position(request)
        assert position.legal_actions.tolist() == request.legal_actions.tolist()
        hands = position.sample(3)
        assert (hands[:, request.seat] == request.hand).all()
        assert (hands.sum(axis=2) == request.cards_left).all()
        self.decisions += 1
        estimates = position.evaluate(20, seed=self.decisions)
        if self.decisions % 10 == 0:
            asked = pb.EvaluateRequest(situation=request.situation(), rollouts=20, seed=self.decisions, time_ms=10_000)
            *_, answer = self.client.evaluate(asked)
            assert [estimate.points for estimate in answer.actions] == estimates.points.tolist()
            assert [estimate.rollouts for estimate in answer.actions] == estimates.rollouts.tolist()
            self.compared += 1
        return estimates.best


@pytest.mark.server
def test_live_decisions(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create("search", rules=pb.RuleSet(target_shifts=4), seats=[None, "greedy", "greedy", "random"])
        agent = Searcher(client)
        client.play(agent, client.rooms.join(room.join_code, "Searcher").ticket).raise_for_error()
    assert agent.decisions > 20
    assert agent.compared > 1


def test_a_decision_without_the_start_of_its_shift() -> None:
    decision = chefshat.Decision(pb.DecisionRequest(), chefshat.SeatInfo("room", "game", 0))
    with pytest.raises(ValueError, match="has not arrived"):
        search.position(decision)


@pytest.mark.slow
def test_the_search_agent_beats_greedy() -> None:
    # Chance is 2.5 of 10.
    places = sample_module("search_agent").play(games=10, rollouts=1000)
    assert len(places) == 10
    assert places.count(1) >= 7


def test_own_rollouts_count_a_shift_of_each_game(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    sample = sample_module("own_rollouts")
    monkeypatch.setattr(sample, "search_action", lambda env, row, policy, deals: int(policy(env.batch)[row]))
    sample.main(games=30)
    expected = evaluate(sample.lowest, "greedy", games=30, seed=1, rules={"target_shifts": 1})
    assert capsys.readouterr().out.startswith(f"{expected.points:.2f} points a Shift")


def test_own_rollouts(capsys: pytest.CaptureFixture[str]) -> None:
    sample_module("own_rollouts").main(games=2, deals=4)
    assert "points a Shift" in capsys.readouterr().out


def test_the_sample_that_improves_a_policy(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("safetensors")
    sample_module("improved_policy").main(shifts=2, rollouts=16)
    assert "points a Shift" in capsys.readouterr().out


def test_the_sample_of_beliefs(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("safetensors")
    belief = sample_module("belief")
    belief.main(positions=2)
    assert capsys.readouterr().out.count("one of 64 ") == 3
    # Two groups of two deals, with one card each: the second deal of each is three times as likely.
    hands, logs = np.array([[[0.0]], [[1.0]], [[0.0]], [[4.0]]]), np.log([1.0, 3.0, 2.0, 6.0])
    np.testing.assert_allclose(belief.guess(hands, logs, 2), [[0.75 * 5 / 2]])
    np.testing.assert_allclose(belief.guess(hands, logs, 1), [[5 / 4]])


def busy_position(actions: int = 4) -> Position:
    """Returns the first decision among more than this number of actions."""
    return next(position for _, position in positions(2) if len(position.legal_actions) > actions)


def test_outcomes_are_what_estimates_are_means_of() -> None:
    position = busy_position()
    tried = position.outcomes(30, seed=1)
    assert tried.points.shape == tried.places.shape == (30, len(position.legal_actions))
    worth = np.array(position.rules.points)
    assert (tried.points == worth[tried.places.astype(int) - 1]).all()
    found = position.evaluate(deals=30, seed=1)
    assert same(found, tried.estimates())
    assert same(found, position.evaluate(deals=30, seed=1, threads=1))
    np.testing.assert_allclose(found.points, tried.points.mean(axis=0))
    np.testing.assert_allclose(found.standard_errors, tried.points.std(axis=0, ddof=1) / np.sqrt(30))
    # A budget of rollouts is spent on the same deals, four at first.
    fewest, first = position.evaluate(1, seed=1), Outcomes(tried.actions, tried.points[:4], tried.places[:4]).estimates()
    for name in Estimates.__dataclass_fields__:
        np.testing.assert_allclose(getattr(fewest, name), getattr(first, name), atol=1e-12)
    assert position.evaluate(deals=1).standard_errors.max() == np.inf


def test_large_weights_and_priors_do_not_overflow() -> None:
    points, actions = np.array([[5.0, 1.0], [3.0, 0.0]]), np.array([7, 9], np.uint16)
    outcomes = Outcomes(actions, points, np.ones((2, 2)))
    large = outcomes.estimates([1.5e308, 0.5e308])
    assert same(large, outcomes.estimates([3, 1]))
    np.testing.assert_allclose(large.points, [4.5, 0.75])
    np.testing.assert_array_equal(large.improved([1e308, 1e308]), large.improved([0.5, 0.5]))


def test_weights_of_deals() -> None:
    position = busy_position()
    hands, tried = position.sample(40, seed=2), position.outcomes(40, seed=2)
    # Deals in which the seat on the left holds a joker, and no others.
    likely = hands[:, (position.seat + 1) % 4, -1] > 0
    assert 2 < likely.sum() < 38
    found = position.evaluate(deals=40, seed=2, weights=3.0 * likely)
    kept = Outcomes(tried.actions, tried.points[likely], tried.places[likely]).estimates()
    for name in ("points", "standard_errors", "gains", "gain_errors", "places"):
        np.testing.assert_allclose(getattr(found, name), getattr(kept, name), err_msg=name)
    for wrong in (np.ones(39), np.zeros(40), np.full(40, np.nan), [-1.0, *np.ones(39)]):
        with pytest.raises(ValueError, match="a finite number of 0 or more for each of the 40 deals"):
            tried.estimates(wrong)


def test_likelihoods_of_deals() -> None:
    position = busy_position()
    logs = position.log_likelihoods(60, seed=2)
    assert logs.shape == (60,)
    assert (logs <= 0).all()
    assert np.ptp(logs) > 0.1
    np.testing.assert_array_equal(logs[:40], position.log_likelihoods(40, seed=2))
    even, found = position.evaluate(deals=60, seed=2), position.evaluate(deals=60, seed=2, weights=np.exp(logs - logs.max()))
    assert not np.allclose(even.points, found.points)
    with pytest.raises(ChefsHatError, match="only a network for these rules"):
        position.log_likelihoods(4, "greedy")


def test_worlds_played_on() -> None:
    # The deals of a position as games of their own, with the cards of all seats.
    position = busy_position()
    tried = position.outcomes(16, agent="greedy", seed=3)
    compared = 0
    with VectorEnv(games=16, starts=position.starts(16, seed=3), rules=position.rules, episode="game", seed=1) as worlds:
        states = worlds.save()
        for column, action in enumerate(position.legal_actions):
            ended = worlds.step(np.full(16, action)).totals.shifts
            points, places = search.play_on(worlds.save(), "greedy")
            assert np.array_equal(np.sort(places), np.tile(np.arange(1, 5), (16, 1)))
            if ended == worlds.restore(np.arange(16), states).totals.shifts and not compared:
                # `greedy` draws no random numbers, so it plays alike here and there.
                assert (points[:, position.seat] == tried.points[:, column]).all()
                compared += 1
    assert compared
    mixed: list[search.Agent] = ["random", "greedy", "trained", NETWORK / "table-actions.safetensors"]
    one, again = (search.play_on(states, mixed, seed=7, threads=threads) for threads in (1, 0))
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one[0], search.play_on(states, mixed, seed=8)[0])
    assert search.play_on([], "greedy")[0].shape == (0, 0)
    with pytest.raises(ChefsHatError, match="there is no agent"):
        search.play_on(states, "Greedy")
    with pytest.raises(ChefsHatError, match="3 agents for 4 seats"):
        search.play_on(states, ["greedy"] * 3)
    with pytest.raises(ChefsHatError, match="not a state of a game"):
        search.play_on([b"nothing"])
    with VectorEnv(rules={"faces": 10}) as other, pytest.raises(ChefsHatError, match="the same numbers of players, faces"):
        search.play_on([states[0], *other.save()])


def test_what_an_agent_would_do() -> None:
    pytest.importorskip("safetensors")
    from chefshat.learn import network

    trained = network.load("trained")
    with VectorEnv(games=30, seed=5) as env:
        for _ in range(40):
            states = env.save(env.batch.games)
            assert (search.choose(states, "trained") == trained.actions_of(env.batch)).all()
            drawn = search.choose(states, "random", seed=1)
            assert env.batch.masks[np.arange(30), drawn].all()
            assert (drawn == search.choose(states, "random", seed=1)).all()
            env.step(search.choose(states, "greedy"))
        assert (drawn != search.choose(states, "random", seed=2)).any()
        with pytest.raises(ChefsHatError, match="there is no agent"):
            search.choose(states, "clever")
    assert search.choose([]).shape == (0,)


def test_leaves_are_the_next_decisions(monkeypatch: pytest.MonkeyPatch) -> None:
    position = busy_position()
    seen = []

    def half(batch: chefshat.Batch) -> NDArray[np.float64]:
        assert (batch.seats == position.seat).all()
        seen.append(batch.observations.hands.sum())
        return np.full(len(batch), 2.5)

    found = position.outcomes(12, leaf=half, seed=4)
    valued = np.isnan(found.places)
    assert valued.any()
    assert (found.points[valued] == 2.5).all()
    assert (position.evaluate(deals=12, leaf=half, seed=4).points == found.points.mean(axis=0)).all()
    # Who plays its last card has no further decision, and a place in all deals.
    last = next(
        position for env, position in positions(2) if env.batch.observations.hands.sum() == 1 and len(position.legal_actions) > 1
    )
    asked = len(seen)
    left = last.outcomes(5, leaf=half, actions=last.legal_actions[:1].tolist())
    assert len(seen) == asked
    assert (left.places == left.places[0, 0]).all()
    assert (left.points == last.rules.points[int(left.places[0, 0]) - 1]).all()
    # In parts, on any number of threads: the random choices are those of each deal.
    options: dict[str, Any] = {"agent": "random", "leaf": lambda batch: batch.observations.cards_left.sum(axis=1), "seed": 4}
    whole = position.outcomes(12, **options)
    assert len(np.unique(whole.points)) > 3
    monkeypatch.setattr(search, "_LEAF_GAMES", 5)
    in_parts = position.outcomes(12, threads=1, **options)
    np.testing.assert_array_equal(in_parts.points, whole.points)
    for wrong in (lambda batch: np.zeros(len(batch) + 1), lambda batch: np.full(len(batch), np.nan)):
        with pytest.raises(ValueError, match="leaf has to return a finite number"):
            position.outcomes(2, leaf=wrong)


def test_a_prior_shares_the_rollouts() -> None:
    position = busy_position(8)
    legal = position.legal_actions
    prior = np.linspace(1, 2, len(legal))
    found = position.evaluate(400, prior=prior, considered=4, seed=1)
    tried = found.rollouts > 0
    assert (found.actions == legal).all()
    assert (tried == (prior > prior[-5])).all()
    assert np.isnan(found.points[~tried]).all()
    assert 380 <= found.rollouts.sum() <= 400
    # The likeliest stays and is what gains refer to.
    assert (found.rollouts[-1], found.gains[-1], found.gain_errors[-1]) == (found.rollouts.max(), 0, 0)
    assert (found.rollouts == found.rollouts.max()).sum() == 2
    assert found.best in legal[found.rollouts == found.rollouts.max()]
    # The deals are those of an evaluation of all.
    most = int(found.rollouts.max())
    same_deals = position.evaluate(deals=most, actions=[int(legal[-1])], seed=1)
    assert same_deals.points[0] == pytest.approx(found.points[-1])
    improved = found.improved(prior)
    assert improved.sum() == pytest.approx(1)
    assert (improved > 0).all()
    assert improved[np.nanargmax(found.points)] > prior[np.nanargmax(found.points)] / prior.sum()
    # A budget is only exceeded for the first 4 deals. What they leave of it is for the actions that stay.
    for rollouts, counts in ((4, [4] * 8), (33, [4] * 8), (34, [5, 5, *[4] * 6]), (35, [5, 5, *[4] * 6])):
        few = position.evaluate(rollouts, prior=prior, considered=8, seed=1)
        assert sorted(few.rollouts.tolist(), reverse=True)[:8] == counts
    certain = np.eye(len(legal))[2]
    assert (position.evaluate(40, prior=certain).improved(certain) == certain).all()
    zeros = np.zeros(3)
    flat = Estimates(np.arange(3, dtype=np.uint16), zeros, zeros, zeros, zeros, zeros, np.array([4, 4, 0], np.uint64))
    np.testing.assert_allclose(flat.improved([0.5, 0.25, 0.25]), [0.5, 0.25, 0.25])
    for wrong in (prior[1:], -prior, np.zeros(len(legal))):
        with pytest.raises(ValueError, match="give the probability of each"):
            position.evaluate(40, prior=wrong)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"deals": 4, "rollouts": 4}, "deals is a budget of its own"),
        ({"deals": 0}, r"the number of deals is 1\.\.=100000, not 0"),
        ({"rollouts": 4, "seed": -1}, r"a seed is 0\.\.="),
        ({"rollouts": 4, "weights": [1, 1]}, "weights and leaf need deals"),
        ({"time_ms": 4, "prior": [1.0]}, "leave out time_ms and halving"),
        ({"rollouts": 100_001, "prior": [1.0]}, r"rollouts with a prior is 1\.\.=100000, not 100001"),
    ],
)
def test_budgets_that_contradict(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        busy_position().evaluate(**options)


@pytest.mark.parametrize("threads", [-1, 257])
def test_threads_have_a_limit(threads: int) -> None:
    position = busy_position()
    for call in (
        lambda: position.evaluate(8, threads=threads),
        lambda: position.evaluate(deals=8, threads=threads),
        lambda: position.outcomes(8, threads=threads),
        lambda: search.play_on([], threads=threads),
    ):
        with pytest.raises(ValueError, match=rf"threads is 0\.\.=256, not {threads}"):
            call()


@pytest.mark.parametrize("halving", [False, True])
def test_a_number_of_rollouts_is_not_exceeded(halving: bool) -> None:
    position = busy_position()
    actions = len(position.legal_actions)
    for budget in (4 * actions, 5 * actions - 1, 400, 2000):
        found = position.evaluate(budget, halving=halving, threads=1)
        assert budget - actions < found.rollouts.sum() <= budget
    # Every action is tried in 4 deals.
    assert (position.evaluate(1, halving=halving).rollouts == 4).all()


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="pins threads to a core")
def test_a_budget_in_time_is_time_of_the_processor() -> None:
    """Not of a clock: another program takes half of the core."""

    def own_ns() -> int:
        return int(Path("/proc/thread-self/schedstat").read_text().split()[0])

    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        if not (start := own_ns()):
            pytest.skip("this system does not count it")
        busy_position().evaluate(time_ms=400, threads=1)
        # It is known to a few milliseconds.
        assert own_ns() - start > 350_000_000
    finally:
        busy.kill()
        busy.wait()
        os.sched_setaffinity(0, before)


def calls_of_signals(call: Callable[[], object]) -> int:
    """Returns how often Python looked for signals during a call, of those that came every 5 ms."""
    looked = 0

    def look(*_: object) -> None:
        nonlocal looked
        looked += 1

    before = signal.signal(signal.SIGALRM, look)
    signal.setitimer(signal.ITIMER_REAL, 0.005, 0.005)
    try:
        call()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    return looked


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs signals of a timer")
def test_ctrl_c_interrupts_long_calls() -> None:
    # The engine itself, without the loops in Python around it.
    with VectorEnv(history=HISTORY, seed=3) as env:
        state = env.save()[0]
    native = search.position(state)._native

    def refused() -> None:
        with pytest.raises(ChefsHatError, match="not a state of a game"):
            search.choose([state] * 60_000 + [b"other"])

    for call in (
        lambda: native.sample(60_000, 1),
        lambda: native.starts(30_000, 1),
        lambda: native.expected_hands(300_000, 1),
        refused,
    ):
        # One before the call, and one after it, do not count.
        assert calls_of_signals(call) > 3


def test_wrong_arguments_are_named() -> None:
    position = busy_position()
    with VectorEnv(games=2, seed=1) as env:
        states = env.save()
    calls: list[tuple[str, Callable[[], object]]] = [
        (f"an agent is .*, not a {kind}", partial(call, agent=agent))
        for kind, agent in (("NoneType", None), ("ndarray", np.zeros(2)), ("Network", network.load("trained")))
        for call in (
            partial(position.evaluate, 8),
            partial(position.evaluate, deals=8),
            partial(search.choose, states),
            partial(search.play_on, states),
        )
    ]
    wrong: Any = None
    calls += [
        ("a position is that of an environment.*, not of a NoneType", partial(search.position, wrong)),
        ("the number of deals is a whole number, not 10.5", partial(position.sample, 10.5)),  # type: ignore[arg-type]
        ("a seed is a whole number, not 1.5", partial(position.evaluate, 8, seed=1.5)),  # type: ignore[arg-type]
        ("a seed is a whole number, not 1.5", partial(search.choose, states, seed=1.5)),  # type: ignore[arg-type]
        ("rollouts", partial(position.evaluate, 8.5)),  # type: ignore[arg-type]
        ("rollouts with a prior", partial(position.evaluate, 8.5, prior=[1.0] * len(position.legal_actions))),  # type: ignore[arg-type]
    ]
    for words, call in calls:
        with pytest.raises(TypeError, match=words):
            call()
    action = int(position.legal_actions[0])
    for actions in (action, [float(action)], [[action]]):
        with pytest.raises(ChefsHatError, match="give a list of at least one action"):
            position.evaluate(8, actions=actions)  # type: ignore[arg-type]
