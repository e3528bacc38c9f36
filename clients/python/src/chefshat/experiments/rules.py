"""Experiment 2: one Deep Q agent learns what is allowed, against three agents that choose among all 200 actions by chance.

The agent has no mask and the paper's parameters; it is rewarded with 1 for a valid and -1 for a wrong action, and asked again after
a wrong one without limit. (It always ends: exploring finds a legal action sooner or later, and every wrong one becomes less likely.
The most attempts that a decision took are among the values.) It is done three times:

- with the classic vector, 228 numbers, which tells the agent what is legal. The networks of this one are kept in the folder of the
  results, where Experiment 3 begins with them;
- with the hand and the board alone, 28 numbers, which is how the paper's text describes the state;
- with the classic vector, while a pass counts as a wrong action wherever something else is legal, as it does in an early public
  version of the paper's environment. Since that alone takes thousands of attempts until it is learned, one of the actions that
  are not wrong is taken by chance after ten wrong ones at one decision, as a later version of that environment does.
"""

import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import chefshat
from chefshat.experiments import learning, paper, stats
from chefshat.experiments.learning import Learned
from chefshat.experiments.progress import Progress
from chefshat.experiments.results import Cell, Config, Estimate, Figure, Level, Panel, Result, Table
from chefshat.learn import checkpoint, network
from chefshat.learn.checkpoint import Training
from chefshat.learn.deep_q import DeepQConfig
from chefshat.learn.mlp import Params
from chefshat.learn.network import NetworkFileError

# The learning agent's seat; the paper calls it Player 1.
LEARNER = 0
RANDOM = (1, 2, 3)


@dataclass(frozen=True)
class Condition:
    """One way of learning the rules: the agent, and whether its passing is wrong where something else is legal."""

    agent: DeepQConfig
    idle_pass_is_wrong: bool = False


CONDITIONS: Mapping[str, Condition] = {
    "sees what is legal": Condition(DeepQConfig()),
    "sees hand and board": Condition(DeepQConfig(see_mask=False)),
    "may not pass idly": Condition(DeepQConfig(wrong_limit=10), idle_pass_is_wrong=True),
}
# The one that Experiment 3 goes on with.
FIRST = "sees what is legal"
REWARDS = "validity"
# Characters of the digest of settings: more than enough to tell apart what lies in one folder.
DIGEST_LENGTH = 16


def run(config: Config, progress: Progress) -> Result:
    """Lets the agents of all conditions learn, with all seeds."""
    learned = {name: _learn(config, progress, name) for name in CONDITIONS}
    _keep(config, learned[FIRST])
    return Result(
        experiment="rules",
        title="Experiment 2: learning the rules",
        seeds=list(config.seeds),
        quick=config.quick,
        settings={name: _settings(config, name) for name in CONDITIONS},
        rules={name: learning.rules_json(each.played) for name, each in learned.items()},
        tables=[_actions(config, learned), _victories(config, learned)],
        figures=[_figure(learned)],
        values={name: _values(config, each) for name, each in learned.items()},
    )


def networks(config: Config, progress: Progress) -> Params:
    """The networks of this experiment, one for each seed.

    Those in the folder, if they were learned with these seeds and settings and by this version; else they are learned now.
    """
    digest = _digest(config)
    read = []
    for seed in config.seeds:
        try:
            kept = network.load(_file(config.out, seed))
        except (OSError, NetworkFileError):
            break
        if kept.info.trained_by != _trained_by(config, seed, digest):
            break
        read.append(kept)
    else:
        return checkpoint.stacked(CONDITIONS[FIRST].agent, read)
    learned = _learn(config, progress, FIRST)
    _keep(config, learned)
    return learned.agents.online


def _settings(config: Config, name: str) -> dict[str, object]:
    """How a condition is learned, as plain values."""
    condition = CONDITIONS[name]
    return {**learning.settings(config, condition.agent), "idle_pass_is_wrong": condition.idle_pass_is_wrong}


def _learn(config: Config, progress: Progress, name: str) -> Learned:
    condition = CONDITIONS[name]
    return learning.learn(
        config,
        progress,
        f"rules, {name}",
        agent=condition.agent,
        rewards=REWARDS,
        seats=[LEARNER],
        idle_pass_is_wrong=condition.idle_pass_is_wrong,
    )


def _keep(config: Config, learned: Learned) -> None:
    """Writes the network of every seed."""
    digest = _digest(config)
    for number, seed in enumerate(config.seeds):
        training = Training(CONDITIONS[FIRST].agent, learned.agents, learned.played.rules, _trained_by(config, seed, digest))
        kept = training.networks(f"deep-q-rules-{seed}")[number]
        network.save(_file(config.out, seed), kept.layers, kept.info)


def _file(folder: Path, seed: int) -> Path:
    return folder / f"rules-seed-{seed}.safetensors"


def _digest(config: Config) -> str:
    """Of everything but its seed that a kept network follows from: settings and versions. Others make another network."""
    with chefshat.Client(config.address) as client:
        server_version = client.server_info().server_version
    made_by = {
        **_settings(config, FIRST),
        "rules": learning.RULES,
        "rewards": REWARDS,
        "seat": LEARNER,
        "package_version": importlib.metadata.version("chefshat"),
        "server_version": server_version,
    }
    return hashlib.sha256(json.dumps(made_by, sort_keys=True).encode()).hexdigest()[:DIGEST_LENGTH]


def _trained_by(config: Config, seed: int, digest: str) -> str:
    """The command that makes the network of a seed again, and what it was made with."""
    quick = " --quick" if config.quick else ""
    return f"python -m chefshat.experiments rules --seed {seed} --seeds 1{quick}  # settings {digest}"


def _actions(config: Config, learned: Mapping[str, Learned]) -> Table:
    begin, end, width = learning.first(config), learning.last(config), learning.in_words(learning.window(config))

    def best_random(each: Learned) -> Estimate:
        return stats.spread(np.max([each.mean_reward(seat) for seat in RANDOM], axis=0).tolist(), digits=2)

    def wrong_of_random(each: Learned) -> list[float]:
        return [float(mean) for mean in np.mean([each.mean_wrong(seat) for seat in RANDOM], axis=0)]

    def compared(each: Learned) -> Estimate:
        pairs = zip(each.mean_wrong(LEARNER), wrong_of_random(each), strict=True)
        return stats.spread([mine / theirs for mine, theirs in pairs], percent=True, digits=1)

    def reward(each: Learned, shifts: slice) -> Estimate:
        return stats.spread(each.mean_reward(LEARNER, shifts), digits=2)

    def row(what: str, printed: Cell, cells: Mapping[str, Cell]) -> list[Cell]:
        return [what, printed, *(cells[name] for name in learned)]

    rows = [
        row(
            "mean reward of the learner", paper.RULES_REWARD_LEARNER, {n: reward(each, slice(None)) for n, each in learned.items()}
        ),
        row(f"… in the first {width}", None, {n: reward(each, begin) for n, each in learned.items()}),
        row(f"… in the last {width}", None, {n: reward(each, end) for n, each in learned.items()}),
        row(
            "mean reward of the best random agent", paper.RULES_REWARD_BEST_RANDOM, {n: best_random(e) for n, e in learned.items()}
        ),
        row(
            "wrong actions of the learner, per Shift",
            None,
            {n: stats.spread(each.mean_wrong(LEARNER)) for n, each in learned.items()},
        ),
        row(
            f"… in the last {width}",
            None,
            {n: stats.spread(each.mean_wrong(LEARNER, end)) for n, each in learned.items()},
        ),
        row(
            "wrong actions of a random agent, per Shift",
            None,
            {n: stats.spread(wrong_of_random(each), digits=0) for n, each in learned.items()},
        ),
        row(
            "the learner's wrong actions, of a random agent's",
            Estimate(paper.RULES_WRONG_ACTIONS_RATIO, percent=True, digits=0),
            {n: compared(each) for n, each in learned.items()},
        ),
        row(
            f"passes of the learner, of its turns, last {width}",
            None,
            {n: stats.spread(each.share_of_turns("passes", LEARNER, end), percent=True) for n, each in learned.items()},
        ),
    ]
    return Table(
        name="actions",
        title=f"Experiment 2: rewards and wrong actions in {learning.shifts_of(config)} Shifts",
        columns=["", "paper", *learned],
        rows=rows,
        note=f"Means over {len(config.seeds)} seeds, in brackets the least and the most of them. The mean reward is that of an "
        "action in a Shift, averaged over Shifts; the paper prints wrong actions as “almost half”.",
    )


def _victories(config: Config, learned: Mapping[str, Learned]) -> Table:
    rows: list[list[Cell]] = [
        [
            f"seat {seat + 1}, {'the learner' if seat == LEARNER else 'random'}",
            printed,
            *(learning.count(config, each.wins(seat)) for each in learned.values()),
        ]
        for seat, printed in enumerate(paper.RULES_WINS)
    ]
    return Table(
        name="victories",
        title=f"Experiment 2: Shifts won of {learning.shifts_of(config)}",
        columns=["", learning.of_all(config, "paper"), *learned],
        rows=rows,
        note="Means over the seeds, in brackets the least and the most. The paper speaks of 100 simulations here; its numbers add "
        "up to 250.",
    )


def _figure(learned: Mapping[str, Learned]) -> Figure:
    panels = []
    for name, each in learned.items():
        rewards, wrong = each.rewards(), each.wrong()
        lines = [
            learning.curve("the learner", rewards[:, :, LEARNER]),
            learning.curve("random agents", rewards[:, :, 1:].mean(axis=2)),
        ]
        levels = [Level("paper, learner", paper.RULES_REWARD_LEARNER), Level("paper, best random", paper.RULES_REWARD_BEST_RANDOM)]
        panels.append(
            Panel(f"Mean reward; {name}", "Shift", "reward of an action", lines=lines, levels=levels, y_range=(-1.05, 1.05))
        )
        turns = each.attempts() - wrong
        shares = [learning.curve("the learner", (wrong / turns)[:, :, LEARNER])]
        panels.append(Panel(f"Wrong actions; {name}", "Shift", "wrong actions per turn", lines=shares))
    return Figure(
        name="learning",
        title=f"One agent learns the rules: means of {learning.SMOOTHED} Shifts, all seeds with the least and the most",
        panels=panels,
    )


def _values(config: Config, learned: Learned) -> dict[str, object]:
    return {
        "wins": {str(seed): wins for seed, wins in zip(config.seeds, learned.won.sum(axis=1).tolist(), strict=True)},
        "mean_reward": learning.by_seed(config, learned.mean_reward(LEARNER)),
        "wrong_per_shift": learning.by_seed(config, learned.mean_wrong(LEARNER)),
        "most_attempts_at_a_decision": learned.played.most_attempts,
        "starter_wins": learning.by_seed(config, learned.starter_wins()),
    }
