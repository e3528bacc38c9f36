//! The shell around a room's core: a task that receives from a bounded mailbox, arms one deadline, and for every batch of inputs lets the
//! core apply them, hands the changes to the store, awaits it, and only then tells anybody. Nothing is decided here.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use chefshat_engine::Seat;
use chefshat_proto::v1;
use tokio::sync::{mpsc, oneshot};
use tokio::time::{Instant, Sleep};
use tokio_util::task::TaskTracker;
use tracing::{debug, error, info};

use super::core::{AnswerInput, Answered, ConnectionId, Core, JoinError, State};
use super::delivery::{Attachment, PublicLog, is_urgent};
use super::handle::{
    Acted, AttachRequest, Handle, JoinRequest, Joined, Message, SeatAction, SpectateError,
    SpectateRequest, TellSpace,
};
use super::spectators::{MAX_SPECTATORS, Spectator};
use crate::config::ROOM_MAILBOX;
use crate::convert;
use crate::grpc::status::{Refusal, refused};
use crate::ids::{Id, Token};
use crate::outbox::{HandStamp, OnSpace};
use crate::store::journal::{AbortReason, GameHeader, SeatedParticipant};
use crate::store::{Journal, Store};

/// Inputs that are applied before the store is asked once for all of them.
const INPUTS_PER_COMMIT: usize = 64;

/// What is told once the changes are kept.
enum Release {
    Join(
        oneshot::Sender<Result<Joined, JoinError>>,
        Result<Joined, JoinError>,
    ),
    Attach(
        Box<AttachRequest>,
        Seat,
        ConnectionId,
        oneshot::Sender<Option<(Seat, ConnectionId)>>,
    ),
    Result(Seat, ConnectionId, v1::AnswerResult),
    Refuse(Seat, ConnectionId, v1::Refused),
    Acted(oneshot::Sender<Option<Acted>>, Acted),
    Closed(oneshot::Sender<Option<v1::Room>>),
    Describe(oneshot::Sender<v1::Room>),
    Spectate(
        Box<SpectateRequest>,
        oneshot::Sender<Result<(), SpectateError>>,
    ),
}

/// What a room needs from its server.
#[derive(Clone)]
pub struct TaskContext {
    /// Where games are kept.
    pub store: Arc<dyn Store>,
    /// Where records are written.
    pub data_dir: Option<PathBuf>,
    /// How long an ended room is still shown.
    pub retention: Duration,
    /// Numbers for connections.
    pub connections: Arc<AtomicU64>,
    /// Tasks that a shutdown waits for.
    pub tracker: TaskTracker,
    /// Told when the game of a room has ended, and when the room is gone.
    pub watcher: Arc<dyn RoomWatcher>,
}

/// Who keeps the list of rooms.
pub trait RoomWatcher: Send + Sync {
    /// The game of a room has ended; the room is still shown.
    fn game_over(&self, room: Id);
    /// The room is gone.
    fn gone(&self, room: Id);
}

/// Starts a room.
pub fn start(header: Arc<GameHeader>, journal: Box<dyn Journal>, context: TaskContext) -> Handle {
    let (mailbox, inbox) = mpsc::channel(ROOM_MAILBOX);
    let handle = Handle {
        id: header.room_id,
        mailbox: mailbox.clone(),
    };
    let seats = header.fills.len();
    let task = Task {
        core: Core::new(header),
        journal,
        epoch: Instant::now(),
        now: Duration::ZERO,
        attachments: (0..seats).map(|_| None).collect(),
        spectators: Vec::new(),
        on_space: Arc::new(TellSpace(mailbox.downgrade())),
        releases: Vec::new(),
        public: PublicLog::default(),
        delivered: 0,
        over_since: None,
        context: context.clone(),
    };
    context.tracker.spawn(task.run(inbox));
    handle
}

/// Says that a room is gone, however it went.
struct TellGone {
    room: Id,
    watcher: Arc<dyn RoomWatcher>,
}

impl Drop for TellGone {
    fn drop(&mut self) {
        self.watcher.gone(self.room);
    }
}

struct Task {
    core: Core,
    journal: Box<dyn Journal>,
    epoch: Instant,
    /// The time of the inputs in hand, since `epoch`.
    now: Duration,
    attachments: Vec<Option<Attachment>>,
    spectators: Vec<Spectator>,
    on_space: Arc<dyn OnSpace>,
    releases: Vec<Release>,
    public: PublicLog,
    /// Length of the log when everybody had last been looked after.
    delivered: usize,
    over_since: Option<Duration>,
    context: TaskContext,
}

impl Task {
    async fn run(mut self, mut inbox: mpsc::Receiver<Message>) {
        let _gone = TellGone {
            room: self.core.header().room_id,
            watcher: Arc::clone(&self.context.watcher),
        };
        self.core.begin_if_all_built_in(Duration::ZERO);
        let mut messages = Vec::with_capacity(INPUTS_PER_COMMIT);
        let alarm = tokio::time::sleep_until(self.epoch);
        tokio::pin!(alarm);
        let mut armed = true;
        loop {
            if !self.keep_and_tell().await {
                break;
            }
            armed = self.arm(alarm.as_mut(), armed);
            tokio::select! {
                biased;
                received = inbox.recv_many(&mut messages, INPUTS_PER_COMMIT) => {
                    if received == 0 {
                        break;
                    }
                    self.now = self.epoch.elapsed();
                    for message in messages.drain(..) {
                        self.receive(message);
                    }
                    // A mailbox that is never empty does not stop the clock.
                    let due = armed && alarm.deadline() <= self.epoch + self.now;
                    if due && !self.ring(&mut armed) {
                        break;
                    }
                }
                () = alarm.as_mut(), if armed => {
                    self.now = self.epoch.elapsed();
                    if !self.ring(&mut armed) {
                        break;
                    }
                }
            }
        }
        debug!(room = %self.core.header().room_id, "the room is gone");
    }

    /// The alarm has rung. `false` when the room has been shown long enough.
    fn ring(&mut self, armed: &mut bool) -> bool {
        *armed = false;
        if self.is_expired() {
            return false;
        }
        let handed = self.handed();
        self.core.tick(self.now, handed);
        true
    }

    /// Arms the alarm for the next deadline. An alarm that rings too early finds nothing to do and is armed again, so that a later
    /// deadline costs nothing.
    fn arm(&self, alarm: std::pin::Pin<&mut Sleep>, armed: bool) -> bool {
        let deadline = match self.over_since {
            Some(since) => Some(since + self.context.retention),
            None => self.core.deadline(),
        };
        let Some(deadline) = deadline else {
            return false;
        };
        let deadline = self.epoch + deadline;
        if !armed || alarm.deadline() > deadline {
            alarm.reset(deadline);
        }
        true
    }

    fn is_expired(&self) -> bool {
        self.over_since
            .is_some_and(|since| since + self.context.retention <= self.now)
    }

    /// When the open decision was handed to its seat's transport.
    fn handed(&self) -> Option<Duration> {
        let open = self.core.awaited()?;
        self.attachments[open.decision.seat.index()]
            .as_ref()?
            .handed(open.id)
    }

    fn receive(&mut self, message: Message) {
        let now = self.now;
        match message {
            Message::Join(request, reply) => {
                let joined = self.join(now, *request);
                self.releases.push(Release::Join(reply, joined));
            }
            Message::Attach(request, reply) => self.attach(now, request, reply),
            Message::Lost(seat, connection, reason) => self.lost(now, seat, connection, reason),
            Message::Do(seat, connection, action, arrived) => {
                if self.is_current(seat, connection) {
                    match self.perform(now, seat, action, arrived) {
                        Ok(Some(result)) => {
                            self.releases
                                .push(Release::Result(seat, connection, result));
                        }
                        Ok(None) => {}
                        Err(error) => {
                            let refused = refused(0, &Refusal::from(error).0);
                            self.releases
                                .push(Release::Refuse(seat, connection, refused));
                        }
                    }
                }
            }
            Message::Act(secret, action, arrived, reply) => {
                match self.core.seat_of_ticket(&secret) {
                    Some(seat) => {
                        let acted = self.perform(now, seat, action, arrived);
                        self.releases.push(Release::Acted(reply, acted));
                    }
                    None => answer(reply, None),
                }
            }
            Message::Spectate(request, reply) => {
                self.releases.push(Release::Spectate(request, reply));
            }
            Message::Describe(reply) => self.releases.push(Release::Describe(reply)),
            Message::Close(secret, reply) => {
                if self.core.header().owner.matches(&secret) {
                    self.core.abort(now, AbortReason::Closed);
                    self.releases.push(Release::Closed(reply));
                } else {
                    answer(reply, None);
                }
            }
            Message::Abort(reason) => self.core.abort(now, reason),
            Message::Space => {}
        }
    }

    fn join(&mut self, now: Duration, request: JoinRequest) -> Result<Joined, JoinError> {
        let ticket = Token::random(self.core.header().room_id);
        let seat = self.core.join(
            now,
            request.seat,
            SeatedParticipant {
                name: request.name,
                kind: request.kind,
                ticket: ticket.hash(),
            },
        )?;
        Ok(Joined {
            seat,
            ticket,
            room: Box::new(convert::describe(&self.core)),
        })
    }

    fn attach(
        &mut self,
        now: Duration,
        request: Box<AttachRequest>,
        reply: oneshot::Sender<Option<(Seat, ConnectionId)>>,
    ) {
        let Some(seat) = self.core.seat_of_ticket(&request.secret) else {
            answer(reply, None);
            return;
        };
        let connection = ConnectionId(self.context.connections.fetch_add(1, Ordering::Relaxed));
        let handed = self.handed();
        self.core
            .attach(now, seat, connection, request.entropy.clone(), handed);
        self.releases
            .push(Release::Attach(request, seat, connection, reply));
    }

    fn lost(
        &mut self,
        now: Duration,
        seat: Seat,
        connection: ConnectionId,
        reason: Option<v1::DetachReason>,
    ) {
        if !self.is_current(seat, connection) {
            return;
        }
        let handed = self.handed();
        self.core.lost(now, seat, connection, handed);
        if let Some(mut attachment) = self.attachments[seat.index()].take()
            && let Some(reason) = reason
        {
            attachment.detach(reason);
        }
    }

    fn is_current(&self, seat: Seat, connection: ConnectionId) -> bool {
        self.attachments[seat.index()]
            .as_ref()
            .is_some_and(|attachment| attachment.connection() == connection)
    }

    fn perform(
        &mut self,
        now: Duration,
        seat: Seat,
        action: SeatAction,
        arrived: Instant,
    ) -> Acted {
        match action {
            SeatAction::Answer {
                decision_id,
                action,
                annotations,
                annotations_refused,
            } => {
                let handed = self.attachments[seat.index()]
                    .as_ref()
                    .and_then(|attachment| attachment.handed(decision_id));
                let answered: Answered = self.core.answer(
                    now,
                    AnswerInput {
                        seat,
                        decision_id,
                        action,
                        annotations,
                        annotations_refused,
                        arrived: arrived.saturating_duration_since(self.epoch),
                        handed,
                    },
                );
                Ok(Some(convert::answer_result(decision_id, action, answered)))
            }
            SeatAction::Express {
                record_only,
                expression,
            } => self
                .core
                .express(now, seat, record_only, expression)
                .map(|()| None),
            SeatAction::Resume => {
                self.core.resume(now, seat);
                Ok(None)
            }
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
        if self.spectators.len() >= MAX_SPECTATORS {
            return Err(SpectateError::Full);
        }
        let spectator = Spectator::new(&self.core, request.outbox, request.from, request.snapshot);
        self.spectators.push(spectator);
        Ok(())
    }

    /// Hands new changes to the store, awaits it, then tells everybody what they may know. `false` when the room must stop.
    async fn keep_and_tell(&mut self) -> bool {
        if !self.core.unkept().is_empty()
            && let Err(error) = self.journal.append(self.core.unkept()).await
        {
            self.fail(&error.to_string());
            return false;
        }
        let ends = self.core.state().is_over() && self.over_since.is_none();
        if ends && !self.conclude().await {
            return false;
        }
        self.public.follow(&self.core);
        let mut releases = std::mem::take(&mut self.releases);
        for release in releases.drain(..) {
            self.release(release);
        }
        self.releases = releases;
        self.deliver();
        if ends {
            // Whoever waits for games to end may close streams at once: everything has been put into them.
            self.context.watcher.game_over(self.core.header().room_id);
        }
        true
    }

    fn release(&mut self, release: Release) {
        match release {
            Release::Join(reply, joined) => answer(reply, joined),
            Release::Attach(request, seat, connection, reply) => {
                self.release_attach(*request, seat, connection, reply);
            }
            Release::Result(seat, connection, result) => {
                if let Some(attachment) = self.current(seat, connection) {
                    attachment.tell_result(result);
                }
            }
            Release::Refuse(seat, connection, refused) => {
                if let Some(attachment) = self.current(seat, connection) {
                    attachment.refuse(refused);
                }
            }
            Release::Acted(reply, acted) => answer(reply, Some(acted)),
            Release::Closed(reply) => answer(reply, Some(convert::describe(&self.core))),
            Release::Describe(reply) => answer(reply, convert::describe(&self.core)),
            Release::Spectate(request, reply) => answer(reply, self.spectate(*request)),
        }
    }

    fn release_attach(
        &mut self,
        request: AttachRequest,
        seat: Seat,
        connection: ConnectionId,
        reply: oneshot::Sender<Option<(Seat, ConnectionId)>>,
    ) {
        let mut attachment = Attachment::new(
            connection,
            request.outbox,
            request.handle,
            request.wishes,
            HandStamp::new(self.epoch),
            request.ended,
            Arc::clone(&self.on_space),
        );
        attachment.greet(&self.core, seat, request.request_id);
        let older = self.attachments[seat.index()].replace(attachment);
        if let Some(mut older) = older {
            older.detach(v1::DetachReason::Superseded);
        }
        let now = self.now;
        if let Some(attachment) = &mut self.attachments[seat.index()] {
            attachment.deliver(&self.core, &self.public, seat, now, true);
        }
        answer(reply, Some((seat, connection)));
    }

    fn current(&mut self, seat: Seat, connection: ConnectionId) -> Option<&mut Attachment> {
        self.attachments[seat.index()]
            .as_mut()
            .filter(|attachment| attachment.connection() == connection)
    }

    fn deliver(&mut self) {
        let now = self.now;
        let news = self.core.log().since(self.delivered);
        for seat in self.core.all_seats() {
            if let Some(attachment) = &mut self.attachments[seat.index()] {
                let urgent = news.iter().any(|entry| is_urgent(&entry.happening, seat));
                attachment.deliver(&self.core, &self.public, seat, now, urgent);
            }
        }
        self.delivered = self.core.log().len();
        let (core, on_space) = (&self.core, &self.on_space);
        self.spectators
            .retain_mut(|spectator| spectator.deliver(core, on_space));
    }

    /// The game has ended: the store is told, the record is written.
    async fn conclude(&mut self) -> bool {
        self.over_since = Some(self.now);
        let header = Arc::clone(self.core.header());
        if let Err(error) = self.journal.finish().await {
            self.fail(&error.to_string());
            return false;
        }
        info!(
            room = %header.room_id,
            game = %header.game_id,
            finished = self.core.state() == State::Finished,
            decisions = self.core.decisions(),
            "the game has ended"
        );
        // A room in which nothing was ever dealt leaves no record.
        if let (Some(data_dir), true) = (&self.context.data_dir, self.core.game().is_some()) {
            let write = write_record(
                Arc::clone(&self.context.store),
                header.game_id,
                data_dir.clone(),
            );
            self.context.tracker.spawn(write);
        }
        true
    }

    /// The store has failed: nobody is told of what may not be kept; everybody is told that the room has stopped.
    fn fail(&mut self, error: &str) {
        error!(room = %self.core.header().room_id, error, "the room stops because its store failed");
        self.releases.clear();
        for attachment in self.attachments.iter_mut().flatten() {
            attachment.detach(v1::DetachReason::RoomFailed);
        }
        for spectator in self.spectators.drain(..) {
            spectator.fail();
        }
    }
}

async fn write_record(store: Arc<dyn Store>, game: Id, data_dir: PathBuf) {
    let kept = match store.finished(game).await {
        Ok(Some(kept)) => kept,
        Ok(None) => return,
        Err(error) => {
            error!(%game, %error, "the record is not written");
            return;
        }
    };
    let written = tokio::task::spawn_blocking(move || {
        let (header, journal) = kept;
        let lines = convert::record_lines(&header, &journal);
        let path = chefshat_records::jsonl::path_of(&data_dir, &game.to_string());
        chefshat_records::jsonl::write(&path, &lines).map(|()| path)
    })
    .await;
    match written {
        Ok(Ok(path)) => info!(%game, path = %path.display(), "the record is written"),
        Ok(Err(error)) => error!(%game, %error, "the record is not written"),
        Err(error) => error!(%game, %error, "the record is not written"),
    }
}

/// Answers a caller. One that is no longer there does not want to know.
fn answer<T>(reply: oneshot::Sender<T>, answer: T) {
    let _ = reply.send(answer);
}
