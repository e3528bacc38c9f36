//! `ParticipationService`: what participants of studies ask for. Answers are made of views, which
//! have no place for anything that names a condition.

use std::sync::Arc;

use chefshat_proto::v1::{self, participation_service_server::ParticipationService};
use chefshat_study::{
    At, ItemAnswer, Joined, ParticipantLink, Pointer, Refusal as StudyRefusal, RequiredDevice,
    SessionSecret,
};
use prost::Message as _;
use sha2::{Digest as _, Sha256};
use tonic::{Code, Request, Response, Status};

use super::{StudyCalls, code_of, not_done, refused};
use crate::grpc::follow::{self, Responses, Sender, changed};
use crate::grpc::limits::charged;
use crate::grpc::status::{Refusal, invalid, link_unknown, shutting_down, status, store_failed};
use chefshat_admission::limits::{COST_OF_ROOM, COST_OF_TOURNAMENT, Key};
use chefshat_base::clock::since_epoch_ms;
use chefshat_base::metrics::StreamKind;
use chefshat_base::tasks::{LongTask, named};
use chefshat_hosting::config::FOLLOW_SEND_TIMEOUT;
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::studies::{NotDone, Studies, StudyHandle, TraceRefusal};
use chefshat_room::ids::Id;
use chefshat_wire::convert;

impl StudyCalls {
    /// The study of a link, and the participant unless it is the open link. Wrong links are charged
    /// like wrong join codes.
    async fn of_any_link(
        &self,
        link: &str,
        key: Key,
    ) -> Result<(Arc<StudyHandle>, Option<u32>), Status> {
        self.calls.may_try_code(key).map_err(Refusal::from)?;
        let mut found = None;
        if let Some(link) = ParticipantLink::parse(link)
            && let Some(handle) = self.here(Studies::full_id(link.study()), key).await?
        {
            let number = handle.number_of(&link);
            found = (number.is_some() || handle.is_open_link(&link)).then_some((handle, number));
        }
        found.ok_or_else(|| {
            self.calls.wrong_code(key);
            link_unknown()
        })
    }

    /// The study and the participant of a link of its own.
    async fn of_link(&self, link: &str, key: Key) -> Result<(Arc<StudyHandle>, u32), Status> {
        match self.of_any_link(link, key).await? {
            (handle, Some(number)) => Ok((handle, number)),
            (_, None) => Err(link_unknown()),
        }
    }

    /// The study, the participant and the session of a secret.
    async fn of_session(
        &self,
        secret: &str,
        key: Key,
    ) -> Result<(Arc<StudyHandle>, u32, u32), Status> {
        let mut found = None;
        if let Some(secret) = SessionSecret::parse(secret)
            && let Some(handle) = self.here(Studies::full_id(secret.study()), key).await?
        {
            let session = handle.session_of(&secret);
            found = session.map(|(number, session)| (handle, number, session));
        }
        found.ok_or_else(|| {
            status(
                Code::Unauthenticated,
                "SESSION_UNKNOWN",
                "this server has no such session; open the link again",
                [("field", "session")],
            )
        })
    }

    /// Reads answers, and charges a caller for storing them.
    fn answers(
        &self,
        answers: Vec<v1::StudyItemAnswer>,
        key: Key,
    ) -> Result<Vec<ItemAnswer>, Status> {
        let bytes = answers.iter().map(|answer| answer.encoded_len()).sum();
        let answers = convert::answers_from_proto(answers).map_err(|item| {
            status(
                Code::InvalidArgument,
                "ANSWER_REFUSED",
                format!("item {item}: the answer is empty"),
                [("item", &item.to_string())],
            )
        })?;
        let rooms = self.studies.rooms();
        rooms.may_store(key, bytes).map_err(Refusal::from)?;
        Ok(answers)
    }
}

/// The status for somebody with this id at the panel who may not begin: it names where the page sends
/// them, or the device that is needed.
fn not_admitted(handle: &StudyHandle, panel_id: &str, problem: NotDone) -> Status {
    let NotDone::Study(refusal) = problem else {
        return not_done(problem);
    };
    if let StudyRefusal::WrongDevice(required) = refusal {
        return wrong_device(handle, required);
    }
    let is_late = matches!(
        refusal,
        StudyRefusal::Closed | StudyRefusal::Full | StudyRefusal::TooManyParticipants
    );
    match handle.recruiting().full_url(panel_id) {
        Some(url) if is_late => {
            let (code, reason) = code_of(&refusal);
            status(code, reason, refusal.to_string(), [("url", url.as_str())])
        }
        _ => refused(refusal),
    }
}

/// The status for a device on which nobody may take part, with what the page says about it.
fn wrong_device(handle: &StudyHandle, required: RequiredDevice) -> Status {
    let refusal = StudyRefusal::WrongDevice(required);
    let (code, reason) = code_of(&refusal);
    let pointer = match required.pointer {
        None | Some(Pointer::None) => "",
        Some(Pointer::Fine) => "fine",
        Some(Pointer::Coarse) => "coarse",
    };
    let min_width = required.min_width.to_string();
    let language = handle.read(|study| study.settings().language.code());
    let metadata = [
        ("pointer", pointer),
        ("min_width", &min_width),
        ("language", language),
    ];
    status(code, reason, refusal.to_string(), metadata)
}

/// What to show next.
fn view_of(handle: &StudyHandle, number: u32, rooms: &Rooms) -> Result<v1::StudyView, Status> {
    // It has begun, so there is something to show.
    (handle.view(number, rooms)).ok_or_else(|| refused(StudyRefusal::Unknown))
}

fn at(number: u32, session: u32, step: u32) -> At {
    At {
        number,
        session,
        step: usize::try_from(step).unwrap_or(usize::MAX),
    }
}

impl ParticipationService for StudyCalls {
    type FollowParticipationStream = Responses<v1::FollowParticipationResponse>;

    async fn join_study(
        &self,
        request: Request<v1::JoinStudyRequest>,
    ) -> Result<Response<v1::JoinStudyResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number) = self.of_any_link(&request.open_link, key).await?;
        if number.is_some() {
            return Err(link_unknown());
        }
        let request_id = <[u8; 32]>::try_from(request.request_id).map_err(|bytes| {
            let problem = format!("{} bytes; give 32 random ones", bytes.len());
            invalid("REQUEST_ID_REFUSED", "request_id", problem)
        })?;
        let panel_id = request.panel_id;
        let joined = Joined {
            request_sha256: Sha256::digest(request_id).to_vec(),
            panel_id: panel_id.clone(),
        };
        self.calls.charge(key, COST_OF_ROOM);
        let rooms = self.studies.rooms();
        (rooms.may_store(key, panel_id.len())).map_err(Refusal::from)?;
        let device = request.device.and_then(convert::device_from_proto);
        let joined = handle.join(key, joined, device).await;
        let number = joined.map_err(|problem| match problem {
            // Somebody from a panel does not wait until others have deleted their studies.
            NotDone::Memory(_) => {
                not_admitted(&handle, &panel_id, StudyRefusal::TooManyParticipants.into())
            }
            problem => not_admitted(&handle, &panel_id, problem),
        })?;
        let link = handle.link(number).link;
        Ok(Response::new(v1::JoinStudyResponse { link }))
    }

    async fn open_study(
        &self,
        request: Request<v1::OpenStudyRequest>,
    ) -> Result<Response<v1::OpenStudyResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number) = self.of_any_link(&request.link, key).await?;
        let Some(number) = number else {
            return Err(status(
                Code::FailedPrecondition,
                "LINK_OPEN",
                "this link is for everyone; take part with JoinStudy, which returns a link of your own",
                [("id_parameter", handle.recruiting().id_parameter.as_str())],
            ));
        };
        let device = request.device.and_then(convert::device_from_proto);
        let opened = handle.open(key, number, device).await;
        let session = opened.map_err(|it| not_admitted(&handle, &handle.panel_id(number), it))?;
        let (saved_answers, step_age_ms) = handle.progress(number, since_epoch_ms());
        Ok(Response::new(v1::OpenStudyResponse {
            saved_answers,
            step_age_ms,
            session: match session {
                0 => String::new(),
                session => handle.session_secret(number, session),
            },
            view: Some(view_of(&handle, number, self.studies.rooms())?),
        }))
    }

    async fn follow_participation(
        &self,
        request: Request<v1::FollowParticipationRequest>,
    ) -> Result<Response<Self::FollowParticipationStream>, Status> {
        let key = charged(request.extensions());
        let (handle, number, session) = self.of_session(&request.into_inner().session, key).await?;
        let what = "too many streams of participants";
        let place = follow::place(&self.participants, key, what)?;
        let rooms = Arc::clone(self.studies.rooms());
        let counted = rooms.metrics().stream(StreamKind::Follow);
        let (response, following) =
            follow::stream(self.closing.clone(), move |sender| async move {
                let _held = (place, counted);
                let _presence = handle.present(number, session).await;
                follow(&handle, &rooms, number, session, &sender).await
            });
        tokio::spawn(named(LongTask::Participation, following));
        Ok(response)
    }

    async fn give_consent(
        &self,
        request: Request<v1::GiveConsentRequest>,
    ) -> Result<Response<v1::GiveConsentResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number, session) = self.of_session(&request.session, key).await?;
        let given = handle.consent(at(number, session, request.step)).await;
        given.map_err(|it| not_admitted(&handle, &handle.panel_id(number), it))?;
        let view = Some(view_of(&handle, number, self.studies.rooms())?);
        Ok(Response::new(v1::GiveConsentResponse { view }))
    }

    async fn answer_questionnaire(
        &self,
        request: Request<v1::AnswerQuestionnaireRequest>,
    ) -> Result<Response<v1::AnswerQuestionnaireResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number, session) = self.of_session(&request.session, key).await?;
        let answers = self.answers(request.answers, key)?;
        let answered = handle.answer(key, at(number, session, request.step), answers);
        answered.await.map_err(not_done)?;
        let view = Some(view_of(&handle, number, self.studies.rooms())?);
        Ok(Response::new(v1::AnswerQuestionnaireResponse { view }))
    }

    async fn save_answers(
        &self,
        request: Request<v1::SaveAnswersRequest>,
    ) -> Result<Response<v1::SaveAnswersResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number, session) = self.of_session(&request.session, key).await?;
        let answers = self.answers(request.answers, key)?;
        let saved = handle.save(key, at(number, session, request.step), answers);
        saved.await.map_err(not_done)?;
        Ok(Response::new(v1::SaveAnswersResponse {}))
    }

    async fn continue_study(
        &self,
        request: Request<v1::ContinueStudyRequest>,
    ) -> Result<Response<v1::ContinueStudyResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number, session) = self.of_session(&request.session, key).await?;
        let at = at(number, session, request.step);
        let continued = handle.proceed(at, self.studies.rooms()).await;
        continued.map_err(not_done)?;
        let view = Some(view_of(&handle, number, self.studies.rooms())?);
        Ok(Response::new(v1::ContinueStudyResponse { view }))
    }

    async fn record_traces(
        &self,
        request: Request<v1::RecordTracesRequest>,
    ) -> Result<Response<v1::RecordTracesResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number, session) = self.of_session(&request.session, key).await?;
        let game =
            Id::parse(&request.game_id).ok_or_else(|| traces_refused(TraceRefusal::GameUnknown))?;
        let rooms = self.studies.rooms();
        let bytes = (request.traces.iter())
            .map(|trace| trace.encoded_len())
            .sum();
        rooms.may_store(key, bytes).map_err(Refusal::from)?;
        let recorded = handle.record_traces((number, session), key, game, request.traces, rooms);
        recorded.await.map_err(traces_refused)?;
        Ok(Response::new(v1::RecordTracesResponse {}))
    }

    async fn get_study_picture(
        &self,
        request: Request<v1::GetStudyPictureRequest>,
    ) -> Result<Response<v1::GetStudyPictureResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number) = self.of_link(&request.link, key).await?;
        let data = handle.picture(number, &request.picture).ok_or_else(|| {
            status(
                Code::NotFound,
                "PICTURE_UNKNOWN",
                "what is shown now has no such picture",
                [("field", "picture")],
            )
        })?;
        Ok(Response::new(v1::GetStudyPictureResponse { data }))
    }

    async fn withdraw_from_study(
        &self,
        request: Request<v1::WithdrawFromStudyRequest>,
    ) -> Result<Response<v1::WithdrawFromStudyResponse>, Status> {
        let key = charged(request.extensions());
        let request = request.into_inner();
        let (handle, number) = self.of_link(&request.link, key).await?;
        if request.delete_data {
            // The journal of the study is written again.
            self.calls.charge(key, COST_OF_TOURNAMENT);
        }
        let withdrawn = handle.withdraw(number, request.delete_data).await;
        withdrawn.map_err(not_done)?;
        let view = Some(view_of(&handle, number, self.studies.rooms())?);
        Ok(Response::new(v1::WithdrawFromStudyResponse { view }))
    }
}

/// Sends what a participant sees whenever it changes, until the end of its participation.
async fn follow(
    handle: &StudyHandle,
    rooms: &Rooms,
    number: u32,
    session: u32,
    sender: &Sender<v1::FollowParticipationResponse>,
) -> Result<(), Status> {
    let mut changes = handle.view_changes(number);
    let mut sent = None;
    loop {
        changes.mark_unchanged();
        if !handle.is_newest(number, session) {
            return Err(refused(StudyRefusal::Superseded));
        }
        let view = view_of(handle, number, rooms)?;
        if sent.as_ref() != Some(&view) {
            send(sender, view.clone()).await?;
        }
        let ended = matches!(view.content, Some(v1::study_view::Content::End(_)));
        sent = Some(view);
        if ended {
            return Ok(());
        }
        changed(&mut changes, handle.stopped()).await?;
    }
}

async fn send(
    sender: &Sender<v1::FollowParticipationResponse>,
    view: v1::StudyView,
) -> Result<(), Status> {
    let message = Ok(v1::FollowParticipationResponse { view: Some(view) });
    let sent = sender.send_timeout(message, FOLLOW_SEND_TIMEOUT).await;
    // The page follows again when it is read again.
    sent.map_err(|_| shutting_down())
}

fn traces_refused(refusal: TraceRefusal) -> Status {
    let (code, reason) = match refusal {
        TraceRefusal::GameUnknown => (Code::NotFound, "GAME_UNKNOWN"),
        TraceRefusal::TooMany => (Code::ResourceExhausted, "TOO_MANY_TRACES"),
        TraceRefusal::Invalid(problem) => {
            return invalid("TRACES_REFUSED", "traces", problem);
        }
        TraceRefusal::Session(refusal) => return refused(refusal),
        TraceRefusal::Store(error) => {
            tracing::error!(%error, "interface traces could not be stored");
            return store_failed();
        }
    };
    status(code, reason, refusal.to_string(), [])
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use prost::Message as _;
    use prost_types::{DescriptorProto, FileDescriptorSet};

    /// Fields that would tell participants what they must not know.
    const FORBIDDEN: [&str; 18] = [
        "attention_check",
        "block",
        "condition",
        "conditions",
        "factor",
        "factors",
        "level",
        "levels",
        "name",
        "order",
        "owner_token",
        "robot_behaviour",
        "scale",
        "seats",
        "seed",
        "seeds",
        "slot",
        "study_id",
    ];

    #[test]
    fn no_message_to_participants_has_a_place_for_a_condition() {
        let set = FileDescriptorSet::decode(chefshat_proto::DESCRIPTORS).expect("descriptors");
        let mut messages: BTreeMap<String, &DescriptorProto> = BTreeMap::new();
        let mut waiting = Vec::new();
        for file in &set.file {
            for message in &file.message_type {
                let path = format!(".{}.{}", file.package(), message.name());
                messages.insert(path, message);
            }
            let services = file.service.iter();
            let ours = services.filter(|service| service.name() == "ParticipationService");
            for method in ours.flat_map(|service| &service.method) {
                waiting.push(method.output_type().to_owned());
            }
        }
        assert_eq!(waiting.len(), 10);
        let mut seen = BTreeSet::new();
        while let Some(path) = waiting.pop() {
            if !seen.insert(path.clone()) {
                continue;
            }
            for field in &messages[&path].field {
                assert!(
                    !FORBIDDEN.contains(&field.name()),
                    "{path}.{}",
                    field.name()
                );
                let is_message = field.type_name().starts_with(".chefshat");
                if is_message && messages.contains_key(field.type_name()) {
                    waiting.push(field.type_name().to_owned());
                }
            }
        }
        assert!(seen.contains(".chefshat.v1.StudyShownGame"));
        assert!(!seen.contains(".chefshat.v1.StudySettings"));
    }
}
