//! The heart of a room: `(state, input, now) → changes and answers`, without async or IO. Timeouts, invalid attempts, substitution and
//! reconnection are decided here and nowhere else. Time is told by the caller as the time since the room was created.
//!
//! An input (`inputs`, `clock`) checks what it is given against the state and states what follows as changes; a change (`fold`) alters the
//! state and the log, and can be folded again later to the same effect. That is how a game is replayed from its journal.

mod answers;
mod clock;
mod fold;
pub mod ids;
mod inputs;
pub mod journal;
pub mod log;
pub mod policy;
mod revive;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::BuiltInAgent;
use chefshat_engine::{
    ActionId, Decision, Event, Game, Mask, Observation, Requirement, Seat, Viewer,
};

pub use answers::{Answer, Answered, ExpressError, JoinError, LeaveError, SeatStanding, Verdict};

pub use revive::BadJournal;

use crate::ids::SecretHash;
use crate::journal::{AbortReason, Change, Entry, Fill, GameHeader, SeatedParticipant};
use crate::log::Log;

/// A joined seat whose ticket is not attached within this time is freed, before the game begins.
pub const JOIN_HOLD: Duration = Duration::from_secs(120);
/// The clock of a decision starts at the latest this long after the decision was released, even if the transport has not taken it.
pub const MAX_HANDOVER: Duration = Duration::from_secs(5);
/// After a restart of the server the clock of a decision waits this long for its seat to be attached again.
pub const RECALL_TIME: Duration = Duration::from_secs(60);
/// A seat that has had to wait this long for the store is given the time back. Shorter waits are part of every answer; were they given
/// back as well, wrong answers would buy time.
const SLOW_STORE: Duration = Duration::from_millis(100);
/// How often to ask whether the transport has taken a request whose deadline would have passed.
const LOOK_AGAIN: Duration = Duration::from_millis(20);
/// Most annotations recorded per seat and game, bytes.
pub const MAX_ANNOTATION_BYTES_PER_GAME: usize = 256 * 1024;
/// Most annotations recorded per decision, bytes.
pub const MAX_ANNOTATION_BYTES: usize = 4 * 1024;
/// Most expressions of one seat in one game.
pub const MAX_EXPRESSIONS_PER_SEAT: u32 = 10_000;
/// Most events of lost and new connections of one seat in one game; later ones are not told.
pub const MAX_CONNECTION_EVENTS: u32 = 1_000;

/// Seats taken in a room, those counted that were given back: each stays in its log.
pub const MAX_SEATINGS: usize = 1_000;
/// Invalid attempts at one decision after which the default is taken even where they are unlimited: a record must hold them.
pub const MAX_ATTEMPTS: u32 = 10_000;
/// Most changes of one game; beyond it the game is aborted.
pub const MAX_GAME_CHANGES: u64 = 2_000_000;
/// Decisions a room's built-in agents take before it looks at its mailbox again.
pub const BUILT_IN_BUDGET: usize = 256;
/// A recorded player compares what it sees with all it has seen: one decision of it counts as so many.
const REPLAY_COST: usize = 32;

/// Where a room stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Seats are free or not attached.
    Waiting,
    /// The game is being played.
    Playing,
    /// The game has ended with a result.
    Finished,
    /// The game has ended without one.
    Aborted(AbortReason),
}

impl State {
    /// Whether the game has ended, one way or the other.
    pub fn is_over(self) -> bool {
        matches!(self, Self::Finished | Self::Aborted(_))
    }
}

/// A connection of a seat: each attachment has its own number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConnectionId(pub u64);

/// The state of a room.
#[derive(Debug)]
pub struct Core {
    header: Arc<GameHeader>,
    state: State,
    seats: Vec<SeatState>,
    game: Option<Box<Game>>,
    entropy: Vec<Vec<u8>>,
    open: Option<OpenDecision>,
    log: Log,
    /// Length of the log when the game had begun and nothing was dealt yet.
    log_before_deal: usize,
    /// Length of the log after the deal and after each decision; kept where spectators are delayed.
    log_after_decision: Vec<u32>,
    changes: u64,
    decisions: u64,
    /// When the server was last restarted.
    restarted: Option<Duration>,
    /// Changes that have been folded and not yet been handed to the store.
    pending: Vec<Entry>,
    /// Room for the events of one action.
    events: Vec<Event>,
}

#[derive(Debug)]
struct SeatState {
    fill: Fill,
    participant: Option<Box<SeatedParticipant>>,
    joined_at: Duration,
    ever_attached: bool,
    connection: Option<ConnectionId>,
    entropy: Vec<u8>,
    /// Whether everybody was told that the agent is away.
    away: bool,
    /// Whether it has not been attached since the server was restarted.
    recalled: bool,
    connection_events: u32,
    expressions: u32,
    agent: Option<Box<BuiltInAgent>>,
    substituted: bool,
    ever_substituted: bool,
    decisions: u64,
    timeouts: u32,
    bank_left: Duration,
    annotation_bytes: usize,
    last_answer: Option<LastAnswer>,
}

#[derive(Debug)]
struct LastAnswer {
    decision_id: u64,
    action: u32,
    answered: Answered,
}

/// The decision that is open.
#[derive(Debug, Clone)]
pub struct OpenDecision {
    /// Whose and what.
    pub decision: Decision,
    /// Number of the decision, per seat, from 1.
    pub id: u64,
    /// When it was opened or, for a seat that came back from a substitute, given back.
    released: Duration,
    /// Whether it has been kept, so that its seat may be told: from then on nothing moves its release.
    announced: bool,
    /// When its clock began, once that is settled.
    start: Option<Duration>,
    /// When to ask again whether the transport has taken the request; zero before it was asked.
    look_again: Duration,
    /// Since when its seat waits for our word: on an answer that is refused, or on a new connection.
    paused_since: Option<Duration>,
    /// Actions refused so far.
    attempts: u32,
}

impl OpenDecision {
    /// Opens it once more, with all its time.
    fn release_anew(&mut self, at: Duration) {
        self.released = at;
        self.announced = false;
        self.start = None;
        self.look_again = Duration::ZERO;
    }
}

impl Core {
    /// A room whose seats are free.
    pub fn new(header: Arc<GameHeader>) -> Self {
        let seats = header
            .fills
            .iter()
            .enumerate()
            .map(|(index, fill)| {
                let built_in =
                    |kind| Box::new(BuiltInAgent::new(kind, header.seed.agent_seed(index)));
                SeatState {
                    fill: *fill,
                    participant: None,
                    joined_at: Duration::ZERO,
                    ever_attached: false,
                    connection: None,
                    entropy: Vec::new(),
                    away: false,
                    recalled: false,
                    connection_events: 0,
                    expressions: 0,
                    agent: match fill {
                        Fill::BuiltIn(kind) => Some(built_in(*kind)),
                        Fill::Replay(_) => header
                            .recorded
                            .get(&index)
                            .map_or_else(
                                // Whose record is gone is played for as if it had been lost.
                                || built_in(header.policy.substitute),
                                |player| Box::new(BuiltInAgent::replay(Arc::clone(player))),
                            )
                            .into(),
                        Fill::Open { .. } => None,
                    },
                    substituted: false,
                    ever_substituted: false,
                    decisions: 0,
                    timeouts: 0,
                    bank_left: header.policy.bank,
                    annotation_bytes: 0,
                    last_answer: None,
                }
            })
            .collect();
        Self {
            header,
            state: State::Waiting,
            seats,
            game: None,
            entropy: Vec::new(),
            open: None,
            log: Log::default(),
            log_before_deal: 0,
            log_after_decision: Vec::new(),
            changes: 0,
            decisions: 0,
            restarted: None,
            pending: Vec::new(),
            events: Vec::new(),
        }
    }

    /// A room as it stood after the entries of a journal.
    pub fn replay(header: Arc<GameHeader>, journal: &[Entry]) -> Self {
        let mut core = Self::new(header);
        for entry in journal {
            core.refold(entry);
        }
        core
    }

    /// Folds an entry of a journal that follows on what has been folded before.
    pub fn refold(&mut self, entry: &Entry) {
        self.fold(entry.at, &entry.change);
    }

    /// What stands about the game from before it began.
    pub fn header(&self) -> &Arc<GameHeader> {
        &self.header
    }

    /// Where the room stands.
    pub fn state(&self) -> State {
        self.state
    }

    /// What has happened.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// The game, once it has begun.
    pub fn game(&self) -> Option<&Game> {
        self.game.as_deref()
    }

    /// The decision that is open.
    pub fn open(&self) -> Option<&OpenDecision> {
        self.open.as_ref()
    }

    /// The open decision if it is put to a seat's own agent, not to a built-in one or a substitute.
    pub fn awaited(&self) -> Option<&OpenDecision> {
        self.open
            .as_ref()
            .filter(|open| !self.is_automatic(open.decision.seat))
    }

    fn awaited_from(&self, seat: Seat) -> Option<&OpenDecision> {
        self.awaited().filter(|open| open.decision.seat == seat)
    }

    /// Invalid attempts left for the open decision; `None` when unlimited.
    pub fn attempts_left(&self) -> Option<u32> {
        let made = self.open.as_ref().map_or(0, |open| open.attempts);
        self.header
            .policy
            .max_invalid_attempts
            .map(|limit| limit.saturating_sub(made))
    }

    /// Invalid attempts after which the default decision is taken.
    fn attempts_limit(&self) -> u32 {
        self.header
            .policy
            .max_invalid_attempts
            .unwrap_or(MAX_ATTEMPTS)
    }

    /// Whether a substitute has played for any seat.
    pub fn was_substituted(&self) -> bool {
        self.seats.iter().any(|seat| seat.ever_substituted)
    }

    /// Number of decisions taken.
    pub fn decisions(&self) -> u64 {
        self.decisions
    }

    /// What the seats added to the game seed, once the game has begun.
    pub fn entropy(&self) -> &[Vec<u8>] {
        &self.entropy
    }

    /// The seats of the room.
    pub fn all_seats(&self) -> impl Iterator<Item = Seat> + use<> {
        (0..self.seats.len()).map(Seat::new)
    }

    /// How a seat stands, as everybody may know it.
    pub fn standing(&self, seat: Seat) -> SeatStanding<'_> {
        let state = &self.seats[seat.index()];
        SeatStanding {
            fill: state.fill,
            participant: state.participant.as_deref(),
            connected: state.connection.is_some(),
            substituted: state.substituted,
        }
    }

    /// What a viewer may know of the game.
    pub fn observe(&self, viewer: Viewer) -> Option<Observation> {
        self.game().map(|game| game.observe(viewer))
    }

    /// Legal actions of the open decision.
    pub fn legal_actions(&self) -> Mask {
        self.game().map(Game::legal_actions).unwrap_or_default()
    }

    /// What the rules require of the open decision.
    pub fn requirement(&self) -> Option<Requirement> {
        self.game().and_then(Game::requirement)
    }

    /// The default decision.
    pub fn default_action(&self) -> Option<ActionId> {
        self.game().and_then(Game::default_action)
    }

    /// The seat a ticket's secret belongs to, in constant time for each seat.
    pub fn seat_of_ticket(&self, secret: &[u8]) -> Option<Seat> {
        let hash = SecretHash::of(secret);
        self.all_seats().find(|seat| {
            self.seats[seat.index()]
                .participant
                .as_ref()
                .is_some_and(|participant| participant.ticket.is(&hash))
        })
    }

    /// How many events of the log a spectator may see.
    pub fn visible_to_spectators(&self) -> usize {
        let delay = self.header.policy.spectator_delay_decisions;
        if delay == 0 || self.state.is_over() {
            return self.log.len();
        }
        if self.state == State::Waiting {
            return self.log.len();
        }
        self.log_after_decision
            .len()
            .checked_sub(delay + 1)
            .map_or(self.log_before_deal, |index| {
                usize::try_from(self.log_after_decision[index]).unwrap_or(usize::MAX)
            })
    }

    /// Whether a built-in agent decides for the seat, its own or a substitute.
    fn is_automatic(&self, seat: Seat) -> bool {
        let state = &self.seats[seat.index()];
        state.substituted || state.fill.is_built_in()
    }

    /// Changes that have been made and are not kept yet, for the store, which empties this. They have been folded already; nobody may be
    /// told before they are kept.
    pub fn pending(&mut self) -> &mut Vec<Entry> {
        &mut self.pending
    }

    /// The changes so far have been kept, and what is open is told now: its time begins now, whatever the store took. If it was told
    /// before, the time is given back in which its seat could do nothing but wait for the store.
    pub fn released(&mut self, now: Duration) {
        let Some(open) = &mut self.open else { return };
        if !open.announced {
            open.announced = true;
            open.released = open.released.max(now);
        }
        if let (Some(since), Some(start)) = (open.paused_since.take(), &mut open.start) {
            let waited = now.saturating_sub(since.max(*start));
            if waited >= SLOW_STORE {
                *start += waited;
            }
        }
    }

    fn commit(&mut self, now: Duration, change: Change) {
        self.fold(now, &change);
        self.pending.push(Entry { at: now, change });
    }

    fn action_from(number: u32) -> ActionId {
        // What does not fit is out of range of every action space, and is refused as that.
        ActionId::new(u16::try_from(number).unwrap_or(u16::MAX))
    }
}
