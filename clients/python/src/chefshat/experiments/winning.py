"""Experiment 3: agents that know the rules learn to win, one against three random agents, and four against each other.

Every agent starts with the network of Experiment 2 for its seed. Memory, optimiser and exploration are new, because the rewards
differ. The paper defines a reward for illegal actions in this experiment, too, and its discussion says that the agents could not be
kept from them: so its agents choose among all 200 actions, and so does our first one. But under the printed reward such an agent
unlearns the rules (every state is worth less than the lowest tanh output, and so is every illegal action) and would spend thousands
of attempts in a Shift: after `WRONG_LIMIT` illegal actions at one decision it takes a random legal one, as the environment
published with the paper does for it. The second agent is the same with a mask.

The reward is used as printed (`paper`) and with the share of cards shed, which it seems to mean (`paper_intended`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from chefshat.experiments import learning, paper, rules, stats
from chefshat.experiments.learning import Learned
from chefshat.experiments.progress import Progress
from chefshat.experiments.results import Cell, Config, Estimate, Figure, Level, Line, Panel, Result, Table
from chefshat.learn.deep_q import DeepQConfig

WRONG_LIMIT = 10
ALL_SEATS = (0, 1, 2, 3)
LEARNER = rules.LEARNER
AGENTS: Mapping[str, DeepQConfig] = {
    "no mask": DeepQConfig(wrong_limit=WRONG_LIMIT),
    "mask": DeepQConfig(mask=True),
}
REWARDS = ("paper", "paper_intended")
# Window of the running means of victories, in Shifts.
SMOOTHED = 25


@dataclass(frozen=True)
class Condition:
    """A condition: the agent, the reward scheme, and whether four of them learn or one."""

    agent: str
    rewards: str
    four: bool

    @property
    def name(self) -> str:
        """Name, without the number of agents."""
        return f"{self.agent}, {self.rewards}"

    @property
    def seats(self) -> tuple[int, ...]:
        """Seats of the learning agents."""
        return ALL_SEATS if self.four else (LEARNER,)


ONE = tuple(Condition(agent, rewards, four=False) for agent in AGENTS for rewards in REWARDS)
# Omits four agents without a mask under `paper_intended`, which rewards every turn: they only learn to draw a Shift out, to some
# 800 turns.
FOUR = tuple(Condition(*names, four=True) for names in (("no mask", "paper"), ("mask", "paper"), ("mask", "paper_intended")))


def run(config: Config, progress: Progress) -> Result:
    """Runs all conditions with all seeds."""
    begin_with = rules.networks(config, progress)
    learned = {
        condition: learning.learn(
            config,
            progress,
            f"winning, {'four' if condition.four else 'one'}, {condition.name}",
            agent=AGENTS[condition.agent],
            rewards=condition.rewards,
            seats=condition.seats,
            begin_with=begin_with,
        )
        for condition in (*ONE, *FOUR)
    }
    return Result(
        experiment="winning",
        title="Experiment 3: learning to win",
        seeds=list(config.seeds),
        quick=config.quick,
        settings={name: learning.settings(config, agent) for name, agent in AGENTS.items()},
        rules={"all": learning.rules_json(learned[ONE[0]].played)},
        tables=[_one(config, learned), _four(config, learned), _behaviour(config, learned)],
        figures=[_figure_of_one(learned), _figure_of_four(learned)],
        values={_key(condition): _values(config, each) for condition, each in learned.items()},
    )


def _one(config: Config, learned: Mapping[Condition, Learned]) -> Table:
    after = slice(min(paper.WINNING_ALL_WON_AFTER, learning.shifts_of(config) // 2), None)

    def share(each: Learned, shifts: slice) -> Estimate:
        return stats.spread([float(won) for won in each.won[:, shifts, LEARNER].mean(axis=1)], percent=True, digits=0)

    printed: list[Cell] = [
        learning.of_all(config, "the 2020 paper"),
        paper.WINNING_WINS_LEARNER,
        None,
        Estimate(1.0, percent=True, digits=0),
        None,
        None,
    ]
    rows = [printed]
    for condition in ONE:
        each = learned[condition]
        randoms = np.mean([each.wins(seat) for seat in rules.RANDOM], axis=0).tolist()
        rows.append(
            [
                condition.name,
                learning.count(config, each.wins(LEARNER)),
                learning.count(config, randoms),
                share(each, after),
                share(each, learning.last(config)),
                stats.spread(each.starter_wins(), percent=True, digits=0),
            ]
        )
    return Table(
        name="one",
        title=f"Experiment 3: one learner against three random agents, {learning.shifts_of(config)} Shifts",
        columns=[
            "agent, reward",
            "Shifts won by the learner",
            "by a random agent",
            "won after the first" if after.start == 1 else f"won after the {after.start}th",
            "in the last one" if learning.window(config) == 1 else f"in the last {learning.window(config)}",
            "starter wins",
        ],
        rows=rows,
        note=f"Means over {len(config.seeds)} seeds; in brackets: minimum and maximum. “By a random agent” is the mean of three.",
    )


def _four(config: Config, learned: Mapping[Condition, Learned]) -> Table:
    ranked = sorted(paper.WINNING_WINS_FOUR, reverse=True)
    printed: list[Cell] = [
        learning.of_all(config, "the 2020 paper"),
        *paper.WINNING_WINS_FOUR,
        ranked[0],
        ranked[-1],
        Estimate(paper.WINNING_STARTER_WINS, percent=True, digits=0),
    ]
    rows = [printed]
    for condition in FOUR:
        each = learned[condition]
        wins = np.array([each.wins(seat) for seat in ALL_SEATS])
        rows.append(
            [
                condition.name,
                *(learning.count(config, each.wins(seat)) for seat in ALL_SEATS),
                learning.count(config, wins.max(axis=0).tolist()),
                learning.count(config, wins.min(axis=0).tolist()),
                stats.spread(each.starter_wins(), percent=True, digits=0),
            ]
        )
    return Table(
        name="four",
        title=f"Experiment 3: four learners, Shifts won of {learning.shifts_of(config)}",
        columns=["agents, reward", *(f"seat {seat + 1}" for seat in ALL_SEATS), "best seat", "last seat", "starter wins"],
        rows=rows,
        note="Means over the seeds; in brackets: minimum and maximum. The seats differ only by chance; “best” and “last” "
        "are determined for each seed. The paper's 30% is that of random agents.",
    )


def _behaviour(config: Config, learned: Mapping[Condition, Learned]) -> Table:
    end = learning.last(config)
    rows: list[list[Cell]] = []
    for condition, each in learned.items():
        seats = condition.seats

        def mean(values: list[list[float]]) -> list[float]:
            return [float(value) for value in np.mean(values, axis=0)]

        rows.append(
            [
                "four" if condition.four else "one",
                condition.name,
                stats.spread(mean([each.mean_reward(seat, end) for seat in seats]), digits=2),
                stats.spread(mean([each.mean_wrong(seat, end) for seat in seats])),
                stats.spread(mean([each.share_of_turns("passes", seat, end) for seat in seats]), percent=True, digits=0),
                stats.spread([float(turns) for turns in each.played.of_shifts["turns"][:, end].mean(axis=1)], digits=0),
            ]
        )
    return Table(
        name="behaviour",
        title=f"Experiment 3: behaviour of the learners in the last {learning.in_words(learning.window(config))}",
        columns=["learners", "agent, reward", "mean reward", "wrong actions per Shift", "passes, of turns", "turns of a Shift"],
        rows=rows,
        note="Means over the learners and the seeds; in brackets: minimum and maximum of the seeds. Mean rewards of the two "
        "schemes cannot be compared.",
    )


def _figure_of_one(learned: Mapping[Condition, Learned]) -> Figure:
    wins = [_share_won(condition.name, learned[condition].won[:, :, LEARNER]) for condition in ONE]
    levels = [Level("by chance", 25), Level("paper, all 250", 100 * paper.WINNING_WINS_LEARNER / paper.SHIFTS)]
    panels = [Panel("Shifts won by the learner", "Shift", "share (%)", lines=wins, levels=levels, y_range=(-3, 103))]
    for rewards in REWARDS:
        lines = []
        for condition in ONE:
            if condition.rewards == rewards:
                of_seats = learned[condition].rewards()
                lines.append(learning.curve(f"learner, {condition.agent}", of_seats[:, :, LEARNER]))
        lines.append(learning.curve("random agents", of_seats[:, :, 1:].mean(axis=2)))
        panels.append(Panel(f"Mean reward, {rewards}", "Shift", "reward of an action", lines=lines))
    return Figure(
        name="one",
        title=f"One learner against three random agents: means of {SMOOTHED} Shifts (rewards: {learning.SMOOTHED}), all seeds",
        panels=panels,
        columns=3,
    )


def _figure_of_four(learned: Mapping[Condition, Learned]) -> Figure:
    panels = []
    for condition in FOUR:
        won = learned[condition].won
        # By seed: the seat with most victories first.
        order = np.argsort(-won.sum(axis=1), axis=1)
        ranked = np.take_along_axis(won, order[:, np.newaxis, :], axis=2)
        names = ("seat with most victories", "second", "third", "seat with fewest")
        lines = [_share_won(name, ranked[:, :, place]) for place, name in enumerate(names)]
        panels.append(
            Panel(condition.name, "Shift", "Shifts won (%)", lines=lines, levels=[Level("by chance", 25)], y_range=(-3, 103))
        )
    return Figure(
        name="four", title=f"Four learners: Shifts won, means of {SMOOTHED} Shifts, all seeds", panels=panels, columns=len(panels)
    )


def _share_won(label: str, won: npt.NDArray[np.bool_]) -> Line:
    """Returns a line over Shifts: `won` is (G, S)."""
    return stats.band(label, list(range(1, won.shape[1] + 1)), 100 * stats.smooth(won, SMOOTHED))


def _key(condition: Condition) -> str:
    return f"{'four' if condition.four else 'one'}, {condition.name}"


def _values(config: Config, learned: Learned) -> dict[str, object]:
    return {
        "wins": {str(seed): wins for seed, wins in zip(config.seeds, learned.won.sum(axis=1).tolist(), strict=True)},
        "starter_wins": learning.by_seed(config, learned.starter_wins()),
        "most_attempts_at_a_decision": learned.played.most_attempts,
    }
