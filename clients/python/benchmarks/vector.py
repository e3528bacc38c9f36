"""Decisions per second of this package's `VectorEnv`, with a random masked policy on all four seats.

One process, one stream. The server's counts confirm the number of decisions.
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
    """A batch of games."""

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
        """Checks that the server took all decisions sent, all of them by the client, none of them invalid."""
        totals = self._batch.totals
        counted = (totals.client_decisions, totals.decisions, totals.invalid_attempts)
        if counted != (self.decisions, self.decisions, 0):
            raise AssertionError(f"{self.decisions} decisions were sent, the server counted {counted}")


def main() -> int:
    """Measures and prints."""
    parser = measure.parser(__doc__.split("\n\n")[0], "python benchmarks/vector.py --games 1 64 1024 --rounds 5 --json")
    parser.add_argument("--address", metavar="HOST:PORT", help="the server (default: a new one)")
    parser.add_argument(
        "--games", type=int, nargs="+", default=DEFAULT_GAMES, metavar="N", help="parallel games (default: 1 64 1024)"
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
