//! The program works and the server bears the attacks: a few of them with tiny counts. Asserts
//! facts, never times.

use std::process::Command;

use chefshat_tests::set_up;
use serde_json::Value;

/// Runs attacks with small counts and returns their rows.
fn attacked(attacks: &[&str]) -> Vec<Value> {
    attacked_with(attacks, "50")
}

/// Runs attacks whose counts are divided by a number.
fn attacked_with(attacks: &[&str], divide: &str) -> Vec<Value> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_chefshat-hostile"));
    command.arg("--server").arg(set_up("CHEFSHAT_BIN"));
    command.args(["--json", "--quiet", "1", "--seconds", "2", "--rest", "0"]);
    command.args(["--divide", divide]);
    for attack in attacks {
        command.args(["--attack", attack]);
    }
    let output = command.output().expect("the program can be started");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Value = serde_json::from_slice(&output.stdout).expect("a JSON document");
    let rows = report["attacks"].as_array().expect("a list").clone();
    assert_eq!(rows.len(), attacks.len(), "{report:#}");
    rows
}

#[test]
fn honest_games_end_while_the_server_is_attacked() {
    for row in attacked(&["built-in-tournament", "silent-play-streams", "ping-flood"]) {
        assert_eq!(row["missed"], 0, "{row:#}");
        assert_eq!(row["lost_games"], 0, "{row:#}");
        assert_eq!(row["last_game_ended"], true, "{row:#}");
        assert!(row["tried"].as_u64() > Some(0), "{row:#}");
        assert!(row["games"].as_u64() > Some(0), "{row:#}");
    }
}

#[test]
fn what_one_client_may_not_take_is_refused_and_others_are_served() {
    for (attack, reason) in [
        ("idle-vector-streams", "TOO_MANY_VECTOR_STREAMS"),
        ("waiting-tournaments", "TOO_MANY_TOURNAMENTS"),
    ] {
        let row = &attacked_with(&[attack], "1")[0];
        assert!(row["reasons"][reason].as_u64() > Some(0), "{row:#}");
        let others = &row["others"];
        assert_eq!(others["served"], others["tried"], "{row:#}");
        assert_eq!(row["missed"], 0, "{row:#}");
        assert_eq!(row["last_game_ended"], true, "{row:#}");
    }
}

/// Runs a scenario and returns its report.
fn scenario(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_chefshat-hostile"))
        .arg("--server")
        .arg(set_up("CHEFSHAT_BIN"))
        .arg("--json")
        .args(arguments)
        .output()
        .expect("the program can be started");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    serde_json::from_slice(&output.stdout).expect("a JSON document")
}

#[test]
fn idle_connections_are_counted_and_stay() {
    let report = scenario(&["idle", "--connections", "20", "--seconds", "1"]);
    assert_eq!(report["connections"], 20, "{report:#}");
    assert_eq!(report["served_again"], 20, "{report:#}");
}

#[test]
fn spectators_that_do_not_read_are_admitted_and_players_miss_nothing() {
    let report = scenario(&[
        "spectators",
        "--spectators",
        "20",
        "--rooms",
        "2",
        "--rounds",
        "1",
        "--seconds",
        "1",
    ]);
    assert_eq!(report["tried"], 20, "{report:#}");
    assert_eq!(report["granted"], 20, "{report:#}");
    assert_eq!(report["missed"], 0, "{report:#}");
    assert!(report["watched_p99_ms"].as_f64() > Some(0.0), "{report:#}");
}

#[test]
fn rooms_of_a_soak_start_and_end() {
    let report = scenario(&["soak", "--seconds", "3", "--settle", "1", "--rooms", "2"]);
    assert!(report["games"].as_u64() > Some(0), "{report:#}");
    assert_eq!(report["lost_games"], 0, "{report:#}");
    assert_eq!(report["missed"], 0, "{report:#}");
    assert!(
        report["samples"]
            .as_array()
            .is_some_and(|samples| samples.len() > 100),
        "{report:#}"
    );
    assert!(report["mib_per_hour"].is_number(), "{report:#}");
}

#[test]
fn an_unknown_attack_is_refused_with_advice() {
    let output = Command::new(env!("CARGO_BIN_EXE_chefshat-hostile"))
        .args(["--attack", "kindness"])
        .output()
        .expect("the program can be started");
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("--list"));
}
