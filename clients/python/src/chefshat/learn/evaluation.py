"""Plays a network, or another policy, on one seat against built-in agents: the command `evaluate`, and comparisons on equal deals.

`chefshat compare` (the program) repeats deals with rotated seats, and so needs far fewer Shifts for the same certainty. How a
network decides is in `network`.
"""

import argparse
import dataclasses
import json
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from chefshat import join_options, search
from chefshat.address import ServerAddress
from chefshat.errors import ChefsHatError, failed
from chefshat.learn import network as network_file
from chefshat.learn import runs
from chefshat.learn.network import Network, NetworkFileError
from chefshat.opponents import Policy
from chefshat.vector import Rules, Seed, VectorEnv
from chefshat.vector_setup import Opponent, is_network_file

# Parallel games.
SIDE_BY_SIDE = 256

_Floats: TypeAlias = npt.NDArray[np.float64]

Player: TypeAlias = Network | Policy | str | Path
"""Who is evaluated: a network, which takes the legal action with the highest output, or its file; a function that chooses actions;
or the built-in agent "random", "greedy" or "trained", by `chefshat-native`: "random" draws the same numbers for every seed."""

OneOpponent: TypeAlias = Opponent | Network | Policy
"""Who plays another seat: as in a `VectorEnv`, or a network for all actions."""


@dataclass(frozen=True)
class Evaluation:
    """The result of an evaluation.

    Attributes:
        opponents: the agents of the other seats.
        games: games played.
        shifts: Shifts played.
        points: points per Shift of the evaluated seat: the points of all games over their Shifts.
        standard_error: of `points`, infinite after one game; games count as independent, the Shifts of one game do not (roles
            connect them).
        places: counts of each place, first to last.
    """

    opponents: tuple[str, ...]
    games: int
    shifts: int
    points: float
    standard_error: float
    places: tuple[int, ...]

    def __str__(self) -> str:
        shares = " ".join(f"{100 * count / self.shifts:.1f} %" for count in self.places)
        against = ", ".join(self.opponents)
        points = f"{self.points:.3f} ± {self.standard_error:.3f} points per Shift against {against}"
        return f"{points} ({self.shifts:,} Shifts in {self.games:,} games; places {shares})"

    def to_json(self) -> dict[str, Any]:
        """Returns the attributes by name, an infinite standard error as None: JSON has no such number."""
        known = np.isfinite(self.standard_error)
        return {**dataclasses.asdict(self), "standard_error": self.standard_error if known else None}


def evaluate(
    player: Player,
    opponents: OneOpponent | Sequence[OneOpponent],
    *,
    games: int,
    seat: int = 0,
    seed: Seed = None,
    rules: Rules = None,
    address: str | ServerAddress | None = None,
) -> Evaluation:
    """Plays games with the player on one seat. With random deals all seats are equal; with given seeds they are not.

    Args:
        player: who is evaluated.
        opponents: built-in agents, network files, networks or functions of the other seats, one for all or one for each.
        games: number of games.
        seat: the player's seat, from 0.
        seed: seed of the deals.
        rules: the rule set.
        address: where the games are played; see `VectorEnv`.

    Raises:
        ChefsHatError: the games are refused, the server does not answer, or there is no such agent.
        NetworkFileError: the file of a player is not a network.
        OSError: it cannot be read.
        ValueError: the network was trained for games of another size, or there is no such seat.
    """
    played = _play(player, opponents, games, seat, seed, rules, address)
    return summed_up(played.opponents, games, played.games, played.points, played.places)


@dataclass(frozen=True)
class Comparison:
    """Two players that never meet, on the same deals, in the same seats and against the same opponents.

    Attributes:
        opponents: the agents of the other seats.
        deals: deals played, each by both players from each of the seats.
        points: points per Shift of the first and of the second player: as in `Evaluation`, those of all games over their Shifts.
        difference: those of the first minus those of the second.
        standard_error: of `difference`; deals count as independent, the games on one deal and their Shifts do not.
    """

    opponents: tuple[str, ...]
    deals: int
    points: tuple[float, float]
    difference: float
    standard_error: float

    def __str__(self) -> str:
        first, second = self.points
        against = ", ".join(self.opponents)
        return (
            f"{self.difference:+.3f} ± {self.standard_error:.3f} points per Shift ({first:.3f} and {second:.3f}) "
            f"against {against}, on {self.deals:,} deals"
        )


def compare(
    first: Player,
    second: Player,
    opponents: OneOpponent | Sequence[OneOpponent],
    *,
    deals: int,
    seats: Sequence[int] | None = None,
    seed: Seed = None,
    rules: Rules = None,
    address: str | ServerAddress | None = None,
) -> Comparison:
    """Lets two players play the same deals from the same seats, which takes most of the chance out of their difference.

    Opponents with random choices make them anew for each player. Agents that only connect to a server are compared by
    `chefshat bench`.

    Args:
        first: a player.
        second: the one to compare it with.
        opponents: as for `evaluate`.
        deals: number of deals, at least 2: the seeds of games, which by most rules have several Shifts.
        seats: the seats from which each deal is played, from 0; None: all.
        seed: seed of the deals; None: random deals, the same for both.
        rules: the rule set.
        address: where the games are played; see `VectorEnv`.

    Raises:
        ChefsHatError: the games are refused, the server does not answer, or there is no such agent.
        NetworkFileError: the file of a player is not a network.
        OSError: it cannot be read.
        ValueError: a network was trained for games of another size, there is no such seat, seats are empty or
            repeated, or deals are fewer than two.
    """
    if deals < 2:
        raise ValueError(f"{deals} deals: play at least 2, so that there is a standard error")
    if seats is None:
        seats = range(runs.full_rules(rules, address).players)
    if not len(seats) or len(set(seats)) < len(seats):
        raise ValueError(f"seats: name at least one seat, and each once, not {list(seats)}")
    seed = secrets.randbits(64) if seed is None else seed
    names: tuple[str, ...] = ()
    # Of each player and deal, the points and the Shifts.
    points, shifts = np.zeros((2, 2, deals))
    for number, player in enumerate((first, second)):
        for seat in seats:
            played = _play(player, opponents, deals, seat, seed, rules, address)
            points[number] += np.bincount(played.games, weights=played.points, minlength=deals)
            shifts[number] += np.bincount(played.games, minlength=deals)
            names = played.opponents
    return compared(names, points, shifts)


class _Played(NamedTuple):
    """The Shifts of some games."""

    # The agents of the other seats.
    opponents: tuple[str, ...]
    # By Shift, (S,): the index of its game, and the points of the player.
    games: npt.NDArray[np.intp]
    points: npt.NDArray[np.uint32]
    # The count of each place, first to last.
    places: npt.NDArray[np.intp]


def _play(
    player: Player,
    opponents: OneOpponent | Sequence[OneOpponent],
    games: int,
    seat: int,
    seed: Seed,
    rules: Rules,
    address: str | ServerAddress | None,
) -> _Played:
    """Plays games with the player on a seat."""
    if isinstance(player, (str, Path)) and is_network_file(player):
        player = network_file.load(player)
    network = player if isinstance(player, Network) else None
    listed = [opponents] if isinstance(opponents, str | bytes | PathLike | Network) or callable(opponents) else opponents
    with VectorEnv(
        address,
        min(games, SIDE_BY_SIDE),
        client_seats=[seat],
        opponents=[opponent.actions_of if isinstance(opponent, Network) else opponent for opponent in listed],
        episode="shift",
        decisions="turns" if network and network.info.output == "turns" else "all",
        skip_forced=True,
        total_games=games,
        seed=seed,
        rules=rules,
        shift_statistics=True,
    ) as env:
        if network and not network.info.fits(env.players, env.faces, env.hand_size):
            info = network.info
            raise ValueError(
                f"the network plays with {info.players} players, {info.faces} faces and hands of {info.hand_size} cards, "
                f"not with {env.players}, {env.faces} and {env.hand_size}"
            )
        others = env.players - 1
        names = tuple(_name(opponent) for opponent in listed) * (others if len(listed) == 1 else 1)
        batch = env.reset()
        indices: list[npt.NDArray[np.uint64]] = []
        points: list[npt.NDArray[np.uint32]] = []
        places: list[npt.NDArray[np.uint8]] = []
        while True:
            assert batch.shifts is not None, "shift_statistics is set"
            indices.append(batch.shifts.indices)
            points.append(batch.shifts.points[:, seat])
            places.append(batch.shifts.places[:, seat])
            if batch.done:
                break
            if isinstance(player, Network):
                actions: npt.ArrayLike = player.actions_of(batch)
            elif isinstance(player, (str, Path)):
                actions = search.choose(env.save(batch.games), player, seed=batch.step)
            else:
                actions = player(batch)
            batch = env.step(actions)
        taken = np.bincount(np.concatenate(places), minlength=env.players + 1)[1:]
    return _Played(names, np.concatenate(indices).astype(np.intp), np.concatenate(points), taken)


def _name(opponent: OneOpponent) -> str:
    if isinstance(opponent, str | PathLike):
        return str(opponent)
    if isinstance(opponent, Network):
        return opponent.info.name
    return getattr(opponent, "__name__", type(opponent).__name__)


def run(options: argparse.Namespace) -> int:
    """Runs the command. Returns the exit code."""
    try:
        trained = network_file.load(options.file)
        found = evaluate(
            trained,
            options.opponents,
            games=options.games,
            seed=options.seed,
            rules=options.rules,
            address=join_options.server_if_any(options),
        )
    except (ChefsHatError, NetworkFileError, OSError, ValueError) as error:
        return failed(error, as_json=options.json)
    print(json.dumps(found.to_json()) if options.json else found)
    return 0


def summed_up(
    opponents: tuple[str, ...],
    games: int,
    indices: npt.NDArray[np.intp],
    points: npt.NDArray[np.uint32],
    taken: npt.NDArray[np.intp],
) -> Evaluation:
    """Summarises the game index and points of each Shift, and the count of each place."""
    mean, over = _means(np.bincount(indices, weights=points, minlength=games), np.bincount(indices, minlength=games))
    return Evaluation(opponents, games, len(points), float(mean), _error(over), tuple(int(count) for count in taken))


def compared(opponents: tuple[str, ...], points: _Floats, shifts: _Floats) -> Comparison:
    """Summarises the points and Shifts of two players on each deal, (2, D)."""
    means, over = _means(points, shifts)
    first, second = means.tolist()
    return Comparison(opponents, points.shape[1], (first, second), first - second, _error(over[0] - over[1]))


def _means(points: npt.NDArray[Any], shifts: npt.NDArray[Any]) -> tuple[_Floats, _Floats]:
    """Returns the points per Shift over all games, and how much each game (the last axis) moves them."""
    mean = np.asarray(points.sum(axis=-1) / shifts.sum(axis=-1))
    return mean, (points - mean[..., np.newaxis] * shifts) / shifts.sum(axis=-1, keepdims=True)


def _error(over: _Floats) -> float:
    """Returns the standard error of a sum over independent games, whose terms sum to 0."""
    games = len(over)
    return float(np.sqrt(games / (games - 1) * np.square(over).sum())) if games > 1 else np.inf
