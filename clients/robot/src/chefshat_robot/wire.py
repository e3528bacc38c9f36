"""Acts and events as JSON objects, for robots that are spoken to in JSON.

An act has a field `act` and the fields of its class in `drivers.driver`:

    {"act": "say", "text": "I pass.", "language": "en"}
    {"act": "pick", "moves": [{"piece": "9", "start": {"x": 346.0, "y": 530.0, "angle": 0.0}, "end": {...}}]}
    {"act": "point", "x": 280.0, "y": 200.0}
    {"act": "gaze", "x": 280.0, "y": -350.0, "z": 450.0}
    {"act": "express", "label": "joy", "valence": 0.8, "arousal": 0.5}

An event of a robot has a field `type`: "heard" (`text`, `confidence`), "affect" (`label` and the other fields of `Affect`), or
"button" (`name`).
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import Any

from chefshat import pb
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.json_format import MessageToDict

from chefshat_robot.drivers.driver import Act, Affect, Button, CardMove, Heard, RobotEvent
from chefshat_robot.table import TableState

SOURCES = ("face", "voice", "self_report", "model")
# The last second of the year 9999, the last that the protocol's timestamps can express.
LAST_SECOND = 253_402_300_799


class WireError(ValueError):
    """A message that is not of this form. The message says what is wrong."""


def parse(line: bytes | str) -> Mapping[str, Any]:
    """Parses a message.

    Raises:
        WireError: it is not a JSON object.
    """
    try:
        message = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise WireError(f"not JSON: {error}") from error
    if not isinstance(message, dict):
        raise WireError("a message must be a JSON object")
    return message


def act_to_json(act: Act) -> dict[str, Any]:
    """Converts an act."""
    return {"act": type(act).__name__.lower(), **dataclasses.asdict(act)}


def move_to_json(move: CardMove) -> dict[str, Any]:
    """Converts a piece to carry."""
    return dataclasses.asdict(move)


def state_to_json(state: TableState) -> dict[str, Any]:
    """Converts the state of the table; arrays as lists."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in dataclasses.asdict(state).items()}


def event_to_json(event: pb.GameEvent) -> dict[str, Any]:
    """Converts an event of the game: `sequence`, `elapsed_ms`, `kind`, and the `fields` of that kind, as named in event.proto.

    Enums are their names, bytes are in base64.
    """
    kind = event.WhichOneof("kind") or ""
    fields: dict[str, Any] = {}
    if kind:
        message = getattr(event, kind)
        fields = MessageToDict(message, preserving_proto_field_name=True, always_print_fields_with_no_presence=True)
        _with_integers(fields, message.DESCRIPTOR)
    return {"sequence": event.sequence, "elapsed_ms": event.elapsed_ms, "kind": kind, "fields": fields}


def robot_event_from_json(message: Mapping[str, Any]) -> RobotEvent:
    """Converts an event of a robot or an analyser.

    Raises:
        WireError: a field is missing, of the wrong type, or out of its range.
    """
    match message.get("type"):
        case "heard":
            confidence = _number(message, "confidence", 0.0)
            return Heard(_text(message, "text"), 1.0 if confidence is None else confidence)
        case "button":
            return Button(_text(message, "name"))
        case "affect":
            return affect_from_json(message)
        case other:
            raise WireError(f"`type` is {other!r}: it must be 'heard', 'affect' or 'button'")


def affect_from_json(message: Mapping[str, Any]) -> Affect:
    """Converts a reading of a person's expression.

    Raises:
        WireError: as `robot_event_from_json`.
    """
    source = message.get("source", "model")
    if source not in SOURCES:
        raise WireError(f"`source` is {source!r}: it must be one of {', '.join(SOURCES)}")
    seat = message.get("seat")
    if seat is not None and (not isinstance(seat, int) or isinstance(seat, bool) or seat < 0):
        raise WireError(f"`seat` is {seat!r}: it must be the number of a seat, from 0")
    taken_at = message.get("taken_at")
    if taken_at is not None and not (_is_number(taken_at) and 0 <= taken_at <= LAST_SECOND):
        raise WireError(f"`taken_at` is {taken_at!r}: it must be seconds since the Unix epoch")
    return Affect(
        label=_text(message, "label"),
        valence=_number(message, "valence", -1.0),
        arousal=_number(message, "arousal", -1.0),
        dominance=_number(message, "dominance", -1.0),
        confidence=_number(message, "confidence", 0.0),
        source=str(source),
        seat=seat,
        taken_at=None if taken_at is None else float(taken_at),
    )


def _text(message: Mapping[str, Any], name: str) -> str:
    value = message.get(name)
    if not isinstance(value, str) or not value:
        raise WireError(f"`{name}` is {value!r}: it must be a text")
    return value


def _number(message: Mapping[str, Any], name: str, least: float) -> float | None:
    value = message.get(name)
    if value is None:
        return None
    if not _is_number(value) or not least <= value <= 1:
        raise WireError(f"`{name}` is {value!r}: it must be a number in {least:g}..1")
    return float(value)


def _is_number(value: object) -> bool:
    # Not `math.isfinite`, which cannot take an integer of hundreds of digits.
    return isinstance(value, int | float) and not isinstance(value, bool) and -math.inf < value < math.inf


def _with_integers(fields: dict[str, Any], descriptor: Descriptor) -> None:
    """Replaces the texts, as which protobuf's JSON writes integers of 64 bits, by integers."""
    for field in descriptor.fields:
        value = fields.get(field.name)
        if value is None:
            continue
        if field.cpp_type in (FieldDescriptor.CPPTYPE_INT64, FieldDescriptor.CPPTYPE_UINT64):
            fields[field.name] = [int(item) for item in value] if isinstance(value, list) else int(value)
        elif field.message_type is not None:
            for item in value if isinstance(value, list) else [value]:
                if isinstance(item, dict):
                    _with_integers(item, field.message_type)
