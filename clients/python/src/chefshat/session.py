"""The protocol of a `Play` stream without the stream: responses go in, requests come out.

Both clients, blocking and asyncio, drive one `PlaySession` for any number of seats, or for all seats of a tournament participant,
over any number of connections. There is no IO, clock, thread or waiting here, and no knowledge of the rules.

The driver of a connection calls `connected()` and sends `take_requests()`; for each response it calls `receive(response)`, decides
what that returns, calls `answer(...)` for each, and sends `take_requests()`; it stops when `done`. After a lost connection it calls
`lost()` and starts again.
"""

import logging
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Self, SupportsIndex

from chefshat import pb
from chefshat.agents import Agent
from chefshat.decision import Decision, SeatInfo
from chefshat.errors import ChefsHatError, from_refused
from chefshat.history import ShiftLog
from chefshat.limits import MAX_ENTROPY_BYTES, pack, why_not_recorded
from chefshat.participant import REQUEST_ID, MakeAgent, OnEntered, Participant
from chefshat.requests import attach
from chefshat.result import SeatResult, abort_reason_of, standings_of
from chefshat.seat_session import Ask, SeatSession

LOG = logging.getLogger("chefshat")


@dataclass(frozen=True)
class PlayOptions:
    """How seats attach.

    Attributes:
        entropy: each seat's contribution to the game seed, 0..=32 bytes; None: 32 random bytes for each seat, so that no single
            party chooses the deals. It counts if given before the game starts, and is part of the result. A participant of a
            tournament has one for all its games; it counts in those that are dealt independently.
        delivery: how events reach the seats; unspecified means together with the next decision.

    Raises:
        ValueError: the entropy is too long.
    """

    entropy: bytes | None = None
    delivery: pb.EventDelivery.ValueType = pb.EVENT_DELIVERY_UNSPECIFIED

    def __post_init__(self) -> None:
        if self.entropy is not None and len(self.entropy) > MAX_ENTROPY_BYTES:
            raise ValueError(f"entropy is {len(self.entropy)} bytes long; the maximum is {MAX_ENTROPY_BYTES}")

    def draw_entropy(self) -> bytes:
        """Returns the bytes for one seat or participant."""
        return os.urandom(MAX_ENTROPY_BYTES) if self.entropy is None else self.entropy


class PlaySession:
    """Plays any number of seats over one stream at a time. Not thread-safe: one thread at a time may call it."""

    def __init__(self, agents: Mapping[str, Agent], options: PlayOptions | None = None) -> None:
        """Creates a session.

        Args:
            agents: the agent for each ticket.
            options: how the seats attach.
        """
        self._options = options or PlayOptions()
        # Seats in play by request id. The ids count from 1, since 0 means unset.
        self._seats: dict[int, SeatSession] = {}
        # Finished seats: only the results, so that agents of a long tournament can be freed.
        self._results: dict[int, tuple[str, SeatResult]] = {}
        self._added = 0
        self._participant: Participant | None = None
        self._by_handle: dict[int, SeatSession] = {}
        self._outbox: list[pb.SeatCommand] = []
        #: Grows with every event and answer of a seat, and with a connection that lasts. One without progress counts as failed.
        self.progress = 0
        for ticket, agent in agents.items():
            self._add(ticket, agent, self._options.draw_entropy())

    @classmethod
    def of_participant(
        cls, ticket: str, make_agent: MakeAgent, options: PlayOptions | None = None, on_entered: OnEntered | None = None
    ) -> Self:
        """Creates a session of all seats of a tournament participant, each with its own agent.

        With the ticket of a seat, which only the server can tell apart, the session has only this seat.
        """
        session = cls({}, options)
        session._participant = Participant(ticket, make_agent, session._options.draw_entropy(), on_entered)
        return session

    def _add(self, ticket: str, agent: Agent, entropy: bytes) -> SeatSession:
        self._added += 1
        seat = SeatSession(ticket, self._added, agent, entropy)
        self._seats[seat.request_id] = seat
        return seat

    @property
    def done(self) -> bool:
        """Whether every seat has its result and no further seats can follow."""
        return not self._seats and (self._participant is None or self._participant.over)

    def results(self) -> dict[str, SeatResult]:
        """Returns the result of each finished ticket, in the order of the tickets given."""
        return dict(self._in_order())

    def _in_order(self) -> list[tuple[str, SeatResult]]:
        return [self._results[request_id] for request_id in sorted(self._results)]

    def played(self) -> list[SeatResult]:
        """Returns the results of a participant's games, in the order in which it was seated.

        Raises:
            ChefsHatError: the participant was lost before the end of the tournament.
        """
        if self._participant is not None and self._participant.error is not None:
            raise self._participant.error
        return [result for _, result in self._in_order()]

    def connected(self) -> None:
        """Starts a new connection: attaches every unfinished seat, from the event after the last one seen.

        The seats of a participant attach before the participant itself, each with its own ticket, to resume after the last event
        seen and to receive the end of a game that ended meanwhile. The server then keeps these attachments.
        """
        self._by_handle.clear()
        self._outbox.clear()
        delivery = self._options.delivery
        for seat in self._seats.values():
            seat.handle = None
            seat.substituted = False
            self._outbox.append(attach(seat.ticket, seat.request_id, seat.last_sequence, seat.entropy, delivery))
        participant = self._participant
        if participant is not None and not participant.over:
            self._outbox.append(participant.attach(delivery))

    def lost(self, unasked: Iterable[Ask] = ()) -> None:
        """Ends a connection. Seats that have seen their game end are done; the others wait for `connected`.

        Args:
            unasked: decisions that no agent has been asked for; the server will send them again.
        """
        for seat, decision in unasked:
            if seat.asked is decision:
                seat.asked = None
        self._by_handle.clear()
        self._outbox.clear()
        for seat in list(self._seats.values()):
            seat.handle = None
            if seat.game_is_over:
                self._finish(seat)

    def give_up(self, error: ChefsHatError) -> None:
        """Ends the session: every unfinished seat gets this error as its result."""
        for seat in list(self._seats.values()):
            self._finish(seat, error)
        if self._participant is not None:
            self._participant.end(error)

    def take_requests(self) -> list[pb.PlayRequest]:
        """Returns the requests to send now, in order; usually none or one."""
        outbox = self._outbox
        if not outbox:
            return []
        self._outbox = []
        return pack(outbox)

    def receive(self, response: pb.PlayResponse) -> list[Ask]:
        """Processes a response and calls the agents' hooks, in order.

        Returns:
            The decisions to make. Answer each with `answer`, in any order, at any time.
        """
        asks: list[Ask] = []
        # Seats that may have to resume from their substitutes, unless the same response says they have.
        away: list[SeatSession] = []
        by_handle = self._by_handle
        for update in response.updates:
            what = update.WhichOneof("update")
            if what == "attached":
                self._attached(update.handle, update.attached)
                continue
            if what == "refused":
                self._refused(update.handle, update.refused)
                continue
            seat = by_handle.get(update.handle)
            if seat is None:
                self._without_seat(update)
                continue
            if what == "decision":
                self._decision(seat, update.decision, asks)
            elif what == "events":
                self._events(seat, update.events)
            elif what == "result":
                self._result(seat, update.result, asks)
            elif what == "snapshot":
                self._snapshot(seat, update.snapshot)
            elif what == "awaited":
                self._awaited(seat, update.awaited)
            elif what == "substitution":
                seat.substituted = update.substitution.active
            elif what == "detached":
                self._detached(seat, update.handle, update.detached)
            if seat.substituted:
                away.append(seat)
        for seat in away:
            self._resume(seat)
        return asks

    def answer(self, ask: Ask, action: SupportsIndex | None) -> None:
        """Answers a decision, or leaves it open. If the seat is not attached, the answer is sent when it is attached again."""
        seat, decision = ask
        if seat.asked is not decision:
            return  # The server has closed the decision.
        if action is None:
            if not seat.has_left_open:
                LOG.warning("decision %d of seat %d is left open, as `decide` returned None", decision.decision_id, decision.seat)
            seat.left_open = seat.has_left_open = True
            seat.asked = None
            return
        answer = pb.Answer(decision_id=decision.decision_id, action=action.__index__(), annotations=self._annotations(ask))
        seat.asked = None
        seat.unacknowledged = answer
        seat.answered = decision
        self._send_answer(seat)

    def _annotations(self, ask: Ask) -> pb.Annotations | None:
        """Returns the decision's annotations, unless the server would refuse to record them."""
        seat, decision = ask
        annotations = decision.annotations
        if annotations is not None and (why := why_not_recorded(annotations)):
            self._note_dropped(seat, decision.decision_id, why)
            return None
        return annotations

    def _note_dropped(self, seat: SeatSession, decision_id: int, why: str) -> None:
        """Counts dropped annotations. Logs only the first, because an agent that sends such annotations usually repeats them."""
        seat.annotations_dropped += 1
        if seat.annotations_dropped == 1:
            LOG.warning(
                "dropped the annotations of decision %d of seat %d: %s; further ones are counted in the result",
                decision_id,
                seat.info.seat if seat.info else -1,
                why,
            )

    def _resume(self, seat: SeatSession) -> None:
        """Takes the seat back from its substitute, if it has one and the agent has not left its last decision open."""
        if seat.substituted and not seat.left_open and seat.handle is not None and not seat.game_is_over:
            self._outbox.append(pb.SeatCommand(handle=seat.handle, resume=pb.ResumeSeat()))
        seat.substituted = False

    def _send_answer(self, seat: SeatSession) -> None:
        if seat.handle is not None and seat.unacknowledged is not None:
            self._outbox.append(pb.SeatCommand(handle=seat.handle, answer=seat.unacknowledged))

    def _without_seat(self, update: pb.SeatUpdate) -> None:
        """Processes an update on a handle that is not a seat's: a participant's, or an old one."""
        participant = self._participant
        if participant is None:
            seat = self._seats.get(update.entered.request_id)
            if seat is not None:
                self._outbox.append(pb.SeatCommand(handle=update.handle, detach=pb.Detach()))
                message = "this is the ticket of a tournament participant, not of a seat: use `play_tournament`"
                self._finish(seat, ChefsHatError("TICKET_OF_PARTICIPANT", message))
        else:
            participant.receive(update)

    def _seated(self, participant: Participant, attached: pb.Attached) -> SeatSession:
        """Returns the session of a participant's seat, which may be new."""
        for seat in self._seats.values():
            if seat.info is not None and seat.info.game_id == attached.game_id:
                return seat
        return self._add_seat(participant, attached, attached.ticket)

    def _has_played(self, game_id: str) -> bool:
        """Whether a game has its result."""
        return any(result.game_id == game_id and result.error is None for _, result in self._results.values())

    def _add_seat(self, participant: Participant, attached: pb.Attached, ticket: str) -> SeatSession:
        agent = participant.make_agent(SeatInfo(attached.room_id, attached.game_id, attached.seat))
        return self._add(ticket, agent, participant.entropy)

    def _attached(self, handle: int, attached: pb.Attached) -> None:
        seat = self._seats.get(attached.request_id)
        participant = self._participant
        if participant is not None and attached.request_id == 0:
            if self._has_played(attached.game_id):
                # It ended on a connection that was lost before the server could count it.
                self._outbox.append(pb.SeatCommand(handle=handle, detach=pb.Detach()))
                return
            seat = self._seated(participant, attached)
        elif participant is not None and attached.request_id == REQUEST_ID:
            # The ticket is a seat's, not a participant's.
            seat = self._add_seat(participant, attached, participant.ticket)
            participant.end()
        if seat is None:
            return
        # The newest handle of a seat replaces an older one.
        if seat.handle is not None:
            self._by_handle.pop(seat.handle, None)
        seat.handle = handle
        seat.live_from = attached.next_sequence
        seat.attachments += 1
        self._by_handle[handle] = seat
        if seat.info is None:
            seat.info = SeatInfo(attached.room_id, attached.game_id, attached.seat, attached.next_sequence)
        seat.agent.on_attached(seat.info)
        # Unless the server says so again, the game does not wait for whom it waited for before.
        if seat.awaits:
            self._awaited(seat, pb.Awaited())
        # The last answer may not have arrived. The server acknowledges a repeated answer in the same way.
        self._send_answer(seat)

    @staticmethod
    def _awaited(seat: SeatSession, awaited: pb.Awaited) -> None:
        seat.awaits = awaited.HasField("seat")
        seat.agent.on_awaited(awaited)

    def _refused(self, handle: int, refused: pb.Refused) -> None:
        if refused.request_id == REQUEST_ID and self._participant is not None:
            self._participant.end(from_refused(refused))
            return
        seat = self._seats.get(refused.request_id)
        if seat is not None and seat.handle is None:
            self._finish(seat, None if seat.game_is_over else from_refused(refused))
            return
        seat = self._by_handle.get(handle)
        LOG.warning("the server refused a command: %s: %s", refused.reason, refused.message)
        if seat is not None:
            seat.agent.on_refused(refused)

    def _events(self, seat: SeatSession, batch: pb.EventBatch) -> None:
        for event in batch.events:
            if event.sequence <= seat.last_sequence:
                continue  # Seen before a reconnection.
            seat.last_sequence = event.sequence
            self.progress += 1
            what = event.WhichOneof("kind")
            if what == "game_started":
                if seat.info is not None:
                    seat.info.game_started = event.game_started
            elif what == "game_ended":
                seat.standings = standings_of(event.game_ended)
                seat.reveal = event.game_ended.reveal if event.game_ended.HasField("reveal") else None
            elif what == "game_aborted":
                seat.abort_reason = abort_reason_of(event.game_aborted)
            elif what == "substituted" and seat.is_seat(event.substituted.seat):
                # Attaching ends a substitution of the past.
                seat.substituted = event.sequence >= seat.live_from
            elif what == "returned" and seat.is_seat(event.returned.seat):
                seat.substituted = False
            if seat.info is not None:
                seat.info.shift_log = seat.info.shift_log.add(event)
            if seat.hears_events:
                seat.agent.on_event(event)

    def _snapshot(self, seat: SeatSession, snapshot: pb.Snapshot) -> None:
        seat.last_sequence = max(seat.last_sequence, snapshot.next_sequence - 1)
        self.progress += 1
        if seat.info is not None:
            # The events before it are unknown.
            seat.info.shift_log = ShiftLog()
            if snapshot.HasField("game_started"):
                seat.info.game_started = snapshot.game_started
        seat.agent.on_snapshot(snapshot)

    def _decision(self, seat: SeatSession, request: pb.DecisionRequest, asks: list[Ask]) -> None:
        decision_id = request.decision_id
        if seat.unacknowledged is not None:
            if seat.unacknowledged.decision_id == decision_id:
                return  # Repeated after a reconnection; the answer has been sent again.
            seat.unacknowledged = None
        if seat.asked is not None and seat.asked.decision_id == decision_id:
            return  # Repeated while the agent is still deciding.
        self._ask(seat, request, None, asks)

    def _ask(self, seat: SeatSession, request: pb.DecisionRequest, attempts_left: int | None, asks: list[Ask]) -> None:
        if seat.info is None:
            return  # Decisions only reach attached seats.
        seat.asked = Decision(request, seat.info, attempts_left)
        seat.left_open = False
        asks.append(Ask(seat, seat.asked))

    def _result(self, seat: SeatSession, result: pb.AnswerResult, asks: list[Ask]) -> None:
        answered = seat.answered
        awaited = seat.unacknowledged is not None and seat.unacknowledged.decision_id == result.decision_id
        if awaited:
            seat.unacknowledged = None
            seat.answered = None
            if result.annotations_dropped:
                self._note_dropped(seat, result.decision_id, "the server refused them")
        if result.status == pb.ANSWER_STATUS_ACCEPTED:
            if awaited:
                seat.decisions += 1
                self.progress += 1
        elif result.status == pb.ANSWER_STATUS_INVALID:
            if awaited:
                seat.invalid += 1
                self.progress += 1
        else:
            seat.late += 1
        if seat.hears_results:
            seat.agent.on_result(result)
        if awaited and answered is not None and result.status == pb.ANSWER_STATUS_INVALID:
            # The decision stays open until the server's limit of attempts, which bounds this loop.
            limited = result.HasField("invalid_attempts_left")
            if not limited or result.invalid_attempts_left > 0:
                attempts_left = result.invalid_attempts_left if limited else None
                self._ask(seat, answered.request, attempts_left, asks)

    def _detached(self, seat: SeatSession, handle: int, detached: pb.Detached) -> None:
        if detached.reason == pb.DETACH_REASON_SERVER_STOPPING:
            # The end of the stream follows; the seat is attached again on the next one.
            return
        del self._by_handle[handle]
        seat.handle = None
        seat.substituted = False
        if detached.reason == pb.DETACH_REASON_GAME_OVER:
            self._finish(seat)
        elif detached.reason == pb.DETACH_REASON_SUPERSEDED:
            # Taking the seat back would make two connections compete for it.
            self._finish(seat, ChefsHatError("SUPERSEDED", "a newer connection has taken the seat"))
        else:
            self._finish(seat, ChefsHatError("DETACHED", "the seat has left the stream"))

    def _finish(self, seat: SeatSession, error: ChefsHatError | None = None) -> None:
        result = seat.finish(error)
        del self._seats[seat.request_id]
        self._results[seat.request_id] = (seat.ticket, result)
        if error is None:
            seat.agent.on_game_over(result)
        else:
            seat.agent.on_seat_lost(error)
