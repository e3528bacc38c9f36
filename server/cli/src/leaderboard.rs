//! `chefshat leaderboard`: shows the ratings of a server's participants. docs/ratings.md explains
//! them.

use std::io::Write as _;
use std::process::ExitCode;

use crate::kind::{KindArg, kind_filter};
use chefshat_client::v1;
use clap::Args;

use super::connect::ServerArg;
use super::numbers::counted;
use super::output::heading;
use super::{CommandError, board};

/// Show the ratings of a server's participants, best first.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat leaderboard --min-games 20\n  chefshat leaderboard --kind human --csv > people.csv\n\n\
                  `chefshat ratings` recomputes it from the records. docs/ratings.md says which games are rated and what the numbers mean."
)]
pub(super) struct Leaderboard {
    #[command(flatten)]
    server: ServerArg,
    /// Only participants of this kind, rated by all their games.
    #[arg(long, value_enum)]
    kind: Option<KindArg>,
    /// Only participants with at least this many rated games.
    #[arg(long, value_name = "N", default_value_t = 0)]
    min_games: u32,
    /// Maximum number of participants, best first.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1000))]
    limit: u32,
    /// Print one JSON object.
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Print CSV, one line per participant.
    #[arg(long)]
    csv: bool,
}

impl Leaderboard {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect().await?;
        let request = v1::GetLeaderboardRequest {
            kind: kind_filter(self.kind).into(),
            min_games: self.min_games,
            limit: self.limit,
        };
        let found = client.leaderboard(request).await?;
        let mut out = anstream::stdout().lock();
        if self.json {
            let lines = board::as_json(&found);
            let object = serde_json::json!({"rated_games": found.games, "leaderboard": lines});
            writeln!(out, "{object}")?;
        } else if self.csv {
            out.write_all(&board::as_csv(&found)?)?;
        } else {
            let mut text = String::new();
            heading(&mut text, &counted(found.games, "rated game"));
            board::add_table(&mut text, &found);
            write!(out, "{text}")?;
        }
        out.flush()?;
        Ok(ExitCode::SUCCESS)
    }
}
