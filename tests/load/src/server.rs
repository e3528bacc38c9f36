//! The servers that are measured: this program run again as a process of its own, so that CPU and memory of the two sides are counted
//! apart. The child says where it listens on its standard output, and ends when its standard input does, so that it never outlives us.

use std::io::Write as _;
use std::net::SocketAddr;
use std::path::Path;
use std::process::Stdio;
use std::sync::Arc;
use std::time::Duration;

use chefshat_server::config::ServerConfig;
use chefshat_server::store::{MemoryStore, SqliteStore, Store};
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, BufReader};
use tokio::net::TcpListener;
use tokio::process::{Child, Command};

use crate::bare;
use crate::error::LoadError;
use crate::options::{Place, Serve};

/// How long a child may take to listen.
const START_LIMIT: Duration = Duration::from_secs(30);

/// How long a child may take to end by itself.
const STOP_LIMIT: Duration = Duration::from_secs(10);

/// Ended rooms are forgotten soon: a run plays more of them than a day of people does.
const RETENTION: Duration = Duration::from_secs(1);

/// What a child serves.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Kind<'a> {
    /// The bare room.
    Bare,
    /// The game server, which keeps games in memory.
    InMemory,
    /// The game server, which keeps games in this folder.
    OnDisk(&'a Path),
}

/// The part of the child.
pub(crate) async fn serve(options: &Serve) -> Result<(), LoadError> {
    let failed = |error: &dyn std::error::Error| LoadError::Protocol(error.to_string());
    let store: Arc<dyn Store> = match &options.data_dir {
        Some(folder) => {
            let opened = SqliteStore::open(folder).await;
            Arc::new(opened.map_err(|error| failed(&error))?)
        }
        None => Arc::new(MemoryStore::default()),
    };
    let listener = TcpListener::bind(("127.0.0.1", 0))
        .await
        .map_err(LoadError::io("listening"))?;
    let address = listener
        .local_addr()
        .map_err(LoadError::io("asking for the port"))?;
    let mut out = std::io::stdout().lock();
    writeln!(out, "{address}")
        .and_then(|()| out.flush())
        .map_err(LoadError::io("saying where it listens"))?;
    drop(out);
    let parent_gone = async {
        // Whatever comes, an end or an error: nobody is there any more.
        let _ = tokio::io::stdin().read_to_end(&mut Vec::new()).await;
    };
    if options.bare {
        bare::serve(listener, parent_gone).await?;
        return Ok(());
    }
    let config = ServerConfig {
        data_dir: options.data_dir.clone(),
        retention: RETENTION,
        grace: Duration::ZERO,
        ..ServerConfig::default()
    };
    chefshat_server::serve::serve(listener, config, store, parent_gone)
        .await
        .map_err(|error| failed(&error))
}

/// A server process. Killed when dropped.
#[derive(Debug)]
pub(crate) struct ServerProcess {
    child: Child,
    pid: u32,
    address: SocketAddr,
}

impl ServerProcess {
    /// Starts a server and waits until it listens.
    pub(crate) async fn start(kind: Kind<'_>, place: Place) -> Result<Self, LoadError> {
        let program = std::env::current_exe().map_err(LoadError::io("finding this program"))?;
        let mut command = Command::new(program);
        command.arg("serve");
        match kind {
            Kind::Bare => drop(command.arg("--bare")),
            Kind::InMemory => {}
            Kind::OnDisk(folder) => drop(command.arg("--data-dir").arg(folder)),
        }
        if place.pin {
            command.args(["--pin", "--core", &place.core.to_string()]);
        } else {
            command.args(["--threads", &place.threads.to_string()]);
        }
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .map_err(LoadError::io("starting a server"))?;
        let out = child.stdout.take().expect("standard output is piped");
        let mut line = String::new();
        let mut reader = BufReader::new(out);
        tokio::time::timeout(START_LIMIT, reader.read_line(&mut line))
            .await
            .map_err(|_| LoadError::Stuck("the start of a server"))?
            .map_err(LoadError::io("reading where a server listens"))?;
        let address = line.trim().parse().map_err(|_| {
            LoadError::Protocol(format!("a server says that it listens at {line:?}"))
        })?;
        let pid = child
            .id()
            .expect("a child that listens has not been waited for");
        Ok(Self {
            child,
            pid,
            address,
        })
    }

    /// Its process number.
    pub(crate) fn pid(&self) -> u32 {
        self.pid
    }

    /// Where it listens.
    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Kills it, as an accident would.
    pub(crate) async fn kill(mut self) -> Result<(), LoadError> {
        (self.child.kill().await).map_err(LoadError::io("killing a server"))
    }

    /// Ends it: by the end of its standard input, or else by force.
    pub(crate) async fn stop(mut self) -> Result<(), LoadError> {
        drop(self.child.stdin.take());
        match tokio::time::timeout(STOP_LIMIT, self.child.wait()).await {
            Ok(ended) => ended.map(drop),
            Err(_) => self.child.kill().await,
        }
        .map_err(LoadError::io("ending a server"))
    }
}
