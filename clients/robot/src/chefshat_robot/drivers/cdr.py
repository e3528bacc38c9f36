"""CDR, the encoding of ROS 2 messages: the types of `chefshat_msgs` (folder `ros2`) and those that ROS derives for actions.

Types have their names in the .msg, .srv and .action files, with ROS's suffixes: `GetTable_Response`, `PlayTurn_SendGoal_Request`.
Messages are dictionaries, as in `ros_messages`. The encoding itself is done by rosbags.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np

from chefshat_robot.drivers.driver import RobotError, describe, require

PACKAGE = "chefshat_msgs"
FOLDER = files("chefshat_robot") / "ros2" / PACKAGE
_GOAL_ID = "unique_identifier_msgs/UUID goal_id\n"


class Cdr:
    """Converts messages to CDR and back."""

    def __init__(self) -> None:
        """Reads the types. Raises RobotError if the extra `ros2` is not installed."""
        typesys = require("rosbags.typesys", "ros2")
        self._nodes = require("rosbags.interfaces", "ros2").Nodetype
        self._parse = typesys.get_types_from_msg
        # Only types that are the same in all distributions are used from it.
        self._store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        for name, text in _definitions().items():
            self._register(name, text)

    def encode(self, name: str, message: Mapping[str, Any]) -> bytes:
        """Returns a message as CDR, little-endian, with its header of four bytes."""
        kind = f"{PACKAGE}/msg/{name}"
        return bytes(self._store.serialize_cdr(self._object(kind, message), kind, little_endian=True))

    def decode(self, name: str, data: bytes) -> dict[str, Any]:
        """Returns the fields of a message. Raises RobotError if the bytes are no such message."""
        try:
            plain: dict[str, Any] = _plain(self._store.deserialize_cdr(data, f"{PACKAGE}/msg/{name}"))
        except Exception as error:
            raise RobotError(f"{len(data)} bytes from the robot are not a message {name}: {describe(error)}") from error
        return plain

    def _register(self, name: str, text: str) -> None:
        lines = [line for line in text.splitlines() if line.partition("#")[0].strip()]
        # ROS gives a message without fields one byte.
        definition = "\n".join(lines) or "uint8 structure_needs_at_least_one_member"
        self._store.register(self._parse(definition, f"{PACKAGE}/msg/{name}"))

    def _object(self, kind: str, message: Mapping[str, Any]) -> object:
        """Builds what rosbags serializes."""
        _, fields = self._store.fielddefs[kind]
        return self._store.types[kind](**{name: self._value(what, message.get(name, 0)) for name, what in fields})

    def _value(self, what: Any, value: Any) -> Any:  # noqa: ANN401 (a value of any field)
        node, details = what
        if node == self._nodes.NAME:
            return self._object(details, value)
        if node == self._nodes.BASE:
            return value
        (item_node, item), _ = details
        if item_node == self._nodes.NAME:
            return [self._object(item, entry) for entry in value]
        return list(value) if item[0] == "string" else np.array(value, np.dtype(item[0]))


def _definitions() -> dict[str, str]:
    """The types in the order of their dependencies."""
    types = {
        name: (FOLDER / "msg" / f"{name}.msg").read_text() for name in ("CardMove", "Act", "GameEvent", "RobotEvent", "TableState")
    }
    types["GetTable_Request"], types["GetTable_Response"] = (FOLDER / "srv" / "GetTable.srv").read_text().split("---\n")
    action = (FOLDER / "action" / "PlayTurn.action").read_text().split("---\n")
    types["PlayTurn_Goal"], types["PlayTurn_Result"], types["PlayTurn_Feedback"] = action
    return {
        **types,
        "PlayTurn_SendGoal_Request": _GOAL_ID + "PlayTurn_Goal goal",
        "PlayTurn_SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp",
        "PlayTurn_GetResult_Request": _GOAL_ID,
        "PlayTurn_GetResult_Response": "int8 status\nPlayTurn_Result result",
        "PlayTurn_FeedbackMessage": _GOAL_ID + "PlayTurn_Feedback feedback",
        "CancelGoal_Request": "action_msgs/GoalInfo goal_info",
        "CancelGoal_Response": "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
    }


def _plain(value: Any) -> Any:  # noqa: ANN401 (a value of any field)
    """Converts what rosbags returns to dictionaries, lists and numbers."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [entry.name for entry in dataclasses.fields(value) if not entry.name.startswith("__")]
        return {name: _plain(getattr(value, name)) for name in names}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [_plain(entry) for entry in value] if isinstance(value, list) else value
