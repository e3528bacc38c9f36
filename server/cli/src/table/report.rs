//! `chefshat table report`: one report, and its verdict.

use std::process::ExitCode;

use chefshat_client::v1;
use clap::Args;

use super::super::CommandError;
use super::args::{TableArgs, is_passing};
use super::display::Display;
use super::line::{self, Command};

/// Report one thing that happened at the table.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat table report --ticket TICKET 'Ada: 7 7'\n  \
                  chefshat table report --ticket TICKET pass\n  \
                  chefshat table report --ticket TICKET 'correct 12: 8 8'\n\n\
                  `chefshat table` with help on its input lists what can be reported.\n\n\
                  Exit code: 0 if the referee accepts the report, knew it already, or asks about it; 1 if it is a violation, or \
                  refused."
)]
pub(super) struct Report {
    #[command(flatten)]
    table: TableArgs,
    /// What happened, as in `chefshat table`, for example 'Ada: 7 7 joker'.
    #[arg(value_name = "REPORT")]
    line: String,
}

impl Report {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let mut display = Display::new(self.table.json);
        let json = self.table.json;
        let table = self.table.connect().await?;
        let state = table.follow().next().await?.ok_or("the game is over")?;
        // For scripts a line that is wrong differs from a server that is lost.
        let problem = |problem: CommandError, message: &str| match json {
            true => Display::new(json)
                .problem(&self.line, message)
                .map(|()| ExitCode::FAILURE),
            false => Err(problem),
        };
        let kind = match line::parse(&self.line, &state) {
            Ok(Command::Report(kind)) => kind,
            Ok(_) => {
                let why = "say what happened, for example 'Ada: 7 7 joker'";
                return problem(why.into(), why);
            }
            Err(why) => return problem(why.clone().into(), &why),
        };
        let response = match table.report(kind).await {
            Err(error) if is_passing(&error) => {
                let message = error.message().to_owned();
                return problem(error.into(), &message);
            }
            response => response?,
        };
        display.verdict(&self.line, &response)?;
        if json && let Some(state) = &response.state {
            display.state(state)?;
        }
        Ok(match response.verdict() {
            v1::ReportVerdict::Violation => ExitCode::FAILURE,
            _ => ExitCode::SUCCESS,
        })
    }
}
