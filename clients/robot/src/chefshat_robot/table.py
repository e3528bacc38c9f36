"""The state of a game as one seat, or a spectator, sees it, from the game's events alone.

`follow` computes the next state from an event, `observe` from a decision. There are no rules here except who acts next, which the
events do not say.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from chefshat import pb

Item = TypeVar("Item")


@dataclass(frozen=True)
class TableState:
    """What is known of a game. Arrays of seats have one entry per seat; all are empty before the game starts.

    Attributes:
        seat: the own seat; None for a spectator.
        names: display names.
        shift: number of the Shift, from 1; 0 before the first.
        pizza: number of the pizza in the Shift, from 1.
        faces: number of faces F, by default 11.
        hand: own cards as F+1 counts, the jokers last; empty if unknown. Gifts are in it until the exchange is complete.
        golden: whether the own hand has the Golden card.
        board_face: 0 for an empty board, else 1..F, or F+1 for a lone joker.
        board_size: cards on the board, jokers included.
        board_jokers: jokers among them.
        cards_left: cards in each hand.
        passed: whether each seat has passed and is out of the pizza.
        places: place of each seat that has finished the Shift, from 1, else 0.
        roles: values of `pb.Role`.
        points: points in the game so far.
        to_act: the seat that decides next; None if unknown or nobody does.
        opening: the next play is the first of the Shift.
        golden_opening: the rules ask for the Golden card in the first play.
        pass_scope_turn: a pass counts for one turn only.
        over: the game has ended.
        hand_size: cards dealt to each seat.
        real_cards: the game is played with real cards at a physical table.
    """

    seat: int | None = None
    names: tuple[str, ...] = ()
    shift: int = 0
    pizza: int = 0
    faces: int = 11
    hand: tuple[int, ...] = ()
    golden: bool = False
    board_face: int = 0
    board_size: int = 0
    board_jokers: int = 0
    cards_left: tuple[int, ...] = ()
    passed: tuple[bool, ...] = ()
    places: tuple[int, ...] = ()
    roles: tuple[int, ...] = ()
    points: tuple[int, ...] = ()
    to_act: int | None = None
    opening: bool = False
    golden_opening: bool = True
    pass_scope_turn: bool = False
    over: bool = False
    hand_size: int = 0
    real_cards: bool = False

    @property
    def players(self) -> int:
        """Number of seats."""
        return len(self.names)

    def name(self, seat: int) -> str:
        """Display name of a seat, or its number if it has none."""
        return (self.names[seat] if seat < self.players else "") or str(seat)


def follow(state: TableState, event: pb.GameEvent) -> TableState:
    """Returns the state after an event."""
    match event.WhichOneof("kind"):
        case "game_started":
            return _started(state, event.game_started)
        case "shift_started":
            return _dealt(state, event.shift_started)
        case "hand_reported":
            return _hand_reported(state, event.hand_reported)
        case "roles_assigned":
            return replace(state, roles=tuple(event.roles_assigned.roles))
        case "cards_exchanged":
            return _exchanged(state, event.cards_exchanged)
        case "play":
            return _played(state, event.play)
        case "pass":
            seat = getattr(event, "pass").seat
            state = replace(state, passed=_with(state.passed, seat, True))
            return replace(state, to_act=_next(state, seat), opening=False, pizza=max(state.pizza, 1))
        case "pizza_done":
            return _pizza_done(state, event.pizza_done)
        case "seat_finished":
            finished = event.seat_finished
            state = replace(state, places=_with(state.places, finished.seat, finished.place))
            return replace(state, to_act=_next(state, finished.seat))
        case "shift_ended":
            return replace(state, points=tuple(event.shift_ended.points), to_act=None)
        case "game_ended" | "game_aborted":
            return replace(state, to_act=None, over=True)
        case "seated":
            return replace(state, names=_with(state.names, event.seated.seat, event.seated.name))
        case _:
            return state


def observe(state: TableState, seen: pb.Observation) -> TableState:
    """Returns the state corrected by the observation of a decision. They differ after a correction at a physical table."""
    hand = tuple(seen.hand)
    if seen.gave and not seen.received:
        # The events of the exchange, which are still to come, take the gifts out of the hand.
        hand = tuple(own + given for own, given in zip(hand, seen.gave, strict=True))
    return replace(
        state,
        shift=seen.shift,
        pizza=max(seen.pizza, 1),
        hand=hand,
        golden=seen.golden,
        board_face=seen.board_face,
        board_size=seen.board_size,
        board_jokers=seen.board_jokers,
        cards_left=tuple(seen.cards_left),
        passed=tuple(map(bool, seen.passed)),
        places=tuple(seen.places),
        roles=tuple(seen.roles),
        points=tuple(seen.points),
    )


def counts_of(cards: Sequence[int], faces: int) -> tuple[int, ...]:
    """Counts cards (1..F, F+1 a joker) by face: F+1 numbers."""
    return tuple(list(cards).count(face) for face in range(1, faces + 2))


def _started(state: TableState, started: pb.GameStarted) -> TableState:
    seats = len(started.seats)
    return replace(
        state,
        names=tuple(seat.name for seat in started.seats),
        faces=started.rules.faces or 11,
        hand_size=started.hand_size,
        golden_opening=started.rules.opening != pb.OPENING_ANY_TOP_FACE,
        pass_scope_turn=started.rules.pass_scope == pb.PASS_SCOPE_TURN,
        cards_left=(0,) * seats,
        passed=(False,) * seats,
        places=(0,) * seats,
        roles=(0,) * seats,
        points=(0,) * seats,
    )


def _dealt(state: TableState, dealt: pb.ShiftStarted) -> TableState:
    own = next((hand for hand in dealt.hands if hand.seat == state.seat), None)
    return replace(
        state,
        shift=dealt.shift,
        pizza=1,
        hand=counts_of(list(own.cards), state.faces) if own is not None else (),
        golden=own is not None and own.golden,
        board_face=0,
        board_size=0,
        board_jokers=0,
        cards_left=(state.hand_size,) * state.players,
        passed=(False,) * state.players,
        places=(0,) * state.players,
        to_act=None,
        opening=True,
    )


def _hand_reported(state: TableState, reported: pb.HandReported) -> TableState:
    hand = reported.hand
    if hand.seat != state.seat or not hand.cards:
        return replace(state, real_cards=True)
    return replace(state, real_cards=True, hand=counts_of(list(hand.cards), state.faces), golden=hand.golden)


def _exchanged(state: TableState, exchanged: pb.CardsExchanged) -> TableState:
    moved = counts_of(list(exchanged.cards), state.faces)
    if state.hand and exchanged.cards:
        if exchanged.giver == state.seat:
            hand = tuple(own - gone for own, gone in zip(state.hand, moved, strict=True))
            state = replace(state, hand=hand, golden=state.golden and not exchanged.golden)
        elif exchanged.receiver == state.seat:
            hand = tuple(own + new for own, new in zip(state.hand, moved, strict=True))
            state = replace(state, hand=hand, golden=state.golden or exchanged.golden)
    return state


def _played(state: TableState, play: pb.Play) -> TableState:
    if play.seat == state.seat and state.hand:
        gone = [0] * (state.faces + 1)
        if play.quantity:
            gone[play.face - 1] = play.quantity
        gone[state.faces] += play.jokers
        golden = state.golden and not plays_golden(state, play.face, play.quantity)
        hand = tuple(own - lost for own, lost in zip(state.hand, gone, strict=True))
        state = replace(state, hand=hand, golden=golden)
    state = replace(
        state,
        pizza=max(state.pizza, 1),
        board_face=play.face,
        board_size=play.quantity + play.jokers,
        board_jokers=play.jokers,
        cards_left=_with(state.cards_left, play.seat, play.cards_left),
        passed=(False,) * state.players if state.pass_scope_turn else state.passed,
        opening=False,
    )
    return replace(state, to_act=_next(state, play.seat))


def plays_golden(state: TableState, face: int, quantity: int) -> bool:
    """Whether a play of the own hand includes the Golden card: the opening plays it first, every other play last (rules §8.1)."""
    if not state.golden or face != state.faces or not quantity:
        return False
    return (state.opening and state.golden_opening) or quantity == state.hand[face - 1]


def _pizza_done(state: TableState, done: pb.PizzaDone) -> TableState:
    return replace(
        state,
        pizza=done.pizza + 1,
        board_face=0,
        board_size=0,
        board_jokers=0,
        passed=(False,) * state.players,
        to_act=done.next_leader,
    )


def _next(state: TableState, seat: int) -> int | None:
    """The next seat to the left that holds cards and is not out of the pizza; None if there is none but the seat itself."""
    for step in range(1, state.players):
        other = (seat + step) % state.players
        if state.cards_left[other] and (state.pass_scope_turn or not state.passed[other]):
            return other
    return None


def _with(items: tuple[Item, ...], index: int, item: Item) -> tuple[Item, ...]:
    return (*items[:index], item, *items[index + 1 :]) if index < len(items) else items
