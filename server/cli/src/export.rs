//! `chefshat export`: records as a dataset. What is in it and how it is written is decided in `chefshat-records`.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_dataset::{Export as Exporter, Exported, Filter, Format, Layout};
use chefshat_record::files::find_records;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use super::numbers::counted;
use super::{CommandError, data_dir};

const HELP: &str = "\
The folder gets the tables `decisions` and `expressions` in every format asked for, a dataset card (README.md) and SHA256SUMS. It \
appears whole or not at all. Every record is replayed first; one that is damaged fails the export unless it is to be skipped.

Examples:
  chefshat export --out dataset
  chefshat export records/ --out dataset --format parquet,csv --finished-only
  chefshat export game.jsonl --out dataset --layout chefshatgym";

/// Kinds of players, as the tables spell them.
const KINDS: [&str; 4] = ["agent", "human", "robot", "built_in"];

/// Make a dataset of records: Parquet, CSV or JSON Lines, with a dataset card.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Export {
    /// Records (GAME-ID.jsonl) or folders of them. Standard: the records in the data folder.
    #[arg(value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// The folder to make; it must not exist, or be empty.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace an earlier dataset in that folder; a folder with anything else in it is left as it is.
    #[arg(long)]
    force: bool,
    /// What to write: two tables over all games, or the columns of the package chefshatgym, a CSV file for each game.
    #[arg(long, value_enum, default_value_t)]
    layout: LayoutName,
    /// The formats of the tables, separated by commas. Standard: parquet.
    #[arg(long = "format", value_name = "LIST", value_delimiter = ',', value_parser = formats())]
    formats: Vec<Format>,
    /// Leave out games that were aborted.
    #[arg(long)]
    finished_only: bool,
    /// Only games of rooms of this name.
    #[arg(long, value_name = "NAME")]
    room: Option<String>,
    /// Only games with at least one player of this kind.
    #[arg(long, value_name = "KIND", value_parser = PossibleValuesParser::new(KINDS))]
    with: Option<String>,
    /// Leave out damaged records, and say which.
    #[arg(long)]
    skip_damaged: bool,
    /// Licence of the dataset, for its card.
    #[arg(long, value_name = "SPDX", default_value = "CC-BY-4.0")]
    licence: String,
    /// Folder in which the server keeps its records, if no PATH is given. Standard: chefshat in the user's data folder.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
enum LayoutName {
    #[default]
    Tables,
    #[value(name = "chefshatgym")]
    ChefsHatGym,
}

fn formats() -> impl TypedValueParser<Value = Format> {
    PossibleValuesParser::new(Format::ALL.map(Format::name))
        .map(|name| Format::from_name(&name).expect("the possible values are the names"))
}

impl Export {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let formats = self.wanted_formats()?;
        let paths = if self.paths.is_empty() {
            vec![data_dir::records(self.data_dir.clone())?]
        } else {
            self.paths.clone()
        };
        let records = find_records(&paths)?;
        let exporter = Exporter {
            out: self.out.clone(),
            replace: self.force,
            layout: match self.layout {
                LayoutName::Tables => Layout::Tables,
                LayoutName::ChefsHatGym => Layout::ChefsHatGym,
            },
            formats,
            filter: Filter {
                finished_only: self.finished_only,
                room_name: self.room.clone(),
                player_kind: self.with.clone(),
            },
            skip_damaged: self.skip_damaged,
            licence: self.licence.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let bytes = records.iter().map(|record| record.bytes).sum();
        let bar = ProgressBar::new(bytes).with_style(ProgressStyle::with_template(
            "{bar:40} {bytes} of {total_bytes} of records, {eta} left",
        )?);
        let result = exporter.run(&records, |bytes| bar.inc(bytes));
        bar.finish_and_clear();
        let exported = result?;
        let mut out = anstream::stdout().lock();
        if self.json {
            writeln!(out, "{}", self.json_report(&exported))?;
        } else {
            self.write_report(&mut out, &exported)?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// The formats, each once.
    fn wanted_formats(&self) -> Result<Vec<Format>, CommandError> {
        let mut formats = self.formats.clone();
        formats.sort();
        formats.dedup();
        match self.layout {
            LayoutName::ChefsHatGym if formats.iter().any(|format| *format != Format::Csv) => {
                Err("--layout chefshatgym is written as CSV alone: leave --format out".into())
            }
            LayoutName::Tables if formats.is_empty() => Ok(vec![Format::Parquet]),
            _ => Ok(formats),
        }
    }

    /// For people.
    fn write_report(&self, out: &mut impl Write, exported: &Exported) -> std::io::Result<()> {
        for left_out in &exported.left_out {
            anstream::eprintln!(
                "left out: {}: {}",
                left_out.path.display(),
                left_out.problem
            );
        }
        if exported.filtered > 0 {
            anstream::eprintln!(
                "left out by the filter: {}",
                counted(exported.filtered, "game")
            );
        }
        writeln!(
            out,
            "{}: {}, {}, {}",
            self.out.display(),
            counted(exported.games, "game"),
            counted(exported.decisions, "decision"),
            counted(exported.expressions, "expression")
        )?;
        // A layout of a file for each game may have thousands of them.
        if self.layout == LayoutName::Tables {
            for file in &exported.files {
                writeln!(out, "  {:<20} {:>12} bytes", file.path, file.bytes)?;
            }
        }
        Ok(())
    }

    fn json_report(&self, exported: &Exported) -> Value {
        let left_out: Vec<Value> = exported
            .left_out
            .iter()
            .map(|record| json!({ "path": record.path.display().to_string(), "problem": record.problem }))
            .collect();
        let files: Vec<Value> = exported
            .files
            .iter()
            .map(|file| json!({ "path": file.path, "bytes": file.bytes, "sha256": file.sha256 }))
            .collect();
        json!({
            "out": self.out.display().to_string(),
            "games": exported.games,
            "finished": exported.finished,
            "decisions": exported.decisions,
            "expressions": exported.expressions,
            "filtered": exported.filtered,
            "left_out": left_out,
            "files": files,
        })
    }
}
