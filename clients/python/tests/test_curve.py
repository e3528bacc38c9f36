"""The plot of a training."""

import json
from pathlib import Path

import pytest

from chefshat.learn import __main__ as command
from chefshat.learn.curve import figure


def a_look(decisions: int, points: float) -> dict[str, object]:
    one = {"opponents": ["greedy", "greedy", "greedy"], "points": points, "standard_error": 0.5}
    return {"event": "evaluation", "decisions": decisions, "evaluations": [one]}


LOG = "\n".join(
    json.dumps(line)
    for line in (
        {"event": "setup", "rules": {"players": 4, "points": [5, 3, 1, 0]}},
        {"event": "update", "decisions": 5},
        a_look(0, 0.5),
        a_look(2_000_000, 3.0),
    )
)


def test_each_evaluation_is_a_point_with_its_interval() -> None:
    (panel,) = figure(LOG).panels
    (line,) = panel.lines
    assert panel.title == "Against 3 greedy"
    assert (list(line.x), list(line.y)) == ([0.0, 2.0], [0.5, 3.0])
    assert line.high[1] == pytest.approx(3.98)
    assert panel.levels[0].y == 2.25


def test_the_command_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, out = tmp_path / "log.jsonl", tmp_path / "curve.png"
    log.write_text(LOG)
    assert command.main(["curve", str(log), "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"out": str(out)}
    assert out.read_bytes().startswith(b"\x89PNG")
    log.write_text(LOG.splitlines()[0])
    capsys.readouterr()
    assert command.main(["curve", str(log), "--out", str(out), "--json"]) == 1
    output = json.loads(capsys.readouterr().out)
    assert (output["event"], "has no evaluation" in output["message"], str(log) in output["message"]) == ("error", True, True)
    for no_log in ("garbage", "17", "[1]"):
        log.write_text(no_log)
        assert command.main(["curve", str(log), "--out", str(out)]) == 1
        assert capsys.readouterr().err.startswith(f"error: {log}: this is not a log")
    assert command.main(["curve", str(tmp_path / "missing"), "--out", str(out)]) == 1
    assert capsys.readouterr().err.startswith("error: there is no file")
