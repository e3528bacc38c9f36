//! The stored values of a tournament: its header and the entries of its journal.

use chefshat_proto::v1;
use chefshat_tournament::Change;

use super::form::Unreadable;
use super::units::{StoredUnit, UnitKind};
use super::{StoreError, form};
use chefshat_room::ids::{Id, SecretHash};

/// The header of a tournament, which exists before anybody joins.
#[derive(Debug, Clone)]
pub struct TournamentHeader {
    /// The tournament.
    pub id: Id,
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

impl TournamentHeader {
    /// Its encoding.
    pub fn to_bytes(&self) -> Vec<u8> {
        form::tournament_to_bytes(self)
    }
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
        room_id: Id,
        /// The game.
        game_id: Id,
    },
}

impl TournamentEntry {
    /// The encoding of entries.
    pub fn to_bytes(entries: &[Self]) -> Vec<u8> {
        form::tournament_entries_to_bytes(entries)
    }

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

impl StoredTournament {
    /// Decodes a tournament.
    ///
    /// # Errors
    /// It cannot be read.
    pub fn decode(id: Id, unit: &StoredUnit) -> Result<Self, StoreError> {
        Self::readable(unit).map_err(|problem| UnitKind::Tournament.id(id).unreadable(&problem))
    }

    pub(super) fn readable(unit: &StoredUnit) -> Result<Self, Unreadable> {
        let (header, entries) = unit.decode(
            form::tournament_from_bytes,
            form::tournament_entries_from_bytes,
        )?;
        Ok(Self {
            header,
            entries,
            rows: unit.rows.len() as u64,
        })
    }
}
