//! What stops the server in the examples of `docker/` waits for longer than a shutdown takes.

use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;

use crate::config::{ServerConfig, longest_shutdown};

/// Settings of what stops the server, in seconds.
const WAITS: [&str; 3] = [
    "stop_grace_period:",
    "terminationGracePeriodSeconds:",
    "TimeoutStopSec=",
];

/// What follows the seconds by which a shutdown may be longer than the grace.
const LONGER: [&str; 2] = [" s longer than --grace", " s more than CHEFSHAT_GRACE"];

/// The files that run a server.
const EXAMPLES: [&str; 5] = [
    "compose.cluster.yaml",
    "compose.yaml",
    "kubernetes/chefshat.yaml",
    "kubernetes/cluster.yaml",
    "systemd/chefshat.service",
];

/// The times in a file.
fn waits(text: &str) -> Vec<Duration> {
    let lines = text.lines().map(str::trim);
    let values = lines.filter_map(|line| WAITS.iter().find_map(|name| line.strip_prefix(name)));
    let seconds = values.map(|value| value.trim().trim_end_matches('s').parse());
    seconds
        .map(|seconds| Duration::from_secs(seconds.expect("seconds")))
        .collect()
}

/// The seconds by which a shutdown may be longer than the grace, in sentences.
fn said(text: &str) -> Vec<u64> {
    let found = LONGER.iter().flat_map(|words| text.match_indices(words));
    let seconds = found.map(|(at, _)| text[..at].rsplit(' ').next().unwrap_or_default().parse());
    seconds.map(|seconds| seconds.expect("seconds")).collect()
}

fn search(folder: &Path, root: &Path, found: &mut BTreeSet<String>) {
    let grace = ServerConfig::default().grace;
    let longest = longest_shutdown(grace);
    for entry in std::fs::read_dir(folder).expect("it exists") {
        let path = entry.expect("readable").path();
        if path.is_dir() {
            search(&path, root, found);
            continue;
        }
        // Pictures are no examples.
        let Ok(text) = std::fs::read_to_string(&path) else {
            continue;
        };
        let name = path
            .strip_prefix(root)
            .expect("below it")
            .display()
            .to_string();
        let (waits, starts) = (
            waits(&text),
            text.contains("CHEFSHAT_GRACE: ") || text.contains("name: CHEFSHAT_GRACE"),
        );
        assert!(
            !starts || !waits.is_empty(),
            "{name} does not say how long a shutdown may take"
        );
        for wait in &waits {
            assert!(
                *wait > longest,
                "{name}: {wait:?}, but a shutdown takes {longest:?}"
            );
        }
        for seconds in said(&text) {
            let longer = (longest - grace).as_secs();
            assert_eq!(seconds, longer, "{name}");
        }
        if !waits.is_empty() {
            found.insert(name);
        }
    }
}

#[test]
fn what_stops_a_server_waits_for_longer_than_a_shutdown_takes() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docker");
    let mut found = BTreeSet::new();
    search(&root, &root, &mut found);
    let known: BTreeSet<String> = EXAMPLES.map(str::to_owned).into();
    assert_eq!(found, known);
}
