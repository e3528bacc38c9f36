"""Agents for the card game Chef's Hat, played on a server over gRPC.

Subclass `Agent` with one method, `decide`, and give it to `play`, or to a `Client` (blocking) or `aio.Client` (asyncio), which also
create and find rooms, watch them and fetch records. The messages of the protocol are in `pb`. The package contains no rules: the
server says what is legal.

To learn, `make` an environment: `VectorEnv` steps many games at once in columns, `envs` has the interfaces of Gymnasium and
PettingZoo, `replay` learns from recorded games.
"""

from pathlib import Path

from chefshat import aio, pb
from chefshat.agents import Agent, RandomAgent
from chefshat.backoff import Backoff
from chefshat.channels import ServerAddress
from chefshat.client import Client
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.local_server import LocalServer
from chefshat.making import make
from chefshat.result import SeatResult, Standing
from chefshat.session import PlayOptions
from chefshat.transitions import Transitions
from chefshat.vector import Batch, VectorEnv, sample_legal

__all__ = [
    "Agent",
    "Backoff",
    "Batch",
    "ChefsHatError",
    "Client",
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
    "make",
    "pb",
    "play",
    "sample_legal",
]


def play(
    agent: Agent,
    address: str | ServerAddress,
    *,
    join_code: str,
    name: str,
    seat: int | None = None,
    token: str | None = None,
    ca: Path | str | None = None,
) -> SeatResult:
    """Joins a room, plays its game to the end and returns the result.

    Args:
        agent: the agent.
        address: "host:port", "http://host:port" or, for TLS, "https://host:port".
        join_code: the room's join code.
        name: display name, 1..=64 characters.
        seat: the seat; None: the first free one.
        token: sent with every call; None: that of the environment variable CHEFSHAT_TOKEN, if set.
        ca: PEM file of the certificate authorities to trust; None: that of CHEFSHAT_CA, or else the system's.

    Raises:
        ChefsHatError: the room or the seat was refused, another connection took the seat, or the server stayed unreachable.
    """
    with Client(address, token=token, ca=ca) as client:
        return client.play(agent, client.join_room(join_code, name, seat=seat).ticket)
