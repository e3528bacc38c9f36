//! Several servers in this process that know of each other's rooms and tournaments, as the nodes of
//! a cluster do. What is where stands in a directory that the test fills, so no database is needed.
//! Each node reaches another one through a link of its own, which can delay and break.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use chefshat_client::Client;
use chefshat_proto::v1;
use chefshat_room::ids::Id;
use chefshat_server::cluster::{Directory, FoundBy, Location, Peer, PeerPort};
use chefshat_server::config::ServerConfig;
use chefshat_server::serve::{ServeError, Server};
use chefshat_server::store::MemoryStore;
use chefshat_server::tls::TlsFiles;
use futures::FutureExt as _;
use futures::future::{BoxFuture, ready};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, mpsc};
use tokio::task::JoinHandle;
use tokio::time::Instant;
use tokio_util::sync::{CancellationToken, DropGuard};

/// Bytes that a link reads at a time.
const LINK_BUFFER: usize = 16 * 1024;

/// Where rooms and tournaments are, for all nodes.
#[derive(Debug, Default)]
struct Places {
    by_id: HashMap<Id, usize>,
    by_code: HashMap<String, usize>,
    /// What a node wrongly remembers: an owner, and how often it must be forgotten.
    stale: HashMap<(usize, Id), (usize, u32)>,
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
    fn location(&self, node: Option<usize>) -> BoxFuture<'static, Location> {
        ready(match node {
            None => Location::Nowhere,
            Some(node) if node == self.node => Location::Here,
            Some(node) => Location::Node(self.peers[node].clone()),
        })
        .boxed()
    }
}

impl Directory for View {
    fn locate(&self, id: Id) -> BoxFuture<'_, Location> {
        let places = self.places.lock().expect("nothing panics under this lock");
        let stale = places.stale.get(&(self.node, id)).map(|(node, _)| *node);
        self.location(stale.or(places.by_id.get(&id).copied()))
    }

    fn locate_code<'a>(&'a self, code: &'a str) -> BoxFuture<'a, Location> {
        let places = self.places.lock().expect("nothing panics under this lock");
        self.location(places.by_code.get(code).copied())
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

async fn listen() -> TcpListener {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
    listener.expect("a free port")
}

/// A way over TCP that can delay and break.
#[derive(Debug)]
pub struct Link {
    address: SocketAddr,
    delay_us: Arc<AtomicU64>,
    cut: Arc<Notify>,
    accepting: JoinHandle<()>,
}

impl Link {
    async fn to(target: SocketAddr) -> Self {
        let listener = listen().await;
        let address = listener.local_addr().expect("it is bound");
        let (delay_us, cut) = (Arc::new(AtomicU64::new(0)), Arc::new(Notify::new()));
        let accepting = {
            let (delay_us, cut) = (Arc::clone(&delay_us), Arc::clone(&cut));
            async move {
                while let Ok((near, _)) = listener.accept().await {
                    let (delay_us, cut) = (Arc::clone(&delay_us), Arc::clone(&cut));
                    tokio::spawn(async move {
                        // Asked first, so that no cut is missed.
                        let cut = cut.notified();
                        let Ok(far) = TcpStream::connect(target).await else {
                            return;
                        };
                        let _ = (near.set_nodelay(true), far.set_nodelay(true));
                        let (near_read, near_write) = near.into_split();
                        let (far_read, far_write) = far.into_split();
                        tokio::select! {
                            () = cut => {}
                            _ = carry(near_read, far_write, &delay_us) => {}
                            _ = carry(far_read, near_write, &delay_us) => {}
                        }
                    });
                }
            }
        };
        Self {
            address,
            delay_us,
            cut,
            accepting: tokio::spawn(accepting),
        }
    }

    /// Delays everything in both directions from now on.
    pub fn delay(&self, delay: Duration) {
        let micros = u64::try_from(delay.as_micros()).expect("short");
        self.delay_us.store(micros, Ordering::Relaxed);
    }

    /// Breaks the connections. New ones are possible.
    pub fn cut(&self) {
        self.cut.notify_waiters();
    }
}

impl Link {
    /// Breaks the connections, and refuses new ones.
    pub fn close(&self) {
        self.accepting.abort();
        self.cut();
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.close();
    }
}

/// Carries what arrives, each part after its delay, in order.
async fn carry(
    mut from: tokio::net::tcp::OwnedReadHalf,
    mut to: tokio::net::tcp::OwnedWriteHalf,
    delay_us: &AtomicU64,
) -> io::Result<()> {
    let (sender, mut receiver) = mpsc::unbounded_channel::<(Instant, Vec<u8>)>();
    let reading = async {
        let mut buffer = vec![0; LINK_BUFFER];
        loop {
            let count = from.read(&mut buffer).await?;
            if count == 0 {
                return Ok(());
            }
            let delay = Duration::from_micros(delay_us.load(Ordering::Relaxed));
            let _ = sender.send((Instant::now() + delay, buffer[..count].to_vec()));
        }
    };
    let writing = async {
        while let Some((due, bytes)) = receiver.recv().await {
            tokio::time::sleep_until(due).await;
            to.write_all(&bytes).await?;
        }
        Ok(())
    };
    tokio::select! {
        ended = reading => ended,
        ended = writing => ended,
    }
}
