//! The load program works: a short run of one room, with its internal checks, and a valid report.
//! Does not depend on the speed of the machine.

use std::process::Command;

use serde_json::Value;

fn run(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_chefshat-load"))
        .args(arguments)
        .output()
        .expect("the load program can be started")
}

#[test]
fn a_moment_of_load_is_counted_on_both_sides() {
    let output = run(&["--smoke", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let scenario = &report["scenarios"][0];
    assert_eq!(scenario["seats"], 4, "{report:#}");
    for path in [
        "/server/decisions_per_second",
        "/server/decisions_in_windows",
        "/other/decisions_per_second",
        "/other/decisions_in_windows",
        "/throughput_ratio/median",
        "/bytes_per_decision/request",
        "/bytes_per_decision/response",
        "/checked/games",
        "/checked/shifts",
        "/other_answers",
    ] {
        let figure = scenario.pointer(path).and_then(Value::as_f64);
        assert!(
            figure.is_some_and(|figure| figure > 0.0),
            "{path}: {report:#}"
        );
    }
    let checked = &scenario["checked"];
    assert_eq!(checked["answers"], checked["accepted"]);
    assert_eq!(checked["turn_answers"], checked["turn_events"]);
}

#[test]
#[ignore = "long"]
fn two_builds_are_measured_beside_the_same_bare_room_at_several_scales() {
    let program = env!("CARGO_BIN_EXE_chefshat-load");
    let output = run(&["--smoke", "--scale", "--against", program, "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["pinned"], true, "{report:#}");
    let scenarios = report["scenarios"].as_array().unwrap();
    let connections = scenarios.iter().map(|scenario| &scenario["connections"]);
    assert!(connections.eq([4, 8].iter()), "{report:#}");
    for scenario in scenarios {
        for path in [
            "/throughput_ratio/median",
            "/server_cpu_ratio/median",
            "/other_build/throughput_ratio/median",
            "/other_build/server_cpu_ratio/median",
            "/other_build/server/decisions_in_windows",
        ] {
            let figure = scenario.pointer(path);
            assert!(figure.is_some_and(positive), "{path}: {report:#}");
        }
    }
}

#[test]
fn a_scenario_that_fails_is_named_in_the_report() {
    let output = run(&["--server", "http://127.0.0.1:1", "--rooms", "1", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(
        errors.contains("not measured to the end: 1 room"),
        "{errors}"
    );
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["scenarios"], serde_json::json!([]), "{report:#}");
    let failed = report["failed"][0].as_str().unwrap();
    assert!(failed.contains("the connection failed"), "{failed}");
}

#[test]
#[ignore = "long"]
fn durable_rooms_are_measured_beside_ephemeral_ones() {
    let output = run(&["--smoke", "--durability", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let scenario = &report["scenarios"][0];
    assert_eq!(scenario["beside"], "ephemeral rooms", "{report:#}");
    assert!(positive(&report["disk_syncs_per_second"]), "{report:#}");
    assert!(positive(&scenario["checked"]["games"]), "{report:#}");
    assert!(positive(&scenario["other_answers"]), "{report:#}");
    assert!(
        positive(&scenario["throughput_ratio"]["median"]),
        "{report:#}"
    );
}

#[test]
fn a_restart_is_timed_and_its_games_are_played_on() {
    let output = run(&["--smoke", "--restart", "5", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["rooms"], 5, "{report:#}");
    let times = &report["restarts"][0];
    let order = ["open_s", "first_decision_s", "playable_s", "played_s"];
    let times = order.map(|name| times[name].as_f64().unwrap_or_default());
    assert!(times[0] > 0.0 && times.is_sorted(), "{report:#}");
}

fn positive(value: &Value) -> bool {
    value.as_f64().is_some_and(|value| value > 0.0)
}

#[test]
#[ignore = "long"]
fn games_of_a_client_are_stepped_and_counted() {
    let output = run(&["--smoke", "--vector", "--json"]);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let scenarios = report["scenarios"].as_array().unwrap();
    assert_eq!(scenarios.len(), 9, "{report:#}");
    for scenario in scenarios {
        assert!(positive(&scenario["decisions"]), "{report:#}");
        assert!(positive(&scenario["bytes_per_decision"]), "{report:#}");
    }
}

#[test]
fn a_server_that_is_not_there_is_an_error() {
    // Listening on port 1 needs privileges, so no server is there.
    let output = run(&["--server", "http://127.0.0.1:1", "--smoke"]);
    assert!(!output.status.success());
    let [printed, errors] =
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(
        printed.starts_with("not measured to the end: 1 room"),
        "{printed}"
    );
    assert!(errors.contains("connection failed"), "{errors}");
}
