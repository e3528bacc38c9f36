"""The command line `chefshat-robot`.

A subcommand is a module with `add_arguments(parser)` and `run(arguments) -> int`, the exit code. Only the module of the chosen
subcommand is imported, so that each needs only its own extra of the package.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Protocol, cast


class CommandError(Exception):
    """A mistake of the user or of the surroundings: the message says what is wrong and what to do."""


class Command(Protocol):
    """What the module of a subcommand offers."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Adds its arguments, and a description with an example."""

    def run(self, arguments: argparse.Namespace) -> int:
        """Runs it and returns the exit code.

        Raises:
            CommandError: With a message for the user.
            OSError: A file cannot be read or written.
        """


@dataclass(frozen=True)
class Entry:
    """A subcommand before it is imported.

    Attributes:
        module: Its module, below this package.
        extra: The extra of the package with the libraries it needs.
        summary: What it does, in one line.
    """

    module: str
    extra: str
    summary: str


COMMANDS = {
    "robot": Entry("robot", "robots", "play a seat with a robot, whose decisions an agent makes"),
    "wizard": Entry("wizard", "robots", "let a robot do what a person on the page plays for it (Wizard of Oz)"),
    "affect": Entry("affect", "lsl", "forward what analysers of faces and voices read to the game"),
    "bridge": Entry("command_bridge", "vision", "report what a camera sees to a physical table"),
    "calibrate": Entry("vision.command_calibrate", "vision", "measure the lens of a camera"),
    "perceive": Entry("vision.command_perceive", "vision", "watch the table through a camera and print what happens"),
    "rehearse": Entry("rehearse", "vision", "play a game at a synthetic table on a real server"),
    "table": Entry("synthetic.command", "vision", "write a video of a synthetic table, with the truth"),
    "print": Entry("printing.command", "print", "write the cards, the playing field and the calibration sheet as a PDF"),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Args:
        arguments: The arguments without the name of the program; by default those of the process.

    Returns:
        The exit code: 0 on success, 1 after an error that is printed. Wrong arguments exit with 2 (`SystemExit`).
    """
    given = sys.argv[1:] if arguments is None else list(arguments)
    parser = argparse.ArgumentParser(prog="chefshat-robot", description="Chef's Hat at a real table, with a camera and robots.")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    chosen = next((word for word in given if not word.startswith("-")), None)
    command: Command | None = None
    try:
        for name, entry in COMMANDS.items():
            subparser = subparsers.add_parser(
                name, help=entry.summary, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
            )
            if name == chosen:
                command = _import(entry)
                command.add_arguments(subparser)
        parsed = parser.parse_args(given)
        assert command is not None, "a chosen command is one of COMMANDS"
        return command.run(parsed)
    except (CommandError, OSError) as error:
        print(f"chefshat-robot: {error}", file=sys.stderr)
        return 1


def _import(entry: Entry) -> Command:
    """The module of a subcommand."""
    try:
        return cast(Command, import_module(f"chefshat_robot.{entry.module}"))
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith("chefshat_robot"):
            raise
        raise CommandError(
            f"this command needs the library {error.name}; install it with: pip install 'chefshat-robot[{entry.extra}]'"
        ) from error


if __name__ == "__main__":
    sys.exit(main())
