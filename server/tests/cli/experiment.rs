//! `chefshat experiment`: a table next to the paper's that is the same for the same seed, and JSON that agrees with it.

use serde_json::Value;

use super::run::{Ended, chefshat};

/// Widest line of the table.
const COLUMNS: usize = 100;

fn mechanics(flags: &str) -> Ended {
    let mut arguments = vec!["experiment", "mechanics"];
    arguments.extend(flags.split_whitespace());
    chefshat(&arguments)
}

#[test]
fn the_table_stands_next_to_the_paper_s() {
    let ended = mechanics("");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert_eq!(ended.stderr, "", "no progress where there is no terminal");
    assert_eq!(ended.stdout, include_str!("mechanics.txt"));
    assert_eq!(mechanics("--threads 1").stdout, ended.stdout);
    assert_ne!(mechanics("--seed 1").stdout, ended.stdout);
}

#[test]
fn large_adds_a_column_that_fits() {
    // Not the hundred thousand of --large, which would take long: as many digits.
    let ended = mechanics("--shifts 1234 --preset paper");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    assert!(ended.stdout.contains("1,234 Shifts"), "{}", ended.stdout);
    let help = mechanics("--help").stdout;
    assert!(help.contains("100,000 Shifts"), "{help}");
    assert!(
        help.contains("chefshat experiment mechanics --large"),
        "{help}"
    );
    for line in ended.stdout.lines() {
        assert!(line.chars().count() <= COLUMNS, "{line}");
        assert!(
            !line.contains('\x1b'),
            "colours where there is no terminal: {line}"
        );
    }
}

#[test]
fn json_says_the_same_with_the_rules() {
    let ended = mechanics("--json --preset original2020");
    assert_eq!(ended.code, Some(0), "{}", ended.stderr);
    let result: Value = serde_json::from_str(&ended.stdout).unwrap();
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
        let ended = mechanics(flags);
        assert_eq!(ended.code, Some(2), "{ended:?}");
        assert!(ended.stderr.contains(expected), "{}", ended.stderr);
    }
    let ended = chefshat(&["experiment"]);
    assert_eq!(ended.code, Some(2));
    assert!(ended.stderr.contains("mechanics"), "{}", ended.stderr);
}
