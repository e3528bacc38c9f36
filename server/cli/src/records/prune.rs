//! `chefshat records prune`: deletes old games of a running server with their records.

use std::process::ExitCode;
use std::time::Duration;

use chefshat_client::v1;
use chefshat_server::clock::since_epoch_ms;
use clap::Args;
use serde_json::json;

use super::super::connect::ServerArg;
use super::super::numbers::{counted, duration};
use super::super::{CommandError, admin, say};

/// Delete finished games with their records from a running server, oldest first, and give the disk
/// space back. Needs a token with the role admin. This cannot be undone.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat records prune --older-than 90d\n  chefshat records prune --older-than 30d --keep 1000\n\n\
                  Games of studies, and of tournaments that are not over, are kept. `chefshat serve --keep-games 90d` prunes by itself."
)]
pub(super) struct Prune {
    #[command(flatten)]
    server: ServerArg,
    /// Only games that ended longer ago than this: days (90d), hours (12h) or minutes (30m).
    #[arg(long, value_name = "TIME", value_parser = duration, required_unless_present = "keep")]
    older_than: Option<Duration>,
    /// Keep the newest games, this many.
    #[arg(long, value_name = "GAMES", value_parser = clap::value_parser!(u64).range(1..))]
    keep: Option<u64>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Prune {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let ended_before_ms = |age: Duration| {
            let age_ms = u64::try_from(age.as_millis()).unwrap_or(u64::MAX);
            since_epoch_ms().saturating_sub(age_ms)
        };
        let request = v1::PruneRecordsRequest {
            ended_before_ms: self.older_than.map_or(0, ended_before_ms),
            keep: self.keep.unwrap_or_default(),
        };
        let mut service = admin::service(&self.server).await?;
        let pruned = service.prune_records(request).await;
        let pruned = pruned.map_err(admin::refused)?.into_inner();
        match self.json {
            true => say(json!({ "games": pruned.games, "freed_bytes": pruned.freed_bytes }))?,
            false => say(words(pruned))?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// What was deleted.
fn words(pruned: v1::PruneRecordsResponse) -> String {
    let games = counted(pruned.games, "game");
    match pruned.freed_bytes {
        0 => format!("{games} deleted"),
        freed => format!(
            "{games} deleted, {:.1} MiB freed",
            freed as f64 / (1024.0 * 1024.0)
        ),
    }
}
