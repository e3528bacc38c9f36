//! The task of a room: receives from a bounded mailbox, sets one timer, and for every batch of
//! inputs lets the core apply them, commits the changes and only then publishes them. While the
//! task waits, the reader of a stream may handle an answer in the same way. The core makes all
//! decisions. `inputs` has the messages, `committing` the commits, `publishing` what is sent.

mod committing;
mod inputs;
mod publishing;

use std::convert::Infallible;
use std::future::poll_fn;
use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::task::Poll;
use std::time::Duration;

use chefshat_agents::{Budget, MonteCarlo};
use chefshat_engine::Seat;
use chefshat_proto::v1;
use chefshat_record::outcome::Outcome;
use chefshat_room::ids::RoomId;
use chefshat_room::journal::AbortReason;
use chefshat_room::{
    Answer, ConnectionId, Core, ExpressError, JoinError, LeaveError, MarkError, ReportOutcome,
    Searched,
};
use futures::future::BoxFuture;
use futures::stream::FuturesUnordered;
use futures::{FutureExt as _, StreamExt as _};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::{Instant, Sleep};
use tokio_util::sync::CancellationToken;
use tokio_util::task::{AbortOnDropHandle, TaskTracker};
use tracing::{Instrument as _, debug};

use super::clients::Clients;
use super::hints::{HintReply, HintRequest, LatestHint};
use super::markers::{MarkerFollower, MarkerLog};
use super::message::{
    AttachRequest, AttachedSeat, Joined, Message, NotAttached, NotifySpace, Reply, ReportRefusal,
    RoomError, SeatAction, SpectateError, SpectateRequest,
};
use super::shared::SharedRoom;
use super::subscriber::{MAX_SPECTATORS, PublicEvents, Subscriber};
use super::table_view::{SentState, TableView};
use super::telemetry::RoomTelemetry;
use crate::cluster::{NodeLease, UnitEvent};
use crate::config::ROOM_MAILBOX;
use crate::record_writer::RecordWriter;
use crate::signing::Signer;
use crate::webhooks::Webhooks;
use chefshat_admission::limits::{
    Background, FairSemaphore, Hint, Key, NotStored, Payer, Permit, Searches, Shares, StoredBytes,
    TimeSlice,
};
use chefshat_base::clock::{ProcessClock, RoomClock};
use chefshat_base::metrics::Metrics;
use chefshat_base::tasks::{LongTask, named, short};
use chefshat_store::{Journal, Store};
use chefshat_wire::outbox::{OnSpace, StreamEnd};

/// Time of a hint.
const HINT_TIME: Duration = Duration::from_millis(400);

/// Most inputs that are applied before one commit.
const INPUTS_PER_COMMIT: usize = 64;

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
    /// The caller that created it; `None` if that was a tournament or study, or is unknown because the
    /// room was resumed.
    pub creator: Option<Payer>,
    /// What callers have written to the disk.
    pub stored: Arc<StoredBytes>,
    /// How much of each limit one caller may use.
    pub shares: Shares,
    /// The time that the process has run.
    pub process_clock: Arc<ProcessClock>,
}

impl TaskContext {
    /// Charges a caller for something of this size that is stored, but that no game needs.
    ///
    /// # Errors
    /// It must not be stored.
    pub fn may_store(&self, key: Key, bytes: usize) -> Result<(), NotStored> {
        match self.store.outlives_server() {
            true => self.stored.admit(key, bytes, self.store.has_space()),
            // What ends with the process is bounded as memory.
            false => Ok(()),
        }
    }
}

/// How a game has ended, as its record says.
#[derive(Debug, Clone)]
pub enum GameEnd {
    /// It was finished, with this outcome if it is of a tournament. Missing if its record could not be
    /// read.
    Finished(Option<Arc<Outcome>>),
    /// It was aborted after the deal.
    Aborted(AbortReason),
    /// It was aborted before the deal, and has no record.
    NotDealt,
    /// Its room has failed, by a fault of the server.
    Failed,
}

/// Maintains the list of rooms.
pub trait RoomWatcher: Send + Sync {
    /// The game of a room has ended; the room is still listed.
    fn game_over(&self, room: RoomId, end: GameEnd);
    /// The room is gone. `has_failed`: before its game was over, and nobody resumes it before the
    /// server is restarted.
    fn gone(&self, room: RoomId, has_failed: bool);
}

/// Spawns the task of a room and returns the sender of its mailbox and where readers share it.
/// `over_since`: the game is already over, and its end has been processed.
pub(super) fn spawn(
    core: Core,
    clock: RoomClock,
    over_since: Option<Duration>,
    journal: Box<dyn Journal>,
    fence: CancellationToken,
    context: TaskContext,
) -> (mpsc::Sender<Message>, Arc<SharedRoom<Room>>) {
    let (mailbox, inbox) = mpsc::channel(ROOM_MAILBOX);
    let shared = Arc::new(SharedRoom::default());
    let seats = core.header().fills.len();
    let physical = core.header().is_physical();
    let telemetry = RoomTelemetry::new(&core, &context.metrics);
    let span = telemetry.span().clone();
    let room = Box::new(Room {
        core,
        journal,
        now: clock.now(),
        clock,
        connections: (0..seats).map(|_| None).collect(),
        spectators: Vec::new(),
        spectator_places: FairSemaphore::new(MAX_SPECTATORS, context.shares),
        on_space: Arc::new(NotifySpace(mailbox.downgrade())),
        after_commit: Vec::new(),
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
        telemetry,
        context: context.clone(),
    });
    let running = run(room, Arc::clone(&shared), inbox).instrument(span);
    context.tracker.spawn(named(LongTask::Room, running));
    (mailbox, shared)
}

/// An answer or update that is sent once the changes are committed.
enum AfterCommit {
    Join(Reply<Joined, JoinError>, Result<Joined, JoinError>),
    Attach(
        Box<AttachRequest>,
        Seat,
        ConnectionId,
        Reply<AttachedSeat, NotAttached>,
    ),
    Result(Seat, ConnectionId, v1::AnswerResult),
    Refuse(Seat, ConnectionId, v1::Refused),
    Acted(
        Reply<Option<v1::AnswerResult>, ExpressError>,
        Result<Option<v1::AnswerResult>, ExpressError>,
    ),
    Closed(Reply<v1::Room, Infallible>),
    Left(Reply<v1::Room, LeaveError>, Result<(), LeaveError>),
    Describe(oneshot::Sender<v1::Room>),
    Spectate(Box<SpectateRequest>, Reply<(), SpectateError>),
    Reported(Reply<Box<v1::ReportResponse>, ReportRefusal>, ReportOutcome),
    WatchTable(Reply<watch::Receiver<SentState>, SpectateError>),
    Hint(HintReply, Hint),
    /// The marker with this number.
    Marked(Reply<v1::Marker, MarkError>, usize),
    FollowMarkers(usize, Reply<MarkerFollower, SpectateError>),
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
    spectator_places: Arc<FairSemaphore>,
    on_space: Arc<dyn OnSpace>,
    after_commit: Vec<AfterCommit>,
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
    place: Option<Permit>,
    /// When the timer of the task fires.
    timer_at: Option<Duration>,
    answers_in_place: bool,
    /// The physical table, if the room has one.
    table: Option<Box<TableView>>,
    /// The markers, if anybody has followed them.
    markers: Option<Box<MarkerLog>>,
    telemetry: RoomTelemetry,
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
    Turn(TimeSlice),
    /// Takes the result of a search.
    Searched(Found),
    /// Gives a hint.
    Hint(HintEnded),
    /// Does what is due.
    Timer,
}

/// Runs a room until it is gone.
async fn run(
    mut room: Box<Room>,
    shared: Arc<SharedRoom<Room>>,
    mut inbox: mpsc::Receiver<Message>,
) {
    let id = room.core.header().room_id;
    room.core.begin_if_all_built_in(room.now);
    let mut messages = Vec::with_capacity(INPUTS_PER_COMMIT);
    let timer = tokio::time::sleep_until(room.clock.instant(room.now));
    tokio::pin!(timer);
    // The next slice of a game that nobody plays.
    let mut turn: Option<BoxFuture<'static, TimeSlice>> = None;
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
        *shared.lock() = Some(room);
        let (room_or_none, next) = poll_fn(|context| {
            // Under the lock, so that no answer in place overtakes a message.
            let mut shared = shared.lock();
            // Before the mailbox, which may never be empty: a decision has few of these.
            if let Some(Poll::Ready(found)) = search.as_mut().map(|it| it.poll_unpin(context)) {
                return Poll::Ready((shared.take(), Next::Searched(found)));
            }
            let hints = shared.as_mut().map(|room| &mut room.hints);
            if let Some(hints) = hints.filter(|hints| !hints.is_empty())
                && let Poll::Ready(Some(hint)) = hints.poll_next_unpin(context)
            {
                return Poll::Ready((shared.take(), Next::Hint(hint)));
            }
            let received = inbox.poll_recv_many(context, &mut messages, INPUTS_PER_COMMIT);
            if let Poll::Ready(count) = received {
                return Poll::Ready((shared.take(), Next::Messages(count)));
            }
            if let Some(Poll::Ready(granted)) = turn.as_mut().map(|turn| turn.poll_unpin(context)) {
                return Poll::Ready((shared.take(), Next::Turn(granted)));
            }
            let fired = armed && timer.as_mut().poll(context).is_ready();
            if fired {
                Poll::Ready((shared.take(), Next::Timer))
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
        let span = self.telemetry.span().clone();
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
            return answer(reply, Err(RoomError::SecretUnknown));
        };
        let request = HintRequest { seat, decision, id };
        let reply = match self.latest_hint.repeat(request, reply) {
            Err(reply) => reply,
            Ok(given) => {
                let given = given.map(|(reply, hint)| AfterCommit::Hint(reply, hint));
                return self.after_commit.extend(given);
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
            Err(error) => answer(reply, Err(RoomError::Refused(error))),
        }
    }

    /// Gives a hint once it is recorded.
    fn give_hint(&mut self, (request, hint): HintEnded) {
        let given = match hint {
            Some(_) => (self.core).hinted(self.now, request.seat, request.decision),
            None => {
                self.core.hint_ended(request.seat, request.decision);
                Ok(())
            }
        };
        let waiting = self.latest_hint.ended(request, hint, given);
        let release = waiting.map(|(reply, hint)| AfterCommit::Hint(reply, hint));
        self.after_commit.extend(release);
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
        // A node of a cluster resumes it.
        let has_failed = std::thread::panicking() && self.context.lease.is_none();
        self.context.watcher.gone(header.room_id, has_failed);
        let is_expected = self.suspended || self.fence.is_cancelled();
        if let Some(lease) = &self.context.lease
            && !is_expected
            && self.over_since.is_none()
        {
            lease.report(header.unit(), UnitEvent::Stopped);
        }
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
    AbortOnDropHandle::new(tokio::spawn(short("one search", work))).map(Result::ok)
}

/// Answers a caller, which may have gone.
fn answer<T>(reply: oneshot::Sender<T>, answer: T) {
    let _ = reply.send(answer);
}
