"""Agents for the card game Chef's Hat, played on a server over gRPC.

Subclass `Agent` with one method, `decide`, and give it to `play`, or to a `Client` (blocking) or `aio.Client` (asyncio), which also
create and find rooms, watch them and fetch records. The messages of the protocol are in `pb`. The package contains no rules: the
server says what is legal.

To learn, `make` an environment: `VectorEnv` steps many games at once in columns, `envs` has the interfaces of Gymnasium and
PettingZoo, `replay` learns from recorded games. `search` looks ahead from what a seat knows.

Names are imported on first use, so that `import chefshat` is fast, and environments in this process do not load gRPC.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from chefshat import aio, errors, pb, replay, search, vector
    from chefshat.address import ServerAddress
    from chefshat.agents import Agent, RandomAgent
    from chefshat.backoff import Backoff
    from chefshat.batch import Batch
    from chefshat.client import Client, play
    from chefshat.clock import ClockReading
    from chefshat.decision import Decision, SeatInfo
    from chefshat.errors import ChefsHatError
    from chefshat.local_server import LocalServer
    from chefshat.making import make
    from chefshat.masks import sample_legal
    from chefshat.result import SeatResult, Standing
    from chefshat.session import PlayOptions
    from chefshat.transitions import Transitions
    from chefshat.vector import VectorEnv

__all__ = [
    "Agent",
    "Backoff",
    "Batch",
    "ChefsHatError",
    "Client",
    "ClockReading",
    "Decision",
    "LocalServer",
    "PlayOptions",
    "RandomAgent",
    "SeatInfo",
    "SeatResult",
    "ServerAddress",
    "Standing",
    "Transitions",
    "VectorEnv",
    "aio",
    "errors",
    "make",
    "pb",
    "play",
    "replay",
    "sample_legal",
    "search",
    "vector",
]

# The modules of the names that are not modules themselves.
_HOMES = {
    "Agent": "agents",
    "Backoff": "backoff",
    "Batch": "batch",
    "ChefsHatError": "errors",
    "Client": "client",
    "ClockReading": "clock",
    "Decision": "decision",
    "LocalServer": "local_server",
    "PlayOptions": "session",
    "RandomAgent": "agents",
    "SeatInfo": "decision",
    "SeatResult": "result",
    "ServerAddress": "address",
    "Standing": "result",
    "Transitions": "transitions",
    "VectorEnv": "vector",
    "make": "making",
    "play": "client",
    "sample_legal": "masks",
}


def __getattr__(name: str) -> object:
    """Imports a name on first use (PEP 562)."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    home = _HOMES.get(name)
    value: object = import_module(f"{__name__}.{home or name}")
    if home is not None:
        value = getattr(value, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
