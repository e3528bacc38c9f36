//! Several servers in this process that know of each other's rooms and tournaments, as the nodes of
//! a cluster do. What is where stands in a directory that the test fills, so no database is needed.
//! Each node reaches another one through a link of its own, which can delay and break.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::net::SocketAddr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1;
use chefshat_room::ids::{GameId, Id, TournamentId, UnitId};
use chefshat_server::cluster::{Directory, FoundBy, Location, Peer};
use chefshat_server::config::ServerConfig;
use chefshat_server::limits::Key;
use chefshat_server::peers::PeerPort;
use chefshat_server::serve::{ServeError, Server};
use chefshat_server::store::MemoryStore;
use chefshat_server::tls::TlsFiles;
use tokio::task::JoinHandle;
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::link::{Link, listen};

/// Where rooms and tournaments are, for all nodes.
#[derive(Debug, Default)]
struct Places {
    by_id: HashMap<UnitId, usize>,
    by_code: HashMap<String, usize>,
    by_game: HashMap<GameId, usize>,
    /// What a node wrongly remembers: an owner, and how often it must be forgotten.
    stale: HashMap<(usize, UnitId), (usize, u32)>,
}

/// The directory of one node.
#[derive(Debug)]
struct View {
    node: usize,
    /// The other nodes, as this one reaches them.
    peers: Vec<Peer>,
    places: Arc<Mutex<Places>>,
    /// How often an owner was forgotten.
    forgotten: Arc<AtomicU64>,
}

impl View {
    fn location(&self, node: Option<usize>) -> Location {
        match node {
            None => Location::Nowhere,
            Some(node) if node == self.node => Location::Here,
            Some(node) => Location::Node(self.peers[node].clone()),
        }
    }
}

#[tonic::async_trait]
impl Directory for View {
    async fn nodes(&self) -> (Arc<str>, Vec<Peer>) {
        let mut others = self.peers.clone();
        let own = others.remove(self.node);
        (own.node, others)
    }

    async fn is_over(&self, _tournament: TournamentId) -> bool {
        false
    }

    async fn locate(&self, found_by: &FoundBy, _caller: Key) -> Location {
        let places = self.places.lock().expect("nothing panics under this lock");
        self.location(match found_by {
            FoundBy::Id(id) => {
                let stale = places.stale.get(&(self.node, *id)).map(|(node, _)| *node);
                stale.or(places.by_id.get(id).copied())
            }
            FoundBy::Code(code) => places.by_code.get(code).copied(),
            FoundBy::Game(game) => places.by_game.get(game).copied(),
        })
    }

    fn forget(&self, found_by: &FoundBy) {
        self.forgotten.fetch_add(1, Ordering::Relaxed);
        let mut places = self.places.lock().expect("nothing panics under this lock");
        if let FoundBy::Id(id) = found_by
            && let Entry::Occupied(mut stale) = places.stale.entry((self.node, *id))
        {
            stale.get_mut().1 -= 1;
            if stale.get().1 == 0 {
                stale.remove();
            }
        }
    }
}

/// A server that runs until it is dropped.
#[derive(Debug)]
pub struct TestNode {
    /// Where clients connect.
    pub address: SocketAddr,
    /// Where other nodes connect.
    pub peer_address: SocketAddr,
    /// How often it has forgotten an owner.
    pub forgotten: Arc<AtomicU64>,
    _serving: JoinHandle<Result<(), ServeError>>,
    _stops_when_dropped: DropGuard,
}

impl TestNode {
    /// Its URL.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// An SDK client with a separate connection.
    pub async fn client(&self) -> Client {
        Client::connect(&self.url())
            .await
            .expect("the node listens")
    }
}

/// Nodes that know each other.
#[derive(Debug)]
pub struct TestNodes {
    /// The nodes.
    pub nodes: Vec<TestNode>,
    /// `links[from][to]`.
    links: Vec<Vec<Link>>,
    places: Arc<Mutex<Places>>,
}

impl TestNodes {
    /// This many nodes, without encryption between them.
    pub async fn start(count: usize) -> Self {
        Self::with(count, |_| {}, None).await
    }

    /// Nodes configured by `configure`, with these certificates for connections between them.
    pub async fn with(
        count: usize,
        configure: impl Fn(&mut ServerConfig),
        tls: Option<TlsFiles>,
    ) -> Self {
        let places = Arc::new(Mutex::new(Places::default()));
        // Finished games are at all nodes.
        let store = Arc::new(MemoryStore::default());
        let mut sockets = Vec::new();
        for _ in 0..count {
            sockets.push((listen().await, listen().await));
        }
        let peer_addresses: Vec<SocketAddr> = (sockets.iter())
            .map(|(_, peers)| peers.local_addr().expect("it is bound"))
            .collect();
        let (mut nodes, mut links) = (Vec::new(), Vec::new());
        for (node, (clients, peer_listener)) in sockets.into_iter().enumerate() {
            let mut links_of_node = Vec::new();
            for address in &peer_addresses {
                links_of_node.push(Link::to(*address).await);
            }
            let forgotten = Arc::new(AtomicU64::new(0));
            let view = View {
                node,
                peers: (links_of_node.iter().enumerate())
                    .map(|(number, link)| Peer {
                        node: format!("node {number}").into(),
                        endpoint: link.address.to_string().into(),
                    })
                    .collect(),
                places: Arc::clone(&places),
                forgotten: Arc::clone(&forgotten),
            };
            let mut config = ServerConfig {
                grace: Duration::ZERO,
                ..ServerConfig::default()
            };
            configure(&mut config);
            let server = Server::of_node(config, store.clone(), Arc::new(view)).await;
            let port = PeerPort::new(peer_listener, tls.clone()).expect("usable");
            let server = server.expect("a server").with_peers(port);
            let address = clients.local_addr().expect("it is bound");
            let stop = CancellationToken::new();
            let stopped = stop.clone().cancelled_owned();
            nodes.push(TestNode {
                address,
                peer_address: peer_addresses[node],
                forgotten,
                _serving: tokio::spawn(server.serve(clients, stopped)),
                _stops_when_dropped: stop.drop_guard(),
            });
            links.push(links_of_node);
        }
        Self {
            nodes,
            links,
            places,
        }
    }

    /// The link over which a node reaches another.
    pub fn link(&self, from: usize, to: usize) -> &Link {
        &self.links[from][to]
    }

    /// Tells all nodes where a room or tournament is.
    pub fn place(&self, node: usize, id: &str, join_code: &str) {
        let mut places = self.places.lock().expect("nothing panics under this lock");
        places.by_id.insert(Id::parse(id).expect("an id"), node);
        places.by_code.insert(join_code.to_owned(), node);
    }

    /// Tells all nodes where a game is played.
    pub fn place_game(&self, node: usize, game: &str) {
        let mut places = self.places.lock().expect("nothing panics under this lock");
        places.by_game.insert(Id::parse(game).expect("an id"), node);
    }

    /// Makes a node believe that `owner` has something, until it has forgotten it this often.
    pub fn mislead(&self, node: usize, id: &str, owner: usize, times: u32) {
        let mut places = self.places.lock().expect("nothing panics under this lock");
        let id = Id::parse(id).expect("an id");
        places.stale.insert((node, id), (owner, times));
    }

    /// Creates a room on a node.
    pub async fn create_room(
        &self,
        node: usize,
        request: v1::CreateRoomRequest,
    ) -> v1::CreateRoomResponse {
        let client = self.nodes[node].client().await;
        let created = client.create_room(request).await.expect("a new room");
        let id = &created.room.as_ref().expect("a room").room_id;
        self.place(node, id, &created.join_code);
        created
    }
}
