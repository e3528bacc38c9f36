"""Decisions per second of this package's `VectorEnv` against a server, the client playing all four seats by a random masked policy.

One process, one stream. Every decision counted is one that the server says it took.
"""

import importlib.metadata
import sys

import measure
import numpy as np

import chefshat
from chefshat.local_server import shared_address
from chefshat.vector import VectorEnv, sample_legal

DEFAULT_GAMES = [1, 64, 1024]


class Batches:
    """Games of a batch, stepped without end."""

    def __init__(self, env: VectorEnv, seed: int) -> None:
        self._env = env
        self._chance = np.random.default_rng(seed)
        self._batch = env.reset()
        self.decisions = 0

    def step(self) -> int:
        """Takes one decision in every game."""
        actions = sample_legal(self._batch.mask_bits, self._chance)
        self._batch = self._env.step(actions)
        self.decisions += len(actions)
        return len(actions)

    def check(self) -> None:
        """Fails unless the server took as many decisions as were sent, all of them by the client, none of them invalid."""
        totals = self._batch.totals
        counted = (totals.client_decisions, totals.decisions, totals.invalid_attempts)
        if counted != (self.decisions, self.decisions, 0):
            raise AssertionError(f"{self.decisions} decisions were sent, the server counted {counted}")


def main() -> int:
    """Measures and prints."""
    parser = measure.parser(__doc__.split("\n\n")[0], "python benchmarks/vector.py --games 1 64 1024 --rounds 5 --json")
    parser.add_argument("--address", metavar="HOST:PORT", help="the server (default: one is started)")
    parser.add_argument(
        "--games", type=int, nargs="+", default=DEFAULT_GAMES, metavar="N", help="games side by side (default: 1 64 1024)"
    )
    options = parser.parse_args()
    measured = []
    address = options.address or shared_address()
    with chefshat.Client(address) as client:
        server_version = client.server_info().server_version
    for games in options.games:
        with VectorEnv(address, games, seed=options.seed) as env:
            batches = Batches(env, options.seed)
            measured.append(measure.measure(f"n = {games:,}", batches.step, options))
            batches.check()
    measure.show(measured, options, chefshat=importlib.metadata.version("chefshat"), server=server_version)
    return 0


if __name__ == "__main__":
    sys.exit(main())
