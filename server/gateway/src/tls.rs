//! TLS on the server's connections. Each handshake is a task of its own beside the accept loop, so
//! a peer that stalls delays nobody; `handshakes` limits them. The certificate is read again when
//! its files change; existing connections keep theirs.

use std::io;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use arc_swap::ArcSwap;
use futures::{Stream, StreamExt as _, stream};
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;
use tonic::transport::server::Connected;
use tracing::{debug, error, info};

use crate::handshakes::{Handshake, Handshakes};
use chefshat_admission::limits::Key;
use chefshat_base::file_watch::FileWatch;
use chefshat_base::lock::Lock;
use chefshat_base::tasks::short;
use chefshat_base::tls_files::ServerTls;
pub use chefshat_base::tls_files::{TlsError, TlsFiles};

/// How long a client may take for the handshake.
const HANDSHAKE_TIMEOUT: Duration = Duration::from_secs(10);
/// How often the files are looked at.
const INTERVAL: Duration = Duration::from_secs(1);

/// The certificate of a server, as its files are.
#[derive(Debug)]
pub struct Tls {
    files: TlsFiles,
    watch: Lock<FileWatch>,
    current: ArcSwap<ServerTls>,
}

impl Tls {
    /// Reads the files.
    ///
    /// # Errors
    /// They cannot be used.
    pub fn open(files: TlsFiles) -> Result<Arc<Self>, TlsError> {
        // Watched before they are read: a later change is noticed.
        let watch = Lock::new(FileWatch::of(files.paths()));
        let current = ArcSwap::from_pointee(files.read()?);
        Ok(Arc::new(Self {
            files,
            watch,
            current,
        }))
    }

    /// Reads the files again whenever they change, until it is dropped. If they cannot be used, the
    /// certificate stays as it was.
    pub async fn follow(self: Arc<Self>) {
        loop {
            sleep(INTERVAL).await;
            let tls = Arc::clone(&self);
            // A disk may hang.
            let reading = tokio::task::spawn_blocking(move || tls.read_if_changed());
            if let Err(error) = reading.await {
                error!(%error, "the certificate was not read");
            }
        }
    }

    /// Reads the files again if they have changed. Blocks.
    fn read_if_changed(&self) {
        let mut watch = self.watch.lock();
        let read = watch.read_changed(|| {
            self.current.store(Arc::new(self.files.read()?));
            info!("the certificate was read again");
            Ok::<_, TlsError>(())
        });
        if let Err(error) = read {
            error!(%error, "the certificate stays as it was");
        }
    }

    /// When the first of its certificates expires, in seconds since the Unix epoch, if that is known.
    pub fn expires_at(&self) -> Option<i64> {
        self.current.load().expires_at
    }

    /// These connections, encrypted. Those whose handshake fails, or for whose address `limits` has
    /// no place, are dropped.
    pub fn secure<C>(
        self: Arc<Self>,
        incoming: impl Stream<Item = io::Result<C>> + Send,
        limits: Arc<Handshakes>,
        key_of: fn(&C) -> Key,
    ) -> impl Stream<Item = io::Result<MaybeTls<C>>> + Send
    where
        C: AsyncRead + AsyncWrite + Connected + Unpin + Send + 'static,
    {
        let state = (Box::pin(incoming), JoinSet::new());
        stream::unfold(state, move |(mut incoming, mut handshakes)| {
            let (tls, limits) = (Arc::clone(&self), Arc::clone(&limits));
            async move {
                loop {
                    tokio::select! {
                        Some(done) = handshakes.join_next() => {
                            if let Ok(Some(secured)) = done {
                                return Some((Ok(secured), (incoming, handshakes)));
                            }
                        }
                        next = incoming.next() => match next? {
                            Ok(connection) => {
                                let (tls, limits) = (Arc::clone(&tls), Arc::clone(&limits));
                                let key = key_of(&connection);
                                handshakes.spawn(short("one handshake, within its time limit", async move {
                                    // Others' handshakes do not use up the time of this one.
                                    let admitted = timeout(HANDSHAKE_TIMEOUT, limits.admit(key));
                                    tls.handshake(connection, admitted.await.ok()??).await
                                }));
                            }
                            Err(error) => return Some((Err(error), (incoming, handshakes))),
                        },
                    }
                }
            }
        })
    }

    async fn handshake<C>(&self, connection: C, admitted: Handshake) -> Option<MaybeTls<C>>
    where
        C: AsyncRead + AsyncWrite + Unpin + Send + 'static,
    {
        let acceptor = TlsAcceptor::from(Arc::clone(&self.current.load().config));
        let computing = admitted.compute(acceptor.accept(connection));
        let shaken = timeout(HANDSHAKE_TIMEOUT, computing).await;
        let stream = shaken.unwrap_or_else(|_| Some(Err(io::ErrorKind::TimedOut.into())))?;
        stream
            .map(|stream| MaybeTls::Tls(Box::new(stream)))
            .inspect_err(|error| debug!(%error, "a TLS handshake failed"))
            .ok()
    }
}

/// A connection, encrypted or not.
#[derive(Debug)]
pub enum MaybeTls<C> {
    /// Not encrypted.
    Plain(C),
    /// Encrypted.
    Tls(Box<TlsStream<C>>),
}

impl<C: Connected> Connected for MaybeTls<C> {
    type ConnectInfo = C::ConnectInfo;

    fn connect_info(&self) -> Self::ConnectInfo {
        match self {
            Self::Plain(connection) => connection.connect_info(),
            Self::Tls(stream) => stream.get_ref().0.connect_info(),
        }
    }
}

impl<C: AsyncRead + AsyncWrite + Unpin> AsyncRead for MaybeTls<C> {
    fn poll_read(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        match self.get_mut() {
            Self::Plain(connection) => Pin::new(connection).poll_read(context, buffer),
            Self::Tls(stream) => Pin::new(stream).poll_read(context, buffer),
        }
    }
}

impl<C: AsyncRead + AsyncWrite + Unpin> AsyncWrite for MaybeTls<C> {
    fn poll_write(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        match self.get_mut() {
            Self::Plain(connection) => Pin::new(connection).poll_write(context, bytes),
            Self::Tls(stream) => Pin::new(stream).poll_write(context, bytes),
        }
    }

    fn poll_flush(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match self.get_mut() {
            Self::Plain(connection) => Pin::new(connection).poll_flush(context),
            Self::Tls(stream) => Pin::new(stream).poll_flush(context),
        }
    }

    fn poll_shutdown(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        match self.get_mut() {
            Self::Plain(connection) => Pin::new(connection).poll_shutdown(context),
            Self::Tls(stream) => Pin::new(stream).poll_shutdown(context),
        }
    }

    fn poll_write_vectored(
        self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        match self.get_mut() {
            Self::Plain(connection) => Pin::new(connection).poll_write_vectored(context, bytes),
            Self::Tls(stream) => Pin::new(stream).poll_write_vectored(context, bytes),
        }
    }

    fn is_write_vectored(&self) -> bool {
        match self {
            Self::Plain(connection) => connection.is_write_vectored(),
            Self::Tls(stream) => stream.is_write_vectored(),
        }
    }
}

#[cfg(test)]
mod tests {
    use futures::TryStreamExt as _;
    use rustls::pki_types::ServerName;
    use rustls::{ClientConfig, RootCertStore};
    use tokio::io::{AsyncReadExt as _, DuplexStream, duplex};
    use tokio_rustls::TlsConnector;

    use super::*;
    use chefshat_admission::limits::Shares;

    /// A connection of a caller.
    struct Keyed {
        connection: DuplexStream,
        key: Key,
    }

    impl Connected for Keyed {
        type ConnectInfo = ();

        fn connect_info(&self) {}
    }

    impl AsyncRead for Keyed {
        fn poll_read(
            mut self: Pin<&mut Self>,
            context: &mut Context<'_>,
            buffer: &mut ReadBuf<'_>,
        ) -> Poll<io::Result<()>> {
            Pin::new(&mut self.connection).poll_read(context, buffer)
        }
    }

    impl AsyncWrite for Keyed {
        fn poll_write(
            mut self: Pin<&mut Self>,
            context: &mut Context<'_>,
            bytes: &[u8],
        ) -> Poll<io::Result<usize>> {
            Pin::new(&mut self.connection).poll_write(context, bytes)
        }

        fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
            Pin::new(&mut self.connection).poll_flush(context)
        }

        fn poll_shutdown(
            mut self: Pin<&mut Self>,
            context: &mut Context<'_>,
        ) -> Poll<io::Result<()>> {
            Pin::new(&mut self.connection).poll_shutdown(context)
        }
    }

    /// A server's side of the connections of these clients, and what clients trust.
    fn server() -> (tempfile::TempDir, Arc<Tls>, RootCertStore) {
        let folder = tempfile::tempdir().expect("a folder");
        let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a name");
        let files = TlsFiles {
            certificate: folder.path().join("cert.pem"),
            key: folder.path().join("key.pem"),
            client_authority: None,
        };
        std::fs::write(&files.certificate, made.cert.pem()).expect("written");
        std::fs::write(&files.key, made.signing_key.serialize_pem()).expect("written");
        let mut roots = RootCertStore::empty();
        roots.add(made.cert.der().clone()).expect("a certificate");
        (folder, Tls::open(files).expect("usable"), roots)
    }

    async fn connect(
        roots: RootCertStore,
        connection: DuplexStream,
    ) -> tokio_rustls::client::TlsStream<DuplexStream> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .expect("ring supports the default versions")
            .with_root_certificates(roots)
            .with_no_client_auth();
        let name = ServerName::try_from("localhost").expect("a name");
        let connector = TlsConnector::from(Arc::new(config));
        connector.connect(name, connection).await.expect("trusted")
    }

    fn handshakes() -> Arc<Handshakes> {
        Handshakes::new(Shares::default(), Arc::default()).expect("a thread")
    }

    #[test]
    fn an_authority_that_cannot_be_used_is_left_out() {
        let (folder, tls, _) = server();
        let authority = folder.path().join("authorities.pem");
        let files = TlsFiles {
            client_authority: Some(authority.clone()),
            ..tls.files.clone()
        };
        let unusable = "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n";
        std::fs::write(&authority, unusable).expect("written");
        files.read().expect_err("no authority is left");
        let good = std::fs::read_to_string(&files.certificate).expect("a certificate");
        std::fs::write(&authority, format!("{unusable}{good}")).expect("written");
        files.read().expect("one is left");
    }

    #[tokio::test]
    async fn a_handshake_that_stalls_is_given_up_and_delays_nobody() {
        let (_folder, tls, roots) = server();
        let ((stalled, first), (near, second)) = (duplex(16 * 1024), duplex(16 * 1024));
        let incoming = stream::iter([Ok(first), Ok(second)]).chain(stream::pending());
        let secured = tls.secure(incoming, handshakes(), |_| Key::Local);
        let mut secured = std::pin::pin!(secured);
        let (_client, accepted) = tokio::join!(connect(roots, near), secured.next());
        accepted.expect("one").expect("no error");
        // The stalled handshake ends with its connection, and is not handed on.
        tokio::time::pause();
        let mut stalled = stalled;
        let ended = async { stalled.read_u8().await.is_err() };
        tokio::select! {
            next = secured.next() => panic!("{}", next.is_some()),
            ended = ended => assert!(ended),
        }
    }

    #[tokio::test]
    async fn a_flood_of_handshakes_is_refused_after_few_and_others_are_served() {
        let (_folder, tls, roots) = server();
        let flood = (0..2_000).map(|_| {
            // It says nothing, and its client has gone.
            let (client, connection) = duplex(16 * 1024);
            drop(client);
            Ok((connection, Key::Resumed))
        });
        let (near, honest) = duplex(16 * 1024);
        let incoming = stream::iter(flood.chain([Ok((honest, Key::Local))]));
        let incoming = incoming.map_ok(|(connection, key)| Keyed { connection, key });
        let limits = handshakes();
        let secured = tls.secure(
            incoming.chain(stream::pending()),
            Arc::clone(&limits),
            |keyed| keyed.key,
        );
        let mut secured = std::pin::pin!(secured);
        let (_client, accepted) = tokio::join!(connect(roots, near), secured.next());
        accepted.expect("one").expect("no error");
        assert!(limits.admit(Key::Resumed).await.is_none(), "too many");
    }
}
