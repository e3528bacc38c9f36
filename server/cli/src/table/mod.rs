//! `chefshat table`: attends to a physical table, as the attendant's view of the page does. `line` is
//! what can be typed, `words` what is shown.

mod args;
mod attend;
mod display;
mod line;
mod report;
mod words;

use std::process::ExitCode;

use clap::{Args, Subcommand};

use super::CommandError;

/// Attend to a table with real cards: see what it waits for, and report what happens.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  chefshat table --ticket TICKET\n  \
                  chefshat table --ticket TICKET --json < reports.txt\n  \
                  chefshat table report --ticket TICKET 'Ada: 7 7'\n\n\
                  Type what happens, one line each: 7 7 joker, pass, clear, hand Ada: 1 2 3, … `help` shows all. The referee's \
                  verdict and the state of the table are printed. The end of the input ends the command; the game continues.\n\n\
                  Exit code: 0 when the game or the input is over, 1 when the game was aborted or the connection was lost."
)]
pub(super) struct TableCommand {
    #[command(subcommand)]
    action: Option<TableAction>,
    #[command(flatten)]
    attend: Option<attend::Attend>,
}

#[derive(Debug, Subcommand)]
enum TableAction {
    /// Report one thing that happened at the table.
    Report(report::Report),
}

impl TableCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match (self.action, self.attend) {
            (Some(TableAction::Report(command)), _) => command.run().await,
            (None, Some(attend)) => attend.run().await,
            (None, None) => Err("give the table's --ticket".into()),
        }
    }
}
