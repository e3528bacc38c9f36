//! What was done in a segment, counted on independent ways and compared; and what its messages weighed.

use serde::Serialize;

use crate::error::LoadError;
use crate::options::SEATS;

/// What was done on a game server, from connecting to the end of the last game.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Counts {
    /// Games made.
    pub(crate) games: u64,
    /// Decisions answered.
    pub(crate) answers: u64,
    /// Those of them that were turns.
    pub(crate) turn_answers: u64,
    /// Answers the server said it accepted.
    pub(crate) accepted: u64,
    /// Plays and passes, as one seat of each room was told of them.
    pub(crate) turn_events: u64,
    /// Shifts that ended, as one seat of each room was told.
    pub(crate) shifts: u64,
    /// Ends of games, as every seat was told.
    pub(crate) game_ends: u64,
    /// Seats that left their stream because the game was over.
    pub(crate) detached: u64,
}

impl Counts {
    /// Adds what another stream counted.
    pub(crate) fn add(&mut self, other: &Self) {
        self.games += other.games;
        self.answers += other.answers;
        self.turn_answers += other.turn_answers;
        self.accepted += other.accepted;
        self.turn_events += other.turn_events;
        self.shifts += other.shifts;
        self.game_ends += other.game_ends;
        self.detached += other.detached;
    }

    /// Checks that every game made has ended for every seat, that every answer was accepted, and that the turns answered are those the
    /// rooms told of: what was measured has happened.
    pub(crate) fn check(
        &mut self,
        games: u64,
        answered: u64,
        in_window: u64,
    ) -> Result<(), LoadError> {
        self.games = games;
        let seats = games * SEATS as u64;
        let pairs = [
            ("decisions answered and counted", self.answers, answered),
            ("answers and acceptances", self.answers, self.accepted),
            (
                "turns answered and told",
                self.turn_answers,
                self.turn_events,
            ),
            ("seats and ends of games", seats, self.game_ends),
            ("seats and seats detached", seats, self.detached),
        ];
        for (what, one, other) in pairs {
            if one != other {
                return Err(LoadError::Count(format!("{what}: {one} and {other}")));
            }
        }
        let least = [
            ("games", games),
            ("turns", self.turn_events),
            ("Shifts", self.shifts),
            ("decisions in the window", in_window),
        ];
        match least.iter().find(|(_, count)| *count == 0) {
            Some((what, _)) => Err(LoadError::Count(format!("no {what} at all"))),
            None => Ok(()),
        }
    }
}

/// Messages and their encoded sizes, without gRPC's five bytes of framing.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub(crate) struct Traffic {
    /// Messages to the server.
    pub(crate) requests: u64,
    /// Their bytes.
    pub(crate) request_bytes: u64,
    /// Messages from the server.
    pub(crate) responses: u64,
    /// Their bytes.
    pub(crate) response_bytes: u64,
}

impl Traffic {
    /// A message to the server.
    pub(crate) fn sent(&mut self, bytes: usize) {
        self.requests += 1;
        self.request_bytes += bytes as u64;
    }

    /// A message from the server.
    pub(crate) fn received(&mut self, bytes: usize) {
        self.responses += 1;
        self.response_bytes += bytes as u64;
    }

    /// Adds what another stream saw.
    pub(crate) fn add(&mut self, other: &Self) {
        self.requests += other.requests;
        self.request_bytes += other.request_bytes;
        self.responses += other.responses;
        self.response_bytes += other.response_bytes;
    }
}
