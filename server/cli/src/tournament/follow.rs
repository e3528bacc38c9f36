//! `chefshat tournament follow`: shows how a tournament stands, after each change, until it is
//! over: a bar and a table on a terminal, otherwise one line per change.

use std::io::{self, IsTerminal as _, Write as _};
use std::process::ExitCode;
use std::time::Duration;

use chefshat_client::v1;
use clap::Args;
use indicatif::ProgressBar;

use super::super::connect::{SecretArgs, ServerArg, patience};
use super::super::{CommandError, progress, say};
use super::tables::{self, Field};
use super::words::{is_over, state, time_in_words};
use crate::narration::clean;

/// Rows of the table while a tournament is in progress.
const LIVE_LINES: usize = 12;
/// Time between two updates of the elapsed time.
const TICK: Duration = Duration::from_secs(1);
/// Leaders listed in a line.
const LEADERS: usize = 3;

/// Follow a tournament to its end.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  chefshat tournament follow 5f0c6a4de2b14b7f8a3d9c1e7b60425d\n  \
                  chefshat tournament follow 5f0c6a4de2b14b7f8a3d9c1e7b60425d --json\n\n\
                  Exit code: 0 when the tournament finished, 1 when it was closed or could not be followed."
)]
pub(super) struct Follow {
    /// ID of the tournament.
    #[arg(value_name = "TOURNAMENT-ID")]
    tournament_id: String,
    #[command(flatten)]
    server: ServerArg,
    #[command(flatten)]
    secrets: SecretArgs,
    /// Print each change as a JSON line.
    #[arg(long)]
    json: bool,
}

impl Follow {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let client = self.server.connect_with(&self.secrets).await?;
        let follower = client.follow_tournament(self.tournament_id);
        let mut follower = follower.with_backoff(patience());
        let mut display = Display::new(self.json)?;
        let mut end = None;
        while let Some(report) = follower.next().await? {
            let tournament = report.tournament.clone().unwrap_or_default();
            display.show(&tournament, report)?;
            end = is_over(&tournament).then(|| tournament.state());
        }
        match end {
            Some(v1::TournamentState::Finished) => Ok(ExitCode::SUCCESS),
            Some(_) => Ok(ExitCode::FAILURE),
            None => Err("the server ended the stream before the tournament was over".into()),
        }
    }
}

/// How changes are shown.
enum Display {
    Json,
    /// The last printed line.
    Lines(String),
    Live(ProgressBar),
}

impl Display {
    fn new(json: bool) -> Result<Self, CommandError> {
        if json {
            return Ok(Self::Json);
        }
        if !(io::stdout().is_terminal() && io::stderr().is_terminal()) {
            return Ok(Self::Lines(String::new()));
        }
        let style = "{prefix}\n{bar:40} {human_pos} of {human_len} games, {elapsed}\n{msg}";
        let bar = progress::styled(ProgressBar::new(0), style);
        // Shows that time passes while nothing changes.
        bar.enable_steady_tick(TICK);
        Ok(Self::Live(bar))
    }

    fn show(
        &mut self,
        tournament: &v1::Tournament,
        report: v1::FollowTournamentResponse,
    ) -> Result<(), CommandError> {
        let field = Field::new(tournament);
        let over = is_over(tournament);
        match self {
            Self::Json => {
                let event = if over { "over" } else { "changed" };
                let (standings, games) = (report.standings, report.games);
                say(serde_json::json!({
                    "event": event, "tournament": tournament, "standings": standings, "games": games,
                }))
            }
            Self::Lines(last) => {
                let line = in_a_line(tournament, &report.standings, &field);
                if line != *last {
                    say(&line)?;
                    *last = line;
                }
                match over {
                    true => print_standings(&field, &report.standings),
                    false => Ok(()),
                }
            }
            Self::Live(bar) => {
                if over {
                    bar.finish_and_clear();
                    say(in_a_line(tournament, &report.standings, &field))?;
                    return print_standings(&field, &report.standings);
                }
                bar.set_length(tournament.games.into());
                bar.set_position(tournament.games_over.into());
                bar.set_prefix(title(tournament));
                let mut text = String::new();
                let shown = report.standings.len().min(LIVE_LINES);
                tables::standings(&mut text, &field, &report.standings[..shown]);
                let more = report.standings.len() - shown;
                if more > 0 {
                    text.push_str(&format!("  … and {more} more\n"));
                }
                bar.set_message(text);
                bar.tick();
                Ok(())
            }
        }
    }
}

fn print_standings(
    field: &Field<'_>,
    standings: &[v1::TournamentStanding],
) -> Result<(), CommandError> {
    let mut text = String::from("\n");
    tables::standings(&mut text, field, standings);
    let mut out = anstream::stdout().lock();
    write!(out, "{text}")?;
    Ok(out.flush()?)
}

/// Name and progress of a tournament.
fn title(tournament: &v1::Tournament) -> String {
    let settings = tournament.settings.clone().unwrap_or_default();
    let name = clean(&settings.name, 40);
    match tournament.state() {
        v1::TournamentState::Open => {
            let participants = tournament.participants.iter();
            let joined = participants.filter(|it| !it.withdrawn).count();
            let begins = match settings.start_when_joined {
                0 => String::new(),
                count => format!(" of {count}"),
            };
            let at = match settings.start_at_ms {
                0 => String::new(),
                at => format!(", starts at {}", time_in_words(at)),
            };
            format!("{name}: open, {joined}{begins} have joined{at}")
        }
        v1::TournamentState::Playing if tournament.paused => format!(
            "{name}: paused in round {} of {}, {} being played",
            tournament.round, tournament.rounds, tournament.games_playing
        ),
        v1::TournamentState::Playing => format!(
            "{name}: round {} of {}, {} being played",
            tournament.round, tournament.rounds, tournament.games_playing
        ),
        other => format!("{name}: {}", state(other)),
    }
}

fn in_a_line(
    tournament: &v1::Tournament,
    standings: &[v1::TournamentStanding],
    field: &Field<'_>,
) -> String {
    let (over, games) = (tournament.games_over, tournament.games);
    let leaders: Vec<String> = standings
        .iter()
        .filter(|standing| standing.games > 0)
        .take(LEADERS)
        .map(|standing| {
            format!(
                "{} {:.2}",
                field.name(standing.participant),
                tables::mean_score(standing)
            )
        })
        .collect();
    let ahead = match leaders.is_empty() {
        true => String::new(),
        false => format!("; ahead: {}", leaders.join(", ")),
    };
    format!("{}; {over} of {games} games over{ahead}", title(tournament))
}
