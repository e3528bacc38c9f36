"""Limits of messages: large requests, invalid annotations, long entropy."""

import itertools
import logging
import math

import pytest
from stage import Scribe, Stage, attached, decision, detached, ended, result

from chefshat import PlayOptions, pb
from chefshat.limits import MAX_ANNOTATIONS_BYTES, MAX_COMMANDS, MAX_ENTROPY_BYTES, MAX_REQUEST_BYTES, why_not_recorded
from chefshat.session import PlaySession


def test_requests_respect_the_limit_of_commands() -> None:
    tickets = [f"{number}" for number in range(MAX_COMMANDS + 1)]
    session = PlaySession({ticket: Scribe() for ticket in tickets}, PlayOptions(entropy=b""))
    session.connected()
    sizes = [len(request.commands) for request in session.take_requests()]
    assert sizes == [MAX_COMMANDS, 1]
    assert session.take_requests() == []


def test_a_request_is_split_by_size() -> None:
    tickets = [f"{number:0200}" for number in range(MAX_COMMANDS)]
    session = PlaySession({ticket: Scribe() for ticket in tickets})
    session.connected()
    requests = session.take_requests()
    assert [command.attach.ticket for request in requests for command in request.commands] == tickets
    assert all(0 < request.ByteSize() <= MAX_REQUEST_BYTES for request in requests)
    # No two consecutive requests would fit into one.
    together = [one.ByteSize() + other.ByteSize() for one, other in itertools.pairwise(requests)]
    assert len(together) > 4
    assert min(together[:-1]) > MAX_REQUEST_BYTES


def test_the_largest_annotations_of_many_seats_are_split() -> None:
    stage = Stage(*(f"ticket {number}" for number in range(40)))
    stage.connect()
    asks = stage.receive(*(attached(number) for number in range(1, 41)), *(decision(1, handle) for handle in range(40)))
    assert len(asks) == 40
    for ask in asks:
        ask.decision.annotations = annotations_of(MAX_ANNOTATIONS_BYTES)
        stage.session.answer(ask, 1)
    requests = stage.session.take_requests()
    assert all(request.ByteSize() <= MAX_REQUEST_BYTES for request in requests)
    sent = [command for request in requests for command in request.commands]
    assert [command.handle for command in sent] == list(range(40))
    assert all(command.answer.annotations.ByteSize() == MAX_ANNOTATIONS_BYTES for command in sent)


def annotations_of(size: int) -> pb.Annotations:
    """Returns annotations of a given size."""
    annotations = pb.Annotations(extra={"why": "x" * (size - 20)})
    annotations.extra["why"] += "x" * (size - annotations.ByteSize())
    assert annotations.ByteSize() == size
    return annotations


def test_annotations_are_sent_with_the_answer(stage: Stage) -> None:
    (ask,) = stage.receive(decision(1))
    ask.decision.annotate(value_estimate=0.25)
    stage.answer(ask)
    assert stage.sent[0].answer.annotations.value_estimate == 0.25
    stage.receive(ended(1), detached("GAME_OVER"))
    assert stage.session.results()["t"].annotations_dropped == 0


@pytest.mark.parametrize(
    ("annotations", "why"),
    [
        (annotations_of(MAX_ANNOTATIONS_BYTES + 1), "4097 bytes"),
        (annotations_of(100_000), "100000 bytes"),
        (pb.Annotations(value_estimate=math.nan), "value_estimate"),
        (pb.Annotations(value_estimate=-math.inf), "value_estimate"),
        # Finite as the agent's double, not as the message's float.
        (pb.Annotations(value_estimate=1e300), "value_estimate"),
        (pb.Annotations(action_scores=[0.0, 1.0, math.nan]), "action_scores"),
    ],
    ids=["a byte too long", "far too long", "not a number", "infinite", "too large a number", "a score is no number"],
)
def test_invalid_annotations_are_dropped_and_the_answer_is_sent(
    stage: Stage, caplog: pytest.LogCaptureFixture, annotations: pb.Annotations, why: str
) -> None:
    caplog.set_level(logging.WARNING, "chefshat")
    for number in (1, 2):
        (ask,) = stage.receive(decision(number))
        ask.decision.annotations = annotations
        stage.answer(ask)
        assert stage.answers() == [(0, number, 1)]
        assert not stage.sent[0].answer.HasField("annotations")
        stage.receive(result(number, "ACCEPTED"))
    # Logged once, counted twice.
    assert [why in record.getMessage() for record in caplog.records] == [True]
    stage.receive(ended(1), detached("GAME_OVER"))
    over = stage.session.results()["t"]
    assert (over.decisions, over.annotations_dropped) == (2, 2)


def test_annotations_within_the_limits_are_recorded() -> None:
    assert why_not_recorded(pb.Annotations()) == ""
    assert why_not_recorded(annotations_of(MAX_ANNOTATIONS_BYTES)) == ""
    assert why_not_recorded(pb.Annotations(value_estimate=-3.5, action_scores=[0.0, 1e30, -1e30])) == ""


def test_annotations_the_server_drops_are_counted_once(stage: Stage, caplog: pytest.LogCaptureFixture) -> None:
    (ask,) = stage.receive(decision(1))
    ask.decision.annotate(value_estimate=0.25)
    stage.answer(ask)
    acknowledgement = result(1, "ACCEPTED")
    acknowledgement.result.annotations_dropped = True
    stage.receive(acknowledgement, acknowledgement)
    assert ["server refused them" in record.getMessage() for record in caplog.records] == [True]
    stage.receive(ended(1), detached("GAME_OVER"))
    assert stage.session.results()["t"].annotations_dropped == 1


def test_entropy_longer_than_the_protocol_allows_is_refused() -> None:
    assert PlayOptions(entropy=bytes(MAX_ENTROPY_BYTES)).draw_entropy() == bytes(MAX_ENTROPY_BYTES)
    with pytest.raises(ValueError, match="33 bytes"):
        PlayOptions(entropy=bytes(MAX_ENTROPY_BYTES + 1))
