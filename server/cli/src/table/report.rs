//! `chefshat table report`: one report, and its verdict.

use std::process::ExitCode;

use chefshat_client::v1;
use clap::Args;

use super::super::CommandError;
use super::args::TableArgs;
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
        let kind = match line::parse(&self.line, &state)? {
            Command::Report(kind) => kind,
            _ => return Err("say what happened, for example 'Ada: 7 7 joker'".into()),
        };
        let response = table.report(kind).await?;
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
