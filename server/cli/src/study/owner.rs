//! Commands for the owner of a study.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use chefshat_client::{Connection, Error, repeated};
use chefshat_proto::v1;
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chrono::{DateTime, SecondsFormat};
use clap::Args;
use serde_json::json;

use super::connection::{get_study, refused, service};
use crate::connect::{OwnerArgs, PATIENCE, ServerArg};
use crate::error::tell;
use crate::new_folder::{NewFolder, at};
use crate::numbers::counted;
use crate::{CommandError, say};

/// The file that is exported last: without it an export is incomplete.
const LAST_FILE: &str = "datapackage.json";
/// Pause before a study is followed again.
const FOLLOW_AGAIN: Duration = Duration::from_secs(1);

/// A study and the proof of ownership.
#[derive(Debug, Args)]
pub(super) struct Owned {
    /// ID of the study.
    #[arg(value_name = "STUDY-ID")]
    pub(super) study_id: String,
    #[command(flatten)]
    pub(super) owner: OwnerArgs,
    #[command(flatten)]
    pub(super) server: ServerArg,
    /// Print JSON lines.
    #[arg(long)]
    pub(super) json: bool,
}

/// List the studies of an owner token, or all for the operator.
#[derive(Debug, Args)]
pub(super) struct List {
    #[command(flatten)]
    owner: OwnerArgs,
    #[command(flatten)]
    server: ServerArg,
    /// Print each study as a JSON line.
    #[arg(long)]
    json: bool,
}

/// Show a study and its participants.
#[derive(Debug, Args)]
pub(super) struct Show {
    #[command(flatten)]
    owned: Owned,
}

/// Print the links of the participants, after adding some if wanted.
#[derive(Debug, Args)]
pub(super) struct Links {
    #[command(flatten)]
    owned: Owned,
    /// Add this many participants, named by number, and print their links alone.
    #[arg(long, value_name = "N", default_value_t = 0)]
    add: u32,
    /// Add a participant with this pseudonym. Do not use names of people. Repeatable.
    #[arg(long = "pseudonym", value_name = "NAME")]
    pseudonyms: Vec<String>,
    /// The links of test participants instead of those of all others. With --add or --pseudonym: add
    /// test participants, who take no place.
    #[arg(long)]
    test: bool,
    /// With --add or --pseudonym, in a study with groups: those who are added play with each other, in
    /// their order, and not with whom they arrive.
    #[arg(long)]
    together: bool,
}

/// Follow the progress of a study until it is closed and nobody but test participants is active.
#[derive(Debug, Args)]
pub(super) struct Follow {
    #[command(flatten)]
    owned: Owned,
}

/// Write the data of a study into a folder.
#[derive(Debug, Args)]
pub(super) struct Export {
    #[command(flatten)]
    owned: Owned,
    /// The folder, which must not exist yet. It appears when the export is complete.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// The data of test participants, instead of those of all others.
    #[arg(long)]
    test: bool,
}

/// Remove a participant, whose slot is free again. Its data are kept.
#[derive(Debug, Args)]
pub(super) struct Remove {
    #[command(flatten)]
    owned: Owned,
    /// Number of the participant.
    #[arg(value_name = "NUMBER")]
    number: u32,
    /// Add another participant and print its link.
    #[arg(long)]
    replace: bool,
}

/// Delete the data of a participant: its pseudonym, answers, interface traces and games.
#[derive(Debug, Args)]
pub(super) struct DeleteParticipant {
    #[command(flatten)]
    owned: Owned,
    /// Number of the participant.
    #[arg(value_name = "NUMBER")]
    number: u32,
}

/// Delete a study with all its data: answers, traces, and games with their records. Export it
/// first.
#[derive(Debug, Args)]
pub(super) struct Delete {
    #[command(flatten)]
    owned: Owned,
    /// Remove participants who are in the middle of the study, and close their games.
    #[arg(long)]
    force: bool,
    /// Confirm that the study is to be deleted. This cannot be undone.
    #[arg(long)]
    yes: bool,
}

impl Delete {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        if !self.yes {
            return Err("nothing was changed: confirm with --yes".into());
        }
        let owned = self.owned;
        let mut service = service(&owned.server).await?;
        let request = v1::DeleteStudyRequest {
            study_id: owned.study_id.clone(),
            owner_token: owned.owner.token()?,
            force: self.force,
        };
        let deleted = service.delete_study(request).await.map_err(refused)?;
        let deleted = deleted.into_inner();
        match owned.json {
            true => say(json!({"event": "deleted", "study": deleted})),
            false => say(format_args!(
                "study {} is deleted, with {} and {}",
                owned.study_id,
                counted(deleted.participants.into(), "participant"),
                counted(deleted.games.into(), "game"),
            )),
        }
    }
}

impl List {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        // The operator needs none.
        let owner_tokens = self.owner.given()?.into_iter().collect();
        let service = service(&self.server).await?;
        let request = v1::ListStudiesRequest { owner_tokens };
        let listed = repeated(|| async { service.clone().list_studies(request.clone()).await });
        let studies = listed.await?.studies;
        if studies.is_empty() && !self.json {
            return say("no studies");
        }
        studies.iter().try_for_each(|study| match self.json {
            true => say(json!(study)),
            false => say(summary(study)),
        })
    }
}

impl Show {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        let owned = self.owned;
        let service = service(&owned.server).await?;
        let shown = get_study(&service, &owned.study_id, &owned.owner.token()?).await?;
        if owned.json {
            return say(json!(shown));
        }
        let study = shown.study.unwrap_or_default();
        say(summary(&study))?;
        if let Some(address) = open_address(&owned.server.page(), &study) {
            say(format_args!("open link {address}"))?;
        }
        shown.participants.iter().try_for_each(|it| say(line(it)))
    }
}

impl Links {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        let owned = self.owned;
        let adds = self.add > 0 || !self.pseudonyms.is_empty();
        if self.together && !adds {
            return Err("--together: add participants with --add or --pseudonym".into());
        }
        let mut service = service(&owned.server).await?;
        let (study_id, owner_token) = (owned.study_id.clone(), owned.owner.token()?);
        let links = if !adds {
            let request = v1::ListStudyLinksRequest {
                study_id,
                owner_token,
            };
            let listed =
                repeated(|| async { service.clone().list_study_links(request.clone()).await });
            listed.await?.links
        } else {
            let request = v1::AddStudyParticipantsRequest {
                study_id,
                owner_token,
                pseudonyms: self.pseudonyms,
                count: self.add,
                test: self.test,
                together: self.together,
            };
            let added = service.add_study_participants(request).await;
            added.map_err(refused)?.into_inner().links
        };
        for link in links.iter().filter(|link| link.test == self.test) {
            print_link(link, &owned.server.page(), owned.json)?;
        }
        Ok(())
    }
}

impl Follow {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        // It connects again by itself.
        let service = service(&self.owned.server).await?;
        let request = v1::FollowStudyRequest {
            study_id: self.owned.study_id.clone(),
            owner_token: self.owned.owner.token()?,
        };
        let mut shown = Shown::default();
        let mut outage = None;
        loop {
            let followed = self.follow(service.clone(), request.clone(), &mut shown, &mut outage);
            let Some(error) = followed.await? else {
                return Ok(());
            };
            // The server stops, has died, or hands the study to another node, which resumes it.
            let Outage { since, failures } = outage.get_or_insert_with(Outage::begins);
            if !error.may_retry() || since.elapsed() >= PATIENCE {
                return Err(error.into());
            }
            *failures += 1;
            // The first one is the end of the stream, which a server that is back at once hides.
            if *failures == 2 {
                let patience = PATIENCE.as_secs();
                tell(format_args!(
                    "{error}; retrying for up to {patience} seconds"
                ));
            }
            tokio::time::sleep(FOLLOW_AGAIN).await;
        }
    }

    /// Shows changes until the study is over, or the stream ends before, and returns why it did. Each
    /// change ends the outage.
    async fn follow(
        &self,
        mut service: StudyServiceClient<Connection>,
        request: v1::FollowStudyRequest,
        shown: &mut Shown,
        outage: &mut Option<Outage>,
    ) -> Result<Option<Error>, CommandError> {
        let mut updates = match service.follow_study(request).await {
            Ok(followed) => followed.into_inner(),
            Err(status) => return Ok(Some(status.into())),
        };
        loop {
            let update = match updates.message().await {
                Ok(Some(update)) => shown.new_in(update),
                Ok(None) => return Ok(None),
                Err(status) => return Ok(Some(status.into())),
            };
            *outage = None;
            if self.owned.json {
                if update != v1::FollowStudyResponse::default() {
                    say(json!(update))?;
                }
                continue;
            }
            if let Some(study) = &update.study {
                say(summary(study))?;
            }
            update
                .participants
                .iter()
                .try_for_each(|it| say(line(it)))?;
        }
    }
}

/// A time without a server.
struct Outage {
    since: Instant,
    failures: u32,
}

impl Outage {
    fn begins() -> Self {
        Self {
            since: Instant::now(),
            failures: 0,
        }
    }
}

/// What was shown of a study: a stream that is opened again begins with all of it.
#[derive(Default)]
struct Shown {
    study: Option<v1::Study>,
    participants: BTreeMap<u32, v1::StudyParticipant>,
}

impl Shown {
    /// What of an update was not shown yet.
    fn new_in(&mut self, update: v1::FollowStudyResponse) -> v1::FollowStudyResponse {
        let study = update
            .study
            .filter(|study| self.study.replace(study.clone()).as_ref() != Some(study));
        let mut participants = update.participants;
        participants.retain(|it| {
            let before = self.participants.insert(it.number, it.clone());
            before.as_ref() != Some(it)
        });
        v1::FollowStudyResponse {
            study,
            participants,
        }
    }
}

impl Export {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        let owned = self.owned;
        if let Some(parent) = self.out.parent() {
            fs::create_dir_all(parent).map_err(|error| at(parent, &error))?;
        }
        let folder =
            NewFolder::beside(&self.out, 0o777).map_err(|error| format!("--out: {error}"))?;
        let service = service(&owned.server).await?;
        let request = v1::ExportStudyRequest {
            study_id: owned.study_id.clone(),
            owner_token: owned.owner.token()?,
            test: self.test,
        };
        let exported = repeated(|| async { service.clone().export_study(request.clone()).await });
        let mut parts = exported.await?;
        let mut sizes: BTreeMap<String, u64> = BTreeMap::new();
        let mut open: Option<(String, File)> = None;
        while let Some(part) = parts.message().await.map_err(refused)? {
            let file = match open.take().filter(|(name, _)| *name == part.file) {
                Some((_, file)) => file,
                None => create(folder.path(), &part.file)?,
            };
            let (_, file) = open.insert((part.file.clone(), file));
            let written = file.write_all(&part.data);
            written.map_err(|error| at(&folder.path().join(&part.file), &error))?;
            *sizes.entry(part.file).or_default() += part.data.len() as u64;
        }
        if !sizes.contains_key(LAST_FILE) {
            return Err("the server ended the export before it was complete; export again".into());
        }
        folder.finish()?;
        let (records, files): (Vec<_>, Vec<_>) = sizes
            .iter()
            .partition(|(name, _)| name.starts_with("records/"));
        if owned.json {
            return say(json!({"event": "exported", "folder": self.out, "files": sizes}));
        }
        for (name, bytes) in files {
            say(format_args!("{name} ({bytes} bytes)"))?;
        }
        let games = counted(records.len() as u64, "game");
        say(format_args!("records/ ({games})"))
    }
}

/// Creates a file of the export. The server names it: it must stay in the folder.
fn create(folder: &Path, name: &str) -> Result<File, CommandError> {
    let is_plain = |part: &str| {
        let allowed = |letter: char| letter.is_ascii_alphanumeric() || "_-.".contains(letter);
        !part.is_empty() && !part.starts_with('.') && part.chars().all(allowed)
    };
    if name.split('/').count() > 2 || !name.split('/').all(is_plain) {
        return Err(format!("the server named a file {name:?}; nothing is written").into());
    }
    let path = folder.join(name);
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|error| at(parent, &error))?;
    }
    File::create_new(&path).map_err(|error| at(&path, &error))
}

impl Owned {
    pub(super) async fn close(self) -> Result<(), CommandError> {
        let mut service = service(&self.server).await?;
        let request = v1::CloseStudyRequest {
            study_id: self.study_id.clone(),
            owner_token: self.owner.token()?,
        };
        let closed = service.close_study(request).await.map_err(refused)?;
        let study = closed.into_inner().study.unwrap_or_default();
        match self.json {
            true => say(json!({"event": "closed", "study": study})),
            false => say(summary(&study)),
        }
    }
}

impl Remove {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        let owned = self.owned;
        let mut service = service(&owned.server).await?;
        let request = v1::RemoveStudyParticipantRequest {
            study_id: owned.study_id.clone(),
            owner_token: owned.owner.token()?,
            number: self.number,
            replace: self.replace,
        };
        let removed = service.remove_study_participant(request).await;
        let removed = removed.map_err(refused)?.into_inner();
        if owned.json {
            return say(json!(removed));
        }
        say(line(&removed.participant.unwrap_or_default()))?;
        match removed.replacement {
            Some(link) => print_link(&link, &owned.server.page(), false),
            None => Ok(()),
        }
    }
}

impl DeleteParticipant {
    pub(super) async fn run(self) -> Result<(), CommandError> {
        let owned = self.owned;
        let mut service = service(&owned.server).await?;
        let request = v1::DeleteStudyParticipantRequest {
            study_id: owned.study_id.clone(),
            owner_token: owned.owner.token()?,
            number: self.number,
        };
        let deleted = service.delete_study_participant(request).await;
        let deleted = deleted.map_err(refused)?.into_inner();
        if owned.json {
            return say(json!(deleted));
        }
        say(format_args!(
            "the data of participant {} are deleted, with {}",
            self.number,
            counted(deleted.games.into(), "game")
        ))
    }
}

fn print_link(link: &v1::StudyLink, page: &str, json: bool) -> Result<(), CommandError> {
    let address = address(page, &link.link);
    if json {
        let (number, pseudonym) = (link.number, &link.pseudonym);
        return say(json!({
            "number": number, "pseudonym": pseudonym, "link": link.link, "address": address,
            "joined": link.joined, "test": link.test, "planned_with": link.planned_with,
        }));
    }
    let plan = match link.planned_with {
        0 => String::new(),
        first => format!("\tplays with the group of {first}"),
    };
    say(format_args!(
        "{}\t{}\t{address}{plan}",
        link.number, link.pseudonym
    ))
}

/// The page's address for a link.
fn address(page: &str, link: &str) -> String {
    format!("{page}/study/{link}")
}

/// The page's address for the open link, if there is one: the id at the panel belongs at its end if
/// one is asked for.
pub(super) fn open_address(page: &str, study: &v1::Study) -> Option<String> {
    if study.open_link.is_empty() {
        return None;
    }
    let recruiting = study
        .settings
        .as_ref()
        .and_then(|it| it.recruiting.as_ref());
    let parameter = recruiting.map_or("", |it| &it.id_parameter);
    let address = address(page, &study.open_link);
    Some(match parameter {
        "" => address,
        parameter => format!("{address}?{parameter}="),
    })
}

/// A study in a line.
fn summary(study: &v1::Study) -> String {
    let name = study.settings.as_ref().map_or("", |it| it.name.as_str());
    let state = if study.closed { "closed" } else { "open" };
    let deletes_at_ms = study.settings.as_ref().map_or(0, |it| it.deletes_at_ms);
    let deletion = (i64::try_from(deletes_at_ms).ok())
        .filter(|at_ms| *at_ms > 0)
        .and_then(DateTime::from_timestamp_millis)
        .map_or_else(String::new, |at| {
            let at = at.to_rfc3339_opts(SecondsFormat::Secs, true);
            format!("; it is deleted with all its data on {at}")
        });
    format!(
        "study {} ({name}) is {state}: {} completed, {} active, {} invited, {} left{deletion}",
        study.study_id, study.completed, study.active, study.invited, study.left
    )
}

/// A participant in a line.
pub(super) fn line(participant: &v1::StudyParticipant) -> String {
    let state = participant.state().as_str_name();
    let state = state
        .trim_start_matches("STUDY_PARTICIPANT_STATE_")
        .to_lowercase();
    let present = if participant.connected {
        ", present"
    } else {
        ""
    };
    let test = if participant.test { " (test)" } else { "" };
    let group = match participant.group {
        0 => String::new(),
        group => format!("group {group}\t"),
    };
    let id = match participant.panel_id.as_str() {
        "" => String::new(),
        id => format!(" ({id})"),
    };
    format!(
        "{}\t{}{test}{id}\t{state}{present}\tstep {}\t{group}{}",
        participant.number,
        participant.pseudonym,
        participant.step,
        participant.conditions.join(" ")
    )
}
