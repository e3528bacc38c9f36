//! What the protocol's numbers for tournaments are called on the command line.

use chefshat_client::v1;
use clap::ValueEnum;

/// Who plays whom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[value(rename_all = "snake_case")]
pub(super) enum FormatArg {
    /// Tables of four, of each of which the first two advance, in two halves that meet in a final.
    Knockout,
    /// All meet, and have each seat, as evenly as their number allows.
    RoundRobin,
    /// Those who score alike meet.
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
    /// Every game anew.
    Independent,
    /// All tables of a round alike.
    Same,
    /// Every pairing plays each deal once for each seat; for built-in and stateless agents alone.
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

/// Where a tournament stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum StateArg {
    /// Participants may join.
    Open,
    /// It is being played.
    Playing,
    /// It has been played to its end.
    Finished,
    /// It was closed before its end.
    Closed,
}

impl StateArg {
    pub(super) fn state(self) -> v1::TournamentState {
        match self {
            Self::Open => v1::TournamentState::Open,
            Self::Playing => v1::TournamentState::Playing,
            Self::Finished => v1::TournamentState::Finished,
            Self::Closed => v1::TournamentState::Closed,
        }
    }
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
pub(super) fn state(state: v1::TournamentState) -> &'static str {
    match state {
        v1::TournamentState::Unspecified => "unknown",
        v1::TournamentState::Open => "open",
        v1::TournamentState::Playing => "playing",
        v1::TournamentState::Finished => "finished",
        v1::TournamentState::Closed => "closed",
    }
}

/// Whether nothing more happens in a tournament.
pub(crate) fn is_over(tournament: &v1::Tournament) -> bool {
    use v1::TournamentState::{Closed, Finished};
    [Finished, Closed].contains(&tournament.state())
}
