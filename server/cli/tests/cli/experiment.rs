//! `chefshat experiment`: a table next to the paper's that is the same for the same seed, and JSON that agrees with it.

use serde_json::Value;

use super::run::{Ended, typed};

fn mechanics(flags: &str) -> Ended {
    typed(&["experiment", "mechanics"], flags)
}

#[test]
fn the_table_stands_next_to_the_paper_s() {
    let ended = mechanics("").well();
    assert_eq!(ended.stderr, "", "no progress where there is no terminal");
    assert_eq!(ended.stdout, include_str!("mechanics.txt"));
    assert_eq!(mechanics("--threads 1").stdout, ended.stdout);
    assert_ne!(mechanics("--seed 1").stdout, ended.stdout);
}

#[test]
fn large_adds_a_column_that_fits() {
    // Not the hundred thousand of --large, which would take long: as many digits.
    let ended = mechanics("--shifts 1234 --preset paper").well();
    assert!(ended.stdout.contains("1,234 Shifts"), "{}", ended.stdout);
    ended.assert_table_fits(8);
    let help = mechanics("--help");
    help.assert_helps("100,000 Shifts");
    help.assert_helps("chefshat experiment mechanics --large");
}

#[test]
fn json_says_the_same_with_the_rules() {
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
    typed(&["experiment"], "").assert_refused("mechanics");
}

#[test]
fn ratings_of_known_skills_are_held_against_them() {
    let ratings = |flags: &str| typed(&["experiment", "ratings", "--participants", "80"], flags);
    let told = ratings("--json").well().json();
    let rows = told["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 36);
    for row in rows {
        let covered = row["covered"].as_f64().unwrap();
        assert!((0.8..=1.0).contains(&covered), "{row}");
    }
    let table = ratings("").well();
    table.assert_table_fits(36);
    assert_eq!(ratings("--threads 1").stdout, table.stdout);
    assert_ne!(ratings("--seed 1").stdout, table.stdout);
    ratings("--help").assert_helps("chefshat experiment ratings --players 6");
    ratings("--players 7").assert_refused("--players");
}

#[test]
fn duplicate_deals_are_held_against_others() {
    let duplicates = |flags: &str| typed(&["experiment", "duplicates", "--games", "120"], flags);
    let told = duplicates("--json").well().json();
    let rows = told["rows"].as_array().unwrap();
    let games: Vec<u64> = rows
        .iter()
        .map(|row| row["games"].as_u64().unwrap())
        .collect();
    assert_eq!(games, [50, 100, 120].repeat(6));
    let error = |row: &Value, of: &str| row[of].as_f64().unwrap();
    for alike in rows[..3].iter() {
        assert!(
            error(alike, "duplicate_error") < 0.8 * error(alike, "independent_error"),
            "{alike}"
        );
    }
    let table = duplicates("").well();
    table.assert_table_fits(8);
    assert_eq!(duplicates("--threads 1").stdout, table.stdout);
    assert_ne!(duplicates("--seed 1").stdout, table.stdout);
    duplicates("--help").assert_helps("chefshat experiment duplicates --games 6400");
}
