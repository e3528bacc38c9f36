//! Arguments and names for values of the protocol about tournaments.

use chefshat_client::v1;
use chefshat_server::clock::since_epoch_ms;
use chrono::{DateTime, SecondsFormat};
use clap::ValueEnum;

use super::super::numbers::duration;

/// Format: who plays whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(super) enum FormatArg {
    /// Tables of four; the first two of each advance, in two halves that meet in a final.
    Knockout,
    /// All participants meet and take each seat as evenly as possible.
    RoundRobin,
    /// Participants with similar scores meet.
    Swiss,
}

impl FormatArg {
    pub(super) fn format(self) -> v1::TournamentFormat {
        match self {
            Self::Knockout => v1::TournamentFormat::Knockout,
            Self::RoundRobin => v1::TournamentFormat::RoundRobin,
            Self::Swiss => v1::TournamentFormat::Swiss,
        }
    }
}

/// How games are dealt.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum DealsArg {
    /// New deals in every game.
    Independent,
    /// The same deals at all tables of a round.
    Same,
    /// Each pairing plays each deal once per seat; only for built-in and stateless agents.
    Rotated,
}

impl DealsArg {
    pub(super) fn deals(self) -> v1::TournamentDeals {
        match self {
            Self::Independent => v1::TournamentDeals::Independent,
            Self::Same => v1::TournamentDeals::SameAtAllTables,
            Self::Rotated => v1::TournamentDeals::Rotated,
        }
    }
}

/// States of tournaments.
pub(super) const STATES: [(&str, v1::TournamentState, &str); 4] = {
    use v1::TournamentState::{Closed, Finished, Open, Playing};
    [
        ("open", Open, "Participants may join"),
        ("playing", Playing, "Games are being played"),
        ("finished", Finished, "All games are over"),
        ("closed", Closed, "The owner closed it early"),
    ]
};

/// Parses a point in time, or a duration from now, to milliseconds since the Unix epoch.
pub(super) fn time(words: &str) -> Result<u64, String> {
    if let Ok(duration) = duration(words) {
        let later = u64::try_from(duration.as_millis()).unwrap_or(u64::MAX);
        return Ok(since_epoch_ms().saturating_add(later));
    }
    let time = DateTime::parse_from_rfc3339(words).ok();
    let milliseconds = time.and_then(|time| u64::try_from(time.timestamp_millis()).ok());
    milliseconds.ok_or_else(|| {
        "give a time as 2026-05-01T18:00:00Z or 2026-05-01T20:00:00+02:00, or a duration from now as 30m"
            .to_owned()
    })
}

/// A point in time, in UTC.
pub(super) fn time_in_words(milliseconds: u64) -> String {
    let time = i64::try_from(milliseconds)
        .ok()
        .and_then(DateTime::from_timestamp_millis);
    time.map_or_else(
        || format!("{milliseconds} ms after 1970"),
        |time| time.to_rfc3339_opts(SecondsFormat::Secs, true),
    )
}

/// The name of a format.
pub(crate) fn format_name(format: v1::TournamentFormat) -> &'static str {
    match format {
        v1::TournamentFormat::Unspecified => "unknown",
        v1::TournamentFormat::Knockout => "knockout",
        v1::TournamentFormat::RoundRobin => "round robin",
        v1::TournamentFormat::Swiss => "swiss",
    }
}

/// The name of a state.
pub(crate) fn state(state: v1::TournamentState) -> &'static str {
    match state {
        v1::TournamentState::Unspecified => "unknown",
        v1::TournamentState::Open => "open",
        v1::TournamentState::Playing => "playing",
        v1::TournamentState::Finished => "finished",
        v1::TournamentState::Closed => "closed",
    }
}

/// Whether a tournament has ended.
pub(crate) fn is_over(tournament: &v1::Tournament) -> bool {
    use v1::TournamentState::{Closed, Finished};
    [Finished, Closed].contains(&tournament.state())
}
