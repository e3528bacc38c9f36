//! What happened in a segment, counted independently in several ways and compared; and the sizes of
//! its messages.

use serde::Serialize;

use crate::error::LoadError;
use crate::options::SEATS;

/// What happened on a game server, from the first connection to the end of the last game.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Counts {
    /// Games created.
    pub(crate) games: u64,
    /// Decisions answered.
    pub(crate) answers: u64,
    /// Answered decisions that were turns.
    pub(crate) turn_answers: u64,
    /// Answers the server accepted.
    pub(crate) accepted: u64,
    /// Plays and passes in the events of one seat of each room.
    pub(crate) turn_events: u64,
    /// Ends of Shifts in the events of one seat of each room.
    pub(crate) shifts: u64,
    /// Ends of games in the events of every seat.
    pub(crate) game_ends: u64,
    /// Seats that left their stream because the game was over.
    pub(crate) detached: u64,
}

impl Counts {
    /// Adds the counts of another stream.
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

    /// Checks the counts: every game has ended for every seat, every answer was accepted, and the
    /// turns answered equal those the rooms reported. Games that were not finished may have no
    /// complete Shift.
    pub(crate) fn check(
        &mut self,
        games: u64,
        answered: u64,
        in_window: u64,
        played_to_end: bool,
    ) -> Result<(), LoadError> {
        self.games = games;
        let seats = games * SEATS as u64;
        let pairs = [
            ("decisions answered and counted", self.answers, answered),
            ("answers and acceptances", self.answers, self.accepted),
            (
                "turns answered and reported",
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
            ("Shifts", self.shifts.max(u64::from(!played_to_end))),
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

    /// Adds the messages of another stream.
    pub(crate) fn add(&mut self, other: &Self) {
        self.requests += other.requests;
        self.request_bytes += other.request_bytes;
        self.responses += other.responses;
        self.response_bytes += other.response_bytes;
    }
}
