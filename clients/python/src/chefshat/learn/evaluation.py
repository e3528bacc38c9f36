"""Plays a network, or another player, on one seat against others: the command `evaluate`, and comparisons on equal deals.

Policies, networks and built-in agents play in batches. Games with players that connect to a server are in `rooms`. `chefshat
compare` (the program) repeats deals with rotated seats, and so needs far fewer Shifts for the same certainty. How a network decides
is in `network`.
"""

import argparse
import dataclasses
import functools
import inspect
import json
import secrets
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

from chefshat import join_options, pb, search
from chefshat.address import ServerAddress
from chefshat.agents import Agent
from chefshat.batch import Batch
from chefshat.decision import Decision
from chefshat.errors import ChefsHatError, failed
from chefshat.learn import network as network_file
from chefshat.learn import rooms, runs
from chefshat.learn.network import Network, NetworkFileError
from chefshat.learn.play import NetworkAgent
from chefshat.learn.rooms import Command, MakeAgent
from chefshat.opponents import Policy
from chefshat.vector import Rules, Seed, VectorEnv
from chefshat.vector_setup import Opponent, is_network_file

# Parallel games.
SIDE_BY_SIDE = 256

_Floats: TypeAlias = npt.NDArray[np.float64]

Connected: TypeAlias = Agent | MakeAgent | Command
"""Who plays over a connection, in rooms of a server: an agent, which plays all games of its seat, one after the other; a class of
agents, or a function without arguments that makes one, for an agent of its own in each game; or a program in any language."""

Player: TypeAlias = Network | Policy | str | Path | Connected
"""Who is evaluated: a network, which takes the legal action with the highest output, or its file; a function that chooses actions;
the built-in agent "random", "greedy" or "trained", by `chefshat-native`: "random" draws the same numbers for every seed; or a
player that is `Connected`."""

OneOpponent: TypeAlias = Opponent | Network | Policy | Connected
"""Who plays another seat: as in a `VectorEnv`, a network for all actions, or a player that is `Connected`."""

# Those who play in batches.
_PlayerInBatch: TypeAlias = Network | Policy | str | Path
_OpponentInBatch: TypeAlias = Opponent | Network | Policy


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
    parallel: int = 1,
) -> Evaluation:
    """Plays games with the player on one seat. With random deals all seats are equal; with given seeds they are not.

    If somebody at the table is `Connected`, the games are played in rooms of a server, which takes far longer than in batches.
    A terminal shows the progress. The deals are those of batches, but built-in agents with random choices make others there.

    Args:
        player: who is evaluated.
        opponents: built-in agents, network files, networks, functions or `Connected` players of the other seats, one for all or
            one for each.
        games: number of games.
        seat: the player's seat, from 0.
        seed: seed of the deals.
        rules: the rule set.
        address: where the games are played; see `VectorEnv`. If it is None, rooms are on a server that stops with the games.
        parallel: games at a time in rooms. The time of a decision runs while an agent is busy with another game.

    Raises:
        ChefsHatError: the games are refused, the server does not answer, or there is no such agent. AGENT_FAILED: a connected
            player failed; the message names it with the game and its seed.
        NetworkFileError: the file of a player is not a network.
        OSError: it cannot be read.
        ValueError: the network was trained for games of another size, there is no such seat, or seeds are fewer than the games or
            repeated.
    """
    _check_seeds(seed, games, "games")
    listed, wanted = _listed(opponents), _Wanted(games, seed, rules, address, parallel)
    with _bar(games * _in_rooms(player, listed)) as bar:
        played = _play(player, listed, seat, wanted, bar)
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
    parallel: int = 1,
) -> Comparison:
    """Lets two players play the same deals from the same seats, which takes most of the chance out of their difference.

    Opponents with random choices make them anew for each player. Games with `Connected` players are played in rooms: see
    `evaluate`. The other player's are played in batches all the same: unless somebody chooses at random, the results are those of
    rooms.

    Args:
        first: a player.
        second: the one to compare it with.
        opponents: as for `evaluate`.
        deals: number of deals, at least 2: the seeds of games, which by most rules have several Shifts.
        seats: the seats from which each deal is played, from 0; None: all.
        seed: seed of the deals; None: random deals, the same for both.
        rules: the rule set.
        address: where the games are played, as for `evaluate`.
        parallel: games at a time in rooms, as for `evaluate`.

    Raises:
        ChefsHatError: as for `evaluate`.
        NetworkFileError: the file of a player is not a network.
        OSError: it cannot be read.
        ValueError: a network was trained for games of another size, there is no such seat, seats are empty or
            repeated, deals are fewer than two, or seeds are fewer than the deals or repeated.
    """
    if deals < 2:
        raise ValueError(f"{deals} deals: play at least 2, so that there is a standard error")
    _check_seeds(seed, deals, "deals")
    if seats is None:
        seats = range(runs.full_rules(rules, address).players)
    if not len(seats) or len(set(seats)) < len(seats):
        raise ValueError(f"seats: name at least one seat, and each once, not {list(seats)}")
    seed = secrets.randbits(64) if seed is None else seed
    names: tuple[str, ...] = ()
    # Of each player and deal, the points and the Shifts.
    points, shifts = np.zeros((2, 2, deals))
    players, listed, wanted = (first, second), _listed(opponents), _Wanted(deals, seed, rules, address, parallel)
    with _bar(deals * len(seats) * sum(_in_rooms(player, listed) for player in players)) as bar:
        for number, player in enumerate(players):
            for seat in seats:
                played = _play(player, listed, seat, wanted, bar)
                points[number] += np.bincount(played.games, weights=played.points, minlength=deals)
                shifts[number] += np.bincount(played.games, minlength=deals)
                names = played.opponents
    return compared(names, points, shifts)


def _check_seeds(seed: Seed, wanted: int, what: str) -> None:
    """Refuses seeds that would play a game again: the standard error takes games as independent."""
    if isinstance(seed, Sequence) and len(different := set(seed[:wanted])) < wanted:
        raise ValueError(f"seed: {len(different):,} different seeds for {wanted:,} {what}; give one for each, or a base seed")


class _Wanted(NamedTuple):
    """The games to play, as for `evaluate`."""

    games: int
    seed: Seed
    rules: Rules
    address: str | ServerAddress | None
    parallel: int


class _Played(NamedTuple):
    """The Shifts of some games."""

    # The agents of the other seats.
    opponents: tuple[str, ...]
    # By Shift, (S,): the index of its game, and the points of the player.
    games: npt.NDArray[np.intp]
    points: npt.NDArray[np.uint32]
    # The count of each place, first to last.
    places: npt.NDArray[np.intp]


def _play(player: Player, opponents: Sequence[OneOpponent], seat: int, wanted: _Wanted, bar: "tqdm[Any]") -> _Played:
    """Plays games with the player on a seat."""
    if _in_rooms(player, opponents):
        return _play_in_rooms(player, opponents, seat, wanted, bar)
    return _play_in_batches(cast(_PlayerInBatch, player), cast(Sequence[_OpponentInBatch], opponents), seat, wanted)


def _play_in_batches(player: _PlayerInBatch, opponents: Sequence[_OpponentInBatch], seat: int, wanted: _Wanted) -> _Played:
    """Plays games without connections."""
    if isinstance(player, (str, Path)) and is_network_file(player):
        player = network_file.load(player)
    network = player if isinstance(player, Network) else None
    turns_alone = network is not None and network.info.output == "turns"
    if turns_alone and any(callable(opponent) for opponent in opponents):
        raise ValueError(
            "a network that decides on turns alone cannot play against functions, which would not be asked for other decisions "
            "either: give networks or built-in agents as opponents"
        )
    with VectorEnv(
        wanted.address,
        min(wanted.games, SIDE_BY_SIDE),
        client_seats=[seat],
        # As a file, a network decides by itself what it was trained for.
        opponents=[
            network_file.encoded(opponent.layers, opponent.info) if isinstance(opponent, Network) else opponent
            for opponent in opponents
        ],
        episode="shift",
        decisions="turns" if turns_alone else "all",
        skip_forced=True,
        total_games=wanted.games,
        seed=wanted.seed,
        rules=wanted.rules,
        shift_statistics=True,
    ) as env:
        if network and not network.info.fits(env.players, env.faces, env.hand_size):
            info = network.info
            raise ValueError(
                f"the network plays with {info.players} players, {info.faces} faces and hands of {info.hand_size} cards, "
                f"not with {env.players}, {env.faces} and {env.hand_size}"
            )
        others = env.players - 1
        names = tuple(_name(opponent) for opponent in opponents) * (others if len(opponents) == 1 else 1)
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


def _play_in_rooms(player: Player, opponents: Sequence[OneOpponent], seat: int, wanted: _Wanted, bar: "tqdm[Any]") -> _Played:
    """Plays games of which some players are connected."""
    rules = runs.full_rules(wanted.rules, wanted.address)
    if not 0 <= seat < rules.players:
        raise ValueError(f"seat: there are seats 0..={rules.players - 1}, but no seat {seat}")
    others = [*opponents] * (rules.players - 1 if len(opponents) == 1 else 1)
    if len(others) != rules.players - 1:
        raise ValueError(f"opponents: give one for each of the {rules.players - 1} other seats, or one for all, not {len(others)}")
    table: list[Player | OneOpponent] = [*others]
    table.insert(seat, player)
    agents = [one for one in table if isinstance(one, Agent)]
    if len({id(agent) for agent in agents}) < len(agents):
        raise ValueError("an agent plays one seat: for several seats give its class, or a function that makes it")
    if wanted.parallel < 1:
        raise ValueError(f"parallel: play at least one game at a time, not {wanted.parallel}")
    if agents and wanted.parallel > 1:
        raise ValueError("an agent plays one game at a time: for parallel games give its class, or a function that makes it")
    played = rooms.play(
        [rooms.Seat(_name(one), _room_player(one, rules)) for one in table],
        game_seeds(wanted.seed, wanted.games, wanted.address),
        rules,
        wanted.address,
        parallel=wanted.parallel,
        on_game=bar.update,
    )
    shifts = [(game, shift) for game, ends in enumerate(played) for shift in ends]
    places = [list(shift.order).index(seat) + 1 for _, shift in shifts]
    return _Played(
        tuple(_name(opponent) for opponent in others),
        np.array([game for game, _ in shifts], np.intp),
        np.array([shift.shift_points[seat] for _, shift in shifts], np.uint32),
        np.bincount(places, minlength=rules.players + 1)[1:],
    )


def game_seeds(seed: Seed, games: int, address: str | ServerAddress | None) -> list[bytes]:
    """Returns the seeds of the games of a `VectorEnv`, in order."""
    side_by_side = min(games, SIDE_BY_SIDE)
    seeds: list[bytes] = []
    with VectorEnv(address, side_by_side, seed=seed) as env:
        while True:
            seeds += [row.tobytes() for row in env.batch.beginnings.seeds]
            if len(seeds) >= games:
                return seeds[:games]
            env.reset(games=np.arange(side_by_side))


class PolicyAgent(Agent):
    """Plays a seat by a policy. It is asked for one row, and as in batches only if there are several legal actions."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy

    def decide(self, request: Decision) -> int:
        """Returns the action that the policy chooses."""
        legal = request.legal_actions
        if len(legal) == 1:
            return int(legal[0])
        return int(np.asarray(self._policy(cast(Batch, request.situations())))[0])


def _room_player(player: Player | OneOpponent, rules: pb.RuleSet) -> str | MakeAgent | Command:
    """Returns who plays a seat of a room."""
    if isinstance(player, Command):
        return player
    if isinstance(player, Agent):
        agent = player
        return lambda: agent
    if isinstance(player, str | PathLike) and is_network_file(player):
        player = network_file.load(player)
    elif isinstance(player, bytes):
        player = network_file.parse(player, "an opponent")
    if isinstance(player, Network):
        network = player
        NetworkAgent(network).check_rules(rules)
        return lambda: NetworkAgent(network)
    if isinstance(player, str):
        return player
    if _makes_agents(player):
        return cast(MakeAgent, player)
    return lambda: PolicyAgent(cast(Policy, player))


def _listed(opponents: OneOpponent | Sequence[OneOpponent]) -> list[OneOpponent]:
    alone = isinstance(opponents, str | bytes | PathLike | Network | Agent | Command) or callable(opponents)
    return [cast(OneOpponent, opponents)] if alone else list(cast(Sequence[OneOpponent], opponents))


def _in_rooms(player: Player, opponents: Sequence[OneOpponent]) -> bool:
    """Whether somebody at the table is connected."""
    return any(isinstance(one, Agent | Command) or _makes_agents(one) for one in (player, *opponents))


def _makes_agents(given: object) -> bool:
    """Whether this makes agents: a class of them, or a function without arguments. A policy takes a batch."""
    made = given.func if isinstance(given, functools.partial) else given
    if isinstance(made, type):
        return issubclass(made, Agent)
    if not callable(given):
        return False
    try:
        signature = inspect.signature(given)
        signature.bind()
    except (TypeError, ValueError):
        return False
    anything = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    return all(parameter.kind not in anything for parameter in signature.parameters.values())


@contextmanager
def _bar(games: int) -> Iterator["tqdm[Any]"]:
    """The progress of games in rooms; those in batches are quick."""
    with tqdm(total=games, unit=" games", file=sys.stderr, disable=not (games and sys.stderr.isatty()), leave=False) as bar:
        yield bar


def _name(player: Player | OneOpponent) -> str:
    if isinstance(player, str | PathLike):
        return str(player)
    if isinstance(player, Network):
        return player.info.name
    if isinstance(player, Command):
        return player.name
    made = player.func if isinstance(player, functools.partial) else player
    return getattr(made, "__name__", type(made).__name__)


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
