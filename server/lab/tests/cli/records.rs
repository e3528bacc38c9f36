//! The records of a server whose database is lost, and downloads that are resumed.

use std::collections::BTreeSet;
use std::path::Path;

use serde_json::Value;

use super::run::{chefshat, fixture, run, serve, serve_with, typed_into_a_closed_pipe};

/// The records that a server lists, oldest first.
fn listed(server: &str) -> Vec<String> {
    let summaries = run(server, "records list --json").clean().json_lines();
    let id = |summary: &Value| summary["gameId"].as_str().unwrap().to_owned();
    summaries.iter().map(id).collect()
}

fn files(folder: &Path) -> BTreeSet<String> {
    let files = folder.read_dir().unwrap().map(|file| file.unwrap().path());
    let name = |path: std::path::PathBuf| path.file_stem().unwrap().to_str().unwrap().to_owned();
    files.map(name).collect()
}

#[test]
fn a_download_is_resumed_after_the_last_record_that_arrived() {
    let folder = tempfile::tempdir().unwrap();
    let (_server, url) = serve_with(folder.path(), &["--allow-import"]);
    for name in ["committed", "fixed"] {
        let file = fixture(&format!("records/{name}.jsonl"));
        run(&url, &format!("records import {}", file.display())).clean();
    }
    let all = listed(&url);
    assert_eq!(all.len(), 2);
    let download = |after: &str| {
        let out = tempfile::tempdir().unwrap();
        let line = format!("records stream --out-dir {}{after}", out.path().display());
        let said = run(&url, &line).well();
        (files(out.path()), said)
    };
    let (both, _) = download("");
    assert_eq!(both, all.iter().cloned().collect());
    let (rest, said) = download(&format!(" --after {}", all[0]));
    assert_eq!(rest, BTreeSet::from([all[1].clone()]));
    said.assert_says(&["1 record in"]);
    let (nothing, _) = download(&format!(" --after {}", all[1]));
    assert!(nothing.is_empty(), "{nothing:?}");
    let unknown = format!("records stream --after {}", "0".repeat(32));
    run(&url, &unknown).assert_failed("no game");
}

#[test]
fn an_import_that_broke_off_can_be_repeated() {
    let folder = tempfile::tempdir().unwrap();
    let (_server, url) = serve_with(folder.path(), &["--allow-import"]);
    let [first, second] = ["committed", "fixed"].map(|name| {
        let file = fixture(&format!("records/{name}.jsonl"));
        file.to_str().unwrap().to_owned()
    });
    run(&url, &format!("records import {first}")).clean();
    let again = run(&url, &format!("records import {first} {second}")).well();
    assert_eq!(again.stderr, format!("already there: {first}\n"));
    assert_eq!(again.stdout.lines().count(), 1, "{again:?}");
    assert_eq!(listed(&url).len(), 2);
}

#[test]
fn a_download_into_a_closed_pipe_ends_well() {
    let folder = tempfile::tempdir().unwrap();
    let (_server, url) = serve_with(folder.path(), &["--allow-import"]);
    for name in ["committed", "fixed"] {
        let file = fixture(&format!("records/{name}.jsonl"));
        run(&url, &format!("records import {}", file.display())).clean();
    }
    let first = &listed(&url)[0];
    let stream = format!("records stream --after {first} --server {url}");
    typed_into_a_closed_pipe(&stream).clean();
}

#[test]
fn a_lost_database_is_begun_anew_only_if_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let (server, url) = serve_with(folder.path(), &["--allow-import"]);
    let file = fixture("records/fixed.jsonl");
    run(&url, &format!("records import {}", file.display())).clean();
    drop(server);
    for file in ["games.sqlite3", "games.sqlite3-wal", "games.sqlite3-shm"] {
        // Only the first one is certain to exist.
        let _ = std::fs::remove_file(folder.path().join(file));
    }
    let data_dir = folder.path().to_str().unwrap();
    let start = ["serve", "--listen", "127.0.0.1:0", "--data-dir", data_dir];
    let refused = chefshat(&start);
    refused.assert_failed("is empty or missing");
    refused.assert_failed("chefshat serve --new");
    assert!(!folder.path().join("games.sqlite3").exists());
    let (server, url) = serve_with(folder.path(), &["--new"]);
    assert!(listed(&url).is_empty());
    drop(server);
    // From now on there is one.
    let (_server, url) = serve(folder.path());
    assert!(listed(&url).is_empty());
}
