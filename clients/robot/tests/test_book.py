"""The samples in the book run, and what it names exists."""

from __future__ import annotations

import argparse
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from chefshat_robot import cli, drivers
from chefshat_robot.drivers import CardMove, Done, Express, Failed, Gaze, Pick, Pose, Say, driver

ROOT = Path(__file__).parents[3]
PAGES = [ROOT / "clients/robot/README.md", *sorted((ROOT / "docs").glob("robot*.md"))]
TEXT = "".join(page.read_text(encoding="utf-8") for page in PAGES)


async def test_the_sample_of_a_driver_works(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (sample,) = [code for code in re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL) if "class Lamp" in code]
    (tmp_path / "my_module.py").write_text(sample, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "my_module", raising=False)
    async with drivers.create("my_module.Lamp:port=9") as lamp:
        acts = (Say("I pass."), Express("joy"), Gaze(0.0, 0.0))
        outcomes = [await driver.attempt(lamp, act, 60) for act in acts]
    assert outcomes == [Done(), Done(), Failed("a lamp has no arms and no eyes")]
    assert capsys.readouterr().out.splitlines() == [
        "connected to port 9",
        "blinks for 'I pass.'",
        "turns to the colour of joy",
        "off",
    ]


async def test_the_sample_of_a_robots_program_works() -> None:
    program = Path(__file__).parent.parent / "samples" / "json_lines_robot.py"
    with subprocess.Popen([sys.executable, str(program), "0"], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            port = process.stdout.readline().split()[-1]
            async with drivers.create(f"jsonlines:port={port}") as robot:
                move = CardMove("9", None, Pose(97.5, 151.0))
                outcomes = [await driver.attempt(robot, act, 60) for act in (Say("I pass."), Pick((move,)), Gaze(0.0, 0.0))]
            assert outcomes == [Done(), Done(), Failed("this robot cannot turn its head")]
            lines = [process.stdout.readline().strip() for _ in range(2)]
            assert lines == ["says: I pass.", "carries the 9 to x 97.5 mm, y 151.0 mm"]
        finally:
            process.kill()


def test_every_command_and_every_driver_is_described() -> None:
    for name in cli.COMMANDS:
        assert f"chefshat-robot {name}" in TEXT
    for name in drivers.names():
        assert f"| `{name}` |" in TEXT


def test_commands_parse() -> None:
    """Every command in the book has options that exist."""
    lines = [shlex.split(line, comments=True) for line in TEXT.splitlines() if line.startswith("chefshat-robot ")]
    assert lines
    for _, name, *arguments in lines:
        parser = argparse.ArgumentParser()
        command = cli._import(cli.COMMANDS[name])
        command.add_arguments(parser)
        parser.parse_args(arguments)
