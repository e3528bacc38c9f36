"""The shared part of the benchmarks: rounds of a fixed time, their median, and output as text or JSON.

It imports only the standard library, so that it runs in any environment.
"""

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

DEFAULT_ROUNDS = 5
DEFAULT_SECONDS = 2.0


@dataclass(frozen=True)
class Measured:
    """Decisions per second, and per second of a core, in each round, and the total number of decisions."""

    name: str
    per_second: list[float]
    per_core_second: list[float]
    decisions: int

    def median(self) -> float:
        """The median of the rounds, decisions per second."""
        return statistics.median(self.per_second)

    def median_of_a_core(self) -> float:
        """The median of the rounds, decisions per second of a core."""
        return statistics.median(self.per_core_second)


def parser(description: str, example: str) -> argparse.ArgumentParser:
    """Creates a parser with the options of all benchmarks."""
    made = argparse.ArgumentParser(
        description=description, epilog=f"example:\n  {example}", formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument(
        "--rounds", type=int, default=DEFAULT_ROUNDS, help="rounds, of which the median counts (default: %(default)s)"
    )
    made.add_argument("--seconds", type=float, default=DEFAULT_SECONDS, help="length of a round (default: %(default)s)")
    made.add_argument("--seed", type=int, default=1, help="the seed (default: %(default)s)")
    made.add_argument("--json", action="store_true", help="print one object of JSON")
    return made


def measure(name: str, play: Callable[[], int], options: argparse.Namespace) -> Measured:
    """Measures `play`, which plays briefly and returns its number of decisions. A first, short round does not count."""
    _round(play, options.seconds / 4)
    rounds = [_round(play, options.seconds) for _ in range(options.rounds)]
    return Measured(
        name,
        [decisions / seconds for decisions, seconds, _ in rounds],
        [decisions / busy for decisions, _, busy in rounds],
        sum(decisions for decisions, _, _ in rounds),
    )


def show(measured: list[Measured], options: argparse.Namespace, **facts: object) -> None:
    """Prints the results, with `facts` (versions)."""
    if options.json:
        rows = [
            {
                "name": row.name,
                "decisions_per_second": row.median(),
                "decisions_per_core_second": row.median_of_a_core(),
                "rounds": row.per_second,
                "decisions": row.decisions,
            }
            for row in measured
        ]
        about = {**facts, "python": platform.python_version(), "cores": os.cpu_count()}
        print(json.dumps({**about, "seconds": options.seconds, "measured": rows}))
        return
    print(", ".join(f"{key} {value}" for key, value in {**facts, "Python": platform.python_version()}.items()))
    width = max(len(row.name) for row in measured)
    print(f"{'':{width}}  {'decisions/s':>12}  {'least':>12}  {'most':>12}  {'/core second':>12}  {'decisions':>12}")
    for row in measured:
        print(
            f"{row.name:{width}}  {row.median():>12,.0f}  {min(row.per_second):>12,.0f}  {max(row.per_second):>12,.0f}"
            f"  {row.median_of_a_core():>12,.0f}  {row.decisions:>12,}"
        )


def _round(play: Callable[[], int], seconds: float) -> tuple[int, float, float]:
    """Returns decisions, seconds, and seconds of processors."""
    decisions = 0
    busy, begun = _processor_seconds(), time.perf_counter()
    while (taken := time.perf_counter() - begun) < seconds:
        decisions += play()
    return decisions, taken, _processor_seconds() - busy


def _processor_seconds() -> float:
    """The processor time of this process and, on Linux, of those that it has started, such as a server."""
    children = (child for of_thread in Path("/proc/self/task").glob("*/children") for child in of_thread.read_text().split())
    return time.process_time() + sum(cpu_of(int(child)) for child in children)


def cpu_of(process: int) -> float:
    """Returns the processor time of a process on Linux, in seconds."""
    after_name = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(after_name[11]) + int(after_name[12])) / os.sysconf("SC_CLK_TCK")
