"""`PlayersClubAgent` without a server or a process: a puppet gives scripted answers."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chefshat import ChefsHatError, Decision, SeatResult, pb
from test_decision import HAND, decision

from chefshat_paper.players_club import AgentError, AgentProcess, AgentSpec, PlayersClubAgent, RulesDoNotFit
from chefshat_paper.players_club.agent import Counts
from chefshat_paper.players_club.players import Players
from chefshat_paper.players_club.process import AgentLost, AgentRaised

T = 200
CHEF, DISHWASHER = 0, 3
RULES = pb.RuleSet(players=4, faces=11, jokers=2)


class Puppet(AgentProcess):
    """Answers by a script, in order, and records the calls. Raises the exceptions in the script."""

    def __init__(self, *script: object) -> None:
        super().__init__(AgentSpec("puppet:Puppet", "Puppet"))
        self.script = list(script)
        self.asked: list[tuple[object, ...]] = []

    def call(self, method: str, *arguments: object) -> object:
        if method.startswith(("update", "observe")):
            return None
        self.asked.append((method, *arguments))
        answer = self.script.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer


def seated(*script: object, seat: int = 2, attempts: int = 5) -> PlayersClubAgent:
    agent = PlayersClubAgent(Puppet(*script), attempts=attempts)
    begin(agent, seat)
    return agent


def begin(agent: PlayersClubAgent, seat: int) -> None:
    """Starts the game and its first Shift."""
    request = decision()
    request.seat_info.seat = seat
    agent.on_attached(request.seat_info)
    names = [pb.Participant(seat=seat, name=f"player {seat}") for seat in range(4)]
    agent.on_event(pb.GameEvent(game_started=pb.GameStarted(rules=RULES, seats=names, hand_size=17)))
    agent.on_event(pb.GameEvent(shift_started=pb.ShiftStarted(shift=1)))


def asked(
    *legal: int, number: int = 9, kind: pb.DecisionKind.ValueType = pb.DECISION_KIND_TURN, seat: int = 2, left: int | None = None
) -> Decision:
    request = decision(legal=legal)
    request.request.decision_id = number
    request.request.kind = kind
    # The server's part.
    defaults = {pb.DECISION_KIND_TURN: 199, pb.DECISION_KIND_SPECIAL_ACTION: 212}
    default = max((action for action in legal if action < T + 11), default=legal[0]) if kind not in defaults else defaults[kind]
    request.request.default_action = default if default in legal else legal[0]
    request.seat_info.seat = seat
    return Decision(request.request, request.seat_info, left)


def wanting(*actions: int) -> list[float]:
    """Returns 200 scores, highest for the first action."""
    numbers = [0.0] * T
    for rank, action in enumerate(actions):
        numbers[action] = 1.0 - rank / 10
    return numbers


def puppet(agent: PlayersClubAgent) -> Puppet:
    process = agent._process
    assert isinstance(process, Puppet)
    return process


def decide_all(agent: PlayersClubAgent, requests: Sequence[Decision]) -> list[int]:
    return [agent.decide(request) for request in requests]


def test_the_highest_score_wins() -> None:
    agent = seated(wanting(8, 199, 0))
    request = asked(0, 8, 199)
    assert agent.decide(request) == 8
    assert puppet(agent).asked == [("get_action", [pytest.approx(number) for number in request.classic_vector().tolist()])]
    assert (agent.counts.failures, agent.counts.replaced) == (0, 0)


def test_ties_go_to_the_first_score_and_infinite_scores_are_allowed() -> None:
    assert seated([1.0] * T).decide(asked(0, 8, 199)) == 0
    numbers: list[float] = [-np.inf] * T
    numbers[8] = np.inf
    assert seated(numbers).decide(asked(0, 8, 199)) == 8


def test_an_illegal_choice_is_sent_and_asked_again_then_the_best_legal_one_is_taken() -> None:
    stubborn = wanting(5, 8, 0)
    agent = seated(*[stubborn] * 4, wanting(0), attempts=3)
    assert decide_all(agent, [asked(0, 8, 199)] * 4) == [5, 5, 5, 8]
    assert (agent.counts.failures, agent.counts.replaced) == (0, 1)
    # At another decision the attempts start again.
    assert agent.decide(asked(0, 8, 199, number=10)) == 0
    assert agent.counts.replaced == 1


def test_the_last_attempt_of_the_room_is_legal() -> None:
    agent = seated(*[wanting(5, 8)] * 2)
    assert decide_all(agent, [asked(0, 8, 199, left=2), asked(0, 8, 199, left=1)]) == [5, 8]


def test_without_attempts_illegal_choices_are_never_sent() -> None:
    assert seated(wanting(5, 8), attempts=0).decide(asked(0, 8, 199)) == 8


@pytest.mark.parametrize(
    "answer",
    [
        AgentRaised("get_action raised ValueError"),
        AgentLost("its process died"),
        None,
        [],
        [0.0] * 199,
        [0.0] * 201,
        [[0.0] * T],
        ["0"] * T,
        [float("nan")] * T,
        [10**400] * T,
        3.0,
    ],
    ids=lambda answer: repr(answer)[:20],
)
def test_missing_or_invalid_answers_are_replaced_by_the_default_action(answer: object, caplog: pytest.LogCaptureFixture) -> None:
    agent = seated(answer, answer)
    assert agent.decide(asked(0, 8, 199)) == 199
    assert agent.decide(asked(6, 8, number=10)) == 6
    assert (agent.counts.failures, agent.counts.replaced) == (2, 2)
    expected = str(answer) if isinstance(answer, AgentError) else "not 200 numbers"
    assert caplog.messages[0].startswith("Puppet: ")
    assert expected in caplog.messages[0]


def test_only_the_first_failures_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    agent = seated(*[None] * 20)
    decide_all(agent, [asked(0, number=number) for number in range(1, 21)])
    assert agent.counts.failures == 20
    assert len(caplog.messages) == 4


def gift(*cards: int, number: int = 9, seat: int = CHEF, given: int = 0) -> Decision:
    """Returns an exchange with these legal gifts and the hand of `test_decision`; `given` cards of face 1 were given before."""
    request = asked(*[T - 1 + card for card in cards], number=number, kind=pb.DECISION_KIND_EXCHANGE, seat=seat)
    request.request.observation.gave = bytes([given] + [0] * 11) if given else b""
    return request


HELD = (2, 4, 11, 12)
CARDS = [2, 4, 4, 11, 11, 11, 12]


def test_the_chef_is_asked_for_both_cards_at_once() -> None:
    agent = seated([11, 12.0], seat=CHEF)
    assert decide_all(agent, [gift(*HELD), gift(*HELD, number=10, given=1)]) == [T - 1 + 11, T - 1 + 12]
    assert puppet(agent).asked == [("get_exhanged_cards", CARDS, 2)]
    assert [card for card, count in enumerate(HAND, 1) for _ in range(count)] == CARDS


def test_a_restarted_chef_is_asked_only_for_the_remaining_card() -> None:
    agent = seated([11], seat=CHEF)
    assert agent.decide(gift(*HELD, number=10, given=1)) == T - 1 + 11
    assert puppet(agent).asked == [("get_exhanged_cards", CARDS, 1)]


def test_the_sous_chef_is_asked_for_one_card() -> None:
    agent = seated([4], seat=1)
    assert agent.decide(gift(*HELD, seat=1)) == T - 1 + 4
    assert puppet(agent).asked == [("get_exhanged_cards", CARDS, 1)]


def test_each_exchange_is_a_new_request() -> None:
    agent = seated([2, 4], [12, 11], seat=CHEF)
    assert agent.decide(gift(*HELD)) == T - 1 + 2
    # The second card was never requested: the partner had too few cards.
    agent.on_event(pb.GameEvent(shift_started=pb.ShiftStarted(shift=2)))
    assert decide_all(agent, [gift(*HELD, number=20), gift(*HELD, number=21, given=1)]) == [T - 1 + 12, T - 1 + 11]


def test_a_card_not_in_the_hand_is_sent_and_asked_again() -> None:
    agent = seated([2, 3], [5], [6], [11], seat=CHEF, attempts=2)
    first, second = gift(*HELD), gift(*HELD, number=10, given=1)
    assert decide_all(agent, [first, second, second]) == [T - 1 + 2, T - 1 + 3, T - 1 + 5]
    assert agent.decide(second) == T - 1 + 11
    assert [question[2] for question in puppet(agent).asked] == [2, 1, 1]
    assert (agent.counts.failures, agent.counts.replaced) == (1, 1)


@pytest.mark.parametrize("answer", [None, [11, 12, 12], [11, 0], [11, 13], ["11", "12"], [11.5, 2], AgentLost("gone")], ids=repr)
def test_missing_or_invalid_cards_are_replaced_by_the_default_action(answer: Any) -> None:
    agent = seated(answer, answer, seat=CHEF)
    assert agent.decide(gift(*HELD)) == T - 1 + 11
    assert agent.decide(gift(12, number=10)) == T - 1 + 12
    assert (agent.counts.failures, agent.counts.replaced) == (2, 2)


@pytest.mark.parametrize(("seat", "name"), [(CHEF, "Dinner served!"), (DISHWASHER, "It is food fight!")])
@pytest.mark.parametrize(
    ("answer", "action"),
    [(True, 213), (1, 213), (False, 212), (None, 212), (AgentRaised("no"), 212)],
    ids=lambda value: repr(value),
)
def test_a_special_action_is_declared_or_declined(seat: int, name: str, answer: object, action: int) -> None:
    agent = seated(answer, seat=seat)
    assert agent.decide(asked(212, 213, kind=pb.DECISION_KIND_SPECIAL_ACTION, seat=seat)) == action
    assert puppet(agent).asked == [("do_special_action", {}, name)]


def test_games_of_other_sizes_are_refused() -> None:
    agent = PlayersClubAgent(Puppet())
    agent.on_attached(decision().seat_info)
    rules = pb.RuleSet(players=5, faces=11, jokers=2)
    with pytest.raises(RulesDoNotFit, match="this one has 5, 11 and 2"):
        agent.on_event(pb.GameEvent(game_started=pb.GameStarted(rules=rules)))


def club() -> Players:
    """Two processes that are not started."""
    return Players(AgentSpec("club_players:Largest", "Ada"), 2, attempts=5)


def test_each_parallel_game_has_a_process_which_plays_game_after_game(caplog: pytest.LogCaptureFixture) -> None:
    players = club()
    one, other = players.processes
    first, second = players.agent(), players.agent()
    assert (first._process, second._process) == (one, other)
    second.on_game_over(SeatResult("room", "game", 0))
    assert players.agent()._process is other
    assert (players.crowded, caplog.text) == (0, "")
    # One more than there are processes.
    assert players.agent()._process is one
    assert players.crowded == 1
    assert "no process is free" in caplog.text


def test_a_lost_seat_frees_its_process() -> None:
    players = club()
    first, _ = players.agent(), players.agent()
    first.on_seat_lost(ChefsHatError("SUPERSEDED"))
    assert players.agent()._process is players.processes[0]
    assert players.crowded == 0


def test_a_process_that_was_given_up_is_used_last() -> None:
    players = club()
    one, other = players.processes
    one.close()
    first = players.agent()
    assert (one.given_up, first._process) == (True, other)
    assert players.agent()._process is one
    first.on_game_over(SeatResult("room", "game", 0))
    assert players.agent()._process is other
    assert players.crowded == 0


def test_failures_are_counted_by_game_and_in_total() -> None:
    players = club()
    for process in players.processes:
        process.close()
    agents = [players.agent() for _ in range(2)]
    for agent in agents:
        begin(agent, 2)
        assert agent.decide(asked(0, 199)) == 199
        assert agent.counts == Counts(failures=1, replaced=1)
    assert players.counts == Counts(failures=2, replaced=2)


def test_placeholders_are_replaced_by_the_number_of_the_process() -> None:
    given = {"log_directory": "trained/{process}", "names": ["{process}"], "rate": 0.5}
    players = Players(AgentSpec("a:B", "Ada", given, log=Path("log.{process}")), 2, attempts=5)
    specs = [process.spec for process in players.processes]
    assert [spec.arguments for spec in specs] == [{"log_directory": f"trained/{n}", "names": [n], "rate": 0.5} for n in "01"]
    assert [spec.log for spec in specs] == [Path("log.0"), Path("log.1")]
