"""Lost connections and substitutes, without a connection: what the session repeats."""

from collections.abc import Callable

import pytest
from stage import Stage, attached, decision, detached, ended, events, result, returned, substituted

from chefshat import ChefsHatError, pb


def test_reconnecting_resumes_after_the_last_event(stage: Stage) -> None:
    stage.receive(events(1, 2, 3))
    stage.session.lost()
    stage.connect()
    assert stage.sent[0].attach.from_sequence == 4
    # A repeated event is reported once.
    stage.receive(attached(), events(3, 4))
    assert [line for line in stage.log if line[0] == "event"] == [("event", number) for number in (1, 2, 3, 4)]  # type: ignore[index]
    stage.receive(ended(5), detached("GAME_OVER"))
    assert stage.session.results()["t"].reconnects == 1


def test_a_seat_resumes_after_the_server_has_stopped(stage: Stage) -> None:
    stage.receive(events(1), detached("SERVER_STOPPING"))
    assert not stage.session.done
    stage.session.lost()
    stage.connect()
    assert stage.sent[0].attach.from_sequence == 2


def test_an_unacknowledged_answer_is_repeated_once_and_not_recomputed(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    stage.answer(ask, 2)
    stage.session.lost()
    stage.connect()
    asks = stage.session.receive(pb.PlayResponse(updates=[attached(), decision(1)]))
    assert asks == []
    stage.flush()
    assert stage.answers() == [(0, 1, 2)]
    # The acknowledgement may come twice: once more for the answer of the lost connection.
    stage.receive(result(1, "ACCEPTED"), result(1, "ACCEPTED"))
    stage.receive(ended(1), detached("GAME_OVER"))
    assert stage.session.results()["t"].decisions == 1


def test_a_repeated_decision_is_answered_on_the_new_connection(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    stage.session.lost()
    stage.connect()
    assert stage.receive(attached(), decision(1)) == []
    stage.answer(ask)
    assert stage.answers() == [(0, 1, 1)]


def test_an_answer_given_between_connections_is_sent_on_the_next(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    stage.session.lost()
    stage.answer(ask)
    assert stage.sent == []
    stage.connect()
    assert [command.WhichOneof("command") for command in stage.sent] == ["attach"]
    assert stage.receive(attached(), decision(1)) == []
    assert stage.answers() == [(0, 1, 1)]


def test_a_decision_not_yet_asked_is_asked_when_repeated(stage: Stage) -> None:
    asks = stage.receive(decision(1))
    stage.session.lost(unasked=asks)
    stage.connect()
    (again,) = stage.receive(attached(), decision(1))
    assert again.decision.decision_id == 1


def test_handles_of_a_lost_connection_are_ignored() -> None:
    stage = Stage("t", "u")
    stage.connect()
    stage.receive(attached(1, seat=0), attached(2, seat=3))
    stage.receive(detached("GAME_OVER", handle=0))
    stage.session.lost()
    stage.connect()
    assert [(command.attach.ticket, command.attach.request_id) for command in stage.sent] == [("u", 2)]
    # On this connection the second seat is the first to attach.
    stage.receive(pb.SeatUpdate(handle=0, attached=pb.Attached(request_id=2, seat=3)))
    (ask,) = stage.receive(decision(1, handle=0))
    assert ask.decision.seat == 3
    assert stage.receive(decision(1, handle=1)) == []


def test_no_reconnection_after_the_games(stage: Stage) -> None:
    stage.receive(ended(1))
    stage.session.lost()
    assert stage.session.done
    assert stage.session.results()["t"].finished


def test_giving_up_ends_open_seats(stage: Stage) -> None:
    stage.session.lost()
    stage.session.give_up(ChefsHatError("UNAVAILABLE"))
    assert stage.session.done
    with pytest.raises(ChefsHatError, match="UNAVAILABLE"):
        stage.session.results()["t"].raise_for_error()


def test_only_events_and_accepted_answers_are_progress(stage: Stage) -> None:
    steps: list[tuple[Callable[[], object], bool]] = [
        (lambda: stage.receive(events(1)), True),
        (lambda: stage.receive(events(1)), False),
        (lambda: stage.receive(attached()), False),
        (lambda: stage.answer(stage.receive(decision(1))[0]), False),
        (lambda: stage.receive(result(1, "ACCEPTED")), True),
        (lambda: stage.receive(result(1, "ACCEPTED")), False),
    ]
    for number, (step, moves) in enumerate(steps):
        before = stage.session.progress
        step()
        assert (stage.session.progress > before) is moves, number


def test_a_substituted_seat_resumes_once(stage: Stage) -> None:
    stage.receive(substituted(1, seat=3))
    assert stage.commands() == []
    stage.receive(substituted(2))
    assert stage.commands() == [(0, "resume")]
    stage.receive(events(3), substituted(2))
    assert stage.commands() == []
    stage.receive(returned(4), decision(1))
    assert stage.commands() == []
    # A later substitution is answered again.
    stage.receive(substituted(5))
    assert stage.commands() == [(0, "resume")]


def test_a_substitution_that_others_do_not_see_is_ended_as_well(stage: Stage) -> None:
    active, over = (pb.SeatUpdate(substitution=pb.Substitution(active=active)) for active in (True, False))
    stage.receive(active)
    assert stage.commands() == [(0, "resume")]
    stage.receive(over)
    stage.receive(active, over)
    assert stage.commands() == []


def test_a_decision_that_is_left_open_leaves_the_seat_to_the_substitute(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    stage.session.answer(ask, None)
    stage.receive(substituted(1))
    assert stage.commands() == []
    # It is asked again, and so takes the seat back, also before it has answered.
    stage.receive(returned(2), decision(2))
    stage.receive(substituted(3))
    assert stage.commands() == [(0, "resume")]


def test_a_substitution_that_is_over_is_not_answered(stage: Stage) -> None:
    (ask,) = stage.receive(substituted(1), returned(2), decision(1))
    assert stage.commands() == []
    stage.answer(ask)
    assert stage.commands() == [(0, "answer")]
    # Attaching ends earlier substitutions.
    stage.session.lost()
    stage.connect()
    stage.receive(attached(next_sequence=10), substituted(9))
    assert stage.commands() == [(0, "answer")]
    stage.receive(substituted(10), returned(11, seat=3))
    assert stage.commands() == [(0, "resume")]


def test_a_substituted_seat_without_game_or_connection_does_not_resume(stage: Stage) -> None:
    stage.receive(substituted(1), ended(2))
    assert stage.commands() == []
    stage.receive(detached("GAME_OVER"))
    assert stage.session.results()["t"].finished
    other = Stage()
    other.connect()
    other.receive(attached())
    other.receive(substituted(1), detached("SUPERSEDED"))
    assert other.commands() == []


def test_every_substituted_seat_resumes_on_its_own_handle() -> None:
    stage = Stage("t", "u")
    stage.connect()
    stage.receive(attached(1, seat=2), attached(2, seat=3))
    both = [pb.GameEvent(sequence=seat, substituted=pb.Substituted(seat=seat)) for seat in (2, 3)]
    stage.receive(*(pb.SeatUpdate(handle=handle, events=pb.EventBatch(events=both)) for handle in (0, 1)))
    assert stage.commands() == [(0, "resume"), (1, "resume")]
