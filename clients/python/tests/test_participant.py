"""Tournament participants without a connection: attaching, agents of games, and the end."""

import pytest
from stage import Scribe, decision, detached, ended, events

from chefshat import Agent, ChefsHatError, PlayOptions, SeatInfo, pb
from chefshat.participant import REQUEST_ID
from chefshat.seat_session import Ask
from chefshat.session import PlaySession

# First handle of the seats that a server attaches.
FIRST_HANDLE = 2**31


class Cup:
    """A session of one participant, its driver, and its agents by game."""

    def __init__(self) -> None:
        self.scribes: dict[str, Scribe] = {}
        self.session = PlaySession.of_participant("cup", self._make, PlayOptions(entropy=b"mine"))
        self.connect()
        self.receive(entered())

    def _make(self, seat: SeatInfo) -> Agent:
        assert seat.game_id not in self.scribes, "one agent a game"
        return self.scribes.setdefault(seat.game_id, Scribe())

    def connect(self) -> list[tuple[str, int]]:
        """Connects. Returns the attachments in order, with their first events."""
        self.session.connected()
        attaches = [command.attach for request in self.session.take_requests() for command in request.commands]
        assert all(attach.entropy == b"mine" for attach in attaches)
        return [(attach.ticket, attach.from_sequence) for attach in attaches]

    def receive(self, *updates: pb.SeatUpdate) -> list[Ask]:
        return self.session.receive(pb.PlayResponse(updates=updates))

    def answers(self) -> list[tuple[int, int]]:
        commands = [command for request in self.session.take_requests() for command in request.commands]
        return [(command.handle, command.answer.decision_id) for command in commands if command.HasField("answer")]


def entered(handle: int = 0) -> pb.SeatUpdate:
    return pb.SeatUpdate(handle=handle, entered=pb.Entered(request_id=REQUEST_ID, tournament_id="tournament", participant=3))


def seated(handle: int, game: str, *, request_id: int = 0, seat: int = 0, next_sequence: int = 1) -> pb.SeatUpdate:
    message = pb.Attached(
        request_id=request_id,
        room_id=f"room of {game}",
        game_id=game,
        seat=seat,
        next_sequence=next_sequence,
        ticket=f"ticket of {game}",
        tournament_id="tournament",
    )
    return pb.SeatUpdate(handle=handle, attached=message)


def refused(request_id: int) -> pb.SeatUpdate:
    return pb.SeatUpdate(refused=pb.Refused(request_id=request_id, reason="TICKET_UNKNOWN", message="no", code=16))


def test_every_game_has_its_own_agent() -> None:
    cup = Cup()
    asks = cup.receive(
        seated(FIRST_HANDLE, "a"),
        seated(FIRST_HANDLE + 1, "b", seat=1),
        events(1, handle=FIRST_HANDLE),
        decision(5, FIRST_HANDLE + 1),
        decision(4, FIRST_HANDLE),
    )
    assert [ask.agent for ask in asks] == [cup.scribes["b"], cup.scribes["a"]]
    for ask in asks:
        cup.session.answer(ask, 1)
    assert cup.answers() == [(FIRST_HANDLE + 1, 5), (FIRST_HANDLE, 4)]
    assert cup.scribes["a"].log == [("attached", 0), ("event", 1)]
    cup.receive(ended(2, handle=FIRST_HANDLE + 1), detached("GAME_OVER", handle=FIRST_HANDLE + 1))
    cup.receive(ended(2, handle=FIRST_HANDLE), detached("GAME_OVER", handle=FIRST_HANDLE))
    assert not cup.session.done, "there may be more games"
    cup.receive(detached("TOURNAMENT_OVER"))
    assert cup.session.done
    played = cup.session.played()
    assert [(result.game_id, result.place, result.entropy) for result in played] == [("a", 2, b"mine"), ("b", 1, b"mine")]


def test_a_new_connection_continues_with_the_same_agents() -> None:
    cup = Cup()
    (ask,) = cup.receive(
        seated(FIRST_HANDLE, "a"), seated(FIRST_HANDLE + 1, "b"), events(1, 2, handle=FIRST_HANDLE), decision(4, FIRST_HANDLE)
    )
    cup.session.answer(ask, 1)
    assert cup.answers() == [(FIRST_HANDLE, 4)]
    cup.session.lost()
    assert cup.connect() == [("ticket of a", 3), ("ticket of b", 0), ("cup", 0)]
    asks = cup.receive(
        seated(0, "a", request_id=1, next_sequence=4),
        seated(1, "b", request_id=2),
        entered(2),
        seated(FIRST_HANDLE, "c"),
        events(3, handle=0),
        decision(4, 0),
        decision(1, 1),
        decision(2, FIRST_HANDLE),
    )
    assert [ask.agent for ask in asks] == [cup.scribes["b"], cup.scribes["c"]], "the answer of a is repeated, and not thought over"
    assert cup.answers() == [(0, 4)]
    assert cup.scribes["a"].log == [("attached", 0), ("event", 1), ("event", 2), ("attached", 0), ("event", 3)]


def test_a_seat_attached_twice_is_one_seat() -> None:
    cup = Cup()
    cup.receive(seated(FIRST_HANDLE, "a"), events(1, handle=FIRST_HANDLE))
    (ask,) = cup.receive(
        seated(FIRST_HANDLE + 1, "a", next_sequence=2),
        detached("SUPERSEDED", handle=FIRST_HANDLE),
        events(1, 2, handle=FIRST_HANDLE + 1),
        decision(4, FIRST_HANDLE + 1),
    )
    assert ask.agent is cup.scribes["a"]
    assert cup.scribes["a"].log == [("attached", 0), ("event", 1), ("attached", 0), ("event", 2)]


def test_a_seat_that_the_server_attached_first_is_played_under_its_newest_handle() -> None:
    cup = Cup()
    cup.receive(seated(FIRST_HANDLE, "a"), events(1, handle=FIRST_HANDLE))
    cup.session.lost()
    cup.connect()
    (ask,) = cup.receive(
        entered(1),
        seated(FIRST_HANDLE, "a"),
        seated(0, "a", request_id=1, next_sequence=2),
        detached("SUPERSEDED", handle=FIRST_HANDLE),
        decision(4, 0),
    )
    assert ask.agent is cup.scribes["a"]


def test_a_game_that_ended_is_not_played_again() -> None:
    cup = Cup()
    cup.receive(seated(FIRST_HANDLE, "a"), ended(1, handle=FIRST_HANDLE))
    cup.session.lost()
    cup.connect()
    # The server has not counted the game yet, and attaches its seat again.
    cup.receive(entered(0), seated(FIRST_HANDLE, "a"), ended(1, handle=FIRST_HANDLE), detached("GAME_OVER", handle=FIRST_HANDLE))
    (request,) = cup.session.take_requests()
    (command,) = request.commands
    assert (command.handle, command.WhichOneof("command")) == (FIRST_HANDLE, "detach")
    cup.receive(detached("TOURNAMENT_OVER", handle=0))
    (played,) = cup.session.played()
    assert played.game_id == "a"


def test_a_participant_enters_again_after_the_server_has_stopped() -> None:
    cup = Cup()
    cup.receive(detached("SERVER_STOPPING"))
    assert not cup.session.done
    cup.session.lost()
    assert cup.connect() == [("cup", 0)]


def test_the_end_of_the_tournament_waits_for_open_games() -> None:
    cup = Cup()
    cup.receive(seated(FIRST_HANDLE, "a"), detached("TOURNAMENT_OVER"))
    assert not cup.session.done
    cup.session.lost()
    assert cup.connect() == [("ticket of a", 0)], "nobody enters what is over"
    aborted = events(1, handle=0, game_aborted=pb.GameAborted(reason=pb.ABORT_REASON_CLOSED))
    cup.receive(seated(0, "a", request_id=1), aborted, detached("GAME_OVER"))
    assert cup.session.done
    (result,) = cup.session.played()
    assert (result.abort_reason, result.finished) == ("CLOSED", False)


def test_a_lost_room_does_not_stop_other_games() -> None:
    cup = Cup()
    cup.receive(seated(FIRST_HANDLE, "a"))
    cup.session.lost()
    assert len(cup.connect()) == 2
    cup.receive(
        refused(1), entered(1), seated(FIRST_HANDLE, "b"), ended(1, handle=FIRST_HANDLE), detached("GAME_OVER", handle=FIRST_HANDLE)
    )
    cup.receive(detached("TOURNAMENT_OVER", handle=1))
    lost, played = cup.session.played()
    assert lost.error is not None
    assert (lost.game_id, lost.error.reason) == ("a", "TICKET_UNKNOWN")
    assert (played.game_id, played.place) == ("b", 2)


@pytest.mark.parametrize(
    ("update", "reason"),
    [(refused(REQUEST_ID), "TICKET_UNKNOWN"), (detached("SUPERSEDED"), "SUPERSEDED"), (detached("REQUESTED"), "DETACHED")],
)
def test_a_lost_participant_has_an_error(update: pb.SeatUpdate, reason: str) -> None:
    cup = Cup()
    cup.receive(seated(FIRST_HANDLE, "a"), update)
    assert not cup.session.done, "its game may go on"
    cup.receive(detached("SUPERSEDED", handle=FIRST_HANDLE))
    assert cup.session.done
    with pytest.raises(ChefsHatError, match=reason):
        cup.session.played()


def test_giving_up_ends_the_participant_too() -> None:
    cup = Cup()
    cup.receive(seated(FIRST_HANDLE, "a"))
    cup.session.give_up(ChefsHatError("UNAVAILABLE"))
    assert cup.session.done
    with pytest.raises(ChefsHatError, match="UNAVAILABLE"):
        cup.session.played()


def test_unexpected_updates_do_not_stop_the_participant() -> None:
    cup = Cup()
    (ask,) = cup.receive(
        decision(1, FIRST_HANDLE),
        detached("GAME_OVER", handle=FIRST_HANDLE),
        seated(FIRST_HANDLE, "a", request_id=77),
        seated(FIRST_HANDLE, "b"),
        decision(1, FIRST_HANDLE),
        decision(1, 0),
    )
    assert ask.agent is cup.scribes["b"]
    assert list(cup.scribes) == ["b"]
    assert not cup.session.done


def test_a_seat_ticket_plays_only_this_seat() -> None:
    entries: list[pb.Entered] = []
    scribe = Scribe()
    session = PlaySession.of_participant("seat", lambda seat: scribe, PlayOptions(entropy=b"mine"), entries.append)
    session.connected()
    session.take_requests()
    (ask,) = session.receive(pb.PlayResponse(updates=[seated(0, "a", request_id=REQUEST_ID, seat=2), events(1), decision(4)]))
    session.answer(ask, 1)
    session.lost()
    session.connected()
    (attach,) = [command.attach for request in session.take_requests() for command in request.commands]
    assert (attach.ticket, attach.from_sequence, attach.entropy) == ("seat", 2, b"mine")
    session.receive(
        pb.PlayResponse(updates=[seated(0, "a", request_id=attach.request_id, seat=2), ended(2), detached("GAME_OVER")])
    )
    assert session.done
    (result,) = session.played()
    assert (result.game_id, result.seat, result.reconnects, entries) == ("a", 2, 1, [])


def test_on_entered_is_called_on_each_connection() -> None:
    entries: list[pb.Entered] = []
    session = PlaySession.of_participant("cup", lambda seat: Scribe(), on_entered=entries.append)
    for connections in (1, 2):
        session.connected()
        session.receive(pb.PlayResponse(updates=[entered()]))
        session.lost()
        assert [(entry.tournament_id, entry.participant) for entry in entries] == [("tournament", 3)] * connections


def test_a_participant_ticket_is_not_a_seat_ticket() -> None:
    session = PlaySession({"cup": Scribe(), "t": Scribe()})
    session.connected()
    session.take_requests()
    message = pb.Entered(request_id=1, tournament_id="tournament", participant=3)
    session.receive(
        pb.PlayResponse(updates=[pb.SeatUpdate(handle=0, entered=message), seated(FIRST_HANDLE, "a"), seated(1, "b", request_id=2)])
    )
    (detach,) = [command for request in session.take_requests() for command in request.commands]
    assert (detach.handle, detach.WhichOneof("command")) == (0, "detach")
    assert not session.done, "the other plays on"
    error = session.results()["cup"].error
    assert error is not None
    assert error.reason == "TICKET_OF_PARTICIPANT"


def test_unknown_seats_are_ignored() -> None:
    session = PlaySession({"t": Scribe()})
    session.connected()
    assert session.receive(pb.PlayResponse(updates=[seated(FIRST_HANDLE, "a"), decision(1, FIRST_HANDLE)])) == []
