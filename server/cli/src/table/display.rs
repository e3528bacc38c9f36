//! What is printed about a physical table: text for people, or JSON lines.

use std::io::Write as _;

use chefshat_client::v1;
use serde_json::{Value, json};

use super::super::{CommandError, say};
use super::line;
use super::words::{state_in_words, verdict_in_words};
use crate::error::plain;

/// Prints states, verdicts and problems.
pub(super) struct Display {
    json: bool,
    /// The last text of a state, which is not repeated.
    shown: String,
    /// The report with the last verdict. Its violation is not repeated.
    judged: Option<u64>,
}

impl Display {
    pub(super) fn new(json: bool) -> Self {
        Self {
            json,
            shown: String::new(),
            judged: None,
        }
    }

    /// Prints a state, as text only if it differs from the last one. Returns whether it did.
    ///
    /// # Errors
    /// The output cannot be written.
    pub(super) fn state(&mut self, state: &v1::TableState) -> Result<bool, CommandError> {
        if self.json {
            say(json!({"event": "state", "state": state}))?;
            return Ok(true);
        }
        let violation = state.violation.clone();
        let text = state_in_words(&v1::TableState {
            violation: violation.filter(|it| Some(it.report) != self.judged),
            ..state.clone()
        });
        if text == self.shown {
            return Ok(false);
        }
        print(&text)?;
        self.shown = text;
        Ok(true)
    }

    /// Prints the last state again.
    ///
    /// # Errors
    /// The output cannot be written.
    pub(super) fn state_again(&mut self, state: &v1::TableState) -> Result<(), CommandError> {
        self.shown.clear();
        self.judged = None;
        self.state(state).map(|_| ())
    }

    /// Prints the verdict on what a line reported.
    ///
    /// # Errors
    /// The output cannot be written.
    pub(super) fn verdict(
        &mut self,
        line: &str,
        response: &v1::ReportResponse,
    ) -> Result<(), CommandError> {
        self.judged = Some(response.report);
        if !self.json {
            return print(&verdict_in_words(response));
        }
        let mut value = serde_json::to_value(response)?;
        // The state has a line of its own.
        if let Value::Object(fields) = &mut value {
            fields.remove("state");
        }
        say(json!({"event": "verdict", "line": line, "response": value}))
    }

    /// Prints why a line was not reported.
    ///
    /// # Errors
    /// The output cannot be written.
    pub(super) fn problem(&self, line: &str, problem: &str) -> Result<(), CommandError> {
        match self.json {
            true => say(json!({"event": "problem", "line": line, "message": problem})),
            false => say(plain(problem)),
        }
    }

    /// Prints what can be typed.
    ///
    /// # Errors
    /// The output cannot be written.
    pub(super) fn help(&self) -> Result<(), CommandError> {
        match self.json {
            true => say(json!({"event": "help", "text": line::HELP})),
            false => say(line::HELP),
        }
    }
}

/// Prints lines; the stream strips the escape codes if needed.
fn print(text: &str) -> Result<(), CommandError> {
    let mut out = anstream::stdout();
    out.write_all(text.as_bytes())?;
    Ok(out.flush()?)
}
