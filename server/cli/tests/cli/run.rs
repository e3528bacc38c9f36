//! Runs the program to its end, with expectations common to all commands: tables that fit,
//! explained errors.

use std::process::Command;

use serde_json::Value;

/// Widest line of a table.
const COLUMNS: usize = 100;

/// The result of a run.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Ended {
    pub(super) code: Option<i32>,
    pub(super) stdout: String,
    pub(super) stderr: String,
}

impl Ended {
    /// Asserts that the program succeeded.
    pub(super) fn well(self) -> Self {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        self
    }

    /// The output as JSON.
    pub(super) fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap()
    }

    /// Asserts that the output is a table of more than `more_than` lines that fits a page and has no
    /// colours.
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

    /// Asserts that the program failed with an explanation and no output.
    pub(super) fn assert_refused(&self, expected: &str) {
        assert!(matches!(self.code, Some(1 | 2)), "{self:?}");
        assert!(self.stderr.contains(expected), "{}", self.stderr);
        assert_eq!(self.stdout, "", "{expected}");
    }

    /// Asserts that the output is a help text with an example.
    pub(super) fn assert_helps(&self, example: &str) {
        assert_eq!(self.code, Some(0));
        assert!(self.stdout.contains(example), "{}", self.stdout);
    }
}

/// Runs a command of `chefshat` with flags as typed.
pub(super) fn typed(command: &[&str], flags: &str) -> Ended {
    let arguments: Vec<&str> = command
        .iter()
        .copied()
        .chain(flags.split_whitespace())
        .collect();
    chefshat(&arguments)
}

/// Runs `chefshat` with arguments and without its environment variables.
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
