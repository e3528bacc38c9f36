//! The connections between nodes: one HTTP/2 connection to each other node, for calls and streams
//! of seats, and the listener for theirs. Both sides show a certificate of the cluster's own
//! authority, so that only nodes connect.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use futures::{Stream, StreamExt as _};
use http::{Request, Response, Uri};
use hyper_util::rt::TokioIo;
use rustls::pki_types::ServerName;
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsConnector;
use tokio_rustls::client::TlsStream;
use tokio_util::either::Either;
use tonic::body::Body;
use tonic::transport::server::TcpIncoming;
use tonic::transport::{Channel, Endpoint};
use tower::{ServiceExt as _, service_fn};

use super::directory::Peer;
use crate::tls::{MaybeTls, Tls, TlsError, TlsFiles};

/// The name that the certificate of every node has.
pub const PEER_NAME: &str = "chefshat-node";
/// How long connecting to another node may take.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two pings of a connection between nodes, from either side.
pub const PING_INTERVAL: Duration = Duration::from_secs(2);
/// How long the other node may take to answer a ping. After that everything on the connection fails.
pub const PING_TIMEOUT: Duration = Duration::from_secs(3);
/// Most bytes that wait on one stream between nodes for a client that does not read.
pub const STREAM_WINDOW: u32 = 64 * 1024;
/// Most bytes that wait on all streams between two nodes: streams that are not read must not hold
/// up the others.
pub const CONNECTION_WINDOW: u32 = 1 << 30;

/// Most streams that may be reset at a time. Clients that cancel their calls reset streams between
/// nodes, whose connection must survive it.
pub const MAX_RESET_STREAMS: usize = 1 << 20;

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
    pub(crate) fn tls(&self) -> Option<Arc<Tls>> {
        self.tls.as_ref().map(|tls| Arc::clone(&tls.accepting))
    }

    /// The connections to other nodes.
    pub(crate) fn peers(&self) -> Arc<Peers> {
        Arc::new(Peers {
            tls: self.tls.as_ref().map(|tls| tls.files.clone()),
            channels: Mutex::default(),
        })
    }

    /// The connections from other nodes.
    pub(crate) fn incoming(
        self,
    ) -> impl Stream<Item = io::Result<MaybeTls<TcpStream>>> + Send + 'static {
        let incoming = TcpIncoming::from(self.listener).with_nodelay(Some(true));
        match self.tls {
            None => incoming.map(|it| it.map(MaybeTls::Plain)).left_stream(),
            Some(tls) => tls.accepting.secure(incoming).right_stream(),
        }
    }
}

/// The connections to other nodes, opened when they are first needed and again when they break.
#[derive(Debug)]
pub struct Peers {
    tls: Option<TlsFiles>,
    /// By endpoint.
    channels: Mutex<BTreeMap<Arc<str>, Channel>>,
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
        let mut channels = (self.channels.lock()).expect("nothing panics under this lock");
        let endpoint = Arc::clone(&peer.endpoint);
        let channel = channels.entry(endpoint).or_insert_with_key(|endpoint| {
            let (tls, address) = (self.tls.clone(), Arc::clone(endpoint));
            let connector = service_fn(move |_: Uri| connect(tls.clone(), Arc::clone(&address)));
            let name = Endpoint::from_static("http://chefshat-node");
            name.http2_keep_alive_interval(PING_INTERVAL)
                .keep_alive_timeout(PING_TIMEOUT)
                .keep_alive_while_idle(true)
                .initial_stream_window_size(STREAM_WINDOW)
                .initial_connection_window_size(CONNECTION_WINDOW)
                .http2_max_concurrent_reset_streams(MAX_RESET_STREAMS)
                .http2_max_local_error_reset_streams(None)
                .connect_with_connector_lazy(connector)
        });
        channel.clone()
    }
}

/// The stream of a connection to another node.
type ToPeer = Either<TcpStream, Box<TlsStream<TcpStream>>>;

/// Connects to another node.
async fn connect(tls: Option<TlsFiles>, address: Arc<str>) -> io::Result<TokioIo<ToPeer>> {
    let connecting = async {
        let stream = TcpStream::connect(&*address).await?;
        stream.set_nodelay(true)?;
        let Some(files) = tls else {
            return Ok(Either::Left(stream));
        };
        // Read for each connection: the files may have been renewed.
        let config = files.client_config().map_err(io::Error::other)?;
        let name = ServerName::try_from(PEER_NAME).expect("a valid name");
        let stream = TlsConnector::from(config).connect(name, stream).await?;
        Ok(Either::Right(Box::new(stream)))
    };
    let connected = tokio::time::timeout(CONNECT_TIMEOUT, connecting).await;
    connected
        .unwrap_or_else(|_| Err(io::ErrorKind::TimedOut.into()))
        .map(TokioIo::new)
}
