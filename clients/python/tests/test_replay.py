"""Replay: the buffer, and transitions from datasets and records, which equal those of the `VectorEnv` that played the games."""

import json
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_vector import FakeVector
from numpy.typing import NDArray

import chefshat
from chefshat import ChefsHatError, Transitions, VectorEnv, local_server, pb, replay, sample_legal
from chefshat.columns import NO_SEAT
from chefshat.local_server import BINARY
from chefshat.replay import recorded
from chefshat.transitions import concatenate

# The default row of a dataset.
RULES = json.dumps({"players": 4, "faces": 11, "jokers": 2, "targetPoints": 15})
ROW: dict[str, Any] = {
    "game_id": "a",
    "rules": RULES,
    "finished": True,
    "number": 1,
    "shift": 1,
    "pizza": 1,
    "seat": 0,
    "agent": "Ada",
    "phase": "turn",
    "hand": [1] * 12,
    "golden": False,
    "board_face": 0,
    "board_size": 0,
    "board_jokers": 0,
    "cards_left": [12, 17, 17, 17],
    "passed": [False, True, False, False],
    "places": [0] * 4,
    "roles": [0] * 4,
    "points": [2**40, 0, 0, 7],
    "played": [0] * 12,
    "gave": None,
    "received": None,
    "mask": "ff" * 26 + "3f",
    "action": 199,
    "source": "agent",
    "invalid_count": 0,
    "invalid_attempts": [],
    "reward_winning": -0.25,
    "invalid_reward_winning": 0.0,
    "shift_place": 2,
    "game_place": 3,
}


def dataset(folder: Path, *rows: Mapping[str, Any]) -> Path:
    """A dataset of these rows, numbered in order."""
    full = [{**ROW, "number": number, **row} for number, row in enumerate(rows, 1)]
    text = "".join(json.dumps(row) + "\n" for row in full)
    (folder / "decisions.jsonl").write_text(text, encoding="utf-8")
    return folder


def test_decisions_are_paired_by_seat_and_shift(tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = [
        {"seat": 0, "action": 10},
        {"seat": 1, "action": 11},
        {"seat": 0, "action": 12, "hand": [2] * 12},
        {"seat": 0, "action": 13, "shift": 2, "phase": "exchange", "gave": [1] * 12},
        {"seat": 0, "action": 14, "shift": 2},
        {"seat": 0, "action": 15, "game_id": "b", "shift_place": None, "finished": False, "game_place": None},
    ]
    made = replay.from_dataset(dataset(tmp_path, *rows), rewards="winning")
    assert made.actions.tolist() == [10, 12, 13, 14, 11]
    assert made.ended.tolist() == [False, True, False, True, True]
    assert made.game_over.tolist() == [False, False, False, True, False]
    assert made.places_taken.tolist() == [0, 2, 0, 2, 2]
    assert made.kinds.tolist() == [1, 1, pb.DECISION_KIND_EXCHANGE, 1, 1]
    assert made.seats.tolist() == [0, 0, 0, 0, 1]
    assert made.rewards.tolist() == [-0.25] * 5
    assert made.after.observations.hands[:, 0].tolist() == [2, 0, 1, 0, 0]
    assert made.before.observations.gave[:, 0].tolist() == [0, 0, 1, 0, 0]
    assert made.before.observations.points[0].tolist() == [2**32 - 1, 0, 0, 7]
    assert made.before.observations.passed[0].tolist() == [0, 1, 0, 0]
    assert made.after.masks.sum(axis=1).tolist() == [214, 0, 214, 0, 0]
    by_game = replay.from_dataset(tmp_path, episode="game")
    assert by_game.actions.tolist() == [10, 12, 13, 14, 11]
    assert by_game.ended.tolist() == [False, False, False, True, True]
    assert by_game.places_taken.tolist() == [0, 0, 0, 3, 3]
    assert by_game.rewards.tolist() == [0] * 5
    turns = replay.from_dataset(tmp_path, decisions="turns", episode="game")
    assert turns.actions.tolist() == [10, 12, 14, 11]
    assert len(replay.from_dataset(tmp_path, agents=["Ada"])) == len(made)
    with pytest.raises(ValueError, match="called 'Bob'; they are Ada"):
        replay.from_dataset(tmp_path, agents=["Ada", "Bob"])


def test_games_are_numbered_in_the_order_of_the_dataset(tmp_path: Path) -> None:
    made = replay.from_dataset(dataset(tmp_path, *[{"game_id": game, "action": ord(game)} for game in "cabcda"]))
    assert made.games.tolist() == [0, 0, 1, 1, 2, 3]
    assert bytes(made.actions.tolist()) == b"ccaabd"


def test_texts_that_repeat_take_no_memory(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    row = {**ROW, "mask": bytes.fromhex(ROW["mask"]), "gave": [0] * 12, "received": [0] * 12, "rules": f"{RULES:300}"}
    rows = [{**row, "game_id": f"{number // 400:032}", "number": number} for number in range(5_000)]
    rows[7]["agent"] = None
    schema = pyarrow.Table.from_pylist([{**row, "invalid_attempts": [1]}]).schema
    parquet.write_table(pyarrow.Table.from_pylist(rows, schema), tmp_path / "decisions.parquet", row_group_size=3_000)
    tracemalloc.start()
    made = replay.from_dataset(tmp_path, rewards="winning")
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(made) == 5_000
    assert made.games.tolist() == [number // 400 for number in range(5_000)]
    assert most < 1000 * len(made)
    assert len(replay.from_dataset(tmp_path, agents=["Ada"])) == 4_999
    with pytest.raises(ValueError, match="called 'Bob'; they are , Ada"):
        replay.from_dataset(tmp_path, agents=["Bob"])


def test_datasets_of_earlier_versions_do_not_say_who_played_the_board(tmp_path: Path) -> None:
    board = {"board_face": 9, "board_size": 2}
    rows: list[dict[str, Any]] = [{**board, "board_owner": 3}, {"board_owner": None}, {**board, "board_owner": 0}]
    made = replay.from_dataset(dataset(tmp_path, *rows))
    assert made.before.observations.board_owners.tolist() == [3, NO_SEAT, 0]
    assert made.after.observations.board_owners.tolist() == [NO_SEAT, 0, NO_SEAT]
    made = replay.from_dataset(dataset(tmp_path, board, board))
    assert made.before.observations.board_owners.tolist() == [NO_SEAT] * 2


def test_an_empty_dataset_has_no_transitions(tmp_path: Path) -> None:
    unfinished = {"shift_place": None, "finished": False, "game_place": None}
    nothing = replay.from_dataset(dataset(tmp_path, unfinished))
    assert len(nothing) == 0
    assert nothing.before.masks.shape == (0, 214)


def test_the_need_for_the_program_is_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(BINARY, raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(local_server, "_cargo_targets", list)
    # As if the package chefshat-server were not installed.
    monkeypatch.setitem(sys.modules, "chefshat_server", None)
    words = r"BINARY_MISSING.*replay the records.*on this machine.*cargo build.*chefshat-lab"
    with pytest.raises(ChefsHatError, match=words) as refused:
        replay.from_records(tmp_path)
    assert "address" not in refused.value.message


def test_invalid_attempts_are_separate_transitions(tmp_path: Path) -> None:
    tried = {"action": 7, "invalid_attempts": [5, 70_000], "invalid_count": 2, "invalid_reward_winning": -2.0}
    exhausted = {**tried, "action": 199, "source": "invalid"}
    folder = dataset(tmp_path, {"action": 1}, tried, exhausted)
    made = replay.from_dataset(folder, rewards="winning")
    assert made.actions.tolist() == [1, 5, 65535, 7, 5, 65535]
    assert made.attempts.tolist() == [0, 0, 1, 2, 0, 1]
    assert made.invalid.tolist() == [False, True, True, False, True, True]
    # The last attempt also gets the reward of the default action.
    assert made.rewards.tolist() == [-0.25, -1, -1, -0.25, -1, -1.25]
    assert made.ended.tolist() == [False, False, False, False, False, True]
    assert made.after.observations.hands[:, 0].tolist() == [1, 1, 1, 1, 1, 0]
    assert replay.from_dataset(folder, invalid_attempts=False).actions.tolist() == [1, 7, 199]


def test_unknown_hands_are_omitted(tmp_path: Path) -> None:
    unknown: dict[str, Any] = {"mask": None, "hand": None, "golden": None}
    made = replay.from_dataset(dataset(tmp_path, {"action": 1}, {"action": 2, **unknown}, {"action": 3}, {"action": 4}))
    assert made.actions.tolist() == [3, 4]


def test_custom_rewards(tmp_path: Path) -> None:
    made = replay.from_dataset(dataset(tmp_path, {}, {}), rewards=lambda transitions: transitions.ended * 7.0)
    assert made.rewards.tolist() == [0, 7]


@pytest.mark.parametrize(
    ("rows", "options", "says"),
    [
        ([{}], {"rewards": "money"}, "'paper_intended'"),
        ([{}], {"episode": "match"}, "'game'"),
        ([{}], {"decisions": "some"}, "'turns'"),
        ([{}, {"rules": RULES.replace("11", "9")}], {}, "4 players, 9 faces, 2 jokers; 4 players, 11 faces, 2 jokers"),
        ([{}], {"rewards": "paper"}, "no column reward_paper"),
        ([], {}, "no rows"),
    ],
)
def test_other_files_are_refused(tmp_path: Path, rows: list[Any], options: Any, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        replay.from_dataset(dataset(tmp_path, *rows), **options)
    with pytest.raises(FileNotFoundError, match="chefshat export"):
        replay.from_dataset(tmp_path / "nothing")
    (tmp_path / "a.txt").touch()
    with pytest.raises(ValueError, match=r"\.parquet, \.jsonl, \.csv"):
        replay.from_dataset(tmp_path / "a.txt")


def test_a_buffer_stores_the_latest_and_samples_all_of_them(tmp_path: Path) -> None:
    buffer = replay.ReplayBuffer(5, seed=1)
    with pytest.raises(ValueError, match="empty"):
        buffer.sample(1)
    made = replay.from_dataset(dataset(tmp_path, *[{"action": action} for action in range(8)]))
    buffer.add(made.take(np.arange(3)))
    assert len(buffer) == 3
    assert set(buffer.sample(200).actions.tolist()) == {0, 1, 2}
    buffer.add(made.take(np.arange(3, 6)))
    assert set(buffer.sample(200).actions.tolist()) == {1, 2, 3, 4, 5}
    buffer.add(made)
    assert len(buffer) == 5
    drawn = buffer.sample(200)
    assert set(drawn.actions.tolist()) == {3, 4, 5, 6, 7}
    assert drawn.ended.tolist() == (drawn.actions == 7).tolist()
    assert drawn.before.observations.hands.shape == (200, 12)
    again = [replay.ReplayBuffer(5, seed=seed) for seed in (9, 9, 10)]
    for other in again:
        other.add(made)
    first, second, third = (other.sample(50).actions.tolist() for other in again)
    assert first == second != third
    small = replay.from_dataset(dataset(tmp_path, {"rules": RULES.replace('"jokers": 2', '"jokers": 1')}))
    with pytest.raises(ValueError, match="use a buffer for each"):
        buffer.add(small)
    with pytest.raises(ValueError, match="at least 1"):
        replay.ReplayBuffer(0)


def test_a_buffer_stores_transitions_of_an_env() -> None:
    buffer = replay.ReplayBuffer(1000, seed=2)
    with FakeVector() as server, VectorEnv(server.address, 8, transitions=True) as env:
        count = 0
        while count < 100:
            transitions = env.step(np.full(8, 199)).transitions
            buffer.add(transitions)
            count += len(transitions)
    assert len(buffer) == count
    drawn = buffer.sample(64)
    assert (drawn.before.observations.hands[:, 0] == drawn.games).all()
    assert (drawn.before.observations.hands[:, 1] == drawn.seats).all()


def in_order(transitions: Transitions) -> list[Transitions]:
    """Returns the transitions of each game, by seat and in order; games by their first hands."""
    games = []
    for game in np.unique(transitions.games):
        own = transitions.take(transitions.games == game)
        games.append(own.take(np.argsort(own.seats, kind="stable")))
    return sorted(games, key=lambda game: game.before.observations.hands.tobytes())


@pytest.mark.server
@pytest.mark.parametrize("invalid", ["error", "ask_again"])
@pytest.mark.parametrize("episode", ["shift", "game"])
def test_records_give_the_transitions_of_the_played_games(real_address: str, tmp_path: Path, episode: str, invalid: str) -> None:
    rng = np.random.default_rng(5)
    options: dict[str, Any] = {"rewards": "paper", "episode": episode}
    limit = 3 if invalid == "ask_again" else 0
    parts: list[Transitions] = []
    with VectorEnv(
        real_address,
        4,
        seed=3,
        total_games=4,
        records=True,
        transitions=True,
        invalid=invalid,
        max_invalid_attempts=limit,
        **options,
    ) as env:
        while not env.batch.done:
            actions = sample_legal(env.batch.mask_bits, rng)
            if limit:
                wrong = rng.random(len(actions)) < 0.2
                actions[wrong] = rng.integers(0, env.num_actions, wrong.sum())
            batch = env.step(actions)
            parts.append(batch.transitions)
            for record in batch.records:
                replay.save_record(record.lines, tmp_path / f"{record.index}.jsonl")
    assert len(list(tmp_path.glob("*.jsonl"))) == 4
    played = in_order(concatenate(parts))
    recorded = in_order(replay.from_records(tmp_path, **options))
    assert len(played) == len(recorded) == 4
    assert (sum(int(game.invalid.sum()) for game in played) > 0) == bool(limit)
    for lived, read in zip(played, recorded, strict=True):
        assert len(lived) == len(read) > 100
        goes_on = ~lived.ended
        columns = read.flatten()
        for name, array in lived.flatten().items():
            # Datasets have no final observations, and number games differently.
            rows: NDArray[np.bool_] = goes_on if name.startswith("after.") else np.ones(len(lived), np.bool_)
            if name == "rewards":
                np.testing.assert_allclose(array, columns[name], rtol=1e-6)
            elif name != "games":
                np.testing.assert_array_equal(array[rows], columns[name][rows], err_msg=name)


@pytest.mark.server
def test_all_formats_of_a_dataset_give_the_same(real_binary: Path, tmp_path: Path) -> None:
    records, folder = tmp_path / "records", tmp_path / "dataset"
    simulate = [str(real_binary), "simulate", "--games", "2", "--seed", "1", "--agents", "greedy,random,random_unmasked,random"]
    subprocess.run([*simulate, "--records", str(records)], check=True, capture_output=True)
    export = [str(real_binary), "export", str(records), "--out", str(folder), "--format", "parquet,jsonl,csv"]
    subprocess.run(export, check=True, capture_output=True)
    made = [replay.from_dataset(folder / f"decisions.{form}", rewards="paper").flatten() for form in ("parquet", "jsonl", "csv")]
    assert len(made[0]["actions"]) > 400
    assert made[0]["invalid"].any()
    for name, array in made[0].items():
        for other in made[1:]:
            np.testing.assert_array_equal(array, other[name], err_msg=name)
            assert array.dtype == other[name].dtype
    whole = replay.from_dataset(folder, rewards="paper")
    assert len(whole) == len(made[0]["actions"])


@pytest.mark.server
def test_games_of_a_server(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create("replayed", seats=[None, "greedy", "random", "random"], rules=pb.RuleSet(target_shifts=2))
        client.play(chefshat.RandomAgent(seed=1), client.rooms.join(room.join_code, "Ada").ticket)
    made = replay.from_server(real_address, pb.RecordFilter(room_name="replayed"), rewards="points")
    assert sorted(np.unique(made.seats).tolist()) == [0, 1, 2, 3]
    assert made.ended.sum() == 8
    assert made.rewards.sum() == 18
    with pytest.raises(ChefsHatError, match="NO_RECORDS"):
        replay.from_server(real_address, pb.RecordFilter(room_name="no such room"))


def test_a_record_that_is_deleted_meanwhile_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    class Server:
        """A server that lists three games and has two of them no more."""

        def __init__(self, address: str) -> None:
            self.records = self

        def __enter__(self) -> "Server":
            return self

        def __exit__(self, *_: object) -> None:
            pass

        def list(self, wanted: pb.RecordFilter | None) -> Iterator[pb.RecordSummary]:
            return iter([pb.RecordSummary(game_id=game) for game in ("a", "b", "c")])

        def read(self, game_id: str) -> Iterator[pb.RecordLine]:
            if game_id != "b":
                raise ChefsHatError("GAME_UNKNOWN", "there is no such game")
            yield pb.RecordLine(header=pb.RecordHeader(game_id=game_id))

    read: list[str] = []
    monkeypatch.setattr(chefshat.client, "Client", Server)
    monkeypatch.setattr(recorded, "from_records", lambda folder: read.extend(path.name for path in Path(folder).iterdir()))
    replay.from_server("127.0.0.1:1")
    assert read == ["b.jsonl"]


@pytest.mark.server
def test_damaged_records_are_reported(real_binary: Path, tmp_path: Path) -> None:
    (tmp_path / "broken.jsonl").write_text("{}\n", encoding="utf-8")
    with pytest.raises(ChefsHatError, match=r"RECORDS_REFUSED.*damaged"):
        replay.from_records(tmp_path)
