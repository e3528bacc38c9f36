"""The command `curve`: draws the points per Shift at each evaluation of trainings, from the logs that `ppo` writes.

Trainings that differ in nothing but their seed are one line: the interquartile mean of the runs.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

import numpy as np
import numpy.typing as npt

from chefshat.learn import plots
from chefshat.learn.figures import Figure, Level, Line, Panel

# Half the width of a 95% interval of the normal distribution, in standard deviations.
Z_95 = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True)
class Run:
    """A training.

    Attributes:
        plan: its settings by name, with those of its rules, without the seed.
        seed: its seed; None if the log does not say.
        evaluations: the lines of its evaluations, in order. Those of an interruption are left out if the training was resumed.
        mean: the mean points of all seats; None if the log does not say.
    """

    plan: Mapping[str, Any]
    seed: int | None
    evaluations: Sequence[Mapping[str, Any]]
    mean: float | None


def read(log: str) -> Run:
    """Reads a log, JSON lines. Raises ValueError if this is not a log, or if it has no evaluation."""
    try:
        lines = [dict(json.loads(line)) for line in log.splitlines()]
    except (ValueError, TypeError) as error:
        raise ValueError("this is not a log; `python -m chefshat.learn ppo` writes one next to its network, as .jsonl") from error
    evaluated = [line for line in lines if line.get("event") == "evaluation"]
    if not evaluated:
        raise ValueError("the log has no evaluation; did the training end before the first?")
    setup = next((line for line in lines if line.get("event") == "setup"), {})
    rules, plan = setup.get("rules"), dict(setup.get("plan", {}))
    hyper = plan.pop("hyper", {})
    settings = {**plan, **hyper, **{f"rules {name}": value for name, value in (rules or {}).items()}}
    # A training that was resumed may have evaluated twice at the same place.
    due = [line for line in evaluated if line is evaluated[-1] or not line.get("stopped")]
    evaluations = list({line["decisions"]: line for line in due}.values())
    return Run(settings, setup.get("seed"), evaluations, sum(rules["points"]) / rules["players"] if rules else None)


def figure(runs: Sequence[Run]) -> Figure:
    """Returns the points per Shift at each evaluation, over the decisions of the training.

    A line is one training, with 95% intervals of its evaluations; or the runs with the same settings, with the interquartile mean
    and its interval over the runs. Raises ValueError if they have not been evaluated alike, or if two of them are the same run.
    """
    groups: list[list[Run]] = []
    for run in runs:
        group = next((group for group in groups if group[0].plan == run.plan), None)
        if group is not None and run.seed is not None and run.seed in [other.seed for other in group]:
            raise ValueError(f"two runs of the same settings have the seed {run.seed}: give each run once, and runs of other seeds")
        groups.append([run]) if group is None else group.append(run)
    opponents = [one["opponents"] for one in runs[0].evaluations[0]["evaluations"]]
    for run in runs:
        if [one["opponents"] for one in run.evaluations[0]["evaluations"]] != opponents:
            raise ValueError("the trainings were evaluated against different opponents: draw them apart")
    means = {run.mean for run in runs}
    mean = runs[0].mean if len(means) == 1 else None
    panels = [
        Panel(
            title=f"Against {len(names)} {names[0]}",
            x_label="decisions of the training, millions",
            y_label="points per Shift",
            lines=[_line(group, number, _label(group, groups)) for group in groups],
            levels=[] if mean is None else [Level(label="mean of all seats", y=mean)],
        )
        for number, names in enumerate(opponents)
    ]
    return Figure(name="curve", title="Training by self-play: evaluations of the policy", panels=panels)


def _label(group: Sequence[Run], groups: Sequence[Sequence[Run]]) -> str:
    """Names what distinguishes the settings of a group."""
    plan = group[0].plan
    differing = [name for name, value in plan.items() if any(other[0].plan.get(name) != value for other in groups)]
    label = ", ".join(f"{name} {'none' if plan[name] == '' else plan[name]}" for name in differing) or "the policy"
    return label if len(group) == 1 else f"{label}: interquartile mean of {len(group)} runs"


def _line(group: Sequence[Run], number: int, label: str) -> Line:
    """Returns the line of runs with the same settings against the opponents with this number."""
    counts = {len(run.evaluations) for run in group}
    if len(counts) > 1:
        raise ValueError(
            f"runs of the same settings have {' and '.join(map(str, sorted(counts)))} evaluations: give them one budget"
        )
    decisions = np.array([[line["decisions"] for line in run.evaluations] for run in group]) / 1e6
    shown = [[line["evaluations"][number] for line in run.evaluations] for run in group]
    points = np.array([[one["points"] for one in run] for run in shown])
    if len(group) == 1:
        errors = Z_95 * np.array([one["standard_error"] for one in shown[0]], np.float64)
        middle, low, high = points[0], points[0] - errors, points[0] + errors
    else:
        middle, low, high = np.transpose([interquartile_mean(column) for column in points.T])
    return Line(label, decisions.mean(axis=0).tolist(), middle.tolist(), low.tolist(), high.tolist())


def interquartile_mean(values: npt.NDArray[np.float64]) -> tuple[float, float, float]:
    """Returns the mean of the middle half of the runs, with its 95% interval by bootstrap: Agarwal et al., 2021.

    "Deep reinforcement learning at the edge of the statistical precipice". Of R runs the R//4 best and the R//4 worst are left out.
    The interval has the 2.5th and the 97.5th percentile over 2,000 resamples of the runs, drawn with a fixed seed.

    Args:
        values: (R,) one number for each run, R at least 2.
    """
    runs = len(values)
    if runs < 2:
        raise ValueError("an interquartile mean needs two runs or more")
    resamples = np.random.default_rng(1).integers(runs, size=(2000, runs))
    left_out = runs // 4

    def middle(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.asarray(np.sort(rows, axis=-1)[..., left_out : runs - left_out].mean(axis=-1))

    low, high = np.percentile(middle(values[resamples]), [2.5, 97.5])
    return float(middle(values)), float(low), float(high)


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    origin = "`python -m chefshat.learn ppo` writes next to its network, as .jsonl"
    return plots.draw_files(options.logs, "log", origin, read, figure, options.out, as_json=options.json)
