"""The protocol without a connection, from attaching to the end of the game. Lost connections are in `test_reconnecting`."""

import grpc
import pytest
from stage import Scribe, Stage, attached, decision, detached, ended, events, result

from chefshat import ChefsHatError, PlayOptions, pb
from chefshat.session import PlaySession


def test_a_game_from_attaching_to_its_end() -> None:
    stage = Stage()
    stage.connect()
    attach = stage.sent[0].attach
    assert (attach.ticket, attach.request_id, attach.from_sequence, attach.entropy) == ("t", 1, 0, b"mine")
    assert stage.receive(attached()) == []
    asks = stage.receive(events(1, game_started=pb.GameStarted(hand_size=17)), decision(1))
    assert [ask.decision.decision_id for ask in asks] == [1]
    assert asks[0].decision.hand_size == 17
    assert asks[0].agent is stage.scribes["t"]
    stage.answer(asks[0], 2)
    assert stage.answers() == [(0, 1, 2)]
    stage.receive(result(1, "ACCEPTED"), ended(2))
    assert not stage.session.done
    stage.receive(detached("GAME_OVER"))
    assert stage.session.done
    over = stage.session.results()["t"]
    assert (over.finished, over.seat, over.place, over.points) == (True, 0, 2, 9)
    assert (over.decisions, over.invalid, over.late, over.reconnects) == (1, 0, 0, 0)
    assert stage.log == [("attached", 0), ("event", 1), ("result", "ACCEPTED"), ("event", 2), ("over", True)]


def test_the_agent_learns_whom_the_game_waits_for(stage: Stage) -> None:
    stage.receive(events(1), pb.SeatUpdate(awaited=pb.Awaited(seat=0, away=True, left_ms=12_000)))
    stage.receive(pb.SeatUpdate(awaited=pb.Awaited()))
    assert stage.log[-3:] == [("event", 1), ("awaited", 0), ("awaited", None)]


def test_after_a_lost_connection_nobody_is_awaited_until_the_server_says_so(stage: Stage) -> None:
    stage.receive(pb.SeatUpdate(awaited=pb.Awaited(seat=2)))
    for nobody in ([("awaited", None)], []):
        stage.session.lost()
        stage.connect()
        stage.log.clear()
        stage.receive(attached())
        assert stage.log == [("attached", 0), *nobody]
    stage.receive(pb.SeatUpdate(awaited=pb.Awaited(seat=2)))
    assert stage.log[-1] == ("awaited", 2)


def test_every_seat_has_its_own_entropy() -> None:
    session = PlaySession({ticket: Scribe() for ticket in "tuv"})
    session.connected()
    first = [command.attach.entropy for request in session.take_requests() for command in request.commands]
    assert [len(entropy) for entropy in first] == [32, 32, 32]
    assert len(set(first)) == 3
    # The game may have begun with the entropy of the first connection, so it is repeated.
    session.lost()
    session.connected()
    assert [command.attach.entropy for request in session.take_requests() for command in request.commands] == first
    session.give_up(ChefsHatError("UNAVAILABLE"))
    assert [over.entropy for over in session.results().values()] == first


def test_entropy_can_be_set_or_empty() -> None:
    for chosen in (b"mine", b""):
        session = PlaySession({"t": Scribe(), "u": Scribe()}, PlayOptions(entropy=chosen))
        session.connected()
        (request,) = session.take_requests()
        assert [command.attach.entropy for command in request.commands] == [chosen, chosen]


def test_the_result_has_the_entropy_of_the_reveal(stage: Stage) -> None:
    stage.receive(ended(1), detached("GAME_OVER"))
    over = stage.session.results()["t"]
    assert over.reveal is not None
    assert over.reveal.seat_entropy[over.seat] == over.entropy == b"mine"


def test_an_aborted_game_has_no_result(stage: Stage) -> None:
    stage.receive(events(1, game_aborted=pb.GameAborted(reason=pb.ABORT_REASON_SHUTDOWN)), detached("GAME_OVER"))
    over = stage.session.results()["t"]
    assert (over.finished, over.abort_reason, over.place, over.points) == (False, "SHUTDOWN", None, None)
    over.raise_for_error()


def test_a_decision_is_asked_again_after_invalid_answers_up_to_the_limit(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    stage.answer(ask)
    (again,) = stage.receive(result(1, "INVALID", attempts_left=1))
    assert again.decision.request == ask.decision.request
    assert again.decision.invalid_attempts_left == 1
    stage.answer(again)
    assert stage.answers() == [(0, 1, 1)]
    assert stage.receive(result(1, "INVALID", attempts_left=0)) == []
    (following,) = stage.receive(decision(2))
    assert following.decision.decision_id == 2
    stage.receive(detached("GAME_OVER"))
    assert stage.session.results()["t"].invalid == 2


def test_unlimited_attempts_are_asked_again(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    for _ in range(20):
        stage.answer(ask)
        (ask,) = stage.receive(result(1, "INVALID"))
        assert ask.decision.invalid_attempts_left is None


def test_a_late_answer_is_counted_and_not_repeated(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    stage.answer(ask)
    (following,) = stage.receive(decision(2))
    assert stage.receive(result(1, "CLOSED")) == []
    stage.answer(following)
    assert stage.answers() == [(0, 2, 1)]
    stage.receive(detached("GAME_OVER"))
    assert stage.session.results()["t"].late == 1


def test_an_answer_to_a_decision_that_was_replaced_is_dropped(stage: Stage) -> None:
    (slow,) = stage.receive(decision(1))
    (following,) = stage.receive(decision(2))
    stage.answer(slow)
    assert stage.sent == []
    stage.answer(following)
    assert stage.answers() == [(0, 2, 1)]


def test_a_superseded_seat_stops_and_the_others_play_on() -> None:
    stage = Stage("t", "u")
    stage.connect()
    stage.receive(attached(1), attached(2))
    stage.receive(detached("SUPERSEDED", handle=0))
    assert not stage.session.done
    stage.session.lost()
    stage.connect()
    assert [command.attach.ticket for command in stage.sent] == ["u"]
    with pytest.raises(ChefsHatError, match="SUPERSEDED"):
        stage.session.results()["t"].raise_for_error()
    assert stage.log == [("attached", 0), ("lost", "SUPERSEDED")]
    assert stage.scribes["u"].log == [("attached", 0)]


def test_a_refused_ticket_stops_only_its_seat() -> None:
    stage = Stage("t", "u")
    stage.connect()
    refused = pb.Refused(request_id=1, reason="TICKET_UNKNOWN", message="no", metadata={"field": "ticket"}, code=16)
    # A refused attachment has a handle too.
    stage.receive(pb.SeatUpdate(handle=0, refused=refused), attached(2, seat=1))
    over = stage.session.results()["t"]
    assert over.error is not None
    assert (over.error.reason, over.error.metadata, over.seat) == ("TICKET_UNKNOWN", {"field": "ticket"}, -1)
    assert over.error.code is grpc.StatusCode.UNAUTHENTICATED
    assert stage.receive(decision(1, handle=0)) == []
    (ask,) = stage.receive(decision(1, handle=1))
    assert ask.agent is stage.scribes["u"]


def test_other_refused_commands_are_only_reported(stage: Stage) -> None:
    stage.receive(pb.SeatUpdate(handle=0, refused=pb.Refused(reason="EXPRESSION_REFUSED", message="too long")))
    assert stage.log[-1] == ("refused", "EXPRESSION_REFUSED")
    assert not stage.session.done


def test_a_snapshot_replaces_earlier_events(stage: Stage) -> None:
    started = pb.GameStarted(hand_size=17)
    stage.receive(pb.SeatUpdate(snapshot=pb.Snapshot(game_started=started, next_sequence=40)))
    (ask,) = stage.receive(events(39, 40), decision(3))
    assert ask.decision.hand_size == 17
    assert stage.log[-2:] == [("snapshot", 40), ("event", 40)]


def test_a_session_of_no_seats_is_done() -> None:
    assert PlaySession({}).done


def test_a_seat_knows_which_events_happened_before_it_was_first_attached() -> None:
    stage = Stage()
    stage.connect()
    stage.receive(attached(next_sequence=12))
    (ask,) = stage.receive(decision(1))
    stage.session.lost()
    stage.connect()
    stage.receive(attached(next_sequence=40))
    assert ask.decision.seat_info.live_from == 12
