//! Removing a participant, from each store. The tests of the command line cover played games and
//! their files.

use chefshat_engine::{ActionId, Seat};
use chefshat_record::pseudonym::{Named, Redactions};
use chefshat_room::journal::{Decided, Marked, ParticipantKind, SeatedParticipant, Source};
use chefshat_room::testing::participant;
use chefshat_tournament::{Change as TournamentChange, Entrant};

use super::*;
use crate::forget::MAX_REWRITTEN_AT_ONCE;
use crate::sqlite::tests::edit;
use crate::tournaments::TournamentEntry;

fn ana() -> Pseudonym {
    Pseudonym {
        of: Named {
            name: "Ana".into(),
            fingerprint: None,
        },
        pseudonym: "deleted 1".into(),
        key: None,
    }
}

fn at_once(change: Change) -> Entry {
    Entry {
        at: std::time::Duration::ZERO,
        change,
    }
}

/// The fingerprint of a name; a pseudonym has none.
fn fingerprint_of(name: &str) -> String {
    match name {
        "deleted 1" => String::new(),
        name => format!("key of {name}"),
    }
}

fn seated(seat: usize, name: &str) -> Entry {
    at_once(Change::Seated {
        seat: Seat::new(seat),
        participant: Box::new(SeatedParticipant {
            name_fingerprint: fingerprint_of(name),
            ..participant(name, ParticipantKind::Human)
        }),
    })
}

fn expressed(seat: usize) -> Entry {
    at_once(Change::Expressed {
        seat: Seat::new(seat),
        record_only: false,
        expression: Box::from([]),
    })
}

fn decided(seat: usize) -> Entry {
    at_once(Change::Decided(Decided {
        seat: Seat::new(seat),
        action: ActionId::new(0),
        source: Source::Agent,
        time_us: 5,
        bank_left_ms: 0,
        annotations: Some(Box::from([])),
        by_fallback: false,
    }))
}

fn marked(label: &str) -> Entry {
    at_once(Change::Marked(Box::new(Marked {
        label: label.into(),
        moment: std::time::Duration::ZERO,
    })))
}

/// Ana in a tournament.
fn entrant() -> Entrant {
    Entrant {
        name: "Ana".into(),
        name_fingerprint: fingerprint_of("Ana"),
        kind: chefshat_tournament::ParticipantKind::Human,
        built_in: None,
        filler: false,
        stateless: false,
        max_games: 1,
        at_table: false,
    }
}

/// Ana sat down, left, and came back to another seat; Bo is there, too.
fn game(number: u8) -> (Arc<GameHeader>, [Vec<Entry>; 2]) {
    let header = Arc::new(GameHeader {
        name: "Ana’s table".into(),
        ..GameHeader::clone(&header(number, Durability::Durable))
    });
    let begin = vec![
        seated(0, "Ana"),
        at_once(Change::Vacated(Seat::new(0))),
        seated(1, "Ana"),
        seated(0, "Bo"),
    ];
    let rest = vec![
        expressed(0),
        expressed(1),
        decided(0),
        decided(1),
        marked("Ana laughs"),
        marked("Anatole laughs"),
    ];
    (header, [begin, rest])
}

fn summary_of(header: &GameHeader) -> Box<v1::RecordSummary> {
    let seat = |number: u32, name: &str, agent: &str| v1::Participant {
        seat: number,
        name: name.into(),
        name_fingerprint: fingerprint_of(name),
        built_in_agent: agent.into(),
        ..v1::Participant::default()
    };
    Box::new(v1::RecordSummary {
        seats: vec![
            seat(0, "Bo", ""),
            seat(1, "Ana", ""),
            // A built-in agent may have the same name.
            seat(2, "Ana", "random"),
        ],
        ..*summary(header)
    })
}

#[tokio::test]
async fn a_participant_is_removed_from_its_games_and_others_stay() {
    with_each_store(async |store| {
        let (header, [first, mut rest]) = game(1);
        let mut journal = begin(store, &header, first).await;
        journal.append(&mut rest).await.expect("committed");
        let ended = journal.finish(
            Some(summary_of(&header)),
            Some(v1::RecordSignature::default()),
        );
        ended.await.expect("committed");
        let mut other = created_of_others(store).await;
        finish(&mut other, 2).await;
        written(store, 1).await;
        written(store, 2).await;

        let forgotten = store.forget(&ana()).await.expect("it is over");
        assert_eq!(forgotten.games, [header.game_id]);
        let has_files = store.outlives_server();
        let filed: &[GameId] = if has_files { &[header.game_id] } else { &[] };
        assert_eq!(forgotten.filed, filed);
        let redactions = Redactions {
            names: 4,
            expressions: 1,
            annotations: 1,
        };
        assert_eq!(forgotten.redactions, redactions);
        let unwritten = store.without_record_file().await.expect("readable");
        assert_eq!(unwritten, filed);

        let stored = store.finished(header.game_id).await.expect("readable");
        let Some(StoredGame::Hosted(header, entries, None)) = stored else {
            panic!("signed, or not there: {stored:?}");
        };
        assert_eq!(header.name, "deleted 1’s table");
        let expected = [
            seated(0, "deleted 1"),
            at_once(Change::Vacated(Seat::new(0))),
            seated(1, "deleted 1"),
            seated(0, "Bo"),
            expressed(0),
            decided(0),
            match decided(1).change {
                Change::Decided(decided) => at_once(Change::Decided(Decided {
                    annotations: None,
                    ..decided
                })),
                _ => unreachable!("it is a decision"),
            },
            marked("deleted 1 laughs"),
            marked("Anatole laughs"),
        ];
        assert_eq!(format!("{entries:?}"), format!("{expected:?}"));
        for (name, games) in [("Ana", 0), ("deleted 1", 1), ("Bo", 1), ("random", 1)] {
            let found = store.list(&named(name), Part::FROM_OLDEST, 9).await;
            assert_eq!(found.expect("readable").len(), games, "{name}");
        }
        let again = store.forget(&ana()).await.expect("nothing to do");
        assert_eq!(again, Forgotten::default());
    })
    .await;
}

async fn created_of_others(store: &dyn Store) -> Box<dyn Journal> {
    begin(
        store,
        &header(2, Durability::Durable),
        vec![seated(0, "Bo")],
    )
    .await
}

/// Plays a game of Ana to its end.
async fn play(store: &dyn Store, number: u8) -> GameId {
    let (header, [first, _]) = game(number);
    let mut journal = begin(store, &header, first).await;
    end(&mut journal, summary_of(&header)).await;
    header.game_id
}

/// Plays more games of Ana to their ends than two transactions rewrite.
async fn many_games(store: &dyn Store) -> Vec<GameId> {
    let mut games = Vec::new();
    for number in 1..=2 * MAX_REWRITTEN_AT_ONCE + 1 {
        games.push(play(store, u8::try_from(number).expect("few")).await);
    }
    games
}

fn named(participant: &str) -> v1::RecordFilter {
    v1::RecordFilter {
        participant: participant.into(),
        ..v1::RecordFilter::default()
    }
}

/// The finished games of a participant.
async fn games_of(store: &dyn Store, name: &str) -> Vec<GameId> {
    let found = store
        .list(&named(name), Part::FROM_OLDEST, usize::MAX)
        .await;
    let summaries = (found.expect("readable").into_iter()).map(|it| it.summary.expect("readable"));
    summaries
        .map(|it| Id::parse(&it.game_id).expect("an id"))
        .collect()
}

/// Removing Ana has failed at the last of these games.
async fn repeated(store: &dyn Store, games: &[GameId]) {
    let (changed, left) = games.split_at(2 * MAX_REWRITTEN_AT_ONCE);
    assert_eq!(games_of(store, "Ana").await, left);
    assert_eq!(games_of(store, "deleted 1").await, changed);
    let forgotten = store.forget(&ana()).await.expect("all are over");
    assert_eq!(forgotten.games, left);
    assert_eq!(games_of(store, "deleted 1").await, games);
}

#[tokio::test]
async fn a_removal_that_fails_is_completed_when_it_is_repeated() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    let games = many_games(&store).await;
    let last = games[games.len() - 1];
    let refusing = format!(
        "CREATE TRIGGER refuse BEFORE UPDATE ON games WHEN old.game_id = x'{last}'
         BEGIN SELECT raise(ABORT, 'refused'); END"
    );
    edit(folder.path(), &refusing).await;
    let refused = store.forget(&ana()).await;
    assert!(matches!(refused, Err(ForgetError::Store(_))), "{refused:?}");
    // After such a failure the store commits nothing more.
    store.close().await;
    drop(store);
    edit(folder.path(), "DROP TRIGGER refuse").await;
    let store = SqliteStore::open(folder.path()).await.expect("a store");
    repeated(&store, &games).await;
    store.close().await;

    let database = chefshat_postgres::database();
    let store = postgres::tests::node(&database).await;
    let games = many_games(&store).await;
    database.run(&format!(
        "CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS $$
         BEGIN RAISE EXCEPTION 'refused'; END $$;
         CREATE TRIGGER refuse BEFORE UPDATE ON games FOR EACH ROW
         WHEN (old.game_id = '\\x{last}') EXECUTE FUNCTION refuse()"
    ));
    let refused = store.forget(&ana()).await;
    assert!(matches!(refused, Err(ForgetError::Store(_))), "{refused:?}");
    database.run("DROP TRIGGER refuse ON games");
    repeated(&store, &games).await;
    store.close().await;
}

/// What this version does not know of it would be lost.
#[tokio::test]
async fn what_a_later_version_has_stored_is_not_written_again() {
    with_each_tables(async |store, tables| {
        play(store, 1).await;
        let joined = TournamentEntry::Change(TournamentChange::Joined(entrant()));
        let closed = TournamentEntry::Change(TournamentChange::Closed);
        let created = store.create_tournament(Arc::new(cup(7)), vec![joined, closed]);
        created.await.expect("committed");
        for table in ["games", "tournaments"] {
            let [later, present] =
                [99, form::FORM].map(|it| format!("UPDATE {table} SET form = {it}"));
            tables.edit(&later).await;
            let refused = store.forget(&ana()).await;
            let is_unreadable = matches!(refused, Err(ForgetError::Unreadable { .. }));
            assert!(is_unreadable, "{later}: {refused:?}");
            assert_eq!(games_of(store, "Ana").await.len(), 1, "{later}");
            tables.edit(&present).await;
        }
        let forgotten = store.forget(&ana()).await.expect("all are over");
        assert_eq!((forgotten.games.len(), forgotten.tournaments), (1, 1));
    })
    .await;
}

/// Every statement is a round trip to the database, and a transaction must end in time.
#[tokio::test]
async fn how_much_postgresql_is_asked_at_once_does_not_grow_with_the_games() {
    let database = chefshat_postgres::database();
    let store = postgres::tests::node(&database).await;
    let games = many_games(&store).await;
    database.run(
        "CREATE TABLE statements (transaction bigint);
         CREATE FUNCTION note() RETURNS trigger LANGUAGE plpgsql AS $$
         BEGIN INSERT INTO statements VALUES (txid_current()); RETURN NULL; END $$;
         CREATE TRIGGER note AFTER UPDATE ON games EXECUTE FUNCTION note();
         CREATE TRIGGER note AFTER UPDATE ON journal EXECUTE FUNCTION note();
         CREATE TRIGGER note AFTER UPDATE ON participants EXECUTE FUNCTION note()",
    );
    let forgotten = store.forget(&ana()).await.expect("all are over");
    assert_eq!(forgotten.games, games);
    let counted = "SELECT count(DISTINCT transaction), count(*) FROM statements";
    assert_eq!(database.run(counted), "3|9");
    store.close().await;
}

#[tokio::test]
async fn of_those_who_share_a_name_only_the_one_meant_is_removed() {
    with_each_store(async |store| {
        let without_key = |mut entry: Entry| {
            if let Change::Seated { participant, .. } = &mut entry.change {
                participant.name_fingerprint.clear();
            }
            entry
        };
        let mut both = summary_of(&header(1, Durability::Durable));
        both.seats[0].name = "Ana".into();
        both.seats[0].name_fingerprint.clear();
        let mut other = both.clone();
        other.seats.truncate(1);
        let games = [
            (
                1,
                vec![without_key(seated(0, "Ana")), seated(1, "Ana")],
                both,
            ),
            (2, vec![without_key(seated(0, "Ana"))], other),
        ];
        for (number, mut entries, summary) in games {
            let mut journal = created(store, number, Durability::Durable).await;
            entries.extend([expressed(0), expressed(1), marked("Ana laughs")]);
            journal.append(&mut entries).await.expect("committed");
            end(&mut journal, summary).await;
        }
        let games_of = async |name: &str| games_of(store, name).await.len();
        let with_fingerprint = |fingerprint: &str| Pseudonym {
            of: Named {
                name: "Ana".into(),
                fingerprint: Some(fingerprint.into()),
            },
            pseudonym: format!("deleted {fingerprint}"),
            key: None,
        };
        let nobody = store.forget(&with_fingerprint("key of Bo")).await;
        assert_eq!(nobody.expect("nothing to do"), Forgotten::default());

        let with_key = with_fingerprint("key of Ana");
        let forgotten = store.forget(&with_key).await.expect("it is over");
        assert_eq!(forgotten.games, [id(1)]);
        let redactions = Redactions {
            names: 2,
            expressions: 1,
            annotations: 0,
        };
        assert_eq!(forgotten.redactions, redactions);
        let found = (games_of("Ana").await, games_of(&with_key.pseudonym).await);
        assert_eq!(found, (2, 1));

        let forgotten = store.forget(&with_fingerprint("")).await;
        assert_eq!(forgotten.expect("both are over").games.len(), 2);
        let found = (games_of("Ana").await, games_of("deleted ").await);
        assert_eq!(found, (0, 2));
    })
    .await;
}

#[tokio::test]
async fn a_player_at_a_physical_table_is_removed() {
    with_each_database(async |store| {
        let mut fills = vec![Fill::Open { reserved_for: None }; 4];
        fills[0] = Fill::AtTable(ParticipantKind::Human);
        let at_table = Arc::new(GameHeader {
            name: "Ana’s table".into(),
            fills,
            display_names: [(0, "Ana".to_owned())].into(),
            ..GameHeader::clone(&header(1, Durability::Durable))
        });
        let mut journal = begin(store, &at_table, Vec::new()).await;
        let refused = store.forget(&ana()).await;
        let is_running = matches!(refused, Err(ForgetError::GameRunning(_)));
        assert!(is_running, "its journal does not name her: {refused:?}");
        let mut summary = summary_of(&at_table);
        summary.seats.truncate(2);
        end(&mut journal, summary).await;
        let with_key = Pseudonym {
            of: Named {
                fingerprint: Some("key of Ana".into()),
                ..ana().of
            },
            ..ana()
        };
        let forgotten = store.forget(&with_key).await.expect("it is over");
        assert_eq!(forgotten, Forgotten::default(), "nobody there has a key");
        let forgotten = store.forget(&ana()).await.expect("it is over");
        assert_eq!(forgotten.games, [at_table.game_id]);
        let stored = store.finished(at_table.game_id).await.expect("readable");
        let Some(StoredGame::Hosted(header, ..)) = stored else {
            panic!("{stored:?}");
        };
        assert_eq!(header.name, "deleted 1’s table");
        assert_eq!(header.display_names[&0], "deleted 1");
    })
    .await;
}

#[tokio::test]
async fn an_imported_record_is_changed_too() {
    with_each_store(async |store| {
        let header = header(1, Durability::Durable);
        let record: Arc<[v1::RecordLine]> = Arc::from([v1::RecordLine {
            line: Some(v1::record_line::Line::Header(Box::new(v1::RecordHeader {
                seats: summary_of(&header).seats,
                ..v1::RecordHeader::default()
            }))),
        }]);
        let imported = store.import(header.game_id, *summary_of(&header), record);
        assert_eq!(imported.await, Ok(true));
        let forgotten = store.forget(&ana()).await.expect("it is over");
        assert_eq!(forgotten.games, [header.game_id]);
        let stored = store.finished(header.game_id).await.expect("readable");
        let Some(StoredGame::Imported(lines)) = stored else {
            panic!("{stored:?}");
        };
        let Some(v1::record_line::Line::Header(header)) = &lines[0].line else {
            panic!("{lines:?}");
        };
        let names: Vec<&str> = header.seats.iter().map(|seat| seat.name.as_str()).collect();
        assert_eq!(names, ["Bo", "deleted 1", "Ana"]);
    })
    .await;
}

#[tokio::test]
async fn what_is_not_over_prevents_it() {
    with_each_database(async |store| {
        let (header, [first, _]) = game(1);
        let mut journal = begin(store, &header, first).await;
        let mut over = created_of_others(store).await;
        let appended = over.append(&mut vec![seated(1, "Ana")]).await;
        appended.expect("committed");
        finish(&mut over, 2).await;
        let refused = store.forget(&ana()).await;
        assert!(matches!(refused, Err(ForgetError::GameRunning(name)) if name == "Ana"));
        let stored = store.finished(id(2)).await.expect("readable");
        assert!(format!("{stored:?}").contains("Ana"), "nothing was changed");
        end(&mut journal, summary_of(&header)).await;

        let tournament = Arc::new(cup(7));
        let joined = vec![TournamentEntry::Change(TournamentChange::Joined(entrant()))];
        let made = store.create_tournament(Arc::clone(&tournament), joined);
        made.await.expect("committed");
        let refused = store.forget(&ana()).await;
        assert!(matches!(refused, Err(ForgetError::TournamentRunning(_))));
        let closed = vec![TournamentEntry::Change(TournamentChange::Closed)];
        let closing = store.append_tournament(tournament.id, 1, closed);
        closing.await.expect("committed");
        let forgotten = store.forget(&ana()).await.expect("all is over");
        assert_eq!((forgotten.games.len(), forgotten.tournaments), (2, 1));
        let stored = store.tournaments(9).await.expect("readable");
        let stored = format!("{:?}", stored[0].entries);
        assert!(
            stored.contains("deleted 1") && !stored.contains("Ana"),
            "{stored}"
        );
    })
    .await;
}
