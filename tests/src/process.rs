//! A server in a process of its own: the real binary, started, killed and started again on the same address, as an operator or an accident
//! would. A server within the test's own process is in `server`.

use std::ffi::OsString;
use std::net::Ipv4Addr;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};
use std::sync::atomic::{AtomicU8, Ordering};

use serde_json::Value;
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, BufReader};
use tokio::process::{Child, Command};
use tokio::task::JoinHandle;

use crate::patiently;

/// What `cargo xtask test` has set up and names in the environment: the binary, an interpreter, a folder.
///
/// # Panics
/// When it is not named.
pub fn set_up(name: &str) -> PathBuf {
    std::env::var_os(name)
        .map(PathBuf::from)
        .unwrap_or_else(|| panic!("{name} is not set: run this test by `cargo xtask test`"))
}

/// How a server is started, again and again on the same folder and address.
#[derive(Debug)]
pub struct Launch {
    data_dir: PathBuf,
    listen: String,
    arguments: Vec<String>,
    through: Vec<OsString>,
}

impl Launch {
    /// A server on this folder, at an address of its own.
    pub fn new(data_dir: &Path) -> Self {
        Self {
            data_dir: data_dir.to_path_buf(),
            listen: format!("{}:0", own_address()),
            arguments: Vec::new(),
            through: Vec::new(),
        }
    }

    /// With one more option of `chefshat serve`.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.arguments.extend([name.to_owned(), value.to_string()]);
        self
    }

    /// Started by another program, which must become the server or pass its end on.
    #[must_use]
    pub fn through(mut self, program: impl IntoIterator<Item = impl Into<OsString>>) -> Self {
        self.through = program.into_iter().map(Into::into).collect();
        self
    }

    /// No longer by another program.
    pub fn by_itself(&mut self) {
        self.through.clear();
    }

    /// The folder.
    pub fn data_dir(&self) -> &Path {
        &self.data_dir
    }

    /// Where it listens: an address that stays the same from the first start on.
    pub fn url(&self) -> String {
        format!("http://{}", self.listen)
    }

    /// Starts the process, whatever becomes of it.
    pub fn spawn(&self) -> Process {
        let mut words = self.through.iter().cloned();
        let binary = set_up("CHEFSHAT_BIN").into_os_string();
        let mut command = Command::new(words.next().unwrap_or_else(|| binary.clone()));
        if !self.through.is_empty() {
            command.args(words).arg(binary);
        }
        let mut child = command
            .args(["serve", "--json", "--listen", &self.listen, "--data-dir"])
            .arg(&self.data_dir)
            .args(&self.arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true)
            .spawn()
            .expect("the binary runs");
        let mut stderr = child.stderr.take().expect("it is piped");
        let said = tokio::spawn(async move {
            let mut bytes = Vec::new();
            // What was read before an error is all there is.
            let _ = stderr.read_to_end(&mut bytes).await;
            String::from_utf8_lossy(&bytes).into_owned()
        });
        Process { child, said }
    }

    /// Starts the server and waits until it listens.
    ///
    /// # Errors
    /// How it ended if it does not come so far.
    pub async fn start(&mut self) -> Result<Process, Ended> {
        let mut process = self.spawn();
        let stdout = process.child.stdout.take().expect("it is piped");
        let mut lines = BufReader::new(stdout).lines();
        let line = patiently("the server to listen", lines.next_line())
            .await
            .expect("it writes text");
        let Some(line) = line else {
            return Err(process.ended().await);
        };
        let listening: Value = serde_json::from_str(&line).expect("a JSON line");
        assert_eq!(listening["event"], "listening");
        self.listen = listening["address"]
            .as_str()
            .expect("an address")
            .to_owned();
        Ok(process)
    }
}

/// A server that was started. Killed when dropped.
#[derive(Debug)]
pub struct Process {
    child: Child,
    said: JoinHandle<String>,
}

/// How a server ended.
#[derive(Debug)]
pub struct Ended {
    /// Its exit status.
    pub status: ExitStatus,
    /// What it said on standard error.
    pub said: String,
}

impl Process {
    /// The number of the process that was started.
    pub fn id(&self) -> u32 {
        self.child.id().expect("it has not been waited for")
    }

    /// SIGKILL, and waits until there is nothing left of it.
    pub async fn kill(mut self) -> Ended {
        self.child.start_kill().expect("it is a child of ours");
        self.ended().await
    }

    /// SIGTERM, as an operator would.
    pub async fn request_stop(&self) {
        let id = self.id().to_string();
        let asked = Command::new("kill").args(["-TERM", &id]).status().await;
        assert!(asked.expect("kill runs").success());
    }

    /// SIGTERM, and waits until it has ended.
    pub async fn stop(self) -> Ended {
        self.request_stop().await;
        self.ended().await
    }

    /// Waits until it has ended.
    pub async fn ended(mut self) -> Ended {
        let status = patiently("the server to end", self.child.wait())
            .await
            .expect("it is a child of ours");
        let said = patiently("its last words", self.said)
            .await
            .expect("reading does not panic");
        Ended { status, said }
    }
}

/// An address of the loopback network that no other test of this machine listens on. Connections come from 127.0.0.1: a client that tries
/// to connect while the server is away can thus never be given the server's own port to connect from.
fn own_address() -> Ipv4Addr {
    static NEXT: AtomicU8 = AtomicU8::new(1);
    let [_, _, high, low] = std::process::id().to_be_bytes();
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    Ipv4Addr::new(127, 100 + number % 100, high, low)
}
