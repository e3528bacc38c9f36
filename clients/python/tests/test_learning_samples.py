"""The samples that learn, and Stable-Baselines3: each learns a little, without a server. How well is measured by hand."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from waiting import LIMIT_S

import chefshat

SAMPLES = Path(__file__).resolve().parents[1] / "samples" / "learning"
LITTLE = ("--decisions", "256", "--games", "4", "--steps", "16", "--evaluation", "8")


@pytest.mark.parametrize(("name", "needs"), [("ppo_jax", "jax"), ("ppo_torch", "torch")])
def test_a_sample_learns(name: str, needs: str) -> None:
    pytest.importorskip("chefshat_native")
    pytest.importorskip(needs)
    command = [sys.executable, str(SAMPLES / f"{name}.py"), *LITTLE]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr
    *updates, evaluated = map(json.loads, done.stdout.splitlines())
    assert [line["decisions"] for line in updates] == [64, 128, 192, 256]
    assert all(np.isfinite(line["policy_loss"]) and line["entropy"] > 0 for line in updates)
    assert evaluated["event"] == "evaluated"
    assert evaluated["shifts"] >= 8
    assert 1 <= evaluated["place"] <= 4


def test_masked_ppo_of_stable_baselines_learns() -> None:
    pytest.importorskip("chefshat_native")
    sb3_contrib = pytest.importorskip("sb3_contrib")
    adapter = importlib.import_module("chefshat.envs.stable_baselines")
    for env in (chefshat.make(rewards="points"), adapter.ChefsHatVecEnv(4, observation="table", rewards="points")):
        model = sb3_contrib.MaskablePPO("MlpPolicy", env, n_steps=32, batch_size=32, n_epochs=1, seed=1)
        model.learn(256)
        assert model.num_timesteps >= 256
        env.close()


def test_the_adapter_for_stable_baselines() -> None:
    pytest.importorskip("chefshat_native")
    pytest.importorskip("stable_baselines3")
    adapter = importlib.import_module("chefshat.envs.stable_baselines")
    with pytest.raises(ValueError, match="autoreset_mode"):
        adapter.ChefsHatVecEnv(2, autoreset_mode="next_step")
    env = adapter.ChefsHatVecEnv(3, observation="columns", rewards="points")
    env.seed(7)
    first = env.reset()
    assert first["hands"].shape[0] == 3
    total, steps = np.zeros(3), np.zeros(3, int)
    ended = np.zeros(3, bool)
    while not ended.any():
        masks = np.stack(env.env_method("action_masks"))
        assert masks.shape == (3, env.action_space.n)
        _, rewards, ended, infos = env.step(masks.argmax(axis=1))
        total += rewards
        steps += 1
    for game in np.flatnonzero(ended):
        assert infos[game]["episode"] == {"r": pytest.approx(total[game]), "l": steps[game]}
        assert 1 <= infos[game]["place"] <= 4
        assert not infos[game]["terminal_observation"]["action_mask"].any()
        assert not infos[game]["TimeLimit.truncated"]
    assert env.env_is_wrapped(object) == [False] * 3
    assert env.get_attr("num_envs", [0, 1]) == [3, 3]
    with pytest.raises(AttributeError, match="no method 'render'"):
        env.env_method("render")
    env.seed(7)
    again = env.reset()
    assert all(np.array_equal(again[name], first[name]) for name in first)
    env.close()
