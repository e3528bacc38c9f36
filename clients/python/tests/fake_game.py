"""The toy game of the fake server: decisions, results of answers, and the end.

It asks every connected seat the same number of questions, seat after seat, and ends with standings in seat order. It has no cards:
legal actions are made up. It records what it receives.
"""

import queue
import threading
from dataclasses import dataclass, field
from typing import Any

from chefshat import pb

SEATS = 4
SIZE = 214
MAX_INVALID = 3
# Default number of decisions per seat.
QUESTIONS = 5

Outbox = queue.SimpleQueue[pb.SeatUpdate | None]


def legal(decision_id: int) -> set[int]:
    """The legal actions of a seat's decision: two, different each time."""
    return {decision_id % SIZE, (decision_id * 37 + 100) % SIZE}


def mask(decision_id: int) -> bytes:
    """The mask of `legal`."""
    return sum(1 << action for action in legal(decision_id)).to_bytes((SIZE + 7) // 8, "little")


@dataclass
class FakeSeat:
    """A seat of the toy game."""

    number: int
    ticket: str
    outbox: Outbox | None = None
    handle: int = 0
    sent: int = 0
    decision_id: int = 0
    open: bool = False
    attempts_left: int = MAX_INVALID
    last: pb.AnswerResult | None = None
    answers: list[pb.Answer] = field(default_factory=list)
    attaches: list[pb.Attach] = field(default_factory=list)


class FakeGame:
    """The toy game of one room. Callers hold `lock`."""

    def __init__(self, number: int, request: pb.CreateRoomRequest, questions: int) -> None:
        self.lock = threading.RLock()
        self.changed = threading.Condition(self.lock)
        self.questions = questions
        self.join_code = f"CODE{number}"
        self.markers: list[pb.Marker] = []
        self.room = pb.Room(
            room_id=f"{number:032x}", game_id=f"{number + 4096:032x}", name=request.name, state=pb.ROOM_STATE_WAITING
        )
        built_in = [config.built_in_agent for config in request.seats] or [""] * SEATS
        for seat, agent in enumerate(built_in):
            self.room.seats.add(seat=seat, built_in_agent=agent, name=agent)
        self.seats = {seat: FakeSeat(seat, f"ticket-{number}-{seat}") for seat, agent in enumerate(built_in) if not agent}
        self.events: list[pb.GameEvent] = []
        self.over = False

    def add(self, **kind: Any) -> None:
        self.events.append(pb.GameEvent(sequence=len(self.events) + 1, **kind))
        self.changed.notify_all()

    def send(self, seat: FakeSeat, **update: Any) -> None:
        """Sends an update to a seat, if it is attached."""
        if seat.outbox is not None:
            seat.outbox.put(pb.SeatUpdate(handle=seat.handle, **update))

    def send_events(self, seat: FakeSeat) -> None:
        """Sends a seat the events it has not seen."""
        if self.events[seat.sent :]:
            self.send(seat, events=pb.EventBatch(events=self.events[seat.sent :]))
            seat.sent = len(self.events)

    def attach(self, seat: FakeSeat, attach: pb.Attach, outbox: Outbox, handle: int, tournament_id: str = "") -> None:
        """Attaches a seat to a stream, for a tournament's participant if one is named, and starts or resumes the game."""
        self.send(seat, detached=pb.Detached(reason=pb.DETACH_REASON_SUPERSEDED))
        seat.outbox, seat.handle, seat.sent = outbox, handle, max(attach.from_sequence - 1, 0)
        seat.attaches.append(attach)
        attached = pb.Attached(
            request_id=attach.request_id,
            room_id=self.room.room_id,
            game_id=self.room.game_id,
            seat=seat.number,
            next_sequence=len(self.events) + 1,
            ticket=seat.ticket if tournament_id else "",
            tournament_id=tournament_id,
        )
        self.send(seat, attached=attached)
        if self.over:
            self.send_events(seat)
            self.send(seat, detached=pb.Detached(reason=pb.DETACH_REASON_GAME_OVER))
        elif self.room.state == pb.ROOM_STATE_PLAYING:
            self.send_events(seat)
            if seat.open:
                self.ask(seat)
        elif all(other.outbox is not None for other in self.seats.values()):
            self.room.state = pb.ROOM_STATE_PLAYING
            self.add(game_started=pb.GameStarted(game_id=self.room.game_id, hand_size=17, seats=self.room.seats))
            self.advance()

    def advance(self) -> None:
        """Asks the next seat, or ends the game."""
        seat = min(self.seats.values(), key=lambda seat: (seat.decision_id, seat.number))
        if seat.decision_id == self.questions:
            self.end()
            return
        seat.decision_id += 1
        seat.open, seat.attempts_left = True, MAX_INVALID
        self.ask(seat)

    def ask(self, seat: FakeSeat) -> None:
        """Sends the open decision to its seat."""
        self.send_events(seat)
        observation = pb.Observation(
            shift=1,
            pizza=1,
            hand=bytes([0, 1, 0, 2, 0, 0, 0, 0, 0, 0, 3, 1]),
            board_face=0,
            cards_left=bytes([7] * SEATS),
            passed=bytes(SEATS),
            places=bytes(SEATS),
            roles=bytes(SEATS),
            points=[0] * SEATS,
            played=bytes(12),
        )
        request = pb.DecisionRequest(
            decision_id=seat.decision_id,
            kind=pb.DECISION_KIND_TURN,
            observation=observation,
            action_mask=mask(seat.decision_id),
            time_left_ms=10_000,
            bank_left_ms=60_000,
            invalid_attempts_left=seat.attempts_left,
        )
        self.send(seat, decision=request)

    def answer(self, seat: FakeSeat, answer: pb.Answer) -> pb.AnswerResult:
        """Takes an answer and calls `advance`. The caller sends the result."""
        seat.answers.append(answer)
        result = pb.AnswerResult(decision_id=answer.decision_id, action=answer.action)
        if seat.last is not None and (seat.last.decision_id, seat.last.action) == (answer.decision_id, answer.action):
            return seat.last  # A repeated answer gets the same acknowledgement.
        if answer.decision_id > seat.decision_id:
            result.status = pb.ANSWER_STATUS_UNKNOWN_DECISION
        elif answer.decision_id < seat.decision_id or not seat.open:
            result.status = pb.ANSWER_STATUS_CLOSED
        elif answer.action in legal(answer.decision_id):
            result.status = pb.ANSWER_STATUS_ACCEPTED
            seat.last, seat.open = result, False
            self.add(play=pb.Play(seat=seat.number, action=answer.action, source=pb.DECISION_SOURCE_AGENT))
        else:
            seat.attempts_left -= 1
            result.status = pb.ANSWER_STATUS_INVALID
            result.invalid_attempts_left = seat.attempts_left
            if seat.attempts_left == 0:
                seat.open = False
                self.add(play=pb.Play(seat=seat.number, action=min(legal(answer.decision_id)), source=pb.DECISION_SOURCE_INVALID))
        return result

    def end(self, reason: pb.AbortReason.ValueType | None = None) -> None:
        """Ends the game with standings, or aborts it for a reason."""
        self.over = True
        if reason is None:
            self.room.state = pb.ROOM_STATE_FINISHED
            self.add(shift_ended=pb.ShiftEnded(shift=1, order=range(SEATS), shift_points=[5, 3, 1, 0], points=[5, 3, 1, 0]))
            table = [pb.Standing(seat=seat, points=points, place=seat + 1) for seat, points in enumerate([5, 3, 1, 0])]
            self.add(game_ended=pb.GameEnded(standings=table))
        else:
            self.room.state = pb.ROOM_STATE_ABORTED
            self.add(game_aborted=pb.GameAborted(reason=reason))
        for seat in self.seats.values():
            self.send_events(seat)
            self.send(seat, detached=pb.Detached(reason=pb.DETACH_REASON_GAME_OVER))
