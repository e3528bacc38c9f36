"""One game of Gymnasium or PettingZoo, whose rows the engine reads: every number is that of the columns."""

from typing import Any

import numpy as np
import pytest

from chefshat.batch import Batch, Situation
from chefshat.learn import features
from chefshat.vector import VectorEnv

pytest.importorskip("chefshat_native")
pytest.importorskip("gymnasium")

from chefshat.envs import ChefsHatEnv
from chefshat.envs.observing import Form

#: The observations that the engine computes for a row.
FORMS: Any = {"table": features.table_of, "classic": features.classic_of, None: None}


@pytest.mark.parametrize("rules", [None, {"players": 2, "faces": 4}, {"players": 6, "faces": 12, "jokers": 1}])
def test_rows_are_those_of_the_columns(rules: Any) -> None:
    kinds = ends = 0
    # Special actions, which only the default game is searched for, are rare.
    steps = 300 if rules is None else 250
    for seat in (0, 1):
        with VectorEnv(rules=rules, seed=6, rewards="winning", client_seats=[seat], invalid="ask_again") as env:
            chance = np.random.default_rng(seat)
            env.sample(seat)
            for _ in range(steps):
                action = env.sample() if chance.random() < 0.9 else chance.integers(0, env.num_actions, 1)
                batch = env.step(action)
                found = [(form, ended, batch.first(form, ended=ended)) for form in FORMS for ended in (False, True)]
                assert batch.ended == len(batch.endings)
                for form, ended, seen in found:
                    table = batch.endings if ended else batch
                    if not len(table):
                        assert seen is None
                        continue
                    assert seen is not None
                    compute = FORMS[form]
                    if compute is None:
                        assert seen.observation is None
                    else:
                        np.testing.assert_array_equal(seen.observation, compute(table)[0])
                    np.testing.assert_array_equal(seen.mask, table.masks[0])
                    attempts = batch.attempts[0] if table is batch else 0
                    assert seen[2:] == (table.rewards[0], table.seats[0], table.kinds[0], attempts)
                    kinds |= 1 << seen.kind
                ends += len(batch.endings)
    assert ends > 10
    # Ends, turns and exchanges; in the default game also special actions.
    wanted = 0b1111 if rules is None else 0b0111
    assert kinds & wanted == wanted


def test_a_row_is_read_while_no_column_has_been_used() -> None:
    with VectorEnv(seed=1) as env:
        assert env.batch.first("table", ended=False) is not None
        assert env.batch.first("table", ended=True) is None
        assert len(env.batch.games) == 1
        assert env.batch.first("table", ended=False) is None


class ByColumns(Form):
    """Observations of batches whose columns have been used."""

    def first(self, batch: Batch, *, ended: bool = False) -> Situation:
        assert len(batch.games) == len(batch)
        assert len(batch.endings.games) == batch.ended
        return super().first(batch, ended=ended)


@pytest.mark.parametrize("observation", ["table", "columns", "classic"])
def test_steps_are_those_of_an_environment_without_rows(observation: str, monkeypatch: pytest.MonkeyPatch) -> None:
    options: Any = {"observation": observation, "rewards": "winning", "seed": 8}
    with monkeypatch.context() as patched:
        patched.setattr("chefshat.envs.gymnasium_env.Form", ByColumns)
        plain = ChefsHatEnv(**options)
    env = ChefsHatEnv(**options)
    chance = np.random.default_rng(1)
    same(env.reset(), plain.reset())
    ended = 0
    for _ in range(300):
        action = int(chance.choice(np.flatnonzero(env.action_masks()))) if chance.random() < 0.9 else int(chance.integers(214))
        step, expected = env.step(action), plain.step(action)
        same(step, expected)
        if step[2]:
            ended += 1
            same(env.reset(), plain.reset())
    assert ended > 5


@pytest.mark.parametrize("observation", ["table", "columns", "classic"])
def test_turns_of_all_seats_are_those_of_an_environment_without_rows(observation: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pettingzoo")
    from chefshat.envs import chefshat_v1

    options: Any = {"observation": observation, "rewards": "winning", "invalid_penalty": 0.5, "seed": 8}
    with monkeypatch.context() as patched:
        patched.setattr("chefshat.envs.chefshat_v1.Form", ByColumns)
        plain = chefshat_v1.raw_env(**options)
    env = chefshat_v1.raw_env(**options)
    chance = np.random.default_rng(1)
    ended = 0
    for _ in range(8):
        env.reset()
        plain.reset()
        for agent in env.agent_iter():
            assert agent == plain.agent_selection
            seen, expected = env.last(), plain.last()
            same(seen, expected)
            for other in env.agents:
                same(env.observe(other), plain.observe(other))
            action = None
            if not seen[2]:
                legal = np.flatnonzero(seen[0]["action_mask"])
                action = int(chance.choice(legal)) if chance.random() < 0.9 else int(chance.integers(214))
            ended += seen[2]
            env.step(action)
            plain.step(action)
    assert ended == 8 * 4


def test_rewards_of_a_function_are_not_those_of_the_row() -> None:
    env = ChefsHatEnv(rewards="winning", reward_function=lambda transitions: np.full(len(transitions), 7.0), seed=1)
    env.reset()
    assert env.step(int(env.action_masks().argmax()))[1] == 7


def same(found: Any, expected: Any) -> None:
    """Compares results with their types."""
    assert type(found) is type(expected)
    if isinstance(found, dict):
        assert found.keys() == expected.keys()
        for name in found:
            same(found[name], expected[name])
    elif isinstance(found, tuple):
        for one, other in zip(found, expected, strict=True):
            same(one, other)
    elif isinstance(found, np.ndarray):
        assert found.dtype == expected.dtype
        assert found.flags.writeable == expected.flags.writeable
        np.testing.assert_array_equal(found, expected)
    else:
        assert found == expected
