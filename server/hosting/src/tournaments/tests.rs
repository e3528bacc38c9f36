//! Creating, joining and restoring tournaments.

use std::cell::Cell;
use std::sync::atomic::Ordering;
use std::time::Duration;

use chefshat_proto::v1;
use futures::FutureExt as _;
use tokio::time::Instant;

use super::*;
use crate::config::{MAX_TOURNAMENTS, ServerConfig};
use chefshat_admission::limits::Key;
use chefshat_room::ids::{GameId, RoomId, TournamentId, TournamentToken};
use chefshat_store::testing::{FailingStore, TypedUnits as _};
use chefshat_store::{SqliteStore, Store};
use chefshat_tournament::{ByHandProblem, GameState};

/// A new database, in a folder of its own.
async fn database() -> (tempfile::TempDir, Arc<dyn Store>) {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a new one");
    (folder, Arc::new(store))
}

/// The tournaments of a server with this store.
fn server(store: Arc<dyn Store>) -> Arc<Tournaments> {
    Tournaments::new(Rooms::for_tests(store), TaskTracker::new())
}

fn plan(settings: &v1::TournamentSettings) -> TournamentPlan {
    convert::tournament_plan(settings, [7; 32]).expect("valid settings")
}

/// A new tournament with these settings.
async fn created(
    tournaments: &Arc<Tournaments>,
    settings: &v1::TournamentSettings,
) -> Arc<TournamentHandle> {
    let created = tournaments.create("Coppa", plan(settings), None, Key::Local);
    created.await.expect("made").0
}

/// A participant of this name.
async fn joined(handle: &TournamentHandle, name: &str) -> (usize, TournamentToken) {
    handle.join(entrant(name)).await.expect("joined")
}

#[tokio::test]
async fn creating_a_tournament_completes_even_if_the_caller_is_cancelled() {
    let (_folder, store) = database().await;
    let tracker = TaskTracker::new();
    let rooms = Rooms::for_tests(Arc::clone(&store));
    let tournaments = Tournaments::new(rooms, tracker.clone());
    // The caller is cancelled during the commit.
    let asked = created(&tournaments, &coppa()).now_or_never();
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
    assert!(tournaments.get(TournamentId::random()).is_none());
    assert!(tournaments.by_code("").is_none());
}

/// Settings of a tournament of built-in agents in games of one Shift.
fn coppa() -> v1::TournamentSettings {
    v1::TournamentSettings {
        name: "Coppa".into(),
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
        name_fingerprint: String::new(),
        kind: chefshat_room::journal::ParticipantKind::Agent,
        max_games: 1,
        stateless: true,
        at_table: false,
        request_id: None,
    }
}

#[tokio::test]
async fn readers_see_only_committed_changes() {
    let store = Arc::new(chefshat_store::testing::FailingStore::after(u64::MAX));
    let commits = Arc::clone(&store.tournament_commits);
    let tournaments = server(store);
    let handle = created(&tournaments, &coppa()).await;
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
    joining.await.expect("no panic").expect("joined");
    assert_eq!(handle.describe().participants.len(), 5);
}

#[tokio::test]
async fn a_forged_record_of_a_coming_game_is_not_counted() {
    let (_folder, store) = database().await;
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
    let handle = created(&tournaments, &coppa()).await;
    let mut changes = handle.changes();
    handle.begin().await.expect("it can start");
    let forged = loop {
        match handle.games(0, 1).pop().map(|game| game.game_id) {
            Some(game_id) if !game_id.is_empty() => break game_id,
            _ => changes.changed().await.expect("the tournament exists"),
        }
    };
    let game = GameId::parse(&forged).expect("an id");
    let summary = v1::RecordSummary {
        game_id: forged.clone(),
        state: v1::RoomState::Finished.into(),
        ..Default::default()
    };
    let lines = chefshat_record::jsonl::read(std::path::Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../tests/fixtures/records/committed.jsonl"
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
    let (_folder, store) = database().await;
    let start = || server(Arc::clone(&store));
    let plan = || plan(&coppa());
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
    assert!(matches!(refused, Err(CreateError::RequestIdUsed)));

    let (first, second) = tokio::join!(handle.join(ada()), handle.join(ada()));
    let joined = first.expect("joined");
    assert_eq!(second.expect("joined"), joined);
    handle.begin().await.expect("it can start");
    assert_eq!(handle.join(ada()).await, Ok(joined));
    // Also when nothing new is accepted any more.
    tournaments.stop();
    let (other, again) = create().await.expect("there");
    assert!(Arc::ptr_eq(&handle, &other) && owner == again);
    let refused = tournaments.create("Coppa", plan(), None, Key::Local).await;
    assert!(matches!(refused, Err(CreateError::ShuttingDown)));
    tournaments.end();

    let tournaments = start();
    tournaments.restore().await.expect("readable");
    let (handle, again) = tournaments
        .create("Coppa", plan(), Some(request), Key::Local)
        .await
        .expect("there");
    assert!(again == owner && handle.is_owner(&owner.to_text()));
    assert_eq!(tournaments.newest(None, None, 9).len(), 1);
    assert_eq!(handle.join(ada()).await, Ok(joined));
    assert_eq!(handle.participant_of(&joined.1.secret), Some(joined.0));
    let bo = Entry {
        name: "Bo".into(),
        ..ada()
    };
    let refused = handle.join(bo).await;
    assert_eq!(refused, Err(JoinRefusal::RequestIdUsed));
    assert_eq!(handle.describe().participants.len(), 5);
}

/// A server's tournaments in memory.
fn in_memory() -> Arc<Tournaments> {
    let store: Arc<dyn Store> = Arc::new(chefshat_store::MemoryStore::default());
    Tournaments::at(stopped_clock, Rooms::for_tests(store), TaskTracker::new())
}

std::thread_local! {
    /// When the test of this thread began, on its stopped clock.
    static BEGAN: Instant = Instant::now();
    /// How much the time of day of this thread is ahead, milliseconds.
    static AHEAD_MS: Cell<u64> = const { Cell::new(0) };
}

/// A time of day that advances with the clock of the test.
fn stopped_clock() -> u64 {
    1_000_000 + millis(BEGAN.with(Instant::elapsed)) + AHEAD_MS.get()
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
    let settings = |agents, start_at_ms| v1::TournamentSettings {
        start_at_ms,
        built_in_agents: vec!["random".into(); agents],
        ..coppa()
    };
    let create = async |agents, start_at_ms| {
        let plan = plan(&settings(agents, start_at_ms));
        tournaments.create("Coppa", plan, None, Key::Local).await
    };
    let now_ms = stopped_clock();
    let before = Instant::now();
    let (handle, _) = create(4, now_ms + hour_ms).await.expect("made");
    assert_eq!(handle.read(Tournament::state), State::Open);
    until(&handle, |core| core.state() != State::Open).await;
    assert!(before.elapsed() >= Duration::from_millis(hour_ms - 60_000));

    // With too few it waits for the second.
    let (handle, _) = create(1, stopped_clock() + 1_000).await.expect("made");
    tokio::time::sleep(Duration::from_secs(60)).await;
    assert_eq!(handle.read(Tournament::state), State::Open);
    joined(&handle, "Ada").await;
    until(&handle, |core| core.state() != State::Open).await;

    for refused in [now_ms - 1, stopped_clock() + 367 * 24 * hour_ms] {
        let problem = create(4, refused)
            .await
            .expect_err("not a time to start at");
        assert!(problem.to_string().starts_with("start_at_ms"), "{problem}");
    }
}

/// A server may start before its clock is set, and machines sleep.
#[tokio::test(start_paused = true)]
async fn it_starts_at_its_time_although_the_clock_was_set_meanwhile() {
    let tournaments = in_memory();
    let days_ms = 300 * 24 * 3_600_000;
    let settings = v1::TournamentSettings {
        start_at_ms: stopped_clock() + days_ms,
        ..coppa()
    };
    let handle = created(&tournaments, &settings).await;
    let a_while = Duration::from_secs(120);
    tokio::time::sleep(a_while).await;
    assert_eq!(handle.read(Tournament::state), State::Open);
    AHEAD_MS.set(days_ms);
    tokio::time::sleep(a_while).await;
    assert_ne!(handle.read(Tournament::state), State::Open);
}

/// The cards of a game whose room has failed are not dealt again.
#[tokio::test(start_paused = true)]
async fn games_whose_rooms_fail_are_voided() {
    let store = Arc::new(FailingStore::after(u64::MAX));
    store.journals_panic.store(true, Ordering::Relaxed);
    let (_, games) = played(&store).await;
    assert_eq!(games, [GameState::Void]);
}

/// A room that has failed is resumed with the server, although its game counts as broken off.
#[tokio::test]
async fn rooms_that_no_running_game_has_are_closed() {
    use crate::rooms::{NewRoom, PartOf, Seating};
    let tournaments = in_memory();
    let handle = created(&tournaments, &coppa()).await;
    let game = chefshat_room::journal::TournamentGame {
        tournament: handle.id(),
        series: None,
    };
    let room = RoomId::random();
    let new = NewRoom {
        seating: Some(Seating {
            part_of: PartOf::Tournament(game),
            owner: handle.room_owner(room),
            game_id: GameId::random(),
            participants: Default::default(),
            server_seed: None,
        }),
        ..NewRoom::for_tests()
    };
    let rooms = tournaments.rooms();
    rooms.create(new).await.expect("a room");
    let closed = rooms.notify_of_games(handle.id().unit());
    handle.close_rooms(rooms);
    closed.notified().await;
    assert_eq!(rooms.is_over(room), Some(true));
}

#[tokio::test]
async fn a_tournament_that_is_over_takes_no_join_code_from_an_open_one() {
    let (_folder, store) = database().await;
    let tournaments = server(Arc::clone(&store));
    let open = created(&tournaments, &coppa()).await;
    // Its code was that of a tournament that another node had.
    let former = TournamentHeader {
        id: TournamentId::random(),
        ..open.header.clone()
    };
    let key = chefshat_store::units::UnitKey::Tournament(open.id());
    let mut stored = store.unit(key).await.expect("readable").expect("stored");
    stored.header = former.to_bytes();
    let closed = [TournamentEntry::Change(Change::Closed)];
    stored.rows.push(TournamentEntry::to_bytes(&closed));
    assert!(tournaments.resume(former.id, stored).await);
    let shown = tournaments.get(former.id).expect("it is shown");
    assert!(shown.is_over());
    let found = || tournaments.by_code(open.join_code()).map(|it| it.id());
    assert_eq!(found(), Some(open.id()));
    tournaments.forget_one(former.id);
    assert_eq!(found(), Some(open.id()));
}

/// The games of a tournament that was played to its end on this store.
async fn played(store: &Arc<FailingStore>) -> (Arc<TournamentHandle>, Vec<GameState>) {
    let tournaments = server(Arc::clone(store) as _);
    let settings = v1::TournamentSettings {
        built_in_agents: vec!["random".into(); 4],
        start_when_joined: 4,
        ..coppa()
    };
    let handle = created(&tournaments, &settings).await;
    until(&handle, |core| core.state() == State::Finished).await;
    handle.stopped().await;
    tokio::task::yield_now().await;
    let unit = handle.id().unit();
    assert!(!tournaments.rooms.notifies(unit), "nobody waits any more");
    let games = handle.read(|core| core.games().iter().map(|game| game.state.clone()).collect());
    (handle, games)
}

/// The result of a game that the room passes on is that of its record.
#[tokio::test]
async fn games_count_without_being_read_from_the_store() {
    let store = Arc::new(FailingStore::after(u64::MAX));
    store.games_unreadable.store(true, Ordering::Relaxed);
    let (handle, games) = played(&store).await;
    let [GameState::Counted(result)] = &games[..] else {
        panic!("{games:?}");
    };

    store.games_unreadable.store(false, Ordering::Relaxed);
    let game = GameId::parse(&handle.games(0, 9)[0].game_id).expect("an id");
    let stored = store.finished(game).await.expect("readable");
    let lines = stored.expect("a record").lines().into_owned();
    let outcome = chefshat_record::outcome::outcome(&lines).expect("finished");
    assert_eq!(result.shifts, outcome.shifts);
    let mut counted: Vec<_> = result.seats.iter().map(|it| it.statistics).collect();
    let mut recorded: Vec<_> = outcome.seats.iter().map(|it| it.statistics).collect();
    for seats in [&mut counted, &mut recorded] {
        seats.sort_by_key(|it| it.place);
    }
    assert_eq!(counted, recorded);
}

#[tokio::test]
async fn a_game_that_cannot_be_read_back_ends_no_tournament() {
    let store = Arc::new(FailingStore::after(u64::MAX));
    store.games_unreadable.store(true, Ordering::Relaxed);
    store.journals_unreadable.store(true, Ordering::Relaxed);
    let (_, games) = played(&store).await;
    assert!(!games.is_empty() && games.iter().all(|state| *state == GameState::Void));
}

#[tokio::test(start_paused = true)]
async fn a_pause_ends_by_itself() {
    let tournaments = in_memory();
    let settings = v1::TournamentSettings {
        built_in_agents: Vec::new(),
        no_show_time_ms: 86_400_000,
        ..coppa()
    };
    let handle = created(&tournaments, &settings).await;
    for name in ["Ada", "Bo", "Cem", "Dia"] {
        joined(&handle, name).await;
    }
    handle.begin().await.expect("begun");
    let paused = handle.change_by_hand(ByHand::SetPaused(true)).await;
    assert_eq!(paused, Ok(None));
    let before = Instant::now();
    until(&handle, |core| !core.is_paused()).await;
    assert!(before.elapsed() >= super::task::TOURNAMENT_PAUSE);
    // Nobody comes, so it ends without results.
    until(&handle, |core| core.state() == State::Finished).await;
}

/// A withdrawal with a ticket.
fn withdrawal(ticket: &TournamentToken) -> ByHand {
    ByHand::Withdraw {
        who: Who::Ticket(ticket.hash()),
        charged: Key::Local,
    }
}

/// Somebody who takes a place, by a request with this id.
fn cem(request_id: u8) -> Newcomer {
    Newcomer::Somebody {
        name: "Cem".into(),
        kind: None,
        max_games: 1,
        stateless: true,
        request_id: Some([request_id; 32]),
    }
}

#[tokio::test]
async fn the_ticket_of_a_participant_ends_with_its_place() {
    let tournaments = in_memory();
    let handle = created(&tournaments, &coppa()).await;
    let change = async |what| handle.change_by_hand(what).await;
    let known = |ticket: &TournamentToken| handle.participant_of(&ticket.secret);
    let (ada, adas) = joined(&handle, "Ada").await;
    assert_eq!(known(&adas), Some(ada));
    assert_eq!(change(withdrawal(&adas)).await, Ok(None));
    assert_eq!(known(&adas), None, "the place is free");
    let (bo, bos) = joined(&handle, "Bo").await;
    assert_ne!(bo, ada, "no number is used again");
    // Decided when it is made: the ticket has no place any more.
    let again = change(withdrawal(&adas)).await;
    assert_eq!(again, Err(ByHandRefusal::TicketUnknown));
    let (participant, by) = (bo, cem(3));
    let replaced = change(ByHand::Replace { participant, by }).await;
    let cems = replaced.expect("replaced").expect("a ticket");
    assert_eq!((known(&bos), known(&cems)), (None, Some(bo)));
    let late = change(withdrawal(&bos)).await;
    assert_eq!(late, Err(ByHandRefusal::TicketUnknown));
    // The response was lost.
    let by = cem(3);
    let again = change(ByHand::Replace { participant, by }).await;
    assert_eq!(
        again.map(|it| it.map(|it| it.secret)),
        Ok(Some(cems.secret))
    );
    let other = change(ByHand::Replace {
        participant: 0,
        by: cem(3),
    });
    assert_eq!(other.await, Err(ByHandRefusal::RequestIdUsed));
    handle.begin().await.expect("begun");
    let postpone = ByHand::Postpone {
        game: 0,
        by: Some(bos.hash()),
    };
    assert_eq!(change(postpone).await, Err(ByHandRefusal::TicketUnknown));
    assert_eq!(change(withdrawal(&cems)).await, Ok(None));
    assert_eq!(known(&cems), Some(bo), "it may look at the results");
    assert_eq!(change(withdrawal(&cems)).await, Ok(None));
    assert_eq!(change(ByHand::Remove { participant }).await, Ok(None));
    assert_eq!(known(&cems), None, "the organiser has removed it");
}

#[tokio::test]
async fn a_repeated_replacement_by_a_built_in_agent_replaces_once() {
    let tournaments = in_memory();
    let settings = v1::TournamentSettings {
        physical_tables: 1,
        ..coppa()
    };
    let handle = created(&tournaments, &settings).await;
    let table = Entry {
        at_table: true,
        ..entrant("Ada")
    };
    let (at_table, _) = handle.join(table).await.expect("joined");
    let replace = async |participant, by| {
        let what = ByHand::Replace { participant, by };
        handle.change_by_hand(what).await
    };
    let built_in = |agent: &str, name: &str, id: u8| Newcomer::BuiltIn {
        agent: agent.parse().expect("a built-in agent"),
        name: name.into(),
        request_id: Some([id; 32]),
    };
    let former = |participant| handle.read(|core| core.former(participant).len());
    let name =
        |participant: usize| handle.read(|core| core.participants()[participant].name.clone());
    // Two of them get the names "greedy" and "greedy 2"; the second is asked for twice.
    let first = replace(0, built_in("greedy", "", 1)).await;
    assert_eq!((first, name(0)), (Ok(None), "greedy".to_owned()));
    for _ in 0..2 {
        let second = replace(1, built_in("greedy", "", 2)).await;
        assert_eq!(second, Ok(None));
        assert_eq!((former(1), name(1)), (1, "greedy 2".to_owned()));
        // The first name is free now.
        replace(0, built_in("random", "Rita", 3))
            .await
            .expect("replaced");
    }
    assert_eq!(former(0), 2);
    let other = replace(1, built_in("random", "", 2)).await;
    assert_eq!(other, Err(ByHandRefusal::RequestIdUsed));
    // Nor does a physical table return a ticket.
    for _ in 0..2 {
        assert_eq!(replace(at_table, cem(4)).await, Ok(None));
        assert_eq!(former(at_table), 1);
    }
    // The answer is the same when the tournament is over.
    handle.close().await.expect("the task runs");
    assert_eq!(replace(at_table, cem(4)).await, Ok(None));
    let late = replace(at_table, cem(5)).await;
    assert_eq!(late, Err(ByHandProblem::Over.into()));
}

#[tokio::test]
async fn one_caller_cannot_join_and_withdraw_for_ever() {
    use super::by_hand::MAX_EARLY_WITHDRAWALS_OF_CALLER;
    let tournaments = in_memory();
    let handle = created(&tournaments, &coppa()).await;
    let come = async || joined(&handle, "fickle").await.1;
    let go = async |ticket: &TournamentToken, address: [u8; 4]| {
        let what = ByHand::Withdraw {
            who: Who::Ticket(ticket.hash()),
            charged: Key::Address(address.into()),
        };
        handle.change_by_hand(what).await
    };
    let (stranger, other) = ([192, 0, 2, 1], [192, 0, 2, 2]);
    for _ in 0..MAX_EARLY_WITHDRAWALS_OF_CALLER {
        assert_eq!(go(&come().await, stranger).await, Ok(None));
    }
    let ticket = come().await;
    let refused = go(&ticket, stranger).await;
    let most = MAX_EARLY_WITHDRAWALS_OF_CALLER;
    assert_eq!(refused, Err(ByHandProblem::TooMany(most).into()));
    assert_eq!(go(&ticket, other).await, Ok(None));
    // What the organiser does is not counted there.
    let ticket = come().await;
    let participant = handle.participant_of(&ticket.secret).expect("joined");
    let removed = ByHand::Remove { participant };
    let removed = handle.change_by_hand(removed).await;
    assert_eq!(removed, Ok(None));
    handle.begin().await.expect("begun");
}

#[tokio::test]
async fn tournaments_count_after_a_restart_too() {
    let (_folder, store) = database().await;
    let start = || server(Arc::clone(&store));
    let create = async |tournaments: &Arc<Tournaments>, caller| {
        let plan = plan(&coppa());
        tournaments.create("Coppa", plan, None, caller).await
    };
    let first = start();
    create(&first, Key::Local).await.expect("there is space");
    let tournaments = start();
    assert_eq!(tournaments.restore().await, Ok(1));
    let mut created = 1;
    // Two callers, because none may have all places.
    for caller in [Key::Local, Key::Resumed] {
        while create(&tournaments, caller).await.is_ok() {
            created += 1;
        }
    }
    assert_eq!(created, MAX_TOURNAMENTS);
}
