"""`VectorEnv` on the toy server: requests, columns, results and errors."""

import gc
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_vector import ACTIONS, FACES, HAND_SIZE, PLAYERS, TURN_ACTIONS, FakeVector
from google.protobuf import json_format
from numpy.typing import NDArray

from chefshat import ChefsHatError, VectorEnv, pb, sample_legal
from chefshat.vector import Batch


def legal(batch: Batch) -> NDArray[np.uint16]:
    """Returns the action 199 for every row."""
    return np.full(len(batch), 199, np.uint16)


def test_the_setup_has_the_options(toy: FakeVector) -> None:
    rules = {"faces": 9, "opening": "any_top_face", "pass_scope": "PASS_SCOPE_TURN", "target_shifts": 3}
    VectorEnv(
        toy.address,
        3,
        client_seats=[1, 3],
        opponents=["greedy", "random"],
        rewards="paper_intended",
        episode="game",
        decisions="turns",
        other_decisions="greedy",
        skip_forced=True,
        invalid="ask_again",
        max_invalid_attempts=7,
        total_games=12,
        seed=2**64 - 1,
        rules=rules,
        shift_statistics=True,
        records=True,
    ).close()
    VectorEnv(toy.address, seed=[b"a" * 32, b"b" * 32], branch=pb.BranchPoint(game_id="x", decisions=4)).close()
    VectorEnv(toy.address, hands=pb.ScriptedShift(shift=2), rules="rulebook").close()
    full, branched, scripted = toy.setups
    assert full == pb.VectorSetup(
        games=3,
        client_seats=[1, 3],
        opponents=["greedy", "random"],
        reward_scheme=pb.REWARD_SCHEME_PAPER_INTENDED,
        episode=pb.EPISODE_SCOPE_GAME,
        decisions=pb.DECISION_SCOPE_TURNS,
        other_decisions="greedy",
        skip_forced=True,
        invalid_actions=pb.INVALID_ACTION_RULE_ASK_AGAIN,
        max_invalid_attempts=7,
        total_games=12,
        base_seed=2**64 - 1,
        rules=pb.RuleSet(faces=9, opening=pb.OPENING_ANY_TOP_FACE, pass_scope=pb.PASS_SCOPE_TURN, target_shifts=3),
        shift_statistics=True,
        records=True,
    )
    assert branched.game_seeds.seeds == [b"a" * 32, b"b" * 32]
    assert branched.branch.decisions == 4
    assert not branched.HasField("rules")
    assert branched.WhichOneof("seeds") == "game_seeds"
    assert scripted.scripted.shift == 2
    assert scripted.rules == pb.RuleSet(preset="rulebook")
    assert scripted.WhichOneof("seeds") is None
    assert scripted.opponents == ["random"]


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"rewards": "money"}, "'paper_intended'"),
        ({"episode": "match"}, "'shift', 'game'"),
        ({"decisions": "some"}, "'turns'"),
        ({"invalid": "ignore"}, "'ask_again'"),
        ({"other_decisions": "greedy"}, 'decisions="turns"'),
        ({"seed": -1}, "base seed"),
        ({"seed": [b"short"]}, "seed 0 is not 32 bytes"),
        ({"seed": []}, "give one seed or more"),
        ({"client_seats": []}, "client_seats"),
        ({"rules": {"face": 3}}, "max_idle_pizzas"),
        ({"rules": {"opening": "joker"}}, "'any_top_face'"),
        ({"branch": pb.BranchPoint(), "hands": pb.ScriptedShift()}, "not both"),
        ({"branch": pb.BranchPoint(), "rules": "paper"}, "leave rules out"),
    ],
)
def test_invalid_options_are_refused_before_sending(arguments: dict[str, Any], says: str) -> None:
    # No server listens there.
    with pytest.raises(ValueError, match=says):
        VectorEnv("127.0.0.1:1", **arguments)


def test_the_env_knows_its_sizes(toy: FakeVector) -> None:
    with VectorEnv(toy.address, 2, client_seats=[2], seed=5) as env:
        assert (env.players, env.faces, env.jokers, env.hand_size) == (PLAYERS, FACES, 2, HAND_SIZE)
        assert (env.num_actions, env.turn_actions, env.mask_bytes) == (ACTIONS, TURN_ACTIONS, 27)
        assert env.client_seats == (2,)
        assert env.built_in_agents == ("random", "random", "", "random")
        assert env.base_seed == 5
        assert env.rules.target_points == 15
        assert env.games == 2


def test_columns_are_read_only_views_of_the_right_shape(toy: FakeVector) -> None:
    with VectorEnv(toy.address, 3) as env:
        env.step(legal(env.batch))
        batch = env.step(legal(env.batch))
        assert (batch.step, batch.done, len(batch)) == (3, False, 3)
        assert batch.games.tolist() == [0, 1, 2]
        assert batch.seats.tolist() == [2, 3, 0]
        assert batch.kinds.tolist() == [pb.DECISION_KIND_TURN] * 3
        assert batch.mask_bits.shape == (3, 27)
        assert batch.masks.shape == (3, ACTIONS)
        assert [np.flatnonzero(mask).tolist() for mask in batch.masks] == [[2, 199]] * 3
        seen = batch.observations
        shapes = {name: array.shape for name, array in seen.as_dict().items()}
        assert shapes == {
            "shifts": (3,),
            "pizzas": (3,),
            "hands": (3, 12),
            "golden": (3,),
            "boards": (3, 3),
            "board_owners": (3,),
            "cards_left": (3, 4),
            "passed": (3, 4),
            "places": (3, 4),
            "roles": (3, 4),
            "points": (3, 4),
            "played": (3, 12),
            "gave": (3, 12),
            "received": (3, 12),
        }
        assert seen.hands[:, :3].tolist() == [[0, 2, 2], [1, 3, 2], [2, 0, 2]]
        assert seen.points[2].tolist() == [2000, 2001, 2002, 2003]
        assert seen.boards.tolist() == [[2, 1, 0]] * 3
        for array in [batch.games, batch.masks, batch.mask_bits, *seen.as_dict().values()]:
            assert not array.flags.writeable
        assert seen.hands is seen.hands
        assert batch.shifts is None
        assert batch.totals.client_decisions == 2
        assert len(batch.beginnings) == 0


def test_endings_and_beginnings(toy: FakeVector) -> None:
    with VectorEnv(toy.address, 1) as env:
        assert env.batch.beginnings.games.tolist() == [0]
        assert env.batch.beginnings.seeds.shape == (1, 32)
        for _ in range(4):
            assert len(env.step(legal(env.batch)).endings) == 0
        endings = env.step(legal(env.batch)).endings
        assert endings.seats.tolist() == [0, 1, 2, 3]
        # Seat 0 decided first and last: its first reward came with its second decision.
        assert endings.rewards.tolist() == [105, 103, 105, 107]
        assert endings.ends.tolist() == [pb.EPISODE_END_FINISHED] * 4
        assert endings.game_over.tolist() == [0] * 4
        assert endings.places_taken.tolist() == [1, 2, 3, 4]
        assert endings.observations.hands[:, 2].tolist() == [5] * 4
        assert endings.kinds.tolist() == [0] * 4
        assert not endings.masks.any()
        assert endings.masks.shape == (4, ACTIONS)
        for _ in range(5):
            batch = env.step(legal(env.batch))
        assert batch.endings.game_over.tolist() == [1] * 4
        assert batch.beginnings.indices.tolist() == [1]
        assert batch.totals.games == 1


def test_resets(toy: FakeVector) -> None:
    with VectorEnv(toy.address, 2, seed=1) as env:
        assert env.reset() is env.batch
        assert toy.requests == []
        env.step(legal(env.batch))
        batch = env.reset()
        assert batch.observations.hands[:, 2].tolist() == [0, 0]
        assert toy.requests[-1] == pb.RunRequest(reset=pb.VectorReset(all=True))
        assert env.reset() is batch
        assert env.reset(seed=9) is not batch
        assert toy.requests[-1].reset.base_seed == 9
        assert env.base_seed == 9
        env.reset([b"s" * 32])
        assert list(toy.requests[-1].reset.game_seeds.seeds) == [b"s" * 32]
        assert env.base_seed is None
        with pytest.raises(ValueError, match="leave games out"):
            env.reset(1, games=[0])
        with pytest.raises(ValueError, match=r"0\.\.=1"):
            env.reset(games=[2])


def test_records_arrive_complete(toy: FakeVector, tmp_path: Path) -> None:
    with VectorEnv(toy.address, 2, records=True) as env:
        records = [record for _ in range(12) for record in env.step(legal(env.batch)).records]
    assert [(record.game, record.index, len(record.lines)) for record in records] == [(0, 7, 2), (1, 7, 2)]
    assert records[1].lines[0].header.game_id == "1"
    assert records[1].lines[1].HasField("footer")
    records[1].save(tmp_path / "1.jsonl")
    saved = (tmp_path / "1.jsonl").read_bytes().split(b"\n")
    assert saved.pop() == b""
    assert tuple(json_format.Parse(line, pb.RecordLine()) for line in saved) == records[1].lines
    assert [path.name for path in tmp_path.iterdir()] == ["1.jsonl"]


@pytest.mark.parametrize(
    ("actions", "says"),
    [
        ([1.0, 2.0], "float64"),
        ([1], r"\(2,\)"),
        ([[1], [2]], r"\(2,\)"),
        ([0, -1], "row 1 has the action -1"),
        ([214, 0], "row 0 has the action 214"),
        ([5, 65536], "row 1 has the action 65536"),
    ],
)
def test_invalid_actions_are_refused_without_effect(toy: FakeVector, actions: object, says: str) -> None:
    with VectorEnv(toy.address, 2) as env:
        with pytest.raises(ValueError, match=says):
            env.step(actions)  # type: ignore[arg-type]
        assert toy.requests == []
        assert env.step(np.array([199, 199])).step == 2


def test_a_refusal_ends_the_env(toy: FakeVector) -> None:
    env = VectorEnv(toy.address, 2)
    with pytest.raises(ChefsHatError) as refused:
        env.restore([0], [b"not a state"])
    assert refused.value.reason == "STATES_REFUSED"
    for seed in [None, 3]:
        with pytest.raises(ChefsHatError, match=r"not a state.*make a new one"):
            env.reset(seed)
    with pytest.raises(ChefsHatError, match="make a new one"):
        env.step([199, 199])
    env.close()
    with pytest.raises(ChefsHatError, match="SETUP_REFUSED"):
        VectorEnv(toy.address, 0)


def test_closing_an_env_ends_its_stream(toy: FakeVector) -> None:
    env = VectorEnv(toy.address, 2)
    env.close()
    env.close()
    assert toy.ended.wait(10)
    with pytest.raises(ChefsHatError, match="ENV_CLOSED"):
        env.step([0, 0])
    toy.ended.clear()
    forgotten = VectorEnv(toy.address, 2)
    del forgotten
    gc.collect()
    assert toy.ended.wait(10)


def test_after_all_games_only_a_reset_continues(toy: FakeVector) -> None:
    def over(response: pb.RunResponse) -> Iterable[pb.RunResponse]:
        if response.HasField("batch") and response.batch.step == 2:
            yield pb.RunResponse(batch=pb.VectorBatch(step=2, done=True))
        else:
            yield response

    toy.spoil = over
    with VectorEnv(toy.address, 2) as env:
        batch = env.step([199, 199])
        assert batch.done
        assert len(batch) == 0
        assert batch.masks.shape == (0, ACTIONS)
        assert batch.observations.hands.shape == (0, FACES + 1)
        assert sample_legal(batch.mask_bits, np.random.default_rng(0)).shape == (0,)
        with pytest.raises(ChefsHatError, match=r"GAMES_OVER.*reset"):
            env.step([])
        assert len(env.reset()) == 2


def test_protocol_violations_are_reported(toy: FakeVector) -> None:
    def short(response: pb.RunResponse) -> Iterable[pb.RunResponse]:
        response.batch.seats = response.batch.seats[:-1] if response.HasField("batch") else b""
        yield response

    toy.spoil = lambda response: [pb.RunResponse()]
    with pytest.raises(ChefsHatError, match="PROTOCOL_VIOLATED"):
        VectorEnv(toy.address, 2)
    toy.spoil = lambda response: short(response) if response.HasField("batch") else [response]
    with VectorEnv(toy.address, 2) as env, pytest.raises(ChefsHatError, match="seats has 1 bytes"):
        assert len(env.batch.seats)


def test_a_missing_server_is_reported() -> None:
    with pytest.raises(ChefsHatError) as lost:
        VectorEnv("127.0.0.1:1", 2)
    assert lost.value.reason == "UNAVAILABLE"
