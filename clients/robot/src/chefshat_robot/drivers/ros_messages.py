"""Acts, events and states as ROS messages of the package `chefshat_msgs` (folder `ros2`), for the drivers `ros2` and `rosbridge`.

Messages are dictionaries here, with the fields of the .msg files. ROS counts in metres and radians, counterclockwise, with y away
from seat 0 (REP 103), everything else in millimetres and degrees, clockwise, with y towards seat 0.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from chefshat import pb

from chefshat_robot import wire
from chefshat_robot.drivers.driver import Act, CardMove, Done, Express, Failed, Gaze, Outcome, Pick, Point, Pose, RobotEvent, Say
from chefshat_robot.table import TableState

SAY, PICK, POINT, GAZE, EXPRESS = range(1, 6)
KINDS = {Say: SAY, Pick: PICK, Point: POINT, Gaze: GAZE, Express: EXPRESS}


def act_message(act: Act) -> dict[str, Any]:
    """Returns an act as `Act`, every field set."""
    message: dict[str, Any] = {
        "kind": KINDS[type(act)],
        "text": "",
        "language": "",
        "moves": [],
        "target": _point(0.0, 0.0, 0.0),
        "label": "",
        "valence": 0.0,
        "arousal": 0.0,
    }
    match act:
        case Say(text, language):
            message.update(text=text, language=language)
        case Pick(moves):
            message["moves"] = [_move(move) for move in moves]
        case Point(x, y):
            message["target"] = _point(x, y, 0.0)
        case Gaze(x, y, z):
            message["target"] = _point(x, y, z)
        case Express(label, valence, arousal):
            message.update(label=label, valence=valence, arousal=arousal)
    return message


def event_message(event: pb.GameEvent) -> dict[str, Any]:
    """Returns an event as `GameEvent`."""
    message = wire.event_to_json(event)
    return {**message, "fields": json.dumps(message["fields"], ensure_ascii=False)}


def state_message(state: TableState) -> dict[str, Any]:
    """Returns a state as `TableState`."""
    return {
        "seat": -1 if state.seat is None else state.seat,
        "names": list(state.names),
        "shift": state.shift,
        "pizza": state.pizza,
        "faces": state.faces,
        "hand": list(state.hand),
        "golden": state.golden,
        "board_face": state.board_face,
        "board_size": state.board_size,
        "board_jokers": state.board_jokers,
        "cards_left": list(state.cards_left),
        "passed": list(state.passed),
        "places": list(state.places),
        "roles": list(state.roles),
        "points": list(state.points),
        "to_act": -1 if state.to_act is None else state.to_act,
        "over": state.over,
    }


def outcome_of(result: Mapping[str, Any]) -> Outcome:
    """Returns the outcome by the result of `PlayTurn`."""
    if result.get("done"):
        return Done()
    return Failed(str(result.get("reason") or "the robot gave no reason"))


def robot_event_of(message: Mapping[str, Any]) -> RobotEvent:
    """Converts a `RobotEvent`.

    Raises:
        WireError: a field does not fit.
    """
    numbers = ("valence", "arousal", "dominance", "confidence")
    fields = {name: value for name, value in message.items() if name != "kind"}
    # rosbridge sends NaN as null.
    unknown = {name for name in numbers if fields.get(name) is None or math.isnan(fields[name])}
    if fields.get("seat", -1) < 0:
        unknown.add("seat")
    if not fields.get("source"):
        unknown.add("source")
    known = {name: value for name, value in fields.items() if name not in unknown}
    return wire.robot_event_from_json({"type": message.get("kind"), **known})


def _move(move: CardMove) -> dict[str, Any]:
    return {
        "piece": move.piece,
        "start_known": move.start is not None,
        "start": _pose(move.start or Pose(0.0, 0.0)),
        "end": _pose(move.end),
    }


def _pose(pose: Pose) -> dict[str, Any]:
    half = math.radians(-pose.angle) / 2
    return {
        "position": _point(pose.x, pose.y, 0.0),
        "orientation": {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)},
    }


def _point(x: float, y: float, z: float) -> dict[str, float]:
    return {"x": x / 1000, "y": -y / 1000, "z": z / 1000}
