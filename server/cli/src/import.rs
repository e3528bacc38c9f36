//! `chefshat import`: adds the record of another server, or the transcript of a game at a physical
//! table, to the records of a data directory. `chefshat-record` reads and verifies them.

use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::import;
use chefshat_record::import::MAX_TRANSCRIPT_BYTES;
use chefshat_record::jsonl;
use chefshat_record::replay::{Replayed, replay};
use chefshat_record::signature::{self, Signed};
use clap::Args;
use serde_json::json;

use super::{CommandError, data_dir, verify};

const HELP: &str = "\
A FILE that ends in .jsonl is a record, perhaps of another server: it is verified and copied. Any other FILE is a transcript: a CSV file \
with the notes of a game played with real cards. It becomes a record; hands that are not in the notes stay unknown unless they follow \
from the plays. docs/records.md describes both formats.

Exit code 0: the record was added. 1: a line is invalid (it is reported), or the record exists already.

Examples:
  chefshat import table-3.csv
  chefshat import table-3.csv --out ./records
  chefshat import 5f0c6a4de2b14b7f8a3d9c1e7b60425d.jsonl --data-dir ./chefshat-data";

/// Import a record from elsewhere, including games at a physical table.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Import {
    /// A record (.jsonl) or a transcript (.csv).
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Where to write the record: a file that ends in .jsonl, or a directory. Default: the records
    /// of the data directory.
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
    /// Data directory to write to (records/GAME-ID.jsonl) if --out is not given. Default: chefshat
    /// in the user's data directory.
    #[arg(long, env = "CHEFSHAT_DATA_DIR")]
    data_dir: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Import {
    pub(super) fn run(self) -> Result<ExitCode, CommandError> {
        let (lines, replayed) = self.read()?;
        let header = match lines.first().and_then(|line| line.line.as_ref()) {
            Some(Line::Header(header)) => header,
            _ => unreachable!("a record that replays begins with its header"),
        };
        let path = self.path_for(&header.game_id)?;
        if path.exists() {
            return Err(format!(
                "{}: game {} exists already; nothing was changed",
                path.display(),
                header.game_id
            )
            .into());
        }
        // Only the text of the file shows what an older version signed, if anything does.
        let copies = matches!(signature::check(&lines, None), Ok(Signed::Uncheckable(_)));
        match (self.out.is_some(), copies) {
            (true, true) => jsonl::copy(&self.file, &path)?,
            (true, false) => jsonl::write(&path, &lines)?,
            (false, true) => jsonl::copy_private(&self.file, &path)?,
            (false, false) => jsonl::write_private(&path, jsonl::all_of(&lines))?,
        }
        self.print(&path, header, &replayed)?;
        Ok(ExitCode::SUCCESS)
    }

    /// Reads and verifies the record or transcript.
    fn read(&self) -> Result<(Vec<v1::RecordLine>, Replayed), CommandError> {
        let name = self.file.display();
        let lines = if self
            .file
            .extension()
            .is_some_and(|extension| extension == "jsonl")
        {
            jsonl::read(&self.file)?
        } else {
            let most = u64::try_from(MAX_TRANSCRIPT_BYTES).unwrap_or(u64::MAX);
            let mut text = Vec::new();
            File::open(&self.file)
                .and_then(|file| file.take(most.saturating_add(1)).read_to_end(&mut text))
                .map_err(|error| format!("{name}: {error}"))?;
            import::import(&text).map_err(|error| format!("{name}: {error}"))?
        };
        let replayed = replay(&lines).map_err(|error| format!("{name}: {error}"))?;
        Ok((lines, replayed))
    }

    fn path_for(&self, game_id: &str) -> Result<PathBuf, CommandError> {
        Ok(match &self.out {
            None => jsonl::path_of(&data_dir::prepare(self.data_dir.clone())?, game_id),
            Some(file)
                if file
                    .extension()
                    .is_some_and(|extension| extension == "jsonl") =>
            {
                file.clone()
            }
            Some(folder) => folder.join(format!("{game_id}.jsonl")),
        })
    }

    fn print(
        &self,
        path: &Path,
        header: &v1::RecordHeader,
        replayed: &Replayed,
    ) -> Result<(), CommandError> {
        let mut out = anstream::stdout().lock();
        if self.json {
            let report = json!({
                "file": path,
                "game_id": header.game_id,
                "origin": header.origin().as_str_name(),
                "state": verify::ending(replayed),
                "decisions": replayed.decisions,
                "events": replayed.events,
            });
            writeln!(out, "{report}")?;
        } else {
            writeln!(
                out,
                "{}: {}, {} decisions, {} events, {}",
                path.display(),
                verify::ending(replayed),
                replayed.decisions,
                replayed.events,
                verify::deals(header)
            )?;
        }
        Ok(())
    }
}
