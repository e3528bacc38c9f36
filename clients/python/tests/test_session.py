"""The protocol without a connection: scripted responses in, requests out."""

from collections.abc import Callable

import pytest

from chefshat import Agent, ChefsHatError, Decision, PlayOptions, SeatInfo, SeatResult, pb
from chefshat.session import MAX_COMMANDS, Ask, PlaySession

MASK = bytes([0b0000_0110])
HAND = bytes(12)


class Scribe(Agent):
    """Writes down what it is told."""

    def __init__(self) -> None:
        self.log: list[object] = []

    def decide(self, request: Decision) -> int:
        raise AssertionError("the session itself never decides")

    def on_attached(self, seat: SeatInfo) -> None:
        self.log.append(("attached", seat.seat))

    def on_event(self, event: pb.GameEvent) -> None:
        self.log.append(("event", event.sequence))

    def on_snapshot(self, snapshot: pb.Snapshot) -> None:
        self.log.append(("snapshot", snapshot.next_sequence))

    def on_result(self, result: pb.AnswerResult) -> None:
        self.log.append(("result", pb.AnswerStatus.Name(result.status).removeprefix("ANSWER_STATUS_")))

    def on_refused(self, refused: pb.Refused) -> None:
        self.log.append(("refused", refused.reason))

    def on_game_over(self, result: SeatResult) -> None:
        self.log.append(("over", result.finished))


def attached(request_id: int = 1, seat: int = 0) -> pb.SeatUpdate:
    said = pb.Attached(request_id=request_id, room_id="room", game_id="game", seat=seat)
    return pb.SeatUpdate(handle=request_id - 1, attached=said)


def events(*sequences: int, handle: int = 0, **kind: object) -> pb.SeatUpdate:
    said = [pb.GameEvent(sequence=sequence, **(kind or {"pass": pb.Pass()})) for sequence in sequences]  # type: ignore[arg-type]
    return pb.SeatUpdate(handle=handle, events=pb.EventBatch(events=said))


def decision(decision_id: int, handle: int = 0) -> pb.SeatUpdate:
    request = pb.DecisionRequest(decision_id=decision_id, action_mask=MASK, observation=pb.Observation(hand=HAND))
    return pb.SeatUpdate(handle=handle, decision=request)


def result(decision_id: int, status: str, attempts_left: int | None = None) -> pb.SeatUpdate:
    value = pb.AnswerStatus.Value(f"ANSWER_STATUS_{status}")
    return pb.SeatUpdate(result=pb.AnswerResult(decision_id=decision_id, status=value, invalid_attempts_left=attempts_left))


def detached(reason: str, handle: int = 0) -> pb.SeatUpdate:
    value = pb.DetachReason.Value(f"DETACH_REASON_{reason}")
    return pb.SeatUpdate(handle=handle, detached=pb.Detached(reason=value))


def ended(sequence: int, handle: int = 0) -> pb.SeatUpdate:
    table = [pb.Standing(seat=1, points=15, place=1), pb.Standing(seat=0, points=9, place=2)]
    return events(sequence, handle=handle, game_ended=pb.GameEnded(standings=table))


class Stage:
    """A session and its driver's part."""

    def __init__(self, *tickets: str) -> None:
        self.scribes = {ticket: Scribe() for ticket in tickets or ("t",)}
        self.session = PlaySession(self.scribes, PlayOptions(entropy=b"mine"))
        self.sent: list[pb.SeatCommand] = []

    @property
    def log(self) -> list[object]:
        return self.scribes["t"].log

    def connect(self) -> None:
        self.session.connected()
        self.flush()

    def flush(self) -> list[pb.SeatCommand]:
        self.sent = [command for request in self.session.take_requests() for command in request.commands]
        return self.sent

    def say(self, *updates: pb.SeatUpdate) -> list[Ask]:
        asks = self.session.receive(pb.PlayResponse(updates=updates))
        self.flush()
        return asks

    def answer(self, ask: Ask, action: int = 1) -> None:
        self.session.answer(ask, action)
        self.flush()

    def answers(self) -> list[tuple[int, int, int]]:
        return [(command.handle, command.answer.decision_id, command.answer.action) for command in self.sent]


@pytest.fixture
def stage() -> Stage:
    stage = Stage()
    stage.connect()
    stage.say(attached())
    return stage


def test_a_game_from_attaching_to_its_end() -> None:
    stage = Stage()
    stage.connect()
    attach = stage.sent[0].attach
    assert (attach.ticket, attach.request_id, attach.from_sequence, attach.entropy) == ("t", 1, 0, b"mine")
    assert stage.say(attached()) == []
    asks = stage.say(events(1, game_started=pb.GameStarted(hand_size=17)), decision(1))
    assert [ask.decision.decision_id for ask in asks] == [1]
    assert asks[0].decision.hand_size == 17
    assert asks[0].agent is stage.scribes["t"]
    stage.answer(asks[0], 2)
    assert stage.answers() == [(0, 1, 2)]
    stage.say(result(1, "ACCEPTED"), ended(2))
    assert not stage.session.done
    stage.say(detached("GAME_OVER"))
    assert stage.session.done
    over = stage.session.results()["t"]
    assert (over.finished, over.seat, over.place, over.points) == (True, 0, 2, 9)
    assert (over.decisions, over.invalid, over.late, over.reconnects) == (1, 0, 0, 0)
    assert stage.log == [("attached", 0), ("event", 1), ("result", "ACCEPTED"), ("event", 2), ("over", True)]


def test_an_aborted_game_has_no_result(stage: Stage) -> None:
    stage.say(events(1, game_aborted=pb.GameAborted(reason=pb.ABORT_REASON_SHUTDOWN)), detached("GAME_OVER"))
    over = stage.session.results()["t"]
    assert (over.finished, over.abort_reason, over.place, over.points) == (False, "SHUTDOWN", None, None)
    over.raise_for_error()


def test_an_invalid_answer_is_asked_again_until_the_servers_limit(stage: Stage) -> None:
    (ask,) = stage.say(decision(1))
    stage.answer(ask)
    (again,) = stage.say(result(1, "INVALID", attempts_left=1))
    assert again.decision.request == ask.decision.request
    assert again.decision.invalid_attempts_left == 1
    stage.answer(again)
    assert stage.answers() == [(0, 1, 1)]
    assert stage.say(result(1, "INVALID", attempts_left=0)) == []
    (following,) = stage.say(decision(2))
    assert following.decision.decision_id == 2
    stage.say(detached("GAME_OVER"))
    assert stage.session.results()["t"].invalid == 2


def test_an_unlimited_number_of_attempts_is_asked_on(stage: Stage) -> None:
    (ask,) = stage.say(decision(1))
    for _ in range(20):
        stage.answer(ask)
        (ask,) = stage.say(result(1, "INVALID"))
        assert ask.decision.invalid_attempts_left is None


def test_a_late_answer_is_counted_and_not_repeated(stage: Stage) -> None:
    (ask,) = stage.say(decision(1))
    stage.answer(ask)
    (following,) = stage.say(decision(2))
    assert stage.say(result(1, "CLOSED")) == []
    stage.answer(following)
    assert stage.answers() == [(0, 2, 1)]
    stage.say(detached("GAME_OVER"))
    assert stage.session.results()["t"].late == 1


def test_an_answer_to_a_decision_that_was_replaced_is_dropped(stage: Stage) -> None:
    (slow,) = stage.say(decision(1))
    (following,) = stage.say(decision(2))
    stage.answer(slow)
    assert stage.sent == []
    stage.answer(following)
    assert stage.answers() == [(0, 2, 1)]


def test_reconnecting_resumes_after_the_last_event(stage: Stage) -> None:
    stage.say(events(1, 2, 3))
    stage.session.lost()
    stage.connect()
    assert stage.sent[0].attach.from_sequence == 4
    # An event that comes twice all the same is told once.
    stage.say(attached(), events(3, 4))
    assert [line for line in stage.log if line[0] == "event"] == [("event", number) for number in (1, 2, 3, 4)]  # type: ignore[index]
    stage.say(ended(5), detached("GAME_OVER"))
    assert stage.session.results()["t"].reconnects == 1


def test_an_unacknowledged_answer_is_repeated_once_and_not_thought_over(stage: Stage) -> None:
    (ask,) = stage.say(decision(1))
    stage.answer(ask, 2)
    stage.session.lost()
    stage.connect()
    asks = stage.session.receive(pb.PlayResponse(updates=[attached(), decision(1)]))
    assert asks == []
    stage.flush()
    assert stage.answers() == [(0, 1, 2)]
    # The acknowledgement may come twice: once more for the answer of the lost connection.
    stage.say(result(1, "ACCEPTED"), result(1, "ACCEPTED"))
    stage.say(ended(1), detached("GAME_OVER"))
    assert stage.session.results()["t"].decisions == 1


def test_a_decision_put_again_while_the_agent_thinks_is_answered_on_the_new_connection(stage: Stage) -> None:
    (ask,) = stage.say(decision(1))
    stage.session.lost()
    stage.connect()
    assert stage.say(attached(), decision(1)) == []
    stage.answer(ask)
    assert stage.answers() == [(0, 1, 1)]


def test_an_answer_given_between_connections_is_sent_on_the_next(stage: Stage) -> None:
    (ask,) = stage.say(decision(1))
    stage.session.lost()
    stage.answer(ask)
    assert stage.sent == []
    stage.connect()
    assert [command.WhichOneof("command") for command in stage.sent] == ["attach"]
    assert stage.say(attached(), decision(1)) == []
    assert stage.answers() == [(0, 1, 1)]


def test_a_decision_nobody_was_asked_for_is_asked_when_it_is_put_again(stage: Stage) -> None:
    asks = stage.say(decision(1))
    stage.session.lost(unasked=asks)
    stage.connect()
    (again,) = stage.say(attached(), decision(1))
    assert again.decision.decision_id == 1


def test_handles_of_a_lost_connection_mean_nothing() -> None:
    stage = Stage("t", "u")
    stage.connect()
    stage.say(attached(1, seat=0), attached(2, seat=3))
    stage.say(detached("GAME_OVER", handle=0))
    stage.session.lost()
    stage.connect()
    assert [(command.attach.ticket, command.attach.request_id) for command in stage.sent] == [("u", 2)]
    # On this connection the second seat is the first to attach.
    stage.say(pb.SeatUpdate(handle=0, attached=pb.Attached(request_id=2, seat=3)))
    (ask,) = stage.say(decision(1, handle=0))
    assert ask.decision.seat == 3
    assert stage.say(decision(1, handle=1)) == []


def test_a_superseded_seat_stops_and_the_others_play_on() -> None:
    stage = Stage("t", "u")
    stage.connect()
    stage.say(attached(1), attached(2))
    stage.say(detached("SUPERSEDED", handle=0))
    assert not stage.session.done
    stage.session.lost()
    stage.connect()
    assert [command.attach.ticket for command in stage.sent] == ["u"]
    with pytest.raises(ChefsHatError, match="SUPERSEDED"):
        stage.session.results()["t"].raise_for_error()


def test_a_refused_ticket_stops_that_seat_alone() -> None:
    stage = Stage("t", "u")
    stage.connect()
    refused = pb.Refused(request_id=1, reason="TICKET_UNKNOWN", message="no", metadata={"field": "ticket"})
    # A refused attachment has a handle too.
    stage.say(pb.SeatUpdate(handle=0, refused=refused), attached(2, seat=1))
    over = stage.session.results()["t"]
    assert over.error is not None
    assert (over.error.reason, over.error.metadata, over.seat) == ("TICKET_UNKNOWN", {"field": "ticket"}, -1)
    assert stage.say(decision(1, handle=0)) == []
    (ask,) = stage.say(decision(1, handle=1))
    assert ask.agent is stage.scribes["u"]


def test_another_refused_command_is_told_and_nothing_else(stage: Stage) -> None:
    stage.say(pb.SeatUpdate(handle=0, refused=pb.Refused(reason="EXPRESSION_REFUSED", message="too long")))
    assert stage.log[-1] == ("refused", "EXPRESSION_REFUSED")
    assert not stage.session.done


def test_a_connection_lost_after_the_games_end_is_not_made_again(stage: Stage) -> None:
    stage.say(ended(1))
    stage.session.lost()
    assert stage.session.done
    assert stage.session.results()["t"].finished


def test_giving_up_ends_what_is_open(stage: Stage) -> None:
    stage.session.lost()
    stage.session.give_up(ChefsHatError("UNAVAILABLE"))
    assert stage.session.done
    with pytest.raises(ChefsHatError, match="UNAVAILABLE"):
        stage.session.results()["t"].raise_for_error()


def test_a_snapshot_stands_for_the_events_before_it(stage: Stage) -> None:
    started = pb.GameStarted(hand_size=17)
    stage.say(pb.SeatUpdate(snapshot=pb.Snapshot(game_started=started, next_sequence=40)))
    (ask,) = stage.say(events(39, 40), decision(3))
    assert ask.decision.hand_size == 17
    assert stage.log[-2:] == [("snapshot", 40), ("event", 40)]


def test_progress_is_made_by_events_and_accepted_answers_alone(stage: Stage) -> None:
    steps: list[tuple[Callable[[], object], bool]] = [
        (lambda: stage.say(events(1)), True),
        (lambda: stage.say(events(1)), False),
        (lambda: stage.say(attached()), False),
        (lambda: stage.answer(stage.say(decision(1))[0]), False),
        (lambda: stage.say(result(1, "ACCEPTED")), True),
        (lambda: stage.say(result(1, "ACCEPTED")), False),
    ]
    for number, (step, moves) in enumerate(steps):
        before = stage.session.progress
        step()
        assert (stage.session.progress > before) is moves, number


def test_annotations_travel_with_the_answer(stage: Stage) -> None:
    (ask,) = stage.say(decision(1))
    ask.decision.annotate(value_estimate=0.25)
    stage.answer(ask)
    assert stage.sent[0].answer.annotations.value_estimate == 0.25


def test_a_request_holds_no_more_commands_than_the_protocol_allows() -> None:
    tickets = [f"ticket {number}" for number in range(MAX_COMMANDS + 1)]
    session = PlaySession({ticket: Scribe() for ticket in tickets})
    session.connected()
    sizes = [len(request.commands) for request in session.take_requests()]
    assert sizes == [MAX_COMMANDS, 1]
    assert session.take_requests() == []


def test_a_session_of_no_seats_is_done() -> None:
    assert PlaySession({}).done
