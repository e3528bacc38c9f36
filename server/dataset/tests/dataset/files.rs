//! The files of a dataset: the formats agree, checksums, the card.

use chefshat_dataset::{
    ColumnInfo, Export, Format, decision_columns, expression_columns, markdown, marker_columns,
    sample_columns,
};
use chefshat_proto::v1::{self, record_line::Line};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::record::Field;
use serde_json::{Map, Value};
use sha2::{Digest as _, Sha256};

use super::{Stage, a_record, with_lines};

const DOCS: &str = include_str!("../../../../docs/datasets.md");

#[test]
fn every_format_has_every_row_and_exports_are_deterministic() {
    let stage = Stage::new(&[("b.jsonl", a_record(2)), ("a.jsonl", a_record(1))]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!((exported.games, exported.finished), (2, 2));
    let rows = stage.rows("decisions");
    // In order of the file names.
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
            "markers.parquet",
            "markers.jsonl",
            "markers.csv",
            "samples.parquet",
            "samples.jsonl",
            "samples.csv",
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
    assert_eq!(stage.leftovers(), ["out"]);
}

#[test]
fn the_card_is_readable_by_hubs_and_people() {
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
        "- config_name: markers",
        "  data_files: markers.parquet",
        "- n<1K",
    ] {
        assert!(front.lines().any(|of| of == line), "{line} in {front}");
    }
    for table in [
        markdown(&decision_columns()),
        markdown(&expression_columns()),
        markdown(&marker_columns()),
        markdown(&sample_columns()),
    ] {
        assert!(card.contains(&table));
        assert!(
            DOCS.contains(&table),
            "docs/datasets.md must hold:\n{table}"
        );
    }
    assert!(card.contains("10.48550/arXiv.2003.05861"));
    assert!(card.contains("| games | 1 (1 finished, 0 aborted) |"));
}

/// A record may say anything about its server.
#[test]
fn a_card_has_no_text_of_a_record() {
    let versions = ["0.3.0-rc.1+b47cdd4", "1 |\n\n<img src=x>", &"9".repeat(41)];
    let records = (1..).zip(versions).map(|(number, version)| {
        let mut lines = a_record(number);
        if let Some(Line::Header(header)) = &mut lines[0].line {
            header.server_version = version.to_owned();
        }
        (format!("{number}.jsonl"), lines)
    });
    let records: Vec<(String, _)> = records.collect();
    let named: Vec<_> = (records.iter())
        .map(|(name, lines)| (name.as_str(), lines.clone()))
        .collect();
    let stage = Stage::new(&named);
    stage.run(&stage.export()).unwrap();
    let card = std::fs::read_to_string(stage.out().join("README.md")).unwrap();
    let line = "| server version | 0.3.0-rc.1+b47cdd4, other |\n";
    assert!(card.contains(line), "{card}");
    assert!(!card.contains("<img"), "{card}");
}

/// A Parquet value in the encoding of JSON Lines, with times in microseconds.
fn json(field: &Field) -> Value {
    match field {
        Field::Null => Value::Null,
        Field::Bool(value) => (*value).into(),
        Field::UByte(value) => (*value).into(),
        Field::UShort(value) => (*value).into(),
        Field::UInt(value) => (*value).into(),
        Field::ULong(value) => (*value).into(),
        Field::Float(value) => value.to_string().parse::<f64>().unwrap().into(),
        Field::Str(value) => value.as_str().into(),
        Field::Bytes(value) => hex::encode(value.data()).into(),
        Field::TimestampMicros(value) => (*value).into(),
        Field::ListInternal(list) => list.elements().iter().map(json).collect(),
        Field::Group(row) => {
            let fields = row.get_column_iter();
            let fields = fields.map(|(name, field)| (name.clone(), json(field)));
            fields.collect::<Map<_, _>>().into()
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn parquet_and_json_lines_have_the_same_values() {
    let expression = v1::PrivateExpression {
        seat: 2,
        elapsed_ms: 0,
        expression: Some(v1::Expression {
            label: "joy".into(),
            valence: Some(0.7),
            record_only: true,
            about: Some(v1::expression::About::Gaze(v1::GazePoint {
                x: 0.25,
                y: -0.5,
                frame: v1::GazeFrame::Table.into(),
            })),
            ..v1::Expression::default()
        }),
    };
    let marker = v1::Marker {
        number: 1,
        label: "EEG on".into(),
        elapsed_us: 1_500,
        received_ms: 0,
    };
    let added = [
        (3, Line::PrivateExpression(expression)),
        (4, Line::Marker(marker)),
    ];
    let lines = with_lines(a_record(1), &added);
    let stage = Stage::new(&[("a.jsonl", lines)]);
    stage.run(&stage.export()).unwrap();
    let tables: [(&str, Vec<ColumnInfo>); 3] = [
        ("decisions", decision_columns()),
        ("expressions", expression_columns()),
        ("markers", marker_columns()),
    ];
    for (table, columns) in tables {
        let path = stage.out().join(format!("{table}.parquet"));
        let reader = SerializedFileReader::try_from(path.as_path()).unwrap();
        let mut rows = stage.rows(table);
        assert!(!rows.is_empty());
        for row in &mut rows {
            if let Some(time @ Value::String(_)) = row.get_mut("created_at") {
                let parsed: chefshat_proto::Timestamp =
                    serde_json::from_value(time.take()).unwrap();
                *time = (parsed.seconds * 1_000_000 + i64::from(parsed.nanos / 1000)).into();
            }
        }
        let found: Vec<Value> = reader
            .get_row_iter(None)
            .unwrap()
            .map(|row| json(&Field::Group(row.unwrap())))
            .collect();
        assert_eq!(found, rows);
        let names: Vec<String> = (reader
            .metadata()
            .file_metadata()
            .schema()
            .get_fields()
            .iter())
        .map(|field| field.name().to_owned())
        .collect();
        let expected: Vec<&str> = columns.iter().map(|column| column.name).collect();
        assert_eq!(names, expected);
    }
}
