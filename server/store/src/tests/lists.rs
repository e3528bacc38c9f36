//! Lists of finished games: filtered, page by page, in both orders.

use chefshat_record::pseudonym::Named;
use chefshat_room::ids::random_bytes;

use super::*;

#[tokio::test]
async fn lists_are_filtered_and_paged() {
    with_each_store(check).await;
}

/// A summary with a robot and a built-in agent.
fn with_seats(header: &GameHeader) -> Box<v1::RecordSummary> {
    let number = header.game_id.bytes()[0];
    let seats = vec![
        v1::Participant {
            name: format!("player of {number}"),
            kind: v1::ParticipantKind::Robot.into(),
            ..v1::Participant::default()
        },
        v1::Participant {
            seat: 1,
            name: format!("name of {number}"),
            built_in_agent: format!("agent of {number}"),
            kind: v1::ParticipantKind::Agent.into(),
            ..v1::Participant::default()
        },
    ];
    Box::new(v1::RecordSummary {
        origin: v1::GameOrigin::Dealt.into(),
        seats,
        ..*summary(header)
    })
}

/// Imported records may have any name, and one that does not compress fits no index of PostgreSQL.
#[tokio::test]
async fn a_game_is_found_by_a_name_of_any_length() {
    with_each_store(async |store| {
        let name = hex::encode(random_bytes::<8_192>());
        let header = header(1, Durability::Durable);
        let mut summary = with_seats(&header);
        summary.seats[0].name.clone_from(&name);
        let record: Arc<[v1::RecordLine]> = Arc::from([v1::RecordLine {
            line: Some(v1::record_line::Line::Header(Box::new(v1::RecordHeader {
                seats: summary.seats.clone(),
                ..v1::RecordHeader::default()
            }))),
        }]);
        let imported = store.import(header.game_id, *summary, record).await;
        assert_eq!(imported, Ok(true));
        let filter = v1::RecordFilter {
            participant: name.clone(),
            ..v1::RecordFilter::default()
        };
        let listed = store.list(&filter, Part::FROM_OLDEST, 9).await;
        assert_eq!(listed.expect("readable").len(), 1);
        let who = Pseudonym {
            of: Named {
                name,
                fingerprint: None,
            },
            pseudonym: "deleted 1".into(),
            key: None,
        };
        let forgotten = store.forget(&who).await.expect("it is over");
        assert_eq!(forgotten.games, [header.game_id]);
    })
    .await;
}

/// What is looked for, after which number, and how many at most; what is found.
type Case = (fn(&mut v1::RecordFilter), (u64, usize), &'static [u64]);

/// The first games, as many as there are.
const ALL: (u64, usize) = (0, 9);

async fn check(store: &dyn Store) {
    for game in 1..=5 {
        let header = Arc::new(GameHeader {
            created_at_ms: u64::from(game) * 1_000,
            ..GameHeader::clone(&header(game, Durability::Durable))
        });
        let mut journal = begin(store, &header, Vec::new()).await;
        end(&mut journal, with_seats(&header)).await;
    }
    // Nothing was dealt in it, so it has no record.
    let mut abandoned = created(store, 6, Durability::Durable).await;
    abandoned.finish(None, None).await.expect("committed");
    let table: [Case; 15] = [
        (|_| {}, ALL, &[1, 2, 3, 4, 5]),
        (|_| {}, (0, 2), &[1, 2]),
        (|_| {}, (2, 2), &[3, 4]),
        (|_| {}, (5, 2), &[]),
        (|it| it.participant = "player of 3".into(), ALL, &[3]),
        (|it| it.participant = "agent of 4".into(), ALL, &[4]),
        // A built-in agent is found by its agent, not by its display name.
        (|it| it.participant = "name of 4".into(), ALL, &[]),
        (|it| it.participant = "player of".into(), ALL, &[]),
        (
            |it| {
                it.kind = v1::ParticipantKind::Robot.into();
                it.state = v1::RoomState::Finished.into();
            },
            (3, 9),
            &[4, 5],
        ),
        (|it| it.kind = v1::ParticipantKind::Human.into(), ALL, &[]),
        (|it| it.state = v1::RoomState::Aborted.into(), ALL, &[]),
        (|it| it.origin = v1::GameOrigin::Branched.into(), ALL, &[]),
        (
            |it| {
                it.room_name = "game 2".into();
                it.origin = v1::GameOrigin::Dealt.into();
            },
            ALL,
            &[2],
        ),
        (|it| it.room_name = "another".into(), ALL, &[]),
        (
            |it| {
                it.created_from_ms = 2_000;
                it.created_before_ms = 4_000;
            },
            ALL,
            &[2, 3],
        ),
    ];
    for (set, (after, count), expected) in table {
        let mut filter = v1::RecordFilter::default();
        set(&mut filter);
        let part = Part::After(after);
        let listed = store.list(&filter, part, count).await.expect("readable");
        let numbers: Vec<u64> = listed.iter().map(|it| it.number).collect();
        assert_eq!(numbers, expected, "{filter:?}");
        for listed in listed {
            let summary = listed.summary.expect("readable");
            let matches = crate::matches_filter(&filter, &summary);
            assert!(matches, "{}", listed.number);
        }
        // In reverse order the same games come, whole or page by page.
        let all = store.list(&filter, Part::FROM_OLDEST, 9).await;
        let backwards: Vec<u64> = (all.expect("readable").iter().rev())
            .map(|it| it.number)
            .collect();
        for count in [2, 9] {
            let mut numbers = Vec::new();
            let mut part = Part::FROM_NEWEST;
            loop {
                let listed = store.list(&filter, part, count).await.expect("readable");
                let Some(last) = listed.last() else {
                    break;
                };
                part = Part::Before(last.number);
                numbers.extend(listed.iter().map(|it| it.number));
            }
            assert_eq!(numbers, backwards, "{filter:?}");
        }
    }
}
