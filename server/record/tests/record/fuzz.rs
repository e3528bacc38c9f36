//! Fuzz targets: edited records and transcripts are read or refused, never a panic. `cargo test` runs
//! each some thousand times; `cargo bolero test` guides it by coverage for as long as one likes.

use std::path::Path;

use bolero::check;
use chefshat_engine::{RuleSetSpec, Stop};
use chefshat_record::import::import;
use chefshat_record::jsonl;
use chefshat_record::replay::replay;
use chefshat_record::testing::{Edits, Observed, TestGame, transcript};

/// Runs of each target in `cargo test`.
const RUNS: usize = 2_000;

/// A game with few cards.
fn short_game() -> TestGame<'static> {
    let spec = RuleSetSpec {
        faces: 4,
        stop: Stop::Shifts(2),
        ..RuleSetSpec::default()
    };
    TestGame::dealt(spec.validate().unwrap(), 3, 5)
}

#[test]
fn edited_records_are_verified_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("record.jsonl");
    let lines = short_game().played();
    jsonl::write(&file, &lines).unwrap();
    let original = std::fs::read(&file).unwrap();
    replays(&file).unwrap();
    check!()
        .with_type::<Edits>()
        .with_iterations(RUNS)
        .for_each(|edits| {
            std::fs::write(&file, edits.apply(&original)).unwrap();
            if let Err(problem) = replays(&file) {
                assert!(!problem.contains(char::is_control), "{problem:?}");
            }
        });
}

fn replays(file: &Path) -> Result<(), String> {
    let lines = jsonl::read(file).map_err(|error| error.to_string())?;
    replay(&lines).map_err(|error| error.to_string())?;
    Ok(())
}

#[test]
fn edited_transcripts_are_imported_or_refused() {
    let lines = short_game().played();
    let originals = [Observed::TURNS, Observed::EVERYTHING]
        .map(|observed| transcript(&short_game().rules, &lines, observed));
    for original in &originals {
        import(original.as_bytes()).unwrap();
    }
    check!()
        .with_type::<(bool, Edits)>()
        .with_iterations(RUNS)
        .for_each(|(everything, edits)| {
            let original = &originals[usize::from(*everything)];
            // What is imported has been verified.
            let _ = import(&edits.apply(original.as_bytes()));
        });
}
