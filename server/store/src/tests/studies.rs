//! Stored studies, in each store that has them.

use chefshat_study::{
    Answer, Change, ConsentGiven, Device, ItemAnswer, Joined, Outcome, PlacedGame, Pointer,
};

use super::*;
use crate::studies::{StudyHeader, changes_to_bytes};

fn header(study: u8) -> Arc<StudyHeader> {
    Arc::new(StudyHeader {
        id: id(study),
        settings: v1::StudySettings {
            name: format!("study {study}"),
            ..v1::StudySettings::default()
        },
        created_at_ms: 1000,
        owner: SecretHash::of(b"owner"),
        key: [study; 32],
    })
}

fn added(number: u32) -> Change {
    Change::Added {
        number,
        pseudonym: format!("Pseudonym {number}"),
        joined: None,
        test: false,
        planned: None,
    }
}

fn every_change() -> Vec<Change> {
    let answer = |item: usize, value: Answer, answered_after_ms: Option<u32>| ItemAnswer {
        item,
        value,
        answered_after_ms,
    };
    let game = |seed_index: Option<usize>| PlacedGame {
        step: 2,
        condition: 1,
        practice: seed_index.is_none(),
        seed_index,
        seat: 3,
        attempt: 2,
        room: [8; 16],
        game: [9; 16],
    };
    let (number, at_ms) = (1, 5000);
    vec![
        added(number),
        Change::Added {
            number: 2,
            pseudonym: "P02".to_owned(),
            joined: Some(Joined {
                request_sha256: [6; 32],
                panel_id: "5f2".to_owned(),
            }),
            test: true,
            planned: Some(1),
        },
        Change::Grouped {
            number,
            group: 3,
            slot: 7,
            passed_over: 1,
            at_ms,
        },
        Change::LeftOver { number, at_ms },
        Change::Opened {
            number,
            slot: Some(0),
            at_ms,
            device: Some(Device {
                width: 390,
                height: 844,
                pixels: 300,
                pointer: Some(Pointer::Coarse),
                time_zone: "Europe/Rome".to_owned(),
            }),
        },
        Change::Opened {
            number,
            slot: None,
            at_ms,
            device: None,
        },
        Change::Consented {
            number,
            slot: None,
            consent: ConsentGiven {
                text_sha256: [7; 32],
                version: "2".to_owned(),
                language: "it".to_owned(),
                at_ms,
            },
        },
        Change::Answered {
            number,
            answers: Arc::new([
                answer(0, Answer::Number(-3), Some(0)),
                answer(1, Answer::Options(vec![0, 4]), None),
                answer(2, Answer::Text("words".to_owned()), Some(9)),
            ]),
            passed_over: 2,
            at_ms,
        },
        Change::Saved {
            number,
            answers: Arc::new([answer(2, Answer::Text("wor".to_owned()), Some(8))]),
        },
        Change::Placed {
            number,
            game: game(None),
        },
        Change::Placed {
            number,
            game: game(Some(0)),
        },
        Change::GameEnded {
            number,
            outcome: Outcome::Finished,
            at_ms,
        },
        Change::GameEnded {
            number,
            outcome: Outcome::Aborted,
            at_ms,
        },
        Change::Continued {
            number,
            step_over: true,
            passed_over: 0,
            at_ms,
        },
        Change::Continued {
            number,
            step_over: false,
            passed_over: 1,
            at_ms,
        },
        Change::DroppedOut { number, at_ms },
        Change::ScreenedOut { number, at_ms },
        Change::Withdrew {
            number,
            delete_data: true,
            at_ms,
        },
        Change::Withdrew {
            number,
            delete_data: false,
            at_ms,
        },
        Change::Removed { number, at_ms },
        Change::Closed,
    ]
}

/// The encoding never changes: studies stored by any version must be readable by every later one.
#[test]
fn the_encoding_of_studies_stays_readable() {
    let written = format!(
        "{}\n{}\n{}\n",
        hex::encode(header(1).to_bytes()),
        hex::encode(changes_to_bytes(&every_change())),
        hex::encode(form::traces_to_bytes(&traces(1)))
    );
    assert_eq!(written, include_str!("../sqlite/fixtures/study3.hex"));
}

fn traces(number: u32) -> StoredTraces {
    StoredTraces {
        number,
        session: 2,
        game: id(9),
        traces: vec![v1::StudyTrace {
            kind: v1::StudyTraceKind::Hover.into(),
            target: format!("card of {number}"),
            ..v1::StudyTrace::default()
        }],
    }
}

#[tokio::test]
async fn stored_studies_are_read_back_and_forget_participants() {
    with_each_store(async |store| {
        let (study, other) = (id(1), id(2));
        for number in [1, 2] {
            store.create_study(header(number)).await.expect("committed");
        }
        let taken = store.create_study(header(1)).await;
        assert_eq!(taken, Err(StoreError::Taken(header(1).id.to_string())));
        let changes = every_change();
        let (first, rest) = changes.split_at(4);
        for (row, changes) in [first, rest].into_iter().enumerate() {
            let appended = store.append_study(study, row as u64, changes.to_vec());
            appended.await.expect("committed");
        }
        let appended = store.append_study(other, 0, vec![added(1)]);
        appended.await.expect("committed");
        for number in [1, 2, 1] {
            let appended = store.append_traces(study, traces(number));
            appended.await.expect("committed");
        }
        let stored = store.study(study).await.expect("readable").expect("stored");
        assert_eq!((stored.changes, stored.rows), (changes, 2));
        assert_eq!(format!("{:?}", stored.header), format!("{:?}", header(1)));
        let missing = store.study(id(3)).await.expect("readable");
        assert!(missing.is_none());
        let all = [1, 2, 1].map(traces).to_vec();
        assert_eq!(store.traces(study).await, Ok(all));

        let rewritten = store.rewrite_study(study, vec![added(2)], vec![1]);
        rewritten.await.expect("committed");
        let appended = store.append_study(study, 1, vec![Change::Closed]);
        appended.await.expect("committed");
        let stored = store.study(study).await.expect("readable").expect("stored");
        assert_eq!(
            (stored.changes, stored.rows),
            (vec![added(2), Change::Closed], 2)
        );
        assert_eq!(store.traces(study).await, Ok(vec![traces(2)]));
        let stored = store.study(other).await.expect("readable").expect("stored");
        assert_eq!((stored.changes, stored.rows), (vec![added(1)], 1));
    })
    .await;
}
