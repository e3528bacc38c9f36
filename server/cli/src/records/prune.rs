//! `chefshat records prune`: deletes old games of a running server with their records.

use std::process::ExitCode;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use chefshat_client::v1;
use clap::Args;
use serde_json::json;

use super::super::connect::ServerArg;
use super::super::numbers::{counted, with_unit};
use super::super::{CommandError, admin, say};

/// Seconds of a day.
const DAY: u64 = 24 * 60 * 60;

/// Delete finished games with their records from a running server, oldest first, and give the disk
/// space back. Needs a token with the role admin. This cannot be undone.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat records prune --older-than 90d\n  chefshat records prune --older-than 30d --keep 1000\n\n\
                  Games of tournaments that are not over are kept. `chefshat serve --keep-games 90d` prunes by itself."
)]
pub(super) struct Prune {
    #[command(flatten)]
    server: ServerArg,
    /// Only games that ended longer ago than this: days (90d), hours (12h) or minutes (30m).
    #[arg(long, value_name = "TIME", value_parser = age, required_unless_present = "keep")]
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
        let now = SystemTime::now().duration_since(UNIX_EPOCH)?;
        let ended_before = self.older_than.map(|age| now.saturating_sub(age));
        let request = v1::PruneRecordsRequest {
            ended_before_ms: ended_before.map_or(0, |time| {
                u64::try_from(time.as_millis()).unwrap_or(u64::MAX)
            }),
            keep: self.keep.unwrap_or_default(),
        };
        let mut service = admin::service(&self.server).await?;
        let pruned = service.prune_records(request).await;
        let pruned = pruned.map_err(admin::refused)?.into_inner();
        match self.json {
            true => say(json!({ "games": pruned.games, "freed_bytes": pruned.freed_bytes }))?,
            false => say(format_args!(
                "{} deleted, {:.1} MiB freed",
                counted(pruned.games, "game"),
                pruned.freed_bytes as f64 / (1024.0 * 1024.0)
            ))?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// A time such as 90d.
pub(crate) fn age(text: &str) -> Result<Duration, String> {
    let wrong =
        || format!("{text:?} is not a time; use days, hours or minutes, such as 90d, 12h or 30m");
    let units = [('d', DAY), ('h', 60 * 60), ('m', 60)];
    with_unit(text, &units)
        .and_then(|(number, seconds)| number.checked_mul(seconds))
        .map(Duration::from_secs)
        .ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_a_unit() {
        assert_eq!(age("90d"), Ok(Duration::from_secs(90 * DAY)));
        assert_eq!(age("12h"), Ok(Duration::from_secs(12 * 60 * 60)));
        for bad in [
            "",
            "d",
            "90",
            "-1d",
            "1w",
            "1.5d",
            "99999999999999999999d",
            "9é",
        ] {
            assert!(age(bad).is_err(), "{bad}");
        }
    }
}
