//! `chefshat compare`: the same output for the same seed, a table that fits, network files, and
//! errors that name the cause.

use serde_json::Value;

use super::run::{Ended, chefshat, typed};

/// Networks with random weights.
const TABLE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../tests/fixtures/network/table-actions.safetensors"
);
const SMALL: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../tests/fixtures/network/small-table.safetensors"
);

fn compare(a: &str, b: &str, flags: &str) -> Ended {
    typed(&format!("compare {a} {b} {flags}"))
}

fn json(a: &str, b: &str, flags: &str) -> Value {
    compare(a, b, &format!("{flags} --json")).well().json()
}

#[test]
fn the_table_is_readable_and_the_same_for_the_same_seed() {
    let flags = "--deals 50 --seed 7";
    let ended = compare("greedy", "random", flags).well();
    assert_eq!(ended.stderr, "", "no progress where there is no terminal");
    assert_eq!(ended.stdout, include_str!("compare.txt"));
    for threads in ["--threads 1", "--threads 3"] {
        let again = compare("greedy", "random", &format!("{flags} {threads}"));
        assert_eq!(again, ended);
    }
    assert_ne!(
        compare("greedy", "random", "--deals 50").stdout,
        ended.stdout
    );
}

#[test]
fn a_number_of_rollouts_makes_games_repeatable() {
    let flags = "--deals 2 --shifts 2 --seats one --faces 5";
    let once = json("monte_carlo:20:random", "random", flags);
    assert_eq!(
        once,
        json(
            "monte_carlo:20:random",
            "random",
            &format!("{flags} --threads 1")
        )
    );
    assert_eq!(once["a"]["agent"], "monte_carlo:20:random");
    let decisions = &once["a"]["decisions"];
    assert!(decisions["searched"].as_u64().unwrap() > 50, "{decisions}");
    assert!(decisions["rollouts"].as_u64() > decisions["searched"].as_u64());
    assert_eq!(decisions["history_unknown"], 0);
    assert_eq!(once["shifts"], 16);
    assert_ne!(
        once["points_per_shift"],
        json("random", "random", flags)["points_per_shift"]
    );
}

#[test]
fn agents_that_search_are_named_with_their_budgets() {
    let text = compare(
        "monte_carlo:10:random",
        "monte_carlo:11:random",
        "--deals 2 --shifts 1 --faces 4",
    )
    .well()
    .stdout;
    let title = "monte_carlo:10:random against monte_carlo:11:random: 2 deals";
    assert!(text.contains(title), "{text}");
    assert!(text.contains("monte_carlo:11:random: "), "{text}");
    assert!(
        text.contains(" rollouts each), 0 decisions taken as trained does."),
        "{text}"
    );
    let table = text.split("Per seat").nth(1).unwrap();
    assert!(table.contains(" A ") && table.contains(" B "), "{text}");
}

#[test]
fn lines_keep_within_100_columns() {
    for (a, b, flags) in [
        (TABLE, TABLE, "--deals 2 --shifts 1000 --seats one"),
        (
            "random_unmasked",
            "random_unmasked",
            "--deals 3 --players 5 --preset original2020 --no-exchange --no-special-actions --points 1000,100,50,10,1",
        ),
    ] {
        compare(a, b, flags).well().assert_table_fits(8);
    }
}

#[test]
fn json_has_settings_and_results() {
    let result = json(
        "random",
        "greedy",
        "--deals 10 --shifts 2 --seats one --preset rulebook",
    );
    assert_eq!(
        (&result["a"]["agent"], &result["b"]["agent"]),
        (&"random".into(), &"greedy".into())
    );
    assert_eq!(result["seats"], "one");
    assert_eq!(result["rules"]["target_shifts"], 2);
    let counts =
        ["deals", "seatings", "games", "shifts"].map(|field| result[field].as_u64().unwrap());
    assert_eq!(counts, [10, 4, 40, 80]);
    let points = &result["points_per_shift"];
    let number = |field: &str| points[field].as_f64().unwrap();
    // Three times as many seats of B; 3 + 2 + 1 + 0 points per Shift.
    assert!(
        (number("a") + 3.0 * number("b") - 6.0).abs() < 1e-9,
        "{points}"
    );
    assert!(number("a") < number("b"), "random loses to greedy");
    let interval = &points["difference_95"];
    assert!(interval[0].as_f64().unwrap() < number("difference"));
    assert!(number("difference") < interval[1].as_f64().unwrap());
    let errors = ["standard_error", "independent_standard_error"].map(number);
    let gain = (errors[1] / errors[0]).powi(2);
    assert!((gain - number("gain")).abs() < 1e-9);

    let network = json(TABLE, "greedy", "--deals 2");
    let file =
        ["file", "name", "input", "output"].map(|field| network["a"][field].as_str().unwrap());
    assert_eq!(file, [TABLE, "table-actions", "table", "actions"]);
    assert_eq!(network["a"]["masked"], true);

    let same = json("greedy", "greedy", "--deals 4");
    assert_eq!(same["points_per_shift"]["difference"], 0.0);
    assert_eq!(same["points_per_shift"]["gain"], Value::Null);
    assert_eq!(
        (&same["seatings"], &same["shifts_per_game"]),
        (&6.into(), &4.into())
    );
}

#[test]
fn mistakes_are_explained() {
    let folder = env!("CARGO_MANIFEST_DIR");
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    for (a, b, flags, expected) in [
        ("clever", "greedy", "", "neither a built-in agent (random, "),
        ("monte_carlo:0", "greedy", "", "write monte_carlo, "),
        ("greedy", manifest, "", "Cargo.toml: not a safetensors file"),
        (
            "greedy",
            folder,
            "",
            "is a directory: name the network file",
        ),
        (
            SMALL,
            "greedy",
            "",
            "it was trained for 3 players, 5 faces and hands of 5 cards",
        ),
        (SMALL, "greedy", "", "change --players, --faces or --jokers"),
        (
            "greedy",
            "random",
            "--target-points 9",
            "use --shifts to set",
        ),
        ("greedy", "random", "--deals 1", "--deals"),
        ("greedy", "random", "--shifts 0", "--shifts"),
        ("greedy", "random", "--players 7", "--players: 7 players"),
        (
            "greedy",
            "random",
            "--seats two",
            "possible values: half, one",
        ),
    ] {
        compare(a, b, flags).assert_refused(expected);
    }
    compare(
        SMALL,
        "greedy",
        "--deals 2 --players 3 --faces 5 --jokers 1",
    )
    .well();
}

#[test]
fn a_command_has_the_result_that_its_agent_has_in_this_process() {
    const AGENT: &str = env!("CARGO_BIN_EXE_chefshat-lab");
    let compared = |a: &str, b: &str, seats: &str| {
        let flags = [
            "--deals", "2", "--shifts", "2", "--seed", "7", "--seats", seats,
        ];
        let mut result = chefshat(&[&["compare", a, b, "--json"], &flags[..]].concat())
            .well()
            .json();
        assert_eq!(result["deals"], 2);
        let sides = ["a", "b"].map(|side| result[side].take());
        (result, sides)
    };
    let each_game = format!("{AGENT} agent greedy --server {{url}} --code {{code}}");
    let reads_games = format!(
        "sh -c 'while read address code name; do {AGENT} agent greedy --server http://$address --code $code; done'"
    );
    // Agents of this process draw the same numbers there.
    let (here, _) = compared("greedy", "random", "half");
    let (each, sides) = compared(&each_game, "random", "half");
    assert_eq!(each, here);
    assert_eq!(sides[0]["command"], *each_game);
    let (reads, _) = compared("random", &reads_games, "one");
    let (one, _) = compared("random", "greedy", "one");
    assert_eq!(reads, one);
    let (networks, _) = compared(TABLE, &each_game, "one");
    assert_eq!(networks, compared(TABLE, "greedy", "one").0);
    let (same, _) = compared(&each_game, &reads_games, "half");
    assert_eq!(same["points_per_shift"]["difference"], 0.0);
}

#[test]
fn a_command_that_does_not_play_ends_the_comparison() {
    for (command, expected) in [
        (
            "sh -c 'echo no seat; exit 3'",
            "the agent's last lines:\n  | no seat",
        ),
        (
            "sh -c 'exit 3' {address} {code}",
            "the agent exited before the end: exit status: 3",
        ),
        ("sh -c '", "a quote is missing"),
        (
            "agent {code}",
            "the command needs {address} (host:port) or {url}",
        ),
        ("agent {tournament}", "{tournament} has no value here"),
        ("no-such-program --code {code} {url}", "no-such-program: "),
    ] {
        let flags = ["--deals", "2", "--shifts", "1"];
        let ended = chefshat(&[&["compare", "greedy", command], &flags[..]].concat());
        ended.assert_failed(expected);
    }
    compare("greedy", "random", "--server http://127.0.0.1:1").assert_failed("it is for commands");
}

#[test]
fn help_shows_an_example() {
    typed("compare --help").assert_helps("chefshat compare greedy random");
}
