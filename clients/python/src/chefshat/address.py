"""Addresses of servers, and what a server requires from a client. Opening channels to them is in `channels`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

#: Environment variable that may contain a token.
TOKEN = "CHEFSHAT_TOKEN"
#: Environment variable that may name a file of certificate authorities.
CA = "CHEFSHAT_CA"


@dataclass(frozen=True)
class ServerAddress:
    """A server, and what it requires from a client. Accepted wherever an address is.

    Attributes:
        address: "host:port", "http://host:port" or, for TLS, "https://host:port".
        token: sent with every call; None: that of the environment variable CHEFSHAT_TOKEN, if set; empty: none.
        ca: PEM file of the certificate authorities to trust; None: that of CHEFSHAT_CA, or else the system's.
        secrets: owner tokens and tickets, at most 16, sent with every call: they show private rooms and tournaments, unlisted ones
            in lists, and their records.
    """

    address: str
    # Left out of the representation, which may be logged.
    token: str | None = field(default=None, repr=False)
    ca: Path | str | None = None
    secrets: tuple[str, ...] = field(default=(), repr=False)

    def __str__(self) -> str:
        return self.address


def server_address(
    address: str | ServerAddress, token: str | None = None, ca: Path | str | None = None, secrets: Sequence[str] = ()
) -> ServerAddress:
    """Adds a token, authorities and secrets to an address, where they are set."""
    server = address if isinstance(address, ServerAddress) else ServerAddress(address)
    return ServerAddress(
        server.address, server.token if token is None else token, server.ca if ca is None else ca, server.secrets + tuple(secrets)
    )
