//! `chefshat study`: creates studies with people, adds participants, follows, exports, closes and
//! deletes them, and deletes the data of participants. The server assigns conditions and runs the
//! games.

mod connection;
mod file;
mod owner;
mod simulate;
mod trial;

use std::path::PathBuf;
use std::process::ExitCode;

use chefshat_client::repeated;
use chefshat_proto::v1;
use chefshat_room::ids::random_bytes;
use clap::{Args, Subcommand};
use serde_json::json;

use self::connection::service;
use super::connect::ServerArg;
use super::numbers::counted;
use super::secret_file::{SecretFile, write_all};
use super::{CommandError, say};

/// Run studies with people: conditions, participants, questionnaires, data.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
                  chefshat study simulate docs/studies/example.toml --measure points --effect strength=strong\n  \
                  chefshat study create docs/studies/example.toml --owner-file ./owner\n  \
                  chefshat study test STUDY-ID --owner-file ./owner\n  \
                  chefshat study links STUDY-ID --add 16 --owner-file ./owner\n  \
                  chefshat study follow STUDY-ID --owner-file ./owner\n  \
                  chefshat study export STUDY-ID --out data --owner-file ./owner\n\n\
                  docs/studies.md goes through a study from its file to its data.")]
pub(super) struct StudyCommand {
    #[command(subcommand)]
    action: StudyAction,
}

#[derive(Debug, Subcommand)]
enum StudyAction {
    /// Create a study from a TOML file.
    Create(Create),
    /// List the studies of an owner token, or all for the operator.
    List(owner::List),
    /// Show a study and its participants.
    Show(owner::Show),
    /// Print the links of the participants, after adding some if wanted.
    Links(owner::Links),
    /// Simulate a study with a known effect, to learn how likely it is to be found.
    Simulate(simulate::Simulate),
    /// Let test participants go through a study, with answers by chance.
    Test(trial::Test),
    /// Follow the progress of a study until it is closed and nobody but test participants is active.
    Follow(owner::Follow),
    /// Write the data of a study into a folder.
    Export(owner::Export),
    /// Close a study: nobody may begin any more.
    Close(owner::Owned),
    /// Remove a participant, whose slot is free again.
    Remove(owner::Remove),
    /// Delete the data of a participant.
    DeleteParticipant(owner::DeleteParticipant),
    /// Delete a study with all its data.
    Delete(owner::Delete),
}

impl StudyCommand {
    pub(super) async fn run(self) -> Result<ExitCode, CommandError> {
        match self.action {
            StudyAction::Create(command) => command.run().await?,
            StudyAction::List(command) => command.run().await?,
            StudyAction::Show(command) => command.run().await?,
            StudyAction::Links(command) => command.run().await?,
            StudyAction::Simulate(command) => return command.run(),
            StudyAction::Test(command) => return command.run().await,
            StudyAction::Follow(command) => command.run().await?,
            StudyAction::Export(command) => command.run().await?,
            StudyAction::Close(command) => command.close().await?,
            StudyAction::Remove(command) => command.run().await?,
            StudyAction::DeleteParticipant(command) => command.run().await?,
            StudyAction::Delete(command) => command.run().await?,
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Create a study from a TOML file.
#[derive(Debug, Args)]
struct Create {
    /// The settings: docs/studies/example.toml is an example with comments.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    server: ServerArg,
    /// Write the owner token to this file, readable only by its owner.
    #[arg(long, value_name = "FILE")]
    owner_file: Option<PathBuf>,
    /// Print the study and its owner token as a JSON line.
    #[arg(long)]
    json: bool,
}

impl Create {
    async fn run(self) -> Result<(), CommandError> {
        let settings = file::settings(&self.file)?;
        let service = service(&self.server).await?;
        let owner_file = (self.owner_file.as_deref())
            .map(SecretFile::for_owner)
            .transpose()?;
        let request = v1::CreateStudyRequest {
            settings: Some(settings),
            request_id: random_bytes::<32>().to_vec(),
        };
        let created = repeated(|| async { service.clone().create_study(request.clone()).await });
        let created = created.await?;
        let study = created.study.ok_or("the server did not return the study")?;
        let owner = created.owner_token;
        let written = write_all([(owner_file, &owner)]);
        if self.json {
            say(json!({"event": "created", "study": study, "owner_token": owner}))?;
        } else {
            // The token is nowhere else if its file could not be written.
            let kept = (self.owner_file.as_ref()).filter(|_| written.is_ok());
            self.print(&study, &owner, kept)?;
        }
        written
    }

    /// Prints a study that was created, and its owner token unless a file has it.
    fn print(
        &self,
        study: &v1::Study,
        owner: &str,
        owner_file: Option<&PathBuf>,
    ) -> Result<(), CommandError> {
        say(format_args!("study        {}", study.study_id))?;
        match owner_file {
            Some(file) => say(format_args!("owner token  in {}", file.display()))?,
            None => say(format_args!("owner token  {owner}"))?,
        }
        if let Some(address) = owner::open_address(&self.server.page(), study) {
            say(format_args!("open link    {address}"))?;
        }
        let participants = study.settings.as_ref().map_or(0, |it| it.participants);
        say(format_args!(
            "seeds sha256 {}",
            hex::encode(&study.seeds_sha256)
        ))?;
        say(format_args!(
            "each of {} has {} with {} and at most {} for practice",
            counted(participants.into(), "participant"),
            counted(study.steps.into(), "step"),
            counted(study.games.into(), "game"),
            study.practice_games
        ))?;
        match study.settings.as_ref().and_then(|it| it.groups.as_ref()) {
            None => Ok(()),
            Some(groups) => say(format_args!("they play in groups of {}", groups.size)),
        }
    }
}
