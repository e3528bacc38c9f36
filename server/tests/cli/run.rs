//! Running the program to its end. Which arguments, and what is expected, is in the modules of the commands.

use std::process::Command;

/// What came of a run.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Ended {
    pub(super) code: Option<i32>,
    pub(super) stdout: String,
    pub(super) stderr: String,
}

/// Runs `chefshat` with arguments, without the environment's settings of it.
pub(super) fn chefshat(arguments: &[&str]) -> Ended {
    let mut command = Command::new(env!("CARGO_BIN_EXE_chefshat"));
    for (name, _) in std::env::vars_os() {
        if name.to_string_lossy().starts_with("CHEFSHAT_") {
            command.env_remove(name);
        }
    }
    let output = command.args(arguments).output().unwrap();
    Ended {
        code: output.status.code(),
        stdout: String::from_utf8(output.stdout).unwrap(),
        stderr: String::from_utf8(output.stderr).unwrap(),
    }
}
