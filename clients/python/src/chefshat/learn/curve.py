"""The command `curve`: draws the points per Shift at each evaluation of trainings, from the logs that `ppo` and `deep-q` write.

Trainings that differ in nothing but their seed are one line: the interquartile mean of the runs. Agents that do not learn are
horizontal lines: they play the same games.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import NormalDist
from typing import Any

import numpy as np
import numpy.typing as npt
from google.protobuf import json_format

from chefshat import pb
from chefshat.learn import plots
from chefshat.learn.evaluation import evaluate
from chefshat.learn.figures import Figure, Level, Line, Panel
from chefshat.learn.runs import EVALUATION_SEED
from chefshat.learn.training_log import ITSELF, entries

ORIGIN = "`python -m chefshat.learn ppo` writes one next to its network, as .jsonl, and so does `deep-q` of chefshat-paper"
# Half the width of a 95% interval of the normal distribution, in standard deviations.
Z_95 = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True)
class Run:
    """A training.

    Attributes:
        algorithm: what has learned.
        plan: its settings by name, with those of its rules, without the seed.
        seed: its seed; None if the log does not say.
        evaluations: the lines of its evaluations, by ascending decisions. If the training was resumed, those of an interruption and
            those that were made again are left out.
        rules: the rule set; None if the log does not say.
    """

    algorithm: str
    plan: Mapping[str, Any]
    seed: int | None
    evaluations: Sequence[Mapping[str, Any]]
    rules: pb.RuleSet | None

    @property
    def mean(self) -> float | None:
        """The mean points of all seats; None if the log does not say."""
        return None if self.rules is None else sum(self.rules.points) / self.rules.players


def read(log: str) -> Run:
    """Reads a log, JSON lines; leaves out torn ones. Raises ValueError if this is not a log, or if it has no evaluation."""
    lines = entries(log)
    if log and not lines:
        raise ValueError(f"this is not a log; {ORIGIN}")
    evaluated = [line for line in lines if line.get("event") == "evaluation"]
    if not evaluated:
        raise ValueError("the log has no evaluation; did the training end before the first?")
    setup = next((line for line in lines if line.get("event") == "setup"), {})
    rules, plan = setup.get("rules"), dict(setup.get("plan", {}))
    if not plan.get("coalition"):
        # Logs of earlier versions lack this setting.
        plan.pop("coalition", None)
    hyper = plan.pop("hyper", {})
    settings = {**plan, **hyper, **{f"rules {name}": value for name, value in (rules or {}).items()}}
    evaluations: list[Mapping[str, Any]] = []
    for line in evaluated:
        if line.get("stopped") and line is not evaluated[-1]:
            continue
        # A resumed training may have evaluated again what was evaluated after its checkpoint was written.
        while evaluations and evaluations[-1]["decisions"] >= line["decisions"]:
            evaluations.pop()
        evaluations.append(line)
    # Logs of earlier versions do not name the algorithm, and are of `ppo`.
    algorithm = setup.get("algorithm", "ppo")
    known = json_format.ParseDict(rules, pb.RuleSet(), ignore_unknown_fields=True) if rules else None
    return Run(algorithm, settings, setup.get("seed"), evaluations, known)


def figure(runs: Sequence[Run], baselines: Sequence[str] = ()) -> Figure:
    """Returns the points per Shift at each evaluation, over the decisions of the training.

    A line is one training, with 95% intervals of its evaluations; or the runs with the same settings, with the interquartile mean
    and its interval over the runs. `baselines` are built-in agents or network files: they play the games of the evaluations too.
    Without them, the mean of all seats is drawn.

    Raises:
        ValueError: the trainings have not been evaluated alike, two of them are the same run, or a baseline does not fit the games.
        ChefsHatError: the games of a baseline are refused.
        OSError: the file of a baseline cannot be read.
    """
    groups: list[list[Run]] = []
    for run in runs:
        alike = (group for group in groups if (group[0].algorithm, group[0].plan) == (run.algorithm, run.plan))
        group = next(alike, None)
        if group is not None and run.seed is not None and run.seed in [other.seed for other in group]:
            raise ValueError(f"two runs of the same settings have the seed {run.seed}: give each run once, and runs of other seeds")
        groups.append([run]) if group is None else group.append(run)
    opponents = [one["opponents"] for one in runs[0].evaluations[0]["evaluations"]]
    games = [one.get("games") for one in runs[0].evaluations[0]["evaluations"]]
    for run in runs:
        if [one["opponents"] for one in run.evaluations[0]["evaluations"]] != opponents:
            raise ValueError("the trainings were evaluated against different opponents: draw them apart")
        if [one.get("games") for one in run.evaluations[0]["evaluations"]] != games:
            raise ValueError("the trainings were evaluated in different numbers of games: draw them apart")
    most = max(run.evaluations[-1]["decisions"] for run in runs)
    unit, name = (1_000_000, "millions") if most >= 1_000_000 else (1_000, "thousands")
    panels = [
        Panel(
            title=f"Against {len(names)} {names[0]}" if len(set(names)) == 1 else f"Against {', '.join(names)}",
            x_label=f"decisions of the training, {name}",
            y_label="points per Shift",
            lines=[_line(group, number, _label(group, groups), unit) for group in groups],
            levels=_levels(runs, number, baselines),
        )
        for number, names in enumerate(opponents)
    ]
    return Figure(name="curve", title="Trainings: evaluations of the policy", panels=panels)


def _levels(runs: Sequence[Run], number: int, baselines: Sequence[str]) -> list[Level]:
    """Returns the points of the baselines against the opponents with this number, or the mean of all seats."""
    if not baselines:
        means = {run.mean for run in runs}
        return [Level(label="mean of all seats", y=mean) for mean in means if mean is not None and len(means) == 1]
    rules, evaluated = runs[0].rules, runs[0].evaluations[0]["evaluations"][number]
    if rules is None or any(run.rules != rules for run in runs):
        raise ValueError("baselines play by the rules of the trainings, which must all have the same: draw others apart")
    if ITSELF in evaluated["opponents"]:
        raise ValueError("a coalition plays with what it has learned, which no baseline has: leave out --baselines")
    played = [
        evaluate(name, evaluated["opponents"], games=evaluated["games"], seed=EVALUATION_SEED, rules=rules) for name in baselines
    ]
    return [Level(label=name, y=evaluation.points) for name, evaluation in zip(baselines, played, strict=True)]


def _label(group: Sequence[Run], groups: Sequence[Sequence[Run]]) -> str:
    """Names the algorithm, if there are several, and what distinguishes the settings of a group from others of this algorithm."""
    algorithm, plan = group[0].algorithm, group[0].plan
    others = [other[0].plan for other in groups if other[0].algorithm == algorithm]
    differing = [name for name, value in plan.items() if any(other.get(name) != value for other in others)]
    named = [algorithm] if len(others) < len(groups) else []
    label = ", ".join(named + [f"{name} {'none' if plan[name] == '' else plan[name]}" for name in differing]) or "the policy"
    return label if len(group) == 1 else f"{label}: interquartile mean of {len(group)} runs"


def _line(group: Sequence[Run], number: int, label: str, unit: int) -> Line:
    """Returns the line of runs with the same settings against the opponents with this number, over units of decisions."""
    counts = {len(run.evaluations) for run in group}
    if len(counts) > 1:
        raise ValueError(
            f"runs of the same settings have {' and '.join(map(str, sorted(counts)))} evaluations: give them one budget"
        )
    decisions = np.array([[line["decisions"] for line in run.evaluations] for run in group]) / unit
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


def last_points(figure: Figure) -> list[dict[str, Any]]:
    """Returns the points at the end of each line with their interval, and those of each level, as JSON values."""
    return [
        {"panel": panel.title, **found}
        for panel in figure.panels
        for found in (
            *({"label": line.label, "points": line.y[-1], "low": line.low[-1], "high": line.high[-1]} for line in panel.lines),
            *({"label": level.label, "points": level.y} for level in panel.levels),
        )
    ]


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    origin = "`python -m chefshat.learn ppo` writes next to its network, as .jsonl"
    draw = partial(figure, baselines=options.baselines)
    return plots.draw_files(options.logs, "log", origin, read, draw, options.out, summary=last_points, as_json=options.json)
