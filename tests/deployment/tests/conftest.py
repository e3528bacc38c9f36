"""A server with a proxy in front of it, for each proxy in turn."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from certificates import trust
from chefshat.local_server import BINARY, LocalServer
from proxies import Envoy, HAProxy, Nginx, Proxy


@pytest.fixture(scope="session", autouse=True)
def authority(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the authority that signs the certificates of the proxies. All clients trust it."""
    return trust(tmp_path_factory.mktemp("authority"))


@pytest.fixture
def server(tmp_path: Path) -> Iterator[LocalServer]:
    """A server that stores its games."""
    binary = os.environ.get(BINARY)
    if not binary:
        pytest.skip(f"{BINARY} is not set: name the chefshat binary")
    with LocalServer(binary, options=["--data-dir", str(tmp_path / "data"), "--grace", "0"]) as server:
        yield server


@pytest.fixture(params=[Nginx, HAProxy, Envoy], ids=lambda kind: kind.program)
def proxy(request: pytest.FixtureRequest, server: LocalServer, tmp_path: Path) -> Iterator[Proxy]:
    """A proxy in front of the server."""
    folder = tmp_path / "proxy"
    folder.mkdir()
    kind: type[Proxy] = request.param
    with kind(server.address, folder) as proxy:
        yield proxy
