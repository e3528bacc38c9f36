//! `chefshat tournament results`: the standings, their confidence and statistics of play, as text,
//! JSON or files.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_client::v1;
use chefshat_record::atomic_file::AtomicFile;
use clap::Args;

use super::super::connect::{SecretArgs, ServerArg};
use super::super::numbers::counted;
use super::super::output::{heading, line};
use super::super::{CommandError, say};
use super::files;
use super::list::all_games;
use super::tables::{self, Field, NO_GAME_COUNTED};
use super::words::{format_name, is_over, state};
use crate::narration::clean;

/// Show the standings of a tournament, their confidence, and statistics of play; final once it is
/// over.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament results 5f0c6a4de2b14b7f8a3d9c1e7b60425d\n  \
                  chefshat tournament results 5f0c6a4de2b14b7f8a3d9c1e7b60425d --csv standings.csv --final-results FinalResultsComp.csv\n\n\
                  docs/tournaments.md and docs/ratings.md say what the numbers mean."
)]
pub(super) struct Results {
    /// ID of the tournament.
    #[arg(value_name = "TOURNAMENT-ID")]
    tournament_id: String,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// Print the results as a JSON line.
    #[arg(long)]
    json: bool,
    /// Write complete standings to this CSV file, one line per participant.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Write the columns of the reference implementation's FinalResultsComp.csv to this file. The
    /// score is that of the last game played.
    #[arg(long, value_name = "FILE")]
    final_results: Option<PathBuf>,
}

impl Results {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let results = client
            .tournament_results(self.tournament_id.as_str())
            .await?;
        if let Some(file) = &self.csv {
            files::write_standings(AtomicFile::create(file)?, &results)?;
        }
        if let Some(file) = &self.final_results {
            let games = all_games(&client, &self.tournament_id).await?;
            files::write_final_results(file, &results, &games)?;
        }
        if self.json {
            let (tournament, standings) = (results.tournament, results.standings);
            say(serde_json::json!({
                "event": "results", "tournament": tournament, "standings": standings, "confidence": results.confidence,
            }))?;
        } else {
            let mut out = anstream::stdout().lock();
            write!(out, "{}", text(&results))?;
            out.flush()?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// The results for people.
fn text(results: &v1::GetTournamentResultsResponse) -> String {
    let tournament = results.tournament.clone().unwrap_or_default();
    let settings = tournament.settings.clone().unwrap_or_default();
    let mut text = String::new();
    let name = clean(&settings.name, 64);
    heading(&mut text, &format!("{name}: {}", state(tournament.state())));
    let format = format_name(settings.format());
    let participants = counted(results.standings.len() as u64, "participant");
    let (over, games) = (tournament.games_over, tournament.games);
    let course = match tournament.state() {
        v1::TournamentState::Open => "not started".to_owned(),
        _ => format!(
            "{}, {over} of {games} games over",
            counted(tournament.rounds.into(), "round")
        ),
    };
    line(&mut text, &format!("{format}, {participants}, {course}"));
    if let Some(words) = of_deals(settings.deals()) {
        line(&mut text, words);
    }
    let has_counted = tables::has_counted(&results.standings);
    match (has_counted, is_over(&tournament)) {
        (false, false) => line(&mut text, "nothing has been played yet"),
        (false, true) => line(&mut text, NO_GAME_COUNTED),
        (true, false) => line(&mut text, "these standings are not final"),
        (true, true) => {}
    }
    let field = Field::new(&tournament);
    text.push('\n');
    tables::standings(&mut text, &field, &results.standings);
    if has_counted {
        text.push('\n');
        tables::order(&mut text, &field, &results.confidence);
        text.push('\n');
        tables::play(&mut text, &field, &results.standings);
    }
    text
}

/// Remarks about the deals.
pub(super) fn of_deals(deals: v1::TournamentDeals) -> Option<&'static str> {
    match deals {
        v1::TournamentDeals::Unspecified | v1::TournamentDeals::Independent => None,
        v1::TournamentDeals::SameAtAllTables => {
            Some("all tables of a round had the same deals; no participant met a deal twice")
        }
        v1::TournamentDeals::Rotated => Some(
            "participants met each deal in all seats: built-in agents, and others that declared to remember nothing",
        ),
    }
}
