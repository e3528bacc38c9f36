"""The process of a player: answers and failures."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from chefshat.join_options import TICKET
from waiting import LIMIT_S, wait_until

from chefshat_paper.players_club.process import AgentError, AgentLost, AgentProcess, AgentRaised, AgentSpec

TESTS = str(Path(__file__).parent)
VECTOR = [0.0] * 28 + [1.0] + [0.0] * 196 + [1.0, 0.0, 1.0]
# Time limit of a hanging player, seconds; others take far less.
HANGS_S = 3.0

Make = Callable[..., AgentProcess]


@pytest.fixture
def make() -> Iterator[Make]:
    """Creates processes by the name of the player class, and closes them after the test."""
    made: list[AgentProcess] = []

    def one(player: str, **options: Any) -> AgentProcess:
        made.append(AgentProcess(AgentSpec(f"club_players:{player}", "Ada", paths=(TESTS,), **options)))
        return made[-1]

    yield one
    for process in made:
        process.close()


def test_a_player_answers_and_reports_its_name(make: Make) -> None:
    process = make("Largest")
    process.start()
    assert process.name == "PLAYER_Ada"
    assert process.call("get_action", VECTOR) == [0.0] * 197 + [1.0, 0.0, 0.0]
    assert process.call("get_exhanged_cards", [3, 9, 11, 12], 2) == [11, 12]
    assert process.call("do_special_action", {}, "Dinner served!") is True


def test_arrays_and_their_numbers_are_answers(make: Make) -> None:
    process = make("Rarest")
    assert process.call("get_exhanged_cards", [3, 9, 11], 2) == [9, 11]
    assert process.call("do_special_action", {}, "Dinner served!") is False


def test_callbacks_may_be_missing_and_return_anything(make: Make, tmp_path: Path) -> None:
    assert make("Largest").call("update_game_over") is None
    scribe = make("Scribe", arguments={"log_file": str(tmp_path / "log")})
    assert scribe.call("update_my_action", {"Matches": 1}) is None
    assert (tmp_path / "log").read_text() == '["update_my_action", {"Matches": 1}]\n'


def test_output_of_a_player_is_not_an_answer(make: Make, tmp_path: Path) -> None:
    process = make("Babbling", log=tmp_path / "log")
    for _ in range(3):
        answer = process.call("get_action", VECTOR)
        assert isinstance(answer, list)
        assert len(answer) == 200
    process.close()
    assert (tmp_path / "log").read_text().count('{"id": 2, "value": [0]}\n') == 3


def test_a_full_disk_ends_the_log_and_not_the_player(make: Make, caplog: pytest.LogCaptureFixture) -> None:
    process = make("Babbling", log=Path("/dev/full"))
    for _ in range(3):
        process.call("get_action", VECTOR)
    process.close()
    assert caplog.text.count("the agent's output is no longer logged") == 1


def test_an_exception_is_reported_and_the_process_continues(make: Make) -> None:
    process = make("Raising")
    with pytest.raises(AgentRaised, match="get_action raised RuntimeError: no idea\nTraceback"):
        process.call("get_action", VECTOR)
    with pytest.raises(AgentRaised, match="get_exhanged_cards raised SystemExit: 1"):
        process.call("get_exhanged_cards", [1], 1)
    assert process.call("do_special_action", {}, "") is True
    assert process.restarts == 0


def test_answers_that_are_not_json_are_reported(make: Make) -> None:
    with pytest.raises(AgentRaised, match="returned object, not a number or a list of numbers"):
        make("Unspeakable").call("get_action", VECTOR)


def test_a_dead_player_is_restarted_and_finally_given_up(make: Make) -> None:
    process = make("Mortal", restarts=2)
    for life in range(3):
        for _ in range(4):
            process.call("get_action", VECTOR)
        assert process.restarts == life
        with pytest.raises(AgentLost, match=r"died in get_action \(exit code 7; its last output:\nfarewell\)"):
            process.call("get_action", VECTOR)
    assert process.given_up
    with pytest.raises(AgentLost, match="has been given up"):
        process.call("get_action", VECTOR)


def test_what_a_player_has_started_ends_with_it(make: Make, tmp_path: Path) -> None:
    file = tmp_path / "pid"
    with pytest.raises(AgentLost, match="exit code 7; it printed nothing"):
        make("Parent", arguments={"file": str(file)}).call("get_action", VECTOR)
    stat = Path(f"/proc/{file.read_text()}/stat")
    # It may have ended without its parent having noticed.
    wait_until(lambda: not stat.exists() or ") Z " in stat.read_text(), "the program that the player has started ends")


def test_a_player_that_hangs_is_ended(make: Make) -> None:
    process = make("Hanging", call_limit_s=HANGS_S, restarts=0)
    with pytest.raises(AgentLost, match="get_action did not finish within 3 s"):
        process.call("get_action", VECTOR)
    assert process.given_up


@pytest.mark.parametrize(
    ("player", "options", "message"),
    [
        ("Unmade", {}, "creating it raised FileNotFoundError: no model there"),
        ("Nothing", {}, "lacks get_exhanged_cards and do_special_action"),
        ("Missing", {}, "has no attribute 'Missing'"),
        ("TESTS", {}, "has no attribute 'TESTS'"),
        ("Scribe", {"arguments": {"colour": "red"}}, "unexpected keyword argument 'colour'"),
        ("Largest", {"python": "/no/such/python"}, "/no/such/python cannot be started: No such file"),
    ],
)
def test_a_failed_start_is_reported(make: Make, player: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(AgentError, match=message):
        make(player, **options).start()


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("read call; exit 3", r"died in creating it \(exit code 3; it printed nothing\)"),
        ("read call; echo hello; read nothing", "sent an invalid answer to creating it: b'hello"),
        ("read call; echo 7; read nothing", "sent an invalid answer to creating it: b'7"),
        ('read call; echo \'{"id": 5, "value": 1}\'; read nothing', "the id of another call"),
    ],
)
def test_a_program_that_is_not_python_is_reported(make: Make, tmp_path: Path, script: str, message: str) -> None:
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(0o755)
    with pytest.raises(AgentLost, match=message):
        make("Largest", python=str(python)).start()


def test_a_closed_player_is_not_started_again(make: Make) -> None:
    process = make("Largest")
    process.start()
    process.close()
    process.close()
    with pytest.raises(AgentLost):
        process.call("get_action", VECTOR)
    assert process.restarts == 0


def test_a_starting_player_can_be_closed(make: Make, tmp_path: Path) -> None:
    file = tmp_path / "pid"
    process = make("Slow", arguments={"file": str(file)})
    with ThreadPoolExecutor(1) as pool:
        starting = pool.submit(process.start)
        wait_until(lambda: file.exists() and file.read_text(), "the player is being made")
        process.close()
        with pytest.raises(AgentLost, match="died in creating it"):
            starting.result(LIMIT_S)
    with pytest.raises(ProcessLookupError):
        os.kill(int(file.read_text()), 0)
    with pytest.raises(AgentLost, match="has been given up"):
        process.start()


def test_a_player_does_not_see_the_ticket(make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(TICKET, "secret")
    file = tmp_path / "known"
    make("Knowing", arguments={"file": str(file)}).start()
    assert file.read_text() == "nothing"
