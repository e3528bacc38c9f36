//! What to export, and what was exported. [`Export::run`] is in `run`.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::files::FileSummary;
use super::formats::Format;
use super::game::GameInfo;

/// The layout of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Tables of all games.
    Tables,
    /// One CSV file per game, in the columns of the reference implementation.
    ChefsHatGym,
}

/// Which games to export; all conditions must hold.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Only finished games.
    pub finished_only: bool,
    /// Only games of rooms with this name.
    pub room_name: Option<String>,
    /// Only games with at least one player of this kind: `agent`, `human`, `robot`, `model` or `built_in`.
    pub player_kind: Option<String>,
}

/// The settings of an export.
#[derive(Debug, Clone)]
pub struct Export {
    /// The target folder.
    pub out: PathBuf,
    /// Whether to replace an earlier dataset.
    pub replace: bool,
    /// The layout.
    pub layout: Layout,
    /// The formats of the tables; ignored by the other layout, which is CSV.
    pub formats: Vec<Format>,
    /// Which games to export.
    pub filter: Filter,
    /// Licence of the dataset, as an SPDX identifier.
    pub licence: String,
    /// Version of the exporting program, for the card.
    pub version: String,
}

/// A skipped record, or a file of samples that cannot be read to its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Skipped {
    /// The file.
    pub path: PathBuf,
    /// The reason.
    pub problem: String,
}

/// The result of an export.
#[derive(Debug, Clone, Default)]
pub struct Exported {
    /// Games.
    pub games: u64,
    /// Finished games.
    pub finished: u64,
    /// Decisions.
    pub decisions: u64,
    /// Expressions (counted only for tables).
    pub expressions: u64,
    /// Markers (counted only for tables).
    pub markers: u64,
    /// Values of samples (counted only for tables).
    pub samples: u64,
    /// Games excluded by the filter.
    pub filtered: u64,
    /// Damaged records and files of samples, and duplicate games.
    pub skipped: Vec<Skipped>,
    /// Number of what is damaged among them.
    pub damaged: u64,
    /// The files except the list of checksums.
    pub files: Vec<FileSummary>,
    /// Games by origin.
    pub(super) origins: BTreeMap<&'static str, u64>,
    /// Seats by kind of player.
    pub(super) kinds: BTreeMap<&'static str, u64>,
    /// Versions of the servers that hosted the games.
    pub(super) servers: BTreeSet<String>,
    /// Versions of the rules.
    pub(super) rules_versions: BTreeSet<u32>,
}

impl Filter {
    /// Whether a game meets all conditions.
    pub(super) fn includes(&self, game: &GameInfo) -> bool {
        (game.finished || !self.finished_only)
            && self
                .room_name
                .as_ref()
                .is_none_or(|name| *name == game.room_name)
            && self
                .player_kind
                .as_ref()
                .is_none_or(|kind| game.seats.iter().any(|seat| seat.kind == kind))
    }
}
