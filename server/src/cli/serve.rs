//! `chefshat serve`: host rooms until told to stop.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use tokio::net::TcpListener;
use tokio::signal::unix::{SignalKind, signal};

use super::{CommandError, data_dir, say};
use crate::config::ServerConfig;
use crate::serve::serve;
use crate::store::MemoryStore;

/// Host rooms: one port for gRPC, gRPC-web, health checks and reflection.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  chefshat serve --listen 127.0.0.1:50051 --data-dir ./chefshat-data"
)]
pub(super) struct Serve {
    /// Address and port to listen on; port 0 takes a free one.
    #[arg(long, env = "CHEFSHAT_LISTEN", default_value = "127.0.0.1:50051")]
    listen: SocketAddr,
    /// Folder for records of finished games (records/GAME-ID.jsonl). Standard: chefshat in the user's data folder.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Write no records.
    #[arg(long, env = "CHEFSHAT_NO_RECORDS", conflicts_with = "data_dir")]
    no_records: bool,
    /// Most rooms at a time.
    #[arg(long, env = "CHEFSHAT_MAX_ROOMS", default_value_t = 10_000)]
    max_rooms: usize,
    /// Seconds that running games may go on after the server was told to stop.
    #[arg(long, env = "CHEFSHAT_GRACE", default_value_t = 30)]
    grace: u64,
    /// Web origin whose pages may call the server (repeatable); * is all.
    #[arg(
        long = "allow-origin",
        env = "CHEFSHAT_ALLOW_ORIGIN",
        value_delimiter = ','
    )]
    allowed_origins: Vec<String>,
    /// Say where the server listens as a JSON line on standard output.
    #[arg(long)]
    json: bool,
}

impl Serve {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let data_dir = match self.no_records {
            true => None,
            false => Some(data_dir::prepare(self.data_dir)?),
        };
        let listener = TcpListener::bind(self.listen).await.map_err(|error| {
            format!(
                "cannot listen on {}: {error}; choose another address with --listen",
                self.listen
            )
        })?;
        let address = listener.local_addr()?;
        // Before anybody is told where to connect, so that a stop that comes at once is heard.
        let mut terminate = signal(SignalKind::terminate())?;
        let mut interrupt = signal(SignalKind::interrupt())?;
        if self.json {
            say(serde_json::json!({"event": "listening", "address": address.to_string()}))?;
        }
        eprintln!("listening on http://{address}");
        if let Some(folder) = &data_dir {
            eprintln!("records go to {}", folder.join("records").display());
        }
        let config = ServerConfig {
            data_dir,
            max_rooms: self.max_rooms,
            grace: Duration::from_secs(self.grace),
            allowed_origins: self.allowed_origins,
            ..ServerConfig::default()
        };
        let stop = async move {
            tokio::select! {
                _ = terminate.recv() => {}
                _ = interrupt.recv() => {}
            }
            eprintln!(
                "stopping: no new rooms; running games may end within the grace; stop again to end at once"
            );
            tokio::spawn(async move {
                tokio::select! {
                    _ = terminate.recv() => {}
                    _ = interrupt.recv() => {}
                }
                eprintln!("stopped at once: running games are lost");
                std::process::exit(1);
            });
        };
        serve(listener, config, Arc::new(MemoryStore::default()), stop).await?;
        Ok(ExitCode::SUCCESS)
    }
}
