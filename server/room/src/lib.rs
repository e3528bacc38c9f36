//! The core of a room: `(state, input, now) → changes and answers`, without async or IO. It alone
//! decides timeouts, invalid attempts, substitution and reconnection. Callers pass the time since
//! the room was created.
//!
//! An input (`inputs`, `clock`) is checked against the state and turned into changes. Folding a
//! change (`fold`) updates the state and the log, always with the same effect: a game is replayed
//! from its journal by folding its changes again.

mod absence;
mod answers;
mod clock;
mod fold;
pub mod ids;
mod inputs;
pub mod journal;
mod limits;
pub mod log;
mod markers;
mod physical;
pub mod policy;
mod revive;
mod search;
mod table;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::{BuiltInAgent, NamedAgent};
use chefshat_engine::{
    ActionId, Decision, DecisionKind, Event, Game, Mask, Observation, OwnChoices, Requirement,
    Seat, Viewer,
};

pub use absence::Awaited;
pub use answers::{
    Answer, Answered, ExpressError, Expression, HintError, JoinError, LeaveError, ReportError,
    ReportOutcome, ReportVerdict, SeatStanding, Verdict,
};

pub use journal::Marker;
pub use limits::{
    BUILT_IN_BUDGET, CONFIRMATION_TIME, JOIN_HOLD, MARKERS_AT_ONCE, MARKERS_PER_SECOND,
    MAX_ANNOTATION_BYTES, MAX_ANNOTATION_BYTES_PER_GAME, MAX_ATTEMPTS, MAX_CONNECTION_EVENTS,
    MAX_EVENTS_KEPT, MAX_EXPRESSIONS_PER_SEAT, MAX_GAME_CHANGES, MAX_GATEWAY_DELAY, MAX_HANDOVER,
    MAX_HINTS, MAX_IDLE, MAX_MARKER_AHEAD, MAX_MARKERS, MAX_REPORTS, MAX_SEARCH_TIME, MAX_SEATINGS,
    RECALL_TIME, SEARCH_PATIENCE, SEARCH_PATIENCE_UNATTENDED,
};
pub use markers::MarkError;
pub use revive::BadJournal;
pub use search::SearchRequest;
pub use table::{Made, PhysicalTable};

use limits::{RECHECK_INTERVAL, REPLAY_COST, SLOW_STORE};

use crate::ids::SecretHash;
use crate::journal::{AbortReason, Change, Entry, Fill, GameHeader, SeatedParticipant};
use crate::log::Log;
use crate::table::RoomGame;

/// The state of a room.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Waiting for seats to be taken and attached.
    Waiting,
    /// The game is being played.
    Playing,
    /// The game has ended with a result.
    Finished,
    /// The game has ended without a result.
    Aborted(AbortReason),
}

impl State {
    /// Whether the game has ended, with or without a result.
    pub fn is_over(self) -> bool {
        matches!(self, Self::Finished | Self::Aborted(_))
    }
}

/// The number of a connection. Each attachment of a seat has its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConnectionId(pub u64);

/// A room: its header, seats, game and log.
#[derive(Debug)]
pub struct Core {
    header: Arc<GameHeader>,
    state: State,
    seats: Vec<SeatState>,
    game: Option<RoomGame>,
    entropy: Vec<Vec<u8>>,
    open: Option<OpenDecision>,
    /// Since when everybody knows that the game waits, in a silence: the start of a Shift, in
    /// which nobody may know whether somebody decides about a special action. It lasts from the
    /// roles to the first gift of a participant, or to the next event of the game.
    silent_since: Option<Duration>,
    log: Log,
    /// Length of the log before the first deal.
    log_before_deal: usize,
    /// Position in the log of the first event of the Shift in progress; 0 before the first Shift.
    shift_start: usize,
    /// Length of the log after the deal and after each decision. Empty unless spectators are
    /// delayed.
    log_after_decision: VecDeque<u32>,
    changes: u64,
    /// How many participants have taken a seat.
    seatings: usize,
    decisions: u64,
    markers: Vec<Marker>,
    /// When there is space for another marker after a burst of them.
    marker_free_at: Duration,
    /// Whether a seat was connected through another server, since this one has the room.
    expects_delays: bool,
    /// When the server was last restarted.
    restarted: Option<Duration>,
    /// Changes that have been folded but not yet passed to the store.
    pending: Vec<Entry>,
    /// Buffer for the events of one action.
    events: Vec<Event>,
}

#[derive(Debug)]
struct SeatState {
    fill: Fill,
    participant: Option<Box<SeatedParticipant>>,
    joined_at: Duration,
    ever_attached: bool,
    connection: Option<ConnectionId>,
    /// When the last connection was lost.
    lost_at: Duration,
    /// How late answers of the connection may arrive because another server measures their time.
    grace: Duration,
    entropy: Vec<u8>,
    /// Whether the loss of the agent's connection has been published.
    away: bool,
    /// Since when it is away because of a server: all of them restarted, or that of its connection
    /// was lost. `None` once it is attached again.
    recalled: Option<Duration>,
    connection_events: u32,
    expressions: u32,
    /// The built-in agent of the seat or its substitute. Of one that searches: what it plays
    /// without a search.
    agent: Option<Box<BuiltInAgent>>,
    substituted: bool,
    ever_substituted: bool,
    /// Whether its participant leaves for good, as soon as that reveals nothing.
    retiring: bool,
    /// Whether its participant has left for good.
    retired: bool,
    ever_hinted: bool,
    /// Whose decisions those of its participant were.
    choices: OwnChoices,
    decisions: u64,
    /// Timeouts since the agent's last valid answer in time. Silent decisions do not count.
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

/// The search for an open decision.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Search {
    /// Not started.
    NotStarted,
    /// Started, and not ended.
    Running,
    /// Ended.
    Ended(Searched),
}

impl Search {
    /// What was found, if it has ended.
    fn found(&self) -> Searched {
        match self {
            Self::NotStarted | Self::Running => Searched::default(),
            Self::Ended(searched) => searched.clone(),
        }
    }
}

/// How a search ended.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Searched {
    /// What was found. Without it, the agent plays as if it did not search.
    pub action: Option<ActionId>,
    /// Recorded with the decision: the message `chefshat.v1.Annotations`, encoded.
    pub annotations: Option<Box<[u8]>>,
}

/// An open decision.
#[derive(Debug, Clone)]
pub struct OpenDecision {
    /// The seat and the kind.
    pub decision: Decision,
    /// Number of the decision, per seat, from 1.
    pub id: u64,
    /// When it was opened, or given back to a seat that returned from a substitute.
    released: Duration,
    /// Whether it has been committed and its seat may learn of it. From then on its release time is
    /// fixed.
    announced: bool,
    /// Until when nobody learns of it: the phase of special actions lasts as long as if somebody
    /// were offered one. `None` once that is over.
    held_until: Option<Duration>,
    /// When its clock started, once determined.
    start: Option<Duration>,
    /// When to check again whether the transport has received the request; zero before the first
    /// check.
    recheck_at: Duration,
    /// Since when the clock is paused: the seat waits for the server after an invalid answer, or on
    /// a new connection.
    paused_since: Option<Duration>,
    /// How long its seat was not connected, in absences that have ended.
    absent: Duration,
    /// How much of them the bank does not pay for, although it was beyond the decision time.
    unbanked: Duration,
    /// Invalid attempts so far.
    attempts: u32,
    /// The search for it, if an agent that searches takes it.
    search: Search,
    /// Hints that its seat was given.
    hints: u32,
    /// Whether a hint is being computed.
    hint_runs: bool,
}

impl OpenDecision {
    /// Whether nobody but its seat may learn that it is taken: a special action, which only the
    /// seat with both jokers is offered. Only a declared one becomes public.
    fn is_silent(&self) -> bool {
        self.decision.kind == DecisionKind::SpecialAction
    }

    /// Keeps it from its seat until the phase of special actions is over, unless it is part of that
    /// phase.
    fn hold(&mut self, until: Option<Duration>) {
        self.held_until = until.filter(|_| !self.is_silent());
        self.released = self.released.max(self.held_until.unwrap_or_default());
    }

    /// Its clock has not started, and its seat was not away from it.
    fn forget_start(&mut self) {
        self.start = None;
        self.recheck_at = Duration::ZERO;
        self.absent = Duration::ZERO;
        self.unbanked = Duration::ZERO;
    }

    /// Opens the decision again, with its full time.
    fn reopen(&mut self, at: Duration) {
        self.released = at;
        self.announced = false;
        self.forget_start();
        self.search = Search::NotStarted;
    }
}

impl Core {
    /// Creates a room with free seats.
    pub fn new(header: Arc<GameHeader>) -> Self {
        let seats = header
            .fills
            .iter()
            .enumerate()
            .map(|(index, fill)| {
                let built_in = |agent: NamedAgent| {
                    let seed = header.seed.agent_seed(index);
                    Box::new(BuiltInAgent::new(agent.without_search(), seed))
                };
                SeatState {
                    fill: *fill,
                    participant: None,
                    joined_at: Duration::ZERO,
                    ever_attached: false,
                    connection: None,
                    lost_at: Duration::ZERO,
                    grace: Duration::ZERO,
                    entropy: Vec::new(),
                    away: false,
                    recalled: None,
                    connection_events: 0,
                    expressions: 0,
                    agent: match fill {
                        Fill::BuiltIn(agent) => Some(built_in(*agent)),
                        Fill::Replay(_) => header
                            .recorded
                            .get(&index)
                            .map_or_else(
                                // If the record is gone, a substitute plays, as for a lost agent.
                                || built_in(header.policy.substitute),
                                |player| Box::new(BuiltInAgent::replay(Arc::clone(player))),
                            )
                            .into(),
                        Fill::Open { .. } | Fill::AtTable(_) => None,
                    },
                    substituted: false,
                    ever_substituted: false,
                    retiring: false,
                    retired: false,
                    ever_hinted: false,
                    choices: OwnChoices::default(),
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
            silent_since: None,
            log: Log::default(),
            log_before_deal: 0,
            shift_start: 0,
            log_after_decision: VecDeque::new(),
            changes: 0,
            seatings: 0,
            decisions: 0,
            markers: Vec::new(),
            marker_free_at: Duration::ZERO,
            expects_delays: false,
            restarted: None,
            pending: Vec::new(),
            events: Vec::new(),
        }
    }

    /// Restores a room from the entries of a journal.
    pub fn replay(header: Arc<GameHeader>, journal: &[Entry]) -> Self {
        let mut core = Self::new(header);
        for entry in journal {
            core.refold(entry);
        }
        core
    }

    /// Folds the next entry of a journal.
    pub fn refold(&mut self, entry: &Entry) {
        self.fold(entry.at, &entry.change);
    }

    /// The header: everything that was fixed before the game began.
    pub fn header(&self) -> &Arc<GameHeader> {
        &self.header
    }

    /// The state of the room.
    pub fn state(&self) -> State {
        self.state
    }

    /// The events so far.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// Drops events before a position, unless the table is physical: its events can be corrected.
    /// Those of the Shift in progress stay: searches need them, however much is expressed meanwhile.
    /// So do those that delayed spectators have not seen.
    pub fn drop_log_before(&mut self, position: usize) {
        let needed = match self.state.is_over() {
            true => self.log.len(),
            false => self.shift_start,
        };
        if self.table().is_none() {
            let needed = needed.min(self.visible_to_spectators());
            self.log.drop_before(position.min(needed));
        }
    }

    /// The game, once it has started.
    pub fn game(&self) -> Option<&Game> {
        self.game.as_ref().map(RoomGame::game)
    }

    /// The open decision.
    pub fn open(&self) -> Option<&OpenDecision> {
        self.open.as_ref()
    }

    /// The open decision, if the seat's own agent takes it rather than a built-in agent or
    /// substitute.
    pub fn awaited(&self) -> Option<&OpenDecision> {
        self.open.as_ref().filter(|open| {
            open.held_until.is_none()
                && !self.is_automatic(open.decision.seat)
                && self.next_taken_over().is_none()
        })
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

    /// Whether the participant of a seat did not play to the end by itself: a substitute or too often its
    /// own fallback played for it, it was given a hint, or it was gone when the game was broken off.
    pub fn has_forfeited(&self, seat: Seat) -> bool {
        let state = &self.seats[seat.index()];
        // After a restart all are away until they have attached again.
        let is_away = state.away && !self.is_away_since_restart(seat);
        let is_gone = match self.state {
            State::Aborted(AbortReason::Closed) => is_away,
            State::Aborted(AbortReason::ParticipantsLost) => {
                is_away || state.timeouts >= self.header.policy.max_timeouts
            }
            _ => false,
        };
        state.ever_substituted
            || state.ever_hinted
            || !state.choices.are_own()
            || (is_gone && state.participant.is_some())
    }

    /// Whether any seat was given a hint.
    pub fn was_hinted(&self) -> bool {
        self.seats.iter().any(|seat| seat.ever_hinted)
    }

    /// Number of changes.
    pub fn changes(&self) -> u64 {
        self.changes
    }

    /// Number of decisions taken, in a physical room only those of participants and built-in
    /// agents.
    pub fn decisions(&self) -> u64 {
        self.decisions
    }

    /// The seats' contributions to the game seed, once the game has started.
    pub fn entropy(&self) -> &[Vec<u8>] {
        &self.entropy
    }

    /// The seats of the room.
    pub fn all_seats(&self) -> impl Iterator<Item = Seat> + use<> {
        (0..self.seats.len()).map(Seat::new)
    }

    /// The display name of a seat; empty while it is free.
    pub fn name_of(&self, seat: Seat) -> String {
        let SeatStanding {
            fill, participant, ..
        } = self.standing(seat);
        if let Some(participant) = participant {
            return participant.name.clone();
        }
        if let Some(name) = self.header.display_names.get(&seat.index()) {
            return name.clone();
        }
        match fill {
            Fill::BuiltIn(agent) => agent.name(),
            // Named after the agent, which is what the reader of a record wants to know.
            Fill::Replay(player) => {
                let game = player.game.to_string();
                format!("{} {}:{}", BuiltInAgent::REPLAY, &game[..8], player.seat)
            }
            Fill::Open { .. } | Fill::AtTable(_) => String::new(),
        }
    }

    /// The public state of a seat.
    pub fn standing(&self, seat: Seat) -> SeatStanding<'_> {
        let state = &self.seats[seat.index()];
        SeatStanding {
            fill: state.fill,
            participant: state.participant.as_deref(),
            connected: state.connection.is_some(),
            substituted: state.substituted,
        }
    }

    /// Whether a substitute plays for a hidden seat. No event shows it.
    pub fn is_substituted_unseen(&self, seat: Seat) -> bool {
        self.seats[seat.index()].substituted && self.header.is_hidden(seat)
    }

    /// The observation of a viewer. At a physical table it has only known cards.
    pub fn observe(&self, viewer: Viewer) -> Option<Observation> {
        self.game.as_ref().map(|game| game.observe(viewer))
    }

    /// Legal actions of the open decision.
    pub fn legal_actions(&self) -> Mask {
        self.game().map(Game::legal_actions).unwrap_or_default()
    }

    /// The requirement of the rules for the open decision.
    pub fn requirement(&self) -> Option<Requirement> {
        self.game().and_then(Game::requirement)
    }

    /// The default decision.
    pub fn default_action(&self) -> Option<ActionId> {
        self.game().and_then(Game::default_action)
    }

    /// The seat with this ticket, unless its participant has left for good. Compares in constant
    /// time for each seat.
    pub fn seat_of_ticket(&self, secret: &[u8]) -> Option<Seat> {
        let hash = SecretHash::of(secret);
        self.all_seats().find(|seat| {
            let state = &self.seats[seat.index()];
            let participant = state.participant.as_ref();
            let is_its = participant.is_some_and(|participant| participant.ticket.is(&hash));
            is_its && !state.retiring && !state.retired
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
        let shown = self.log_after_decision.front();
        let shown = shown.filter(|_| self.log_after_decision.len() > delay);
        shown.map_or(self.log_before_deal, |length| {
            usize::try_from(*length).unwrap_or(usize::MAX)
        })
    }

    /// Whether a built-in agent or a substitute decides for the seat.
    fn is_automatic(&self, seat: Seat) -> bool {
        let state = &self.seats[seat.index()];
        state.substituted || state.fill.is_built_in()
    }

    /// Whether a built-in agent or a substitute decides for the seat, for all that anybody may
    /// know: one may play in every hidden seat.
    fn seems_automatic(&self, seat: Seat) -> bool {
        self.is_automatic(seat) || self.header.is_hidden(seat)
    }

    /// Changes that are folded but not committed. The store removes them. They must not be
    /// published before they are committed.
    pub fn pending(&mut self) -> &mut Vec<Entry> {
        &mut self.pending
    }

    /// Called when all changes have been committed and the open decision is published. Its clock
    /// starts now, however long the commit took. If it was published before, its seat gets back the
    /// time it spent waiting for the store.
    pub fn released(&mut self, now: Duration) {
        let Some(open) = &mut self.open else { return };
        if !open.announced && open.held_until.is_none() {
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
        // A number that does not fit is outside every action space and is refused as such.
        ActionId::new(u16::try_from(number).unwrap_or(u16::MAX))
    }
}
