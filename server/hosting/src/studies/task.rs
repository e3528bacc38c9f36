//! The task of one study: what its changes bring about. `games` acts on games and their rooms.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_study::{Change, Ended, Refusal, SettingsProblem, Status, Study};
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;
use tracing::{info, warn};

use super::data::{RETRY_STUDIES, StudyData, memory_of};
use super::message::{Command, Message, NotDeleted};
use super::state::{Budgets, StudyShared};
use crate::config::MAX_STUDIES;
use crate::journaled::{Folded, Handle, Journaled, Unit, UnitHeader};
use crate::rooms::Rooms;
use chefshat_admission::limits::{Key, Refused};
use chefshat_base::clock::{RoomClock, TimeOfDay, millis};
use chefshat_base::tasks::LongTask;
use chefshat_room::ids::{self, GameId, RoomId, SecretHash, StudyId};
use chefshat_store::StoreError;
use chefshat_store::samples::Undeleted;
use chefshat_store::studies::{StoredStudy, StudyHeader, changes_to_bytes};
use chefshat_store::units::{StoredUnit, UnitKey, UnitWrite};
use chefshat_wire::convert::{self, StudyPlan};

/// Messages that may wait for one study.
const STUDY_MAILBOX: usize = 256;

impl UnitHeader for StudyHeader {
    type Kind = ids::Study;

    fn id(&self) -> StudyId {
        self.id
    }

    fn owner(&self) -> &SecretHash {
        &self.owner
    }

    fn created_at_ms(&self) -> u64 {
        self.created_at_ms
    }
}

/// Time after which data are deleted again that the file system kept.
pub(super) const DELETION_RETRY: Duration = Duration::from_secs(300);

/// Runs a study.
pub struct StudyTask {
    pub(super) unit: Unit<Self>,
    pub(super) now: TimeOfDay,
    /// Streams of participants.
    streams: BTreeMap<u32, u64>,
    /// Participants for whom a game may be due.
    pub(super) touched: BTreeSet<u32>,
    /// Participants with a running game.
    pub(super) playing: BTreeSet<u32>,
    /// Those of them whose game has no room yet.
    pub(super) without_room: BTreeSet<u32>,
    /// Since the task began: a pause of the process makes no participant late.
    clock: RoomClock,
    /// Rooms that were asked to close.
    pub(super) closing: BTreeSet<RoomId>,
    /// Rooms that were asked to give up the seat of a participant.
    pub(super) retired: BTreeSet<(RoomId, u32)>,
    /// Those who wait for the deletion of the study, once that is requested.
    deletion: Vec<oneshot::Sender<Result<usize, NotDeleted>>>,
    /// When data are deleted again that the file system kept.
    delete_again: Option<Instant>,
}

impl Journaled for StudyTask {
    type Kind = ids::Study;
    type Header = StudyHeader;
    type Plan = StudyPlan;
    type State = Study;
    type Entry = Change;
    type Message = Message;
    type Shared = StudyShared;
    type Common = Budgets;
    type SettingsProblem = SettingsProblem;

    const TASK: LongTask = LongTask::Study;
    const MAILBOX: usize = STUDY_MAILBOX;
    const MOST: usize = MAX_STUDIES;

    fn header_to_bytes(header: &StudyHeader) -> Vec<u8> {
        header.to_bytes()
    }

    fn row_to_bytes(changes: &[Change]) -> Vec<u8> {
        changes_to_bytes(changes)
    }

    fn fold(id: StudyId, stored: &StoredUnit) -> Result<Folded<Self>, String> {
        let stored = StoredStudy::decode(id, stored).map_err(|problem| problem.to_string())?;
        let (plan, state) = restored(&stored).map_err(|problem| problem.to_string())?;
        Ok(Folded {
            header: stored.header,
            plan,
            state,
            rows: stored.rows,
        })
    }

    fn share(common: &Budgets, folded: &Folded<Self>) -> StudyShared {
        let memory = memory_of(&folded.header.settings).div_ceil(1024);
        let memory = (common.memory).take_many_anyway(Self::key_of(folded.header.id), memory);
        let data = StudyData::of(&folded.state, folded.header.id, &common.data);
        StudyShared::new(memory, Arc::new(data))
    }

    fn key_of(id: StudyId) -> Key {
        Key::Study(id)
    }

    fn too_many(limit: u64) -> Refused {
        Refused {
            reason: "TOO_MANY_STUDIES",
            what: "too many studies",
            limit,
            retry_after: RETRY_STUDIES,
        }
    }

    fn apply(state: &mut Study, change: &Change) {
        state.fold(change);
    }

    /// Its participants' data can still be deleted.
    fn is_over(_: &Study) -> bool {
        false
    }

    /// Closes a room that failed and was resumed: its game counts as broken off.
    fn enter(handle: &Handle<Self>, rooms: &Arc<Rooms>) {
        let needed = handle.read(|study| {
            let games = study.participants().values().flat_map(|it| &it.games);
            let running = games.filter(|game| game.ended.is_none());
            running.map(|game| convert::room_of(&game.placed)).collect()
        });
        rooms.close_all_but(handle.id().unit(), &needed);
    }

    fn new(unit: Unit<Self>, common: &Budgets) -> Self {
        let participants = unit.state.participants();
        let playing = participants
            .iter()
            .filter(|(_, it)| it.games.last().is_some_and(|game| game.ended.is_none()));
        let playing = playing.map(|(number, _)| *number).collect();
        // A server that ended in the middle of a deletion completes it.
        let deleted = participants.iter().filter(|(_, it)| it.data_deleted);
        *unit.handle.shared.deleting.lock() = deleted.map(|(number, _)| (*number, false)).collect();
        Self {
            clock: RoomClock::of_age(Duration::ZERO, unit.rooms.process_clock()),
            unit,
            now: common.now,
            streams: BTreeMap::new(),
            touched: BTreeSet::new(),
            playing,
            without_room: BTreeSet::new(),
            closing: BTreeSet::new(),
            retired: BTreeSet::new(),
            deletion: Vec::new(),
            delete_again: None,
        }
    }

    fn unit(&self) -> &Unit<Self> {
        &self.unit
    }

    fn unit_mut(&mut self) -> &mut Unit<Self> {
        &mut self.unit
    }

    async fn receive(&mut self, message: Message) -> Result<(), StoreError> {
        match message {
            Message::Command(command, reply) => {
                let executed = self.execute(command);
                self.unit.reply(reply, executed);
            }
            Message::Delete { force, reply } => {
                let participants = self.unit.state.participants();
                let middle = participants.values().filter(|it| it.is_in_the_middle());
                let middle = middle.count();
                if middle > 0 && !force {
                    // The caller may have gone.
                    let _ = reply.send(Err(NotDeleted::Running(middle)));
                    return Ok(());
                }
                let active = participants.iter();
                let active = active.filter(|(_, it)| it.status == Status::Active);
                let active: Vec<u32> = active.map(|(number, _)| *number).collect();
                let at_ms = (self.now)();
                for number in active {
                    self.fold(Change::Removed(Ended { number, at_ms }));
                }
                if let Some(change) = self.unit.state.close() {
                    self.fold(change);
                }
                self.deletion.push(reply);
            }
            Message::Connected {
                number,
                session,
                stream,
            } => {
                let newest = self.unit.state.participant(number).map(|it| it.session);
                if newest == Some(session) {
                    self.streams.insert(number, stream);
                    self.set_connected(number, true);
                }
            }
            Message::Disconnected { number, stream } => {
                if self.streams.get(&number) == Some(&stream) {
                    self.streams.remove(&number);
                    self.set_connected(number, false);
                }
            }
        }
        Ok(())
    }

    async fn follow(&mut self) -> Result<(), StoreError> {
        self.count_ended_games().await?;
        let now_ms = (self.now)();
        loop {
            let elapsed_ms = self.elapsed_ms();
            let changes = self.unit.state.next(now_ms, elapsed_ms);
            if changes.is_empty() {
                break;
            }
            self.fold_all(changes, now_ms);
        }
        self.place_due_games();
        Ok(())
    }

    fn announce(&mut self, changes: &[Change]) {
        let numbers: BTreeSet<u32> = changes.iter().filter_map(Change::number).collect();
        // What somebody has entered so far changes nothing for others.
        let seen = changes.iter().filter(|it| !matches!(it, Change::Saved(_)));
        let seen: BTreeSet<u32> = seen.filter_map(Change::number).collect();
        let others = seen.iter();
        let others = others.flat_map(|number| self.unit.state.affected_with(*number));
        let affected: BTreeSet<u32> = numbers.iter().copied().chain(others).collect();
        for number in affected {
            self.unit.handle.notify_participant(number);
        }
    }

    async fn act(&mut self) -> Result<(), StoreError> {
        self.make_rooms().await?;
        self.close_rooms();
        Ok(())
    }

    /// Deletes the data of participants who want it, once their games are over: of all of them
    /// together, because each time the whole journal is read and written.
    async fn delete(&mut self) -> Result<(), StoreError> {
        let is_again = self.delete_again.is_none_or(|at| at <= Instant::now());
        if is_again {
            self.delete_again = None;
        }
        let deleting = self.unit.handle.shared.deleting.lock().clone();
        // What the file system keeps of one holds up no other.
        let due = (deleting.into_iter())
            .filter(|(_, has_failed)| is_again || !has_failed)
            .map(|(number, _)| number);
        let due: BTreeSet<u32> = due.filter(|it| !self.playing.contains(it)).collect();
        if due.is_empty() {
            return Ok(());
        }
        let handle = Arc::clone(&self.unit.handle);
        let mut counts = handle.shared.traces.lock().await;
        let is_changed = self.forget(&due).await?;
        let played = due
            .iter()
            .filter_map(|number| self.unit.state.participant(*number));
        let games: Vec<_> = played.flat_map(|it| &it.games).collect();
        let ids: BTreeSet<GameId> = games
            .iter()
            .map(|game| convert::game_of(&game.placed))
            .collect();
        counts.retain(|(number, _), _| !due.contains(number));
        for game in &games {
            self.unit.rooms.forget(convert::room_of(&game.placed));
        }
        let count = ids.len();
        let ids = ids.into_iter().collect();
        let undeleted = self.unit.rooms.delete_games(ids).await?;
        for number in &due {
            handle.shared.data.forget_answers(*number);
        }
        if !undeleted.is_empty() {
            warn_of(handle.id(), &undeleted);
            let again = Instant::now() + DELETION_RETRY;
            self.delete_again.get_or_insert(again);
        }
        let failed = |number: u32| {
            let participant = self.unit.state.participant(number);
            let mut games = participant.iter().flat_map(|it| &it.games);
            games.any(|game| undeleted.contains_key(&convert::game_of(&game.placed)))
        };
        handle.shared.deleting.lock().retain(|number, has_failed| {
            if !due.contains(number) {
                return true;
            }
            *has_failed = failed(*number);
            *has_failed
        });
        if is_changed {
            info!(study = %handle.id(), participants = due.len(), games = count, "the data of participants were deleted");
        }
        self.unit.has_changed = true;
        Ok(())
    }

    /// Deletes the study if that was requested and no game runs any more. Returns whether it did.
    async fn conclude(&mut self, inbox: &mut mpsc::Receiver<Message>) -> Result<bool, StoreError> {
        if self.deletion.is_empty() || !self.playing.is_empty() {
            return Ok(false);
        }
        let participants = self.unit.state.participants().values();
        let played = participants.flat_map(|it| it.games.iter().map(|game| (it.test, game)));
        let played: Vec<_> = played.collect();
        for (_, game) in &played {
            self.unit.rooms.forget(convert::room_of(&game.placed));
        }
        // Those of a group have one game.
        let games: BTreeMap<GameId, bool> = (played.iter())
            .map(|(test, game)| (convert::game_of(&game.placed), *test))
            .collect();
        let count = games.values().filter(|test| !**test).count();
        let games = games.into_keys().collect();
        let store = self.unit.rooms.store();
        // The games first: a repetition completes what was interrupted in between.
        let undeleted = self.unit.rooms.delete_games(games).await?;
        if !undeleted.is_empty() {
            warn_of(self.unit.handle.id(), &undeleted);
            for reply in self.deletion.drain(..) {
                // The caller may have gone.
                let _ = reply.send(Err(NotDeleted::Files(undeleted.len())));
            }
            return Ok(false);
        }
        let unit = UnitKey::Study(self.unit.handle.id());
        store.write_unit(unit, UnitWrite::Delete).await?;
        info!(study = %self.unit.handle.id(), games = count, "a study was deleted");
        // Those who asked while it was deleted get the same answer.
        inbox.close();
        while let Ok(message) = inbox.try_recv() {
            if let Message::Delete { reply, .. } = message {
                self.deletion.push(reply);
            }
        }
        self.unit.send_replies();
        for reply in self.deletion.drain(..) {
            // The caller may have gone.
            let _ = reply.send(Ok(count));
        }
        Ok(true)
    }

    fn wake_at(&self) -> Option<Instant> {
        let by_core = self.unit.state.wake_in((self.now)(), self.elapsed_ms());
        let by_core = by_core.map(|wait_ms| Instant::now() + Duration::from_millis(wait_ms));
        let by_rooms = self.unit.retry.at();
        let by_files = self.delete_again;
        by_core.into_iter().chain(by_rooms).chain(by_files).min()
    }
}

impl StudyTask {
    fn execute(&mut self, command: Command) -> Result<u32, Refusal> {
        if !self.deletion.is_empty() {
            return Err(Refusal::Closed);
        }
        let now_ms = (self.now)();
        let (changes, number) = command(&self.unit.state, now_ms)?;
        self.fold_all(changes, now_ms);
        Ok(number)
    }

    /// Applies changes, and the ends of participants whom they screen out.
    fn fold_all(&mut self, changes: Vec<Change>, now_ms: u64) {
        let participants: Vec<u32> = changes.iter().filter_map(Change::number).collect();
        changes.into_iter().for_each(|change| self.fold(change));
        for number in participants {
            let ended = self.unit.state.screen_out(number, now_ms);
            ended.into_iter().for_each(|change| self.fold(change));
        }
    }

    /// Deletes the data of participants from the journal. Returns whether it had them.
    async fn forget(&mut self, forgotten: &BTreeSet<u32>) -> Result<bool, StoreError> {
        // A server before may have rewritten it, and ended before their games were deleted. Traces
        // were deleted with it.
        let state = &self.unit.state;
        if !forgotten.iter().any(|number| state.is_recorded(*number)) {
            return Ok(false);
        }
        let store = self.unit.rooms.store();
        let id = self.unit.handle.id();
        let Some(stored) = store.unit(UnitKey::Study(id)).await? else {
            return Ok(false);
        };
        let numbers = forgotten.clone();
        // A long journal takes a while, and others are played meanwhile.
        let forgetting = tokio::task::spawn_blocking(move || {
            let mut changes = StoredStudy::decode(id, &stored)?.changes;
            let mut is_changed = false;
            for change in &mut changes {
                if let Some(number) = change.number().filter(|it| numbers.contains(it)) {
                    is_changed |= change.forget(number);
                }
            }
            Ok::<_, StoreError>(is_changed.then(|| changes_to_bytes(&changes)))
        });
        let entries = (forgetting.await).map_err(|error| {
            StoreError::Failed(format!("rewriting a journal failed: {error}"))
        })??;
        let Some(entries) = entries else {
            return Ok(false);
        };
        let forgotten = forgotten.iter().copied().collect();
        let rewrite = UnitWrite::Rewrite { entries, forgotten };
        store.write_unit(UnitKey::Study(id), rewrite).await?;
        self.unit.rows = 1;
        Ok(true)
    }

    /// Since the task began, by a clock that never jumps.
    fn elapsed_ms(&self) -> u64 {
        millis(self.clock.now())
    }

    fn show_connected(&mut self, number: u32, connected: bool) {
        let elapsed_ms = self.elapsed_ms();
        self.unit.state.set_connected(number, connected, elapsed_ms);
        (self.unit.handle.committed()).set_connected(number, connected, elapsed_ms);
    }

    fn set_connected(&mut self, number: u32, connected: bool) {
        self.show_connected(number, connected);
        self.touched.insert(number);
        for other in self.unit.state.affected_with(number) {
            self.unit.handle.notify_participant(other);
        }
        self.unit.has_changed = true;
    }

    /// Applies a change and adds it to the next commit.
    pub(super) fn fold(&mut self, change: Change) {
        self.unit.push(change.clone());
        if let Some(number) = change.number() {
            self.touched.insert(number);
            self.touched.extend(self.unit.state.affected_with(number));
        }
        match &change {
            Change::Placed(placed) => {
                self.playing.insert(placed.number);
                self.without_room.insert(placed.number);
            }
            Change::GameEnded(ended) => {
                self.playing.remove(&ended.number);
                self.without_room.remove(&ended.number);
            }
            Change::Opened(opened) => {
                // The stream of the earlier session ends.
                self.streams.remove(&opened.number);
                self.show_connected(opened.number, false);
            }
            Change::Withdrew(withdrew) if withdrew.delete_data => {
                let shared = &self.unit.handle.shared;
                shared.deleting.lock().insert(withdrew.number, false);
            }
            _ => {}
        }
    }

    /// Whether a participant is in the middle of the study.
    pub(super) fn is_active(&self, number: u32) -> bool {
        let participant = self.unit.state.participant(number);
        participant.is_some_and(|it| it.status == Status::Active)
    }
}

fn warn_of(study: StudyId, undeleted: &Undeleted) {
    for (game, error) in undeleted {
        warn!(%study, %game, %error, "samples of a game that is to be deleted were not deleted");
    }
}

/// The state of a stored study.
///
/// # Errors
/// This version cannot read its settings.
pub(crate) fn restored(stored: &StoredStudy) -> Result<(StudyPlan, Study), SettingsProblem> {
    let plan = convert::study_plan(&stored.header.settings)?;
    let mut study = Study::new(Arc::clone(&plan.core))?;
    stored.changes.iter().for_each(|change| study.fold(change));
    Ok((plan, study))
}
