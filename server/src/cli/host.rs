//! A server within the process of a command, for those who want to play at once: on a free port of this machine, with the games in memory and
//! their records in the data folder.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::CommandError;
use crate::config::ServerConfig;
use crate::serve::{ServeError, serve};
use crate::store::MemoryStore;

/// The server.
pub(super) struct Host {
    /// Where it listens.
    pub(super) address: SocketAddr,
    stop: CancellationToken,
    serving: JoinHandle<Result<(), ServeError>>,
}

impl Host {
    /// Starts it.
    ///
    /// # Errors
    /// There is no free port.
    pub(super) async fn start(data_dir: PathBuf) -> Result<Self, CommandError> {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await?;
        let address = listener.local_addr()?;
        let stop = CancellationToken::new();
        let config = ServerConfig {
            data_dir: Some(data_dir),
            // When the command ends its game has ended, or nobody waits for it any more.
            grace: Duration::ZERO,
            ..ServerConfig::default()
        };
        let stopped = stop.clone().cancelled_owned();
        let store = Arc::new(MemoryStore::default());
        let serving = tokio::spawn(serve(listener, config, store, stopped));
        Ok(Self {
            address,
            stop,
            serving,
        })
    }

    /// Where it listens, as clients want it.
    pub(super) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Stops it and waits until all records are written.
    ///
    /// # Errors
    /// It did not end well.
    pub(super) async fn stop(self) -> Result<(), CommandError> {
        self.stop.cancel();
        self.serving.await??;
        Ok(())
    }
}
