//! `chefshat check-agent`: tests an agent and prints the result. The crate `chefshat-examiner` has
//! the cases and judges them.

use std::fmt::Write as _;
use std::io::Write as _;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use anstyle::{AnsiColor, Style};
use chefshat_cli::error::{CommandError, say, tell};
use chefshat_cli::stops::Stops;
use chefshat_examiner::case::{CASES, Case, Patience};
use chefshat_examiner::{AgentCommand, Examination, Outcome, Waiting};
use clap::Args;

/// Time to wait for an agent that a person starts.
const BY_HAND: Duration = Duration::from_secs(600);

/// Test whether an agent, in any language, plays correctly, even when a move is rejected or the
/// connection drops.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat check-agent -- python agent.py --server {address} --code {code}\n  \
                  chefshat check-agent --only refusal --only disconnect -- node agent.js --address {address} --code {code} --name {name}\n  \
                  chefshat check-agent --many 'python agent.py --server {address} --tournament {tournament}' -- python agent.py --server {address} --code {code}\n  \
                  chefshat check-agent --list\n  chefshat check-agent --only game        (waits for an agent started by hand)\n\n\
                  In the command, {address} stands for the examiner's host:port, {url} for http://host:port, {code} for the join code of \
                  the case's room, {tournament} for that of a tournament, {name} for a display name. The agent is restarted for each case. The faults are explained in \
                  docs/check-agent.md.\n\n\
                  Exit code: 0 when the agent passed every case."
)]
pub(super) struct CheckAgent {
    /// Run only this case. Repeatable.
    #[arg(long, value_name = "CASE", value_parser = case_named)]
    only: Vec<&'static Case>,
    /// List the cases without running them.
    #[arg(long)]
    list: bool,
    /// Seconds the agent has to answer, reconnect, leave and exit.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = seconds)]
    patience: f64,
    /// Seconds the agent has to start and take its seat. Default: 30, or 600 if a person starts it.
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    start: Option<f64>,
    /// Address to listen on, for agents with a fixed server address. Default: a free port of
    /// 127.0.0.1 for each case.
    #[arg(long, value_name = "ADDRESS")]
    listen: Option<SocketAddr>,
    /// Directory for the agent's output, one file per case.
    #[arg(long, value_name = "FOLDER")]
    logs: Option<PathBuf>,
    /// Shell command that starts the agent for a tournament. Without it the case many-seats is
    /// skipped.
    #[arg(long, value_name = "COMMAND LINE")]
    many: Option<String>,
    /// Print one JSON line per case, and a summary.
    #[arg(long)]
    json: bool,
    /// Command that starts the agent. Without it, the address and join code of each case are
    /// printed.
    #[arg(last = true, value_name = "COMMAND")]
    command: Vec<String>,
}

impl CheckAgent {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if self.list {
            return self.print_list();
        }
        let mut stops = Stops::catch()?;
        tokio::select! {
            code = self.examine() => code,
            // Returning ends the agent's processes, which are in a process group of their own.
            stop = stops.next() => Ok(stop.exit_code()),
        }
    }

    async fn examine(&self) -> Result<ExitCode, CommandError> {
        let in_rooms = match self.command.is_empty() {
            true => None,
            false => Some(AgentCommand::new(self.command.clone())?),
        };
        let in_tournaments = (self.many.as_deref())
            .map(AgentCommand::for_tournament)
            .transpose()?;
        if let Some(logs) = &self.logs {
            std::fs::create_dir_all(logs).map_err(|error| {
                let folder = logs.display();
                format!("cannot use the directory {folder}: {error}; choose another with --logs")
            })?;
        }
        let start = match (self.start, in_rooms.as_ref().or(in_tournaments.as_ref())) {
            (Some(start), _) => Duration::from_secs_f64(start),
            (None, Some(_)) => Duration::from_secs(30),
            (None, None) => BY_HAND,
        };
        let patience = Patience {
            start,
            each: Duration::from_secs_f64(self.patience),
        };
        let cases = self.cases()?;
        let examination = Examination::new(self.listen, patience, self.logs.clone()).await?;
        let mut passed = 0;
        let mut played = 0;
        // Whether an agent has come: to rooms, and to tournaments, which may have another command.
        let mut has_come: [Option<bool>; 2] = [None; 2];
        for case in &cases {
            let has_come = &mut has_come[usize::from(case.is_tournament())];
            if *has_come == Some(false) {
                continue;
            }
            let waiting = |waiting: &Waiting| self.print_waiting(case, waiting);
            let command = match case.is_tournament() {
                true => in_tournaments.as_ref(),
                false => in_rooms.as_ref(),
            };
            let outcome = examination.examine(case, command, waiting).await?;
            self.print(case, &outcome)?;
            played += 1;
            passed += usize::from(outcome.is_passed());
            // A command that has worked before may work again. A person who has left may not come back.
            let before = has_come.is_some() && command.is_some();
            *has_come = Some(before || !outcome.is_fatal());
        }
        examination.stop().await?;
        self.print_summary(passed, played, cases.len())?;
        Ok(if passed == cases.len() {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }

    /// The cases to run: those given with --only, or all that have a command.
    fn cases(&self) -> Result<Vec<&'static Case>, CommandError> {
        let (rooms, many) = (!self.command.is_empty(), self.many.is_some());
        if self.only.is_empty() {
            // --many alone selects the tournament case; neither command selects the cases in rooms.
            let wanted = |case: &&Case| match case.is_tournament() {
                true => many,
                false => rooms || !many,
            };
            return Ok(CASES.iter().filter(wanted).collect());
        }
        let without = |case: &&&Case| case.is_tournament() && rooms && !many;
        match self.only.iter().find(without) {
            Some(case) => Err(format!(
                "the case {} runs in a tournament; give its command with --many",
                case.name
            )
            .into()),
            None => Ok(self.only.clone()),
        }
    }

    fn print_list(&self) -> Result<ExitCode, CommandError> {
        for case in &CASES {
            let (name, about) = (case.name, case.about);
            if self.json {
                say(serde_json::json!({"case": name, "about": about}))?;
            } else {
                say(format!("{name:WIDTH$} {about}"))?;
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    fn print_waiting(&self, case: &Case, waiting: &Waiting) {
        let Waiting { address, code } = waiting;
        if self.json {
            let line = serde_json::json!({
                "event": "waiting", "case": case.name, "address": address.to_string(), "code": code,
            });
            // If nobody reads this, no agent starts, and the case reports that after its time.
            let _unread = say(line);
        } else {
            tell(format_args!(
                "{}: start an agent on {address} with join code {code}",
                case.name
            ));
        }
    }

    fn print(&self, case: &Case, outcome: &Outcome) -> Result<(), CommandError> {
        if self.json {
            return say(as_json(case, outcome));
        }
        let mut text = String::new();
        let (word, colour) = match outcome.is_passed() {
            true => ("PASS ", AnsiColor::Green),
            false => ("FAULT", AnsiColor::Red),
        };
        let style = Style::new().fg_color(Some(colour.into())).bold();
        let (name, took) = (case.name, outcome.took.as_secs_f64());
        write!(
            text,
            "{style}{word}{style:#} {name:WIDTH$} {} ({took:.1} s)",
            case.about
        )?;
        for finding in &outcome.findings {
            let fault = finding.fault;
            let times = match finding.times {
                1 => String::new(),
                times => format!(", {times} times"),
            };
            write!(text, "\n      {style}{fault}{style:#}{times}")?;
            write!(text, "\n        expected: {}", finding.expected)?;
            write!(text, "\n        got:      {}", finding.got)?;
            write!(text, "\n        to do:    {}", fault.advice())?;
        }
        if !outcome.last_lines.is_empty() {
            write!(text, "\n      the agent's last lines:")?;
            for line in &outcome.last_lines {
                write!(text, "\n        | {line}")?;
            }
        }
        Ok(writeln!(anstream::stdout(), "{text}")?)
    }

    fn print_summary(&self, passed: usize, played: usize, all: usize) -> Result<(), CommandError> {
        if self.json {
            return say(serde_json::json!({
                "event": "summary", "cases": all, "played": played, "passed": passed, "ok": passed == all,
            }));
        }
        let rest = match all - played {
            0 => String::new(),
            rest => format!("; {rest} skipped, because no agent connected"),
        };
        say(format!("{passed} of {all} cases passed{rest}"))
    }
}

/// Columns of a case's name.
const WIDTH: usize = 15;

fn as_json(case: &Case, outcome: &Outcome) -> serde_json::Value {
    let faults: Vec<serde_json::Value> = outcome
        .findings
        .iter()
        .map(|finding| {
            serde_json::json!({
                "code": finding.fault.code(),
                "times": finding.times,
                "expected": finding.expected,
                "got": finding.got,
                "advice": finding.fault.advice(),
            })
        })
        .collect();
    serde_json::json!({
        "event": "case",
        "case": case.name,
        "about": case.about,
        "passed": outcome.is_passed(),
        "faults": faults,
        "seconds": outcome.took.as_secs_f64(),
        "last_lines": outcome.last_lines,
    })
}

fn case_named(name: &str) -> Result<&'static Case, String> {
    Case::named(name).ok_or_else(|| {
        let names: Vec<&str> = CASES.iter().map(|case| case.name).collect();
        format!("unknown case; use one of {}", names.join(", "))
    })
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.1..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("0.1 to 3600 seconds".into()),
    }
}
