//! The connections between nodes: one HTTP/2 connection to each other node, for calls and streams
//! of seats, and the listener for theirs. Both sides show a certificate of the cluster's own
//! authority, so that only nodes connect.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;

use futures::stream::FuturesUnordered;
use futures::{Stream, StreamExt as _};
use http::{Request, Response, Uri};
use hyper_util::rt::TokioIo;
use rayon::ThreadPoolBuildError;
use rustls::ClientConfig;
use rustls::pki_types::ServerName;
use tokio::net::{TcpListener, TcpStream};
use tokio::time::error::Elapsed;
use tokio::time::{Instant, timeout};
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_util::either::Either;
use tonic::body::Body;
use tonic::transport::{Channel, Endpoint};
use tonic::{Code, Status};
use tower::{ServiceExt as _, service_fn};
use tracing::debug;

use crate::connections::{self, Connection, Connections, Limits};
use crate::handshakes::Handshakes;
use crate::tls::{MaybeTls, Tls, TlsError, TlsFiles};
use chefshat_admission::limits::Shares;
use chefshat_base::lock::Lock;
use chefshat_base::metrics::Metrics;
use chefshat_base::proxies::TrustedProxies;
use chefshat_hosting::cluster::Peer;
use chefshat_room::MAX_GATEWAY_DELAY;
use chefshat_wire::encoded::peer::peer_service_client::PeerServiceClient;
use chefshat_wire::encoded::peer::{IdentifyRequest, ReachRequest, ReachResponse};

/// The name that the certificate of every node has.
pub const PEER_NAME: &str = "chefshat-node";
/// How long connecting to another node may take.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// How long another node may take to say who it is.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(10);
/// Time between two pings of a connection between nodes, from either side.
pub const PING_INTERVAL: Duration = Duration::from_secs(2);
/// How long the other node may take to answer a ping. After that everything on the connection fails.
pub const PING_TIMEOUT: Duration = Duration::from_secs(3);
const _: () = assert!(
    PING_INTERVAL.as_secs() + PING_TIMEOUT.as_secs() < MAX_GATEWAY_DELAY.as_secs(),
    "no decision runs out before it is noticed that its client's node is gone"
);
/// A connection to another node that nobody asked for during this time is closed, once its streams
/// have ended.
const CHANNEL_IDLE: Duration = Duration::from_secs(600);
/// Most bytes that wait on one stream between nodes for a client that does not read.
pub const STREAM_WINDOW: u32 = 64 * 1024;
/// Most bytes that wait on all streams between two nodes: streams that are not read must not hold
/// up the others.
pub const CONNECTION_WINDOW: u32 = 1 << 30;

/// Most streams that may be reset at a time. Clients that cancel their calls reset streams between
/// nodes, whose connection must survive it.
pub const MAX_RESET_STREAMS: usize = 1 << 20;

/// Most connections from other nodes at a time: each has one, and a few that are ending.
const MAX_PEER_CONNECTIONS: usize = 512;
/// How much of them one machine may have. In tests and at home, it has all nodes.
const PEER_SHARES: Shares = Shares {
    local: 100,
    remote: 25,
};

/// How a node receives and opens connections of other nodes.
#[derive(Debug)]
pub struct PeerPort {
    listener: TcpListener,
    tls: Option<PeerTls>,
}

/// The certificates of a node.
#[derive(Debug, Clone)]
struct PeerTls {
    accepting: Arc<Tls>,
    files: TlsFiles,
}

/// Why the settings for other nodes cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum PeerPortError {
    /// The files for TLS cannot be used.
    #[error(transparent)]
    Tls(#[from] TlsError),
    /// Without an authority, anyone could connect as a node.
    #[error(
        "nodes need the certificate of the cluster's own authority; set it beside the node's certificate and key"
    )]
    NoAuthority,
    /// Without encryption, other machines could read and send everything.
    #[error(
        "without certificates nodes connect on one machine only, but {0} is not a loopback address; set the certificate, key and authority for connections between nodes"
    )]
    NotEncrypted(SocketAddr),
    /// The socket has no address.
    #[error("the socket for other nodes cannot be used: {0}")]
    Socket(#[from] io::Error),
}

impl PeerPort {
    /// Receives other nodes on this socket. The certificate of `files` has the name [`PEER_NAME`];
    /// without files, connections are not encrypted and stay on this machine.
    ///
    /// # Errors
    /// The files cannot be used, or are missing although the socket can be reached from elsewhere.
    pub fn new(listener: TcpListener, files: Option<TlsFiles>) -> Result<Self, PeerPortError> {
        let address = listener.local_addr()?;
        let tls = match files {
            None if address.ip().is_loopback() => None,
            None => return Err(PeerPortError::NotEncrypted(address)),
            Some(files) if files.client_authority.is_none() => {
                return Err(PeerPortError::NoAuthority);
            }
            Some(files) => {
                files.client_config()?;
                let accepting = Tls::open(files.clone())?;
                Some(PeerTls { accepting, files })
            }
        };
        Ok(Self { listener, tls })
    }

    /// The certificate that other nodes see, which follows its files.
    pub fn tls(&self) -> Option<Arc<Tls>> {
        self.tls.as_ref().map(|tls| Arc::clone(&tls.accepting))
    }

    /// The connections to other nodes.
    pub fn peers(&self, metrics: &Arc<Metrics>) -> Arc<Peers> {
        Arc::new(Peers {
            opening: Arc::new(Opening {
                tls: self.tls.as_ref().map(|tls| tls.files.clone()),
                config: Lock::default(),
                metrics: Arc::clone(metrics),
            }),
            channels: Lock::default(),
        })
    }

    /// The connections from other nodes, within limits of their own.
    ///
    /// # Errors
    /// The operating system cannot start the thread that computes handshakes.
    pub fn incoming(
        self,
        metrics: &Arc<Metrics>,
    ) -> Result<
        impl Stream<Item = io::Result<MaybeTls<Connection>>> + Send + 'static,
        ThreadPoolBuildError,
    > {
        self.incoming_within(MAX_PEER_CONNECTIONS, metrics)
    }

    fn incoming_within(
        self,
        max_connections: usize,
        metrics: &Arc<Metrics>,
    ) -> Result<
        impl Stream<Item = io::Result<MaybeTls<Connection>>> + Send + 'static,
        ThreadPoolBuildError,
    > {
        let limits = Limits {
            max_connections,
            shares: PEER_SHARES,
            trusted_proxies: TrustedProxies::default(),
        };
        let connections = Connections::new(limits, Arc::clone(metrics));
        let incoming = connections::accept(self.listener.into(), connections);
        Ok(match self.tls {
            None => incoming.map(|it| it.map(MaybeTls::Plain)).left_stream(),
            Some(tls) => {
                let limits = Handshakes::new(PEER_SHARES, Arc::clone(metrics))?;
                let secured = tls.accepting.secure(incoming, limits, Connection::key);
                secured.right_stream()
            }
        })
    }
}

/// The connections to other nodes, opened when they are first needed and again when they break.
#[derive(Debug)]
pub struct Peers {
    opening: Arc<Opening>,
    /// By endpoint, with the time of the last use.
    channels: Lock<BTreeMap<Arc<str>, (Channel, Instant)>>,
}

impl Peers {
    /// Sends a request to another node.
    ///
    /// # Errors
    /// The node cannot be reached, or the connection broke before its answer.
    pub async fn send(
        &self,
        peer: &Peer,
        request: Request<Body>,
    ) -> Result<Response<Body>, tonic::transport::Error> {
        self.channel(peer).oneshot(request).await
    }

    /// The connection to another node.
    pub fn channel(&self, peer: &Peer) -> Channel {
        let now = Instant::now();
        let mut channels = self.channels.lock();
        // Nodes come and go, often with new endpoints. Streams keep their connection.
        channels.retain(|endpoint, (_, used)| {
            *endpoint == peer.endpoint || now.duration_since(*used) < CHANNEL_IDLE
        });
        let endpoint = Arc::clone(&peer.endpoint);
        let (channel, used) = channels.entry(endpoint).or_insert_with_key(|endpoint| {
            let (opening, address) = (Arc::clone(&self.opening), Arc::clone(endpoint));
            let connector = service_fn(move |_: Uri| {
                let (opening, address) = (Arc::clone(&opening), Arc::clone(&address));
                async move { opening.open(&address).await }
            });
            let name = Endpoint::from_static("http://chefshat-node");
            let channel = name
                .http2_keep_alive_interval(PING_INTERVAL)
                .keep_alive_timeout(PING_TIMEOUT)
                .keep_alive_while_idle(true)
                .initial_stream_window_size(STREAM_WINDOW)
                .initial_connection_window_size(CONNECTION_WINDOW)
                .http2_max_concurrent_reset_streams(MAX_RESET_STREAMS)
                .http2_max_local_error_reset_streams(None)
                .connect_with_connector_lazy(connector);
            (channel, now)
        });
        *used = now;
        channel.clone()
    }

    /// Asks other nodes to reach this one, which is called `own`. One that does is enough; those of an
    /// earlier version, which cannot say, are enough if none says that it does not.
    ///
    /// # Errors
    /// None does; says why, by node.
    pub async fn reached_by(&self, others: &[Peer], own: &str) -> Result<(), Vec<(Peer, String)>> {
        let asked = others.iter().map(async |peer| {
            let mut service = PeerServiceClient::new(self.channel(peer));
            let request = ReachRequest {
                node: own.to_owned(),
            };
            let asked = timeout(ANSWER_TIMEOUT * 2, service.reach(request));
            (peer, answered(asked.await))
        });
        let mut asked: FuturesUnordered<_> = asked.collect();
        let (mut problems, mut is_any_earlier) = (Vec::new(), false);
        while let Some((peer, asked)) = asked.next().await {
            let problem = match asked {
                Ok(ReachResponse { problem }) if problem.is_empty() => return Ok(()),
                Ok(ReachResponse { problem }) => format!("it does not reach this node: {problem}"),
                Err(status) if status.code() == Code::Unimplemented => {
                    is_any_earlier = true;
                    continue;
                }
                Err(status) => format!("this node does not reach it: {}", status.message()),
            };
            problems.push((peer.clone(), problem));
        }
        match is_any_earlier && problems.is_empty() {
            true => Ok(()),
            false => Err(problems),
        }
    }

    /// Reaches another node. Returns the key with which it signs records, empty if it signs none; `None`
    /// if it is of an earlier version, which does not say.
    ///
    /// # Errors
    /// Nobody, or another node, answers at its endpoint; says so.
    pub async fn reach(&self, peer: &Peer) -> Result<Option<String>, String> {
        let Peer { node, endpoint } = peer;
        let mut service = PeerServiceClient::new(self.channel(peer));
        let asked = timeout(ANSWER_TIMEOUT, service.identify(IdentifyRequest {}));
        match answered(asked.await) {
            Ok(answer) if *answer.node == **node => Ok(answer.signing_key),
            Ok(answer) if answer.node.is_empty() => {
                Err(format!("the node at {endpoint} has not joined yet"))
            }
            Ok(answer) => Err(format!("node {:?} answers at {endpoint}", answer.node)),
            // An earlier version, which cannot say who it is.
            Err(status) if status.code() == Code::Unimplemented => Ok(None),
            Err(status) => Err(format!("{endpoint} does not answer: {}", status.message())),
        }
    }
}

/// The answer of another node, if it came in time.
fn answered<T>(asked: Result<Result<tonic::Response<T>, Status>, Elapsed>) -> Result<T, Status> {
    let asked = asked.unwrap_or_else(|late| Err(Status::deadline_exceeded(late.to_string())));
    asked.map(tonic::Response::into_inner)
}

/// The stream of a connection to another node.
type ToPeer = Either<TcpStream, Box<TlsStream<TcpStream>>>;

/// How connections to other nodes are opened.
#[derive(Debug)]
struct Opening {
    tls: Option<TlsFiles>,
    /// What the files were when they could be used last.
    config: Lock<Option<Arc<ClientConfig>>>,
    metrics: Arc<Metrics>,
}

impl Opening {
    /// Connects to another node.
    async fn open(&self, address: &str) -> io::Result<TokioIo<ToPeer>> {
        let connected = timeout(CONNECT_TIMEOUT, self.connect(address)).await;
        let connected = connected.unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()));
        if let Err(error) = &connected {
            self.metrics.peer_error();
            debug!(%address, %error, "another node cannot be reached");
        }
        connected.map(TokioIo::new)
    }

    /// The files as they are now, since they may have been renewed; or as they could be used last.
    fn config(&self, files: &TlsFiles) -> Result<Arc<ClientConfig>, TlsError> {
        let mut last = self.config.lock();
        match (files.client_config(), &*last) {
            (Ok(config), _) => Ok(Arc::clone(last.insert(config))),
            (Err(_), Some(last)) => Ok(Arc::clone(last)),
            (Err(error), None) => Err(error),
        }
    }

    async fn connect(&self, address: &str) -> io::Result<ToPeer> {
        let stream = TcpStream::connect(address).await?;
        stream.set_nodelay(true)?;
        let Some(files) = &self.tls else {
            return Ok(Either::Left(stream));
        };
        let config = self.config(files).map_err(io::Error::other)?;
        let name = ServerName::try_from(PEER_NAME).expect("a valid name");
        let stream = TlsConnector::from(config).connect(name, stream).await?;
        Ok(Either::Right(Box::new(stream)))
    }
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;
    use std::path::Path;

    use chefshat_proto::v1;
    use chefshat_proto::v1::server_service_server::{ServerService, ServerServiceServer};
    use futures::FutureExt as _;
    use tokio::io::AsyncReadExt as _;
    use tokio::net::TcpSocket;
    use tokio_stream::wrappers::TcpListenerStream;
    use tonic::Streaming;
    use tonic::server::NamedService;
    use tower::Service;

    use super::*;
    use chefshat_wire::encoded::Updates;
    use chefshat_wire::encoded::peer::peer_service_server::{PeerService, PeerServiceServer};
    use chefshat_wire::encoded::peer::{
        IdentifyResponse, PlayRequest, ShareRequest, ShareResponse,
    };

    async fn port() -> (SocketAddr, PeerPort) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("bound");
        (
            address,
            PeerPort::new(listener, None).expect("on this machine"),
        )
    }

    /// A node that signs with a key.
    struct Other(&'static str);

    impl ServerService for Other {
        async fn get_server_info(
            &self,
            _: tonic::Request<v1::GetServerInfoRequest>,
        ) -> Result<tonic::Response<v1::GetServerInfoResponse>, tonic::Status> {
            Ok(tonic::Response::new(v1::GetServerInfoResponse {
                signing_key: self.0.to_owned(),
                ..v1::GetServerInfoResponse::default()
            }))
        }

        async fn get_action_table(
            &self,
            _: tonic::Request<v1::GetActionTableRequest>,
        ) -> Result<tonic::Response<v1::GetActionTableResponse>, tonic::Status> {
            unreachable!("nobody asks for it")
        }

        async fn get_clock(
            &self,
            _: tonic::Request<v1::GetClockRequest>,
        ) -> Result<tonic::Response<v1::GetClockResponse>, tonic::Status> {
            unreachable!("nobody asks for it")
        }
    }

    fn peer(node: &str, address: SocketAddr) -> Peer {
        Peer {
            node: node.into(),
            endpoint: address.to_string().into(),
        }
    }

    /// A node with this service alone.
    async fn serving<S>(node: &str, service: S) -> Peer
    where
        S: Service<Request<Body>, Response = Response<Body>, Error = Infallible>
            + NamedService
            + Clone
            + Send
            + Sync
            + 'static,
        S::Future: Send + 'static,
    {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("bound");
        let incoming = TcpListenerStream::new(listener);
        let serving = tonic::transport::Server::builder().add_service(service);
        tokio::spawn(serving.serve_with_incoming(incoming));
        peer(node, address)
    }

    /// A node that answers those who ask to be reached.
    #[derive(Clone)]
    struct Asked(&'static str);

    impl PeerService for Asked {
        type PlayStream = futures::stream::Empty<Result<Updates, Status>>;

        async fn play(
            &self,
            _: tonic::Request<Streaming<PlayRequest>>,
        ) -> Result<tonic::Response<Self::PlayStream>, Status> {
            unreachable!("nobody plays")
        }

        async fn share(
            &self,
            _: tonic::Request<Streaming<ShareRequest>>,
        ) -> Result<tonic::Response<ShareResponse>, Status> {
            unreachable!("nobody watches")
        }

        async fn reach(
            &self,
            request: tonic::Request<ReachRequest>,
        ) -> Result<tonic::Response<ReachResponse>, Status> {
            assert_eq!(request.into_inner().node, "own #1");
            match self.0 {
                "unknown" => Err(Status::not_found("no such node is known here yet")),
                problem => Ok(tonic::Response::new(ReachResponse {
                    problem: problem.to_owned(),
                })),
            }
        }

        async fn identify(
            &self,
            _: tonic::Request<IdentifyRequest>,
        ) -> Result<tonic::Response<IdentifyResponse>, Status> {
            Ok(tonic::Response::new(IdentifyResponse {
                node: self.0.to_owned(),
                signing_key: Some("key".to_owned()),
            }))
        }
    }

    #[tokio::test]
    async fn a_node_is_reached_if_it_answers_itself() {
        let (_, port) = port().await;
        let peers = port.peers(&Arc::default());
        let one = serving("one", PeerServiceServer::new(Asked("one"))).await;
        assert_eq!(peers.reach(&one).await, Ok(Some("key".to_owned())));
        // Its --peer-endpoint is that of another.
        let other = Peer {
            node: "other".into(),
            ..one
        };
        let refused = peers.reach(&other).await.expect_err("another node");
        assert!(refused.starts_with("node \"one\" answers at"), "{refused}");
        let silent = peer("silent", SocketAddr::from(([127, 0, 0, 1], 1)));
        let refused = peers.reach(&silent).await.expect_err("nobody");
        assert!(refused.contains("does not answer"), "{refused}");
    }

    #[tokio::test]
    async fn one_node_that_reaches_this_one_is_enough() {
        let (_, port) = port().await;
        let peers = port.peers(&Arc::default());
        let reaches = serving("reaches", PeerServiceServer::new(Asked(""))).await;
        let does_not = serving("does not", PeerServiceServer::new(Asked("refused"))).await;
        let unknown = serving("unknown", PeerServiceServer::new(Asked("unknown"))).await;
        // It has no such call.
        let earlier = serving("earlier", ServerServiceServer::new(Other("ours"))).await;
        let silent = peer("silent", SocketAddr::from(([127, 0, 0, 1], 1)));

        let without = [does_not.clone(), unknown, silent];
        let none = peers.reached_by(&without, "own #1").await;
        let none: BTreeMap<Arc<str>, String> = (none.expect_err("none of them").into_iter())
            .map(|(peer, problem)| (peer.node, problem))
            .collect();
        assert_eq!(none["does not"], "it does not reach this node: refused");
        assert!(none["unknown"].contains("known here"), "{none:?}");
        assert!(none["silent"].starts_with("this node does not"), "{none:?}");
        let others = [without.as_slice(), &[reaches]].concat();
        assert_eq!(peers.reached_by(&others, "own #1").await, Ok(()));
        let earlier = std::slice::from_ref(&earlier);
        assert_eq!(peers.reached_by(earlier, "own #1").await, Ok(()));
        assert_eq!(peers.reach(&earlier[0]).await, Ok(None));
        let others = [earlier, &[does_not]].concat();
        let refused = peers.reached_by(&others, "own #1").await;
        assert_eq!(refused.map_err(|problems| problems.len()), Err(1));
        assert_eq!(peers.reached_by(&[], "own #1").await, Err(Vec::new()));
    }

    #[tokio::test(start_paused = true)]
    async fn the_connections_to_nodes_that_are_gone_are_forgotten() {
        let (_, port) = port().await;
        let peers = port.peers(&Arc::default());
        let peer = |number: u32| Peer {
            node: format!("node-{number}").into(),
            endpoint: format!("192.0.2.1:{number}").into(),
        };
        for number in 0..1_000 {
            peers.channel(&peer(number));
            peers.channel(&peer(0));
            tokio::time::advance(Duration::from_secs(60)).await;
        }
        let live = peers.channels.lock().len();
        assert_eq!(live, 11, "those of ten minutes, and the one in use");
    }

    /// The files of a node whose certificate an authority of its own has signed.
    fn certified(folder: &Path) -> TlsFiles {
        let made = rcgen::generate_simple_self_signed([PEER_NAME.to_owned()]).expect("signed");
        let files = TlsFiles {
            certificate: folder.join("node.pem"),
            key: folder.join("node.key"),
            client_authority: Some(folder.join("node.pem")),
        };
        std::fs::write(&files.certificate, made.cert.pem()).expect("written");
        std::fs::write(&files.key, made.signing_key.serialize_pem()).expect("written");
        files
    }

    #[tokio::test]
    async fn nodes_that_cannot_be_reached_are_counted() {
        let folders = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
        let [own, other] = folders.each_ref().map(|folder| certified(folder.path()));
        let listen = || TcpListener::bind("127.0.0.1:0");
        let port = PeerPort::new(listen().await.expect("a port"), Some(own)).expect("usable");
        let metrics = Arc::default();
        let peers = port.peers(&metrics);
        let errors = async |address: SocketAddr| {
            let peer = Peer {
                node: "other".into(),
                endpoint: address.to_string().into(),
            };
            let problem = peers.reach(&peer).await.expect_err("nobody answers");
            (problem, metrics.text())
        };

        // Nobody listens there, and the port is not given to others.
        let closed = TcpSocket::new_v4().expect("a socket");
        closed.bind(([127, 0, 0, 1], 0).into()).expect("a port");
        let closed_at = closed.local_addr().expect("bound");
        let (problem, counted) = errors(closed_at).await;
        assert!(problem.contains("refused"), "{problem}");
        assert!(counted.contains("chefshat_peer_errors_total 1\n"));
        // Its certificate is of another authority.
        let listener = listen().await.expect("a port");
        let address = listener.local_addr().expect("bound");
        let strange = PeerPort::new(listener, Some(other)).expect("usable");
        let incoming = strange.incoming(&Arc::default()).expect("a thread");
        let accepting = tokio::spawn(incoming.for_each(async |_| {}));
        let (problem, counted) = errors(address).await;
        assert!(problem.contains("certificate"), "{problem}");
        assert!(counted.contains("chefshat_peer_errors_total 2\n"));
        accepting.abort();
    }

    #[tokio::test]
    async fn connections_of_nodes_are_limited() {
        let (address, port) = port().await;
        let incoming = port.incoming_within(2, &Arc::default());
        let mut incoming = std::pin::pin!(incoming.expect("no thread is needed"));
        let mut clients = Vec::new();
        for _ in 0..3 {
            clients.push(TcpStream::connect(address).await.expect("it listens"));
        }
        let _first = incoming.next().await.expect("endless").expect("one");
        let second = incoming.next().await.expect("endless").expect("one");
        let mut byte = [0];
        tokio::select! {
            _ = incoming.next() => panic!("the third one is closed"),
            read = clients[2].read(&mut byte) => assert!(!matches!(read, Ok(1..))),
        }
        drop(second);
        let _fourth = TcpStream::connect(address).await.expect("it listens");
        assert!(incoming.next().await.is_some());
        assert!(incoming.next().now_or_never().is_none());
    }
}
