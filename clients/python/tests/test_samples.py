"""Every sample runs on both servers: the Python in the README and the book, the files in samples/, and the command."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from fake_server import FakeServer
from waiting import LIMIT_S

import chefshat
from chefshat import agent as command

PACKAGE = Path(__file__).resolve().parents[1]
PRINTED_ADDRESS = "127.0.0.1:50051"
ROOT = PACKAGE.parents[1]
# Those pages of the project that explain the package, in a complete checkout.
PAGES = [
    path
    for path in (
        ROOT / "README.md",
        ROOT / "docs" / "agents-python.md",
        ROOT / "docs" / "environments.md",
        ROOT / "docs" / "learning.md",
    )
    if path.is_file()
]
PRINTED = [
    block
    for path in PAGES
    for block in re.findall(r"^```python\n(.*?)^```", path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
]
SAMPLES = sorted(path.name for path in (PACKAGE / "samples").glob("*.py"))


def run_python(*arguments: str, folder: Path = PACKAGE) -> str:
    """Runs Python in a folder, and returns its output."""
    done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=LIMIT_S, cwd=folder)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_there_are_samples() -> None:
    assert len(PAGES) == 4
    assert len(PRINTED) >= 15
    assert len(SAMPLES) >= 4


@pytest.mark.parametrize("number", range(len(PRINTED)))
def test_printed(number: int, address: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    if PRINTED_ADDRESS not in PRINTED[number]:
        pytest.importorskip("chefshat_native")
        if "import pyspiel" in PRINTED[number]:
            pytest.importorskip("pyspiel")
        assert re.search(r"chefshat\.(make|VectorEnv)\(|(evaluate|compare)\(|pyspiel\.", PRINTED[number])
        if "fake" in request.fixturenames:
            pytest.skip("it plays in this process, so once is enough")
    if "replay" in PRINTED[number] and "fake" in request.fixturenames:
        pytest.skip("the records of the fake server cannot be replayed")
    if "chefshat import search" in PRINTED[number]:
        pytest.importorskip("chefshat_native")
        if "fake" in request.fixturenames:
            pytest.skip("the decisions of the fake server follow no rules")
    assert run_python("-c", PRINTED[number].replace(PRINTED_ADDRESS, address), folder=tmp_path) != ""


@pytest.mark.parametrize("name", SAMPLES)
def test_sample(name: str, address: str) -> None:
    assert run_python(f"samples/{name}", address) != ""


@pytest.mark.parametrize("agent", ["random", "samples.careful_agent:Careful"])
def test_command_prints_one_line_of_json(address: str, agent: str) -> None:
    with chefshat.Client(address) as client:
        code = client.rooms.create(seats=[None, "random", "random", "random"]).join_code
    printed = run_python("-m", "chefshat.agent", "--address", address, "--code", code, "--name", "Ada", "--agent", agent, "--json")
    outcome = json.loads(printed)
    assert printed.count("\n") == 1
    assert outcome["event"] == "finished"
    assert sorted(line["seat"] for line in outcome["standings"]) == [0, 1, 2, 3]
    assert outcome["place"] == next(line["place"] for line in outcome["standings"] if line["seat"] == outcome["seat"])
    assert outcome["decisions"] > 0
    assert outcome["invalid"] == 0


def test_command_prints_a_table(fake: FakeServer, capsys: pytest.CaptureFixture[str]) -> None:
    with chefshat.Client(fake.address) as client:
        code = client.rooms.create(seats=[None, "random", "random", "random"]).join_code
    assert command.main(["--address", fake.address, "--code", code, "--name", "Ada", "--seed", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["place", "seat", "points"]
    assert lines[1].endswith("<- this agent")
    assert lines[-1] == "5 decisions, 0 invalid answers, 0 too late"


def test_the_command_reports_refusals(fake: FakeServer, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--address", fake.address, "--code", "WRONG", "--name", "Ada"]
    assert command.main(arguments) == 1
    assert "JOIN_CODE_WRONG" in capsys.readouterr().err
    assert command.main([*arguments, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["reason"] == "JOIN_CODE_WRONG"


@pytest.mark.parametrize("agent", ["greedy", "no_such_module:Agent", "json:JSONDecoder", "samples.careful_agent:Nobody"])
def test_the_command_refuses_other_classes(agent: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(PACKAGE)
    with pytest.raises(SystemExit) as exit_info:
        command.main(["--address", "127.0.0.1:1", "--code", "X", "--name", "Ada", "--agent", agent])
    assert exit_info.value.code == 2
    assert agent in capsys.readouterr().err


def test_the_readme_has_no_local_path() -> None:
    assert os.sep + "home" not in (PACKAGE / "README.md").read_text(encoding="utf-8")
