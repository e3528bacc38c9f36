"""`chefshat bench run` with an agent in Python: one process plays all games, whose seeds are what the documents say."""

import base64
import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from waiting import LIMIT_S

from chefshat import Agent, Decision, benchmark

pytestmark = pytest.mark.server

PAGE = Path(__file__).parents[3] / "docs" / "benchmark.md"
SAMPLE = Path(__file__).parents[1] / "samples" / "benchmark" / "never_idle.py"
DEALS = 6


def run(real_binary: Path, folder: Path, program: str) -> "subprocess.CompletedProcess[str]":
    """Plays the first deals of a task with a program in Python."""
    bench = [str(real_binary), "bench", "run", "shift", "--json", "--deals", str(DEALS), "--out", str(folder)]
    command = [*bench, "--name", "first", "--", sys.executable, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S)


@pytest.fixture(scope="module")
def agent() -> str:
    """The program of the page."""
    (program,) = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return str(program)


def test_one_process_plays_all_games(agent: str, real_binary: Path, tmp_path: Path) -> None:
    done = run(real_binary, tmp_path, agent)
    assert done.returncode == 1, "six deals are not a valid result"
    result = json.loads(done.stdout)
    assert result["deals"] == DEALS, done.stderr
    assert result["fallback_decisions"] == result["invalid_attempts"] == 0
    assert result["played_by"] == ["first"]
    assert result["problems"] == [f"{DEALS} of 2500 deals"]
    for deal in range(DEALS):
        lines = (tmp_path / "records" / f"{deal:04}.jsonl").read_text().splitlines()
        [ended] = [line["event"]["gameEnded"] for line in map(json.loads, lines) if "gameEnded" in line.get("event", {})]
        seed = hashlib.sha256(f"ChefsHat-v1 shift {deal}".encode()).digest()
        assert base64.b64decode(ended["reveal"]["gameSeed"]) == seed


def test_the_agent_of_the_reference_results_plays_the_same_games_again(real_binary: Path, tmp_path: Path) -> None:
    sample = SAMPLE.read_text(encoding="utf-8")
    one, again = (json.loads(run(real_binary, tmp_path / name, sample).stdout) for name in ("one", "again"))
    assert one["by_deal"] == again["by_deal"]
    assert one["deals"] == DEALS
    assert one["fallback_decisions"] == one["invalid_attempts"] == 0
    for record in (tmp_path / "one" / "records").glob("*.jsonl"):
        own = int(record.stem) % 4
        lines = [json.loads(line) for line in record.read_text().splitlines()]
        decisions = [line["decision"] for line in lines if "decision" in line and line["decision"].get("seat", 0) == own]
        passes = [decision for decision in decisions if decision["text"] == "pass"]
        assert passes
        for decision in passes:
            mask = base64.b64decode(decision["actionMask"])
            assert sum(byte.bit_count() for byte in mask) == 1, "it passes only if it must"


def test_what_the_agent_raises_is_shown(agent: str, real_binary: Path, tmp_path: Path) -> None:
    done = run(real_binary, tmp_path, agent.replace("legal_actions[0]", "legal_actions[10_000]"))
    assert done.returncode == 1
    assert "IndexError" in done.stderr


def test_the_lines_of_games_may_come_from_anywhere() -> None:
    class Never(Agent):
        def decide(self, decision: Decision) -> int:
            raise AssertionError(decision)

    def broken() -> Iterator[str]:
        yield from ()
        raise RuntimeError("torn")

    assert benchmark.play(Never, games=[]) == 0
    with pytest.raises(ValueError, match="not an address, a join code and a name"):
        benchmark.play(Never, games=["127.0.0.1:1"])
    with pytest.raises(RuntimeError, match="torn"):
        benchmark.play(Never, games=broken())
