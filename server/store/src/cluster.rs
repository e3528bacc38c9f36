//! What a store offers the nodes of a cluster besides [`Store`]: nodes and their leases, and who
//! owns which rooms, tournaments and studies. What changes hands together is a *unit*: a room alone,
//! or a tournament or study with all its rooms; its id is that of the room, tournament or study. Each
//! change of hands raises the *epoch* of the unit, and nothing is written for it at an older epoch
//! (`StoreError::Fenced`). A unit with nothing open is over: nobody owns or claims it.

use std::time::Duration;

use async_trait::async_trait;
use chefshat_cluster::LeaseTimes;
pub use chefshat_cluster::{Epoch, Load, NodeId};

use super::units::{StoredUnit, UnitKey};
use super::{ResumableGame, Store, StoreError};
use chefshat_room::ids::{GameId, RoomId, UnitId};

/// What a node says about itself when it joins.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct NodeInfo {
    /// Its name for people, for example the host's; need not be unique.
    pub name: String,
    /// Where other nodes reach it.
    pub peer_endpoint: String,
    /// Where clients that care reach it directly; empty if nowhere.
    pub client_endpoint: String,
    /// The version of the program.
    pub build: String,
    /// Most units that it takes over.
    pub capacity: u64,
}

/// What a node says about itself with each heartbeat.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Heartbeat {
    /// Whether it has been reached since it joined.
    pub reached: bool,
    /// Rooms that wait or play there, or are about to.
    pub rooms: u64,
    /// Whether it hands over what it owns, to leave.
    pub drains: bool,
    /// Other nodes that it does not reach.
    pub unreachable: u32,
    /// Whether nothing that it writes is committed.
    pub is_stalled: bool,
}

/// A node that has a lease.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LivingNode {
    /// Its id.
    pub id: NodeId,
    /// What it said when it joined.
    pub info: NodeInfo,
    /// Whether it has been reached since it joined.
    pub reached: bool,
    /// How full it is; `None` if it takes no rooms, or is of an earlier version, which does not say.
    pub load: Option<Load>,
}

/// A node of the cluster.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeStatus {
    /// Its id.
    pub id: NodeId,
    /// What it said when it joined.
    pub info: NodeInfo,
    /// Time since its last beat, on the clock of the database.
    pub last_beat: Duration,
    /// Whether its lease has expired.
    pub expired: bool,
    /// Whether it has been asked to hand over what it owns.
    pub drain: bool,
    /// Whether it has been reached since it joined.
    pub reached: bool,
    /// Other nodes that it does not reach.
    pub unreachable: u32,
    /// Whether nothing that it writes is committed.
    pub is_stalled: bool,
    /// Rooms that it owns and that are not over.
    pub rooms: u64,
    /// Tournaments that it owns and that are not over.
    pub tournaments: u64,
    /// Its studies.
    pub studies: u64,
}

/// What is not over, survives its node and belongs to no node that lives.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct WithoutNode {
    /// Rooms, those of tournaments and studies included.
    pub rooms: u64,
    /// Tournaments.
    pub tournaments: u64,
    /// Studies.
    pub studies: u64,
}

/// The answer to a beat.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Beat {
    /// The units that the node owns, with their epochs.
    pub owned: Vec<(UnitId, Epoch)>,
    /// Whether somebody has asked the node to hand over what it owns.
    pub drain: bool,
}

/// What an id belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Subject {
    /// A room.
    Room(RoomId),
    /// A tournament, or a study, which is never over.
    Unit(UnitKey),
}

/// Where a room or tournament is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// The room or tournament.
    pub subject: Subject,
    /// The unit it belongs to.
    pub unit: UnitId,
    /// Who owns the unit, or owned it last; `None` if nobody does at present.
    pub node: Option<NodeId>,
    /// The epoch of the unit.
    pub epoch: Epoch,
    /// Whether it is over. Then nothing is written any more, and every node may load it to show
    /// its end.
    pub over: bool,
}

/// A unit as its owner resumes it.
#[derive(Default)]
pub struct LoadedUnit {
    /// The tournament or study, if the unit is one.
    pub stored: Option<(UnitKey, StoredUnit)>,
    /// Its durable rooms that are not over, and those that are but have not been removed yet,
    /// oldest first. A game that cannot be read is logged and left unchanged. The last entry of a
    /// game that has been claimed says that the server was restarted.
    pub games: Vec<ResumableGame>,
}

/// A store that several servers share. Everything that [`Store`] creates or changes belongs to the
/// node that has joined through the same value.
///
/// Times are those of the database's clock.
#[async_trait]
pub trait ClusterStore: Store {
    /// The times of all leases.
    fn lease(&self) -> LeaseTimes;

    /// Adds this server as a node, whose lease begins now. Called again, for example after the node
    /// was removed because it was away for long, it becomes a new node.
    async fn join(&self, info: NodeInfo) -> Result<NodeId, StoreError>;

    /// Renews the lease of this node, even if it has expired, notes what it says, and returns what it
    /// owns at the same moment. `None`: the node is not known (any more).
    async fn beat(&self, heartbeat: Heartbeat) -> Result<Option<Beat>, StoreError>;

    /// At most `count` units that nobody owns or whose owner's lease has expired, with their
    /// epochs, in an order of this node's own, so that several nodes share them; only such that this
    /// version of the program can resume.
    async fn orphans(&self, count: usize) -> Result<Vec<(UnitId, Epoch)>, StoreError>;

    /// Waits until another node releases a unit and names this one as its next owner; returns the
    /// unit and its epoch. Some are missed: they are found as orphans.
    async fn handed_over(&self) -> (UnitId, Epoch);

    /// Removes what has been over for long, and the ephemeral rooms of nodes whose leases have
    /// expired.
    async fn tidy(&self) -> Result<(), StoreError>;

    /// Takes orphans over that still have the epochs that were seen: raises the epoch and adds "the
    /// server was restarted" to the journal of each room that is not over, in one commit for each
    /// unit or for several. Returns their new epochs, in the same order; `None` for a unit that is
    /// not an orphan any more, or not at this epoch, or that this version cannot resume.
    async fn claim_all(
        &self,
        orphans: Vec<(UnitId, Epoch)>,
    ) -> Result<Vec<Option<Epoch>>, StoreError>;

    /// Takes one orphan over. See [`ClusterStore::claim_all`].
    async fn claim(&self, unit: UnitId, seen: Epoch) -> Result<Option<Epoch>, StoreError> {
        Ok(self.claim_all(vec![(unit, seen)]).await?.pop().flatten())
    }

    /// Reads a unit that this node owns at this epoch, with journals that write at this epoch;
    /// `None` if it does not (any more). From here on, what is written for its tournament is
    /// written at this epoch, so what ran before at another one must have ended.
    async fn load(&self, unit: UnitId, epoch: Epoch) -> Result<Option<LoadedUnit>, StoreError>;

    /// Gives up a unit that this node owns at this epoch, so that others may claim it at once, and
    /// names one that is to: `next` if it takes rooms, otherwise any, an emptier one more often. The
    /// last append to each of its journals must have been answered.
    async fn release(
        &self,
        unit: UnitId,
        epoch: Epoch,
        next: Option<NodeId>,
    ) -> Result<(), StoreError>;

    /// Removes this node if it owns nothing. Returns whether it is removed.
    async fn leave(&self) -> Result<bool, StoreError>;

    /// Where a room or tournament is; `None` if there is none with this id.
    async fn locate(&self, id: UnitId) -> Result<Option<Location>, StoreError>;

    /// Where the room or tournament with this join code, in its normal form, is.
    async fn locate_code(&self, join_code: &str) -> Result<Option<Location>, StoreError>;

    /// Where the room of a game is that is not over.
    async fn locate_game(&self, game: GameId) -> Result<Option<Location>, StoreError>;

    /// The room of a durable game that is over, to show its end, if it has not been removed yet.
    async fn ended_room(&self, room: RoomId) -> Result<Option<ResumableGame>, StoreError>;

    /// The nodes that have a lease.
    async fn alive(&self) -> Result<Vec<LivingNode>, StoreError>;

    /// All nodes, in the order in which they joined. Counts what they own, so it takes longer than
    /// [`ClusterStore::alive`].
    async fn nodes(&self) -> Result<Vec<NodeStatus>, StoreError>;

    /// Asks a node to hand over what it owns; it learns of it with its next beat. Returns whether
    /// the node is known.
    async fn request_drain(&self, node: NodeId) -> Result<bool, StoreError>;
}
