"""Games against the real server: four agents of one process and of four, blocking and asyncio, watched and recorded."""

import asyncio
import json
import subprocess
import sys

import numpy as np
import pytest
from playing import Player, play_asyncio, play_blocking
from proxy import Proxy

import chefshat
from chefshat import Agent, Backoff, Decision, RandomAgent, aio, pb

pytestmark = pytest.mark.server

QUICK = Backoff(first_s=0.001, max_s=0.05, attempts=100)


# The command, but it ends with tracebacks of all threads after two minutes.
DUMPING = """
import faulthandler, sys
from chefshat.agent import main
faulthandler.dump_traceback_later(120, exit=True)
sys.exit(main())
"""


class Checking(RandomAgent):
    """Plays at random and checks the consistency of its events."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.sequences: list[int] = []
        self.ids: list[int] = []
        self.accepted = 0

    def decide(self, request: Decision) -> int:
        self.ids.append(request.decision_id)
        assert request.faces == 11
        assert request.mask.shape == (214,)
        assert len(request.legal_actions) > 0
        assert request.cards_left.shape == request.passed.shape == request.places.shape == request.roles.shape == (4,)
        assert request.hand.sum() == request.cards_left[request.seat]
        vector = request.classic_vector()
        assert vector.shape == (228,)
        assert np.count_nonzero(vector[11:28]) == request.hand.sum()
        assert vector.min() >= 0.0
        assert vector.max() <= 1.0
        return super().decide(request)

    def on_event(self, event: pb.GameEvent) -> None:
        self.sequences.append(event.sequence)

    def on_result(self, result: pb.AnswerResult) -> None:
        assert result.status == pb.ANSWER_STATUS_ACCEPTED
        self.accepted += 1


def check(agents: dict[str, Checking], results: dict[str, chefshat.SeatResult]) -> None:
    """Checks that the four seats of a game agree."""
    assert sorted(result.seat for result in results.values()) == [0, 1, 2, 3]
    assert len({result.standings for result in results.values()}) == 1
    for result in results.values():
        assert len(result.entropy) == 32
        assert result.reveal is not None
        assert result.reveal.seat_entropy[result.seat] == result.entropy
    assert sorted(result.place or 0 for result in results.values()) == [1, 2, 3, 4]
    for ticket, agent in agents.items():
        assert results[ticket].finished
        assert results[ticket].decisions == agent.accepted == len(agent.ids) > 0
        assert agent.ids == list(range(1, len(agent.ids) + 1))
        assert agent.sequences == list(range(1, len(agent.sequences) + 1))
    assert len({len(agent.sequences) for agent in agents.values()}) == 1


def test_a_game_over_one_blocking_stream(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create("blocking")
        agents = {client.rooms.join(room.join_code, f"player {number}").ticket: Checking(number) for number in range(4)}
        results = client.play_many(agents)
        check(agents, results)
        assert client.rooms.get(room.room.room_id).state == pb.ROOM_STATE_FINISHED
        # There are no built-in agents, so the record has the decisions of these four.
        lines = list(client.records.read(room.room.game_id))
        assert lines[0].header.game_id == room.room.game_id
        assert lines[-1].footer.decisions == sum(result.decisions for result in results.values())
        watched = [event.sequence for event in client.rooms.watch(room.room.room_id)]
        # Of a long game, the room has the latest events.
        assert watched
        assert watched == next(iter(agents.values())).sequences[-len(watched) :]


async def test_a_game_over_one_asyncio_stream(real_address: str) -> None:
    async with aio.Client(real_address) as client:
        room = await client.rooms.create("asyncio")
        agents = {}
        for number in range(4):
            agents[(await client.rooms.join(room.join_code, f"player {number}")).ticket] = Checking(number)
        check(agents, await client.play_many(agents))


async def test_a_game_of_four_asyncio_streams(real_address: str) -> None:
    async with aio.Client(real_address) as client:
        room = await client.rooms.create("four streams", rules=pb.RuleSet(target_shifts=2))
        agents = {}
        for number in range(4):
            agents[(await client.rooms.join(room.join_code, f"player {number}")).ticket] = Checking(number)
        games = [client.play_many({ticket: agent}) for ticket, agent in agents.items()]
        results: dict[str, chefshat.SeatResult] = {}
        for result in await asyncio.gather(*games):
            results |= result
        check(agents, results)


def test_a_game_of_four_processes(real_address: str, processes: list[subprocess.Popen[str]]) -> None:
    with chefshat.Client(real_address) as client:
        code = client.rooms.create("four processes").join_code
    for number in range(4):
        arguments = ["--address", real_address, "--code", code, "--name", f"player {number}", "--seed", str(number), "--json"]
        # If a process hangs, its output has the tracebacks of its threads.
        arguments = [sys.executable, "-c", DUMPING, *arguments]
        processes.append(subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))
    outputs = [process.communicate() for process in processes]
    assert [process.returncode for process in processes] == [0] * 4, [errors for _, errors in outputs]
    outcomes = [json.loads(output) for output, _ in outputs]
    assert all(line["event"] == "finished" for line in outcomes)
    assert sorted(line["seat"] for line in outcomes) == [0, 1, 2, 3]
    assert len({json.dumps(line["standings"]) for line in outcomes}) == 1


class Cutter(Checking):
    """Cuts its own connection at times: before an answer, or after its acknowledgement."""

    def __init__(self, seed: int, proxy: Proxy) -> None:
        super().__init__(seed)
        self.proxy = proxy

    def decide(self, request: Decision) -> int:
        if request.decision_id % 7 == 3:
            self.proxy.cut()
        return super().decide(request)

    def on_result(self, result: pb.AnswerResult) -> None:
        super().on_result(result)
        if result.decision_id % 7 == 6:
            self.proxy.cut()


@pytest.mark.parametrize("play", [play_blocking, play_asyncio])
def test_reconnections_miss_no_event(real_address: str, play: Player) -> None:
    with chefshat.Client(real_address) as client, Proxy(real_address) as proxy:
        # Long time limits: the test is about lost decisions, not speed.
        policy = pb.RoomPolicy(decision_time_ms=60_000)
        room = client.rooms.create("cut", rules=pb.RuleSet(target_shifts=2), policy=policy)
        agents: dict[str, Checking] = {}
        for number in range(4):
            agents[client.rooms.join(room.join_code, f"player {number}").ticket] = Cutter(number, proxy)
        results = play(proxy.address, agents, QUICK)
        lines = list(client.records.read(room.room.game_id))
        assert proxy.cuts > 4
        assert all(0 < result.reconnects <= proxy.cuts for result in results.values())
        for ticket, agent in agents.items():
            result = results[ticket]
            assert result.finished
            assert agent.sequences == list(range(1, len(agent.sequences) + 1))
            assert agent.ids == list(range(1, len(agent.ids) + 1))
            recorded = [line.decision for line in lines if line.HasField("decision") and line.decision.seat == result.seat]
            assert len(recorded) == len(agent.ids)
            assert all(decision.source == pb.DECISION_SOURCE_AGENT for decision in recorded)
            assert all(not decision.invalid_attempts for decision in recorded)


class Stubborn(Agent):
    """Answers with illegal actions while attempts remain, and counts them."""

    def __init__(self) -> None:
        self.asked = 0

    def decide(self, request: Decision) -> int:
        self.asked += 1
        return int((~request.mask).nonzero()[0][0])


def test_a_stubborn_agent_reaches_the_limit_of_attempts(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        policy = pb.RoomPolicy(max_invalid_attempts=3)
        rules = pb.RuleSet(target_shifts=1)
        room = client.rooms.create("stubborn", rules=rules, policy=policy, seats=[None, "random", "random", "random"])
        agent = Stubborn()
        result = client.play(agent, client.rooms.join(room.join_code, "Stubborn").ticket)
    assert result.finished
    assert result.decisions == 0
    assert result.invalid == agent.asked > 0
    assert result.invalid % 3 == 0


def test_annotations_and_expressions_are_recorded(real_address: str) -> None:
    class Talkative(RandomAgent):
        def decide(self, request: Decision) -> int:
            request.annotate(value_estimate=0.5, extra={"why": "chance"})
            return super().decide(request)

    with chefshat.Client(real_address) as client:
        room = client.rooms.create("talk", rules=pb.RuleSet(target_shifts=1), seats=[None, "random", "random", "random"])
        ticket = client.rooms.join(room.join_code, "Talkative").ticket
        client.send_expression(ticket, pb.Expression(label="joy", valence=0.5))
        result = client.play(Talkative(1), ticket)
        lines = list(client.records.read(room.room.game_id))
    assert any(line.HasField("event") and line.event.expression_shown.expression.label == "joy" for line in lines)
    noted = [
        line.decision for line in lines if line.HasField("decision") and line.decision.annotations.extra.get("why") == "chance"
    ]
    assert len(noted) == result.decisions
    assert all(decision.seat == result.seat for decision in noted)


def test_refusals(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        with pytest.raises(chefshat.ChefsHatError) as caught:
            client.rooms.create(rules=pb.RuleSet(players=9))
        assert caught.value.reason == "RULE_SET_REFUSED"
        with pytest.raises(chefshat.ChefsHatError, match="JOIN_CODE_WRONG"):
            client.rooms.join("NOSUCHCODE", "Ada")
        with pytest.raises(chefshat.ChefsHatError, match="TICKET_UNKNOWN"):
            client.play(RandomAgent(), "nonsense")
        with pytest.raises(chefshat.ChefsHatError, match="ROOM_UNKNOWN"):
            client.rooms.get("0" * 32)


def test_a_recorded_game_is_branched_and_replayed(real_address: str) -> None:
    with chefshat.Client(real_address) as client:

        def ended(room: pb.Room) -> list[tuple[int, int]]:
            for _ in client.rooms.watch(room.room_id):
                pass
            lines = client.records.read(room.game_id)
            return [(line.decision.seat, line.decision.action) for line in lines if line.HasField("decision")]

        rules, seats = pb.RuleSet(target_shifts=2), ["greedy", "random", "random", "random"]
        first = client.rooms.create("to branch from", rules=rules, seats=seats).room
        course = ended(first)
        players = [pb.RecordedPlayer(game_id=first.game_id, seat=seat) for seat in range(4)]
        again = client.rooms.create(
            "again",
            seats=players,
            branch=pb.BranchPoint(game_id=first.game_id, decisions=30, same_deals=True),
            durability=pb.DURABILITY_EPHEMERAL,
        ).room
        assert again.origin == pb.GAME_ORIGIN_BRANCHED
        assert again.policy.durability == pb.DURABILITY_EPHEMERAL
        assert [seat.replay for seat in again.seats] == players
        assert ended(again) == course
        listed = {summary.game_id: summary for summary in client.records.list(pb.RecordFilter(origin=pb.GAME_ORIGIN_BRANCHED))}
        assert listed[again.game_id].decisions == len(course)
        assert first.game_id not in listed

        # The hands of its second Shift start another game.
        starts = [line.event.shift_started for line in client.records.read(first.game_id) if line.event.HasField("shift_started")]
        hands = pb.ScriptedShift(hands=starts[1].hands)
        scripted = client.rooms.create("given", rules=pb.RuleSet(target_shifts=1), seats=["greedy"] * 4, hands=hands).room
        ended(scripted)
        events = (line.event for line in client.records.read(scripted.game_id))
        (dealt,) = (event.shift_started for event in events if event.HasField("shift_started"))
        assert dealt.hands == starts[1].hands

        with pytest.raises(chefshat.ChefsHatError, match="BRANCH_REFUSED"):
            client.rooms.create(branch=pb.BranchPoint(game_id=first.game_id, decisions=len(course)))


def test_a_seat_that_was_given_up_is_free(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create(seats=[None, "random", "random", "random"])
        left = client.rooms.join(room.join_code, "Ada").ticket
        assert client.rooms.leave(left).seats[0].name == ""
        with pytest.raises(chefshat.ChefsHatError, match="TICKET_UNKNOWN"):
            client.rooms.leave(left)
        assert client.rooms.join(room.join_code, "Ben").seat == 0


class Undecided(Agent):
    """Leaves all decisions open, and counts them and who takes the seat over."""

    def __init__(self) -> None:
        self.asked = 0
        self.changes: list[str | None] = []

    def decide(self, request: Decision) -> None:
        self.asked += 1

    def on_event(self, event: pb.GameEvent) -> None:
        if event.HasField("substituted") or event.HasField("returned"):
            self.changes.append(event.WhichOneof("kind"))


def test_a_seat_whose_decisions_are_left_open_stays_with_the_substitute(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        policy = pb.RoomPolicy(decision_time_ms=20, bank_ms=0, pace_ms=0, abort=pb.ABORT_POLICY_NEVER, max_timeouts=2)
        room = client.rooms.create("undecided", rules=pb.RuleSet(target_shifts=1), policy=policy, seats=[None, *["random"] * 3])
        agent = Undecided()
        result = client.play(agent, client.rooms.join(room.join_code, "Undecided").ticket)
    assert result.finished
    assert result.decisions == 0
    assert agent.asked >= 2
    assert agent.changes == ["substituted"]
