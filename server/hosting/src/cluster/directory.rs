//! Which node has a room or tournament. A node asks for those that it does not have in memory
//! itself, so the directory of a single server has nothing to say and never waits.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use async_trait::async_trait;

use chefshat_admission::limits::Key;
use chefshat_cluster::Load;
use chefshat_room::ids::{GameId, Id, IsUnit, RoomId, TournamentId, UnitId, normal_code};
use chefshat_store::cluster::Subject;
use chefshat_store::{ResumableGame, StoreError};

/// Another node of the cluster.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Peer {
    /// Its name, unique in the cluster.
    pub node: Arc<str>,
    /// Where its peer listener is: `HOST:PORT`.
    pub endpoint: Arc<str>,
}

/// Where a room or tournament is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Location {
    /// This node owns it. If it is not in memory, it is about to be resumed.
    Here,
    /// Another node owns it.
    Node(Peer),
    /// It is over, and the node that had it is gone. Every node may load it to show its end.
    Over(Subject),
    /// No node has it.
    Nowhere,
    /// The directory cannot be read now.
    Unknown,
}

/// What a request is about is at another node, or is created there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("another node has it")]
pub struct Elsewhere {
    /// The node.
    pub peer: Peer,
    /// How it was found; `None` for what is new.
    pub found_by: Option<FoundBy>,
}

/// How a room or tournament is found.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum FoundBy {
    /// By its id.
    Id(UnitId),
    /// By its join code, in its normal form.
    Code(String),
    /// A room by its game, which is not over.
    Game(GameId),
}

impl<T: IsUnit> From<Id<T>> for FoundBy {
    fn from(id: Id<T>) -> Self {
        Self::Id(id.unit())
    }
}

impl From<&str> for FoundBy {
    fn from(code: &str) -> Self {
        Self::Code(normal_code(code))
    }
}

/// Finds the owners of rooms and tournaments. It may remember nodes that it has named; a node that
/// is not the owner any more says so, and is then forgotten. That nobody has something is never
/// remembered.
#[async_trait]
pub trait Directory: Send + Sync + 'static {
    /// The name of this node, and the other nodes that are alive.
    async fn nodes(&self) -> (Arc<str>, Vec<Peer>);

    /// The name of this node, as it was read last: nothing is read. Empty before the first time.
    fn own_name(&self) -> Arc<str> {
        Arc::from("")
    }

    /// The names of the nodes that have not been reached since they joined.
    async fn unreached(&self) -> BTreeSet<Arc<str>> {
        BTreeSet::new()
    }

    /// The node that something new is for, if this node, which is this full, is not.
    async fn place(&self, _own: Load) -> Option<Peer> {
        None
    }

    /// This node could not be reached: for some time, nothing new is for it.
    fn avoid(&self, _node: &Peer) {}

    /// The location of a room or tournament that is not in memory, for this caller.
    async fn locate(&self, found_by: &FoundBy, caller: Key) -> Location;

    /// Whether a tournament of another node is over, so that no record of its games is withheld.
    async fn is_over(&self, tournament: TournamentId) -> bool;

    /// The room of a game that is over, if its end is still shown.
    async fn ended_room(&self, _room: RoomId) -> Result<Option<ResumableGame>, StoreError> {
        Ok(None)
    }

    /// The node that was named last does not own it any more, or cannot be reached.
    fn forget(&self, found_by: &FoundBy);
}

impl fmt::Debug for dyn Directory {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("Directory")
    }
}

/// The directory of a server without peers: what it does not have in memory does not exist.
#[derive(Debug, Clone, Copy, Default)]
pub struct SingleServer;

#[async_trait]
impl Directory for SingleServer {
    async fn nodes(&self) -> (Arc<str>, Vec<Peer>) {
        (Arc::from(""), Vec::new())
    }

    async fn is_over(&self, _tournament: TournamentId) -> bool {
        false
    }

    async fn locate(&self, _found_by: &FoundBy, _caller: Key) -> Location {
        Location::Nowhere
    }

    fn forget(&self, _found_by: &FoundBy) {}
}
