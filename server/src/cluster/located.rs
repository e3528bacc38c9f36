//! The directory of a node: asks the database who owns what, and remembers what other nodes own.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use futures::FutureExt as _;
use futures::future::BoxFuture;
use tokio::sync::Mutex as AsyncMutex;
use tokio::time::Instant;
use tracing::{debug, warn};

use super::directory::{Directory, FoundBy, Location, Peer};
use super::lease::NodeLease;
use crate::store::cluster::{self, ClusterStore, NodeId};
use crate::store::tournaments::StoredTournament;
use crate::store::{ResumableGame, StoreError};
use chefshat_room::ids::Id;

/// Most rooms and tournaments of other nodes that are remembered, by id and by join code.
const MAX_REMEMBERED: usize = 10_000;
/// How long it is known which nodes have a lease.
const NODES_KNOWN_FOR: Duration = Duration::from_secs(1);

/// Finds the owners of rooms and tournaments in the database.
pub struct StoreDirectory {
    store: Arc<dyn ClusterStore>,
    lease: Arc<NodeLease>,
    known: Mutex<Known>,
    /// Locked while they are read, so that one request reads them for all.
    nodes: AsyncMutex<Option<Nodes>>,
}

/// The nodes that have a lease, or why they are unknown, and when they were read.
struct Nodes {
    read: Instant,
    alive: Result<BTreeMap<NodeId, Peer>, StoreError>,
}

#[derive(Default)]
struct Known {
    by_id: BTreeMap<Id, Peer>,
    by_code: BTreeMap<String, Peer>,
}

impl StoreDirectory {
    /// Reads from this database, for the node with this lease.
    pub fn new(store: Arc<dyn ClusterStore>, lease: Arc<NodeLease>) -> Self {
        Self {
            store,
            lease,
            known: Mutex::default(),
            nodes: AsyncMutex::default(),
        }
    }

    fn known(&self) -> MutexGuard<'_, Known> {
        (self.known.lock()).expect("nothing panics under this lock")
    }

    /// The location of something that stands in the database.
    async fn location(&self, found: Option<cluster::Location>) -> Result<Location, StoreError> {
        let Some(found) = found else {
            return Ok(Location::Nowhere);
        };
        if found.node.is_some() && found.node == self.lease.node() {
            return Ok(match found.over {
                true => Location::Over(found.id, found.kind),
                false => Location::Here,
            });
        }
        let peer = match found.node {
            Some(node) => self.alive().await?.remove(&node),
            None => None,
        };
        Ok(match peer {
            Some(peer) => Location::Node(peer),
            None if found.over => Location::Over(found.id, found.kind),
            // A node will soon take it over.
            None => Location::Unknown,
        })
    }

    /// The nodes that have a lease.
    async fn alive(&self) -> Result<BTreeMap<NodeId, Peer>, StoreError> {
        let mut nodes = self.nodes.lock().await;
        let recent = |nodes: &&Nodes| nodes.read.elapsed() < NODES_KNOWN_FOR;
        if let Some(nodes) = nodes.as_ref().filter(recent) {
            return nodes.alive.clone();
        }
        let alive = self.store.alive().await.map(|alive| {
            let peers = alive.into_iter().map(|(id, info)| {
                let peer = Peer {
                    node: format!("{} #{}", info.name, id.0).into(),
                    endpoint: info.peer_endpoint.into(),
                };
                (id, peer)
            });
            peers.collect()
        });
        *nodes = Some(Nodes {
            read: Instant::now(),
            alive: alive.clone(),
        });
        alive
    }
}

/// The answer, or that the directory cannot be read.
fn readable(location: Result<Location, StoreError>) -> Location {
    location.unwrap_or_else(|error| {
        debug!(%error, "the owner of a room or tournament cannot be found");
        Location::Unknown
    })
}

/// Remembers a node that owns something.
fn remember<K: Ord>(peers: &mut BTreeMap<K, Peer>, key: K, location: &Location) {
    if let Location::Node(peer) = location {
        if peers.len() >= MAX_REMEMBERED {
            peers.clear();
        }
        peers.insert(key, peer.clone());
    }
}

/// What was read about something that is over.
fn read<T>(ended: Result<Option<T>, StoreError>) -> Option<T> {
    ended.unwrap_or_else(|error| {
        warn!(%error, "a room or tournament that is over cannot be read");
        None
    })
}

impl Directory for StoreDirectory {
    fn ended_room(&self, room: Id) -> BoxFuture<'_, Option<ResumableGame>> {
        self.store.ended_room(room).map(read).boxed()
    }

    fn ended_tournament(&self, tournament: Id) -> BoxFuture<'_, Option<StoredTournament>> {
        self.store.tournament(tournament).map(read).boxed()
    }

    fn locate(&self, id: Id) -> BoxFuture<'_, Location> {
        async move {
            if let Some(peer) = self.known().by_id.get(&id) {
                return Location::Node(peer.clone());
            }
            let location = match self.store.locate(id).await {
                Ok(found) => self.location(found).await,
                Err(error) => Err(error),
            };
            let location = readable(location);
            remember(&mut self.known().by_id, id, &location);
            location
        }
        .boxed()
    }

    fn locate_code<'a>(&'a self, code: &'a str) -> BoxFuture<'a, Location> {
        async move {
            if let Some(peer) = self.known().by_code.get(code) {
                return Location::Node(peer.clone());
            }
            let location = match self.store.locate_code(code).await {
                Ok(found) => self.location(found).await,
                Err(error) => Err(error),
            };
            let location = readable(location);
            remember(&mut self.known().by_code, code.to_owned(), &location);
            location
        }
        .boxed()
    }

    fn nodes(&self) -> BoxFuture<'_, (Arc<str>, Vec<Peer>)> {
        async move {
            let mut alive = self.alive().await.unwrap_or_else(|error| {
                warn!(%error, "the nodes of the cluster are unknown");
                BTreeMap::new()
            });
            let own = self.lease.node().and_then(|node| alive.remove(&node));
            let name = own.map_or_else(|| Arc::from(""), |own| own.node);
            (name, alive.into_values().collect())
        }
        .boxed()
    }

    fn is_over(&self, tournament: Id) -> BoxFuture<'_, bool> {
        async move {
            let found = self.store.locate(tournament).await;
            found.is_ok_and(|found| found.is_some_and(|location| location.over))
        }
        .boxed()
    }

    fn forget(&self, found_by: &FoundBy) {
        let mut known = self.known();
        match found_by {
            FoundBy::Id(id) => drop(known.by_id.remove(id)),
            FoundBy::Code(code) => drop(known.by_code.remove(code)),
        }
    }
}
