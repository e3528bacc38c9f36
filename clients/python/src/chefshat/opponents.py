"""Opponents in Python: functions that choose the actions of seats of a `VectorEnv`.

Inside, their seats are the client's, so that they can be of any kind and in any process. `PolicyGames` asks the functions for all
decisions that wait for them until only the learner's are left, so a step of the environment may be several steps of its games.
Names of built-in agents are the server's business.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chefshat import pb
from chefshat._games import LEAVE_OPEN, Games, checked
from chefshat.address import ServerAddress
from chefshat.batch import Batch
from chefshat.columns import Beginnings, Endings, ShiftStatistics, Sizes, Table, Totals
from chefshat.errors import ChefsHatError
from chefshat.masks import is_legal
from chefshat.vector_setup import VectorOptions

Policy: TypeAlias = Callable[[Batch], ArrayLike]
"""Chooses actions: given the R rows of a batch that wait for its seats, returns R integers, the action of each row."""

AnyTable = TypeVar("AnyTable", bound=Table)


@dataclass(frozen=True)
class Policies:
    """The opponents of an environment of which some are functions.

    Attributes:
        learner: the seats that the client plays.
        opponents: the opponents of the other seats, in order: functions, and None for built-in agents; or one for all.
    """

    learner: tuple[int, ...]
    opponents: tuple[Policy | None, ...]

    def by_seat(self, players: int) -> list[Policy | None]:
        """Returns the function of each seat. Raises ValueError if seats are wrong, or the opponents too few or too many."""
        if not self.learner or len(set(self.learner) & set(range(players))) < len(self.learner):
            raise ValueError(f"client_seats: name each of the client's seats once, 0..={players - 1}, not {list(self.learner)}")
        others = [seat for seat in range(players) if seat not in self.learner]
        each = self.opponents * len(others) if len(self.opponents) == 1 else self.opponents
        if len(each) != len(others):
            raise ValueError(f"opponents: give one for each of the {len(others)} other seats, or one for all, not {len(each)}")
        found: list[Policy | None] = [None] * players
        for seat, opponent in zip(others, each, strict=True):
            found[seat] = opponent
        return found


def split(options: VectorOptions) -> tuple[VectorOptions, Policies | None]:
    """Separates functions among the `opponents` of the options: returns the options of the games inside, and the functions.

    Raises:
        ValueError: there are no seats for opponents, since the client plays all.
    """
    given, seats = options.get("opponents"), options.get("client_seats")
    if given is None:
        return options, None
    listed: Sequence[Any] = given if isinstance(given, Sequence) and not isinstance(given, (str, bytes)) else [given]
    if seats is None:
        raise ValueError("opponents play the seats that client_seats leaves: name the client's seats, for example client_seats=[0]")
    functions = tuple(opponent if callable(opponent) else None for opponent in listed)
    if not any(functions):
        return options, None
    learner = tuple(seats)
    inside: dict[str, Any] = {name: value for name, value in options.items() if name not in ("client_seats", "opponents")}
    names = [opponent for opponent in listed if not callable(opponent)]
    if names:
        others = (seat for seat in range(len(learner) + len(listed)) if seat not in learner)
        mine = [seat for seat, opponent in zip(others, listed, strict=False) if callable(opponent)]
        inside |= {"client_seats": sorted({*learner, *mine}), "opponents": names}
    return cast(VectorOptions, inside), Policies(learner, functions)


class PolicyGames:
    """Games of which functions play some seats. See `_games.Games`."""

    def __init__(self, inside: Games, policies: Policies) -> None:
        self._inside = inside
        self.server: ServerAddress | None = inside.server
        self.started = pb.VectorStarted()
        self.started.CopyFrom(inside.started)
        del self.started.client_seats[:]
        self._sizes = Sizes.of(inside.started)
        by_seat = policies.by_seat(self._sizes.players)
        self.started.client_seats.extend(sorted(policies.learner))
        # A function that plays several seats is asked once for all of them.
        self._policies = {id(policy): policy for policy in by_seat if policy is not None}
        numbers = list(self._policies)
        # By seat: the number of its function, or -1.
        self._players = np.array([-1 if policy is None else numbers.index(id(policy)) for policy in by_seat])
        self._learner = np.isin(np.arange(self._sizes.players), policies.learner)
        # Batches so far, and decisions that the functions have taken.
        self._step = 0
        self._taken = 0
        self._latest: Batch
        # Held during a call, which may be several of the games inside.
        self._lock = threading.Lock()

    def first(self) -> Batch:
        """Returns the first batch."""
        with self._claimed():
            return self._settled(self._inside.first())

    def step(self, actions: ArrayLike, batch: Batch) -> Batch:
        """Takes the action of each row of the latest batch and returns the next batch."""
        return self.take(checked(actions, batch))

    def take(self, actions: NDArray[np.uint16]) -> Batch:
        """Takes actions, of which `LEAVE_OPEN` takes none, and returns the next batch."""
        with self._claimed():
            return self._settled(self._inside.take(actions))

    def reset(self, request: pb.VectorReset) -> Batch:
        """Abandons games, starts new ones and returns the next batch."""
        with self._claimed():
            return self._settled(self._inside.reset(request))

    def save(self, games: NDArray[np.uint32]) -> list[bytes]:
        """Returns the states of games."""
        with self._claimed():
            return self._inside.save(games)

    def restore(self, games: NDArray[np.uint32], states: Sequence[bytes]) -> Batch:
        """Replaces games, in ascending order, by saved ones and returns the next batch."""
        with self._claimed():
            return self._settled(self._inside.restore(games, states))

    def sample(self, batch: Batch, seed: int, first: int) -> NDArray[np.uint16]:
        """Draws a legal action for each row of the latest batch."""
        return self._inside.sample(self._latest, seed, first)

    def action_texts(self, faces: int) -> Sequence[str]:
        """Returns the texts of all actions."""
        return self._inside.action_texts(faces)

    def close(self) -> None:
        """Ends the games."""
        self._inside.close()

    @contextmanager
    def _claimed(self) -> Iterator[None]:
        if not self._lock.acquire(blocking=False):
            words = "another thread, or an opponent, is using these games: use one env for each thread"
            raise ChefsHatError("GAMES_IN_USE", words)
        try:
            yield
        finally:
            self._lock.release()

    def _settled(self, batch: Batch) -> Batch:
        """Asks the functions until only the learner's decisions wait, and returns all that has happened as one batch."""
        parts = [batch]
        while True:
            players = self._players[batch.seats]
            waiting = int(np.count_nonzero(players >= 0))
            if not waiting:
                break
            actions = np.full(len(batch), LEAVE_OPEN, np.uint16)
            for number, policy in enumerate(self._policies.values()):
                rows = np.flatnonzero(players == number)
                if len(rows):
                    actions[rows] = self._ask(policy, selected(batch, rows))
            self._taken += waiting
            batch = self._inside.take(actions)
            parts.append(batch)
        self._step += 1
        self._latest = batch
        return joined(parts, self._sizes, self._step, self._learner, self._taken)

    def _ask(self, policy: Policy, batch: Batch) -> NDArray[np.uint16]:
        """Returns the actions that a function chooses. Raises `ChefsHatError` for anything else."""
        seats = sorted(set(batch.seats.tolist()))
        name = f"the opponent {getattr(policy, '__name__', type(policy).__name__)} of seat {' and '.join(map(str, seats))}"
        try:
            actions = np.asarray(policy(batch))
        except Exception as error:
            raise ChefsHatError("OPPONENT_FAILED", f"{name} raised {error!r}") from error
        if actions.shape != (len(batch),) or actions.dtype.kind not in "iu":
            wanted = f"integers of the shape ({len(batch)},)"
            given = f"{actions.dtype} of the shape {actions.shape}"
            raise ChefsHatError("OPPONENT_FAILED", f"{name} returned {given}: return one action for each row, {wanted}")
        known = (actions >= 0) & (actions < self._sizes.num_actions)
        legal = known & is_legal(batch.mask_bits, np.where(known, actions, 0))
        if not legal.all():
            row = int(legal.argmin())
            where = f"row {row} (game {batch.games[row]}, seat {batch.seats[row]})"
            raise ChefsHatError(
                "OPPONENT_FAILED", f"{name} chose {actions[row]} in {where}, which is illegal: see batch.masks[{row}]"
            )
        return actions.astype("<u2", copy=False)


def selected(batch: Batch, rows: NDArray[np.intp]) -> Batch:
    """Returns rows of a batch, whose columns are extracted on demand, without what has happened in it."""
    chosen = Batch(len(rows), batch.sizes)
    chosen.source = lambda name: getattr(batch, name)[rows]
    chosen.observations.source = lambda name: getattr(batch.observations, name)[rows]
    return chosen


def joined(parts: list[Batch], sizes: Sizes, step: int, learner: NDArray[np.bool_], taken: int = 0) -> Batch:
    """Returns the rows of the last batch, with what has happened in all of them.

    Args:
        parts: the batches, in order.
        sizes: the numbers that determine the widths of columns.
        step: number of the batch.
        learner: (N,) the seats whose endings it has.
        taken: decisions so far that were not the learner's.
    """
    last = parts[-1]
    whole = Batch(len(last), sizes, _Joined(parts, step, learner, taken))
    whole.source = partial(getattr, last)
    whole.observations.source = partial(getattr, last.observations)
    whole.records = tuple(record for part in parts for record in part.records)
    return whole


class _Joined:
    """The content of several batches as one, for the learner's seats. See `batch.Content`."""

    def __init__(self, parts: list[Batch], step: int, learner: NDArray[np.bool_], taken: int) -> None:
        self._parts = parts
        self._learner = learner
        self._taken = taken
        self.step = step
        self.done = parts[-1].done

    def endings(self, sizes: Sizes) -> Endings:
        """Returns the episodes that have ended."""
        endings = [part.endings.take(self._learner[part.endings.seats]) for part in self._parts if len(part.endings)]
        return _by_game([Endings(0, sizes), *endings])

    def beginnings(self, sizes: Sizes) -> Beginnings:
        """Returns the games that have begun."""
        return _by_game([part.beginnings for part in self._parts])

    def shifts(self, sizes: Sizes) -> ShiftStatistics | None:
        """Returns the Shifts that have ended; None without statistics."""
        shifts = [part.shifts for part in self._parts]
        return None if shifts[0] is None else _by_game(cast(list[ShiftStatistics], shifts))

    def totals(self) -> Totals:
        """Returns the counts."""
        totals = self._parts[-1].totals
        mine = totals.client_decisions - self._taken
        return Totals(mine, totals.decisions, totals.invalid_attempts, totals.shifts, totals.games)


def _by_game(tables: list[AnyTable]) -> AnyTable:
    """Concatenates tables and sorts them by game; rows of a game stay in order."""
    filled = [table for table in tables if len(table)]
    if not filled:
        return tables[0]
    if len(filled) == 1:
        return filled[0]
    joined = type(filled[0]).concatenated(filled)
    return joined.take(np.argsort(joined.games, kind="stable"))  # type: ignore[attr-defined] # All have games.
