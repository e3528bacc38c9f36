"""Both clients over real connections to the fake server: whole games, broken streams, refused seats, agents that fail."""

import asyncio
import math
import threading

import pytest
from fake_game import QUESTIONS, FakeGame, FakeSeat
from fake_server import FakeServer
from playing import QUICK, Player, play_asyncio, play_blocking

import chefshat
from chefshat import Agent, ChefsHatError, Decision, RandomAgent, SeatResult, aio, backoff, pb


@pytest.fixture(params=[play_blocking, play_asyncio], ids=["blocking", "asyncio"])
def play(request: pytest.FixtureRequest) -> Player:
    """The test runs once with each client."""
    player: Player = request.param
    return player


class Listener(Agent):
    """Takes the first legal action, and records events and decisions."""

    def __init__(self) -> None:
        self.events: list[int] = []
        self.asked: list[int] = []

    def decide(self, request: Decision) -> int:
        self.asked.append(request.decision_id)
        return int(request.legal_actions[0])

    def on_event(self, event: pb.GameEvent) -> None:
        self.events.append(event.sequence)


class Thinker(Listener):
    """`Listener` as a coroutine."""

    async def decide(self, request: Decision) -> int:  # type: ignore[override]
        await asyncio.sleep(0)
        return super().decide(request)


def seats(server: FakeServer, *, games: int = 1, played: int = 4) -> list[str]:
    """Creates rooms and joins them; returns the tickets."""
    tickets = []
    with chefshat.Client(server.address) as client:
        for _ in range(games):
            room = client.rooms.create(seats=[None] * played + ["random"] * (4 - played))
            tickets += [client.rooms.join(room.join_code, f"player {seat}").ticket for seat in range(played)]
    return tickets


def test_several_seats_of_several_games_over_one_stream(fake: FakeServer, play: Player) -> None:
    tickets = seats(fake, games=3)
    results = play(fake.address, {ticket: RandomAgent(seed) for seed, ticket in enumerate(tickets)})
    assert list(results) == tickets
    assert [result.place for result in results.values()] == [1, 2, 3, 4] * 3
    assert all(result.decisions == QUESTIONS and result.reconnects == 0 for result in results.values())
    assert fake.streams == 1


def test_coroutines_play_too(fake: FakeServer) -> None:
    agents = {ticket: Thinker() for ticket in seats(fake)}
    results = play_asyncio(fake.address, agents)
    assert all(result.finished and result.decisions == QUESTIONS for result in results.values())
    assert all(agent.asked == list(range(1, QUESTIONS + 1)) for agent in agents.values())


def test_a_coroutine_in_the_blocking_client_is_refused(fake: FakeServer) -> None:
    (ticket,) = seats(fake, played=1)
    with pytest.raises(TypeError, match=r"chefshat\.aio"):
        play_blocking(fake.address, {ticket: Thinker()})


@pytest.mark.parametrize("moment", ["before", "after"])
@pytest.mark.parametrize(("play", "agent_class"), [(play_blocking, Listener), (play_asyncio, Listener), (play_asyncio, Thinker)])
def test_a_broken_stream_is_restored(fake: FakeServer, play: Player, moment: str, agent_class: type[Listener]) -> None:
    broken: set[tuple[int, int]] = set()

    def fault(game: FakeGame, seat: FakeSeat, answer: pb.Answer) -> str:
        mark = (seat.number, answer.decision_id)
        if answer.decision_id % 2 == 0 or mark in broken:
            return ""
        broken.add(mark)
        return moment

    fake.fault = fault
    agents = {ticket: agent_class() for ticket in seats(fake)}
    results = play(fake.address, agents)
    breaks = 4 * 3
    assert len(broken) == breaks
    assert fake.streams == 1 + breaks
    (game,) = fake.games
    plays = [event.play for event in game.events if event.HasField("play")]
    assert len(plays) == 4 * QUESTIONS
    assert all(entry.source == pb.DECISION_SOURCE_AGENT for entry in plays)
    for ticket, agent in agents.items():
        assert results[ticket].finished
        # Every event arrives once and in order, no decision is computed twice, every answer is acknowledged.
        assert agent.events == list(range(1, len(game.events) + 1))
        assert agent.asked == list(range(1, QUESTIONS + 1))
        # The acknowledgement of the last answer is lost with its connection: the game ends before the answer is repeated.
        unacknowledged = 1 if moment == "after" and results[ticket].seat == 3 else 0
        assert results[ticket].decisions == QUESTIONS - unacknowledged
        assert results[ticket].invalid == results[ticket].late == 0
    for seat in game.seats.values():
        # Each connection requests the missing events.
        wanted = [attach.from_sequence for attach in seat.attaches]
        assert wanted[0] == 0
        assert wanted == sorted(wanted)
        assert wanted[-1] > 4 * QUESTIONS - 4


def test_connections_without_progress_are_given_up(fake: FakeServer, play: Player, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backoff, "STABLE_S", math.inf)
    fake.fault = lambda game, seat, answer: "before"
    (ticket,) = seats(fake, played=1)
    result = play(fake.address, {ticket: Listener()})[ticket]
    assert result.error is not None
    assert result.error.reason == "UNAVAILABLE"
    # The first stream had the start of the game, which is progress; the ten allowed attempts after it had none.
    assert fake.streams == 1 + QUICK.attempts


def test_connections_that_last_are_never_given_up(fake: FakeServer, play: Player, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(backoff, "STABLE_S", 0.0)
    fake.fault = lambda game, seat, answer: "before" if fake.streams < 2 * QUICK.attempts else ""
    (ticket,) = seats(fake, played=1)
    assert play(fake.address, {ticket: Listener()})[ticket].finished
    assert fake.streams == 2 * QUICK.attempts


class Talkative(Listener):
    """Annotates each answer with more than a message or a record may contain."""

    def decide(self, request: Decision) -> int:
        if request.decision_id % 2:
            request.annotate(extra={"why": "because " * 10_000})
        else:
            request.annotate(value_estimate=float("nan"))
        return super().decide(request)


def test_too_large_annotations_are_dropped_without_losing_the_answer_or_the_stream(fake: FakeServer, play: Player) -> None:
    agents = {ticket: Talkative() for ticket in seats(fake)}
    results = play(fake.address, agents)
    assert fake.streams == 1
    for result in results.values():
        assert (result.finished, result.decisions, result.annotations_dropped) == (True, QUESTIONS, QUESTIONS)
    assert not any(answer.HasField("annotations") for seat in fake.games[0].seats.values() for answer in seat.answers)


class Stubborn(Agent):
    """Answers with illegal actions, and counts them."""

    def __init__(self) -> None:
        self.attempts_left: list[int | None] = []

    def decide(self, request: Decision) -> int:
        self.attempts_left.append(request.invalid_attempts_left)
        return int((~request.mask).nonzero()[0][0])


def test_invalid_decisions_are_asked_again_up_to_the_limit(fake: FakeServer, play: Player) -> None:
    (ticket,) = seats(fake, played=1)
    agent = Stubborn()
    result = play(fake.address, {ticket: agent})[ticket]
    assert result.finished
    assert (result.decisions, result.invalid) == (0, 3 * QUESTIONS)
    assert agent.attempts_left == [3, 2, 1] * QUESTIONS


class Broken(Agent):
    """Raises."""

    def decide(self, request: Decision) -> int:
        raise ZeroDivisionError("an agent's own mistake") from KeyError("what led to it")


class BrokenLater(Broken):
    """Raises in a coroutine."""

    async def decide(self, request: Decision) -> int:  # type: ignore[override]
        await asyncio.sleep(0)
        return super().decide(request)


def test_exceptions_of_agents_propagate(fake: FakeServer, play: Player) -> None:
    (ticket,) = seats(fake, played=1)
    with pytest.raises(ZeroDivisionError, match="own mistake") as raised:
        play(fake.address, {ticket: Broken()})
    assert isinstance(raised.value.__cause__, KeyError)


def test_exceptions_of_coroutines_propagate(fake: FakeServer) -> None:
    (ticket,) = seats(fake, played=1)
    with pytest.raises(ZeroDivisionError, match="own mistake") as raised:
        play_asyncio(fake.address, {ticket: BrokenLater()})
    assert isinstance(raised.value.__cause__, KeyError)


class Offline(aio.Client):
    """Never reconnects. Lets the test wait until the connection is lost."""

    def __init__(self, address: str) -> None:
        super().__init__(address)
        self.offline = asyncio.Event()
        self._connection.wait = self._stay_offline  # type: ignore[method-assign]

    async def _stay_offline(self, failures: int, error: ChefsHatError) -> None:
        self.offline.set()
        await asyncio.Event().wait()


class BrokenOffline(Agent):
    """Raises when the connection has been lost."""

    def __init__(self, client: Offline) -> None:
        self._client = client

    async def decide(self, request: Decision) -> int:
        await self._client.offline.wait()
        raise ZeroDivisionError("an agent's own mistake")


def test_exceptions_between_connections_propagate(fake: FakeServer) -> None:
    first, second = (ticket for _ in range(2) for ticket in seats(fake, played=1))
    fake.fault = lambda game, seat, answer: "before"

    async def run() -> None:
        async with asyncio.timeout(60), Offline(fake.address) as client:
            await client.play_many({first: BrokenOffline(client), second: RandomAgent()})

    with pytest.raises(ZeroDivisionError, match="own mistake"):
        asyncio.run(run())


class Slow(Agent):
    """Never answers."""

    def __init__(self) -> None:
        self.asked = asyncio.Event()

    async def decide(self, request: Decision) -> int:
        self.asked.set()
        await asyncio.Event().wait()
        raise AssertionError("unreachable")


def test_closing_the_client_ends_a_game_of_asyncio_with_an_error(fake: FakeServer) -> None:
    (ticket,) = seats(fake, played=1)

    async def run() -> None:
        agent, client = Slow(), aio.Client(fake.address)
        playing = asyncio.create_task(client.play(agent, ticket))
        await agent.asked.wait()
        await client.close()
        await asyncio.wait_for(playing, 60)

    with pytest.raises(ChefsHatError, match="CLIENT_CLOSED"):
        asyncio.run(run())


def test_an_unknown_ticket_stops_only_its_seat(fake: FakeServer, play: Player) -> None:
    (ticket,) = seats(fake, played=1)
    results = play(fake.address, {"nonsense": RandomAgent(), ticket: RandomAgent()})
    assert results[ticket].finished
    with pytest.raises(ChefsHatError, match="TICKET_UNKNOWN"):
        results["nonsense"].raise_for_error()


class Waiting(Agent):
    """Waits for the test before its first answer."""

    def __init__(self) -> None:
        self.reached = threading.Event()
        self.go_on = threading.Event()

    def decide(self, request: Decision) -> int:
        self.reached.set()
        assert self.go_on.wait(60)
        return int(request.legal_actions[0])


def test_the_newest_connection_takes_the_seat(fake: FakeServer, play: Player) -> None:
    (ticket,) = seats(fake, played=1)
    waiting = Waiting()
    older: list[SeatResult] = []
    thread = threading.Thread(target=lambda: older.append(play(fake.address, {ticket: waiting})[ticket]))
    thread.start()
    assert waiting.reached.wait(60)
    newer = play_blocking(fake.address, {ticket: RandomAgent()})[ticket]
    waiting.go_on.set()
    thread.join(60)
    assert newer.finished
    (result,) = older
    assert result.error is not None
    assert result.error.reason == "SUPERSEDED"
    with pytest.raises(ChefsHatError, match="SUPERSEDED"):
        result.raise_for_error()


def test_a_closed_room_is_an_aborted_game(fake: FakeServer, play: Player) -> None:
    with chefshat.Client(fake.address) as client:
        room = client.rooms.create(seats=[None, None, "random", "random"])
        ticket = client.rooms.join(room.join_code, "Ada").ticket
        client.rooms.join(room.join_code, "nobody who ever attaches")
        over: list[SeatResult] = []
        thread = threading.Thread(target=lambda: over.append(play(fake.address, {ticket: RandomAgent()})[ticket]))
        thread.start()
        client.rooms.close(room.room.room_id, room.owner_token)
        thread.join(60)
    (result,) = over
    assert not result.finished
    assert result.abort_reason == "CLOSED"
    assert result.error is None


def test_the_rest_of_the_blocking_client(fake: FakeServer) -> None:
    with chefshat.Client(fake.address) as client:
        made = [client.rooms.create(f"room {number}").room.room_id for number in range(5)]
        assert [room.room_id for room in client.rooms.list()] == made[::-1]
        assert client.rooms.get(made[2]).name == "room 2"
        assert client.server_info().server_version == "fake"
        assert client.action_table().action_space.size == 214
        room = client.rooms.create(seats=[None, "random", "random", "random"])
        joined = client.rooms.join(room.join_code, "Ada")
        client.send_expression(joined.ticket, pb.Expression(label="joy"))
        assert client.play(RandomAgent(1), joined.ticket).place == 1
        watched = [event.sequence for event in client.rooms.watch(room.room.room_id)]
        assert watched == list(range(1, len(watched) + 1))
        assert [event.sequence for event in client.rooms.watch(room.room.room_id, from_sequence=4)] == watched[3:]
        fake.gone = 2
        assert [event.sequence for event in client.rooms.watch(room.room.room_id)] == watched[2:]
        assert fake.watched_from[-2:] == [0, 3]
        lines = list(client.records.read(room.room.game_id))
        assert len(lines) == len(watched) + 2
        assert lines[1].event.HasField("expression_shown")
        names = [summary.room_name for summary in client.records.list()]
        assert names == [f"room {number}" for number in range(5)] + [""]
        assert [summary.room_name for summary in client.records.list(newest_first=True)] == names[::-1]
        (summary,) = client.records.list(pb.RecordFilter(room_name="room 3"))
        assert summary.game_id == client.rooms.get(made[3]).game_id


async def test_the_rest_of_the_asyncio_client(fake: FakeServer) -> None:
    async with aio.Client(fake.address) as client:
        made = [(await client.rooms.create(f"room {number}")).room.room_id for number in range(5)]
        assert [room.room_id async for room in client.rooms.list()] == made[::-1]
        assert (await client.rooms.get(made[2])).name == "room 2"
        assert (await client.server_info()).server_version == "fake"
        assert (await client.action_table()).action_space.size == 214
        room = await client.rooms.create(seats=[None, "random", "random", "random"])
        joined = await client.rooms.join(room.join_code, "Ada")
        await client.send_expression(joined.ticket, pb.Expression(label="joy"))
        assert (await client.play(RandomAgent(1), joined.ticket)).place == 1
        watched = [event.sequence async for event in client.rooms.watch(room.room.room_id)]
        assert watched == list(range(1, len(watched) + 1))
        assert [event.sequence async for event in client.rooms.watch(room.room.room_id, from_sequence=4)] == watched[3:]
        fake.gone = 2
        assert [event.sequence async for event in client.rooms.watch(room.room.room_id)] == watched[2:]
        assert fake.watched_from[-2:] == [0, 3]
        assert len([line async for line in client.records.read(room.room.game_id)]) == len(watched) + 2
        names = [summary.room_name async for summary in client.records.list()]
        assert names == [f"room {number}" for number in range(5)] + [""]
        assert [summary.room_name async for summary in client.records.list(newest_first=True)] == names[::-1]
        wanted = pb.RecordFilter(room_name="room 3")
        assert [summary.room_name async for summary in client.records.list(wanted)] == ["room 3"]


POINT = pb.BranchPoint(game_id="0f" * 16, decisions=40, same_deals=True)
HANDS = pb.ScriptedShift(hands=[pb.SeatCards(seat=0, cards=[1, 4, 12], golden=True)])
PLAYER = pb.RecordedPlayer(game_id="0f" * 16, seat=2)


async def test_the_start_of_a_game_is_sent_to_the_server(fake: FakeServer) -> None:
    slow = pb.RoomPolicy(pace_ms=500)
    with chefshat.Client(fake.address) as client:
        client.rooms.create(seats=[PLAYER, "greedy", None, None], branch=POINT)
        client.rooms.create(hands=HANDS, durability=pb.DURABILITY_EPHEMERAL)
        client.rooms.create(policy=slow, durability=pb.DURABILITY_EPHEMERAL)
        client.rooms.create(policy=slow, visibility=pb.VISIBILITY_PRIVATE)
        client.rooms.create(policy=slow)
        with pytest.raises(ValueError, match="not both"):
            client.rooms.create(branch=POINT, hands=HANDS)
    async with aio.Client(fake.address) as client:
        await client.rooms.create(seats=[PLAYER, "greedy", None, None], branch=POINT)
    branched, scripted, slow_ephemeral, private, plain, branched_too = fake.created
    assert len(branched.request_id) == 32
    assert branched.request_id != branched_too.request_id, "each call draws its own"
    branched_too.request_id = branched.request_id
    assert branched == branched_too
    assert branched.branch == POINT
    assert not branched.HasField("rules")
    assert branched.seats[0].replay == PLAYER
    assert branched.seats[1].built_in_agent == "greedy"
    assert scripted.scripted == HANDS
    assert scripted.policy == pb.RoomPolicy(durability=pb.DURABILITY_EPHEMERAL)
    assert slow_ephemeral.policy == pb.RoomPolicy(pace_ms=500, durability=pb.DURABILITY_EPHEMERAL)
    assert private.policy == pb.RoomPolicy(pace_ms=500, visibility=pb.VISIBILITY_PRIVATE)
    assert plain.policy == slow == pb.RoomPolicy(pace_ms=500)
    assert plain.WhichOneof("start") is None
