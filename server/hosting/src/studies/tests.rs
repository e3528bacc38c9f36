//! Studies of a server whose clock is stopped: dropping out, and deleting a study.

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;
use std::sync::atomic::Ordering;
use std::time::Duration;

use chefshat_proto::v1::study_stage::Stage;
use chefshat_study::{Answer, At, ItemAnswer, NewParticipants, ParticipantLink, Refusal, Status};
use futures::FutureExt as _;
use tokio::sync::mpsc;
use tokio::time::advance;

use super::*;
use crate::cluster::{NodeLease, SingleServer, UnitEvent};
use crate::config::{MAX_STUDIES, ServerConfig};
use crate::journaled::ROOMS_AT_ONCE;
use crate::studies::message::{Command, Message};
use crate::studies::task::DELETION_RETRY;
use chefshat_admission::limits::Key;
use chefshat_base::tasks::{LongTask, polls};
use chefshat_record::samples;
use chefshat_room::ids::{GameId, RoomId};
use chefshat_room::journal::GameHeader;
use chefshat_room::policy::Durability;
use chefshat_store::testing::{FailingStore, TypedUnits as _, header};
use chefshat_store::units::UnitKey;
use chefshat_store::{MemoryStore, Store};

/// How long a participant may be away.
const LIMIT: Duration = Duration::from_secs(60);

std::thread_local! {
    /// When the test of this thread began, on its stopped clock.
    static BEGAN: OnceLock<tokio::time::Instant> = const { OnceLock::new() };
    /// How much the time of day of this thread is ahead, milliseconds.
    static AHEAD_MS: Cell<u64> = const { Cell::new(0) };
}

/// A time of day that advances with the clock of the test.
fn stopped_clock() -> u64 {
    let began = BEGAN.with(|began| *began.get_or_init(tokio::time::Instant::now));
    let passed = u64::try_from(began.elapsed().as_millis()).expect("not that long");
    1_000_000 + passed + AHEAD_MS.get()
}

fn stage(stage: Stage) -> v1::StudyStage {
    v1::StudyStage {
        stage: Some(stage),
        ..v1::StudyStage::default()
    }
}

/// A study of two participants who read a text and consent.
fn settings() -> v1::StudySettings {
    let seat = v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    };
    v1::StudySettings {
        name: "away".into(),
        title: "A game of cards".into(),
        participants: 1,
        conditions: vec![v1::StudyCondition {
            id: "only".into(),
            seats: vec![seat; 3],
            ..v1::StudyCondition::default()
        }],
        stages: vec![
            stage(Stage::Consent(v1::StudyConsent {
                text: "I take part.".into(),
                version: "1".into(),
            })),
            stage(Stage::Games(v1::StudyGames { count: 1 })),
        ],
        drop_out_after_ms: u64::try_from(LIMIT.as_millis()).expect("small"),
        ..v1::StudySettings::default()
    }
}

/// A step of a participant, in its first session.
fn at(number: u32, step: usize) -> At {
    At {
        number,
        session: 1,
        step,
    }
}

fn named(pseudonym: &str) -> NewParticipants {
    NewParticipants {
        pseudonyms: vec![pseudonym.to_owned()],
        ..NewParticipants::default()
    }
}

fn tests(count: usize) -> NewParticipants {
    NewParticipants {
        test: true,
        ..NewParticipants::numbered(count)
    }
}

struct Lab {
    store: Arc<dyn Store>,
    studies: Arc<Studies>,
    study: Arc<StudyHandle>,
}

/// Waits until something holds of a study.
async fn until(study: &StudyHandle, holds: impl Fn(&Study) -> bool) {
    let mut changes = study.changes();
    while !study.read(&holds) {
        changes.changed().await.expect("the study runs");
    }
}

/// A data directory, and the settings of a server that has it.
fn in_a_folder() -> (tempfile::TempDir, ServerConfig) {
    let folder = tempfile::tempdir().expect("a folder");
    let config = ServerConfig {
        data_dir: Some(folder.path().to_path_buf()),
        ..ServerConfig::default()
    };
    (folder, config)
}

/// The studies of a server with this store.
fn server(store: &Arc<dyn Store>) -> Arc<Studies> {
    server_of(&ServerConfig::default(), store)
}

fn server_of(config: &ServerConfig, store: &Arc<dyn Store>) -> Arc<Studies> {
    let tracker = TaskTracker::new();
    let rooms = Rooms::new(config, Arc::clone(store), tracker.clone()).expect("threads");
    Studies::at(stopped_clock, rooms, tracker)
}

impl Lab {
    /// A new study with two participants.
    async fn new() -> Self {
        Self::of(&ServerConfig::default()).await
    }

    async fn of(config: &ServerConfig) -> Self {
        Self::with(config, settings(), 2).await
    }

    /// A new study with these settings and this number of participants.
    async fn with(config: &ServerConfig, settings: v1::StudySettings, participants: usize) -> Self {
        let store = Arc::new(MemoryStore::default());
        Self::on(
            store,
            config,
            settings,
            NewParticipants::numbered(participants),
        )
        .await
    }

    /// A new study with these settings and participants, in this store.
    async fn on(
        store: Arc<dyn Store>,
        config: &ServerConfig,
        settings: v1::StudySettings,
        participants: NewParticipants,
    ) -> Self {
        let studies = server_of(config, &store);
        let created = studies.create(settings, None, Key::Local).await;
        let (study, _) = created.expect("valid settings");
        let added = study.add(Key::Local, participants).await;
        assert_eq!(added, Ok(1));
        Self {
            store,
            studies,
            study,
        }
    }

    /// A new study with these participants, in a store that can fail.
    async fn failing(participants: NewParticipants) -> (Self, Arc<FailingStore>) {
        let failing = Arc::new(FailingStore::after(u64::MAX));
        let store = Arc::clone(&failing) as _;
        let lab = Self::on(store, &ServerConfig::default(), settings(), participants).await;
        (lab, failing)
    }

    fn status(&self, number: u32) -> Status {
        self.study
            .read(|study| study.participants()[&number].status)
    }

    /// Waits until a participant has a status.
    async fn until(&self, number: u32, status: Status) {
        until(&self.study, |it| {
            it.participants()[&number].status == status
        })
        .await;
    }

    async fn open(&self, number: u32) -> Result<u32, NotDone> {
        self.study.open(Key::Local, number, None).await
    }

    /// The first participant opens the study, stays, and consents.
    async fn begin(&self) -> Presence {
        self.begin_as(1).await
    }

    /// A participant does.
    async fn begin_as(&self, number: u32) -> Presence {
        assert_eq!(self.open(number).await, Ok(1));
        let present = self.study.present(number, 1).await;
        assert_eq!(self.study.consent(at(number, 0)).await, Ok(0));
        self.settled().await;
        present
    }

    /// The study on another server, which has resumed it.
    async fn resumed(&self) -> (Arc<Studies>, Arc<StudyHandle>) {
        let studies = server(&self.store);
        studies.restore().await.expect("readable");
        let study = studies.get(self.study.id()).expect("it is resumed");
        (studies, study)
    }

    /// Lets the study execute what has been sent to it.
    async fn settled(&self) {
        assert_eq!(self.open(99).await, Err(Refusal::Unknown.into()));
    }
}

#[tokio::test(start_paused = true)]
async fn a_participant_who_is_away_for_long_gives_its_slot_to_the_next() {
    let lab = Lab::new().await;
    let consent = async |number, session| {
        let at = At {
            number,
            session,
            step: 0,
        };
        lab.study.consent(at).await
    };
    assert_eq!((lab.open(1).await, lab.open(2).await), (Ok(1), Ok(1)));
    assert_eq!(consent(1, 1).await, Ok(0));
    assert_eq!(consent(2, 1).await, Err(Refusal::Full.into()));
    let present = lab.study.present(1, 1).await;
    lab.settled().await;
    advance(LIMIT * 2).await;
    lab.settled().await;
    assert_eq!(lab.status(1), Status::Active, "it is there");

    drop(present);
    until(&lab.study, |study| !study.is_connected(1)).await;
    lab.settled().await;
    advance(LIMIT - Duration::from_millis(1)).await;
    lab.settled().await;
    assert_eq!(lab.status(1), Status::Active, "not for long enough");
    advance(Duration::from_millis(1)).await;
    lab.until(1, Status::DroppedOut).await;
    let stored = lab.store.study(lab.study.id()).await.expect("readable");
    let stored = format!("{:?}", stored.expect("it exists").changes);
    assert!(stored.contains("DroppedOut"), "{stored}");

    // Until somebody has its slot, it may come back.
    assert_eq!(lab.open(1).await, Ok(2));
    assert_eq!(lab.status(1), Status::Active);
    lab.settled().await;
    advance(LIMIT).await;
    lab.until(1, Status::DroppedOut).await;
    assert_eq!(
        lab.open(2).await,
        Ok(2),
        "without a slot it may always return"
    );
    assert_eq!(consent(2, 2).await, Ok(0));
    assert_eq!(lab.open(1).await, Ok(0), "there is only the end to show");
    assert_eq!(lab.status(1), Status::DroppedOut);
}

/// Nobody could return meanwhile.
#[tokio::test(start_paused = true)]
async fn a_pause_of_the_process_drops_nobody_out() {
    let lab = Lab::new().await;
    let clock = Arc::clone(lab.studies.rooms().process_clock());
    let watching = tokio::spawn(clock.watch());
    assert_eq!(lab.open(1).await, Ok(1));
    drop(lab.study.present(1, 1).await);
    until(&lab.study, |study| !study.is_connected(1)).await;
    lab.settled().await;
    advance(LIMIT * 5).await;
    lab.settled().await;
    assert_eq!(lab.status(1), Status::Active);
    let resumed = tokio::time::Instant::now();
    lab.until(1, Status::DroppedOut).await;
    assert!(resumed.elapsed() > LIMIT / 2, "{:?}", resumed.elapsed());
    watching.abort();
}

/// A server may start before its clock is set, and machines sleep.
#[tokio::test(start_paused = true)]
async fn a_study_closes_at_its_date_although_the_clock_was_set_meanwhile() {
    let days_ms = 300 * 24 * 3_600_000;
    let settings = v1::StudySettings {
        closes_at_ms: stopped_clock() + days_ms,
        ..settings()
    };
    let lab = Lab::with(&ServerConfig::default(), settings, 1).await;
    let is_closed = async || {
        tokio::time::sleep(Duration::from_secs(900)).await;
        lab.study.read(Study::is_closed)
    };
    assert!(!is_closed().await);
    AHEAD_MS.set(days_ms);
    assert!(is_closed().await);
}

#[tokio::test(start_paused = true)]
async fn a_study_sleeps_while_the_server_ends_although_something_is_due() {
    let lab = Lab::new().await;
    assert_eq!(lab.open(1).await, Ok(1));
    drop(lab.study.present(1, 1).await);
    until(&lab.study, |study| !study.is_connected(1)).await;
    lab.studies.stop();
    lab.settled().await;
    let before = polls()[&LongTask::Study];
    tokio::time::sleep(LIMIT * 60).await;
    assert!(polls()[&LongTask::Study] <= before + 1);
    assert_eq!(lab.status(1), Status::Active, "the next start decides");
}

#[tokio::test(start_paused = true)]
async fn a_study_sleeps_when_the_one_who_waited_for_a_room_has_left() {
    let lab = Lab::of(&ServerConfig {
        max_rooms: 0,
        ..ServerConfig::default()
    })
    .await;
    let _present = lab.begin().await;
    let games = |study: &Study| study.participants()[&1].games.len();
    assert_eq!(lab.study.read(games), 1, "it waits for a room");
    let withdrawn = lab.study.withdraw(1, false).await;
    assert_eq!(withdrawn, Ok(()));
    tokio::time::sleep(LIMIT).await;
    let before = polls()[&LongTask::Study];
    tokio::time::sleep(LIMIT * 60).await;
    assert!(polls()[&LongTask::Study] <= before + 1);
}

#[tokio::test(start_paused = true)]
async fn a_study_that_cannot_be_read_keeps_no_other_from_being_resumed() {
    let failing = Arc::new(FailingStore::after(u64::MAX));
    let store: Arc<dyn Store> = Arc::clone(&failing) as Arc<dyn Store>;
    let studies = server(&store);
    let create = async || {
        let created = studies.create(settings(), None, Key::Local).await;
        created.expect("valid settings").0.id()
    };
    let [broken, readable] = [create().await, create().await];
    failing
        .unreadable
        .lock()
        .expect("no panic")
        .insert(broken.unit());
    let studies = server(&store);
    assert_eq!(studies.restore().await, Ok(1));
    assert!(studies.get(broken).is_none() && studies.get(readable).is_some());
}

#[tokio::test(start_paused = true)]
async fn a_game_that_cannot_be_read_back_ends_no_study() {
    let (lab, failing) = Lab::failing(tests(1)).await;
    let _present = lab.begin().await;
    lab.studies.end();
    lab.study.stopped().await;

    failing.games_unreadable.store(true, Ordering::Relaxed);
    let (_studies, study) = lab.resumed().await;
    let outcome = |it: &Study| {
        let game = it.participants()[&1].games.last()?;
        game.ended.map(|(outcome, _)| outcome)
    };
    until(&study, |it| outcome(it).is_some()).await;
    assert_eq!(study.read(outcome), Some(chefshat_study::Outcome::Aborted));
}

#[tokio::test(start_paused = true)]
async fn a_game_whose_room_fails_ends() {
    let (lab, failing) = Lab::failing(NewParticipants::numbered(1)).await;
    let _present = lab.begin().await;
    let game = (lab.study).read(|study| study.participants()[&1].games[0].placed.clone());
    let room = lab.studies.rooms().get(convert::room_of(&game));
    failing.journals_panic.store(true, Ordering::Relaxed);
    room.expect("it waits").close_without_token().await;
    let deleted = lab.studies.delete(Arc::clone(&lab.study), true).await;
    // The next game may have begun before.
    let games = (lab.study).read(|study| study.participants()[&1].games.clone());
    assert_eq!(deleted, Ok((1, games.len())));
    let outcome = games[0].ended.map(|(outcome, _)| outcome);
    assert_eq!(outcome, Some(chefshat_study::Outcome::Aborted));
}

/// A node of a cluster resumes it then.
#[tokio::test(start_paused = true)]
async fn a_study_that_panics_is_reported_to_its_node() {
    let store = Arc::new(MemoryStore::default());
    let lease = Arc::new(NodeLease::new());
    lease.set_reached();
    lease.set(tokio::time::Instant::now() + LIMIT);
    let (config, tracker) = (ServerConfig::default(), TaskTracker::new());
    let (shared, held) = (Arc::new(SingleServer), Some(Arc::clone(&lease)));
    let rooms = Rooms::of_node(&config, store, shared, held, tracker.clone()).expect("threads");
    let studies = Studies::at(stopped_clock, rooms, tracker);
    let (study, _) = (studies.create(settings(), None, Key::Local).await).expect("valid settings");
    let unit = study.id().unit();
    let created = UnitEvent::Created { ephemeral: false };
    assert_eq!(lease.news().await, [(unit, created)].into());
    let planted: Command = Box::new(|_: &Study, _: u64| panic!("planted"));
    let asked = study.ask(|reply| Message::Command(planted, reply)).await;
    assert_eq!(asked, Err(Stopped));
    assert_eq!(lease.news().await, [(unit, UnitEvent::Stopped)].into());
    study.stopped().await;
}

/// What is in the store twice is run once.
#[tokio::test(start_paused = true)]
async fn a_study_that_runs_is_not_resumed_beside_itself() {
    let lab = Lab::new().await;
    let id = lab.study.id();
    let stored = lab.store.unit(UnitKey::Study(id)).await.expect("readable");
    let stored = stored.expect("stored");
    assert!(lab.studies.resume(id, stored).await);
    let found = lab.studies.get(id).expect("it runs");
    assert!(Arc::ptr_eq(&found, &lab.study));
}

#[tokio::test(start_paused = true)]
async fn samples_that_cannot_be_deleted_stop_no_study_and_are_tried_again() {
    let (folder, config) = in_a_folder();
    let lab = Lab::of(&config).await;
    let _present = lab.begin().await;
    let game = (lab.study).read(|study| study.participants()[&1].games[0].placed.clone());
    let game = convert::game_of(&game).to_string();
    // A folder with the name of the file, which cannot be removed as a file.
    let stuck = samples::path_of(folder.path(), &game, 0);
    std::fs::create_dir_all(&stuck).expect("created");

    let withdraw = || lab.study.withdraw(1, true);
    assert_eq!(withdraw().await, Err(NotDone::Files));
    assert_eq!(lab.open(2).await, Ok(1), "the others go on");
    let before = tokio::time::Instant::now();
    assert_eq!(lab.study.withdraw(2, true).await, Ok(()));
    assert!(before.elapsed() < DELETION_RETRY, "and wait for nobody");
    let delete = || lab.studies.delete(Arc::clone(&lab.study), true);
    assert_eq!(delete().await, Err(NotDeleted::Files(1)));

    std::fs::remove_dir(&stuck).expect("removed");
    assert_eq!(withdraw().await, Err(NotDone::Files));
    tokio::time::sleep(DELETION_RETRY).await;
    lab.settled().await;
    assert_eq!(withdraw().await, Ok(()));
    assert_eq!(delete().await, Ok((2, 1)));
}

#[tokio::test(start_paused = true)]
async fn a_study_is_deleted_once_nobody_is_in_the_middle_of_it() {
    let lab = Lab::new().await;
    let id = lab.study.id();
    let (study, studies) = (&lab.study, &lab.studies);
    assert_eq!(study.open(Key::Local, 1, None).await, Ok(1));
    let refused = studies.delete(Arc::clone(study), false).await;
    assert_eq!(refused, Err(NotDeleted::Running(1)));
    let consented = study.consent(at(1, 0)).await;
    assert_eq!(consented, Ok(0), "it continues");
    // Its game begins when it is there.
    let _present = study.present(1, 1).await;
    until(study, |study| !study.participants()[&1].games.is_empty()).await;
    let link = study.link(1).link;
    let link = ParticipantLink::parse(&link).expect("a link");
    assert!(studies.get(Studies::full_id(link.study())).is_some());

    let deleted = studies.delete(Arc::clone(study), true).await;
    assert_eq!(deleted, Ok((2, 1)));
    assert!(lab.store.study(id).await.expect("readable").is_none());
    assert_eq!(lab.store.studies().await, Ok(Vec::new()));
    assert!(studies.get(Studies::full_id(link.study())).is_none());
    assert!(studies.earlier(None).is_empty());
    assert!(
        study.open(Key::Local, 1, None).await.is_err(),
        "its task has ended"
    );
    assert!(study.is_complete());
}

#[tokio::test(start_paused = true)]
async fn a_study_is_deleted_at_its_date_and_not_when_the_clock_jumps() {
    const HOUR: Duration = Duration::from_secs(3_600);
    let deletes_at_ms = stopped_clock() + 10 * 3_600 * 1_000;
    let dated = v1::StudySettings {
        deletes_at_ms,
        drop_out_after_ms: 604_800_000,
        ..settings()
    };
    let lab = Lab::with(&ServerConfig::default(), dated.clone(), 2).await;
    let id = lab.study.id();
    let repeated = Some(RequestKey::new([7; 32], b""));
    let again = async || {
        lab.studies
            .create(dated.clone(), repeated, Key::Local)
            .await
    };
    let first = again().await.expect("valid settings").0.id();
    let other = lab.studies.create(settings(), None, Key::Local).await;
    let other = other.expect("valid settings").0;
    let deleting = tokio::spawn(Arc::clone(&lab.studies).delete_when_due());
    let is_there = |id| lab.studies.get(id).is_some();
    assert_eq!(lab.open(1).await, Ok(1));
    let present = lab.study.present(1, 1).await;

    // The clock is a year ahead for three quarters of an hour.
    AHEAD_MS.set(365 * 24 * 3_600 * 1_000);
    tokio::time::sleep(HOUR * 3 / 4).await;
    AHEAD_MS.set(0);
    tokio::time::sleep(HOUR * 8).await;
    assert!(is_there(id));

    // The answer to a request may be lost.
    AHEAD_MS.set(9 * 3_600 * 1_000);
    assert_eq!(again().await.expect("it was created").0.id(), first);
    AHEAD_MS.set(0);

    // Somebody is in the middle of it when its time has come.
    tokio::time::sleep(HOUR * 2).await;
    assert!(is_there(id));
    assert_eq!(lab.status(1), Status::Active);
    tokio::time::sleep(HOUR).await;
    assert!(!is_there(id) && !is_there(first));
    drop(present);
    assert!(lab.store.study(id).await.expect("readable").is_none());
    assert!(is_there(other.id()));
    deleting.abort();

    let refused = again().await.map(drop).expect_err("its date has passed");
    assert!(
        refused.to_string().starts_with("deletes_at_ms: "),
        "{refused}"
    );
}

#[tokio::test(start_paused = true)]
async fn a_study_that_could_not_be_deleted_at_its_date_is_tried_again_however_late_that_is() {
    const HOUR: Duration = Duration::from_secs(3_600);
    let (folder, config) = in_a_folder();
    let dated = v1::StudySettings {
        deletes_at_ms: stopped_clock() + 1_000,
        ..settings()
    };
    let lab = Lab::with(&config, dated, 2).await;
    let present = lab.begin().await;
    let game = (lab.study).read(|study| study.participants()[&1].games[0].placed.clone());
    let game = convert::game_of(&game).to_string();
    let stuck = samples::path_of(folder.path(), &game, 0);
    std::fs::create_dir_all(&stuck).expect("created");
    // Its task waits for what is being written, longer than it is waited for.
    let writing = Arc::clone(&lab.study.shared.traces).lock_owned().await;
    let study = Arc::clone(&lab.study);
    let withdrawing = tokio::spawn(async move { study.withdraw(2, true).await });
    let deleting = tokio::spawn(Arc::clone(&lab.studies).delete_when_due());
    tokio::time::sleep(2 * HOUR).await;
    drop((writing, present));
    withdrawing.await.expect("no panic").expect("withdrawn");
    tokio::time::sleep(HOUR).await;
    assert!(
        lab.studies.get(lab.study.id()).is_some(),
        "samples are left"
    );
    std::fs::remove_dir(&stuck).expect("removed");
    tokio::time::sleep(HOUR).await;
    assert!(lab.studies.get(lab.study.id()).is_none());
    deleting.abort();
}

#[tokio::test(start_paused = true)]
async fn all_who_delete_a_study_are_answered() {
    let lab = Lab::new().await;
    assert_eq!(lab.open(1).await, Ok(1));
    let delete = || lab.studies.delete(Arc::clone(&lab.study), true);
    let (first, second) = tokio::join!(delete(), delete());
    assert_eq!(first, Ok((2, 0)));
    assert_eq!(second, Ok((2, 0)));
}

#[tokio::test(start_paused = true)]
async fn studies_count_after_a_restart_too() {
    let lab = Lab::new().await;
    let studies = server(&lab.store);
    studies.restore().await.expect("readable");
    assert_eq!(studies.earlier(None).len(), 1);
    let mut created = 1;
    // Two callers, because none may have all places.
    for caller in [Key::Local, Key::Resumed] {
        while studies.create(settings(), None, caller).await.is_ok() {
            created += 1;
        }
    }
    assert_eq!(created, MAX_STUDIES);

    // More than there may be, as an earlier version let there be, are all resumed.
    let studies = server(&lab.store);
    let one_more = lab.studies.create(settings(), None, Key::Local).await;
    one_more.expect("this server has one");
    studies.restore().await.expect("readable");
    assert_eq!(studies.earlier(None).len(), MAX_STUDIES + 1);
    let one = studies.get(lab.study.id()).expect("it was resumed");
    let deleted = studies.delete(one, true).await;
    assert_eq!(deleted, Ok((2, 0)));
    let refused = studies.create(settings(), None, Key::Local).await;
    assert!(
        matches!(refused, Err(CreateError::Refused(_))),
        "still full"
    );
}

#[tokio::test(start_paused = true)]
async fn all_who_wait_for_rooms_get_them_after_a_restart_and_a_taken_id_ends_one_game_alone() {
    // More than are created at a time.
    const WAITING: u32 = ROOMS_AT_ONCE as u32 + 8;
    const TAKEN: u32 = 2;
    let config = ServerConfig {
        max_rooms: 0,
        ..ServerConfig::default()
    };
    let settings = v1::StudySettings {
        participants: WAITING,
        ..settings()
    };
    let lab = Lab::with(&config, settings, WAITING as usize).await;
    let mut present = Vec::new();
    for number in 1..=WAITING {
        present.push(lab.begin_as(number).await);
    }
    let placed = |study: &StudyHandle, number| {
        study.read(|study| study.participants()[&number].games[0].placed.clone())
    };
    let other = GameHeader {
        game_id: convert::game_of(&placed(&lab.study, TAKEN)),
        ..GameHeader::clone(&header(9, Durability::Ephemeral))
    };
    let created = lab.store.create(Arc::new(other), Vec::new()).await;
    let _held = created.expect("its id is free");
    lab.studies.end();

    let (studies, study) = lab.resumed().await;
    let rooms = &studies.rooms;
    let has_room = |number| {
        rooms
            .get(convert::room_of(&placed(&study, number)))
            .is_some()
    };
    let has_ended = |study: &Study| study.participants()[&TAKEN].games[0].ended.is_some();
    until(&study, has_ended).await;
    for number in 1..=WAITING {
        assert_eq!(has_room(number), number != TAKEN, "{number}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_restart_rewrites_a_journal_once_and_only_if_something_is_left() {
    let lab = Lab::new().await;
    let id = lab.study.id();
    let rows = async || {
        let stored = lab.store.study(id).await.expect("readable");
        stored.expect("it exists").rows
    };
    for number in [1, 2] {
        let withdrawn = lab.study.withdraw(number, true).await;
        assert_eq!(withdrawn, Ok(()));
    }
    assert_eq!(rows().await, 1, "rewritten");
    let added = lab.study.add(Key::Local, named("Ada")).await;
    assert_eq!(added, Ok(3));
    assert_eq!(rows().await, 2);
    lab.studies.end();

    let (studies, study) = lab.resumed().await;
    let unknown = study.open(Key::Local, 99, None).await;
    assert_eq!(unknown, Err(Refusal::Unknown.into()));
    assert_eq!(rows().await, 2, "nothing is left to delete");

    // A server that ended right after the withdrawals.
    let added = study.add(Key::Local, named("Bo")).await;
    assert_eq!(added, Ok(4));
    studies.end();
    let withdrew = |number| {
        chefshat_study::Change::Withdrew(chefshat_study::Withdrew {
            number,
            delete_data: true,
            at_ms: 1,
        })
    };
    let appended = lab
        .store
        .append_study(id, 3, vec![withdrew(3), withdrew(4)]);
    appended.await.expect("committed");
    let (_studies, study) = lab.resumed().await;
    let unknown = study.open(Key::Local, 99, None).await;
    assert_eq!(unknown, Err(Refusal::Unknown.into()));
    assert_eq!(rows().await, 1, "rewritten");
    let stored = lab.store.study(id).await.expect("readable");
    let stored = format!("{:?}", stored.expect("it exists").changes);
    assert!(
        !stored.contains("Ada") && !stored.contains("Bo"),
        "{stored}"
    );
}

#[tokio::test(start_paused = true)]
async fn a_restart_reads_no_journal_again_for_data_that_were_deleted_before() {
    let (lab, failing) = Lab::failing(named("Ada")).await;
    assert_eq!(lab.study.withdraw(1, true).await, Ok(()));
    lab.studies.end();
    lab.study.stopped().await;

    let studies = server(&lab.store);
    assert_eq!(studies.restore().await, Ok(1));
    let unreadable = failing.unreadable.lock();
    unreadable.expect("no panic").insert(lab.study.id().unit());
    let study = studies.get(lab.study.id()).expect("it is resumed");
    let unknown = study.open(Key::Local, 99, None).await;
    assert_eq!(unknown, Err(Refusal::Unknown.into()), "it runs");
}

/// Who imports a record under the id of a study's game adds nothing to the study's data.
#[tokio::test]
async fn a_record_from_elsewhere_is_no_data_of_a_study() {
    let lab = Lab::new().await;
    let game = GameId::from_bytes([9; 16]);
    let summary = v1::RecordSummary::default();
    let imported = lab.store.import(game, summary, Arc::from([])).await;
    assert_eq!(imported, Ok(true));
    let record = super::export::record_of(&lab.study, lab.studies.rooms(), game).await;
    assert_eq!(record, Ok(None));
}

#[tokio::test]
async fn an_export_reads_records_in_turn_with_others() {
    let (lab, failing) = Lab::failing(tests(1)).await;
    let (rooms, game) = (lab.studies.rooms(), GameId::from_bytes([9; 16]));
    let imported = lab
        .store
        .import(game, v1::RecordSummary::default(), Arc::from([]));
    assert_eq!(imported.await, Ok(true));
    let mut slices = Vec::new();
    while let Some(slice) = rooms.background().slice(Key::Resumed).now_or_never() {
        slices.push(slice);
    }
    failing.take_reads();
    let mut reading = Box::pin(super::export::record_of(&lab.study, rooms, game));
    assert_eq!(reading.as_mut().now_or_never(), None);
    assert!(failing.take_reads().is_empty(), "others compute");
    drop(slices);
    assert_eq!(reading.await, Ok(None));
    assert_eq!(failing.take_reads().len(), 1);
}

/// The rows of exported tables, without those of records, each by the names of its columns.
type Tables = BTreeMap<String, Vec<BTreeMap<String, String>>>;

/// The files that a study exports, or those of its test participants, by name.
async fn exported(lab: &Lab, test: bool) -> BTreeMap<String, Vec<u8>> {
    let (sender, mut receiver) = mpsc::channel::<ExportedFile>(1);
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let receiving = async {
        while let Some(part) = receiver.recv().await {
            files.entry(part.file).or_default().extend(part.data);
        }
    };
    let exporting = async {
        let rooms = lab.studies.rooms();
        lab.study
            .export(rooms, test, &sender)
            .await
            .expect("an export");
        drop(sender);
    };
    tokio::join!(receiving, exporting);
    files
}

fn tables(files: &BTreeMap<String, Vec<u8>>) -> Tables {
    let tables = files.iter().filter(|(name, _)| name.ends_with(".csv"));
    let tables = tables.map(|(name, file)| {
        let rows = csv::Reader::from_reader(file.as_slice()).into_deserialize();
        let rows = rows.map(|row| row.expect("as many cells as columns"));
        (name.clone(), rows.collect())
    });
    tables.collect()
}

#[tokio::test(start_paused = true)]
async fn a_test_participant_ends_its_game_and_goes_on_and_nobody_waits_for_it() {
    let lab = Lab::new().await;
    let (study, rooms) = (&lab.study, lab.studies.rooms());
    let added = study.add(Key::Local, tests(2)).await;
    let number = added.expect("there is space");
    // Another one is in the middle of the study to its end.
    assert_eq!(lab.open(number + 1).await, Ok(1));
    let _present = lab.begin_as(number).await;
    let game = |number| study.read(|it| it.participants()[&number].games.last().cloned());
    let ended = |number| game(number).and_then(|game| game.ended);
    assert!(game(number).is_some() && ended(number).is_none());

    // Nobody else ends a game, or waits for this one.
    let _other = lab.begin().await;
    let refused = study.proceed(at(1, 1), rooms).await;
    assert_eq!(refused, Err(Refusal::GameNotOver.into()));
    let closing = study.proceed(at(number, 1), rooms).await;
    assert_eq!(closing, Ok(0));
    while ended(number).is_none() {
        lab.settled().await;
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    assert_eq!(
        ended(number).map(|(outcome, _)| outcome),
        Some(chefshat_study::Outcome::Aborted)
    );
    assert!(ended(1).is_none());
    let proceeded = study.proceed(at(number, 1), rooms).await;
    assert_eq!(proceeded, Ok(0));
    assert_eq!(study.read(|it| it.participants()[&number].step()), 2);
    assert_eq!(lab.status(number), Status::Completed);
    assert_eq!(lab.status(number + 1), Status::Active);
    let removed = study.remove(Key::Local, 1, false).await;
    assert!(removed.is_ok(), "{removed:?}");
    study.close().await.expect("it runs");
    assert!(study.is_complete());
    let deleted = lab.studies.delete(Arc::clone(study), false).await;
    assert_eq!(deleted.map(|(participants, _)| participants), Ok(2));
}

#[tokio::test]
async fn the_data_have_a_row_of_every_item_shown_and_a_codebook() {
    use v1::study_item::Kind;
    let item = |id: &str, optional, kind| v1::StudyItem {
        id: id.into(),
        text: format!("About {id}, \"as it was\""),
        optional,
        kind: Some(kind),
        ..v1::StudyItem::default()
    };
    let points = v1::StudyLikert {
        points: 5,
        labels: vec!["not at all".into(), "very".into()],
    };
    let from = |min| {
        Some(v1::StudyAnswerSet {
            min: Some(min),
            ..v1::StudyAnswerSet::default()
        })
    };
    let questionnaire = v1::StudyQuestionnaire {
        id: "after".into(),
        title: "After all".into(),
        items: vec![
            item("liked", false, Kind::Likert(points.clone())),
            item(
                "seen",
                true,
                Kind::Choice(v1::StudyChoice {
                    options: vec!["=cards".into(), "faces".into(), "nothing".into()],
                    multiple: true,
                }),
            ),
            item(
                "said",
                true,
                Kind::FreeText(v1::StudyFreeText { max_characters: 50 }),
            ),
            v1::StudyItem {
                shown_if: vec![v1::StudyShownIf {
                    item: "liked".into(),
                    answers: from(4),
                    ..v1::StudyShownIf::default()
                }],
                ..item(
                    "played",
                    false,
                    Kind::Number(v1::StudyNumber {
                        min: 0,
                        max: 99,
                        unit: "years".into(),
                    }),
                )
            },
            v1::StudyItem {
                attention_check: from(3),
                ..item("check", false, Kind::Likert(points))
            },
        ],
        ..v1::StudyQuestionnaire::default()
    };
    let mut settings = settings();
    settings.participants = 3;
    settings.factors = vec![v1::StudyFactor {
        name: "mood".into(),
        levels: vec!["-low".into(), "high".into()],
    }];
    settings.conditions[0].levels = [("mood".to_owned(), "-low".to_owned())].into();
    let questionnaire = stage(Stage::Questionnaire(questionnaire));
    settings.stages.insert(1, questionnaire);
    let lab = Lab::with(&ServerConfig::default(), settings, 4).await;
    for number in 1..=3 {
        assert_eq!(lab.study.open(Key::Local, number, None).await, Ok(1));
        let consented = lab.study.consent(at(number, 0)).await;
        assert_eq!(consented, Ok(0));
    }
    let answer = |item, value| ItemAnswer {
        item,
        value: Some(value),
        answered_after_ms: Some(700),
    };
    let all = vec![
        answer(0, Answer::Number(5)),
        answer(1, Answer::options(vec![0, 2])),
        answer(2, Answer::Text("=1+2, or \"three\"".into())),
        answer(3, Answer::Number(12)),
        answer(4, Answer::Number(3)),
    ];
    let few = vec![answer(0, Answer::Number(3)), answer(4, Answer::Number(2))];
    for (number, answers) in [(1, all), (2, few)] {
        let answered = lab.study.answer(Key::Local, at(number, 1), answers).await;
        answered.expect("they are valid");
    }

    let tested = lab.study.add(Key::Local, tests(1)).await;
    assert_eq!(tested, Ok(5));
    let files = exported(&lab, false).await;
    let tables = tables(&files);
    let cells = |tables: &Tables, table: &str, columns: &[&str]| -> Vec<String> {
        let cells = |row: &BTreeMap<String, String>| {
            let cells = columns.iter().map(|column| row[*column].clone());
            cells.collect::<Vec<_>>().join("|")
        };
        tables[table].iter().map(cells).collect()
    };
    let columns = [
        "number",
        "factor_mood",
        "item",
        "position",
        "status",
        "answer",
        "label",
        "passed",
    ];
    assert_eq!(
        cells(&tables, "answers.csv", &columns),
        [
            "1|'-low|liked|1|answered|5|very|",
            "1|'-low|seen|2|answered|0 2|'=cards; nothing|",
            "1|'-low|said|3|answered|'=1+2, or \"three\"||",
            "1|'-low|played|4|answered|12||",
            "1|'-low|check|5|answered|3||true",
            // Points between the ends have no label.
            "2|'-low|liked|1|answered|3||",
            "2|'-low|seen|2|left_out|||",
            "2|'-low|said|3|left_out|||",
            "2|'-low|played||not_shown|||",
            "2|'-low|check|4|answered|2||false",
            "3|'-low|liked|1|not_sent|||",
            "3|'-low|seen|2|not_sent|||",
            "3|'-low|said|3|not_sent|||",
            "3|'-low|played||not_shown|||",
            "3|'-low|check|4|not_sent|||",
        ]
    );
    let columns = [
        "item",
        "kind",
        "required",
        "lowest",
        "highest",
        "labels",
        "unit",
        "shown_if",
        "attention_check",
    ];
    assert_eq!(
        cells(&tables, "items.csv", &columns),
        [
            "liked|likert|true|1|5|1 = not at all; 5 = very|||",
            "seen|choices|false|0|2|0 = =cards; 1 = faces; 2 = nothing|||",
            "said|free_text|false||||||",
            "played|number|true|0|99||years|liked 4..|",
            "check|likert|true|1|5|1 = not at all; 5 = very|||3..",
        ]
    );
    let columns = [
        "number",
        "state",
        "conditions",
        "factor_mood",
        "attention_checks",
        "attention_checks_passed",
    ];
    assert_eq!(
        cells(&tables, "participants.csv", &columns),
        [
            "1|active|only|'-low|1|1",
            "2|active|only|'-low|1|0",
            "3|active|only|'-low|0|0",
            "4|invited|||0|0"
        ]
    );

    // The codebook and the descriptor name the columns of all files, in order.
    let descriptor: serde_json::Value =
        serde_json::from_slice(&files["datapackage.json"]).expect("JSON");
    let resources = descriptor["resources"].as_array().expect("a list");
    let described = resources
        .iter()
        .map(|it| it["path"].as_str().expect("a name"));
    let described: BTreeSet<&str> = described.collect();
    assert_eq!(described, tables.keys().map(String::as_str).collect());
    for resource in resources {
        let file = resource["path"].as_str().expect("a name");
        let mut reader = csv::Reader::from_reader(files[file].as_slice());
        let header = reader.headers().cloned();
        let fields = resource["schema"]["fields"].as_array().expect("a list");
        let names: Vec<&str> = fields
            .iter()
            .map(|it| it["name"].as_str().expect("a name"))
            .collect();
        assert_eq!(
            header.expect("a header").iter().collect::<Vec<_>>(),
            names,
            "{file}"
        );
        if file != "codebook.csv" {
            let codebook = tables["codebook.csv"]
                .iter()
                .filter(|row| row["file"] == file);
            let codebook: Vec<&str> = codebook.map(|row| row["column"].as_str()).collect();
            assert_eq!(codebook, names);
        }
    }
    let mood = tables["codebook.csv"]
        .iter()
        .find(|row| row["column"] == "factor_mood");
    assert_eq!(mood.expect("a row")["codes"], "'-low; high");
    let tests = self::tables(&exported(&lab, true).await);
    let tests = cells(&tests, "participants.csv", &["participant", "test"]);
    assert_eq!(tests, ["T05|true"]);
}

#[tokio::test]
async fn samples_that_cannot_be_read_end_no_export() {
    let (folder, config) = in_a_folder();
    let lab = Lab::of(&config).await;
    let game = GameId::from_bytes([9; 16]);
    let [stuck, other] =
        [0, 1].map(|seat| samples::path_of(folder.path(), &game.to_string(), seat));
    // A folder can be opened, and not read.
    std::fs::create_dir_all(&stuck).expect("created");
    std::fs::write(&other, "samples").expect("written");
    let (sender, mut receiver) = mpsc::channel(9);
    let sent = super::export::samples(lab.studies.rooms(), game, &sender).await;
    let name = |path: &std::path::Path| path.file_name().expect("a name").display().to_string();
    let problem = sent.expect("somebody receives").expect("one is left out");
    assert!(problem.contains(&name(&stuck)), "{problem}");
    drop(sender);
    let mut files = BTreeMap::new();
    while let Some(ExportedFile { file, data }) = receiver.recv().await {
        files.insert(file, data);
    }
    assert_eq!(files[&format!("samples/{}", name(&other))], b"samples");
}

#[tokio::test]
async fn traces_that_were_sent_again_are_exported_once() {
    let mut settings = settings();
    settings.traces = true;
    let lab = Lab::with(&ServerConfig::default(), settings, 1).await;
    let _present = lab.begin().await;
    let game = |study: &Study| GameId::from_bytes(study.participants()[&1].games[0].placed.game);
    let game = lab.study.read(game);
    let trace = |at_ms| v1::StudyTrace {
        kind: v1::StudyTraceKind::CardPicked.into(),
        at_ms,
        target: "card:7".into(),
        ..v1::StudyTrace::default()
    };
    for times in [
        [1, 2].as_slice(),
        &[1, 2, 3],
        &[1, 2, 3, 4, 5],
        &[6],
        &[6, 7],
    ] {
        let traces = times.iter().copied().map(trace).collect();
        let rooms = lab.studies.rooms();
        let recorded = lab
            .study
            .record_traces((1, 1), Key::Local, game, traces, rooms)
            .await;
        assert_eq!(recorded, Ok(()));
    }
    let tables = tables(&exported(&lab, false).await);
    let times = tables["traces.csv"].iter().map(|row| row["at_ms"].as_str());
    assert_eq!(
        times.collect::<Vec<_>>(),
        ["1", "2", "3", "4", "5", "6", "7"]
    );
}

#[tokio::test(start_paused = true)]
async fn the_settings_of_all_studies_of_a_caller_take_its_share_of_memory() {
    let studies = server(&(Arc::new(MemoryStore::default()) as Arc<dyn Store>));
    let remote = Key::Address([192, 0, 2, 1].into());
    let mut long = settings();
    let text = v1::StudyText {
        text: "x".repeat(20_000),
        ..v1::StudyText::default()
    };
    long.stages.splice(1..1, vec![stage(Stage::Text(text)); 45]);
    let create = async || studies.create(long.clone(), None, remote).await;
    let mut created = Vec::new();
    let refused = loop {
        match create().await {
            Ok((study, _)) => created.push(study),
            Err(refused) => break refused,
        }
        assert!(created.len() < 10, "there is no limit");
    };
    // A tenth of 48 MiB.
    assert_eq!(created.len(), 5);
    let CreateError::Refused(refused) = refused else {
        panic!("{refused}");
    };
    assert_eq!(refused.reason, "TOO_MANY_STUDIES");
    assert_eq!(refused.limit, 48 * 1024 * 1024 / 10 / 1024 * 1024);
    let small = studies.create(settings(), None, remote).await;
    small.expect("a small one still fits");
    let other = Key::Address([192, 0, 2, 2].into());
    let other = studies.create(long.clone(), None, other).await;
    other.expect("the memory of another caller");
    let deleted = created.pop().expect("one");
    let deleting = studies.delete(deleted, true).await;
    deleting.expect("nobody is in it");
    tokio::task::yield_now().await;
    create().await.expect("its memory is free again");
    assert!(matches!(create().await, Err(CreateError::Refused(_))));
}

/// One participant, who answers questionnaires with long texts and nothing else.
fn long_answers(questionnaires: usize) -> v1::StudySettings {
    use v1::study_item::Kind;
    let item = |number| v1::StudyItem {
        id: format!("q{number}"),
        text: "Why?".into(),
        kind: Some(Kind::FreeText(v1::StudyFreeText {
            max_characters: 10_000,
        })),
        ..v1::StudyItem::default()
    };
    let questionnaire = |number| {
        stage(Stage::Questionnaire(v1::StudyQuestionnaire {
            id: format!("s{number}"),
            items: (0..100).map(item).collect(),
            ..v1::StudyQuestionnaire::default()
        }))
    };
    let mut settings = settings();
    settings
        .stages
        .splice(0..1, (0..questionnaires).map(questionnaire));
    settings
}

#[tokio::test(start_paused = true)]
async fn answers_and_participants_take_a_bounded_memory_that_callers_share() {
    let lab = Lab::new().await;
    let (studies, store) = (&lab.studies, &lab.store);
    let created = studies.create(long_answers(49), None, Key::Local).await;
    let (study, _) = created.expect("valid settings");
    let added = study.add(Key::Local, NewParticipants::numbered(2)).await;
    assert_eq!(added, Ok(1));
    assert_eq!(study.open(Key::Local, 1, None).await, Ok(1));
    let address = |last| Key::Address([192, 0, 2, last].into());
    let before = studies.common.data.taken();
    let answer = |item| chefshat_study::ItemAnswer {
        item,
        value: Some(chefshat_study::Answer::Text("x".repeat(10_000))),
        answered_after_ms: None,
    };
    let answers: Vec<_> = (0..100).map(answer).collect();
    let mut step = 0;
    let mut answer = async |key, study: &StudyHandle| {
        let answered = study.answer(key, at(1, step), answers.clone()).await;
        step += usize::from(answered.is_ok());
        answered
    };
    // An answer at another step is charged for nothing.
    let refused = study.answer(address(1), at(1, 7), answers.clone()).await;
    assert!(matches!(refused, Err(NotDone::Study(_))), "{refused:?}");
    assert_eq!(studies.common.data.taken(), before);

    // What is saved replaces what was saved before, and goes when it is answered.
    let save = async |count: usize| {
        let saved = study
            .save(address(1), at(1, 0), answers[..count].to_vec())
            .await;
        assert_eq!(saved, Ok(0));
        studies.common.data.taken() - before
    };
    let few = save(1).await;
    assert!((10_000..11_000).contains(&few), "{few}");
    assert!(save(50).await > 500_000);
    assert_eq!(save(1).await, few);

    // A caller stores its share; others store theirs.
    let share = MAX_STUDY_DATA / 10;
    while answer(address(1), &study).await.is_ok() {}
    let taken = studies.common.data.taken() - before;
    assert!((share - 2_000_000..=share).contains(&taken), "{taken}");
    let refused = answer(address(1), &study).await;
    assert!(
        matches!(&refused, Err(NotDone::Memory(it)) if it.reason == "TOO_MANY_ANSWERS"),
        "{refused:?}"
    );
    assert_eq!(answer(address(2), &study).await, Ok(0));
    let stored = studies.common.data.taken();

    // A restart counts them, and loads them even if there are too many.
    studies.end();
    let resumed = server(store);
    let full = resumed
        .common
        .data
        .take_many_anyway(Key::Local, MAX_STUDY_DATA);
    resumed.restore().await.expect("readable");
    let counted = resumed.common.data.taken() - MAX_STUDY_DATA;
    // With the names that participants got.
    assert!((stored..stored + 100).contains(&counted), "{counted}");
    drop(full);
    let study = resumed.get(study.id()).expect("it is resumed");
    let mut callers = 3;
    while answer(address(callers), &study).await.is_ok() || callers < 20 {
        callers += 1;
    }
    assert!(resumed.common.data.taken() <= MAX_STUDY_DATA);
    let free = MAX_STUDY_DATA - resumed.common.data.taken();
    let others = resumed.common.data.take_many_anyway(Key::Local, free);
    let one_more = study.add(address(200), NewParticipants::numbered(1)).await;
    assert!(
        matches!(&one_more, Err(NotDone::Memory(it)) if it.reason == "TOO_MANY_PARTICIPANTS"),
        "{one_more:?}"
    );

    drop(others);
    let added = study.add(address(200), NewParticipants::numbered(1)).await;
    assert_eq!(added, Ok(3));

    // What is deleted is free again.
    let withdrawn = study.withdraw(1, true).await;
    assert_eq!(withdrawn, Ok(()));
    assert!(
        resumed.common.data.taken() < share,
        "{}",
        resumed.common.data.taken()
    );
    let deleted = resumed.delete(study, true).await;
    deleted.expect("nobody is in it");
    let left = resumed.common.data.taken();
    let participants = 2 * 2 * size_of::<chefshat_study::Participant>() + 4 * "P01".len();
    assert_eq!(left, participants, "those of the other study");
}

/// The settings of a study with pairs.
fn in_pairs() -> v1::StudySettings {
    let mut settings = settings();
    settings.participants = 4;
    settings.conditions[0].seats.truncate(2);
    settings.groups = Some(v1::StudyGroups {
        size: 2,
        wait_ms: 30_000,
        left_over: v1::StudyLeftOver::Dismiss.into(),
    });
    let arrival = stage(Stage::Arrival(v1::StudyArrival::default()));
    settings.stages.insert(1, arrival);
    settings
}

#[tokio::test(start_paused = true)]
async fn pairs_are_formed_and_who_waits_too_long_is_left_over() {
    let lab = Lab::with(&ServerConfig::default(), in_pairs(), 3).await;
    let mut present = Vec::new();
    for number in [3, 1, 2] {
        present.push(lab.begin_as(number).await);
    }
    let groups = |study: &Study| [1, 2, 3].map(|number| study.participants()[&number].group);
    assert_eq!(lab.study.read(groups), [Some(1), None, Some(1)]);
    let rooms = |study: &Study| {
        let games = |number| &study.participants()[&number].games;
        [1, 3].map(|number| {
            games(number)
                .iter()
                .map(|it| it.placed.room)
                .collect::<Vec<_>>()
        })
    };
    let [one, other] = lab.study.read(rooms);
    assert_eq!((one.len(), &one), (1, &other));
    // Nothing is due before the time is up.
    lab.settled().await;
    let before = polls()[&LongTask::Study];
    tokio::time::sleep(Duration::from_millis(29_000)).await;
    assert!(polls()[&LongTask::Study] <= before + 1);
    assert_eq!(lab.status(2), Status::Active);
    tokio::time::sleep(Duration::from_millis(1_001)).await;
    lab.until(2, Status::LeftOver).await;
    drop(present);
}

#[tokio::test(start_paused = true)]
async fn a_game_waits_for_a_partner_who_does_not_come_no_longer_than_for_one_who_is_late() {
    let lab = Lab::with(&ServerConfig::default(), in_pairs(), 2).await;
    let _present = [lab.begin_as(1).await, lab.begin_as(2).await];
    let room = |study: &Study| RoomId::from_bytes(study.participants()[&1].games[0].placed.room);
    let room = lab.study.read(room);
    let header = lab.studies.rooms().header(room).expect("it has a room");
    assert_eq!(header.policy.waiting_time, Duration::from_secs(30));
    let study = header.study.as_ref().expect("it is of a study");
    let seats: Vec<usize> = study.members.iter().map(|it| it.seat.index()).collect();
    assert_eq!((study.group, seats), (Some(1), vec![0, 2]));
}
