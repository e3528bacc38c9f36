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
    table: args::TableArgs,
}

#[derive(Debug, Subcommand)]
enum TableAction {
    /// Report one thing that happened at the table.
    Report(report::Report),
}

impl TableCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            Some(TableAction::Report(command)) => command.run().await,
            None => attend::attend(self.table).await,
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Only {
        #[command(flatten)]
        table: TableCommand,
    }

    #[test]
    fn the_ticket_stands_with_or_without_a_report() {
        let parse = |words: &[&str]| {
            let words = std::iter::once(&"test").chain(words);
            Only::try_parse_from(words).map(|it| it.table)
        };
        let attends = parse(&["--ticket", "T"]).expect("attends");
        assert_eq!(attends.table.ticket.as_deref(), Some("T"));
        let reports = parse(&["report", "--ticket", "T", "pass"]).expect("reports");
        assert!(matches!(reports.action, Some(TableAction::Report(_))));
        assert!(parse(&[]).is_err());
        assert!(parse(&["report", "pass"]).is_err());
    }
}
