//! The servers that are measured: this program run again as a process of its own, so that CPU and memory of the two sides are counted
//! apart. The child says where it listens on its standard output, and ends when its standard input does, so that it never outlives us.

use std::io::Write as _;
use std::net::SocketAddr;
use std::process::Stdio;
use std::sync::Arc;
use std::time::Duration;

use chefshat_server::config::ServerConfig;
use chefshat_server::store::MemoryStore;
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

/// The part of the child.
pub(crate) async fn serve(options: &Serve) -> Result<(), LoadError> {
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
        data_dir: None,
        retention: RETENTION,
        grace: Duration::ZERO,
        ..ServerConfig::default()
    };
    chefshat_server::serve::serve(
        listener,
        config,
        Arc::new(MemoryStore::default()),
        parent_gone,
    )
    .await
    .map_err(|error| LoadError::Protocol(error.to_string()))
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
    pub(crate) async fn start(bare: bool, place: Place) -> Result<Self, LoadError> {
        let program = std::env::current_exe().map_err(LoadError::io("finding this program"))?;
        let mut command = Command::new(program);
        command.arg("serve");
        if bare {
            command.arg("--bare");
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
