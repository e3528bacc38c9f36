"""Translates our events to the calls that players of the reference implementation get.

The reference says "match" for a Shift and "round" for a pizza; only this module uses its words. There is no process, no server and
no rule here: for example, the next seat to act is known only when it acts. Decisions are in `agent`.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from chefshat import pb

# The sizes of the reference's games. Its 228 numbers are FACES of the board, HAND of the hand, and the mask.
PLAYERS = 4
FACES = 11
HAND = 17
JOKER = FACES + 1
EMPTY = FACES + 2
#: Its 200 actions by name, in the order of its mask.
ACTIONS = tuple(
    [f"C{face};Q{quantity};J{jokers}" for face in range(1, FACES + 1) for quantity in range(1, face + 1) for jokers in range(3)]
    + ["C0;Q0;J1", "pass"]
)
PASS = len(ACTIONS) - 1
EMPTY_BOARD = [EMPTY] + [0] * (FACES - 1)
#: Points of a match by place, independent of the room's rules: its players infer their place from them.
MATCH_POINTS = (3, 2, 1, 0)
#: Points of an unfinished match.
UNKNOWN = -1

ROLES = {pb.ROLE_CHEF: "Chef", pb.ROLE_SOUS_CHEF: "Souschef", pb.ROLE_WAITER: "Waiter", pb.ROLE_DISHWASHER: "Dishwasher"}
ROLES_BY_PLACE = ("Chef", "Souschef", "Waiter", "Dishwasher")
FOOD_FIGHT = "It is food fight!"
DINNER_SERVED = "Dinner served!"


class Call(NamedTuple):
    """A method of the player to call, with its arguments."""

    method: str
    arguments: list[Any]


class Asked(NamedTuple):
    """A turn of the player: the 228 numbers, and whether its choice was replaced."""

    vector: list[float]
    replaced: bool


class Table:
    """One game as one seat has seen it."""

    def __init__(self, seat: int, own_name: str) -> None:
        self._seat = seat
        self._own_name = own_name
        self._names: list[str] = []
        self._matches = 0
        self._rounds = 1
        self._hand: list[int] = []
        self._sent: list[int] = []
        self._received: list[int] = []
        self._board = EMPTY_BOARD
        self._cards = [HAND] * PLAYERS
        self._last_actions = [""] * PLAYERS
        self._finished = [False] * PLAYERS
        self._roles = [""] * PLAYERS
        self._match_score = [UNKNOWN] * PLAYERS
        self._game_score = [0] * PLAYERS
        self._performance = [0.0] * PLAYERS
        # Whether the player knows that the match has begun; it is notified when the first seat to act is known.
        self._begun = False
        self._asked: Asked | None = None
        # The last action, until its consequences are known.
        self._pending: dict[str, Any] | None = None
        #: The last action as the player was notified of it.
        self.info: dict[str, Any] = {}

    def event(self, event: pb.GameEvent) -> list[Call]:
        """Processes an event. Returns the calls to make."""
        calls: list[Call] = []
        match event.WhichOneof("kind"):
            case "game_started":
                self._names = self._unique([seat.name or seat.built_in_agent for seat in event.game_started.seats])
            case "shift_started":
                self._deal(event.shift_started)
            case "roles_assigned":
                self._roles = [ROLES.get(role, "") for role in event.roles_assigned.roles]
            case "special_action_declared":
                declared = event.special_action_declared
                fight = declared.action == pb.SPECIAL_ACTION_FOOD_FIGHT
                calls.append(Call("observe_special_action", [FOOD_FIGHT if fight else DINNER_SERVED, declared.seat]))
            case "cards_exchanged":
                self._exchange(event.cards_exchanged)
            case "play":
                calls += self.turn_of(event.play.seat)
                self._play(event.play)
            case "pass":
                # `pass` is a keyword of Python.
                passed: pb.Pass = getattr(event, "pass")
                calls += self.turn_of(passed.seat)
                self._act(passed.seat, PASS, passed.source, self._board, self._cards[passed.seat])
            case "pizza_done":
                self._pizza_done(event.pizza_done)
            case "seat_finished":
                self._finished[event.seat_finished.seat] = True
            case "shift_ended":
                calls += self._shift_ended(event.shift_ended)
            case "game_ended" | "game_aborted":
                calls += [*self._settle(UNKNOWN), Call("update_game_over", [])]
        return calls

    def turn_of(self, seat: int) -> list[Call]:
        """Sets the seat that acts next. Returns the calls to make before."""
        calls = self._settle(seat)
        if not self._begun:
            self._begun = True
            if self._sent or self._received:
                calls.append(Call("update_exchange_cards", [sorted(self._sent), sorted(self._received)]))
            calls.append(Call("update_start_match", [sorted(self._hand), list(self._names), self._names[seat]]))
        return calls

    def asked(self, vector: list[float], *, replaced: bool) -> None:
        """Stores a turn of the player, and whether its choice was replaced."""
        self._asked = Asked(vector, replaced)

    def _deal(self, started: pb.ShiftStarted) -> None:
        self._matches += 1
        self._rounds = 1
        self._hand = [card for hand in started.hands if hand.seat == self._seat for card in hand.cards]
        self._sent, self._received = [], []
        self._board = EMPTY_BOARD
        self._cards = [HAND] * PLAYERS
        self._last_actions = [""] * PLAYERS
        self._finished = [False] * PLAYERS
        self._match_score = [UNKNOWN] * PLAYERS
        self._begun = False

    def _exchange(self, exchanged: pb.CardsExchanged) -> None:
        if exchanged.giver == self._seat:
            self._sent += exchanged.cards
            self._take_away(exchanged.cards)
        elif exchanged.receiver == self._seat:
            self._received += exchanged.cards
            self._hand += exchanged.cards

    def _play(self, play: pb.Play) -> None:
        jokers_alone = play.quantity == 0
        cards = [JOKER] if jokers_alone else [play.face] * play.quantity + [JOKER] * play.jokers
        board = (cards + [0] * FACES)[:FACES]
        self._act(play.seat, play.action, play.source, board, play.cards_left)
        if play.seat == self._seat:
            self._take_away(cards)

    def _act(self, seat: int, action: int, source: int, board: list[int], cards_left: int) -> None:
        """Stores an action, for `_settle`."""
        before = self._vector(action)
        asked = self._asked if seat == self._seat else None
        if asked is not None:
            before, self._asked = asked.vector, None
        random = source != pb.DECISION_SOURCE_AGENT or (asked is not None and asked.replaced)
        self._pending = {
            "Author_Index": seat,
            "Author_Possible_Actions": [name for name, legal in zip(ACTIONS, before[FACES + HAND :], strict=True) if legal],
            "Action_Valid": True,
            "Action_Random": random,
            "Action_Index": action,
            "Action_Decoded": ACTIONS[action],
            "Is_Pizza": False,
            "Pizza_Author": -1,
            "Board_Before": list(self._board),
            "Board_After": list(board),
            "Observation_Before": before,
        }
        self._board = board
        self._cards[seat] = cards_left
        self._last_actions[seat] = ACTIONS[action]

    def _pizza_done(self, done: pb.PizzaDone) -> None:
        self._rounds = done.pizza + 1
        self._board = EMPTY_BOARD
        self._last_actions = [last if finished else "" for last, finished in zip(self._last_actions, self._finished, strict=True)]
        if self._pending is not None:
            self._pending["Is_Pizza"] = True
            self._pending["Pizza_Author"] = done.last_to_play if done.HasField("last_to_play") else -1

    def _shift_ended(self, ended: pb.ShiftEnded) -> list[Call]:
        for place, seat in enumerate(ended.order):
            points = MATCH_POINTS[place]
            self._match_score[seat] = points
            self._game_score[seat] += points
            before = self._performance[seat] * (self._matches - 1)
            self._performance[seat] = (before + 10 * points / max(ended.pizzas, 1)) / self._matches
            self._roles[seat] = ROLES_BY_PLACE[place]
        self._finished = [True] * PLAYERS
        # The last seat still has cards and would be next.
        return [*self._settle(ended.order[-1]), Call("update_end_match", [self._for(others=True)])]

    def _settle(self, next_player: int) -> list[Call]:
        """Returns the calls about the last action, whose consequences are known now."""
        action, self._pending = self._pending, None
        if action is None:
            return []
        self.info = {
            "Matches": self._matches,
            "Rounds": self._rounds,
            "Player_Names": list(self._names),
            **action,
            "Finished_Players": list(self._finished),
            "Cards_Per_Player": list(self._cards),
            "Last_action_Per_Player": list(self._last_actions),
            "Next_Player": next_player,
            "Current_Roles": list(self._roles),
            "Match_Score": list(self._match_score),
            "Game_Score": list(self._game_score),
            "Game_Performance_Score": list(self._performance),
            "Observation_After": self._vector(PASS),
        }
        own = action["Author_Index"] == self._seat
        return [Call("update_my_action" if own else "update_action_others", [self._for(others=not own)])]

    def _for(self, *, others: bool) -> dict[str, Any]:
        """Returns the last action; of other seats', the reference hides what only they may know."""
        if not others:
            return dict(self.info)
        hidden = ("Observation_Before", "Observation_After", "Action_Random", "Author_Possible_Actions")
        return {**self.info, **dict.fromkeys(hidden, "")}

    def _vector(self, action: int) -> list[float]:
        """Returns the 228 numbers outside of the player's turns, with a single action instead of a mask."""
        hand = sorted(self._hand)
        cards = [*self._board, *([0] * (HAND - len(hand))), *hand]
        mask = [0.0] * len(ACTIONS)
        mask[action] = 1.0
        return [card / EMPTY for card in cards] + mask

    def _take_away(self, cards: Sequence[int]) -> None:
        for card in cards:
            if card in self._hand:
                self._hand.remove(card)

    def _unique(self, names: list[str]) -> list[str]:
        """Makes the players' names unique, with its own name for its seat: players identify themselves by name."""
        taken = {self._own_name}
        unique = []
        for seat, name in enumerate(names):
            if seat == self._seat:
                unique.append(self._own_name)
                continue
            # Appends the seat until the name is unique.
            while name in taken:
                name = f"{name} ({seat})"
            taken.add(name)
            unique.append(name)
        return unique
