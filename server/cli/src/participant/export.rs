//! `chefshat participant export`: writes a participant's data as JSON Lines.

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_proto::v1;
use chefshat_record::atomic_file::AtomicFile;
use chefshat_record::pseudonym::Named;
use chefshat_server::participants::Skipped;
use clap::Args;
use serde_json::{Value, json};
use tokio::sync::mpsc;

use super::super::admin::{refused, service};
use super::super::numbers::counted;
use super::super::{CommandError, say};
use super::who::{Who, check};
use crate::connect::ServerArg;

const HELP: &str = "\
The first line says whose data these are. Then, for each game that is over: a line `game` (when, the room, its rules, the seat, the \
place), a line `decision` for each of the participant's decisions with its times and annotations, a line `expression` for each of its \
expressions. Then a line `tournament` for each tournament it joined, and for each study with a participant of this name a line `study`, with lines `answer` and \
`trace`. docs/playing.md describes the fields. Name a running server with --server; without it, the server must be stopped.

Examples:
  chefshat participant export P07 --out p07.jsonl --server http://127.0.0.1:50051
  chefshat participant export P07 --out p07.jsonl --data-dir ./chefshat-data
  chefshat participant export \"Rosa L.\" --fingerprint eff42f032b0bc531 --out rosa.jsonl --json";

/// Export everything stored about a participant as JSON Lines.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Export {
    #[command(flatten)]
    who: Who,
    /// File to write; it is written atomically.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    force: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// The file and the counts of its lines.
struct Sheet {
    file: AtomicFile,
    games: u64,
    tournaments: u64,
    studies: u64,
    decisions: u64,
    expressions: u64,
}

impl Sheet {
    fn add(&mut self, line: &str) -> Result<(), CommandError> {
        self.file.write_all(line.as_bytes())?;
        self.file.write_all(b"\n")?;
        let line: Value = serde_json::from_str(line)?;
        for (kind, count) in [
            ("game", &mut self.games),
            ("tournament", &mut self.tournaments),
            ("study", &mut self.studies),
            ("decision", &mut self.decisions),
            ("expression", &mut self.expressions),
        ] {
            *count += u64::from(line.get(kind).is_some());
        }
        Ok(())
    }

    fn has_any(&self) -> bool {
        self.games + self.tournaments + self.studies > 0
    }
}

impl Export {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        if self.out.exists() && !self.force {
            let out = self.out.display();
            return Err(format!("{out} exists already; --force replaces it").into());
        }
        let name = &self.who.name;
        let mut sheet = Sheet {
            file: AtomicFile::create(&self.out)?,
            games: 0,
            tournaments: 0,
            studies: 0,
            decisions: 0,
            expressions: 0,
        };
        let skipped = match self.who.server() {
            Some(server) => from_server(&server, self.who.named(), &mut sheet).await?,
            None => from_folder(&self.who, &mut sheet).await?,
        };
        if !sheet.has_any() {
            check(&skipped, name)?;
            return Err(format!(
                "nothing is stored about {name:?} in {}: give the exact name the participant played under",
                self.who.place()?
            )
            .into());
        }
        sheet.file.finish()?;
        if self.json {
            say(json!({
                "out": self.out.display().to_string(),
                "games": sheet.games,
                "tournaments": sheet.tournaments,
                "studies": sheet.studies,
                "decisions": sheet.decisions,
                "expressions": sheet.expressions,
            }))?;
        } else {
            say(format_args!(
                "{}: {}, {}, {}, {}, {}",
                self.out.display(),
                counted(sheet.games, "game"),
                counted(sheet.decisions, "decision"),
                counted(sheet.expressions, "expression"),
                counted(sheet.tournaments, "tournament"),
                counted(sheet.studies, "study"),
            ))?;
        }
        check(&skipped, name)?;
        Ok(ExitCode::SUCCESS)
    }
}

/// Lines that wait to be written.
const LINES: usize = 64;

async fn from_folder(who: &Who, sheet: &mut Sheet) -> Result<Skipped, CommandError> {
    who.with_data(async |data| {
        let (sender, mut lines) = mpsc::channel(LINES);
        let exporting = async {
            let exported = data.export(&who.named(), &sender).await;
            drop(sender);
            exported
        };
        let sheet = &mut *sheet;
        // The lines are dropped when writing fails, so that nothing more is gathered.
        let writing = async move {
            while let Some(line) = lines.recv().await {
                sheet.add(&line)?;
            }
            Ok::<_, CommandError>(())
        };
        let (exported, written) = tokio::join!(exporting, writing);
        written?;
        Ok(exported?)
    })
    .await
}

async fn from_server(
    server: &ServerArg,
    who: Named,
    sheet: &mut Sheet,
) -> Result<Skipped, CommandError> {
    let request = v1::ExportParticipantRequest {
        name: who.name,
        name_fingerprint: who.fingerprint,
    };
    let exported = service(server).await?.export_participant(request).await;
    let mut responses = exported.map_err(refused)?.into_inner();
    let mut skipped = Skipped::default();
    while let Some(mut response) = responses.message().await.map_err(refused)? {
        if !response.line.is_empty() {
            sheet.add(&response.line)?;
        }
        skipped.named.append(&mut response.unread_files);
    }
    Ok(skipped)
}
