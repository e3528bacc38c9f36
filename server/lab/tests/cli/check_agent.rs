//! `chefshat check-agent`: the list of cases, the report, and commands that cannot be examined. The
//! faults of agents are tested with the whole system.

use serde_json::Value;

use super::run::{chefshat, typed};

const PROGRAM: &str = env!("CARGO_BIN_EXE_chefshat-lab");

#[test]
fn the_cases_are_listed() {
    let listed = typed("check-agent --list").well();
    listed.assert_table_fits(9);
    let json = typed("check-agent --list --json").well().stdout;
    for (line, text) in json.lines().zip(listed.stdout.lines()) {
        let case: Value = serde_json::from_str(line).unwrap();
        assert!(text.starts_with(case["case"].as_str().unwrap()));
    }
    assert_eq!(json.lines().count(), listed.stdout.lines().count());
}

#[test]
fn a_report_has_the_expectation_the_fault_and_the_advice() {
    let agent = ["sh", "-c", "echo $0 {address}; exit 3", "{code}"];
    let arguments = ["check-agent", "--only", "game", "--"];
    let ended = chefshat(&[&arguments[..], &agent[..]].concat());
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    // Long sentences are not wrapped, and there are no colours outside a terminal.
    assert!(ended.stdout.lines().count() > 6, "{}", ended.stdout);
    assert!(!ended.stdout.contains('\x1b'), "{}", ended.stdout);
    for part in [
        "FAULT game ",
        "NEVER_JOINED",
        "expected: ",
        "its process exited: exit status: 3",
        "to do: ",
        " 127.0.0.1:",
        "0 of 1 cases passed",
    ] {
        ended.assert_says(&[part]);
    }
}

#[test]
fn an_agent_that_once_does_not_join_is_examined_in_the_other_cases() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    let script = format!(
        "echo >> {0}; [ $(wc -l < {0}) = 2 ] || exec {PROGRAM} agent greedy --server http://$0 --code $1",
        runs.display()
    );
    let agent = ["sh", "-c", &script, "{address}", "{code}"];
    let arguments = "check-agent --json --only game --only small --only original --";
    let arguments: Vec<&str> = arguments.split_whitespace().collect();
    let ended = chefshat(&[&arguments[..], &agent[..]].concat());
    assert_eq!(ended.code, Some(1), "{}", ended.stderr);
    let lines = ended.json_lines();
    let summary = lines.iter().find(|line| line["event"] == "summary");
    let summary = summary.expect("it is printed");
    assert_eq!(
        (&summary["played"], &summary["passed"]),
        (&3.into(), &2.into())
    );
}

#[test]
fn commands_that_cannot_be_examined_are_refused() {
    for (flags, expected) in [
        ("-- agent --server {address}", "{code}"),
        ("-- agent --code {code}", "{address}"),
        ("--many agent -- agent {address} {code}", "{tournament}"),
        ("--only many-seats -- agent {address} {code}", "--many"),
        ("--only nothing", "use one of game, "),
        ("--patience 0 -- agent {address} {code}", "0.1 to 3600"),
    ] {
        typed(&format!("check-agent {flags}")).assert_refused(expected);
    }
    typed("check-agent --help").assert_helps("check-agent -- python agent.py --server {address}");
}
