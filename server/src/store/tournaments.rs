//! What a tournament is kept as: its header, and everything that moved it. Where its games stand is kept with the games. The form on disk
//! belongs to the store that writes one; here are the values.

use chefshat_proto::v1;
use chefshat_tournament::Change;

use chefshat_room::ids::{Id, SecretHash};

/// Everything about a tournament that stands before anybody joins.
#[derive(Debug, Clone)]
pub struct TournamentHeader {
    /// The tournament.
    pub id: Id,
    /// What it is, every field set.
    pub settings: v1::TournamentSettings,
    /// When it was made, milliseconds since the Unix epoch.
    pub created_at_ms: u64,
    /// The join code, in its normal form.
    pub join_code: String,
    /// The owner's token, hashed.
    pub owner: SecretHash,
    /// What games that are dealt alike are dealt from.
    pub deal_secret: [u8; 32],
}

/// One thing that moved a tournament.
#[derive(Debug, Clone)]
pub enum TournamentEntry {
    /// A change of its core.
    Change(Change),
    /// Somebody joined; the ticket, hashed.
    Ticket {
        /// Number of the participant, whose change came before.
        participant: usize,
        /// The hash.
        ticket: SecretHash,
    },
    /// A game was given a room, before that was made. A later one of the same game takes the place of an earlier.
    Placed {
        /// Number of the game in the tournament.
        game: usize,
        /// The room.
        room_id: Id,
        /// The game.
        game_id: Id,
    },
}

impl TournamentEntry {
    /// Whether the tournament is over with it.
    pub fn is_end(&self) -> bool {
        matches!(self, Self::Change(Change::Finished | Change::Closed))
    }
}

/// A tournament as it was kept.
#[derive(Debug, Clone)]
pub struct StoredTournament {
    /// Its header.
    pub header: TournamentHeader,
    /// Everything that moved it, in order.
    pub entries: Vec<TournamentEntry>,
    /// Rows that this took.
    pub rows: u64,
}
