"""The shared part of Experiments 2 and 3: Deep Q agents that learn while they play 250 Shifts, one game for each seed.

The games of all seeds run in parallel in one `VectorEnv`. A game's deals and all its random choices follow from its seed: a seed
gives the same result whatever other seeds run in parallel, and every condition has the same deals. Tables and figures are in
`rules` and `winning`.
"""

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import jax
import numpy as np
import numpy.typing as npt
from chefshat.learn.figures import Line
from chefshat.learn.mlp import Params
from chefshat.transitions import RewardFunction
from chefshat.vector import VectorEnv
from google.protobuf.json_format import MessageToDict

from chefshat_paper.experiments import paper, stats
from chefshat_paper.experiments.progress import Progress
from chefshat_paper.experiments.results import Config, Estimate
from chefshat_paper.learn import deep_q, deep_q_training
from chefshat_paper.learn.deep_q import Agents, DeepQConfig
from chefshat_paper.learn.deep_q_training import Played

QUICK_SHIFTS = 2
# Random agents choose among all 200 actions, as the paper's do. It does not affect who wins: in the end they take every legal
# action as often as `random` does.
OPPONENTS = "random_unmasked"
# The rule set, with the number of Shifts to learn in.
RULES = "paper"
# How the client's seats decide in the exchange: the built-in agent that does it, or None for the default actions (the highest face
# is given, special actions are declined). The other seats give random cards and take special actions at random.
DEFAULT_GIFTS, RANDOM_GIFTS = "default gifts", "random gifts"
GIFTS: Mapping[str, str | None] = {DEFAULT_GIFTS: None, RANDOM_GIFTS: "random"}
# Window of the running means of curves, in Shifts.
SMOOTHED = 10
# The beginning and the end of the learning, in Shifts.
WINDOW = 50

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Counts:
    """What was counted in one condition. G games, S Shifts in each, N seats.

    Attributes:
        played: the counts.
    """

    played: Played

    def estimate(self, values: Sequence[float], *, percent: bool = False, digits: int = 1) -> Estimate:
        """Returns the mean of one value for each game, with its standard error."""
        return stats.clustered(values, percent=percent, digits=digits)

    @property
    def won(self) -> npt.NDArray[np.bool_]:
        """(G, S, N): who won each Shift."""
        return np.asarray(self.played.of_seats["places"] == 1)

    def wins(self, seat: int) -> list[float]:
        """Shifts that a seat won, by game."""
        return [float(wins) for wins in self.won[:, :, seat].sum(axis=1)]

    def starter_wins(self) -> list[float]:
        """The share of Shifts that the starter won, by game."""
        starters = self.played.of_shifts["starters"][:, :, np.newaxis]
        return [float(share) for share in np.take_along_axis(self.won, starters, axis=2)[:, :, 0].mean(axis=1)]

    def attempts(self) -> Floats:
        """(G, S, N): actions at turns, wrong ones included."""
        return np.asarray(self.played.of_seats["valid"] + self.played.of_seats["wrong"], np.float64)

    def rewards(self) -> Floats:
        """(G, S, N): the mean reward of an action."""
        return np.asarray(self.played.of_seats["reward_sums"] / np.maximum(self.attempts(), 1))

    def wrong(self) -> Floats:
        """(G, S, N): wrong actions."""
        return np.asarray(self.played.of_seats["wrong"], np.float64)

    def mean_reward(self, seat: int, shifts: slice = slice(None)) -> list[float]:
        """The mean over Shifts of a seat's mean reward in each, by game."""
        return [float(mean) for mean in self.rewards()[:, shifts, seat].mean(axis=1)]

    def mean_wrong(self, seat: int, shifts: slice = slice(None)) -> list[float]:
        """Wrong actions per Shift, by game."""
        return [float(mean) for mean in self.wrong()[:, shifts, seat].mean(axis=1)]

    def share_of_turns(self, of: str, seat: int, shifts: slice = slice(None)) -> list[float]:
        """Returns a count, for example of passes, as a share of a seat's turns, by game."""
        seats = self.played.of_seats
        return [float(share) for share in seats[of][:, shifts, seat].sum(axis=1) / seats["valid"][:, shifts, seat].sum(axis=1)]


@dataclass(frozen=True)
class Learned(Counts):
    """One condition of learning agents: one game for each seed.

    Attributes:
        agents: the agents as they are at the end.
    """

    agents: Agents

    def estimate(self, values: Sequence[float], *, percent: bool = False, digits: int = 1) -> Estimate:
        """Returns the mean over the seeds, with its standard error, the minimum and the maximum."""
        return stats.spread(values, percent=percent, digits=digits)


def learn(
    config: Config,
    progress: Progress,
    what: str,
    *,
    agent: DeepQConfig,
    rewards: str | RewardFunction,
    seats: Sequence[int],
    gifts: str = DEFAULT_GIFTS,
    begin_with: Params | None = None,
    idle_pass_is_wrong: bool = False,
) -> Learned:
    """Lets agents learn for 250 Shifts (a few if quick), in a game for each seed of the config.

    Args:
        config: address, seeds, quick or not.
        progress: shows the Shifts.
        what: name of the condition, for the progress.
        agent: the agents' hyper-parameters.
        rewards: the reward scheme, or a function.
        seats: their seats; random agents have the others.
        gifts: how the learners decide in the exchange, a key of `GIFTS`.
        begin_with: an initial network for each seed; None: new ones.
        idle_pass_is_wrong: whether the learners' passing counts as illegal where another action is legal.
    """
    seeds = [_number(seed, seat) for seed in config.seeds for seat in seats]
    if begin_with is None:
        agents = deep_q.start(agent, seeds)
    else:
        copies = np.repeat(np.arange(len(config.seeds)), len(seats))
        agents = deep_q.start_from(agent, jax.tree.map(lambda leaf: leaf[copies], begin_with), seeds)
    env = games(config, [game_seed(seed) for seed in config.seeds], rewards=rewards, seats=seats, gifts=gifts)
    total = shifts_of(config) * len(config.seeds)
    with env, progress.task(what, total=total, unit="Shifts") as advance:
        learned, played = deep_q_training.play(env, agent, agents, idle_pass_is_wrong=idle_pass_is_wrong, advance=advance)
    return Learned(played, learned)


def games(config: Config, seeds: Sequence[bytes], *, rewards: str | RewardFunction, seats: Sequence[int], gifts: str) -> VectorEnv:
    """Starts one game of 250 Shifts (a few if quick) for each seed, in which the client takes the turns of some seats.

    Args:
        config: address, quick or not.
        seeds: the games' seeds.
        rewards: the reward scheme, or a function.
        seats: the client's seats; random agents have the others.
        gifts: how the client's seats decide in the exchange, a key of `GIFTS`.
    """
    function = None if isinstance(rewards, str) else rewards
    return VectorEnv(
        config.address,
        len(seeds),
        reward_function=function,
        client_seats=seats,
        opponents=OPPONENTS,
        rewards=rewards if isinstance(rewards, str) else None,
        episode="shift",
        decisions="turns",
        other_decisions=GIFTS[gifts],
        invalid="ask_again",
        total_games=len(seeds),
        seed=list(seeds),
        rules={"preset": RULES, "target_shifts": shifts_of(config)},
        shift_statistics=True,
    )


def shifts_of(config: Config) -> int:
    """Returns the Shifts of a game."""
    return QUICK_SHIFTS if config.quick else paper.SHIFTS


def first(config: Config) -> slice:
    """Returns the Shifts of the first window."""
    return slice(0, min(WINDOW, shifts_of(config) // 2))


def last(config: Config) -> slice:
    """Returns the Shifts of the last window."""
    return slice(-min(WINDOW, shifts_of(config) // 2), None)


def window(config: Config) -> int:
    """Returns the number of Shifts in `first` and `last`."""
    return int(first(config).stop)


def curve(label: str, runs: Floats) -> Line:
    """Returns a line over Shifts with a band over seeds: `runs` is (G, S)."""
    return stats.band(label, list(range(1, runs.shape[1] + 1)), stats.smooth(runs, SMOOTHED))


def settings(config: Config, agent: DeepQConfig) -> dict[str, object]:
    """Returns the settings as JSON values."""
    return {"shifts": shifts_of(config), "opponents": OPPONENTS, "agent": dataclasses.asdict(agent)}


def rules_json(played: Played) -> Mapping[str, object]:
    """Returns the rule set as JSON values."""
    return dict(MessageToDict(played.rules, preserving_proto_field_name=True))


def count(config: Config, counts: Counts, values: Sequence[float]) -> Estimate:
    """Summarises a count over games. The mean of a few small ones needs a decimal place."""
    return counts.estimate(values, digits=1 if config.quick or not isinstance(counts, Learned) else 0)


def note(config: Config) -> str:
    """Returns the sentence about the rows of learners for the note of a table."""
    return f"Learners: means over {len(config.seeds)} seeds ± standard errors; in brackets: minimum and maximum."


def in_words(shifts: int) -> str:
    """Returns "50 Shifts" or "Shift", for use after "the last"."""
    return "Shift" if shifts == 1 else f"{shifts} Shifts"


def of_all(config: Config, name: str) -> str:
    """Returns the heading of the paper's counts; adds its number of Shifts if ours is smaller."""
    return f"{name}, of {paper.SHIFTS}" if config.quick else name


def by_seed(config: Config, values: Sequence[float], digits: int = 4) -> dict[str, float]:
    """Returns the values by seed, as JSON values."""
    return {str(seed): round(value, digits) for seed, value in zip(config.seeds, values, strict=True)}


def game_seed(seed: int, repetition: int = 0) -> bytes:
    """Derives the seed of a game: the same for every condition, so that conditions differ in nothing else."""
    return _digest(seed, f"the games, repetition {repetition}" if repetition else "the games")


def _digest(seed: int, of: str) -> bytes:
    """Derives 32 bytes from a seed."""
    return hashlib.sha256(f"seed {seed} of {of}".encode()).digest()


def _number(seed: int, seat: int) -> int:
    """Derives the seed of an agent."""
    return int.from_bytes(_digest(seed, f"the agent at seat {seat}")[:4], "little")
