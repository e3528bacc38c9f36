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
from google.protobuf.json_format import MessageToDict

from chefshat.experiments import paper, stats
from chefshat.experiments.progress import Progress
from chefshat.experiments.results import Config, Estimate, Line
from chefshat.learn import deep_q, deep_q_training
from chefshat.learn.deep_q import Agents, DeepQConfig
from chefshat.learn.deep_q_training import Played
from chefshat.learn.mlp import Params
from chefshat.vector import VectorEnv

QUICK_SHIFTS = 2
# Random agents choose among all 200 actions, as the paper's do. It does not affect who wins: in the end they take every legal
# action as often as `random` does.
OPPONENTS = "random_unmasked"
# The rule set, with the number of Shifts to learn in.
RULES = "paper"
# Window of the running means of curves, in Shifts.
SMOOTHED = 10
# The beginning and the end of the learning, in Shifts.
WINDOW = 50

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Learned:
    """One condition, all seeds. G seeds, S Shifts, N seats.

    Attributes:
        agents: the agents as they are at the end.
        played: what was counted.
    """

    agents: Agents
    played: Played

    @property
    def won(self) -> npt.NDArray[np.bool_]:
        """(G, S, N): who won each Shift."""
        return np.asarray(self.played.of_seats["places"] == 1)

    def wins(self, seat: int) -> list[float]:
        """Shifts that a seat won, by seed."""
        return [float(wins) for wins in self.won[:, :, seat].sum(axis=1)]

    def starter_wins(self) -> list[float]:
        """The share of Shifts that the starter won, by seed."""
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
        """The mean over Shifts of a seat's mean reward in each, by seed."""
        return [float(mean) for mean in self.rewards()[:, shifts, seat].mean(axis=1)]

    def mean_wrong(self, seat: int, shifts: slice = slice(None)) -> list[float]:
        """Wrong actions per Shift, by seed."""
        return [float(mean) for mean in self.wrong()[:, shifts, seat].mean(axis=1)]

    def share_of_turns(self, of: str, seat: int, shifts: slice = slice(None)) -> list[float]:
        """Returns a count, for example of passes, as a share of a seat's turns, by seed."""
        seats = self.played.of_seats
        return [float(share) for share in seats[of][:, shifts, seat].sum(axis=1) / seats["valid"][:, shifts, seat].sum(axis=1)]


def learn(
    config: Config,
    progress: Progress,
    what: str,
    *,
    agent: DeepQConfig,
    rewards: str,
    seats: Sequence[int],
    begin_with: Params | None = None,
    idle_pass_is_wrong: bool = False,
) -> Learned:
    """Lets agents learn for 250 Shifts (a few if quick), in a game for each seed of the config.

    Args:
        config: address, seeds, quick or not.
        progress: shows the Shifts.
        what: name of the condition, for the progress.
        agent: the agents' hyper-parameters.
        rewards: the reward scheme.
        seats: their seats; random agents have the others.
        begin_with: an initial network for each seed; None: new ones.
        idle_pass_is_wrong: whether the learners' passing counts as illegal where another action is legal.
    """
    shifts = shifts_of(config)
    seeds = [_number(seed, seat) for seed in config.seeds for seat in seats]
    if begin_with is None:
        agents = deep_q.start(agent, seeds)
    else:
        copies = np.repeat(np.arange(len(config.seeds)), len(seats))
        agents = deep_q.start_from(agent, jax.tree.map(lambda leaf: leaf[copies], begin_with), seeds)
    env = VectorEnv(
        config.address,
        len(config.seeds),
        client_seats=seats,
        opponents=OPPONENTS,
        rewards=rewards,
        episode="shift",
        decisions="turns",
        invalid="ask_again",
        total_games=len(config.seeds),
        seed=[_digest(seed) for seed in config.seeds],
        rules={"preset": RULES, "target_shifts": shifts},
        shift_statistics=True,
    )
    with env, progress.task(what, total=shifts * len(config.seeds), unit="Shifts") as advance:
        return Learned(*deep_q_training.play(env, agent, agents, idle_pass_is_wrong=idle_pass_is_wrong, advance=advance))


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


def count(config: Config, values: Sequence[float]) -> Estimate:
    """Summarises a count over seeds. The mean of a few small ones needs a decimal place."""
    return stats.spread(values, digits=1 if config.quick else 0)


def in_words(shifts: int) -> str:
    """Returns "50 Shifts" or "Shift", for use after "the last"."""
    return "Shift" if shifts == 1 else f"{shifts} Shifts"


def of_all(config: Config, name: str) -> str:
    """Returns the heading of the paper's counts; adds its number of Shifts if ours is smaller."""
    return f"{name}, of {paper.SHIFTS}" if config.quick else name


def by_seed(config: Config, values: Sequence[float], digits: int = 4) -> dict[str, float]:
    """Returns the values by seed, as JSON values."""
    return {str(seed): round(value, digits) for seed, value in zip(config.seeds, values, strict=True)}


def _digest(seed: int, of: str = "the games") -> bytes:
    """Derives 32 bytes from a seed: the same for every condition, so that conditions differ in nothing else."""
    return hashlib.sha256(f"seed {seed} of {of}".encode()).digest()


def _number(seed: int, seat: int) -> int:
    """Derives the seed of an agent."""
    return int.from_bytes(_digest(seed, f"the agent at seat {seat}")[:4], "little")
