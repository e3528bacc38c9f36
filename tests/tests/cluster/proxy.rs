//! A real proxy in front of the nodes: HAProxy from Debian, which spreads calls and streams over the
//! nodes that say that they serve.

use std::fmt::Write as _;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::Path;
use std::process::Stdio;

use chefshat_tests::{own_address, patiently};
use tokio::net::TcpStream;
use tokio::process::{Child, Command};

const PROGRAM: &str = "/usr/sbin/haproxy";
const PORT: u16 = 50_050;
/// What a node that serves answers to a health check: a message of two bytes, its field 1 is
/// SERVING.
const SERVING: [u8; 7] = [0, 0, 0, 0, 2, 8, 1];

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

fn configuration(address: Ipv4Addr, nodes: &[SocketAddr]) -> String {
    let (check, serving) = (hex::encode(health_check()), hex::encode(SERVING));
    let mut text = format!(
        "
global
    tune.h2.max-concurrent-streams 1000
    log stdout format raw local0
defaults
    mode http
    log global
    timeout connect 1s
    timeout check 1s
    timeout client 1h
    timeout server 1h
    retries 3
    option redispatch
frontend clients
    bind {address}:{PORT} proto h2
    default_backend nodes
backend nodes
    balance roundrobin
    option tcp-check
    tcp-check connect
    tcp-check send-binary {check}
    tcp-check expect binary {serving}
    default-server proto h2 check inter 250ms fall 2 rise 1 on-marked-down shutdown-sessions
"
    );
    for (number, node) in nodes.iter().enumerate() {
        writeln!(text, "    server node{number} {node}").expect("memory");
    }
    text
}

/// A health check of gRPC as it goes over the wire: HAProxy 2.6 cannot send bodies that contain
/// zeros.
fn health_check() -> Vec<u8> {
    const SETTINGS: u8 = 4;
    const HEADERS: u8 = 1;
    const DATA: u8 = 0;
    const END_STREAM: u8 = 1;
    const END_HEADERS: u8 = 4;
    let mut bytes = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n".to_vec();
    let mut frame = |kind: u8, flags: u8, stream: u8, payload: &[u8]| {
        let length = u8::try_from(payload.len()).expect("short");
        bytes.extend([0, 0, length, kind, flags, 0, 0, 0, stream]);
        bytes.extend(payload);
    };
    let literal = |text: &str| {
        let length = u8::try_from(text.len()).expect("short");
        [&[length], text.as_bytes()].concat()
    };
    // By their numbers in the static table: POST, http, :path, :authority, content-type.
    let headers = [
        vec![0x83, 0x86, 0x04],
        literal("/grpc.health.v1.Health/Check"),
        vec![0x01],
        literal("localhost"),
        vec![0x0f, 0x10],
        literal("application/grpc"),
        vec![0x00],
        literal("te"),
        literal("trailers"),
    ];
    frame(SETTINGS, 0, 0, &[]);
    frame(HEADERS, END_HEADERS, 1, &headers.concat());
    // An empty message.
    frame(DATA, END_STREAM, 1, &[0; 5]);
    bytes
}
