//! Tests of datasets, a module for each subject, and their shared helpers.

#![allow(
    clippy::unwrap_used,
    reason = "a test fails by it, in its helpers as well"
)]

mod choice;
mod expressions;
mod files;
mod folder;
mod golden;
mod gym;
mod missing;
mod rows;

use std::path::PathBuf;

use chefshat_dataset::{Export, ExportError, Exported, Filter, Format, Layout};
use chefshat_engine::{ActionId, Game, MetricsRecorder, RewardScheme, RuleSet, RuleSetSpec, Seat};
use chefshat_engine::{Seed, ShiftMetrics, Stop};
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::files::find_records;
use chefshat_record::jsonl;
use serde_json::Value;
use tempfile::TempDir;

use chefshat_record::testing::TestGame;

/// A folder with records and a place for datasets.
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
            licence: "CC-BY-4.0".into(),
            version: "test".into(),
        }
    }

    fn run(&self, export: &Export) -> Result<Exported, ExportError> {
        export.run(&find_records(&[self.records()]).files, |_| {})
    }

    fn rows(&self, table: &str) -> Vec<Value> {
        let text = std::fs::read_to_string(self.out().join(format!("{table}.jsonl"))).unwrap();
        text.lines()
            .map(|line| serde_json::from_str(line).unwrap())
            .collect()
    }

    /// The entries of the folder except the records.
    fn leftovers(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.folder.path()).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.filter(|name| name != "records").collect()
    }
}

/// The default rules with this number of Shifts.
fn rules(shifts: u32) -> RuleSet {
    let spec = RuleSetSpec {
        stop: Stop::Shifts(shifts),
        ..RuleSetSpec::default()
    };
    spec.validate().unwrap()
}

/// The record of a game of two Shifts, with a number that identifies it.
fn a_record(number: u8) -> Vec<v1::RecordLine> {
    let game = TestGame::dealt(rules(2), number, u64::from(number));
    let mut lines = game.record(|_| v1::DecisionSource::Agent);
    rename(&mut lines, number);
    lines
}

/// Sets the id and the room of a record by its number.
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

/// The record with lines added before decisions, by their index, and its events renumbered.
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
    renumbered(all)
}

/// The record with its events renumbered.
fn renumbered(mut lines: Vec<v1::RecordLine>) -> Vec<v1::RecordLine> {
    let mut events = 0;
    for line in &mut lines {
        match &mut line.line {
            Some(Line::Event(event)) => {
                events += 1;
                event.sequence = events;
            }
            Some(Line::Footer(footer)) => footer.events = events,
            _ => {}
        }
    }
    lines
}

/// The metrics of a record's Shifts by the engine's recorder, independent of datasets.
fn counted(lines: &[v1::RecordLine], scheme: RewardScheme) -> Vec<ShiftMetrics> {
    let rules = rules(2);
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
        let action = ActionId::new(u16::try_from(decision.action).unwrap());
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
