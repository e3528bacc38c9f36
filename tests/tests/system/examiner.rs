//! The examiner passes good agents in all languages, and names the faults of bad ones.

use std::path::Path;
use std::process::Stdio;

use chefshat_tests::{patiently, set_up};
use futures::future::join_all;
use futures::{StreamExt as _, stream};
use serde_json::Value;
use tokio::process::Command;

/// Concurrent examinations; they mostly wait.
const AT_A_TIME: usize = 8;
/// Patience for a good agent in seconds, even on a busy machine.
const PATIENCE: &str = "30";

/// The result of an examination.
struct Examined {
    passed: bool,
    cases: Vec<Value>,
    said: String,
}

impl Examined {
    /// The codes of all faults, in the order in which they were found.
    fn codes(&self) -> Vec<&str> {
        self.cases
            .iter()
            .flat_map(|case| case["faults"].as_array().expect("a list"))
            .map(|fault| fault["code"].as_str().expect("a code"))
            .collect()
    }
}

async fn examine(options: &[&str], agent: &[&str], folder: Option<&Path>) -> Examined {
    let mut command = Command::new(set_up("CHEFSHAT_BIN"));
    command.args(["check-agent", "--json"]).args(options);
    command.arg("--").args(agent);
    if let Some(folder) = folder {
        command.current_dir(folder);
    }
    let output = command.stdin(Stdio::null()).kill_on_drop(true).output();
    let output = patiently("the examination", output)
        .await
        .expect("the binary starts");
    let text = String::from_utf8(output.stdout).expect("text");
    let said = format!("{text}{}", String::from_utf8_lossy(&output.stderr));
    let lines = text
        .lines()
        .map(|line| serde_json::from_str(line).expect(line));
    let mut cases: Vec<Value> = lines.collect();
    let summary = cases.pop().unwrap_or_else(|| panic!("no summary: {said}"));
    assert_eq!(summary["event"], "summary", "{said}");
    let passed = output.status.success();
    assert_eq!(summary["ok"], passed, "{said}");
    assert_eq!(summary["played"], cases.len(), "{said}");
    Examined {
        passed,
        cases,
        said,
    }
}

/// Checks that all cases pass. `many`: the command line for tournaments.
async fn passes(agent: &[&str], many: &str, folder: Option<&Path>) {
    let options = ["--patience", PATIENCE, "--start", PATIENCE, "--many", many];
    let examined = examine(&options, agent, folder).await;
    assert!(examined.passed, "{}", examined.said);
    assert_eq!(examined.cases.len(), 12, "{}", examined.said);
    for case in &examined.cases {
        assert_eq!(case["passed"], true, "{}", examined.said);
    }
}

async fn the_examples_of_the_rust_sdk_pass() {
    let examples = set_up("CHEFSHAT_BIN").with_file_name("examples");
    let example = examples.join("random_agent");
    let example = example.to_str().expect("text");
    let many = examples.join("tournament_agent");
    let many = format!("exec '{}' {{tournament}} {{name}} {{url}}", many.display());
    passes(&[example, "{code}", "{url}"], &many, None).await;
}

async fn the_built_in_agents_pass() {
    let binary = set_up("CHEFSHAT_BIN");
    let binary = binary.to_str().expect("text");
    let agent = [binary, "agent", "greedy", "--server", "{url}"];
    let agent = [&agent[..], &["--code", "{code}"]].concat();
    let many = format!(
        "exec '{binary}' tournament join --agent greedy --name {{name}} --server {{url}} --code {{tournament}} --games 8"
    );
    passes(&agent, &many, None).await;
}

async fn the_agent_of_the_python_package_passes() {
    let python = set_up("CHEFSHAT_PYTHON");
    let python = python.to_str().expect("text");
    let agent = [python, "-m", "chefshat.agent", "--address", "{address}"];
    let agent = [&agent[..], &["--code", "{code}", "--name", "{name}"]].concat();
    let many = format!(
        "exec '{python}' -m chefshat.agent --address {{address}} --tournament {{tournament}} --name {{name}} --games 8"
    );
    passes(&agent, &many, None).await;
}

async fn the_agent_in_javascript_passes() {
    let agent = ["node", "agent.js", "--address", "{address}"];
    let agent = [&agent[..], &["--code", "{code}", "--name", "{name}"]].concat();
    let many = "exec node agent.js --address {address} --tournament {tournament} --games 8";
    passes(&agent, many, Some(&set_up("CHEFSHAT_NODE_DIR"))).await;
}

async fn the_agent_in_cpp_passes() {
    let agent = set_up("CHEFSHAT_CPP_AGENT");
    let agent = agent.to_str().expect("text");
    let many = format!(
        "exec '{agent}' --address {{address}} --tournament {{tournament}} --name {{name}} --games 8"
    );
    let agent = [agent, "--address", "{address}", "--code", "{code}"];
    passes(&agent, &many, None).await;
}

/// The agent without an SDK: with a fault or without, in a room or in a tournament.
const BAD_AGENT: &str = env!("CARGO_BIN_EXE_bad_agent");

fn in_a_tournament(fault: &str) -> String {
    format!("exec '{BAD_AGENT}' {fault} {{address}} {{tournament}} here")
}

async fn an_agent_without_an_sdk_passes() {
    let agent = [BAD_AGENT, "none", "{address}", "{code}"];
    passes(&agent, &in_a_tournament("none"), None).await;
}

/// All at the same time, because they mostly wait.
#[tokio::test]
async fn good_agents_of_all_languages_pass() {
    tokio::join!(
        the_examples_of_the_rust_sdk_pass(),
        the_built_in_agents_pass(),
        the_agent_of_the_python_package_passes(),
        the_agent_in_javascript_passes(),
        the_agent_in_cpp_passes(),
        an_agent_without_an_sdk_passes(),
    );
}

/// Agents with a fault, the case in which it shows, and the code that must be reported first.
const FAULTY: [(&str, &str, &str); 33] = [
    ("never-joins", "game", "NEVER_JOINED"),
    ("wrong-code", "game", "JOIN_REFUSED"),
    ("never-attaches", "game", "NEVER_ATTACHED"),
    ("wrong-ticket", "game", "ATTACH_REFUSED"),
    ("uses-act", "game", "NO_PLAY_STREAM"),
    ("silent", "game", "NOT_ANSWERED"),
    ("always-illegal", "game", "ILLEGAL_ACTION"),
    ("ignores-mask", "game", "ILLEGAL_ACTION"),
    ("answers-twice", "game", "ANSWERED_TWICE"),
    ("wrong-decision", "game", "ANSWERED_UNASKED"),
    ("unasked", "game", "ANSWERED_UNASKED"),
    ("wrong-handle", "game", "HANDLE_UNKNOWN"),
    ("floods", "game", "FLOODING"),
    ("large-annotations", "game", "ANNOTATIONS_DROPPED"),
    ("large-message", "game", "MESSAGE_REFUSED"),
    ("bad-expression", "game", "COMMAND_REFUSED"),
    ("detaches", "game", "LEFT_EARLY"),
    ("one-shift", "game", "EXITED_EARLY"),
    ("never-leaves", "game", "NEVER_LEFT"),
    ("never-exits", "game", "NEVER_EXITED"),
    ("exit-status", "game", "EXIT_STATUS"),
    ("always-passes", "small", "ACTION_OUT_OF_SPACE"),
    ("two-hundred", "large", "ILLEGAL_ACTION"),
    ("too-slow", "deadlines", "TOO_SLOW"),
    ("exits-when-refused", "refusal", "GAVE_UP_WHEN_REFUSED"),
    ("ignores-refusal", "refusal", "GAVE_UP_WHEN_REFUSED"),
    ("no-reconnect", "disconnect", "DID_NOT_RECONNECT"),
    ("no-reconnect", "restart", "DID_NOT_RECONNECT"),
    ("joins-again", "disconnect", "JOINED_AGAIN"),
    ("skips-events", "disconnect", "EVENTS_SKIPPED"),
    ("stale-forever", "stale", "REPEATED_AFTER_CLOSED"),
    ("stops-when-late", "stale", "STOPPED_AFTER_CLOSED"),
    ("never-resumes", "substitution", "NEVER_RESUMED"),
];

#[tokio::test]
async fn every_fault_is_named() {
    let examined = stream::iter(FAULTY)
        .map(|(fault, case, code)| async move {
            let agent = [BAD_AGENT, fault, "{address}", "{code}"];
            // Agents that join have the default time for it.
            let start = if fault == "never-joins" { "1" } else { "30" };
            let options = ["--start", start, "--only", case];
            (fault, code, examine(&options, &agent, None).await)
        })
        .buffer_unordered(AT_A_TIME)
        .collect::<Vec<_>>()
        .await;
    let wrong: Vec<String> = examined
        .iter()
        .filter(|(_, code, examined)| examined.passed || examined.codes().first() != Some(code))
        .map(|(fault, code, examined)| format!("{fault} is not {code}: {}", examined.said))
        .collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Runs the many-seats case with the agent that has this fault.
async fn examine_in_a_tournament(fault: &str) -> Examined {
    examine(&["--many", &in_a_tournament(fault)], &[], None).await
}

#[tokio::test]
async fn faults_with_many_seats_are_named() {
    let table = [
        ("one-at-a-time", "ONE_AT_A_TIME"),
        ("own-handles", "NOT_ANSWERED"),
        ("never-leaves", "NEVER_LEFT"),
    ];
    let examined = table.map(|(fault, _)| examine_in_a_tournament(fault));
    for ((fault, code), examined) in table.into_iter().zip(join_all(examined).await) {
        assert_eq!(examined.cases.len(), 1, "{}", examined.said);
        assert_eq!(examined.cases[0]["case"], "many-seats");
        let codes = examined.codes();
        assert_eq!(codes, [code], "{fault}: {}", examined.said);
    }
}

#[tokio::test]
async fn an_examination_without_an_agent_says_so() {
    let nothing = ["/nowhere/agent", "{address}", "{code}"];
    let examined = examine(&[], &nothing, None).await;
    assert_eq!(examined.codes(), ["COMMAND_FAILED"], "{}", examined.said);
}
