//! The database returns what was stored. `opening` tests folders and files that cannot be used.

mod damage;
mod full;
mod opening;
pub(crate) mod tournaments;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use chefshat_agents::{AgentKind, NamedAgent};
use chefshat_engine::SeedPlan;
use chefshat_engine::{ActionId, RuleSetSpec, Seat, Seed};
use chefshat_proto::v1;
use futures::FutureExt as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};
use sqlx::{Connection as _, Executor as _};

use super::{DATABASE_FILE, OpenError, SqliteStore};
use crate::ephemeral::{BLOCK, EphemeralJournal, Scratch, StoreFinished};
use crate::form;
use crate::studies::StudyHeader;
use crate::testing::{TypedUnits as _, begin, cup, end, ended};
use crate::{Journal, Keep, Part, ResumableGame, Store, StoreError, StoredGame};
use chefshat_room::ids::{GameId, SecretHash};
use chefshat_room::journal::{
    AbortReason, Branch, Change, Decided, Entry, Fill, GameHeader, GameStart, Marked,
    ParticipantKind, RecordedSeat, SeatLabels, SeatedParticipant, Source, StudyGame, TakenOver,
};
use chefshat_room::policy::{Durability, Policy};
use chefshat_room::testing::{self, OPEN, id, participant, study_game, study_member};

fn header(game: u8, durability: Durability) -> GameHeader {
    let policy = Policy {
        durability,
        bank: Duration::from_millis(1_234),
        pace: Some(Duration::ZERO),
        clocks: Vec::new(),
        // Games of earlier servers have none.
        absence_time: None,
        ..Policy::default()
    };
    let fills = vec![
        OPEN,
        Fill::Open {
            reserved_for: Some(ParticipantKind::Robot),
        },
        Fill::BuiltIn(AgentKind::Greedy.into()),
        Fill::Replay(RecordedSeat {
            game: id(9),
            seat: Seat::new(2),
        }),
    ];
    let taken_over = |seed: u8, actions: &[u16]| TakenOver {
        seed: Seed([seed; 32]),
        actions: actions.iter().copied().map(ActionId::new).collect(),
    };
    GameHeader {
        room_id: id(game ^ 0xff),
        game_id: id(game),
        name: "a room with ünïcode".into(),
        start: GameStart {
            script: None,
            branch: Some(Branch {
                game: id(8),
                same_deals: true,
                taken_over: vec![taken_over(1, &[3, 199]), taken_over(2, &[7])],
            }),
        },
        seed: SeedPlan::Committed {
            server_seed: [4; 32],
            nonce: [5; 32],
        },
        created_at_ms: 1_700_000_000_000,
        join_code: "ABCDEFGH".into(),
        server_version: "0.0.1".into(),
        ..testing::header(policy, fills, RuleSetSpec::default())
    }
}

/// One entry of every kind.
fn entries() -> Vec<Entry> {
    let seat = Seat::new(1);
    let seated = |name_fingerprint: &str| Change::Seated {
        seat,
        participant: Box::new(SeatedParticipant {
            name_fingerprint: name_fingerprint.into(),
            ..participant("Ada", ParticipantKind::Human)
        }),
    };
    let changes = [
        seated(""),
        Change::Vacated(seat),
        Change::Started {
            entropy: vec![vec![], vec![1, 2, 3], vec![0; 32], vec![7]],
        },
        Change::Disconnected {
            seat,
            with_node: false,
        },
        Change::Returned(seat),
        Change::Substituted(Seat::new(0)),
        Change::Attempted {
            seat,
            action: u32::MAX,
        },
        Change::Decided(Decided {
            seat,
            action: ActionId::new(213),
            source: Source::Recorded,
            time_us: u64::MAX,
            bank_left_ms: 17,
            annotations: Some(Box::from([1, 2, 3])),
            by_fallback: false,
        }),
        Change::Expressed {
            seat,
            record_only: true,
            expression: Box::from([4, 5]),
        },
        Change::ServerRestarted,
        Change::Aborted(AbortReason::TooLong),
        // Newer than the changes above.
        Change::Retired(Seat::new(3)),
        Change::Marked(Box::new(Marked {
            label: "EEG on".into(),
            moment: Duration::from_micros(1_234_567),
        })),
        seated("0123456789abcdef"),
        Change::EndConfirmed,
        Change::Disconnected {
            seat,
            with_node: true,
        },
    ];
    (1..)
        .zip(changes)
        .map(|(step, change)| Entry {
            at: Duration::from_micros(step * 1_000_001),
            change,
        })
        .collect()
}

fn summary(header: &GameHeader) -> Box<v1::RecordSummary> {
    Box::new(v1::RecordSummary {
        game_id: header.game_id.to_string(),
        room_name: header.name.clone(),
        state: v1::RoomState::Finished.into(),
        origin: v1::GameOrigin::Dealt.into(),
        created_at_ms: header.created_at_ms,
        ended_at_ms: header.created_at_ms + 1_000,
        seats: vec![
            v1::Participant {
                name: format!("player of {:?}", header.game_id.bytes()[0]),
                kind: v1::ParticipantKind::Robot.into(),
                ..v1::Participant::default()
            },
            v1::Participant {
                seat: 1,
                name: format!("name of {:?}", header.game_id.bytes()[0]),
                built_in_agent: format!("agent of {:?}", header.game_id.bytes()[0]),
                kind: v1::ParticipantKind::Agent.into(),
                ..v1::Participant::default()
            },
        ],
        ..v1::RecordSummary::default()
    })
}

fn shown(value: &(impl std::fmt::Debug + ?Sized)) -> String {
    format!("{value:?}")
}

async fn opened(folder: &Path) -> SqliteStore {
    SqliteStore::open(folder).await.expect("a usable folder")
}

/// The games that are not over.
async fn unfinished(store: &SqliteStore) -> Vec<ResumableGame> {
    let unfinished = store.resumable_games(u64::MAX).await;
    unfinished.expect("readable")
}

/// A connection to the database of a folder, which is created if it is missing.
pub(crate) async fn connected(folder: &Path) -> SqliteConnection {
    let file = SqliteConnectOptions::new().filename(folder.join(DATABASE_FILE));
    let file = file.create_if_missing(true);
    let connection = SqliteConnection::connect_with(&file).await;
    connection.expect("a connection")
}

/// Executes statements on the database of a folder.
pub(crate) async fn edit(folder: &Path, statements: &str) {
    let mut connection = connected(folder).await;
    let statements = sqlx::AssertSqlSafe(statements.to_owned());
    connection.execute(statements).await.expect("executed");
    connection.close().await.expect("closed");
}

#[tokio::test]
async fn an_unfinished_game_resumes_where_it_stopped() {
    let folder = tempfile::tempdir().expect("a folder");
    let header = Arc::new(header(1, Durability::Durable));
    let entries = entries();
    let store = opened(folder.path()).await;
    let mut journal = begin(&store, &header, Vec::new()).await;
    // In parts, as a room commits them.
    for part in entries.chunks(3) {
        let mut part = part.to_vec();
        journal.append(&mut part).await.expect("committed");
        assert!(part.is_empty());
    }
    // The process dies: nothing is closed.
    drop(journal);
    drop(store);
    let store = opened(folder.path()).await;
    let mut left = unfinished(&store).await;
    assert_eq!(left.len(), 1);
    let mut game = left.pop().expect("one");
    assert_eq!(shown(&game.header), shown(&*header));
    assert_eq!(shown(&game.entries), shown(&entries));
    assert!(
        store
            .finished(header.game_id)
            .await
            .expect("readable")
            .is_none(),
        "it is not finished"
    );
    // It resumes and ends.
    let more = vec![entries[3].clone()];
    game.journal
        .append(&mut more.clone())
        .await
        .expect("committed");
    end(&mut game.journal, summary(&header)).await;
    store.close().await;
    drop(store);
    let store = opened(folder.path()).await;
    assert!(unfinished(&store).await.is_empty());
    let stored = store.finished(header.game_id).await.expect("readable");
    let Some(StoredGame::Hosted(stored, journal, _)) = stored else {
        panic!("not stored: {stored:?}");
    };
    assert_eq!(shown(&*stored), shown(&*header));
    assert_eq!(shown(&journal.to_vec()), shown(&[entries, more].concat()));
    let ended_at_ms = summary(&header).ended_at_ms;
    let left = store.resumable_games(ended_at_ms).await.expect("readable");
    assert_eq!(left.len(), 1, "it is still resumable for a while");
    assert!(left[0].concluded);
    assert_eq!(
        store.without_record_file().await.expect("readable"),
        [header.game_id]
    );
    store
        .mark_record_written(header.game_id)
        .await
        .expect("committed");
    assert!(
        store
            .without_record_file()
            .await
            .expect("readable")
            .is_empty()
    );
}

/// The versions of the encoding of what is in a table.
async fn forms(store: &SqliteStore, table: &str) -> Vec<i64> {
    let forms = format!("SELECT form FROM {table} ORDER BY number");
    let forms = sqlx::query_scalar(sqlx::AssertSqlSafe(forms));
    forms.fetch_all(&store.reader.pool).await.expect("readable")
}

#[tokio::test]
async fn what_is_added_to_has_the_form_of_the_version_that_adds_to_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    for number in [1, 2] {
        let header = Arc::new(header(number, Durability::Durable));
        store.create(header, entries()).await.expect("committed");
        let cup = Arc::new(cup(number));
        let created = store.create_tournament(cup, Vec::new());
        created.await.expect("committed");
        let study = StudyHeader {
            id: id(number),
            settings: v1::StudySettings::default(),
            created_at_ms: 1_000,
            owner: SecretHash::of(b"owner"),
            key: [7; 32],
        };
        let created = store.create_study(Arc::new(study));
        created.await.expect("committed");
    }
    store.close().await;
    drop(store);
    // An earlier version has stored all of it.
    let tables = ["games", "tournaments", "studies"];
    for table in tables {
        edit(folder.path(), &format!("UPDATE {table} SET form = 1")).await;
    }

    let store = opened(folder.path()).await;
    let mut games = unfinished(&store).await;
    for table in tables {
        assert_eq!(
            forms(&store, table).await,
            [1, 1],
            "nothing is added to {table} yet"
        );
    }
    let first = games.first_mut().expect("two games");
    first
        .journal
        .append(&mut entries())
        .await
        .expect("committed");
    let appended = store.append_tournament(id(1), 1, Vec::new());
    appended.await.expect("committed");
    let appended = store.append_study(id(1), 0, Vec::new());
    appended.await.expect("committed");
    for table in tables {
        assert_eq!(forms(&store, table).await, [form::FORM, 1], "{table}");
    }
    store.close().await;
}

#[tokio::test]
async fn a_game_is_created_with_its_first_entries() {
    for durability in [Durability::Durable, Durability::Ephemeral] {
        let folder = tempfile::tempdir().expect("a folder");
        let header = Arc::new(header(1, durability));
        let entries = entries();
        let (first, rest) = entries.split_at(2);
        let store = opened(folder.path()).await;
        let mut journal = begin(&store, &header, first.to_vec()).await;
        if durability == Durability::Durable {
            // After a crash here, no game is without its first entries.
            let left = unfinished(&store).await;
            assert_eq!(left.len(), 1);
            assert_eq!(shown(&left[0].entries), shown(&first.to_vec()));
        }
        journal.append(&mut rest.to_vec()).await.expect("committed");
        end(&mut journal, summary(&header)).await;
        let journal = ended(&store, header.game_id).await;
        assert_eq!(shown(&journal), shown(&entries));
    }
}

#[tokio::test]
async fn an_ephemeral_game_is_stored_only_when_it_ends() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let header = Arc::new(header(1, Durability::Ephemeral));
    let mut journal = begin(&store, &header, Vec::new()).await;
    journal.append(&mut entries()).await.expect("in memory");
    assert!(unfinished(&store).await.is_empty());
    end(&mut journal, summary(&header)).await;
    let journal = ended(&store, header.game_id).await;
    assert_eq!(shown(&journal), shown(&entries()));
}

/// Appends entries as rooms do, until they take several files' worth of memory; all of them.
async fn append_many(journal: &mut dyn Journal) -> Vec<Entry> {
    let mut all = Vec::new();
    for _ in 0..2_000 {
        all.extend(entries());
        let mut new = entries();
        if !journal.append_now(&mut new) {
            journal.append(&mut new).await.expect("it is kept");
        }
        assert!(new.is_empty());
    }
    all
}

#[tokio::test]
async fn a_long_ephemeral_game_is_in_a_file_until_it_ends() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let header = Arc::new(header(1, Durability::Ephemeral));
    let mut journal = begin(&store, &header, entries()).await;
    let mut all = entries();
    all.extend(append_many(&mut *journal).await);
    assert!(store.scratch.in_use() > 0);
    let read = journal.entries().await.expect("readable");
    assert_eq!(shown(&read), shown(&all));
    // And what comes after it was read.
    all.extend(append_many(&mut *journal).await);
    end(&mut journal, summary(&header)).await;
    // Its room has the journal for a while.
    assert_eq!(store.scratch.in_use(), 0);
    let stored = ended(&store, header.game_id).await;
    assert_eq!(shown(&stored), shown(&all));
}

/// Stores nothing but how many bytes arrive.
#[derive(Default)]
struct Counted(AtomicUsize);

impl StoreFinished for Arc<Counted> {
    async fn store_finished(
        &self,
        _: &GameHeader,
        entries: Vec<u8>,
        _: Option<Box<v1::RecordSummary>>,
        _: Option<Vec<u8>>,
    ) -> Result<(), StoreError> {
        self.0.store(entries.len(), Ordering::Relaxed);
        Ok(())
    }
}

#[tokio::test]
async fn a_file_that_cannot_be_written_costs_memory_and_no_game() {
    let folder = tempfile::tempdir().expect("a folder");
    for is_writable in [true, false] {
        let path = folder.path().to_path_buf();
        let header = Arc::new(header(1, Durability::Ephemeral));
        let counted = Arc::new(Counted::default());
        let scratch = Scratch::new(path, move || is_writable);
        let mut journal = EphemeralJournal::new(
            Arc::clone(&header),
            Vec::new(),
            scratch,
            Arc::clone(&counted),
        );
        let mut all = append_many(&mut journal).await;
        let encoded = form::entries_to_bytes(&mut all).len();
        assert!(encoded > 4 * BLOCK);
        if is_writable {
            // A room commits little at a time.
            assert!(journal.in_memory() < 2 * BLOCK);
        } else {
            assert_eq!(journal.in_memory(), encoded);
        }
        let end = journal.finish(Some(summary(&header)), None).await;
        end.expect("stored");
        assert_eq!(counted.0.load(Ordering::Relaxed), encoded);
    }
}

#[tokio::test]
async fn the_owner_of_a_long_branch_is_listed() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let mut header = header(1, Durability::Durable);
    let branch = header.start.branch.as_mut().expect("it is one");
    branch.taken_over[0].actions = vec![ActionId::new(199); 100_000];
    let header = Arc::new(header);
    let mut journal = begin(&store, &header, entries()).await;
    end(&mut journal, summary(&header)).await;
    let all = v1::RecordFilter::default();
    let listed = (store.list(&all, Part::After(0), 9).await).expect("readable");
    let owner = listed[0].owner.as_ref().expect("it is read");
    assert_eq!(owner.bytes(), header.owner.bytes());
}

#[tokio::test]
async fn many_rooms_share_the_writer() {
    // More than fit one statement, and not a round number.
    const ROOMS: u8 = 201;
    let folder = tempfile::tempdir().expect("a folder");
    let store = Arc::new(opened(folder.path()).await);
    let playing = (0..ROOMS).map(|room| {
        let store = Arc::clone(&store);
        tokio::spawn(async move {
            let header = Arc::new(header(room, Durability::Durable));
            let mut journal = begin(&*store, &header, Vec::new()).await;
            for entry in entries() {
                journal.append(&mut vec![entry]).await.expect("committed");
            }
        })
    });
    for room in playing.collect::<Vec<_>>() {
        room.await.expect("no panic");
    }
    let unfinished = unfinished(&store).await;
    assert_eq!(unfinished.len(), usize::from(ROOMS));
    for game in unfinished {
        assert_eq!(shown(&game.entries), shown(&entries()));
    }
}

#[tokio::test]
async fn an_imported_game_is_stored_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let header = header(1, Durability::Durable);
    let lines: Arc<[v1::RecordLine]> = Arc::from([
        v1::RecordLine {
            line: Some(v1::record_line::Line::Header(Box::new(v1::RecordHeader {
                game_id: header.game_id.to_string(),
                ..v1::RecordHeader::default()
            }))),
        },
        v1::RecordLine {
            line: Some(v1::record_line::Line::Footer(v1::RecordFooter::default())),
        },
    ]);
    let import = || store.import(header.game_id, *summary(&header), Arc::clone(&lines));
    // One caller is cancelled before the answer; others call at the same time.
    assert!(import().now_or_never().is_none());
    let answers = tokio::join!(import(), import());
    assert_eq!(answers, (Ok(false), Ok(false)), "the first was stored");
    assert!(
        store.failed().now_or_never().is_none(),
        "a taken id is not a failure"
    );
    let listed = (store.list(&v1::RecordFilter::default(), Part::FROM_OLDEST, 9)).await;
    let listed = listed.expect("readable");
    assert!(listed.len() == 1 && listed[0].summary.as_ref().is_ok_and(|it| it.added));
    let hosted_here = v1::RecordFilter {
        hosted_here: true,
        ..v1::RecordFilter::default()
    };
    let listed = store.list(&hosted_here, Part::FROM_OLDEST, 9).await;
    let listed = listed.expect("readable");
    assert!(listed.is_empty());
    let stored = store.finished(header.game_id).await.expect("readable");
    let Some(StoredGame::Imported(stored)) = stored else {
        panic!("not stored: {stored:?}");
    };
    assert_eq!(stored, lines);
    assert!(unfinished(&store).await.is_empty());
}

#[tokio::test]
async fn an_unreadable_game_is_left_unchanged_and_others_resume() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    for game in 1..=4 {
        let header = Arc::new(header(game, Durability::Durable));
        let mut journal = begin(&store, &header, Vec::new()).await;
        for entry in entries() {
            journal.append(&mut vec![entry]).await.expect("committed");
        }
    }
    store.close().await;
    drop(store);
    let mut connection = connected(folder.path()).await;
    for damage in [
        "UPDATE journal SET entries = x'ff' WHERE game = 1 AND position = 2",
        "DELETE FROM journal WHERE game = 2 AND position = 4",
        "UPDATE games SET form = 99 WHERE number = 4",
    ] {
        let changed = connection.execute(damage).await.expect("executed");
        assert_eq!(changed.rows_affected(), 1, "{damage}");
    }
    connection.close().await.expect("closed");
    let store = opened(folder.path()).await;
    let unfinished = unfinished(&store).await;
    let games: Vec<GameId> = unfinished.iter().map(|game| game.header.game_id).collect();
    assert_eq!(games, [id(3)]);
}

/// Stores two finished games with [`entries`], whose rows alternate, and closes the database.
async fn two_games(folder: &Path) -> [Arc<GameHeader>; 2] {
    let store = opened(folder).await;
    let headers = [1, 2].map(|game| Arc::new(header(game, Durability::Durable)));
    let mut journals = Vec::new();
    for header in &headers {
        journals.push(begin(&store, header, Vec::new()).await);
    }
    for entry in entries() {
        for journal in &mut journals {
            let mut entry = vec![entry.clone()];
            journal.append(&mut entry).await.expect("committed");
        }
    }
    for (journal, header) in journals.iter_mut().zip(&headers) {
        end(journal, summary(header)).await;
    }
    store.close().await;
    headers
}

#[tokio::test]
async fn a_missing_part_of_a_finished_game_is_detected() {
    for damage in [
        "DELETE FROM journal WHERE game = 1 AND position = 0",
        "DELETE FROM journal WHERE game = 1 AND position = 4",
        "DELETE FROM journal WHERE row = (SELECT max(row) FROM journal WHERE game = 1)",
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let headers = two_games(folder.path()).await;
        edit(folder.path(), damage).await;
        let store = opened(folder.path()).await;
        let error = store.finished(headers[0].game_id).await.expect_err("a gap");
        assert!(error.to_string().contains("missing"), "{error}");
        let journal = ended(&store, headers[1].game_id).await;
        assert_eq!(shown(&journal), shown(&entries()));
    }
}

#[tokio::test]
async fn deleting_a_damaged_game_deletes_no_row_of_another() {
    for damage in [
        "UPDATE journal SET previous = row - 1 WHERE game = 2",
        // A circle.
        "UPDATE journal SET previous = (SELECT max(row) FROM journal WHERE game = 2)
         WHERE game = 2 AND position = 0",
        "UPDATE games SET last_row = (SELECT max(row) FROM journal WHERE game = 1)
         WHERE number = 2",
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let [whole, damaged] = two_games(folder.path()).await;
        edit(folder.path(), damage).await;
        let store = opened(folder.path()).await;
        let deleted = store.delete(vec![damaged.game_id]).await;
        deleted.expect("committed");
        assert!(matches!(store.finished(damaged.game_id).await, Ok(None)));
        let journal = ended(&store, whole.game_id).await;
        assert_eq!(shown(&journal), shown(&entries()));
    }
}

#[tokio::test]
async fn an_import_of_an_earlier_version_is_kept_from_the_first_start_of_this_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = opened(folder.path()).await;
    let imported = header(1, Durability::Durable);
    for game in [imported.game_id, id(2)] {
        let import = store.import(game, *summary(&imported), Arc::from([])).await;
        assert_eq!(import, Ok(true));
        store.mark_record_written(game).await.expect("committed");
    }
    store.close().await;
    drop(store);
    edit(
        folder.path(),
        "UPDATE games SET ended_at_ms = 1; DELETE FROM _sqlx_migrations WHERE version > 4;
         DROP TABLE study_traces; DROP TABLE study_changes; DROP TABLE studies",
    )
    .await;
    let store = opened(folder.path()).await;
    for (ended_since_ms, prunable) in [(summary(&imported).ended_at_ms, 0), (u64::MAX, 1)] {
        let keep = Keep {
            ended_since_ms: Some(ended_since_ms),
            ..Keep::default()
        };
        let found = store.prunable(keep, 0, 9).await.expect("readable");
        assert_eq!(found.len(), prunable);
    }
}

/// The files of their records wait for space, which deleting them frees.
#[tokio::test]
async fn games_without_record_files_are_pruned_while_the_disk_is_full() {
    let folder = tempfile::tempdir().expect("a folder");
    let [older, _] = two_games(folder.path()).await;
    let store = opened(folder.path()).await;
    let found = store.prunable(Keep::default(), 0, 9).await;
    assert_eq!(found, Ok(Vec::new()));
    let waiting = store.space.wait(tokio::time::Instant::now());
    let waited = tokio::time::timeout(Duration::ZERO, waiting).await;
    assert!(waited.is_err() && !store.has_space());
    let found = store.prunable(Keep::default(), 0, 9).await;
    let games: Vec<GameId> = found.expect("readable").iter().map(|it| it.1).collect();
    assert_eq!(games, [older.game_id]);
}

/// The encoding never changes: games stored by any version must be readable by every later one.
#[test]
fn the_encoding_of_stored_data_does_not_change() {
    let header = header(1, Durability::Durable);
    let mut journal = Vec::new();
    for entry in entries() {
        form::put_entry(&entry, &mut journal);
    }
    let written = format!(
        "{}\n{}\n",
        hex::encode(form::header_to_bytes(&header)),
        hex::encode(&journal)
    );
    assert_eq!(written, include_str!("fixtures/form3.hex"));
    for (former, version) in [
        // That of before versions were named.
        (include_str!("fixtures/form1.hex"), "0.1.0"),
        (include_str!("fixtures/form2.hex"), "0.0.1"),
    ] {
        let (first, second) = former.split_once('\n').expect("two lines");
        let bytes = hex::decode(first).expect("hexadecimal digits");
        let read = form::header_from_bytes(&bytes).expect("readable");
        assert_eq!(read.server_version, version);
        let bytes = hex::decode(second.trim()).expect("hexadecimal digits");
        let mut read = Vec::new();
        form::read_entries(&bytes, &mut read).expect("readable");
        assert_eq!(shown(&read), shown(&entries()[..read.len()]));
    }
    let (first, second) = written.split_once('\n').expect("two lines");
    let bytes = hex::decode(first).expect("hexadecimal digits");
    let read = form::header_from_bytes(&bytes).expect("readable");
    assert_eq!(shown(&read), shown(&header));
    let bytes = hex::decode(second.trim()).expect("hexadecimal digits");
    let mut read = Vec::new();
    form::read_entries(&bytes, &mut read).expect("readable");
    assert_eq!(shown(&read), shown(&entries()));
}

#[test]
fn fields_added_later_are_read_back() {
    let header = GameHeader {
        display_names: BTreeMap::from([(2, "Greta".to_owned())]),
        policy: Policy::default(),
        study: Some(Arc::new(StudyGame {
            members: vec![study_member(3, "P03", 1), study_member(5, "P05", 3)],
            group: Some(2),
            ..study_game(SeatLabels::Players)
        })),
        ..header(1, Durability::Durable)
    };
    let read = form::header_from_bytes(&form::header_to_bytes(&header)).expect("readable");
    assert_eq!(shown(&read), shown(&header));
}

/// The bounds of a search apply to requests alone.
#[test]
fn what_was_stored_with_larger_searches_is_read_back() {
    let agent: NamedAgent = "monte_carlo:60000ms".parse().expect("an agent");
    chefshat_wire::convert::check_budget("seats", agent).expect_err("no request may name it");
    let mut stored = header(1, Durability::Durable);
    stored.policy.substitute = agent;
    stored.fills[2] = Fill::BuiltIn(agent);
    let read = form::header_from_bytes(&form::header_to_bytes(&stored)).expect("readable");
    assert_eq!(read.policy.substitute, agent);
    assert_eq!(shown(&read.fills[2]), shown(&stored.fills[2]));
    let mut cup = cup(1);
    cup.settings.built_in_agents = vec![agent.name(); 2];
    cup.settings.filler = agent.name();
    let read = form::tournament_from_bytes(&cup.to_bytes()).expect("readable");
    let plan =
        chefshat_wire::convert::tournament_plan(&read.settings, [0; 32]).expect("it resumes");
    assert_eq!((plan.built_in, plan.core.filler), (vec![agent; 2], agent));
}
