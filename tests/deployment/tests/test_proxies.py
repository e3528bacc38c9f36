"""The server behind nginx, HAProxy and Envoy: agents in three languages, the page, reloads, restarts and idle streams."""

import http.client
import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import chefshat
import pytest
from certificates import client_context
from chefshat import Decision, RandomAgent, pb
from chefshat.local_server import LocalServer, clean_environment, find_binary
from proxies import PATIENCE_S, Envoy, HAProxy, Nginx, Proxy

# How long a stream stays idle in the slow test, seconds: more than six minutes.
IDLE_S = 370.0


class Interrupting(RandomAgent):
    """Does something at certain decisions, while the others wait for its answer or play."""

    def __init__(self, at: dict[int, Callable[[], object]]) -> None:
        super().__init__(1)
        self._at = at

    def decide(self, request: Decision) -> int:
        interruption = self._at.pop(request.decision_id, None)
        if interruption is not None:
            interruption()
        return super().decide(request)


def play(proxy: Proxy, at: dict[int, Callable[[], object]]) -> list[pb.RecordLine]:
    """Plays a game of agents in Python, Rust and JavaScript through a proxy. Returns its record."""
    node = os.environ.get("CHEFSHAT_NODE_DIR")
    if not node:
        pytest.skip("CHEFSHAT_NODE_DIR is not set: name the folder of the JavaScript agent with its modules")
    with chefshat.Client(proxy.url) as client:
        # Long time limits: the test is about lost decisions, not speed.
        policy = pb.RoomPolicy(decision_time_ms=60_000)
        room = client.create_room("behind a proxy", rules=pb.RuleSet(target_shifts=3), policy=policy)
        ticket = client.join_room(room.join_code, "in-process").ticket
        rust = [os.environ["CHEFSHAT_BIN"], "agent", "greedy", "--server", proxy.url, "--name", "rust"]
        python = [sys.executable, "-m", "chefshat.agent", "--address", proxy.url, "--name", "python"]
        javascript = ["node", "agent.js", "--address", proxy.url, "--name", "javascript"]
        processes = [
            subprocess.Popen(
                [*command, "--code", room.join_code],
                cwd=node,
                env=clean_environment() | {name: os.environ[name] for name in ("CHEFSHAT_CA", "CHEFSHAT_PROTO")},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            for command in (rust, python, javascript)
        ]
        try:
            result = client.play(Interrupting(at), ticket)
            outputs = [process.communicate(timeout=PATIENCE_S)[0] for process in processes]
        finally:
            for process in processes:
                process.kill()
                process.wait()
        assert [process.returncode for process in processes] == [0, 0, 0], outputs
        assert result.finished
        assert not at, "not all interruptions happened"
        return list(client.record(room.room.game_id))


def decisions_by_agents(record: list[pb.RecordLine]) -> bool:
    """Whether no decision was taken in an agent's place."""
    decisions = [line.decision for line in record if line.HasField("decision")]
    assert decisions
    return all(decision.source == pb.DECISION_SOURCE_AGENT for decision in decisions)


def test_a_reload_with_a_new_certificate_loses_nobody(proxy: Proxy) -> None:
    record = play(proxy, {5: proxy.reload, 15: proxy.reload, 25: proxy.reload})
    assert decisions_by_agents(record)
    events = [line.event for line in record if line.HasField("event")]
    seats = {event.seated.name: event.seated.seat for event in events if event.HasField("seated")}
    disconnected = {event.disconnected.seat for event in events if event.HasField("disconnected")}
    # Node cannot ping over a connection that is ending, so its gRPC gives up the stream; the agent is back at once.
    assert disconnected <= {seats["javascript"]}


def test_a_game_resumes_after_the_server_behind_the_proxy_was_killed(proxy: Proxy, server: LocalServer) -> None:
    def restart() -> None:
        server.kill()
        server.start()

    record = play(proxy, {5: restart, 25: restart})
    assert decisions_by_agents(record)
    kinds = [line.event.WhichOneof("kind") for line in record if line.HasField("event")]
    assert kinds.count("server_restarted") == 2


def test_a_person_plays_on_the_page(proxy: Proxy, tmp_path: Path) -> None:
    web = os.environ.get("CHEFSHAT_WEB_DIR")
    if not web:
        pytest.skip("CHEFSHAT_WEB_DIR is not set: name the folder of the page with its modules")
    command = ["npm", "run", "test:browser", "--", "tests/browser/shift.test.ts", "--testNamePattern", "complete Shift by clicking"]
    played = subprocess.run(
        command,
        cwd=web,
        env=os.environ | {"CHEFSHAT_URL": proxy.url, "CHEFSHAT_DATA_DIR": str(tmp_path / "data")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=PATIENCE_S,
    )
    assert played.returncode == 0, played.stdout


def test_the_page_and_grpc_web_pass_over_http_1(proxy: Proxy, server: LocalServer) -> None:
    def page(connection: http.client.HTTPConnection) -> tuple[int, str | None, bytes]:
        connection.request("GET", "/rooms/0123")
        answer = connection.getresponse()
        return answer.status, answer.getheader("content-security-policy"), answer.read()

    connection = http.client.HTTPSConnection(proxy.address, context=client_context(), timeout=PATIENCE_S)
    # Without a build of the page it is one that says how to build it.
    assert page(connection) == page(http.client.HTTPConnection(server.address, timeout=PATIENCE_S))

    frame = struct.pack(">BI", 0, 0)
    headers = {"content-type": "application/grpc-web+proto", "x-grpc-web": "1"}
    connection.request("POST", "/chefshat.v1.ServerService/GetServerInfo", body=frame, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    assert answer.status == 200
    assert answer.getheader("content-type") == "application/grpc-web+proto"
    assert b"grpc-status:0" in body


@pytest.mark.parametrize("kind", [Nginx, HAProxy, Envoy], ids=lambda kind: kind.program)
def test_the_server_knows_the_addresses_of_clients(kind: type[Proxy], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    client, invented = "127.77.0.5", "192.0.2.1"
    monkeypatch.setenv("CHEFSHAT_LOG", "info")
    options = ["--data-dir", str(tmp_path / "data"), "--access", "tokens", "--trusted-proxy", "127.0.0.1"]
    folder = tmp_path / "proxy"
    folder.mkdir()
    with LocalServer(find_binary(), options=options) as server, kind(server.address, folder) as proxy:
        connection = http.client.HTTPSConnection(
            proxy.address, context=client_context(), timeout=PATIENCE_S, source_address=(client, 0)
        )
        headers = {"content-type": "application/grpc-web+proto", "x-grpc-web": "1", "x-forwarded-for": invented}
        # Refused without a token, which is logged.
        connection.request("POST", "/chefshat.v1.RoomService/ListRooms", body=struct.pack(">BI", 0, 0), headers=headers)
        assert connection.getresponse().status == 200
        assert f"address={client}" in server.log
        assert invented not in server.log


@pytest.mark.slow
def test_idle_streams_keep_their_seats(server: LocalServer, tmp_path: Path) -> None:
    def think_long(kind: type[Proxy]) -> chefshat.SeatResult:
        folder = tmp_path / kind.program
        folder.mkdir()
        with kind(server.address, folder) as proxy, chefshat.Client(proxy.url) as client:
            policy = pb.RoomPolicy(decision_time_ms=3_600_000)
            seats = [None, "greedy", "greedy", "greedy"]
            room = client.create_room(seats=seats, rules=pb.RuleSet(target_shifts=1), policy=policy)
            ticket = client.join_room(room.join_code, "slow").ticket
            # Nobody else can act while this seat thinks, so its stream is silent.
            return client.play(Interrupting({2: lambda: time.sleep(IDLE_S)}), ticket)

    kinds = (Nginx, HAProxy, Envoy)
    with ThreadPoolExecutor(len(kinds)) as threads:
        for result in threads.map(think_long, kinds):
            assert result.finished
            assert (result.reconnects, result.late) == (0, 0)
