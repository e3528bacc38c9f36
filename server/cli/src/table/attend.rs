//! `chefshat table`: an attendant in a terminal, or a script. Shows every state of the table, and
//! reports what is typed.

use std::io::{self, BufRead, IsTerminal as _, Read as _, Write as _};
use std::process::ExitCode;
use std::{iter, thread};

use chefshat_client::TableFollower;
use chefshat_client::v1::{self, table_report::Kind};
use tokio::sync::mpsc;

use super::super::CommandError;
use super::args::{Table, TableArgs, is_passing};
use super::display::Display;
use super::line::{self, Command};

/// Maximum length of a line. What can be reported is far shorter.
const MAX_LINE_BYTES: u64 = 4096;

/// Attends to a table until the game or the input is over.
pub(super) async fn attend(arguments: TableArgs) -> Result<ExitCode, CommandError> {
    let prompts = !arguments.json && io::stdin().is_terminal() && io::stdout().is_terminal();
    let display = Display::new(arguments.json);
    let table = arguments.connect().await?;
    let mut follower = table.follow();
    let mut attendant = Attendant {
        table,
        state: v1::TableState::default(),
        display,
    };
    let first = follower.next().await?;
    attendant.see(first.ok_or("the game is over")?)?;
    attendant.attend(follower, prompts).await?;
    let room = attendant.state.room.unwrap_or_default();
    Ok(match room.state() {
        v1::RoomState::Aborted => ExitCode::FAILURE,
        _ => ExitCode::SUCCESS,
    })
}

/// An attendant who reports to a table.
struct Attendant {
    table: Table,
    state: v1::TableState,
    display: Display,
}

impl Attendant {
    /// Shows states and reports lines until the game or the input is over.
    async fn attend(
        &mut self,
        mut follower: TableFollower,
        prompts: bool,
    ) -> Result<(), CommandError> {
        let mut lines = typed_lines();
        let (mut prompted, mut waits) = (false, false);
        while self.state.stage() != v1::TableStage::Over {
            waits &= !needs_a_report(&self.state);
            if prompts && !prompted && !waits {
                prompt()?;
                prompted = true;
            }
            tokio::select! {
                biased;
                state = follower.next() => match state? {
                    Some(state) => prompted &= !self.see(state)?,
                    None => break,
                },
                line = lines.recv(), if !waits => {
                    let Some(line) = line.transpose()? else { break };
                    prompted = false;
                    let line = match line {
                        Typed::Line(line) => line,
                        Typed::Unreadable(line, problem) => {
                            self.display.problem(&line, &problem)?;
                            continue;
                        }
                    };
                    match line::parse(&line, &self.state) {
                        Ok(Command::Report(kind)) => self.report(&line, kind).await?,
                        Ok(Command::Help) => self.display.help()?,
                        Ok(Command::State) => self.display.state_again(&self.state)?,
                        Ok(Command::Wait) => waits = true,
                        Ok(Command::Nothing) => {}
                        Ok(Command::Quit) => break,
                        Err(problem) => self.display.problem(&line, &problem)?,
                    }
                }
            }
        }
        Ok(())
    }

    /// Shows a state, if it is newer than the last one. Returns whether something was printed.
    fn see(&mut self, state: v1::TableState) -> Result<bool, CommandError> {
        if state.version <= self.state.version {
            return Ok(false);
        }
        let printed = self.display.state(&state)?;
        self.state = state;
        Ok(printed)
    }

    async fn report(&mut self, line: &str, kind: Kind) -> Result<(), CommandError> {
        match self.table.report(kind).await {
            Ok(response) => {
                self.display.verdict(line, &response)?;
                self.see(response.state.unwrap_or_default()).map(|_| ())
            }
            Err(error) if is_passing(&error) => self.display.problem(line, error.message()),
            Err(error) => Err(error.into()),
        }
    }
}

/// Whether the table waits for a report, not for the decision of a remote seat.
fn needs_a_report(state: &v1::TableState) -> bool {
    let at_table = |seat: u32| {
        let seat = usize::try_from(seat).ok();
        seat.and_then(|seat| state.seats.get(seat))
            .is_some_and(|seat| seat.at_table)
    };
    match state.stage() {
        _ if !state.to_lay.is_empty() || !state.questions.is_empty() => true,
        v1::TableStage::Waiting => false,
        v1::TableStage::Turn | v1::TableStage::Gift | v1::TableStage::SpecialAction => {
            state.seat.is_none_or(at_table)
        }
        _ => true,
    }
}

fn prompt() -> Result<(), CommandError> {
    let mut out = io::stdout();
    write!(out, "> ")?;
    Ok(out.flush()?)
}

/// What was typed.
#[derive(Debug, PartialEq)]
enum Typed {
    Line(String),
    /// The beginning of a line that cannot be a report, and why.
    Unreadable(String, String),
}

/// The lines of an input, until it ends or fails.
fn lines_of(mut input: impl BufRead) -> impl Iterator<Item = io::Result<Typed>> {
    let mut number = 0;
    iter::from_fn(move || {
        number += 1;
        next_line(&mut input, number).transpose()
    })
}

fn next_line(input: &mut impl BufRead, number: u64) -> io::Result<Option<Typed>> {
    let mut bytes = Vec::new();
    let most = MAX_LINE_BYTES + 1;
    input.by_ref().take(most).read_until(b'\n', &mut bytes)?;
    if bytes.is_empty() {
        return Ok(None);
    }
    let problem = if bytes.len() as u64 == most && !bytes.ends_with(b"\n") {
        input.skip_until(b'\n')?;
        bytes.truncate(80);
        Some(format!(
            "line {number} is longer than {MAX_LINE_BYTES} bytes"
        ))
    } else {
        let is_text = std::str::from_utf8(&bytes).is_ok();
        (!is_text).then(|| format!("line {number} is not UTF-8"))
    };
    let line = String::from_utf8_lossy(&bytes).trim_end().to_owned();
    Ok(Some(match problem {
        None => Typed::Line(line),
        Some(problem) => Typed::Unreadable(line, problem),
    }))
}

/// The lines of the input. A thread reads them, which does not keep the process from ending.
fn typed_lines() -> mpsc::Receiver<io::Result<Typed>> {
    let (sender, receiver) = mpsc::channel(1);
    thread::spawn(move || {
        for line in lines_of(io::stdin().lock()) {
            if sender.blocking_send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_cannot_be_read_does_not_end_the_others() {
        let long = "7 ".repeat(4_000);
        let text = [
            b"pass\r\nJos\xe9: 7\n" as &[u8],
            long.as_bytes(),
            b"\nclear",
        ]
        .concat();
        let lines: Vec<Typed> = lines_of(&text[..]).map(|it| it.expect("bytes")).collect();
        let typed = |line: &str| Typed::Line(line.to_owned());
        assert_eq!(lines[0], typed("pass"));
        let unreadable =
            |line: &str, problem: &str| Typed::Unreadable(line.to_owned(), problem.to_owned());
        assert_eq!(
            lines[1],
            unreadable("Jos\u{fffd}: 7", "line 2 is not UTF-8")
        );
        let problem = "line 3 is longer than 4096 bytes";
        assert_eq!(lines[2], unreadable(long[..80].trim_end(), problem));
        assert_eq!(lines[3..], [typed("clear")]);
    }

    #[test]
    fn decisions_of_remote_seats_are_waited_for() {
        use v1::TableStage::{
            Confirmation, Gift, Hand, Opening, Over, Question, SpecialAction, Turn, Waiting,
        };
        let state = |stage: v1::TableStage, seat| v1::TableState {
            stage: stage.into(),
            seat,
            seats: [true, false]
                .map(|at_table| v1::TableSeat {
                    at_table,
                    hand_known: false,
                })
                .to_vec(),
            ..v1::TableState::default()
        };
        for (stage, seat, expected) in [
            (Waiting, None, false),
            (Hand, Some(1), true),
            (SpecialAction, None, true),
            (SpecialAction, Some(1), false),
            (Gift, Some(0), true),
            (Gift, Some(1), false),
            (Opening, None, true),
            (Turn, Some(0), true),
            (Turn, Some(1), false),
            (Question, None, true),
            (Confirmation, None, true),
            (Over, None, true),
        ] {
            assert_eq!(needs_a_report(&state(stage, seat)), expected, "{stage:?}");
        }
        let decided = v1::TableState {
            to_lay: vec![v1::CardsToLay::default()],
            ..state(Turn, Some(1))
        };
        assert!(needs_a_report(&decided));
    }
}
