"""Curves for TensorBoard."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from chefshat.learn.scalars import Scalars

event_pb2: Any = pytest.importorskip("tensorboardX.proto.event_pb2")


def events(file: Path) -> Iterator[Any]:
    """Reads a file: of each event its length in 8 bytes, a checksum of 4, the message, and another checksum."""
    content = file.read_bytes()
    while content:
        end = 12 + int.from_bytes(content[:8], "little")
        yield event_pb2.Event.FromString(content[12:end])
        content = content[end + 4 :]


@pytest.mark.parametrize(("decisions", "hidden_from"), [(0, []), (20, [21])])
def test_what_a_resumed_training_plays_again_is_not_shown_twice(decisions: int, hidden_from: list[int], tmp_path: Path) -> None:
    with Scalars(tmp_path, decisions) as scalars:
        scalars.add("losses", {"entropy": 0.5}, decisions + 10)
    (file,) = tmp_path.iterdir()
    assert [event.step for event in events(file) if event.HasField("session_log")] == hidden_from
    assert [event.step for event in events(file) if event.summary.value] == [decisions + 10]
