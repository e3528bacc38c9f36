"""Draws how duplicate deals reduce the standard error: `python -m chefshat_paper.experiments.duplicates FILE --out PNG`.

FILE is the output of the example `duplicates --json` of chefshat-simulation.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from chefshat.learn import plots
from chefshat.learn.figures import Figure, Line, Panel

EXAMPLE = """\
example:
  cargo run --release -p chefshat-simulation --example duplicates -- --json > duplicates.json
  python -m chefshat_paper.experiments.duplicates duplicates.json --out duplicates.png
"""
PRINTED = "the example `duplicates --json` of chefshat-simulation prints"
# Room above the highest line, as a share of it.
HEADROOM = 1.08


def figure(report: str) -> Figure:
    """Returns the standard error of the difference between two agents over the games of each, a panel per pair and game length.

    Args:
        report: the report, JSON.

    Raises:
        ValueError: this is not such a report.
    """
    try:
        rows = json.loads(report)["rows"]
        cases: dict[tuple[str, str, str], list[dict[str, Any]]] = {}
        for row in rows:
            cases.setdefault((row["game"], row["first"], row["second"]), []).append(row)
        highest = max(max(row["independent_error"], row["duplicate_error"]) for row in rows)
        panels = [_panel(case, rows, highest * HEADROOM) for case, rows in cases.items()]
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"this is not what {PRINTED}") from error
    return Figure(
        name="duplicates",
        title="Two agents among three greedy ones: how sure is it which of them is better?",
        panels=panels,
        columns=3,
    )


def _panel(case: tuple[str, str, str], rows: list[dict[str, Any]], highest: float) -> Panel:
    game, first, second = case
    names = {"independent_error": "each game has its own deals", "duplicate_error": "both play the same deals"}
    games = [row["games"] for row in rows]
    return Panel(
        title=f"{first} / {second}, games of {game}" if "Shift" in game else f"{first} / {second}, games to {game}",
        x_label="games of each",
        y_label="standard error, points by place",
        lines=[Line(label=label, x=games, y=[row[error] for row in rows]) for error, label in names.items()],
        y_range=(0.0, highest),
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command. Returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m chefshat_paper.experiments.duplicates",
        description="Draw how duplicate deals reduce the standard error.",
        epilog=EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("report", type=Path, metavar="FILE", help=f"what {PRINTED}")
    parser.add_argument("--out", type=Path, required=True, metavar="PNG", help="the picture to write")
    parser.add_argument("--json", action="store_true", help="print one object of JSON")
    options = parser.parse_args(arguments)
    return plots.draw_files([options.report], "report", PRINTED, figure, lambda found: found[0], options.out, as_json=options.json)


if __name__ == "__main__":
    sys.exit(main())
