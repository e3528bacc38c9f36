//! `chefshat simulate`: the same output for the same seed, a table that fits and adds up, errors
//! that name the flag.

use serde_json::Value;

use super::run::{Ended, closed_pipe, on_a_full_disk, typed, typed_on_a_full_disk};

fn simulate(flags: &str) -> Ended {
    typed(&format!("simulate {flags}"))
}

fn json(flags: &str) -> Value {
    simulate(&format!("{flags} --json")).well().json()
}

#[test]
fn the_same_seed_prints_the_same_on_any_number_of_threads() {
    let flags = "--games 2000 --seed 7 --reward paper";
    for form in ["", " --json"] {
        let first = simulate(&format!("{flags}{form}")).well();
        assert_eq!(first.stderr, "", "no progress where there is no terminal");
        for threads in [
            "",
            " --threads 1",
            " --threads 2",
            " --threads 3",
            " --threads 0",
            " --threads 20000",
        ] {
            assert_eq!(
                simulate(&format!("{flags}{form}{threads}")),
                first,
                "{threads}{form}"
            );
        }
    }
    let other = simulate("--games 2000 --seed 8 --reward paper");
    assert_ne!(other.stdout, simulate(flags).stdout);
}

#[test]
fn the_table_is_readable() {
    let ended = simulate("--games 60 --seed 7").well();
    assert_eq!(ended.stdout, include_str!("simulate.txt"));
}

#[test]
fn lines_keep_within_100_columns() {
    for flags in [
        "--games 300 --agents random_unmasked,random_unmasked,random_unmasked,random_unmasked --reward paper_intended",
        "--games 50 --players 6 --faces 15 --preset original2020 --no-exchange --no-special-actions --max-idle-pizzas 1000000 \
         --max-turns 4000000000 --target-shifts 12 --points 1000000,200000,30000,4000,500,60 --max-invalid-attempts 4000000000",
    ] {
        simulate(flags).well().assert_table_fits(10);
    }
}

#[test]
fn json_is_complete_and_adds_up() {
    let result = json(
        "--games 100 --seed 3 --players 3 --agents greedy,random,random_unmasked --reward validity --no-exchange",
    );
    assert_eq!(result["games"], 100);
    assert_eq!(result["seed"], 3);
    assert_eq!(result["reward"], "validity");
    assert_eq!(result["rules"]["players"], 3);
    assert_eq!(result["rules"]["exchange"], false);
    assert_eq!(result["rules"]["special_actions"], true);
    let seats = result["seats"].as_array().unwrap();
    let names: Vec<&str> = seats
        .iter()
        .map(|seat| seat["agent"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["greedy", "random", "random_unmasked"]);
    let sum = |field: &str| {
        seats
            .iter()
            .map(|seat| seat[field].as_u64().unwrap())
            .sum::<u64>()
    };
    assert_eq!(sum("games_won"), 100);
    assert_eq!(sum("shifts_won"), result["shifts"].as_u64().unwrap());
    assert_eq!(sum("points"), 8 * result["shifts"].as_u64().unwrap());
    assert_eq!(sum("plays") + sum("passes"), sum("valid_actions"));
    assert_eq!(seats[0]["mean_reward"], 1.0);
    assert_eq!(seats[1]["wrong_actions"], 0);
    assert!(
        seats[2]["wrong_actions"].as_u64().unwrap()
            > 10 * seats[2]["valid_actions"].as_u64().unwrap()
    );
    assert!(seats[2]["mean_reward"].as_f64().unwrap() < -0.8);
    assert!(seats[0]["mean_place"].as_f64().unwrap() < seats[1]["mean_place"].as_f64().unwrap());
}

#[test]
fn greedy_has_seat_0_by_default() {
    let agents = |flags: &str| -> Vec<String> {
        let result = json(flags);
        let seats = result["seats"].as_array().unwrap();
        seats
            .iter()
            .map(|seat| seat["agent"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(
        agents("--games 1"),
        ["greedy", "random", "random", "random"]
    );
    assert_eq!(agents("--games 1 --players 2"), ["greedy", "random"]);
}

#[test]
fn mistakes_are_explained() {
    let table = [
        ("--agents greedy,random", "2 agents for 4 players"),
        (
            "--agents clever,random,random,random",
            "invalid value 'clever'",
        ),
        (
            "--reward gold",
            "possible values: validity, paper, paper_intended, winning, points",
        ),
        (
            "--preset chess",
            "possible values: paper, rulebook, original2020",
        ),
        ("--faces 3", "--faces: 3 faces: choose 4 to 15"),
        ("--players 7", "--players: 7 players: choose 2 to 6"),
        (
            "--preset rulebook --players 3",
            "--points: the preset rulebook has points for 4 players, not for 3: give the points of each place",
        ),
        (
            "--preset rulebook --players 3 --points 3,2,1,0",
            "--points: 4 numbers of points for 3 players",
        ),
        ("--target-shifts 0", "--target-shifts: a target of 0 Shifts"),
        ("--target-shifts 3 --target-points 9", "cannot be used with"),
        ("--no-exchange --exchange on", "cannot be used with"),
        ("--games 0", "--games"),
        ("--max-turns 0", "--max-turns is 0"),
        ("--threads many", "--threads"),
        ("--max-invalid-attempts 0", "--max-invalid-attempts"),
    ];
    for (flags, expected) in table {
        simulate(flags).assert_refused(expected);
    }
}

#[test]
fn records_that_cannot_be_written_cost_no_result() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let refused = simulate(&format!("--records {}", file.join("records").display()));
    refused.assert_failed("--records: ");
    let records = folder.path().join("records");
    let flags = "--games 2 --records";
    let line = format!("simulate {flags} {}", records.display());
    let ended = typed_on_a_full_disk(&line);
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert_eq!(ended.stdout, simulate("--games 2").stdout);
    let mut unread = on_a_full_disk(&line);
    let ended = Ended::of(unread.stdout(closed_pipe()).output().unwrap());
    assert_eq!(ended.code, Some(1), "{ended:?}");
}

#[test]
fn games_that_cannot_be_repeated_are_not_recorded() {
    let records = std::env::temp_dir().join("chefshat-never-recorded");
    let simulated = |agent: &str| {
        let to = records.display();
        simulate(&format!(
            "--games 1 --agents {agent},greedy,greedy,greedy --records {to}"
        ))
    };
    for timed in ["monte_carlo", "monte_carlo:20ms"] {
        simulated(timed).assert_failed("monte_carlo:64");
        assert!(!records.exists(), "{timed}");
    }
}

#[test]
fn help_shows_an_example() {
    simulate("--help").assert_helps("chefshat simulate --games 2000 --seed 7");
}
