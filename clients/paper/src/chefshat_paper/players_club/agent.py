"""A player of the reference implementation's second version as an agent of this package.

The player runs in its own process (`process`), and sees the game in its own terms (`table`). Here its answers become actions. If it
fails to answer, the default action is taken. An illegal choice is sent to the server, which counts it and asks again, as often as
the reference would; then the legal choice with the highest score is taken.
"""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeGuard

import numpy as np
from chefshat import pb
from chefshat.agents import Agent
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError
from chefshat.result import SeatResult
from numpy.typing import NDArray

from chefshat_paper.players_club.process import AgentError, AgentProcess
from chefshat_paper.players_club.table import ACTIONS, DINNER_SERVED, FACES, FOOD_FIGHT, JOKER, PLAYERS, Call, Table

LOG = logging.getLogger("chefshat")

JOKERS = 2
#: Illegal choices to send before a legal one: the limit of the reference.
ATTEMPTS = 5
# Indices of the actions other than turns, for eleven faces. Giving card c, jokers included, is GIVE + c.
GIVE = len(ACTIONS) - 1
DECLINE = len(ACTIONS) + FACES + 1
DECLARE = DECLINE + 1
# Cards that the Chef and the Sous-Chef choose to give.
GIVEN_BY: dict[int, int] = {pb.ROLE_CHEF: 2, pb.ROLE_SOUS_CHEF: 1}
# Annotation of decisions that the agent did not take itself.
FALLBACK = "fallback"
# Failures to log. An agent that fails usually does so at every decision.
TOLD = 3


class RulesDoNotFit(ValueError):
    """The game does not have four players, eleven faces and two jokers, as players of the reference require."""


def check_rules(rules: pb.RuleSet) -> None:
    """Raises RulesDoNotFit if players of the reference implementation cannot play under these rules."""
    if (rules.players, rules.faces, rules.jokers) != (PLAYERS, FACES, JOKERS):
        raise RulesDoNotFit(
            f"players of the reference implementation only play games of {PLAYERS} players, {FACES} faces and {JOKERS} jokers; "
            f"this one has {rules.players}, {rules.faces} and {rules.jokers}"
        )


@dataclass
class Counts:
    """Failures of the player, in one game or many.

    Attributes:
        failures: calls that raised, that were lost, or that returned no valid answer.
        replaced: decisions taken for the player, because it failed or made no legal choice.
    """

    failures: int = 0
    replaced: int = 0


class PlayersClubAgent(Agent):
    """Plays one game with a player of the reference implementation. Create a new one for another game of the same process.

    Attributes:
        counts: of this game.
        over: whether the game is over, and the player has been notified, or the seat is lost.
    """

    def __init__(self, process: AgentProcess, *, attempts: int = ATTEMPTS, total: Counts | None = None) -> None:
        """Creates the agent of one game.

        Args:
            process: the started player.
            attempts: illegal choices to send before a legal one is taken instead; the room's limit applies, too.
            total: also counts the failures of this game.
        """
        self._process = process
        self._attempts = attempts
        self._table: Table | None = None
        # The open decision, and its illegal answers so far.
        self._decision_id = 0
        self._refused = 0
        # Cards that the player has chosen to give next.
        self._to_give: list[int] = []
        self.counts = Counts()
        self._total = total or Counts()
        self.over = False

    def on_attached(self, seat: SeatInfo) -> None:
        """Creates the game as the player sees it."""
        if self._table is None:
            self._table = Table(seat.seat, self._process.name)

    def on_event(self, event: pb.GameEvent) -> None:
        """Makes the calls that the reference implementation would make."""
        if event.HasField("game_started"):
            check_rules(event.game_started.rules)
        if event.HasField("shift_started"):
            self._to_give = []
        self._notify(self._seen.event(event))

    def on_game_over(self, result: SeatResult) -> None:
        """Logs the failures."""
        self.over = True
        if self.counts.failures:
            LOG.warning("%s failed %d times in this game", self._process.name, self.counts.failures)

    def on_seat_lost(self, error: ChefsHatError) -> None:
        """Frees the player for another game. The reference has no call for this."""
        self.over = True

    def decide(self, request: Decision) -> int:
        """Asks the player, and again if its choice was illegal."""
        if request.decision_id == self._decision_id:
            self._refused += 1
        else:
            self._decision_id, self._refused = request.decision_id, 0
        left = request.invalid_attempts_left
        # Does not use up the room's last attempt, after which the server would decide.
        insists = self._refused < self._attempts and (left is None or left > 1)
        if request.kind == pb.DECISION_KIND_EXCHANGE:
            return self._give(request, insists)
        if request.kind == pb.DECISION_KIND_SPECIAL_ACTION:
            return self._special_action(request)
        return self._turn(request, insists)

    @property
    def _seen(self) -> Table:
        assert self._table is not None, "seats are attached before any event or decision"
        return self._table

    def _turn(self, request: Decision, insists: bool) -> int:
        """Chooses the action with the highest of the 200 scores; a legal one if the player may no longer insist."""
        self._notify(self._seen.turn_of(request.seat))
        vector = [float(number) for number in request.classic_vector()]
        scores = self._numbers(vector)
        if scores is None:
            self._seen.asked(vector, replaced=True)
            return self._default(request)
        choice = int(np.argmax(scores))
        legal = request.legal_actions
        if choice in legal:
            self._seen.asked(vector, replaced=False)
            return choice
        self._seen.asked(vector, replaced=True)
        return choice if insists else self._replaced(int(legal[np.argmax(scores[legal])]))

    def _numbers(self, vector: list[float]) -> NDArray[np.float64] | None:
        """Returns the player's scores for the 228 numbers; None if the answer is invalid."""
        try:
            answer = self._process.call("get_action", vector)
        except AgentError as error:
            self._failed(error)
            return None
        if not (is_numbers(answer) and len(answer) == len(ACTIONS)):
            self._failed(f"get_action returned {_shape(answer)}, not {len(ACTIONS)} numbers")
            return None
        return np.array(answer, np.float64)

    def _give(self, request: Decision, insists: bool) -> int:
        """Gives a card. The server asks the Chef twice, the player is asked once for both cards."""
        legal = request.legal_actions
        if self._refused:
            self._to_give = []
        if not self._to_give:
            # Cards may have been given already, also by a process before this one.
            amount = max(GIVEN_BY.get(int(request.roles[request.seat]), 1) - int(request.gave.sum()), 1)
            cards = [int(card) for card in np.repeat(np.arange(1, JOKER + 1), request.hand)]
            try:
                answer = self._process.call("get_exhanged_cards", cards, amount)
            except AgentError as error:
                self._failed(error)
                return self._default(request)
            if not (is_numbers(answer) and len(answer) == amount and all(card in range(1, JOKER + 1) for card in answer)):
                self._failed(f"get_exhanged_cards returned {_shape(answer)}, not a list of {amount} of its cards")
                return self._default(request)
            self._to_give = [int(card) for card in answer]
        action = GIVE + self._to_give.pop(0)
        if action in legal or insists:
            return action
        self._failed("get_exhanged_cards chose cards that are not in its hand")
        return self._default(request)

    def _special_action(self, request: Decision) -> int:
        dishwasher = int(request.roles[request.seat]) == pb.ROLE_DISHWASHER
        try:
            answer = self._process.call("do_special_action", self._seen.info, FOOD_FIGHT if dishwasher else DINNER_SERVED)
        except AgentError as error:
            self._failed(error)
            return self._default(request)
        return DECLARE if answer else DECLINE

    def _notify(self, calls: Sequence[Call]) -> None:
        for call in calls:
            if self._process.given_up:
                return  # Logged before.
            try:
                self._process.call(call.method, *call.arguments)
            except AgentError as error:
                self._failed(error)

    def _default(self, request: Decision) -> int:
        """Takes the default action for a player that fails. Records and results count it as a fallback."""
        request.annotate(extra={FALLBACK: "the player failed"})
        return self._replaced(request.default_action)

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
            LOG.warning("%s: further failures are counted, but not logged", self._process.name)


def is_numbers(answer: object) -> TypeGuard[list[float]]:
    """Whether the answer is a list of numbers, which may be infinite, but not NaN."""
    if not (isinstance(answer, list) and all(isinstance(number, int | float) for number in answer)):
        return False
    try:
        return not any(math.isnan(number) for number in answer)
    except OverflowError:
        return False  # An integer of hundreds of digits.


def _shape(answer: object) -> str:
    """Describes an answer briefly."""
    if isinstance(answer, list):
        return f"{len(answer)} values" if len(answer) > PLAYERS else repr(answer)[:80]
    return f"{type(answer).__name__} {answer!r}"[:80]
