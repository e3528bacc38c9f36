"""The protocol of a `Play` stream without the stream: responses go in, requests come out.

Both clients, blocking and asyncio, drive one `PlaySession` for any number of seats, or for those that a participant of a
tournament is given, and through any number of connections, so that attaching, resuming, answering and ending exist once. There is
no IO, clock, thread or waiting here, and no knowledge of the rules.

A connection's life, as its driver sees it: `connected()`, send `take_requests()`; for each response `receive(response)`, decide
what it returns, `answer(...)` each, send `take_requests()`; stop when `done`. When it is lost, `lost()`, and begin again.
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
        entropy: every seat's own part of the game seed, 0..=32 bytes; None: 32 fresh random bytes for each seat, so that nobody
            alone chose the deals. Counts where it is given before the game starts. The result says what it was. A participant of a
            tournament has one for all its games, which counts in those that are dealt independently.
        delivery: how events reach the seats; unspecified means together with the next decision.

    Raises:
        ValueError: the entropy is too long.
    """

    entropy: bytes | None = None
    delivery: pb.EventDelivery.ValueType = pb.EVENT_DELIVERY_UNSPECIFIED

    def __post_init__(self) -> None:
        if self.entropy is not None and len(self.entropy) > MAX_ENTROPY_BYTES:
            raise ValueError(f"entropy is {len(self.entropy)} bytes long, and {MAX_ENTROPY_BYTES} are allowed")

    def draw_entropy(self) -> bytes:
        """The bytes for one seat or participant."""
        return os.urandom(MAX_ENTROPY_BYTES) if self.entropy is None else self.entropy


class PlaySession:
    """Plays any number of seats over one stream at a time. Not thread-safe: one thread at a time may call it."""

    def __init__(self, agents: Mapping[str, Agent], options: PlayOptions | None = None) -> None:
        """Begins a session.

        Args:
            agents: the agent for each ticket.
            options: how the seats attach.
        """
        self._options = options or PlayOptions()
        # Seats whose games go on, by their request ids, which count from 1, so that 0 (not set) is no seat's.
        self._places: dict[int, SeatSession] = {}
        # Of a seat that is done nothing is kept but its result, lest a long tournament keep all its agents.
        self._results: dict[int, tuple[str, SeatResult]] = {}
        self._added = 0
        self._participant: Participant | None = None
        self._by_handle: dict[int, SeatSession] = {}
        self._outbox: list[pb.SeatCommand] = []
        #: Grows whenever the game has moved on for a seat. A connection that brought none was of no use.
        self.progress = 0
        for ticket, agent in agents.items():
            self._add(ticket, agent, self._options.draw_entropy())

    @classmethod
    def of_participant(
        cls, ticket: str, make_agent: MakeAgent, options: PlayOptions | None = None, on_entered: OnEntered | None = None
    ) -> Self:
        """Begins a session of the seats that a participant of a tournament will be given, each with an agent of its own.

        Whose ticket it is only the server knows: if it is that of a seat, the session is of this seat alone.
        """
        session = cls({}, options)
        session._participant = Participant(ticket, make_agent, session._options.draw_entropy(), on_entered)
        return session

    def _add(self, ticket: str, agent: Agent, entropy: bytes) -> SeatSession:
        self._added += 1
        place = SeatSession(ticket, self._added, agent, entropy)
        self._places[place.request_id] = place
        return place

    @property
    def done(self) -> bool:
        """Whether every seat has its result and no other is to come."""
        return not self._places and (self._participant is None or self._participant.over)

    def results(self) -> dict[str, SeatResult]:
        """The result of each ticket whose seat is done, in the order of the tickets given."""
        return dict(self._in_order())

    def _in_order(self) -> list[tuple[str, SeatResult]]:
        return [self._results[request_id] for request_id in sorted(self._results)]

    def played(self) -> list[SeatResult]:
        """What has come of the games of a participant that are over, in the order in which it was seated.

        Raises:
            ChefsHatError: why it could not take part to the end of the tournament.
        """
        if self._participant is not None and self._participant.error is not None:
            raise self._participant.error
        return [result for _, result in self._in_order()]

    def connected(self) -> None:
        """A new connection stands: attaches every seat that is not done, from the event after the last one seen.

        Those of a participant come before itself, each with its own ticket: so it is told what it has not seen alone, and how a
        game ended meanwhile. The server leaves such seats as they are.
        """
        self._by_handle.clear()
        self._outbox.clear()
        delivery = self._options.delivery
        for place in self._places.values():
            place.handle = None
            place.substituted = False
            self._outbox.append(attach(place.ticket, place.request_id, place.last_sequence, place.entropy, delivery))
        participant = self._participant
        if participant is not None and not participant.over:
            self._outbox.append(participant.attach(delivery))

    def lost(self, unasked: Iterable[Ask] = ()) -> None:
        """The connection is gone. Seats that have seen their game end are done; the others wait for `connected`.

        Args:
            unasked: decisions no agent has been asked for and none will be: the server will put them again.
        """
        for place, decision in unasked:
            if place.asked is decision:
                place.asked = None
        self._by_handle.clear()
        self._outbox.clear()
        for place in list(self._places.values()):
            place.handle = None
            if place.game_is_over:
                self._finish(place)

    def give_up(self, error: ChefsHatError) -> None:
        """No connection will come any more: every seat that is not done gets this error as its result."""
        for place in list(self._places.values()):
            self._finish(place, error)
        if self._participant is not None:
            self._participant.end(error)

    def take_requests(self) -> list[pb.PlayRequest]:
        """What is to be sent now, in order; usually nothing or one request."""
        outbox = self._outbox
        if not outbox:
            return []
        self._outbox = []
        return pack(outbox)

    def receive(self, response: pb.PlayResponse) -> list[Ask]:
        """Takes in what the server said and calls the agents' hooks, in the order in which it was said.

        Returns:
            The decisions now to be made. Answer each with `answer`, in any order, at any time.
        """
        asks: list[Ask] = []
        # Seats that may have to say that they are here. What follows in the same response may say that this is known already.
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
            place = by_handle.get(update.handle)
            if place is None:
                self._told_no_seat(update)
                continue
            if what == "decision":
                self._decision(place, update.decision, asks)
            elif what == "events":
                self._events(place, update.events)
            elif what == "result":
                self._result(place, update.result, asks)
            elif what == "snapshot":
                self._snapshot(place, update.snapshot)
            elif what == "detached":
                self._detached(place, update.handle, update.detached)
            if place.substituted:
                away.append(place)
        for place in away:
            self._resume(place)
        return asks

    def answer(self, ask: Ask, action: SupportsIndex) -> None:
        """Answers a decision. If the seat is not attached just now, the answer is sent as soon as it is again."""
        place, decision = ask
        if place.asked is not decision:
            return  # The server has closed the decision in the meantime.
        answer = pb.Answer(decision_id=decision.decision_id, action=action.__index__(), annotations=self._annotations(ask))
        place.asked = None
        place.unacknowledged = answer
        place.answered = decision
        self._send_answer(place)

    def _annotations(self, ask: Ask) -> pb.Annotations | None:
        """The decision's annotations, unless the server would not record them."""
        place, decision = ask
        annotations = decision.annotations
        if annotations is not None and (why := why_not_recorded(annotations)):
            self._note_dropped(place, decision.decision_id, why)
            return None
        return annotations

    def _note_dropped(self, place: SeatSession, decision_id: int, why: str) -> None:
        """Counts annotations that are not recorded. An agent that does it once does it often, so only the first is logged."""
        place.annotations_dropped += 1
        if place.annotations_dropped == 1:
            LOG.warning(
                "the annotations of decision %d of seat %d are not recorded: %s; further ones are counted in the result",
                decision_id,
                place.info.seat if place.info else -1,
                why,
            )

    def _resume(self, place: SeatSession) -> None:
        """Says that the seat's agent plays itself again, if a substitute plays for it."""
        if place.substituted and place.handle is not None and not place.game_is_over:
            self._outbox.append(pb.SeatCommand(handle=place.handle, resume=pb.ResumeSeat()))
        place.substituted = False

    def _send_answer(self, place: SeatSession) -> None:
        if place.handle is not None and place.unacknowledged is not None:
            self._outbox.append(pb.SeatCommand(handle=place.handle, answer=place.unacknowledged))

    def _told_no_seat(self, update: pb.SeatUpdate) -> None:
        """What is told on a handle that is no seat's: a participant's own, or one that is of no interest any more."""
        participant = self._participant
        if participant is None:
            place = self._places.get(update.entered.request_id)
            if place is not None:
                self._outbox.append(pb.SeatCommand(handle=update.handle, detach=pb.Detach()))
                message = "it is the ticket of a participant in a tournament, not of a seat: `play_tournament` plays with it"
                self._finish(place, ChefsHatError("TICKET_OF_PARTICIPANT", message))
        else:
            participant.told(update)

    def _seated(self, participant: Participant, attached: pb.Attached) -> SeatSession:
        """The seat that the server has given a participant: one it has already, or a new one."""
        for place in self._places.values():
            if place.info is not None and place.info.game_id == attached.game_id:
                # The newest handle of a seat is its only one: what becomes of an older does not concern it.
                if place.handle is not None:
                    self._by_handle.pop(place.handle, None)
                return place
        return self._add_seat(participant, attached, attached.ticket)

    def _add_seat(self, participant: Participant, attached: pb.Attached, ticket: str) -> SeatSession:
        agent = participant.make_agent(SeatInfo(attached.room_id, attached.game_id, attached.seat))
        return self._add(ticket, agent, participant.entropy)

    def _attached(self, handle: int, attached: pb.Attached) -> None:
        place = self._places.get(attached.request_id)
        participant = self._participant
        if participant is not None and attached.request_id == 0:
            place = self._seated(participant, attached)
        elif participant is not None and attached.request_id == REQUEST_ID:
            # The ticket is a seat's: there is no participant.
            place = self._add_seat(participant, attached, participant.ticket)
            participant.end()
        if place is None:
            return
        place.handle = handle
        place.live_from = attached.next_sequence
        place.attachments += 1
        self._by_handle[handle] = place
        if place.info is None:
            place.info = SeatInfo(attached.room_id, attached.game_id, attached.seat)
        place.agent.on_attached(place.info)
        # Whether the last answer arrived before the connection broke is unknown. The same answer twice gets the same
        # acknowledgement, so it is simply given again.
        self._send_answer(place)

    def _refused(self, handle: int, refused: pb.Refused) -> None:
        if refused.request_id == REQUEST_ID and self._participant is not None:
            self._participant.end(from_refused(refused))
            return
        place = self._places.get(refused.request_id)
        if place is not None and place.handle is None:
            self._finish(place, None if place.game_is_over else from_refused(refused))
            return
        place = self._by_handle.get(handle)
        LOG.warning("the server refused a command: %s: %s", refused.reason, refused.message)
        if place is not None:
            place.agent.on_refused(refused)

    def _events(self, place: SeatSession, batch: pb.EventBatch) -> None:
        for event in batch.events:
            if event.sequence <= place.last_sequence:
                continue  # Seen before a reconnection.
            place.last_sequence = event.sequence
            self.progress += 1
            what = event.WhichOneof("kind")
            if what == "game_started":
                if place.info is not None:
                    place.info.game_started = event.game_started
            elif what == "game_ended":
                place.standings = standings_of(event.game_ended)
                place.reveal = event.game_ended.reveal if event.game_ended.HasField("reveal") else None
            elif what == "game_aborted":
                place.abort_reason = abort_reason_of(event.game_aborted)
            elif what == "substituted" and place.is_seat(event.substituted.seat):
                # A substitution of the past is over: attaching ended it.
                place.substituted = event.sequence >= place.live_from
            elif what == "returned" and place.is_seat(event.returned.seat):
                place.substituted = False
            if place.hears_events:
                place.agent.on_event(event)

    def _snapshot(self, place: SeatSession, snapshot: pb.Snapshot) -> None:
        place.last_sequence = max(place.last_sequence, snapshot.next_sequence - 1)
        self.progress += 1
        if place.info is not None and snapshot.HasField("game_started"):
            place.info.game_started = snapshot.game_started
        place.agent.on_snapshot(snapshot)

    def _decision(self, place: SeatSession, request: pb.DecisionRequest, asks: list[Ask]) -> None:
        decision_id = request.decision_id
        if place.unacknowledged is not None:
            if place.unacknowledged.decision_id == decision_id:
                return  # Told again after a reconnection; the answer is on its way again already.
            place.unacknowledged = None
        if place.asked is not None and place.asked.decision_id == decision_id:
            return  # Told again while the agent is still thinking about it.
        self._ask(place, request, None, asks)

    def _ask(self, place: SeatSession, request: pb.DecisionRequest, attempts_left: int | None, asks: list[Ask]) -> None:
        if place.info is None:
            return  # A seat without a handle is told nothing.
        place.asked = Decision(request, place.info, attempts_left)
        asks.append(Ask(place, place.asked))

    def _result(self, place: SeatSession, result: pb.AnswerResult, asks: list[Ask]) -> None:
        answered = place.answered
        awaited = place.unacknowledged is not None and place.unacknowledged.decision_id == result.decision_id
        if awaited:
            place.unacknowledged = None
            place.answered = None
            if result.annotations_dropped:
                self._note_dropped(place, result.decision_id, "the server has dropped them")
        if result.status == pb.ANSWER_STATUS_ACCEPTED:
            if awaited:
                place.decisions += 1
                self.progress += 1
        elif result.status == pb.ANSWER_STATUS_INVALID:
            if awaited:
                place.invalid += 1
                self.progress += 1
        else:
            place.late += 1
        if place.hears_results:
            place.agent.on_result(result)
        if awaited and answered is not None and result.status == pb.ANSWER_STATUS_INVALID:
            # The decision stays open until the server's limit of attempts, which is what ends a stubborn agent's loop.
            limited = result.HasField("invalid_attempts_left")
            if not limited or result.invalid_attempts_left > 0:
                attempts_left = result.invalid_attempts_left if limited else None
                self._ask(place, answered.request, attempts_left, asks)

    def _detached(self, place: SeatSession, handle: int, detached: pb.Detached) -> None:
        del self._by_handle[handle]
        place.handle = None
        place.substituted = False
        if detached.reason == pb.DETACH_REASON_GAME_OVER:
            self._finish(place)
        elif detached.reason == pb.DETACH_REASON_SUPERSEDED:
            # Taking the seat back would only make two connections fight over it.
            self._finish(place, ChefsHatError("SUPERSEDED", "a newer connection has taken the seat"))
        else:
            self._finish(place, ChefsHatError("DETACHED", "the seat has left the stream"))

    def _finish(self, place: SeatSession, error: ChefsHatError | None = None) -> None:
        result = place.finish(error)
        del self._places[place.request_id]
        self._results[place.request_id] = (place.ticket, result)
        if error is None:
            place.agent.on_game_over(result)
        else:
            place.agent.on_seat_lost(error)
