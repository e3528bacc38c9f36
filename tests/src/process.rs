//! A server in its own process: the real binary, started, killed and restarted on the same address.
//! `server` runs one in the test's process.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{ExitStatus, Stdio};

use serde_json::Value;
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, BufReader};
use tokio::process::{Child, Command};
use tokio::task::JoinHandle;

use crate::{own_address, patiently};

/// A path that `cargo xtask test` prepares and passes in the environment: the binary, an
/// interpreter, a folder.
///
/// # Panics
/// The variable is not set.
pub fn set_up(name: &str) -> PathBuf {
    std::env::var_os(name)
        .map(PathBuf::from)
        .unwrap_or_else(|| panic!("{name} is not set: run this test with `cargo xtask test`"))
}

/// How to start a server, repeatedly on the same folder and address.
#[derive(Debug)]
pub struct Launch {
    data_dir: PathBuf,
    binary: Option<PathBuf>,
    listen: String,
    arguments: Vec<String>,
    through: Vec<OsString>,
}

impl Launch {
    /// A server on this folder, at its own address.
    pub fn new(data_dir: &Path) -> Self {
        Self {
            data_dir: data_dir.to_path_buf(),
            binary: None,
            listen: format!("{}:0", own_address()),
            arguments: Vec::new(),
            through: Vec::new(),
        }
    }

    /// Starts this binary instead of the one that `cargo xtask test` builds.
    #[must_use]
    pub fn binary(mut self, binary: &Path) -> Self {
        self.binary = Some(binary.to_path_buf());
        self
    }

    /// Adds options of `chefshat serve` that have no value.
    #[must_use]
    pub fn flags(mut self, flags: &[&str]) -> Self {
        self.arguments
            .extend(flags.iter().map(|flag| (*flag).to_owned()));
        self
    }

    /// Adds an option of `chefshat serve`.
    #[must_use]
    pub fn with(mut self, name: &str, value: impl ToString) -> Self {
        self.arguments.extend([name.to_owned(), value.to_string()]);
        self
    }

    /// Starts it through another program, which must become the server or pass on its exit.
    #[must_use]
    pub fn through(mut self, program: impl IntoIterator<Item = impl Into<OsString>>) -> Self {
        self.through = program.into_iter().map(Into::into).collect();
        self
    }

    /// Starts the binary that `cargo xtask test` builds again.
    pub fn own_binary(&mut self) {
        self.binary = None;
    }

    /// Starts it directly again.
    pub fn by_itself(&mut self) {
        self.through.clear();
    }

    /// The folder.
    pub fn data_dir(&self) -> &Path {
        &self.data_dir
    }

    /// Its address, the same after every start.
    pub fn url(&self) -> String {
        format!("http://{}", self.listen)
    }

    /// Starts the process without waiting for it.
    pub fn spawn(&self) -> Process {
        let mut words = self.through.iter().cloned();
        let binary = (self.binary.clone()).unwrap_or_else(|| set_up("CHEFSHAT_BIN"));
        let binary = binary.into_os_string();
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
            .expect("the binary starts");
        let mut stderr = child.stderr.take().expect("a pipe");
        let said = tokio::spawn(async move {
            let mut bytes = Vec::new();
            // Text read before an error is all there is.
            let _ = stderr.read_to_end(&mut bytes).await;
            String::from_utf8_lossy(&bytes).into_owned()
        });
        Process { child, said }
    }

    /// Starts the server and waits until it listens.
    ///
    /// # Errors
    /// It exited before.
    pub async fn start(&mut self) -> Result<Process, Ended> {
        let mut process = self.spawn();
        let stdout = process.child.stdout.take().expect("a pipe");
        let mut lines = BufReader::new(stdout).lines();
        let line = patiently("the server to listen", lines.next_line())
            .await
            .expect("text");
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

/// A running server. Killed when dropped.
#[derive(Debug)]
pub struct Process {
    child: Child,
    said: JoinHandle<String>,
}

/// How a server exited.
#[derive(Debug)]
pub struct Ended {
    /// Its exit status.
    pub status: ExitStatus,
    /// Its standard error.
    pub said: String,
}

impl Process {
    /// The id of the process.
    pub fn id(&self) -> u32 {
        self.child.id().expect("it has not been waited for")
    }

    /// Sends SIGKILL and waits until the process is gone.
    pub async fn kill(mut self) -> Ended {
        self.child.start_kill().expect("a child process");
        self.ended().await
    }

    /// Sends SIGTERM.
    pub async fn request_stop(&self) {
        self.send("-TERM").await;
    }

    /// Stops it in the middle of whatever it does, until it is thawed.
    pub async fn freeze(&self) {
        self.send("-STOP").await;
    }

    /// Lets a frozen process continue.
    pub async fn thaw(&self) {
        self.send("-CONT").await;
    }

    async fn send(&self, signal: &str) {
        let id = self.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status().await;
        assert!(sent.expect("kill runs").success());
    }

    /// Sends SIGTERM and waits until it has exited.
    pub async fn stop(self) -> Ended {
        self.request_stop().await;
        self.ended().await
    }

    /// Waits until it has exited.
    pub async fn ended(mut self) -> Ended {
        let status = patiently("the server to end", self.child.wait())
            .await
            .expect("a child process");
        let said = patiently("the rest of its output", self.said)
            .await
            .expect("reading does not panic");
        Ended { status, said }
    }
}
