"""The sample for Ray clusters: its runners without Ray, and the complete sample on a local cluster if Ray is installed.

Ray (extra `ray`) is large, so the tests do not require it.
"""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

from chefshat import pb
from chefshat.learn import network, runs
from chefshat.learn.ppo_checkpoint import Plan

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "cluster" / "rllib_ppo.py"
# Time limit in seconds: Ray starts several processes.
LIMIT_S = 300


class Runner:
    """The part of RLlib's `EnvRunner` that the sample uses."""

    def __init__(self, *, config: Any, worker_index: int) -> None:
        self.config = config
        self.worker_index = worker_index


@pytest.fixture
def sample(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The sample as a module, with a minimal replacement for Ray."""
    names: dict[str, dict[str, Any]] = {
        "ray": {"ObjectRef": object},
        "ray.rllib": {},
        "ray.rllib.algorithms": {},
        "ray.rllib.algorithms.algorithm": {"Algorithm": type("Algorithm", (), {})},
        "ray.rllib.algorithms.algorithm_config": {"AlgorithmConfig": type("AlgorithmConfig", (), {})},
        "ray.rllib.env": {},
        "ray.rllib.env.env_runner": {"EnvRunner": Runner},
    }
    for name, contents in names.items():
        module = ModuleType(name)
        vars(module).update(contents)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("rllib_ppo", SAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_runners_play_different_deals_with_the_given_rules(sample: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[dict[str, Any]] = []

    def env(address: str, games: int, **options: Any) -> None:
        asked.append({"address": address, "games": games, **options})

    chances: list[Any] = []

    def play(collector: object, params: object, chance: Any, plan: Plan) -> None:
        chances.append(tuple(np.asarray(jax.random.key_data(chance)).tolist()))

    monkeypatch.setattr(sample, "VectorEnv", env)
    monkeypatch.setattr(sample, "Collector", lambda env, games, steps: None)
    monkeypatch.setattr(sample, "play", play)
    rules = pb.RuleSet(players=2, faces=4)
    setting = {"plan": Plan(games=8), "address": "an address", "rules": rules}
    for seed in (1, 2):
        for number in (1, 2):
            config = SimpleNamespace(env_config=setting, seed=seed)
            runner = sample.SelfPlayRunner(config=config, worker_index=number)
            runner.sample(None)
            runner.sample(None)
    assert all((one["address"], one["games"], one["rules"]) == ("an address", 8, rules) for one in asked)
    seeds = [one["seed"] for one in asked]
    # No two runners, no two trainings, and no runner and evaluation share a seed.
    assert len({*seeds, runs.EVALUATION_SEED}) == 5
    assert min(seeds) >= runs.SEED_STEP > runs.EVALUATION_SEED
    assert len(set(chances)) == 8


@pytest.mark.server
@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'chefshat[ray]'")
def test_a_few_iterations_are_trained(real_address: str, tmp_path: Path) -> None:
    out = tmp_path / "n.safetensors"
    command = [sys.executable, str(SAMPLE), "--address", real_address, "--runners", "2", "--games", "8", "--iterations", "2"]
    done = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [json.loads(line)["decisions"] for line in lines[:2]] == [1024, 2048]
    assert "against random, random, random" in lines[2]
    assert network.load(out).info.name == "rllib"
