//! Ways over TCP between programs of a test, which can delay, hold and break: a network that fails
//! as the test wants it.

use std::collections::BTreeSet;
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Notify, mpsc, watch};
use tokio::task::JoinHandle;
use tokio::time::Instant;

/// Bytes that a link reads at a time.
const BUFFER: usize = 16 * 1024;

/// What a way keeps back. It arrives once the way passes everything again, unless the connection
/// was cut before.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Held {
    /// Nothing.
    #[default]
    Nothing,
    /// What comes back from the target.
    Answers,
    /// Everything.
    Everything,
}

/// What happens to the connections of one way. Clones control the same way.
#[derive(Debug, Clone, Default)]
pub struct Way {
    state: Arc<State>,
}

#[derive(Debug, Default)]
struct State {
    delay_us: AtomicU64,
    held: watch::Sender<Held>,
    cut: Notify,
    /// The local ports of the connections to the target.
    ports: Mutex<BTreeSet<u16>>,
}

impl Way {
    /// Delays everything in both directions from now on.
    pub fn delay(&self, delay: Duration) {
        let micros = u64::try_from(delay.as_micros()).expect("short");
        self.state.delay_us.store(micros, Ordering::Relaxed);
    }

    /// Keeps this back from now on, of new connections too. Neither side notices.
    pub fn hold(&self, held: Held) {
        self.state.held.send_replace(held);
    }

    /// Breaks the connections; what was held is lost. New ones are possible.
    pub fn cut(&self) {
        self.state.cut.notify_waiters();
    }

    /// The ports from which the present connections come, as the target sees them.
    pub fn ports(&self) -> BTreeSet<u16> {
        self.open_ports().clone()
    }

    fn open_ports(&self) -> MutexGuard<'_, BTreeSet<u16>> {
        (self.state.ports.lock()).expect("nothing panics under this lock")
    }

    /// Connects `near` to the target until one of them ends or the way is cut.
    async fn carry(self, near: TcpStream, target: SocketAddr) {
        // Asked first, so that no cut is missed.
        let cut = self.state.cut.notified();
        let Ok(far) = TcpStream::connect(target).await else {
            return;
        };
        let _ = (near.set_nodelay(true), far.set_nodelay(true));
        let port = far.local_addr().map(|address| address.port());
        self.open_ports().extend(port.as_ref());
        let (near_read, near_write) = near.into_split();
        let (far_read, far_write) = far.into_split();
        let requests = self.carry_on(near_read, far_write, |held| held == Held::Everything);
        let answers = self.carry_on(far_read, near_write, |held| held != Held::Nothing);
        tokio::select! {
            () = cut => {}
            _ = async { tokio::try_join!(requests, answers) } => {}
        }
        if let Ok(port) = port {
            self.open_ports().remove(&port);
        }
    }

    /// Carries what arrives in one direction, in order, each part after its delay and while nothing
    /// holds it, and then the end.
    async fn carry_on(
        &self,
        mut from: OwnedReadHalf,
        mut to: OwnedWriteHalf,
        is_held: impl Fn(Held) -> bool,
    ) -> io::Result<()> {
        let (sender, mut receiver) = mpsc::unbounded_channel::<(Instant, Vec<u8>)>();
        let reading = async move {
            let mut buffer = vec![0; BUFFER];
            loop {
                let count = from.read(&mut buffer).await?;
                if count == 0 {
                    return Ok(());
                }
                let delay = Duration::from_micros(self.state.delay_us.load(Ordering::Relaxed));
                let _ = sender.send((Instant::now() + delay, buffer[..count].to_vec()));
            }
        };
        let writing = async {
            let mut held = self.state.held.subscribe();
            let mut passes = async || {
                let passes = held.wait_for(|held| !is_held(*held)).await;
                passes.expect("the way holds the sender");
            };
            while let Some((due, bytes)) = receiver.recv().await {
                tokio::time::sleep_until(due).await;
                passes().await;
                to.write_all(&bytes).await?;
            }
            passes().await;
            to.shutdown().await
        };
        tokio::try_join!(reading, writing).map(drop)
    }
}

/// An address in front of a target.
#[derive(Debug)]
pub struct Link {
    /// Where to connect.
    pub address: SocketAddr,
    way: Way,
    target: watch::Sender<SocketAddr>,
    accepting: JoinHandle<()>,
}

impl Link {
    /// An address whose connections all take the same way.
    pub async fn to(target: SocketAddr) -> Self {
        let way = Way::default();
        let only = way.clone();
        Self::by_origin(target, way, move |_| Some(only.clone())).await
    }

    /// An address whose connections take ways that depend on where they come from; those with none
    /// are broken. The link itself controls `way`.
    pub async fn by_origin(
        target: SocketAddr,
        way: Way,
        way_of: impl Fn(SocketAddr) -> Option<Way> + Send + 'static,
    ) -> Self {
        let listener = listen().await;
        let address = listener.local_addr().expect("it is bound");
        let (target, leads_to) = watch::channel(target);
        let accepting = async move {
            while let Ok((near, origin)) = listener.accept().await {
                if let Some(way) = way_of(origin) {
                    tokio::spawn(way.carry(near, *leads_to.borrow()));
                }
            }
        };
        Self {
            address,
            way,
            target,
            accepting: tokio::spawn(accepting),
        }
    }

    /// What happens to its connections.
    pub fn way(&self) -> &Way {
        &self.way
    }

    /// Delays everything in both directions from now on.
    pub fn delay(&self, delay: Duration) {
        self.way.delay(delay);
    }

    /// Breaks the connections. New ones are possible.
    pub fn cut(&self) {
        self.way.cut();
    }

    /// Breaks the connections. New ones lead to another target.
    pub fn lead_to(&self, target: SocketAddr) {
        self.target.send_replace(target);
        self.way.cut();
    }

    /// Breaks the connections, and refuses new ones.
    pub fn close(&self) {
        self.accepting.abort();
        self.way.cut();
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        self.close();
    }
}

/// A socket on a free port.
pub(crate) async fn listen() -> TcpListener {
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await;
    listener.expect("a free port")
}
