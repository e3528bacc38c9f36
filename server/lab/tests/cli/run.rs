//! Runs the program: to its end, in the background, and as a server. Expectations common to all
//! commands: tables that fit, explained errors.

use std::io::{BufRead as _, BufReader, PipeWriter};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

/// Widest line of a table.
const COLUMNS: usize = 100;

/// How long a test waits for something that is certain to happen. Games of built-in agents alone
/// give way to all else that the machine does.
const PATIENCE: Duration = Duration::from_secs(300);

/// Waits until a condition holds.
pub(super) fn until(what: &str, mut holds: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !holds() {
        assert!(begun.elapsed() < PATIENCE, "waited too long for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Waits until the server has written the records of this number of games: it tells of a game's end
/// before its file is there.
pub(super) fn until_recorded(games: usize, data_dir: &Path) {
    let records = data_dir.join("records");
    until("the records of all games", || {
        let files = std::fs::read_dir(&records).into_iter().flatten();
        let paths = files.map(|file| file.unwrap().path());
        paths
            .filter(|path| path.extension() == Some("jsonl".as_ref()))
            .count()
            == games
    });
}

/// Runs what the test does with a client of the SDK.
pub(super) fn in_runtime<T>(what: impl Future<Output = T>) -> T {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build();
    runtime.unwrap().block_on(what)
}

/// The result of a run.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Ended {
    pub(super) code: Option<i32>,
    pub(super) stdout: String,
    pub(super) stderr: String,
}

impl Ended {
    pub(super) fn of(output: Output) -> Self {
        Self {
            code: output.status.code(),
            stdout: String::from_utf8(output.stdout).unwrap(),
            stderr: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Asserts that the program succeeded.
    pub(super) fn well(self) -> Self {
        assert_eq!(self.code, Some(0), "{self:?}");
        self
    }

    /// Asserts that the program succeeded and wrote nothing to standard error.
    pub(super) fn clean(self) -> Self {
        assert_eq!(self.stderr, "", "{self:?}");
        self.well()
    }

    /// Asserts that the program ended with this code and wrote nothing to standard error.
    pub(super) fn ended_with(self, code: i32) -> Self {
        assert_eq!((self.code, self.stderr.as_str()), (Some(code), ""));
        self
    }

    /// The output as JSON.
    pub(super) fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    /// The output as JSON lines.
    pub(super) fn json_lines(&self) -> Vec<Value> {
        json_lines(&self.stdout)
    }

    /// Asserts that the output contains all of these.
    pub(super) fn assert_says(&self, words: &[&str]) {
        for words in words {
            assert!(self.stdout.contains(words), "{words} is not in {self:?}");
        }
    }

    /// Asserts that the output is a table of more than `more_than` lines that fits a page and has
    /// no colours.
    pub(super) fn assert_table_fits(&self, more_than: usize) {
        assert!(self.stdout.lines().count() > more_than, "{}", self.stdout);
        for line in self.stdout.lines() {
            assert!(line.chars().count() <= COLUMNS, "{line}");
            assert!(
                !line.contains('\x1b'),
                "colours where there is no terminal: {line}"
            );
        }
    }

    /// Asserts that the program or its arguments failed with an explanation and no output.
    pub(super) fn assert_refused(&self, expected: &str) {
        assert!(matches!(self.code, Some(1 | 2)), "{self:?}");
        assert!(self.stderr.contains(expected), "{expected}: {self:?}");
        assert_eq!(self.stdout, "", "{expected}");
    }

    /// Asserts that the program, not its arguments, failed with an explanation and no output.
    pub(super) fn assert_failed(&self, expected: &str) {
        assert_eq!(self.code, Some(1), "{self:?}");
        self.assert_refused(expected);
    }

    /// Asserts that the output is a help text with an example.
    pub(super) fn assert_helps(&self, example: &str) {
        assert_eq!(self.code, Some(0));
        self.assert_says(&[example]);
    }
}

/// JSON values, one per line.
pub(super) fn json_lines(text: &str) -> Vec<Value> {
    let lines = text.lines();
    lines
        .map(|line| serde_json::from_str(line).unwrap())
        .collect()
}

/// A file of the tests' fixtures.
pub(super) fn fixture(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/fixtures")
        .join(path)
}

/// The program, without `CHEFSHAT_*` variables.
pub(super) fn program() -> Command {
    without_settings(Command::new(env!("CARGO_BIN_EXE_chefshat-lab")))
}

fn without_settings(mut command: Command) -> Command {
    for (name, _) in std::env::vars_os() {
        if name.to_string_lossy().starts_with("CHEFSHAT_") {
            command.env_remove(name);
        }
    }
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Runs `chefshat` with these arguments.
pub(super) fn chefshat(arguments: &[&str]) -> Ended {
    Ended::of(program().args(arguments).output().unwrap())
}

/// Runs `chefshat` with a command line as typed. Arguments are split at white space, paths
/// included.
pub(super) fn typed(line: &str) -> Ended {
    chefshat(&line.split_whitespace().collect::<Vec<_>>())
}

/// Runs a command line against a server.
pub(super) fn run(server: &str, line: &str) -> Ended {
    typed(&format!("{line} --server {server}"))
}

/// A command line as on a full disk: it can write to no file.
pub(super) fn on_a_full_disk(line: &str) -> Command {
    let mut shell = without_settings(Command::new("sh"));
    // Without its signal, a write beyond the limit fails.
    let script = "trap '' XFSZ; ulimit -f 0; exec \"$@\"";
    shell.args(["-c", script, "sh", env!("CARGO_BIN_EXE_chefshat-lab")]);
    shell.args(line.split_whitespace());
    shell
}

/// Runs a command line as on a full disk.
pub(super) fn typed_on_a_full_disk(line: &str) -> Ended {
    Ended::of(on_a_full_disk(line).output().unwrap())
}

/// A pipe that its reader has closed, as `head` does.
pub(super) fn closed_pipe() -> PipeWriter {
    let (_, writer) = std::io::pipe().unwrap();
    writer
}

/// Runs a command line whose output is closed by its reader.
pub(super) fn typed_into_a_closed_pipe(line: &str) -> Ended {
    let mut program = program();
    program.args(line.split_whitespace()).stdout(closed_pipe());
    Ended::of(program.output().unwrap())
}

/// A process that is killed at the end of the test.
pub(super) struct Running(pub(super) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    /// Starts a command line against a server.
    pub(super) fn start(server: &str, line: &str) -> Self {
        let mut command = program();
        command.args(line.split_whitespace());
        command.args(["--server", server]);
        Self(command.spawn().unwrap())
    }

    /// Asks it to stop, as an operating system does.
    pub(super) fn terminate(&self) {
        kill_process(Pid::from_child(&self.0), Signal::TERM).unwrap();
    }

    /// Waits for the end. Returns the exit code and the lines of output.
    pub(super) fn ended(mut self) -> (Option<i32>, Vec<String>) {
        let stdout = self.0.stdout.take().unwrap();
        let lines = BufReader::new(stdout).lines().map(Result::unwrap).collect();
        (self.0.wait().unwrap().code(), lines)
    }
}

/// A server and its address.
pub(super) fn serve(data_dir: &Path) -> (Running, String) {
    serve_with(data_dir, &[])
}

/// A server with more flags, and its address.
pub(super) fn serve_with(data_dir: &Path, flags: &[&str]) -> (Running, String) {
    serve_at("127.0.0.1:0", data_dir, flags)
}

/// A server at an address, and that address as a URL.
pub(super) fn serve_at(listen: &str, data_dir: &Path, flags: &[&str]) -> (Running, String) {
    let mut command = program();
    command.arg("serve").args(flags);
    command.args(["--listen", listen, "--json", "--data-dir"]);
    // Both are false, so records are written.
    command.env("CHEFSHAT_NO_RECORDS", "0");
    command.env("CHEFSHAT_LOG_JSON", "");
    let child = command.arg(data_dir).stderr(Stdio::inherit()).spawn();
    let mut server = Running(child.unwrap());
    let mut line = String::new();
    let stdout = server.0.stdout.take().unwrap();
    BufReader::new(stdout).read_line(&mut line).unwrap();
    let listening: Value = serde_json::from_str(&line).unwrap();
    let address = listening["address"].as_str().unwrap();
    let url = format!("http://{address}");
    (server, url)
}
