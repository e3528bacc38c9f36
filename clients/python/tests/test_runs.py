"""What the training commands share."""

import argparse
import os
import signal
from pathlib import Path

import pytest

from chefshat.learn import ppo_command, runs
from chefshat.learn.__main__ import main, parse


def test_given_options_are_distinguished_from_defaults() -> None:
    options = parse(["ppo", "--out", "o", "--minutes", "1", "--games", "256", "--all-hands"])
    assert (options.given["games"], options.given["all_hands"]) == (256, True)
    assert "steps" not in options.given


@pytest.mark.parametrize(
    ("option", "values", "words"),
    [
        ("--gae-lambda", ("7", "-0.1", "nan"), "must be from 0 to 1"),
        ("--value-learning-rate", ("-1", "nan", "inf"), "must be 0 or more"),
        ("--entropy-bonus", ("-1", "nan", "inf"), "must be 0 or more"),
        ("--learning-rate", ("0", "nan", "inf"), "must be above 0"),
        ("--clip", ("0", "nan", "inf"), "must be above 0"),
    ],
)
def test_impossible_plans_are_refused(option: str, values: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    for value in values:
        with pytest.raises(SystemExit):
            parse(["ppo", "--out", "o", "--minutes", "1", f"{option}={value}"])
        assert words in capsys.readouterr().err


def test_a_command_is_stored_without_its_secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    stored: list[str] = []

    def run(options: argparse.Namespace) -> int:
        stored.append(options.trained_by)
        return 0

    monkeypatch.setattr(ppo_command, "run", run)
    secrets = ["--token", "T0k=n", "--secret=0wner", "--sec", "t1cket"]
    assert main(["ppo", "--out", "o", "--minutes", "1", *secrets, "--seed", "7"]) == 0
    (command,) = stored
    assert command == "python -m chefshat.learn ppo --out o --minutes 1 --token ... --secret=... --sec ... --seed 7"


def test_a_limited_number_of_commands_is_stored() -> None:
    assert runs.trained_by("", "first") == "first"
    assert runs.trained_by("first", "second") == "first; second"
    commands = ""
    for number in range(1_000):
        commands = runs.trained_by(commands, f"command {number:04}")
    assert len(commands) <= runs.MAX_TRAINED_BY
    assert commands.startswith("command 0000; command 0001; ")
    assert commands.endswith("; command 0998; command 0999")
    assert commands.count("[...]") == 1
    assert len(runs.trained_by("", "x" * 100_000)) <= runs.MAX_TRAINED_BY


def test_files_are_reserved_before_the_work(tmp_path: Path) -> None:
    out, log = tmp_path / "out", tmp_path / "log"
    with runs.reserved(out, log, replace=False):
        # Another process would be refused, too.
        with pytest.raises(FileExistsError, match="continue that training with --resume, replace it with --force"):
            runs.reserved(out, log, replace=False).__enter__()
        assert not out.exists()
    assert not list(tmp_path.iterdir())
    with runs.reserved(log, replace=False):
        log.write_text("done")
    with runs.reserved(log, replace=True):
        pass
    assert log.read_text() == "done"
    with pytest.raises(FileExistsError, match="log exists: replace it"):
        runs.reserved(log, out, replace=False, can_resume=False).__enter__()
    with pytest.raises(FileNotFoundError, match="there is no folder"):
        runs.reserved(tmp_path / "missing" / "out", replace=True).__enter__()


def test_the_first_ctrl_c_requests_a_stop_and_the_second_interrupts() -> None:
    before = signal.getsignal(signal.SIGINT)
    with runs.Interrupts() as interrupts:
        assert not interrupts.asked
        os.kill(os.getpid(), signal.SIGINT)
        assert interrupts.asked
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
