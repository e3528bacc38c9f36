//! Accepts connections: disables Nagle's delay, limits their number, and drops those that send
//! nothing at the start or whose peer has vanished.

use std::io;
use std::net::IpAddr;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use futures::{Stream, stream};
use prometheus_client::metrics::gauge::Gauge;
use socket2::{SockRef, TcpKeepalive};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream, UnixListener, UnixStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::Sleep;
use tokio_util::either::Either;
use tonic::transport::server::{Connected, TcpConnectInfo};
use tracing::debug;

use crate::metrics::Counted;

/// Pause after a failed accept: usually the process has run out of file descriptors.
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

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
    Unix(UnixListener),
}

impl From<TcpListener> for Listener {
    fn from(listener: TcpListener) -> Self {
        Self::Tcp(listener)
    }
}

impl From<UnixListener> for Listener {
    fn from(listener: UnixListener) -> Self {
        Self::Unix(listener)
    }
}

impl Listener {
    async fn accept(&self) -> io::Result<Socket> {
        match self {
            Self::Tcp(listener) => {
                let (stream, _) = listener.accept().await?;
                if let Err(error) = set_options(&stream) {
                    debug!(%error, "could not set the options of a connection");
                }
                Ok(Either::Left(stream))
            }
            Self::Unix(listener) => Ok(Either::Right(listener.accept().await?.0)),
        }
    }
}

type Socket = Either<TcpStream, UnixStream>;

/// Limits of connections.
#[derive(Debug, Clone, Copy)]
pub struct Limits {
    /// Most connections at a time; further ones wait to be accepted.
    pub max_connections: usize,
    /// How long a new connection may stay silent.
    pub first_byte_timeout: Duration,
}

/// The client of a request, in the request's extensions if a trusted proxy named it (`forwarded`).
#[derive(Debug, Clone, Copy)]
pub(crate) struct ForwardedClient(pub(crate) IpAddr);

/// The address of the client that sent a request, from the request's extensions: the one that a
/// trusted proxy names, else that of the peer. `None` for connections without one, such as those of
/// a unix socket.
pub fn peer_address(extensions: &http::Extensions) -> Option<IpAddr> {
    if let Some(ForwardedClient(address)) = extensions.get() {
        return Some(*address);
    }
    let info: &TcpConnectInfo = extensions.get()?;
    info.remote_addr()
        .map(|address| address.ip().to_canonical())
}

/// The connections of a listening socket. `open`: gauge of open connections.
pub fn accept(
    listener: Listener,
    limits: Limits,
    open: Gauge,
) -> impl Stream<Item = io::Result<Connection>> {
    let permits = Arc::new(Semaphore::new(limits.max_connections));
    stream::unfold(
        (listener, permits, open),
        move |(listener, permits, open)| async move {
            let permit = Arc::clone(&permits)
                .acquire_owned()
                .await
                .expect("the semaphore is never closed");
            let stream = loop {
                match listener.accept().await {
                    Ok(stream) => break stream,
                    Err(error) => {
                        debug!(%error, "accepting a connection failed");
                        tokio::time::sleep(ACCEPT_PAUSE).await;
                    }
                }
            };
            let connection = Connection {
                stream,
                silence: Some(Box::pin(tokio::time::sleep(limits.first_byte_timeout))),
                _permit: permit,
                _counted: Counted::new(&open),
            };
            Some((Ok(connection), (listener, permits, open)))
        },
    )
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

/// A connection that is dropped unless it sends its first bytes in time.
#[derive(Debug)]
pub struct Connection {
    stream: Socket,
    /// Fires unless something has been read.
    silence: Option<Pin<Box<Sleep>>>,
    _permit: OwnedSemaphorePermit,
    _counted: Counted,
}

impl Connected for Connection {
    type ConnectInfo = TcpConnectInfo;

    fn connect_info(&self) -> Self::ConnectInfo {
        match &self.stream {
            Either::Left(stream) => stream.connect_info(),
            Either::Right(_) => TcpConnectInfo {
                local_addr: None,
                remote_addr: None,
            },
        }
    }
}

impl AsyncRead for Connection {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let read = Pin::new(&mut self.stream).poll_read(context, buffer);
        if read.is_ready() {
            self.silence = None;
        } else if let Some(silence) = &mut self.silence
            && silence.as_mut().poll(context).is_ready()
        {
            return Poll::Ready(Err(io::ErrorKind::TimedOut.into()));
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
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
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
        Pin::new(&mut self.stream).poll_write_vectored(context, bytes)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }
}

#[cfg(test)]
mod tests {
    use futures::StreamExt as _;

    use super::*;

    #[cfg(unix)]
    #[tokio::test]
    async fn an_accepted_connection_is_probed_by_the_kernel() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("bound");
        let limits = Limits {
            max_connections: 1,
            first_byte_timeout: Duration::from_secs(60),
        };
        let mut connections = std::pin::pin!(accept(listener.into(), limits, Gauge::default()));
        let _client = TcpStream::connect(address).await.expect("it listens");
        let connection = connections.next().await.expect("endless").expect("one");
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
}
