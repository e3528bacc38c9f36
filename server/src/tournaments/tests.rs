//! Creating, joining and restoring tournaments.

use futures::FutureExt as _;

use super::*;
use crate::config::ServerConfig;
use crate::limits::Key;
use crate::store::{SqliteStore, Store};

#[tokio::test]
async fn creating_a_tournament_completes_even_if_the_caller_is_cancelled() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a new one");
    let store: Arc<dyn Store> = Arc::new(store);
    let tracker = TaskTracker::new();
    let rooms = Rooms::new(
        &ServerConfig::default(),
        Arc::clone(&store),
        tracker.clone(),
    )
    .expect("threads");
    let tournaments = Tournaments::new(rooms, tracker.clone());
    let settings = chefshat_proto::v1::TournamentSettings {
        format: chefshat_proto::v1::TournamentFormat::Swiss.into(),
        ..Default::default()
    };
    let plan = convert::tournament_plan(&settings, [7; 32]).expect("valid settings");
    // The caller is cancelled during the commit.
    let asked = tournaments
        .create("Coppa", plan, None, Key::Local)
        .now_or_never();
    assert!(asked.is_none(), "the commit takes a while");
    tournaments.end();
    tracker.close();
    tracker.wait().await;

    let made = tournaments.newest(None, None, 9);
    let [(_, handle)] = made.as_slice() else {
        panic!("not exactly one: {made:?}");
    };
    let found = tournaments.get(handle.id()).expect("found by its id");
    assert_eq!(found.id(), handle.id());
    let code = handle.join_code().to_lowercase();
    let found = tournaments.by_code(&code).expect("found by its code");
    assert_eq!(found.id(), handle.id());
    let stored = store.tournaments(0).await.expect("readable");
    assert_eq!(stored.len(), 1);
    assert!(tournaments.get(Id::random()).is_none());
    assert!(tournaments.by_code("").is_none());
}

/// Settings of a tournament of built-in agents in games of one Shift.
fn built_in(name: &str) -> chefshat_proto::v1::TournamentSettings {
    use chefshat_proto::v1;
    v1::TournamentSettings {
        name: name.into(),
        format: v1::TournamentFormat::Swiss.into(),
        built_in_agents: vec!["random".into(); 4],
        rounds: 1,
        rules: Some(v1::RuleSet {
            stop: Some(v1::rule_set::Stop::TargetShifts(1)),
            ..v1::RuleSet::default()
        }),
        ..Default::default()
    }
}

fn entrant(name: &str) -> Entry {
    Entry {
        name: name.into(),
        kind: chefshat_room::journal::ParticipantKind::Agent,
        max_games: 1,
        stateless: true,
        at_table: false,
        request_id: None,
    }
}

#[tokio::test]
async fn readers_see_only_committed_changes() {
    let store = Arc::new(crate::store::FailingStore::after(u64::MAX));
    let commits = Arc::clone(&store.tournament_commits);
    let rooms = Rooms::new(&ServerConfig::default(), store, TaskTracker::new()).expect("threads");
    let tournaments = Tournaments::new(rooms, TaskTracker::new());
    let plan = convert::tournament_plan(&built_in("Coppa"), [7; 32]).expect("valid settings");
    let (handle, _) = tournaments
        .create("Coppa", plan, None, Key::Local)
        .await
        .expect("made");
    commits.forget_permits(usize::MAX >> 3);
    assert_eq!(commits.available_permits(), 0);

    let joining = tokio::spawn({
        let handle = Arc::clone(&handle);
        async move { handle.join(entrant("Ada")).await }
    });
    // The task of the tournament has received the message and waits for the commit.
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
    assert!(!joining.is_finished());
    let shown = handle.describe().participants.len();
    assert_eq!(shown, 4, "uncommitted changes are not visible");
    commits.add_permits(1);
    joining
        .await
        .expect("no panic")
        .expect("the task runs")
        .expect("joined");
    assert_eq!(handle.describe().participants.len(), 5);
}

#[tokio::test]
async fn a_forged_record_of_a_coming_game_is_not_counted() {
    use chefshat_proto::v1;
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a new one");
    let store: Arc<dyn Store> = Arc::new(store);
    let start = |max_rooms| {
        let config = ServerConfig {
            max_rooms,
            ..ServerConfig::default()
        };
        let rooms = Rooms::new(&config, Arc::clone(&store), TaskTracker::new()).expect("threads");
        Tournaments::new(rooms, TaskTracker::new())
    };
    // No room can be created: the game has its id, and waits.
    let tournaments = start(0);
    let plan = convert::tournament_plan(&built_in("Coppa"), [7; 32]).expect("valid settings");
    let (handle, _) = tournaments
        .create("Coppa", plan, None, Key::Local)
        .await
        .expect("made");
    let mut changes = handle.changes();
    handle
        .begin()
        .await
        .expect("the task runs")
        .expect("it can start");
    let forged = loop {
        match handle.games(0, 1).pop().map(|game| game.game_id) {
            Some(game_id) if !game_id.is_empty() => break game_id,
            _ => changes.changed().await.expect("the tournament exists"),
        }
    };
    let game = Id::parse(&forged).expect("an id");
    let summary = v1::RecordSummary {
        game_id: forged.clone(),
        state: v1::RoomState::Finished.into(),
        ..Default::default()
    };
    let lines = chefshat_record::jsonl::read(std::path::Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../tests/fixtures/records/committed.jsonl"
    )));
    let lines: Arc<[_]> = lines.expect("the fixture").into();
    let imported = store.import(game, summary, lines).await;
    assert_eq!(imported, Ok(true));
    assert!(tournaments.has_announced(game), "imports of it are refused");
    let id = handle.id();
    tournaments.end();

    let tournaments = start(9);
    tournaments.restore().await.expect("readable");
    let handle = tournaments.get(id).expect("restored");
    let mut changes = handle.changes();
    while !handle.is_over() {
        changes.changed().await.expect("the tournament exists");
    }
    let games = handle.games(0, 9);
    assert!(
        store.failed().now_or_never().is_none(),
        "the store keeps working"
    );
    assert!(!games.is_empty());
    for game in games {
        assert_eq!(game.state(), v1::TournamentGameState::Counted);
        assert_ne!(game.game_id, forged);
    }
}

#[tokio::test]
async fn a_repeated_request_gets_the_same_answer_also_after_a_restart() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a new one");
    let store: Arc<dyn Store> = Arc::new(store);
    let start = || {
        let config = ServerConfig::default();
        let rooms = Rooms::new(&config, Arc::clone(&store), TaskTracker::new()).expect("threads");
        Tournaments::new(rooms, TaskTracker::new())
    };
    let plan = || convert::tournament_plan(&built_in("Coppa"), [7; 32]).expect("valid settings");
    let request = RequestKey::new([1; 32], b"content");
    let ada = || Entry {
        request_id: Some([2; 32]),
        ..entrant("Ada")
    };
    let tournaments = start();
    let create = || tournaments.create("Coppa", plan(), Some(request), Key::Local);
    let (first, second) = tokio::join!(create(), create());
    let ((handle, owner), (other, again)) = (first.expect("made"), second.expect("made"));
    assert!(Arc::ptr_eq(&handle, &other) && owner == again);
    let other = RequestKey::new([1; 32], b"other content");
    let refused = tournaments
        .create("Coppa", plan(), Some(other), Key::Local)
        .await;
    assert!(matches!(refused, Err(CreateProblem::RequestIdUsed)));

    let (first, second) = tokio::join!(handle.join(ada()), handle.join(ada()));
    let joined = first.expect("the task runs").expect("joined");
    assert_eq!(second.expect("the task runs").expect("joined"), joined);
    handle
        .begin()
        .await
        .expect("the task runs")
        .expect("it can start");
    assert_eq!(handle.join(ada()).await.expect("the task runs"), Ok(joined));
    tournaments.end();

    let tournaments = start();
    tournaments.restore().await.expect("readable");
    let (handle, again) = tournaments
        .create("Coppa", plan(), Some(request), Key::Local)
        .await
        .expect("there");
    assert!(again == owner && handle.is_owner(&owner.to_text()));
    assert_eq!(tournaments.newest(None, None, 9).len(), 1);
    assert_eq!(handle.join(ada()).await.expect("the task runs"), Ok(joined));
    assert_eq!(handle.participant_of(&joined.1.secret), Some(joined.0));
    let bo = Entry {
        name: "Bo".into(),
        ..ada()
    };
    let refused = handle.join(bo).await.expect("the task runs");
    assert_eq!(refused, Err(JoinRefusal::RequestIdUsed));
    assert_eq!(handle.describe().participants.len(), 5);
}

/// A server's tournaments in memory.
fn in_memory() -> Arc<Tournaments> {
    let store: Arc<dyn Store> = Arc::new(crate::store::MemoryStore::default());
    let rooms = Rooms::new(&ServerConfig::default(), store, TaskTracker::new()).expect("threads");
    Tournaments::new(rooms, TaskTracker::new())
}

/// Waits until a tournament is in this state, however long that takes on the paused clock.
async fn until(handle: &TournamentHandle, wanted: impl Fn(&Tournament) -> bool) {
    let mut changes = handle.changes();
    while !handle.read(&wanted) {
        changes.changed().await.expect("its handle is here");
    }
}

#[tokio::test(start_paused = true)]
async fn it_starts_by_itself_at_its_time_if_enough_have_joined() {
    let tournaments = in_memory();
    let hour_ms = 3_600_000;
    let settings = |agents, start_at_ms| chefshat_proto::v1::TournamentSettings {
        start_at_ms,
        built_in_agents: vec!["random".into(); agents],
        ..built_in("Coppa")
    };
    let create = async |agents, start_at_ms| {
        let plan = convert::tournament_plan(&settings(agents, start_at_ms), [7; 32]);
        let plan = plan.expect("valid settings");
        tournaments.create("Coppa", plan, None, Key::Local).await
    };
    let now_ms = since_epoch_ms();
    let before = tokio::time::Instant::now();
    let (handle, _) = create(4, now_ms + hour_ms).await.expect("made");
    assert_eq!(handle.read(Tournament::state), State::Open);
    until(&handle, |core| core.state() != State::Open).await;
    assert!(before.elapsed() >= Duration::from_millis(hour_ms - 60_000));

    // With too few it waits for the second.
    let (handle, _) = create(1, since_epoch_ms() + 1_000).await.expect("made");
    tokio::time::sleep(Duration::from_secs(60)).await;
    assert_eq!(handle.read(Tournament::state), State::Open);
    let joined = handle.join(entrant("Ada")).await.expect("the task runs");
    joined.expect("joined");
    until(&handle, |core| core.state() != State::Open).await;

    for refused in [now_ms - 1, since_epoch_ms() + 367 * 24 * hour_ms] {
        let problem = create(4, refused)
            .await
            .expect_err("not a time to start at");
        assert!(problem.to_string().starts_with("start_at_ms"), "{problem}");
    }
}

#[tokio::test(start_paused = true)]
async fn a_pause_ends_by_itself() {
    let tournaments = in_memory();
    let settings = chefshat_proto::v1::TournamentSettings {
        built_in_agents: Vec::new(),
        no_show_time_ms: 86_400_000,
        ..built_in("Coppa")
    };
    let plan = convert::tournament_plan(&settings, [7; 32]).expect("valid settings");
    let (handle, _) = tournaments
        .create("Coppa", plan, None, Key::Local)
        .await
        .expect("made");
    for name in ["Ada", "Bo", "Cem", "Dia"] {
        let joined = handle.join(entrant(name)).await.expect("the task runs");
        joined.expect("joined");
    }
    handle.begin().await.expect("the task runs").expect("begun");
    let paused = handle.change_by_hand(ByHand::SetPaused(true)).await;
    assert!(paused.expect("the task runs").is_ok());
    let before = tokio::time::Instant::now();
    until(&handle, |core| !core.is_paused()).await;
    assert!(before.elapsed() >= crate::config::TOURNAMENT_PAUSE);
    // Nobody comes, so it ends without results.
    until(&handle, |core| core.state() == State::Finished).await;
}

#[tokio::test]
async fn the_ticket_of_a_participant_ends_with_its_place() {
    let tournaments = in_memory();
    let plan = convert::tournament_plan(&built_in("Coppa"), [7; 32]).expect("valid settings");
    let (handle, _) = tournaments
        .create("Coppa", plan, None, Key::Local)
        .await
        .expect("made");
    let join = async |name| {
        let joined = handle.join(entrant(name)).await.expect("the task runs");
        joined.expect("joined")
    };
    let change = async |what| handle.change_by_hand(what).await.expect("the task runs");
    let known = |ticket: &Token| handle.participant_of(&ticket.secret);
    let (ada, ticket) = join("Ada").await;
    assert_eq!(known(&ticket), Some(ada));
    let leaves = ByHand::Withdraw {
        participant: ada,
        removed: false,
    };
    assert_eq!(change(leaves).await, Ok(None));
    assert_eq!(known(&ticket), None, "the place is free");
    let (bo, bos) = join("Bo").await;
    assert_eq!(bo, ada, "the number is taken again");
    let by = || Newcomer::Somebody {
        name: "Cem".into(),
        kind: None,
        max_games: 1,
        stateless: true,
        request_id: Some([3; 32]),
    };
    let replaced = change(ByHand::Replace {
        participant: bo,
        by: by(),
    });
    let cems = replaced.await.expect("replaced").expect("a ticket");
    assert_eq!((known(&bos), known(&cems)), (None, Some(bo)));
    // The response was lost.
    let again = change(ByHand::Replace {
        participant: bo,
        by: by(),
    });
    assert_eq!(
        again.await.map(|it| it.map(|it| it.secret)),
        Ok(Some(cems.secret))
    );
    let other = change(ByHand::Replace {
        participant: 0,
        by: by(),
    });
    assert_eq!(other.await, Err(ByHandRefusal::RequestIdUsed));
    handle.begin().await.expect("the task runs").expect("begun");
    let leaves = ByHand::Withdraw {
        participant: bo,
        removed: false,
    };
    assert_eq!(change(leaves).await, Ok(None));
    assert_eq!(known(&cems), Some(bo), "it may look at the results");
}
