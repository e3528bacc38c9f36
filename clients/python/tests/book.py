"""The commands in the documents of the project, and whether a package accepts their arguments. Contains no tests."""

import argparse
import importlib
import re
import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "clients/python/README.md",
    ROOT / "clients/paper/README.md",
    *sorted((ROOT / "docs").glob("*.md")),
]

# Page, module and arguments of a command.
Command = tuple[str, str, list[str]]


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


def found(source: Path, package: str, scripts: Mapping[str, str]) -> list[Command]:
    """Returns each command of a package in the documents.

    Args:
        source: the folder with the package.
        package: its name.
        scripts: the modules of its scripts, by the names of those.
    """
    listed: list[Command] = []
    for document in DOCUMENTS:
        if not document.is_file():
            continue
        for command in commands(document.read_text(encoding="utf-8")):
            match command:
                case ["python", "-m", module, *arguments] if module.partition(".")[0] == package:
                    path = f"{module}.__main__" if (source / module.replace(".", "/")).is_dir() else module
                    listed.append((document.name, path, arguments))
                case [script, *arguments] if script in scripts:
                    listed.append((document.name, scripts[script], arguments))
    return listed


def check(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks that the parser of a command accepts its arguments. Skips a command whose dependencies are not installed."""
    _, module, arguments = command
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
