"""How commands join, and resume after they were killed, on the fake and the real server."""

import errno
import json
import os
import re
import signal
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fake_game import FakeGame, FakeSeat
from fake_server import FakeServer
from stalling import STALLS
from waiting import LIMIT_S

import chefshat
from chefshat import ChefsHatError, RandomAgent, pb
from chefshat import agent as command
from chefshat.join_options import TICKET, name_key

TESTS = Path(__file__).parent
# Far longer than a test, so that a killed command resumes in time on a slow machine.
PATIENT = pb.RoomPolicy(decision_time_ms=600_000)
GAMES = 6
Processes = list["subprocess.Popen[str]"]


def new_room(client: chefshat.Client) -> pb.CreateRoomResponse:
    return client.rooms.create(seats=["random", None, "random", "random"], policy=PATIENT)


def new_cup(client: chefshat.Client) -> pb.CreateTournamentResponse:
    settings = pb.TournamentSettings(
        name="Coppa",
        format=pb.TOURNAMENT_FORMAT_ROUND_ROBIN,
        rules=pb.RuleSet(target_shifts=1),
        policy=PATIENT,
        rounds=3,
        games_per_pairing=2,
        built_in_agents=["random", "random", "random"],
        start_when_joined=4,
    )
    return client.tournaments.create(settings)


def start(processes: Processes, *arguments: str, ticket: str = "") -> "subprocess.Popen[str]":
    """Starts the command of agents."""
    environment = {**os.environ, **({TICKET: ticket} if ticket else {})}
    call = [sys.executable, "-m", "chefshat.agent", "--json", *arguments]
    pipe = subprocess.PIPE
    processes.append(subprocess.Popen(call, stdout=pipe, stderr=pipe, text=True, cwd=TESTS, env=environment))
    return processes[-1]


def wait_until_it_stalls(process: "subprocess.Popen[str]") -> list[str]:
    """Waits until the command is in the middle of a game. Returns its output so far, by line."""
    assert process.stderr is not None
    output: list[str] = []
    for line in process.stderr:
        if line.strip() == STALLS:
            return output
        output.append(line)
    raise AssertionError(f"it never stalled: {output}")


def kill_when_it_stalls(process: "subprocess.Popen[str]") -> list[str]:
    """Kills the command in the middle of a game. Returns its output so far, by line."""
    output = wait_until_it_stalls(process)
    process.kill()
    process.wait(LIMIT_S)
    return output


def one_line(process: "subprocess.Popen[str]") -> dict[str, Any]:
    """Returns the line of JSON that a successful command prints."""
    printed, output = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0, output
    assert printed.count("\n") == 1
    outcome: dict[str, Any] = json.loads(printed)
    return outcome


def kill_and_resume(address: str, way: list[str], processes: Processes, file: Path | None) -> dict[str, Any]:
    """Joins, kills the command in the middle of a game, and resumes with the printed ticket or the one in the file."""
    ticket_options = [] if file is None else ["--ticket-file", str(file)]
    joining = ["--address", address, *way, *ticket_options]
    output = kill_when_it_stalls(start(processes, *joining, "--agent", "stalling:Stalling"))
    (line,) = output
    if file is not None:
        assert stat.S_IMODE(file.stat().st_mode) == 0o600
        ticket = file.read_text().strip()
        assert ticket not in line
        outcome = one_line(start(processes, *joining))
        assert not file.exists(), "nobody goes on where all is over"
        return outcome
    ticket = line.partition("--ticket ")[2].split()[0]
    return one_line(start(processes, "--address", address, ticket=ticket))


@pytest.mark.parametrize("in_file", [False, True], ids=["printed", "in a file"])
def test_a_killed_command_resumes_its_seat(
    address: str, in_file: bool, tmp_path: Path, processes: Processes, request: pytest.FixtureRequest
) -> None:
    is_real = request.node.callspec.params["address"] == "real"
    with chefshat.Client(address) as client:
        room = new_room(client)
        way = ["--code", room.join_code, "--name", "Ada"]
        outcome = kill_and_resume(address, way, processes, tmp_path / "ticket" if in_file else None)
        lines = list(client.records.read(room.room.game_id))
    assert (outcome["event"], outcome["game_id"], outcome["seat"]) == ("finished", room.room.game_id, 1)
    decisions = [line.decision for line in lines if line.HasField("decision") and line.decision.seat == 1]
    # The two decisions before the kill are not among its own. Records of the fake server have no decisions.
    assert len(decisions) == (outcome["decisions"] + 2 if is_real else 0)
    assert all(decision.source == pb.DECISION_SOURCE_AGENT for decision in decisions)


@pytest.mark.parametrize("in_file", [False, True], ids=["printed", "in a file"])
def test_a_killed_command_resumes_its_tournament(address: str, in_file: bool, tmp_path: Path, processes: Processes) -> None:
    with chefshat.Client(address) as client:
        cup = new_cup(client)
        tournament_id = cup.tournament.tournament_id
        way = ["--tournament", cup.join_code, "--name", "Ada", "--games", "2"]
        outcome = kill_and_resume(address, way, processes, tmp_path / "ticket" if in_file else None)
        games = {game.game_id: game for game in client.tournaments.games(tournament_id)}
        results = client.tournaments.results(tournament_id)
    assert (outcome["event"], outcome["tournament_id"]) == ("finished", tournament_id)
    assert results.tournament.participants[outcome["participant"]].name == "Ada"
    assert len(games) == GAMES
    # Two games started before the kill; all finished after it.
    assert {game["game_id"] for game in outcome["games"]} == set(games)
    for game in outcome["games"]:
        seat = games[game["game_id"]].seats[game["seat"]]
        assert (seat.participant, seat.place, seat.points) == (outcome["participant"], game["place"], game["points"])
    # No seat was substituted meanwhile.
    assert [line.forfeited for line in results.standings] == [0] * 4
    assert [line.substituted for line in results.standings] == [0] * 4


def close(game: FakeGame, seat: FakeSeat, answer: pb.Answer) -> str:
    """A fault of the fake server: closes the room before the first answer."""
    game.end(pb.ABORT_REASON_CLOSED)
    return ""


def test_a_ticket_is_stored_until_the_game_is_over(fake: FakeServer, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "ticket"
    file.write_text("nobody's\n")
    with chefshat.Client(fake.address) as client:
        code = new_room(client).join_code
        joining = ["--address", fake.address, "--code", code, "--name", "Ada", "--ticket-file", str(file)]
        assert command.main(joining) == 1
        assert f"TICKET_UNKNOWN: no seat has this ticket; the ticket comes from {file}" in capsys.readouterr().err
        assert file.read_text() == "nobody's\n"
        file.write_text("")
        assert command.main(joining) == 0
        assert list(tmp_path.iterdir()) == []
        room = new_room(client)
        fake.fault = close
        assert command.main([*joining, "--code", room.join_code]) == 1
        assert "aborted (CLOSED)" in capsys.readouterr().out
        assert list(tmp_path.iterdir()) == []


def test_without_a_place_for_the_ticket_no_seat_is_taken(
    fake: FakeServer, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with chefshat.Client(fake.address) as client:
        room = new_room(client)
        joining = ["--address", fake.address, "--code", room.join_code, "--name", "Ada", "--ticket-file"]
        assert command.main([*joining, str(tmp_path)]) == 1
        assert "is a folder: name a file in it" in capsys.readouterr().err
        assert command.main([*joining, str(tmp_path / "no such folder" / "ticket")]) == 1
        assert "no such folder" in capsys.readouterr().err
        assert client.rooms.get(room.room.room_id).seats[1].name == ""
    assert command.main(["--address", fake.address, "--ticket-file", str(tmp_path / "none")]) == 1
    assert "there is no ticket in" in capsys.readouterr().err
    joining[joining.index(room.join_code)] = "WRONG"
    assert command.main([*joining, str(tmp_path / "ticket")]) == 1
    assert list(tmp_path.iterdir()) == [], "nothing is left of a file that got no ticket"


@pytest.mark.parametrize("fails", ["fsync", "replace"])
def test_a_ticket_that_cannot_be_stored_is_printed(
    fails: str, fake: FakeServer, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(*{"fsync": (os, "fsync"), "replace": (Path, "replace")}[fails], full)
    file = tmp_path / "ticket"
    with chefshat.Client(fake.address) as client:
        code = new_room(client).join_code
    assert command.main(["--address", fake.address, "--code", code, "--name", "Ada", "--ticket-file", str(file)]) == 0
    printed, output = capsys.readouterr()
    assert "<- this agent" in printed
    warning, ticket = output.splitlines()
    assert warning == f"warning: cannot store the ticket in {file}: [Errno 28] No space left on device"
    assert re.search(r"if this process ends before the game, resume with --ticket \S+$", ticket)
    assert list(tmp_path.iterdir()) == []


def test_an_undeletable_ticket_file_is_a_warning(
    fake: FakeServer, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "ticket"
    with chefshat.Client(fake.address) as client:
        file.write_text(client.rooms.join(new_room(client).join_code, "Ada").ticket)

    def refuse(path: Path, missing_ok: bool = False) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(Path, "unlink", refuse)
    assert command.main(["--address", fake.address, "--json", "--ticket-file", str(file)]) == 0
    printed, output = capsys.readouterr()
    assert json.loads(printed)["event"] == "finished"
    assert f"warning: cannot delete the used ticket: [Errno 13] Permission denied: '{file}'; remove {file}" in output


def test_two_commands_do_not_share_a_ticket_file(
    fake: FakeServer, tmp_path: Path, capsys: pytest.CaptureFixture[str], processes: Processes
) -> None:
    file = tmp_path / "ticket"
    with chefshat.Client(fake.address) as client:
        room = new_room(client)
        joining = ["--address", fake.address, "--code", room.join_code, "--name", "Ada", "--ticket-file", str(file)]
        first = start(processes, *joining, "--agent", "stalling:Stalling")
        wait_until_it_stalls(first)
        ticket = file.read_text()
        assert command.main(joining) == 1
        assert f"another command uses {file}" in capsys.readouterr().err
        assert file.read_text() == ticket
        # The end of the process releases the lock.
        first.kill()
        first.wait(LIMIT_S)
        assert command.main(joining) == 0
    assert list(tmp_path.iterdir()) == []


def test_a_ticket_file_that_is_not_a_text_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "ticket"
    file.write_bytes(b"\xff\xfe")
    assert command.main(["--address", "127.0.0.1:1", "--ticket-file", str(file)]) == 1
    assert f"error: {file} is not a text file" in capsys.readouterr().err


def test_ctrl_c_exits_with_130_and_reports_the_substitute(fake: FakeServer, processes: Processes) -> None:
    with chefshat.Client(fake.address) as client:
        code = new_room(client).join_code
    process = start(processes, "--address", fake.address, "--code", code, "--name", "Ada", "--agent", "stalling:Stalling")
    wait_until_it_stalls(process)
    process.send_signal(signal.SIGINT)
    printed, output = process.communicate(timeout=LIMIT_S)
    assert (process.returncode, printed) == (130, "")
    assert output == "interrupted; a substitute plays until the ticket is used again\n"


def test_a_seat_ticket_is_not_a_participant_ticket(address: str) -> None:
    with chefshat.Client(address) as client:
        seat = client.rooms.join(new_room(client).join_code, "Ada")
        (result,) = client.play_tournament(seat.ticket, lambda info: RandomAgent(info.seat))
        assert (result.seat, result.finished) == (seat.seat, True)
        participant = client.tournaments.join(new_cup(client).join_code, "Ada")
        with pytest.raises(ChefsHatError, match="TICKET_OF_PARTICIPANT"):
            client.play(RandomAgent(), participant.ticket)


@pytest.mark.parametrize(
    ("arguments", "ticket", "output"),
    [
        ([], "", "give --code, --tournament, --ticket or --ticket-file"),
        (["--code", "X"], "", "--name"),
        (["--tournament", "X", "--ticket-file", "F"], "", "--name"),
        (["--code", "X", "--tournament", "Y"], "", "--code and --tournament exclude each other"),
        (["--code", "X", "--ticket", "T"], "", "--code and --ticket exclude each other"),
        (["--tournament", "X"], "T", f"--tournament and the environment variable {TICKET} exclude each other"),
        (["--ticket", "T", "--ticket-file", "F"], "", "--ticket and --ticket-file both name a place"),
        (["--ticket-file", "F"], "T", f"{TICKET} and --ticket-file both name a place"),
        (["--code", "X", "--name", "Ada", "--games", "2"], "", "--games and --stateless are for tournaments"),
        (["--code", "X", "--name", "Ada", "--stateless"], "", "--games and --stateless are for tournaments"),
        (["--tournament", "X", "--name", "Ada", "--seat", "1"], "", "--seat is for joining a room"),
        (["--ticket", "T", "--seat", "1"], "", "--seat is for joining a room"),
        (["--tournament", "X", "--name", "Ada", "--games", "0"], "", "1 to 64 games at a time"),
        (["--tournament", "X", "--name", "Ada", "--games", "10000000000"], "", "1 to 64 games at a time"),
        (["--code", "X", "--name", "Ada", "--seat", "-1"], "", "seats are numbered from 0, and a table has at most 6"),
        (["--code", "X", "--name", "Ada", "--seat", "6"], "", "seats are numbered from 0, and a table has at most 6"),
        (["--ticket", "T", "--stateless"], "", "--stateless is for joining"),
        (["--ticket-file", "F", "--stateless"], "", "--stateless is for joining"),
    ],
)
def test_contradicting_join_options_are_refused(
    arguments: list[str], ticket: str, output: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if ticket:
        monkeypatch.setenv(TICKET, ticket)
    with pytest.raises(SystemExit) as exit_info:
        command.main(["--address", "127.0.0.1:1", *arguments])
    assert exit_info.value.code == 2
    assert output in capsys.readouterr().err


@pytest.mark.server
def test_a_name_keeps_its_key(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    key, fingerprints = tmp_path / "ada.key", []
    joining = ["--address", real_address, "--name", "Ada"]
    with chefshat.Client(real_address) as client:
        for file in (key, key, tmp_path / "other.key"):
            made = client.rooms.create(seats=["random", None, "random", "random"], rules=pb.RuleSet(target_shifts=1))
            assert command.main([*joining, "--code", made.join_code, "--name-key", str(file)]) == 0
            fingerprints.append(client.rooms.get(made.room.room_id).seats[1].name_fingerprint)
    first, again, other = fingerprints
    assert re.fullmatch("[0-9a-f]{16}", first)
    assert first == again != other
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    capsys.readouterr()
    key.write_text("nonsense")
    for way, why in (("--code", "contains no key: 64 hexadecimal digits"), ("--ticket", "--name-key is for joining")):
        with pytest.raises(SystemExit, match="2"):
            command.main([*joining, way, "BCDF2345", "--name-key", str(key)])
        assert why in capsys.readouterr().err


def test_commands_that_create_a_key_at_once_have_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file, keys, link = tmp_path / "ada.key", [], os.link

    def after_another(begun: Path, target: Path) -> None:
        monkeypatch.setattr(os, "link", link)
        keys.append(name_key(target))
        link(begun, target)

    monkeypatch.setattr(os, "link", after_another)
    keys.append(name_key(file))
    assert len(keys) == 2
    assert len(set(keys)) == 1
    assert list(tmp_path.iterdir()) == [file]
