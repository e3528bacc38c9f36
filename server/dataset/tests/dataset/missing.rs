//! Null values: unobserved cards, results of aborted games, decisions taken over.

use chefshat_dataset::{Export, ExportError, Filter, Layout};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::branch::branch_of;
use chefshat_record::import::import;
use chefshat_record::testing::{Observed, TestGame, aborted, transcript};
use serde_json::Value;

use super::{Stage, a_record, rename, rules};

/// Observed turns of a game at a real table: few enough to leave the other hands unknown.
const OBSERVED_TURNS: usize = 20;

/// A game at a real table with the hand of seat 0 and the first turns.
fn a_real_table() -> Vec<v1::RecordLine> {
    let rules = rules(1);
    let lines = TestGame::dealt(rules, 8, 8).record(|_| v1::DecisionSource::Agent);
    let observed = Observed {
        hands: 1,
        turns: OBSERVED_TURNS,
        ..Observed::TURNS
    };
    import(transcript(&rules, &lines, observed).as_bytes()).unwrap()
}

#[test]
fn unobserved_cards_are_null() {
    let stage = Stage::new(&[("a.jsonl", a_real_table())]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    assert_eq!(rows.len(), OBSERVED_TURNS);
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
    let lines = a_record(6);
    // Aborted in its second Shift, before a decision.
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
    let lines = aborted(lines, second + play + 1);
    let decisions = lines
        .iter()
        .filter(|line| matches!(line.line, Some(Line::Decision(_))))
        .count() as u64;
    let stage = Stage::new(&[("a.jsonl", lines)]);
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
fn decisions_taken_over_have_no_player() {
    let mut before = TestGame::dealt(rules(3), 7, 3).record(|_| v1::DecisionSource::Agent);
    rename(&mut before, 7);
    let branch = branch_of(&before, TAKEN_OVER).unwrap();
    let game = TestGame {
        branch: Some(&branch),
        ..TestGame::dealt(rules(3), 8, 4)
    };
    let mut after = game.record(|_| v1::DecisionSource::Agent);
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
    // These facts are taken over, unlike player, room and result.
    let facts = ["number", "shift", "turn", "seat", "hand", "mask", "action"];
    for (row, original) in second.iter().zip(&first) {
        if row["number"].as_u64() > Some(TAKEN_OVER) {
            break;
        }
        assert_eq!(row["source"], "recorded");
        assert!(whose.iter().all(|column| row[*column].is_null()), "{row}");
        assert_eq!(original["agent"], format!("player {}", original["seat"]));
        for fact in facts {
            assert_eq!(row[fact], original[fact], "{fact} of {row}");
        }
    }
    for row in &second[TAKEN_OVER as usize..] {
        assert_eq!(row["source"], "agent");
        assert_eq!(row["agent"], format!("player {}", row["seat"]));
        assert_eq!(row["agent_kind"], "agent");
    }
    // The other layout cannot express this: all turns of a seat are those of its player.
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
