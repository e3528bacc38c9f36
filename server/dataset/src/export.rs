//! Exporting: records are read one after the other, replayed, filtered and written, so that memory holds one game at a time; at the end the
//! dataset card and the checksums, and the folder is put in its place. Nothing is put there if something fails.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::card;
use super::chefshatgym::lay_out;
use super::decisions::{self, DecisionRow};
use super::expressions::{self, ExpressionRow};
use super::files::{FileSummary, SummedFile};
use super::folder::{FolderError, NewFolder};
use super::formats::{Format, Table};
use super::game::{GameInfo, checked_info};
use super::gather::{GameRows, gather};
use super::sheet::{self, Sheet};
use chefshat_record::files::RecordFile;
use chefshat_record::jsonl;
use chefshat_record::jsonl::RecordFileError;

/// Name of the table of decisions.
pub(super) const DECISIONS: &str = "decisions";
/// Name of the table of expressions.
pub(super) const EXPRESSIONS: &str = "expressions";

/// Damaged records that an error names.
const NAMED_DAMAGES: usize = 10;

/// How a dataset is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// Two tables over all games.
    Tables,
    /// A CSV file for each game, in the columns of the reference implementation.
    ChefsHatGym,
}

/// Which games are wanted: all conditions must hold.
#[derive(Debug, Clone, Default)]
pub struct Filter {
    /// Games that were played to their end alone.
    pub finished_only: bool,
    /// Games of rooms of this name alone.
    pub room_name: Option<String>,
    /// Games with at least one player of this kind alone: `agent`, `human`, `robot` or `built_in`.
    pub player_kind: Option<String>,
}

/// What is to be exported, and how.
#[derive(Debug, Clone)]
pub struct Export {
    /// The folder to make.
    pub out: PathBuf,
    /// Whether an earlier dataset there may be replaced.
    pub replace: bool,
    /// The layout.
    pub layout: Layout,
    /// The formats of the tables; the other layout is CSV whatever stands here.
    pub formats: Vec<Format>,
    /// Which games are wanted.
    pub filter: Filter,
    /// Whether records that do not replay are left out instead of failing the export.
    pub skip_damaged: bool,
    /// Licence of the dataset, as an SPDX identifier.
    pub licence: String,
    /// Version of the program that exports, for the card.
    pub version: String,
}

/// A record that was left out, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: String,
}

/// What an export came to.
#[derive(Debug, Clone, Default)]
pub struct Exported {
    /// Games.
    pub games: u64,
    /// Games among them that were played to their end.
    pub finished: u64,
    /// Decisions in them.
    pub decisions: u64,
    /// Expressions in them (counted for the tables alone).
    pub expressions: u64,
    /// Games that the filter did not let through.
    pub filtered: u64,
    /// Damaged records and repeated games.
    pub left_out: Vec<LeftOut>,
    /// The files, but for the list of checksums.
    pub files: Vec<FileSummary>,
    /// Games by where they came from.
    pub(super) origins: BTreeMap<&'static str, u64>,
    /// Seats by the kind of their player.
    pub(super) kinds: BTreeMap<&'static str, u64>,
    /// Versions of the servers that hosted the games.
    pub(super) servers: BTreeSet<String>,
    /// Versions of the rules.
    pub(super) rules_versions: BTreeSet<u32>,
}

/// Why nothing was exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The filter let no game through, or all were left out.
    #[error("of {records} records none is left to export")]
    NothingLeft {
        /// Records looked at.
        records: usize,
    },
    /// Records do not replay.
    #[error("{}", damages(.named, *.more))]
    Damaged {
        /// The first of them.
        named: Vec<LeftOut>,
        /// How many more there are.
        more: u64,
    },
    /// The folder cannot be made.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file of the dataset cannot be written.
    #[error("the dataset cannot be written to {path}: {source}")]
    Write {
        /// The folder in the making.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

fn damages(named: &[LeftOut], more: u64) -> String {
    let mut text = String::from("nothing was exported, because records are damaged:\n");
    for LeftOut { path, problem } in named {
        text.push_str(&format!("  {}: {problem}\n", path.display()));
    }
    if more > 0 {
        text.push_str(&format!("  and {more} more\n"));
    }
    text + "leave them out with --skip-damaged"
}

impl Export {
    /// Exports the records, in their order. `progress` is told the size of each file that is done.
    ///
    /// # Errors
    /// Whatever stands in the way; the folder is then as it was.
    pub fn run(
        &self,
        records: &[RecordFile],
        mut progress: impl FnMut(u64),
    ) -> Result<Exported, ExportError> {
        let folder = NewFolder::begin(&self.out, self.replace)?;
        let write = |source| ExportError::Write {
            path: folder.path().to_path_buf(),
            source,
        };
        let mut sink = Sink::new(folder.path(), self).map_err(write)?;
        let mut exported = Exported::default();
        let mut games: HashMap<String, PathBuf> = HashMap::new();
        let mut damaged = 0;
        for RecordFile { path, bytes } in records {
            let left_out = match self.read(path) {
                Err(problem) => {
                    damaged += 1;
                    Some(problem)
                }
                // Nothing will come of it: only the damages are still looked for.
                Ok(_) if damaged > 0 && !self.skip_damaged => None,
                Ok(game) if !self.filter.lets_through(game.info()) => {
                    exported.filtered += 1;
                    None
                }
                Ok(game) => match games.get(&game.info().game_id) {
                    Some(first) => Some(format!("the same game as {}", first.display())),
                    None => {
                        games.insert(game.info().game_id.clone(), path.clone());
                        sink.add(&game).map_err(write)?;
                        exported.count(&game);
                        None
                    }
                },
            };
            exported.left_out.extend(left_out.map(|problem| LeftOut {
                path: path.clone(),
                problem,
            }));
            progress(*bytes);
        }
        if damaged > 0 && !self.skip_damaged {
            return Err(damaged_error(exported.left_out));
        }
        if exported.games == 0 {
            return Err(ExportError::NothingLeft {
                records: records.len(),
            });
        }
        exported.files = sink.finish().map_err(write)?;
        let card = card::write(self, &exported);
        let mut file = SummedFile::create(folder.path(), card::FILE_NAME).map_err(write)?;
        file.write_all(card.as_bytes()).map_err(write)?;
        exported.files.push(file.finish().map_err(write)?);
        folder.put_in_place(&exported.files)?;
        Ok(exported)
    }

    /// Reads and replays a record.
    fn read(&self, path: &Path) -> Result<Game, String> {
        let lines = jsonl::read(path).map_err(|error| match error {
            // The path is told by whoever tells the problem.
            RecordFileError::Io { source, .. } => source.to_string(),
            RecordFileError::Line { line, problem, .. } => format!("line {line} {problem}"),
        })?;
        let game = match self.layout {
            Layout::Tables => gather(&lines).map(Game::Rows),
            Layout::ChefsHatGym => checked_info(&lines).and_then(|info| {
                let sheet = lay_out(&lines, &info)?;
                Ok(Game::Sheet(info, sheet))
            }),
        };
        game.map_err(|error| error.to_string())
    }
}

fn damaged_error(mut damaged: Vec<LeftOut>) -> ExportError {
    let more = damaged.len().saturating_sub(NAMED_DAMAGES) as u64;
    damaged.truncate(NAMED_DAMAGES);
    ExportError::Damaged {
        named: damaged,
        more,
    }
}

impl Filter {
    fn lets_through(&self, game: &GameInfo) -> bool {
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

impl Exported {
    fn count(&mut self, game: &Game) {
        let info = game.info();
        self.games += 1;
        self.finished += u64::from(info.finished);
        match game {
            Game::Rows(rows) => {
                self.decisions += rows.decisions.len() as u64;
                self.expressions += rows.expressions.len() as u64;
            }
            Game::Sheet(_, sheet) => self.decisions += sheet.decisions,
        }
        *self.origins.entry(info.origin).or_default() += 1;
        for seat in &info.seats {
            *self.kinds.entry(seat.kind).or_default() += 1;
        }
        self.servers.insert(info.server_version.clone());
        self.rules_versions.insert(info.rules_version);
    }
}

/// A game, ready to be written.
enum Game {
    Rows(GameRows),
    Sheet(GameInfo, Sheet),
}

impl Game {
    fn info(&self) -> &GameInfo {
        match self {
            Game::Rows(rows) => &rows.game,
            Game::Sheet(info, _) => info,
        }
    }
}

/// Where games are written.
enum Sink<'a> {
    Tables {
        decisions: Table<DecisionRow>,
        expressions: Table<ExpressionRow>,
    },
    Sheets {
        folder: &'a Path,
        files: Vec<FileSummary>,
    },
}

impl<'a> Sink<'a> {
    fn new(folder: &'a Path, export: &Export) -> io::Result<Self> {
        Ok(match export.layout {
            Layout::Tables => Sink::Tables {
                decisions: Table::create(folder, DECISIONS, decisions::COLUMNS, &export.formats)?,
                expressions: Table::create(
                    folder,
                    EXPRESSIONS,
                    expressions::COLUMNS,
                    &export.formats,
                )?,
            },
            Layout::ChefsHatGym => Sink::Sheets {
                folder,
                files: Vec::new(),
            },
        })
    }

    fn add(&mut self, game: &Game) -> io::Result<()> {
        match (self, game) {
            (
                Sink::Tables {
                    decisions,
                    expressions,
                },
                Game::Rows(rows),
            ) => {
                decisions.write(&rows.decisions)?;
                expressions.write(&rows.expressions)
            }
            (Sink::Sheets { folder, files }, Game::Sheet(info, sheet)) => {
                let path = format!("{}/{}", info.game_id, sheet::FILE_NAME);
                files.push(sheet.write(SummedFile::create(folder, &path)?)?);
                Ok(())
            }
            _ => unreachable!("games are read for the layout that they are written in"),
        }
    }

    fn finish(self) -> io::Result<Vec<FileSummary>> {
        match self {
            Sink::Tables {
                decisions,
                expressions,
            } => {
                let mut files = decisions.finish()?;
                files.extend(expressions.finish()?);
                Ok(files)
            }
            Sink::Sheets { files, .. } => Ok(files),
        }
    }
}
