//! Runs an export: reads, verifies, filters and writes one game at a time, then writes the card
//! and checksums and moves the folder into place. A failure leaves the target unchanged.

use std::collections::HashMap;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use super::card;
use super::chefshatgym::lay_out;
use super::decisions::{self, DecisionRow};
use super::export::{Export, Exported, Layout, Skipped};
use super::expressions::{self, ExpressionRow};
use super::files::{FileSummary, SummedFile};
use super::folder::{FolderError, NewFolder};
use super::formats::Table;
use super::game::{GameInfo, checked_info};
use super::gather::{GameRows, gather};
use super::markers::{self, MarkerRow};
use super::samples::{self, SampleRow};
use super::sheet::{self, Sheet};
use chefshat_record::files::RecordFile;
use chefshat_record::jsonl;
use chefshat_record::jsonl::RecordFileError;

/// Bytes of the longest version of a server.
const MAX_VERSION_BYTES: usize = 40;

/// A failed export.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// All games were filtered or skipped.
    #[error("none of {records} records is left to export{}", damages(.damaged))]
    NothingLeft {
        /// The number of records read.
        records: usize,
        /// The first that was skipped, if any was.
        damaged: Option<Skipped>,
    },
    /// The target folder is unsuitable.
    #[error(transparent)]
    Folder(#[from] FolderError),
    /// A file cannot be written.
    #[error("the dataset cannot be written to {path}: {source}")]
    Write {
        /// The folder being written.
        path: PathBuf,
        /// The cause.
        source: io::Error,
    },
}

fn damages(first: &Option<Skipped>) -> String {
    match first {
        Some(Skipped { path, problem }) => format!("; skipped: {}: {problem}", path.display()),
        None => String::new(),
    }
}

impl Export {
    /// Exports the records in order. Calls `progress` with the size of each file read. A damaged record
    /// is left out and named.
    ///
    /// # Errors
    /// The first failure; the target is then unchanged.
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
        for RecordFile { path, bytes } in records {
            let skipped = match self.read(path) {
                Err(problem) => {
                    exported.damaged += 1;
                    Some(problem)
                }
                Ok(game) if !self.filter.includes(game.info()) => {
                    exported.filtered += 1;
                    None
                }
                Ok(game) => match games.get(&game.info().game_id) {
                    Some(first) => Some(format!("the same game as {}", first.display())),
                    None => {
                        games.insert(game.info().game_id.clone(), path.clone());
                        sink.add(&game).map_err(write)?;
                        let (values, damaged) = sink.add_samples(path, &game).map_err(write)?;
                        exported.samples += values;
                        exported.damaged += damaged.len() as u64;
                        exported.skipped.extend(damaged);
                        exported.count(&game);
                        None
                    }
                },
            };
            exported.skipped.extend(skipped.map(|problem| Skipped {
                path: path.clone(),
                problem,
            }));
            progress(*bytes);
        }
        if exported.games == 0 {
            return Err(ExportError::NothingLeft {
                records: records.len(),
                damaged: exported.skipped.into_iter().next(),
            });
        }
        exported.files = sink.finish().map_err(write)?;
        let card = card::write(self, &exported);
        let mut file = SummedFile::create(folder.path(), card::FILE_NAME).map_err(write)?;
        file.write_all(card.as_bytes()).map_err(write)?;
        exported.files.push(file.finish().map_err(write)?);
        folder.move_into_place(&exported.files)?;
        Ok(exported)
    }

    /// Reads and verifies a record.
    fn read(&self, path: &Path) -> Result<Game, String> {
        let record = jsonl::read_record(path).map_err(|error| match error {
            // The caller reports the path.
            RecordFileError::Io { source, .. } => source.to_string(),
            RecordFileError::Line { line, problem, .. } => format!("line {line} {problem}"),
        })?;
        let game = match self.layout {
            Layout::Tables => gather(&record).map(Game::Rows),
            Layout::ChefsHatGym => checked_info(&record.lines).and_then(|info| {
                let sheet = lay_out(&record, &info)?;
                Ok(Game::Sheet(Box::new(info), sheet))
            }),
        };
        game.map_err(|error| error.to_string())
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
                self.markers += rows.markers.len() as u64;
            }
            Game::Sheet(_, sheet) => self.decisions += sheet.decisions,
        }
        *self.origins.entry(info.origin).or_default() += 1;
        for seat in &info.seats {
            *self.kinds.entry(seat.kind).or_default() += 1;
        }
        self.servers
            .insert(version(&info.server_version).to_owned());
        self.rules_versions.insert(info.rules_version);
    }
}

/// The version of a server as the card shows it: nobody checks what a record says there.
fn version(stated: &str) -> &str {
    let fits = |byte: u8| byte.is_ascii_alphanumeric() || b".+-_".contains(&byte);
    match stated.len() <= MAX_VERSION_BYTES && stated.bytes().all(fits) {
        true => stated,
        false => "other",
    }
}

/// A game to write.
enum Game {
    Rows(GameRows),
    Sheet(Box<GameInfo>, Sheet),
}

impl Game {
    fn info(&self) -> &GameInfo {
        match self {
            Game::Rows(rows) => &rows.game,
            Game::Sheet(info, _) => info,
        }
    }
}

/// The output of an export.
enum Sink<'a> {
    Tables {
        decisions: Table<DecisionRow>,
        expressions: Table<ExpressionRow>,
        markers: Table<MarkerRow>,
        samples: Table<SampleRow>,
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
                decisions: Table::create(
                    folder,
                    decisions::TABLE,
                    decisions::COLUMNS,
                    &export.formats,
                )?,
                expressions: Table::create(
                    folder,
                    expressions::TABLE,
                    expressions::COLUMNS,
                    &export.formats,
                )?,
                markers: Table::create(folder, markers::TABLE, markers::COLUMNS, &export.formats)?,
                samples: Table::create(folder, samples::TABLE, samples::COLUMNS, &export.formats)?,
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
                    markers,
                    ..
                },
                Game::Rows(rows),
            ) => {
                decisions.write(&rows.decisions)?;
                expressions.write(&rows.expressions)?;
                markers.write(&rows.markers)
            }
            (Sink::Sheets { folder, files }, Game::Sheet(info, sheet)) => {
                let path = format!("{}/{}", info.game_id, sheet::FILE_NAME);
                files.push(sheet.write(SummedFile::create(folder, &path)?)?);
                Ok(())
            }
            _ => unreachable!("games are read for the layout of the export"),
        }
    }

    /// Adds the samples beside a record. Returns the number of values, and the files that cannot be
    /// read to their end.
    fn add_samples(&mut self, record: &Path, game: &Game) -> io::Result<(u64, Vec<Skipped>)> {
        let (Self::Tables { samples: table, .. }, Game::Rows(rows)) = (self, game) else {
            return Ok((0, Vec::new()));
        };
        let mut count = 0;
        let damaged = samples::of_game(record, &rows.game, |rows| {
            count += rows.len() as u64;
            table.write(rows)
        })?;
        Ok((count, damaged))
    }

    fn finish(self) -> io::Result<Vec<FileSummary>> {
        match self {
            Sink::Tables {
                decisions,
                expressions,
                markers,
                samples,
            } => {
                let mut files = decisions.finish()?;
                files.extend(expressions.finish()?);
                files.extend(markers.finish()?);
                files.extend(samples.finish()?);
                Ok(files)
            }
            Sink::Sheets { files, .. } => Ok(files),
        }
    }
}
