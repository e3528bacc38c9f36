"""The sample for Ray clusters: its parts without Ray, and the complete sample on a local cluster if Ray is installed.

Ray (extra `ray`) requires an older Gymnasium than the other tests, so they do not install it: see CONTRIBUTING.md.
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
from waiting import LIMIT_S

from chefshat import ChefsHatError, pb
from chefshat.learn import network, ppo_checkpoint, runs
from chefshat.learn.evaluation import evaluate
from chefshat.learn.ppo_checkpoint import Plan

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "cluster" / "rllib_ppo.py"


class Runner:
    """The part of RLlib's `EnvRunner` that the sample uses."""

    def __init__(self, *, config: Any, worker_index: int) -> None:
        self.config = config
        self.env: Any = None
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
        "ray.rllib.env.env_runner_group": {"EnvRunnerGroup": object},
    }
    # The sample sets them.
    for variable in ("NPROC", "RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "RAY_USAGE_STATS_ENABLED"):
        monkeypatch.setenv(variable, "")
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
    monkeypatch.setattr(sample, "Collector", lambda env, games, steps: (games, steps))
    monkeypatch.setattr(sample, "play", play)
    rules = pb.RuleSet(players=2, faces=4)
    setting = {"plan": Plan(games=8), "addresses": ["one", "two"], "rules": rules}
    for seed in (1, 2):
        for number in (1, 2, 3):
            config = SimpleNamespace(env_config=setting, seed=seed)
            runner = sample.SelfPlayRunner(config=config, worker_index=number)
            played = [runner.sample(None, iteration) for iteration in (0, 1)]
            assert [part.runner for part in played] == [number, number]
    # The servers have equal shares.
    assert [one["address"] for one in asked] == ["one", "two", "one"] * 2
    assert all((one["games"], one["rules"]) == (8, rules) for one in asked)
    seeds = [one["seed"] for one in asked]
    # No two runners, no two trainings, and no runner and evaluation share a seed.
    assert len({*seeds, runs.EVALUATION_SEED}) == 7
    assert min(seeds) >= runs.SEED_STEP > runs.EVALUATION_SEED
    assert len(set(chances)) == 12


def test_a_runner_plays_legally_and_its_errors_name_the_server(sample: ModuleType, anywhere: str | None) -> None:
    plan = Plan(games=4, steps=16)
    setting = {"plan": plan, "addresses": [anywhere] if anywhere else [], "rules": "paper"}
    runner = sample.SelfPlayRunner(config=SimpleNamespace(env_config=setting, seed=1), worker_index=1)
    params = ppo_checkpoint.begin(plan, 1, runs.full_rules("paper", anywhere), "").learner.params
    played = runner.sample(params, 0)
    # The last features are the mask.
    masks = np.asarray(played.samples.inputs)[:, -runner.env.num_actions :]
    assert masks[np.arange(64), np.asarray(played.samples.actions)].all()
    assert runner.env.batch.totals.client_decisions == 64
    assert runner.env.batch.totals.invalid_attempts == 0
    runner.stop()
    sample.ray.get = lambda reference: reference
    error = sample._sample(params, 1, runner)
    assert error.reason == "ENV_CLOSED"
    assert f"runner 1, which plays on {anywhere or 'this process'}" in str(error)


def test_a_random_policy_has_the_mean_of_the_points(sample: ModuleType, anywhere: str | None) -> None:
    found = evaluate(sample.randomly(1), "random", games=100, seed=1, address=anywhere)
    assert found.games == 100
    assert sum(found.places) == found.shifts
    # A Shift has 5, 3, 1 and 0 points.
    assert abs(found.points - 9 / 4) < 4 * found.standard_error < 1


def test_a_training_that_ends_with_an_error_writes_what_it_has_learned(
    sample: ModuleType, anywhere: str | None, tmp_path: Path
) -> None:
    def lost() -> None:
        raise ChefsHatError("CONNECTION_LOST", "the server is gone")

    training = ppo_checkpoint.begin(Plan(), 1, runs.full_rules("paper", anywhere), "")
    algorithm = SimpleNamespace(train=lost, network=training.network)
    out = tmp_path / "network.safetensors"
    with pytest.raises(ChefsHatError, match="CONNECTION_LOST"):
        list(sample.trained(algorithm, SimpleNamespace(iterations=3, out=out)))
    assert network.load(out).info.name == "rllib"


@pytest.mark.server
@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'chefshat[ray]'")
def test_a_training_is_the_same_on_two_servers_and_in_process(real_binary: Path, tmp_path: Path) -> None:
    pytest.importorskip("chefshat_native")
    command = [sys.executable, str(SAMPLE), "--json", "--runners", "2", "--games", "8", "--iterations", "2", "--evaluation", "8"]
    trained = []
    for name, where in (("servers", ["--servers", "2"]), ("process", [])):
        out = tmp_path / f"{name}.safetensors"
        done = subprocess.run([*command, *where, "--out", str(out)], capture_output=True, text=True, timeout=LIMIT_S)
        assert done.returncode == 0, done.stderr
        *iterations, _, evaluation, last = map(json.loads, done.stdout.splitlines())
        assert [line["decisions"] for line in iterations] == [1024, 2048]
        assert [line["runners"] for line in iterations] == [2, 2]
        assert evaluation["opponents"] == "greedy"
        assert [evaluation[player]["games"] for player in ("learned", "untrained", "random")] == [8, 8, 8]
        assert network.load(out).info.name == "rllib"
        trained.append((evaluation, last))
    assert trained[0] == trained[1]
