"""The history column: who did what since the Shift began, as the seat of a row may know it.

It exists in environments with `history=K`, and in `Decision.situations(history=K)` of a live game, where `ShiftLog` collects the
events and `entries` turns them into the same column. With the hand, the history is an information state with perfect recall of the
Shift, unless `history_counts` exceeds K. `actors` and `actions` take the column apart; `tokens` makes sequences for a model of it.

The vocabulary of `tokens`, for N seats and A actions:

| token | meaning |
|---|---|
| 0 | padding |
| 1..=N | the seat that acts: 1 is the seat of the row, 2 the next to its left, and so on |
| N+1..=N+A | the action with the index token - N - 1 |
| N+A+1 | a gift of a card that the seat may not know |
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.columns import Situations, Sizes

PADDING = 0
#: In `actors` and `actions`: there is no entry.
NONE = -1


def actors(situations: Situations) -> NDArray[np.int32]:
    """Returns (R, K): the seat of each entry, -1 where there is none."""
    return _parts(situations)[0]


def actions(situations: Situations) -> NDArray[np.int32]:
    """Returns (R, K): the action of each entry, A for a gift of an unknown card, -1 where there is none."""
    return _parts(situations)[1]


def tokens(situations: Situations) -> NDArray[np.int32]:
    """Returns (R, 2K): the seat and the action of each entry as tokens, the most recent last, after padding."""
    viewers = situations.seats[:, np.newaxis].astype(np.int32)
    return tokens_of(*_parts(situations), viewers, situations.sizes).reshape(len(situations), 2 * situations.sizes.history)


def tokens_of(seats: NDArray[np.int32], actions: NDArray[np.int32], viewers: NDArray[np.int32], sizes: Sizes) -> NDArray[np.int32]:
    """Returns (..., 2): the tokens of entries as these seats see them."""
    pairs = np.stack([1 + (seats - viewers) % sizes.players, 1 + sizes.players + actions], axis=-1)
    return np.where((seats == NONE)[..., np.newaxis], PADDING, pairs).astype(np.int32)


def vocabulary_size(sizes: Sizes) -> int:
    """Returns the number of tokens, N + A + 2."""
    return sizes.players + sizes.num_actions + 2


def _parts(situations: Situations) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Returns the seats and actions of the entries."""
    sizes = situations.sizes
    if not sizes.history:
        raise ValueError("there is no history: create the VectorEnv with history=K, the number of actions to see")
    return parts_of(situations.observations.history, sizes)


def parts_of(numbers: NDArray[np.integer[Any]], sizes: Sizes) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Returns the seats and actions of entries that are numbered as in the column."""
    entries = numbers.astype(np.int32) - 1
    width = sizes.num_actions + 1
    return np.where(entries < 0, NONE, entries // width), np.where(entries < 0, NONE, entries % width)


class Entry(NamedTuple):
    """An action of a seat.

    Attributes:
        seat: the seat.
        action: the action, A for a gift of a card that is unknown.
    """

    seat: int
    action: int


class ShiftLog:
    """The events of a Shift of a live game, as a seat sees them.

    Attributes:
        events: the events from `shift_started` on, without those of the room.
        is_complete: whether they begin with `shift_started`.
        first_gift: the card that the seat gave first, F+1 for a joker; 0 if it has not given one or this process did not see it.
    """

    __slots__ = ("events", "first_gift", "is_complete")

    def __init__(self, events: Sequence[pb.GameEvent] = (), *, is_complete: bool = False) -> None:
        self.events = list(events)
        self.is_complete = is_complete
        self.first_gift = 0

    def add(self, event: pb.GameEvent) -> "ShiftLog":
        """Adds an event. Returns the log that the next one is added to: another one if a Shift began or events became void."""
        kind = event.WhichOneof("kind")
        if kind == "shift_started":
            return ShiftLog([event], is_complete=True)
        if kind == "correction" and event.correction.first_void > 0:
            standing = [earlier for earlier in self.events if earlier.sequence < event.correction.first_void]
            return ShiftLog(standing, is_complete=self.is_complete and len(standing) > 0)
        if kind in _KINDS:
            self.events.append(event)
        return self

    def asked(self, request: pb.DecisionRequest) -> None:
        """Remembers the first of two gifts, whose order no event tells."""
        if request.kind == pb.DECISION_KIND_EXCHANGE and any(request.observation.gave):
            self.first_gift = next(_cards(request.observation.gave))


def entries(log: ShiftLog, count: int, request: pb.DecisionRequest, seat: int, started: pb.GameStarted) -> list[Entry]:
    """Returns the actions of the Shift as a seat knows them at its decision.

    Args:
        log: the events of the Shift.
        count: how many of them the seat had seen at its decision.
        request: the decision.
        seat: the seat.
        started: the start of the game.
    """
    sizes = Sizes.of(started)
    turns, decline = sizes.turn_actions, sizes.num_actions - 2
    special: list[Entry] = []
    chosen: list[Entry] = []
    forced: list[Entry] = []
    turned: list[Entry] = []
    roles = request.observation.roles
    dealt_jokers = 0
    for event in log.events[:count]:
        what = event.WhichOneof("kind")
        if what == "play":
            turned.append(Entry(event.play.seat, event.play.action))
        elif what == "pass":
            turned.append(Entry(getattr(event, "pass").seat, turns - 1))
        elif what == "special_action_declared":
            special.append(Entry(event.special_action_declared.seat, decline + 1))
        elif what == "cards_exchanged":
            gift = event.cards_exchanged
            has_choice = roles[gift.giver] in (pb.ROLE_CHEF, pb.ROLE_SOUS_CHEF)
            cards = list(gift.cards)
            if gift.giver == seat and log.first_gift in cards[1:]:
                # In the order of the decisions.
                cards.remove(log.first_gift)
                cards.insert(0, log.first_gift)
            given = [turns + card - 1 for card in cards] or [sizes.num_actions] * gift.count
            (chosen if has_choice else forced).extend(Entry(gift.giver, action) for action in given)
        elif what == "shift_started":
            own = (hand.cards for hand in event.shift_started.hands if hand.seat == seat)
            dealt_jokers = sum(card > sizes.faces for cards in own for card in cards)
        elif event.hand_reported.dealt and event.hand_reported.hand.seat == seat:
            dealt_jokers = sum(card > sizes.faces for card in event.hand_reported.hand.cards)
    # No event tells of a declined special action: only the seat itself knows that it could have declared it.
    may_declare = started.rules.special_actions and any(roles) and dealt_jokers == 2
    if may_declare and not special and request.kind != pb.DECISION_KIND_SPECIAL_ACTION:
        special.append(Entry(seat, decline))
    if request.kind == pb.DECISION_KIND_EXCHANGE:
        chosen = list(_gifts_so_far(request.observation, seat, sizes))
    return special + chosen + forced + turned


def columns(seen: Sequence[Entry], sizes: Sizes) -> tuple[NDArray[np.uint16], NDArray[np.uint32]]:
    """Returns one row of the columns `history` and `history_counts`."""
    numbers = [1 + seat * (sizes.num_actions + 1) + action for seat, action in seen[-sizes.history :]]
    row = np.zeros((1, sizes.history), np.uint16)
    row[0, sizes.history - len(numbers) :] = numbers
    return row, np.array([len(seen)], np.uint32)


#: The events that a log keeps.
_KINDS = frozenset(
    ("roles_assigned", "special_action_declared", "cards_exchanged", "play", "pass", "pizza_done", "seat_finished", "hand_reported")
)


def _gifts_so_far(seen: pb.Observation, seat: int, sizes: Sizes) -> Iterator[Entry]:
    """Returns the gifts of an exchange that is not complete: no event tells of them yet."""
    for role in (pb.ROLE_CHEF, pb.ROLE_SOUS_CHEF):
        giver = seen.roles.index(role)
        if giver == seat:
            yield from (Entry(seat, sizes.turn_actions + card - 1) for card in _cards(seen.gave))
            return
        yield from [Entry(giver, sizes.num_actions)] * (sizes.hand_size - seen.cards_left[giver])


def _cards(counts: bytes) -> Iterator[int]:
    """Returns the cards with these counts, ascending, F+1 for a joker."""
    return (card for card, count in enumerate(counts, start=1) for _ in range(count))
