//! A server as a process, and commands run against it.

use std::io::{BufRead as _, BufReader};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use serde_json::Value;

/// A running program, killed at the end of the test.
pub(super) struct Running(pub(super) Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The program without its environment variables.
pub(super) fn program() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_chefshat"));
    for (name, _) in std::env::vars_os() {
        if name.to_string_lossy().starts_with("CHEFSHAT_") {
            command.env_remove(name);
        }
    }
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Starts a server. Returns it and its address.
pub(super) fn serve(data_dir: &Path) -> (Running, String) {
    serve_with(data_dir, &[])
}

/// Starts a server with further flags. Returns it and its address.
pub(super) fn serve_with(data_dir: &Path, flags: &[&str]) -> (Running, String) {
    let mut command = program();
    command.arg("serve").args(flags);
    command.args(["--listen", "127.0.0.1:0", "--json", "--data-dir"]);
    // Both values turn the setting off, so that records are written.
    command.env("CHEFSHAT_NO_RECORDS", "0");
    command.env("CHEFSHAT_LOG_JSON", "");
    let mut child = command
        .arg(data_dir)
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.take().unwrap())
        .read_line(&mut line)
        .unwrap();
    let listening: Value = serde_json::from_str(&line).unwrap();
    let address = listening["address"].as_str().unwrap();
    let url = format!("http://{address}");
    (Running(child), url)
}

/// The output of the program, one line of JSON.
pub(super) fn json(output: &Output) -> Value {
    let text = std::str::from_utf8(&output.stdout).unwrap();
    serde_json::from_str(text).unwrap_or_else(|error| {
        let errors = String::from_utf8_lossy(&output.stderr);
        panic!("{error}: {text:?}, {errors}")
    })
}

/// Runs the program to its end against a server.
pub(super) fn run(server: &str, arguments: &[&str]) -> Output {
    let mut command = program();
    command.args(arguments).args(["--server", server]);
    command.output().unwrap()
}
