"""A server with TLS of its own that requires tokens, reached directly and through a proxy that passes connections on.

Agents in three languages, a spectator and people on the page; a certificate that is replaced while they play.
"""

import json
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import people_play
from certificates import PATIENCE_S, client_context, issue, until_served
from games import decisions_by_agents, disconnected, play
from proxies import HAProxyPassingThrough
from servers import EncryptedServer, run


@pytest.fixture
def server(tmp_path: Path) -> Iterator[EncryptedServer]:
    """A server whose clients are soon asked to open new connections."""
    with EncryptedServer(tmp_path / "data", tmp_path / "tls", "--connection-age", "1") as server:
        yield server


@pytest.fixture
def proxy(server: EncryptedServer, tmp_path: Path) -> Iterator[HAProxyPassingThrough]:
    """A proxy that has no certificate. The server has one for the proxy's address."""
    folder = tmp_path / "proxy"
    folder.mkdir()
    with HAProxyPassingThrough(server.address, folder, server.tls) as proxy:
        yield proxy


def replace_certificate(server: EncryptedServer) -> None:
    """Replaces the files; returns when new connections get the new certificate."""
    host, _, port = server.address.rpartition(":")
    certificate = issue(host, server.tls)
    until_served(certificate, host, int(port), lambda: "" if server.running else server.log)


def connections(server: EncryptedServer, role: str) -> set[str]:
    """The connections on which a token was used."""
    environment = {"CHEFSHAT_SERVER": server.url, "CHEFSHAT_TOKEN": server.tokens["admin"]}
    lines = run("admin", "clients", "--json", environment=environment).stdout.splitlines()
    clients = [json.loads(line) for line in lines]
    token_id = server.tokens[role].split("_")[1]
    return {client["clientId"] for client in clients if client.get("tokenId") == token_id}


def test_a_new_certificate_reaches_clients_while_they_play(server: EncryptedServer) -> None:
    def move() -> None:
        replace_certificate(server)
        with server.client("host") as host:
            seen: set[str] = set()
            give_up_at = time.monotonic() + PATIENCE_S
            # The connection of the first calls reaches its age; the last ones are made on another.
            while len(seen) < 2:
                assert time.monotonic() < give_up_at
                host.server_info()
                seen |= connections(server, "host")

    record = play(server, server.url, {5: move, 15: move})
    assert decisions_by_agents(record)
    # As behind a proxy that reloads: Node cannot ping over a connection that is ending.
    assert disconnected(record) <= {"javascript"}


def test_a_proxy_passes_on_what_it_cannot_read(server: EncryptedServer, proxy: HAProxyPassingThrough) -> None:
    with socket.create_connection((proxy.host, int(proxy.address.rpartition(":")[2]))) as plain:
        context = client_context()
        context.set_alpn_protocols(["h2", "http/1.1"])
        with context.wrap_socket(plain, server_hostname=proxy.host) as encrypted:
            assert encrypted.selected_alpn_protocol() == "h2"
    record = play(server, proxy.url, {5: proxy.reload, 15: proxy.reload})
    assert decisions_by_agents(record)
    assert disconnected(record) <= {"javascript"}
    people_play(server, proxy.url)
