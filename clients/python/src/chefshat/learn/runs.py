"""What the training commands share: base seeds, full rule sets, resuming a training, and Ctrl-C.

The file of a training is in `training_file`, the training itself in the modules of the agents.
"""

import contextlib
import signal
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, Self

from google.protobuf.json_format import MessageToDict

from chefshat import pb
from chefshat.address import ServerAddress
from chefshat.vector import Rules, VectorEnv

# Seeds given by users are below 2^31. Adding multiples of this gives other games.
SEED_STEP = 2**32
# Base seed of all evaluations; trainings use base seeds from 2^32 on. Only a new one of `deep-q` plays the game of its own seed.
EVALUATION_SEED = 20_200_612
# Maximum characters of the commands in a file. `chefshat` reads at most 16 KiB of such a text, and a character may be 4 bytes.
MAX_TRAINED_BY = 4_000
LEFT_OUT = " [...] "


def full_rules(rules: Rules, address: str | ServerAddress | None) -> pb.RuleSet:
    """Returns a rule set with every field set."""
    with VectorEnv(address, 1, rules=rules, seed=0) as env:
        return env.rules


def existing(training: Path) -> Path:
    """Returns the checkpoint to resume from. Raises FileNotFoundError, saying what to do, if it does not exist."""
    if not training.exists():
        raise FileNotFoundError(f"{training} does not exist: there is nothing to resume; leave out --resume to start a training")
    return training


@contextlib.contextmanager
def reserved(*files: Path, replace: bool, can_resume: bool = True) -> Iterator[None]:
    """Reserves the files that a command writes, before it begins with the work.

    Unless it replaces them, the last one is created, empty, so that another command that would write it is refused. If it is still
    empty at the end, it is removed.

    Args:
        files: the files.
        replace: whether existing ones are replaced or resumed.
        can_resume: whether the command has --resume.

    Raises:
        FileNotFoundError: there is no folder for one of them.
        FileExistsError: one exists, and is not replaced. The message says what to do.
    """
    resume = "continue that training with --resume, " if can_resume else ""
    words = f"exists: {resume}replace it with --force, or give another --out"
    for file in files:
        if not file.parent.is_dir():
            raise FileNotFoundError(f"there is no folder {file.parent} to write {file.name} to")
        if file.exists() and not replace:
            raise FileExistsError(f"{file} {words}")
    last = files[-1]
    if not replace:
        try:
            last.touch(exist_ok=False)
        except FileExistsError:
            raise FileExistsError(f"{last} {words}") from None
    try:
        yield
    finally:
        if not replace and last.exists() and last.stat().st_size == 0:
            last.unlink()


def trained_by(before: str, command: str) -> str:
    """Appends a command to those of a resumed training: reproducing it takes all of them.

    Cuts the middle out of more than `MAX_TRAINED_BY` characters.
    """
    commands = f"{before}; {command}" if before else command
    if len(commands) <= MAX_TRAINED_BY:
        return commands
    half = (MAX_TRAINED_BY - len(LEFT_OUT)) // 2
    return commands[:half] + LEFT_OUT + commands[-half:]


def refuse_contradictions(given: Mapping[str, object], fixed: Mapping[str, object]) -> None:
    """Compares the options given with the settings of the training to resume.

    Args:
        given: options by their names in Python; those that `fixed` lacks may have any value.
        fixed: the settings of the training, by the same names.

    Raises:
        ValueError: they differ. The message lists the differences.
    """
    differing = [
        f"{name.replace('_', ' ')} {fixed[name]}, not {value}"
        for name, value in given.items()
        if name in fixed and fixed[name] != value
    ]
    if differing:
        raise ValueError(f"the training to resume has {'; '.join(differing)}: leave these options out, or start without --resume")


def refuse_other_rules(asked: pb.RuleSet, fixed: pb.RuleSet) -> None:
    """Compares full rule sets, except for what ends a game. Raises ValueError if they differ; the message lists the differences."""

    def plain(rules: pb.RuleSet) -> dict[str, Any]:
        fields = MessageToDict(rules, preserving_proto_field_name=True, always_print_fields_with_no_presence=True)
        return {f"rules {name}": value for name, value in fields.items() if name not in ("target_points", "target_shifts")}

    refuse_contradictions(plain(asked), plain(fixed))


class Interrupts:
    """Defers Ctrl-C while entered: the first one sets `asked`, a second one interrupts at once.

    Does nothing outside of the main thread, where no signals arrive.

    Attributes:
        asked: whether Ctrl-C was pressed.
    """

    def __init__(self) -> None:
        self.asked = False

    def __enter__(self) -> Self:
        self._main = threading.current_thread() is threading.main_thread()
        if self._main:
            self._before = signal.signal(signal.SIGINT, self._ask)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._main:
            signal.signal(signal.SIGINT, self._before)

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
