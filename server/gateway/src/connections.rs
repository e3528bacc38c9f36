//! Accepts connections: disables Nagle's delay, limits their number, of each caller and in all, and
//! drops those whose peer has vanished. Knows which clients are
//! connected, and closes their connections.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize};
use std::sync::{Arc, Weak};
use std::task::{Context, Poll};
use std::time::{Duration, SystemTime};

use futures::task::AtomicWaker;
use futures::{FutureExt as _, Stream, stream};
use socket2::{SockRef, TcpKeepalive};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
#[cfg(unix)]
use tokio::net::UnixListener;
use tokio::net::{TcpListener, TcpStream};
use tokio::time::Instant;
use tokio_util::either::Either;
use tonic::transport::server::{Connected, TcpConnectInfo};
use tracing::{debug, warn};

use chefshat_admission::access::TokenId;
use chefshat_admission::limits::{FairSemaphore, Key, LogPace, Permit, Shares};
use chefshat_base::clock::millis;
use chefshat_base::lock::Lock;
use chefshat_base::metrics::{Counted, Metrics};
use chefshat_base::proxies::TrustedProxies;

/// Pause after a failed accept: usually the process has run out of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);
/// File descriptors that connections leave for databases, records and everything else.
const RESERVED_DESCRIPTORS: usize = 128;
/// How long a client may read nothing of an answer.
pub const STALLED_LIMIT: Duration = Duration::from_secs(30);
/// Time between two checks of that.
const STALLED_INTERVAL: Duration = Duration::from_secs(5);
/// Bytes of streams that one caller may leave unread for longer than [`STALLED_LIMIT`]. Messages that
/// wait to be encoded take about as much again.
pub const MAX_UNREAD: usize = 32 << 20;

/// Idle time before the kernel probes the peer. Unlike HTTP/2 pings, probes cost nothing per
/// message, and they work for HTTP/1.1 as well.
const KEEPALIVE_IDLE: Duration = Duration::from_secs(20);
/// Time between probes.
const KEEPALIVE_INTERVAL: Duration = Duration::from_secs(5);
/// Unanswered probes before the connection is dropped.
const KEEPALIVE_RETRIES: u32 = 2;
/// How long data may stay unacknowledged, or unsent because the peer does not read, before the
/// connection is dropped. Longer than any time the services give a client to read. Other systems
/// have no such option: there a peer that vanishes with data in flight is found by their own limit.
#[cfg(target_os = "linux")]
const UNACKNOWLEDGED_LIMIT: Duration = Duration::from_secs(90);

/// A socket that accepts connections.
#[derive(Debug)]
pub enum Listener {
    /// On an address and port.
    Tcp(TcpListener),
    /// On a path of this machine, for a proxy.
    #[cfg(unix)]
    Unix(UnixListener),
}

impl From<TcpListener> for Listener {
    fn from(listener: TcpListener) -> Self {
        Self::Tcp(listener)
    }
}

#[cfg(unix)]
impl From<UnixListener> for Listener {
    fn from(listener: UnixListener) -> Self {
        Self::Unix(listener)
    }
}

impl Listener {
    async fn accept(&self) -> io::Result<(Socket, Option<SocketAddr>)> {
        match self {
            Self::Tcp(listener) => {
                let (stream, address) = listener.accept().await?;
                if let Err(error) = set_options(&stream) {
                    debug!(%error, "could not set the options of a connection");
                }
                Ok((Either::Left(stream), Some(address)))
            }
            #[cfg(unix)]
            Self::Unix(listener) => Ok((Either::Right(listener.accept().await?.0), None)),
        }
    }
}

#[cfg(unix)]
type Local = tokio::net::UnixStream;
/// There are none.
#[cfg(not(unix))]
type Local = tokio::io::Empty;

type Socket = Either<TcpStream, Local>;

/// Limits of connections.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Most connections at a time. Each caller has its share of them.
    pub max_connections: usize,
    /// How much of them one caller may have.
    pub shares: Shares,
    /// Proxies, whose connections carry many callers: they may have all.
    pub trusted_proxies: TrustedProxies,
}

/// The connections of a server.
#[derive(Debug)]
pub struct Connections {
    places: Arc<FairSemaphore>,
    trusted_proxies: TrustedProxies,
    clients: Lock<BTreeMap<u64, Weak<Client>>>,
    next: AtomicU64,
    metrics: Arc<Metrics>,
    logged: LogPace,
}

impl Connections {
    /// No connections yet. Lets this process open as many files as the system allows, and leaves
    /// some for everything else.
    pub fn new(limits: Limits, metrics: Arc<Metrics>) -> Arc<Self> {
        let descriptors = raise_descriptor_limit();
        let most = descriptors.saturating_sub(RESERVED_DESCRIPTORS).max(1);
        let max_connections = limits.max_connections.min(most);
        if max_connections < limits.max_connections {
            warn!(
                max_connections,
                descriptors,
                "the system allows fewer open files than connections; raise its limit (ulimit -n)"
            );
        }
        Arc::new(Self {
            places: FairSemaphore::new(max_connections, limits.shares),
            trusted_proxies: limits.trusted_proxies,
            clients: Lock::default(),
            next: AtomicU64::new(1),
            metrics,
            logged: LogPace::new(1),
        })
    }

    /// The clients that are connected, oldest first.
    pub fn clients(&self) -> Vec<Arc<Client>> {
        self.clients
            .lock()
            .values()
            .filter_map(Weak::upgrade)
            .collect()
    }

    /// The client with this number.
    pub fn client(&self, id: u64) -> Option<Arc<Client>> {
        self.clients.lock().get(&id)?.upgrade()
    }

    /// Number of places for connections.
    pub fn max_connections(&self) -> usize {
        self.places.total()
    }

    /// Closes connections whose clients do not read answers, or too much of their streams, until the
    /// future is dropped. What waits for them takes memory.
    pub async fn close_stalled(self: Arc<Self>) {
        let mut interval = tokio::time::interval(STALLED_INTERVAL);
        loop {
            interval.tick().await;
            let clients = self.clients();
            for client in &clients {
                let stalled = client.oldest_answer();
                if stalled.is_some_and(|since| since.elapsed() > STALLED_LIMIT) {
                    self.metrics.refused("ANSWERS_NOT_READ");
                    client.close();
                }
            }
            for client in with_too_much_unread(&clients) {
                self.metrics.refused("STREAMS_NOT_READ");
                client.close();
            }
        }
    }

    /// Admits a new connection, unless there are too many.
    fn admit(self: &Arc<Self>, address: Option<SocketAddr>) -> Option<Arc<Client>> {
        let peer = address.map(|address| address.ip());
        let key = match self.trusted_proxies.contains(peer) {
            true => Key::Proxies,
            false => Key::of_address(peer),
        };
        let Some(place) = self.places.try_take(key) else {
            self.refuse("TOO_MANY_CONNECTIONS", &format_args!("{address:?}"));
            return None;
        };
        let id = self.next.fetch_add(1, Relaxed);
        let client = Arc::new(Client {
            id,
            address,
            key,
            since: SystemTime::now(),
            calls: AtomicU64::new(0),
            streams: Lock::default(),
            token: Lock::default(),
            answers: Lock::default(),
            closing: AtomicBool::new(false),
            waker: AtomicWaker::new(),
            connections: Arc::downgrade(self),
            _counted: Counted::new(self.metrics.connections()),
            _place: place,
        });
        self.clients.lock().insert(id, Arc::downgrade(&client));
        Some(client)
    }

    /// Counts a refused connection, and logs it unless another was logged just before.
    fn refuse(&self, reason: &'static str, cause: &dyn std::fmt::Display) {
        self.metrics.refused(reason);
        if self.logged.admits() {
            let open = self.places.taken();
            warn!(reason, %cause, open, "connections are refused");
        }
    }
}

/// The clients to disconnect so that each caller leaves at most [`MAX_UNREAD`] bytes unread: those that
/// leave most.
fn with_too_much_unread(clients: &[Arc<Client>]) -> Vec<&Arc<Client>> {
    let mut by_caller: BTreeMap<Key, Vec<(usize, &Arc<Client>)>> = BTreeMap::new();
    for client in clients {
        let mut unread: BTreeMap<Key, usize> = BTreeMap::new();
        for stream in client.streams.lock().values().filter(|it| it.is_stalled()) {
            *unread.entry(stream.key).or_default() += stream.bytes.load(Relaxed);
        }
        for (key, bytes) in unread {
            by_caller.entry(key).or_default().push((bytes, client));
        }
    }
    let mut closed = Vec::new();
    for mut unread in by_caller.into_values() {
        unread.sort_by_key(|(bytes, _)| *bytes);
        let mut kept = 0;
        for (bytes, client) in unread {
            kept += bytes;
            if kept > MAX_UNREAD {
                closed.push(client);
            }
        }
    }
    closed
}

/// What the client of a stream has not read.
#[derive(Debug)]
pub struct Unread {
    /// Who is charged for the stream.
    key: Key,
    began: Instant,
    /// Bytes that wait for the client.
    bytes: AtomicUsize,
    /// When some of them were sent, or the first began to wait, in milliseconds since the stream began.
    moved_ms: AtomicU64,
}

impl Unread {
    /// More bytes wait for the client.
    pub fn waits(&self, bytes: usize) {
        if self.bytes.fetch_add(bytes, Relaxed) == 0 {
            self.moved();
        }
    }

    /// Some of them have been sent, or never will be.
    pub fn sent(&self, bytes: usize) {
        self.bytes.fetch_sub(bytes, Relaxed);
        self.moved();
    }

    fn moved(&self) {
        self.moved_ms.store(self.elapsed_ms(), Relaxed);
    }

    fn elapsed_ms(&self) -> u64 {
        millis(self.began.elapsed())
    }

    /// Whether bytes wait, of which none has been sent for [`STALLED_LIMIT`].
    fn is_stalled(&self) -> bool {
        let still_ms = (self.elapsed_ms()).saturating_sub(self.moved_ms.load(Relaxed));
        self.bytes.load(Relaxed) > 0 && Duration::from_millis(still_ms) > STALLED_LIMIT
    }
}

/// The client at the other end of a connection.
#[derive(Debug)]
pub struct Client {
    /// Its number, unique in the life of the server.
    pub id: u64,
    /// Its address; `None` if it has none, as on a unix socket.
    pub address: Option<SocketAddr>,
    /// Who is charged for its connection.
    key: Key,
    /// When it connected.
    pub since: SystemTime,
    calls: AtomicU64,
    /// Its open streams, by the number of the call.
    streams: Lock<BTreeMap<u64, Arc<Unread>>>,
    /// The token that it used last.
    token: Lock<Option<TokenId>>,
    /// Answers that it has not read completely, by the number of the call, with the time at which
    /// they were ready, or it read some of them.
    answers: Lock<BTreeMap<u64, Instant>>,
    closing: AtomicBool,
    waker: AtomicWaker,
    connections: Weak<Connections>,
    _counted: Counted,
    _place: Permit,
}

impl Client {
    /// The client that sent a request; `None` if it did not come by a socket of the server.
    pub fn of(extensions: &http::Extensions) -> Option<&Arc<Self>> {
        extensions.get()
    }

    /// Whether it is a trusted proxy, whose connection carries many callers.
    pub fn is_proxy(&self) -> bool {
        self.key == Key::Proxies
    }

    /// Number of its calls so far, including streams.
    pub fn calls(&self) -> u64 {
        self.calls.load(Relaxed)
    }

    /// Number of its open streams.
    pub fn streams(&self) -> usize {
        self.streams.lock().len()
    }

    /// The token that it used last.
    pub fn token(&self) -> Option<TokenId> {
        *self.token.lock()
    }

    /// Counts a call with this token, if any, and returns its number.
    pub fn called(&self, token: Option<TokenId>) -> u64 {
        if token.is_some() {
            *self.token.lock() = token;
        }
        self.calls.fetch_add(1, Relaxed)
    }

    /// A stream of this caller begins.
    pub fn stream_begins(&self, call: u64, key: Key) -> Arc<Unread> {
        let unread = Arc::new(Unread {
            key,
            began: Instant::now(),
            bytes: AtomicUsize::new(0),
            moved_ms: AtomicU64::new(0),
        });
        self.streams.lock().insert(call, Arc::clone(&unread));
        unread
    }

    /// A stream has ended, and nothing of it waits for the client.
    pub fn stream_gone(&self, call: u64) {
        self.streams.lock().remove(&call);
    }

    /// An answer is ready, and waits until the client reads it.
    pub fn answer_ready(&self, call: u64) {
        self.answers.lock().insert(call, Instant::now());
    }

    /// Some of an answer has been read.
    pub fn answer_moves(&self, call: u64) {
        if let Some(since) = self.answers.lock().get_mut(&call) {
            *since = Instant::now();
        }
    }

    /// An answer has been read, or will never be.
    pub fn answer_gone(&self, call: u64) {
        self.answers.lock().remove(&call);
    }

    /// Closes the connection.
    pub fn close(&self) {
        self.closing.store(true, Release);
        self.waker.wake();
    }

    /// Fails once the connection is to be closed.
    fn open(&self) -> io::Result<()> {
        match self.closing.load(Acquire) {
            true => Err(io::ErrorKind::ConnectionAborted.into()),
            false => Ok(()),
        }
    }

    fn oldest_answer(&self) -> Option<Instant> {
        self.answers.lock().values().min().copied()
    }
}

impl Drop for Client {
    fn drop(&mut self) {
        if let Some(connections) = self.connections.upgrade() {
            connections.clients.lock().remove(&self.id);
        }
    }
}

/// The client of a request, in the request's extensions if a trusted proxy named it (`forwarded`).
#[derive(Debug, Clone, Copy)]
pub struct ForwardedClient(pub IpAddr);

/// The address of the client that sent a request, from the request's extensions: the one that a
/// trusted proxy names, else that of the peer. `None` for connections without one, such as those of
/// a unix socket.
pub fn peer_address(extensions: &http::Extensions) -> Option<IpAddr> {
    if let Some(ForwardedClient(address)) = extensions.get() {
        return Some(*address);
    }
    let address = match Client::of(extensions) {
        Some(client) => client.address,
        None => extensions.get::<TcpConnectInfo>()?.remote_addr(),
    };
    address.map(|address| address.ip().to_canonical())
}

/// The connections of a listening socket.
pub fn accept(
    listener: Listener,
    connections: Arc<Connections>,
) -> impl Stream<Item = io::Result<Connection>> {
    let reserve = Reserve::new();
    let start = (listener, connections, reserve);
    stream::unfold(
        start,
        move |(listener, connections, mut reserve)| async move {
            let (stream, client) = loop {
                match listener.accept().await {
                    Ok((stream, address)) => match connections.admit(address) {
                        Some(client) => break (stream, client),
                        None => drop(stream),
                    },
                    Err(error) if is_out_of_descriptors(&error) => {
                        connections.refuse("OUT_OF_DESCRIPTORS", &error);
                        reserve.refuse_one(&listener);
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                    }
                    Err(error) => {
                        debug!(%error, "accepting a connection failed");
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                    }
                }
            };
            let connection = Connection { stream, client };
            Some((Ok(connection), (listener, connections, reserve)))
        },
    )
}

/// A file descriptor that is given up to refuse a connection when there is no other. Otherwise
/// those that wait would hang.
struct Reserve(Option<File>);

impl Reserve {
    fn new() -> Self {
        Self(File::open("/dev/null").ok())
    }

    fn refuse_one(&mut self, listener: &Listener) {
        self.0 = None;
        drop(listener.accept().now_or_never());
        *self = Self::new();
    }
}

#[cfg(unix)]
fn is_out_of_descriptors(error: &io::Error) -> bool {
    use rustix::io::Errno;
    let code = error.raw_os_error();
    [Errno::MFILE, Errno::NFILE]
        .iter()
        .any(|errno| code == Some(errno.raw_os_error()))
}

#[cfg(not(unix))]
fn is_out_of_descriptors(error: &io::Error) -> bool {
    /// `WSAEMFILE` of Windows.
    const TOO_MANY_SOCKETS: i32 = 10_024;
    error.raw_os_error() == Some(TOO_MANY_SOCKETS)
}

/// Sockets are not counted with files.
#[cfg(not(unix))]
fn raise_descriptor_limit() -> usize {
    usize::MAX
}

/// Raises the limit of open files to what the system allows and returns it.
#[cfg(unix)]
fn raise_descriptor_limit() -> usize {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    /// `OPEN_MAX` of macOS, which refuses more although it names no limit.
    const OPEN_MAX: u64 = 10_240;
    let limit = getrlimit(Resource::Nofile);
    let allowed = match (cfg!(target_os = "macos"), limit.maximum) {
        (true, maximum) => Some(maximum.map_or(OPEN_MAX, |it| it.min(OPEN_MAX))),
        (false, maximum) => maximum,
    };
    let raised = Rlimit {
        current: allowed,
        maximum: limit.maximum,
    };
    let current = match setrlimit(Resource::Nofile, raised) {
        Ok(()) => allowed,
        Err(_) => limit.current,
    };
    // No limit at all is none that matters.
    current
        .and_then(|limit| usize::try_from(limit).ok())
        .unwrap_or(usize::MAX)
}

fn set_options(stream: &TcpStream) -> io::Result<()> {
    stream.set_nodelay(true)?;
    let keepalive = TcpKeepalive::new()
        .with_time(KEEPALIVE_IDLE)
        .with_interval(KEEPALIVE_INTERVAL)
        .with_retries(KEEPALIVE_RETRIES);
    let socket = SockRef::from(stream);
    socket.set_tcp_keepalive(&keepalive)?;
    #[cfg(target_os = "linux")]
    socket.set_tcp_user_timeout(Some(UNACKNOWLEDGED_LIMIT))?;
    Ok(())
}

/// A connection that [`Client::close`] closes.
#[derive(Debug)]
pub struct Connection {
    stream: Socket,
    client: Arc<Client>,
}

impl Connection {
    /// Who is charged for it.
    pub fn key(&self) -> Key {
        self.client.key
    }
}

impl Connected for Connection {
    type ConnectInfo = Arc<Client>;

    fn connect_info(&self) -> Self::ConnectInfo {
        Arc::clone(&self.client)
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        if read.is_pending() {
            self.client.waker.register(context.waker());
            self.client.open()?;
        }
        read
    }
}

impl AsyncWrite for Connection {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.client.open()?;
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        // Some connections are only written to, for as long as what was read is not used up.
        self.client.waker.register(context.waker());
        self.client.open()?;
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.client.open()?;
        Pin::new(&mut self.stream).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use futures::StreamExt as _;
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};

    use super::*;

    fn limits(max_connections: usize) -> Limits {
        Limits {
            max_connections,
            shares: Shares::default(),
            trusted_proxies: TrustedProxies::default(),
        }
    }

    async fn listening(
        limits: Limits,
    ) -> (
        SocketAddr,
        Arc<Connections>,
        Pin<Box<impl Stream<Item = io::Result<Connection>>>>,
    ) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("bound");
        let connections = Connections::new(limits, Arc::default());
        let accepted = accept(listener.into(), Arc::clone(&connections));
        (address, connections, Box::pin(accepted))
    }

    #[cfg(unix)]
    #[tokio::test]
    async fn an_accepted_connection_is_probed_by_the_kernel() {
        let (address, _, mut accepted) = listening(limits(1)).await;
        let _client = TcpStream::connect(address).await.expect("it listens");
        let connection = accepted.next().await.expect("endless").expect("one");
        let Either::Left(stream) = &connection.stream else {
            panic!("not a TCP connection");
        };
        let socket = SockRef::from(stream);
        assert!(socket.keepalive().expect("an option"));
        assert_eq!(
            socket.tcp_keepalive_time().expect("an option"),
            KEEPALIVE_IDLE
        );
        assert!(socket.tcp_nodelay().expect("an option"));
    }

    #[tokio::test(start_paused = true)]
    async fn who_leaves_too_much_of_its_streams_unread_is_disconnected() {
        let connections = Connections::new(limits(8), Arc::default());
        let client = || {
            let address = SocketAddr::from(([127, 0, 0, 1], 1));
            connections.admit(Some(address)).expect("there is space")
        };
        let (one, other) = (Key::Local, Key::Address([192, 0, 2, 7].into()));
        let clients: Vec<Arc<Client>> = std::iter::repeat_with(client).take(3).collect();
        let streams = [one, one, other].map(|key| (key, MAX_UNREAD / 3));
        let mut unread = Vec::new();
        for (client, (key, bytes)) in clients.iter().zip(streams) {
            let stream = client.stream_begins(1, key);
            stream.waits(bytes);
            unread.push(stream);
        }
        let closed = |clients: &[Arc<Client>]| -> Vec<u64> {
            let closed = with_too_much_unread(clients);
            closed.into_iter().map(|client| client.id).collect()
        };
        tokio::time::advance(2 * STALLED_LIMIT).await;
        assert!(closed(&clients).is_empty(), "each caller may leave as much");
        unread[0].waits(MAX_UNREAD);
        assert_eq!(closed(&clients), [clients[0].id], "who leaves most");
        // A client that reads, however slowly, keeps its connection.
        unread[0].sent(1);
        assert!(closed(&clients).is_empty());
        tokio::time::advance(2 * STALLED_LIMIT).await;
        unread[0].sent(MAX_UNREAD);
        assert!(closed(&clients).is_empty());
        clients[0].stream_gone(1);
        assert_eq!(clients[0].streams(), 0);
    }

    #[test]
    fn the_connection_of_a_trusted_proxy_is_nobodys_own() {
        let proxy = "10.0.0.0/8".parse().expect("a network");
        let connections = Connections::new(
            Limits {
                trusted_proxies: TrustedProxies::new([proxy]),
                ..limits(8)
            },
            Arc::default(),
        );
        let admit = |address: [u8; 4]| connections.admit(Some((address, 1).into()));
        assert!(admit([10, 1, 2, 3]).is_some_and(|it| it.is_proxy()));
        assert!(admit([192, 0, 2, 7]).is_some_and(|it| !it.is_proxy()));
    }

    #[tokio::test]
    async fn one_caller_cannot_take_all_connections() {
        // Half of them are the share of a caller on this machine.
        let (address, connections, mut accepted) = listening(limits(4)).await;
        let mut clients = Vec::new();
        for _ in 0..4 {
            clients.push(TcpStream::connect(address).await.expect("it listens"));
        }
        let first = accepted.next().await.expect("endless").expect("one");
        let _second = accepted.next().await.expect("endless").expect("one");
        let mut byte = [0];
        tokio::select! {
            _ = accepted.next() => panic!("the others are closed"),
            read = clients[3].read(&mut byte) => assert!(!matches!(read, Ok(1..))),
        }
        assert_eq!(connections.clients().len(), 2);
        drop(first);
        let _fifth = TcpStream::connect(address).await.expect("it listens");
        assert!(accepted.next().await.is_some());
        assert_eq!(connections.clients().len(), 1);
    }

    #[tokio::test]
    async fn a_trusted_proxy_may_have_all_connections() {
        let network = "127.0.0.0/8".parse().expect("a network");
        let limits = Limits {
            trusted_proxies: TrustedProxies::new([network]),
            ..limits(4)
        };
        let (address, connections, accepted) = listening(limits).await;
        let mut clients = Vec::new();
        for _ in 0..4 {
            clients.push(TcpStream::connect(address).await.expect("it listens"));
        }
        let accepted: Vec<_> = accepted.take(4).collect().await;
        assert_eq!(accepted.len(), 4);
        assert_eq!(connections.clients().len(), 4);
    }

    #[tokio::test]
    async fn a_closed_connection_ends_while_it_is_read_or_written() {
        let (address, connections, mut accepted) = listening(limits(4)).await;
        let _client = TcpStream::connect(address).await.expect("it listens");
        let mut connection = accepted.next().await.expect("endless").expect("one");
        let reading = async {
            let read = connection.read_u8().await;
            (read.map(drop), connection.write_all(b"late").await)
        };
        let closing = async {
            tokio::task::yield_now().await;
            connections.clients().last().expect("connected").close();
        };
        let ((read, written), ()) = tokio::join!(reading, closing);
        for ended in [read, written] {
            let error = ended.expect_err("it is closed");
            assert_eq!(error.kind(), io::ErrorKind::ConnectionAborted);
        }
    }
}
