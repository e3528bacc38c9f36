//! `chefshat tournament simulate`: the same output for the same seed, tables that fit, every format
//! and kind of deals, errors that name the flag.

use serde_json::Value;

use super::run::{Ended, closed_pipe, on_a_full_disk, program, typed, typed_on_a_full_disk};

fn simulate(flags: &str) -> Ended {
    typed(&format!("tournament simulate {flags}"))
}

fn json(flags: &str) -> Value {
    simulate(&format!("{flags} --json")).well().json()
}

/// Names in the order of the standings.
fn order(result: &Value) -> Vec<String> {
    let standings = result["standings"].as_array().unwrap();
    // Canonical JSON omits 0.
    let number = |line: &Value| line["participant"].as_u64().unwrap_or(0) as usize;
    standings
        .iter()
        .map(|line| {
            result["participants"][number(line)]["name"]
                .as_str()
                .unwrap()
                .to_owned()
        })
        .collect()
}

#[test]
fn the_same_seed_gives_the_same_standings_on_any_number_of_threads() {
    let flags = "--format swiss --agents greedy*4,random*5 --games-per-pairing 3 --seed 7";
    let ended = simulate(flags).well();
    for threads in ["--threads 1", "--threads 3"] {
        let again = simulate(&format!("{flags} {threads}"));
        assert_eq!(again.stdout, ended.stdout);
    }
    let other = simulate(&flags.replace("--seed 7", "--seed 8"));
    assert_ne!(other.stdout, ended.stdout);
    assert!(
        ended
            .stdout
            .starts_with("swiss of 9 participants, seed 7\n")
    );
    assert!(
        ended
            .stdout
            .contains("4 rounds, 3 games of each pairing, 24 games in all")
    );
    assert!(ended.stderr.starts_with("24 games in "), "{}", ended.stderr);
    assert_eq!(
        ended.stderr.lines().count(),
        1,
        "no progress where there is no terminal"
    );
    ended.assert_table_fits(8);
}

#[test]
fn nobody_has_to_read_how_long_it_took() {
    let mut unread = program();
    unread.args("tournament simulate --format swiss --agents greedy*4".split(' '));
    let ended = Ended::of(unread.stderr(closed_pipe()).output().unwrap());
    assert!(ended.well().stdout.contains("greedy 4"));
}

#[test]
fn every_format_and_kind_of_deals_is_played_to_its_end() {
    for (format, rounds, pairings) in [("knockout", 2, 3), ("round_robin", 7, 14), ("swiss", 3, 6)]
    {
        for (deals, games) in [("independent", 2), ("same", 2), ("rotated", 8)] {
            let result = json(&format!(
                "--format {format} --deals {deals} --agents greedy,random --participants 8 --games-per-pairing 2"
            ));
            assert_eq!(
                [
                    &result["format"],
                    &result["deals"],
                    &result["rounds"],
                    &result["games"]
                ],
                [
                    &Value::from(format),
                    &Value::from(deals),
                    &Value::from(rounds),
                    &Value::from(pairings * games)
                ]
            );
            let order = order(&result);
            assert_eq!(order.len(), 8);
            assert!(order[0].starts_with("greedy "), "{order:?}");
            assert_eq!(result["confidence"].as_array().unwrap().len(), 7);
            assert_eq!(result["rules"]["players"], 4);
        }
    }
}

#[test]
fn participants_are_named_after_their_agents() {
    let result = json("--format knockout --agents greedy,random*4");
    let mut names = order(&result);
    names.sort_unstable();
    assert_eq!(
        names,
        [
            "Filler 1", "Filler 2", "Filler 3", "greedy", "random 1", "random 2", "random 3",
            "random 4"
        ]
    );
    let result = json("--format swiss --agents greedy,random --participants 3 --players 3");
    let mut names = order(&result);
    names.sort_unstable();
    assert_eq!(names, ["greedy 1", "greedy 2", "random"]);
}

#[test]
fn standings_are_written_as_csv() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("standings.csv");
    let flags = format!(
        "--format round_robin --agents greedy,random --participants 5 --csv {}",
        file.display()
    );
    simulate(&flags).well();
    let csv = std::fs::read_to_string(&file).unwrap();
    assert_eq!(csv.lines().count(), 6);
    assert!(csv.starts_with("place,participant,name,"), "{csv}");
}

#[test]
fn a_file_that_cannot_be_written_costs_no_result() {
    let folder = tempfile::tempdir().unwrap();
    let flags = "--format round_robin --agents greedy*4 --csv";
    let simulate_to = |file: &str| {
        let file = folder.path().join(file);
        format!("tournament simulate {flags} {}", file.display())
    };
    let refused = typed(&simulate_to("nowhere/standings.csv"));
    refused.assert_failed("nowhere");
    assert!(!refused.stderr.contains("games in"), "{refused:?}");
    let ended = typed_on_a_full_disk(&simulate_to("standings.csv"));
    assert_eq!(ended.code, Some(1), "{ended:?}");
    ended.assert_says(&["round robin of 4 participants"]);
    let mut unread = on_a_full_disk(&simulate_to("standings.csv"));
    let ended = Ended::of(unread.stdout(closed_pipe()).output().unwrap());
    assert_eq!(ended.code, Some(1), "{ended:?}");
}

#[test]
fn mistakes_are_explained() {
    for (flags, expected) in [
        ("--agents greedy,random", "--format"),
        ("--format swiss", "--agents"),
        ("--format swiss --agents clever", "clever"),
        (
            "--format swiss --agents greedy",
            "--participants: 1 is not within 2..=1024",
        ),
        (
            "--format swiss --agents greedy*1000,random*1000",
            "--agents: 2000 of at most 1024",
        ),
        (
            "--format swiss --agents greedy --participants 1",
            "--participants",
        ),
        (
            "--format swiss --agents greedy*4 --rounds 0",
            "--rounds: 0 is not within 1..=1000",
        ),
        (
            "--format knockout --agents greedy*4 --rounds 2",
            "--rounds: the rounds of a knockout",
        ),
        (
            "--format knockout --agents greedy*4 --players 3",
            "--format: a knockout is for games of 4",
        ),
        (
            "--format swiss --agents greedy*40 --games-per-pairing 1000 --deals rotated",
            "--games-per-pairing: up to 240000 games",
        ),
        (
            "--format swiss --agents greedy*4 --players 9",
            "--players: 9 players",
        ),
    ] {
        simulate(flags).assert_refused(expected);
    }
}

#[test]
fn help_shows_an_example() {
    simulate("--help").assert_helps("chefshat tournament simulate --format swiss");
}
