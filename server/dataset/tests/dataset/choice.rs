//! Which records are exported: damaged and duplicate ones, filters.

use chefshat_dataset::{Export, ExportError, Filter};
use chefshat_record::files::find_records;
use chefshat_record::testing::header;

use super::{Stage, a_record, players};

#[test]
fn damaged_records_are_left_out_and_named() {
    let mut damaged = a_record(2);
    damaged.pop();
    let stage = Stage::new(&[("a.jsonl", damaged), ("b.jsonl", a_record(1))]);
    std::fs::write(stage.records().join("c.jsonl"), "{}\nno record\n").unwrap();
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!((exported.games, exported.damaged), (1, 2));
    let named: Vec<bool> = (exported.skipped.iter().zip(["a.jsonl", "c.jsonl"]))
        .map(|(skipped, name)| skipped.path.ends_with(name) && skipped.problem.contains("line "))
        .collect();
    assert_eq!(named, [true, true]);
    assert_eq!(stage.leftovers(), ["out"]);
    std::fs::remove_file(stage.records().join("b.jsonl")).unwrap();
    let replacing = Export {
        replace: true,
        ..stage.export()
    };
    let error = stage.run(&replacing).unwrap_err().to_string();
    assert!(
        error.contains("none of 2") && error.contains("a.jsonl: line "),
        "{error}"
    );
}

#[test]
fn a_game_is_exported_once() {
    let stage = Stage::new(&[("a.jsonl", a_record(1)), ("b.jsonl", a_record(1))]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!(exported.games, 1);
    assert!(exported.skipped[0].problem.contains("a.jsonl"));
    let file = stage.records().join("a.jsonl");
    let twice = find_records(&[file.clone(), stage.records(), file]).files;
    assert_eq!(twice.len(), 2);
}

#[test]
fn filters_exclude_games() {
    let stage = Stage::new(&[("a.jsonl", a_record(1)), ("b.jsonl", a_record(2))]);
    let with = |filter| Export {
        filter,
        replace: true,
        ..stage.export()
    };
    let room = with(Filter {
        room_name: Some("room 2".into()),
        ..Filter::default()
    });
    let exported = stage.run(&room).unwrap();
    assert_eq!((exported.games, exported.filtered), (1, 1));
    let kind = match players(&a_record(1))[0].built_in_agent.as_str() {
        "" => "agent",
        _ => "built_in",
    };
    let present = with(Filter {
        player_kind: Some(kind.into()),
        finished_only: true,
        ..Filter::default()
    });
    assert_eq!(stage.run(&present).unwrap().games, 2);
    let human = with(Filter {
        player_kind: Some("human".into()),
        ..Filter::default()
    });
    assert!(matches!(
        stage.run(&human),
        Err(ExportError::NothingLeft { records: 2, .. })
    ));
    // The failed export left the dataset unchanged.
    assert_eq!(
        stage
            .rows("decisions")
            .iter()
            .filter(|row| row["number"] == 1)
            .count(),
        2
    );
}

#[test]
fn a_time_after_the_year_9999_damages_only_its_own_record() {
    const LAST_MS: u64 = 253_402_300_799_999;
    let (mut last, mut beyond) = (a_record(2), a_record(3));
    header(&mut last).created_at_ms = LAST_MS;
    header(&mut beyond).created_at_ms = LAST_MS + 1;
    let stage = Stage::new(&[
        ("a.jsonl", a_record(1)),
        ("b.jsonl", last),
        ("c.jsonl", beyond),
    ]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!((exported.games, exported.skipped.len()), (2, 1));
    let skipped = &exported.skipped[0];
    assert!(skipped.path.ends_with("c.jsonl"), "{skipped:?}");
    let problem = &skipped.problem;
    assert!(
        problem.contains("line 1: createdAtMs is 253402300800000, after the year 9999"),
        "{problem}"
    );
    let rows = stage.rows("decisions");
    let of_last = rows.iter().rfind(|row| row["room_name"] == "room 2");
    assert_eq!(
        of_last.unwrap()["created_at"],
        "9999-12-31T23:59:59.999+00:00"
    );
}
