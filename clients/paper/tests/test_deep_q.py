"""The Deep Q agent: limits of its parameters, learning, and independence of agents in a stack."""

import dataclasses
from typing import Any

import jax
import numpy as np
import pytest

from chefshat_paper.learn import deep_q
from chefshat_paper.learn.deep_q import Agents, DeepQConfig, Transitions

# A network and memory as small as the problems below.
TINY = DeepQConfig(inputs=4, outputs=3, hidden=(16,), batch_size=8, memory_size=64, learning_rate=0.01, target_every=10)


def transitions(config: DeepQConfig, rows: int, seed: int) -> Transitions:
    """Random transitions."""
    chance = np.random.default_rng(seed)
    made: dict[str, Any] = {
        "states": chance.random((rows, config.inputs), np.float32),
        "actions": chance.integers(0, config.outputs, rows).astype(np.int32),
        "rewards": chance.uniform(-1, 1, rows).astype(np.float32),
        "next_states": chance.random((rows, config.inputs), np.float32),
        "next_masks": chance.random((rows, config.outputs)) < 0.8,
        "done": chance.random(rows) < 0.2,
    }
    return Transitions(**made)


def row(of: Transitions, number: int) -> Transitions:
    """Returns one row."""
    return Transitions(*(array[number : number + 1] for array in of))


def ids(*numbers: int) -> Any:
    return np.array(numbers, np.int32)


def plain(agents: Agents) -> Agents:
    """Converts keys for numpy."""
    return agents._replace(keys=jax.random.key_data(agents.keys))


def same(one: Agents, other: Agents) -> bool:
    """Returns whether all numbers are bitwise equal."""
    pairs = zip(jax.tree.leaves(plain(one)), jax.tree.leaves(plain(other)), strict=True)
    return all(np.array_equal(np.asarray(left), np.asarray(right)) for left, right in pairs)


def assert_close(one: Agents, other: Agents) -> None:
    """Checks that all numbers are equal but for the order of additions, which the size of a stack may change."""
    jax.tree.map(lambda left, right: np.testing.assert_allclose(left, right, rtol=0, atol=1e-5), plain(one), plain(other))


def values(config: DeepQConfig, agents: Agents, state: list[float]) -> np.ndarray[Any, Any]:
    """Returns the action values of each agent."""
    seen = np.array([state], np.float32)
    return np.stack(
        [
            np.tanh(
                deep_q.outputs(config, jax.tree.map(lambda leaf, at=agent: leaf[at], agents.online), jax.numpy.asarray(seen))[0]
            )
            for agent in range(len(agents.epsilon))
        ]
    )


def test_the_default_parameters_are_those_of_the_paper() -> None:
    config = DeepQConfig()
    assert (config.inputs, config.hidden, config.outputs) == (228, (128, 256), 200)
    assert (config.batch_size, config.memory_size, config.discount, config.learning_rate) == (32, 2000, 0.95, 0.001)
    assert (config.epsilon_start, config.epsilon_decay, config.epsilon_end) == (1.0, 0.995, 0.1)
    agents = deep_q.start(config, [1])
    assert [layer["kernel"].shape for layer in agents.online.values()] == [(1, 228, 128), (1, 128, 256), (1, 256, 200)]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"batch_size": 0}, "batch_size must be 1..=4,096, not 0"),
        ({"memory_size": 31}, "memory_size must be 32..=1,000,000, not 31"),
        ({"discount": 1.5}, "discount must be 0.0..=1.0, not 1.5"),
        ({"learning_rate": 0.0}, "learning_rate must be"),
        ({"hidden": ()}, "the number of hidden layers must be 1..=8, not 0"),
        ({"hidden": (0,)}, "hidden must be 1..=4,096, not 0"),
        ({"target_every": 0}, "target_every must be"),
        ({"inputs": 200, "see_mask": False}, "without see_mask"),
    ],
)
def test_parameters_out_of_range_are_refused(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message.split(",")[0].replace("(", r"\(")):
        dataclasses.replace(DeepQConfig(), **changed)


def test_a_bandit_is_learned() -> None:
    """The state determines which of three arms pays; every pull is an episode."""
    config = dataclasses.replace(TINY, epsilon_decay=0.99)
    agents = deep_q.start(config, [1, 2, 3])
    chance = np.random.default_rng(0)
    everything = np.ones((3, 3), np.bool_)
    for _ in range(400):
        arm = chance.integers(0, 3, 3)
        states: Any = np.eye(4, dtype=np.float32)[arm]
        keys, actions = deep_q.act(config, agents, ids(0, 1, 2), states, jax.numpy.asarray(everything), ids(0, 0, 0))
        rewards: Any = np.where(np.asarray(actions) == arm, 1, -1).astype(np.float32)
        over: Any = np.ones(3, np.bool_)
        agents = deep_q.learn(
            config,
            agents._replace(keys=keys),
            ids(0, 1, 2),
            Transitions(states, actions, rewards, states, jax.numpy.asarray(everything), over),
        )
    for wanted in range(3):
        learned = values(config, agents, np.eye(4)[wanted].tolist())
        assert learned.argmax(axis=1).tolist() == [wanted] * 3
        assert learned[:, wanted].min() > 0.8


@pytest.mark.parametrize("double", [False, True])
def test_values_of_a_chain_are_discounted_from_its_end(double: bool) -> None:
    """A chain of three states; only leaving the last one by action 1 pays. The value halves with each step before it."""
    config = dataclasses.replace(TINY, discount=0.5, double=double)
    agents = deep_q.start(config, [5])
    steps = [(place, action) for place in range(3) for action in range(3)]
    for number in range(1200):
        place, action = steps[number % len(steps)]
        onward = action == 1
        last = onward and place == 2
        made: dict[str, Any] = {
            "states": np.eye(4, dtype=np.float32)[[place]],
            "actions": np.array([action], np.int32),
            "rewards": np.array([0.8 if last else 0.0], np.float32),
            "next_states": np.eye(4, dtype=np.float32)[[min(place + onward, 3)]],
            "next_masks": np.ones((1, 3), np.bool_),
            "done": np.array([last]),
        }
        agents = deep_q.learn(config, agents, ids(0), Transitions(**made))
    best = [values(config, agents, np.eye(4)[place].tolist())[0].max() for place in range(3)]
    assert best == pytest.approx([0.2, 0.4, 0.8], abs=0.05)


def test_with_a_mask_the_next_value_is_that_of_a_legal_action() -> None:
    """The best action of the next state is worth 0.9, the only legal one -0.6: the previous action is worth half of the latter."""
    made: dict[str, Any] = {
        "states": np.eye(4, dtype=np.float32)[[0, 1, 1]],
        "actions": np.array([0, 0, 1], np.int32),
        "rewards": np.array([0, 0.9, -0.6], np.float32),
        "next_states": np.eye(4, dtype=np.float32)[[1, 3, 3]],
        "next_masks": np.array([[False, True, False]] * 3),
        "done": np.array([False, True, True]),
    }
    for mask, expected in ((True, -0.3), (False, 0.45)):
        config = dataclasses.replace(TINY, discount=0.5, mask=mask)
        agents = deep_q.start(config, [5])
        for number in range(1200):
            agents = deep_q.learn(config, agents, ids(0), row(Transitions(**made), number % 3))
        assert values(config, agents, [1, 0, 0, 0])[0, 0] == pytest.approx(expected, abs=0.05)


def test_with_a_mask_all_actions_are_legal() -> None:
    config = dataclasses.replace(TINY, mask=True)
    masks: Any = np.array([[False, True, True], [True, False, False]])
    states: Any = np.ones((2, 4), np.float32)
    for epsilon in (0.0, 1.0):
        agents = deep_q.start(dataclasses.replace(config, epsilon_start=epsilon), [1, 2])
        seen: list[set[int]] = [set(), set()]
        for _ in range(60):
            keys, actions = deep_q.act(config, agents, ids(0, 1), states, masks, ids(0, 0))
            agents = agents._replace(keys=keys)
            for agent in range(2):
                seen[agent].add(int(actions[agent]))
        assert seen[1] == {0}
        assert seen[0] == {1, 2} if epsilon else len(seen[0]) == 1 and 0 not in seen[0]


def test_without_a_mask_exploration_reaches_every_action() -> None:
    agents = deep_q.start(TINY, [1])
    nothing: Any = np.zeros((1, 3), np.bool_)
    states: Any = np.ones((1, 4), np.float32)
    seen = set()
    for _ in range(60):
        keys, actions = deep_q.act(TINY, agents, ids(0), states, nothing, ids(0))
        agents = agents._replace(keys=keys)
        seen.add(int(actions[0]))
    assert seen == {0, 1, 2}


def test_after_too_many_wrong_actions_a_legal_one_is_taken() -> None:
    config = dataclasses.replace(TINY, epsilon_start=0.0, wrong_limit=3)
    agents = deep_q.start(config, [1, 1])
    masks: Any = np.array([[True, False, True]] * 2)
    states: Any = np.ones((2, 4), np.float32)
    seen: list[set[int]] = [set(), set()]
    for _ in range(40):
        keys, actions = deep_q.act(config, agents, ids(0, 1), states, masks, ids(2, 3))
        agents = agents._replace(keys=keys)
        for agent in range(2):
            seen[agent].add(int(actions[agent]))
    assert len(seen[0]) == 1
    assert seen[1] == {0, 2}


def test_epsilon_decays_with_every_update_and_stops() -> None:
    config = dataclasses.replace(TINY, epsilon_decay=0.9, epsilon_end=0.5)
    agents = deep_q.start(config, [1])
    seen = []
    for number in range(20):
        agents = deep_q.learn(config, agents, ids(0), transitions(config, 1, number))
        seen.append(float(agents.epsilon[0]))
    # Seven transitions are fewer than a batch.
    assert seen[:7] == [1.0] * 7
    assert seen[7:14] == pytest.approx([0.9, 0.81, 0.729, 0.6561, 0.59049, 0.531441, 0.5])
    assert seen[14:] == [0.5] * 6
    assert int(agents.updates[0]) == 13


def test_the_target_network_is_updated_periodically() -> None:
    agents = deep_q.start(TINY, [1])
    online = []
    for number in range(8 + 24):
        agents = deep_q.learn(TINY, agents, ids(0), transitions(TINY, 1, number))
        online.append(np.asarray(agents.online["Dense_0"]["kernel"]))
    updates = int(agents.updates[0])
    assert updates == 25
    # The 20th update was the 27th transition.
    assert np.array_equal(np.asarray(agents.target["Dense_0"]["kernel"]), online[26])
    assert not np.array_equal(online[26], online[-1])


def test_the_memory_forgets_the_oldest_first() -> None:
    config = dataclasses.replace(TINY, memory_size=8)
    agents = deep_q.start(config, [1])
    for number in range(11):
        batch = transitions(config, 1, number)._replace(rewards=jax.numpy.array([float(number)]))
        agents = deep_q.learn(config, agents, ids(0), batch)
    assert np.asarray(agents.memory.rewards[0]).tolist() == [8, 9, 10, 3, 4, 5, 6, 7]
    assert int(agents.remembered[0]) == 11


def test_agents_that_do_not_exist_are_ignored() -> None:
    batch = transitions(TINY, 2, 0)
    agents, alone = deep_q.start(TINY, [1]), deep_q.start(TINY, [1])
    for _ in range(12):
        agents = deep_q.learn(TINY, agents, ids(0, 1), batch)
        alone = deep_q.learn(TINY, alone, ids(0), row(batch, 0))
    assert int(agents.updates[0]) == 5
    assert_close(agents, alone)


def test_agents_in_a_stack_learn_the_same_as_alone() -> None:
    seeds, steps = [3, 1, 4, 1], 30
    nobody = len(seeds)
    stack = deep_q.start(TINY, seeds)
    alone = [deep_q.start(TINY, [seed]) for seed in seeds]
    for step in range(steps):
        # Not every agent learns in every step.
        busy = [agent if (step + agent) % 3 else nobody for agent in range(nobody)]
        batch = transitions(TINY, len(busy), step)
        stack = deep_q.learn(TINY, stack, ids(*busy), batch)
        keys, actions = deep_q.act(TINY, stack, ids(*busy), batch.states, batch.next_masks, ids(0, 0, 0, 0))
        stack = stack._replace(keys=keys)
        for agent in set(busy) - {nobody}:
            here = row(batch, agent)
            one = deep_q.learn(TINY, alone[agent], ids(0), here)
            keys, action = deep_q.act(TINY, one, ids(0), here.states, here.next_masks, ids(0))
            alone[agent] = one._replace(keys=keys)
            assert int(action[0]) == int(actions[agent])
    for agent, one in enumerate(alone):
        assert int(one.updates[0]) == 13
        assert_close(jax.tree.map(lambda leaf, at=agent: leaf[at : at + 1], plain(stack)), plain(one))


def test_the_same_seed_learns_the_same() -> None:
    first, second = deep_q.start(TINY, [7]), deep_q.start(TINY, [7])
    other = deep_q.start(TINY, [8])
    for number in range(20):
        batch = transitions(TINY, 1, number)
        first, second, other = (deep_q.learn(TINY, agents, ids(0), batch) for agents in (first, second, other))
    assert same(first, second)
    assert not same(first, other)


def test_an_agent_that_does_not_see_the_mask_ignores_it() -> None:
    config = dataclasses.replace(TINY, see_mask=False)
    agents = deep_q.start(config, [1])
    assert values(config, agents, [0.5, 0, 0, 0]).tolist() == values(config, agents, [0.5, 1, 0, 1]).tolist()
    assert values(config, agents, [0.5, 0, 0, 0]).tolist() != values(config, agents, [0.2, 0, 0, 0]).tolist()


def test_agents_start_with_given_networks() -> None:
    agents = deep_q.start(TINY, [1, 2])
    for number in range(12):
        agents = deep_q.learn(TINY, agents, ids(0, 1), transitions(TINY, 2, number))
    fresh = deep_q.start_from(TINY, agents.online, [3, 4])
    assert np.array_equal(np.asarray(fresh.online["Dense_0"]["kernel"]), np.asarray(agents.online["Dense_0"]["kernel"]))
    assert np.asarray(fresh.epsilon).tolist() == [1.0, 1.0]
    assert np.asarray(fresh.remembered).tolist() == [0, 0]
    # Learning does not consume the initial networks.
    deep_q.learn(TINY, fresh, ids(0, 1), transitions(TINY, 2, 0))
    assert np.isfinite(np.asarray(agents.online["Dense_0"]["kernel"])).all()
    with pytest.raises(ValueError, match="2 networks and 1 seeds"):
        deep_q.start_from(TINY, agents.online, [3])


def test_without_seeds_there_are_no_agents() -> None:
    with pytest.raises(ValueError, match="no seeds"):
        deep_q.start(TINY, [])
