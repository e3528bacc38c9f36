"""Complete games on the real server with players of the reference implementation, by the command and the package."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import chefshat
import pytest
from chefshat import RandomAgent, pb
from chefshat.join_options import TICKET
from test_club_process import TESTS
from waiting import LIMIT_S, wait_until

from chefshat_paper.players_club import AgentProcess, AgentSpec, PlayersClubAgent
from chefshat_paper.players_club.__main__ import main
from chefshat_paper.players_club.table import ACTIONS

pytestmark = pytest.mark.server

COMMAND = (sys.executable, "-m", "chefshat_paper.players_club")

Info = dict[str, Any]


def room(address: str, seats: list[str | None], **options: Any) -> str:
    with chefshat.Client(address) as client:
        return client.rooms.create("club", seats=seats, **options).join_code


def command(address: str, code: str, player: str, *options: str) -> list[str]:
    named = ["--server", address, "--code", code, "--agent", f"club_players:{player}"]
    return [*named, "--path", TESTS, *options]


def one_line(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    printed = capsys.readouterr().out
    assert printed.count("\n") == 1
    outcome: dict[str, Any] = json.loads(printed)
    return outcome


def play_four(address: str, players: list[AgentSpec]) -> dict[str, chefshat.SeatResult]:
    """Plays a game with these players, and random agents in the other seats. Returns the results by name."""
    with chefshat.Client(address) as client, contextlib.ExitStack() as stack:
        code = client.rooms.create("club").join_code
        agents: dict[str, chefshat.Agent] = {}
        names = {}
        for number in range(4):
            spec = players[number] if number < len(players) else None
            name = spec.name if spec else f"random {number}"
            ticket = client.rooms.join(code, name).ticket
            names[ticket] = name
            agents[ticket] = PlayersClubAgent(stack.enter_context(AgentProcess(spec))) if spec else RandomAgent(seed=number)
        results = client.play_many(agents)
    return {names[ticket]: result for ticket, result in results.items()}


def test_four_commands_play_a_game_with_each_other(real_address: str) -> None:
    code = room(real_address, [None] * 4)
    running = [
        subprocess.Popen(
            [*COMMAND, *command(real_address, code, player, "--name", f"{number}", "--json")],
            stdout=subprocess.PIPE,
            text=True,
        )
        for number, player in enumerate(["Largest", "Rarest", "Largest", "Babbling"])
    ]
    outcome = [json.loads(process.communicate(timeout=LIMIT_S)[0]) for process in running]
    assert [process.returncode for process in running] == [0] * 4
    assert sorted(one["place"] for one in outcome) == [1, 2, 3, 4]
    assert len({one["game_id"] for one in outcome}) == 1
    for one in outcome:
        assert one["event"] == "finished"
        assert one["decisions"] > 0
        assert (one["invalid"], one["failures"], one["replaced"], one["restarts"]) == (0, 0, 0, 0)


def test_a_player_plays_room_after_room(real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    codes = [room(real_address, [None, "random", "random", "random"]) for _ in range(2)]
    log = tmp_path / "log"
    arguments = command(real_address, codes[0], "Scribe", "--code", codes[1], "--arguments", json.dumps({"log_file": str(log)}))
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert printed.count("<- this agent") == 2
    assert printed.count("0 failures of the player, 0 decisions taken for it, 0 restarts") == 2
    assert log.read_text().count('["update_game_over"]') == 2


def test_a_player_gets_the_calls_of_the_reference(real_address: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    specs = [AgentSpec("club_players:Scribe", "Ada", {"log_file": str(log)}, paths=(TESTS,))]
    specs += [AgentSpec("club_players:Rarest", name, paths=(TESTS,)) for name in ("Bob", "Cleo")]
    result = play_four(real_address, specs)["Ada"]
    calls = [json.loads(line) for line in log.read_text().splitlines()]
    notified = [call for call in calls if not call[0].startswith(("get", "do"))]
    check_order([method for method, *_ in notified])
    check_asking(calls)
    infos = [call[1] for call in calls if call[0].startswith("update_") and "action" in call[0]]
    check_actions(infos, result.seat)
    ends = [call[1] for call in calls if call[0] == "update_end_match"]
    # The points of the reference, which give the same order as ours.
    game = [sum(end["Match_Score"][seat] for end in ends) for seat in range(4)]
    assert ends[-1]["Game_Score"] == game
    assert all(sorted(end["Match_Score"]) == [0, 1, 2, 3] for end in ends)
    ours = [sum((0, 1, 3, 5)[end["Match_Score"][seat]] for end in ends) for seat in range(4)]
    assert {line.seat: line.points for line in result.standings} == dict(enumerate(ours))


def check_order(methods: list[str]) -> None:
    """Checks the order of calls: matches with actions, and exchanges and special actions between them."""
    beginning = [index for index, method in enumerate(methods) if method == "update_start_match"]
    ending = [index for index, method in enumerate(methods) if method == "update_end_match"]
    assert len(beginning) == len(ending) >= 3
    assert beginning[0] == 0
    assert methods[-1] == "update_game_over"
    for start, end in zip(beginning, ending, strict=True):
        assert set(methods[start + 1 : end]) <= {"update_my_action", "update_action_others"}
        assert end - start > 4
    special, exchange = "observe_special_action", "update_exchange_cards"
    for end, start in zip(ending, beginning[1:], strict=False):
        assert methods[end + 1 : start] in ([exchange], [special], [special, exchange])


def check_asking(calls: list[list[Any]]) -> None:
    """Compares choices and gifts with the calls that report them."""
    chosen = [(call[1], call[2]) for call in calls if call[0] == "get_action"]
    done = [call[1] for call in calls if call[0] == "update_my_action"]
    assert len(chosen) == len(done) > 10
    for (vector, action), info in zip(chosen, done, strict=True):
        assert len(vector) == len(info["Observation_After"]) == 228
        assert info["Observation_Before"] == pytest.approx(vector)
        assert info["Action_Index"] == action
        assert info["Action_Decoded"] == ACTIONS[action]
        assert info["Action_Decoded"] in info["Author_Possible_Actions"]
        assert len(info["Author_Possible_Actions"]) == sum(vector[28:])
        assert info["Action_Random"] is False
        before, after = (sum(1 for card in observed[11:28] if card) for observed in (vector, info["Observation_After"]))
        assert after == info["Cards_Per_Player"][info["Author_Index"]]
        assert before - after == sum(int(number[1:]) for number in info["Action_Decoded"].split(";")[1:])
    gave = [call[3] for call in calls if call[0] == "get_exhanged_cards"]
    sent = [call[1] for call in calls if call[0] == "update_exchange_cards"]
    hands = [call[1] for call in calls if call[0] == "update_start_match"]
    assert all(len(hand) == 17 for hand in hands)
    assert [cards for cards in sent if cards in gave] == gave


def check_actions(infos: list[Info], seat: int) -> None:
    """Checks that each action follows from the one before: board, pizza, turn."""
    assert all(set(info) == set(infos[0]) for info in infos)
    assert {info["Author_Index"] for info in infos} == {0, 1, 2, 3}
    assert all((info["Observation_Before"] != "") == (info["Author_Index"] == seat) for info in infos)
    assert any(info["Is_Pizza"] for info in infos)
    for one, other in pairwise(infos):
        if one["Matches"] != other["Matches"]:
            assert other["Matches"] == one["Matches"] + 1
            assert one["Match_Score"] != other["Match_Score"] == [-1] * 4
            assert other["Rounds"] == 1
            continue
        assert other["Author_Index"] == one["Next_Player"]
        assert other["Board_Before"] == ([13] + [0] * 10 if one["Is_Pizza"] else one["Board_After"])
        assert other["Rounds"] == one["Rounds"] + other["Is_Pizza"]
        assert sum(other["Cards_Per_Player"]) <= sum(one["Cards_Per_Player"])


def test_illegal_choices_are_counted_as_often_as_the_reference_would_ask(
    real_address: str, capsys: pytest.CaptureFixture[str]
) -> None:
    code = room(real_address, [None, "random", "random", "random"], rules=pb.RuleSet(target_shifts=3))
    assert main(command(real_address, code, "Stubborn", "--json", "--attempts", "2")) == 0
    outcome = one_line(capsys)
    # Its first choice is never legal: two invalid attempts at every turn and gift.
    assert outcome["invalid"] == 2 * outcome["replaced"] > 0
    assert outcome["replaced"] <= outcome["decisions"]


def test_the_game_continues_with_a_failing_player(real_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = room(real_address, [None, "random", "random", "random"], rules=pb.RuleSet(target_shifts=2))
    assert main(command(real_address, code, "Raising", "--json")) == 0
    outcome = one_line(capsys)
    assert outcome["invalid"] == 0
    assert outcome["failures"] > outcome["replaced"] > 0
    assert outcome["restarts"] == 0


def test_the_game_continues_when_the_player_is_given_up(real_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = room(real_address, [None, "random", "random", "random"], rules=pb.RuleSet(target_shifts=6))
    assert main(command(real_address, code, "Mortal", "--json", "--restarts", "1")) == 1
    outcome = one_line(capsys)
    assert outcome["event"] == "finished"
    assert outcome["restarts"] == 1
    # Four actions of each process are the player's.
    assert 0 < outcome["replaced"] < outcome["decisions"]


def test_an_interrupted_command_leaves_no_process(
    real_address: str, tmp_path: Path, processes: list["subprocess.Popen[str]"]
) -> None:
    with chefshat.Client(real_address) as client:
        made = client.rooms.create("club", seats=[None, None, "random", "random"])
        given = json.dumps({"file": str(tmp_path / "pid")})
        options = command(real_address, made.join_code, "Present", "--arguments", given)
        process = subprocess.Popen([*COMMAND, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        processes.append(process)
        wait_until(lambda: client.rooms.get(made.room.room_id).seats[0].connected, "the player is there", process)
    process.send_signal(signal.SIGINT)
    _, outcome = process.communicate(timeout=LIMIT_S)
    assert outcome.endswith("interrupted; a substitute plays until the ticket is used again\n")
    assert process.returncode == 130
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)


def test_an_interrupted_start_leaves_no_process(tmp_path: Path, processes: list["subprocess.Popen[str]"]) -> None:
    given = json.dumps({"file": str(tmp_path / "pid.{process}")})
    # They end because the command ends, not because they take too long.
    arguments = ["--server", "127.0.0.1:1", "--tournament", "X", "--games", "2", "--start-limit", "100000"]
    options = [*arguments, "--agent", "club_players:Slow", "--path", TESTS, "--arguments", given]
    process = subprocess.Popen([*COMMAND, *options], stderr=subprocess.PIPE, text=True)
    processes.append(process)
    files = [tmp_path / f"pid.{number}" for number in range(2)]
    wait_until(lambda: all(file.exists() and file.read_text() for file in files), "both players are being made", process)
    process.send_signal(signal.SIGINT)
    _, outcome = process.communicate(timeout=LIMIT_S)
    # It had no seat yet.
    assert (process.returncode, outcome) == (130, "interrupted\n")
    for file in files:
        with pytest.raises(ProcessLookupError):
            os.kill(int(file.read_text()), 0)


def test_a_player_that_fails_to_start_takes_no_seat(real_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = room(real_address, [None, "random", "random", "random"])
    assert main(command(real_address, code, "Unmade", "--json")) == 1
    assert "creating it raised FileNotFoundError: no model there" in one_line(capsys)["message"]
    assert main(command(real_address, code, "Largest", "--json")) == 0


def test_rooms_with_unsupported_rules_are_refused(real_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    code = room(real_address, [None, "random", "random"], rules=pb.RuleSet(players=3))
    assert main(command(real_address, code, "Largest")) == 1
    assert "only play games of 4 players, 11 faces and 2 jokers; this one has 3, 11 and 2" in capsys.readouterr().err


def test_the_actions_are_those_of_the_server(real_address: str) -> None:
    with chefshat.Client(real_address) as client:
        assert tuple(client.action_table().texts[:200]) == ACTIONS


@pytest.mark.parametrize(
    ("options", "outcome"),
    [
        (["--agent", "no colon"], "not of the form module.path:Class"),
        (["--arguments", "[1]"], "must be a JSON object"),
        (["--arguments", "{"], "not JSON"),
        (["--limit", "0"], "must be above 0"),
        (["--attempts", "-1"], "must be a number from 0"),
    ],
)
def test_arguments_are_checked(options: list[str], outcome: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--server", "127.0.0.1:1", "--code", "CODE", "--agent", "a:B", *options])
    assert ended.value.code == 2
    assert outcome in capsys.readouterr().err


def cup(client: chefshat.Client, rules: pb.RuleSet) -> pb.CreateTournamentResponse:
    """A tournament of three rounds of two games, for one participant and three built-in agents."""
    settings = pb.TournamentSettings(
        name="Coppa",
        format=pb.TOURNAMENT_FORMAT_ROUND_ROBIN,
        rules=rules,
        # Far longer than a test, so that a killed command resumes in time on any machine.
        policy=pb.RoomPolicy(decision_time_ms=600_000),
        rounds=3,
        games_per_pairing=2,
        built_in_agents=["random"] * (rules.players - 1),
        start_when_joined=rules.players,
    )
    return client.tournaments.create(settings)


def in_cup(address: str, code: str, player: str, *options: str) -> list[str]:
    named = ["--server", address, "--tournament", code, "--agent", f"club_players:{player}"]
    return [*named, "--path", TESTS, "--json", *options]


def test_a_player_plays_a_tournament_with_two_processes(
    real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log"
    given = json.dumps({"log_file": str(log)})
    with chefshat.Client(real_address) as client:
        made = cup(client, pb.RuleSet(players=4, target_shifts=2))
        assert main(in_cup(real_address, made.join_code, "Scribe", "--games", "2", "--arguments", given)) == 0
        outcome = one_line(capsys)
        games = list(client.tournaments.games(made.tournament.tournament_id))
        results = client.tournaments.results(made.tournament.tournament_id)
    assert (outcome["event"], outcome["tournament_id"]) == ("finished", made.tournament.tournament_id)
    assert (outcome["failures"], outcome["replaced"], outcome["restarts"]) == (0, 0, 0)
    assert results.tournament.participants[outcome["participant"]].max_games == 2
    assert sorted(game["game_id"] for game in outcome["games"]) == sorted(game.game_id for game in games)
    for game in outcome["games"]:
        assert (game["event"], game["invalid"], game["late"]) == ("finished", 0, 0)
        assert game["decisions"] > 0
    assert log.read_text().count('["update_game_over"]') == len(games) == 6
    assert all(game.rated for game in games)


def test_a_resumed_command_has_as_many_processes_as_declared(
    real_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with chefshat.Client(real_address) as client:
        made = cup(client, pb.RuleSet(players=4, target_shifts=2))
        joined = client.tournaments.join(made.join_code, "Ada", max_games=2)
    # Not with --games.
    monkeypatch.setenv(TICKET, joined.ticket)
    given = json.dumps({"log_file": str(tmp_path / "log.{process}")})
    options = ["--server", real_address, "--agent", "club_players:Scribe", "--path", TESTS, "--json", "--arguments", given]
    assert main(options) == 0
    outcome = one_line(capsys)
    assert [game["event"] for game in outcome["games"]] == ["finished"] * 6
    assert outcome["crowded"] == 0
    notified = [(tmp_path / f"log.{number}").read_text().count('["update_game_over"]') for number in range(2)]
    assert sum(notified) == 6
    assert all(notified), "both play"


def test_a_tournament_with_unsupported_rules_is_refused(real_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    with chefshat.Client(real_address) as client:
        made = cup(client, pb.RuleSet(players=3))
        assert main(in_cup(real_address, made.join_code, "Largest")) == 1
        client.tournaments.close(made.tournament.tournament_id, made.owner_token)
    outcome = one_line(capsys)
    assert "this one has 3, 11 and 2; the tournament will be played without it" in outcome["message"]


@pytest.mark.parametrize("where", ["room", "tournament"])
def test_a_killed_command_resumes(
    real_address: str, where: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], processes: list["subprocess.Popen[str]"]
) -> None:
    stalls, log, ticket = tmp_path / "stalls", tmp_path / "log", tmp_path / "ticket"
    ticket_options = ["--ticket-file", str(ticket)]
    with chefshat.Client(real_address) as client:
        if where == "room":
            policy = pb.RoomPolicy(decision_time_ms=600_000)
            code = room(real_address, ["random", None, "random", "random"], policy=policy, rules=pb.RuleSet(target_shifts=3))
            arguments = command(real_address, code, "Stalling", "--json", *ticket_options)
        else:
            made = cup(client, pb.RuleSet(players=4, target_shifts=2))
            arguments = in_cup(real_address, made.join_code, "Stalling", *ticket_options)
        process = subprocess.Popen(
            [*COMMAND, *arguments, "--arguments", json.dumps({"file": str(stalls)})],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        wait_until(stalls.exists, "the player stalls", process)
        process.kill()
        process.wait(LIMIT_S)

        again = [*arguments, "--arguments", json.dumps({"log_file": str(log)})]
        again[again.index("club_players:Stalling")] = "club_players:Scribe"
        assert main(again) == 0
        outcome = one_line(capsys)
        games = outcome.get("games", [outcome])
        records = [list(client.records.read(game["game_id"])) for game in games]
    assert not ticket.exists()
    assert (outcome["failures"], outcome["replaced"]) == (0, 0)
    assert len(games) == (1 if where == "room" else 6)
    own = 0
    for game, lines in zip(games, records, strict=True):
        assert game["event"] == "finished"
        decisions = [line.decision for line in lines if line.HasField("decision") and line.decision.seat == game["seat"]]
        assert all(decision.source == pb.DECISION_SOURCE_AGENT for decision in decisions)
        own += len(decisions) - game["decisions"]
    # Decisions before the command was killed.
    assert own >= 4
    if where == "room":
        assert games[0]["seat"] == 1
        # The player of the second process got all events of the game.
        check_order(
            [call[0] for line in log.read_text().splitlines() if not (call := json.loads(line))[0].startswith(("get", "do"))]
        )
