//! `chefshat bench`: an agent has the same result in this process and over the protocol, from one
//! process or from one for each game; interrupted runs resume; records that do not count are named.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::run::{Ended, chefshat, fixture, serve, typed, typed_into_a_closed_pipe};

const PROGRAM: &str = env!("CARGO_BIN_EXE_chefshat-lab");

/// Plays the first deals of a task.
fn run(task: &str, folder: &Path, agent: &[&str]) -> Ended {
    let folder = folder.to_str().unwrap();
    let start = [
        "bench", "run", task, "--json", "--deals", "4", "--out", folder,
    ];
    chefshat(&[&start, agent].concat())
}

/// What does not depend on where the agent played.
fn figures(ended: &Ended) -> [Value; 5] {
    assert_eq!(
        ended.code,
        Some(1),
        "four deals are not a valid result: {ended:?}"
    );
    let result = ended.json();
    assert_eq!(result["problems"][0], "4 of 2500 deals");
    assert_eq!(result["fallback_decisions"], 0);
    [
        "points_per_shift",
        "games_won",
        "place",
        "by_deal",
        "decisions",
    ]
    .map(|name| result[name].clone())
}

#[test]
fn an_agent_has_the_same_result_wherever_it_plays() {
    let folder = tempfile::tempdir().unwrap();
    let [here, each, one] = ["here", "each", "one"].map(|name| folder.path().join(name));
    let offline = run("game", &here, &["--agent", "greedy"]);
    let each_game = [
        "--name", "each", "--", PROGRAM, "agent", "greedy", "--server", "{url}", "--code", "{code}",
    ];
    let each_game = run("game", &each, &each_game);
    let loops = format!(
        "while read address code name; do {PROGRAM} agent greedy --server http://$address --code $code; done"
    );
    let one_process = run("game", &one, &["--name", "one", "--", "sh", "-c", &loops]);
    let renamed = run("game", &one, &["--name", "One", "--", "sh", "-c", &loops]);
    renamed.assert_failed("has games of \"one\"");
    assert_eq!(figures(&each_game), figures(&offline));
    assert_eq!(figures(&one_process), figures(&offline));
    assert_eq!(offline.json()["decision_ms"], Value::Null);
    assert!(each_game.json()["decision_ms"][0].as_f64() > Some(0.0));
    for played in [&here, &each, &one] {
        typed(&format!("verify {}", played.join("records").display())).well();
    }
    let table = typed(&format!(
        "bench table {} {} --versus each",
        here.display(),
        each.display()
    ));
    let table = table.well();
    table.assert_says(&["each is not valid: 4 of 2500 deals"]);
    table.assert_table_fits(3);
    assert!(table.stdout.contains("+0.000"), "{}", table.stdout);
}

#[cfg(unix)]
#[test]
fn one_run_at_a_time_adds_games_to_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let other = fs::File::open(folder.path()).unwrap();
    other.lock().unwrap();
    let refused = run("shift", folder.path(), &["--agent", "random"]);
    refused.assert_failed("another run adds games to");
    assert!(fs::read_dir(folder.path()).unwrap().next().is_none());
    drop(other);
    let played = run("shift", folder.path(), &["--agent", "random"]);
    assert_eq!(played.json()["deals"], 4);
}

#[test]
fn every_task_can_be_hosted() {
    let folder = tempfile::tempdir().unwrap();
    for task in chefshat_benchmark::tasks() {
        let out = folder.path().join(&task.name);
        let agent = ["agent", "greedy", "--server", "{url}", "--code", "{code}"];
        let played = run(
            &task.name,
            &out,
            &[&["--name", "it", "--", PROGRAM], &agent[..]].concat(),
        );
        assert_eq!(played.json()["deals"], 4, "{played:?}");
        assert_eq!(played.json()["played_by"], serde_json::json!(["greedy"]));
    }
}

#[test]
fn a_run_resumes_and_records_that_do_not_count_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path().join("greedy");
    let whole = run("small_deck", &folder, &["--agent", "greedy"]);
    let record = |deal: usize| folder.join("records").join(format!("{deal:04}.jsonl"));
    fs::remove_file(record(2)).unwrap();
    let unfinished = folder.join("records/0002.jsonl.x7Qz1a.part");
    fs::write(&unfinished, "of a run that was killed").unwrap();
    let again = run("small_deck", &folder, &["--agent", "greedy"]);
    assert_eq!(again.stdout, whole.stdout);
    assert!(!cfg!(unix) || !unfinished.exists());
    assert!(
        again.stderr.contains("3 games, 1 are played now"),
        "{again:?}"
    );
    fs::copy(record(0), record(1)).unwrap();
    fs::write(record(2), "no record").unwrap();
    let markers = "{\"marker\":{}}\n".repeat(200_000);
    let header = fs::read_to_string(record(3)).unwrap();
    let header = header.split_inclusive('\n').next().unwrap();
    fs::write(record(4), format!("{header}{markers}")).unwrap();
    let submitted = typed(&format!("bench submit {} --json", folder.display())).json();
    assert_eq!(submitted["deals"], 2);
    let problems = submitted["problems"].to_string();
    for expected in [
        "2 of 2500 deals",
        "0001.jsonl: the game has a different seed",
        "0002.jsonl",
        "0004.jsonl: line 100001 is one too many",
    ] {
        assert!(problems.contains(expected), "{problems}");
    }
    let others_key = format!("ed25519:58{}", "66".repeat(31));
    let keys = typed(&format!(
        "bench submit {} --json --key {others_key}",
        folder.display()
    ));
    assert!(
        keys.json()["problems"].to_string().contains("unsigned"),
        "{keys:?}"
    );
    let result = folder.join("result.json");
    let table = typed(&format!(
        "bench table nowhere {} {}",
        folder.display(),
        result.display()
    ));
    assert!(table.stderr.contains("left out: nowhere"), "{table:?}");
    assert_eq!(table.code, Some(1));
    table.assert_says(&["not checked", "2 of 2500 deals"]);
    // One of more deals than there are would make the agent that it is compared with play them.
    let mut endless = whole.json();
    endless["by_deal"] = vec![Value::Null; 800_000].into();
    let endless_file = folder.join("endless.json");
    fs::write(&endless_file, endless.to_string()).unwrap();
    typed(&format!("bench table {}", endless_file.display()))
        .assert_failed("the task has 2500 deals");
    assert_eq!(submitted["by_deal"][1], Value::Null);
    assert_eq!(submitted["by_deal"][3], whole.json()["by_deal"][3]);
}

#[test]
fn hidden_deals_are_played_and_checked_with_their_key_alone() {
    let folder = tempfile::tempdir().unwrap();
    let out = |name: &str| folder.path().join(name);
    let path = |name: &str| out(name).to_str().unwrap().to_owned();
    let (deals, other) = (path("deals.key"), path("other.key"));
    let greedy = |name: &str, key: &str| {
        run(
            "shift",
            &out(name),
            &["--agent", "greedy", "--deals-key", key],
        )
    };
    greedy("greedy", &deals).assert_failed("create it: chefshat bench deals-key");
    let commitment = |file: &str| {
        let created = typed(&format!("bench deals-key {file} --json"))
            .well()
            .json();
        created["deals_commitment"].as_str().unwrap().to_owned()
    };
    let published = commitment(&deals);
    assert_eq!(commitment(&deals), published, "its key stays");
    assert_ne!(commitment(&other), published);
    let text = typed(&format!("bench deals-key {deals}")).well();
    text.assert_says(&[&format!("commitment: {published}")]);

    let offline = greedy("greedy", &deals);
    assert_eq!(offline.json()["deals_commitment"], published);
    let connected = [
        "--name",
        "it",
        "--deals-key",
        &deals,
        "--",
        PROGRAM,
        "agent",
        "greedy",
        "--server",
        "{url}",
        "--code",
        "{code}",
    ];
    let connected = run("shift", &out("connected"), &connected);
    assert_eq!(figures(&connected), figures(&offline));
    let others = run("shift", &out("published"), &["--agent", "greedy"]);
    assert_ne!(others.json()["by_deal"], offline.json()["by_deal"]);
    assert_eq!(others.json()["deals_commitment"], Value::Null);

    // Nobody adds games with other deals, and nobody checks them without the key.
    run("shift", &out("greedy"), &["--agent", "greedy"]).assert_failed("--deals-key");
    greedy("greedy", &other).assert_failed("another key");
    greedy("published", &deals).assert_failed("published deals");
    let submit =
        |name: &str, key: &str| typed(&format!("bench submit {} --json {key}", path(name)));
    submit("greedy", "").assert_failed(&published);
    submit("greedy", &format!("--deals-key {other}")).assert_failed("another key");
    submit("published", &format!("--deals-key {deals}")).assert_failed("published deals");
    fs::write(out("empty.key"), "").unwrap();
    let empty = format!("--deals-key {}", path("empty.key"));
    submit("greedy", &empty).assert_failed("64 hexadecimal digits");
    let checked = submit("greedy", &format!("--deals-key {deals}"));
    assert_eq!(figures(&checked), figures(&offline));

    let folders = format!("{} {}", path("greedy"), path("connected"));
    let left_out = typed(&format!("bench table {folders} {}", path("published")));
    assert_eq!(left_out.code, Some(1));
    assert!(left_out.stderr.contains("has hidden deals"), "{left_out:?}");
    let all = typed(&format!(
        "bench table {folders} {} --deals-key {deals}",
        path("published")
    ))
    .well();
    all.assert_says(&[&format!("hidden deals {published}")]);
    assert!(all.stdout.contains("+0.000"), "{}", all.stdout);
    assert_eq!(
        all.stdout.matches("ChefsHat-v1 shift").count(),
        2,
        "{}",
        all.stdout
    );
    // Files are believed, but nobody else plays their deals.
    let files = ["greedy", "connected"].map(|name| out(name).join("result.json"));
    let files = format!("bench table {} {}", files[0].display(), files[1].display());
    typed(&files).assert_failed("greedy has hidden deals");
    typed(&format!("{files} --versus nobody"))
        .assert_failed("no result on the same deals has this name");
    typed(&format!("{files} --versus it"))
        .well()
        .assert_says(&["not checked"]);
    // What is shown is a commitment, not any text.
    let manifest = fs::read_to_string(out("greedy").join("manifest.json")).unwrap();
    let edited = manifest.replace(&published, "\\u001b[2J");
    fs::write(out("greedy").join("manifest.json"), edited).unwrap();
    submit("greedy", &format!("--deals-key {deals}")).assert_failed("64 hexadecimal digits");
}

#[test]
fn what_is_no_folder_of_a_submission_is_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = folder.path().join("manifest.json");
    fs::write(&manifest, r#"{"name": "a page"}"#).unwrap();
    run("shift", folder.path(), &["--agent", "greedy"]).assert_failed("bench run` wrote");
    assert_eq!(
        fs::read_to_string(&manifest).unwrap(),
        r#"{"name": "a page"}"#
    );
}

#[test]
fn errors_say_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    run("chess", &out, &["--agent", "greedy"]).assert_refused("use one of shift, game");
    run("shift", &out, &[]).assert_failed("a command after --");
    run("shift", &out, &["--", "true"]).assert_failed("with --name");
    run("shift", &out, &["--agent", "nobody"]).assert_failed("neither a built-in agent");
    let small = fixture("network/small-table.safetensors");
    let small = run("shift", &out, &["--agent", small.to_str().unwrap()]);
    small.assert_failed("trained for games of another size");
    let exits = run(
        "shift",
        &out,
        &["--name", "it", "--", "sh", "-c", "echo away; exit 3"],
    );
    exits.assert_failed("exit status: 3");
    exits.assert_failed("away");
    let exits = [
        "--name",
        "it",
        "--",
        "sh",
        "-c",
        "echo {address} {code}; exit 3",
    ];
    let other = folder.path().join("other");
    run("shift", &other, &exits).assert_failed("the agent exited before the end");
    // Nothing was played there.
    assert_eq!(
        run("game", &other, &["--agent", "greedy"]).json()["deals"],
        4
    );
    run("shift", &other, &["--agent", "greedy"]).assert_failed("name another folder with --out");
    typed("bench submit nowhere").assert_failed("a folder that `chefshat bench run` wrote");
    typed("bench table nowhere").assert_failed("nowhere");
}

#[test]
fn the_tasks_are_data() {
    let tasks = typed("bench tasks --json").well().json();
    assert_eq!(tasks["benchmark"], "ChefsHat-v1");
    let names = tasks["tasks"].as_array().unwrap().iter();
    let names: Vec<_> = names.map(|task| task["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["shift", "game", "small_deck", "language_model"]);
    let text = typed("bench tasks").well().stdout;
    assert!(names.iter().all(|name| text.contains(name)), "{text}");
}

#[test]
fn the_pool_has_a_row_and_a_column_for_each_agent() {
    let flags = "--agents random,greedy --deals 10 --task-deals 10";
    let pool = typed(&format!("bench pool {flags} --json")).well().json();
    assert_eq!(pool["tasks"].as_array().unwrap().len(), 4);
    let pairs = pool["cross"]["pairs"].as_array().unwrap();
    assert_eq!(pairs.len(), 2);
    assert_eq!(
        (&pairs[1]["one"], &pairs[1]["others"]),
        (&"greedy".into(), &"random".into())
    );
    assert!(
        pairs[1]["difference"].as_f64() > Some(0.0),
        "greedy is better: {pairs:?}"
    );
    // A network for games of another size has no games with the others.
    let small = fixture("network/small-table.safetensors");
    let agents = format!("random,greedy,{}", small.display());
    let text = typed(&format!(
        "bench pool --agents {agents} --deals 10 --task-deals 10"
    ))
    .well();
    text.assert_table_fits(10);
    // A file takes nobody's place by its name.
    let folder = tempfile::tempdir().unwrap();
    let network = folder.path().join("greedy.safetensors");
    fs::copy(fixture("network/table-actions.safetensors"), &network).unwrap();
    let flags = "--deals 2 --task-deals 2 --json";
    let pool = format!("bench pool --agents random,{} {flags}", network.display());
    let pool = typed(&pool).well().json();
    let rows = pool["tasks"][0]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 2);
    assert!(
        rows.iter().all(|row| row["difference"].is_object()),
        "{rows:?}"
    );
}

#[test]
fn a_result_with_which_nothing_can_be_compared_leaves_the_others_in_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let out = |name: &str| folder.path().join(name);
    run("small_deck", &out("small"), &["--agent", "greedy"]);
    run("shift", &out("large"), &["--agent", "greedy"]);
    let network = fixture("network/table-actions.safetensors");
    let folders = format!("{} {}", out("small").display(), out("large").display());
    let table = typed(&format!(
        "bench table {folders} --versus {}",
        network.display()
    ));
    assert_eq!(table.code, Some(1));
    assert!(table.stderr.contains("left out: small_deck: "), "{table:?}");
    table.assert_says(&["ChefsHat-v1 shift"]);
    assert!(!table.stdout.contains("small_deck"), "{}", table.stdout);
}

#[test]
#[cfg(unix)]
fn rooms_of_an_agent_that_has_exited_are_closed() {
    let folder = tempfile::tempdir().unwrap();
    let (_server, url) = serve(folder.path());
    let out = folder.path().join("out");
    let exits = [
        "--parallel",
        "4",
        "--name",
        "it",
        "--server",
        &url,
        "--",
        "sh",
        "-c",
        "read line; exit 3",
    ];
    run("shift", &out, &exits).assert_failed("exit");
    let rooms = typed(&format!("room list --server {url}")).well();
    assert!(!rooms.stdout.contains("waiting"), "{rooms:?}");
}

#[test]
fn a_reader_may_close_the_output() {
    typed_into_a_closed_pipe("bench tasks").clean();
}
