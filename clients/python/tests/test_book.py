"""Every command of this package in the documents of the project has arguments that its parser accepts."""

import argparse
import importlib
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "clients/python/README.md", *sorted((ROOT / "docs").glob("*.md"))]
SCRIPTS = {
    "chefshat-agent": "chefshat.agent",
    "chefshat-experiments": "chefshat.experiments.__main__",
    "chefshat-learn": "chefshat.learn.__main__",
    "chefshat-players-club": "chefshat.players_club.__main__",
}
# Those of other packages have tests of their own.
PACKAGE = re.compile(r"chefshat(\.|$)")


class Accepted(Exception):
    """Raised in place of what the command would do."""


def commands(text: str) -> Iterator[list[str]]:
    """The command lines in the blocks of shell commands, as words."""
    for block in re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            lexer = shlex.shlex(line, posix=True, punctuation_chars=";&|")
            lexer.whitespace_split = True
            command: list[str] = []
            for word in [*lexer, ";"]:
                if set(word) <= set(";&|"):
                    yield command
                    command = []
                else:
                    command.append(word)


def found() -> Iterator[tuple[str, str, list[str]]]:
    """Each command of this package: the document, the module, and the arguments."""
    for document in DOCUMENTS:
        if not document.is_file():
            continue
        for command in commands(document.read_text(encoding="utf-8")):
            match command:
                case ["python", "-m", module, *arguments] if PACKAGE.match(module):
                    path = f"{module}.__main__" if (ROOT / "clients/python/src" / module.replace(".", "/")).is_dir() else module
                    yield document.name, path, arguments
                case [script, *arguments] if script in SCRIPTS:
                    yield document.name, SCRIPTS[script], arguments


COMMANDS = list(found())


def test_there_are_commands() -> None:
    assert {module for _, module, _ in COMMANDS} >= {*SCRIPTS.values(), "chefshat.lsl"}
    assert len(COMMANDS) > 20


@pytest.mark.parametrize(("page", "module", "arguments"), COMMANDS, ids=[" ".join(command[2])[:60] for command in COMMANDS])
def test_the_arguments_are_accepted(page: str, module: str, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    parse = argparse.ArgumentParser.parse_args

    def stop(self: argparse.ArgumentParser, given: list[str]) -> None:
        parse(self, given)
        raise Accepted

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", stop)
    # Exported on the pages whose commands name no server.
    monkeypatch.setenv("CHEFSHAT_SERVER", "https://chef.example.org")
    try:
        main = importlib.import_module(module).main
    except ModuleNotFoundError as error:
        pytest.skip(f"{error.name} is not installed")
    with pytest.raises(Accepted):
        main([argument.replace("$seed", "1") for argument in arguments])
