"""Decisions per second of this package's `VectorEnv`, with a random masked policy: in this process, and over the network.

One process, one environment at a time. By default the policy has all four seats; with --opponents it has one. Only its decisions
count, and the counts of the games confirm their number.
"""

import importlib.util
import sys
from importlib.metadata import version

import measure

import chefshat
from chefshat.local_server import shared_address
from chefshat.vector import VectorEnv, VectorOptions

DEFAULT_GAMES = [1, 16, 64, 1024]


class Batches:
    """A batch of games."""

    def __init__(self, env: VectorEnv, seed: int) -> None:
        self._env = env
        env.sample(seed)
        self._before = env.batch.totals
        self._sent = 0

    def step(self) -> int:
        """Takes one decision in every game. Returns their number, without those of opponents."""
        actions = self._env.sample()
        self._sent += len(actions)
        self._env.step(actions)
        return len(actions)

    def check(self) -> None:
        """Checks that the games took all decisions sent, none of them invalid."""
        totals = self._env.batch.totals
        counted = totals.client_decisions - self._before.client_decisions
        if (counted, totals.invalid_attempts) != (self._sent, 0):
            raise AssertionError(f"{self._sent} decisions were sent, the games counted {counted}")


def main() -> int:
    """Measures and prints."""
    parser = measure.parser(__doc__.split("\n\n")[0], "python benchmarks/vector.py --games 1 64 1024 --rounds 5 --json")
    parser.add_argument("--address", metavar="HOST:PORT", help="the server (default: a new one)")
    parser.add_argument(
        "--games", type=int, nargs="+", default=DEFAULT_GAMES, metavar="N", help="parallel games (default: 1 16 64 1024)"
    )
    parser.add_argument("--opponents", metavar="AGENT", help="the policy has seat 0 against this agent, for example trained")
    options = parser.parse_args()
    measured = []
    ways: dict[str, str | None] = {"over the network": options.address or shared_address()}
    if options.address is None and importlib.util.find_spec("chefshat_native") is not None:
        ways = {"in process": None, **ways}
    with chefshat.Client(ways["over the network"] or "") as client:
        server_version = client.server_info().server_version
    for way, address in ways.items():
        for games in options.games:
            setup: VectorOptions = {"seed": options.seed}
            if options.opponents is not None:
                setup |= {"client_seats": [0], "opponents": options.opponents}
            with VectorEnv(address, games, **setup) as env:
                batches = Batches(env, options.seed)
                measured.append(measure.measure(f"{way}, n = {games:,}", batches.step, options))
                batches.check()
    measure.show(measured, options, chefshat=version("chefshat"), server=server_version)
    return 0


if __name__ == "__main__":
    sys.exit(main())
