//! The limits of a room: times, counts and sizes.

use std::time::Duration;

use chefshat_engine::limits::MIN_PACE_OF_PHASE_MS;
pub use chefshat_engine::limits::{
    MAX_ANNOTATION_BYTES, MAX_ANNOTATION_BYTES_PER_GAME, MAX_ATTEMPTS, MAX_CONNECTION_EVENTS,
    MAX_HINTS,
};

/// How long the search for a decision may wait for a thread.
pub const SEARCH_PATIENCE: Duration = Duration::from_secs(2);
/// The same in a game that nobody plays.
pub const SEARCH_PATIENCE_UNATTENDED: Duration = Duration::from_secs(300);
/// The decision is taken without a search that has not ended this long after its patience.
pub const MAX_SEARCH_TIME: Duration = Duration::from_secs(10);
/// Before the game starts, a seat becomes free again if its ticket is not attached within this
/// time.
pub const JOIN_HOLD: Duration = Duration::from_secs(120);
/// The clock of a decision starts at most this long after its release, even if the transport has
/// not received the request.
pub const MAX_HANDOVER: Duration = Duration::from_secs(5);
/// How late an answer that was measured by another server may arrive, and how much of its time the
/// network between the servers may have cost. Longer than servers need to notice that they are cut
/// off from each other.
pub const MAX_GATEWAY_DELAY: Duration = Duration::from_secs(6);
/// After a restart of the server, or the loss of the one that a seat is connected to, the clock of a
/// decision waits this long for its seat to be attached.
pub const RECALL_TIME: Duration = Duration::from_secs(60);
/// Where built-in agents have a pace, the phase of special actions lasts this many times the pace
/// in every Shift that has one, whether or not somebody is offered one.
pub(crate) const SPECIAL_ACTION_PACES: u32 = 10;
/// Shortest pace for which it does: ten shorter ones would end before a distant agent has answered.
pub(crate) const MIN_PACE_OF_PHASE: Duration = Duration::from_millis(MIN_PACE_OF_PHASE_MS as u64);
/// Longest such phase.
pub(crate) const MAX_SPECIAL_ACTION_TIME: Duration = Duration::from_secs(10);
/// A seat that has waited this long for the store gets the time back. Shorter waits are part of
/// every answer: if they were refunded, invalid answers would gain time.
pub(crate) const SLOW_STORE: Duration = Duration::from_millis(100);
/// How often the room checks whether the transport has received a request whose deadline would have
/// passed.
pub(crate) const RECHECK_INTERVAL: Duration = Duration::from_millis(20);
/// Most events that a room keeps for those who come late or come back: more than a game by the
/// standard rules has. The record has all of them; a physical table, whose reports are few, keeps
/// them too.
pub const MAX_EVENTS_KEPT: usize = 768;
/// Most expressions of one seat in one game.
pub const MAX_EXPRESSIONS_PER_SEAT: u32 = 10_000;
/// Most markers in one game.
pub const MAX_MARKERS: usize = 10_000;
/// Most markers in a second, if more come for a while.
pub const MARKERS_PER_SECOND: u32 = 50;
/// Most markers at once.
pub const MARKERS_AT_ONCE: u32 = 200;
/// How far in the future a marked moment may be: clocks are not known exactly.
pub const MAX_MARKER_AHEAD: Duration = Duration::from_secs(1);

/// Most times that seats are taken in a room, including freed ones: each stays in its log.
pub const MAX_SEATINGS: usize = 1_000;
/// Most reports from the physical table in one game. A game that reaches this limit is aborted.
pub const MAX_REPORTS: usize = 20_000;
/// The game of a physical table is aborted if nothing is reported for this long, also while it is
/// paused.
pub const MAX_IDLE: Duration = Duration::from_secs(12 * 60 * 60);
/// How long the play that ended the game of a physical table can be corrected, after the last report.
pub const CONFIRMATION_TIME: Duration = Duration::from_secs(20);
/// Most changes of one game. A game that reaches this limit is aborted.
pub const MAX_GAME_CHANGES: u64 = 2_000_000;
/// Most decisions that built-in agents take before the room reads its mailbox again.
pub const BUILT_IN_BUDGET: usize = 256;
/// Cost of a decision of a recorded player, in decisions of other agents: it compares its
/// observation with all recorded ones.
pub(crate) const REPLAY_COST: usize = 32;
