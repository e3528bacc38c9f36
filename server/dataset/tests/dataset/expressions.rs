//! Expressions: in their own table, and beside the decisions after them.

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use serde_json::{Value, json};

use super::{Stage, a_record, renumbered, with_lines};

#[test]
fn expressions_are_in_both_tables() {
    let joy = v1::Expression {
        label: "joy".into(),
        valence: Some(0.7),
        source: v1::ExpressionSource::Face.into(),
        taken_at: Some(chefshat_proto::Timestamp {
            seconds: 1_700_000_000,
            nanos: 5_000_000,
        }),
        ..v1::Expression::default()
    };
    let doubt = v1::Expression {
        label: "doubt".into(),
        confidence: Some(0.5),
        media: "clip 7".into(),
        record_only: true,
        ..v1::Expression::default()
    };
    let shown = Line::Event(v1::GameEvent {
        kind: Some(Kind::ExpressionShown(Box::new(v1::ExpressionShown {
            seat: 2,
            expression: Some(joy),
        }))),
        ..v1::GameEvent::default()
    });
    let private = Line::PrivateExpression(v1::PrivateExpression {
        seat: 1,
        elapsed_ms: 0,
        expression: Some(doubt),
    });
    let lines = with_lines(a_record(4), &[(3, shown), (5, private)]);
    let stage = Stage::new(&[("a.jsonl", lines)]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!(exported.expressions, 2);
    let expressions = stage.rows("expressions");
    let facts: Vec<[&Value; 7]> = expressions
        .iter()
        .map(|row| {
            [
                "seat",
                "label",
                "public",
                "source",
                "media",
                "taken_at",
                "decisions_before",
            ]
            .map(|column| &row[column])
        })
        .collect();
    assert_eq!(
        serde_json::to_value(facts).unwrap(),
        json!([
            [
                2,
                "joy",
                true,
                "face",
                null,
                "2023-11-14T22:13:20.005+00:00",
                3
            ],
            [1, "doubt", false, null, "clip 7", null, 5],
        ])
    );
    let latest: Vec<Value> = stage
        .rows("decisions")
        .iter()
        .map(|row| row["expressions"].clone())
        .collect();
    assert_eq!(latest[2], json!([null, null, null, null]));
    assert_eq!(latest[3][2]["label"], "joy");
    assert_eq!(latest[3][2]["valence"], 0.7);
    assert_eq!(latest[4][1], Value::Null);
    assert_eq!(latest[5][1]["label"], "doubt");
    assert_eq!(latest[5][1]["public"], false);
    assert_eq!(latest[5][2]["public"], true);
}

/// A public expression.
fn shown(seat: u32, label: &str) -> Line {
    let expression = v1::Expression {
        label: label.into(),
        ..v1::Expression::default()
    };
    event(Kind::ExpressionShown(Box::new(v1::ExpressionShown {
        seat,
        expression: Some(expression),
    })))
}

fn event(kind: Kind) -> Line {
    Line::Event(v1::GameEvent {
        kind: Some(kind),
        ..v1::GameEvent::default()
    })
}

#[test]
fn a_participant_that_leaves_removes_its_last_expression() {
    let mut lines = a_record(4);
    let ann = event(Kind::Seated(Box::new(v1::Seated {
        seat: 0,
        name: "Ann".into(),
        kind: v1::ParticipantKind::Human.into(),
    })));
    let leaves = event(Kind::Vacated(v1::Vacated { seat: 0 }));
    let added = [
        ann,
        shown(0, "bored"),
        leaves,
        shown(0, "an echo"),
        shown(1, "early"),
    ];
    let added = added.map(|line| v1::RecordLine { line: Some(line) });
    lines.splice(1..1, added);
    // After this, participants take the seats 0 to 3 and the game starts.
    let lines = with_lines(renumbered(lines), &[(2, shown(1, "joy"))]);
    let stage = Stage::new(&[("a.jsonl", lines)]);
    stage.run(&stage.export()).unwrap();
    let expressions: Vec<[Value; 4]> = stage
        .rows("expressions")
        .iter()
        .map(|row| ["seat", "label", "agent", "agent_kind"].map(|column| row[column].clone()))
        .collect();
    assert_eq!(
        json!(expressions),
        json!([
            [0, "bored", "Ann", "human"],
            [0, "an echo", null, null],
            [1, "early", null, null],
            [1, "joy", "player 1", "agent"],
        ])
    );
    let rows = stage.rows("decisions");
    let nobody = json!([null, null, null, null]);
    assert_eq!(rows[0]["expressions"], nobody);
    assert_eq!(rows[1]["expressions"], nobody);
    for row in &rows[2..] {
        assert_eq!(row["expressions"][0], Value::Null);
        assert_eq!(row["expressions"][1]["label"], "joy");
    }
    assert!(rows.iter().all(|row| row["agent"] != "Ann"));
}
