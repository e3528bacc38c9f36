//! Limits of what is recorded of a game besides its rules: a room keeps to them, and the replay of a
//! record checks them.

/// Invalid attempts at one decision after which the default is taken even if attempts are
/// unlimited, so that records stay bounded.
pub const MAX_ATTEMPTS: u32 = 10_000;
/// Shortest pace of built-in agents, in milliseconds, with which special actions have a fixed time.
pub const MIN_PACE_OF_PHASE_MS: u32 = 50;
/// Most hints for one decision.
pub const MAX_HINTS: u32 = 3;
/// Most annotations recorded per decision, bytes.
pub const MAX_ANNOTATION_BYTES: usize = 4 * 1024;
/// Most annotations recorded per seat and game, bytes.
pub const MAX_ANNOTATION_BYTES_PER_GAME: usize = 256 * 1024;
/// Most events of lost and new connections of one seat in one game. Later ones are not published.
pub const MAX_CONNECTION_EVENTS: u32 = 1_000;
