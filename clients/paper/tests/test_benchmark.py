"""`chefshat bench run` with a player of the reference implementation, by the sample."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from test_club_process import TESTS
from waiting import LIMIT_S

pytestmark = pytest.mark.server

SAMPLE = Path(__file__).parents[1] / "samples" / "benchmark" / "players_club.py"
DEALS = 3


def run(real_binary: Path, tmp_path: Path, player: str, *options: str) -> "subprocess.CompletedProcess[str]":
    """Plays the first deals of a task."""
    bench = [str(real_binary), "bench", "run", "shift", "--json", "--deals", f"{DEALS}", "--out", str(tmp_path / "results")]
    sample = [sys.executable, str(SAMPLE), f"club_players:{player}", "--python", sys.executable, *options]
    environment = os.environ | {"PYTHONPATH": TESTS}
    command = [*bench, "--name", "Ada", "--", *sample]
    return subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, env=environment, check=False)


def test_one_process_of_a_player_plays_all_games(real_binary: Path, tmp_path: Path) -> None:
    log = tmp_path / "log"
    done = run(real_binary, tmp_path, "Scribe", "--arguments", json.dumps({"log_file": str(log)}))
    result = json.loads(done.stdout)
    assert (result["deals"], result["problems"]) == (DEALS, [f"{DEALS} of 2500 deals"]), done.stderr
    assert result["fallback_decisions"] == result["invalid_attempts"] == 0
    assert log.read_text().count('["update_game_over"]') == DEALS


def test_what_is_decided_for_a_player_that_fails_is_a_fallback(real_binary: Path, tmp_path: Path) -> None:
    result = json.loads(run(real_binary, tmp_path, "Raising").stdout)
    assert 0 < result["fallback_decisions"] <= result["choices"]
    assert "fallback" in str(result["problems"])


def test_a_player_that_is_given_up_ends_the_run(real_binary: Path, tmp_path: Path) -> None:
    done = run(real_binary, tmp_path, "Mortal")
    assert done.returncode == 1
    assert "has failed too often" in done.stderr
