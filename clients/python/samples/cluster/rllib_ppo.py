"""Self-play training on a Ray cluster with RLlib: its runners play batches of games, its algorithm learns by masked PPO in JAX.

    pip install 'chefshat[ray]'
    python samples/cluster/rllib_ppo.py --iterations 3
    python samples/cluster/rllib_ppo.py --ray auto --runners 32 --iterations 1000 --out strong.safetensors

The last line is for a cluster. Every runner is an actor of Ray and starts a server on its machine (the program `chefshat` must be
on the PATH, or named by CHEFSHAT_BIN); with --address all of them play on one server. The networks and the loss are those of
`python -m chefshat.learn ppo`: RLlib's own learners need torch, whose wheels for Linux include gigabytes of CUDA.
"""

import argparse
import dataclasses
import json
from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import ray
from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.algorithm_config import AlgorithmConfig
from ray.rllib.env.env_runner import EnvRunner

from chefshat.learn import network, ppo, ppo_checkpoint
from chefshat.learn.evaluation import evaluate
from chefshat.learn.ppo import Params, Samples
from chefshat.learn.ppo_checkpoint import Plan
from chefshat.learn.ppo_training import joined, play
from chefshat.learn.runs import EVALUATION_SEED, SEED_STEP, full_rules
from chefshat.learn.self_play import Collector
from chefshat.vector import VectorEnv


class SelfPlayRunner(EnvRunner):  # type: ignore[misc]  # Ray has no types.
    """Continues its games with the given weights. One decision in each of its games is one step."""

    def __init__(self, *, config: AlgorithmConfig, **kwargs: Any) -> None:  # noqa: ANN401 - RLlib's.
        super().__init__(config=config, **kwargs)
        setting = config.env_config
        self._plan: Plan = setting["plan"]
        # Every runner has its own seeds, which differ from those of evaluations.
        self._key = jax.random.fold_in(jax.random.key(config.seed), self.worker_index)
        self._calls = 0
        self.env = VectorEnv(
            setting["address"],
            self._plan.games,
            skip_forced=True,
            episode="shift",
            seed=config.seed + SEED_STEP * self.worker_index,
            rules=setting["rules"],
        )
        self._collector = Collector(self.env, self._plan.games, self._plan.steps)

    def sample(self, params: Params, **_: Any) -> Samples:  # noqa: ANN401 - RLlib's.
        """Plays `plan.steps` steps."""
        self._calls += 1
        return play(self._collector, params, jax.random.fold_in(self._key, self._calls), self._plan)

    def assert_healthy(self) -> None:
        """Checks that the games exist."""
        assert self.env is not None

    def get_spaces(self) -> None:
        """Returns None: there is no RLlib module."""

    def stop(self) -> None:
        """Ends the games."""
        self.env.close()


class JaxPPOConfig(AlgorithmConfig):  # type: ignore[misc]
    """Configures the runners above. `env_config` has the plan, the address and the rules."""

    def __init__(self, algo_class: type[Algorithm] | None = None) -> None:
        super().__init__(algo_class=algo_class or JaxPPO)
        self.api_stack(enable_rl_module_and_learner=False, enable_env_runner_and_connector_v2=True)
        self.env_runners(env_runner_cls=SelfPlayRunner)
        self._dont_auto_sync_env_runner_states = True

    def validate(self) -> None:
        """Skips the check that refuses RLlib's new runners without its new learners."""


class JaxPPO(Algorithm):  # type: ignore[misc]
    """In every iteration all runners play with the latest weights, and the algorithm learns from all samples."""

    def setup(self, config: AlgorithmConfig) -> None:
        """Creates the networks and the runners."""
        super().setup(config)
        options = self.config.env_config
        self.training = ppo_checkpoint.begin(
            options["plan"], self.config.seed, options["rules"], "python samples/cluster/rllib_ppo.py"
        )
        self._learner = self.training.learner

    def training_step(self) -> None:
        """Plays and learns once."""
        plan = self.training.plan
        # Each machine fetches this object once.
        params = ray.put(jax.tree.map(np.asarray, self._learner.params))
        parts = self.env_runner_group.foreach_env_runner(partial(_sample, params), local_env_runner=False)
        samples = joined(parts)
        for _ in range(plan.epochs):
            self._learner, losses = ppo.learn(
                self._learner,
                samples,
                ppo.Rates(plan.learning_rate, plan.learning_rate),
                jnp.float32(plan.entropy_bonus),
                plan.hyper,
            )
        self.metrics.log_value("decisions", samples.actions.size, reduce="lifetime_sum")
        for name, value in losses._asdict().items():
            self.metrics.log_value(("losses", name), float(value), window=1)

    def network(self, name: str) -> network.Network:
        """Returns the current policy."""
        return dataclasses.replace(self.training, learner=self._learner).network(name)


def _sample(params: ray.ObjectRef, runner: SelfPlayRunner) -> Samples:
    return runner.sample(ray.get(params))


def main() -> None:
    """Trains for some iterations and evaluates the policy."""
    parser = argparse.ArgumentParser(description="Trains by self-play on a Ray cluster.")
    parser.add_argument(
        "--ray", metavar="ADDRESS", help="a Ray cluster ('auto': the cluster of this machine); default: a local one"
    )
    parser.add_argument(
        "--address", metavar="HOST:PORT", help="one Chef's Hat server for all runners; default: one for each runner"
    )
    parser.add_argument("--runners", type=int, default=2, help="runners (default: 2)")
    parser.add_argument("--games", type=int, default=128, help="games of each runner (default: 128)")
    parser.add_argument("--iterations", type=int, default=3, help="iterations (default: 3)")
    parser.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set (default: paper)")
    parser.add_argument("--seed", type=int, default=1, help="the seed, 0 to 2147483647 (default: 1)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the network to this file")
    options = parser.parse_args()

    ray.init(address=options.ray, include_dashboard=False, log_to_driver=False)
    plan = Plan(games=options.games, steps=64)
    setting = {"plan": plan, "address": options.address, "rules": full_rules(options.rules, options.address)}
    config = (
        JaxPPOConfig().environment(env_config=setting).env_runners(num_env_runners=options.runners).debugging(seed=options.seed)
    )
    algorithm = config.build_algo()
    try:
        for iteration in range(1, options.iterations + 1):
            result = algorithm.train()
            seconds = round(result["time_this_iter_s"], 1)
            print(json.dumps({"iteration": iteration, "decisions": result["decisions"], "seconds": seconds}))
        trained = algorithm.network("rllib")
        for opponents in ("random", "greedy"):
            print(evaluate(trained, opponents, games=200, seed=EVALUATION_SEED, rules=setting["rules"], address=options.address))
        if options.out:
            network.save(options.out, trained.layers, trained.info, dtype=np.float16)
    finally:
        algorithm.stop()
        ray.shutdown()


if __name__ == "__main__":
    main()
