"""What the command lines of training packages share: their parser, the message for a missing package, and types of options.

Imports packages that train only after parsing the options, so that `--help` works without them.
"""

import argparse
import importlib
import json
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chefshat import join_options
from chefshat.errors import INTERRUPTED

MAX_WIDTH = 4096
# Adds the options of a command.
AddOptions = Callable[[argparse.ArgumentParser], None]


@dataclass(frozen=True)
class Program:
    """A command line, `python -m MODULE COMMAND`. Each command is the function `run(options)` of a module.

    Attributes:
        module: the package, whose modules `commands` names.
        description: what it does.
        examples: the end of its help, with a line for each command.
        commands: of each command its module, its summary, and what adds its options.
        extra: what to install if one of `packages` is missing.
        packages: the packages of that extra. A missing module of any other package is a bug.
    """

    module: str
    description: str
    examples: str
    commands: Mapping[str, tuple[str, str, AddOptions]]
    extra: str
    packages: Sequence[str]

    def main(self, arguments: Sequence[str] | None = None) -> int:
        """Runs the command and returns its exit code."""
        given = sys.argv[1:] if arguments is None else arguments
        options = self.parse(given)
        options.trained_by = shlex.join(["python", "-m", self.module, *_without_secrets(given, options)])
        try:
            return int(importlib.import_module(options.module).run(options))
        except ModuleNotFoundError as error:
            if (error.name or "").partition(".")[0] not in self.packages:
                raise
            print(f"error: the package {error.name} is missing; pip install '{self.extra}'", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            print("interrupted", file=sys.stderr)
            return INTERRUPTED

    def parse(self, arguments: Sequence[str] | None) -> argparse.Namespace:
        """Parses the options. Exits with 2 if they are wrong, with 0 after --help.

        Options given explicitly are also in `given`, by name.
        """
        parser = argparse.ArgumentParser(
            prog=f"python -m {self.module}",
            description=self.description,
            epilog=self.examples,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        commands = parser.add_subparsers(metavar="COMMAND", required=True)
        for name, (module, summary, add_options) in self.commands.items():
            example = next(line for line in self.examples.splitlines() if f"{self.module} {name} " in line)
            command = commands.add_parser(
                name, help=summary, description=summary, epilog=f"example:\n{example}", formatter_class=_WithDefaults
            )
            command.register("action", None, Given)
            command.set_defaults(module=f"{self.module}.{module}", given={})
            command.add_argument("--json", action="store_true", help="print one line of JSON instead of text")
            add_options(command)
        return parser.parse_args(arguments)


def _without_secrets(arguments: Sequence[str], options: argparse.Namespace) -> list[str]:
    """Returns the arguments as networks and logs have them, which people publish: with "..." for a token and other secrets."""
    secrets = [secret for secret in (getattr(options, "token", None), *getattr(options, "secret", ())) if secret]

    def shown(argument: str) -> str:
        found = (secret for secret in secrets if argument == secret or argument.endswith(f"={secret}"))
        return next((f"{argument.removesuffix(secret)}..." for secret in found), argument)

    return list(map(shown, arguments))


class Given(argparse.Action):
    """Stores a value and records it in `given`, so that a resumed training can refuse contradictions. nargs=0 stores `const`."""

    def __call__(self, parser: Any, namespace: Any, values: Any, option: str | None = None) -> None:  # noqa: ANN401 - argparse's.
        """Stores the value."""
        value = self.const if self.nargs == 0 else values
        setattr(namespace, self.dest, value)
        namespace.given = {**namespace.given, self.dest: value}


class _WithDefaults(argparse.RawDescriptionHelpFormatter, argparse.ArgumentDefaultsHelpFormatter):
    """Shows the default of every option that has one."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        return action.help if action.default is None or action.default is False else super()._get_help_string(action)


def add_games(command: argparse.ArgumentParser) -> None:
    """Adds the options of a command that plays: the seed and the server."""
    command.add_argument("--seed", type=natural, default=1, help="seed of deals and of random choices")
    join_options.add_server_options(command)


def add_rules(command: argparse.ArgumentParser) -> None:
    """Adds the option for the rule set."""
    command.add_argument("--rules", default="paper", metavar="PRESET", help="the rule set")


def add_log(command: argparse.ArgumentParser) -> None:
    """Adds the option for the log of a training."""
    command.add_argument(
        "--log", type=Path, metavar="FILE", help="JSON lines of the setup and the evaluations (default: OUT as .jsonl)"
    )


def add_evaluations(command: argparse._ActionsContainer) -> None:
    """Adds the options for the evaluations of a training."""
    command.add_argument(
        "--evaluations", "--looks", type=count, default=20, help="number of evaluations, besides the one before the first update"
    )
    command.add_argument("--evaluation-games", type=count, default=400, help="games against greedy and random in each evaluation")


def add_force(command: argparse.ArgumentParser) -> None:
    """Adds the option that replaces files."""
    command.add_argument("--force", action="store_true", help="replace existing files")


def count(text: str) -> int:
    """Parses a number from 1."""
    number = natural(text)
    if number == 0:
        raise argparse.ArgumentTypeError("must be at least 1")
    return number


def units(text: str) -> int:
    """Parses the width of hidden layers. Two of the widest, in float16, are smaller than the largest file that agents read."""
    number = count(text)
    if number > MAX_WIDTH:
        raise argparse.ArgumentTypeError(f"must be at most {MAX_WIDTH}: agents read no larger networks")
    return number


def natural(text: str) -> int:
    """Parses a number from 0 to 2147483647."""
    if not (text.isascii() and text.isdigit() and int(text) < 2**31):
        raise argparse.ArgumentTypeError("must be a number from 0 to 2147483647")
    return int(text)


def json_object(text: str) -> str:
    """Checks that a text is a JSON object, and returns it."""
    try:
        read = json.loads(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"is not JSON: {error}") from error
    if not isinstance(read, dict):
        raise argparse.ArgumentTypeError('must be a JSON object, such as {"agentType": "vsSelf"}')
    return text


def above_zero(text: str) -> float:
    """Parses a number above 0."""
    number = float(text)
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError("must be above 0")
    return number


def zero_or_more(text: str) -> float:
    """Parses a number of 0 or more."""
    number = float(text)
    if not 0 <= number < float("inf"):
        raise argparse.ArgumentTypeError("must be 0 or more")
    return number


def share(text: str) -> float:
    """Parses a number from 0 to 1."""
    number = float(text)
    if not 0 <= number <= 1:
        raise argparse.ArgumentTypeError("must be from 0 to 1")
    return number
