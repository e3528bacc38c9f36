"""A session with scripted responses, and an agent that logs its hooks. Contains no tests."""

from chefshat import Agent, ChefsHatError, Decision, PlayOptions, SeatInfo, SeatResult, pb
from chefshat.seat_session import Ask
from chefshat.session import PlaySession

MASK = bytes([0b0000_0110])
HAND = bytes(12)


class Scribe(Agent):
    """Logs its hooks."""

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

    def on_awaited(self, awaited: pb.Awaited) -> None:
        self.log.append(("awaited", awaited.seat if awaited.HasField("seat") else None))

    def on_result(self, result: pb.AnswerResult) -> None:
        self.log.append(("result", pb.AnswerStatus.Name(result.status).removeprefix("ANSWER_STATUS_")))

    def on_refused(self, refused: pb.Refused) -> None:
        self.log.append(("refused", refused.reason))

    def on_game_over(self, result: SeatResult) -> None:
        self.log.append(("over", result.finished))

    def on_seat_lost(self, error: ChefsHatError) -> None:
        self.log.append(("lost", error.reason))


def attached(request_id: int = 1, seat: int = 0, next_sequence: int = 1) -> pb.SeatUpdate:
    message = pb.Attached(request_id=request_id, room_id="room", game_id="game", seat=seat, next_sequence=next_sequence)
    return pb.SeatUpdate(handle=request_id - 1, attached=message)


def events(*sequences: int, handle: int = 0, **kind: object) -> pb.SeatUpdate:
    message = [pb.GameEvent(sequence=sequence, **(kind or {"pass": pb.Pass()})) for sequence in sequences]  # type: ignore[arg-type]
    return pb.SeatUpdate(handle=handle, events=pb.EventBatch(events=message))


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
    reveal = pb.SeedReveal(seat_entropy=[b"mine", b"theirs"])
    return events(sequence, handle=handle, game_ended=pb.GameEnded(standings=table, reveal=reveal))


def substituted(sequence: int, seat: int = 0) -> pb.SeatUpdate:
    return events(sequence, substituted=pb.Substituted(seat=seat, built_in_agent="random"))


def returned(sequence: int, seat: int = 0) -> pb.SeatUpdate:
    return events(sequence, returned=pb.Returned(seat=seat))


class Stage:
    """A session and its driver."""

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

    def receive(self, *updates: pb.SeatUpdate) -> list[Ask]:
        asks = self.session.receive(pb.PlayResponse(updates=updates))
        self.flush()
        return asks

    def answer(self, ask: Ask, action: int = 1) -> None:
        self.session.answer(ask, action)
        self.flush()

    def commands(self) -> list[tuple[int, str | None]]:
        return [(command.handle, command.WhichOneof("command")) for command in self.sent]

    def answers(self) -> list[tuple[int, int, int]]:
        return [(command.handle, command.answer.decision_id, command.answer.action) for command in self.sent]
