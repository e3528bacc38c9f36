"""The log of a training: JSON lines of its setup and of its evaluations, which `curve` draws.

All algorithms write the same lines through the logger `chefshat.learn`. They are evaluated alike: greedily, on the same deals.
"""

import contextlib
import dataclasses
import json
import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from google.protobuf import json_format

from chefshat import pb
from chefshat.address import ServerAddress
from chefshat.learn import runs
from chefshat.learn.evaluation import Evaluation, OneOpponent, evaluate
from chefshat.learn.network import Network

LOG = logging.getLogger("chefshat.learn")
# Whom every training is evaluated against.
OPPONENTS = ("greedy", "random")
#: The name of the partner among the opponents of a coalition: what has been learned so far.
ITSELF = "itself"


@dataclass(frozen=True)
class Progress:
    """The progress of a training.

    Attributes:
        updates: updates so far.
        decisions: decisions taken among several legal actions, on all seats that learn.
        seconds: seconds of training, evaluations included.
        runs: times it was started or resumed.
    """

    updates: int = 0
    decisions: int = 0
    seconds: float = 0.0
    runs: int = 0


@contextlib.contextmanager
def written(path: Path, *, append: bool) -> Iterator[None]:
    """Writes the messages of the logger `chefshat.learn` to a file."""
    if append:
        _end_last_line(path)
    level, handler = LOG.level, logging.FileHandler(path, "a" if append else "w", encoding="utf-8")
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    try:
        yield
    finally:
        LOG.setLevel(level)
        LOG.removeHandler(handler)
        handler.close()


def _end_last_line(path: Path) -> None:
    """Ends the last line of a file if it is torn, so that what is appended does not become part of it."""
    text = path.read_bytes() if path.exists() else b""
    if text and not text.endswith(b"\n"):
        with path.open("ab") as file:
            file.write(b"\n")


def log_setup(algorithm: str, plan: Mapping[str, Any], seed: int, rules: pb.RuleSet, trained_by: str) -> None:
    """Logs the settings of a training. Those that follow from the algorithm are in `plan["hyper"]`."""
    setup = {
        "algorithm": algorithm,
        "plan": plan,
        "seed": seed,
        "rules": json_format.MessageToDict(rules),
        "trained_by": trained_by,
    }
    LOG.info(json.dumps({"event": "setup", **setup}))


def log_evaluations(
    progress: Progress, evaluations: Sequence[Evaluation], losses: Mapping[str, float], *, stopped: bool = False
) -> None:
    """Logs evaluations. `stopped`: they are made since Ctrl-C was pressed, not since they were due."""
    line = {"event": "evaluation", **summary(progress, evaluations), "losses": losses}
    LOG.info(json.dumps({**line, "stopped": True} if stopped else line))


def summary(progress: Progress, evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """Returns the progress by name, and the evaluations, as JSON values."""
    return {**dataclasses.asdict(progress), "evaluations": [evaluation.to_json() for evaluation in evaluations]}


def evaluate_all(
    network: Network,
    games: int,
    rules: pb.RuleSet,
    address: str | ServerAddress | None,
    *,
    further: Sequence[OneOpponent] = (),
) -> list[Evaluation]:
    """Plays a network greedily on seat 0 against each of `OPPONENTS`, on the same deals every time.

    Args:
        network: what the training has learned.
        games: games against each of them.
        rules: the rule set.
        address: where the games are played; see `VectorEnv`.
        further: one more table of opponents, one for all seats or one for each; empty: none.
    """
    tables: list[tuple[OneOpponent, ...]] = [(name,) for name in OPPONENTS]
    if further and tuple(further) not in tables:
        tables.append(tuple(further))
    return [
        evaluate(network, opponents, games=games, seed=runs.EVALUATION_SEED, rules=rules, address=address) for opponents in tables
    ]


def entries(log: str) -> list[dict[str, Any]]:
    """Returns the lines of a log. Leaves out what is no JSON object: a full disk or the end of the process tears a line."""
    found = []
    for line in log.splitlines():
        with contextlib.suppress(ValueError):
            found.append(json.loads(line))
    return [entry for entry in found if isinstance(entry, dict)]


def last_evaluated(log: Path) -> int | None:
    """Returns the decisions before the last evaluation of a log; None if there is none."""
    lines = entries(log.read_text(encoding="utf-8")) if log.exists() else []
    found = [line for line in lines if line.get("event") == "evaluation"]
    return int(found[-1]["decisions"]) if found else None


def next_evaluation(done: float, evaluations: int) -> float:
    """Returns the share of the budget at the next evaluation, which is the same in a training that was not interrupted."""
    before = int(done * evaluations)
    return next(share for share in (number / evaluations for number in range(before, before + 3)) if share > done)
