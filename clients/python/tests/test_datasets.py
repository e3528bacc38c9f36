"""Datasets of `chefshat export`, read with pandas, polars and pyarrow: types, rows, and the counts of `chefshat simulate`."""

import ast
import hashlib
import json
import re
import subprocess
import sys
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import polars
import pyarrow
import pyarrow.parquet
import pytest
from real_server import RealServer
from waiting import wait_until

import chefshat
from chefshat import Agent, Decision, RandomAgent, pb

pytestmark = pytest.mark.server

DOCS = Path(__file__).resolve().parents[3] / "docs" / "datasets.md"
TABLES = ["decisions", "expressions", "markers", "samples"]
# Simulated games, and their agents.
GAMES = 6
AGENTS = ["greedy", "random_unmasked", "random", "random"]

ARROW: dict[str, Any] = {
    "bool": pyarrow.bool_(),
    "uint8": pyarrow.uint8(),
    "uint16": pyarrow.uint16(),
    "uint32": pyarrow.uint32(),
    "uint64": pyarrow.uint64(),
    "float": pyarrow.float32(),
    "string": pyarrow.string(),
    "binary": pyarrow.binary(),
    "timestamp[us, UTC]": pyarrow.timestamp("us", tz="UTC"),
}
POLARS: dict[str, Any] = {
    "bool": polars.Boolean(),
    "uint8": polars.UInt8(),
    "uint16": polars.UInt16(),
    "uint32": polars.UInt32(),
    "uint64": polars.UInt64(),
    "float": polars.Float32(),
    "string": polars.String(),
    "binary": polars.Binary(),
    "timestamp[us, UTC]": polars.Datetime("us", "UTC"),
}


def arrow_type(documented: str) -> Any:
    """Returns the documented Arrow type."""
    if documented.startswith("list<"):
        return pyarrow.list_(arrow_type(documented[5:-1]))
    if documented.startswith("struct<"):
        fields = (field.split(": ") for field in documented[7:-1].split(", "))
        return pyarrow.struct([(name, arrow_type(of)) for name, of in fields])
    return ARROW[documented]


def polars_type(documented: str) -> Any:
    """Returns the documented polars type."""
    if documented.startswith("list<"):
        return polars.List(polars_type(documented[5:-1]))
    if documented.startswith("struct<"):
        fields = (field.split(": ") for field in documented[7:-1].split(", "))
        return polars.Struct({name: polars_type(of) for name, of in fields})
    return POLARS[documented]


def documented_columns(table: str) -> list[tuple[str, str]]:
    """Returns the documented names and types of a table's columns."""
    section = DOCS.read_text(encoding="utf-8").split(f"\n## {table.capitalize()}\n")[1]
    text = section.split("| column | type | content |\n")[1].split("\n\n")[0]
    return re.findall(r"^\| `(\w+)` \| `([^`]+)` \|", text, re.MULTILINE)


def run(binary: Path, *arguments: object) -> Any:
    """Returns the program's JSON output."""
    command = [str(binary), *(str(argument) for argument in arguments), "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


class Talkative(RandomAgent):
    """Plays at random, sends expressions and samples, and asks for one hint."""

    def __init__(self, client: chefshat.Client, ticket: str) -> None:
        super().__init__(1)
        self.client = client
        self.ticket = ticket

    def decide(self, request: Decision) -> int:
        if request.decision_id % 5 == 2:
            chunk = pb.SampleChunk(
                stream="affect", channels=["valence", "arousal"], elapsed_us=[1, 2], values=[0.5, -0.5, 0.25, np.nan]
            )
            self.client.rooms.add_samples(self.ticket, chunk)
            public = pb.Expression(label="joy", valence=0.5, source=pb.EXPRESSION_SOURCE_SELF_REPORT)
            self.client.send_expression(self.ticket, public)
        if request.decision_id % 7 == 3:
            private = pb.Expression(label="doubt", confidence=0.25, media="clip", record_only=True)
            self.client.send_expression(self.ticket, private)
        if request.decision_id == 3:
            hint = self.client.get_hint(self.ticket, request.decision_id)
            assert request.mask[hint.action]
            assert {estimate.action for estimate in hint.actions} <= set(request.legal_actions)
        return super().decide(request)


class Stubborn(Agent):
    """Answers with illegal actions."""

    def decide(self, request: Decision) -> int:
        return int((~request.mask).nonzero()[0][0])


@dataclass
class Dataset:
    """A folder with datasets of the same records: `dataset` (all formats) and `gym`."""

    folder: Path
    records: Path
    # The output of `simulate`.
    metrics: Any = None

    def parquet(self, table: str) -> Path:
        return self.folder / "dataset" / f"{table}.parquet"

    def gym(self) -> "list[pandas.DataFrame]":
        return [pandas.read_csv(path) for path in sorted((self.folder / "gym").glob("*/Dataset.pkl.csv"))]


def export(binary: Path, records: Path, folder: Path) -> None:
    """Exports the datasets and checks their checksums."""
    exported = run(binary, "export", records, "--out", folder / "dataset", "--format", "parquet,csv,jsonl")
    assert exported["games"] == len(list(records.glob("*.jsonl"))) > 0
    assert run(binary, "export", records, "--out", folder / "gym", "--layout", "chefshatgym")["games"] == exported["games"]
    for name in ["dataset", "gym"]:
        sums = (folder / name / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
        assert len(sums) > exported["games"] if name == "gym" else len(sums) == 13
        for line in sums:
            digest, path = line.split("  ")
            assert hashlib.sha256((folder / name / path).read_bytes()).hexdigest() == digest


@pytest.fixture(scope="module")
def hosted(real_binary: Path, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Games hosted by a real server: one with expressions and a marker, one with invalid attempts."""
    data_dir = tmp_path_factory.mktemp("data")
    records = data_dir / "records"
    rules = pb.RuleSet(target_shifts=2)
    with RealServer(real_binary, data_dir) as server, chefshat.Client(server.address) as client:
        seats = [None, "random", "greedy", "random"]
        room = client.rooms.create("talk", rules=rules, policy=pb.RoomPolicy(hints=True), seats=seats)
        ticket = client.rooms.join(room.join_code, "Talkative").ticket
        client.rooms.add_marker(room.room.room_id, room.owner_token, "EEG on")
        client.play(Talkative(client, ticket), ticket)
        policy = pb.RoomPolicy(max_invalid_attempts=3)
        room = client.rooms.create("stubborn", rules=rules, policy=policy, seats=seats)
        client.play(Stubborn(), client.rooms.join(room.join_code, "Stubborn").ticket)
        wait_until(lambda: len(list(records.glob("*.jsonl"))) >= 2, "the records of two finished games are there")
    folder = tmp_path_factory.mktemp("hosted")
    export(real_binary, records, folder)
    return Dataset(folder, records)


@pytest.fixture(scope="module")
def simulated(real_binary: Path, tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Simulated games, with statistics collected during the simulation."""
    folder = tmp_path_factory.mktemp("simulated")
    records = folder / "records"
    arguments = ["simulate", "--games", GAMES, "--seed", 7, "--agents", ",".join(AGENTS), "--reward", "paper"]
    metrics = run(real_binary, *arguments, "--records", records)
    export(real_binary, records, folder)
    return Dataset(folder, records, metrics)


@pytest.mark.parametrize("table", TABLES)
def test_every_column_has_its_documented_type(hosted: Dataset, table: str) -> None:
    columns = documented_columns(table)
    assert len(columns) == {"decisions": 65, "expressions": 20, "markers": 6, "samples": 8}[table]
    schema = pyarrow.parquet.read_schema(hosted.parquet(table))
    in_polars = polars.read_parquet(hosted.parquet(table))
    in_pandas = pandas.read_parquet(hosted.parquet(table), dtype_backend="pyarrow")
    assert schema.names == in_polars.columns == list(in_pandas.columns) == [name for name, _ in columns]
    assert in_polars.height == len(in_pandas) > 0
    for name, documented in columns:
        assert schema.field(name).type == arrow_type(documented), name
        assert in_polars.schema[name] == polars_type(documented), name
        assert in_pandas[name].dtype == pandas.ArrowDtype(arrow_type(documented)), name


@pytest.mark.parametrize("table", TABLES)
def test_every_format_has_the_same_cells(hosted: Dataset, table: str) -> None:
    rows = polars.read_parquet(hosted.parquet(table)).to_dicts()
    with (hosted.folder / "dataset" / f"{table}.jsonl").open(encoding="utf-8") as file:
        objects = [json.loads(line) for line in file]
    text = pandas.read_csv(hosted.folder / "dataset" / f"{table}.csv", dtype=str, keep_default_na=False)
    assert len(rows) == len(objects) == len(text) > 0
    for row, item, (_, cells) in zip(rows, objects, text.iterrows(), strict=True):
        for name, documented in documented_columns(table):
            value = row[name]
            if documented == "binary":
                value = value.hex()
            elif documented == "timestamp[us, UTC]" and value is not None:
                assert datetime.fromisoformat(item[name]) == value
                value = item[name]
            elif documented == "float" and value is not None:
                # As in the file: the shortest text that parses to the same 32 bits.
                assert np.float32(item[name]) == np.float32(value)
                value = item[name]
            assert item[name] == value, name
            if value is None or isinstance(value, str):
                assert cells[name] == (value or "")
            else:
                assert json.loads(cells[name]) == value


def test_rows_are_the_decisions_of_the_records(hosted: Dataset) -> None:
    decisions = polars.read_parquet(hosted.parquet("decisions"))
    recorded = []
    for path in sorted(hosted.records.glob("*.jsonl")):
        lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        game = lines[0]["header"]["gameId"]
        for line in lines:
            if decision := line.get("decision"):
                source = decision["source"].removeprefix("DECISION_SOURCE_").lower()
                attempts = decision.get("invalidAttempts", [])
                recorded.append((game, decision.get("seat", 0), decision["text"], source, attempts))
    assert decisions.select("game_id", "seat", "text", "source", "invalid_attempts").rows() == recorded

    played = decisions.filter(polars.col("agent") == "Talkative")
    assert played["agent_kind"].unique().to_list() == ["agent"]
    assert played["decision_time_us"].null_count() == 0
    hinted = decisions.filter("hinted")
    assert hinted.select("agent", "decision_id").rows() == [("Talkative", 3)]
    built_in = decisions.filter(polars.col("agent_kind") == "built_in")
    assert built_in["decision_time_us"].null_count() == built_in.height > 0
    assert set(built_in["built_in_agent"]) == {"random", "greedy"}
    assert decisions["created_at"].null_count() == 0
    # No decision was taken over from another game.
    assert decisions["agent"].null_count() == decisions["agent_kind"].null_count() == 0

    refused = decisions.filter(polars.col("agent") == "Stubborn")
    assert refused.height > 0
    assert refused["invalid_count"].unique().to_list() == [3]
    assert refused["source"].unique().to_list() == ["invalid"]
    assert not refused["valid"].any()
    turns = refused.filter(polars.col("phase") == "turn")
    assert turns["invalid_reward_validity"].unique().to_list() == [-3.0]


def test_expressions_are_in_the_rows_of_the_decisions_they_precede(hosted: Dataset) -> None:
    expressions = polars.read_parquet(hosted.parquet("expressions"))
    assert set(expressions["label"]) == {"joy", "doubt"}
    assert expressions.filter(polars.col("public"))["label"].unique().to_list() == ["joy"]
    assert expressions["agent"].unique().to_list() == ["Talkative"]
    decisions = polars.read_parquet(hosted.parquet("decisions")).filter(polars.col("room_name") == "talk")
    shown = decisions.select("number", polars.col("expressions").list.get(0)).rows()
    for number, latest in shown:
        before = expressions.filter(polars.col("decisions_before") < number)
        if before.height == 0:
            assert latest is None
        else:
            last = before.row(-1, named=True)
            fields = ["label", "valence", "arousal", "dominance", "confidence", "source", "public"]
            assert {field: latest[field] for field in fields} == {field: last[field] for field in fields}
            assert latest["age_ms"] >= 0
    assert any(latest is not None for _, latest in shown)


def test_tables_agree_with_simulate(simulated: Dataset) -> None:
    decisions = pandas.read_parquet(simulated.parquet("decisions"))
    assert decisions["game_id"].nunique() == GAMES
    assert len(decisions) == simulated.metrics["decisions"]
    turns = decisions[decisions["phase"] == "turn"]
    for seat in simulated.metrics["seats"]:
        mine = turns[turns["seat"] == seat["seat"]]
        assert mine["agent"].unique().tolist() == [AGENTS[seat["seat"]]]
        assert len(mine) == seat["valid_actions"] > 0
        assert mine["invalid_count"].sum() == seat["wrong_actions"]
        assert (mine["text"] == "pass").sum() == seat["passes"] > 0
        rewards = (mine["reward_paper"].astype(float) + mine["invalid_reward_paper"].astype(float)).sum()
        count = seat["valid_actions"] + seat["wrong_actions"]
        assert rewards / count == pytest.approx(seat["mean_reward"], rel=1e-5)
        shifts = mine.drop_duplicates(["game_id", "shift"])
        assert shifts["shift_points"].sum() == seat["points"]
        games = mine.drop_duplicates(["game_id"])
        assert (games["game_place"] == 1).sum() == seat["games_won"]
        assert games["game_points"].sum() == seat["points"]


def names_of(metrics: Any) -> dict[int, str]:
    """Returns the names of the simulated players in the chefshatgym layout: duplicates with their seats."""
    agents = [seat["agent"] for seat in metrics["seats"]]
    return {seat: name if agents.count(name) == 1 else f"{name} (seat {seat})" for seat, name in enumerate(agents)}


def test_the_chefshatgym_layout_agrees_with_simulate(simulated: Dataset) -> None:
    games = simulated.gym()
    assert len(games) == GAMES
    names = names_of(simulated.metrics)
    played = dict.fromkeys(names.values(), 0)
    passed = dict.fromkeys(names.values(), 0)
    pizzas = dict.fromkeys([*names.values(), "SYSTEM"], 0)
    points = dict.fromkeys(names.values(), 0)
    shifts = 0
    for rows in games:
        assert ast.literal_eval(rows["Agent_Names"][0]) == list(names.values())
        for source, action, description in rows[["Source", "Action_Type", "Action_Description"]].itertuples(index=False):
            if action == "DISCARD":
                (passed if description == "pass" else played)[source] += 1
            elif action == "DECLARE_PIZZA":
                pizzas[source] += 1
        ends = rows[rows["Action_Type"] == "END_MATCH"]
        shifts += len(ends)
        for scores in ends["Match_Score"]:
            for name, score in ast.literal_eval(scores).items():
                points[name] += score
    metrics = simulated.metrics
    for seat in metrics["seats"]:
        name = names[seat["seat"]]
        assert played[name] == seat["plays"] > 0
        assert passed[name] == seat["passes"] > 0
        assert points[name] == seat["points"]
        assert pizzas[name] > 0
    assert shifts == metrics["shifts"]
    assert sum(pizzas.values()) == round(metrics["pizzas_per_shift"] * metrics["shifts"])

    # The pizzas of each player, compared with the events of the records.
    made = dict.fromkeys(names.values(), 0)
    for path in sorted(simulated.records.glob("*.jsonl")):
        last = None
        for line in path.read_text(encoding="utf-8").splitlines():
            event = json.loads(line).get("event", {})
            if "play" in event:
                last = names[event["play"].get("seat", 0)]
            if ("pizzaDone" in event or "shiftEnded" in event) and last is not None:
                made[last] += 1
                last = None
    assert made == {name: pizzas[name] for name in made}


def test_the_chefshatgym_layout_is_readable_like_the_original(hosted: Dataset) -> None:
    action = re.compile(r"C\d+;Q\d+;J\d+|pass")
    for rows in hosted.gym():
        types = rows["Action_Type"].tolist()
        assert types[:3] == ["START_EXPERIMENT", "NEW_MATCH", "DEAL_CARDS"]
        assert types[-2:] == ["END_MATCH", "END_EXPERIMENT"]
        assert types.count("END_MATCH") == types.count("NEW_MATCH") == 2
        assert types.count("CARD_EXCHANGE") <= 1
        hands: dict[str, list[int]] = {}
        names = ast.literal_eval(rows["Agent_Names"][0])
        for row in rows.to_dict("records"):
            if row["Action_Type"] in ("DEAL_CARDS", "CARD_EXCHANGE"):
                hands = dict(zip(names, ast.literal_eval(row["Player_Hands"]), strict=True))
                assert [len(hand) for hand in hands.values()] == [17] * 4
            if row["Action_Type"] != "DISCARD":
                continue
            text = row["Action_Description"]
            possible = ast.literal_eval(row["Possible_Actions"])
            before, after = (ast.literal_eval(row[name]) for name in ("Board_Before", "Board_After"))
            assert text in possible
            assert all(action.fullmatch(each) for each in possible)
            assert len(before) == len(after) == 11
            hand = ast.literal_eval(row["Player_Hands"])
            assert len(hand) == 17
            # Each card of the hand is still in it, or on the board.
            gone = [] if text == "pass" else [card for card in after if card]
            assert sorted(card for card in hand + gone if card) == sorted(card for card in hands[row["Source"]] if card)
            assert after == before if text == "pass" else before[0] > after[0]
            assert str(row["Player_Finished"]) == str(not any(hand))
            hands[row["Source"]] = hand
        scores = ast.literal_eval(rows["Game_Score"].iloc[-1])
        assert sum(scores.values()) == 18
        assert list(ast.literal_eval(rows["Game_Performance_Score"].iloc[-1])) == names
        roles = ast.literal_eval(rows["Current_Roles"].iloc[-1])
        assert sorted(roles.values()) == ["Chef", "Dishwasher", "Souschef", "Waiter"]


SAMPLES = re.findall(r"^```python\n(.*?)^```", DOCS.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL) if DOCS.is_file() else []


def test_there_are_samples() -> None:
    assert len(SAMPLES) == 4


@pytest.mark.parametrize("number", range(len(SAMPLES)))
def test_the_samples_of_the_documentation_run(number: int, hosted: Dataset) -> None:
    done = subprocess.run([sys.executable, "-c", SAMPLES[number]], capture_output=True, text=True, cwd=hosted.folder)
    assert done.returncode == 0, done.stderr
    assert done.stdout != ""
