//! Stored studies, in each store that has them.

use chefshat_study::{
    Added, Answer, Answered, Answers, Change, Consented, Continued, Device, Ended, GameEnded,
    Grouped, ItemAnswer, Joined, Opened, Placed, PlacedGame, Pointer, Saved, Withdrew,
};

use super::*;
use crate::studies::{StoredStudy, StudyHeader, changes_to_bytes};
use crate::units::StoredUnit;

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
    Change::Added(Added {
        number,
        pseudonym: format!("Pseudonym {number}"),
        joined: None,
        test: false,
        planned: None,
    })
}

fn every_change() -> Vec<Change> {
    let answer = |item: u32, value: Answer, answered_after_ms: Option<u32>| ItemAnswer {
        item,
        value: Some(value),
        answered_after_ms,
    };
    let (number, at_ms) = (1, 5000);
    let placed = |seed_index: Option<usize>| {
        Change::Placed(Placed::new(
            number,
            &PlacedGame {
                step: 2,
                condition: 1,
                practice: seed_index.is_none(),
                seed_index,
                seat: 3,
                attempt: 2,
                room: [8; 16],
                game: [9; 16],
            },
        ))
    };
    let ended = Ended { number, at_ms };
    vec![
        added(number),
        Change::Added(Added {
            number: 2,
            pseudonym: "P02".to_owned(),
            joined: Some(Joined {
                request_sha256: vec![6; 32],
                panel_id: "5f2".to_owned(),
            }),
            test: true,
            planned: Some(1),
        }),
        Change::Grouped(Grouped {
            number,
            group: 3,
            slot: 7,
            passed_over: 1,
            at_ms,
        }),
        Change::LeftOver(ended.clone()),
        Change::Opened(Opened {
            number,
            slot: Some(0),
            at_ms,
            device: Some(Device {
                width: 390,
                height: 844,
                pixels: 300,
                pointer: Pointer::Coarse as u32,
                time_zone: "Europe/Rome".to_owned(),
            }),
        }),
        Change::Opened(Opened {
            number,
            slot: None,
            at_ms,
            device: None,
        }),
        Change::Consented(Consented {
            number,
            text_sha256: vec![7; 32],
            version: "2".to_owned(),
            language: "it".to_owned(),
            at_ms,
            slot: None,
        }),
        Change::Answered(Answered {
            number,
            answers: Answers::from(vec![
                answer(0, Answer::Number(-3), Some(0)),
                answer(1, Answer::options(vec![0, 4]), None),
                answer(2, Answer::Text("words".to_owned()), Some(9)),
            ]),
            passed_over: 2,
            at_ms,
        }),
        Change::Saved(Saved {
            number,
            answers: Answers::from(vec![answer(2, Answer::Text("wor".to_owned()), Some(8))]),
        }),
        placed(None),
        placed(Some(0)),
        Change::GameEnded(GameEnded {
            number,
            at_ms,
            finished: true,
        }),
        Change::GameEnded(GameEnded {
            number,
            at_ms,
            finished: false,
        }),
        Change::Continued(Continued {
            number,
            step_over: true,
            passed_over: 0,
            at_ms,
        }),
        Change::Continued(Continued {
            number,
            step_over: false,
            passed_over: 1,
            at_ms,
        }),
        Change::DroppedOut(ended.clone()),
        Change::ScreenedOut(ended.clone()),
        Change::Withdrew(Withdrew {
            number,
            delete_data: true,
            at_ms,
        }),
        Change::Withdrew(Withdrew {
            number,
            delete_data: false,
            at_ms,
        }),
        Change::Removed(ended),
        Change::Closed(true),
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
        let appended = store.append_study(study, 1, vec![Change::Closed(true)]);
        appended.await.expect("committed");
        let stored = store.study(study).await.expect("readable").expect("stored");
        assert_eq!(
            (stored.changes, stored.rows),
            (vec![added(2), Change::Closed(true)], 2)
        );
        assert_eq!(store.traces(study).await, Ok(vec![traces(2)]));
        let stored = store.study(other).await.expect("readable").expect("stored");
        assert_eq!((stored.changes, stored.rows), (vec![added(1)], 1));
    })
    .await;
}

#[test]
fn changes_that_are_not_whole_are_not_read() {
    let joined = Added {
        number: 1,
        joined: Some(Joined {
            request_sha256: vec![6; 31],
            panel_id: String::new(),
        }),
        ..Added::default()
    };
    let consented = Consented {
        text_sha256: vec![7; 33],
        ..Consented::default()
    };
    let answers = Answers::from(vec![ItemAnswer::default()]);
    let answered = Answered {
        answers: answers.clone(),
        ..Answered::default()
    };
    let saved = Saved { number: 1, answers };
    let written = |change| changes_to_bytes(&[change]);
    for (row, problem) in [
        (
            written(Change::Added(joined)),
            "the hash of a request id has 31 bytes, not 32",
        ),
        (
            written(Change::Consented(consented)),
            "the hash of a consent has 33 bytes, not 32",
        ),
        (written(Change::Answered(answered)), "an answer is empty"),
        (written(Change::Saved(saved)), "an answer is empty"),
        (
            written(Change::Placed(Placed::default())),
            "the id of a room or game does not have 16 bytes",
        ),
        // Of a kind with the number 16.
        (vec![3, 0x82, 1, 0], "a change is empty"),
    ] {
        let stored = StoredUnit::new(header(1).to_bytes(), vec![row]);
        let error = StoredStudy::decode(header(1).id, &stored).expect_err(problem);
        assert!(error.to_string().ends_with(problem), "{error}");
    }
}
