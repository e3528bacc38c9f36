"""Experiments 2 and 3: statistics from the server's counts, and the initial networks of Experiment 3."""

import dataclasses
import importlib.metadata
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from chefshat import ServerAddress, pb
from chefshat.columns import Sizes
from chefshat.transitions import Transitions, situations

from chefshat_paper.experiments import baselines, learning, rules, stats, winning
from chefshat_paper.experiments.learning import Counts, Learned
from chefshat_paper.experiments.progress import Progress
from chefshat_paper.experiments.results import Config
from chefshat_paper.experiments.winning import Condition
from chefshat_paper.learn import deep_q, deep_q_training
from chefshat_paper.learn.deep_q import DeepQConfig
from chefshat_paper.learn.deep_q_training import Played

AGENT = DeepQConfig(hidden=(4,), batch_size=2, memory_size=4)


def learned(places: list[list[list[int]]]) -> Learned:
    """Made-up figures: the places of each seat in each Shift of each game, and matching counts."""
    array = np.array(places)
    ones = np.ones_like(array)
    of_seats: dict[str, Any] = {
        "places": array,
        "valid": 10 * ones,
        "wrong": 10 * (array - 1),
        "passes": 5 * ones,
        "reward_sums": array.astype(np.float32),
    }
    of_shifts: dict[str, Any] = {"starters": np.zeros(array.shape[:2], np.int64), "turns": 40 * np.ones(array.shape[:2])}
    return Learned(Played(of_shifts, of_seats, pb.RuleSet(), 7), deep_q.start(AGENT, [1]))


# Two games of three Shifts. The starter is always seat 0.
SOME = learned([[[1, 2, 3, 4], [2, 1, 3, 4], [1, 2, 4, 3]], [[4, 1, 2, 3], [4, 2, 1, 3], [1, 2, 3, 4]]])


def test_statistics_follow_from_places_and_counts() -> None:
    assert SOME.wins(0) == [2, 1]
    assert SOME.wins(1) == [1, 1]
    assert SOME.starter_wins() == pytest.approx([2 / 3, 1 / 3])
    # An action's mean reward is place / (10 valid + 10 (place - 1) wrong ones): the same in every Shift.
    assert SOME.mean_reward(0) == pytest.approx([0.1, 0.1])
    assert SOME.mean_wrong(0) == pytest.approx([10 / 3, 20])
    assert SOME.mean_wrong(0, slice(-1, None)) == [0, 0]
    assert SOME.share_of_turns("passes", 3) == [0.5, 0.5]


def test_the_tables_have_the_counts(tmp_path: Path) -> None:
    config = Config(ServerAddress(""), (1, 2), True, tmp_path)
    both = {"learner": SOME, "other": Counts(SOME.played)}
    learner, other = rules._actions(config, both).rows[1:]
    assert learner[:2] == ["learner", stats.spread([10 / 3, 20])]
    assert other[:2] == ["other", stats.clustered([10 / 3, 20])]
    victories = rules._victories(config, both).rows
    assert [row[0] for row in victories[1:]] == list(both)
    assert victories[1][1:3] == [stats.spread([2, 1]), stats.spread([1, 1])]
    one = Condition("random", "paper", four=False)
    four = dataclasses.replace(one, four=True)
    others = {each: Counts(SOME.played) for each in (one, four)}
    table = winning._four(config, dict.fromkeys(winning.FOUR, SOME), others)
    assert table.rows[0][1:7] == [117, 45, 55, 33, 117, 33]
    # The best seat wins two Shifts with one seed and one with the other; the last seat wins none.
    assert table.rows[1][5:7] == [stats.spread([2, 1]), stats.spread([0, 0])]
    assert table.rows[-1][0] == "random"
    assert table.rows[-1][5] == stats.clustered([2, 1])
    assert [row[:2] for row in winning._behaviour(config, {}, others).rows] == [["one", "random"], ["four", "random"]]


def test_agents_that_do_not_learn_choose_as_they_say() -> None:
    # Four actions of a turn; the last is passing.
    masks = np.array([[True, False, True, True], [True, True, True, False], [False, False, False, True]])
    for draw, wanted in ((0.0, [0, 0, 3]), (0.5, [2, 1, 3]), (0.99, [3, 2, 3])):
        assert baselines.random(masks, np.full(3, draw)).tolist() == wanted
    for draw, wanted in ((0.0, [0, 0, 3]), (0.99, [2, 2, 3])):
        assert baselines.never_idle(masks, np.full(3, draw)).tolist() == wanted
    assert baselines.last_play(masks, np.zeros(3)).tolist() == [2, 2, 3]


def test_greedy_plays_the_highest_face_without_jokers_first() -> None:
    def index(face: int, cards: int, jokers: int) -> int:
        return 3 * (face * (face - 1) // 2 + cards - 1) + jokers

    lone_joker, idle = 198, 199
    order = [index(11, 3, 0), index(11, 2, 0), index(10, 9, 0), index(11, 2, 1), lone_joker, index(11, 9, 2), idle]
    masks = np.zeros((len(order), 200), np.bool_)
    for row in range(len(order)):
        masks[row, order[row:]] = True
    assert baselines.greedy(masks, np.zeros(len(order))).tolist() == order


def test_the_rewards_of_the_papers_program() -> None:
    sizes = Sizes(players=4, faces=11, jokers=2, hand_size=17, num_actions=214, turn_actions=200)
    #        a play, an idle pass, a forced pass, a wrong action, the first place, another place
    actions = np.array([3, 199, 199, 9, 3, 3], np.uint16)
    masks = np.zeros((6, 200), np.bool_)
    masks[:, 199] = True
    masks[[0, 1, 3, 4, 5], 3] = True
    hands = np.zeros((6, 12), np.uint8)
    hands[0, 0] = 12
    before = {"mask_bits": np.packbits(np.pad(masks, ((0, 0), (0, 14))), axis=1, bitorder="little")}
    columns = {
        "actions": actions,
        "invalid": np.array([0, 0, 0, 1, 0, 0], np.bool_),
        "ended": np.array([0, 0, 0, 0, 1, 1], np.bool_),
        "places_taken": np.array([0, 0, 0, 0, 1, 2], np.uint8),
    }
    transitions = Transitions.of(6, sizes, columns)
    transitions.before = situations(6, sizes, before)
    transitions.after = situations(6, sizes, {"hands": hands})
    assert winning.program_rewards(transitions) == pytest.approx([0.7 * 5 / 17, -0.5, 0.01, -1, 1, -0.01])


def test_an_idle_pass_can_count_as_illegal() -> None:
    masks = np.array([[False, True, True], [False, False, True], [True, False, False]])
    right = deep_q_training.without_idle_passes(masks)
    assert right.tolist() == [[False, True, False], [False, False, True], [True, False, False]]
    # The first pass is sent as an illegal action; for the second only passing is legal; the third was illegal already.
    assert deep_q_training._wrong_as_illegal(np.array([2, 2, 2], np.int32), right).tolist() == [0, 2, 1]
    assert deep_q_training._wrong_as_illegal(np.array([1, 2, 0], np.int32), right).tolist() == [1, 2, 0]


def never(*_: object, **__: object) -> Learned:
    raise AssertionError("learned again")


@pytest.mark.slow
@pytest.mark.server
def test_experiment_3_begins_with_the_networks_of_2(real_address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quiet = Progress(show=False)
    both = rules.networks(Config(ServerAddress(real_address), (1, 2), True, tmp_path), quiet)
    files = sorted(path.name for path in tmp_path.iterdir())
    assert files == ["rules-quick-seed-1.safetensors", "rules-quick-seed-2.safetensors"]
    with monkeypatch.context() as patched:
        patched.setattr(learning, "learn", never)
        again = rules.networks(Config(ServerAddress(real_address), (1, 2), True, tmp_path), quiet)
    # A seed gives the same result alone and beside another, but for the order in which this machine adds.
    (tmp_path / "alone").mkdir()
    alone = rules.networks(Config(ServerAddress(real_address), (2,), True, tmp_path / "alone"), quiet)
    jax.tree.map(np.testing.assert_array_equal, both, again)
    jax.tree.map(lambda first, third: np.testing.assert_allclose(first[1], third[0], rtol=0, atol=1e-5), both, alone)


@pytest.mark.server
def test_networks_of_other_settings_are_learned_again(real_address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = Config(ServerAddress(real_address), (1, 2), True, tmp_path)
    ruleset = pb.RuleSet(players=4, faces=11, jokers=2)
    made = rules.CONDITIONS[rules.FIRST].agent
    agents = deep_q.start(made, quick.seeds)
    rules._keep(quick, Learned(Played({}, {}, ruleset, 0), agents))
    monkeypatch.setattr(learning, "learn", never)
    loaded = rules.networks(quick, Progress(show=False))
    jax.tree.map(np.testing.assert_array_equal, loaded, agents.online)

    def is_learned_again(config: Config = quick) -> bool:
        with pytest.raises(AssertionError, match="learned again"):
            rules.networks(config, Progress(show=False))
        return True

    full = dataclasses.replace(quick, quick=False)
    assert is_learned_again(full)
    # A quick run and a full one leave the networks of each other.
    others = deep_q.start(made, (3, 4))
    rules._keep(full, Learned(Played({}, {}, ruleset, 0), others))
    for config, expected in ((quick, agents), (full, others)):
        jax.tree.map(np.testing.assert_array_equal, rules.networks(config, Progress(show=False)), expected.online)
    assert is_learned_again(dataclasses.replace(quick, seeds=(1, 3)))
    for where, name, value in (
        (learning, "QUICK_SHIFTS", learning.QUICK_SHIFTS + 1),
        (learning, "OPPONENTS", "random"),
        (rules, "REWARDS", "paper"),
        (rules, "CONDITIONS", {rules.FIRST: rules.Condition(dataclasses.replace(made, discount=0.9))}),
        (importlib.metadata, "version", lambda package: f"another {package}"),
    ):
        with monkeypatch.context() as patched:
            patched.setattr(where, name, value)
            assert is_learned_again()
