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

Agents that do not learn play in the same setting, see `baselines`. Four that never pass idly show what the third condition would be
like if all four seats obeyed its rule.
"""

import hashlib
import importlib.metadata
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import chefshat
import numpy as np
from chefshat.learn import network
from chefshat.learn.figures import Figure, Level, Panel
from chefshat.learn.mlp import Params
from chefshat.learn.network import NetworkFileError

from chefshat_paper.experiments import baselines, learning, paper
from chefshat_paper.experiments.learning import Counts, Learned
from chefshat_paper.experiments.progress import Progress
from chefshat_paper.experiments.results import Cell, Config, Estimate, Result, Table
from chefshat_paper.learn import checkpoint
from chefshat_paper.learn.checkpoint import Training
from chefshat_paper.learn.deep_q import DeepQConfig

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
# The row of four agents that do not learn.
FOUR = "four that never pass idly"
PAPER = "the 2020 paper"
# The condition whose networks Experiment 3 starts with.
FIRST = "sees what is legal"
REWARDS = "validity"
# Characters of the digest of settings: enough to distinguish the files of one folder.
DIGEST_LENGTH = 16


def run(config: Config, progress: Progress) -> Result:
    """Runs all conditions with all seeds, and the agents that do not learn."""
    learned = {name: _learn(config, progress, name) for name in CONDITIONS}
    _keep(config, learned[FIRST])
    others = {name: baselines.play(config, progress, name, rewards=REWARDS, seats=[LEARNER]) for name in baselines.POLICIES}
    four = baselines.play(config, progress, baselines.NEVER_IDLE, rewards=REWARDS, seats=[LEARNER, *RANDOM])
    rows: Mapping[str, Counts] = {**learned, **others}
    return Result(
        experiment="rules",
        title="Experiment 2: learning the rules",
        seeds=list(config.seeds),
        quick=config.quick,
        settings={name: _settings(config, name) for name in CONDITIONS},
        rules={name: learning.rules_json(each.played) for name, each in learned.items()},
        tables=[_rewards(config, rows), _actions(config, rows), _victories(config, {**rows, FOUR: four})],
        figures=[_figure(learned)],
        values={
            **{name: _values(config, each) for name, each in learned.items()},
            **{name: baselines.values(config, each) for name, each in {**others, FOUR: four}.items()},
        },
    )


def networks(config: Config, progress: Progress) -> Params:
    """Returns the networks of this experiment, one for each seed.

    Reads the files in the folder, if they were learned with these seeds and settings and by this version; otherwise learns them.
    """
    digest = _digest(config)
    read = []
    for seed in config.seeds:
        try:
            saved = network.load(_file(config, seed))
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
        network.save(_file(config, seed), trained.layers, trained.info)


def _file(config: Config, seed: int) -> Path:
    """Returns the path of a network. Those of a quick run never replace those of a full one, which took hours."""
    return config.out / f"rules{'-quick' if config.quick else ''}-seed-{seed}.safetensors"


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
    return f"python -m chefshat_paper.experiments rules --seed {seed} --seeds 1{quick}  # settings {digest}"


def _rewards(config: Config, agents: Mapping[str, Counts]) -> Table:
    width = learning.in_words(learning.window(config))

    def mean(counts: Counts, shifts: slice = slice(None)) -> Estimate:
        return counts.estimate(counts.mean_reward(LEARNER, shifts), digits=2)

    def best_random(counts: Counts) -> Estimate:
        return counts.estimate(np.max([counts.mean_reward(seat) for seat in RANDOM], axis=0).tolist(), digits=2)

    rows: list[list[Cell]] = [[PAPER, paper.RULES_REWARD_LEARNER, None, None, paper.RULES_REWARD_BEST_RANDOM]]
    rows += [
        [name, mean(each), mean(each, learning.first(config)), mean(each, learning.last(config)), best_random(each)]
        for name, each in agents.items()
    ]
    return Table(
        name="rewards",
        title=f"Experiment 2: mean reward of an action in {learning.shifts_of(config)} Shifts",
        columns=["agent of seat 1", "its mean reward", f"in the first {width}", f"in the last {width}", "of the best random agent"],
        rows=rows,
        note="The mean reward is per action in a Shift, averaged over Shifts. "
        f"{learning.note(config)} {baselines.note(config, agents.values())}",
    )


def _actions(config: Config, agents: Mapping[str, Counts]) -> Table:
    end, width = learning.last(config), learning.in_words(learning.window(config))

    def wrong_of_random(counts: Counts) -> list[float]:
        return [float(mean) for mean in np.mean([counts.mean_wrong(seat) for seat in RANDOM], axis=0)]

    def compared(counts: Counts) -> Estimate:
        pairs = zip(counts.mean_wrong(LEARNER), wrong_of_random(counts), strict=True)
        return counts.estimate([mine / theirs for mine, theirs in pairs], percent=True)

    share: Cell = Estimate(paper.RULES_WRONG_ACTIONS_RATIO, percent=True, digits=0)
    rows: list[list[Cell]] = [[PAPER, None, None, None, share, None]]
    rows += [
        [
            name,
            each.estimate(each.mean_wrong(LEARNER)),
            each.estimate(each.mean_wrong(LEARNER, end)),
            each.estimate(wrong_of_random(each), digits=0),
            compared(each),
            each.estimate(each.share_of_turns("passes", LEARNER, end), percent=True),
        ]
        for name, each in agents.items()
    ]
    return Table(
        name="actions",
        title=f"Experiment 2: wrong actions and passes in {learning.shifts_of(config)} Shifts",
        columns=[
            "agent of seat 1",
            "its wrong actions per Shift",
            f"in the last {width}",
            "of a random agent",
            "its share of those",
            f"its passes, of turns, last {width}",
        ],
        rows=rows,
        note="The paper prints wrong actions as “almost half” of a random agent's.",
    )


def _victories(config: Config, agents: Mapping[str, Counts]) -> Table:
    rows: list[list[Cell]] = [[learning.of_all(config, PAPER), *paper.RULES_WINS]]
    rows += [
        [name, *(learning.count(config, each, each.wins(seat)) for seat in (LEARNER, *RANDOM))] for name, each in agents.items()
    ]
    return Table(
        name="victories",
        title=f"Experiment 2: Shifts won of {learning.shifts_of(config)}",
        columns=["agent of seat 1", "seat 1", "seat 2, random", "seat 3, random", "seat 4, random"],
        rows=rows,
        note=f"In the row “{FOUR}” the other seats have that agent, too. The paper speaks of 100 simulations here; its numbers add "
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
