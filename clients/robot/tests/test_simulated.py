"""The simulated robot, and the pictures that it draws."""

from __future__ import annotations

import io
import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from chefshat_robot import layout
from chefshat_robot.drivers import picture
from chefshat_robot.drivers.driver import CardMove, Done, Express, Failed, Gaze, Pick, Point, Pose, RobotError, Say, attempt
from chefshat_robot.drivers.simulated import SimulatedDriver
from chefshat_robot.drivers.standpoint import Standpoint, mood_of
from chefshat_robot.table import TableState, follow
from tests.robots import game_started, numbered, passed, play, shift_started

FAR_S = 3600.0
SVG = "{http://www.w3.org/2000/svg}"


def texts(path: Path) -> list[str]:
    """The words in a picture; fails if it is not well-formed."""
    return ["".join(text.itertext()) for text in ElementTree.parse(path).iter(f"{SVG}text")]


async def test_every_act_is_drawn(tmp_path: Path) -> None:
    async with SimulatedDriver(frames=tmp_path, speed=0) as driver:
        state = TableState(seat=1)
        for event in numbered(game_started(), shift_started(), play(0, 11, 1), passed(3)):
            state = follow(state, event)
            await driver.show_state(state)
        before = driver.frames_written
        stand = layout.Stand.at(1, 4)
        stand.fill(state.hand, state.golden)
        moves = stand.take(["9", "9"], layout.play_places(2))
        acts = (Say("Tom & <Jerry>"), Pick(moves), Point(280.0, 200.0), Gaze(0.0, 0.0), Express("gloom", -0.8, -0.5))
        for act in acts:
            assert await attempt(driver, act, FAR_S) == Done()
        # Two pictures for each card: at its start and at its end.
        assert driver.frames_written == before + len(acts) + 3
        assert driver.acts == list(acts)
    frames = [texts(path) for path in sorted(tmp_path.glob("*.svg"))]
    said = next(frame for frame in frames if "Tom & <Jerry>" in frame)
    assert "9" in said
    assert {"Ada · 0", "Pepe · 0", "Cleo · 0", "Dan · 0"} <= set(said)
    assert "gloom" in frames[-1]
    # The two 9s have left the stand, where there were three, and lie on the field, whose place 9 has a label.
    assert frames[-1].count("9") == said.count("9")


async def test_a_clumsy_robot_drops_its_cards(tmp_path: Path) -> None:
    async with SimulatedDriver(speed=0, clumsy=True) as driver:
        pick = Pick((CardMove("9", None, Pose(0.0, 0.0)),))
        assert await attempt(driver, pick, FAR_S) == Failed("the gripper dropped the card")


async def test_pictures_are_rendered_as_png(tmp_path: Path) -> None:
    pytest.importorskip("resvg_py")
    image = pytest.importorskip("PIL.Image")
    async with SimulatedDriver(frames=tmp_path, png=True, speed=0) as driver:
        await attempt(driver, Say("Hello"), FAR_S)
    pictures = sorted(tmp_path.glob("*.png"))
    assert len(pictures) == 2
    silent, speaking = [image.open(io.BytesIO(path.read_bytes())).convert("RGB") for path in pictures]
    assert silent.size == speaking.size == (picture.VIEW[2], picture.VIEW[3])
    assert silent.tobytes() != speaking.tobytes()


def test_every_seat_and_number_of_players_can_be_drawn() -> None:
    for players in range(2, 7):
        for seat in range(players):
            state = TableState(
                seat=seat,
                names=tuple("ABCDEF"[:players]),
                hand=(1,) * 12,
                golden=True,
                board_face=11,
                board_size=13,
                board_jokers=2,
                cards_left=(3,) * players,
                passed=(True,) * players,
                places=(0,) * players,
                roles=(1,) * players,
                points=(0,) * players,
                to_act=0,
            )
            scene = picture.Scene(state, layout.Stand.at(seat, players), speech="Hello", hand=(100.0, 100.0), carried="joker")
            ElementTree.fromstring(picture.draw(scene))


async def test_a_folder_that_cannot_be_made_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match="file"):
        await SimulatedDriver(frames=tmp_path / "file" / "frames").connect()


def test_a_missing_package_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "resvg_py", None)
    with pytest.raises(RobotError, match=r"pip install 'chefshat-robot\[frames\]'"):
        picture.to_png("<svg/>")


def test_seats_sit_around_the_field_clockwise_from_the_bottom() -> None:
    assert [layout.beside(seat, 4, 100.0) for seat in range(4)] == [
        (280.0, 500.0),
        (-100.0, 200.0),
        (280.0, -100.0),
        (660.0, 200.0),
    ]
    # To the right of each person as that person sees it.
    assert [layout.beside(seat, 4, 0.0, 10.0) for seat in range(4)] == [(290.0, 400.0), (0.0, 210.0), (270.0, 0.0), (560.0, 190.0)]
    assert layout.beside(0, 6, 50.0) == layout.beside(0, 4, 50.0)
    assert layout.beside(3, 6, 50.0) == layout.beside(2, 4, 50.0)


def test_points_are_before_a_robot_forward_left_and_up() -> None:
    state = TableState(seat=2, names=("A", "B", "C", "D"))
    standpoint = Standpoint.at(state, 300.0, 700.0)
    assert standpoint.before(280.0, 200.0) == (0.5, 0.0, 0.7)
    # Seat 2 sits at the top: its left is where x is larger.
    assert standpoint.before(380.0, 100.0, 50.0) == (0.4, 0.1, 0.75)


@pytest.mark.parametrize("seat", range(4))
def test_the_frame_of_the_field_leads_from_its_points_to_the_robot(seat: int) -> None:
    standpoint = Standpoint.at(TableState(seat=seat, names=("Ada", "Bo", "Cleo", "Dan")), 300.0, 700.0)
    x, y, z, yaw = standpoint.field_frame()
    for point in ((0.0, 0.0), (560.0, 400.0), (97.5, 151.0)):
        # As in ROS: metres, and y away from seat 0.
        field_x, field_y = point[0] / 1000, -point[1] / 1000
        forward = x + field_x * math.cos(yaw) - field_y * math.sin(yaw)
        left = y + field_x * math.sin(yaw) + field_y * math.cos(yaw)
        assert (forward, left, z) == pytest.approx(standpoint.before(*point), abs=2e-4)


def test_expressions_have_the_nearest_mood() -> None:
    assert mood_of(Express("annoyance", 1.0, 1.0)) == "annoyance"
    assert mood_of(Express("bliss", 0.9, 0.4)) == "joy"
    assert mood_of(Express("grief", -0.9, -0.5)) == "sadness"
