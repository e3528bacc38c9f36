"""How a training went, as a picture: the points that the policy took at its looks, from the log that `ppo` writes.

The log is written by `ppo_command`; the style of pictures is that of the experiments.
"""

import argparse
import json

from chefshat.errors import failed
from chefshat.experiments import plots
from chefshat.experiments.results import Figure, Level, Line, Panel
from chefshat.files import check_readable, write_whole

# Half the width of a 95% interval, in standard errors.
WIDTH_95 = 1.96


def figure(log: str) -> Figure:
    """The points per Shift at each look, over the decisions of the training, with 95% intervals.

    Args:
        log: the log, JSON lines.

    Raises:
        ValueError: it is no log, or holds no look.
    """
    try:
        lines = [dict(json.loads(line)) for line in log.splitlines()]
    except (ValueError, TypeError) as error:
        raise ValueError("this is no log; `python -m chefshat.learn ppo` writes one beside its network, as .jsonl") from error
    looks = [line for line in lines if line.get("event") == "evaluation"]
    rules = [line["rules"] for line in lines if line.get("event") == "setup"]
    if not looks:
        raise ValueError("the log holds no look at the policy; was the training ended before its first?")
    alike = Level(label="all alike", y=sum(rules[0]["points"]) / rules[0]["players"]) if rules else None
    panels = []
    for number, evaluation in enumerate(looks[0]["evaluations"]):
        opponents = evaluation["opponents"]
        shown = [look["evaluations"][number] for look in looks]
        line = Line(
            label="the policy",
            x=[look["decisions"] / 1e6 for look in looks],
            y=[one["points"] for one in shown],
            low=[one["points"] - WIDTH_95 * one["standard_error"] for one in shown],
            high=[one["points"] + WIDTH_95 * one["standard_error"] for one in shown],
        )
        panels.append(
            Panel(
                title=f"Against {len(opponents)} {opponents[0]}",
                x_label="decisions of the training, millions",
                y_label="points a Shift",
                lines=[line],
                levels=[alike] if alike else [],
            )
        )
    return Figure(name="curve", title="Training by self-play: the policy at its looks", panels=panels)


def run(options: argparse.Namespace) -> int:
    """The command. Returns the exit code."""
    try:
        check_readable(options.log, "log", "`python -m chefshat.learn ppo` writes beside its network, as .jsonl")
        drawn = figure(options.log.read_text(encoding="utf-8"))
        write_whole(options.out, plots.png(drawn))
    except OSError as error:
        return failed(error, as_json=options.json)
    except ValueError as error:
        return failed(ValueError(f"{options.log}: {error}"), as_json=options.json)
    print(json.dumps({"out": str(options.out)}) if options.json else f"wrote {options.out}")
    return 0
