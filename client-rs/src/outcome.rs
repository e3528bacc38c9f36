//! The result of a seat's game.

use crate::v1;

/// The result of a game for one seat.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Identifies the room.
    pub room_id: String,
    /// Identifies the game and its record.
    pub game_id: String,
    /// The seat.
    pub seat: u32,
    /// With a result or without.
    pub ending: Ending,
    /// The seat's contribution to the game seed, to be compared with the reveal.
    pub entropy: Vec<u8>,
    /// Answers of the agent, including refused ones.
    pub answers: u64,
}

/// How a game ended.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// With a result.
    Finished(v1::GameEnded),
    /// Without a result.
    Aborted(v1::GameAborted),
}

impl Outcome {
    /// The final table, best first; empty if the game has no result.
    pub fn standings(&self) -> &[v1::Standing] {
        match &self.ending {
            Ending::Finished(end) => &end.standings,
            Ending::Aborted(_) => &[],
        }
    }

    /// This seat's line of the final table.
    pub fn standing(&self) -> Option<&v1::Standing> {
        self.standings().iter().find(|line| line.seat == self.seat)
    }

    /// Why the game has no result; `None` if it has one.
    pub fn aborted(&self) -> Option<v1::AbortReason> {
        match &self.ending {
            Ending::Finished(_) => None,
            Ending::Aborted(end) => Some(end.reason()),
        }
    }
}
