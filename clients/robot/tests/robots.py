"""Robots for tests, and a table to play at. Contains no tests."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator

from chefshat import pb

from chefshat_robot.drivers.driver import Act, Done, Driver, Outcome
from chefshat_robot.table import TableState

SEATS = ("Ada", "Pepe", "Cleo", "Dan")
HAND = [2, 2, 5, 7, 9, 9, 9, 10, 10, 10, 11, 11, 11, 11, 11, 12, 12]


class ScriptedRobot(Driver):
    """A robot in this process that does what the test says.

    Attributes:
        acts: what it was asked to do.
        stops: how often it was stopped.
        seen: the events it was shown.
        state: the last state it was shown.
    """

    def __init__(self, behaviour: Callable[[Act], Outcome | Exception | None] = lambda act: Done()) -> None:
        """Creates it.

        Args:
            behaviour: the outcome of an act; None: it never ends; an exception: raised.
        """
        super().__init__()
        self.acts: list[Act] = []
        self.stops = 0
        self.seen: list[pb.GameEvent] = []
        self.state: TableState | None = None
        self._behaviour = behaviour

    async def connect(self) -> None:
        pass

    async def perform(self, act: Act) -> Outcome:
        self.acts.append(act)
        outcome = self._behaviour(act)
        if isinstance(outcome, Exception):
            raise outcome
        if outcome is None:
            await asyncio.Event().wait()
            raise AssertionError("unreachable")
        return outcome

    async def stop(self) -> None:
        self.stops += 1

    async def show_event(self, event: pb.GameEvent) -> None:
        self.seen.append(event)

    async def show_state(self, state: TableState) -> None:
        self.state = state

    async def close(self) -> None:
        pass


def numbered(*kinds: dict[str, object]) -> Iterator[pb.GameEvent]:
    """Yields events with the numbers 1, 2, …"""
    for number, kind in enumerate(kinds, 1):
        yield pb.GameEvent(sequence=number, elapsed_ms=100 * number, **kind)  # type: ignore[arg-type]


def game_started() -> dict[str, object]:
    """The start of a game of four."""
    seats = [pb.Participant(seat=seat, name=name, connected=True) for seat, name in enumerate(SEATS)]
    rules = pb.RuleSet(players=4, faces=11, jokers=2, opening=pb.OPENING_GOLDEN, pass_scope=pb.PASS_SCOPE_PIZZA)
    return {"game_started": pb.GameStarted(game_id="ab", rules=rules, seats=seats, hand_size=17)}


def shift_started(cards: list[int] = HAND, *, golden: bool = True, seat: int = 1) -> dict[str, object]:
    """A deal; the viewer's seat gets `cards`."""
    return {"shift_started": pb.ShiftStarted(shift=1, hands=[pb.SeatCards(seat=seat, cards=cards, golden=golden)])}


def play(seat: int, face: int, quantity: int, jokers: int = 0, cards_left: int = 9) -> dict[str, object]:
    return {"play": pb.Play(seat=seat, face=face, quantity=quantity, jokers=jokers, cards_left=cards_left)}


def passed(seat: int) -> dict[str, object]:
    return {"pass": pb.Pass(seat=seat)}


def pizza_done(last: int, leader: int, pizza: int = 1) -> dict[str, object]:
    return {"pizza_done": pb.PizzaDone(pizza=pizza, last_to_play=last, next_leader=leader)}
