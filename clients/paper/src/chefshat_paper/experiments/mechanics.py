"""Experiment 1: the effect of each mechanic on the starter's chance and on the length of a Shift, among random agents.

The paper's random agents play 250 "games", each a Shift, with all mechanics and with one of them removed at a time. Here 250 Shifts
in a row are one game, so that all but the first have roles, exchange and special actions; game i of the batch has seed i of the
base seed. The client plays seat 0, uniformly among the legal actions; the server's `random` plays the others in the same way.

The program behind the paper does not let its agents choose in the exchange: it gives their highest cards. So everything is played
a second time with the default actions for all decisions except turns: the highest face is given, special actions are declined.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from chefshat import pb
from chefshat.address import ServerAddress
from chefshat.learn.figures import Figure, Level, Panel, Points
from chefshat.vector import VectorEnv, sample_legal
from google.protobuf.json_format import MessageToDict

from chefshat_paper.experiments import paper, stats
from chefshat_paper.experiments.progress import Progress
from chefshat_paper.experiments.results import Cell, Config, Estimate, Result, Table

PRESETS = ("paper", "original2020")
# The mechanic that is switched off in each condition.
CONDITIONS: Mapping[str, pb.RuleSet] = {
    "all": pb.RuleSet(),
    "without_jokers": pb.RuleSet(jokers=0),
    "without_exchange": pb.RuleSet(exchange=False),
    "without_special_actions": pb.RuleSet(special_actions=False),
}
NAMES = {
    "all": "all mechanics",
    "without_jokers": "without jokers",
    "without_exchange": "without exchange",
    "without_special_actions": "without special actions",
}
# Shifts compared with the paper's: the same number.
FEW = paper.SHIFTS


@dataclass(frozen=True)
class Size:
    """How much is played of a condition: parallel games, and Shifts in each."""

    games: int
    shifts_per_game: int

    @property
    def shifts(self) -> int:
        """Total number of Shifts."""
        return self.games * self.shifts_per_game


# Conditions that differ under the default actions, which never declare special actions.
OF_DEFAULTS = ("all", "without_jokers", "without_exchange")

# Games as long as the paper's whole run; 100,000 Shifts.
FULL = Size(games=400, shifts_per_game=paper.SHIFTS)
# Shorter games, because the longest game determines the duration of a batch.
QUICK = Size(games=64, shifts_per_game=4)


@dataclass(frozen=True)
class Counted:
    """The Shifts of one condition, ordered by game, then by Shift.

    Attributes:
        starter_won: (Shifts,) bool.
        laps: (Shifts,) u32.
        pizzas: (Shifts,) u32.
        turns: (Shifts,) u32.
        rules: the rule set, every field set.
    """

    starter_won: npt.NDArray[np.bool_]
    laps: npt.NDArray[np.uint32]
    pizzas: npt.NDArray[np.uint32]
    turns: npt.NDArray[np.uint32]
    rules: pb.RuleSet

    def first(self, shifts: int) -> "Counted":
        """Returns the first `shifts` Shifts."""
        return Counted(self.starter_won[:shifts], self.laps[:shifts], self.pizzas[:shifts], self.turns[:shifts], self.rules)

    def wins(self) -> Estimate:
        """Returns the share of Shifts that the starter wins."""
        return stats.share(int(self.starter_won.sum()), len(self.starter_won))

    def error_ratios(self, size: Size) -> dict[str, float]:
        """Returns for each mean its standard error if only games are independent, as a multiple of that if all Shifts are."""
        columns = {"starter_won": self.starter_won, "laps": self.laps, "pizzas": self.pizzas, "turns": self.turns}
        return {name: stats.cluster_ratio(column.reshape(size.games, -1)) for name, column in columns.items()}

    def mean_laps(self) -> Estimate:
        """Returns the laps per Shift."""
        return stats.mean(self.laps)


def run(config: Config, progress: Progress) -> Result:
    """Plays all conditions under both presets, with the first seed."""
    size = QUICK if config.quick else FULL
    seed = config.seeds[0]
    counted: dict[tuple[str, str], Counted] = {}
    of_defaults: dict[tuple[str, str], Counted] = {}
    for preset in PRESETS:
        for condition in CONDITIONS:
            with progress.task(f"mechanics, {preset}, {NAMES[condition]}", total=size.shifts, unit="Shifts") as advance:
                counted[preset, condition] = play(config.address, preset, condition, size, seed, advance)
        for condition in OF_DEFAULTS:
            task = f"mechanics, {preset}, {NAMES[condition]}, highest cards given"
            with progress.task(task, total=size.shifts, unit="Shifts") as advance:
                of_defaults[preset, condition] = play(config.address, preset, condition, size, seed, advance, defaults=True)
    named = {f"{preset}, {NAMES[condition]}": those for (preset, condition), those in counted.items()}
    named |= {f"{preset}, {NAMES[condition]}, highest cards given": those for (preset, condition), those in of_defaults.items()}
    return Result(
        experiment="mechanics",
        title="Experiment 1: what each mechanic does",
        seeds=[seed],
        quick=config.quick,
        settings={
            "agents": "random, uniform over the legal actions",
            "games": size.games,
            "shifts_per_game": size.shifts_per_game,
        },
        rules={name: _rules_json(those.rules) for name, those in named.items()},
        tables=[_starter_table(counted, size), _laps_table(counted), _defaults_table(counted, of_defaults), _length_table(counted)],
        figures=[_figure(counted, of_defaults)],
        values={
            name: {
                "shifts": len(those.laps),
                "starter_won": int(those.starter_won.sum()),
                "laps": int(those.laps.sum()),
                "pizzas": int(those.pizzas.sum()),
                "turns": int(those.turns.sum()),
                "error_ratios": {key: round(ratio, 3) for key, ratio in those.error_ratios(size).items()},
            }
            for name, those in named.items()
        },
    )


def play(
    address: ServerAddress,
    preset: str,
    condition: str,
    size: Size,
    seed: int,
    advance: Callable[[int], object],
    *,
    defaults: bool = False,
) -> Counted:
    """Plays games under a preset without the mechanic of the condition.

    Args:
        address: the server.
        preset: "paper" or "original2020".
        condition: a key of `CONDITIONS`.
        size: number of games and Shifts, in one stream.
        seed: of the deals, of the other seats, and of the client's choices.
        advance: called with the number of Shifts that have ended since the last call.
        defaults: whether the default action is taken at all decisions except turns.
    """
    rules = pb.RuleSet(preset=preset, target_shifts=size.shifts_per_game)
    rules.MergeFrom(CONDITIONS[condition])
    chance = np.random.default_rng(seed)
    parts: list[npt.NDArray[np.uint64]] = []
    env = VectorEnv(
        address,
        size.games,
        # Built-in agents would take these decisions themselves.
        client_seats=range(4) if defaults else [0],
        opponents="random",
        decisions="turns" if defaults else "all",
        total_games=size.games,
        seed=seed,
        rules=rules,
        shift_statistics=True,
    )
    with env:
        batch = env.reset()
        while not batch.done:
            batch = env.step(sample_legal(batch.mask_bits, chance))
            ended = batch.shifts
            if ended is not None and len(ended):
                starters = ended.starters.astype(np.intp)
                won = np.take_along_axis(ended.places, starters[:, None], axis=1)[:, 0] == 1
                columns = (ended.games, ended.shifts, won, ended.laps, ended.pizzas, ended.turns)
                parts.append(np.stack([column.astype(np.uint64) for column in columns]))
                advance(len(ended))
        played = env.rules
    table = np.concatenate(parts, axis=1)
    table = table[:, np.lexsort((table[1], table[0]))]
    if table.shape[1] != size.shifts:
        raise RuntimeError(f"{table.shape[1]} Shifts were counted, not {size.shifts}")
    numbers = table.astype(np.uint32)
    return Counted(table[2] == 1, numbers[3], numbers[4], numbers[5], played)


def _rules_json(rules: pb.RuleSet) -> dict[str, object]:
    return dict(MessageToDict(rules, preserving_proto_field_name=True))


def _starter_table(counted: Mapping[tuple[str, str], Counted], size: Size) -> Table:
    ratios = [ratio for those in counted.values() for ratio in those.error_ratios(size).values()]
    rows: list[list[Cell]] = [
        [NAMES[condition], _reported(condition), *(those.wins() for those in _few_and_many(counted, condition).values())]
        for condition in CONDITIONS
    ]
    return Table(
        name="starter",
        title="The starter wins the Shift, four random agents, by rule set and number of Shifts",
        columns=["", "2020 paper, 250", *_few_and_many(counted, "all")],
        rows=rows,
        note="In brackets: Wilson's 95% intervals; for the paper's figures, those of 250 Shifts. Without any advantage the starter "
        "would win 25%. The larger samples include the smaller ones. The intervals treat Shifts as independent; clustered by "
        f"game ({size.games} games), the standard errors of the larger samples with random gifts, here and below, are "
        f"{min(ratios):.2f} to {max(ratios):.2f} times as large.",
    )


def _laps_table(counted: Mapping[tuple[str, str], Counted]) -> Table:
    rows: list[list[Cell]] = [
        [NAMES[condition], paper.LAPS[condition], *(those.mean_laps() for those in _few_and_many(counted, condition).values())]
        for condition in CONDITIONS
    ]
    return Table(
        name="laps",
        title="Laps per Shift, four random agents, by rule set and number of Shifts",
        columns=["", "2020 paper, 250", *_few_and_many(counted, "all")],
        rows=rows,
        note="In brackets: 95% intervals of the mean. A lap in progress at the end of a Shift counts.",
    )


def _defaults_table(counted: Mapping[tuple[str, str], Counted], of_defaults: Mapping[tuple[str, str], Counted]) -> Table:
    rows: list[list[Cell]] = []
    for condition in OF_DEFAULTS:
        row: list[Cell] = [NAMES[condition], _reported(condition)]
        for preset in PRESETS:
            row += [counted[preset, condition].wins(), of_defaults[preset, condition].wins()]
        rows.append(row)
    shifts = len(of_defaults[PRESETS[0], "all"].laps)
    columns = ["", "2020 paper, 250"] + [f"{preset}, {gifts}" for preset in PRESETS for gifts in ("random gifts", "highest")]
    return Table(
        name="gifts",
        title=f"The starter wins the Shift, by gifts in the exchange, {shifts:,} Shifts, by rule set",
        columns=columns,
        rows=rows,
        note="Turns are random. Random gifts: as above. Highest: Chef and Sous-Chef give their highest faces, special actions are "
        "declined. In brackets: Wilson's 95% intervals.",
    )


def _length_table(counted: Mapping[tuple[str, str], Counted]) -> Table:
    rows: list[list[Cell]] = []
    for condition in CONDITIONS:
        row: list[Cell] = [NAMES[condition]]
        for preset in PRESETS:
            those = counted[preset, condition]
            row += [stats.mean(those.pizzas, digits=2), stats.mean(those.turns, digits=2)]
        rows.append(row)
    columns = [""] + [f"{what}, {preset}" for preset in PRESETS for what in ("pizzas", "turns")]
    shifts = len(counted[PRESETS[0], "all"].laps)
    return Table(
        name="length",
        title=f"Pizzas and turns per Shift, four random agents, {shifts:,} Shifts, by rule set",
        columns=columns,
        rows=rows,
        note="The paper does not report these. In brackets: 95% intervals of the mean.",
    )


def _reported(condition: str) -> Estimate:
    """Returns the paper's figure with the interval for its number of Shifts."""
    return stats.share(round(paper.STARTER_WINS[condition] * paper.SHIFTS), paper.SHIFTS, digits=0)


def _few_and_many(counted: Mapping[tuple[str, str], Counted], condition: str) -> dict[str, Counted]:
    """Returns the Shifts of a condition by rule set and number of Shifts."""
    found: dict[str, Counted] = {}
    for preset in PRESETS:
        many = counted[preset, condition]
        for those in (many.first(FEW), many):
            found[f"{preset}, {len(those.laps):,}"] = those
    return found


def _figure(counted: Mapping[tuple[str, str], Counted], of_defaults: Mapping[tuple[str, str], Counted]) -> Figure:
    wins = [_points("2020 paper, 250 Shifts", [_reported(condition) for condition in CONDITIONS], factor=100)]
    laps = [Points("2020 paper, 250 Shifts", [paper.LAPS[condition] for condition in CONDITIONS])]
    columns = [_few_and_many(counted, condition) for condition in CONDITIONS]
    for label in columns[0]:
        wins.append(_points(f"rules {label} Shifts", [column[label].wins() for column in columns], factor=100))
        laps.append(_points(f"rules {label} Shifts", [column[label].mean_laps() for column in columns], factor=1))
    missing = Estimate(float("nan"))
    highest = [of_defaults.get((PRESETS[-1], condition)) for condition in CONDITIONS]
    label = f"rules {PRESETS[-1]}, highest cards given"
    wins.append(_points(label, [those.wins() if those else missing for those in highest], factor=100))
    laps.append(_points(label, [those.mean_laps() if those else missing for those in highest], factor=1))
    names = [NAMES[condition].replace(" ", "\n", 1) for condition in CONDITIONS]
    chance = Level("no advantage", 25)
    return Figure(
        name="starter-and-laps",
        title="Four random agents: the starter's chance and the length of a Shift, with 95% intervals",
        panels=[
            Panel("The starter wins the Shift", "", "share of Shifts (%)", points=wins, levels=[chance], categories=names),
            Panel("Length of a Shift", "", "laps", points=laps, categories=names),
        ],
    )


def _points(label: str, estimates: Sequence[Estimate], factor: float) -> Points:
    low = [factor * (each.value if each.low is None else each.low) for each in estimates]
    high = [factor * (each.value if each.high is None else each.high) for each in estimates]
    return Points(label, [factor * each.value for each in estimates], low, high)
