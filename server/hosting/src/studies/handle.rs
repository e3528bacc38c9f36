//! The handle of one study: what others can read of it, and messages to its task.

use std::slice;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use bytes::Bytes;
use chefshat_proto::v1;
use chefshat_study::{
    At, Change, Content, Device, ItemAnswer, Joined, NewParticipants, Participant, ParticipantLink,
    Recruiting, Refusal, SessionSecret, Study,
};
use tokio::sync::watch;

use super::data::StudyData;
use super::message::{Command, Message, NotDeleted};
use super::task::StudyTask;
use crate::journaled::{Handle, Stopped};
use crate::rooms::Rooms;
use chefshat_admission::limits::{Key, Permit, Refused};
use chefshat_base::tasks::short;
use chefshat_room::ids::{GameId, RoomId, RoomToken, SecretHash, Token};
use chefshat_store::StoreError;
use chefshat_store::units::{StoredTraces, UnitKey, UnitWrite};
use chefshat_wire::convert::{self, StudyPlan};

/// Most interface traces in one request.
pub const MAX_TRACES: usize = 500;
/// Most interface traces of a game.
pub const MAX_TRACES_OF_GAME: usize = 20_000;
/// Longest target of an interface trace, characters.
const MAX_TRACE_TARGET: usize = 64;

/// Why interface traces are refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TraceRefusal {
    /// The participant has no such game.
    #[error("the participant has no such game")]
    GameUnknown,
    /// One is invalid, or there are too many.
    #[error("{0}")]
    Invalid(String),
    /// The game has too many.
    #[error("a game has at most {MAX_TRACES_OF_GAME} interface traces")]
    TooMany,
    /// The session may not act.
    #[error(transparent)]
    Session(#[from] Refusal),
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// Why a study does not do what it is asked for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NotDone {
    /// The study refuses it.
    #[error(transparent)]
    Study(#[from] Refusal),
    /// The server has no memory for it.
    #[error(transparent)]
    Memory(#[from] Refused),
    /// The file system keeps samples of the participant, which are to be deleted.
    #[error("samples of the participant cannot be deleted yet")]
    Files,
    /// It has stopped.
    #[error(transparent)]
    Stopped(#[from] Stopped),
}

/// A study of this server.
pub type StudyHandle = Handle<StudyTask>;

impl StudyHandle {
    /// Its settings.
    pub fn plan(&self) -> &StudyPlan {
        &self.plan
    }

    /// Its settings as a message, every field set.
    pub fn settings(&self) -> &v1::StudySettings {
        &self.header.settings
    }

    /// The study as a message.
    pub fn describe(&self) -> v1::Study {
        let study = self.committed();
        let header = &self.header;
        let open_link = match study.settings().recruiting.open_link {
            true => ParticipantLink::open(&header.key, self.short_id()).to_text(),
            false => String::new(),
        };
        let created_at_ms = header.created_at_ms;
        convert::study_to_proto(
            header.id,
            &header.settings,
            created_at_ms,
            open_link,
            &study,
        )
    }

    /// The study as a message, with the files of its pictures.
    pub fn describe_with_pictures(&self) -> v1::Study {
        let mut study = self.describe();
        if let Some(settings) = &mut study.settings {
            settings.pictures.clone_from(&self.header.settings.pictures);
        }
        study
    }

    /// The file of a picture that a participant is shown now, by the name that the text has.
    pub fn picture(&self, number: u32, name: &str) -> Option<Bytes> {
        let pictures = &self.header.settings.pictures;
        let picture = pictures.iter().find(|picture| picture.name == name)?;
        let view = self.committed().view(number)?;
        view.names(name).then(|| picture.data.clone())
    }

    /// A participant as a message, for researchers.
    pub fn participant(&self, number: u32, rooms: &Rooms) -> Option<v1::StudyParticipant> {
        let study = self.committed();
        self.participant_of(&study, number, rooms)
    }

    /// All participants as messages, by number.
    pub fn participants(&self, rooms: &Rooms) -> Vec<v1::StudyParticipant> {
        let study = self.committed();
        (study.participants().keys())
            .filter_map(|number| self.participant_of(&study, *number, rooms))
            .collect()
    }

    fn participant_of(
        &self,
        study: &Study,
        number: u32,
        rooms: &Rooms,
    ) -> Option<v1::StudyParticipant> {
        let join_code = |room| {
            let header = rooms.header(room);
            header.map_or_else(String::new, |header| header.join_code.clone())
        };
        convert::study_participant(study, &self.plan, number, join_code)
    }

    /// The link of a participant.
    pub fn link(&self, number: u32) -> v1::StudyLink {
        let study = self.committed();
        let participant = study.participant(number);
        v1::StudyLink {
            number,
            pseudonym: participant.map_or_else(String::new, |it| it.pseudonym.clone()),
            link: ParticipantLink::new(&self.header.key, self.short_id(), number).to_text(),
            joined: participant.is_some_and(|it| it.joined.is_some()),
            test: participant.is_some_and(|it| it.test),
            planned_with: participant.and_then(|it| it.planned).unwrap_or(0),
        }
    }

    /// The participant with this link.
    pub fn number_of(&self, link: &ParticipantLink) -> Option<u32> {
        let number = link.verify(&self.header.key)?;
        self.committed().participant(number).map(|_| number)
    }

    /// Whether this is the open link of the study.
    pub fn is_open_link(&self, link: &ParticipantLink) -> bool {
        link.is_open() && link.verify(&self.header.key).is_some() && self.recruiting().open_link
    }

    /// How people without a link of their own take part.
    pub fn recruiting(&self) -> &Recruiting {
        &self.plan.core.recruiting
    }

    /// The id of a participant at the panel; empty if there is none.
    pub fn panel_id(&self, number: u32) -> String {
        let study = self.committed();
        let participant = study.participant(number);
        participant.map_or_else(String::new, |it| it.panel_id().to_owned())
    }

    /// The participant and the number of its session with this secret.
    pub fn session_of(&self, secret: &SessionSecret) -> Option<(u32, u32)> {
        let (number, session) = secret.verify(&self.header.key)?;
        self.committed()
            .participant(number)
            .map(|_| (number, session))
    }

    /// The secret of a session.
    pub fn session_secret(&self, number: u32, session: u32) -> String {
        let key = &self.header.key;
        SessionSecret::new(key, self.short_id(), number, session).to_text()
    }

    fn short_id(&self) -> [u8; 12] {
        std::array::from_fn(|index| self.header.id.bytes()[index])
    }

    /// What a participant sees now; `None` if it has not begun.
    pub fn view(&self, number: u32, rooms: &Rooms) -> Option<v1::StudyView> {
        let mut view = self.committed().view(number)?;
        if let Content::Game(game) = &mut view.content
            && !game.ended
        {
            // A game is placed before its room exists.
            game.place = game
                .place
                .filter(|(room, _)| rooms.get(RoomId::from_bytes(*room)).is_some());
        }
        Some(convert::study_view(view, |room| {
            self.ticket_of(room, number).to_text()
        }))
    }

    /// Whether this is the newest session of a participant.
    pub fn is_newest(&self, number: u32, session: u32) -> bool {
        let study = self.committed();
        study
            .participant(number)
            .is_some_and(|it| it.session == session)
    }

    /// The ticket of a participant's seat in a room. One who has no group has the room alone.
    pub(super) fn ticket_of(&self, room: RoomId, number: u32) -> RoomToken {
        let has_group = |study: &Study| {
            study
                .participant(number)
                .is_some_and(|it| it.group.is_some())
        };
        let mut member = [0; 32];
        if self.read(has_group) {
            member[..4].copy_from_slice(&number.to_be_bytes());
        }
        Token::of_request(room, &SecretHash::from_bytes(self.header.key), &member)
    }

    /// Adds participants, and charges a caller for their memory. Returns the number of the first.
    ///
    /// # Errors
    /// See [`NotDone`].
    pub async fn add(&self, key: Key, new: NewParticipants) -> Result<u32, NotDone> {
        let data = Arc::clone(&self.shared.data);
        let memory = data.for_participants(key, &new.pseudonyms)?;
        self.command(move |study, _| {
            let first = study.next_number();
            let changes = study.add(&new)?;
            // Here, because the caller may go before it gets its answer.
            data.keep_participants(memory);
            Ok((changes, first))
        })
        .await
    }

    /// Adds a participant who joins by the open link, unless the request is repeated, and charges a
    /// caller for its memory. Returns its number.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn join(
        &self,
        key: Key,
        joined: Joined,
        device: Option<Device>,
    ) -> Result<u32, NotDone> {
        // A repeated request takes no memory.
        if let Some(number) = self.committed().joined_by(&joined.request_sha256) {
            return Ok(number);
        }
        let data = Arc::clone(&self.shared.data);
        let memory = data.for_participants(key, slice::from_ref(&joined.panel_id))?;
        self.command(move |study, now_ms| {
            let (number, change) = study.join(joined, device.as_ref(), now_ms)?;
            if change.is_some() {
                data.keep_participants(memory);
            }
            Ok((Vec::from_iter(change), number))
        })
        .await
    }

    /// Opens a session of a participant. Returns its number; 0 if there is only the end to show. The
    /// device, for whose memory a caller is charged, is not stored if there is none for it.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn open(
        &self,
        key: Key,
        number: u32,
        device: Option<Device>,
    ) -> Result<u32, NotDone> {
        let memory = (device.as_ref()).and_then(|device| self.shared.data.for_device(key, device));
        let data = Arc::clone(&self.shared.data);
        self.command(move |study, now_ms| {
            let Some(mut change) = study.open(number, device, now_ms)? else {
                return Ok((Vec::new(), 0));
            };
            match (memory, &mut change) {
                (Some(memory), _) => data.keep(number, memory),
                (None, Change::Opened(opened)) => opened.device = None,
                (None, _) => {}
            }
            let before = study.participant(number).map_or(0, |it| it.session);
            Ok((vec![change], before + 1))
        })
        .await
    }

    /// Records the consent of a participant.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn consent(&self, at: At) -> Result<u32, NotDone> {
        self.command(move |study, now_ms| Ok((vec![study.consent(at, now_ms)?], 0)))
            .await
    }

    /// Records the answers of a participant, and charges a caller for their memory.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn answer(&self, key: Key, at: At, answers: Vec<ItemAnswer>) -> Result<u32, NotDone> {
        let change = move |study: &Study, answers, now_ms| study.answer(at, answers, now_ms);
        self.keep(key, at.number, answers, change, StudyData::keep_answers)
            .await
    }

    /// Saves what a participant has entered so far, and charges a caller for its memory.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn save(&self, key: Key, at: At, answers: Vec<ItemAnswer>) -> Result<u32, NotDone> {
        let change = move |study: &Study, answers, _| study.save(at, answers);
        self.keep(
            key,
            at.number,
            answers,
            change,
            StudyData::keep_saved_answers,
        )
        .await
    }

    /// Makes the change of answers of a participant, and charges a caller for their memory, which
    /// `kept` holds.
    async fn keep(
        &self,
        key: Key,
        number: u32,
        answers: Vec<ItemAnswer>,
        change: impl FnOnce(&Study, Vec<ItemAnswer>, u64) -> Result<Change, Refusal>
        + Send
        + Sync
        + 'static,
        kept: fn(&StudyData, u32, Permit),
    ) -> Result<u32, NotDone> {
        let data = Arc::clone(&self.shared.data);
        let memory = data.for_answers(key, &answers)?;
        self.command(move |study, now_ms| {
            let change = change(study, answers, now_ms)?;
            // Here, because the caller may go before it gets its answer.
            kept(&data, number, memory);
            Ok((vec![change], 0))
        })
        .await
    }

    /// What a participant has entered at its step so far, and how long ago it reached the step, in
    /// milliseconds.
    pub fn progress(&self, number: u32, now_ms: u64) -> (Vec<v1::StudyItemAnswer>, u64) {
        let study = self.committed();
        let Some(participant) = study.participant(number) else {
            return (Vec::new(), 0);
        };
        let reached_ms = participant.reached_at_ms.last().copied();
        let age_ms = now_ms.saturating_sub(reached_ms.unwrap_or(now_ms));
        (
            convert::answers_to_proto(&participant.saved_answers),
            age_ms,
        )
    }

    /// Continues with the next step of a participant. The running game of a test participant is closed
    /// before it can continue, and those drop out for whom its game waits.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn proceed(&self, at: At, rooms: &Rooms) -> Result<u32, NotDone> {
        let command = self.command(move |study, now_ms| Ok((vec![study.proceed(at, now_ms)?], 0)));
        let proceeded = command.await;
        if proceeded != Err(NotDone::Study(Refusal::GameNotOver)) {
            return proceeded;
        }
        if let Some(room) = self.read(|study| study.room_of_test(at.number))
            && let Some(room) = rooms.get(RoomId::from_bytes(room))
        {
            room.close_without_token().await;
            return Ok(0);
        }
        self.command(move |study, now_ms| {
            let late = study.without_late(at.number, now_ms);
            match late.is_empty() {
                true => Err(Refusal::GameNotOver),
                false => Ok((late, 0)),
            }
        })
        .await
    }

    /// Withdraws a participant. If its data are to be deleted, returns when they are; at once, if others
    /// play on in its game, which is over first.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn withdraw(&self, number: u32, delete_data: bool) -> Result<(), NotDone> {
        self.command(move |study, now_ms| {
            let change = study.withdraw(number, delete_data, now_ms)?;
            Ok((Vec::from_iter(change), 0))
        })
        .await?;
        if self.read(|study| study.plays_with_others(number)) {
            return Ok(());
        }
        let mut changes = self.changes();
        while delete_data && let Some(failed) = self.deletion_failed(number) {
            if failed {
                return Err(NotDone::Files);
            }
            tokio::select! {
                changed = changes.changed() => changed.map_err(|_| Stopped)?,
                () = self.stopped() => return Err(Stopped.into()),
            }
        }
        Ok(())
    }

    /// Removes a participant, and adds another one if wanted, for whose memory a caller is charged.
    /// Returns the number of the other; 0 if there is none.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn remove(&self, key: Key, number: u32, replace: bool) -> Result<u32, NotDone> {
        let data = Arc::clone(&self.shared.data);
        let memory = match replace {
            true => Some(data.for_participants(key, &[String::new()])?),
            false => None,
        };
        self.command(move |study, now_ms| {
            let mut changes = Vec::from_iter(study.remove(number, now_ms)?);
            let Some(memory) = memory else {
                return Ok((changes, 0));
            };
            let next = study.next_number();
            changes.extend(study.replacement(number)?);
            data.keep_participants(memory);
            Ok((changes, next))
        })
        .await
    }

    /// Closes the study.
    ///
    /// # Errors
    /// As [`StudyHandle::add`].
    pub async fn close(&self) -> Result<(), NotDone> {
        let closed = self.command(|study, _| Ok((Vec::from_iter(study.close()), 0)));
        closed.await.map(drop)
    }

    /// Deletes the study, and returns the number of its games once all is deleted. Participants
    /// in the middle of it are removed if `force` is set.
    ///
    /// # Errors
    /// See [`NotDeleted`].
    pub(super) async fn delete(&self, force: bool) -> Result<usize, NotDeleted> {
        self.ask(|reply| Message::Delete { force, reply }).await?
    }

    /// Records interface traces of a participant's game.
    ///
    /// # Errors
    /// See [`TraceRefusal`].
    pub async fn record_traces(
        &self,
        (number, session): (u32, u32),
        key: Key,
        game: GameId,
        traces: Vec<v1::StudyTrace>,
        rooms: &Rooms,
    ) -> Result<(), TraceRefusal> {
        check_traces(&traces).map_err(TraceRefusal::Invalid)?;
        // Deletion waits for it, so that nothing is added after the data were deleted.
        let mut counts = Arc::clone(&self.shared.traces).lock_owned().await;
        {
            let study = self.committed();
            let participant = study.participant(number).filter(|it| !it.data_deleted);
            let Some(participant) = participant else {
                return Err(Refusal::Over.into());
            };
            if participant.session != session {
                return Err(Refusal::Superseded.into());
            }
            if !(participant.games.iter()).any(|played| played.placed.game == *game.bytes()) {
                return Err(TraceRefusal::GameUnknown);
            }
            if !study.settings().traces || traces.is_empty() {
                return Ok(());
            }
        }
        let count = counts.entry((number, game)).or_default();
        if *count + traces.len() > MAX_TRACES_OF_GAME {
            return Err(TraceRefusal::TooMany);
        }
        if !rooms.store().outlives_server() {
            let data = &self.shared.data;
            let memory = data.for_traces(key, &traces).ok_or(TraceRefusal::TooMany)?;
            data.keep(number, memory);
        }
        *count += traces.len();
        let traces = StoredTraces {
            number,
            session,
            game,
            traces,
        };
        let unit = UnitKey::Study(self.id());
        let traces = UnitWrite::Traces(traces);
        let store = Arc::clone(rooms.store());
        // Deletion waits for it even if the caller goes.
        let writing = tokio::spawn(short("one write", async move {
            let written = store.write_unit(unit, traces).await;
            drop(counts);
            written
        }));
        let written = writing.await;
        Ok(written.unwrap_or_else(|error| Err(StoreError::Failed(error.to_string())))?)
    }

    /// Adds a stream that shows the study to a participant. While the value lives, the participant
    /// is present.
    pub async fn present(self: &Arc<Self>, number: u32, session: u32) -> Presence {
        let stream = self.shared.streams.fetch_add(1, Ordering::Relaxed);
        let message = Message::Connected {
            number,
            session,
            stream,
        };
        // On failure the server ends, and the stream with it.
        let _ = self.mailbox.send(message).await;
        Presence {
            handle: Arc::clone(self),
            number,
            stream,
        }
    }

    /// Counts the changes of a participant's view.
    pub fn view_changes(&self, number: u32) -> watch::Receiver<u64> {
        let mut views = self.shared.views.lock();
        let sender = views.entry(number).or_insert_with(|| watch::Sender::new(0));
        sender.subscribe()
    }

    /// Whether nobody waits for it any more: it is closed, and nobody but test participants is active.
    pub fn is_complete(&self) -> bool {
        let study = self.committed();
        study.is_closed()
            && !study
                .participants()
                .values()
                .any(Participant::is_in_the_middle)
    }

    /// Reads the committed state.
    pub fn read<T>(&self, read: impl FnOnce(&Study) -> T) -> T {
        read(&self.committed())
    }

    /// Notifies the streams of a participant.
    pub(super) fn notify_participant(&self, number: u32) {
        if let Some(sender) = self.shared.views.lock().get(&number) {
            sender.send_modify(|count| *count += 1);
        }
    }

    /// Whether the file system has refused to delete a participant's data; `None` if they are not being
    /// deleted.
    fn deletion_failed(&self, number: u32) -> Option<bool> {
        self.shared.deleting.lock().get(&number).copied()
    }

    async fn command(
        &self,
        command: impl FnOnce(&Study, u64) -> Result<(Vec<Change>, u32), Refusal> + Send + Sync + 'static,
    ) -> Result<u32, NotDone> {
        let command: Command = Box::new(command);
        Ok(self.ask(|reply| Message::Command(command, reply)).await??)
    }
}

/// A stream that shows the study to a participant.
#[derive(Debug)]
pub struct Presence {
    handle: Arc<StudyHandle>,
    number: u32,
    stream: u64,
}

impl Drop for Presence {
    fn drop(&mut self) {
        let (handle, number, stream) = (Arc::clone(&self.handle), self.number, self.stream);
        // The mailbox may be full: the message must not be lost. Without a runtime the server has
        // ended.
        if let Ok(runtime) = tokio::runtime::Handle::try_current() {
            runtime.spawn(short("one message", async move {
                let _ = handle
                    .mailbox
                    .send(Message::Disconnected { number, stream })
                    .await;
            }));
        }
    }
}

fn check_traces(traces: &[v1::StudyTrace]) -> Result<(), String> {
    if traces.len() > MAX_TRACES {
        let count = traces.len();
        return Err(format!(
            "{count} traces; send at most {MAX_TRACES} at a time"
        ));
    }
    for trace in traces {
        if trace.kind() == v1::StudyTraceKind::Unspecified {
            return Err("a trace has no kind".to_owned());
        }
        if trace.target.chars().count() > MAX_TRACE_TARGET
            || trace.target.chars().any(char::is_control)
        {
            return Err(format!(
                "a target has at most {MAX_TRACE_TARGET} characters, none of them a control character"
            ));
        }
    }
    Ok(())
}
