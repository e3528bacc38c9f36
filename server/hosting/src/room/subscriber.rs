//! Subscribers of a room: the connections of its seats, and its spectators. Each has a viewer, a
//! position in the log and an outbox. Events after the position are sent when they are due. A room
//! never waits for a full outbox: the position stays, and delivery resumes when there is space. Of
//! a long game the log has only the last events: a seat that is further behind is sent a snapshot.
//! A spectator that falls too far behind is disconnected.

use std::borrow::Cow;
use std::cell::OnceCell;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use chefshat_engine::{Event, Seat, Viewer};
use chefshat_proto::v1::{self, seat_update::Update};
use chefshat_record::convert::seat_number;
use chefshat_room::ids::RoomToken;
use chefshat_room::log::RoomEvent;
use chefshat_room::{Awaited, ConnectionId, Core, MAX_EVENTS_KEPT};

use chefshat_admission::limits::{Payer, Permit};
use chefshat_base::metrics::Counted;
use chefshat_wire::convert;
use chefshat_wire::encoded::{Events, Updates, encode_decision, put_event};
use chefshat_wire::outbox::{HandStamp, OnSpace, Outbox, StreamEnd};

/// Events that wait for a seat's next decision before they are sent without one.
pub const MAX_PENDING_EVENTS: usize = 128;
/// Most updates and events pending for a full stream. Further results of commands are dropped.
const MAX_PENDING_UPDATES: usize = 1_024;
/// Most events that a spectator's stream may fall behind before it is disconnected.
pub const MAX_SPECTATOR_LAG: usize = MAX_EVENTS_KEPT;
/// Encoded events that the log no longer has are dropped as soon as they are this many.
const MAX_ENCODED_GONE: usize = 1_024;
/// Most spectators of one room.
pub const MAX_SPECTATORS: usize = 256;
/// Typical size of a decision request, bytes.
const DECISION_CAPACITY: usize = 256;
/// Most events in one batch.
const EVENTS_PER_BATCH: usize = 256;

/// How events and decisions are delivered to a seat.
#[derive(Debug, Clone, Copy)]
pub struct DeliveryOptions {
    /// Send each event at once instead of with the next decision.
    pub at_once: bool,
    /// Leave masks out of decision requests.
    pub no_mask: bool,
    /// Start with a snapshot instead of the past events.
    pub snapshot: bool,
    /// Position in the log of the first event to send.
    pub from: usize,
}

/// A subscriber of a room.
pub struct Subscriber {
    outbox: Arc<Outbox>,
    on_space: Arc<dyn OnSpace>,
    position: usize,
    /// Updates for the next flush.
    pending: Updates,
    /// [`Awaited::key`] of what was last sent.
    awaited: Option<(Seat, u64, bool, bool)>,
    stalled: bool,
    ended: bool,
    role: Role,
}

enum Role {
    Seat(SeatConnection),
    Spectator {
        _counted: (Counted, Permit),
        /// Number of events it could see when its stream last had space.
        kept_up_at: usize,
    },
}

/// A seat on a stream.
pub struct SeatConnection {
    /// The seat.
    pub seat: Seat,
    /// Number of the connection.
    pub id: ConnectionId,
    /// Who is charged for what it stores.
    pub charged: Payer,
    /// Number of the seat on the stream.
    pub handle: u32,
    /// How events and decisions are delivered to it.
    pub options: DeliveryOptions,
    /// Records when a decision request is handed over.
    pub stamp: Arc<HandStamp>,
    /// Whether the client is connected to another node, which reports when that happens.
    pub by_gateway: bool,
    /// Set with the last update to the seat on this stream.
    pub detached: Arc<AtomicBool>,
    /// The last decision sent, or 0.
    sent: u64,
    /// The newest decision whose answer was acknowledged, or 0.
    acknowledged: u64,
    /// Whether a decision request is among the pending updates.
    decision_pending: bool,
    /// What was last sent of whether a substitute plays for it.
    substituted: bool,
    _counted: Counted,
}

impl SeatConnection {
    /// Creates a connection that has received nothing yet.
    pub fn new(
        (seat, id, charged): (Seat, ConnectionId, Payer),
        handle: u32,
        options: DeliveryOptions,
        stamp: Arc<HandStamp>,
        by_gateway: bool,
        detached: Arc<AtomicBool>,
        counted: Counted,
    ) -> Self {
        Self {
            seat,
            id,
            charged,
            handle,
            options,
            stamp,
            by_gateway,
            detached,
            sent: 0,
            acknowledged: 0,
            decision_pending: false,
            substituted: false,
            _counted: counted,
        }
    }
}

impl Subscriber {
    /// The subscriber for a seat's connection. [`Subscriber::confirm_attached`] notifies the seat.
    pub fn seat(
        connection: SeatConnection,
        outbox: Arc<Outbox>,
        on_space: Arc<dyn OnSpace>,
    ) -> Self {
        Self::new(
            connection.options.from,
            outbox,
            on_space,
            Role::Seat(connection),
        )
    }

    /// A spectator that starts at an event (position from 0) or with a snapshot, which also stands
    /// for events that are gone. The first message is in its outbox.
    pub fn spectator(
        core: &Core,
        outbox: Arc<Outbox>,
        on_space: Arc<dyn OnSpace>,
        from: usize,
        snapshot: bool,
        counted: (Counted, Permit),
    ) -> Self {
        let (first, visible) = (core.log().first(), core.visible_to_spectators());
        // A snapshot shows the present, and has no result.
        let is_delayed = core.header().policy.spectator_delay_decisions > 0;
        let may_skip = !is_delayed && !core.state().is_over();
        let with_snapshot = snapshot || (from < first && may_skip);
        let position = if with_snapshot {
            visible
        } else {
            from.clamp(first, visible)
        };
        let role = Role::Spectator {
            _counted: counted,
            kept_up_at: visible,
        };
        let mut spectator = Self::new(position, outbox, on_space, role);
        spectator.pending.add_room(&convert::describe(core));
        if with_snapshot {
            let snapshot = convert::snapshot(core, Viewer::Spectator);
            spectator.pending.add_snapshot(&snapshot);
        }
        spectator.flush();
        spectator
    }

    fn new(position: usize, outbox: Arc<Outbox>, on_space: Arc<dyn OnSpace>, role: Role) -> Self {
        Self {
            outbox,
            on_space,
            position,
            pending: Updates::default(),
            awaited: None,
            stalled: false,
            ended: false,
            role,
        }
    }

    /// The connection of a seat; `None` for a spectator.
    pub fn connection(&self) -> Option<&SeatConnection> {
        match &self.role {
            Role::Seat(connection) => Some(connection),
            Role::Spectator { .. } => None,
        }
    }

    /// Whether updates may be due even without a decision, an urgent event or a full backlog.
    pub fn must_always_be_visited(&self) -> bool {
        let must =
            |connection: &SeatConnection| connection.options.at_once || connection.substituted;
        self.stalled || self.connection().is_none_or(must)
    }

    /// Position in the log of the first event that has not been sent.
    pub fn position(&self) -> usize {
        self.position
    }

    /// Whether nothing more is sent.
    pub fn has_ended(&self) -> bool {
        self.ended
    }

    /// Length of the log at which the backlog is due.
    pub fn backlog_due_at(&self) -> usize {
        self.position + MAX_PENDING_EVENTS
    }

    /// When a decision request was handed to the transport; `None` if it was not yet.
    pub fn handed(&self, decision_id: u64) -> Option<Duration> {
        let connection = self.connection()?;
        if connection.by_gateway {
            return connection.stamp.reported(decision_id);
        }
        let left = connection.sent == decision_id && !connection.decision_pending;
        connection.stamp.get().filter(|_| left)
    }

    /// Tells a seat that it is attached, with a snapshot if requested. `ticket`: set if the server
    /// attached a participant of a tournament.
    pub fn confirm_attached(&mut self, core: &Core, request_id: u32, ticket: Option<RoomToken>) {
        let Role::Seat(connection) = &self.role else {
            return;
        };
        let (seat, handle, options) = (connection.seat, connection.handle, connection.options);
        let header = core.header();
        let attached = v1::Attached {
            request_id,
            room_id: header.room_id.to_string(),
            game_id: header.game_id.to_string(),
            seat: seat_number(seat),
            next_sequence: convert::next_sequence(core),
            tournament_id: match &ticket {
                Some(_) => convert::tournament_id(header),
                None => String::new(),
            },
            ticket: ticket.map_or_else(String::new, |ticket| ticket.to_text()),
        };
        self.pending.add(handle, Update::Attached(attached));
        if options.snapshot {
            self.skip_events(core);
        }
        self.position = self.position.min(core.log().len());
    }

    /// Sends a seat a snapshot in place of the events that it has not received.
    fn skip_events(&mut self, core: &Core) {
        let Role::Seat(connection) = &mut self.role else {
            return;
        };
        self.position = core.log().len();
        let snapshot = convert::snapshot(core, Viewer::Seat(connection.seat));
        self.pending
            .add(connection.handle, Update::Snapshot(Box::new(snapshot)));
        let is_substituted = core.standing(connection.seat).substituted;
        if is_substituted && !core.state().is_over() {
            let substitution = Update::Substitution(v1::Substitution { active: true });
            self.pending.add(connection.handle, substitution);
            connection.substituted = core.is_substituted_unseen(connection.seat);
        }
    }

    /// Sends the result of an answer: with the next flush if it was accepted and the seat receives
    /// events with its decisions, else at once.
    pub fn send_result(&mut self, result: v1::AnswerResult) {
        if self.ended || self.is_saturated() {
            return;
        }
        let Role::Seat(connection) = &mut self.role else {
            return;
        };
        // A client that repeats an answer has missed the first result.
        let may_wait = !connection.options.at_once
            && result.status() == v1::AnswerStatus::Accepted
            && result.decision_id > connection.acknowledged;
        connection.acknowledged = connection.acknowledged.max(result.decision_id);
        let handle = connection.handle;
        self.pending.add_result(handle, &result);
        if !may_wait {
            self.flush();
        }
    }

    /// Tells a seat that a command was refused.
    pub fn refuse(&mut self, refused: v1::Refused) {
        if self.ended || self.is_saturated() {
            return;
        }
        if let Role::Seat(connection) = &self.role {
            let handle = connection.handle;
            self.pending.add(handle, Update::Refused(refused));
            self.flush();
        }
    }

    /// Detaches a seat from its stream; pending updates are sent first.
    pub fn detach(&mut self, reason: v1::DetachReason) {
        let Role::Seat(connection) = &self.role else {
            return;
        };
        if !self.ended {
            self.ended = true;
            let reason = reason.into();
            let detached = Update::Detached(v1::Detached { reason });
            self.pending.add(connection.handle, detached);
            // At most one such update for each seat: even a full outbox accepts it.
            self.outbox.push_last(&mut self.pending);
            connection.detached.store(true, Ordering::Relaxed);
        }
    }

    /// Ends the stream because the server stops; sends a seat the reason first.
    pub fn stop(&mut self) {
        if !self.ended {
            self.detach(v1::DetachReason::ServerStopping);
            self.ended = true;
            self.outbox.end(StreamEnd::ShuttingDown);
        }
    }

    /// Ends the stream. Pending updates are dropped.
    pub fn end(&mut self, end: StreamEnd) {
        if !self.ended {
            self.ended = true;
            self.outbox.end(end);
            if let Role::Seat(connection) = &self.role {
                connection.detached.store(true, Ordering::Relaxed);
            }
        }
    }

    /// Sends what is due. `urgent`: send now even if the seat receives events with its decisions.
    /// Returns `false` when nothing more can follow.
    pub fn deliver(&mut self, news: &Publication<'_>, urgent: bool) -> bool {
        if self.ended {
            return false;
        }
        let (core, public, now) = (news.core, news.public, news.now);
        let visible = match &self.role {
            Role::Seat(_) => core.log().len(),
            Role::Spectator { .. } => core.visible_to_spectators(),
        };
        let over = core.state().is_over();
        let decision = self.connection().and_then(|connection| {
            core.awaited()
                .filter(|open| open.decision.seat == connection.seat && open.id != connection.sent)
        });
        let awaited = self.awaited_of(news);
        let key = awaited.map(|it| it.key());
        let awaits_another = !over && key != self.awaited;
        let backlog = visible - self.position;
        let at_once = (self.connection()).is_none_or(|connection| connection.options.at_once);
        let due = decision.is_some()
            || urgent
            || over
            || self.stalled
            || awaits_another
            || self.new_substitution(core).is_some()
            || backlog >= MAX_PENDING_EVENTS
            || (at_once && (backlog > 0 || !self.pending.is_empty()));
        if !due {
            return !self.is_abandoned();
        }
        if self.stalled && !self.flush() {
            return self.keeps_up(visible);
        }
        if self.position < core.log().first() {
            // Only a seat can be that far behind: spectators are disconnected before. No snapshot has
            // the result of a game that is over, but its last events have.
            match over {
                true => self.position = core.log().first(),
                false => self.skip_events(core),
            }
        }
        let substitution = self.new_substitution(core).filter(|_| !over);
        while self.position < visible {
            let end = (self.position + EVENTS_PER_BATCH).min(visible);
            self.add_events(core, public, end);
            if end < visible && !self.flush() {
                return self.keeps_up(visible);
            }
        }
        if awaits_another {
            self.awaited = key;
            let awaited = convert::awaited_to_proto(awaited, now);
            match &self.role {
                Role::Seat(connection) => {
                    (self.pending).add(connection.handle, Update::Awaited(awaited));
                }
                Role::Spectator { .. } => self.pending.add_spectator_awaited(&awaited),
            }
        }
        if let (Some(active), Role::Seat(connection)) = (substitution, &mut self.role) {
            connection.substituted = active;
            let substitution = Update::Substitution(v1::Substitution { active });
            self.pending.add(connection.handle, substitution);
        }
        if let (Some(open), Role::Seat(connection)) = (decision, &mut self.role) {
            let mut request = Vec::with_capacity(DECISION_CAPACITY);
            encode_decision(core, open, now, !connection.options.no_mask, &mut request);
            connection.sent = open.id;
            if !connection.by_gateway {
                connection.stamp.clear();
            }
            connection.decision_pending = true;
            self.pending.add_decision(connection.handle, &request);
        }
        if !self.pending.is_empty() && !self.flush() {
            return self.keeps_up(visible);
        }
        if let Role::Spectator { kept_up_at, .. } = &mut self.role {
            *kept_up_at = visible;
        }
        if over {
            match self.role {
                Role::Seat(_) => self.detach(v1::DetachReason::GameOver),
                Role::Spectator { .. } => self.end(StreamEnd::Complete),
            }
        }
        !self.ended && !self.is_abandoned()
    }

    /// Whether a substitute plays for its seat, if that has changed and no event says so.
    fn new_substitution(&self, core: &Core) -> Option<bool> {
        let connection = self.connection()?;
        let active = core.is_substituted_unseen(connection.seat);
        (active != connection.substituted).then_some(active)
    }

    /// Whom the game waits for, if the subscriber is sent this: not its own seat.
    fn awaited_of(&self, news: &Publication<'_>) -> Option<Awaited> {
        let policy = &news.core.header().policy;
        let own = match &self.role {
            Role::Seat(connection) if connection.options.at_once => Some(connection.seat),
            Role::Spectator { .. } if policy.spectator_delay_decisions == 0 => None,
            Role::Seat(_) | Role::Spectator { .. } => return None,
        };
        news.awaited().filter(|awaited| Some(awaited.seat) != own)
    }

    /// Adds the events up to a position to the pending updates.
    fn add_events(&mut self, core: &Core, public: &PublicEvents, end: usize) {
        let (from, count) = (self.position, end - self.position);
        match &self.role {
            Role::Seat(connection) => {
                let viewer = Viewer::Seat(connection.seat);
                let events = public.range(core, from, end, viewer, true);
                self.pending.add_events(connection.handle, &events, count);
            }
            Role::Spectator { .. } => {
                let events = public.range(core, from, end, spectator_view(core), false);
                self.pending.add_spectator_events(&events, count);
            }
        }
        self.position = end;
    }

    /// Moves pending updates to the outbox. If it is full they stay pending, and the room is
    /// notified when there is space.
    fn flush(&mut self) -> bool {
        let stamp = match &self.role {
            Role::Seat(connection) if connection.decision_pending && !connection.by_gateway => {
                Some(Arc::clone(&connection.stamp) as _)
            }
            Role::Seat(_) | Role::Spectator { .. } => None,
        };
        let pushed = self
            .outbox
            .push(&mut self.pending, stamp, Some(&self.on_space));
        self.stalled = !pushed;
        if let Role::Seat(connection) = &mut self.role {
            connection.decision_pending &= !pushed;
        }
        pushed
    }

    /// Disconnects a spectator that is too far behind. Seats have no such limit.
    fn keeps_up(&mut self, visible: usize) -> bool {
        let Role::Spectator { kept_up_at, .. } = self.role else {
            return true;
        };
        if visible.saturating_sub(kept_up_at) <= MAX_SPECTATOR_LAG {
            return true;
        }
        self.ended = true;
        self.outbox.cut(StreamEnd::SpectatorTooSlow);
        false
    }

    /// Whether the client does not read and the pending updates have reached their limit.
    fn is_saturated(&self) -> bool {
        self.stalled && self.pending.weight() >= MAX_PENDING_UPDATES
    }

    /// Whether it is a spectator who has left.
    pub fn is_abandoned(&self) -> bool {
        matches!(self.role, Role::Spectator { .. }) && self.outbox.is_abandoned()
    }
}

impl std::fmt::Debug for Subscriber {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Subscriber")
            .field("position", &self.position)
            .finish_non_exhaustive()
    }
}

/// What a room publishes to its subscribers at one time.
pub struct Publication<'a> {
    core: &'a Core,
    public: &'a PublicEvents,
    now: Duration,
    awaited: OnceCell<Option<Awaited>>,
}

impl<'a> Publication<'a> {
    /// The state of a room, with its public events encoded.
    pub fn new(core: &'a Core, public: &'a PublicEvents, now: Duration) -> Self {
        Self {
            core,
            public,
            now,
            awaited: OnceCell::new(),
        }
    }

    /// Whom the game waits for, found once for all subscribers who are sent this.
    fn awaited(&self) -> Option<Awaited> {
        *(self.awaited.get_or_init(|| self.core.awaited_in_public()))
    }
}

/// The public events of a room, encoded once for all subscribers.
#[derive(Debug, Default)]
pub struct PublicEvents {
    events: Events,
}

impl PublicEvents {
    /// Drops what is encoded: nobody reads it. What follows starts at this position.
    pub fn restart_at(&mut self, position: usize) {
        self.events = Events::starting_at(position);
    }

    /// Drops encoded events before a position, if they are many or nobody reads the others.
    pub fn drop_before(&mut self, position: usize) {
        if position >= self.events.end() {
            self.restart_at(position);
        } else if position >= self.events.first() + MAX_ENCODED_GONE {
            self.events.drop_before(position);
        }
    }

    /// The positions of the encoded events.
    pub fn encoded(&self) -> Range<usize> {
        self.events.first()..self.events.end()
    }

    /// Encodes the events added to the log.
    pub fn follow(&mut self, core: &Core) {
        for position in self.events.end()..core.log().len() {
            let event = convert::event_to_proto(core, position, Viewer::Spectator);
            self.events
                .add(&event.expect("the position is within the log"));
        }
    }

    /// The events between two positions, encoded for a viewer. The bytes of public events are
    /// shared; only events that show more to the viewer are encoded separately.
    fn range(
        &self,
        core: &Core,
        from: usize,
        to: usize,
        viewer: Viewer,
        with_rewards: bool,
    ) -> Cow<'_, [u8]> {
        let mut own = Vec::new();
        let mut shared = from;
        for (position, entry) in (from..to).zip(core.log().since(from)) {
            if entry.event.shows_more_to(viewer)
                && let Some(mut event) = convert::event_to_proto(core, position, viewer)
            {
                if !with_rewards {
                    event.rewards.clear();
                }
                own.extend_from_slice(self.events.range(shared, position));
                put_event(&mut own, &event);
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

/// The current view of spectators: all hands after the game, or if the room allows it. Where it
/// admits none, its owner watches, who may also play. In a series of games with the same deals
/// hands stay hidden, because others still play them.
fn spectator_view(core: &Core) -> Viewer {
    let header = core.header();
    let policy = &header.policy;
    let shows_hands = (policy.spectators && policy.spectators_see_hands) || core.state().is_over();
    if shows_hands && header.series().is_none() {
        Viewer::Everything
    } else {
        Viewer::Spectator
    }
}

/// Whether an event is always sent to a seat at once: its own finishing, substitution and return,
/// the end of a Shift and of the game, corrections and pauses at a physical table.
pub fn is_urgent(event: &RoomEvent, seat: Seat) -> bool {
    match event {
        RoomEvent::Substituted(own) | RoomEvent::Retired(own) | RoomEvent::Returned(own) => {
            *own == seat
        }
        RoomEvent::GameAborted(_) | RoomEvent::Correction(_) | RoomEvent::Paused(_) => true,
        RoomEvent::Game(game) => match &game.event {
            Event::SeatFinished { seat: own, .. } => *own == seat,
            Event::ShiftEnded(_) | Event::GameEnded { .. } => true,
            _ => false,
        },
        _ => false,
    }
}
