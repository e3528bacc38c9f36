"""Robots in games on the real server, and the command `chefshat-robot robot`."""

from __future__ import annotations

import asyncio
import json
import socket
import sys
from pathlib import Path

import pytest
from chefshat import ChefsHatError, RandomAgent, aio, pb

from chefshat_robot import cli, drivers, layout, speech
from chefshat_robot.affect import Forwarder
from chefshat_robot.body import Body, Notice, Turn
from chefshat_robot.drivers.driver import Affect, CardMove, Done, Express, Failed, Pick, Pose, Say
from chefshat_robot.player import RobotPlayer
from chefshat_robot.robot import attendant, play_seat
from chefshat_robot.running import Sender, live_from
from chefshat_robot.words import TEXTS, Words
from tests.robots import ScriptedRobot

ONE_SHIFT = pb.RuleSet(target_shifts=1)


async def room(client: aio.Client) -> str:
    """Creates a room with built-in agents and a free seat, and returns its join code."""
    made = await client.rooms.create("robots", seats=[None, "greedy", "random", "greedy"], rules=ONE_SHIFT)
    return made.join_code


async def own_turns(client: aio.Client, game_id: str, seat: int) -> list[Turn]:
    """The turns of a seat by the record."""
    turns = []
    async for line in client.records.read(game_id):
        event = line.event
        if line.HasField("event") and event.HasField("play") and event.play.seat == seat:
            turns.append(Turn(event.play.face if event.play.quantity else 0, event.play.quantity, event.play.jokers))
        elif line.HasField("event") and event.HasField("pass") and getattr(event, "pass").seat == seat:
            turns.append(Turn())
    return turns


@pytest.mark.server
@pytest.mark.parametrize("jammed", [False, True])
async def test_a_robot_plays_a_game_and_lays_just_what_it_played(server_address: str, jammed: bool) -> None:
    robot = ScriptedRobot(lambda act: Failed("jammed") if jammed and isinstance(act, Pick) else Done())
    notices: list[Notice] = []
    async with aio.Client(server_address) as client:
        seat = await client.rooms.join(await room(client), "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT)
        result = await play_seat(client, seat.ticket, RandomAgent(7), robot, words=Words("en"), notify=notices.append)
        assert result.finished
        assert (result.late, result.invalid) == (0, 0)
        turns = await own_turns(client, result.game_id, result.seat)
        record = [line async for line in client.records.read(result.game_id)]
    assert turns
    cards = [[move.piece for move in act.moves if move.piece != "pass"] for act in robot.acts if isinstance(act, Pick)]
    laid = [pieces for pieces in cards if pieces]
    assert [len(pieces) for pieces in laid] == [turn.quantity + turn.jokers for turn in turns if not turn.is_pass]
    for pieces, turn in zip(laid, [turn for turn in turns if not turn.is_pass], strict=True):
        faces = {"11" if piece == "golden" else piece for piece in pieces if piece != "joker"}
        assert faces == ({str(turn.face)} if turn.quantity else set())
        assert pieces.count("joker") == turn.jokers
    assert all(move.start is not None for act in robot.acts if isinstance(act, Pick) for move in act.moves)
    assert sum(act == Say("I pass.") for act in robot.acts) == sum(turn.is_pass for turn in turns)
    # What it said is in the record, its requests for help in the game's public events.
    said = [text for line in record if (text := speech.text_of(line.private_expression.expression))]
    assert said
    assert said == [act.text for act in robot.acts if isinstance(act, Say)][: len(said)]
    shown = [line.event.expression_shown.expression for line in record if line.event.HasField("expression_shown")]
    asked = [text for expression in shown if (text := speech.text_of(expression))]
    assert bool(asked) == jammed
    assert asked == [notice.text for notice in notices][: len(asked)]
    # Its feelings are, too; those after the end of the game no longer.
    felt = [Express(act.label, act.valence, act.arousal) for act in shown if act.label != speech.HELP]
    expressed = [act for act in robot.acts if isinstance(act, Express)]
    assert [act.label for act in felt] == [act.label for act in expressed][: len(felt)]


@pytest.mark.server
async def test_what_a_robot_reads_in_faces_becomes_expressions_of_their_seats(server_address: str) -> None:
    async with aio.Client(server_address) as client:
        made = await client.rooms.create(
            "faces", seats=[None, None, "random", "greedy"], rules=ONE_SHIFT, policy=pb.RoomPolicy(pace_ms=0)
        )
        person = await client.rooms.join(made.join_code, "Ada", kind=pb.PARTICIPANT_KIND_HUMAN)
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT)
        robot = ScriptedRobot()
        for affect in (Affect("joy", 0.5, seat=0, source="face"), Affect("sadness", seat=3)):
            robot.report(affect)
        people = Forwarder(client, {0: person.ticket})
        playing = asyncio.create_task(client.play(RandomAgent(1), person.ticket))
        result = await play_seat(client, seat.ticket, RandomAgent(7), robot, words=Words("en"), people=people)
        await playing
        lines = [line async for line in client.records.read(result.game_id)]
        expressions = [line.event.expression_shown.expression for line in lines if line.event.expression_shown.seat == person.seat]
    shown = [expression for expression in expressions if expression.label]
    assert [(expression.label, expression.valence, expression.source) for expression in shown] == [
        ("joy", 0.5, pb.EXPRESSION_SOURCE_FACE)
    ]


@pytest.mark.server
async def test_a_robot_that_never_answers_costs_no_decision(server_address: str) -> None:
    robot = ScriptedRobot(lambda act: None)
    async with aio.Client(server_address) as client:
        # The bank is only for a slow machine: the player does not use it.
        policy = pb.RoomPolicy(decision_time_ms=1200, bank_ms=3_600_000)
        made = await client.rooms.create("deaf", seats=[None, "greedy", "greedy", "greedy"], rules=ONE_SHIFT, policy=policy)
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT)
        async with Body(robot, Words("en"), finish_s=0) as body:
            result = await client.play(RobotPlayer(RandomAgent(7), body), seat.ticket)
        assert result.finished
        assert (result.late, result.invalid) == (0, 0)
        record = [line async for line in client.records.read(result.game_id)]
    turns = [line.event.play for line in record if line.event.HasField("play") and line.event.play.seat == 0]
    turns += [
        getattr(line.event, "pass") for line in record if line.event.HasField("pass") and getattr(line.event, "pass").seat == 0
    ]
    assert turns
    assert {turn.source for turn in turns} == {pb.DECISION_SOURCE_AGENT}


@pytest.mark.server
async def test_a_robot_gives_just_what_the_exchange_says(server_address: str) -> None:
    robot = ScriptedRobot()
    async with aio.Client(server_address) as client:
        made = await client.rooms.create("gifts", seats=[None, "greedy", "random", "greedy"], rules=pb.RuleSet(target_shifts=6))
        seat = await client.rooms.join(made.join_code, "Pepe", kind=pb.PARTICIPANT_KIND_ROBOT)
        result = await play_seat(client, seat.ticket, RandomAgent(5), robot, words=Words("en"))
        record = [line async for line in client.records.read(result.game_id)]
    exchanges = [line.event.cards_exchanged for line in record if line.event.HasField("cards_exchanged")]
    given = [(exchange.receiver, sorted(exchange.cards)) for exchange in exchanges if exchange.giver == result.seat]
    assert given
    spots = [layout.gift_place(receiver, 4) for receiver in range(4)]
    moves = [move for act in robot.acts if isinstance(act, Pick) for move in act.moves if move.end in spots]
    assert all(move.start is not None for move in moves)
    for receiver, cards in given:
        carried, moves = moves[: len(cards)], moves[len(cards) :]
        assert {move.end for move in carried} == {spots[receiver]}
        assert sorted({"joker": 12, "golden": 11}.get(move.piece) or int(move.piece) for move in carried) == cards
    assert moves == []


@pytest.mark.server
def test_the_command_plays_and_draws_a_game(server_address: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    async def code() -> str:
        async with aio.Client(server_address) as client:
            return await room(client)

    async def fingerprints() -> list[str]:
        async with aio.Client(server_address) as client:
            wanted = pb.RecordFilter(participant="Keyed")
            return [
                seat.name_fingerprint async for game in client.records.list(wanted) for seat in game.seats if seat.name == "Keyed"
            ]

    key = ["--name", "Keyed", "--name-key", str(tmp_path / "robot.key")]
    arguments = ["--address", server_address, "--code", asyncio.run(code()), "--seed", "3", "--json", "--language", "it", *key]
    driver = f"simulated:frames={tmp_path / 'frames'},speed=0,clumsy=true"
    assert cli.main(["robot", *arguments, "--driver", driver]) == 0
    out, err = capsys.readouterr()
    lines = [json.loads(line) for line in out.splitlines()]
    assert lines[-1]["event"] == "finished"
    assert {line["event"] for line in lines[:-1]} == {"help"}
    assert any("al posto mio" in line["text"] for line in lines[:-1])
    assert "resume with --ticket" in err
    frames = sorted((tmp_path / "frames").glob("*.svg"))
    assert len(frames) > 20
    assert any("Passo." in frame.read_text() or "Gioco" in frame.read_text() for frame in frames)
    assert [len(fingerprint) for fingerprint in asyncio.run(fingerprints())] == [16]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--code", "X", "--ticket", "Y"], "give the room's join code (--code), or the ticket"),
        ([], "give the room's join code (--code), or the ticket"),
        (["--code", "X", "--agent", "nonsense"], "--agent nonsense: give 'random' or module:Class"),
        (["--code", "X", "--agent", "missing.safetensors"], "--agent missing.safetensors"),
        (["--code", "X", "--address", "127.0.0.1:1"], "no server answers"),
        (["--code", "X", "--name-key", "."], "--name-key: "),
    ],
)
def test_wrong_arguments_are_explained(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["robot", *arguments]) == 1
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("unknown", "no driver 'unknown': give one of furhat, jsonlines, "),
        ("simulated:colour=red", "driver simulated has no option 'colour'"),
        ("simulated:speed=fast", "option speed of driver simulated: 'fast' is not a number"),
        ("simulated:png=perhaps", "option png of driver simulated: 'perhaps' is not true or false"),
        ("no.such.Driver", "driver no.such.Driver: No module named 'no'"),
        ("chefshat_robot.words.Words", "Words is not a subclass"),
    ],
)
def test_wrong_drivers_are_explained(spec: str, message: str) -> None:
    with pytest.raises(drivers.RobotError) as error:
        drivers.create(spec)
    assert message in str(error.value)


@pytest.mark.server
def test_a_robot_that_is_not_there_at_the_start_is_an_error(server_address: str, capsys: pytest.CaptureFixture[str]) -> None:
    async def code() -> str:
        async with aio.Client(server_address) as client:
            return await room(client)

    arguments = ["--address", server_address, "--code", asyncio.run(code()), "--driver", "jsonlines:port=1"]
    assert cli.main(["robot", *arguments]) == 1
    err = capsys.readouterr().err
    assert "no robot listens at 127.0.0.1:1" in err
    assert "--ticket" not in err  # It has not taken the seat.


def test_requests_for_help_name_the_cards(capsys: pytest.CaptureFixture[str]) -> None:
    moves = tuple(CardMove(piece, None, Pose(1.0, 2.0)) for piece in ("9", "joker"))
    attendant(False)(Notice("help", "Please lay my cards.", "jammed", moves))
    attendant(True)(Notice("help", "Please lay my cards.", "jammed", moves))
    out, err = capsys.readouterr()
    assert err == "HELP: Please lay my cards. [9, joker] (jammed)\n"
    assert json.loads(out)["cards"][0]["end"] == {"x": 1.0, "y": 2.0, "angle": 0.0}


@pytest.mark.parametrize(
    ("driver", "package"),
    [("ros2", "zenoh"), ("ros2", "rosbags.typesys"), ("rosbridge", "roslibpy"), ("naoqi", "qi"), ("furhat", "furhat_realtime_api")],
)
def test_a_missing_package_of_a_driver_is_named_with_its_extra(driver: str, package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(drivers.RobotError) as error:
        drivers.create(driver)
    assert package in str(error.value)
    assert f"pip install 'chefshat-robot[{driver}]'" in str(error.value)


def test_drivers_are_listed_with_their_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["robot", "--list-drivers"]) == 0
    out = capsys.readouterr().out
    for name in drivers.names():
        assert name in out
    assert "speed=FLOAT  (default: 1.0)" in out


def test_an_own_class_is_a_driver() -> None:
    assert isinstance(drivers.create("tests.robots.ScriptedRobot"), ScriptedRobot)


def test_an_installed_package_adds_a_driver(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    metadata = tmp_path / "theatre-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Name: theatre\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(
        f"[{drivers.GROUP}]\nstage = tests.robots:ScriptedRobot\nempty = tests.robots:Absent\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    assert {"stage", "simulated"} <= set(drivers.names())
    assert isinstance(drivers.create("stage"), ScriptedRobot)
    with pytest.raises(drivers.RobotError, match=r"driver empty: .*Absent"):
        drivers.create("empty")


def test_both_languages_have_all_texts_with_the_same_values() -> None:
    def values(text: str) -> set[str]:
        return {part.split("}")[0] for part in text.split("{")[1:]}

    english, italian = TEXTS["en"], TEXTS["it"]
    assert english.keys() == italian.keys()
    assert {key: values(text) for key, text in english.items()} == {key: values(text) for key, text in italian.items()}


def test_cards_are_named_in_both_languages() -> None:
    assert Words("en").cards(9, 2, 1) == "two 9s and a joker"
    assert Words("en").my_cards(9, 1, 2) == "my 9 and my jokers"
    assert Words("it").cards(9, 1, 0) == "un 9"
    assert Words("it").my_cards(11, 3, 1) == "i miei tre 11 e il mio jolly"
    assert Words("en").cards(0, 0, 1) == "a joker"


def test_lines_travel_in_expressions_within_the_protocols_limit() -> None:
    for text in ("I pass.", "È la mia ultima carta, perché no? 100 % & più", "ò" * 300):
        expression = speech.line(text, by_person=True)
        assert len(expression.media.encode()) <= 256
        carried = speech.text_of(expression)
        assert carried is not None
        assert carried == text or (carried.endswith("…") and text.startswith(carried[:-1]))
    assert speech.text_of(pb.Expression(label="joy")) is None


class Away(Sender[str]):
    """A sender whose server is away."""

    async def _deliver(self, item: str) -> None:
        await asyncio.Event().wait()


async def test_what_cannot_be_sent_at_the_end_is_given_up(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("chefshat_robot.running.DRAIN_S", 0.01)
    async with aio.Client("127.0.0.1:1") as client, Away(client, "ticket") as sender:
        sender.send("I pass.")
    assert "was not sent to the server within 0.01 s" in caplog.text


def test_a_client_that_is_closed_while_a_room_is_looked_up_says_so() -> None:
    async def test(address: str) -> None:
        client = aio.Client(address)
        looking = asyncio.create_task(live_from(client, "room"))
        await asyncio.sleep(0)
        await client.close()
        with pytest.raises(ChefsHatError, match="CLIENT_CLOSED"):
            await looking

    # A server that accepts connections and never answers.
    with socket.create_server(("127.0.0.1", 0)) as listener:
        asyncio.run(test(f"127.0.0.1:{listener.getsockname()[1]}"))
