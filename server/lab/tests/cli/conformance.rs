//! `chefshat conformance`: the vectors agree; damaged and foreign files are reported with exit code
//! 1. The kinds of damage are tested in `chefshat-simulation`.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};
use tempfile::TempDir;

use super::run::{Ended, chefshat, fixture, typed_into_a_closed_pipe};

fn vectors(file: &str) -> PathBuf {
    fixture(&format!("vectors/{file}"))
}

/// Copies the first lines of a file of vectors and changes the last one.
fn damaged(folder: &TempDir, file: &str, lines: usize, damage: impl FnOnce(&mut Value)) -> PathBuf {
    let text = std::fs::read_to_string(vectors(file)).unwrap();
    let mut lines: Vec<String> = text.lines().take(lines).map(str::to_owned).collect();
    let last = lines.last_mut().unwrap();
    let mut vector = serde_json::from_str(last).unwrap();
    damage(&mut vector);
    *last = vector.to_string();
    let path = folder.path().join(file);
    std::fs::write(&path, lines.join("\n")).unwrap();
    path
}

fn conformance(path: &Path, flags: &[&str]) -> Ended {
    let mut arguments = vec!["conformance", path.to_str().unwrap()];
    arguments.extend(flags);
    chefshat(&arguments)
}

#[test]
fn the_vectors_agree() {
    for (file, expected, counts) in [
        (
            "games.jsonl",
            "all agree: 57 games (29,553 decisions)",
            (0, 57, 29_553),
        ),
        ("deals.jsonl", "all agree: 87 deals", (87, 0, 0)),
    ] {
        let ended = conformance(&vectors(file), &[]).clean();
        assert!(
            ended.stdout.trim_end().ends_with(expected),
            "{}",
            ended.stdout
        );

        let ended = conformance(&vectors(file), &["--json"]);
        assert_eq!(ended.code, Some(0), "{file}");
        let result = ended.json();
        assert_eq!(
            (
                &result["agree"],
                &result["disagreement"],
                &result["problem"]
            ),
            (&json!(true), &Value::Null, &Value::Null)
        );
        assert_eq!(
            (
                result["deals"].clone(),
                result["games"].clone(),
                result["decisions"].clone()
            ),
            (json!(counts.0), json!(counts.1), json!(counts.2))
        );
    }
}

#[test]
fn a_report_into_a_closed_pipe_ends_well() {
    let file = vectors("deals.jsonl");
    typed_into_a_closed_pipe(&format!("conformance {}", file.display())).clean();
}

#[test]
fn several_files_are_checked_even_if_one_is_wrong() {
    let folder = TempDir::new().unwrap();
    let wrong = damaged(&folder, "deals.jsonl", 4, |deal| deal["leader"] = json!(9));
    let missing = folder.path().join("missing.jsonl");
    let (deals, games) = (vectors("deals.jsonl"), vectors("games.jsonl"));
    let check = |files: &[&Path], flags: &[&str]| {
        let files = files.iter().map(|file| file.to_str().unwrap());
        let all: Vec<&str> = (["conformance"].into_iter().chain(files))
            .chain(flags.iter().copied())
            .collect();
        chefshat(&all)
    };
    let all = check(&[&deals, &games], &[]).clean();
    all.assert_says(&["all agree: 87 deals", "all agree: 57 games"]);
    let some = check(&[&wrong, &missing, &deals], &["--json"]);
    assert_eq!(some.code, Some(1));
    let agree: Vec<Value> = (some.stdout.lines())
        .map(|line| serde_json::from_str::<Value>(line).unwrap()["agree"].clone())
        .collect();
    assert_eq!(agree, [json!(false), json!(true)]);
    assert!(some.stderr.contains("missing.jsonl"), "{}", some.stderr);
}

#[test]
fn the_first_wrong_vector_is_reported() {
    let folder = TempDir::new().unwrap();
    let path = damaged(&folder, "games.jsonl", 3, |game| {
        game["steps"][5][2] = json!([1, 199])
    });
    let ended = conformance(&path, &[]).ended_with(1);
    for expected in [
        "line 3, step 5",
        "where     steps[5], legal actions",
        "expected  [1, 199]",
        "got       [",
        "before it: 2 games",
    ] {
        ended.assert_says(&[expected]);
    }

    let ended = conformance(&path, &["--json"]);
    assert_eq!(ended.code, Some(1));
    let result = ended.json();
    assert_eq!(
        (&result["agree"], &result["games"]),
        (&json!(false), &json!(2))
    );
    assert_eq!(
        (
            &result["disagreement"]["line"],
            &result["disagreement"]["step"]
        ),
        (&json!(3), &json!(5))
    );

    let path = damaged(&folder, "deals.jsonl", 4, |deal| deal["leader"] = json!(9));
    let ended = conformance(&path, &[]);
    assert_eq!(ended.code, Some(1));
    assert!(
        ended.stdout.contains("line 4 does not agree") && ended.stdout.contains("where     leader"),
        "{}",
        ended.stdout
    );
}

#[test]
fn other_files_are_refused() {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, text: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let table = [
        (folder.path().join("missing.jsonl"), "No such file"),
        (folder.path().to_owned(), "is a folder"),
        (write("empty", b""), "the file has no vectors"),
        (
            write("binary", &[0, 159, 146, 150]),
            "line 1 is not a vector: it is not JSON",
        ),
        (
            write("foreign", b"{\"name\": \"chefshat\"}"),
            "line 1 is not a vector: it is neither a game",
        ),
    ];
    for (path, expected) in table {
        let ended = conformance(&path, &[]);
        ended.assert_failed(expected);
        assert!(
            ended.stderr.contains(path.to_str().unwrap()),
            "{}",
            ended.stderr
        );
    }
}
