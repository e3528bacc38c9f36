//! `chefshat cluster`: the nodes of a cluster, as its database knows them; and the settings with
//! which `chefshat serve` becomes one.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;

use chefshat_server::cluster::LeaseTimes;
use chefshat_server::peers::PeerPort;
use chefshat_server::store::cluster::{ClusterStore, NodeInfo, NodeStatus, WithoutNode};
use chefshat_server::store::{PostgresOptions, PostgresStore, Store as _};
use chefshat_server::tls::TlsFiles;
use clap::{Args, Subcommand};
use serde_json::json;

use super::listen;
use super::numbers::counted;
use super::output::{heading, table};
use super::{CommandError, say};

/// The database that the nodes share.
#[derive(Debug, Args)]
struct DatabaseArg {
    /// Address of the database.
    #[arg(
        long,
        env = "CHEFSHAT_DATABASE",
        hide_env_values = true,
        value_name = "URL"
    )]
    database: String,
}

impl DatabaseArg {
    async fn open(&self) -> Result<PostgresStore, CommandError> {
        Ok(PostgresStore::open_existing(&self.database, PostgresOptions::default()).await?)
    }
}

/// Show the nodes of a cluster, or make one hand over what it owns.
#[derive(Debug, Args)]
pub(super) struct ClusterCommand {
    #[command(subcommand)]
    command: Subcommands,
}

#[derive(Debug, Subcommand)]
enum Subcommands {
    /// Show the nodes, living ones first: version, last heartbeat, lease, what they own; and what nobody owns.
    Status(Status),
    /// Make a node hand over all rooms, tournaments and studies to the others, and stop.
    Drain(Drain),
}

/// Show the nodes, living ones first: version, last heartbeat, lease, what they own; and what nobody owns.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat cluster status --database postgres://chefshat@db.example.org/chefshat"
)]
struct Status {
    #[command(flatten)]
    database: DatabaseArg,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Make a node hand over all rooms, tournaments and studies to the others, and stop.
#[derive(Debug, Args)]
#[command(
    after_help = "The node stops once it owns nothing; a supervisor that restarts it makes it a new node. SIGTERM does the same.\n\n\
                  Example:\n  chefshat cluster drain one"
)]
struct Drain {
    /// Number or name of the node, as `chefshat cluster status` shows them.
    node: String,
    #[command(flatten)]
    database: DatabaseArg,
    /// Print the node as a JSON line.
    #[arg(long)]
    json: bool,
}

impl ClusterCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.command {
            Subcommands::Status(status) => status.run().await,
            Subcommands::Drain(drain) => drain.run().await,
        }
    }
}

impl Status {
    async fn run(self) -> Result<ExitCode, CommandError> {
        let store = self.database.open().await?;
        let found = (store.nodes().await, store.without_node().await);
        store.close().await;
        let (nodes, without_node) = (found.0?, found.1?);
        let WithoutNode {
            rooms,
            tournaments,
            studies,
        } = without_node;
        if self.json {
            let nodes: Vec<_> = nodes.iter().map(as_json).collect();
            let without_node =
                json!({ "rooms": rooms, "tournaments": tournaments, "studies": studies });
            say(json!({ "nodes": nodes, "without_node": without_node }))?;
            return Ok(ExitCode::SUCCESS);
        }
        let mut text = String::new();
        heading(&mut text, "nodes");
        let header = [
            "node",
            "name",
            "version",
            "state",
            "last heartbeat",
            "rooms",
            "tournaments",
            "studies",
            "peers",
        ];
        table(&mut text, &header, &[1, 2, 3, 8], nodes.iter().map(as_row));
        let mut out = anstream::stdout().lock();
        write!(out, "{text}")?;
        if without_node != WithoutNode::default() {
            writeln!(
                out,
                "\nwithout a node that lives: {}, {}, {}",
                counted(rooms, "room"),
                counted(tournaments, "tournament"),
                counted(studies, "study"),
            )?;
        }
        out.flush()?;
        Ok(ExitCode::SUCCESS)
    }
}

/// What a node is doing.
fn state(node: &NodeStatus) -> &'static str {
    match node {
        NodeStatus { expired: true, .. } => "lost",
        NodeStatus { drain: true, .. } => "draining",
        NodeStatus { reached: false, .. } => "not reached",
        _ => "serving",
    }
}

/// The same for people, with what is wrong with a node that lives.
fn state_in_words(node: &NodeStatus) -> String {
    let mut words = state(node).to_owned();
    if !node.expired && node.unreachable > 0 {
        let others = counted(node.unreachable.into(), "other");
        words.push_str(&format!(", does not reach {others}"));
    }
    if !node.expired && node.is_stalled {
        words.push_str(", commits wait");
    }
    words
}

fn as_json(node: &NodeStatus) -> serde_json::Value {
    json!({
        "node": node.id.0,
        "name": node.info.name,
        "version": node.info.build,
        "state": state(node),
        "lease_expired": node.expired,
        "reached": node.reached,
        "unreachable": node.unreachable,
        "stalled": node.is_stalled,
        "last_beat_ms": node.last_beat.as_millis(),
        "rooms": node.rooms,
        "tournaments": node.tournaments,
        "studies": node.studies,
        "capacity": node.info.capacity,
        "peer_endpoint": node.info.peer_endpoint,
        "client_endpoint": node.info.client_endpoint,
    })
}

fn as_row(node: &NodeStatus) -> Vec<String> {
    vec![
        node.id.0.to_string(),
        node.info.name.clone(),
        node.info.build.clone(),
        state_in_words(node),
        format!("{:.1} s ago", node.last_beat.as_secs_f64()),
        node.rooms.to_string(),
        node.tournaments.to_string(),
        node.studies.to_string(),
        node.info.peer_endpoint.clone(),
    ]
}

impl Drain {
    async fn run(self) -> Result<ExitCode, CommandError> {
        let store = self.database.open().await?;
        let asked = self.ask(&store).await;
        store.close().await;
        asked?;
        Ok(ExitCode::SUCCESS)
    }

    async fn ask(&self, store: &PostgresStore) -> Result<(), CommandError> {
        let nodes = store.nodes().await?;
        let matching: Vec<_> = (nodes.iter())
            .filter(|node| !node.expired)
            .filter(|node| node.id.0.to_string() == self.node || node.info.name == self.node)
            .collect();
        let node = match matching.as_slice() {
            [node] => node,
            [] => {
                return Err(format!(
                    "no node with a lease has the number or name {:?}; see `chefshat cluster status`",
                    self.node
                )
                .into());
            }
            _ => {
                return Err(format!(
                    "several nodes have the name {:?}; use the number that `chefshat cluster status` shows",
                    self.node
                )
                .into());
            }
        };
        if !store.request_drain(node.id).await? {
            return Err(format!("node {} has just left", node.id.0).into());
        }
        if self.json {
            return say(json!({ "event": "draining", "node": as_json(node) }));
        }
        say(format_args!(
            "node {} ({}) hands over {}, {} and {}, then stops",
            node.id.0,
            node.info.name,
            counted(node.rooms, "room"),
            counted(node.tournaments, "tournament"),
            counted(node.studies, "study"),
        ))?;
        Ok(())
    }
}

/// The settings with which a server is a node of a cluster.
#[derive(Debug, Args)]
pub(super) struct NodeSettings {
    /// Run as a node of a cluster that shares this PostgreSQL database, such as
    /// postgres://chefshat@db.example.org/chefshat. Games are stored there; the data directory has
    /// only keys and tokens. See docs/cluster.md.
    #[arg(
        long,
        env = "CHEFSHAT_DATABASE",
        hide_env_values = true,
        value_name = "URL"
    )]
    pub(super) database: Option<String>,
    /// Name of the node for people. Default: the name of the machine.
    #[arg(long, env = "CHEFSHAT_NODE_NAME", value_name = "NAME")]
    node_name: Option<String>,
    /// Address and port on which a node receives the other nodes. Without certificates, a loopback
    /// address.
    #[arg(long, env = "CHEFSHAT_PEER_LISTEN", value_name = "HOST:PORT", default_value = "127.0.0.1:0", value_parser = listen::host_and_port)]
    peer_listen: String,
    /// Where other nodes reach that address. Default: the address of --peer-listen.
    #[arg(long, env = "CHEFSHAT_PEER_ENDPOINT", value_name = "HOST:PORT", value_parser = listen::host_and_port)]
    peer_endpoint: Option<String>,
    /// Where clients reach this node without the balancer, such as https://node1.example.org:50051:
    /// sent to clients that ask for it.
    #[arg(long, env = "CHEFSHAT_CLIENT_ENDPOINT", value_name = "URL")]
    client_endpoint: Option<String>,
    /// Certificate of the node for connections between nodes, PEM; its name is chefshat-node.
    #[arg(long, env = "CHEFSHAT_PEER_CERT", value_name = "FILE")]
    peer_cert: Option<PathBuf>,
    /// File with the private key of that certificate, PEM.
    #[arg(long, env = "CHEFSHAT_PEER_KEY", value_name = "FILE")]
    peer_key: Option<PathBuf>,
    /// File with the authority that signs the certificates of nodes, and of nothing else, PEM.
    #[arg(long, env = "CHEFSHAT_PEER_CA", value_name = "FILE")]
    peer_ca: Option<PathBuf>,
    /// Milliseconds after which the lease of a node that does not beat expires, the same for all
    /// nodes: short ones are for tests.
    #[arg(long, hide = true, value_name = "MS", value_parser = lease)]
    pub(super) lease: Option<LeaseTimes>,
}

/// The times of leases that expire after these milliseconds, in the usual proportions.
fn lease(text: &str) -> Result<LeaseTimes, String> {
    let expire_after_ms: u64 = text.parse().map_err(|_| "use a number".to_owned())?;
    let quarter_ms = expire_after_ms / 4;
    LeaseTimes::new(quarter_ms, 3 * quarter_ms, expire_after_ms).map_err(|error| error.to_string())
}

/// A node that is about to join.
pub(super) struct NewNode {
    pub(super) store: Arc<PostgresStore>,
    pub(super) info: NodeInfo,
    pub(super) port: PeerPort,
}

impl NodeSettings {
    /// Opens the database and the socket for other nodes; `None` for a single server. `capacity`:
    /// most rooms and tournaments that the node takes over.
    pub(super) async fn open(
        &self,
        capacity: usize,
        options: PostgresOptions,
    ) -> Result<Option<NewNode>, CommandError> {
        let Some(database) = &self.database else {
            return Ok(None);
        };
        let listener = listen::tcp(&self.peer_listen, "--peer-listen").await?;
        let address = listener.local_addr()?;
        let peer_endpoint = match &self.peer_endpoint {
            Some(endpoint) => endpoint.clone(),
            None if address.ip().is_unspecified() => {
                return Err(format!(
                    "other nodes cannot reach {address}; say with --peer-endpoint where they reach this node"
                )
                .into());
            }
            None => address.to_string(),
        };
        let port = PeerPort::new(listener, self.tls()?)?;
        let store = PostgresStore::open(database, options).await?;
        Ok(Some(NewNode {
            store: Arc::new(store),
            info: NodeInfo {
                name: self.node_name.clone().unwrap_or_else(host_name),
                peer_endpoint,
                client_endpoint: self.client_endpoint.clone().unwrap_or_default(),
                build: env!("CARGO_PKG_VERSION").to_owned(),
                capacity: capacity as u64,
            },
            port,
        }))
    }

    fn tls(&self) -> Result<Option<TlsFiles>, CommandError> {
        match (&self.peer_cert, &self.peer_key, &self.peer_ca) {
            (Some(certificate), Some(key), Some(authority)) => Ok(Some(TlsFiles {
                certificate: certificate.clone(),
                key: key.clone(),
                client_authority: Some(authority.clone()),
            })),
            (None, None, None) => Ok(None),
            _ => Err("--peer-cert, --peer-key and --peer-ca must be given together".into()),
        }
    }
}

/// The name of this machine.
fn host_name() -> String {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname");
    let name = name.map(|name| name.trim().to_owned()).unwrap_or_default();
    match name.is_empty() {
        true => "node".to_owned(),
        false => name,
    }
}
