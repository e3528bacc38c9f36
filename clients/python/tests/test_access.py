"""TLS and tokens, with both clients, environments and the command; and connections that go silent."""

import asyncio
import json
import re
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import grpc
import pytest
from fake_server import TLS, FakeServer
from proxy import Proxy

import chefshat
from chefshat import Backoff, ChefsHatError, Decision, LocalServer, SeatResult, ServerAddress, aio, pb
from chefshat import agent as command
from chefshat.address import CA, TOKEN
from chefshat.channels import channel

SECRET = "chefshat_0badcafe_c2VjcmV0"
AUTHORITY = TLS / "localhost.pem"
SEATS = [None, "random", "random", "random"]
# The default time for a decision, 10 s, and no more.
POLICY = pb.RoomPolicy(bank_ms=0)


@pytest.fixture
def guarded() -> Iterator[FakeServer]:
    """A fake server with TLS that requires a token."""
    with FakeServer(SECRET) as server:
        yield server


def play_blocking(server: str | ServerAddress, agent: chefshat.Agent) -> SeatResult:
    with chefshat.Client(server) as client:
        room = client.rooms.create("tea", seats=SEATS, policy=POLICY)
        return client.play(agent, client.rooms.join(room.join_code, "Ada").ticket)


def play_asyncio(server: str | ServerAddress, agent: chefshat.Agent) -> SeatResult:
    async def run() -> SeatResult:
        async with aio.Client(server) as client:
            room = await client.rooms.create("tea", seats=SEATS, policy=POLICY)
            joined = await client.rooms.join(room.join_code, "Ada")
            return await client.play(agent, joined.ticket)

    return asyncio.run(run())


Player = Callable[[str | ServerAddress, chefshat.Agent], SeatResult]


@pytest.fixture(params=[play_blocking, play_asyncio], ids=["blocking", "asyncio"])
def play(request: pytest.FixtureRequest) -> Player:
    """The test runs once with each client."""
    player: Player = request.param
    return player


def test_a_game_is_played_with_tls_and_a_token(guarded: FakeServer, play: Player) -> None:
    assert play(ServerAddress(guarded.address, SECRET, AUTHORITY), chefshat.RandomAgent(1)).finished


@pytest.mark.server
def test_the_real_server_with_tls_and_tokens(real_binary: Path, tmp_path: Path, play: Player) -> None:
    create = [str(real_binary), "token", "create", "--role", "host", "--data-dir", str(tmp_path)]
    token = subprocess.run(create, capture_output=True, text=True, check=True).stdout.strip()
    tls = ["--tls-cert", str(AUTHORITY), "--tls-key", str(TLS / "localhost.key")]
    with LocalServer(real_binary, options=["--data-dir", str(tmp_path), *tls]) as server:
        address = f"https://{server.address}"
        with pytest.raises(ChefsHatError, match="TOKEN_MISSING"):
            play(ServerAddress(address, token="", ca=AUTHORITY), chefshat.RandomAgent(1))
        assert play(ServerAddress(address, token, AUTHORITY), chefshat.RandomAgent(1)).finished


@pytest.mark.server
def test_what_is_private_is_shown_with_a_secret_of_it(real_address: str) -> None:
    rules = pb.RuleSet(target_shifts=1)
    with chefshat.Client(real_address) as stranger:
        created = stranger.rooms.create(rules=rules, seats=["random"] * 4, visibility=pb.VISIBILITY_PRIVATE)
        room = created.room
        assert room.policy.visibility == pb.VISIBILITY_PRIVATE
        settings = pb.TournamentSettings(name="cup", format=pb.TOURNAMENT_FORMAT_KNOCKOUT, rules=rules)
        cup = stranger.tournaments.create(settings, visibility=pb.VISIBILITY_PRIVATE)
        assert not settings.HasField("policy")
        tournament_id = cup.tournament.tournament_id
        for unknown in (
            lambda: stranger.rooms.get(room.room_id),
            lambda: list(stranger.rooms.watch(room.room_id)),
            lambda: list(stranger.records.read(room.game_id)),
            lambda: stranger.tournaments.get(tournament_id),
        ):
            with pytest.raises(ChefsHatError, match="_UNKNOWN"):
                unknown()
        assert room.room_id not in [listed.room_id for listed in stranger.rooms.list()]
    secrets = [created.owner_token, cup.owner_token]
    with chefshat.Client(real_address, secrets=secrets) as owner:
        assert list(owner.rooms.watch(room.room_id))
        assert list(owner.records.read(room.game_id))
        assert room.game_id in [listed.game_id for listed in owner.records.list()]
        assert owner.tournaments.get(tournament_id).tournament_id == tournament_id
        owner.tournaments.close(tournament_id, cup.owner_token)

    async def run() -> None:
        async with aio.Client(ServerAddress(real_address, secrets=(created.owner_token,))) as owner:
            assert (await owner.rooms.get(room.room_id)).game_id == room.game_id

    asyncio.run(run())


def test_token_and_authorities_come_from_the_environment(
    guarded: FakeServer, play: Player, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(TOKEN, f" {SECRET}\n")
    monkeypatch.setenv(CA, str(AUTHORITY))
    assert play(guarded.address, chefshat.RandomAgent(1)).finished
    with pytest.raises(ChefsHatError, match="TOKEN_MISSING"):
        play(ServerAddress(guarded.address, token=""), chefshat.RandomAgent(1))


def test_arguments_of_clients_and_environments(guarded: FakeServer) -> None:
    with chefshat.Client(guarded.address, token=SECRET, ca=AUTHORITY) as client:
        room = client.rooms.create("tea", seats=SEATS)
    result = chefshat.play(
        chefshat.RandomAgent(1), guarded.address, join_code=room.join_code, name="Ada", token=SECRET, ca=AUTHORITY
    )
    assert result.finished
    env = chefshat.make("vector", address=guarded.address, token=SECRET, ca=AUTHORITY, games=2)
    assert env.games == 2
    env.close()


def test_the_command_takes_a_token_and_authorities(
    guarded: FakeServer, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with chefshat.Client(guarded.address, token=SECRET, ca=AUTHORITY) as client:
        code = client.rooms.create("tea", seats=SEATS).join_code
    arguments = ["--address", guarded.address, "--ca", str(AUTHORITY), "--code", code, "--name", "Ada", "--json"]
    assert command.main(arguments) == 1
    assert json.loads(capsys.readouterr().out)["reason"] == "TOKEN_MISSING"
    assert command.main([*arguments, "--token", "chefshat_wrong"]) == 1
    refused = capsys.readouterr()
    assert json.loads(refused.out)["reason"] == "TOKEN_UNKNOWN"
    assert "chefshat_wrong" not in refused.out + refused.err
    assert command.main([*arguments, "--token", SECRET]) == 0


@pytest.mark.parametrize(("token", "reason"), [("", "TOKEN_MISSING"), ("chefshat_1_2", "TOKEN_UNKNOWN")])
def test_a_refused_token_is_not_sent_again(guarded: FakeServer, play: Player, token: str, reason: str) -> None:
    server = ServerAddress(guarded.address, token, AUTHORITY)
    with pytest.raises(ChefsHatError) as caught:
        play(server, chefshat.RandomAgent(1))
    assert guarded.guard.calls == 1
    error = caught.value
    assert (error.reason, error.code, error.retryable) == (reason, grpc.StatusCode.UNAUTHENTICATED, False)
    assert ("CHEFSHAT_TOKEN" in error.message) is (reason == "TOKEN_MISSING")
    # The same for a stream.
    with chefshat.Client(server) as client, pytest.raises(ChefsHatError, match=reason):
        client.play(chefshat.RandomAgent(1), "ticket")
    assert guarded.guard.calls == 2


def test_a_token_is_never_shown(guarded: FakeServer) -> None:
    server = ServerAddress(guarded.address, SECRET, AUTHORITY)
    with chefshat.Client(server) as client, pytest.raises(ChefsHatError) as caught:
        client.rooms.get("nowhere")
    opened = channel(server)
    shown = [server, str(server), client, vars(client), opened, opened.unary_unary("/a/b"), caught.value, caught.value.__cause__]
    opened.close()
    assert not any(SECRET in repr(thing) for thing in shown)


@pytest.mark.parametrize("host", ["example.org", "192.0.2.1", "[2001:db8::1]"])
def test_a_token_that_others_can_read_on_the_way_is_warned_of(host: str) -> None:
    bare = host.strip("[]")
    with pytest.warns(UserWarning, match=re.escape(f"the token is sent unencrypted to {bare}; use https://{bare}")):
        channel(ServerAddress(f"http://{host}:50051", SECRET)).close()


@pytest.mark.parametrize(
    ("address", "token"),
    [
        ("https://example.org", SECRET),
        ("localhost:50051", SECRET),
        ("127.8.0.1:50051", SECRET),
        ("http://[::1]:50051", SECRET),
        ("example.org:50051", ""),
    ],
)
def test_safe_connections_cause_no_warning(address: str, token: str, recwarn: pytest.WarningsRecorder) -> None:
    channel(ServerAddress(address, token)).close()
    assert not recwarn.list


def test_servers_that_cannot_be_trusted(guarded: FakeServer, fake: FakeServer) -> None:
    for server in (ServerAddress(guarded.address), ServerAddress(f"https://{fake.address}", ca=AUTHORITY)):
        with chefshat.Client(server, backoff=Backoff(attempts=3)) as client:
            with pytest.raises(ChefsHatError, match=r"TLS_FAILED.*CHEFSHAT_CA") as caught:
                client.play(chefshat.RandomAgent(1), "ticket")
            assert not caught.value.retryable


def test_unusable_files_and_tokens_are_refused(tmp_path: Path) -> None:
    (tmp_path / "empty.pem").touch()
    with pytest.raises(ChefsHatError, match=r"CA_REFUSED.*no certificate"):
        chefshat.Client("https://localhost", ca=tmp_path / "empty.pem")
    with pytest.raises(ChefsHatError, match=r"CA_REFUSED.*missing\.pem"):
        chefshat.Client("https://localhost", ca=tmp_path / "missing.pem")
    with pytest.raises(ChefsHatError, match="TOKEN_REFUSED") as caught:
        chefshat.Client("localhost:1", token="two\nlines")
    assert "lines" not in str(caught.value)
    with pytest.raises(ChefsHatError, match="SECRETS_REFUSED") as caught:
        chefshat.Client("localhost:1", secrets=["two\nlines"])
    assert "lines" not in str(caught.value)


class Silencer(chefshat.RandomAgent):
    """Silences the connection once, at its third decision."""

    def __init__(self, proxy: Proxy) -> None:
        super().__init__(1)
        self.proxy = proxy
        self.decisions = 0

    def decide(self, request: Decision) -> int:
        self.decisions += 1
        if self.decisions == 3:
            self.proxy.silence()
        return super().decide(request)


def test_a_silent_connection_is_replaced_before_a_decision_is_lost(address: str, play: Player) -> None:
    with Proxy(address) as proxy:
        agent = Silencer(proxy)
        result = play(proxy.address, agent)
    assert result.finished
    assert result.reconnects == 1
    assert result.decisions == agent.decisions, "the server decided nothing"
