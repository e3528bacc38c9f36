"""What happens at a synthetic table, as values: acts with times, from a random Shift or the record of a game.

A script knows nothing about pictures. `table.py` plays it.
"""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from chefshat_robot.deck import FACES, JOKERS, Card, deck

SEATS = 4
MAX_PLACES = 11


@dataclass(frozen=True)
class LayCards:
    """A seat lays cards on the first places, on top of what lies there.

    Attributes:
        start: Time at which the hand comes, in s.
        seat: The seat, 0..3.
        cards: The cards.
        places: The place of each card, 1..11.
        face_down: Whether they are laid with their backs up.
    """

    start: float
    seat: int
    cards: tuple[Card, ...]
    places: tuple[int, ...]
    face_down: bool = False


@dataclass(frozen=True)
class ShowPass:
    """A seat lays its pass card at its pass place.

    Attributes:
        start: Time at which the hand comes, in s.
        seat: The seat, 0..3.
        face_down: Whether it is laid with its back up.
    """

    start: float
    seat: int
    face_down: bool = False


@dataclass(frozen=True)
class WithdrawPass:
    """A seat takes its pass card back."""

    start: float
    seat: int


@dataclass(frozen=True)
class Clear:
    """A seat sweeps all cards off the places."""

    start: float
    seat: int


@dataclass(frozen=True)
class TakeBack:
    """A seat takes back the top cards of some places."""

    start: float
    seat: int
    places: tuple[int, ...]


@dataclass(frozen=True)
class Hover:
    """A hand passes over places, holds still there, and leaves without doing anything.

    Attributes:
        start: Time at which the hand comes, in s.
        seat: The seat, 0..3.
        place: The place over which it holds still, 1..11.
        duration: How long it holds still, in s.
        card: A card it holds meanwhile, if any.
    """

    start: float
    seat: int
    place: int
    duration: float
    card: Card | None = None


Act: TypeAlias = LayCards | ShowPass | WithdrawPass | Clear | TakeBack | Hover


@dataclass(frozen=True)
class Play:
    """A step of a Shift: cards were played."""

    seat: int
    cards: tuple[Card, ...]


@dataclass(frozen=True)
class Pass:
    """A step of a Shift: a seat passed."""

    seat: int


@dataclass(frozen=True)
class PizzaDone:
    """A step of a Shift: the board is cleared. The seat is the one whose turn is next."""

    seat: int


Step: TypeAlias = Play | Pass | PizzaDone
"""A step of a Shift, in the order of the game, without times."""


def random_shift(seed: int, deck_number: int = 0) -> list[Step]:
    """Plays one Shift of four seats by random legal actions (docs/rules.md, section 4) and returns its steps.

    Seats pass one time in ten although they could play, and rather play many cards than few.
    """
    rng = random.Random(f"shift {seed}")
    cards = deck(deck_number)
    rng.shuffle(cards)
    hands = [sorted(cards[seat::SEATS]) for seat in range(SEATS)]
    turn = next(seat for seat in range(SEATS) if any(card.is_golden for card in hands[seat]))
    steps: list[Step] = []
    passed: set[int] = set()
    board: tuple[Card, ...] = ()
    last = leader = turn
    idle_pizzas = 0
    while sum(bool(hand) for hand in hands) > 1:
        active = [seat for seat in range(SEATS) if hands[seat] and seat not in passed]
        if not [seat for seat in active if seat != last or not board]:
            idle_pizzas = 0 if board else idle_pizzas + 1
            after = last if board else leader + 1
            turn = leader = next(seat % SEATS for seat in range(after, after + SEATS) if hands[seat % SEATS])
            steps.append(PizzaDone(turn))
            passed, board = set(), ()
            continue
        if turn in active:
            options = _plays(hands[turn], board, first=not steps)
            must = not steps or (not board and idle_pizzas >= 3)
            if options and (must or rng.random() < 0.9):
                board = rng.choices(options, weights=[len(option) ** 3 for option in options])[0]
                hands[turn] = [card for card in hands[turn] if card not in board]
                last = turn
                steps.append(Play(turn, board))
            else:
                passed.add(turn)
                steps.append(Pass(turn))
        turn = (turn + 1) % SEATS
    steps.append(PizzaDone(turn))
    return steps


def _plays(hand: list[Card], board: tuple[Card, ...], first: bool) -> list[tuple[Card, ...]]:
    """The legal plays of a hand, one for each face, number of cards and number of jokers."""
    jokers = [card for card in hand if card.is_joker]
    ceiling = min((card.face for card in board), default=FACES + 2)
    options: list[tuple[Card, ...]] = []
    for face, count in Counter(card.face for card in hand if not card.is_joker).items():
        if face >= ceiling or (first and face != FACES):
            continue
        of_face = [card for card in hand if card.face == face]
        if first:
            of_face.sort(key=lambda card: not card.is_golden)
        options += [
            (*of_face[:plain], *jokers[:wild])
            for plain in range(1, count + 1)
            for wild in range(len(jokers) + 1)
            if max(1, len(board)) <= plain + wild <= MAX_PLACES
        ]
    if jokers and not board and not first:
        options.append((jokers[0],))
    return [option for option in options if not first or any(card.is_golden for card in option)]


def shifts_of_record(path: Path, deck_number: int = 0) -> list[list[Step]]:
    """The Shifts of a recorded game, as steps.

    Records name faces, not single cards: each play gets cards of its face that were not played before in the Shift. The Golden card
    is the first 11 of a Shift that opens with 11s, and otherwise the last.

    Args:
        path: A record as the server writes it (JSON Lines) of two to four players with the default deck.
        deck_number: The deck the cards are taken from.

    Raises:
        ValueError: It is not such a record.
    """
    shifts: list[list[Step]] = []
    unused: dict[int, list[Card]] = {}
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            event: dict[str, Any] = json.loads(line).get("event", {})
        except (json.JSONDecodeError, AttributeError) as error:
            raise ValueError(f"{path}: line {number} is not a line of a game's record") from error
        if "gameStarted" in event:
            rules = event["gameStarted"]["rules"]
            if (rules.get("players"), rules.get("faces"), rules.get("jokers")) not in [(n, FACES, JOKERS) for n in (2, 3, 4)]:
                raise ValueError(f"{path}: the table has {SEATS} seats and the default deck; this game is of another size")
        elif "shiftStarted" in event:
            shifts.append([])
            unused = {face: [card for card in deck(deck_number) if card.face == face] for face in range(1, FACES + 2)}
        elif "play" in event:
            play = event["play"]
            face = int(play["face"])
            plain, wild = int(play.get("quantity", 0)), int(play.get("jokers", 0))
            if face == FACES and not shifts[-1]:
                unused[FACES].sort(key=lambda card: not card.is_golden)
            cards = [unused[face].pop(0) for _ in range(plain)] + [unused[FACES + 1].pop(0) for _ in range(wild)]
            shifts[-1].append(Play(int(play.get("seat", 0)), tuple(cards)))
        elif "pass" in event:
            shifts[-1].append(Pass(int(event["pass"].get("seat", 0))))
        elif "pizzaDone" in event:
            shifts[-1].append(PizzaDone(int(event["pizzaDone"].get("nextLeader", 0))))
    if not shifts:
        raise ValueError(f"{path}: no Shift in it; give the record of a game, as lies in the server's records directory")
    return shifts


REACH_TIME = 0.3
"""Time in which a hand comes to a place, or leaves from it, in s."""
NEXT_PLACE_TIME = 0.13
"""Time in which a hand gets from one place to the next, in s."""
SWEEP_TIME = 0.6
"""Time in which a hand sweeps over all places, in s."""


def duration(act: Act) -> float:
    """How long a hand is over the table for an act, in s."""
    if isinstance(act, LayCards):
        return 2 * REACH_TIME + NEXT_PLACE_TIME * (len(act.cards) - 1)
    if isinstance(act, TakeBack):
        return 2 * REACH_TIME + NEXT_PLACE_TIME * (len(act.places) - 1)
    if isinstance(act, Clear):
        return 2 * REACH_TIME + SWEEP_TIME
    if isinstance(act, Hover):
        return 2 * REACH_TIME + act.duration
    return 2 * REACH_TIME


def acts_of_steps(
    steps: Iterable[Step], seed: int, pause: tuple[float, float] = (0.7, 1.2), hovers: float = 0.0, start: float = 1.0
) -> list[Act]:
    """The acts at the table that show the steps of a Shift, with times.

    Cards are laid on the places 1, 2, … in their order. A pass card stays at its place until the pizza is done; then the next seat
    sweeps the cards away and all take their pass cards back.

    Args:
        steps: The steps.
        seed: Decides the pauses and who passes over the table.
        pause: Shortest and longest time between a hand's leaving and the next hand's coming, in s.
        hovers: Probability, at each play, that a hand then passes over the places.
        start: Time of the first act, in s: until then the field is empty.
    """
    rng = random.Random(f"acts {seed}")
    acts: list[Act] = []
    now = start
    passed: list[int] = []
    lying = False
    for step in steps:
        if isinstance(step, Play):
            acts.append(LayCards(now, step.seat, step.cards, tuple(range(1, len(step.cards) + 1))))
            lying = True
        elif isinstance(step, Pass):
            acts.append(ShowPass(now, step.seat))
            passed.append(step.seat)
        else:
            first = now
            if lying:
                acts.append(Clear(now, step.seat))
                first += 0.3
            acts += [WithdrawPass(first + rng.uniform(0.0, 0.6), seat) for seat in passed]
            passed, lying = [], False
            now = max((act.start + duration(act) for act in acts[-5:]), default=now) + rng.uniform(*pause)
            continue
        now = acts[-1].start + duration(acts[-1]) + rng.uniform(*pause)
        if isinstance(step, Play) and rng.random() < hovers:
            acts.append(Hover(now, rng.randrange(SEATS), rng.randint(1, MAX_PLACES), rng.uniform(0.1, 0.6)))
            now += duration(acts[-1]) + rng.uniform(*pause)
    return sorted(acts, key=lambda act: act.start)
