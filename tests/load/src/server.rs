//! The measured servers: child processes that run this program, or another build of it, so that the
//! CPU time and memory of both sides are counted separately. A child prints its address on standard
//! output and ends when its standard input closes, so it never outlives the run.

use std::io::{self, Write as _};
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
use crate::options::{Load, Place, Serve};

/// How long a child may take to listen.
const START_LIMIT: Duration = Duration::from_secs(60);

/// How long a child may take to end.
const STOP_LIMIT: Duration = Duration::from_secs(10);

/// Rooms are dropped soon after their game: a run plays more games than people play in a day.
const RETENTION: Duration = Duration::from_secs(1);

/// Counts the instructions of a server, which takes a hundred times as long.
const CALLGRIND: &str = "valgrind --quiet --tool=callgrind --callgrind-out-file=/dev/null";

/// What a child process serves.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Kind<'a> {
    /// The bare room.
    Bare,
    /// The game server, with games in memory.
    InMemory,
    /// The game server, with games in this folder.
    OnDisk(&'a Path),
}

/// Serves until standard input closes.
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
        .map_err(LoadError::io("printing the address"))?;
    drop(out);
    let parent_gone = async {
        // The end of the input and an error both mean that the parent is gone.
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

/// How the servers of a run are started.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Launcher<'a> {
    /// The program; this one unless set.
    program: Option<&'a Path>,
    /// The command that starts it, with its own arguments.
    under: Option<&'a str>,
    place: Place,
}

impl<'a> Launcher<'a> {
    /// Starts servers of this build.
    pub(crate) fn new(load: &'a Load) -> Self {
        Self {
            program: None,
            under: match load.instructions {
                true => Some(CALLGRIND),
                false => load.under.as_deref(),
            },
            place: load.place,
        }
    }

    /// Starts servers of the build to compare with, if there is one.
    pub(crate) fn of_other_build(load: &'a Load) -> Option<Self> {
        let program = load.against.as_deref()?;
        Some(Self {
            program: Some(program),
            ..Self::new(load)
        })
    }

    fn command(self) -> Result<Command, LoadError> {
        let program = match self.program {
            Some(program) => program.to_owned(),
            None => std::env::current_exe().map_err(LoadError::io("finding this program"))?,
        };
        let mut words = self.under.unwrap_or_default().split_whitespace();
        let Some(wrapper) = words.next() else {
            return Ok(Command::new(program));
        };
        let mut command = Command::new(wrapper);
        command.args(words).arg(program);
        Ok(command)
    }

    /// Starts a server and waits until it listens.
    pub(crate) async fn start(self, kind: Kind<'_>) -> Result<ServerProcess, LoadError> {
        let mut command = self.command()?;
        command.arg("serve");
        match kind {
            Kind::Bare => drop(command.arg("--bare")),
            Kind::InMemory => {}
            Kind::OnDisk(folder) => drop(command.arg("--data-dir").arg(folder)),
        }
        if self.place.pin {
            command.args(["--pin", "--core", &self.place.core.to_string()]);
        } else {
            command.args(["--threads", &self.place.threads.to_string()]);
        }
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .map_err(|error| match (error.kind(), self.under) {
                (io::ErrorKind::NotFound, Some(under)) => LoadError::Lacks(under.to_owned()),
                _ => LoadError::io("starting a server")(error),
            })?;
        let out = child.stdout.take().expect("standard output is piped");
        let mut line = String::new();
        let mut reader = BufReader::new(out);
        tokio::time::timeout(START_LIMIT, reader.read_line(&mut line))
            .await
            .map_err(|_| LoadError::Stuck("the start of a server"))?
            .map_err(LoadError::io("reading a server's address"))?;
        let address = line
            .trim()
            .parse()
            .map_err(|_| LoadError::Protocol(format!("{line:?} is not a server's address")))?;
        let pid = child
            .id()
            .expect("a child that listens has not been waited for");
        Ok(ServerProcess {
            child,
            pid,
            address,
        })
    }
}

/// A server process. Killed when dropped.
#[derive(Debug)]
pub(crate) struct ServerProcess {
    child: Child,
    pid: u32,
    address: SocketAddr,
}

impl ServerProcess {
    /// The process id.
    pub(crate) fn pid(&self) -> u32 {
        self.pid
    }

    /// The URL it serves.
    pub(crate) fn url(&self) -> String {
        format!("http://{}", self.address)
    }

    /// Kills the process without warning.
    pub(crate) async fn kill(mut self) -> Result<(), LoadError> {
        (self.child.kill().await).map_err(LoadError::io("killing a server"))
    }

    /// Closes its standard input, and kills it if it does not end.
    pub(crate) async fn stop(mut self) -> Result<(), LoadError> {
        drop(self.child.stdin.take());
        match tokio::time::timeout(STOP_LIMIT, self.child.wait()).await {
            Ok(ended) => ended.map(drop),
            Err(_) => self.child.kill().await,
        }
        .map_err(LoadError::io("ending a server"))
    }
}
