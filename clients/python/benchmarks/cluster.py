"""Decisions per second of the runners of samples/cluster/rllib_ppo.py, by their number and by where they play.

Every decision is one of the policy network. A round is one call of all its runners: they fetch the weights, take 64 decisions in
each of their games, and return the samples. The rounds of different numbers of runners alternate, so that other programs on the
machine disturb all of them alike. The processor time of runners, servers and this process is measured, too; they change it less.
"""

import argparse
import importlib.util
import json
import os
import statistics
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, redirect_stdout
from dataclasses import asdict, dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "samples" / "cluster"))

import rllib_ppo
from measure import cpu_of
from ray import cloudpickle

from chefshat.learn.ppo_checkpoint import Plan
from chefshat.local_server import LocalServer

# The runners' processes do not find this module.
cloudpickle.register_pickle_by_value(rllib_ppo)


@dataclass(frozen=True)
class Round:
    """One call of some runners. Processor times are in seconds, summed over processes.

    Attributes:
        decisions: decisions taken.
        seconds: how long it took.
        runners_cpu: processor time of the runners.
        servers_cpu: of the game servers.
        own_cpu: of this process.
        others_cpu: of everything else on the machine; Ray's own processes are a small part of it.
    """

    decisions: int
    seconds: float
    runners_cpu: float
    servers_cpu: float
    own_cpu: float
    others_cpu: float


def busy() -> float:
    """Returns the seconds that the machine's cores have worked since it was started."""
    user, nice, system, _, _, irq, softirq, *_ = map(int, Path("/proc/stat").read_text().split()[1:11])
    return (user + nice + system + irq + softirq) / os.sysconf("SC_CLK_TCK")


def one_round(algorithm: rllib_ppo.JaxPPO, runners: int, servers: Sequence[int]) -> Round:
    """Lets the first runners play."""
    wall, own, all_cores = time.perf_counter(), time.process_time(), busy()
    before = [cpu_of(server) for server in servers]
    parts = algorithm.play(list(range(1, runners + 1)))
    if len(parts) != runners:
        raise AssertionError(f"{len(parts)} of {runners} runners played")
    seconds, own_cpu = time.perf_counter() - wall, time.process_time() - own
    servers_cpu = sum(cpu_of(server) for server in servers) - sum(before)
    runners_cpu = sum(part.cpu_seconds for part in parts)
    others = busy() - all_cores - own_cpu - servers_cpu - runners_cpu
    decisions = sum(part.samples.actions.size for part in parts)
    return Round(decisions, seconds, runners_cpu, servers_cpu, own_cpu, max(others, 0.0))


def measured(options: argparse.Namespace, servers: int) -> Iterator[dict[str, object]]:
    """Measures runners that play on some servers; 0: in their own processes. Yields a row for each number of runners."""
    with ExitStack() as stack:
        started = [stack.enter_context(LocalServer()) for _ in range(servers)]
        addresses, processes = [server.address for server in started], [server.pid for server in started]
        plan = Plan(games=options.games, steps=rllib_ppo.STEPS)
        most = max(options.runners)
        config = rllib_ppo.configured(plan, addresses, runners=most, rules="paper", seed=options.seed)
        algorithm = stack.enter_context(rllib_ppo.built(config))
        # Compiles the network, which does not count.
        one_round(algorithm, most, processes)
        rounds: dict[int, list[Round]] = {runners: [] for runners in options.runners}
        for _ in range(options.rounds):
            for runners, found in rounds.items():
                found.append(one_round(algorithm, runners, processes))
    first = options.runners[0]
    for runners, found in rounds.items():
        speeds = [one.decisions / one.seconds for one in found]
        decisions, seconds = sum(one.decisions for one in found), sum(one.seconds for one in found)
        work = sum(one.runners_cpu + one.servers_cpu + one.own_cpu for one in found)
        # Each round beside the one of the first number of runners that came just before it.
        ratios = [
            one.decisions / one.seconds / (other.decisions / other.seconds) for one, other in zip(found, rounds[first], strict=True)
        ]
        yield {
            "servers": servers,
            "runners": runners,
            "decisions_per_second": round(statistics.median(speeds)),
            "least": round(min(speeds)),
            "most": round(max(speeds)),
            f"speed_up_over_{first}": round(statistics.median(ratios), 2),
            "decisions_per_cpu_second": round(decisions / work),
            "cores_used": round(work / seconds, 2),
            "cores_of_other_programs": round(sum(one.others_cpu for one in found) / seconds, 2),
            "runners_us": round(1e6 * sum(one.runners_cpu for one in found) / decisions, 1),
            "servers_us": round(1e6 * sum(one.servers_cpu for one in found) / decisions, 1),
            "own_us": round(1e6 * sum(one.own_cpu for one in found) / decisions, 1),
            "rounds": [asdict(one) for one in found],
        }


def main() -> int:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--runners", type=int, nargs="+", default=[1, 2, 4], metavar="N", help="runners (default: 1 2 4)")
    parser.add_argument(
        "--servers", type=int, nargs="+", default=[0, 1, 2], metavar="N", help="game servers; 0: in process (default: 0 1 2)"
    )
    parser.add_argument("--games", type=int, default=128, help="games of each runner (default: %(default)s)")
    parser.add_argument("--rounds", type=int, default=9, help="rounds of each (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="the seed (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one object of JSON")
    options = parser.parse_args()
    if 0 in options.servers and importlib.util.find_spec("chefshat_native") is None:
        parser.error("--servers 0: install chefshat-native, or leave 0 out")
    with redirect_stdout(sys.stderr), rllib_ppo.cluster(max(options.runners)):
        rows = [row for servers in options.servers for row in measured(options, servers)]
    if options.json:
        print(json.dumps({"cores": os.cpu_count(), "games": options.games, "measured": rows}))
        return 0
    print(f"{os.cpu_count()} cores, {options.games} games for each runner, {options.rounds} rounds")
    shown = [name for name in rows[0] if name != "rounds"]
    print("  ".join(shown))
    for row in rows:
        print("  ".join(f"{row[name]!s:>{len(name)}}" for name in shown))
    return 0


if __name__ == "__main__":
    sys.exit(main())
