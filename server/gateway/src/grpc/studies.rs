//! `StudyService`: checks requests of researchers, forwards them to the study, and converts the
//! results. What participants ask for is in `participation`.

mod participation;

use std::collections::{BTreeMap, BTreeSet};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::sync::Arc;

use chefshat_proto::codec::{LARGE, beside_tasks};
use chefshat_proto::v1::{
    self, study_service_client::StudyServiceClient, study_service_server::StudyService,
};
use chefshat_study::{NewParticipants, Refusal as StudyRefusal, SettingsProblem};
use prost::Message as _;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Response, Status};

use super::access::opened;
use super::fields::{checked_name, request_id};
use super::follow::{self, Responses, Sender, send};
use super::forward::Gateway;
use super::limits::make_way;
use super::lists;
use super::lookup::Lookup;
use super::status::{
    Refusal, internal, invalid, not_created, read_failed, shutting_down, status, study_unknown,
};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{COST_OF_TOURNAMENT, CallLimits, FairSemaphore, Key};
use chefshat_base::metrics::StreamKind;
use chefshat_base::tasks::{LongTask, named, short};
use chefshat_hosting::cluster::FoundBy;
use chefshat_hosting::config::{
    FOLLOW_INTERVAL, FOLLOW_SEND_TIMEOUT, MAX_FOLLOWERS, MAX_PEER_MESSAGE_BYTES, MAX_RECORDS_SENT,
    MAX_STUDY_STREAMS,
};
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::studies::{
    CreateError, ExportError, ExportedFile, NotDeleted, NotDone, Studies, StudyHandle,
};
use chefshat_room::ids::{Id, RequestKey, StudyId};
use chefshat_store::StoreError;
use chefshat_wire::convert;

/// Most participants that one request adds to a study.
const MAX_STUDY_ADDED: usize = 1_000;
/// Most participants in one message to a follower of a study.
const MAX_STUDY_PARTICIPANTS_SENT: usize = 200;

/// Participants of a study about all of whom a request costs its caller one call more.
const PARTICIPANTS_PER_CALL: usize = 100;

/// The services of studies.
#[derive(Debug, Clone)]
pub struct StudyCalls {
    studies: Arc<Studies>,
    lookup: Lookup,
    calls: Arc<CallLimits>,
    followers: Arc<FairSemaphore>,
    /// Limits the records in memory while clients receive exports.
    exports: Arc<FairSemaphore>,
    /// Permits for streams of participants.
    participants: Arc<FairSemaphore>,
    /// Cancelled when all streams must end.
    closing: CancellationToken,
}

impl StudyCalls {
    /// Creates the services for these studies; `closing` ends their streams.
    pub fn new(
        studies: Arc<Studies>,
        lookup: Lookup,
        calls: Arc<CallLimits>,
        closing: CancellationToken,
    ) -> Self {
        let shares = studies.rooms().shares();
        Self {
            studies,
            lookup,
            calls,
            followers: FairSemaphore::new(MAX_FOLLOWERS, shares),
            exports: FairSemaphore::new(MAX_RECORDS_SENT, shares),
            participants: FairSemaphore::new(MAX_STUDY_STREAMS, shares),
            closing,
        }
    }

    /// Charges a caller for something about all participants of a study.
    fn charge_all(&self, handle: &StudyHandle, key: Key) {
        let participants = handle.read(|study| study.participants().len());
        self.calls
            .charge(key, (participants / PARTICIPANTS_PER_CALL) as u64);
    }

    /// Answers with something about all participants of a study, in turn among long computations. The
    /// call holds up no others while it waits: its handler has made way.
    async fn about_all<T: Send + 'static>(
        &self,
        handle: Arc<StudyHandle>,
        key: Key,
        compute: impl FnOnce(&StudyHandle) -> T + Send + 'static,
    ) -> Result<Response<T>, Status> {
        self.charge_all(&handle, key);
        let background = self.studies.rooms().background();
        let _slice = background.slice(key).await;
        let computed = background.run(move || compute(&handle)).await;
        computed.map(Response::new).ok_or_else(internal)
    }

    /// The study with this id, if this node has it. If another node does, the error sends the request
    /// there.
    async fn here(&self, id: StudyId, caller: Key) -> Result<Option<Arc<StudyHandle>>, Status> {
        let known = self.studies.get(id);
        if let Some(handle) = known.clone().filter(|handle| !handle.is_stopped()) {
            return Ok(Some(handle));
        }
        let found_by = FoundBy::from(id);
        let checked = (self.lookup).check_not_elsewhere(&found_by, caller, || known.is_some());
        checked.await?;
        Ok(self.studies.get(id))
    }

    /// The study of an owner token. A wrong one is answered like an unknown study.
    async fn owned(
        &self,
        caller: &Caller,
        id: &str,
        token: &str,
    ) -> Result<Arc<StudyHandle>, Status> {
        let id = Id::parse(id).ok_or_else(study_unknown)?;
        let key = Key::of_caller(caller);
        let handle = self.here(id, key).await?.ok_or_else(study_unknown)?;
        if handle.is_owner(token) || (caller.is_operator() && token.is_empty()) {
            return Ok(handle);
        }
        // As for rooms: one that does not exist is looked for at other nodes.
        let found_by = FoundBy::from(id);
        (self.lookup.check_not_elsewhere(&found_by, key, || true)).await?;
        Err(study_unknown())
    }

    fn links(&self, handle: &StudyHandle, from: u32, count: usize) -> Vec<v1::StudyLink> {
        (from..).take(count).map(|it| handle.link(it)).collect()
    }
}

impl StudyService for StudyCalls {
    type FollowStudyStream = Responses<v1::FollowStudyResponse>;
    type ExportStudyStream = Responses<v1::ExportStudyResponse>;

    async fn create_study(
        &self,
        request: Request<v1::CreateStudyRequest>,
    ) -> Result<Response<v1::CreateStudyResponse>, Status> {
        let gateway: Option<Gateway> = request.extensions().get().cloned();
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let settings = request.settings.unwrap_or_default();
        // Levels are a map: their order differs between encodings of the same settings.
        let content = beside_tasks(settings.encoded_len(), || content_of(&settings));
        let request_key =
            request_id(&request.request_id, &caller)?.map(|id| RequestKey::new(id, &content));
        let known = match request_key {
            // Another node may have created it for the same request.
            Some(request) => self.here(Studies::created_id(request), key).await?,
            None => None,
        };
        if known.is_none() {
            self.lookup.check_placed_here(gateway.as_ref()).await?;
        }
        self.calls.charge(key, COST_OF_TOURNAMENT);
        let created = self.studies.create(settings, request_key, key).await;
        if let (Err(CreateError::Store(StoreError::Taken(_))), Some(request)) =
            (&created, request_key)
        {
            // Another node has created it meanwhile.
            self.here(Studies::created_id(request), key).await?;
        }
        let refused = |problem| not_created(problem, settings_refused);
        let (handle, owner) = created.map_err(refused)?;
        Ok(Response::new(v1::CreateStudyResponse {
            study: Some(handle.describe()),
            owner_token: owner.to_text(),
        }))
    }

    async fn get_study(
        &self,
        request: Request<v1::GetStudyRequest>,
    ) -> Result<Response<v1::GetStudyResponse>, Status> {
        make_way(request.extensions());
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        let rooms = Arc::clone(self.studies.rooms());
        let described = move |handle: &StudyHandle| v1::GetStudyResponse {
            study: Some(handle.describe_with_pictures()),
            participants: handle.participants(&rooms),
        };
        self.about_all(handle, key, described).await
    }

    async fn list_studies(
        &self,
        request: Request<v1::ListStudiesRequest>,
    ) -> Result<Response<v1::ListStudiesResponse>, Status> {
        let gateway: Option<Gateway> = request.extensions().get().cloned();
        // Who waits for a turn holds up no other calls.
        make_way(request.extensions());
        let (caller, request) = opened(request);
        // The settings of many studies are large.
        let _turn = self.calls.list(Key::of_caller(&caller)).await;
        let is_operator = caller.is_operator();
        let tokens = &request.owner_tokens;
        if tokens.len() > 100 {
            return Err(invalid("COUNT_REFUSED", "owner_tokens", "give at most 100"));
        }
        let studies = self
            .studies
            .earlier(None)
            .into_iter()
            .map(|(_, handle)| handle)
            .filter(|handle| is_operator || tokens.iter().any(|token| handle.is_owner(token)));
        // Their settings are large together.
        let described = || studies.map(|handle| handle.describe()).collect();
        let mut studies: Vec<v1::Study> = beside_tasks(LARGE, described);
        if let Some(gateway) = gateway {
            let ask = |channel| {
                let service = StudyServiceClient::new(channel);
                let mut service = service.max_decoding_message_size(MAX_PEER_MESSAGE_BYTES);
                let request = gateway.request(request.clone());
                async move { service.list_studies(request).await }
            };
            let others = lists::of_others(&gateway, ask).await;
            studies.extend(others.flat_map(|listed| listed.studies));
            studies.sort_by_key(|study| std::cmp::Reverse(study.created_at_ms));
            // A study that just changes hands may be listed twice.
            let mut seen = BTreeSet::new();
            studies.retain(|study| seen.insert(study.study_id.clone()));
        }
        Ok(Response::new(v1::ListStudiesResponse { studies }))
    }

    async fn add_study_participants(
        &self,
        request: Request<v1::AddStudyParticipantsRequest>,
    ) -> Result<Response<v1::AddStudyParticipantsResponse>, Status> {
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        let pseudonyms = request.pseudonyms.iter();
        let mut pseudonyms = pseudonyms
            .map(|pseudonym| checked_name("pseudonyms", pseudonym, 1))
            .collect::<Result<Vec<_>, _>>()?;
        let count = usize::try_from(request.count).unwrap_or(usize::MAX);
        let count = count.saturating_add(pseudonyms.len());
        if !(1..=MAX_STUDY_ADDED).contains(&count) {
            let words = format!("{count} participants; add 1 to {MAX_STUDY_ADDED} at a time");
            return Err(invalid("COUNT_REFUSED", "count", words));
        }
        pseudonyms.resize(count, String::new());
        let new = NewParticipants {
            pseudonyms,
            test: request.test,
            together: request.together,
        };
        let first = handle.add(key, new).await.map_err(not_done)?;
        Ok(Response::new(v1::AddStudyParticipantsResponse {
            links: self.links(&handle, first, count),
        }))
    }

    async fn list_study_links(
        &self,
        request: Request<v1::ListStudyLinksRequest>,
    ) -> Result<Response<v1::ListStudyLinksResponse>, Status> {
        use chefshat_study::Status::{Active, DroppedOut, Invited};
        make_way(request.extensions());
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        let links = |handle: &StudyHandle| {
            let numbers: Vec<u32> = handle.read(|study| {
                let participants = study.participants().iter();
                participants
                    .filter(|(_, it)| matches!(it.status, Invited | Active | DroppedOut))
                    .map(|(number, _)| *number)
                    .collect()
            });
            v1::ListStudyLinksResponse {
                links: numbers.into_iter().map(|it| handle.link(it)).collect(),
            }
        };
        self.about_all(handle, key, links).await
    }

    async fn follow_study(
        &self,
        request: Request<v1::FollowStudyRequest>,
    ) -> Result<Response<Self::FollowStudyStream>, Status> {
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        let what = "too many streams that follow studies";
        let place = follow::place(&self.followers, key, what)?;
        self.charge_all(&handle, key);
        let studies = Arc::clone(&self.studies);
        let counted = studies.rooms().metrics().stream(StreamKind::Follow);
        let (response, following) =
            follow::stream(self.closing.clone(), move |sender| async move {
                let _held = (place, counted);
                follow(&handle, &studies, key, &sender).await
            });
        tokio::spawn(named(LongTask::FollowStudy, following));
        Ok(response)
    }

    async fn remove_study_participant(
        &self,
        request: Request<v1::RemoveStudyParticipantRequest>,
    ) -> Result<Response<v1::RemoveStudyParticipantResponse>, Status> {
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        let removed = handle.remove(key, request.number, request.replace).await;
        let added = removed.map_err(not_done)?;
        Ok(Response::new(v1::RemoveStudyParticipantResponse {
            participant: handle.participant(request.number, self.studies.rooms()),
            replacement: (added > 0).then(|| handle.link(added)),
        }))
    }

    async fn close_study(
        &self,
        request: Request<v1::CloseStudyRequest>,
    ) -> Result<Response<v1::CloseStudyResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        handle.close().await.map_err(not_done)?;
        let study = Some(handle.describe());
        Ok(Response::new(v1::CloseStudyResponse { study }))
    }

    async fn export_study(
        &self,
        request: Request<v1::ExportStudyRequest>,
    ) -> Result<Response<Self::ExportStudyStream>, Status> {
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        self.calls.charge(key, COST_OF_TOURNAMENT);
        let place = self.exports.take(key).await;
        let (files, mut exported) = mpsc::channel::<ExportedFile>(1);
        let studies = Arc::clone(&self.studies);
        let (response, exporting) =
            follow::stream(self.closing.clone(), move |sender| async move {
                let _place = place;
                let forwarding = async move {
                    while let Some(part) = exported.recv().await {
                        let response = v1::ExportStudyResponse {
                            file: part.file,
                            data: part.data,
                        };
                        // If it is not received, what gathers the export notices that this has ended.
                        let (what, limit) = ("the export", FOLLOW_SEND_TIMEOUT);
                        follow::send_part(&sender, response, what, limit).await?;
                    }
                    Ok(())
                };
                let gathering = async move {
                    let gathered = handle.export(studies.rooms(), request.test, &files).await;
                    drop(files);
                    gathered
                };
                match tokio::join!(forwarding, gathering) {
                    (_, Err(ExportError::Store(error))) => Err(read_failed(error)),
                    (forwarded, _) => forwarded,
                }
            });
        tokio::spawn(short("one export", exporting));
        Ok(response)
    }

    async fn delete_study_participant(
        &self,
        request: Request<v1::DeleteStudyParticipantRequest>,
    ) -> Result<Response<v1::DeleteStudyParticipantResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        // The journal of the study is written again.
        self.calls
            .charge(Key::of_caller(&caller), COST_OF_TOURNAMENT);
        let deleted = handle.withdraw(request.number, true).await;
        deleted.map_err(not_done)?;
        let participant = handle.participant(request.number, self.studies.rooms());
        let games = participant.as_ref().map_or(0, |it| it.games.len());
        Ok(Response::new(v1::DeleteStudyParticipantResponse {
            participant,
            games: convert::number(games),
        }))
    }

    async fn delete_study(
        &self,
        request: Request<v1::DeleteStudyRequest>,
    ) -> Result<Response<v1::DeleteStudyResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.study_id, &request.owner_token);
        let handle = self.owned(&caller, id, owner).await?;
        let deleted = self.studies.delete(handle, request.force).await;
        let (participants, games) = deleted.map_err(not_deleted)?;
        Ok(Response::new(v1::DeleteStudyResponse {
            participants: convert::number(participants),
            games: convert::number(games),
        }))
    }
}

/// What has changed of the participants of a study since a follower was sent them, of each of whom it
/// is known by a hash what that was: a study has up to 10,000, and many followers.
fn changed_participants(
    handle: &StudyHandle,
    rooms: &Rooms,
    sent: &mut BTreeMap<u32, u64>,
) -> Vec<v1::StudyParticipant> {
    let mut participants = handle.participants(rooms);
    participants.retain(|it| {
        let mut hasher = DefaultHasher::new();
        it.encode_to_vec().hash(&mut hasher);
        let hash = hasher.finish();
        sent.insert(it.number, hash) != Some(hash)
    });
    participants
}

/// Sends a study and then what changes of it, until it is over. Followers are sent updates in turns,
/// which are made on threads that give way to those of rooms.
async fn follow(
    handle: &Arc<StudyHandle>,
    studies: &Studies,
    key: Key,
    sender: &Sender<v1::FollowStudyResponse>,
) -> Result<(), Status> {
    let response = |study, participants| v1::FollowStudyResponse {
        study,
        participants,
    };
    let mut changes = handle.changes();
    let mut sent_study = None;
    let mut sent = BTreeMap::new();
    let background = studies.rooms().background();
    loop {
        changes.mark_unchanged();
        let over = handle.is_complete();
        let (followed, rooms) = (Arc::clone(handle), Arc::clone(studies.rooms()));
        let slice = background.slice(key).await;
        let making = background.run(move || {
            let study = followed.describe();
            let changed = changed_participants(&followed, &rooms, &mut sent);
            (study, changed, sent)
        });
        let (study, changed);
        (study, changed, sent) = making.await.ok_or_else(internal)?;
        drop(slice);
        let study = (sent_study.as_ref() != Some(&study)).then_some(study);
        let began = Instant::now();
        let mut parts = changed.chunks(MAX_STUDY_PARTICIPANTS_SENT);
        let first = parts.next().unwrap_or_default().to_vec();
        if study.is_some() || !first.is_empty() {
            sent_study = study.clone().or(sent_study);
            send(sender, response(study, first)).await?;
        }
        for part in parts {
            send(sender, response(None, part.to_vec())).await?;
        }
        if over {
            return Ok(());
        }
        sleep_until(began + FOLLOW_INTERVAL).await;
        follow::changed(&mut changes, handle.stopped()).await?;
    }
}

/// The content of a request to create a study, encoded in one way only.
fn content_of(settings: &v1::StudySettings) -> Vec<u8> {
    let mut settings = settings.clone();
    let mut levels = Vec::new();
    for condition in &mut settings.conditions {
        let mut of_one: Vec<_> = std::mem::take(&mut condition.levels).into_iter().collect();
        of_one.sort();
        for (factor, level) in of_one {
            levels.extend([factor, level].map(|word| format!("{}:{word}", word.len())));
        }
        levels.push(String::new());
    }
    let mut content = settings.encode_to_vec();
    content.extend(levels.join("\n").into_bytes());
    content
}

/// The status for a study that is not deleted.
fn not_deleted(problem: NotDeleted) -> Status {
    match problem {
        NotDeleted::Running(active) => status(
            Code::FailedPrecondition,
            "STUDY_RUNNING",
            format!("{problem}; wait for them, or set `force` to remove them"),
            [("participants", &active.to_string())],
        ),
        NotDeleted::Files(_) => internal(),
        NotDeleted::Stopped(_) => shutting_down(),
    }
}

fn settings_refused(problem: SettingsProblem) -> Status {
    status(
        Code::InvalidArgument,
        "SETTINGS_REFUSED",
        problem.to_string(),
        [("field", &problem.field)],
    )
}

/// The status for what a study did not do.
fn not_done(problem: NotDone) -> Status {
    match problem {
        NotDone::Study(refusal) => refused(refusal),
        NotDone::Memory(refusal) => Refusal::from(refusal).into(),
        NotDone::Files => internal(),
        NotDone::Stopped(_) => shutting_down(),
    }
}

/// The status for a refused command.
fn refused(refusal: StudyRefusal) -> Status {
    let (code, reason) = code_of(&refusal);
    match &refusal {
        StudyRefusal::PanelId(problem) => invalid(reason, "panel_id", problem.clone()),
        StudyRefusal::Answers(problem) => {
            let item = problem.item.to_string();
            status(code, reason, refusal.to_string(), [("item", &item)])
        }
        _ => status(code, reason, refusal.to_string(), []),
    }
}

/// The code and the reason of a refused command.
fn code_of(refusal: &StudyRefusal) -> (Code, &'static str) {
    match refusal {
        StudyRefusal::Unknown => (Code::NotFound, "PARTICIPANT_UNKNOWN"),
        StudyRefusal::Closed => (Code::FailedPrecondition, "STUDY_CLOSED"),
        StudyRefusal::Full => (Code::FailedPrecondition, "STUDY_FULL"),
        StudyRefusal::WrongDevice(_) => (Code::FailedPrecondition, "WRONG_DEVICE"),
        StudyRefusal::Over => (Code::FailedPrecondition, "PARTICIPATION_OVER"),
        StudyRefusal::Superseded => (Code::Aborted, "SESSION_SUPERSEDED"),
        StudyRefusal::StepOver => (Code::FailedPrecondition, "STEP_OVER"),
        StudyRefusal::StepMismatch => (Code::FailedPrecondition, "STEP_MISMATCH"),
        StudyRefusal::GameNotOver => (Code::FailedPrecondition, "GAME_NOT_OVER"),
        StudyRefusal::TooManySessions => (Code::ResourceExhausted, "TOO_MANY_SESSIONS"),
        StudyRefusal::TooManySaves => (Code::ResourceExhausted, "TOO_MANY_SAVES"),
        StudyRefusal::NameTaken(_) => (Code::AlreadyExists, "NAME_TAKEN"),
        StudyRefusal::TooManyParticipants | StudyRefusal::TooManyTests => {
            (Code::ResourceExhausted, "TOO_MANY_PARTICIPANTS")
        }
        StudyRefusal::NoWholeGroups(_) => (Code::InvalidArgument, "COUNT_REFUSED"),
        StudyRefusal::PanelIdTaken => (Code::AlreadyExists, "PANEL_ID_TAKEN"),
        StudyRefusal::PanelId(_) => (Code::InvalidArgument, "PANEL_ID_REFUSED"),
        StudyRefusal::Answers(_) => (Code::InvalidArgument, "ANSWER_REFUSED"),
    }
}
