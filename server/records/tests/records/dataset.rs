//! Datasets: their rows against a second count of the same games, their files against each other, and what is refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use chefshat_engine::{Action, BySeat, Game, MetricsRecorder, RewardScheme, RuleSetSpec, Seat};
use chefshat_engine::{Seed, ShiftMetrics, Stop};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_records::dataset::{
    Export, ExportError, Exported, Filter, Format, Layout, decision_columns, expression_columns,
    find_records, markdown,
};
use chefshat_records::jsonl;
use chefshat_records::table::import;
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use tempfile::TempDir;

use super::made::Making;

const DOCS: &str = include_str!("../../../../docs/datasets.md");

/// Games whose records lie in a folder, and a place for datasets.
struct Stage {
    folder: TempDir,
}

impl Stage {
    fn new(records: &[(&str, Vec<v1::RecordLine>)]) -> Self {
        let stage = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        for (name, lines) in records {
            jsonl::write(&stage.records().join(name), lines).unwrap();
        }
        stage
    }

    fn records(&self) -> PathBuf {
        self.folder.path().join("records")
    }

    fn out(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    fn export(&self) -> Export {
        Export {
            out: self.out(),
            replace: false,
            layout: Layout::Tables,
            formats: Format::ALL.to_vec(),
            filter: Filter::default(),
            skip_damaged: false,
            licence: "CC-BY-4.0".into(),
            version: "test".into(),
        }
    }

    fn run(&self, export: &Export) -> Result<Exported, ExportError> {
        export.run(&find_records(&[self.records()]).unwrap(), |_| {})
    }

    fn rows(&self, table: &str) -> Vec<Value> {
        let text = std::fs::read_to_string(self.out().join(format!("{table}.jsonl"))).unwrap();
        text.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    }

    /// Everything in the folder of the stage but the records.
    fn left_lying(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name != "records").collect()
    }
}

/// A game of two Shifts, with a number of its own.
fn a_record(number: u8) -> Vec<v1::RecordLine> {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(2),
        ..RuleSetSpec::default()
    };
    let making = Making::dealt(spec.validate().unwrap(), number, u64::from(number));
    let mut lines = making.record(|_| v1::DecisionSource::Agent);
    rename(&mut lines, number);
    lines
}

/// Gives a record an id and a room of its own.
fn rename(lines: &mut [v1::RecordLine], number: u8) {
    for line in lines {
        match line.line.as_mut().unwrap() {
            Line::Header(header) => {
                header.game_id = format!("{number:032x}");
                header.room_name = format!("room {number}");
                header.created_at_ms = 1_700_000_000_123;
            }
            Line::Event(event) => {
                if let Some(Kind::GameStarted(started)) = &mut event.kind {
                    started.game_id = format!("{number:032x}");
                }
            }
            _ => {}
        }
    }
}

fn players(lines: &[v1::RecordLine]) -> Vec<v1::Participant> {
    match &lines[0].line {
        Some(Line::Header(header)) => header.seats.clone(),
        _ => panic!("the first line is the header"),
    }
}

/// The record with invalid attempts before some of its decisions.
fn with_attempts(mut lines: Vec<v1::RecordLine>) -> Vec<v1::RecordLine> {
    let decisions = lines.iter_mut().filter_map(|line| match &mut line.line {
        Some(Line::Decision(decision)) => Some(decision),
        _ => None,
    });
    for (index, decision) in decisions.enumerate() {
        if index % 5 == 2 {
            // No action has these numbers, so they are never legal.
            decision.invalid_attempts = vec![4_000_000_000, 213_000];
        }
    }
    lines
}

/// The record with lines put in after its first decisions, its events numbered anew.
fn with_lines(lines: Vec<v1::RecordLine>, added: &[(usize, Line)]) -> Vec<v1::RecordLine> {
    let mut all = Vec::new();
    let mut decisions = 0;
    for line in lines {
        if matches!(line.line, Some(Line::Decision(_))) {
            let here = added.iter().filter(|(after, _)| *after == decisions);
            all.extend(here.map(|(_, line)| v1::RecordLine {
                line: Some(line.clone()),
            }));
            decisions += 1;
        }
        all.push(line);
    }
    let mut events = 0;
    for line in &mut all {
        match &mut line.line {
            Some(Line::Event(event)) => {
                events += 1;
                event.sequence = events;
            }
            Some(Line::Footer(footer)) => footer.events = events,
            _ => {}
        }
    }
    all
}

/// The Shifts of a record counted by the engine's own recorder, which knows nothing of datasets.
fn counted(lines: &[v1::RecordLine], scheme: RewardScheme) -> Vec<ShiftMetrics> {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(2),
        ..RuleSetSpec::default()
    };
    let rules = spec.validate().unwrap();
    let seed = lines.iter().find_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::GameEnded(ended)) => ended.reveal.clone(),
            _ => None,
        },
        _ => None,
    });
    let seed = Seed(seed.unwrap().game_seed.try_into().unwrap());
    let mut recorder = MetricsRecorder::new(rules, Some(scheme));
    let mut shifts = Vec::new();
    let mut game = Game::new(rules, seed, |event| {
        shifts.extend(recorder.on_event(&event));
    });
    for line in lines {
        let Some(Line::Decision(decision)) = &line.line else {
            continue;
        };
        if decision.kind() == v1::DecisionKind::Turn {
            for _ in &decision.invalid_attempts {
                recorder.wrong(Seat::new(decision.seat as usize));
            }
        }
        let action = Action::new(u16::try_from(decision.action).unwrap());
        let note = |event| shifts.extend(recorder.on_event(&event));
        game.apply(action, note).unwrap();
    }
    assert!(game.is_over() && shifts.len() == 2);
    shifts
}

fn number(row: &Value, column: &str) -> f64 {
    row[column]
        .as_f64()
        .unwrap_or_else(|| panic!("{column} of {row}"))
}

#[test]
fn rows_agree_with_the_engines_own_count() {
    let lines = with_attempts(a_record(3));
    let stage = Stage::new(&[("a.jsonl", lines.clone())]);
    let exported = stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    assert_eq!(exported.decisions, rows.len() as u64);
    for scheme in RewardScheme::ALL {
        for shift in counted(&lines, scheme) {
            for (seat, metrics) in shift.seats.iter() {
                let of_seat: Vec<&Value> = rows
                    .iter()
                    .filter(|row| {
                        row["shift"] == shift.shift
                            && row["seat"].as_u64() == Some(seat.index() as u64)
                    })
                    .collect();
                let turns: Vec<&&Value> = of_seat
                    .iter()
                    .filter(|row| row["phase"] == "turn")
                    .collect();
                let passes = turns.iter().filter(|row| row["text"] == "pass").count();
                let attempts: f64 = turns.iter().map(|row| number(row, "invalid_count")).sum();
                assert_eq!(turns.len(), metrics.valid as usize);
                assert_eq!(passes, metrics.passes as usize);
                assert_eq!(attempts, f64::from(metrics.wrong));
                let name = scheme.name();
                let rewards: f64 = of_seat
                    .iter()
                    .map(|row| {
                        number(row, &format!("reward_{name}"))
                            + number(row, &format!("invalid_reward_{name}"))
                    })
                    .sum();
                assert!(
                    (rewards - metrics.reward_sum).abs() < 1e-4,
                    "{name}, seat {seat}: {rewards}, {}",
                    metrics.reward_sum
                );
                for row in of_seat {
                    assert_eq!(number(row, "shift_points"), f64::from(metrics.points));
                    assert_eq!(number(row, "shift_place"), f64::from(metrics.place));
                }
            }
        }
    }
}

#[test]
fn what_a_shifts_end_gives_falls_to_each_seats_last_turn() {
    let stage = Stage::new(&[("a.jsonl", a_record(3))]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    for shift in [1, 2] {
        let turns: Vec<&Value> = rows
            .iter()
            .filter(|row| row["shift"] == shift && row["phase"] == "turn")
            .collect();
        let mut enders = 0;
        for seat in 0..4 {
            let mine: Vec<&&Value> = turns.iter().filter(|row| row["seat"] == seat).collect();
            let (last, before) = mine.split_last().unwrap();
            let points = |row: &Value| number(row, "reward_points");
            assert_eq!(points(last), number(last, "shift_points"));
            assert!(before.iter().all(|row| points(row) == 0.0));
            let won = last["shift_place"] == 1;
            assert_eq!(number(last, "reward_winning") == 1.0, won);
            enders += usize::from(last["number"] == turns[turns.len() - 1]["number"]);
        }
        assert_eq!(enders, 1, "one seat's last turn ended the Shift");
    }
}

/// Turns of a game at a real table that were written down: few enough to leave open what others held.
const TOLD_TURNS: usize = 20;

/// A game as somebody wrote it down who saw the hand of seat 0 alone, and left early.
fn a_real_table() -> Vec<v1::RecordLine> {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(1),
        ..RuleSetSpec::default()
    };
    let lines = Making::dealt(spec.validate().unwrap(), 8, 8).record(|_| v1::DecisionSource::Agent);
    let mut text = String::from("shift,seat,what,value\n,,rules,paper target_shifts=1\n");
    for seat in 0..4 {
        text.push_str(&format!(",{seat},human,player {seat}\n"));
    }
    let cards = |cards: &[u32], golden: bool| {
        let mut golden = golden;
        let words = cards.iter().map(|card| match card {
            12 => "J".to_owned(),
            11 if std::mem::take(&mut golden) => "G".to_owned(),
            card => card.to_string(),
        });
        words.collect::<Vec<_>>().join(" ")
    };
    let mut turns = 0;
    for line in &lines {
        if turns == TOLD_TURNS {
            break;
        }
        let Some(Line::Event(v1::GameEvent {
            kind: Some(kind), ..
        })) = &line.line
        else {
            continue;
        };
        turns += usize::from(matches!(kind, Kind::Play(_) | Kind::Pass(_)));
        match kind {
            Kind::ShiftStarted(started) => {
                let hand = &started.hands[0];
                let told = cards(&hand.cards, hand.golden);
                text.push_str(&format!("1,0,hand,{told}\n"));
            }
            Kind::Play(play) => {
                let mut played = vec![play.face; play.quantity as usize];
                played.extend(vec![12; play.jokers as usize]);
                let told = cards(&played, false);
                text.push_str(&format!("1,{},plays,{told}\n", play.seat));
            }
            Kind::Pass(pass) => text.push_str(&format!("1,{},passes,\n", pass.seat)),
            _ => {}
        }
    }
    import(text.as_bytes()).unwrap()
}

#[test]
fn what_nobody_saw_is_null() {
    let stage = Stage::new(&[("a.jsonl", a_real_table())]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    assert_eq!(rows.len(), TOLD_TURNS);
    let hidden = ["hand", "golden", "mask", "legal_actions"];
    let mut unknown = 0;
    for row in &rows {
        assert_eq!(row["origin"], "imported");
        assert_eq!(row["agent_kind"], "human");
        assert_eq!(row["decision_time_us"], Value::Null);
        assert_eq!(row["gave"], Value::Null);
        let nulls = hidden
            .iter()
            .filter(|column| row[**column].is_null())
            .count();
        if row["seat"] == 0 {
            assert_eq!(nulls, 0);
        } else {
            assert_eq!(nulls, hidden.len());
            unknown += 1;
        }
        assert!(row["reward_paper"].is_number());
    }
    assert!(unknown > 10);
    let sheets = Export {
        layout: Layout::ChefsHatGym,
        replace: true,
        ..stage.export()
    };
    stage.run(&sheets).unwrap();
    let games = std::fs::read_dir(stage.out()).unwrap();
    let game = games
        .map(|entry| entry.unwrap().path())
        .find(|path| path.is_dir())
        .unwrap();
    let text = std::fs::read_to_string(game.join("Dataset.pkl.csv")).unwrap();
    assert!(text.contains("], None, None, None]\","), "{}", &text[..800]);
}

#[test]
fn an_aborted_game_has_no_result() {
    let mut lines = a_record(6);
    let reveal = lines.iter().find_map(|line| match &line.line {
        Some(Line::Event(event)) => match &event.kind {
            Some(Kind::GameEnded(ended)) => ended.reveal.clone(),
            _ => None,
        },
        _ => None,
    });
    // Cut off in its second Shift, before a decision.
    let is_play = |line: &v1::RecordLine| match &line.line {
        Some(Line::Event(event)) => matches!(&event.kind, Some(Kind::Play(_))),
        _ => false,
    };
    let second = lines
        .iter()
        .rposition(|line| match &line.line {
            Some(Line::Event(event)) => matches!(&event.kind, Some(Kind::ShiftStarted(_))),
            _ => false,
        })
        .unwrap();
    let play = lines[second..].iter().position(is_play).unwrap();
    lines.truncate(second + play + 1);
    let decisions = lines
        .iter()
        .filter(|line| matches!(line.line, Some(Line::Decision(_))))
        .count() as u64;
    let aborted = Kind::GameAborted(Box::new(v1::GameAborted {
        reason: v1::AbortReason::Closed.into(),
        reveal,
    }));
    let end = [
        Line::Event(v1::GameEvent {
            kind: Some(aborted),
            ..v1::GameEvent::default()
        }),
        Line::Footer(v1::RecordFooter {
            state: v1::RoomState::Aborted.into(),
            events: 0,
            decisions,
        }),
    ];
    lines.extend(end.map(|line| v1::RecordLine { line: Some(line) }));
    let stage = Stage::new(&[("a.jsonl", with_lines(lines, &[]))]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!((exported.games, exported.finished), (1, 0));
    let rows = stage.rows("decisions");
    assert_eq!(rows.len() as u64, decisions);
    for row in &rows {
        assert_eq!(row["finished"], false);
        assert_eq!(row["game_place"], Value::Null);
        assert_eq!(row["game_points"], Value::Null);
        assert_eq!(row["shift_place"].is_null(), row["shift"] == 2);
        assert_eq!(row["shift_points"].is_null(), row["shift"] == 2);
    }
    assert_eq!(rows[rows.len() - 1]["shift"], 2);
    let none = Export {
        filter: Filter {
            finished_only: true,
            ..Filter::default()
        },
        replace: true,
        ..stage.export()
    };
    assert!(matches!(
        stage.run(&none),
        Err(ExportError::NothingLeft { .. })
    ));
    let sheets = Export {
        layout: Layout::ChefsHatGym,
        replace: true,
        ..stage.export()
    };
    stage.run(&sheets).unwrap();
    let path = stage.out().join(format!("{:032x}/Dataset.pkl.csv", 6));
    let text = std::fs::read_to_string(path).unwrap();
    assert_eq!(text.matches(",END_MATCH,").count(), 1);
    assert_eq!(text.matches(",END_EXPERIMENT,").count(), 0);
}

#[test]
fn a_row_says_what_the_seat_knew_and_did() {
    let lines = a_record(3);
    let players = players(&lines);
    let stage = Stage::new(&[("a.jsonl", lines)]);
    stage.run(&stage.export()).unwrap();
    let rows = stage.rows("decisions");
    let columns: Vec<&str> = decision_columns()
        .iter()
        .map(|column| column.name)
        .collect();
    let turns_of_shift = |shift: u64| {
        let turns = rows.iter().filter(move |row| row["shift"] == shift);
        turns.filter_map(|row| row["turn"].as_u64())
    };
    for shift in [1, 2] {
        let turns: Vec<u64> = turns_of_shift(shift).collect();
        assert!(turns.len() > 20);
        assert_eq!(turns, (1..=turns.len() as u64).collect::<Vec<_>>());
    }
    assert!(rows.iter().any(|row| row["phase"] == "exchange"));
    for (row, index) in rows.iter().zip(1..) {
        assert!(columns.iter().all(|column| row.get(column).is_some()));
        assert_eq!(row.as_object().unwrap().len(), columns.len());
        assert_eq!(row["number"], index);
        assert_eq!(row["game_id"], format!("{:032x}", 3));
        assert_eq!(row["created_at"], "2023-11-14T22:13:20.123+00:00");
        assert_eq!(row["origin"], "fixed_seed");
        assert_eq!(row["finished"], true);
        let player = &players[row["seat"].as_u64().unwrap() as usize];
        assert_eq!(row["agent"], player.name);
        let built_in = Some(&player.built_in_agent).filter(|name| !name.is_empty());
        assert_eq!(
            row["built_in_agent"],
            built_in.map_or(Value::Null, |name| name.as_str().into())
        );
        assert_eq!(row["agent_kind"], built_in.map_or("agent", |_| "built_in"));
        assert_eq!(row["decision_time_us"].is_null(), built_in.is_some());
        assert_eq!(row["valid"], true);
        assert_eq!(row["invalid_reward_validity"].to_string(), "0.0");
        let seat = row["seat"].as_u64().unwrap() as usize;
        let hand: u64 = sum(&row["hand"]);
        assert_eq!(Some(hand), row["cards_left"][seat].as_u64());
        let legal = row["legal_actions"].as_array().unwrap();
        assert!(legal.contains(&row["action"]));
        let mask = hex::decode(row["mask"].as_str().unwrap()).unwrap();
        let bits = (0..214u16).filter(|bit| mask[usize::from(bit / 8)] >> (bit % 8) & 1 == 1);
        assert_eq!(*legal, bits.map(Value::from).collect::<Vec<_>>());
        let is_turn = row["phase"] == "turn";
        assert_eq!(row["pizza"].is_null(), !is_turn);
        assert_eq!(row["turn"].is_null(), !is_turn);
        if !is_turn {
            assert_eq!(number(row, "reward_validity"), 0.0);
        }
        assert_eq!(
            *row["expressions"].as_array().unwrap(),
            vec![Value::Null; 4]
        );
    }
    let places: BTreeMap<u64, u64> = rows
        .iter()
        .map(|row| {
            (
                row["seat"].as_u64().unwrap(),
                row["game_place"].as_u64().unwrap(),
            )
        })
        .collect();
    let mut in_order: Vec<u64> = places.into_values().collect();
    in_order.sort_unstable();
    assert_eq!(in_order, [1, 2, 3, 4]);
}

fn sum(list: &Value) -> u64 {
    let values = list.as_array().unwrap().iter();
    values.map(|value| value.as_u64().unwrap()).sum()
}

#[test]
fn expressions_stand_in_both_tables() {
    let joy = v1::Expression {
        label: "joy".into(),
        valence: Some(0.7),
        source: v1::ExpressionSource::Face.into(),
        taken_at: Some(chefshat_proto::Timestamp {
            seconds: 1_700_000_000,
            nanos: 5_000_000,
        }),
        ..v1::Expression::default()
    };
    let doubt = v1::Expression {
        label: "doubt".into(),
        confidence: Some(0.5),
        media: "clip 7".into(),
        record_only: true,
        ..v1::Expression::default()
    };
    let shown = Line::Event(v1::GameEvent {
        kind: Some(Kind::ExpressionShown(Box::new(v1::ExpressionShown {
            seat: 2,
            expression: Some(joy),
        }))),
        ..v1::GameEvent::default()
    });
    let private = Line::PrivateExpression(v1::PrivateExpression {
        seat: 1,
        elapsed_ms: 0,
        expression: Some(doubt),
    });
    let lines = with_lines(a_record(4), &[(3, shown), (5, private)]);
    let stage = Stage::new(&[("a.jsonl", lines)]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!(exported.expressions, 2);
    let expressions = stage.rows("expressions");
    let facts: Vec<[&Value; 7]> = expressions
        .iter()
        .map(|row| {
            [
                "seat",
                "label",
                "public",
                "source",
                "media",
                "taken_at",
                "decisions_before",
            ]
            .map(|column| &row[column])
        })
        .collect();
    assert_eq!(
        serde_json::to_value(facts).unwrap(),
        serde_json::json!([
            [
                2,
                "joy",
                true,
                "face",
                null,
                "2023-11-14T22:13:20.005+00:00",
                3
            ],
            [1, "doubt", false, null, "clip 7", null, 5],
        ])
    );
    let latest: Vec<Value> = stage
        .rows("decisions")
        .iter()
        .map(|row| row["expressions"].clone())
        .collect();
    assert_eq!(latest[2], serde_json::json!([null, null, null, null]));
    assert_eq!(latest[3][2]["label"], "joy");
    assert_eq!(latest[3][2]["valence"], 0.7);
    assert_eq!(latest[4][1], Value::Null);
    assert_eq!(latest[5][1]["label"], "doubt");
    assert_eq!(latest[5][1]["public"], false);
    assert_eq!(latest[5][2]["public"], true);
}

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

#[test]
fn damaged_records_are_named_and_nothing_is_put_in_place() {
    let mut damaged = a_record(2);
    damaged.pop();
    let stage = Stage::new(&[("a.jsonl", a_record(1)), ("b.jsonl", damaged)]);
    std::fs::write(stage.records().join("c.jsonl"), "{}\nno record\n").unwrap();
    let error = stage.run(&stage.export()).unwrap_err().to_string();
    assert!(
        error.contains("b.jsonl: line ") && error.contains("c.jsonl: line "),
        "{error}"
    );
    assert!(
        !error.contains("a.jsonl") && error.contains("--skip-damaged"),
        "{error}"
    );
    assert_eq!(stage.left_lying(), [""; 0]);
    let skipping = Export {
        skip_damaged: true,
        ..stage.export()
    };
    let exported = stage.run(&skipping).unwrap();
    assert_eq!((exported.games, exported.left_out.len()), (1, 2));
    assert_eq!(stage.left_lying(), ["out"]);
}

#[test]
fn a_game_comes_once() {
    let stage = Stage::new(&[("a.jsonl", a_record(1)), ("b.jsonl", a_record(1))]);
    let exported = stage.run(&stage.export()).unwrap();
    assert_eq!(exported.games, 1);
    assert!(exported.left_out[0].problem.contains("a.jsonl"));
    let file = stage.records().join("a.jsonl");
    let twice = find_records(&[file.clone(), stage.records(), file]).unwrap();
    assert_eq!(twice.len(), 2);
}

#[test]
fn filters_leave_out_games() {
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
    let there = with(Filter {
        player_kind: Some(kind.into()),
        finished_only: true,
        ..Filter::default()
    });
    assert_eq!(stage.run(&there).unwrap().games, 2);
    let human = with(Filter {
        player_kind: Some("human".into()),
        ..Filter::default()
    });
    assert!(matches!(
        stage.run(&human),
        Err(ExportError::NothingLeft { records: 2 })
    ));
    // What was there stays.
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
fn only_datasets_are_replaced() {
    let stage = Stage::new(&[("a.jsonl", a_record(1))]);
    let replacing = Export {
        replace: true,
        ..stage.export()
    };
    std::fs::create_dir(stage.out()).unwrap();
    let precious = stage.out().join("precious");
    std::fs::write(&precious, "kept").unwrap();
    let error = stage.run(&stage.export()).unwrap_err().to_string();
    assert!(error.contains("--force"), "{error}");
    let error = stage.run(&replacing).unwrap_err().to_string();
    assert!(error.contains("something else than a dataset"), "{error}");
    assert_eq!(std::fs::read(&precious).unwrap(), b"kept");
    std::fs::remove_file(&precious).unwrap();
    // An empty folder will do.
    stage.run(&stage.export()).unwrap();
    assert!(stage.run(&stage.export()).is_err());
    stage.run(&replacing).unwrap();
    std::fs::remove_dir_all(stage.out()).unwrap();
    std::fs::write(stage.out(), "a file").unwrap();
    assert!(stage.run(&replacing).is_err());
    let nowhere = Export {
        out: Path::new("/").into(),
        ..stage.export()
    };
    assert!(stage.run(&nowhere).is_err());
    assert!(find_records(&[stage.folder.path().join("missing")]).is_err());
}

#[test]
fn the_other_layout_counts_the_same() {
    let lines = a_record(5);
    let stage = Stage::new(&[("a.jsonl", lines.clone())]);
    let export = Export {
        layout: Layout::ChefsHatGym,
        ..stage.export()
    };
    stage.run(&export).unwrap();
    let path = stage.out().join(format!("{:032x}/Dataset.pkl.csv", 5));
    let text = std::fs::read_to_string(path).unwrap();
    let names: Vec<String> = players(&lines)
        .into_iter()
        .map(|player| player.name)
        .collect();
    let listed: Vec<String> = names.iter().map(|name| format!("'{name}'")).collect();
    assert!(text.starts_with(&format!(
        "Match,Round,Agent_Names,Source,Action_Type,Action_Description,Player_Finished,Player_Hands,Board_Before,Board_After,\
         Possible_Actions,Current_Roles,Match_Score,Game_Score,Game_Performance_Score\n\
         0,0,\"[{}]\",SYSTEM,START_EXPERIMENT,,,,,,,,,,\n\
         1,0,,SYSTEM,NEW_MATCH,,,,,,,",
        listed.join(", ")
    )));
    let mut csv = csv::Reader::from_reader(text.as_bytes());
    let rows: Vec<csv::StringRecord> = csv.records().map(Result::unwrap).collect();
    let count =
        |shift: u32, source: &str, action: &str, keep: &dyn Fn(&csv::StringRecord) -> bool| {
            rows.iter()
                .filter(|row| {
                    row[0] == shift.to_string()
                        && (source.is_empty() || row[3] == *source)
                        && row[4] == *action
                        && keep(row)
                })
                .count()
        };
    let all = |_: &csv::StringRecord| true;
    for shift in counted(&lines, RewardScheme::Points) {
        for (seat, metrics) in shift.seats.iter() {
            let name = names[seat.index()].as_str();
            let passes = count(shift.shift, name, "DISCARD", &|row| row[5] == *"pass");
            let discards = count(shift.shift, name, "DISCARD", &|row| row[5] != *"pass");
            assert_eq!(passes, metrics.passes as usize);
            assert_eq!(discards, metrics.plays as usize);
            let finished = count(shift.shift, name, "DISCARD", &|row| row[6] == *"True");
            assert_eq!(finished, usize::from(metrics.place < 4));
        }
        assert_eq!(
            count(shift.shift, "", "DECLARE_PIZZA", &all),
            shift.pizzas as usize
        );
        assert_eq!(count(shift.shift, "", "DEAL_CARDS", &all), 1);
        assert_eq!(count(shift.shift, "", "END_MATCH", &all), 1);
        let end = rows
            .iter()
            .find(|row| row[0] == shift.shift.to_string() && row[4] == *"END_MATCH")
            .unwrap();
        let by_name = |points: BySeat<u32>| {
            let parts: Vec<String> = points
                .iter()
                .map(|(seat, points)| format!("'{}': {points}", names[seat.index()]))
                .collect();
            format!("{{{}}}", parts.join(", "))
        };
        assert_eq!(end[12], by_name(shift.seats.map(|seat| seat.points)));
    }
    let last = rows.last().unwrap();
    assert_eq!(&last[4], "END_EXPERIMENT");
    let exchanges = rows.iter().filter(|row| row[4] == *"CARD_EXCHANGE").count();
    let special = rows
        .iter()
        .filter(|row| row[5] == *"Dinner served!")
        .count();
    assert_eq!(exchanges + special, 1, "one in the second Shift");
}
