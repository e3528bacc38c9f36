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

DEFAULT_ROUNDS = 5
DEFAULT_SECONDS = 2.0


@dataclass(frozen=True)
class Measured:
    """Decisions per second in each round, and the total number of decisions."""

    name: str
    per_second: list[float]
    decisions: int

    def median(self) -> float:
        """The median of the rounds."""
        return statistics.median(self.per_second)


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
    return Measured(name, [decisions / seconds for decisions, seconds in rounds], sum(decisions for decisions, _ in rounds))


def show(measured: list[Measured], options: argparse.Namespace, **facts: object) -> None:
    """Prints the results, with `facts` (versions)."""
    if options.json:
        rows = [
            {
                "name": row.name,
                "decisions_per_second": row.median(),
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
    print(f"{'':{width}}  {'decisions/s':>12}  {'least':>12}  {'most':>12}  {'decisions':>12}")
    for row in measured:
        print(
            f"{row.name:{width}}  {row.median():>12,.0f}  {min(row.per_second):>12,.0f}  {max(row.per_second):>12,.0f}"
            f"  {row.decisions:>12,}"
        )


def _round(play: Callable[[], int], seconds: float) -> tuple[int, float]:
    decisions = 0
    begun = time.perf_counter()
    while (taken := time.perf_counter() - begun) < seconds:
        decisions += play()
    return decisions, taken
