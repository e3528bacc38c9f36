"""The command line, apart from what its subcommands do."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from chefshat_robot import cli


def test_help_names_every_subcommand(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_info:
        cli.main(["--help"])
    assert exit_info.value.code == 0
    shown = " ".join(capsys.readouterr().out.split())
    for name, entry in cli.COMMANDS.items():
        assert f"{name} {entry.summary}" in shown


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_subcommand_has_help_with_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_info:
        cli.main([name, "--help"])
    assert exit_info.value.code == 0
    assert capsys.readouterr().out.count(f"chefshat-robot {name}") > 1


@pytest.mark.parametrize("option", ["--mistakes", "--face-down"])
def test_shares_of_a_rehearsal_are_from_0_to_1(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    for share in ("7", "-0.1", "nan"):
        assert cli.main(["rehearse", f"{option}={share}", "--ticket", "none"]) != 0
        assert f"{option} is from 0 to 1" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"), [([], "required: COMMAND"), (["fly"], "invalid choice: 'fly'"), (["--fly"], "required: COMMAND")]
)
def test_wrong_arguments_are_explained(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as exit_info:
        cli.main(arguments)
    assert exit_info.value.code == 2
    assert message in capsys.readouterr().err


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for name in [name for name in sys.modules if name.startswith("chefshat_robot.printing")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "segno", None)
    assert cli.main(["print"]) == 1
    assert "needs the library segno; install it with: pip install 'chefshat-robot[print]'" in capsys.readouterr().err


def test_the_extra_of_every_subcommand_exists() -> None:
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
    assert {entry.extra for entry in cli.COMMANDS.values()} <= set(project["optional-dependencies"])


def test_the_libraries_of_a_subcommand_are_imported_only_for_it() -> None:
    program = (
        "import sys; from chefshat_robot import cli; print([name for name in ('cv2', 'fpdf', 'segno') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    "command",
    [
        ["affect", "--ticket", "TICKET", "--listen", "127.0.0.1:0"],
        ["bridge", "{folder}", "--ticket", "TICKET"],
        ["rehearse"],
        ["robot", "--room", "CODE", "--name", "Pepe"],
        ["wizard", "--room", "ROOM", "--seat", "0"],
    ],
    ids=lambda command: command[0],
)
def test_every_subcommand_that_connects_takes_a_token_and_authorities(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    where = ["--address", "https://localhost:1", "--token", "chefshat_1_2", "--ca", str(tmp_path / "missing.pem")]
    (tmp_path / "frame.png").write_bytes(b"")
    assert cli.main([*(word.format(folder=tmp_path) for word in command), *where]) == 1
    error = capsys.readouterr().err
    assert "CA_REFUSED" in error
    assert "chefshat_1_2" not in error
