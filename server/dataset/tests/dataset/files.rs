//! The files of a dataset: the formats against each other, sums, the card.

use chefshat_dataset::{Export, Format, decision_columns, expression_columns, markdown};
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::{Stage, a_record};

const DOCS: &str = include_str!("../../../../docs/datasets.md");

#[test]
fn every_format_has_every_row_and_the_same_input_the_same_bytes() {
    let stage = Stage::new(&[("b.jsonl", a_record(2)), ("a.jsonl", a_record(1))]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!((exported.games, exported.finished), (2, 2));
    let rows = stage.rows("decisions");
    // By the names of the files.
    assert_eq!(rows[0]["room_name"], "room 1");
    assert_eq!(rows[rows.len() - 1]["room_name"], "room 2");
    let mut csv = csv::Reader::from_path(stage.out().join("decisions.csv")).unwrap();
    let header: Vec<String> = csv.headers().unwrap().iter().map(str::to_owned).collect();
    assert_eq!(
        header,
        decision_columns()
            .iter()
            .map(|column| column.name)
            .collect::<Vec<_>>()
    );
    let mut count = 0;
    for (cells, row) in csv.records().zip(&rows) {
        for (cell, name) in cells.unwrap().iter().zip(&header) {
            let expected = match &row[name] {
                Value::Null => String::new(),
                Value::String(text) => text.clone(),
                other => other.to_string(),
            };
            assert_eq!(cell, expected, "{name}");
        }
        count += 1;
    }
    assert_eq!(count, rows.len());
    let names: Vec<&str> = exported
        .files
        .iter()
        .map(|file| file.path.as_str())
        .collect();
    assert_eq!(
        names,
        [
            "decisions.parquet",
            "decisions.jsonl",
            "decisions.csv",
            "expressions.parquet",
            "expressions.jsonl",
            "expressions.csv",
            "README.md"
        ]
    );
    let mut sums = String::new();
    for file in &exported.files {
        let bytes = std::fs::read(stage.out().join(&file.path)).unwrap();
        assert_eq!(bytes.len() as u64, file.bytes);
        assert_eq!(hex::encode(Sha256::digest(&bytes)), file.sha256);
        sums.push_str(&format!("{}  {}\n", file.sha256, file.path));
    }
    let written = std::fs::read_to_string(stage.out().join("SHA256SUMS")).unwrap();
    assert_eq!(written, sums);
    let again = Export {
        replace: true,
        ..stage.export()
    };
    assert_eq!(stage.run(&again).unwrap().files, exported.files);
    assert_eq!(stage.left_lying(), ["out"]);
}

#[test]
fn the_card_is_read_by_hubs_and_people() {
    let stage = Stage::new(&[("a.jsonl", a_record(1))]);
    let export = Export {
        formats: vec![Format::Csv, Format::Parquet],
        licence: "CC0-1.0".into(),
        ..stage.export()
    };
    stage.run(&export).unwrap();
    let card = std::fs::read_to_string(stage.out().join("README.md")).unwrap();
    let front = card
        .strip_prefix("---\n")
        .unwrap()
        .split("---\n")
        .next()
        .unwrap();
    for line in [
        "license: cc0-1.0",
        "configs:",
        "- config_name: decisions",
        "  data_files: decisions.parquet",
        "  default: true",
        "- config_name: expressions",
        "  data_files: expressions.parquet",
        "- n<1K",
    ] {
        assert!(front.lines().any(|of| of == line), "{line} in {front}");
    }
    for table in [
        markdown(&decision_columns()),
        markdown(&expression_columns()),
    ] {
        assert!(card.contains(&table));
        assert!(
            DOCS.contains(&table),
            "docs/datasets.md must hold:\n{table}"
        );
    }
    assert!(card.contains("10.48550/arXiv.2003.05861"));
    assert!(card.contains("| games | 1 (1 played to the end, 0 aborted) |"));
}
