"""The sample for Ray clusters, on a local one: only where Ray is installed (extra `ray`), which the tests do not ask for."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

from chefshat.learn import network

SAMPLE = Path(__file__).resolve().parents[1] / "samples" / "cluster" / "rllib_ppo.py"
# Seconds it may take before it counts as hanging: Ray starts several processes.
LIMIT_S = 300


@pytest.mark.server
@pytest.mark.skipif(importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install 'chefshat[ray]'")
def test_it_trains_a_few_iterations(real_address: str, tmp_path: Path) -> None:
    out = tmp_path / "n.safetensors"
    command = [sys.executable, str(SAMPLE), "--address", real_address, "--runners", "2", "--games", "8", "--iterations", "2"]
    done = subprocess.run([*command, "--out", str(out)], capture_output=True, text=True, timeout=LIMIT_S)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [json.loads(line)["decisions"] for line in lines[:2]] == [1024, 2048]
    assert "against random, random, random" in lines[2]
    assert network.load(out).info.name == "rllib"
