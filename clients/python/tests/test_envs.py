"""The Gymnasium and PettingZoo environments: the libraries' checkers on the real server, details on the toy server."""

import copy
import io
import pickle
import subprocess
import sys
import warnings
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pettingzoo.test
import pytest
from fake_vector import ACTIONS, FakeVector
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

import chefshat
from chefshat.columns import Situations
from chefshat.envs import ENV_ID, ChefsHatEnv, ChefsHatVectorEnv, chefshat_v1
from chefshat.envs import illegal as illegal_actions
from chefshat.learn import features


def hands(situations: Situations) -> NDArray[np.float32]:
    """A custom observation."""
    return np.asarray(situations.observations.hands, np.float32)


FORMS: list[Any] = ["classic", "table", "columns", hands]
NAMES = ["classic", "table", "columns", "own"]


@pytest.mark.parametrize("episode", ["shift", "game"])
@pytest.mark.parametrize("observation", FORMS, ids=NAMES)
def test_the_gymnasium_checker_passes(anywhere: str | None, observation: Any, episode: str) -> None:
    env = gymnasium.make(ENV_ID, address=anywhere, observation=observation, episode=episode)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The range of a custom function is unknown.
        warnings.filterwarnings("ignore", message=".*A Box observation space m.*imum value is")
        with redirect_stdout(io.StringIO()):
            check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("episode", ["shift", "game"])
@pytest.mark.parametrize("observation", FORMS, ids=NAMES)
def test_the_pettingzoo_checker_passes(anywhere: str | None, observation: Any, episode: str) -> None:
    def make(**options: Any) -> Any:
        return chefshat_v1.env(anywhere, observation=observation, episode=episode, **options)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The checker knows by name which environments have masks in their observations, and does not require arrays of these.
        warnings.filterwarnings("ignore", message="Observation is not a NumPy array")
        warnings.filterwarnings("ignore", message="Observation space for each agent probably should be")
        # A hand may be empty.
        warnings.filterwarnings("ignore", message="Observation numpy array is all zeros")
        pettingzoo.test.api_test(make(), num_cycles=100)
        pettingzoo.test.seed_test(make, num_cycles=100)
        with redirect_stdout(io.StringIO()) as printed:
            pettingzoo.test.render_test(lambda render_mode: make(render_mode=render_mode))
    assert "takes a turn" in printed.getvalue()


@pytest.mark.parametrize("kind", ["gymnasium", "pettingzoo"])
def test_render_without_a_mode_warns_and_shows_nothing(anywhere: str | None, kind: Any) -> None:
    env: Any = chefshat.make(kind, address=anywhere)
    env.reset(seed=1)
    with pytest.warns(UserWarning, match='made with render_mode="ansi" or "human"'):
        assert env.render() is None
    env.close()


def test_a_random_agent_plays_complete_games(anywhere: str | None) -> None:
    env = chefshat.make("gymnasium", address=anywhere, episode="game", rewards="points", render_mode="ansi")
    env.action_space.seed(1)
    _, info = env.reset(seed=1)
    total, ended = 0.0, False
    while not ended:
        shown = env.render()
        assert shown is not None
        assert "board:" in shown
        _, reward, terminated, truncated, info = env.step(env.action_space.sample(info["action_mask"]))
        total += reward
        ended = terminated or truncated
    assert info["place"] in (1, 2, 3, 4)
    assert total == env.vector.batch.endings.observations.points[0, 0]
    assert not info["action_mask"].any()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(0)
    env.close()


def test_the_vector_environment_equals_many_single_ones(anywhere: str | None) -> None:
    games = 3
    options: dict[str, Any] = {"address": anywhere, "opponents": "greedy", "observation": "columns", "rewards": "paper"}
    vector = gymnasium.make_vec(ENV_ID, num_envs=games, **options)
    assert vector.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    observed, infos = vector.reset(seed=11)
    assert isinstance(vector, ChefsHatVectorEnv)
    beginnings = vector.vector.batch.beginnings
    singles = [chefshat.make(**options, seed=[bytes(seed)]) for seed in beginnings.seeds]
    for env in singles:
        env.reset()
    endings = 0
    while True:
        assert observed in vector.observation_space
        actions = infos["action_mask"].argmax(axis=1)
        observed, rewards, terminations, truncations, infos = vector.step(actions)
        if len(vector.vector.batch.beginnings) > 0:
            # A game is over; the next one has another seed.
            break
        for game, env in enumerate(singles):
            alone, reward, terminated, truncated, info = env.step(actions[game])
            assert (reward, terminated, truncated) == (rewards[game], terminations[game], truncations[game])
            if terminated or truncated:
                endings += 1
                assert infos["_final_obs"][game]
                last = infos["final_obs"][game]
                assert {name: array.tolist() for name, array in last.items()} == {
                    name: array.tolist() for name, array in alone.items()
                }
                assert infos["final_info"]["place"][game] == info["place"]
                alone, info = env.reset()
            for name, array in alone.items():
                assert array.tolist() == observed[name][game].tolist()
            assert info["action_mask"].tolist() == infos["action_mask"][game].tolist()
    assert endings >= games
    for env in singles:
        env.close()
    vector.close()


def test_observation_forms(anywhere: str | None) -> None:
    with chefshat.VectorEnv(anywhere, seed=3) as env:
        seen = env.batch
        sizes = env.sizes
        classic = features.classic(seen.observations, seen.mask_bits, faces=sizes.faces, hand_size=sizes.hand_size)
        forms: list[tuple[Any, Any]] = [("classic", classic[0]), (hands, seen.observations.hands[0])]
        for observation, wanted in forms:
            one = chefshat.make(address=anywhere, observation=observation, seat=int(seen.seats[0]), seed=3)
            assert one.reset()[0].tolist() == wanted.tolist()
            one.close()


def test_an_episode_of_one_seat(toy: FakeVector) -> None:
    env = ChefsHatEnv(toy.address, seat=2, observation="columns", opponents="greedy", rewards="validity")
    assert toy.setups[0].client_seats == [2]
    assert list(toy.setups[0].opponents) == ["greedy"]
    assert toy.setups[0].invalid_actions == chefshat.pb.INVALID_ACTION_RULE_ASK_AGAIN
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(199)
    seen, info = env.reset()
    assert toy.requests == []
    # In game 0 seat 2 decides once, at decision 2.
    assert seen["hands"][:3].tolist() == [0, 2, 2]
    assert seen["seats"].tolist() == [2]
    assert np.flatnonzero(seen["action_mask"]).tolist() == np.flatnonzero(info["action_mask"]).tolist() == [2, 199]
    seen, reward, terminated, truncated, info = env.step(150)
    assert (reward, terminated, truncated, info["invalid_attempts"]) == (-1, False, False, 1)
    seen, reward, terminated, truncated, info = env.step(np.int64(199))
    assert (reward, terminated, truncated, info["place"]) == (3 + 102, True, False, 3)
    assert seen["hands"][2] == 5
    assert not seen["action_mask"].any()
    # The server has started the next Shift already; the one after it starts on request.
    seen, _ = env.reset()
    assert seen["shifts"].tolist() == [2]
    assert not any(request.HasField("reset") for request in toy.requests)
    env.step(199)
    env.reset()
    env.step(150)
    env.reset()
    assert toy.requests[-1].reset.games == bytes(4)
    env.reset(seed=5)
    assert toy.requests[-1].reset.base_seed == 5
    env.close()


def test_illegal_actions_are_limited_and_cost_what_the_caller_says(anywhere: str | None) -> None:
    env = ChefsHatEnv(anywhere, rewards=None, invalid_penalty=2.5)
    _, info = env.reset(seed=1)
    assert env.action_masks().tolist() == info["action_mask"].astype(bool).tolist()
    illegal = int(np.argmin(env.action_masks()))
    for attempt in range(1, illegal_actions.MAX_INVALID_ATTEMPTS):
        _, reward, _, _, info = env.step(illegal)
        assert (reward, info["invalid_attempts"]) == (-2.5, attempt)
    # The default action is taken, and another decision follows.
    _, reward, _, _, info = env.step(illegal)
    assert (reward, info["invalid_attempts"]) == (-2.5, 0)
    assert env.step(int(np.argmax(env.action_masks())))[1] == 0
    with pytest.raises(ValueError, match="actions are 0"):
        env.step(1000)
    env.close()


def test_illegal_actions_cost_the_same_in_all_environments(anywhere: str | None) -> None:
    many = ChefsHatVectorEnv(anywhere, 3, rewards=None, invalid_penalty=2.5, max_invalid_attempts=1)
    many.reset(seed=1)
    actions = many.action_masks().argmax(axis=1)
    actions[1] = many.action_masks()[1].argmin()
    _, rewards, _, _, infos = many.step(actions)
    assert rewards.tolist() == [0, -2.5, 0]
    assert infos["invalid_attempts"].tolist() == [0, 0, 0]
    many.close()
    everyone = chefshat_v1.env(anywhere, rewards=None, invalid_penalty=2.5, max_invalid_attempts=2)
    everyone.reset(seed=1)
    agent = everyone.agent_selection
    illegal = int(everyone.last()[0]["action_mask"].argmin())
    everyone.step(illegal)
    assert (everyone.agent_selection, everyone.last()[1]) == (agent, -2.5)
    everyone.step(illegal)
    assert everyone.rewards[agent] == -2.5
    assert everyone.infos[everyone.agent_selection]["invalid_attempts"] == 0
    everyone.close()


def test_the_next_episode_starts_in_the_same_step(toy: FakeVector) -> None:
    env = ChefsHatVectorEnv(toy.address, 3, seat=2, observation=hands)
    seen, infos = env.reset(seed=4)
    # Seat 2 decides first at decision 2, 1 and 0.
    assert seen[:, 2].tolist() == [2, 1, 0]
    seen, rewards, terminations, truncations, infos = env.step([199, 199, 199])
    assert terminations.tolist() == [True, False, False]
    assert rewards.tolist() == [3 + 102, 2, 1]
    assert seen[:, 2].tolist() == [2, 5, 4]
    assert infos["final_obs"][0][2] == 5
    assert infos["final_obs"][1] is None
    assert infos["_final_obs"].tolist() == infos["_final_info"].tolist() == [True, False, False]
    assert infos["final_info"]["place"].tolist() == [3, 0, 0]
    seen, rewards, terminations, truncations, infos = env.step([199, 199, 199])
    assert terminations.tolist() == [True, False, True]
    assert truncations.tolist() == [False, True, False]
    mask = np.array([False, True, False])
    env.reset(options={"reset_mask": mask})
    assert toy.requests[-1].reset.games == np.array([1], "<u4").tobytes()
    env.reset()
    assert toy.requests[-1].reset.all
    env.close()


def test_games_without_a_row_do_not_change(toy: FakeVector) -> None:
    env = ChefsHatVectorEnv(toy.address, 3, seat=0, observation=hands)
    env.reset()
    whole = env.step([199, 199, 199])[0]
    batch = env.vector.batch
    # Game 1 has no row: the server postponed decisions of its other seats.
    left = batch.take(np.array([0, 2]))
    seen = env._observe(left)
    assert seen.tolist() == whole.tolist()
    assert env._infos(left)["action_mask"].sum(axis=1).tolist() == [2, 2, 2]
    env.vector.batch = left
    sent: list[Any] = []

    def step(actions: Any, **_: Any) -> Any:
        sent.append(actions)
        return batch

    env.vector.step = step  # type: ignore[method-assign]
    env.step([10, 11, 12])
    assert sent[0].tolist() == [10, 12]
    env.close()


def test_all_seats_are_rewarded_when_they_decide_next(toy: FakeVector) -> None:
    env = chefshat_v1.env(toy.address, observation=hands, rewards="validity")
    env.reset(seed=1)
    given: dict[str, list[float]] = {}
    for agent in env.agent_iter():
        seen, reward, terminated, truncated, _ = env.last()
        given.setdefault(agent, []).append(reward)
        if terminated or truncated:
            env.step(None)
            continue
        other = env.possible_agents[(int(agent[-1]) + 1) % 4]
        assert not env.observe(other)["action_mask"].any()
        assert np.flatnonzero(seen["action_mask"]).tolist()[-1] == 199
        env.step(199)
    # Seat 0 decided at 0 and at 4, the others once; the end brings 100 and the seat.
    assert given == {"player_0": [0, 1, 105], "player_1": [0, 103], "player_2": [0, 105], "player_3": [0, 107]}
    env.close()


def untyped(function: Any, *arguments: Any, **options: Any) -> Any:
    """Calls a function with what its types do not allow."""
    return function(*arguments, **options)


@pytest.mark.parametrize("kind", ["gymnasium", "gymnasium_vector", "pettingzoo", "vector"])
def test_make_creates_every_kind(toy: FakeVector, kind: Any) -> None:
    env = chefshat.make(kind, address=toy.address, rewards="points", seed=8)
    assert toy.setups[0].reward_scheme == chefshat.pb.REWARD_SCHEME_POINTS
    assert toy.setups[0].base_seed == 8
    env.close()
    assert toy.ended.wait(10)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda address: untyped(chefshat.make, "gym", address=address), "'gymnasium_vector'"),
        (lambda address: ChefsHatEnv(address, observation="picture"), "'table', 'columns', 'classic'"),
        (lambda address: ChefsHatEnv(address, observation=lambda seen: np.zeros(3)), "one row for each"),
        (lambda address: ChefsHatEnv(address, observation=lambda seen: seen.masks), "booleans"),
        (lambda address: untyped(ChefsHatEnv, address, games=2), "VectorEnv"),
        (lambda address: ChefsHatEnv(address, render_mode="rgb_array"), '"ansi"'),
        (lambda address: ChefsHatVectorEnv(address, render_mode="ansi"), "render_mode"),
        (lambda address: ChefsHatVectorEnv(address, 2, total_games=2), "total_games"),
        (lambda address: ChefsHatVectorEnv(address, 2).reset(options={"reset_mask": [1, 0]}), "booleans"),
        (lambda address: untyped(chefshat_v1.env, address, client_seats=[1]), "all seats"),
        (lambda address: chefshat_v1.env(address, render_mode="rgb_array"), '"human"'),
    ],
)
def test_invalid_options_are_reported(toy: FakeVector, make: Any, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        make(toy.address)


def test_many_games_start_with_a_reset(toy: FakeVector) -> None:
    env = ChefsHatVectorEnv(toy.address, 3)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step([199, 199, 199])
    assert toy.requests == []
    env.close()


@pytest.mark.parametrize("make", [ChefsHatEnv, ChefsHatVectorEnv, chefshat_v1.raw_env])
def test_a_closed_environment_stays_closed(toy: FakeVector, make: Any) -> None:
    env = make(toy.address)
    env.reset()
    env.close()
    with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="make a new one"):
        env.reset()


@pytest.mark.parametrize("make", [ChefsHatEnv, ChefsHatVectorEnv, chefshat_v1.raw_env])
def test_an_environment_is_neither_pickled_nor_copied(toy: FakeVector, make: Any) -> None:
    env = make(toy.address)
    for copied in (pickle.dumps, copy.copy, copy.deepcopy):
        with pytest.raises(TypeError, match="cannot be pickled or copied: make another one"):
            copied(env)
    env.close()


def test_each_agent_samples_on_its_own(toy: FakeVector) -> None:
    env = chefshat_v1.raw_env(toy.address, observation="columns")
    first, second = (env.observation_space(agent) for agent in env.possible_agents[:2])
    first.seed(1)
    second.seed(2)
    before = first.sample()
    first.seed(1)
    second.seed(3)
    again = first.sample()
    assert all((before["observation"][name] == again["observation"][name]).all() for name in before["observation"])
    env.close()


def test_a_mask_can_be_sampled(toy: FakeVector) -> None:
    env = chefshat.make(address=toy.address)
    _, info = env.reset()
    assert info["action_mask"].dtype == np.int8
    assert info["action_mask"].shape == (ACTIONS,)
    assert {int(env.action_space.sample(info["action_mask"])) for _ in range(64)} == {0, 199}
    env.close()


def without(missing: str, use: str) -> "subprocess.CompletedProcess[str]":
    """Runs Python where a package is missing."""
    code = f"import sys; sys.modules[{missing!r}] = None; import chefshat; {use}"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(chefshat.__file__).parents[1])


def test_only_needed_packages_are_imported(toy: FakeVector) -> None:
    by_name = f"import gymnasium; gymnasium.make('chefshat.envs:{ENV_ID}', address='{toy.address}', observation='table')"
    for missing in ("jax", "pettingzoo", "pyarrow"):
        done = without(missing, by_name)
        assert done.returncode == 0, done.stderr
    assert toy.setups


@pytest.mark.parametrize(
    ("missing", "use"),
    [("gymnasium", "import chefshat.envs"), ("gymnasium", "chefshat.make()"), ("pettingzoo", "chefshat.make('pettingzoo')")],
)
def test_a_missing_extra_is_named(missing: str, use: str) -> None:
    done = without(missing, use)
    assert done.returncode != 0
    assert "pip install 'chefshat[envs]'" in done.stderr


def test_a_shift_adjudicated_at_the_turn_limit_terminates(anywhere: str | None) -> None:
    """It awards places and points by the rules, so it is not truncated."""
    env = ChefsHatEnv(anywhere, rules={"max_turns": 6}, rewards="points")
    _, info = env.reset(seed=1)
    terminated = truncated = False
    while not (terminated or truncated):
        _, _, terminated, truncated, info = env.step(env.action_space.sample(info["action_mask"]))
    assert (terminated, truncated) == (True, False)
    assert info["place"] in range(1, 5)
    env.close()


def test_the_state_has_all_hands(anywhere: str | None) -> None:
    env = chefshat.make("pettingzoo", address=anywhere, all_hands=True, observation="classic")
    pettingzoo.test.api_test(env, num_cycles=20)
    env.reset(seed=1)
    deck = np.array([*range(1, 12), 2])
    for agent in env.agent_iter(200):
        *_, ended, cut, _ = env.last()
        state = env.state()
        assert env.state_space.contains(state)
        hands = state[-48:].reshape(4, 12) * deck
        if not (ended or cut):
            seat = env.possible_agents.index(agent)
            seen = env.unwrapped.vector.batch.observations
            np.testing.assert_allclose(hands[0], seen.hands[0], atol=1e-5)
            np.testing.assert_allclose(hands.sum(axis=1), np.roll(seen.cards_left[0], -seat), atol=1e-5)
        env.step(None if ended or cut else env.action_space(agent).sample(env.observe(agent)["action_mask"]))
    env.close()
    with pytest.raises(ValueError, match="all_hands=True"):
        chefshat.make("pettingzoo", address=anywhere).unwrapped.state()


@pytest.mark.parametrize("kind", ["gymnasium", "pettingzoo"])
def test_a_new_game_where_it_is_asked_for(anywhere: str | None, kind: str) -> None:
    env = untyped(chefshat.make, kind, address=anywhere)
    shifts = env.unwrapped.vector

    def play() -> None:
        while not len(shifts.batch.endings):
            env.step(int(shifts.batch.masks[0].argmax()))

    env.reset(seed=1)
    play()
    env.reset()
    assert shifts.batch.observations.shifts[0] == 2
    play()
    env.reset(options={"new_game": True})
    seen = shifts.batch.observations
    assert (seen.shifts[0], seen.points[0].sum()) == (1, 0)
    # Also before the first step.
    hands = seen.hands.tolist()
    env.reset(options={"new_game": True})
    assert shifts.batch.observations.hands.tolist() != hands
    env.close()
