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

async fn check(store: &dyn Store) {
    for game in 1..=5 {
        let header = Arc::new(GameHeader {
            created_at_ms: u64::from(game) * 1_000,
            ..GameHeader::clone(&header(game, Durability::Durable))
        });
        let mut journal = store
            .create(Arc::clone(&header), Vec::new())
            .await
            .expect("committed");
        journal
            .finish(Some(with_seats(&header)), None)
            .await
            .expect("committed");
    }
    let abandoned = {
        let mut journal = store
            .create(header(6, Durability::Durable), Vec::new())
            .await
            .expect("committed");
        // Nothing was dealt in it, so it has no record.
        journal.finish(None, None).await
    };
    abandoned.expect("committed");
    let filter = v1::RecordFilter::default;
    let robot = v1::ParticipantKind::Robot.into();
    let human = v1::ParticipantKind::Human.into();
    let finished = v1::RoomState::Finished.into();
    let table = [
        (filter(), 0, 9, vec![1, 2, 3, 4, 5]),
        (filter(), 0, 2, vec![1, 2]),
        (filter(), 2, 2, vec![3, 4]),
        (filter(), 5, 2, vec![]),
        (
            v1::RecordFilter {
                participant: "player of 3".into(),
                ..filter()
            },
            0,
            9,
            vec![3],
        ),
        (
            v1::RecordFilter {
                participant: "agent of 4".into(),
                ..filter()
            },
            0,
            9,
            vec![4],
        ),
        // A built-in agent is found by its agent, not by its display name.
        (
            v1::RecordFilter {
                participant: "name of 4".into(),
                ..filter()
            },
            0,
            9,
            vec![],
        ),
        (
            v1::RecordFilter {
                participant: "player of".into(),
                ..filter()
            },
            0,
            9,
            vec![],
        ),
        (
            v1::RecordFilter {
                kind: robot,
                state: finished,
                ..filter()
            },
            3,
            9,
            vec![4, 5],
        ),
        (
            v1::RecordFilter {
                kind: human,
                ..filter()
            },
            0,
            9,
            vec![],
        ),
        (
            v1::RecordFilter {
                state: v1::RoomState::Aborted.into(),
                ..filter()
            },
            0,
            9,
            vec![],
        ),
        (
            v1::RecordFilter {
                origin: v1::GameOrigin::Branched.into(),
                ..filter()
            },
            0,
            9,
            vec![],
        ),
        (
            v1::RecordFilter {
                room_name: "game 2".into(),
                origin: v1::GameOrigin::Dealt.into(),
                ..filter()
            },
            0,
            9,
            vec![2],
        ),
        (
            v1::RecordFilter {
                room_name: "another".into(),
                ..filter()
            },
            0,
            9,
            vec![],
        ),
        (
            v1::RecordFilter {
                created_from_ms: 2_000,
                created_before_ms: 4_000,
                ..filter()
            },
            0,
            9,
            vec![2, 3],
        ),
    ];
    for (filter, after, count, expected) in table {
        let part = Part::After(after);
        let listed = store.list(&filter, part, count).await.expect("readable");
        let numbers: Vec<u64> = listed.iter().map(|it| it.number).collect();
        assert_eq!(numbers, expected, "{filter:?}");
        for listed in listed {
            let summary = listed.summary.expect("readable");
            assert!(
                crate::matches_filter(&filter, &summary),
                "{}",
                listed.number
            );
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
