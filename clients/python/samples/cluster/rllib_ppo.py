"""Self-play training on a Ray cluster with RLlib: its runners play batches of games, its algorithm learns by masked PPO in JAX.

    pip install '.[ray]' ../../target/wheels/chefshat_*_$(uname -m).whl    # after cargo xtask wheels
    python samples/cluster/rllib_ppo.py                 # every runner plays in its own process
    python samples/cluster/rllib_ppo.py --servers 2     # over the network, on two servers of this machine
    RAY_ADDRESS=auto python samples/cluster/rllib_ppo.py --runners 32 --address lab1:50051 lab2:50051 --iterations 1000

Every runner is an actor of Ray, in a process of its own. Without the environment variable RAY_ADDRESS, Ray runs on this machine
alone, listens on its loopback interface, and is gone when the training ends. The networks and the loss are those of
`python -m chefshat.learn ppo`: RLlib's own learners need torch, whose wheels for Linux include gigabytes of CUDA.
"""

import argparse
import dataclasses
import hashlib
import json
import logging
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

# Ray reads these when it is imported. The first also exists on Linux: with 0, no other machine can reach Ray's processes.
os.environ.setdefault("RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER", "1" if "RAY_ADDRESS" in os.environ else "0")
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")

import jax
import jax.numpy as jnp
import numpy as np
import ray
from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.algorithm_config import AlgorithmConfig
from ray.rllib.env.env_runner import EnvRunner
from ray.rllib.env.env_runner_group import EnvRunnerGroup

from chefshat.batch import Batch
from chefshat.errors import ChefsHatError, exit_code
from chefshat.learn import network, ppo, ppo_checkpoint
from chefshat.learn.evaluation import evaluate
from chefshat.learn.network import Network
from chefshat.learn.ppo import Params, Samples
from chefshat.learn.ppo_checkpoint import Plan
from chefshat.learn.ppo_training import joined, play
from chefshat.learn.runs import EVALUATION_SEED, SEED_STEP, full_rules
from chefshat.learn.self_play import Collector
from chefshat.local_server import LocalServer
from chefshat.masks import sample_legal
from chefshat.opponents import Policy
from chefshat.vector import VectorEnv

# Bytes of a local cluster's object store, which holds the samples of an iteration; more are written to disk.
OBJECT_STORE = 200_000_000
# Decisions in each game between two updates.
STEPS = 64
OPPONENTS = ("random", "greedy")


class Played(NamedTuple):
    """What a runner has played.

    Attributes:
        runner: its number, from 1.
        samples: its decisions.
        cpu_seconds: processor time that its process took.
    """

    runner: int
    samples: Samples
    cpu_seconds: float


class SelfPlayRunner(EnvRunner):  # type: ignore[misc]  # Ray is not among the development extras.
    """Continues its games with the given weights. One decision in each of its games is one step."""

    def __init__(self, *, config: AlgorithmConfig, **kwargs: Any) -> None:  # noqa: ANN401 - RLlib's.
        # Ray counts on one core for each runner. JAX would start a thread for each core of the machine.
        os.environ["NPROC"] = "1"
        super().__init__(config=config, **kwargs)
        self._plan: Plan = config.env_config["plan"]
        # Every runner has its own seeds, which differ from those of evaluations.
        self._key = jax.random.fold_in(jax.random.key(config.seed), self.worker_index)
        addresses: Sequence[str] = config.env_config["addresses"]
        self.address = addresses[(self.worker_index - 1) % len(addresses)] if addresses else None
        self._collector: Collector | None = None

    def _begin(self) -> Collector:
        """Starts the games."""
        self.env = VectorEnv(
            self.address,
            self._plan.games,
            skip_forced=True,
            episode="shift",
            seed=self.config.seed + SEED_STEP * self.worker_index,
            rules=self.config.env_config["rules"],
        )
        return Collector(self.env, self._plan.games, self._plan.steps)

    def sample(self, params: Params, iteration: int, **_: Any) -> Played:  # noqa: ANN401 - RLlib's.
        """Plays `plan.steps` steps. The first call starts the games, because RLlib hides errors of the constructor."""
        self._collector = self._collector or self._begin()
        began = time.process_time()
        samples = play(self._collector, params, jax.random.fold_in(self._key, iteration), self._plan)
        return Played(self.worker_index, samples, time.process_time() - began)

    def assert_healthy(self) -> None:
        """Does nothing: a runner without games starts them."""

    def get_spaces(self) -> None:
        """Returns None: there is no RLlib module."""

    def stop(self) -> None:
        """Ends the games."""
        if self.env is not None:
            self.env.close()


class JaxPPOConfig(AlgorithmConfig):  # type: ignore[misc]
    """Configures the runners above. `env_config` has the plan, the addresses of the servers and the rules."""

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

    def play(self, runners: Sequence[int] | None = None) -> list[Played]:
        """Returns what the runners (None: all) have played with the current weights, in the order of their numbers.

        Raises ChefsHatError if games were refused or a server was lost. Runners whose process was lost are left out.
        """
        # Each machine fetches this object once.
        params = ray.put(jax.tree.map(np.asarray, self._learner.params))
        results = self.env_runner_group.foreach_env_runner(
            partial(_sample, params, self.iteration), local_env_runner=False, remote_worker_ids=runners
        )
        errors = [result for result in results if isinstance(result, ChefsHatError)]
        if errors or not results:
            raise errors[0] if errors else ChefsHatError("RUNNERS_LOST", "the processes of all runners were lost")
        return sorted(results, key=lambda played: played.runner)

    def training_step(self) -> None:
        """Plays and learns once."""
        plan = self.training.plan
        began = time.perf_counter()
        parts = self.play()
        played = time.perf_counter()
        samples = joined([part.samples for part in parts])
        rates = ppo.Rates(plan.learning_rate, plan.learning_rate)
        for _ in range(plan.epochs):
            self._learner, losses = ppo.learn(self._learner, samples, rates, jnp.float32(plan.entropy_bonus), plan.hyper)
        for name, value in losses._asdict().items():
            self.metrics.log_value(("losses", name), float(value), window=1)
        self.metrics.log_value("decisions", samples.actions.size, reduce="lifetime_sum")
        self.metrics.log_value("runners", len(parts), window=1)
        self.metrics.log_value("playing_s", played - began, window=1)
        self.metrics.log_value("learning_s", time.perf_counter() - played, window=1)

    def restore_env_runners(self, env_runner_group: EnvRunnerGroup) -> list[int]:
        """Takes back runners that Ray has started again. They need no state: the next call brings the weights."""
        return list(env_runner_group.probe_unhealthy_env_runners())

    def network(self, name: str) -> Network:
        """Returns the current policy."""
        return dataclasses.replace(self.training, learner=self._learner).network(name)


def _sample(params: ray.ObjectRef, iteration: int, runner: SelfPlayRunner) -> Played | ChefsHatError:
    try:
        return runner.sample(ray.get(params), iteration)
    except ChefsHatError as error:
        # Returned, not raised: RLlib would start the runner again.
        where = runner.address or "this process"
        return ChefsHatError(error.reason, f"runner {runner.worker_index}, which plays on {where}: {error.message}")


@contextmanager
def cluster(runners: int) -> Iterator[None]:
    """Connects to the Ray cluster that RAY_ADDRESS names. Without it, runs one of this machine, which leaves nothing behind."""
    options: dict[str, Any] = {}
    with ExitStack() as stack:
        if "RAY_ADDRESS" not in os.environ:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="ray-", ignore_cleanup_errors=True))
            options = {"num_cpus": runners, "object_store_memory": OBJECT_STORE, "include_dashboard": False, "_temp_dir": folder}
        stack.callback(ray.shutdown)
        ray.init(**options, log_to_driver=False, logging_level="ERROR")
        yield


@contextmanager
def built(config: JaxPPOConfig) -> Iterator[JaxPPO]:
    """Runs an algorithm with its runners. The folder that RLlib creates for it in ~/ray_results is removed."""
    algorithm = config.build_algo()
    try:
        yield algorithm
    finally:
        algorithm.stop()
        shutil.rmtree(algorithm.logdir, ignore_errors=True)


def configured(plan: Plan, addresses: Sequence[str], *, runners: int, rules: str, seed: int) -> JaxPPOConfig:
    """Configures a training. Raises ChefsHatError if one of the servers does not answer."""
    logging.getLogger("ray.rllib").setLevel(logging.ERROR)
    places: Sequence[str | None] = addresses or [None]
    complete = [full_rules(rules, address) for address in places]
    setting = {"plan": plan, "addresses": addresses, "rules": complete[0]}
    config = JaxPPOConfig()
    config.environment(env_config=setting).env_runners(num_env_runners=runners).debugging(seed=seed, log_level="ERROR")
    return config


def randomly(seed: int) -> Policy:
    """Returns a policy that draws each legal action with the same probability."""
    rng = np.random.default_rng(seed)

    def choose(batch: Batch) -> np.ndarray[Any, np.dtype[np.uint16]]:
        return sample_legal(batch.mask_bits, rng)

    return choose


def trained(algorithm: JaxPPO, options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Trains and evaluates. Yields an event for each iteration and evaluation, and one at the end.

    Beside what was learned, a policy that draws legal actions and the network before training play the same deals.
    """
    untrained = algorithm.network("untrained")
    try:
        for iteration in range(1, options.iterations + 1):
            result = algorithm.train()
            yield {
                "event": "iteration",
                "iteration": iteration,
                "decisions": int(result["decisions"]),
                "runners": int(result["runners"]),
                "playing_s": round(result["playing_s"], 3),
                "learning_s": round(result["learning_s"], 3),
                "entropy": round(result["losses"]["entropy"], 4),
            }
    finally:
        # Also if a server was lost, or Ctrl-C has ended the training.
        learned = algorithm.network("rllib")
        if options.out:
            network.save(options.out, learned.layers, learned.info, dtype=np.float16)
    for opponents in OPPONENTS:
        alike: dict[str, Any] = {
            "games": options.evaluation,
            "seed": EVALUATION_SEED,
            "rules": algorithm.training.rules,
            "address": options.address[0] if options.address else None,
        }
        players: dict[str, Network | Policy] = {"learned": learned, "untrained": untrained, "random": randomly(options.seed)}
        yield {
            "event": "evaluation",
            "opponents": opponents,
            **{name: dataclasses.asdict(evaluate(player, opponents, **alike)) for name, player in players.items()},
        }
    weights = b"".join(part.tobytes() for layer in learned.layers for part in layer)
    yield {"event": "trained", "weights_sha256": hashlib.sha256(weights).hexdigest()}


def described(event: dict[str, Any]) -> str:
    """Returns an event as text for people."""
    if event["event"] == "iteration":
        return (
            f"iteration {event['iteration']}: {event['decisions']:,} decisions, {event['runners']} runners played for "
            f"{event['playing_s']:.1f} s, learning took {event['learning_s']:.1f} s, entropy {event['entropy']:.2f}"
        )
    if event["event"] == "evaluation":
        points = [
            f"{name} {event[name]['points']:.3f} ± {event[name]['standard_error']:.3f}"
            for name in ("learned", "untrained", "random")
        ]
        return f"points per Shift against {event['opponents']}: {', '.join(points)} ({event['learned']['games']} games each)"
    return f"weights: SHA-256 {event['weights_sha256']}"


def run(options: argparse.Namespace) -> int:
    """Trains on the cluster, and prints what happens."""
    out = sys.stdout
    with ExitStack() as stack:
        # Ray prints there, too.
        stack.enter_context(redirect_stdout(sys.stderr))
        servers = [stack.enter_context(LocalServer()) for _ in range(options.servers)]
        options.address = options.address or [server.address for server in servers]
        plan = Plan(games=options.games, steps=STEPS)
        config = configured(plan, options.address, runners=options.runners, rules=options.rules, seed=options.seed)
        stack.enter_context(cluster(options.runners))
        for event in trained(stack.enter_context(built(config)), options):
            print(json.dumps(event) if options.json else described(event), file=out, flush=True)
    return 0


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Trains by self-play on a Ray cluster.")
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--address", nargs="+", default=[], metavar="HOST:PORT", help="servers, over which the runners are distributed evenly"
    )
    where.add_argument("--servers", type=int, default=0, metavar="N", help="start N servers on this machine for the runners")
    parser.add_argument("--runners", type=int, default=2, help="runners (default: 2)")
    parser.add_argument("--games", type=int, default=128, help="games of each runner (default: 128)")
    parser.add_argument("--iterations", type=int, default=3, help="iterations (default: 3)")
    parser.add_argument("--evaluation", type=int, default=200, metavar="GAMES", help="games of an evaluation (default: 200)")
    parser.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set (default: paper)")
    parser.add_argument("--seed", type=int, default=1, help="the seed, 0 to 2147483647 (default: 1)")
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the network to this file")
    parser.add_argument("--json", action="store_true", help="print lines of JSON instead of text")
    options = parser.parse_args()
    if options.runners < 1:
        parser.error("--runners: at least 1")
    if options.servers and "RAY_ADDRESS" in os.environ:
        parser.error("--servers: other machines cannot reach servers of this one; start them and give their --address")
    return exit_code(lambda: run(options), ValueError, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
