//! `chefshat experiment`: a table beside the paper's, repeatable with a seed, and JSON that agrees
//! with it.

use serde_json::Value;

use super::run::{Ended, typed};

fn mechanics(flags: &str) -> Ended {
    typed(&format!("experiment mechanics {flags}"))
}

#[test]
fn the_table_is_beside_the_papers() {
    let ended = mechanics("").well();
    assert_eq!(ended.stderr, "", "no progress where there is no terminal");
    assert_eq!(ended.stdout, include_str!("mechanics.txt"));
    assert_eq!(mechanics("--threads 1").stdout, ended.stdout);
    assert_ne!(mechanics("--seed 1").stdout, ended.stdout);
}

#[test]
fn large_adds_a_column_that_fits() {
    // Fewer Shifts than --large, which would take long, but as many digits.
    let ended = mechanics("--shifts 1234 --preset paper").well();
    ended.assert_says(&["1,234 Shifts"]);
    ended.assert_table_fits(8);
    let help = mechanics("--help");
    help.assert_helps("100,000 Shifts");
    help.assert_helps("chefshat experiment mechanics --large");
}

#[test]
fn json_has_the_same_and_the_rules() {
    let result = mechanics("--json --preset original2020").well().json();
    assert_eq!(
        (&result["seed"], &result["shifts_per_game"]),
        (&0.into(), &250.into())
    );
    let results = result["results"].as_array().unwrap();
    let conditions: Vec<&str> = results
        .iter()
        .map(|row| row["condition"].as_str().unwrap())
        .collect();
    assert_eq!(
        conditions,
        [
            "all",
            "without_jokers",
            "without_exchange",
            "without_special_actions"
        ]
    );
    for row in results {
        assert_eq!(row["preset"], "original2020");
        assert_eq!(row["rules"]["pass_scope"], "turn");
        assert_eq!(row["shifts"], 250);
        let number = |value: &Value| value.as_f64().unwrap();
        let share = number(&row["starter_wins"]);
        assert_eq!(share, number(&row["starter_won"]) / 250.0);
        for (mean, interval) in [
            ("starter_wins", "starter_wins_95"),
            ("laps_per_shift", "laps_per_shift_95"),
        ] {
            let (mean, ends) = (number(&row[mean]), &row[interval]);
            assert!(number(&ends[0]) < mean && mean < number(&ends[1]), "{row}");
        }
    }
    assert_eq!(results[1]["rules"]["jokers"], 0);
    assert_eq!(results[2]["rules"]["exchange"], false);
    assert_eq!(results[3]["rules"]["special_actions"], false);
    assert_eq!(results[2]["paper"]["starter_wins"], 0.6);
    assert_eq!(results[1]["paper"]["laps_per_shift"], 33.0);
}

#[test]
fn mistakes_are_explained() {
    for (flags, expected) in [
        ("--shifts 0", "--shifts"),
        (
            "--preset chess",
            "possible values: paper, rulebook, original2020",
        ),
    ] {
        mechanics(flags).assert_refused(expected);
    }
    typed("experiment").assert_refused("mechanics");
}
