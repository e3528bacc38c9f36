//! Why a store failed.

use chefshat_room::ids::UnitId;

/// Why a store failed, with advice.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// The store failed; a commit in progress may or may not have succeeded.
    #[error("{0}")]
    Failed(String),
    /// The id of a game or tournament is taken. Nothing was changed, and the store has not failed.
    #[error("the id {0} is taken")]
    Taken(String),
    /// A game or study cannot be read. The store has not failed.
    #[error("{0}")]
    Unreadable(String),
    /// Another node of the cluster owns the unit of this room or tournament. Nothing was changed,
    /// and the store has not failed; the room or tournament must stop and publish nothing more.
    #[error("another node has taken {0} over")]
    Fenced(UnitId),
    /// The database has lost rows of this room, tournament or study that it had committed. Nothing was
    /// changed, and the store has not failed; its owner stops, and goes on from what is stored.
    #[error("the database has lost rows of {0} that it had committed")]
    Lost(UnitId),
}
