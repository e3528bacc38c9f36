//! The shell around a room's core: a task that receives from a bounded mailbox, arms one deadline, and for every batch of inputs lets the
//! core apply them, hands the changes to the store, awaits it, and only then tells anybody. Nothing is decided here.

mod inputs;
mod outputs;

use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::Sleep;
use tokio_util::task::TaskTracker;
use tracing::debug;

use self::outputs::Release;
use crate::config::ROOM_MAILBOX;
use crate::filing::Filing;
use crate::grpc::status;
use crate::outbox::OnSpace;
use crate::room::RoomClock;
use crate::room::delivery::{Attachment, PublicLog};
use crate::room::handle::{Handle, Message, TellSpace};
use crate::room::spectators::Spectator;
use crate::store::{Journal, Store};
use chefshat_room::Core;
use chefshat_room::ids::Id;

/// Inputs that are applied before the store is asked once for all of them.
const INPUTS_PER_COMMIT: usize = 64;

/// What a room needs from its server.
#[derive(Clone)]
pub struct TaskContext {
    /// Where games are kept.
    pub store: Arc<dyn Store>,
    /// Writes records to files.
    pub filing: Filing,
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

/// Starts a room, whose game may have begun before. `over_since`: the game is over, and everything that follows from that has been done.
pub fn go_on(
    core: Core,
    clock: RoomClock,
    over_since: Option<Duration>,
    journal: Box<dyn Journal>,
    context: TaskContext,
) -> Handle {
    let (mailbox, inbox) = mpsc::channel(ROOM_MAILBOX);
    let handle = Handle {
        id: core.header().room_id,
        mailbox: mailbox.clone(),
    };
    let seats = core.header().fills.len();
    let task = Task {
        core,
        journal,
        now: clock.now(),
        clock,
        attachments: (0..seats).map(|_| None).collect(),
        spectators: Vec::new(),
        on_space: Arc::new(TellSpace(mailbox.downgrade())),
        releases: Vec::new(),
        public: PublicLog::default(),
        delivered: 0,
        over_since,
        put_down: false,
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
    clock: RoomClock,
    /// The time of the inputs in hand.
    now: Duration,
    attachments: Vec<Option<Attachment>>,
    spectators: Vec<Spectator>,
    on_space: Arc<dyn OnSpace>,
    releases: Vec<Release>,
    public: PublicLog,
    /// Length of the log when everybody had last been looked after.
    delivered: usize,
    over_since: Option<Duration>,
    /// The room ends without its game being over, which goes on when the server is back.
    put_down: bool,
    context: TaskContext,
}

impl Task {
    async fn run(mut self, mut inbox: mpsc::Receiver<Message>) {
        let _gone = TellGone {
            room: self.core.header().room_id,
            watcher: Arc::clone(&self.context.watcher),
        };
        self.core.begin_if_all_built_in(self.now);
        let mut messages = Vec::with_capacity(INPUTS_PER_COMMIT);
        let alarm = tokio::time::sleep_until(self.clock.instant(self.now));
        tokio::pin!(alarm);
        let mut armed = true;
        loop {
            if !self.keep_and_tell().await {
                break;
            }
            if self.put_down && self.over_since.is_none() {
                self.end_streams(&status::shutting_down());
                break;
            }
            armed = self.arm(alarm.as_mut(), armed);
            tokio::select! {
                biased;
                received = inbox.recv_many(&mut messages, INPUTS_PER_COMMIT) => {
                    if received == 0 {
                        break;
                    }
                    self.now = self.clock.now();
                    for message in messages.drain(..) {
                        self.receive(message);
                    }
                    // A mailbox that is never empty does not stop the clock.
                    let due = armed && self.clock.at(alarm.deadline()) <= self.now;
                    if due && !self.ring(&mut armed) {
                        break;
                    }
                }
                () = alarm.as_mut(), if armed => {
                    self.now = self.clock.now();
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
        let deadline = self.clock.instant(deadline);
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
}
