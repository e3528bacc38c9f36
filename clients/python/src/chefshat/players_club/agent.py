"""A player of the reference implementation's second version as an agent of this package: its answers become actions.

The player itself is in a process of its own (`process`), and sees the game as it is used to (`table`). Here is what its answers
mean, and what is done where it has none: the default decision of the rules. An illegal choice is sent to the server, which counts
it and asks again, as often as the reference would; then the legal choice that the player likes best is taken.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from chefshat import pb
from chefshat.agents import Agent
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.players_club.process import AgentError, AgentProcess
from chefshat.players_club.table import ACTIONS, DINNER_SERVED, FACES, FOOD_FIGHT, JOKER, PASS, PLAYERS, Call, Table
from chefshat.result import SeatResult

LOG = logging.getLogger("chefshat")

JOKERS = 2
#: How often an illegal choice is sent before a legal one is: what the reference allows.
ATTEMPTS = 5
# Numbers of the actions that are no turn, for eleven faces. Giving card c, jokers included, is GIVE + c.
GIVE = len(ACTIONS) - 1
DECLINE = len(ACTIONS) + FACES + 1
DECLARE = DECLINE + 1
# Cards that the Chef and the Sous-Chef choose to give.
GIVEN_BY: dict[int, int] = {pb.ROLE_CHEF: 2, pb.ROLE_SOUS_CHEF: 1}
# Failures that are told in full. An agent that fails once often does so at every decision.
TOLD = 3


class RulesDoNotFit(ValueError):
    """Its players know no other games than those of four players, eleven faces and two jokers."""


def check_rules(rules: pb.RuleSet) -> None:
    """Raises RulesDoNotFit for a game whose numbers are not those that players of the reference implementation know."""
    if (rules.players, rules.faces, rules.jokers) != (PLAYERS, FACES, JOKERS):
        raise RulesDoNotFit(
            f"players of the reference implementation know games of {PLAYERS} players, {FACES} faces and {JOKERS} jokers alone; "
            f"this one has {rules.players}, {rules.faces} and {rules.jokers}"
        )


@dataclass
class Counts:
    """What was not the player's own, in one game or many.

    Attributes:
        failures: how often the player raised, was lost, or answered with what is no answer.
        replaced: decisions that were taken for it, because it failed or chose nothing legal to the last.
    """

    failures: int = 0
    replaced: int = 0


class PlayersClubAgent(Agent):
    """Plays one game with a player of the reference implementation. Another game with the same process takes another of these.

    Attributes:
        counts: of this game.
        over: whether its game is over, and the player has been told, or its seat is lost.
    """

    def __init__(self, process: AgentProcess, *, attempts: int = ATTEMPTS, total: Counts | None = None) -> None:
        """Seats a player.

        Args:
            process: the player, started.
            attempts: how often an illegal choice is sent before a legal one is taken instead; the room's own limit holds too.
            total: counted on with the game's own counts.
        """
        self._process = process
        self._attempts = attempts
        self._table: Table | None = None
        # The decision that is open, and how often it was answered illegally.
        self._decision_id = 0
        self._refused = 0
        # Cards the player has chosen that are still to be given.
        self._to_give: list[int] = []
        self.counts = Counts()
        self._total = total or Counts()
        self.over = False

    def on_attached(self, seat: SeatInfo) -> None:
        """Learns the number of the seat."""
        if self._table is None:
            self._table = Table(seat.seat, self._process.name)

    def on_event(self, event: pb.GameEvent) -> None:
        """Tells the player what it would have been told by the reference implementation."""
        if event.HasField("game_started"):
            check_rules(event.game_started.rules)
        if event.HasField("shift_started"):
            self._to_give = []
        self._tell(self._seen.event(event))

    def on_game_over(self, result: SeatResult) -> None:
        """Says how much of the game was the player's own."""
        self.over = True
        if self.counts.failures:
            LOG.warning("%s failed %d times in this game", self._process.name, self.counts.failures)

    def on_seat_lost(self, error: ChefsHatError) -> None:
        """The player is free for another game. It is told nothing: the reference has no word for this."""
        self.over = True

    def decide(self, request: Decision) -> int:
        """Asks the player, and again if its choice was illegal."""
        if request.decision_id == self._decision_id:
            self._refused += 1
        else:
            self._decision_id, self._refused = request.decision_id, 0
        left = request.invalid_attempts_left
        # The last attempt that the room grants is not wasted: after it the server would decide.
        insists = self._refused < self._attempts and (left is None or left > 1)
        if request.kind == pb.DECISION_KIND_EXCHANGE:
            return self._give(request, insists)
        if request.kind == pb.DECISION_KIND_SPECIAL_ACTION:
            return self._special_action(request)
        return self._turn(request, insists)

    @property
    def _seen(self) -> Table:
        assert self._table is not None, "seats are attached before they are told or asked anything"
        return self._table

    def _turn(self, request: Decision, insists: bool) -> int:
        """The largest of the 200 numbers, of those that are legal if the player may not insist on an illegal one any more."""
        self._tell(self._seen.turn_of(request.seat))
        vector = [float(number) for number in request.classic_vector()]
        scores = self._numbers(vector)
        if scores is None:
            self._seen.asked(vector, replaced=True)
            return self._replaced(_default_turn(request))
        choice = int(np.argmax(scores))
        legal = request.legal_actions
        if choice in legal:
            self._seen.asked(vector, replaced=False)
            return choice
        self._seen.asked(vector, replaced=True)
        return choice if insists else self._replaced(int(legal[np.argmax(scores[legal])]))

    def _numbers(self, vector: list[float]) -> NDArray[np.float64] | None:
        """What the player answers to the 228 numbers; None if that is no answer."""
        try:
            answer = self._process.call("get_action", vector)
        except AgentError as error:
            self._failed(error)
            return None
        if not (_is_numbers(answer) and len(answer) == len(ACTIONS)):
            self._failed(f"get_action returned {_shape(answer)}: {len(ACTIONS)} numbers were expected")
            return None
        return np.array(answer, np.float64)

    def _give(self, request: Decision, insists: bool) -> int:
        """The Chef is asked twice by the server, the player once for both cards."""
        legal = request.legal_actions
        if self._refused:
            self._to_give = []
        if not self._to_give:
            # Some may have been given already, by a process before this one too.
            amount = max(GIVEN_BY.get(int(request.roles[request.seat]), 1) - int(request.gave.sum()), 1)
            cards = [int(card) for card in np.repeat(np.arange(1, JOKER + 1), request.hand)]
            try:
                answer = self._process.call("get_exhanged_cards", cards, amount)
            except AgentError as error:
                self._failed(error)
                return self._replaced(_default_gift(request))
            if not (_is_numbers(answer) and len(answer) == amount and all(card in range(1, JOKER + 1) for card in answer)):
                self._failed(f"get_exhanged_cards returned {_shape(answer)}: a list of {amount} of the cards it holds was expected")
                return self._replaced(_default_gift(request))
            self._to_give = [int(card) for card in answer]
        action = GIVE + self._to_give.pop(0)
        if action in legal or insists:
            return action
        self._failed("get_exhanged_cards chose cards that it does not hold")
        return self._replaced(_default_gift(request))

    def _special_action(self, request: Decision) -> int:
        dishwasher = int(request.roles[request.seat]) == pb.ROLE_DISHWASHER
        try:
            answer = self._process.call("do_special_action", self._seen.info, FOOD_FIGHT if dishwasher else DINNER_SERVED)
        except AgentError as error:
            self._failed(error)
            return self._replaced(DECLINE)
        return DECLARE if answer else DECLINE

    def _tell(self, calls: Sequence[Call]) -> None:
        for call in calls:
            if self._process.given_up:
                return  # It has been said.
            try:
                self._process.call(call.method, *call.arguments)
            except AgentError as error:
                self._failed(error)

    def _replaced(self, action: int) -> int:
        self.counts.replaced += 1
        self._total.replaced += 1
        return action

    def _failed(self, why: object) -> None:
        self.counts.failures += 1
        self._total.failures += 1
        if self.counts.failures <= TOLD:
            LOG.warning("%s: %s", self._process.name, why)
        if self.counts.failures == TOLD:
            LOG.warning("%s: further failures are counted, not told", self._process.name)


def _default_turn(request: Decision) -> int:
    """Pass, or where that is not legal the legal action with the lowest index: the default decision of the rules."""
    legal = request.legal_actions
    return PASS if PASS in legal else int(legal[0])


def _default_gift(request: Decision) -> int:
    """The highest face, or a joker if there is nothing else: the default decision of the rules."""
    gifts = [int(action) for action in request.legal_actions if action != GIVE + JOKER]
    return max(gifts, default=GIVE + JOKER)


def _is_numbers(answer: object) -> TypeGuard[list[float]]:
    """Whether that is a list of numbers, infinite ones allowed."""
    if not (isinstance(answer, list) and all(isinstance(number, int | float) for number in answer)):
        return False
    try:
        return not any(math.isnan(number) for number in answer)
    except OverflowError:
        return False  # A whole number of hundreds of digits.


def _shape(answer: object) -> str:
    """An answer in few words."""
    if isinstance(answer, list):
        return f"{len(answer)} values" if len(answer) > PLAYERS else repr(answer)[:80]
    return f"{type(answer).__name__} {answer!r}"[:80]
