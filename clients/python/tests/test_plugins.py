"""Opponents of trainings that another package adds."""

import sys
from pathlib import Path

import pytest

from chefshat.learn import plugins
from chefshat.learn.ppo_checkpoint import Opponent
from chefshat.learn.ppo_training import seated

PACKAGE = """
class Added:
    def __init__(self, name, *, arguments, python):
        self.given = name, arguments, python
"""


def test_an_opponent_of_another_package_is_created(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    metadata = tmp_path / "added-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Name: added\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(f"[{plugins.GROUP}]\nadded = added_opponent:Added\n")
    (tmp_path / "added_opponent.py").write_text(PACKAGE)
    monkeypatch.syspath_prepend(tmp_path)

    assert vars(seated(Opponent("added:a.b:C")))["given"] == ("a.b:C", {}, sys.executable)
    opponent = seated(Opponent("added:d", python="other", arguments='{"depth": 2}'))
    assert vars(opponent)["given"] == ("d", {"depth": 2}, "other")
    # The games refuse what is not a built-in agent.
    for name in ("greedy", "added", "added:file.safetensors", "other:a.b:C"):
        assert seated(Opponent(name)) == name
