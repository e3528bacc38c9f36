//! A cluster as it is operated: server processes as nodes on a PostgreSQL server, behind a proxy.
//! Between each node and the database, and between each two nodes, is a way that can hold and break.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use chefshat_client::Client;
use chefshat_postgres::{Database, Server as Postgres};
use chefshat_tests::{Ended, Held, Launch, Link, Process, Way, own_address, patiently, set_up};
use futures::future::join_all;
use procfs::process::{FDTarget, Process as Running};
use tempfile::TempDir;
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_check_response::ServingStatus;
use tonic_health::pb::health_client::HealthClient;

use crate::certificates::Authority;
use crate::proxy::Proxy;

/// The port on which nodes listen for others, each on an address of its own.
const PEER_PORT: u16 = 50_052;
/// Time between two looks at the database.
/// Each look starts a `psql`.
const LOOK_AGAIN: Duration = Duration::from_millis(200);
/// How much of the log of a node is shown when a test fails, bytes.
const SHOWN: usize = 20_000;

/// How long leases last. As on real machines also means that the database syncs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Leases {
    /// A takeover takes about a second. A very busy machine cannot keep them, and plays when it can.
    Short,
    /// Kept on a machine that is ten times as busy as it should be.
    Steady,
    /// As on real machines.
    Default,
}

/// A running cluster. Its processes end when it is dropped.
pub(crate) struct Cluster {
    pub(crate) nodes: Vec<Node>,
    pub(crate) postgres: Postgres,
    pub(crate) database: Database,
    proxy: Proxy,
    pairs: Arc<Pairs>,
    folder: TempDir,
}

/// A node.
pub(crate) struct Node {
    launch: Launch,
    process: Option<Process>,
    /// Its way to the database.
    pub(crate) database: Link,
    /// In front of its listener for other nodes.
    peers: Link,
    log: PathBuf,
}

/// The ways between nodes.
struct Pairs {
    /// From each node to each.
    ways: Vec<Vec<Way>>,
    /// The processes of the nodes that run.
    processes: Mutex<Vec<Option<u32>>>,
}

impl Pairs {
    fn new(nodes: usize) -> Self {
        Self {
            ways: (0..nodes)
                .map(|_| (0..nodes).map(|_| Way::default()).collect())
                .collect(),
            processes: Mutex::new(vec![None; nodes]),
        }
    }

    /// Notes which processes the nodes are.
    fn note_processes(&self, nodes: &[Node]) {
        let ids = nodes.iter().map(Node::process_id).collect();
        *self.processes.lock().expect("no panic") = ids;
    }

    /// The node whose process has a connection from this address.
    fn node_of(&self, origin: SocketAddr) -> Option<usize> {
        let sockets = procfs::net::tcp().ok()?;
        let inode = (sockets.iter()).find(|socket| socket.local_address == origin)?;
        let has_it = |process: &Option<u32>| {
            let process = process.and_then(|id| Running::new(i32::try_from(id).ok()?).ok());
            let mut open = process.and_then(|process| process.fd().ok());
            open.as_mut().is_some_and(|open| {
                open.flatten()
                    .any(|file| file.target == FDTarget::Socket(inode.inode))
            })
        };
        let processes = self.processes.lock().expect("no panic");
        processes.iter().position(has_it)
    }
}

impl Cluster {
    /// Starts this many nodes.
    pub(crate) async fn start(count: usize, leases: Leases) -> Self {
        Self::start_with(count, leases, |launch| launch).await
    }

    /// The same, each launched in a special way.
    pub(crate) async fn start_with(
        count: usize,
        leases: Leases,
        mut special: impl FnMut(Launch) -> Launch,
    ) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let postgres = tokio::task::block_in_place(match leases {
            Leases::Short | Leases::Steady => Postgres::start,
            Leases::Default => Postgres::syncing,
        });
        let database = tokio::task::block_in_place(|| postgres.database());
        let authority = Authority::new(folder.path());
        let pairs = Arc::new(Pairs::new(count));
        let mut nodes = Vec::new();
        for number in 0..count {
            let link = Link::to(postgres.address()).await;
            let (own, through) = (postgres.address().to_string(), link.address.to_string());
            let url = database.url().replace(&own, &through);
            let folder = folder.path().join(format!("node{number}"));
            std::fs::create_dir(&folder).expect("a new folder");
            let certificate = authority.certificate(&folder);
            let listens = SocketAddr::from((own_address(), PEER_PORT));
            let ways = Arc::clone(&pairs);
            let way_of = move |origin| {
                let from = ways.node_of(origin)?;
                Some(ways.ways[from][number].clone())
            };
            let peers = Link::by_origin(listens, Way::default(), way_of).await;
            let log = folder.join("log");
            let shell = format!("exec \"$0\" \"$@\" 2>>{}", log.display());
            let launch = Launch::new(&folder.join("data"))
                .through(["sh", "-c", &shell])
                .with("--database", url)
                .with("--peer-listen", listens)
                .with("--peer-endpoint", peers.address)
                .with("--peer-cert", certificate.certificate.display())
                .with("--peer-key", certificate.key.display())
                .with("--peer-ca", certificate.authority.display());
            let launch = match leases {
                Leases::Short => launch.with("--lease", 1_000),
                Leases::Steady => launch.with("--lease", 4_000),
                Leases::Default => launch,
            };
            nodes.push(Node {
                launch: special(launch),
                process: None,
                database: link,
                peers,
                log,
            });
        }
        join_all(nodes.iter_mut().map(Node::launch)).await;
        pairs.note_processes(&nodes);
        let serving = async {
            for node in &nodes {
                while node.health().await != ServingStatus::Serving {
                    tokio::time::sleep(LOOK_AGAIN).await;
                }
            }
        };
        patiently("all nodes to be reached", serving).await;
        let addresses: Vec<SocketAddr> = nodes.iter().map(Node::address).collect();
        let proxy = Proxy::start(&addresses, folder.path()).await;
        Self {
            nodes,
            postgres,
            database,
            proxy,
            pairs,
            folder,
        }
    }

    /// Where clients connect.
    pub(crate) fn url(&self) -> String {
        self.proxy.url()
    }

    /// Starts a node again.
    pub(crate) async fn restart(&mut self, node: usize) {
        self.nodes[node].launch().await;
        self.pairs.note_processes(&self.nodes);
    }

    /// Upgrades the database for the binary of this build, with which nodes start from here on.
    pub(crate) fn upgrade(&mut self) {
        let mut migrate = Command::new(set_up("CHEFSHAT_BIN"));
        migrate.args(["migrate", "--database", self.database.url()]);
        let upgraded = tokio::task::block_in_place(|| migrate.status());
        assert!(upgraded.expect("the binary starts").success());
        self.nodes
            .iter_mut()
            .for_each(|node| node.launch.own_binary());
    }

    /// Kills a node.
    pub(crate) async fn kill(&mut self, node: usize) {
        self.nodes[node].take().kill().await;
    }

    /// Asks a node to stop and waits until it has.
    pub(crate) async fn stop(&mut self, node: usize) {
        let ended = self.nodes[node].take().stop().await;
        assert!(ended.status.success(), "node {node}: {ended:?}");
    }

    /// The way from one node to another.
    pub(crate) fn way(&self, from: usize, to: usize) -> &Way {
        &self.pairs.ways[from][to]
    }

    /// Holds everything between two nodes, in both directions.
    pub(crate) fn separate(&self, one: usize, other: usize) {
        for (from, to) in [(one, other), (other, one)] {
            self.way(from, to).hold(Held::Everything);
        }
    }

    /// Ends a separation; the connections of that time are lost.
    pub(crate) fn join(&self, one: usize, other: usize) {
        for (from, to) in [(one, other), (other, one)] {
            self.way(from, to).cut();
            self.way(from, to).hold(Held::Nothing);
        }
    }

    /// Holds everything that other nodes send to this one.
    pub(crate) fn hide(&self, node: usize) {
        for from in &self.pairs.ways {
            from[node].hold(Held::Everything);
        }
    }

    /// Ends what `hide` began; the connections of that time are lost.
    pub(crate) fn show(&self, node: usize) {
        for from in &self.pairs.ways {
            from[node].cut();
            from[node].hold(Held::Nothing);
        }
    }

    /// The processes of all nodes, which run.
    pub(crate) fn process_ids(&self) -> Vec<u32> {
        self.nodes.iter().filter_map(Node::process_id).collect()
    }

    /// What SQL returns.
    pub(crate) fn select(&self, sql: &str) -> String {
        tokio::task::block_in_place(|| self.database.run(sql))
    }

    /// Ends the connections of a node to the database, from the side of the database.
    pub(crate) fn terminate_connections(&self, node: usize) {
        let ports = self.nodes[node].database.way().ports();
        let ports: Vec<String> = ports.iter().map(u16::to_string).collect();
        self.select(&format!(
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE client_port = ANY ('{{{}}}')",
            ports.join(",")
        ));
    }

    /// Waits until other nodes have everything that a node owned. It must not be able to beat.
    pub(crate) async fn taken_over(&self, node: usize) {
        let owned = format!(
            "SELECT count(*) FROM owned JOIN nodes USING (node) WHERE NOT over AND peer_endpoint = '{}'",
            self.nodes[node].peers.address
        );
        let all = async {
            while self.select(&owned) != "0" {
                tokio::time::sleep(LOOK_AGAIN).await;
            }
        };
        patiently("a takeover", all).await;
    }

    /// The ids of the games that a node owns and that are not over.
    pub(crate) fn games_of(&self, node: usize) -> Vec<String> {
        let games = self.select(&format!(
            "SELECT encode(game_id, 'hex') FROM owned JOIN nodes USING (node) WHERE NOT over AND game_id IS NOT NULL \
             AND peer_endpoint = '{}'",
            self.nodes[node].peers.address
        ));
        games.lines().map(str::to_owned).collect()
    }

    /// What stands in the database in this column of a node.
    pub(crate) fn select_of(&self, column: &str, node: usize) -> String {
        let endpoint = self.nodes[node].peers.address;
        self.select(&format!(
            "SELECT {column} FROM nodes WHERE peer_endpoint = '{endpoint}' ORDER BY beat_ms DESC LIMIT 1"
        ))
    }

    /// How many rooms that are not over each node owns.
    pub(crate) fn rooms_of_nodes(&self) -> Vec<usize> {
        let owners = self.select(
            "SELECT peer_endpoint FROM owned JOIN nodes USING (node) WHERE NOT over AND game_id IS NOT NULL",
        );
        let owned = |node: &Node| {
            let endpoint = node.peers.address.to_string();
            owners.lines().filter(|owner| *owner == endpoint).count()
        };
        self.nodes.iter().map(owned).collect()
    }

    /// Waits until the numbers of rooms that nodes own differ by less than this part of the largest.
    pub(crate) async fn balanced(&self, percent: usize) {
        let balanced = async {
            loop {
                let rooms = self.rooms_of_nodes();
                let (least, most) = (rooms.iter().min(), rooms.iter().max());
                let (least, most) = (least.expect("nodes"), most.expect("nodes"));
                if (most - least) * 100 < percent * most {
                    return;
                }
                tokio::time::sleep(LOOK_AGAIN).await;
            }
        };
        patiently("nodes that are about equally full", balanced).await;
    }

    /// The node that owns a room or tournament.
    pub(crate) fn owner_of(&self, id: &str) -> usize {
        let endpoint = self.select(&format!(
            "SELECT peer_endpoint FROM owned JOIN nodes USING (node) WHERE id = '\\x{id}'"
        ));
        let is_owner = |node: &Node| node.peers.address.to_string() == endpoint;
        (self.nodes.iter().position(is_owner)).expect("one of the nodes owns it")
    }

    /// Ends the database and starts it again.
    pub(crate) fn restart_database(&mut self, end: impl FnOnce(&mut Postgres)) {
        tokio::task::block_in_place(|| {
            end(&mut self.postgres);
            self.postgres.resume();
        });
    }

    /// Kills the database. Its address leads to this standby from then on, which is promoted. Returns
    /// when it was killed.
    pub(crate) fn fail_over(&mut self, standby: Postgres) -> Instant {
        tokio::task::block_in_place(|| self.postgres.kill());
        let killed = Instant::now();
        for node in &self.nodes {
            node.database.lead_to(standby.address());
        }
        tokio::task::block_in_place(|| standby.promote());
        self.database = standby.copy_of(&self.database);
        self.postgres = standby;
        killed
    }
}

impl Node {
    async fn launch(&mut self) {
        match self.launch.start().await {
            Ok(process) => self.process = Some(process),
            Err(Ended { status, .. }) => {
                panic!("a node does not start: {status}\n{}", end_of(&self.log))
            }
        }
    }

    /// The process, which runs.
    pub(crate) fn process(&self) -> &Process {
        self.process.as_ref().expect("the node runs")
    }

    fn process_id(&self) -> Option<u32> {
        self.process.as_ref().map(Process::id)
    }

    fn take(&mut self) -> Process {
        self.process.take().expect("the node runs")
    }

    /// Where it listens for clients.
    fn address(&self) -> SocketAddr {
        let url = self.launch.url();
        let address = url.trim_start_matches("http://");
        address.parse().expect("an address")
    }

    /// What it has said at last.
    pub(crate) fn said(&self) -> String {
        end_of(&self.log)
    }

    /// What a health check says.
    pub(crate) async fn health(&self) -> ServingStatus {
        let mut service = HealthClient::new(self.client().await.channel());
        let answer = service.check(HealthCheckRequest::default()).await;
        answer.expect("it answers").into_inner().status()
    }

    /// Where clients connect that go past the proxy.
    pub(crate) fn url(&self) -> String {
        self.launch.url()
    }

    /// A client that goes past the proxy.
    pub(crate) async fn client(&self) -> Client {
        let connecting = Client::connect(self.url()).await;
        connecting.expect("the node listens")
    }
}

impl Drop for Cluster {
    /// Shows what the nodes said if the test fails.
    fn drop(&mut self) {
        if !std::thread::panicking() {
            return;
        }
        for (number, node) in self.nodes.iter().enumerate() {
            eprintln!("---- node {number} said at last:\n{}", end_of(&node.log));
        }
        let log = self.folder.path().join("proxy.log");
        eprintln!("---- the proxy said at last:\n{}", end_of(&log));
    }
}

fn end_of(log: &Path) -> String {
    let said = std::fs::read(log).unwrap_or_default();
    let end = &said[said.len().saturating_sub(SHOWN)..];
    String::from_utf8_lossy(end).into_owned()
}
