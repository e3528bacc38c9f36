"""The history of a live game is that of a vector environment: the same seeded games, played both ways."""

import asyncio
import sys
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from proxy import Proxy

import chefshat
import chefshat.aio
from chefshat import Client, Decision, SeatInfo, VectorEnv, history, pb
from chefshat.columns import Situations

SEED = bytes(range(32))
WIDTH = 24
AGAINST_GREEDY: dict[str, Any] = {"target_shifts": 6}
RULE_SETS: list[dict[str, Any]] = [
    {"target_shifts": 8},
    {"players": 6, "target_shifts": 9},
    {"players": 2, "faces": 4, "target_shifts": 24},
    {"players": 3, "faces": 5, "jokers": 2, "target_shifts": 12, "pass_scope": pb.PASS_SCOPE_TURN},
]


@cache
def weights(actions: int) -> NDArray[np.float32]:
    """Returns the scores."""
    return np.random.default_rng(5).standard_normal((2 * WIDTH, actions), np.float32)


def policy(situations: Situations) -> NDArray[np.intp]:
    """Chooses a legal action by fixed scores of the tokens. Declares special actions in every other Shift."""
    tokens = history.tokens(situations)
    best = np.where(situations.masks, np.sin(tokens) @ weights(situations.sizes.num_actions), -np.inf).argmax(axis=1)
    special = situations.sizes.num_actions - 1 - situations.observations.shifts % 2
    chosen: NDArray[np.intp] = np.where(situations.kinds == pb.DECISION_KIND_SPECIAL_ACTION, special, best).astype(np.intp)
    return chosen


def row_of(situations: Situations, row: int) -> tuple[Any, ...]:
    """Returns what the policy sees in a row, and all else that tells of the history."""
    seen = situations.observations
    return (
        *(int(column[row]) for column in (situations.kinds, seen.shifts, seen.board_owners, seen.history_counts)),
        history.actors(situations)[row].tolist(),
        history.actions(situations)[row].tolist(),
        int(policy(situations)[row]),
    )


class Stopped(Exception):
    """The process of an agent ends."""


class Live(chefshat.Agent):
    """Plays by the policy, and keeps what it saw and did. Stops before it has decided more than `most` times."""

    def __init__(self, most: int = sys.maxsize) -> None:
        self.seen: list[tuple[Any, ...]] = []
        self._most = most

    def decide(self, decision: Decision) -> int:
        """Decides by the one row of the decision."""
        if len(self.seen) == self._most:
            raise Stopped
        assert decision.is_history_complete
        situations = decision.situations(history=WIDTH)
        self.seen.append(row_of(situations, 0))
        return int(policy(situations)[0])


def played_live(address: str, rules: Mapping[str, Any], seed: bytes, players: int) -> list[list[tuple[Any, ...]]]:
    """Plays a game with all its seats; returns what each saw."""
    agents = [Live() for _ in range(players)]
    with Client(address) as client:
        room = client.rooms.create("live", rules=pb.RuleSet(**rules), seats=[None] * players, game_seed=seed)
        tickets = [client.rooms.join(room.join_code, f"seat {seat}", seat=seat).ticket for seat in range(players)]
        client.play_many(dict(zip(tickets, agents, strict=True)))
    return [agent.seen for agent in agents]


def played_in_columns(rules: Mapping[str, Any], seed: bytes, players: int, **options: Any) -> list[list[tuple[Any, ...]]]:
    """Plays the same game in a vector environment; returns what each seat saw."""
    seen: list[list[tuple[Any, ...]]] = [[] for _ in range(players)]
    with VectorEnv(rules=rules, seed=[seed], total_games=1, history=WIDTH, **options) as env:
        while not env.batch.done:
            if len(env.batch):
                seen[int(env.batch.seats[0])].append(row_of(env.batch, 0))
            env.step(policy(env.batch).astype(np.uint16) if len(env.batch) else [])
    return seen


@pytest.mark.server
@pytest.mark.parametrize("rules", RULE_SETS, ids=str)
def test_the_same_policy_sees_the_same_history_live(real_address: str, rules: dict[str, Any]) -> None:
    pytest.importorskip("chefshat_native")
    players = rules.get("players", 4)
    live = played_live(real_address, rules, SEED, players)
    assert live == played_in_columns(rules, SEED, players)
    kinds = [kind for seen in live for kind, *_ in seen]
    assert len(kinds) > 200
    assert kinds.count(pb.DECISION_KIND_EXCHANGE) > 4
    assert kinds.count(pb.DECISION_KIND_SPECIAL_ACTION) > 0


@pytest.fixture
def expected() -> list[tuple[Any, ...]]:
    """Returns what seat 0 sees of a game against built-in agents, in columns."""
    pytest.importorskip("chefshat_native")
    return played_in_columns(AGAINST_GREEDY, SEED, 4, client_seats=[0], opponents="greedy")[0]


def ticket_of(client: Client) -> str:
    """Creates a room with the same game and joins it; returns the ticket of seat 0."""
    rules, policy = pb.RuleSet(**AGAINST_GREEDY), pb.RoomPolicy(pace_ms=0)
    room = client.rooms.create("live", rules=rules, seats=[None, *["greedy"] * 3], game_seed=SEED, policy=policy)
    return client.rooms.join(room.join_code, "live", seat=0).ticket


@pytest.mark.server
def test_a_new_process_sees_the_same_history(real_address: str, expected: list[tuple[Any, ...]]) -> None:
    # Before every decision of an exchange, and in some pizzas.
    stops = [row for row, (kind, *_) in enumerate(expected) if kind != pb.DECISION_KIND_TURN or row % 9 == 3]
    seen: list[tuple[Any, ...]] = []
    with Client(real_address) as client:
        ticket = ticket_of(client)
        for stop in stops:
            live = Live(stop - len(seen))
            with pytest.raises(Stopped):
                client.play(live, ticket)
            seen += live.seen
        live = Live()
        client.play(live, ticket)
    assert seen + live.seen == expected
    assert len(stops) > 5


@pytest.mark.server
def test_a_history_outlives_connections(real_address: str, expected: list[tuple[Any, ...]]) -> None:
    class Cutting(Live):
        def decide(self, decision: Decision) -> int:
            if len(self.seen) % 17 == 5:
                proxy.cut()
            return super().decide(decision)

    async def play() -> int:
        async with chefshat.aio.Client(proxy.address) as client:
            return (await client.play(live, ticket)).reconnects

    live = Cutting()
    with Client(real_address) as client:
        ticket = ticket_of(client)
    with Proxy(real_address) as proxy:
        reconnects = asyncio.run(play())
    assert live.seen == expected
    assert reconnects > 2


def test_a_history_that_begins_in_mid_shift_says_so() -> None:
    seat = SeatInfo("room", "game", 0)
    assert not Decision(pb.DecisionRequest(), seat).is_history_complete
    seat.shift_log = seat.shift_log.add(pb.GameEvent(sequence=9, shift_started=pb.ShiftStarted(shift=2)))
    for sequence in (10, 11):
        seat.shift_log = seat.shift_log.add(pb.GameEvent(sequence=sequence, play=pb.Play(seat=1, action=sequence)))
    seat.shift_log = seat.shift_log.add(pb.GameEvent(sequence=12, seated=pb.Seated()))
    decision = Decision(pb.DecisionRequest(), seat)
    assert [event.sequence for event in decision.shift_events] == [9, 10, 11]
    # What comes later does not change a decision, and a correction of a table with real cards makes events void.
    seat.shift_log = seat.shift_log.add(pb.GameEvent(sequence=13, correction=pb.Correction(first_void=11)))
    seat.shift_log = seat.shift_log.add(pb.GameEvent(sequence=14, play=pb.Play(seat=1, action=14)))
    assert [event.sequence for event in decision.shift_events] == [9, 10, 11]
    corrected = Decision(pb.DecisionRequest(), seat)
    assert [event.sequence for event in corrected.shift_events] == [9, 10, 14]
    assert corrected.is_history_complete
    seat.shift_log = seat.shift_log.add(pb.GameEvent(sequence=15, correction=pb.Correction(first_void=9)))
    assert not Decision(pb.DecisionRequest(), seat).is_history_complete
