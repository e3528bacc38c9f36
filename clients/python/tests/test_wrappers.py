"""Every wrapper of Gymnasium around the environments: it works, or cannot apply for the reason in the list."""

import inspect
from typing import Any

import numpy as np
import pytest

import chefshat
from chefshat.vector import VectorEnv

pytest.importorskip("chefshat_native")
gymnasium = pytest.importorskip("gymnasium")
wrappers: Any = pytest.importorskip("gymnasium.wrappers")
of_many: Any = pytest.importorskip("gymnasium.wrappers.vector")

GAMES = 3
STEPS = 60


def pictures(situations: Any) -> Any:
    """Observations as small pictures in colour, for wrappers of pictures."""
    seen = np.zeros((len(situations), 8, 8, 3), np.uint8)
    seen[:, 0, :, 0] = situations.observations.hands[:, :8]
    return seen


def same(value: Any) -> Any:
    return value


# By name: how to create a wrapper that needs arguments, and with which observations; "table" is the default.
ARGUMENTS: dict[str, dict[str, Any]] = {
    "AddWhiteNoise": {"probability_of_noise_per_pixel": 0.5},
    "ClipReward": {"min_reward": -0.5, "max_reward": 0.5},
    "DelayObservation": {"delay": 2},
    "DiscretizeAction": {"bins": 2},
    "DiscretizeObservation": {"bins": 2, "multidiscrete": True},
    "DtypeObservation": {"dtype": np.float32},
    "FilterObservation": {"filter_keys": ["hands", "action_mask"]},
    "FrameStackObservation": {"stack_size": 2},
    "MaxAndSkipObservation": {"skip": 2},
    "ObstructView": {"obstructed_pixels_ratio": 0.5, "obstruction_width": 2},
    "RecordVideo": {"video_folder": "unused"},
    "RepeatAction": {"num_repeats": 2},
    "RescaleAction": {"min_action": np.float32(-1), "max_action": np.float32(1)},
    "RescaleObservation": {"min_obs": np.float32(0), "max_obs": np.float32(1)},
    "ReshapeObservation": {"shape": (2, 167)},
    "ResizeObservation": {"shape": (4, 4)},
    "StickyAction": {"repeat_action_probability": 0.5},
    "TimeLimit": {"max_episode_steps": 5},
    "TransformAction": {"func": same, "action_space": None},
    "TransformObservation": {"func": same, "observation_space": None},
    "TransformReward": {"func": same},
    "VectorizeTransformAction": {"wrapper": wrappers.TransformAction, "func": same, "action_space": None},
    "VectorizeTransformObservation": {"wrapper": wrappers.TransformObservation, "func": same, "observation_space": None},
    "VectorizeTransformReward": {"wrapper": wrappers.TransformReward, "func": same},
}
OBSERVATIONS: dict[str, Any] = {
    "FilterObservation": "columns",
    **dict.fromkeys(["GrayscaleObservation", "ObstructView", "ResizeObservation"], pictures),
}
# Why a wrapper cannot apply, as its own error says.
NOT_NUMBERS = r"requires a Box action space"  # Actions are the indices of a table.
NO_PICTURES = r"(?i)render.?mode|return a numpy array"  # The environments render as text.
IMPOSSIBLE = {
    "AddRenderObservation": NO_PICTURES,
    "AtariPreprocessing": r"opencv|frame-skipping",  # For the emulator of Atari games.
    "ClipAction": NOT_NUMBERS,
    "DiscretizeAction": r"Box",
    "HumanRendering": NO_PICTURES,
    "RecordVideo": NO_PICTURES,
    "RescaleAction": NOT_NUMBERS,
}
# The vector wrappers that change observations would not change `final_obs`, so they need games that pause.
NEED_A_PAUSE = {
    "DtypeObservation",
    "FilterObservation",
    "FlattenObservation",
    "GrayscaleObservation",
    "NormalizeObservation",
    "RescaleObservation",
    "ReshapeObservation",
    "ResizeObservation",
    "TransformObservation",
    "VectorizeTransformObservation",
}


def wrappers_of(module: Any) -> list[str]:
    return [name for name, value in vars(module).items() if inspect.isclass(value) and name[0].isupper()]


def wrapped(module: Any, name: str, env: Any) -> Any:
    if name == "ResizeObservation":
        pytest.importorskip("cv2")
    arguments = ARGUMENTS.get(name, {})
    if module is of_many:
        # Those of many environments change the spaces of single ones, too.
        known = inspect.signature(getattr(module, name).__init__).parameters
        plain = not name.startswith("Vectorize")
        arguments = {key: value for key, value in arguments.items() if key in known or not plain}
    if name == "TimeAwareObservation":
        env = wrappers.TimeLimit(env, 5)
    return getattr(module, name)(env, **arguments)


@pytest.mark.parametrize("name", wrappers_of(wrappers))
def test_a_wrapper_of_one_game(name: str) -> None:
    env = chefshat.make(observation=OBSERVATIONS.get(name, "table"), render_mode="ansi")
    if name in IMPOSSIBLE:
        with pytest.raises(Exception, match=IMPOSSIBLE[name]):
            wrapped(wrappers, name, env)
        return
    outer = wrapped(wrappers, name, env)
    ended = 0
    observed, _ = outer.reset(seed=1)
    for _ in range(STEPS):
        assert observed in outer.observation_space
        masks = env.action_masks()
        # A wrapper may have continued to the end of the episode.
        observed, reward, terminated, truncated, _ = outer.step(int(masks.argmax()))
        assert np.isfinite(float(reward))
        if terminated or truncated:
            ended += 1
            if name != "Autoreset":
                observed, _ = outer.reset()
    assert ended
    outer.close()


@pytest.mark.parametrize("name", wrappers_of(of_many))
def test_a_wrapper_of_many_games(name: str) -> None:
    def make(mode: str) -> Any:
        return gymnasium.make_vec(
            "chefshat.envs:chefshat/ChefsHat-v1", num_envs=GAMES, observation=OBSERVATIONS.get(name, "table"), autoreset_mode=mode
        )

    if name in IMPOSSIBLE:
        with pytest.raises(Exception, match=IMPOSSIBLE[name]):
            wrapped(of_many, name, make("next_step"))
        return
    if name in NEED_A_PAUSE:
        with pytest.raises(ValueError, match="NEXT_STEP"):
            wrapped(of_many, name, make("same_step"))
    for mode in ("next_step",) if name in NEED_A_PAUSE else ("next_step", "same_step"):
        outer = wrapped(of_many, name, make(mode))
        ended = 0
        observed, _ = outer.reset(seed=1)
        for _ in range(STEPS):
            assert observed in outer.observation_space
            observed, rewards, terminated, truncated, _ = outer.step(outer.unwrapped.action_masks().argmax(axis=1))
            assert np.isfinite(rewards).all()
            ended += int((terminated | truncated).sum())
        assert ended
        outer.close()


def test_games_that_pause_are_those_that_do_not() -> None:
    """With a pause the same episodes come, one step later each."""
    options: Any = {"num_envs": GAMES, "observation": "columns", "rewards": "winning"}
    episodes: dict[str, list[list[Any]]] = {}
    for mode in ("same_step", "next_step"):
        env: Any = gymnasium.make_vec("chefshat.envs:chefshat/ChefsHat-v1", autoreset_mode=mode, **options)
        observed, infos = env.reset(seed=4)
        found: list[list[Any]] = [[] for _ in range(GAMES)]
        pausing = np.zeros(GAMES, bool)
        for _ in range(80):
            masks = env.unwrapped.action_masks()
            assert masks[pausing].all()
            for game in np.flatnonzero(~pausing):
                found[game].append((observed["hands"][game].tolist(), masks[game].tolist()))
            before = pausing
            observed, rewards, terminated, truncated, infos = env.step(masks.argmax(axis=1))
            assert not rewards[before].any()
            assert not (terminated | truncated)[before].any()
            ended = terminated | truncated
            for game in np.flatnonzero(ended):
                last = observed if mode == "next_step" else infos["final_obs"][game]
                place = infos["place"] if mode == "next_step" else infos["final_info"]["place"]
                hand = last["hands"][game] if mode == "next_step" else last["hands"]
                found[game].append((hand.tolist(), float(rewards[game]), int(place[game])))
            pausing = ended & (mode == "next_step")
        episodes[mode] = found
        env.close()
    for one, other in zip(episodes["same_step"], episodes["next_step"], strict=True):
        shorter = min(len(one), len(other))
        assert shorter > 60
        assert one[:shorter] == other[:shorter]


@pytest.mark.parametrize("transitions", [False, True])
def test_decisions_left_open_come_again(anywhere: str | None, transitions: bool) -> None:
    with VectorEnv(anywhere, 4, client_seats=[0], opponents="greedy", rewards="winning", seed=3, transitions=transitions) as env:
        for _ in range(30):
            before = env.batch
            open_ = np.array([True, False, True, False])
            after = env.step(before.masks.argmax(axis=1), leave_open=open_)
            for name in ("games", "seats", "rewards", "mask_bits"):
                np.testing.assert_array_equal(getattr(before, name)[open_], getattr(after, name)[open_])
            np.testing.assert_array_equal(before.observations.hands[open_], after.observations.hands[open_])
            if transitions:
                assert set(after.transitions.games.tolist()) == {1, 3}
        assert env.batch.totals.client_decisions == 60


@pytest.mark.parametrize(
    "leave_open", [[True, False, True], [[True], [False], [True], [False]], [1, 0, 1, 0], np.array([0, 1, 0, 1], np.uint8), True]
)
def test_what_is_left_open_is_checked_before_anything_is_played(anywhere: str | None, leave_open: Any) -> None:
    with VectorEnv(anywhere, 4, client_seats=[0], opponents="greedy", seed=3, transitions=True) as env:
        before = env.batch
        actions = before.masks.argmax(axis=1)
        with pytest.raises(ValueError, match=r"leave_open: give one boolean for each row of the batch, of the shape \(4,\)"):
            env.step(actions, leave_open=leave_open)
        assert env.batch is before
        after = env.step(actions, leave_open=[True, False, True, False])
        assert set(after.transitions.games.tolist()) == {1, 3}
        assert after.totals.client_decisions == 2


def test_a_mode_that_does_not_exist_is_named() -> None:
    with pytest.raises(ValueError, match='choose "same_step" or "next_step"'):
        chefshat.make("gymnasium_vector", autoreset_mode="disabled")
