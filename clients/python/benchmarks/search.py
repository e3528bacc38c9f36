"""Latency of estimates of all legal actions, and rollouts a second: in this process, and with `--address` on a server.

Rollouts a second of processor time are measured in this process only: on a busy machine they tell more than those of a second.

A position is a decision with a choice, of a game by random agents; on a server, of a recorded game by greedy ones.
"""

import argparse
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import TypedDict

import numpy as np

import chefshat
from chefshat import VectorEnv, pb, search

# Rollouts and milliseconds; 0: no limit.
BUDGETS = ((400, 0), (0, 50))
AGENTS = ("greedy", "trained")
# The most time of an analysis with a number of rollouts, which it does not reach.
ENOUGH_MS = 10_000


class Row(TypedDict):
    """The result of a measurement."""

    name: str
    calls: int
    p50_ms: float
    p99_ms: float
    rollouts_per_second: int
    rollouts_per_cpu_second: int | None


def positions(count: int, seed: int) -> list[search.Position]:
    """Returns positions of a game."""
    found: list[search.Position] = []
    with VectorEnv(history=1024, seed=seed) as env:
        env.sample(seed)
        while len(found) < count:
            at = search.position(env)
            if len(at.legal_actions) > 1:
                found.append(at)
            env.step(env.sample())
    return found


def recorded(client: chefshat.Client, count: int) -> Iterator[pb.RecordedMoment]:
    """Plays a game of greedy agents on the server and returns decisions of it with a choice."""
    room = client.rooms.create("benchmark", seats=[None, "greedy", "greedy", "greedy"])
    client.play(chefshat.RandomAgent(1), client.rooms.join(room.join_code, "Random").ticket)
    game = room.room.game_id
    lines = [line.decision for line in client.records.read(game) if line.HasField("decision")]
    choices = [number for number, taken in enumerate(lines) if sum(map(int.bit_count, taken.action_mask)) > 1]
    return (pb.RecordedMoment(game_id=game, decisions=choices[place % len(choices)]) for place in range(count))


def measure(name: str, calls: Sequence[Callable[[], int]], *, here: bool) -> Row:
    """Measures calls that return their number of rollouts. The first one does not count."""
    calls[0]()
    times, rollouts, busy = [], 0, time.process_time()
    for call in calls:
        start = time.perf_counter()
        rollouts += call()
        times.append(1000 * (time.perf_counter() - start))
    p50, p99 = np.percentile(times, [50, 99])
    return {
        "name": name,
        "calls": len(calls),
        "p50_ms": round(float(p50), 3),
        "p99_ms": round(float(p99), 3),
        "rollouts_per_second": round(1000 * rollouts / sum(times)),
        "rollouts_per_cpu_second": round(rollouts / (time.process_time() - busy)) if here else None,
    }


def named(agent: str, rollouts: int, time_ms: int) -> str:
    """Returns the name of a measurement."""
    return f"{agent} {rollouts} rollouts" if rollouts else f"{agent} {time_ms} ms"


def in_process(at: search.Position, agent: str, rollouts: int, time_ms: int, threads: int) -> int:
    """Evaluates a position here. Returns the number of rollouts."""
    found = at.evaluate(rollouts or None, time_ms=time_ms or None, agent=agent, threads=threads)
    return int(found.rollouts.sum())


def on_server(client: chefshat.Client, moment: pb.RecordedMoment, agent: str, rollouts: int, time_ms: int) -> int:
    """Evaluates a recorded decision on a server. Returns the number of rollouts."""
    asked = pb.EvaluateRequest(moment=moment, agent=agent, rollouts=rollouts, time_ms=time_ms or ENOUGH_MS)
    *_, answer = client.evaluate(asked)
    return answer.rollouts


def main() -> None:
    """Measures and prints."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--positions", type=int, default=200, help="positions of each measurement (default: %(default)s)")
    parser.add_argument(
        "--threads", type=int, default=1, help="threads in this process; 0: one for each core (default: %(default)s)"
    )
    parser.add_argument("--address", help="measure AnalysisService of this server, too, which uses one thread for each analysis")
    parser.add_argument("--seed", type=int, default=1, help="the seed (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print one object of JSON")
    options = parser.parse_args()
    costs = [(agent, rollouts, time_ms) for agent in AGENTS for rollouts, time_ms in BUDGETS]
    rows = []
    here = positions(options.positions, options.seed)
    for cost in costs:
        rows.append(
            measure(f"in process {named(*cost)}", [partial(in_process, at, *cost, options.threads) for at in here], here=True)
        )
    if options.address:
        with chefshat.Client(options.address) as client:
            moments = list(recorded(client, options.positions))
            for cost in costs:
                rows.append(
                    measure(f"on a server {named(*cost)}", [partial(on_server, client, at, *cost) for at in moments], here=False)
                )
    if options.json:
        print(json.dumps({"cores": os.cpu_count(), "load": os.getloadavg()[0], "rows": rows}))
        return
    for row in rows:
        times = f"p50 {row['p50_ms']:8.2f} ms  p99 {row['p99_ms']:8.2f} ms"
        own = row["rollouts_per_cpu_second"]
        of_processor = "" if own is None else f"  {own:9,} a second of processor time"
        print(f"{row['name']:36} {times}  {row['rollouts_per_second']:9,} rollouts/s{of_processor}")


if __name__ == "__main__":
    main()
