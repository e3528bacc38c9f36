"""Experiment 2: one Deep Q agent learns which actions are legal, against three agents that choose randomly among all 200.

The agent has no mask and the paper's parameters. Its reward is 1 for a legal and -1 for an illegal action, after which it is asked
again, without limit. (This terminates: exploring finds a legal action eventually, and illegal ones become less likely. The maximum
number of attempts at a decision is among the values.) There are three conditions:

- the classic vector, 228 numbers, which include the legal actions. The networks of this one are saved with the results, for
  Experiment 3;
- only the hand and the board, 28 numbers, as the paper's text describes the state;
- the classic vector, where a pass counts as illegal if another action is legal, as in an early public version of the paper's
  environment. Since learning that takes thousands of attempts, a random one of the remaining legal actions is taken after ten
  illegal ones at one decision, as in a later version of that environment.
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
    """A condition: the agent, and whether its passing counts as illegal where another action is legal."""

    agent: DeepQConfig
    idle_pass_is_wrong: bool = False


CONDITIONS: Mapping[str, Condition] = {
    "sees what is legal": Condition(DeepQConfig()),
    "sees hand and board": Condition(DeepQConfig(see_mask=False)),
    "may not pass idly": Condition(DeepQConfig(wrong_limit=10), idle_pass_is_wrong=True),
}
# The condition whose networks Experiment 3 starts with.
FIRST = "sees what is legal"
REWARDS = "validity"
# Characters of the digest of settings: enough to distinguish the files of one folder.
DIGEST_LENGTH = 16


def run(config: Config, progress: Progress) -> Result:
    """Runs all conditions with all seeds."""
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
    """Returns the networks of this experiment, one for each seed.

    Reads the files in the folder, if they were learned with these seeds and settings and by this version; otherwise learns them.
    """
    digest = _digest(config)
    read = []
    for seed in config.seeds:
        try:
            saved = network.load(_file(config.out, seed))
        except (OSError, NetworkFileError):
            break
        if saved.info.trained_by != _trained_by(config, seed, digest):
            break
        read.append(saved)
    else:
        return checkpoint.stacked(CONDITIONS[FIRST].agent, read)
    learned = _learn(config, progress, FIRST)
    _keep(config, learned)
    return learned.agents.online


def _settings(config: Config, name: str) -> dict[str, object]:
    """Returns the settings of a condition as JSON values."""
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
        trained = training.networks(f"deep-q-rules-{seed}")[number]
        network.save(_file(config.out, seed), trained.layers, trained.info)


def _file(folder: Path, seed: int) -> Path:
    return folder / f"rules-seed-{seed}.safetensors"


def _digest(config: Config) -> str:
    """Hashes everything but the seed that determines a saved network: settings and versions."""
    with chefshat.Client(config.address) as client:
        server_version = client.server_info().server_version
    causes = {
        **_settings(config, FIRST),
        "rules": learning.RULES,
        "rewards": REWARDS,
        "seat": LEARNER,
        "package_version": importlib.metadata.version("chefshat"),
        "server_version": server_version,
    }
    return hashlib.sha256(json.dumps(causes, sort_keys=True).encode()).hexdigest()[:DIGEST_LENGTH]


def _trained_by(config: Config, seed: int, digest: str) -> str:
    """Returns the command that reproduces the network of a seed, with the digest of its settings."""
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
            "the learner's wrong actions, as a share of a random agent's",
            Estimate(paper.RULES_WRONG_ACTIONS_RATIO, percent=True, digits=0),
            {n: compared(each) for n, each in learned.items()},
        ),
        row(
            f"passes of the learner, as a share of its turns, last {width}",
            None,
            {n: stats.spread(each.share_of_turns("passes", LEARNER, end), percent=True) for n, each in learned.items()},
        ),
    ]
    return Table(
        name="actions",
        title=f"Experiment 2: rewards and wrong actions in {learning.shifts_of(config)} Shifts",
        columns=["", "paper", *learned],
        rows=rows,
        note=f"Means over {len(config.seeds)} seeds; in brackets: minimum and maximum. The mean reward is per action in a "
        "Shift, averaged over Shifts; the paper prints wrong actions as “almost half”.",
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
        note="Means over the seeds; in brackets: minimum and maximum. The paper speaks of 100 simulations here; its numbers add "
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
