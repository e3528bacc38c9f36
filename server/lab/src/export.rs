//! `chefshat export`: exports records as a dataset. `chefshat-dataset` decides its contents.

use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_dataset::{Export as Exporter, Exported, Filter, Format, Layout, Skipped};
use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use chefshat_cli::data_dir::RecordsArg;
use chefshat_cli::error::{CommandError, after_printing, tell};
use chefshat_cli::numbers::counted;
use chefshat_cli::progress;

const HELP: &str = "\
The directory contains the tables `decisions`, `expressions`, `markers` and `samples` in every requested format, a dataset card (README.md) and SHA256SUMS. \
It is written atomically. Every record is replayed first. A damaged one is left out and named, and so is what cannot be read of the samples beside it.

Exit code 0: all records are in the dataset with their samples, or excluded by a filter. 1: some are damaged (0 with --skip-damaged), or nothing was written.

Examples:
  chefshat export --out dataset
  chefshat export records/ --out dataset --format parquet,csv --finished-only
  chefshat export game.jsonl --out dataset --layout chefshatgym";

/// Names of the kinds of players in the tables.
const KINDS: [&str; 5] = ["agent", "human", "robot", "model", "built_in"];

/// Export records as a dataset: Parquet, CSV or JSON Lines, with a dataset card.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Export {
    #[command(flatten)]
    records: RecordsArg,
    /// Directory to create; it must not exist or be empty.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace an earlier dataset in that directory. A directory with other files is never changed.
    #[arg(long)]
    force: bool,
    /// Layout: two tables over all games, or the columns of the package chefshatgym, one CSV file
    /// per game.
    #[arg(long, value_enum, default_value_t)]
    layout: LayoutName,
    /// Formats of the tables, separated by commas. Default: parquet.
    #[arg(long = "format", value_name = "LIST", value_delimiter = ',', value_parser = formats())]
    formats: Vec<Format>,
    /// Skip aborted games.
    #[arg(long)]
    finished_only: bool,
    /// Only games of rooms with this name.
    #[arg(long, value_name = "NAME")]
    room: Option<String>,
    /// Only games with at least one player of this kind.
    #[arg(long, value_name = "KIND", value_parser = PossibleValuesParser::new(KINDS))]
    with: Option<String>,
    /// End with exit code 0 although damaged records or samples were left out.
    #[arg(long)]
    skip_damaged: bool,
    /// Licence of the dataset, for its card.
    #[arg(long, value_name = "SPDX", default_value = "CC-BY-4.0")]
    licence: String,
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
        let found = self.records.find()?;
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
            licence: self.licence.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let bytes = found.files.iter().map(|record| record.bytes).sum();
        let bar = progress::of_record_bytes(bytes);
        let result = exporter.run(&found.files, |bytes| bar.inc(bytes));
        bar.finish_and_clear();
        let mut exported = result?;
        exported.damaged += found.missing.len() as u64;
        exported
            .skipped
            .extend(found.missing.into_iter().map(|missing| Skipped {
                path: missing.path,
                problem: missing.problem.to_string(),
            }));
        let mut out = anstream::stdout().lock();
        let printed = match self.json {
            true => writeln!(out, "{}", self.json_report(&exported)),
            false => self.write_report(&mut out, &exported),
        };
        let mut code = ExitCode::SUCCESS;
        if exported.damaged > 0 && !self.skip_damaged {
            let damaged = counted(exported.damaged, "damaged file");
            tell(format_args!(
                "{damaged} left out in whole or part; with --skip-damaged this is no failure"
            ));
            code = ExitCode::FAILURE;
        }
        after_printing(printed, code)
    }

    /// The formats without duplicates.
    fn wanted_formats(&self) -> Result<Vec<Format>, CommandError> {
        let mut formats = self.formats.clone();
        formats.sort();
        formats.dedup();
        match self.layout {
            LayoutName::ChefsHatGym if formats.iter().any(|format| *format != Format::Csv) => {
                Err("--layout chefshatgym is always CSV: leave out --format".into())
            }
            LayoutName::Tables if formats.is_empty() => Ok(vec![Format::Parquet]),
            _ => Ok(formats),
        }
    }

    /// The report for people.
    fn write_report(&self, out: &mut impl Write, exported: &Exported) -> std::io::Result<()> {
        for record in &exported.skipped {
            tell(format_args!(
                "skipped: {}: {}",
                record.path.display(),
                record.problem
            ));
        }
        if exported.filtered > 0 {
            tell(format_args!(
                "excluded by the filter: {}",
                counted(exported.filtered, "game")
            ));
        }
        writeln!(
            out,
            "{}: {}, {}, {}",
            self.out.display(),
            counted(exported.games, "game"),
            counted(exported.decisions, "decision"),
            counted(exported.expressions, "expression")
        )?;
        // A layout with one file per game may have thousands.
        if self.layout == LayoutName::Tables {
            for file in &exported.files {
                writeln!(out, "  {:<20} {:>12} bytes", file.path, file.bytes)?;
            }
        }
        Ok(())
    }

    fn json_report(&self, exported: &Exported) -> Value {
        let left_out: Vec<Value> = exported
            .skipped
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
            "markers": exported.markers,
            "samples": exported.samples,
            "filtered": exported.filtered,
            "left_out": left_out,
            "files": files,
        })
    }
}
