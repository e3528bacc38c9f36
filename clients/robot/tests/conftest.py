"""The real server, if the environment variable CHEFSHAT_BIN names its binary."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from chefshat import LocalServer
from chefshat.address import CA, TOKEN
from chefshat.join_options import TICKET
from chefshat.local_server import BINARY


@pytest.fixture(autouse=True)
def no_secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    """Removes a ticket, a token and authorities from the environment."""
    for name in (TICKET, TOKEN, CA):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def server_address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of the real server, one for the complete run. Skips the test if there is none."""
    binary = os.environ.get(BINARY)
    if not binary:
        pytest.skip(f"{BINARY} is not set: name the chefshat binary to play against the real server")
    with LocalServer(binary, options=["--data-dir", str(tmp_path_factory.mktemp("data"))]) as server:
        yield server.address
