"""A server that requires tokens, behind nginx, HAProxy and Envoy with TLS.

Agents in three languages, a spectator and people on the page; new certificates, restarts and idle streams.
"""

import http.client
import struct
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import chefshat
import pytest
from browser import people_play
from certificates import PATIENCE_S, client_context
from chefshat import pb
from games import Interrupting, decisions_by_agents, disconnected, play
from proxies import Envoy, HAProxy, Nginx, Proxy
from servers import GuardedServer

# How long a stream stays idle in the slow test, seconds: more than six minutes.
IDLE_S = 370.0


def test_a_reload_with_a_new_certificate_loses_nobody(proxy: Proxy, server: GuardedServer) -> None:
    record = play(server, proxy.url, {5: proxy.reload, 15: proxy.reload, 25: proxy.reload})
    assert decisions_by_agents(record)
    # Node cannot ping over a connection that is ending, so its gRPC gives up the stream; the agent is back at once.
    assert disconnected(record) <= {"javascript"}


def test_a_game_resumes_after_the_server_behind_the_proxy_was_killed(proxy: Proxy, server: GuardedServer) -> None:
    def restart() -> None:
        server.kill()
        server.start()

    record = play(server, proxy.url, {5: restart, 25: restart})
    assert decisions_by_agents(record)
    kinds = [line.event.WhichOneof("kind") for line in record if line.HasField("event")]
    assert kinds.count("server_restarted") == 2


# Of the others, agents and the calls of the page show that they pass everything on.
@pytest.mark.parametrize(
    "proxy",
    [Nginx, *(pytest.param(kind, marks=pytest.mark.slow) for kind in (HAProxy, Envoy))],
    ids=lambda kind: kind.program,
    indirect=True,
)
def test_people_play_on_the_page(proxy: Proxy, server: GuardedServer) -> None:
    people_play(server, proxy.url)


@pytest.mark.parametrize(("role", "reason"), [("", "TOKEN_MISSING"), ("spectator", "ROLE_TOO_LOW"), ("player", "ROLE_TOO_LOW")])
def test_roles_hold_behind_a_proxy(server: GuardedServer, tmp_path: Path, role: str, reason: str) -> None:
    token = server.tokens[role] if role else ""
    (tmp_path / "proxy").mkdir()
    with (
        Nginx(server.address, tmp_path / "proxy") as proxy,
        chefshat.Client(proxy.url, token=token) as client,
        pytest.raises(chefshat.ChefsHatError, match=reason),
    ):
        client.rooms.create("mine")


def test_the_page_and_grpc_web_pass_over_http_1(proxy: Proxy, server: GuardedServer) -> None:
    def page(connection: http.client.HTTPConnection) -> tuple[int, str | None, bytes]:
        connection.request("GET", "/rooms/0123")
        answer = connection.getresponse()
        return answer.status, answer.getheader("content-security-policy"), answer.read()

    connection = http.client.HTTPSConnection(proxy.address, context=client_context(), timeout=PATIENCE_S)
    # Without a build of the page it is one that says how to build it.
    through = page(connection)
    assert through[0] == 200
    assert through == page(http.client.HTTPConnection(server.address, timeout=PATIENCE_S))

    frame = struct.pack(">BI", 0, 0)
    headers = {"content-type": "application/grpc-web+proto", "x-grpc-web": "1"}
    connection.request("POST", "/chefshat.v1.ServerService/GetServerInfo", body=frame, headers=headers)
    answer = connection.getresponse()
    body = answer.read()
    assert answer.status == 200
    assert answer.getheader("content-type") == "application/grpc-web+proto"
    assert b"grpc-status:0" in body


def test_the_server_knows_the_addresses_of_clients(proxy: Proxy, server: GuardedServer) -> None:
    client, invented = "127.77.0.5", "192.0.2.1"
    connection = http.client.HTTPSConnection(
        proxy.address, context=client_context(), timeout=PATIENCE_S, source_address=(client, 0)
    )
    headers = {"content-type": "application/grpc-web+proto", "x-grpc-web": "1", "x-forwarded-for": invented}
    # Refused without a token, which is logged.
    connection.request("POST", "/chefshat.v1.RoomService/ListRooms", body=struct.pack(">BI", 0, 0), headers=headers)
    answer = connection.getresponse()
    assert (answer.status, answer.getheader("grpc-status")) == (200, "16")
    assert f"address={client}" in server.log
    assert invented not in server.log


@pytest.mark.slow
def test_idle_streams_keep_their_seats(server: GuardedServer, tmp_path: Path) -> None:
    def think_long(kind: type[Proxy]) -> chefshat.SeatResult:
        folder = tmp_path / kind.program
        folder.mkdir()
        with kind(server.address, folder) as proxy, server.client("host", proxy.url) as client:
            policy = pb.RoomPolicy(decision_time_ms=3_600_000)
            seats = [None, "greedy", "greedy", "greedy"]
            room = client.rooms.create(seats=seats, rules=pb.RuleSet(target_shifts=1), policy=policy)
            ticket = client.rooms.join(room.join_code, "slow").ticket
            # Nobody else can act while this seat thinks, so its stream is silent.
            return client.play(Interrupting({2: lambda: time.sleep(IDLE_S)}), ticket)

    kinds = (Nginx, HAProxy, Envoy)
    with ThreadPoolExecutor(len(kinds)) as threads:
        for result in threads.map(think_long, kinds):
            assert result.finished
            assert (result.reconnects, result.late) == (0, 0)
