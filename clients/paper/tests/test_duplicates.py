"""The plot of the effect of duplicate deals."""

import json
from pathlib import Path

import pytest

from chefshat_paper.experiments.duplicates import figure, main


def a_row(first: str, game: str, games: int) -> dict[str, object]:
    return {
        "first": first,
        "second": "random",
        "game": game,
        "games": games,
        "independent_error": 4 / games,
        "duplicate_error": 1 / games,
    }


REPORT = json.dumps(
    {
        "rows": [
            a_row(first, game, games) for game in ("1 Shift", "15 points") for first in ("trained", "greedy") for games in (50, 100)
        ]
    }
)


def test_every_pair_and_length_has_a_panel() -> None:
    panels = figure(REPORT).panels
    assert [panel.title for panel in panels] == [
        "trained / random, games of 1 Shift",
        "greedy / random, games of 1 Shift",
        "trained / random, games to 15 points",
        "greedy / random, games to 15 points",
    ]
    for panel in panels:
        own, same = panel.lines
        assert (list(own.x), list(own.y), list(same.y)) == ([50, 100], [0.08, 0.04], [0.02, 0.01])
        assert panel.y_range == panels[0].y_range


def test_the_command_draws(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report, out = tmp_path / "report.json", tmp_path / "duplicates.png"
    report.write_text(REPORT)
    assert main([str(report), "--out", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"out": str(out)}
    assert out.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"rows": []}', '{"rows": [{"game": "1 Shift"}]}'])
def test_other_files_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str) -> None:
    report, out = tmp_path / "report.json", tmp_path / "duplicates.png"
    report.write_text(text)
    assert main([str(report), "--out", str(out)]) == 1
    assert "duplicates --json" in capsys.readouterr().err
    assert main([str(tmp_path / "none.json"), "--out", str(out)]) == 1
    assert not out.exists()
