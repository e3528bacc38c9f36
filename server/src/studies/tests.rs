//! Studies of a server whose clock is stopped: dropping out, and deleting a study.

use std::sync::OnceLock;

use chefshat_study::{At, ParticipantLink, Status};
use tokio::time::advance;

use super::*;
use crate::config::ServerConfig;
use crate::store::{MemoryStore, Store};

/// How long a participant may be away.
const LIMIT: Duration = Duration::from_secs(60);

std::thread_local! {
    /// When the test of this thread began, on its stopped clock.
    static BEGAN: OnceLock<tokio::time::Instant> = const { OnceLock::new() };
}

/// A time of day that advances with the clock of the test.
fn stopped_clock() -> u64 {
    let began = BEGAN.with(|began| *began.get_or_init(tokio::time::Instant::now));
    1_000_000 + u64::try_from(began.elapsed().as_millis()).expect("not that long")
}

/// A study of two participants who read a text and consent.
fn settings() -> v1::StudySettings {
    use v1::study_stage::Stage;
    let seat = v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    };
    let stage = |stage| v1::StudyStage { stage: Some(stage) };
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

struct Lab {
    store: Arc<dyn Store>,
    studies: Arc<Studies>,
    study: Arc<StudyHandle>,
}

impl Lab {
    /// A new study with two participants.
    async fn new() -> Self {
        let store: Arc<dyn Store> = Arc::new(MemoryStore::default());
        let tracker = TaskTracker::new();
        let config = ServerConfig::default();
        let rooms = Rooms::new(&config, Arc::clone(&store), tracker.clone()).expect("threads");
        let studies = Studies::at(stopped_clock, rooms, tracker);
        let created = studies.create(settings(), None, Key::Local).await;
        let (study, _) = created.expect("valid settings");
        let added = study.add(vec![String::new(); 2]).await;
        assert_eq!(added.expect("it runs"), Ok(1));
        Self {
            store,
            studies,
            study,
        }
    }

    fn status(&self, number: u32) -> Status {
        self.study
            .read(|study| study.participants()[&number].status)
    }

    /// Waits until a participant has a status.
    async fn until(&self, number: u32, status: Status) {
        let mut changes = self.study.changes();
        while self.status(number) != status {
            changes.changed().await.expect("the study runs");
        }
    }

    /// Lets the study execute what has been sent to it.
    async fn settled(&self) {
        let unknown = self.study.open(99).await.expect("it runs");
        assert_eq!(unknown, Err(chefshat_study::Refusal::Unknown));
    }
}

#[tokio::test(start_paused = true)]
async fn a_participant_who_is_away_for_long_gives_its_slot_to_the_next() {
    let lab = Lab::new().await;
    let open = async |number| lab.study.open(number).await.expect("it runs");
    assert_eq!(open(1).await, Ok(1));
    assert_eq!(open(2).await, Err(chefshat_study::Refusal::Full));
    let present = lab.study.present(1, 1).await;
    lab.settled().await;
    advance(LIMIT * 2).await;
    lab.settled().await;
    assert_eq!(lab.status(1), Status::Active, "it is there");

    drop(present);
    let mut changes = lab.study.changes();
    while lab.study.read(|study| study.is_connected(1)) {
        changes.changed().await.expect("the study runs");
    }
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
    assert_eq!(open(1).await, Ok(2));
    assert_eq!(lab.status(1), Status::Active);
    lab.settled().await;
    advance(LIMIT).await;
    lab.until(1, Status::DroppedOut).await;
    assert_eq!(open(2).await, Ok(1));
    assert_eq!(open(1).await, Ok(0), "there is only the end to show");
    assert_eq!(lab.status(1), Status::DroppedOut);
}

#[tokio::test(start_paused = true)]
async fn a_study_is_deleted_once_nobody_is_in_the_middle_of_it() {
    let lab = Lab::new().await;
    let id = lab.study.id();
    let (study, studies) = (&lab.study, &lab.studies);
    assert_eq!(study.open(1).await.expect("it runs"), Ok(1));
    let refused = studies.delete(Arc::clone(study), false).await;
    assert_eq!(refused.expect("it runs"), Err(1));
    let at = At {
        number: 1,
        session: 1,
        step: 0,
    };
    let consented = study.consent(at).await.expect("it runs");
    assert_eq!(consented, Ok(0), "it continues");
    // Its game begins when it is there.
    let _present = study.present(1, 1).await;
    let mut changes = study.changes();
    while study.read(|study| study.participants()[&1].games.is_empty()) {
        changes.changed().await.expect("the study runs");
    }
    let link = study.link(1).link;
    let link = ParticipantLink::parse(&link).expect("a link");
    assert!(studies.get(Studies::full_id(link.study())).is_some());

    let deleted = studies.delete(Arc::clone(study), true).await;
    assert_eq!(deleted.expect("it runs"), Ok((2, 1)));
    assert!(lab.store.study(id).await.expect("readable").is_none());
    assert_eq!(lab.store.studies().await, Ok(Vec::new()));
    assert!(studies.get(Studies::full_id(link.study())).is_none());
    assert!(studies.newest().is_empty());
    assert!(study.open(1).await.is_err(), "its task has ended");
    assert!(study.is_over());
}
