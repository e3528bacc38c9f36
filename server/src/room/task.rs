//! The task of a room: receives from a bounded mailbox, sets one timer, and for every batch of
//! inputs lets the core apply them, commits the changes and only then publishes them. While the
//! task waits, the reader of a stream may handle an answer in the same way. The core makes all
//! decisions.

use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::Poll;
use std::time::Duration;

use chefshat_agents::{Budget, MonteCarlo};
use chefshat_engine::Seat;
use chefshat_proto::v1;
use chefshat_room::ids::{Id, Token};
use chefshat_room::journal::{AbortReason, ParticipantKind, SeatedParticipant};
use chefshat_room::{
    Answer, ConnectionId, Core, JoinError, LeaveError, ReportOutcome, Searched, State,
};
use futures::future::BoxFuture;
use futures::stream::FuturesUnordered;
use futures::{FutureExt as _, StreamExt as _};
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, Sleep};
use tokio_util::sync::CancellationToken;
use tokio_util::task::{AbortOnDropHandle, TaskTracker};
use tracing::{Instrument as _, debug, error, info, warn};

use super::clients::Clients;
use super::hints::{HintReply, HintRequest, LatestHint};
use super::markers::MarkerLog;
use super::message::{
    Acted, AttachRequest, AttachedSeat, Following, JoinRequest, Joined, MarkOutcome, MarkRequest,
    Message, NotAttached, NotifySpace, ReportRefusal, Ruled, SeatAction, SpectateError,
    SpectateRequest, Watching,
};
use super::observed::Observed;
use super::resting::Resting;
use super::subscriber::{
    MAX_PENDING_EVENTS, MAX_SPECTATORS, PublicEvents, Publication, SeatConnection, Subscriber,
    is_urgent,
};
use super::table_view::TableView;
use crate::clock::RoomClock;
use crate::cluster::{News, NodeLease};
use crate::config::{HINT_TIME, ROOM_MAILBOX};
use crate::convert::{self, Deck};
use crate::limits::{Background, Held, Hint, Key, Places, Searches, Shares, Turn};
use crate::metrics::Metrics;
use crate::outbox::{HandStamp, OnSpace, StreamEnd};
use crate::record_writer::RecordWriter;
use crate::signing::Signer;
use crate::store::{Journal, Signed, Store, StoreError};
use crate::webhooks::Webhooks;

/// Most inputs that are applied before one commit.
const INPUTS_PER_COMMIT: usize = 64;
/// How long a node tries to read a journal to sign the record, as long as its store tries to commit
/// the end of the game, and the pause before the next attempt.
const SIGNING_LIMIT: Duration = Duration::from_mins(5);
const SIGNING_PAUSE: Duration = Duration::from_secs(1);
/// Most events that a room of built-in agents keeps for spectators who come late. Its record has
/// all of them.
const MAX_EVENTS_UNREAD: usize = 16_384;
/// The same, once its game is over.
const MAX_EVENTS_UNREAD_AFTERWARDS: usize = 1_024;

/// The parts of the server that a room uses.
#[derive(Clone)]
pub struct TaskContext {
    /// Stores games.
    pub store: Arc<dyn Store>,
    /// Writes records to files.
    pub record_writer: RecordWriter,
    /// Signs records.
    pub signer: Signer,
    /// How long an ended room stays listed.
    pub retention: Duration,
    /// Source of connection ids.
    pub connections: Arc<AtomicU64>,
    /// Tasks that a shutdown waits for.
    pub tracker: TaskTracker,
    /// Counts what the room does.
    pub metrics: Arc<Metrics>,
    /// Notified when the game of a room has ended, and when the room is gone.
    pub watcher: Arc<dyn RoomWatcher>,
    /// Plays the games of built-in agents.
    pub background: Arc<Background>,
    /// Searches for built-in agents.
    pub searches: Arc<Searches>,
    /// What lets a node of a cluster publish; `None` in a single server, which always may.
    pub lease: Option<Arc<NodeLease>>,
    /// Announces rooms and ends of games.
    pub webhooks: Webhooks,
    /// Who created the room.
    pub owner: Key,
    /// How much of each limit one caller may use.
    pub shares: Shares,
}

/// Maintains the list of rooms.
pub trait RoomWatcher: Send + Sync {
    /// The game of a room has ended; the room is still listed.
    fn game_over(&self, room: Id);
    /// The room is gone.
    fn gone(&self, room: Id);
}

/// Spawns the task of a room and returns the sender of its mailbox and its resting place.
/// `over_since`: the game is already over, and its end has been processed.
pub(super) fn spawn(
    core: Core,
    clock: RoomClock,
    over_since: Option<Duration>,
    journal: Box<dyn Journal>,
    fence: CancellationToken,
    context: TaskContext,
) -> (mpsc::Sender<Message>, Arc<Resting<Room>>) {
    let (mailbox, inbox) = mpsc::channel(ROOM_MAILBOX);
    let resting = Arc::new(Resting::default());
    let seats = core.header().fills.len();
    let physical = core.header().is_physical();
    let observed = Observed::new(&core, &context.metrics);
    let span = observed.span().clone();
    let room = Box::new(Room {
        core,
        journal,
        now: clock.now(),
        clock,
        connections: (0..seats).map(|_| None).collect(),
        spectators: Vec::new(),
        spectator_places: Places::new(MAX_SPECTATORS, context.shares),
        on_space: Arc::new(NotifySpace(mailbox.downgrade())),
        releases: Vec::new(),
        hints: FuturesUnordered::new(),
        latest_hint: LatestHint::default(),
        public: PublicEvents::default(),
        delivered: 0,
        always_visit: vec![false; seats],
        clients: Clients::default(),
        backlog_due_at: 0,
        over_since,
        suspended: false,
        fence,
        place: None,
        timer_at: None,
        answers_in_place: false,
        table: physical.then(|| Box::new(TableView::new())),
        markers: None,
        observed,
        context: context.clone(),
    });
    let running = run(room, Arc::clone(&resting), inbox).instrument(span);
    context.tracker.spawn(running);
    (mailbox, resting)
}

/// An answer or update that is sent once the changes are committed.
enum Release {
    Join(
        oneshot::Sender<Result<Joined, JoinError>>,
        Result<Joined, JoinError>,
    ),
    Attach(
        Box<AttachRequest>,
        Seat,
        ConnectionId,
        oneshot::Sender<Result<AttachedSeat, NotAttached>>,
    ),
    Result(Seat, ConnectionId, v1::AnswerResult),
    Refuse(Seat, ConnectionId, v1::Refused),
    Acted(oneshot::Sender<Option<Acted>>, Acted),
    Closed(oneshot::Sender<Option<v1::Room>>),
    Left(
        oneshot::Sender<Option<Result<v1::Room, LeaveError>>>,
        Result<(), LeaveError>,
    ),
    Describe(oneshot::Sender<v1::Room>),
    Spectate(
        Box<SpectateRequest>,
        oneshot::Sender<Result<(), SpectateError>>,
    ),
    Reported(oneshot::Sender<Option<Ruled>>, ReportOutcome),
    WatchTable(oneshot::Sender<Option<Watching>>),
    Hint(HintReply, Hint),
    /// The marker with this number.
    Marked(oneshot::Sender<Option<MarkOutcome>>, usize),
    FollowMarkers(usize, oneshot::Sender<Option<Following>>),
}

/// The state of a room: its core, journal and subscribers.
pub(super) struct Room {
    core: Core,
    journal: Box<dyn Journal>,
    clock: RoomClock,
    /// The time of the current inputs.
    now: Duration,
    connections: Vec<Option<Subscriber>>,
    spectators: Vec<Subscriber>,
    spectator_places: Arc<Places>,
    on_space: Arc<dyn OnSpace>,
    releases: Vec<Release>,
    /// The hints that are being computed.
    hints: FuturesUnordered<BoxFuture<'static, HintEnded>>,
    latest_hint: LatestHint,
    public: PublicEvents,
    /// Length of the log at the last delivery.
    delivered: usize,
    /// By seat, whether every delivery must visit its connection.
    always_visit: Vec<bool>,
    clients: Clients,
    /// Length of the log at which the backlog of a connection may first be due.
    backlog_due_at: usize,
    over_since: Option<Duration>,
    /// Whether the room ends while its game is unfinished; the game resumes when the server is
    /// restarted.
    suspended: bool,
    /// Cancelled when another node of the cluster may have the room.
    fence: CancellationToken,
    /// The place among the games that built-in agents play.
    place: Option<Held>,
    /// When the timer of the task fires.
    timer_at: Option<Duration>,
    answers_in_place: bool,
    /// The physical table, if the room has one.
    table: Option<Box<TableView>>,
    /// The markers, if anybody has followed them.
    markers: Option<Box<MarkerLog>>,
    observed: Observed,
    context: TaskContext,
}

/// The seat and number of a decision, and how the search for it ended.
type Found = (Seat, u64, Searched);

/// A hint and the request for it; `None` if computing it panicked.
type HintEnded = (HintRequest, Option<Hint>);

/// What the task of a room does next.
enum Next {
    /// Reads this number of messages; 0: nobody has a handle any more.
    Messages(usize),
    /// Plays a slice of a game of built-in agents.
    Turn(Turn),
    /// Takes the result of a search.
    Searched(Found),
    /// Gives a hint.
    Hint(HintEnded),
    /// Does what is due.
    Timer,
}

/// Runs a room until it is gone.
async fn run(mut room: Box<Room>, resting: Arc<Resting<Room>>, mut inbox: mpsc::Receiver<Message>) {
    let id = room.core.header().room_id;
    room.core.begin_if_all_built_in(room.now);
    let mut messages = Vec::with_capacity(INPUTS_PER_COMMIT);
    let timer = tokio::time::sleep_until(room.clock.instant(room.now));
    tokio::pin!(timer);
    // The next slice of a game that nobody plays.
    let mut turn: Option<BoxFuture<'static, Turn>> = None;
    // The search for the open decision.
    let mut search: Option<BoxFuture<'static, Found>> = None;
    while room.commit_and_publish().await {
        if room.suspended && room.over_since.is_none() {
            room.subscribers().for_each(Subscriber::stop);
            break;
        }
        if room.is_fenced() {
            break;
        }
        if !room.plays_in_background() {
            (turn, room.place) = (None, None);
        } else if turn.is_none() {
            let background = Arc::clone(&room.context.background);
            turn = Some(
                background
                    .turn(room.context.owner, room.place.take())
                    .boxed(),
            );
        }
        if let Some(started) = room.start_search() {
            search = Some(started);
        } else if !room.core.awaits_search() {
            search = None;
        }
        room.set_timer(timer.as_mut(), turn.is_some());
        room.answers_in_place = room.core.awaits_participants_only();
        let armed = room.timer_at.is_some();
        *resting.lock() = Some(room);
        let (room_or_none, next) = poll_fn(|context| {
            // Under the lock, so that no answer in place overtakes a message.
            let mut resting = resting.lock();
            // Before the mailbox, which may never be empty: a decision has few of these.
            if let Some(Poll::Ready(found)) = search.as_mut().map(|it| it.poll_unpin(context)) {
                return Poll::Ready((resting.take(), Next::Searched(found)));
            }
            let hints = resting.as_mut().map(|room| &mut room.hints);
            if let Some(hints) = hints.filter(|hints| !hints.is_empty())
                && let Poll::Ready(Some(hint)) = hints.poll_next_unpin(context)
            {
                return Poll::Ready((resting.take(), Next::Hint(hint)));
            }
            let received = inbox.poll_recv_many(context, &mut messages, INPUTS_PER_COMMIT);
            if let Poll::Ready(count) = received {
                return Poll::Ready((resting.take(), Next::Messages(count)));
            }
            if let Some(Poll::Ready(granted)) = turn.as_mut().map(|turn| turn.poll_unpin(context)) {
                return Poll::Ready((resting.take(), Next::Turn(granted)));
            }
            let fired = armed && timer.as_mut().poll(context).is_ready();
            if fired {
                Poll::Ready((resting.take(), Next::Timer))
            } else {
                Poll::Pending
            }
        })
        .await;
        // There is no room any more if it panicked while it handled an answer in place.
        let Some(state) = room_or_none.filter(|_| !matches!(next, Next::Messages(0))) else {
            break;
        };
        room = state;
        if let Next::Turn(granted) = next {
            turn = None;
            let background = Arc::clone(&room.context.background);
            let played = background.play(granted, move || room.play_slice()).await;
            let Some((state, place)) = played else { break };
            room = state;
            room.place = Some(place);
            continue;
        }
        room.now = room.clock.now();
        let searched = matches!(next, Next::Searched(_));
        let fired = matches!(next, Next::Timer);
        match next {
            Next::Searched((seat, decision, found)) => {
                search = None;
                room.core.searched(seat, decision, found);
            }
            Next::Hint(hint) => room.give_hint(hint),
            _ => {}
        }
        for message in messages.drain(..) {
            room.receive(message);
        }
        // A busy mailbox must not delay deadlines.
        let due = fired || searched || room.timer_at.is_some_and(|at| at <= room.now);
        if due && !room.fire() {
            break;
        }
    }
    debug!(room = %id, "the room is gone");
}

impl Room {
    /// Handles an answer while the task waits, and publishes the changes. Returns whether the task
    /// must run: to commit to a store that takes time, to conclude the game, or to set its timer.
    pub(super) fn answer_in_place(
        &mut self,
        seat: Seat,
        connection: ConnectionId,
        answer: Answer,
        arrived: Instant,
    ) -> bool {
        let span = self.observed.span().clone();
        let _entered = span.enter();
        self.now = self.now.max(self.clock.at(arrived));
        self.execute(seat, connection, SeatAction::Answer(answer), arrived);
        if !self.commit_now() || self.core.state().is_over() {
            return true;
        }
        self.publish();
        !self.timer_covers(self.core.deadline())
    }

    /// Whether an answer can be handled while the task waits.
    pub(super) fn may_answer_in_place(&self) -> bool {
        let lease = self.context.lease.as_ref();
        self.answers_in_place && lease.is_none_or(|lease| lease.holds())
    }

    /// Whether another node of the cluster may have the room.
    fn is_fenced(&self) -> bool {
        self.over_since.is_none() && self.fence.is_cancelled()
    }

    /// Whether the timer fires no later than a deadline, if there is one.
    fn timer_covers(&self, deadline: Option<Duration>) -> bool {
        deadline.is_none_or(|deadline| self.timer_at.is_some_and(|at| at <= deadline))
    }

    /// Handles the timer. Returns `false` when the room need not be listed any longer.
    fn fire(&mut self) -> bool {
        self.timer_at = None;
        if self.is_expired() {
            return false;
        }
        if !self.plays_in_background() {
            let handed = self.handed();
            self.core.tick(self.now, handed);
        }
        true
    }

    /// Whether the next decision is due and needs no participant.
    fn plays_in_background(&self) -> bool {
        let is_due = |deadline| deadline <= self.now;
        self.core.is_unattended() && self.core.deadline().is_some_and(is_due)
    }

    /// Starts the search for the open decision, if it needs one.
    fn start_search(&mut self) -> Option<BoxFuture<'static, Found>> {
        let request = self.core.start_search()?;
        let (seat, decision) = (request.seat, request.decision);
        let searches = Arc::clone(&self.context.searches);
        let (owner, rules) = (self.context.owner, self.core.header().rules);
        let found = spawned(searches.search(owner, rules, request));
        let ended = found.map(move |found| (seat, decision, found.unwrap_or_default()));
        Some(ended.boxed())
    }

    /// Starts to compute a hint.
    fn start_hint(&mut self, secret: &[u8], decision: u64, id: Option<[u8; 32]>, reply: HintReply) {
        let Some(seat) = self.core.seat_of_ticket(secret) else {
            return answer(reply, None);
        };
        let request = HintRequest { seat, decision, id };
        let reply = match self.latest_hint.repeat(request, reply) {
            Err(reply) => reply,
            Ok(given) => {
                let given = given.map(|(reply, hint)| Release::Hint(reply, hint));
                return self.releases.extend(given);
            }
        };
        let plays = MonteCarlo {
            budget: Budget::Time(HINT_TIME),
            ..MonteCarlo::default()
        };
        match self.core.start_hint(seat, decision, plays) {
            Ok(search) => {
                let searches = Arc::clone(&self.context.searches);
                let rules = self.core.header().rules;
                let hint = spawned(searches.hint(self.context.owner, rules, search));
                self.latest_hint.started(request, reply);
                self.hints
                    .push(hint.map(move |hint| (request, hint)).boxed());
            }
            Err(error) => answer(reply, Some(Err(error))),
        }
    }

    /// Gives a hint once it is recorded.
    fn give_hint(&mut self, (request, hint): HintEnded) {
        let given = match hint {
            Some(_) => (self.core).hinted(self.now, request.seat, request.decision),
            None => Ok(()),
        };
        let waiting = self.latest_hint.ended(request, hint, given);
        let release = waiting.map(|(reply, hint)| Release::Hint(reply, hint));
        self.releases.extend(release);
    }

    /// Plays a slice of a game that nobody plays, and returns the number of decisions.
    fn play_slice(mut self: Box<Self>) -> (Box<Self>, u64) {
        self.now = self.clock.now();
        let before = self.core.decisions();
        self.core.tick(self.now, None);
        let made = self.core.decisions() - before;
        (self, made)
    }

    /// Sets the timer to the next deadline. A timer that fires too early finds nothing to do and is
    /// set again, so that moving a deadline back costs nothing.
    /// While the room waits for its turn, the game has no deadline.
    fn set_timer(&mut self, timer: Pin<&mut Sleep>, waits_for_turn: bool) {
        let deadline = match self.over_since {
            Some(since) => Some(since + self.context.retention),
            None => self.core.deadline().filter(|_| !waits_for_turn),
        };
        if !self.timer_covers(deadline)
            && let Some(deadline) = deadline
        {
            timer.reset(self.clock.instant(deadline));
            self.timer_at = Some(deadline);
        }
    }

    fn is_expired(&self) -> bool {
        self.over_since
            .is_some_and(|since| since + self.context.retention <= self.now)
    }

    /// When the open decision was handed to its seat's transport.
    fn handed(&self) -> Option<Duration> {
        let open = self.core.awaited()?;
        self.connections[open.decision.seat.index()]
            .as_ref()?
            .handed(open.id)
    }

    fn receive(&mut self, message: Message) {
        match message {
            Message::Join(request, reply) => {
                let joined = self.join(*request);
                self.releases.push(Release::Join(reply, joined));
            }
            Message::Attach(request, reply) => self.attach(request, reply),
            Message::Lost(seat, connection, reason) => self.lost(seat, connection, reason),
            Message::Do(seat, connection, action, arrived) => {
                self.execute(seat, connection, action, arrived);
            }
            Message::Act(secret, action, arrived, reply) => {
                match self.core.seat_of_ticket(&secret) {
                    Some(seat) => {
                        let acted = self.perform(seat, action, arrived);
                        self.releases.push(Release::Acted(reply, acted));
                    }
                    None => answer(reply, None),
                }
            }
            Message::Hint(secret, decision, id, reply) => {
                self.start_hint(&secret, decision, id, reply);
            }
            Message::Spectate(request, reply) => {
                self.releases.push(Release::Spectate(request, reply));
            }
            Message::Describe(reply) => self.releases.push(Release::Describe(reply)),
            Message::HasTicket(secrets, reply) => {
                let seated = |secret: &[u8; 32]| self.core.seat_of_ticket(secret).is_some();
                answer(reply, secrets.iter().any(seated));
            }
            Message::SeatOf(secret, reply) => {
                let has_started = self.core.game().is_some();
                let seat = self.core.seat_of_ticket(&secret);
                answer(reply, seat.map(|seat| (seat, has_started)));
            }
            Message::Close(secret, reply) => {
                if self.core.header().owner.matches(&secret) {
                    self.core.abort(self.now, AbortReason::Closed);
                    self.releases.push(Release::Closed(reply));
                } else {
                    answer(reply, None);
                }
            }
            Message::Leave(secret, reply) => match self.core.seat_of_ticket(&secret) {
                Some(seat) => {
                    let left = self.core.leave(self.now, seat);
                    if left.is_ok()
                        && let Some(mut subscriber) = self.connections[seat.index()].take()
                    {
                        subscriber.detach(v1::DetachReason::Requested);
                    }
                    self.releases.push(Release::Left(reply, left));
                }
                None => answer(reply, None),
            },
            Message::Report(secret, request, reply) => match self.report(&secret, *request) {
                Some(Ok(outcome)) => self.releases.push(Release::Reported(reply, outcome)),
                Some(Err(refusal)) => answer(reply, Some(Err(refusal))),
                None => answer(reply, None),
            },
            Message::WatchTable(secret, reply) => match self.has_table(&secret) {
                true => self.releases.push(Release::WatchTable(reply)),
                false => answer(reply, None),
            },
            Message::Mark(request, reply) => self.mark(*request, reply),
            Message::FollowMarkers(secret, position, reply) => {
                match self.core.header().owner.matches(&secret) {
                    true => self.releases.push(Release::FollowMarkers(position, reply)),
                    false => answer(reply, None),
                }
            }
            Message::Retire(seat) => self.retire(seat),
            Message::Abort(reason) => self.core.abort(self.now, reason),
            Message::Suspend => self.suspended = true,
            Message::Wake => {}
        }
    }

    fn join(&mut self, request: JoinRequest) -> Result<Joined, JoinError> {
        let header = self.core.header();
        let ticket = match request.request_id {
            Some(id) => Token::of_request(header.room_id, &header.owner, &id),
            None => Token::random(header.room_id),
        };
        if let Some(seat) = self.core.seat_of_ticket(&ticket.secret) {
            return self.join_again(seat, ticket, &request);
        }
        self.clients.check(&self.core, request.client)?;
        let seat = self.core.join(
            self.now,
            request.seat,
            SeatedParticipant {
                name: request.name,
                kind: request.kind,
                ticket: ticket.hash(),
            },
        )?;
        self.clients.add(request.client, ticket.secret);
        Ok(Joined {
            seat,
            ticket,
            room: Box::new(convert::describe(&self.core)),
        })
    }

    /// Answers a repeated request for a seat.
    fn join_again(
        &self,
        seat: Seat,
        ticket: Token,
        request: &JoinRequest,
    ) -> Result<Joined, JoinError> {
        let room = Box::new(convert::describe(&self.core));
        let seated = &room.seats[seat.index()];
        let is_same = seated.name == request.name
            && seated.kind == convert::kind_to_proto(Some(request.kind))
            && request.seat.is_none_or(|wanted| wanted == seated.seat);
        match is_same {
            true => Ok(Joined { seat, ticket, room }),
            false => Err(JoinError::RequestIdUsed),
        }
    }

    fn attach(
        &mut self,
        request: Box<AttachRequest>,
        reply: oneshot::Sender<Result<AttachedSeat, NotAttached>>,
    ) {
        let Some(seat) = self.core.seat_of_ticket(&request.secret) else {
            return answer(reply, Err(NotAttached::TicketUnknown));
        };
        if !request.outbox.is_open() {
            return answer(reply, Err(NotAttached::StreamOver));
        }
        if let Some(holder) = request.supersedes.kept_by(self.holder(seat)) {
            return answer(reply, Err(NotAttached::HeldBy(holder)));
        }
        let connection = ConnectionId(self.context.connections.fetch_add(1, Ordering::Relaxed));
        let handed = self.handed();
        let (entropy, arrived) = (request.entropy.clone(), self.clock.at(request.arrived));
        self.core
            .attach(self.now, seat, connection, entropy, arrived, handed);
        if request.by_gateway {
            self.core.expect_delays(seat);
        }
        self.releases
            .push(Release::Attach(request, seat, connection, reply));
    }

    fn lost(&mut self, seat: Seat, connection: ConnectionId, reason: Option<v1::DetachReason>) {
        if !self.is_current(seat, connection) {
            return;
        }
        let handed = self.handed();
        self.core.lost(self.now, seat, connection, handed);
        if let Some(mut subscriber) = self.connections[seat.index()].take()
            && let Some(reason) = reason
        {
            subscriber.detach(reason);
        }
    }

    /// Gives up a seat whose participant has left the tournament.
    fn retire(&mut self, seat: Seat) {
        let handed = self.handed();
        self.core.retire(self.now, seat, handed);
        if let Some(mut subscriber) = self.connections[seat.index()].take() {
            subscriber.detach(v1::DetachReason::Requested);
        }
    }

    fn is_current(&self, seat: Seat, connection: ConnectionId) -> bool {
        self.connections[seat.index()]
            .as_ref()
            .is_some_and(|subscriber| is_connection(subscriber, connection))
    }

    /// Executes a command of a connection, unless a newer one has its seat. The result is released
    /// once the changes are committed.
    fn execute(
        &mut self,
        seat: Seat,
        connection: ConnectionId,
        action: SeatAction,
        arrived: Instant,
    ) {
        if !self.is_current(seat, connection) {
            return;
        }
        let release = match self.perform(seat, action, arrived) {
            Ok(Some(result)) => Release::Result(seat, connection, result),
            Ok(None) => return,
            Err(error) => Release::Refuse(seat, connection, convert::express_refused(error)),
        };
        self.releases.push(release);
    }

    fn perform(&mut self, seat: Seat, action: SeatAction, arrived: Instant) -> Acted {
        match action {
            SeatAction::Answer(answer) => {
                self.observed.answer_read(arrived);
                let (decision_id, action) = (answer.decision_id, answer.action);
                let handed = self.connections[seat.index()]
                    .as_ref()
                    .and_then(|subscriber| subscriber.handed(decision_id));
                let arrived = self.clock.at(arrived);
                let answered = self.core.answer(self.now, seat, answer, arrived, handed);
                Ok(Some(convert::answer_result(decision_id, action, answered)))
            }
            SeatAction::Express {
                record_only,
                about,
                expression,
            } => self
                .core
                .express(self.now, seat, record_only, about, expression)
                .map(|()| None),
            SeatAction::Resume => {
                self.core.resume(self.now, seat);
                Ok(None)
            }
        }
    }

    /// Whether a secret is that of the table's ticket.
    fn has_table(&self, secret: &[u8]) -> bool {
        (self.core.header().table).is_some_and(|table| table.matches(secret))
    }

    /// Takes a report from the physical table; `None` if the secret is not its ticket's.
    fn report(
        &mut self,
        secret: &[u8],
        request: v1::ReportRequest,
    ) -> Option<Result<ReportOutcome, ReportRefusal>> {
        if !self.has_table(secret) {
            return None;
        }
        let deck = Deck::of(&self.core.header().rules);
        let message = request.report.unwrap_or_default();
        let outcome = convert::reported_from_proto(&request.report_id, &message, deck)
            .map_err(ReportRefusal::Malformed)
            .and_then(|reported| {
                let outcome = self.core.report(self.now, reported);
                outcome.map_err(ReportRefusal::Refused)
            });
        if let (Ok(_), Some(table)) = (&outcome, &mut self.table) {
            table.keep_picture(&self.core, message);
        }
        Some(outcome)
    }

    /// Adds a marker, and answers once it is committed.
    fn mark(&mut self, request: MarkRequest, reply: oneshot::Sender<Option<MarkOutcome>>) {
        if !self.core.header().owner.matches(&request.secret) {
            return answer(reply, None);
        }
        match self.core.mark(self.now, request.marked) {
            Ok(number) => self.releases.push(Release::Marked(reply, number)),
            Err(error) => answer(reply, Some(Err(error))),
        }
    }

    fn spectate(&mut self, request: SpectateRequest) -> Result<(), SpectateError> {
        let policy = &self.core.header().policy;
        if !policy.spectators {
            return Err(SpectateError::NotAdmitted);
        }
        if request.snapshot && policy.spectator_delay_decisions > 0 {
            return Err(SpectateError::SnapshotDelayed);
        }
        let first = self.core.log().first();
        if !request.snapshot && request.from < first {
            return Err(SpectateError::EventsGone(first));
        }
        let place = (self.spectator_places.try_take(request.charged)).ok_or(SpectateError::Full)?;
        let spectator = Subscriber::spectator(
            &self.core,
            request.outbox,
            Arc::clone(&self.on_space),
            request.from,
            request.snapshot,
            (self.context.metrics.spectator(), place),
        );
        let position = spectator.position();
        self.spectators.push(spectator);
        if position < self.public.encoded().start {
            self.public.restart_at(first);
            self.public.follow(&self.core);
        }
        Ok(())
    }

    /// Commits new changes if this takes no time.
    fn commit_now(&mut self) -> bool {
        let metrics = &self.context.metrics;
        self.observed.count_changes(&mut self.core, metrics);
        self.core.pending().is_empty() || self.journal.append_now(self.core.pending())
    }

    /// Commits new changes, then publishes what subscribers may know. Returns `false` when the room
    /// must stop.
    async fn commit_and_publish(&mut self) -> bool {
        if !self.commit_now() {
            let room = self.core.header().room_id;
            let appended = self.journal.append(self.core.pending());
            let appended = unless_fenced(&self.context, &self.fence, room, appended);
            if let Err(error) = appended.await {
                self.fail(&error);
                return false;
            }
            // The time of the commit does not count as thinking time.
            self.now = self.clock.now();
        }
        let ends = self.core.state().is_over() && self.over_since.is_none();
        if ends && !self.conclude().await {
            return false;
        }
        if !self.wait_for_lease().await {
            return false;
        }
        self.publish();
        if ends {
            // A shutdown that waits for games to end may close streams at once: everything has been
            // queued.
            self.context.watcher.game_over(self.core.header().room_id);
        }
        true
    }

    /// Waits until the server may publish. Returns `false` if the room must stop instead.
    async fn wait_for_lease(&mut self) -> bool {
        let Some(lease) = self.context.lease.as_ref().filter(|lease| !lease.holds()) else {
            return true;
        };
        tokio::select! {
            () = self.fence.cancelled() => return false,
            () = lease.held() => {}
        }
        self.now = self.clock.now();
        true
    }

    /// Sends committed changes to subscribers and results to callers.
    fn publish(&mut self) {
        self.core.released(self.now);
        if self.core.is_built_in_only() {
            self.forget_unread();
        }
        self.public.follow(&self.core);
        let mut releases = std::mem::take(&mut self.releases);
        for release in releases.drain(..) {
            self.release(release);
        }
        self.releases = releases;
        if let Some(table) = &self.table {
            table.follow(&self.core, self.now);
        }
        if let Some(markers) = &self.markers {
            markers.follow(&self.core);
        }
        self.deliver();
        self.observed.trace_decision(&self.core);
        let metrics = &self.context.metrics;
        self.observed.count_published(&self.core, metrics);
    }

    /// Drops old events of a game without participants that no spectator waits for.
    fn forget_unread(&mut self) {
        let length = self.core.log().len();
        let unread = self.spectators.iter().map(Subscriber::position).min();
        // What spectators have not read yet is encoded again, which is little: they keep up.
        if unread.is_none() || self.public.encoded().len() > 2 * MAX_EVENTS_UNREAD {
            self.public.restart_at(unread.unwrap_or(length));
        }
        let kept = match self.core.state().is_over() {
            true => MAX_EVENTS_UNREAD_AFTERWARDS,
            false => MAX_EVENTS_UNREAD,
        };
        let visible = self.core.visible_to_spectators();
        let keep_from = length.saturating_sub(kept).min(visible);
        let keep_from = unread.map_or(keep_from, |unread| keep_from.min(unread));
        self.core.drop_log_before(keep_from);
    }

    fn release(&mut self, release: Release) {
        match release {
            Release::Join(reply, joined) => answer(reply, joined),
            Release::Attach(request, seat, connection, reply) => {
                self.release_attach(*request, seat, connection, reply);
            }
            Release::Result(seat, connection, result) => {
                if let Some(subscriber) = self.current(seat, connection) {
                    subscriber.send_result(result);
                    self.always_visit[seat.index()] = true;
                }
            }
            Release::Refuse(seat, connection, refused) => {
                if let Some(subscriber) = self.current(seat, connection) {
                    subscriber.refuse(refused);
                    self.always_visit[seat.index()] = true;
                }
            }
            Release::Acted(reply, acted) => answer(reply, Some(acted)),
            Release::Hint(reply, hint) => answer(reply, Some(Ok(hint))),
            Release::Closed(reply) => answer(reply, Some(convert::describe(&self.core))),
            Release::Left(reply, left) => {
                answer(reply, Some(left.map(|()| convert::describe(&self.core))));
            }
            Release::Describe(reply) => answer(reply, convert::describe_at(&self.core, self.now)),
            Release::Spectate(request, reply) => answer(reply, self.spectate(*request)),
            Release::Reported(reply, outcome) => {
                let state = (self.table.as_ref()).map(|table| table.state(&self.core, self.now));
                let state = state.map_or_else(v1::TableState::default, Arc::unwrap_or_clone);
                let response = convert::report_response(&outcome, state);
                answer(reply, Some(Ok(Box::new(response))));
            }
            Release::Marked(reply, number) => {
                let marker = &self.core.markers()[number - 1];
                let marker = convert::marker_to_proto(number - 1, marker);
                answer(reply, Some(Ok(marker)));
            }
            Release::FollowMarkers(position, reply) => {
                let core = &self.core;
                let log = (self.markers).get_or_insert_with(|| Box::new(MarkerLog::new(core)));
                log.follow(core);
                let following = log.subscribe(position).ok_or(SpectateError::Full);
                answer(reply, Some(following));
            }
            Release::WatchTable(reply) => {
                let watching = (self.table.as_ref())
                    .and_then(|table| table.watch(&self.core, self.now))
                    .ok_or(SpectateError::Full);
                answer(reply, Some(watching));
            }
        }
    }

    fn release_attach(
        &mut self,
        request: AttachRequest,
        seat: Seat,
        connection: ConnectionId,
        reply: oneshot::Sender<Result<AttachedSeat, NotAttached>>,
    ) {
        // Its participant may have left or been removed in the same batch.
        if self.core.seat_of_ticket(&request.secret) != Some(seat) {
            return answer(reply, Err(NotAttached::TicketUnknown));
        }
        let participant = self.core.standing(seat).participant;
        let kind = participant.map_or(ParticipantKind::Agent, |participant| participant.kind);
        let stamp = HandStamp::new(self.clock);
        let connected = SeatConnection::new(
            (seat, connection),
            request.handle,
            request.options,
            Arc::clone(&stamp),
            request.by_gateway,
            request.detached,
            self.context.metrics.seat(kind),
        );
        let mut subscriber =
            Subscriber::seat(connected, request.outbox, Arc::clone(&self.on_space));
        subscriber.confirm_attached(&self.core, request.request_id, request.assigned_ticket);
        let news = Publication::new(&self.core, &self.public, self.now);
        subscriber.deliver(&news, true);
        if let Some(mut older) = self.connections[seat.index()].replace(subscriber) {
            older.detach(v1::DetachReason::Superseded);
        }
        self.always_visit[seat.index()] = true;
        let attached = AttachedSeat {
            seat,
            connection,
            stamp,
        };
        answer(reply, Ok(attached));
    }

    /// The number of the newest connection of a seat, attached or about to be.
    fn holder(&self, seat: Seat) -> Option<u64> {
        let mut attaching = self
            .releases
            .iter()
            .rev()
            .filter_map(|release| match release {
                Release::Attach(_, of, connection, _) if *of == seat => Some(connection.0),
                _ => None,
            });
        let attached = || {
            let subscriber = self.connections[seat.index()].as_ref()?;
            Some(subscriber.connection()?.id.0)
        };
        attaching.next().or_else(attached)
    }

    fn current(&mut self, seat: Seat, connection: ConnectionId) -> Option<&mut Subscriber> {
        self.connections[seat.index()]
            .as_mut()
            .filter(|subscriber| is_connection(subscriber, connection))
    }

    /// Sends updates that are due. Visits only connections for which some may be: with many rooms,
    /// each visit costs several cache misses.
    fn deliver(&mut self) {
        let events = self.core.log().since(self.delivered);
        let length = self.core.log().len();
        let news = Publication::new(&self.core, &self.public, self.now);
        let awaited = self.core.awaited().map(|open| open.decision.seat);
        let all = length >= self.backlog_due_at || self.core.state().is_over();
        for seat in self.core.all_seats() {
            let urgent = events.clone().any(|entry| is_urgent(&entry.event, seat));
            let always_visit = &mut self.always_visit[seat.index()];
            if (all || urgent || *always_visit || awaited == Some(seat))
                && let Some(subscriber) = &mut self.connections[seat.index()]
            {
                subscriber.deliver(&news, urgent);
                *always_visit = subscriber.must_always_be_visited();
            }
        }
        if all {
            let connected = self.connections.iter().flatten();
            let due_at = connected.map(Subscriber::backlog_due_at).min();
            self.backlog_due_at = due_at.unwrap_or(length + MAX_PENDING_EVENTS);
        }
        self.delivered = length;
        self.spectators
            .retain_mut(|spectator| spectator.deliver(&news, false));
    }

    /// Handles the end of the game: finishes the journal and writes the record.
    async fn conclude(&mut self) -> bool {
        self.over_since = Some(self.now);
        let header = Arc::clone(self.core.header());
        // A game without a deal has no record.
        let summary = self.core.game().map(|_| convert::summary(&self.core));
        let has_record = summary.is_some();
        let announced = summary.clone().filter(|_| self.context.webhooks.is_on());
        (self.context.metrics).game_ended(self.core.state() == State::Finished);
        let signed = match has_record {
            true => self.sign().await,
            false => Ok(None),
        };
        let finished = match signed {
            Ok(signed) => {
                let finished = self.journal.finish(summary.map(Box::new), signed);
                unless_lost(&self.context, &self.fence, header.room_id, finished).await
            }
            Err(error) => Err(error),
        };
        if let Err(error) = finished {
            self.over_since = None;
            self.fail(&error);
            return false;
        }
        (self.context.webhooks).game_ended(&header, announced.as_ref());
        info!(
            room = %header.room_id,
            game = %header.game_id,
            finished = self.core.state() == State::Finished,
            decisions = self.core.decisions(),
            "the game has ended"
        );
        if has_record {
            let owner = self.context.owner;
            self.context
                .record_writer
                .write_record(header.game_id, owner);
        }
        true
    }

    /// Signs the record of the game. If its journal cannot be read, the record stays unsigned; a
    /// node, whose database may be away, tries again before.
    ///
    /// # Errors
    /// The room was fenced meanwhile.
    async fn sign(&mut self) -> Result<Option<Signed>, StoreError> {
        let background = self.core.is_built_in_only();
        let background = background.then_some((&*self.context.background, self.context.owner));
        let header = self.core.header();
        let (game, unit) = (header.game_id, header.unit());
        let limit = match self.context.lease {
            Some(_) => SIGNING_LIMIT,
            None => Duration::ZERO,
        };
        let began = Instant::now();
        loop {
            let header = Arc::clone(self.core.header());
            let journal = &mut *self.journal;
            let signing = self.context.signer.sign(header, journal, background);
            let error = match signing.await {
                Ok(signed) => return Ok(signed),
                Err(error) => error,
            };
            if began.elapsed() >= limit {
                error!(%game, %error, "a record could not be signed; it stays unsigned");
                return Ok(None);
            }
            tokio::select! {
                () = self.fence.cancelled() => return Err(StoreError::Fenced(unit)),
                () = tokio::time::sleep(SIGNING_PAUSE) => {}
            }
        }
    }

    /// Handles a failure of the store: nothing uncommitted is published. The streams end, so that
    /// agents reconnect and find the game as the restarted server, or the node that owns it, finds
    /// it.
    fn fail(&mut self, error: &StoreError) {
        let room = self.core.header().room_id;
        self.releases.clear();
        match (error, &self.context.lease) {
            (StoreError::Fenced(_), _) => info!(%room, %error, "the room stops here"),
            (_, Some(_)) => warn!(%room, %error, "the room stops until its node resumes it"),
            (_, None) => {
                error!(%room, %error, "the store failed; the room stops");
                self.end_streams(StreamEnd::StoreFailed);
            }
        }
    }

    /// Ends the streams of all subscribers, which may reconnect.
    fn end_streams(&mut self, end: StreamEnd) {
        self.subscribers()
            .for_each(|subscriber| subscriber.end(end));
    }

    fn subscribers(&mut self) -> impl Iterator<Item = &mut Subscriber> {
        let seats = self.connections.iter_mut().flatten();
        seats.chain(&mut self.spectators)
    }
}

/// Streams end even if the room panics, so that no client waits for a room that is gone.
impl Drop for Room {
    fn drop(&mut self) {
        self.end_streams(StreamEnd::RoomGone);
        let header = self.core.header();
        self.context.watcher.gone(header.room_id);
        let is_expected = self.suspended || self.fence.is_cancelled();
        if let Some(lease) = &self.context.lease
            && !is_expected
            && self.over_since.is_none()
        {
            lease.report(header.unit(), News::Stopped);
        }
    }
}

/// The result of a write, unless the room is fenced before. In a single server it never is.
async fn unless_fenced(
    context: &TaskContext,
    fence: &CancellationToken,
    room: Id,
    written: impl Future<Output = Result<(), StoreError>>,
) -> Result<(), StoreError> {
    if context.lease.is_none() {
        return written.await;
    }
    tokio::select! {
        biased;
        written = written => written,
        () = fence.cancelled() => Err(StoreError::Fenced(room)),
    }
}

/// The outcome of the end of a game, unless the room is fenced and the node has no lease. A node
/// that has one learns from its beat that the game is over, maybe before it learns the outcome.
async fn unless_lost(
    context: &TaskContext,
    fence: &CancellationToken,
    room: Id,
    finished: impl Future<Output = Result<(), StoreError>>,
) -> Result<(), StoreError> {
    let Some(lease) = &context.lease else {
        return finished.await;
    };
    let lost = async {
        fence.cancelled().await;
        lease.lapsed().await;
    };
    tokio::select! {
        biased;
        finished = finished => finished,
        () = lost => Err(StoreError::Fenced(room)),
    }
}

fn is_connection(subscriber: &Subscriber, connection: ConnectionId) -> bool {
    (subscriber.connection()).is_some_and(|attached| attached.id == connection)
}

/// Starts work that does not wait until somebody polls it, and ends it when dropped. `None` if it
/// panicked.
fn spawned<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> impl Future<Output = Option<T>> + Send {
    AbortOnDropHandle::new(tokio::spawn(work)).map(Result::ok)
}

/// Answers a caller, which may have gone.
fn answer<T>(reply: oneshot::Sender<T>, answer: T) {
    let _ = reply.send(answer);
}
