//! A server inside another process: a command that plays, the examiner, or a test. It listens on a
//! free port of this machine. `serve` is the server itself.

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::task::{JoinError, JoinHandle};
use tokio_util::sync::{CancellationToken, DropGuard};

use crate::access::{AccessSettings, Mode};
use crate::config::ServerConfig;
use crate::serve::{ServeError, serve};
use crate::store::{MemoryStore, Store};

/// Why a server in this process failed.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The server failed.
    #[error(transparent)]
    Serve(#[from] ServeError),
    /// Its task panicked or was cancelled.
    #[error("the server in this process was interrupted: {0}")]
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
    /// Starts a server with these settings and this store.
    ///
    /// # Errors
    /// No port is free.
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

    /// Starts a server for this process only. Games are stored in memory; records are written to
    /// files if there is a folder for them. Every program of this machine may use it. Stopping it does not wait for running games.
    ///
    /// # Errors
    /// No port is free.
    pub async fn in_memory(data_dir: Option<PathBuf>) -> io::Result<Self> {
        let config = ServerConfig {
            data_dir,
            grace: Duration::ZERO,
            // Tokens in the folder are those of the server that has its games there.
            access: AccessSettings {
                mode: Some(Mode::Open),
                ..AccessSettings::default()
            },
            ..ServerConfig::default()
        };
        Self::start(config, Arc::new(MemoryStore::default())).await
    }

    /// Its socket address.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its URL for clients.
    pub fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Requests a stop without waiting for it.
    pub fn request_stop(&self) {
        self.stop.cancel();
    }

    /// Waits until it has stopped.
    ///
    /// # Errors
    /// The server failed.
    pub async fn ended(self) -> Result<(), HostError> {
        Ok(self.serving.await??)
    }

    /// Stops it and waits until all records are written.
    ///
    /// # Errors
    /// The server failed.
    pub async fn stop(self) -> Result<(), HostError> {
        self.request_stop();
        self.ended().await
    }
}
