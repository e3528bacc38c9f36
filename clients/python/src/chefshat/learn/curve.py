"""The command `curve`: draws the points per Shift at each evaluation of a training, from the log that `ppo` writes."""

import argparse
import json

from chefshat.experiments import plots
from chefshat.experiments.results import Figure, Level, Line, Panel

# Half the width of a 95% interval, in standard errors.
WIDTH_95 = 1.96


def figure(log: str) -> Figure:
    """Returns the points per Shift at each evaluation, over the decisions of the training, with 95% intervals.

    Args:
        log: the log, JSON lines.

    Raises:
        ValueError: this is not a log, or it has no evaluation.
    """
    try:
        lines = [dict(json.loads(line)) for line in log.splitlines()]
    except (ValueError, TypeError) as error:
        raise ValueError("this is not a log; `python -m chefshat.learn ppo` writes one next to its network, as .jsonl") from error
    evaluated = [line for line in lines if line.get("event") == "evaluation"]
    rules = [line["rules"] for line in lines if line.get("event") == "setup"]
    if not evaluated:
        raise ValueError("the log has no evaluation; did the training end before the first?")
    mean = Level(label="mean of all seats", y=sum(rules[0]["points"]) / rules[0]["players"]) if rules else None
    panels = []
    for number, evaluation in enumerate(evaluated[0]["evaluations"]):
        opponents = evaluation["opponents"]
        shown = [line["evaluations"][number] for line in evaluated]
        line = Line(
            label="the policy",
            x=[line["decisions"] / 1e6 for line in evaluated],
            y=[one["points"] for one in shown],
            low=[one["points"] - WIDTH_95 * one["standard_error"] for one in shown],
            high=[one["points"] + WIDTH_95 * one["standard_error"] for one in shown],
        )
        panels.append(
            Panel(
                title=f"Against {len(opponents)} {opponents[0]}",
                x_label="decisions of the training, millions",
                y_label="points per Shift",
                lines=[line],
                levels=[mean] if mean else [],
            )
        )
    return Figure(name="curve", title="Training by self-play: evaluations of the policy", panels=panels)


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    origin = "`python -m chefshat.learn ppo` writes next to its network, as .jsonl"
    return plots.draw_file(options.log, "log", origin, figure, options.out, as_json=options.json)
