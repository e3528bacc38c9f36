//! `chefshat tournament` and `chefshat leaderboard` on a server: a tournament from creation to
//! results, the owner's rights, refusals.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Read as _};
use std::path::Path;

use chefshat_client::{Client, v1};
use serde_json::Value;
use tempfile::TempDir;

use super::run::{
    Ended, Running, in_runtime, json_lines, program, run, serve, typed_into_a_closed_pipe, until,
};

/// Waits for the end of a program that must succeed. Returns its output, JSON lines.
fn objects_of(program: Running) -> Vec<Value> {
    let (code, lines) = program.ended();
    assert_eq!(code, Some(0), "{lines:?}");
    json_lines(&lines.join("\n"))
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().to_owned()
}

#[test]
fn a_tournament_is_played_followed_and_reported() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    assert_eq!(run(&url, "tournament list").stdout, "no tournaments\n");

    // The agents may start before the code exists; one of them plays two games at a time.
    let code_file = path(folder.path(), "code");
    let agents = ["greedy --name Ada --games 2", "random --name Ben --games 1"].map(|agent| {
        let join = format!("tournament join --agent {agent} --seed 7 --json");
        Running::start(&url, &format!("{join} --code-file {code_file}"))
    });
    let settings = "--format round_robin --rounds 3 --built-in greedy*2,random --start-when 5";
    let create = format!("tournament create --name friday {settings} --target-shifts 1 --json");
    let made = run(&url, &format!("{create} --code-file {code_file}")).json();
    assert_eq!(made["event"], "created");
    let id = made["tournament"]["tournamentId"].as_str().unwrap();
    let lines = Running::start(&url, &format!("tournament follow {id}"));
    let objects = Running::start(&url, &format!("tournament follow {id} --json"));

    for agent in agents {
        let objects = objects_of(agent);
        let (over, games) = objects.split_last().unwrap();
        assert_eq!(
            (&over["event"], &over["state"]),
            (&"over".into(), &"finished".into())
        );
        let counted = over["standing"]["games"].as_u64().unwrap();
        assert_eq!(counted, games.len() as u64);
        let byes = over["standing"]["byes"].as_u64().unwrap_or(0);
        assert_eq!(counted + byes, 3);
        assert!(games.iter().all(|game| game["event"] == "result"));
    }
    let (code, lines) = lines.ended();
    assert_eq!(code, Some(0), "{lines:?}");
    let finished = "friday: finished; 3 of 3 games over; ahead: ";
    let has = |wanted: fn(&str, &str) -> bool, words: &str| {
        assert!(lines.iter().any(|line| wanted(line, words)), "{lines:?}");
    };
    has(|line, words| line.starts_with(words), finished);
    has(|line, words| line.contains(words), "Standings");
    let objects = objects_of(objects);
    let last = objects.last().unwrap();
    assert_eq!(last["event"], "over");
    assert_eq!(last["standings"].as_array().unwrap().len(), 5);

    check_results(&url, id, folder.path());
    check_games(&url, id, folder.path());
    let listed = run(&url, "tournament list --json").json();
    assert_eq!(listed["state"], "TOURNAMENT_STATE_FINISHED");
}

fn check_results(url: &str, id: &str, folder: &Path) {
    let (standings, reference) = (path(folder, "standings.csv"), path(folder, "final.csv"));
    let results = format!("tournament results {id}");
    let files = format!("--csv {standings} --final-results {reference}");
    let printed = run(url, &format!("{results} {files}")).well();
    printed.assert_says(&["friday: finished", "Ada", "greedy 2", "Rating"]);
    printed.assert_says(&["round robin, 5 participants, 3 rounds, 3 of 3 games over"]);
    printed.assert_says(&["How sure is the order?"]);
    printed.assert_table_fits(5);

    let results = run(url, &format!("{results} --json")).json();
    let best = results["standings"][0]["participant"].as_u64().unwrap_or(0);
    let names = &results["tournament"]["participants"];
    let best = &names[usize::try_from(best).unwrap()]["name"];
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
    let best = format!("1,{},", best.as_str().unwrap());
    assert!(first.starts_with(&best), "{first}");
    assert_eq!(reference.filter(|line| !line.is_empty()).count(), 4);
}

fn check_games(url: &str, id: &str, data_dir: &Path) {
    let games = format!("tournament games {id}");
    let mut known = BTreeSet::new();
    for line in run(url, &format!("{games} --json")).json_lines() {
        assert_eq!(line["game"]["state"], "TOURNAMENT_GAME_STATE_COUNTED");
        let record = line["record"].as_str().unwrap();
        // Records are written after their game has ended.
        until(record, || data_dir.join(record).is_file());
        known.insert(record.to_owned());
    }
    assert_eq!(known.len(), 3);
    let second = run(url, &format!("{games} --round 2"));
    assert_eq!(second.stdout.lines().count(), 1, "{second:?}");
    second.assert_says(&["round 2 table 1 game 1  counted  1st "]);

    let board = run(url, "leaderboard --json").json();
    let rated = board["rated_games"].as_u64().unwrap();
    let names = board["leaderboard"].as_array().unwrap();
    // A game with two greedy agents is not rated.
    assert!(rated <= 3 && (rated == 0) == names.is_empty(), "{board}");
    run(url, "leaderboard --kind human").assert_says(&["no participants"]);
}

#[test]
fn an_agent_that_ended_resumes_with_its_ticket() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let settings = "--name final --format knockout --built-in greedy*3 --target-shifts 1";
    let made = run(&url, &format!("tournament create {settings} --json")).json();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    let code = text(&made["join_code"]);
    let join = "tournament join --agent random";
    let mut first = Running::start(&url, &format!("{join} --code {code}"));
    let printed = BufReader::new(first.0.stderr.take().unwrap()).lines();
    let mut tickets = printed.filter_map(|line| {
        let line = line.unwrap();
        let (_, ticket) = line.split_once("--ticket ")?;
        Some(ticket.to_owned())
    });
    let ticket = tickets.next().unwrap();
    drop(first);

    let second = Running::start(&url, &format!("{join} --ticket {ticket} --json"));
    let id = text(&made["tournament"]["tournamentId"]);
    let owner = text(&made["owner_token"]);
    let start = format!("tournament start {id} --owner-token {owner}");
    run(&url, &start).well();
    let printed = objects_of(second);
    let [game, over] = printed.as_slice() else {
        panic!("expected one game and the end: {printed:?}");
    };
    assert_eq!(game["event"], "result");
    assert_eq!(over["event"], "over");
    assert_eq!(over["state"], "finished");
}

#[test]
fn only_its_owner_starts_and_closes_a_tournament() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let owner = path(folder.path(), "owner");
    let settings = "--name slow --format knockout --built-in random*4 --pace-ms 60000";
    let create = format!("tournament create {settings} --owner-file {owner}");
    let made = run(&url, &create);
    made.assert_says(&["chefshat tournament join --agent greedy --server"]);
    made.assert_says(&[&format!("--owner-file {owner}")]);
    let first = made.stdout.lines().next().unwrap();
    let id = first.strip_prefix("tournament   ").unwrap();
    let add = format!("tournament add {id} --name Ada --owner-file {owner}");
    run(&url, &add).assert_failed("NO_PHYSICAL_TABLES");
    let results = format!("tournament results {id}");
    let before = run(&url, &results);
    before.assert_says(&["nothing has been played yet", "Participants"]);

    let start = format!("tournament start {id} --json");
    let wrong = format!("{id}{}", "0".repeat(64));
    for (token, reason) in [
        ("nonsense", "SECRETS_REFUSED"),
        (&*wrong, "OWNER_TOKEN_WRONG"),
    ] {
        run(&url, &format!("{start} --owner-token {token}")).assert_failed(reason);
    }
    let begun = run(&url, &format!("{start} --owner-file {owner}")).json();
    assert_eq!(begun["tournament"]["state"], "TOURNAMENT_STATE_PLAYING");
    let table = format!("tournament table {id} 0 --owner-file {owner}");
    run(&url, &table).assert_failed("GAME_NOT_PHYSICAL");
    let mut join = Running::start(&url, "tournament join --agent random --code BCDF2345");
    let mut late = String::new();
    let stderr = join.0.stderr.as_mut().unwrap();
    stderr.read_to_string(&mut late).unwrap();
    assert!(late.contains("JOIN_CODE_WRONG"), "{late}");

    let follower = Running::start(&url, &format!("tournament follow {id}"));
    let closed = run(&url, &format!("tournament close {id} --owner-file {owner}"));
    assert_eq!(closed.stdout, format!("tournament {id} is closed\n"));
    let (code, lines) = follower.ended();
    assert_eq!(
        code,
        Some(1),
        "a closed tournament did not finish: {lines:?}"
    );
    run(&url, &results).assert_says(&["no game was counted"]);
    let listed = |state: &str| run(&url, &format!("tournament list --state {state}")).stdout;
    assert!(listed("closed").starts_with(id));
    assert_eq!(listed("open"), "no tournaments\n");
}

/// Joins a tournament as a participant that never connects. Returns its ticket.
fn ticket_of(url: &str, code: &str, name: &str) -> String {
    let request = v1::JoinTournamentRequest {
        join_code: code.to_owned(),
        name: name.to_owned(),
        ..v1::JoinTournamentRequest::default()
    };
    in_runtime(async {
        let client = Client::connect(url).await.unwrap();
        client.join_tournament(request).await.unwrap().ticket
    })
}

/// The participant with this name, as the results have it.
fn participant(url: &str, id: &str, name: &str) -> Value {
    let results = run(url, &format!("tournament results {id} --json")).json();
    let participants = results["tournament"]["participants"].as_array().unwrap();
    let found = participants.iter().find(|it| it["name"] == name);
    found
        .unwrap_or_else(|| panic!("{name}: {results}"))
        .to_owned()
}

/// The games of a tournament, in order.
fn games(url: &str, id: &str) -> Vec<Value> {
    let listed = run(url, &format!("tournament games {id} --json")).json_lines();
    listed.iter().map(|line| line["game"].clone()).collect()
}

/// Two games wait for the same absent participants, one is played at a time, and its first decision
/// takes a minute: what the organiser does is not overtaken by the games.
#[test]
fn an_organiser_changes_a_tournament_by_hand() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let owner = path(folder.path(), "owner");
    let settings = "--name friday --format round_robin --rounds 2 --built-in greedy*2";
    let slow = "--no-show-time-ms 3600000 --max-parallel-games 1 --pace-ms 60000";
    let create = format!("tournament create {settings} {slow} --owner-file {owner} --json");
    let made = run(&url, &create).json();
    let id = made["tournament"]["tournamentId"].as_str().unwrap();
    let code = made["join_code"].as_str().unwrap();
    let command = |words: &str| run(&url, &format!("tournament {words} --owner-file {owner}"));

    // Before the start, a place is free again.
    let cy = ticket_of(&url, code, "Cy");
    // A place is not a seat, and its games do not wait for an agent that cannot play them.
    let seat = run(&url, &format!("agent random --ticket {cy} --json"));
    assert_eq!(seat.code, Some(1), "{seat:?}");
    assert_eq!(seat.json()["reason"], "TICKET_OF_PARTICIPANT");
    let left = run(&url, &format!("tournament withdraw {id} --ticket {cy}"));
    assert_eq!(left.well().stdout, "participants  greedy 1, greedy 2\n");
    let [ada, _] = ["Ada", "Bo"].map(|name| ticket_of(&url, code, name));
    command(&format!("start {id}")).well();
    assert_eq!(participant(&url, id, "Cy")["withdrawn"], true);

    // The first game goes behind the second one, and then before it again.
    let postpone = format!("tournament postpone {id} 0 --ticket {ada} --json");
    let postponed = run(&url, &postpone).well().json();
    assert_eq!(postponed["event"], "postponed");
    assert_eq!(games(&url, id)[0]["postponed"], 1);
    let called = command(&format!("call {id} 0")).well();
    called.assert_says(&["   0  round 1 table 1 game 1  due      ", "Ada", "Bo"]);

    // While the tournament is paused, everybody who is absent leaves, and no game is called.
    let paused = command(&format!("pause {id}")).well();
    assert_eq!(paused.stdout, format!("tournament {id} is paused\n"));
    let listed = || run(&url, "tournament list --json").json();
    assert_eq!(listed()["paused"], true);
    command(&format!("remove {id} bo")).well();
    assert_eq!(participant(&url, id, "Bo")["withdrawn"], true);
    let replaced = command(&format!("replace {id} Ada --built-in random --name Robbie"));
    let names = "participants  greedy 1, greedy 2, Robbie\n";
    assert_eq!(replaced.well().stdout, names);
    let robbie = participant(&url, id, "Robbie");
    assert_eq!(robbie["builtInAgent"], "random", "{robbie}");
    assert_eq!(robbie["former"][0]["name"], "Ada", "{robbie}");
    let ticket_file = path(folder.path(), "dee");
    let replace = format!("replace {id} Bo --name Dee --ticket-file {ticket_file} --json");
    let replaced = command(&replace).well().json();
    let dee = std::fs::read_to_string(ticket_file).unwrap();
    assert_eq!(replaced["ticket"], dee.trim());
    // Its ticket is nowhere else if nobody reads what is printed.
    let ticket_file = path(folder.path(), "eve");
    let replace = format!("replace {id} Dee --name Eve --ticket-file {ticket_file}");
    typed_into_a_closed_pipe(&format!(
        "tournament {replace} --owner-file {owner} --server {url}"
    ));
    assert_ne!(std::fs::read_to_string(ticket_file).unwrap().trim(), "");
    // What is typed counts more than a variable.
    let withdraw = format!("tournament withdraw {id} --participant Eve --owner-file {owner}");
    let mut by_owner = program();
    by_owner.args(withdraw.split_whitespace());
    by_owner.args(["--json", "--server", &url]);
    let withdrawn = Ended::of(by_owner.env("CHEFSHAT_TICKET", ada).output().unwrap());
    assert_eq!(withdrawn.well().json()["event"], "withdrawn");
    assert_eq!(participant(&url, id, "Eve")["withdrawn"], true);
    let states = || -> Vec<Value> {
        let games = games(&url, id);
        games.iter().map(|game| game["state"].clone()).collect()
    };
    let [due, playing] = ["DUE", "PLAYING"].map(|it| format!("TOURNAMENT_GAME_STATE_{it}"));
    assert_eq!(states(), [due.as_str(), &due]);

    let resumed = command(&format!("resume {id}")).well();
    assert_eq!(resumed.stdout, format!("tournament {id} is playing\n"));
    assert_ne!(listed()["paused"], true);
    until("the game that was called", || {
        states() == [playing.as_str(), &due]
    });
    command(&format!("call {id} 0")).assert_failed("GAME_NOT_DUE");
}

#[test]
fn a_name_means_the_participant_that_has_not_withdrawn() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let owner = path(folder.path(), "owner");
    let settings = "--name friday --format round_robin --rounds 1 --built-in greedy*2";
    let create = format!("tournament create {settings} --no-show-time-ms 3600000");
    let made = run(&url, &format!("{create} --owner-file {owner} --json")).json();
    let id = made["tournament"]["tournamentId"].as_str().unwrap();
    let code = made["join_code"].as_str().unwrap();
    let command = |words: &str| {
        let ended = run(&url, &format!("tournament {words} --owner-file {owner}"));
        ended.well().stdout
    };
    let rest = "participants  greedy 1, greedy 2\n";
    ticket_of(&url, code, "Ada");
    assert_eq!(command(&format!("withdraw {id} --participant Ada")), rest);
    ticket_of(&url, code, "Ada");
    assert_eq!(command(&format!("remove {id} Ada")), rest);
    for name in ["Ada", "Bo"] {
        ticket_of(&url, code, name);
    }
    command(&format!("start {id}"));
    let replaced = command(&format!("replace {id} Ada --built-in random --name Cy"));
    assert_eq!(replaced, "participants  greedy 1, greedy 2, Cy, Bo\n");
}

#[test]
fn invalid_tournament_options_are_reported_by_flag() {
    let folder = TempDir::new().unwrap();
    let (_server, url) = serve(folder.path());
    let nowhere = path(folder.path(), "nowhere/code");
    for (flags, words) in [
        ("--rounds 5000", "--rounds: "),
        ("--start-when 1", "--start-when: "),
        ("--built-in nobody", "--built-in"),
        ("--decision-time-ms 1", "--decision-time-ms: "),
        ("--clock human:1", "--clock: "),
        ("--faces 3", "--faces: "),
        ("--target-shifts 1000000", "--target-shifts: "),
        ("--physical-tables 65", "--physical-tables: "),
        ("--physical-tables 1 --deals same", "--physical-tables: "),
        (
            "--physical-tables 1 --opening any_top_face",
            "a physical table needs the opening with the Golden card",
        ),
        (&format!("--code-file {nowhere}"), "--code-file: "),
    ] {
        let create = format!("tournament create --name x --format swiss {flags}");
        run(&url, &create).assert_refused(words);
    }
    assert_eq!(run(&url, "tournament list").stdout, "no tournaments\n");
    run(&url, "tournament results nonsense").assert_failed("TOURNAMENT_UNKNOWN");
}
