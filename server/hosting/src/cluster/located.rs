//! The directory of a node: asks the database who owns what, and remembers what other nodes own.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use async_trait::async_trait;
use tokio::sync::Mutex as AsyncMutex;
use tokio::time::{Instant, timeout};
use tracing::{debug, warn};

use super::directory::{Directory, FoundBy, Location, Peer};
use super::lease::NodeLease;
use chefshat_admission::limits::{FairSemaphore, Key, Shares};
use chefshat_base::lock::Lock;
use chefshat_cluster::Load;
use chefshat_room::ids::{RoomId, TournamentId};
use chefshat_store::cluster::{self, ClusterStore, LivingNode, NodeId};
use chefshat_store::{ResumableGame, StoreError};

/// Most rooms and tournaments of other nodes that are remembered, by whatever they were found.
const MAX_REMEMBERED: usize = 20_000;
/// Most rooms and tournaments that are looked for in the database at a time, for callers in turns:
/// a caller that makes ids up leaves connections for everything else.
const LOOKED_FOR_AT_ONCE: usize = 2;
/// How long a look takes at most, with the wait for its turn: many for one caller would otherwise wait
/// for a database that hangs one after another.
pub(crate) const LOOK_LIMIT: Duration = Duration::from_secs(2);
/// How long it is known which nodes have a lease.
const NODES_KNOWN_FOR: Duration = Duration::from_secs(1);

/// How long nothing new is for a node that could not be reached.
pub const AVOIDED_FOR: Duration = Duration::from_secs(10);

/// Finds the owners of rooms and tournaments in the database.
pub struct StoreDirectory {
    store: Arc<dyn ClusterStore>,
    lease: Arc<NodeLease>,
    /// Owners among the other nodes.
    known: Lock<BTreeMap<FoundBy, Peer>>,
    looking: Arc<FairSemaphore>,
    /// Nodes that could not be reached, and until when nothing new is for them.
    avoided: Lock<BTreeMap<Peer, Instant>>,
    /// The name of this node, as it was read last; empty before.
    own: Lock<Arc<str>>,
    /// Locked while they are read, so that one request reads them for all.
    nodes: AsyncMutex<Option<Nodes>>,
}

/// The nodes that have a lease, or why they are unknown, and when they were read.
struct Nodes {
    read: Instant,
    alive: Result<Alive, StoreError>,
}

#[derive(Clone, Default)]
struct Alive {
    nodes: BTreeMap<NodeId, Peer>,
    /// The names of those that have not been reached.
    unreached: BTreeSet<Arc<str>>,
    /// How full those are that take rooms.
    loads: BTreeMap<NodeId, Load>,
}

impl StoreDirectory {
    /// Reads from this database, for the node with this lease. One caller has at most its share of
    /// what is read at a time.
    pub fn new(store: Arc<dyn ClusterStore>, lease: Arc<NodeLease>, shares: Shares) -> Self {
        Self {
            store,
            lease,
            known: Lock::default(),
            looking: FairSemaphore::new(LOOKED_FOR_AT_ONCE, shares),
            avoided: Lock::default(),
            own: Lock::new(Arc::from("")),
            nodes: AsyncMutex::default(),
        }
    }

    /// Reads where something is.
    async fn read(&self, found_by: &FoundBy, caller: Key) -> Result<Location, StoreError> {
        let _place = self.looking.take(caller).await;
        let found = match found_by {
            FoundBy::Id(id) => self.store.locate(*id).await?,
            FoundBy::Code(code) => self.store.locate_code(code).await?,
            FoundBy::Game(game) => self.store.locate_game(*game).await?,
        };
        self.location(found).await
    }

    /// The location of something that stands in the database.
    async fn location(&self, found: Option<cluster::Location>) -> Result<Location, StoreError> {
        let Some(found) = found else {
            return Ok(Location::Nowhere);
        };
        if found.node.is_some() && found.node == self.lease.node() {
            return Ok(match found.over {
                true => Location::Over(found.subject),
                false => Location::Here,
            });
        }
        let peer = match found.node {
            Some(node) => self.alive().await?.nodes.remove(&node),
            None => None,
        };
        Ok(match peer {
            Some(peer) => Location::Node(peer),
            None if found.over => Location::Over(found.subject),
            // A node will soon take it over.
            None => Location::Unknown,
        })
    }

    /// The nodes that have a lease.
    async fn alive(&self) -> Result<Alive, StoreError> {
        let mut nodes = self.nodes.lock().await;
        let recent = |nodes: &&Nodes| nodes.read.elapsed() < NODES_KNOWN_FOR;
        if let Some(nodes) = nodes.as_ref().filter(recent) {
            return nodes.alive.clone();
        }
        let was_known = nodes.as_ref().is_none_or(|nodes| nodes.alive.is_ok());
        let alive = self.store.alive().await.map(|alive| {
            let mut read = Alive::default();
            for living in alive {
                let LivingNode {
                    id,
                    info,
                    reached,
                    load,
                } = living;
                let node: Arc<str> = format!("{} #{}", info.name, id.0).into();
                if !reached {
                    read.unreached.insert(Arc::clone(&node));
                }
                read.loads.extend(load.map(|load| (id, load)));
                let endpoint = info.peer_endpoint.into();
                read.nodes.insert(id, Peer { node, endpoint });
            }
            read
        });
        match &alive {
            Err(error) if was_known => warn!(%error, "the nodes of the cluster are unknown"),
            Ok(_) if !was_known => warn!("the nodes of the cluster are known again"),
            _ => {}
        }
        *nodes = Some(Nodes {
            read: Instant::now(),
            alive: alive.clone(),
        });
        alive
    }

    /// The nodes that have a lease, as far as they are known.
    async fn living(&self) -> Alive {
        self.alive().await.unwrap_or_default()
    }
}

#[async_trait]
impl Directory for StoreDirectory {
    async fn ended_room(&self, room: RoomId) -> Result<Option<ResumableGame>, StoreError> {
        self.store.ended_room(room).await
    }

    async fn locate(&self, found_by: &FoundBy, caller: Key) -> Location {
        if let Some(peer) = self.known.lock().get(found_by) {
            return Location::Node(peer.clone());
        }
        let read = timeout(LOOK_LIMIT, self.read(found_by, caller)).await;
        let location = match read {
            Ok(Ok(location)) => location,
            Ok(Err(error)) => {
                debug!(%error, "the owner of a room or tournament cannot be found");
                Location::Unknown
            }
            Err(_) => {
                debug!("the database did not say in time who owns a room or tournament");
                Location::Unknown
            }
        };
        if let Location::Node(peer) = &location {
            let mut known = self.known.lock();
            if known.len() >= MAX_REMEMBERED {
                known.clear();
            }
            known.insert(found_by.clone(), peer.clone());
        }
        location
    }

    async fn nodes(&self) -> (Arc<str>, Vec<Peer>) {
        let mut nodes = self.living().await.nodes;
        let own = self.lease.node().and_then(|node| nodes.remove(&node));
        let name = own.map_or_else(|| Arc::from(""), |own| own.node);
        if !name.is_empty() {
            *self.own.lock() = Arc::clone(&name);
        }
        (name, nodes.into_values().collect())
    }

    fn own_name(&self) -> Arc<str> {
        Arc::clone(&self.own.lock())
    }

    async fn place(&self, own: Load) -> Option<Peer> {
        let mut alive = self.living().await;
        let own_node = self.lease.node()?;
        let now = Instant::now();
        let others: Vec<_> = {
            let mut avoided = self.avoided.lock();
            avoided.retain(|_, until| now < *until);
            let is_other = |node: &NodeId| {
                let peer = alive.nodes.get(node);
                *node != own_node && peer.is_some_and(|peer| !avoided.contains_key(peer))
            };
            (alive.loads.into_iter())
                .filter(|(node, _)| is_other(node))
                .collect()
        };
        let node = chefshat_cluster::place(own, &others)?;
        // Until it is read again, the node has one more.
        if let Some(Nodes {
            alive: Ok(known), ..
        }) = &mut *self.nodes.lock().await
            && let Some(load) = known.loads.get_mut(&node)
        {
            load.rooms += 1;
        }
        alive.nodes.remove(&node)
    }

    async fn unreached(&self) -> BTreeSet<Arc<str>> {
        self.living().await.unreached
    }

    async fn is_over(&self, tournament: TournamentId) -> bool {
        let found = self.store.locate(tournament.unit()).await;
        found.is_ok_and(|found| found.is_some_and(|location| location.over))
    }

    fn avoid(&self, node: &Peer) {
        self.avoided
            .lock()
            .insert(node.clone(), Instant::now() + AVOIDED_FOR);
    }

    fn forget(&self, found_by: &FoundBy) {
        self.known.lock().remove(found_by);
    }
}
