"""Games and tournaments that continue when their server is killed and restarted: agents only lose connections."""

import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from playing import Player, play_asyncio, play_blocking
from real_server import RealServer
from waiting import LIMIT_S

import chefshat
from chefshat import Backoff, Decision, RandomAgent, SeatInfo, SeatResult, pb

pytestmark = pytest.mark.server

# Retries for as long as a server may take to start on a slow machine.
PATIENT = Backoff(first_s=0.005, max_s=0.05, attempts=2000)
# Acknowledged decisions of the game after which the server is killed.
KILLS = (5, 20, 21, 60)


class Ledger:
    """The log of all agents. At certain counts the agents wait until the server has been killed."""

    def __init__(self) -> None:
        # The action of each acknowledged decision, by seat (or game and seat) and number.
        self.accepted: dict[tuple[object, int], int] = {}
        self.lock = threading.Lock()
        self.reached = {count: threading.Event() for count in KILLS}
        self.killed = {count: threading.Event() for count in KILLS}

    def accept(self, who: object, result: pb.AnswerResult) -> None:
        """Records an acknowledged decision."""
        assert result.status == pb.ANSWER_STATUS_ACCEPTED
        with self.lock:
            self.accepted[who, result.decision_id] = result.action
            count = len(self.accepted)
        if count in self.reached:
            self.reached[count].set()
            assert self.killed[count].wait(LIMIT_S)


class Noting(RandomAgent):
    """Plays at random and stores the acknowledgements."""

    def __init__(self, seed: int, ledger: Ledger, who: object) -> None:
        super().__init__(seed)
        self.who = who
        self.ledger = ledger
        self.asked: Counter[int] = Counter()
        self.sequences: list[int] = []

    def decide(self, request: Decision) -> int:
        self.asked[request.decision_id] += 1
        return super().decide(request)

    def on_event(self, event: pb.GameEvent) -> None:
        self.sequences.append(event.sequence)

    def on_result(self, result: pb.AnswerResult) -> None:
        self.ledger.accept(self.who, result)


def kill_at_each_count(server: RealServer, ledger: Ledger) -> None:
    """Kills the server and starts it again while the agents wait."""
    for count in KILLS:
        assert ledger.reached[count].wait(LIMIT_S)
        server.kill()
        ledger.killed[count].set()
        server.start()


@pytest.mark.parametrize("play", [play_blocking, play_asyncio], ids=["blocking", "asyncio"])
def test_agents_play_on_through_restarts(play: Player, real_binary: Path, tmp_path: Path) -> None:
    ledger = Ledger()
    results: dict[str, SeatResult] = {}
    # A separate address, so that no outgoing connection takes the server's port while it is down.
    with RealServer(real_binary, tmp_path, host="127.0.0.2") as server:
        with chefshat.Client(server.address) as client:
            room = client.rooms.create(rules=pb.RuleSet(target_shifts=2))
            tickets = [client.rooms.join(room.join_code, f"player {seat}", seat=seat).ticket for seat in range(4)]
        agents = {ticket: Noting(seat, ledger, seat) for seat, ticket in enumerate(tickets)}
        playing = threading.Thread(target=lambda: results.update(play(server.address, agents, PATIENT)))
        playing.start()
        kill_at_each_count(server, ledger)
        playing.join(LIMIT_S)
        assert not playing.is_alive()
        with chefshat.Client(server.address) as client:
            lines = list(client.records.read(room.room.game_id))
    restarts = sum(line.event.HasField("server_restarted") for line in lines if line.HasField("event"))
    assert restarts == len(KILLS)
    decisions = [line.decision for line in lines if line.HasField("decision")]
    recorded = {(decision.seat, decision.decision_id): decision.action for decision in decisions}
    assert len(recorded) == len(decisions)
    assert all(decision.source == pb.DECISION_SOURCE_AGENT for decision in decisions)
    assert ledger.accepted.items() <= recorded.items()
    for ticket, agent in agents.items():
        assert results[ticket].finished
        assert results[ticket].reconnects >= len(KILLS)
        # No decision was asked twice, and no event was missed or repeated.
        assert set(agent.asked.values()) == {1}
        assert agent.sequences == list(range(1, len(agent.sequences) + 1))


def test_a_tournament_survives_restarts(real_binary: Path, tmp_path: Path) -> None:
    ledger = Ledger()
    agents: dict[tuple[str, int], Noting] = {}

    def make(seat: SeatInfo) -> Noting:
        who = (seat.game_id, seat.seat)
        assert who not in agents, "one agent for each game and seat"
        return agents.setdefault(who, Noting(seat.seat, ledger, who))

    def play(ticket: str) -> list[SeatResult]:
        with chefshat.Client(server.address, backoff=PATIENT) as client:
            return client.play_tournament(ticket, make)

    settings = pb.TournamentSettings(
        name="Coppa",
        format=pb.TOURNAMENT_FORMAT_ROUND_ROBIN,
        rules=pb.RuleSet(target_shifts=1),
        # Long time limits: the test is about losses, not speed.
        policy=pb.RoomPolicy(decision_time_ms=600_000),
        rounds=2,
        games_per_pairing=2,
        built_in_agents=["random", "random"],
        start_when_joined=4,
    )
    with RealServer(real_binary, tmp_path, host="127.0.0.3") as server, ThreadPoolExecutor(2) as pool:
        with chefshat.Client(server.address) as client:
            made = client.tournaments.create(settings)
            names = ("Ada", "Bob")
            tickets = [client.tournaments.join(made.join_code, name, max_games=2).ticket for name in names]
        playing = [pool.submit(play, ticket) for ticket in tickets]
        kill_at_each_count(server, ledger)
        played = [results.result(LIMIT_S) for results in playing]
        with chefshat.Client(server.address) as client:
            games = list(client.tournaments.games(made.tournament.tournament_id))
            recorded = {
                ((game.game_id, line.decision.seat), line.decision.decision_id): line.decision.action
                for game in games
                for line in client.records.read(game.game_id)
                if line.HasField("decision")
            }
    assert [game.state for game in games] == [pb.TOURNAMENT_GAME_STATE_COUNTED] * 4
    assert all(game.rated for game in games), "nobody forfeited or was substituted"
    for results in played:
        assert sorted(result.game_id for result in results) == sorted(game.game_id for game in games)
        assert all(result.finished for result in results)
    assert ledger.accepted.items() <= recorded.items()
    for agent in agents.values():
        assert set(agent.asked.values()) == {1}
        assert agent.sequences == list(range(1, len(agent.sequences) + 1))


def test_reports_about_a_table_wait_for_the_server(real_binary: Path, tmp_path: Path) -> None:
    seats = [pb.SeatConfig(at_table=pb.PARTICIPANT_KIND_HUMAN, name=name) for name in ("Ada", "Bo", "Cy", "Di")]
    opening = pb.TableReport(laid=pb.CardsLaid(seat=0, cards=pb.SeenCards(cards=[11, 11], golden=True)))
    answer = pb.TableReport(laid=pb.CardsLaid(seat=1, cards=pb.SeenCards(cards=[9, 9])))
    with (
        RealServer(real_binary, tmp_path, host="127.0.0.4") as server,
        chefshat.Client(server.address, backoff=PATIENT) as client,
        ThreadPoolExecutor(1) as pool,
    ):
        ticket = client.rooms.create("real", seats=seats, physical=True).table_ticket
        first = client.tables.report(ticket, opening, report_id="first")
        server.kill()
        waiting = pool.submit(client.tables.report, ticket, answer)
        server.start()
        second = waiting.result(LIMIT_S)
        assert client.tables.report(ticket, opening, report_id="first").report == first.report
        state = next(client.tables.watch(ticket))
    assert first.verdict == second.verdict == pb.REPORT_VERDICT_ACCEPTED
    assert [report.report for report in state.reports] == [first.report, second.report]
