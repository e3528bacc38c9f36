//! `chefshat tournament` and `chefshat leaderboard` on a server: a tournament from creation to
//! results, the owner's rights, refusals.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use super::server::{Running, json, program, run, serve};

/// Waits for the end of a program. Returns its exit code and output lines.
fn ended(mut program: Running) -> (Option<i32>, Vec<String>) {
    let stdout = program.0.stdout.take().unwrap();
    let lines = BufReader::new(stdout).lines().map(Result::unwrap).collect();
    (program.0.wait().unwrap().code(), lines)
}

fn start(server: &str, arguments: &[&str]) -> Running {
    let mut command = program();
    command.args(arguments).args(["--server", server]);
    Running(command.spawn().unwrap())
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().to_owned()
}

#[test]
fn a_tournament_is_played_followed_and_reported() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let none = run(&url, &["tournament", "list"]);
    assert_eq!(String::from_utf8(none.stdout).unwrap(), "no tournaments\n");

    // The agents may start before the code exists; one of them plays two games at a time.
    let code_file = path(folder.path(), "code");
    let agents: Vec<Running> = [("greedy", "Ada", "2"), ("random", "Ben", "1")]
        .into_iter()
        .map(|(agent, name, games)| {
            let join = [
                "tournament",
                "join",
                "--agent",
                agent,
                "--name",
                name,
                "--games",
                games,
            ];
            let rest = ["--seed", "7", "--code-file", &code_file, "--json"];
            start(&url, &[&join[..], &rest].concat())
        })
        .collect();
    let create = [
        "tournament",
        "create",
        "--name",
        "friday",
        "--format",
        "round_robin",
        "--rounds",
        "3",
        "--built-in",
        "greedy*2,random",
        "--start-when",
        "5",
        "--target-shifts",
        "1",
        "--code-file",
        &code_file,
        "--json",
    ];
    let made = json(&run(&url, &create));
    assert_eq!(made["event"], "created");
    let id = made["tournament"]["tournamentId"].as_str().unwrap();
    let lines = start(&url, &["tournament", "follow", id]);
    let objects = start(&url, &["tournament", "follow", id, "--json"]);

    for agent in agents {
        let (code, lines) = ended(agent);
        assert_eq!(code, Some(0), "{lines:?}");
        let (over, games) = lines.split_last().unwrap();
        let over: Value = serde_json::from_str(over).unwrap();
        assert_eq!(
            (&over["event"], &over["state"]),
            (&"over".into(), &"finished".into())
        );
        let counted = over["standing"]["games"].as_u64().unwrap();
        assert_eq!(counted, games.len() as u64);
        let byes = over["standing"]["byes"].as_u64().unwrap_or(0);
        assert_eq!(counted + byes, 3);
        for game in games {
            let game: Value = serde_json::from_str(game).unwrap();
            assert_eq!(game["event"], "result");
        }
    }
    let (code, lines) = ended(lines);
    assert_eq!(code, Some(0), "{lines:?}");
    let finished = "friday: finished; 3 of 3 games over; ahead: ";
    assert!(
        lines.iter().any(|line| line.starts_with(finished)),
        "{lines:?}"
    );
    assert!(
        lines.iter().any(|line| line.contains("Standings")),
        "{lines:?}"
    );
    let (code, objects) = ended(objects);
    assert_eq!(code, Some(0), "{objects:?}");
    let last: Value = serde_json::from_str(objects.last().unwrap()).unwrap();
    assert_eq!(last["event"], "over");
    assert_eq!(last["standings"].as_array().unwrap().len(), 5);

    check_results(&url, id, folder.path());
    check_games(&url, id, folder.path());
    let listed = json(&run(&url, &["tournament", "list", "--json"]));
    assert_eq!(listed["state"], "TOURNAMENT_STATE_FINISHED");
}

fn check_results(url: &str, id: &str, folder: &Path) {
    let (standings, reference) = (path(folder, "standings.csv"), path(folder, "final.csv"));
    let files = ["--csv", &standings, "--final-results", &reference];
    let told = run(url, &[&["tournament", "results", id], &files[..]].concat());
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    let told = String::from_utf8(told.stdout).unwrap();
    for words in [
        "friday: finished",
        "round robin, 5 participants, 3 rounds, 3 of 3 games over",
        "Ada",
        "greedy 2",
        "How sure is the order?",
        "Rating",
    ] {
        assert!(told.contains(words), "{words} is not in {told}");
    }
    assert!(
        told.lines().all(|line| line.chars().count() <= 100),
        "{told}"
    );

    let results = json(&run(url, &["tournament", "results", id, "--json"]));
    let best = results["standings"][0]["participant"].as_u64().unwrap_or(0);
    let names = &results["tournament"]["participants"];
    let best = names[usize::try_from(best).unwrap()]["name"]
        .as_str()
        .unwrap();
    assert_eq!(results["confidence"].as_array().unwrap().len(), 4);
    let standings = std::fs::read_to_string(standings).unwrap();
    assert_eq!(standings.lines().count(), 6);
    assert!(
        standings.starts_with("place,participant,name,kind,"),
        "{standings}"
    );
    let reference = std::fs::read_to_string(reference).unwrap();
    let mut reference = reference.split("\r\n");
    let header = "Position,Player Name,Final Game Performance Score,Games Played";
    assert_eq!(reference.next(), Some(header));
    let first = reference.next().unwrap();
    assert!(first.starts_with(&format!("1,{best},")), "{first}");
    assert_eq!(reference.filter(|line| !line.is_empty()).count(), 4);
}

fn check_games(url: &str, id: &str, data_dir: &Path) {
    let listed = run(url, &["tournament", "games", id, "--json"]);
    let listed = String::from_utf8(listed.stdout).unwrap();
    let mut known = BTreeSet::new();
    for line in listed.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        assert_eq!(line["game"]["state"], "TOURNAMENT_GAME_STATE_COUNTED");
        let record = line["record"].as_str().unwrap();
        assert!(data_dir.join(record).is_file(), "{record}");
        known.insert(record.to_owned());
    }
    assert_eq!(known.len(), 3);
    let second = run(url, &["tournament", "games", id, "--round", "2"]);
    let second = String::from_utf8(second.stdout).unwrap();
    assert_eq!(second.lines().count(), 1, "{second}");
    assert!(
        second.contains("round 2 table 1 game 1  counted  1st "),
        "{second}"
    );

    let board = json(&run(url, &["leaderboard", "--json"]));
    let rated = board["rated_games"].as_u64().unwrap();
    let names: BTreeSet<&str> = (board["leaderboard"].as_array().unwrap().iter())
        .map(|line| line["name"].as_str().unwrap())
        .collect();
    // A game with two greedy agents is not rated.
    assert!(rated <= 3 && (rated == 0) == names.is_empty(), "{board}");
    let people = run(url, &["leaderboard", "--kind", "human"]);
    let people = String::from_utf8(people.stdout).unwrap();
    assert!(people.contains("no participants"), "{people}");
}

#[test]
fn an_agent_that_ended_resumes_with_its_ticket() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let create = "--name final --format knockout --built-in greedy*3 --target-shifts 1 --json";
    let create = ["tournament", "create"]
        .into_iter()
        .chain(create.split(' '));
    let made = json(&run(&url, &create.collect::<Vec<&str>>()));
    let code = made["join_code"].as_str().unwrap();
    let join = ["tournament", "join", "--agent", "random"];
    let mut first = start(&url, &[&join[..], &["--code", code]].concat());
    let told = BufReader::new(first.0.stderr.take().unwrap()).lines();
    let mut tickets = told.filter_map(|line| {
        let line = line.unwrap();
        let (_, ticket) = line.split_once("--ticket ")?;
        Some(ticket.to_owned())
    });
    let ticket = tickets.next().unwrap();
    drop(first);

    let second = start(
        &url,
        &[&join[..], &["--ticket", &ticket, "--json"]].concat(),
    );
    let id = made["tournament"]["tournamentId"].as_str().unwrap();
    let owner = made["owner_token"].as_str().unwrap();
    let begun = run(&url, &["tournament", "start", id, "--owner-token", owner]);
    assert_eq!(begun.status.code(), Some(0), "{begun:?}");
    let (code, lines) = ended(second);
    assert_eq!(code, Some(0), "{lines:?}");
    let [line] = lines.as_slice() else {
        panic!("one game was expected: {lines:?}");
    };
    let result: Value = serde_json::from_str(line).unwrap();
    assert_eq!(result["event"], "result");
}

#[test]
fn only_its_owner_starts_and_closes_a_tournament() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let owner = path(folder.path(), "owner");
    let create = [
        "tournament",
        "create",
        "--name",
        "slow",
        "--format",
        "knockout",
        "--built-in",
        "random*4",
        "--pace-ms",
        "60000",
        "--owner-file",
        &owner,
    ];
    let made = run(&url, &create);
    let made = String::from_utf8(made.stdout).unwrap();
    assert!(
        made.contains("chefshat tournament join --agent greedy --server"),
        "{made}"
    );
    assert!(made.contains(&format!("--owner-file {owner}")), "{made}");
    let id = made
        .lines()
        .next()
        .unwrap()
        .strip_prefix("tournament   ")
        .unwrap();
    let told = |arguments: &[&str]| {
        let told = run(&url, &[&["tournament"], arguments].concat());
        String::from_utf8(told.stdout).unwrap()
    };
    let before = told(&["results", id]);
    assert!(before.contains("nothing has been played yet"), "{before}");
    assert!(before.contains("Who takes part"), "{before}");

    let wrong = run(
        &url,
        &["tournament", "start", id, "--owner-token", "nonsense"],
    );
    assert_eq!(wrong.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("OWNER_TOKEN_WRONG"));
    let begun = run(
        &url,
        &["tournament", "start", id, "--owner-file", &owner, "--json"],
    );
    let begun = json(&begun);
    assert_eq!(begun["tournament"]["state"], "TOURNAMENT_STATE_PLAYING");
    let mut join = start(
        &url,
        &[
            "tournament",
            "join",
            "--agent",
            "random",
            "--code",
            "BCDF2345",
        ],
    );
    let mut late = String::new();
    join.0
        .stderr
        .take()
        .unwrap()
        .read_to_string(&mut late)
        .unwrap();
    assert!(late.contains("JOIN_CODE_WRONG"), "{late}");

    let follower = start(&url, &["tournament", "follow", id]);
    let closed = run(&url, &["tournament", "close", id, "--owner-file", &owner]);
    let closed = String::from_utf8(closed.stdout).unwrap();
    assert_eq!(closed, format!("tournament {id} is closed\n"));
    let (code, lines) = ended(follower);
    assert_eq!(
        code,
        Some(1),
        "a closed tournament did not finish: {lines:?}"
    );
    let after = told(&["results", id]);
    assert!(after.contains("no game was counted"), "{after}");
    assert!(told(&["list", "--state", "closed"]).starts_with(id));
    assert_eq!(told(&["list", "--state", "open"]), "no tournaments\n");
}

#[test]
fn invalid_tournament_options_are_reported_by_flag() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let nowhere = path(folder.path(), "nowhere/code");
    for (flags, words) in [
        (["--rounds", "5000"], "--rounds: "),
        (["--start-when", "1"], "--start-when: "),
        (["--built-in", "nobody"], "--built-in"),
        (["--decision-time-ms", "1"], "--decision-time-ms: "),
        (["--clock", "human:1"], "--clock: "),
        (["--faces", "3"], "--faces: "),
        (["--target-shifts", "1000000"], "--target-shifts: "),
        (["--code-file", &nowhere], "--code-file: "),
    ] {
        let mut arguments = vec!["tournament", "create", "--name", "x", "--format", "swiss"];
        arguments.extend(flags);
        let refused = run(&url, &arguments);
        assert!(matches!(refused.status.code(), Some(1 | 2)), "{flags:?}");
        let stderr = String::from_utf8(refused.stderr).unwrap();
        assert!(stderr.contains(words), "{stderr}");
        assert!(refused.stdout.is_empty(), "{flags:?}");
    }
    let none = run(&url, &["tournament", "list"]);
    assert_eq!(String::from_utf8(none.stdout).unwrap(), "no tournaments\n");
    let unknown = run(&url, &["tournament", "results", "nonsense"]);
    assert_eq!(unknown.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("TOURNAMENT_UNKNOWN"));
}
