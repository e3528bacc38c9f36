//! The column `golden` of games at real tables, where the Golden card's holder may be unknown.

use chefshat_engine::RuleSet;
use chefshat_proto::v1;
use chefshat_record::import::import;
use chefshat_record::testing::{HiddenGolden, Observed, TestGame, transcript};
use serde_json::Value;

use super::{Stage, rules};

fn exported(rules: &RuleSet, played: &[v1::RecordLine], observed: Observed) -> Vec<Value> {
    let record = import(transcript(rules, played, observed).as_bytes()).unwrap();
    let stage = Stage::new(&[("table.jsonl", record)]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions").into_iter();
    rows.map(|mut row| row["golden"].take()).collect()
}

#[test]
fn golden_is_null_while_the_holder_is_unknown() {
    let HiddenGolden {
        rules,
        lines: played,
        holder,
    } = HiddenGolden::record();
    let column = exported(&rules, &played, Observed::TURNS);
    let nulls = column.iter().filter(|golden| golden.is_null()).count();
    assert!(
        nulls > 0 && nulls < column.len(),
        "{nulls} of {}",
        column.len()
    );
    assert!(column.iter().all(|golden| golden.as_bool() != Some(true)));

    // The holder's dealt hand reveals it; any other hand does not.
    for seat in 0..4 {
        let observed = Observed {
            hands: 1 << seat,
            ..Observed::TURNS
        };
        let column = exported(&rules, &played, observed);
        assert_eq!(!column.contains(&Value::Null), seat == holder);
    }
}

#[test]
fn the_golden_opening_reveals_its_holder() {
    let rules = rules(1);
    let played = TestGame::dealt(rules, 7, 1).record(|_| v1::DecisionSource::Agent);
    let column = exported(&rules, &played, Observed::TURNS);
    assert_eq!(column, exported(&rules, &played, Observed::EVERYTHING));
    assert!(column.iter().all(Value::is_boolean));
}
