"""The command `play`: networks in rooms and tournaments."""

import json
import threading
from pathlib import Path

import pytest

import chefshat
from chefshat import RandomAgent, pb
from chefshat.learn.__main__ import main

NETWORK = str(Path(__file__).resolve().parents[3] / "tests" / "fixtures" / "network" / "classic-turns.safetensors")


@pytest.mark.server
def test_a_network_plays_in_a_room_and_in_a_tournament(
    real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create("network", rules=pb.RuleSet(target_shifts=2))
        tickets = {client.rooms.join(room.join_code, f"random {seat}").ticket: RandomAgent(seat) for seat in range(3)}
        others = threading.Thread(target=client.play_many, args=[tickets])
        others.start()
        ticket = tmp_path / "ticket"
        play = ["play", NETWORK, "--address", real_address, "--name", "Deep", "--ticket-file", str(ticket), "--json"]
        code = main([*play, "--code", room.join_code])
        others.join()
        output = json.loads(capsys.readouterr().out)
        assert (code, output["event"], output["invalid"], output["late"]) == (0, "finished", 0, 0)
        # Two Shifts, with an exchange and perhaps a special action before the second.
        assert output["decisions"] > 2
        cup = pb.TournamentSettings(
            name="Coppa",
            format=pb.TOURNAMENT_FORMAT_ROUND_ROBIN,
            rules=pb.RuleSet(target_shifts=1),
            rounds=2,
            built_in_agents=["random"] * 3,
            start_when_joined=4,
        )
        made = client.tournaments.create(cup)
        assert main([*play, "--tournament", made.join_code, "--games", "2"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert [(game["event"], game["invalid"], game["late"]) for game in output["games"]] == [("finished", 0, 0)] * 2
    assert not ticket.exists()


@pytest.mark.server
def test_a_network_for_other_decks_does_not_play(real_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    with chefshat.Client(real_address) as client:
        room = client.rooms.create("small", rules=pb.RuleSet(faces=7))
        tickets = {client.rooms.join(room.join_code, f"random {seat}").ticket: RandomAgent(seat) for seat in range(3)}
        others = threading.Thread(target=client.play_many, args=[tickets], daemon=True)
        others.start()
        code = main(["play", NETWORK, "--address", real_address, "--code", room.join_code, "--name", "Deep"])
        # The seat was not attached, so no game was disturbed.
        assert client.rooms.get(room.room.room_id).state == pb.ROOM_STATE_WAITING
        client.rooms.close(room.room.room_id, room.owner_token)
        others.join()
    assert code == 1
    assert "plays with 4 players, 11 faces and hands of 17 cards; this game has 4, 7 and 7" in capsys.readouterr().err


def test_a_file_that_is_not_a_network_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "n").write_text("no")
    assert main(["play", str(tmp_path / "n"), "--address", "127.0.0.1:1", "--code", "C", "--name", "N"]) == 1
    assert "is not a network" in capsys.readouterr().err
