"""Tournaments with both clients and the command, on the fake and the real server. Without a server: `test_participant`."""

import asyncio
import json
import subprocess
import sys
import threading
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import pytest
from fake_game import FakeGame, FakeSeat
from fake_server import FakeServer
from proxy import Proxy
from waiting import LIMIT_S

import chefshat
from chefshat import Backoff, ChefsHatError, Decision, RandomAgent, SeatInfo, SeatResult, aio, pb
from chefshat import agent as command
from chefshat.participant import MakeAgent

PACKAGE = Path(__file__).resolve().parents[1]
QUICK = Backoff(first_s=0.001, max_s=0.05, attempts=100)
GAMES = 6

Item = TypeVar("Item")
Player = Callable[[str, str, MakeAgent], list[SeatResult]]


def play_blocking(address: str, ticket: str, make: MakeAgent) -> list[SeatResult]:
    with chefshat.Client(address, backoff=QUICK) as client:
        return client.play_tournament(ticket, make)


def play_asyncio(address: str, ticket: str, make: MakeAgent) -> list[SeatResult]:
    async def run() -> list[SeatResult]:
        async with aio.Client(address, backoff=QUICK) as client:
            return await client.play_tournament(ticket, make)

    return asyncio.run(run())


@pytest.fixture(params=[play_blocking, play_asyncio], ids=["blocking", "asyncio"])
def play(request: pytest.FixtureRequest) -> Player:
    """The test runs once with each client."""
    player: Player = request.param
    return player


class Checking(RandomAgent):
    """Plays at random in one game, and checks its events."""

    def __init__(self, seat: SeatInfo) -> None:
        super().__init__(seat.seat)
        self.seat = seat
        self.sequences: list[int] = []
        self.ids: list[int] = []

    def decide(self, request: Decision) -> int:
        self.ids.append(request.decision_id)
        return super().decide(request)

    def on_event(self, event: pb.GameEvent) -> None:
        self.sequences.append(event.sequence)

    def on_game_over(self, result: SeatResult) -> None:
        assert (result.game_id, result.seat) == (self.seat.game_id, self.seat.seat)
        assert self.sequences == list(range(1, len(self.sequences) + 1)), "each once and in order"
        assert self.ids == list(range(1, len(self.ids) + 1)), "asked once for each"


def settings(*built_in: str, start_when_joined: int = 4) -> pb.TournamentSettings:
    """Three rounds of two games, for four participants."""
    return pb.TournamentSettings(
        name="Coppa",
        format=pb.TOURNAMENT_FORMAT_ROUND_ROBIN,
        rules=pb.RuleSet(target_shifts=1),
        policy=pb.RoomPolicy(decision_time_ms=60_000),
        rounds=3,
        games_per_pairing=2,
        built_in_agents=built_in,
        start_when_joined=start_when_joined,
    )


def compare(client: chefshat.Client, tournament_id: str, played: list[list[SeatResult]]) -> None:
    """Compares the participants' results with the server's counts."""
    games = list(client.tournaments.games(tournament_id))
    assert len(games) == GAMES
    for game in games:
        assert game.state == pb.TOURNAMENT_GAME_STATE_COUNTED
        for number, line in enumerate(game.seats):
            if line.participant < len(played):
                (result,) = [result for result in played[line.participant] if result.game_id == game.game_id]
                assert (result.seat, result.place, result.points, result.error) == (number, line.place, line.points, None)
    assert [len(results) for results in played] == [GAMES] * len(played)


def test_four_participants_play_a_tournament_to_its_end(address: str, play: Player) -> None:
    with chefshat.Client(address) as client:
        made = client.tournaments.create(settings())
        tournament_id = made.tournament.tournament_id
        joined = [client.tournaments.join(made.join_code, f"player {number}", max_games=2) for number in range(4)]
        assert [entry.participant for entry in joined] == [0, 1, 2, 3]
        with ThreadPoolExecutor(4) as pool:
            playing = [pool.submit(play, address, entry.ticket, Checking) for entry in joined]
            *_, last = client.tournaments.follow(tournament_id)
            played = [results.result(LIMIT_S) for results in playing]
        assert (last.tournament.state, last.tournament.games_over) == (pb.TOURNAMENT_STATE_FINISHED, GAMES)
        compare(client, tournament_id, played)
        results = client.tournaments.results(tournament_id)
        assert sorted(line.place for line in results.standings) == [1, 2, 3, 4]
        assert [line.games for line in results.standings] == [GAMES] * 4
        assert len(client.tournaments.leaderboard().rated) >= 4


@pytest.mark.parametrize("moment", ["before", "after"])
def test_a_broken_stream_is_restored(fake: FakeServer, play: Player, moment: str) -> None:
    broken: set[tuple[str, int]] = set()

    def fault(game: FakeGame, seat: FakeSeat, answer: pb.Answer) -> str:
        mark = (game.room.game_id, answer.decision_id)
        if answer.decision_id % 2 == 0 or mark in broken:
            return ""
        broken.add(mark)
        return moment

    fake.fault = fault
    with chefshat.Client(fake.address) as client:
        made = client.tournaments.create(settings("random", "random", "random"))
        joined = client.tournaments.join(made.join_code, "Ada", max_games=2)
        played = play(fake.address, joined.ticket, Checking)
        assert len(broken) == 3 * GAMES
        assert fake.streams > len(broken)
        compare(client, made.tournament.tournament_id, [played])
    assert sum(result.reconnects for result in played) >= len(broken)


class Cutter(Checking):
    """Cuts all connections before every fourth decision."""

    def __init__(self, seat: SeatInfo, proxy: Proxy) -> None:
        super().__init__(seat)
        self.proxy = proxy

    def decide(self, request: Decision) -> int:
        if request.decision_id % 4 == 0:
            self.proxy.cut()
        return super().decide(request)


@pytest.mark.server
def test_a_cut_connection_is_restored_with_the_real_server(real_address: str, play: Player) -> None:
    agents: list[Cutter] = []
    with chefshat.Client(real_address) as client, Proxy(real_address) as proxy:

        def make(seat: SeatInfo) -> Cutter:
            agents.append(Cutter(seat, proxy))
            return agents[-1]

        made = client.tournaments.create(settings("greedy", "random", "random"))
        built_in = 3
        joined = client.tournaments.join(made.join_code, "Ada", max_games=2)
        assert joined.participant == built_in
        played = play(proxy.address, joined.ticket, make)
        assert proxy.cuts > GAMES
        assert len(agents) == len(played) == GAMES
        games = {game.game_id: game for game in client.tournaments.games(made.tournament.tournament_id)}
        assert sorted(games) == sorted(result.game_id for result in played)
        for result in played:
            line = games[result.game_id].seats[result.seat]
            assert (line.participant, line.place, line.points) == (built_in, result.place, result.points)
            assert not line.substituted


class Waiting(RandomAgent):
    """Waits at its first decision until it is released."""

    reached = threading.Event()
    go_on = threading.Event()

    def decide(self, request: Decision) -> int:
        self.reached.set()
        assert self.go_on.wait(LIMIT_S)
        return super().decide(request)


def test_the_newest_connection_plays(address: str, play: Player) -> None:
    Waiting.reached.clear()
    Waiting.go_on.clear()
    with chefshat.Client(address) as client, ThreadPoolExecutor(1) as pool:
        made = client.tournaments.create(settings("random", "random", "random"))
        ticket = client.tournaments.join(made.join_code, "Ada").ticket
        older = pool.submit(play, address, ticket, lambda seat: Waiting())
        assert Waiting.reached.wait(LIMIT_S)
        newer = play_blocking(address, ticket, Checking)
        Waiting.go_on.set()
        assert len(newer) == GAMES
        with pytest.raises(ChefsHatError, match="SUPERSEDED"):
            older.result(LIMIT_S)


def test_closing_a_tournament_ends_it_for_its_participants(address: str, play: Player) -> None:
    Waiting.reached.clear()
    Waiting.go_on.clear()
    with chefshat.Client(address) as client, ThreadPoolExecutor(1) as pool:
        made = client.tournaments.create(settings("random", "random", "random", start_when_joined=0))
        tournament_id = made.tournament.tournament_id
        ticket = client.tournaments.join(made.join_code, "Ada").ticket
        playing = pool.submit(play, address, ticket, lambda seat: Waiting())
        with pytest.raises(ChefsHatError, match="OWNER_TOKEN_WRONG"):
            client.tournaments.start(tournament_id, "not it")
        assert client.tournaments.start(tournament_id, made.owner_token).state == pb.TOURNAMENT_STATE_PLAYING
        assert Waiting.reached.wait(LIMIT_S)
        closed = client.tournaments.close(tournament_id, made.owner_token)
        assert closed.state == pb.TOURNAMENT_STATE_CLOSED
        Waiting.go_on.set()
        (result,) = playing.result(LIMIT_S)
        assert (result.finished, result.abort_reason) == (False, "CLOSED")
        assert client.tournaments.get(tournament_id).state == pb.TOURNAMENT_STATE_CLOSED
        # A late participant has no games.
        assert play(address, ticket, Checking) == []


@pytest.mark.server
def test_the_organiser_has_the_ticket_of_a_physical_table(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        wanted = settings("random", "random", "random", start_when_joined=0)
        wanted.physical_tables = 1
        made = client.tournaments.create(wanted)
        tournament_id, owner = made.tournament.tournament_id, made.owner_token
        added = client.tournaments.add_table_participant(tournament_id, owner, "Pepper", kind=pb.PARTICIPANT_KIND_ROBOT)
        robot = added.tournament.participants[added.participant]
        assert (robot.name, robot.kind, robot.at_table) == ("Pepper", pb.PARTICIPANT_KIND_ROBOT, True)
        client.tournaments.start(tournament_id, owner)
        for _ in client.tournaments.follow(tournament_id):
            try:
                table = client.tournaments.physical_table(tournament_id, owner, 0)
                break
            except ChefsHatError as refused:
                # Another report follows when the game has a room.
                if refused.reason != "GAME_NOT_STARTED":
                    raise
        state = next(iter(client.tables.watch(table.table_ticket)))
        assert state.room.room_id == table.room_id
        assert "Pepper" in [seat.name for seat in state.room.seats]
        with pytest.raises(ChefsHatError, match="OWNER_TOKEN_WRONG"):
            client.tournaments.physical_table(tournament_id, "not it", 0)
        client.rooms.close(table.room_id, table.owner_token)
        client.tournaments.close(tournament_id, owner)


def test_an_unknown_ticket_is_refused(address: str, play: Player) -> None:
    with pytest.raises(ChefsHatError, match="TICKET_UNKNOWN"):
        play(address, "nobody's", Checking)


def test_exceptions_of_make_agent_propagate(fake: FakeServer, play: Player) -> None:
    def make(seat: SeatInfo) -> RandomAgent:
        raise LookupError(f"no agent for seat {seat.seat}")

    with chefshat.Client(fake.address) as client:
        made = client.tournaments.create(settings("random", "random", "random"))
        ticket = client.tournaments.join(made.join_code, "Ada").ticket
        with pytest.raises(LookupError, match="no agent for seat 0"):
            play(fake.address, ticket, make)


def test_the_calls_of_the_blocking_client(fake: FakeServer) -> None:
    with chefshat.Client(fake.address) as client:
        made = [client.tournaments.create(settings()).tournament.tournament_id for _ in range(3)]
        assert [tournament.tournament_id for tournament in client.tournaments.list()] == made[::-1]
        assert len(list(client.tournaments.list(pb.TOURNAMENT_STATE_OPEN))) == 3
        assert not list(client.tournaments.list(pb.TOURNAMENT_STATE_CLOSED))
        assert client.tournaments.get(made[1]).settings.name == "Coppa"
        joined = client.tournaments.join("CUP2", "Ada", max_games=3, stateless=True, kind=pb.PARTICIPANT_KIND_ROBOT)
        assert joined.tournament.tournament_id == made[1]
        (asked,) = fake.tournaments.joins
        assert (asked.name, asked.max_games, asked.stateless, asked.kind) == ("Ada", 3, True, pb.PARTICIPANT_KIND_ROBOT)
        with pytest.raises(ChefsHatError, match="JOIN_CODE_WRONG"):
            client.tournaments.join("WRONG", "Ada")
        with pytest.raises(ChefsHatError, match="TOURNAMENT_UNKNOWN"):
            list(client.tournaments.follow("nowhere"))
        with pytest.raises(ValueError, match="max_games"):
            client.tournaments.join("CUP2", "Ada", max_games=0)
        with pytest.raises(ChefsHatError, match="NO_PHYSICAL_TABLES"):
            client.tournaments.add_table_participant(made[0], "owner", "Ada")


async def listed(items: AsyncIterator[Item]) -> list[Item]:
    return [item async for item in items]


def test_a_server_whose_every_stream_breaks_is_given_up(fake: FakeServer) -> None:
    fake.tournaments.breaks = True
    few = Backoff(first_s=0.001, max_s=0.002, attempts=3)

    async def follow(tournament_id: str) -> int:
        async with aio.Client(fake.address, backoff=few) as client:
            with pytest.raises(ChefsHatError, match="the connection is lost"):
                await listed(client.tournaments.follow(tournament_id))
        return fake.tournaments.followed

    with chefshat.Client(fake.address, backoff=few) as client:
        tournament_id = client.tournaments.create(settings()).tournament.tournament_id
        with pytest.raises(ChefsHatError, match="the connection is lost"):
            list(client.tournaments.follow(tournament_id))
        assert fake.tournaments.followed == 1 + few.attempts
    assert asyncio.run(follow(tournament_id)) == 2 * (1 + few.attempts)


@pytest.mark.parametrize("asynchronous", [False, True])
def test_the_server_sees_a_client_leave_a_stream_early(fake: FakeServer, asynchronous: bool) -> None:
    async def follow(tournament_id: str) -> None:
        async with aio.Client(fake.address) as client:
            async for _ in client.tournaments.follow(tournament_id):
                break
            assert await asyncio.to_thread(fake.tournaments.follower_left.wait, LIMIT_S)

    with chefshat.Client(fake.address) as client:
        tournament_id = client.tournaments.create(settings()).tournament.tournament_id
        if asynchronous:
            asyncio.run(follow(tournament_id))
            return
        for _ in client.tournaments.follow(tournament_id):
            break
        assert fake.tournaments.follower_left.wait(LIMIT_S)


async def test_a_stream_of_a_closed_client_says_so(fake: FakeServer) -> None:
    client = aio.Client(fake.address)
    tournament_id = (await client.tournaments.create(settings())).tournament.tournament_id
    reports = client.tournaments.follow(tournament_id)
    await anext(reports)
    await client.close()
    with pytest.raises(ChefsHatError, match="CLIENT_CLOSED"):
        await listed(reports)


async def test_the_calls_of_the_asyncio_client(fake: FakeServer) -> None:
    async with aio.Client(fake.address, backoff=QUICK) as client:
        ids = [(await client.tournaments.create(settings("random", "random", "random"))).tournament.tournament_id for _ in range(3)]
        assert [tournament.tournament_id for tournament in await listed(client.tournaments.list())] == ids[::-1]
        assert not await listed(client.tournaments.list(pb.TOURNAMENT_STATE_CLOSED))
        joined = await client.tournaments.join("CUP1", "Ada")
        following = asyncio.create_task(listed(client.tournaments.follow(ids[0])))
        played = await client.play_tournament(joined.ticket, Checking)
        reports = await following
        assert reports[-1].tournament.state == pb.TOURNAMENT_STATE_FINISHED
        games = await listed(client.tournaments.games(ids[0]))
        assert [game.game_id for game in games] == [result.game_id for result in played]
        assert len((await client.tournaments.results(ids[0])).standings) == 4
        assert (await client.tournaments.leaderboard()).games == 4
        assert (await client.tournaments.start(ids[1], "owner")).state == pb.TOURNAMENT_STATE_PLAYING
        assert (await client.tournaments.close(ids[1], "owner")).state == pb.TOURNAMENT_STATE_CLOSED
        assert (await client.tournaments.get(ids[1])).state == pb.TOURNAMENT_STATE_CLOSED
        with pytest.raises(ChefsHatError, match="TOURNAMENT_UNKNOWN"):
            await listed(client.tournaments.follow("nowhere"))
        with pytest.raises(ChefsHatError, match="GAME_NOT_PHYSICAL"):
            await client.tournaments.physical_table(ids[0], "owner", 0)


@pytest.mark.parametrize("more", [["--seed", "3"], ["--agent", "samples.careful_agent:Careful"]])
def test_the_command_takes_part(address: str, more: list[str]) -> None:
    with chefshat.Client(address) as client:
        made = client.tournaments.create(settings("random", "random", "random"))
        arguments = ["--address", address, "--tournament", made.join_code, "--name", "Ada", "--games", "2", "--json", *more]
        done = subprocess.run(
            [sys.executable, "-m", "chefshat.agent", *arguments], capture_output=True, text=True, timeout=LIMIT_S, cwd=PACKAGE
        )
        assert done.returncode == 0, done.stderr
        outcome = json.loads(done.stdout)
        results = client.tournaments.results(made.tournament.tournament_id)
    assert (outcome["event"], outcome["tournament_id"]) == ("finished", made.tournament.tournament_id)
    assert [game["event"] for game in outcome["games"]] == ["finished"] * GAMES
    assert [line["participant"] for line in outcome["standings"]] == [line.participant for line in results.standings]
    assert outcome["place"] == next(line.place for line in results.standings if line.participant == outcome["participant"])


def test_the_command_prints_a_table(fake: FakeServer, capsys: pytest.CaptureFixture[str]) -> None:
    with chefshat.Client(fake.address) as client:
        made = client.tournaments.create(settings("random", "random", "random"))
    assert command.main(["--address", fake.address, "--tournament", made.join_code, "--name", "Ada"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["place", "score", "points", "games", "name"]
    assert lines[1].split() == ["1", "5.00", "0.00", "6", "Ada", "<-", "this", "agent"]
    assert len(lines) == 5
