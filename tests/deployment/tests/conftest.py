"""A server with a proxy in front of it, for each proxy in turn."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from certificates import trust
from proxies import Envoy, HAProxy, Nginx, Proxy
from servers import GuardedServer


@pytest.fixture(scope="session", autouse=True)
def authority(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the authority that signs the certificates of the proxies. All clients trust it."""
    return trust(tmp_path_factory.mktemp("authority"))


@pytest.fixture
def server(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[GuardedServer]:
    """A server that stores its games, requires tokens, and trusts the proxies. Its log contains no token."""
    monkeypatch.setenv("CHEFSHAT_LOG", "info")
    with GuardedServer(tmp_path / "data", "--trusted-proxy", "127.0.0.1") as server:
        yield server
        secrets = [token.split("_", 2)[2] for token in server.tokens.values()]
        assert not [secret for secret in secrets if secret in server.log]


@pytest.fixture(params=[Nginx, HAProxy, Envoy], ids=lambda kind: kind.program)
def proxy(request: pytest.FixtureRequest, server: GuardedServer, tmp_path: Path) -> Iterator[Proxy]:
    """A proxy in front of the server."""
    folder = tmp_path / "proxy"
    folder.mkdir()
    kind: type[Proxy] = request.param
    with kind(server.address, folder) as proxy:
        yield proxy
