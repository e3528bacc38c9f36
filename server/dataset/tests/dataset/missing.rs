//! What is null: what nobody saw, what did not come to be, whose decision it was not.

use chefshat_dataset::{Export, ExportError, Filter, Layout};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::branch::branch_of;
use chefshat_record::import::import;
use chefshat_record::testing::{Observed, TestGame, transcript};
use serde_json::Value;

use super::{Stage, a_record, rename, renumbered, rules};

/// Turns of a game at a real table that were written down: few enough to leave open what others held.
const TOLD_TURNS: usize = 20;

/// A real table of which only the hand of seat 0 and the first turns were observed.
fn a_real_table() -> Vec<v1::RecordLine> {
    let rules = rules(1);
    let lines = TestGame::dealt(rules, 8, 8).record(|_| v1::DecisionSource::Agent);
    let observed = Observed {
        hands: 1,
        turns: TOLD_TURNS,
        ..Observed::TURNS
    };
    import(transcript(&rules, &lines, observed).as_bytes()).unwrap()
}

#[test]
fn what_nobody_saw_is_null() {
    let stage = Stage::new(&[("a.jsonl", a_real_table())]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    assert_eq!(rows.len(), TOLD_TURNS);
    let hidden = ["hand", "golden", "mask", "legal_actions"];
    let mut unknown = 0;
    for row in &rows {
        assert_eq!(row["origin"], "imported");
        assert_eq!(row["agent_kind"], "human");
        assert_eq!(row["decision_time_us"], Value::Null);
        assert_eq!(row["gave"], Value::Null);
        let nulls = hidden
            .iter()
            .filter(|column| row[**column].is_null())
            .count();
        if row["seat"] == 0 {
            assert_eq!(nulls, 0);
        } else {
            assert_eq!(nulls, hidden.len());
            unknown += 1;
        }
        assert!(row["reward_paper"].is_number());
    }
    assert!(unknown > 10);
    let sheets = Export {
        layout: Layout::ChefsHatGym,
        replace: true,
        ..stage.export()
    };
    stage.run(&sheets).unwrap();
    let games = std::fs::read_dir(stage.out()).unwrap();
    let game = games
        .map(|entry| entry.unwrap().path())
        .find(|path| path.is_dir())
        .unwrap();
    let text = std::fs::read_to_string(game.join("Dataset.pkl.csv")).unwrap();
    assert!(text.contains("], None, None, None]\","), "{}", &text[..800]);
}

#[test]
fn an_aborted_game_has_no_result() {
    let mut lines = a_record(6);
    let reveal = lines.iter().find_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::GameEnded(ended)) => ended.reveal.clone(),
            _ => None,
        },
        _ => None,
    });
    // Cut off in its second Shift, before a decision.
    let is_play = |line: &v1::RecordLine| match &line.line {
        Some(Line::Event(event)) => matches!(&event.kind, Some(Kind::Play(_))),
        _ => false,
    };
    let second = lines
        .iter()
        .rposition(|line| match &line.line {
            Some(Line::Event(event)) => matches!(&event.kind, Some(Kind::ShiftStarted(_))),
            _ => false,
        })
        .unwrap();
    let play = lines[second..].iter().position(is_play).unwrap();
    lines.truncate(second + play + 1);
    let decisions = lines
        .iter()
        .filter(|line| matches!(line.line, Some(Line::Decision(_))))
        .count() as u64;
    let aborted = Kind::GameAborted(Box::new(v1::GameAborted {
        reason: v1::AbortReason::Closed.into(),
        reveal,
    }));
    let end = [
        Line::Event(v1::GameEvent {
            kind: Some(aborted),
            ..v1::GameEvent::default()
        }),
        Line::Footer(v1::RecordFooter {
            state: v1::RoomState::Aborted.into(),
            events: 0,
            decisions,
        }),
    ];
    lines.extend(end.map(|line| v1::RecordLine { line: Some(line) }));
    let stage = Stage::new(&[("a.jsonl", renumbered(lines))]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!((exported.games, exported.finished), (1, 0));
    let rows = stage.rows("decisions");
    assert_eq!(rows.len() as u64, decisions);
    for row in &rows {
        assert_eq!(row["finished"], false);
        assert_eq!(row["game_place"], Value::Null);
        assert_eq!(row["game_points"], Value::Null);
        assert_eq!(row["shift_place"].is_null(), row["shift"] == 2);
        assert_eq!(row["shift_points"].is_null(), row["shift"] == 2);
    }
    assert_eq!(rows[rows.len() - 1]["shift"], 2);
    let none = Export {
        filter: Filter {
            finished_only: true,
            ..Filter::default()
        },
        replace: true,
        ..stage.export()
    };
    assert!(matches!(
        stage.run(&none),
        Err(ExportError::NothingLeft { .. })
    ));
    let sheets = Export {
        layout: Layout::ChefsHatGym,
        replace: true,
        ..stage.export()
    };
    stage.run(&sheets).unwrap();
    let path = stage.out().join(format!("{:032x}/Dataset.pkl.csv", 6));
    let text = std::fs::read_to_string(path).unwrap();
    assert_eq!(text.matches(",END_MATCH,").count(), 1);
    assert_eq!(text.matches(",END_EXPERIMENT,").count(), 0);
}

/// Decisions that the branched game takes over: more than its first Shift has.
const TAKEN_OVER: u64 = 100;

#[test]
fn decisions_taken_over_are_nobodys_here() {
    let mut before = TestGame::dealt(rules(3), 7, 3).record(|_| v1::DecisionSource::Agent);
    rename(&mut before, 7);
    let branch = branch_of(&before, TAKEN_OVER).unwrap();
    let making = TestGame {
        branch: Some(&branch),
        ..TestGame::dealt(rules(3), 8, 4)
    };
    let mut after = making.record(|_| v1::DecisionSource::Agent);
    rename(&mut after, 8);
    let stage = Stage::new(&[("a.jsonl", before), ("b.jsonl", after)]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    let of_game = |number: u8| {
        let game = format!("{number:032x}");
        let rows = rows.iter().filter(|row| row["game_id"] == game);
        rows.cloned().collect::<Vec<Value>>()
    };
    let (first, second) = (of_game(7), of_game(8));
    assert!(second.len() as u64 > TAKEN_OVER);
    let whose = ["agent", "agent_kind", "built_in_agent", "decision_time_us"];
    // What was taken over is what was decided there, but for whose it was, which room that was and what became of it.
    let facts = ["number", "shift", "turn", "seat", "hand", "mask", "action"];
    for (row, there) in second.iter().zip(&first) {
        if row["number"].as_u64() > Some(TAKEN_OVER) {
            break;
        }
        assert_eq!(row["source"], "recorded");
        assert!(whose.iter().all(|column| row[*column].is_null()), "{row}");
        assert_eq!(there["agent"], format!("player {}", there["seat"]));
        for fact in facts {
            assert_eq!(row[fact], there[fact], "{fact} of {row}");
        }
    }
    for row in &second[TAKEN_OVER as usize..] {
        assert_eq!(row["source"], "agent");
        assert_eq!(row["agent"], format!("player {}", row["seat"]));
        assert_eq!(row["agent_kind"], "agent");
    }
    // The other layout has no word for it: whoever sits there bears all turns of the seat.
    let sheets = Export {
        layout: Layout::ChefsHatGym,
        replace: true,
        ..stage.export()
    };
    stage.run(&sheets).unwrap();
    let path = stage.out().join(format!("{:032x}/Dataset.pkl.csv", 8));
    let mut csv = csv::Reader::from_path(path).unwrap();
    let discards: Vec<csv::StringRecord> = csv
        .records()
        .map(Result::unwrap)
        .filter(|row| row[4] == *"DISCARD")
        .collect();
    let turns = second.iter().filter(|row| row["phase"] == "turn");
    assert_eq!(discards.len(), turns.clone().count());
    for (row, turn) in discards.iter().zip(turns) {
        assert_eq!(row[3], format!("player {}", turn["seat"]));
    }
}
