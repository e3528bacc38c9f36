//! The agent's process: started from a command with placeholders, in its own process group, so that
//! all of it ends with its case or its games. Its output is logged, and the last lines are kept in
//! memory.

use std::collections::VecDeque;
use std::ffi::OsString;
use std::io;
use std::path::PathBuf;
use std::process::{ExitStatus, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

#[cfg(unix)]
use rustix::process::{Pid, Signal, kill_process_group};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWriteExt as _};
use tokio::process::{Child, ChildStdin, Command};
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// Bytes of an agent's output that are written to its log.
const MAX_LOG_BYTES: usize = 16 * 1024 * 1024;
/// Bytes of its output that are kept in memory.
const MAX_TAIL_BYTES: usize = 4 * 1024;
/// How long to wait for the rest of its output after the process has exited.
const LAST_WORDS: Duration = Duration::from_secs(1);

/// A command with placeholders: `{address}`, `{url}`, `{code}` or `{tournament}`, and `{name}`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AgentCommand(Vec<String>);

/// The values of the placeholders.
#[derive(Debug, Clone)]
pub struct Placeholders {
    /// `host:port` of the server, or its URL if that begins with `https://`.
    pub address: String,
    /// Join code of the room or the tournament.
    pub code: String,
    /// Display name.
    pub name: String,
}

impl AgentCommand {
    /// A command that takes a seat in a room, given as words.
    ///
    /// # Errors
    /// The missing placeholder.
    pub fn new(words: Vec<String>) -> Result<Self, String> {
        Self::mentioning("{code}", words)
    }

    /// A command that takes part in a tournament, given as a shell line.
    ///
    /// # Errors
    /// The missing placeholder.
    pub fn for_tournament(line: &str) -> Result<Self, String> {
        let words = ["sh", "-c", line].map(str::to_owned).to_vec();
        Self::mentioning("{tournament}", words)
    }

    /// A command that plays many games, given as words. If it mentions `{code}`, it is started for
    /// each; otherwise it is started once and reads a line for each game from its standard input: the
    /// address of the server, the join code and the display name, separated by spaces.
    ///
    /// # Errors
    /// The missing placeholder.
    pub fn for_games(words: Vec<String>) -> Result<Self, String> {
        let command = Self(words);
        if command.mentions("{tournament}") {
            return Err("{tournament} has no value here: the games are those of rooms".into());
        }
        if command.mentions("{code}") {
            return Self::new(command.0);
        }
        Ok(command)
    }

    /// Whether its process reads from its standard input which games to play.
    pub fn reads_games(&self) -> bool {
        !self.mentions("{code}") && !self.mentions("{tournament}")
    }

    fn mentions(&self, place: &str) -> bool {
        self.0.iter().any(|word| word.contains(place))
    }

    fn mentioning(code: &str, words: Vec<String>) -> Result<Self, String> {
        let command = Self(words);
        if !command.mentions(code) {
            return Err(format!(
                "the command needs {code} in place of the join code, for instance --code {code}"
            ));
        }
        if !command.mentions("{address}") && !command.mentions("{url}") {
            return Err(
                "the command needs {address} (host:port) or {url} (http://host:port) in place of the server's address"
                    .into(),
            );
        }
        Ok(command)
    }

    /// The words as they were given.
    pub fn words(&self) -> &[String] {
        &self.0
    }

    fn filled(&self, places: &Placeholders) -> Vec<OsString> {
        let url = match places.address.contains("://") {
            true => places.address.clone(),
            false => format!("http://{}", places.address),
        };
        let fill = |word: &String| {
            word.replace("{address}", &places.address)
                .replace("{url}", &url)
                .replace("{code}", &places.code)
                .replace("{tournament}", &places.code)
                .replace("{name}", &places.name)
                .into()
        };
        self.0.iter().map(fill).collect()
    }
}

/// A running process. Dropping it kills the process and, where processes have groups, everything it
/// started.
#[derive(Debug)]
pub struct AgentProcess {
    child: Child,
    #[cfg(unix)]
    group: Option<Pid>,
    log: Arc<Mutex<Log>>,
    readers: Vec<JoinHandle<()>>,
}

/// The output of the process.
#[derive(Debug, Default)]
struct Log {
    tail: VecDeque<u8>,
}

impl AgentProcess {
    /// Starts it. `log`: a file for its output.
    ///
    /// # Errors
    /// The program or the file.
    pub async fn start(
        command: &AgentCommand,
        places: &Placeholders,
        log: Option<PathBuf>,
    ) -> io::Result<Self> {
        let file = match log {
            Some(path) => Some(tokio::fs::File::create(path).await?),
            None => None,
        };
        let reads_games = command.reads_games();
        let mut words = command.filled(places).into_iter();
        let program = words.next().unwrap_or_default();
        let mut command = Command::new(program);
        command
            .args(words)
            .stdin(match reads_games {
                true => Stdio::piped(),
                false => Stdio::null(),
            })
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .kill_on_drop(true);
        #[cfg(unix)]
        command.process_group(0);
        let mut child = command.spawn()?;
        #[cfg(unix)]
        let group = child
            .id()
            .and_then(|id| i32::try_from(id).ok())
            .and_then(Pid::from_raw);
        let kept = Arc::new(Mutex::new(Log::default()));
        let file = Arc::new(tokio::sync::Mutex::new((file, MAX_LOG_BYTES)));
        let mut readers = Vec::new();
        if let Some(stdout) = child.stdout.take() {
            readers.push(tokio::spawn(keep_tail(
                stdout,
                Arc::clone(&kept),
                Arc::clone(&file),
            )));
        }
        if let Some(stderr) = child.stderr.take() {
            readers.push(tokio::spawn(keep_tail(stderr, Arc::clone(&kept), file)));
        }
        Ok(Self {
            child,
            #[cfg(unix)]
            group,
            log: kept,
            readers,
        })
    }

    /// Where it reads which games to play, until that is dropped; `None` if it reads none.
    pub fn games(&mut self) -> Option<ChildStdin> {
        self.child.stdin.take()
    }

    /// Waits until it has exited. Cancel safe. It reads no games from then on, unless [`Self::games`]
    /// was called.
    ///
    /// # Errors
    /// Its status is unknown.
    pub async fn ended(&mut self) -> io::Result<ExitStatus> {
        self.child.wait().await
    }

    /// Kills it and returns the last lines of its output.
    pub async fn finish(mut self, most: usize) -> Vec<String> {
        self.kill();
        for reader in std::mem::take(&mut self.readers) {
            // A process that left the group may hold the output open; it is not waited for.
            let _read = timeout(LAST_WORDS, reader).await;
        }
        self.last_lines(most)
    }

    fn kill(&mut self) {
        // What is killed may be gone already.
        #[cfg(unix)]
        if let Some(group) = self.group {
            let _gone = kill_process_group(group, Signal::KILL);
        }
        #[cfg(not(unix))]
        let _gone = self.child.start_kill();
    }

    fn last_lines(&self, most: usize) -> Vec<String> {
        let log = self.log.lock().unwrap_or_else(PoisonError::into_inner);
        let bytes: Vec<u8> = log.tail.iter().copied().collect();
        let text = String::from_utf8_lossy(&bytes);
        let lines: Vec<&str> = text.lines().collect();
        let from = lines.len().saturating_sub(most);
        // The output may contain control characters, which a terminal must not receive.
        let plain = |line: &&str| line.chars().filter(|it| !it.is_control()).collect();
        lines[from..].iter().map(plain).collect()
    }
}

impl Drop for AgentProcess {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Reads the output of a process to its end and keeps the last part.
async fn keep_tail(
    mut source: impl AsyncRead + Unpin,
    log: Arc<Mutex<Log>>,
    file: Arc<tokio::sync::Mutex<(Option<tokio::fs::File>, usize)>>,
) {
    let mut buffer = [0; 4096];
    while let Ok(count @ 1..) = source.read(&mut buffer).await {
        let read = &buffer[..count];
        {
            let mut log = log.lock().unwrap_or_else(PoisonError::into_inner);
            log.tail.extend(read);
            let excess = log.tail.len().saturating_sub(MAX_TAIL_BYTES);
            log.tail.drain(..excess);
        }
        let mut file = file.lock().await;
        let (file, left) = &mut *file;
        if let Some(file) = file {
            let written = &read[..count.min(*left)];
            *left -= written.len();
            // Keep reading even if the log cannot be written.
            let _lost = file.write_all(written).await;
            let _lost = file.flush().await;
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::process::*;

    fn words(text: &str) -> Vec<String> {
        text.split(' ').map(str::to_owned).collect()
    }

    #[test]
    fn placeholders_are_filled_in_everywhere() {
        let command = AgentCommand::new(words("run --server={url} {address} {code}/{name} {}"));
        let places = Placeholders {
            address: "127.0.0.1:7".into(),
            code: "BCDF".into(),
            name: "Ada".into(),
        };
        let filled = command.expect("it has all placeholders").filled(&places);
        let expected = words("run --server=http://127.0.0.1:7 127.0.0.1:7 BCDF/Ada {}");
        assert_eq!(
            filled,
            expected.iter().map(OsString::from).collect::<Vec<_>>()
        );
    }

    #[test]
    fn a_command_without_needed_placeholders_is_refused() {
        for (command, missing) in [("run", "{code}"), ("run {code}", "{address}")] {
            let problem = AgentCommand::new(words(command)).expect_err("a placeholder is missing");
            assert!(problem.contains(missing), "{problem}");
        }
    }

    #[tokio::test]
    async fn dropping_kills_the_group_and_keeps_its_last_lines() {
        let command = AgentCommand(words("sh -c XXX"));
        let script = "echo one; echo two; sleep 600 & echo $!; wait";
        let command =
            AgentCommand((command.0.iter().map(|word| word.replace("XXX", script))).collect());
        let places = Placeholders {
            address: String::new(),
            code: String::new(),
            name: String::new(),
        };
        let process = AgentProcess::start(&command, &places, None)
            .await
            .expect("a shell");
        let lines = loop {
            let lines = process.last_lines(2);
            if lines.len() == 2 && lines[0] == "two" {
                break lines;
            }
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        };
        let sleeper: i32 = lines[1].parse().expect("a process id");
        let sleeper = Pid::from_raw(sleeper).expect("not zero");
        assert!(rustix::process::test_kill_process(sleeper).is_ok());
        drop(process);
        // It may remain as a zombie for a moment, but it does not run any more.
        let stat = format!("/proc/{}/stat", sleeper.as_raw_nonzero());
        while let Ok(stat) = std::fs::read_to_string(&stat)
            && !stat.contains(") Z ")
        {
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        }
    }
}
