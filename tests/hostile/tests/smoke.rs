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

#[test]
fn an_unknown_attack_is_refused_with_advice() {
    let output = Command::new(env!("CARGO_BIN_EXE_chefshat-hostile"))
        .args(["--attack", "kindness"])
        .output()
        .expect("the program can be started");
    assert!(!output.status.success());
    assert!(String::from_utf8_lossy(&output.stderr).contains("--list"));
}
