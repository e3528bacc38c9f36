//! The log of a room: every event as it is, in order. The number of an event is its position plus
//! one. `convert::event` in `chefshat-wire` redacts events for a viewer.

use std::collections::VecDeque;
use std::time::Duration;

use chefshat_engine::{Cards, Event, Seat, Viewer};
use chefshat_referee::Violation;

use crate::journal::{AbortReason, SeatedParticipant, Source};

/// Most events of one game. A game that reaches this limit is aborted.
pub const MAX_GAME_EVENTS: usize = 1_000_000;

/// An event with its time.
#[derive(Debug, Clone)]
pub struct LogEntry {
    /// Milliseconds since the room was created.
    pub at_ms: u32,
    /// The event.
    pub event: RoomEvent,
}

/// An event of a room: one of the engine, or one that only a room has.
#[derive(Debug, Clone)]
pub enum RoomEvent {
    /// A participant took a seat.
    Seated(Seat, Box<SeatedParticipant>),
    /// A seat became free again.
    Vacated(Seat),
    /// A seat's agent lost its connection.
    Disconnected {
        /// The seat.
        seat: Seat,
        /// Whether it was lost together with the node that it was connected to.
        with_node: bool,
    },
    /// A seat's agent plays again.
    Returned(Seat),
    /// A built-in agent plays for a seat.
    Substituted(Seat),
    /// A built-in agent plays for a seat until the end.
    Retired(Seat),
    /// The game started.
    GameStarted,
    /// An event of the engine.
    Game(GameEvent),
    /// The game ended without a result.
    GameAborted(AbortReason),
    /// The server was restarted.
    ServerRestarted,
    /// A seat expressed something publicly: the encoded `chefshat.v1.Expression`.
    Expressed(Seat, Box<[u8]>),
    /// At a physical table, a hand became known.
    HandReported(Box<HandReported>),
    /// At a physical table, something that the rules or the cards do not allow, with the number of
    /// its report.
    Violation(Box<(u64, Violation)>),
    /// At a physical table, a report was wrong.
    Correction(Box<Correction>),
    /// A physical table was paused (`true`) or resumed.
    Paused(bool),
}

/// A hand that became known.
#[derive(Debug, Clone)]
pub struct HandReported {
    /// Number of the report.
    pub report: u64,
    /// The seat.
    pub seat: Seat,
    /// Its cards.
    pub cards: Cards,
    /// Whether it is the hand as dealt, rather than as it was then.
    pub dealt: bool,
}

/// A correction of an earlier report.
#[derive(Debug, Clone)]
pub struct Correction {
    /// Number of the corrected report.
    pub report: u64,
    /// Numbers of later reports that no longer fit.
    pub void_reports: Vec<u64>,
    /// Number of the first void event of the game; 0 if there is none.
    pub first_void: u64,
    /// For people.
    pub text: String,
}

/// An event of the engine, with the decision that caused it and its rewards.
#[derive(Debug, Clone)]
pub struct GameEvent {
    /// The event, unredacted.
    pub event: Event,
    /// Who or what took the decision.
    pub source: Source,
    /// Measured time of the decision, microseconds.
    pub time_us: u64,
    /// Rewards by seat. Empty without a reward scheme.
    pub rewards: Box<[(Seat, f32)]>,
}

impl RoomEvent {
    /// Whether a viewer may see more of this event than the public: private cards, or a reward.
    pub fn shows_more_to(&self, viewer: Viewer) -> bool {
        let is = |seat: Seat| match viewer {
            Viewer::Seat(own) => own == seat,
            Viewer::Spectator => false,
            Viewer::Everything => true,
        };
        let game = match self {
            Self::Game(game) => game,
            Self::HandReported(reported) => return is(reported.seat),
            _ => return false,
        };
        let shows_cards = match &game.event {
            Event::ShiftStarted { .. } => viewer != Viewer::Spectator,
            Event::CardsExchanged {
                giver, receiver, ..
            } => is(*giver) || is(*receiver),
            _ => false,
        };
        shows_cards || game.rewards.iter().any(|(seat, _)| is(*seat))
    }
}

/// Events in one chunk of a log.
const CHUNK: usize = 64;

/// The events of a room, in chunks of a fixed size, so that a growing log is never copied. The
/// oldest may be dropped.
#[derive(Debug, Default)]
pub struct Log {
    /// All full but the last.
    chunks: VecDeque<Vec<LogEntry>>,
    /// Number of events in chunks that were dropped.
    dropped: usize,
    length: usize,
}

impl Log {
    /// Appends an event.
    pub(super) fn push(&mut self, at: Duration, event: RoomEvent) {
        if self.length.is_multiple_of(CHUNK) {
            self.chunks.push_back(Vec::with_capacity(CHUNK));
        }
        let last = self.chunks.back_mut().expect("one has space");
        last.push(LogEntry {
            at_ms: u32::try_from(at.as_millis()).unwrap_or(u32::MAX),
            event,
        });
        self.length += 1;
    }

    /// Replaces the hands that were dealt, for tests of redaction.
    #[cfg(any(test, feature = "testing"))]
    pub(super) fn replace_hands(
        &mut self,
        hands: &chefshat_engine::BySeat<chefshat_engine::Cards>,
    ) {
        for entry in self.chunks.iter_mut().flatten() {
            if let RoomEvent::Game(game) = &mut entry.event
                && let Event::ShiftStarted { hands: dealt, .. } = &mut game.event
            {
                **dealt = hands.map(Some);
            }
        }
    }

    /// Number of events.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Whether there is no event yet.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Number of events that have not been dropped.
    pub fn kept(&self) -> usize {
        self.length - self.dropped
    }

    /// Position of the first event that has not been dropped.
    pub fn first(&self) -> usize {
        self.dropped
    }

    /// Drops events before a position, except for those that share a chunk with later ones.
    pub(super) fn drop_before(&mut self, position: usize) {
        while self.dropped + CHUNK <= position.min(self.length) && self.chunks.len() > 1 {
            self.chunks.pop_front();
            self.dropped += CHUNK;
        }
    }

    /// The event at a position, from 0, unless it has been dropped.
    pub fn get(&self, position: usize) -> Option<&LogEntry> {
        let position = position.checked_sub(self.dropped)?;
        self.chunks.get(position / CHUNK)?.get(position % CHUNK)
    }

    /// The events from a position on, or from the first one that has not been dropped.
    pub fn since(&self, position: usize) -> impl Iterator<Item = &LogEntry> + Clone {
        let position = position.saturating_sub(self.dropped);
        let chunks = self
            .chunks
            .range((position / CHUNK).min(self.chunks.len())..);
        chunks.flatten().skip(position % CHUNK)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_fits_one_cache_line() {
        assert!(size_of::<LogEntry>() <= 64, "{}", size_of::<LogEntry>());
    }

    #[test]
    fn dropped_events_leave_the_others_where_they_are() {
        let mut log = Log::default();
        for number in 0..3 * CHUNK {
            let at = Duration::from_millis(u64::try_from(number).expect("small"));
            log.push(at, RoomEvent::GameStarted);
        }
        log.drop_before(CHUNK - 1);
        assert_eq!(log.first(), 0, "a chunk is dropped as a whole");
        log.drop_before(10 * CHUNK);
        assert_eq!(log.first(), 2 * CHUNK, "the last chunk stays");
        assert_eq!(log.len(), 3 * CHUNK);
        assert!(log.get(2 * CHUNK - 1).is_none());
        for from in [0, 2 * CHUNK, 2 * CHUNK + 7] {
            let times = log.since(from).map(|entry| entry.at_ms as usize);
            assert!(times.eq(from.max(2 * CHUNK)..3 * CHUNK), "{from}");
        }
    }

    #[test]
    fn events_are_found_across_chunks() {
        let mut log = Log::default();
        for number in 0..3 * CHUNK + 1 {
            let at = Duration::from_millis(u64::try_from(number).expect("small"));
            log.push(at, RoomEvent::GameStarted);
        }
        assert_eq!(log.len(), 3 * CHUNK + 1);
        for from in [
            0,
            1,
            CHUNK - 1,
            CHUNK,
            2 * CHUNK + 5,
            3 * CHUNK,
            3 * CHUNK + 1,
            9 * CHUNK,
        ] {
            let times = log.since(from).map(|entry| entry.at_ms as usize);
            assert!(times.eq(from..log.len().max(from)), "{from}");
            assert_eq!(
                log.get(from).map(|entry| entry.at_ms as usize),
                (from < log.len()).then_some(from)
            );
        }
    }
}
