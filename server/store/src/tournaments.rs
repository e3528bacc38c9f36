//! The stored values of a tournament: its header and the entries of its journal.

use chefshat_proto::v1;
use chefshat_tournament::Change;

use chefshat_room::ids::{GameId, RoomId, SecretHash, TournamentId};

/// The header of a tournament, which exists before anybody joins.
#[derive(Debug, Clone)]
pub struct TournamentHeader {
    /// The tournament.
    pub id: TournamentId,
    /// The settings, every field set.
    pub settings: v1::TournamentSettings,
    /// When it was created, milliseconds since the Unix epoch.
    pub created_at_ms: u64,
    /// The join code, in its normal form.
    pub join_code: String,
    /// The hash of the owner token.
    pub owner: SecretHash,
    /// The seed of games with shared deals.
    pub deal_secret: [u8; 32],
}

/// An entry of a tournament's journal.
#[derive(Debug, Clone)]
pub enum TournamentEntry {
    /// A change of its core.
    Change(Change),
    /// A participant joined.
    Ticket {
        /// Number of the participant, whose change came before.
        participant: usize,
        /// The hash of its ticket.
        ticket: SecretHash,
    },
    /// A game was assigned a room, before the room is created. A later entry for the same game
    /// replaces an earlier one.
    Placed {
        /// Number of the game in the tournament.
        game: usize,
        /// The room.
        room_id: RoomId,
        /// The game.
        game_id: GameId,
    },
}

impl TournamentEntry {
    /// Whether it ends the tournament.
    pub fn is_end(&self) -> bool {
        matches!(self, Self::Change(Change::Finished | Change::Closed))
    }
}

/// A tournament in the store.
#[derive(Debug, Clone)]
pub struct StoredTournament {
    /// Its header.
    pub header: TournamentHeader,
    /// The entries of its journal, in order.
    pub entries: Vec<TournamentEntry>,
    /// Number of rows of the journal.
    pub rows: u64,
}
