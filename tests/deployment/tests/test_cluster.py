"""Three nodes on PostgreSQL behind HAProxy and Envoy, with the certificates that docs/cluster.md makes."""

import re
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from database import Database
from games import decisions_by_agents, play
from proxies import Envoy, HAProxy, Proxy
from servers import GuardedServer, run

PAGE = Path(__file__).resolve().parents[3] / "docs" / "cluster.md"


class Node(GuardedServer):
    """A node of a cluster.

    Attributes:
        database: the database of the cluster.
    """

    def __init__(self, name: str, data: Path, database: Database, certificates: Path) -> None:
        """Prepares a node. All have the same data directory, with the signing key and the tokens."""
        files = {"cert": "node.pem", "key": "node.key", "ca": "ca.pem"}
        options = [text for option, file in files.items() for text in (f"--peer-{option}", str(certificates / file))]
        shared = ["--database", database.url, "--trusted-proxy", "127.0.0.1"]
        self.database = database
        super().__init__(data, *shared, "--node-name", name, "--peer-listen", "127.0.0.1:0", *options)


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[list[Node]]:
    """Three nodes."""
    (tmp_path / "peers").mkdir()
    section = PAGE.read_text().split("## Certificates between nodes", 1)[1]
    commands = re.search(r"```sh\n(.*?)```", section, re.DOTALL)
    assert commands, "the page has no commands"
    subprocess.run(["bash", "-e", "-c", commands[1]], cwd=tmp_path / "peers", check=True, capture_output=True)
    with Database() as database, ExitStack() as running:
        yield [
            running.enter_context(Node(name, tmp_path / "data", database, tmp_path / "peers")) for name in ("one", "two", "three")
        ]


@pytest.mark.parametrize("kind", [HAProxy, Envoy], ids=lambda kind: kind.program)
def test_a_game_outlives_each_of_its_nodes(kind: type[Proxy], nodes: list[Node], tmp_path: Path) -> None:
    def lose(node: Node) -> None:
        node.kill()
        node.start()

    def drain(node: Node) -> None:
        node.stop()
        node.start()

    one, two, three = nodes
    (tmp_path / "proxy").mkdir()
    with kind(" ".join(node.address for node in nodes), tmp_path / "proxy") as proxy:
        # The last one does not even close its connections.
        record = play(one, proxy.url, {5: lambda: lose(one), 15: lambda: drain(two), 25: three.freeze})
    three.kill()
    assert decisions_by_agents(record)
    kinds = [line.event.WhichOneof("kind") for line in record if line.HasField("event")]
    assert kinds.count("server_restarted") > 0
    status = run("cluster", "status", "--database", nodes[0].database.url).stdout
    assert all(name in status for name in ("one", "two", "three"))
