//! The server behind the examiner: the real one, in this process, on a port of its own that the agent is not told of.

use std::net::Ipv4Addr;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::Client;
use tokio::net::TcpListener;
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use super::examination::ExaminationError;
use crate::config::ServerConfig;
use crate::serve::{ServeError, serve};
use crate::store::MemoryStore;

/// A server that runs until it is stopped.
#[derive(Debug)]
pub(super) struct Host {
    /// A connection to it.
    pub(super) client: Client,
    stop: CancellationToken,
    serving: JoinHandle<Result<(), ServeError>>,
}

impl Host {
    pub(super) async fn start() -> Result<Self, ExaminationError> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).await?;
        let address = listener.local_addr()?;
        let stop = CancellationToken::new();
        let config = ServerConfig {
            grace: Duration::ZERO,
            ..ServerConfig::default()
        };
        let store = Arc::new(MemoryStore::default());
        let stopped = stop.clone().cancelled_owned();
        let serving = tokio::spawn(serve(listener, config, store, stopped));
        let client = Client::connect(format!("http://{address}")).await?;
        Ok(Self {
            client,
            stop,
            serving,
        })
    }

    pub(super) async fn stop(self) -> Result<(), ExaminationError> {
        drop(self.client);
        self.stop.cancel();
        Ok(self.serving.await??)
    }
}
