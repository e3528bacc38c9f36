"""Every command of this package in the documents of the project has arguments that its parser accepts."""

from pathlib import Path

import pytest
from book import Command, check, found

SCRIPTS = {
    "chefshat-agent": "chefshat.agent",
    "chefshat-learn": "chefshat.learn.__main__",
}
COMMANDS = found(Path(__file__).resolve().parents[1] / "src", "chefshat", SCRIPTS)


def test_there_are_commands() -> None:
    assert {module for _, module, _ in COMMANDS} >= {*SCRIPTS.values(), "chefshat.lsl"}
    assert len(COMMANDS) > 10


@pytest.mark.parametrize("command", COMMANDS, ids=[" ".join(arguments)[:60] for _, _, arguments in COMMANDS])
def test_the_arguments_are_accepted(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    check(command, monkeypatch)
