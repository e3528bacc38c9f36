//! `chefshat migrate`: creates or upgrades the tables of a PostgreSQL database, and moves the games
//! of a data directory there. The work is done by [`chefshat_server::store`].

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_server::store::{migrate, transfer};
use clap::Args;
use serde_json::json;

use super::numbers::counted;
use super::{CommandError, progress, say};

/// Create or upgrade the tables of a PostgreSQL database, or move a data directory there.
#[derive(Debug, Args)]
#[command(
    after_help = "Upgrade the tables with the new version first, while the nodes of the old one run; then replace the nodes one by one. \
                  While a backup runs, it waits for a minute, then gives up: run it again.\n\n\
                  With --from, stop the server of the folder first. Finished and unfinished games and tournaments move in one transaction: \
                  all or nothing. The folder keeps everything, but no server starts on it again: its unfinished games resume on the cluster. \
                  The nodes need its signing-key and its files of tokens and certificates.\n\n\
                  Examples:\n  \
                  chefshat migrate --database postgres://chefshat@db.example.org/chefshat\n  \
                  chefshat migrate --from ./chefshat-data --database postgres://chefshat@db.example.org/chefshat"
)]
pub(super) struct Migrate {
    /// Address of the database.
    #[arg(
        long,
        env = "CHEFSHAT_DATABASE",
        hide_env_values = true,
        value_name = "URL"
    )]
    database: String,
    /// Data directory to move. The database must not have any games.
    #[arg(long, value_name = "DIR")]
    from: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Migrate {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match &self.from {
            Some(folder) => self.transfer(folder).await,
            None => self.upgrade().await,
        }
    }

    async fn upgrade(&self) -> Result<ExitCode, CommandError> {
        let (before, version) = migrate(&self.database).await?;
        if self.json {
            say(json!({ "version_before": before, "version": version }))?;
        } else {
            match before {
                0 => say(format_args!("tables created, version {version}"))?,
                _ if before == version => {
                    say(format_args!("the tables have version {version} already"))?;
                }
                _ => say(format_args!(
                    "tables upgraded from version {before} to {version}"
                ))?,
            }
        }
        Ok(ExitCode::SUCCESS)
    }

    async fn transfer(&self, folder: &std::path::Path) -> Result<ExitCode, CommandError> {
        let bar = progress::of_items(0, "games");
        let moved = transfer(folder, &self.database, |moved, all| {
            bar.set_length(all);
            bar.set_position(moved);
        });
        let moved = moved.await;
        bar.finish_and_clear();
        let moved = moved?;
        if self.json {
            say(json!({
                "finished_games": moved.finished,
                "unfinished_games": moved.unfinished,
                "tournaments": moved.tournaments,
                "studies": moved.studies,
                "unreadable": moved.unreadable,
            }))?;
            return Ok(ExitCode::SUCCESS);
        }
        say(format_args!(
            "moved: {}, {} unfinished, {}, {}",
            counted(moved.finished, "finished game"),
            moved.unfinished,
            counted(moved.tournaments, "tournament"),
            counted(moved.studies, "study"),
        ))?;
        if moved.unreadable > 0 {
            say(format_args!(
                "{} of them cannot be read by this version and will not resume; --log error names them",
                moved.unreadable
            ))?;
        }
        Ok(ExitCode::SUCCESS)
    }
}
