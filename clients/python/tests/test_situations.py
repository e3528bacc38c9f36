"""A policy with its observation function plays live as on a vector environment."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

import chefshat
from chefshat import Client, Decision, VectorEnv, pb
from chefshat.columns import Situations
from chefshat.learn import network
from chefshat.learn.features import classic_of, table_of
from chefshat.learn.play import NetworkAgent

NETWORKS = Path(__file__).parents[3] / "tests" / "fixtures" / "network"
SEED = bytes(range(32))


def policy(situations: Situations) -> NDArray[np.intp]:
    """Chooses the legal action with the highest of fixed scores of everything that a seat may know."""
    inputs = table_of(situations)
    weights = np.random.default_rng(3).standard_normal((inputs.shape[1], situations.sizes.num_actions), np.float32)
    best: NDArray[np.intp] = np.where(situations.masks, inputs @ weights, -np.inf).argmax(axis=1)
    return best


class Live(chefshat.Agent):
    """Plays by the policy, and keeps what it saw and did."""

    def __init__(self) -> None:
        self.seen: list[tuple[bytes, bytes, int]] = []

    def decide(self, decision: Decision) -> int:
        """Decides by the one row of the decision."""
        situations = decision.situations()
        assert (classic_of(situations)[0] == decision.classic_vector()).all()
        action = int(policy(situations)[0])
        self.seen.append((table_of(situations).tobytes(), columns(situations, 0), action))
        return action


def columns(situations: Situations, row: int) -> bytes:
    """Returns a row of all columns."""
    tables = [*((name, array) for name, array in situations.observations.as_dict().items())]
    tables += [(name, getattr(situations, name)) for name in Situations.columns()]
    return b"".join(name.encode() + array[row].tobytes() for name, array in tables)


@pytest.mark.server
def test_the_same_function_plays_live_and_on_a_vector_environment(real_address: str) -> None:
    live = Live()
    with Client(real_address) as client:
        seats = [None, "greedy", "greedy", "greedy"]
        room = client.rooms.create("live", seats=seats, game_seed=SEED, policy=pb.RoomPolicy(pace_ms=0))
        client.play(live, client.rooms.join(room.join_code, "live").ticket)
    seen = []
    with VectorEnv(real_address, client_seats=[0], opponents="greedy", seed=[SEED], total_games=1) as env:
        while not env.batch.done:
            action = int(policy(env.batch)[0])
            seen.append((table_of(env.batch).tobytes(), columns(env.batch, 0), action))
            env.step([action])
    assert len(seen) > 20
    assert live.seen == seen


class LiveNetwork(NetworkAgent):
    """Plays by a network, and keeps the kinds of its decisions and what it did."""

    def __init__(self, net: network.Network) -> None:
        super().__init__(net)
        self.seen: list[tuple[int, int]] = []

    def decide(self, request: Decision) -> int:
        action = super().decide(request)
        self.seen.append((request.kind, action))
        return action


@pytest.mark.server
@pytest.mark.parametrize("name", ["table-actions", "classic-turns"])
def test_a_network_plays_live_as_on_a_vector_environment(real_address: str, name: str) -> None:
    net = network.load(NETWORKS / f"{name}.safetensors")
    live, rules = LiveNetwork(net), pb.RuleSet(target_shifts=40)
    with Client(real_address) as client:
        seats = [None, "greedy", "greedy", "greedy"]
        room = client.rooms.create("live", seats=seats, rules=rules, game_seed=SEED, policy=pb.RoomPolicy(pace_ms=0))
        client.play(live, client.rooms.join(room.join_code, "live").ticket)
    decisions: Literal["all", "turns"] = "turns" if net.info.output == "turns" else "all"
    seen = []
    with VectorEnv(
        real_address, client_seats=[0], opponents="greedy", rules=rules, seed=[SEED], total_games=1, decisions=decisions
    ) as env:
        while not env.batch.done:
            action = int(net.actions_of(env.batch)[0])
            seen.append((int(env.batch.kinds[0]), action))
            env.step([action])
    kinds = {kind for kind, _ in live.seen}
    assert kinds == {pb.DECISION_KIND_TURN, pb.DECISION_KIND_EXCHANGE, pb.DECISION_KIND_SPECIAL_ACTION}
    # At the others, a network of turns takes the default action.
    assert [each for each in live.seen if each[0] == pb.DECISION_KIND_TURN or decisions == "all"] == seen


def test_a_decision_before_the_start_of_its_game_has_no_table() -> None:
    decision = Decision(pb.DecisionRequest(), chefshat.SeatInfo("room", "game", 0))
    with pytest.raises(ValueError, match="the start of the game has not arrived"):
        decision.situations()
