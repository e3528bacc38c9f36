//! The log of a room: everything public that happened in it, compactly, in order. The number of an event is its position plus one. How
//! an event looks to a viewer is written in `convert::log`.

use std::time::Duration;

use chefshat_engine::{ActionId, Event, Seat};

use crate::journal::{AbortReason, SeatedParticipant, Source};

/// Most events of one game; beyond it the game is aborted.
pub const MAX_GAME_EVENTS: usize = 1_000_000;

/// One event.
#[derive(Debug, Clone)]
pub struct LogEntry {
    /// Milliseconds since the room was created.
    pub at_ms: u32,
    /// What happened.
    pub happening: Happening,
}

/// What happened.
#[derive(Debug, Clone)]
pub enum Happening {
    /// A participant took a seat.
    Seated(Seat, Box<SeatedParticipant>),
    /// A seat became free again.
    Vacated(Seat),
    /// A seat's agent lost its connection.
    Disconnected(Seat),
    /// A seat's agent plays again.
    Returned(Seat),
    /// A built-in agent plays for a seat.
    Substituted(Seat),
    /// The game began.
    GameStarted,
    /// An event of the engine that comes rarely, with how it came about and the rewards it brought.
    Game(Box<GameHappening>),
    /// A seat played.
    Played {
        /// The seat.
        seat: Seat,
        /// The action.
        action: ActionId,
        /// Cards left in its hand.
        cards_left: u8,
        /// How it came about.
        by: ByWhom,
    },
    /// A seat passed.
    Passed {
        /// The seat.
        seat: Seat,
        /// Cards left in its hand.
        cards_left: u8,
        /// How it came about.
        by: ByWhom,
    },
    /// A pizza was done.
    PizzaDone {
        /// Its number in the Shift.
        pizza: u32,
        /// Who played last.
        last_to_play: Option<Seat>,
        /// Who leads the next.
        next_leader: Seat,
    },
    /// A seat got rid of its last card.
    SeatFinished {
        /// The seat.
        seat: Seat,
        /// Its place, from 1.
        place: u8,
    },
    /// The game ended with a result.
    GameEnded,
    /// The game ended without a result.
    GameAborted(AbortReason),
    /// The server was restarted.
    ServerRestarted,
    /// A seat expressed something publicly.
    Expressed(Seat, Box<[u8]>),
}

impl Happening {
    /// Whether a seat is told more of this than everybody is. When in doubt, it is: what more there is, if anything, is then decided event
    /// by event.
    pub fn tells_more_to(&self, seat: Seat) -> bool {
        match self {
            Self::Played {
                seat: actor, by, ..
            }
            | Self::Passed {
                seat: actor, by, ..
            } => *actor == seat && by.reward.is_some(),
            Self::Game(_) => true,
            _ => false,
        }
    }
}

/// A rare event of the engine.
#[derive(Debug, Clone)]
pub struct GameHappening {
    /// The event, with nothing withheld.
    pub event: Event,
    /// How it came about.
    pub by: ByWhom,
    /// Rewards it brought.
    pub rewards: Vec<(Seat, f32)>,
}

/// How a decision came about, and what it brought its seat.
#[derive(Debug, Clone, Copy)]
pub struct ByWhom {
    /// Who or what decided.
    pub source: Source,
    /// Measured decision time, microseconds.
    pub time_us: u64,
    /// The reward of the turn, where the room has a scheme.
    pub reward: Option<f32>,
}

/// The events of a room.
#[derive(Debug, Default)]
pub struct Log {
    entries: Vec<LogEntry>,
}

impl Log {
    /// Adds an event.
    pub(super) fn push(&mut self, at: Duration, happening: Happening) {
        self.entries.push(LogEntry {
            at_ms: u32::try_from(at.as_millis()).unwrap_or(u32::MAX),
            happening,
        });
    }

    /// Puts other hands in place of those dealt, as a test of what is hidden needs it.
    #[cfg(any(test, feature = "testing"))]
    pub(super) fn replace_hands(
        &mut self,
        hands: &chefshat_engine::BySeat<chefshat_engine::Cards>,
    ) {
        for entry in &mut self.entries {
            if let Happening::Game(game) = &mut entry.happening
                && let Event::ShiftStarted { hands: dealt, .. } = &mut game.event
            {
                *dealt = hands.map(Some);
            }
        }
    }

    /// Number of events.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether nothing has happened yet.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The event at a position, from 0.
    pub fn get(&self, position: usize) -> Option<&LogEntry> {
        self.entries.get(position)
    }

    /// The events from a position on.
    pub fn since(&self, position: usize) -> &[LogEntry] {
        self.entries.get(position..).unwrap_or_default()
    }
}
