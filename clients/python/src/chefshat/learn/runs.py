"""What the commands that train have in common: base seeds, full rule sets, going on with a training, and Ctrl-C.

How a training is kept in a file is in `training_file`; what it does, in the modules of the agents.
"""

import signal
import threading
from collections.abc import Mapping
from pathlib import Path
from types import FrameType, TracebackType
from typing import Any, Self

from google.protobuf.json_format import MessageToDict

from chefshat import pb
from chefshat.vector import Rules, VectorEnv

# Seeds that users choose are below 2^31. What must not play the same games adds multiples of this to them.
SEED_STEP = 2**32
# Deals that policies are looked at with, the same every time; trainings use base seeds from 2^32 on.
EVALUATION_SEED = 20_200_612
# Characters of the commands that a file remembers. `chefshat` reads at most 16 KiB of such a text, and a character may be 4 bytes.
MAX_TRAINED_BY = 4_000
LEFT_OUT = " [...] "
# The exit code of a command that Ctrl-C has ended.
INTERRUPTED = 130


def full_rules(rules: Rules, address: str | None) -> pb.RuleSet:
    """A rule set with every field set, as the server understands it."""
    with VectorEnv(address, 1, rules=rules, seed=0) as env:
        return env.rules


def existing(training: Path) -> Path:
    """The file of a training that is to go on. Raises FileNotFoundError, saying what to do, if it is not there."""
    if not training.exists():
        raise FileNotFoundError(f"{training} does not exist: there is nothing to go on from; leave out --resume to begin")
    return training


def trained_by(before: str, command: str) -> str:
    """The commands of a training that goes on: who wants to train the same again needs them all.

    Of more than `MAX_TRAINED_BY` characters the first half and the last remain.
    """
    commands = f"{before}; {command}" if before else command
    if len(commands) <= MAX_TRAINED_BY:
        return commands
    half = (MAX_TRAINED_BY - len(LEFT_OUT)) // 2
    return commands[:half] + LEFT_OUT + commands[-half:]


def refuse_contradictions(given: Mapping[str, object], kept: Mapping[str, object]) -> None:
    """Compares options that were given with what a training has that is to go on.

    Args:
        given: options by their names in Python; those that `kept` does not have are free.
        kept: what the training has, by the same names.

    Raises:
        ValueError: they differ. The message says in what.
    """
    differing = [
        f"{name.replace('_', ' ')} {kept[name]}, not {value}"
        for name, value in given.items()
        if name in kept and kept[name] != value
    ]
    if differing:
        raise ValueError(
            f"the training to go on from has {'; '.join(differing)}: leave the options out that say so, or begin without --resume"
        )


def refuse_other_rules(asked: pb.RuleSet, kept: pb.RuleSet) -> None:
    """Compares full rule sets, but for what ends a game. Raises ValueError if they differ; the message says in what."""

    def plain(rules: pb.RuleSet) -> dict[str, Any]:
        fields = MessageToDict(rules, preserving_proto_field_name=True, always_print_fields_with_no_presence=True)
        return {f"rules {name}": value for name, value in fields.items() if name not in ("target_points", "target_shifts")}

    refuse_contradictions(plain(asked), plain(kept))


class Interrupts:
    """While it is entered, Ctrl-C asks to stop where it suits; a second one interrupts at once.

    Outside of the main thread, where no signals arrive, it does nothing.

    Attributes:
        asked: whether it was asked to stop.
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
