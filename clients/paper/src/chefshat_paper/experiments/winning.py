"""Experiment 3: agents that know the rules learn to win, one against three random agents, and four against each other.

Every agent starts with the network of Experiment 2 for its seed, unless the condition says otherwise. Memory, optimiser and
exploration are new, because the rewards differ. The paper defines a reward for illegal actions in this experiment, too, and its
discussion says that the agents could not be kept from them: so its agents choose among all 200 actions, and so does our first one.
But under the printed reward such an agent unlearns the rules (every state is worth less than the lowest tanh output, and so is
every illegal action) and would spend thousands of attempts in a Shift: after `WRONG_LIMIT` illegal actions at one decision it takes
a random legal one, as the environment published with the paper does for it. The second agent is the same with a mask. It plays with
a new network, too: that of Experiment 2 values passing so highly that its tanh is flat there, and a masked agent, which lacks the
large errors of illegal actions, hardly unlearns it.

The reward is used as printed (`paper`), with the share of cards shed, which it seems to mean (`paper_intended`), and as the paper's
program seems to have had it (`program`).

A learner decides only at turns: in the exchange it gives by default, while the random agents give at random, which alone changes
how often it wins. So one learner plays again with random gifts, and agents that do not learn play with both (see `baselines`).
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from chefshat.learn.figures import Figure, Level, Line, Panel
from chefshat.transitions import RewardFunction, Transitions

from chefshat_paper.experiments import baselines, learning, paper, rules, stats
from chefshat_paper.experiments.learning import Counts, Learned
from chefshat_paper.experiments.progress import Progress
from chefshat_paper.experiments.results import Cell, Config, Estimate, Result, Table
from chefshat_paper.learn.deep_q import DeepQConfig

WRONG_LIMIT = 10
ALL_SEATS = (0, 1, 2, 3)
# The rewards that the paper's program seems to have used: for a play, times the share of cards discarded so far; ...
PROGRAM_PLAY = 0.7
# ... for a pass if a play was legal, and for another one; for finishing first, and for another place; for an illegal action.
PROGRAM_IDLE_PASS, PROGRAM_PASS = -0.5, 0.01
PROGRAM_FIRST, PROGRAM_OTHER = 1.0, -0.01
PROGRAM_ILLEGAL = -1.0
LEARNER = rules.LEARNER
AGENTS: Mapping[str, DeepQConfig] = {
    "no mask": DeepQConfig(wrong_limit=WRONG_LIMIT),
    "mask": DeepQConfig(mask=True),
}
# Window of the running means of victories, in Shifts.
SMOOTHED = 25


def program_rewards(transitions: Transitions) -> npt.NDArray[np.float64]:
    """The rewards of the class named after the paper in the public history of its program."""
    sizes, before = transitions.sizes, transitions.before
    discarded = 1 - transitions.after.observations.hands.sum(axis=1) / sizes.hand_size
    idle = before.masks[:, : sizes.turn_actions].sum(axis=1) > 1
    passed = transitions.actions == sizes.turn_actions - 1
    rewards = np.where(passed, np.where(idle, PROGRAM_IDLE_PASS, PROGRAM_PASS), PROGRAM_PLAY * discarded)
    rewards = np.where(transitions.ended, np.where(transitions.places_taken == 1, PROGRAM_FIRST, PROGRAM_OTHER), rewards)
    return np.where(transitions.invalid, PROGRAM_ILLEGAL, rewards)


# The reward schemes: the two readings of the printed formula, and what the paper's program seems to have used.
PROGRAM = "program"
REWARDS: Mapping[str, str | RewardFunction] = {"paper": "paper", "paper_intended": "paper_intended", PROGRAM: program_rewards}
# The schemes that the server counts for every seat.
COUNTED = ("paper", "paper_intended")


@dataclass(frozen=True)
class Condition:
    """A condition: the agent, the reward scheme, and whether four of them learn or one.

    Attributes:
        agent: a key of `AGENTS`, or of `baselines.POLICIES`.
        rewards: a key of `REWARDS`.
        four: whether all four seats have such an agent, or one.
        gifts: how these seats decide in the exchange.
        new_network: whether learners begin with a new network instead of that of Experiment 2.
    """

    agent: str
    rewards: str
    four: bool
    gifts: str = learning.DEFAULT_GIFTS
    new_network: bool = False

    @property
    def learner(self) -> str:
        """Name of the learner: without the number of agents and their gifts."""
        return f"{self.agent}, {self.rewards}{', new network' if self.new_network else ''}"

    @property
    def name(self) -> str:
        """Name, without the number of agents."""
        gifts = "" if self.gifts == learning.DEFAULT_GIFTS else f", {self.gifts}"
        return f"{self.learner}{gifts}"

    @property
    def seats(self) -> tuple[int, ...]:
        """Seats of the learning agents."""
        return ALL_SEATS if self.four else (LEARNER,)


ONE = (
    *(Condition(agent, rewards, four=False) for agent in AGENTS for rewards in REWARDS),
    *(Condition("mask", rewards, four=False, new_network=True) for rewards in REWARDS),
    Condition("mask", "paper", four=False, gifts=learning.RANDOM_GIFTS),
)
# Omits four agents without a mask under `paper_intended`, which rewards every turn: they only learn to draw a Shift out, to some
# 800 turns.
FOUR = tuple(Condition(*names, four=True) for names in (("no mask", "paper"), ("mask", "paper"), ("mask", "paper_intended")))
# Agents that do not learn, at the learner's seat or at all four. The rewards do not change how they play. Where all four are the
# same, the gifts make no difference between them.
BASELINES = (
    *(Condition(agent, rewards, four) for four in (False, True) for agent in baselines.POLICIES for rewards in COUNTED),
    *(Condition(agent, COUNTED[0], four=False, gifts=learning.RANDOM_GIFTS) for agent in baselines.POLICIES),
)


def run(config: Config, progress: Progress) -> Result:
    """Runs all conditions with all seeds, and the agents that do not learn."""
    begin_with = rules.networks(config, progress)
    learned = {
        condition: learning.learn(
            config,
            progress,
            f"winning, {'four' if condition.four else 'one'}, {condition.name}",
            agent=AGENTS[condition.agent],
            rewards=REWARDS[condition.rewards],
            seats=condition.seats,
            gifts=condition.gifts,
            begin_with=None if condition.new_network else begin_with,
        )
        for condition in (*ONE, *FOUR)
    }
    others = {
        baseline: baselines.play(
            config, progress, baseline.agent, rewards=baseline.rewards, seats=baseline.seats, gifts=baseline.gifts
        )
        for baseline in BASELINES
    }
    return Result(
        experiment="winning",
        title="Experiment 3: learning to win",
        seeds=list(config.seeds),
        quick=config.quick,
        settings={name: learning.settings(config, agent) for name, agent in AGENTS.items()},
        rules={"all": learning.rules_json(learned[ONE[0]].played)},
        tables=[_one(config, learned, others), _four(config, learned, others), _behaviour(config, learned, others)],
        figures=[_figure_of_one(learned, others), _figure_of_four(learned)],
        values={
            **{_key(condition): _values(config, each) for condition, each in learned.items()},
            **{_key(baseline): baselines.values(config, each) for baseline, each in others.items()},
        },
    )


def _one(config: Config, learned: Mapping[Condition, Learned], others: Mapping[Condition, Counts]) -> Table:
    after = slice(min(paper.WINNING_ALL_WON_AFTER, learning.shifts_of(config) // 2), None)

    def share(each: Counts, shifts: slice) -> Estimate:
        return each.estimate([float(won) for won in each.won[:, shifts, LEARNER].mean(axis=1)], percent=True, digits=0)

    rows: list[list[Cell]] = [
        [
            learning.of_all(config, rules.PAPER),
            None,
            paper.WINNING_WINS_LEARNER,
            None,
            Estimate(1.0, percent=True, digits=0),
            None,
            None,
        ]
    ]
    for condition, each in {**learned, **others}.items():
        if condition.four or (condition in others and condition.rewards != COUNTED[0]):
            continue
        randoms = np.mean([each.wins(seat) for seat in rules.RANDOM], axis=0).tolist()
        rows.append(
            [
                condition.agent if condition in others else condition.learner,
                "default" if condition.gifts == learning.DEFAULT_GIFTS else "random",
                learning.count(config, each, each.wins(LEARNER)),
                learning.count(config, each, randoms),
                share(each, after),
                share(each, learning.last(config)),
                each.estimate(each.starter_wins(), percent=True, digits=0),
            ]
        )
    return Table(
        name="one",
        title=f"Experiment 3: one agent against three random agents, {learning.shifts_of(config)} Shifts",
        columns=[
            "agent, reward",
            "its gifts",
            "Shifts it won",
            "by a random agent",
            "won after the first" if after.start == 1 else f"won after the {after.start}th",
            "in the last one" if learning.window(config) == 1 else f"in the last {learning.window(config)}",
            "starter wins",
        ],
        rows=rows,
        note="“By a random agent” is the mean of three, whose gifts are random. Default gifts: the highest faces; special "
        f"actions are declined. {learning.note(config)} {baselines.note(config, _played(others, four=False))}",
    )


def _four(config: Config, learned: Mapping[Condition, Learned], others: Mapping[Condition, Counts]) -> Table:
    ranked = sorted(paper.WINNING_WINS_FOUR, reverse=True)
    printed: list[Cell] = [
        learning.of_all(config, rules.PAPER),
        *paper.WINNING_WINS_FOUR,
        ranked[0],
        ranked[-1],
        Estimate(paper.WINNING_STARTER_WINS, percent=True, digits=0),
    ]
    rows = [printed]
    for condition, each in {**learned, **others}.items():
        if not condition.four or (condition in others and condition.rewards != COUNTED[0]):
            continue
        wins = np.array([each.wins(seat) for seat in ALL_SEATS])
        rows.append(
            [
                condition.agent if condition in others else condition.name,
                *(learning.count(config, each, each.wins(seat)) for seat in ALL_SEATS),
                learning.count(config, each, wins.max(axis=0).tolist()),
                learning.count(config, each, wins.min(axis=0).tolist()),
                each.estimate(each.starter_wins(), percent=True, digits=0),
            ]
        )
    return Table(
        name="four",
        title=f"Experiment 3: four agents of a kind, Shifts won of {learning.shifts_of(config)}",
        columns=["agents, reward", *(f"seat {seat + 1}" for seat in ALL_SEATS), "best seat", "last seat", "starter wins"],
        rows=rows,
        note="The seats differ only by chance; “best” and “last” are determined for each game. The paper's 30% is that of random "
        f"agents. {learning.note(config)} {baselines.note(config, _played(others, four=True))}",
    )


def _behaviour(config: Config, learned: Mapping[Condition, Learned], others: Mapping[Condition, Counts]) -> Table:
    end = learning.last(config)

    def cells(condition: Condition, each: Counts) -> list[Cell]:
        def mean(values: list[list[float]], *, percent: bool = False, digits: int = 1) -> Estimate:
            return each.estimate([float(value) for value in np.mean(values, axis=0)], percent=percent, digits=digits)

        def reward(scheme: str) -> Cell:
            # Agents that do not learn play the same under both schemes.
            counted = others.get(dataclasses.replace(condition, rewards=scheme)) if condition in others else each
            if counted is None or (condition in learned and scheme != condition.rewards):
                return None
            of_seats = [counted.mean_reward(seat, end) for seat in condition.seats]
            return counted.estimate(np.mean(of_seats, axis=0).tolist(), digits=2)

        return [
            *(reward(scheme) for scheme in COUNTED),
            mean([each.mean_wrong(seat, end) for seat in condition.seats]),
            mean([each.share_of_turns("passes", seat, end) for seat in condition.seats], percent=True, digits=0),
            mean([each.played.of_shifts["turns"][:, end].mean(axis=1).tolist()], digits=0),
        ]

    rows: list[list[Cell]] = []
    for condition, each in {**learned, **others}.items():
        if condition in others and (condition.rewards != COUNTED[0] or condition.gifts != learning.DEFAULT_GIFTS):
            continue
        name = condition.agent if condition in others else condition.name
        rows.append(["four" if condition.four else "one", name, *cells(condition, each)])
    return Table(
        name="behaviour",
        title=f"Experiment 3: behaviour of the agents in the last {learning.in_words(learning.window(config))}",
        columns=[
            "agents",
            "agent, reward",
            *(f"mean reward, {scheme}" for scheme in COUNTED),
            "wrong actions per Shift",
            "passes, of turns",
            "turns of a Shift",
        ],
        rows=rows,
        note=f"Means over the agents, not the random ones. Default gifts unless another kind is named. {learning.note(config)} "
        f"{baselines.note(config, ())}",
    )


def _played(others: Mapping[Condition, Counts], *, four: bool) -> list[Counts]:
    return [counts for condition, counts in others.items() if condition.four == four]


def _figure_of_one(learned: Mapping[Condition, Learned], others: Mapping[Condition, Counts]) -> Figure:
    def share_of(agent: str) -> float:
        return float(100 * others[Condition(agent, COUNTED[0], four=False)].won[:, :, LEARNER].mean())

    levels = [
        *(Level(agent, share_of(agent)) for agent in (baselines.RANDOM, baselines.NEVER_IDLE)),
        Level("paper, all 250", 100 * paper.WINNING_WINS_LEARNER / paper.SHIFTS),
    ]
    panels = []
    for title, new_network in (("Experiment 2's network", False), ("new network", True)):
        of_title = [each for each in ONE if each.new_network == new_network and each.gifts == learning.DEFAULT_GIFTS]
        lines = [_share_won(f"{each.agent}, {each.rewards}", learned[each].won[:, :, LEARNER]) for each in of_title]
        panels.append(Panel(f"Shifts won, {title}", "Shift", "share (%)", lines=lines, levels=levels, y_range=(-3, 103)))
    for rewards in COUNTED:
        lines = []
        for agent in AGENTS:
            of_seats = learned[Condition(agent, rewards, four=False)].rewards()
            lines.append(learning.curve(f"learner, {agent}", of_seats[:, :, LEARNER]))
        lines.append(learning.curve("random agents", of_seats[:, :, 1:].mean(axis=2)))
        panels.append(Panel(f"Mean reward, {rewards}, Experiment 2's network", "Shift", "reward of an action", lines=lines))
    return Figure(
        name="one",
        title=f"One learner against three random agents: means of {SMOOTHED} Shifts (rewards: {learning.SMOOTHED}), all seeds",
        panels=panels,
        columns=2,
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
