//! `chefshat export` on records of `chefshat simulate`: output, files, and errors with advice. The
//! contents of the files are tested in `chefshat-dataset` and in Python.

use std::path::{Path, PathBuf};

use serde_json::Value;
use tempfile::TempDir;

use super::run::{Ended, chefshat, program, typed};

/// A folder that contains a data folder with simulated records.
struct Stage {
    folder: TempDir,
}

impl Stage {
    fn new(games: u32) -> Self {
        let stage = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        simulate(games, &stage.path("data/records")).well();
        stage
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Exports the records of the data folder to `out`.
    fn export(&self, flags: &str) -> Ended {
        let (data, out) = (self.path("data"), self.path("out"));
        let mut arguments = vec!["export", "--data-dir", text(&data), "--out", text(&out)];
        arguments.extend(flags.split_whitespace());
        chefshat(&arguments)
    }

    /// The files in `out`, by name.
    fn out(&self) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(self.path("out"))
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

fn simulate(games: u32, records: &Path) -> Ended {
    let agents = "greedy,random_unmasked,random,random --max-invalid-attempts 20";
    let line = format!("simulate --games {games} --seed 7 --reward paper --agents {agents}");
    typed(&format!("{line} --records {}", text(records)))
}

fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_str().unwrap().to_owned();
            (name, std::fs::read(path).unwrap())
        })
        .collect();
    files.sort();
    files
}

#[test]
fn simulated_games_have_records_that_verify() {
    let stage = Stage::new(4);
    let records = stage.path("data/records");
    let first = contents(&records);
    assert_eq!(first.len(), 4);
    for (name, content) in &first {
        let header = content.split(|byte| *byte == b'\n').next().unwrap();
        let header: Value = serde_json::from_slice(header).unwrap();
        let id = header["header"]["gameId"].as_str().unwrap();
        assert_eq!(*name, format!("{id}.jsonl"));
        assert!(String::from_utf8_lossy(content).contains("DECISION_SOURCE_INVALID"));
    }
    chefshat(&["verify", text(&records)]).well();
    // The same batch writes the same records and prints the same.
    let again = simulate(4, &stage.path("again"));
    assert_eq!(contents(&stage.path("again")), first);
    assert_eq!(simulate(4, &stage.path("more")), again);
    let none = format!("--records {}", text(&stage.path("none")));
    let refused = typed(&format!("simulate --max-invalid-attempts 1001 {none}"));
    assert_eq!(refused.code, Some(1));
    assert!(refused.stderr.contains("at most 1000"), "{refused:?}");
    assert!(!stage.path("none").exists());
}

#[test]
fn a_dataset_is_exported_from_the_data_folder() {
    let stage = Stage::new(2);
    let ended = stage.export("").well();
    assert_eq!(ended.stderr, "");
    ended.assert_says(&[": 2 games, "]);
    let standard = [
        "README.md",
        "SHA256SUMS",
        "decisions.parquet",
        "expressions.parquet",
        "markers.parquet",
        "samples.parquet",
    ];
    assert_eq!(stage.out(), standard);
    let ended = stage
        .export("--format csv,jsonl --format csv --force --json --licence CC0-1.0")
        .well();
    let said = ended.json();
    assert_eq!(said["games"], 2);
    assert_eq!(said["finished"], 2);
    assert_eq!(said["files"].as_array().unwrap().len(), 9);
    let files = [
        "README.md",
        "SHA256SUMS",
        "decisions.csv",
        "decisions.jsonl",
        "expressions.csv",
        "expressions.jsonl",
        "markers.csv",
        "markers.jsonl",
        "samples.csv",
        "samples.jsonl",
    ];
    assert_eq!(stage.out(), files);
    let rows = std::fs::read_to_string(stage.path("out/decisions.jsonl")).unwrap();
    assert_eq!(
        Some(rows.lines().count() as u64),
        said["decisions"].as_u64()
    );
    let card = std::fs::read_to_string(stage.path("out/README.md")).unwrap();
    assert!(card.contains("license: cc0-1.0\n") && card.contains("Licence: CC0-1.0."));
}

#[test]
fn the_chefshatgym_layout_has_a_file_for_each_game() {
    let stage = Stage::new(2);
    stage.export("--layout chefshatgym").well();
    let mut expected: Vec<String> = contents(&stage.path("data/records"))
        .into_iter()
        .map(|(name, _)| name.trim_end_matches(".jsonl").to_owned())
        .collect();
    for game in &expected {
        let file = stage.path("out").join(game).join("Dataset.pkl.csv");
        assert!(file.is_file(), "{}", file.display());
    }
    expected.extend(["README.md".to_owned(), "SHA256SUMS".to_owned()]);
    expected.sort();
    assert_eq!(stage.out(), expected);
}

#[test]
fn damaged_records_are_left_out_and_named() {
    let stage = Stage::new(2);
    let records = stage.path("data/records");
    let (name, content) = contents(&records).swap_remove(0);
    let cut = content.len() / 2;
    std::fs::write(records.join(&name), &content[..cut]).unwrap();
    let ended = stage.export("");
    assert_eq!(ended.code, Some(1));
    assert!(
        ended.stderr.contains(&name) && ended.stderr.contains(": line "),
        "{ended:?}"
    );
    assert!(ended.stderr.contains("--skip-damaged"), "{ended:?}");
    assert!(ended.stdout.contains(": 1 game, "), "{ended:?}");
    let missing = stage.path("missing.jsonl");
    let flags = format!(
        "--force --skip-damaged {} {}",
        text(&missing),
        text(&records)
    );
    let ended = stage.export(&flags).well();
    assert!(
        ended.stderr.contains("missing.jsonl: No such file"),
        "{ended:?}"
    );
    assert!(ended.stdout.contains(": 1 game, "), "{ended:?}");
    let ended = stage.export("--skip-damaged --force").well();
    assert!(ended.stderr.contains("skipped: ") && ended.stderr.contains(&name));
    assert!(ended.stdout.contains(": 1 game, "));
    let ended = stage.export("--skip-damaged --force --json");
    let said = ended.json();
    assert!(
        said["left_out"][0]["path"]
            .as_str()
            .unwrap()
            .ends_with(&name)
    );
}

#[test]
fn damaged_samples_are_named_and_the_rest_is_exported() {
    let stage = Stage::new(2);
    let (name, _) = contents(&stage.path("data/records")).swap_remove(0);
    let samples = format!("{}.2.samples", name.trim_end_matches(".jsonl"));
    std::fs::create_dir(stage.path("data/samples")).unwrap();
    std::fs::write(stage.path("data/samples").join(&samples), [0xff; 9]).unwrap();
    let ended = stage.export("");
    assert_eq!(ended.code, Some(1));
    assert!(ended.stderr.contains(&samples), "{ended:?}");
    assert!(ended.stdout.contains(": 2 games, "), "{ended:?}");
    let said = stage.export("--skip-damaged --force --json").well().json();
    let left_out = said["left_out"][0]["path"].as_str().unwrap();
    assert!(left_out.ends_with(&samples), "{left_out}");
    // They are found beside records that are named relative to their own folder.
    for (records, out) in [(".", "all"), (name.as_str(), "one")] {
        let mut export = program();
        export.current_dir(stage.path("data/records"));
        export.args(["export", records, "--out", text(&stage.path(out))]);
        let ended = Ended::of(export.output().unwrap());
        assert_eq!(ended.code, Some(1), "{records}: {ended:?}");
        assert!(ended.stderr.contains(&samples), "{records}: {ended:?}");
    }
}

#[test]
fn only_a_dataset_is_replaced() {
    let stage = Stage::new(1);
    assert_eq!(stage.export("").code, Some(0));
    assert_eq!(stage.export("--force --format csv").code, Some(0));
    let notes = stage.path("out/notes.txt");
    std::fs::write(&notes, "kept").unwrap();
    let before = contents(&stage.path("out"));
    assert_eq!(before.len(), 7);
    let ended = stage.export("--force");
    ended.assert_failed(
        "it is not only a dataset: it contains notes.txt, which SHA256SUMS does not list",
    );
    assert_eq!(contents(&stage.path("out")), before);
    std::fs::remove_file(&notes).unwrap();
    assert_eq!(stage.export("--force").code, Some(0));
}

#[test]
fn a_folder_named_like_a_record_is_ignored() {
    let stage = Stage::new(1);
    std::fs::create_dir(stage.path("data/records/old.jsonl")).unwrap();
    let ended = stage.export("").well();
    ended.assert_says(&[": 1 game, "]);
    let named = stage.path("data/records/old.jsonl");
    let ended = stage.export(&format!("--force {}", text(&named)));
    assert_eq!(ended.code, Some(1));
    assert!(
        ended.stderr.contains("old.jsonl: contains no records"),
        "{ended:?}"
    );
}

#[test]
fn mistakes_are_explained() {
    let stage = Stage::new(1);
    assert_eq!(stage.export("").code, Some(0));
    let table = [
        ("", "is not empty; choose another folder, or replace"),
        ("--format xls", "possible values: parquet, jsonl, csv"),
        ("--layout tensor", "possible values: tables, chefshatgym"),
        ("--layout chefshatgym --format parquet", "always CSV"),
        (
            "--with cat",
            "possible values: agent, human, robot, model, built_in",
        ),
        (
            "--force --with human",
            "none of 1 records is left to export",
        ),
        (
            "--force --room elsewhere",
            "none of 1 records is left to export",
        ),
        ("missing", "missing: No such file"),
    ];
    for (flags, expected) in table {
        stage.export(flags).assert_refused(expected);
    }
    let (nothing, out) = (stage.path("nothing"), stage.path("other"));
    let ended = chefshat(&["export", "--data-dir", text(&nothing), "--out", text(&out)]);
    assert!(
        ended.stderr.contains("there are no records in"),
        "{ended:?}"
    );
    assert!(!nothing.exists() && !out.exists());
}

#[test]
fn help_shows_an_example() {
    typed("export --help").assert_helps("chefshat export --out dataset");
}
