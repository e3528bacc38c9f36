//! A real proxy in front of the nodes: HAProxy from Debian with the configuration of docker/proxies,
//! which spreads calls and streams over the nodes that say that they serve.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::process::Stdio;

use chefshat_tests::{own_address, patiently};
use tokio::net::TcpStream;
use tokio::process::{Child, Command};

const PROGRAM: &str = "/usr/sbin/haproxy";
const PORT: u16 = 50_050;

/// The proxy. Killed when dropped.
#[derive(Debug)]
pub(crate) struct Proxy {
    address: Ipv4Addr,
    _process: Child,
}

impl Proxy {
    /// Starts a proxy of these nodes, with its files in this folder, and waits until it listens.
    pub(crate) async fn start(nodes: &[SocketAddr], folder: &Path) -> Self {
        let address = own_address();
        let file = folder.join("haproxy.cfg");
        std::fs::write(&file, configuration(address, nodes)).expect("written");
        let log = std::fs::File::create(folder.join("proxy.log")).expect("a file");
        let mut process = Command::new(PROGRAM)
            .args(["-db", "-f"])
            .arg(&file)
            .stdin(Stdio::null())
            .stdout(log.try_clone().expect("a second handle"))
            .stderr(log)
            .kill_on_drop(true)
            .spawn()
            .unwrap_or_else(|error| {
                panic!("{PROGRAM}: {error}; install it: apt-get install haproxy")
            });
        let listens = async {
            while TcpStream::connect((address, PORT)).await.is_err() {
                let ended = process.try_wait().expect("a child can be asked");
                assert_eq!(ended, None, "HAProxy does not start");
                tokio::task::yield_now().await;
            }
        };
        patiently("the proxy", listens).await;
        Self {
            address,
            _process: process,
        }
    }

    /// Where clients connect.
    pub(crate) fn url(&self) -> String {
        format!("http://{}:{PORT}", self.address)
    }
}

/// The configuration of docker/proxies for a cluster, as its comments tell to make it; without
/// encryption.
fn configuration(address: Ipv4Addr, nodes: &[SocketAddr]) -> String {
    let shipped = include_str!("../../../docker/proxies/haproxy.cfg");
    let (single, cluster) = (shipped.split_once("# A cluster has these lines instead"))
        .expect("the configuration of a cluster");
    let (single, _) = single.trim_end().rsplit_once('\n').expect("a server");
    let cluster = cluster
        .lines()
        .filter_map(|line| line.trim_start().strip_prefix("#   "));
    let listening = format!("bind {address}:{PORT} proto h2");
    let own = single.lines().filter_map(|line| match line.trim() {
        bind if bind.starts_with("bind :::443") => None,
        bind if bind.starts_with("bind :443") => Some(listening.as_str()),
        // Of a system's service.
        line if ["user ", "group ", "stats "]
            .iter()
            .any(|word| line.starts_with(word)) =>
        {
            None
        }
        line => Some(line),
    });
    let (nodes_named, cluster): (Vec<_>, Vec<_>) =
        cluster.partition(|line| line.starts_with("server "));
    assert!(!nodes_named.is_empty(), "{shipped}");
    let servers =
        (nodes.iter().enumerate()).map(|(number, node)| format!("server node{number} {node}"));
    let lines = own.chain(cluster).map(str::to_owned).chain(servers);
    let mut text = lines.collect::<Vec<_>>().join("\n");
    text.push('\n');
    text
}
