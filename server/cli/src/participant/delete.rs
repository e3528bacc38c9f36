//! `chefshat participant delete`: deletes a participant's data, in a data directory or on a running
//! server. Running it again completes an interrupted run.

use std::io::{self, BufRead as _, IsTerminal as _, Write as _};
use std::process::ExitCode;

use chefshat_proto::v1;
use chefshat_record::pseudonym::Named;
use chefshat_server::participants::Skipped;
use chefshat_server::store::SqliteStore;
use clap::Args;
use serde_json::json;

use super::super::admin::{refused, service};
use super::super::numbers::counted;
use super::super::{CommandError, say};
use super::who::{Who, check};
use crate::connect::ServerArg;
use crate::error::tell;

const HELP: &str = "\
Without --fingerprint, all who played under the name become one participant. The name gives way to a pseudonym, \"deleted participant\" and six letters and digits, in the database and in records/*.jsonl, markers included; expressions of the \
participant, annotations of its decisions (times measured at its side among them) and samples of its seats are dropped. What was played stays, so that the \
games of the others can still be replayed and checked; a record that changes loses its signature. In every study that has a participant of this name, it withdraws, \
and its answers, traces and games are deleted; `chefshat study delete-participant` does so in one study. Copies elsewhere (datasets, backups, other servers) are not \
touched, nor is what others wrote in theirs. While a game or tournament with the name is not over, nothing is changed.

Name a running server with --server. Without it, the server must be stopped.

This cannot be undone. `chefshat participant export` first, if the data are still wanted.

Examples:
  chefshat participant delete P07 --server http://127.0.0.1:50051
  chefshat participant delete P07 --data-dir ./chefshat-data
  chefshat participant delete \"Rosa L.\" --fingerprint none --yes --json";

/// Delete a participant's data: a pseudonym replaces the name.
#[derive(Debug, Args)]
#[command(after_help = HELP)]
pub(super) struct Delete {
    #[command(flatten)]
    who: Who,
    /// Do not ask for confirmation.
    #[arg(long)]
    yes: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

impl Delete {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        let name = &self.who.name;
        let (deleted, skipped) = match self.who.server() {
            Some(server) => {
                self.ask()?;
                on_server(&server, self.who.named()).await?
            }
            None => self.in_folder().await?,
        };
        let found = deleted.games + deleted.tournaments + deleted.studies > 0;
        if self.json {
            say(json!({
                "pseudonym": deleted.pseudonym,
                "games": deleted.games,
                "tournaments": deleted.tournaments,
                "studies": deleted.studies,
                "files": deleted.record_files,
                "expressions": deleted.expressions,
                "annotations": deleted.annotations,
            }))?;
        } else if found {
            say(format_args!(
                "{name:?} is now {:?} in {}, {} and {}; dropped: {}, {}",
                deleted.pseudonym,
                counted(deleted.games, "game"),
                counted(deleted.tournaments, "tournament"),
                counted(deleted.record_files, "record file"),
                counted(deleted.expressions, "expression"),
                counted(deleted.annotations, "annotation"),
            ))?;
            if deleted.studies > 0 {
                let studies = counted(deleted.studies, "study");
                say(format_args!("its data in {studies} are deleted"))?;
            }
        }
        check(&skipped, name)?;
        if !found && !self.json {
            tell(format_args!("nothing is stored about {name:?}"));
        }
        Ok(if found {
            ExitCode::SUCCESS
        } else {
            ExitCode::FAILURE
        })
    }

    /// Deletes from a data directory. Returns what a server would, and which files were left.
    async fn in_folder(&self) -> Result<(v1::DeleteParticipantResponse, Skipped), CommandError> {
        let deleting = self.who.with_data(async |data| {
            self.ask()?;
            Ok(data.delete(&self.who.named()).await?)
        });
        let deleted = deleting.await?;
        SqliteStore::purge(&self.who.data_dir()?).await?;
        let skipped = deleted.skipped.clone();
        Ok((deleted.into(), skipped))
    }

    /// Asks for confirmation.
    fn ask(&self) -> Result<(), CommandError> {
        if self.yes {
            return Ok(());
        }
        if !io::stdin().is_terminal() {
            return Err("nothing was changed: confirm with --yes".into());
        }
        let name = &self.who.name;
        let mut out = anstream::stderr();
        write!(
            out,
            "This removes {name:?} from all data here and cannot be undone. Type the name to confirm: "
        )?;
        out.flush()?;
        let mut answer = String::new();
        io::stdin().lock().read_line(&mut answer)?;
        if answer.trim_end_matches(['\r', '\n']) == name {
            Ok(())
        } else {
            Err("nothing was changed".into())
        }
    }
}

async fn on_server(
    server: &ServerArg,
    who: Named,
) -> Result<(v1::DeleteParticipantResponse, Skipped), CommandError> {
    let request = v1::DeleteParticipantRequest {
        name: who.name,
        name_fingerprint: who.fingerprint,
    };
    let deleted = service(server).await?.delete_participant(request).await;
    let mut deleted = deleted.map_err(refused)?.into_inner();
    let skipped = Skipped {
        named: std::mem::take(&mut deleted.unchanged_files),
        ..Skipped::default()
    };
    Ok((deleted, skipped))
}
