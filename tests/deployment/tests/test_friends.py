"""The tournament of friends in docs/access.md: its commands as they are written, but for names, ports and printed values."""

import os
import re
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import chefshat
import pytest
from certificates import PATIENCE_S
from chefshat.local_server import BINARY
from machine import Machine, copied, finished

PAGE = Path(__file__).resolve().parents[3] / "docs" / "access.md"
SECTION = "## A tournament of friends"


def refusal(call: Callable[[], object]) -> str:
    """Why the server refuses a call; empty if it does not."""
    try:
        call()
    except chefshat.ChefsHatError as error:
        return error.reason
    return ""


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[list[Machine]]:
    """The machines of the server, of the organiser and of two friends, who have the authority's certificate."""
    if BINARY not in os.environ:
        pytest.skip(f"{BINARY} is not set: name the chefshat binary")
    if shutil.which("openssl") is None:
        pytest.skip("openssl is not installed")
    machines = [Machine(tmp_path / name, {}) for name in ("server", "organiser", "gustav", "thea")]
    yield machines
    for machine in reversed(machines):
        machine.leave()


def test_a_tournament_of_friends_is_played_as_written(machines: list[Machine]) -> None:
    section = PAGE.read_text().split(SECTION)[1].split("\n## ")[0]
    blocks = re.findall(r"```(?:sh|python)\n(.*?)```", section, re.DOTALL)
    authority, tokens, serve, create, join, program, own, link, follow, revoke = blocks
    server, organiser, gustav, thea = machines

    server.values |= {"chef.example.org": "localhost", "0.0.0.0:443": "127.0.0.1:0"}
    server.type(authority)
    host, player = re.findall(r"^chefshat_\w{8}_[\w-]{43}$", server.type(tokens), re.MULTILINE)
    serving = server.start(serve)
    assert serving.stdout is not None
    listening = next(line for line in serving.stdout if "listening" in line)
    port = copied(r"https://127.0.0.1:(\d+)", listening)
    url = f"https://localhost:{port}"
    for machine, token in ((organiser, host), (gustav, player), (thea, player)):
        shutil.copy(server.folder / "ca.pem", machine.folder)
        machine.values |= {"https://chef.example.org": url, "chefshat_…": token}

    created = organiser.type(create)
    code, tournament = copied(r"join code +(\w{8})", created), copied(r"tournament +(\w{32})", created)
    for machine in (server, gustav, thea):
        machine.values["JOIN-CODE"] = code
    gustavs = gustav.start(join)
    (thea.folder / "my_agent.py").write_text(program)
    # Installed already, as in all of these tests.
    installed = re.sub(r"^(python3 -m venv venv &&|pip install SOURCES/clients/python) .*\n", "", own, flags=re.MULTILINE)
    assert installed.count("\n") == own.count("\n") - 2
    theas = thea.start(installed)

    server.values["https://chef.example.org"] = url
    anas = server.type(link)
    assert copied(r"(https://\S+)#token=chefshat_", anas) == f"{url}/join/{code}"

    # A terminal keeps what was exported in it.
    exported = "".join(re.findall(r"^export .*\n", create, re.MULTILINE))
    organiser.values["TOURNAMENT-ID"] = tournament
    results, start = follow.split("\n", 1)
    give_up_at = time.monotonic() + PATIENCE_S
    while not {"Gustav", "Thea"} <= set(organiser.type(exported + results).split()):
        assert time.monotonic() < give_up_at
    followed = organiser.type(exported + start)
    assert "Gustav" in followed
    assert "Thea" in followed
    assert "Thea" in finished(theas)
    assert "Gustav" in finished(gustavs)

    server.values["1a2b3c4d"] = player.split("_")[1]
    assert "friends" in server.type(revoke)
    give_up_at = time.monotonic() + PATIENCE_S
    with chefshat.Client(url, token=player, ca=server.folder / "ca.pem") as client:
        while refusal(client.action_table) != "TOKEN_UNKNOWN":
            assert time.monotonic() < give_up_at
