//! How what happened reaches the seats of a room. Each attached seat has a position in the room's log; what lies beyond it is sent when
//! it is due. A stream that is full is not waited for: the position stays, and the rest follows when there is space.

use std::borrow::Cow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use chefshat_engine::{Event, Seat, Viewer};
use chefshat_proto::v1::{self, seat_update::Update};

use chefshat_record::convert::seat_number;

use tonic::Status;

use crate::convert;
use crate::outbox::{HandStamp, OnSpace, Outbox, Pile as _};
use crate::wire::{Events, Updates, encode_decision, put_event};
use chefshat_room::ids::Token;
use chefshat_room::log::Happening;
use chefshat_room::{ConnectionId, Core};

/// Events that gather for a seat before they are sent without a decision.
pub const MAX_HELD_EVENTS: usize = 128;
/// Updates and events held for a stream that is full; answers to commands beyond it are dropped.
const MAX_HELD_UPDATES: usize = 1_024;
/// Bytes that a decision request takes at most as a rule.
const DECISION_CAPACITY: usize = 256;
/// Most events in one batch.
const EVENTS_PER_BATCH: usize = 256;

/// How a seat wants to be told.
#[derive(Debug, Clone, Copy)]
pub struct Wishes {
    /// Each event as it happens, not with the next decision.
    pub at_once: bool,
    /// No masks in decision requests.
    pub no_mask: bool,
    /// Start with a snapshot instead of the events so far.
    pub snapshot: bool,
    /// Position in the log from which events are wanted.
    pub from: usize,
}

/// A seat's place on a stream.
pub struct Attachment {
    connection: ConnectionId,
    outbox: Arc<Outbox<Updates>>,
    handle: u32,
    wishes: Wishes,
    position: usize,
    /// Decision that has been sent, or 0.
    sent: u64,
    /// Newest decision whose answer has been acknowledged, or 0.
    acknowledged: u64,
    stamp: Arc<HandStamp>,
    /// Set with the last word to the seat on this stream.
    ended: Arc<AtomicBool>,
    on_space: Arc<dyn OnSpace>,
    /// Updates that go out with the next flush.
    held: Updates,
    /// Whether a decision request is among them.
    decision_held: bool,
    stalled: bool,
    done: bool,
}

impl Attachment {
    /// Attaches a seat. Its stream is told by [`Attachment::greet`].
    pub fn new(
        connection: ConnectionId,
        outbox: Arc<Outbox<Updates>>,
        handle: u32,
        wishes: Wishes,
        stamp: Arc<HandStamp>,
        ended: Arc<AtomicBool>,
        on_space: Arc<dyn OnSpace>,
    ) -> Self {
        Self {
            connection,
            outbox,
            handle,
            wishes,
            position: wishes.from,
            sent: 0,
            acknowledged: 0,
            stamp,
            ended,
            on_space,
            held: Updates::default(),
            decision_held: false,
            stalled: false,
            done: false,
        }
    }

    /// Which connection it is.
    pub fn connection(&self) -> ConnectionId {
        self.connection
    }

    /// When a decision was handed to the transport; `None` while it was not.
    pub fn handed(&self, decision_id: u64) -> Option<Duration> {
        self.stamp
            .get()
            .filter(|_| self.sent == decision_id && !self.decision_held)
    }

    /// Says that the seat is attached, with a snapshot if one was wished for.
    /// `told_ticket`: the server attached a participant of a tournament by itself.
    pub fn greet(&mut self, core: &Core, seat: Seat, request_id: u32, told_ticket: Option<Token>) {
        let header = core.header();
        let next_sequence = u64::try_from(core.log().len()).unwrap_or(u64::MAX) + 1;
        self.hold(Update::Attached(v1::Attached {
            request_id,
            room_id: header.room_id.to_string(),
            game_id: header.game_id.to_string(),
            seat: seat_number(seat),
            next_sequence,
            tournament_id: match &told_ticket {
                Some(_) => convert::tournament_id(header),
                None => String::new(),
            },
            ticket: told_ticket.map_or_else(String::new, |ticket| ticket.word()),
        }));
        if self.wishes.snapshot {
            self.position = core.log().len();
            self.hold(Update::Snapshot(Box::new(snapshot(
                core,
                Viewer::Seat(seat),
            ))));
        }
        self.position = self.position.min(core.log().len());
    }

    /// Tells what became of an answer: with the next flush if it was taken and the seat is told with its decisions, else now.
    pub fn tell_result(&mut self, result: v1::AnswerResult) {
        if self.done || self.is_deaf() {
            return;
        }
        // A client that says the same again has not heard the first word: it is told at once.
        let may_wait = !self.wishes.at_once
            && result.status() == v1::AnswerStatus::Accepted
            && result.decision_id > self.acknowledged;
        self.acknowledged = self.acknowledged.max(result.decision_id);
        self.hold(Update::Result(result));
        if !may_wait {
            self.push();
        }
    }

    /// Tells that a command was refused.
    pub fn refuse(&mut self, refused: v1::Refused) {
        if self.done || self.is_deaf() {
            return;
        }
        self.hold(Update::Refused(refused));
        self.push();
    }

    /// Ends the attachment.
    pub fn detach(&mut self, reason: v1::DetachReason) {
        if !self.done {
            self.done = true;
            self.hold(Update::Detached(v1::Detached {
                reason: reason.into(),
            }));
            // The last word, with what was held before it, has its place even in an outbox that is full: there is one for each seat.
            self.outbox.push_last(&mut self.held);
            self.ended.store(true, Ordering::Relaxed);
        }
    }

    /// Ends the whole stream, because the server ends. Nothing that is held is told.
    pub fn end(&mut self, status: Status) {
        self.done = true;
        self.outbox.end(Err(status));
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Sends what is due. `urgent`: something happened that the seat is told of at once in any case.
    pub fn deliver(
        &mut self,
        core: &Core,
        public: &PublicLog,
        seat: Seat,
        now: Duration,
        urgent: bool,
    ) {
        if self.done {
            return;
        }
        let decision = core
            .awaited()
            .filter(|open| open.decision.seat == seat && open.id != self.sent);
        let backlog = core.log().len() - self.position;
        let over = core.state().is_over();
        let due = decision.is_some()
            || urgent
            || over
            || self.stalled
            || backlog >= MAX_HELD_EVENTS
            || (self.wishes.at_once && (backlog > 0 || !self.held.is_empty()));
        if !due {
            return;
        }
        if self.stalled && !self.push() {
            return;
        }
        while self.position < core.log().len() {
            let end = (self.position + EVENTS_PER_BATCH).min(core.log().len());
            let batch = public.batch(core, self.position, end, seat);
            self.held
                .add_events(self.handle, &batch, end - self.position);
            self.position = end;
            if end < core.log().len() && !self.push() {
                return;
            }
        }
        if let Some(open) = decision {
            let mut request = Vec::with_capacity(DECISION_CAPACITY);
            encode_decision(core, open, now, !self.wishes.no_mask, &mut request);
            self.sent = open.id;
            self.held.add_decision(self.handle, &request);
            self.stamp.clear();
            self.decision_held = true;
        }
        if !self.held.is_empty() && !self.push() {
            return;
        }
        if over {
            self.detach(v1::DetachReason::GameOver);
        }
    }

    fn hold(&mut self, update: Update) {
        self.held.add(self.handle, update);
    }

    /// Moves what is held to the outbox; if that is full, it stays held, and the room hears when there is space.
    fn push(&mut self) -> bool {
        let stamp = self.decision_held.then_some(&self.stamp);
        let pushed = self
            .outbox
            .push(&mut self.held, stamp, Some(&self.on_space));
        self.stalled = !pushed;
        self.decision_held &= !pushed;
        pushed
    }

    /// Whether the client does not read and has had its share of answers held for it.
    fn is_deaf(&self) -> bool {
        self.stalled && self.held.weight() >= MAX_HELD_UPDATES
    }
}

impl std::fmt::Debug for Attachment {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Attachment")
            .field("connection", &self.connection)
            .field("position", &self.position)
            .finish_non_exhaustive()
    }
}

/// The events of a room as those see them who are told nothing private, encoded once for all of them.
#[derive(Debug, Default)]
pub struct PublicLog {
    events: Events,
}

impl PublicLog {
    /// Takes in what has been added to the log.
    pub fn follow(&mut self, core: &Core) {
        for position in self.events.len()..core.log().len() {
            let event = convert::view(core, position, Viewer::Spectator);
            self.events
                .add(&event.expect("the position is within the log"));
        }
    }

    /// The events from one position to another, encoded as a seat may see them.
    fn batch(&self, core: &Core, from: usize, to: usize, seat: Seat) -> Cow<'_, [u8]> {
        let mut own = Vec::new();
        let mut shared = from;
        for (position, entry) in (from..to).zip(core.log().since(from)) {
            if entry.happening.tells_more_to(seat) {
                own.extend_from_slice(self.events.range(shared, position));
                if let Some(event) = convert::view(core, position, Viewer::Seat(seat)) {
                    put_event(&mut own, &event);
                }
                shared = position + 1;
            }
        }
        if shared == from {
            return Cow::Borrowed(self.events.range(from, to));
        }
        own.extend_from_slice(self.events.range(shared, to));
        Cow::Owned(own)
    }
}

/// Where the game stands, for a viewer.
pub fn snapshot(core: &Core, viewer: Viewer) -> v1::Snapshot {
    v1::Snapshot {
        game_started: core.game().map(|_| convert::game_started(core)),
        observation: core
            .observe(viewer)
            .map(|observation| chefshat_record::convert::observation_to_proto(&observation)),
        next_sequence: u64::try_from(core.log().len()).unwrap_or(u64::MAX) + 1,
    }
}

/// Whether an event is told to a seat at once in any case: its own finishing, its own substitution and return, the end of a Shift, the end
/// of the game.
pub fn is_urgent(happening: &Happening, seat: Seat) -> bool {
    match happening {
        Happening::SeatFinished { seat: own, .. }
        | Happening::Substituted(own)
        | Happening::Returned(own) => *own == seat,
        Happening::Game(game) => matches!(game.event, Event::ShiftEnded { .. }),
        Happening::GameEnded | Happening::GameAborted(_) => true,
        _ => false,
    }
}
