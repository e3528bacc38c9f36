//! A server within the process of somebody else: of a command that plays at once, of the examiner of agents, of a test. It listens on a free
//! port of this machine. What a server does is in `serve`.

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinHandle};
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::config::ServerConfig;
use crate::serve::{ServeError, serve};
use crate::store::{MemoryStore, Store};

/// Why a server within this process did not end well.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// It said why.
    #[error(transparent)]
    Serve(#[from] ServeError),
    /// Its task did not come to its end.
    #[error("the server within this process was broken off: {0}")]
    BrokenOff(#[from] JoinError),
}

/// A server that runs until it is stopped or dropped.
#[derive(Debug)]
pub struct Host {
    address: SocketAddr,
    stop: CancellationToken,
    serving: JoinHandle<Result<(), ServeError>>,
    _stops_when_dropped: DropGuard,
}

impl Host {
    /// Starts a server of this configuration over a store.
    ///
    /// # Errors
    /// There is no free port.
    pub async fn start(config: ServerConfig, store: Arc<dyn Store>) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let address = listener.local_addr()?;
        let stop = CancellationToken::new();
        let stopped = stop.clone().cancelled_owned();
        Ok(Self {
            address,
            serving: tokio::spawn(serve(listener, config, store, stopped)),
            _stops_when_dropped: stop.clone().drop_guard(),
            stop,
        })
    }

    /// Starts a server for this process alone: games are kept in memory and, if there is a folder for them, records in files. When it is
    /// stopped its games have ended, or nobody waits for them any more.
    ///
    /// # Errors
    /// There is no free port.
    pub async fn in_memory(data_dir: Option<PathBuf>) -> io::Result<Self> {
        let config = ServerConfig {
            data_dir,
            grace: Duration::ZERO,
            ..ServerConfig::default()
        };
        Self::start(config, Arc::new(MemoryStore::default())).await
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Where it listens, as clients want it.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Asks it to stop, without waiting for it.
    pub fn ask_to_stop(&self) {
        self.stop.cancel();
    }

    /// Waits until it has ended by itself, or because it was asked to.
    ///
    /// # Errors
    /// It did not end well.
    pub async fn ended(self) -> Result<(), HostError> {
        Ok(self.serving.await??)
    }

    /// Stops it and waits until all records are written.
    ///
    /// # Errors
    /// It did not end well.
    pub async fn stop(self) -> Result<(), HostError> {
        self.ask_to_stop();
        self.ended().await
    }
}
