//! Allowed dependencies between the crates of the workspace. Cargo refuses circles between crates;
//! this check refuses every dependency that is not in the table below, so that no lower crate
//! starts to depend on a higher one.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::command::{self, cargo};
use crate::failure::Failure;
use crate::places::Places;

/// For each crate, the crates of the workspace that it may depend on. ARCHITECTURE.md explains the
/// map.
const ALLOWED: &[(&str, &[&str])] = &[
    ("chefshat-engine", &[]),
    ("chefshat-proto", &[]),
    ("chefshat-agents", &["chefshat-engine"]),
    ("chefshat-search", &["chefshat-engine", "chefshat-agents"]),
    ("chefshat-referee", &["chefshat-engine"]),
    ("chefshat-cluster", &[]),
    ("chefshat-study", &[]),
    (
        "chefshat-tournament",
        &["chefshat-engine", "chefshat-agents"],
    ),
    (
        "chefshat-simulation",
        &[
            "chefshat-engine",
            "chefshat-agents",
            "chefshat-search",
            "chefshat-tournament",
        ],
    ),
    (
        "chefshat-record",
        &["chefshat-engine", "chefshat-proto", "chefshat-referee"],
    ),
    (
        "chefshat-dataset",
        &["chefshat-engine", "chefshat-proto", "chefshat-record"],
    ),
    (
        "chefshat-render",
        &["chefshat-engine", "chefshat-proto", "chefshat-record"],
    ),
    (
        "chefshat-room",
        &["chefshat-engine", "chefshat-agents", "chefshat-referee"],
    ),
    (
        "chefshat-benchmark",
        &[
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-search",
            "chefshat-tournament",
            "chefshat-simulation",
            "chefshat-record",
        ],
    ),
    (
        "chefshat-vector",
        &[
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-simulation",
            "chefshat-record",
        ],
    ),
    ("chefshat-base", &["chefshat-room"]),
    (
        "chefshat-admission",
        &[
            "chefshat-base",
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-search",
            "chefshat-record",
            "chefshat-room",
        ],
    ),
    (
        "chefshat-wire",
        &[
            "chefshat-base",
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-referee",
            "chefshat-tournament",
            "chefshat-record",
            "chefshat-room",
            "chefshat-study",
        ],
    ),
    (
        "chefshat-store",
        &[
            "chefshat-base",
            "chefshat-wire",
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-tournament",
            "chefshat-record",
            "chefshat-room",
            "chefshat-cluster",
            "chefshat-study",
        ],
    ),
    (
        "chefshat-hosting",
        &[
            "chefshat-base",
            "chefshat-wire",
            "chefshat-store",
            "chefshat-admission",
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-tournament",
            "chefshat-record",
            "chefshat-room",
            "chefshat-vector",
            "chefshat-cluster",
            "chefshat-study",
        ],
    ),
    (
        "chefshat-gateway",
        &[
            "chefshat-base",
            "chefshat-wire",
            "chefshat-store",
            "chefshat-admission",
            "chefshat-hosting",
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-search",
            "chefshat-referee",
            "chefshat-tournament",
            "chefshat-simulation",
            "chefshat-record",
            "chefshat-room",
            "chefshat-vector",
            "chefshat-study",
        ],
    ),
    (
        "chefshat-server",
        &[
            "chefshat-base",
            "chefshat-wire",
            "chefshat-store",
            "chefshat-admission",
            "chefshat-hosting",
            "chefshat-gateway",
            "chefshat-proto",
        ],
    ),
    ("chefshat-client", &["chefshat-proto"]),
    (
        "chefshat-native",
        &[
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-search",
            "chefshat-simulation",
            "chefshat-record",
            "chefshat-vector",
        ],
    ),
    (
        "chefshat-examiner",
        &[
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-agents",
            "chefshat-record",
            "chefshat-server",
            "chefshat-client",
        ],
    ),
    // What only some users need, and takes long to build, belongs to chefshat-lab.
    (
        "chefshat",
        &[
            "chefshat-agents",
            "chefshat-client",
            "chefshat-engine",
            "chefshat-proto",
            "chefshat-record",
            "chefshat-room",
            "chefshat-search",
            "chefshat-server",
            "chefshat-simulation",
            "chefshat-study",
            "chefshat-tournament",
        ],
    ),
    ("chefshat-lab", &["*"]),
    ("chefshat-tests", &["*"]),
    (
        "chefshat-hostile",
        &[
            "chefshat-proto",
            "chefshat-client",
            "chefshat-postgres",
            "chefshat-tests",
        ],
    ),
    (
        "chefshat-load",
        &["chefshat-proto", "chefshat-client", "chefshat-server"],
    ),
    ("chefshat-postgres", &[]),
    ("xtask", &[]),
];

/// Crates that the tests of a crate may depend on besides [`ALLOWED`] and, for its test features,
/// itself.
const ALLOWED_IN_TESTS: &[(&str, &[&str])] = &[
    ("chefshat-wire", &["chefshat-vector"]),
    ("chefshat-store", &["chefshat-agents", "chefshat-postgres"]),
    (
        "chefshat-server",
        &["chefshat-engine", "chefshat-record", "chefshat-room"],
    ),
];

/// Refuses dependencies between crates of the workspace that the tables do not allow.
pub(crate) fn check(places: &Places) -> Result<(), Failure> {
    let metadata = metadata(places)?;
    let problems = problems(&metadata, ALLOWED, ALLOWED_IN_TESTS);
    if problems.is_empty() {
        return Ok(());
    }
    Err(Failure::new(format!(
        "\n{}\nMove the shared value to the lower crate; ARCHITECTURE.md has the map.",
        problems.join("\n")
    )))
}

/// The output of `cargo metadata` for the crates of the workspace.
pub(crate) fn metadata(places: &Places) -> Result<Value, Failure> {
    let arguments = ["metadata", "--no-deps", "--format-version", "1"];
    let text = command::read(cargo().current_dir(&places.root).args(arguments))?;
    serde_json::from_str(&text).map_err(|error| Failure::new(format!("cargo metadata: {error}")))
}

type Table<'a> = &'a [(&'a str, &'a [&'a str])];

/// A line for each dependency that is not allowed and for each crate without a row.
fn problems(metadata: &Value, allowed: Table<'_>, in_tests: Table<'_>) -> Vec<String> {
    let allowed: BTreeMap<_, _> = allowed.iter().copied().collect();
    let in_tests: BTreeMap<_, _> = in_tests.iter().copied().collect();
    let packages = metadata["packages"].as_array();
    let packages: Vec<(&str, &Value)> = (packages.into_iter().flatten())
        .filter_map(|package| Some((package["name"].as_str()?, package)))
        .collect();
    let mut problems = Vec::new();
    for (name, package) in &packages {
        let Some(row) = allowed.get(name) else {
            problems.push(format!("{name} has no row in tests/xtask/src/arrows.rs"));
            continue;
        };
        let dependencies = package["dependencies"].as_array();
        for dependency in dependencies.into_iter().flatten() {
            let Some(other) = dependency["name"].as_str() else {
                continue;
            };
            if !packages.iter().any(|(name, _)| *name == other) {
                continue;
            }
            let kind = dependency["kind"].as_str().unwrap_or("normal");
            let may = |row: &[&str]| row.contains(&other) || row.contains(&"*");
            let is_allowed = match kind {
                "dev" => {
                    other == *name || may(row) || in_tests.get(name).is_some_and(|row| may(row))
                }
                _ => may(row),
            };
            if !is_allowed {
                problems.push(format!(
                    "{name} must not depend on {other} ({kind} dependency)"
                ));
            }
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    const TABLE: Table<'_> = &[("low", &[]), ("high", &["low"]), ("top", &["*"])];

    fn workspace(low: &Value, high: &Value) -> Value {
        json!({ "packages": [
            { "name": "low", "dependencies": low },
            { "name": "high", "dependencies": high },
            { "name": "top", "dependencies": [{ "name": "high", "kind": null }] },
        ]})
    }

    #[test]
    fn the_workspace_has_only_allowed_arrows() {
        check(&Places::find().unwrap()).unwrap();
    }

    #[test]
    fn a_dependency_on_a_higher_crate_is_refused() {
        let serde = json!({ "name": "serde", "kind": null });
        let down = json!([{ "name": "low", "kind": null }, serde]);
        let up = |kind: Value| json!([{ "name": "high", "kind": kind }]);

        let none: [String; 0] = [];
        assert_eq!(problems(&workspace(&json!([]), &down), TABLE, &[]), none);
        assert_eq!(
            problems(&workspace(&up(Value::Null), &json!([])), TABLE, &[]),
            ["low must not depend on high (normal dependency)"]
        );
        assert_eq!(
            problems(&workspace(&up(json!("build")), &json!([])), TABLE, &[]),
            ["low must not depend on high (build dependency)"]
        );
    }

    #[test]
    fn tests_may_use_only_what_their_own_list_names() {
        let up = json!([{ "name": "high", "kind": "dev" }]);
        let metadata = workspace(&up, &json!([]));
        assert_eq!(
            problems(&metadata, TABLE, &[]),
            ["low must not depend on high (dev dependency)"]
        );
        let itself = json!([{ "name": "low", "kind": "dev" }]);
        assert!(problems(&workspace(&itself, &json!([])), TABLE, &[]).is_empty());
        let in_tests: Table<'_> = &[("low", &["high"])];
        assert!(problems(&metadata, TABLE, in_tests).is_empty());
        let normal = workspace(&json!([{ "name": "high", "kind": null }]), &json!([]));
        assert_eq!(problems(&normal, TABLE, in_tests).len(), 1);
    }

    #[test]
    fn a_new_crate_needs_a_row() {
        let metadata = json!({ "packages": [{ "name": "new", "dependencies": [] }] });
        assert_eq!(
            problems(&metadata, TABLE, &[]),
            ["new has no row in tests/xtask/src/arrows.rs"]
        );
    }
}
