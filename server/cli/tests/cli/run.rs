//! Running the program to its end, and what is expected of every command alike: tables that fit, errors that are explained. Which
//! arguments, and what is expected beyond it, is in the modules of the commands.

use std::process::Command;

use serde_json::Value;

/// Widest line of a table.
const COLUMNS: usize = 100;

/// What came of a run.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Ended {
    pub(super) code: Option<i32>,
    pub(super) stdout: String,
    pub(super) stderr: String,
}

impl Ended {
    /// The same, if the program did what it was asked to.
    pub(super) fn well(self) -> Self {
        assert_eq!(self.code, Some(0), "{}", self.stderr);
        self
    }

    /// What was printed, as JSON.
    pub(super) fn json(&self) -> Value {
        serde_json::from_str(&self.stdout).unwrap()
    }

    /// Asserts that a table of more than so many lines was printed, which fits on a page and has no colours.
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

    /// Asserts that the program refused what it was asked, printed nothing and said why.
    pub(super) fn assert_refused(&self, expected: &str) {
        assert!(matches!(self.code, Some(1 | 2)), "{self:?}");
        assert!(self.stderr.contains(expected), "{}", self.stderr);
        assert_eq!(self.stdout, "", "{expected}");
    }

    /// Asserts that this is a help with an example.
    pub(super) fn assert_helps(&self, example: &str) {
        assert_eq!(self.code, Some(0));
        assert!(self.stdout.contains(example), "{}", self.stdout);
    }
}

/// Runs a command of `chefshat` with flags as they would be typed.
pub(super) fn typed(command: &[&str], flags: &str) -> Ended {
    let arguments: Vec<&str> = command
        .iter()
        .copied()
        .chain(flags.split_whitespace())
        .collect();
    chefshat(&arguments)
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
