//! Records of simulated games: replays each game of a batch, notes its decisions and writes its
//! record. `chefshat-record` decides the form.

use std::path::Path;

use chefshat_agents::Listener;
use chefshat_engine::{ActionId, BySeat, Decision, PlayedDecision};
use chefshat_record::jsonl;
use chefshat_record::jsonl::RecordFileError;
use chefshat_simulation::Batch;

use chefshat_record::convert::Played;
use chefshat_vector::simulation_policy;

/// Plays a game of a batch, by its index from 0, and writes its record to a directory.
///
/// # Errors
/// The file cannot be written.
pub(super) fn write(batch: &Batch, index: u64, folder: &Path) -> Result<(), RecordFileError> {
    let limit = batch
        .max_invalid_attempts()
        .map(|attempts| attempts.get() as usize);
    let mut notes = Notes {
        limit,
        ..Notes::default()
    };
    batch.play_game(index, &mut notes);
    let names: Vec<String> = batch.agents().values().map(|agent| agent.name()).collect();
    let played = Played {
        by: "simulate",
        rules: batch.rules(),
        agents: &BySeat::from_fn(names.len(), |seat| Some(names[seat.index()].as_str())),
        seed: batch.game_seed(index),
        scheme: batch.scheme(),
        policy: &simulation_policy(
            batch.max_invalid_attempts().map(|attempts| attempts.get()),
            batch.scheme(),
        ),
        decisions: &notes.decisions,
    };
    let path = folder.join(format!("{}.jsonl", played.game_id()));
    jsonl::write(&path, &played.record())
}

/// The decisions of a game, each after its invalid attempts.
#[derive(Default)]
struct Notes {
    limit: Option<usize>,
    decisions: Vec<PlayedDecision>,
    attempts: Vec<ActionId>,
}

impl Listener for Notes {
    fn on_invalid(&mut self, _: Decision, action: ActionId) {
        self.attempts.push(action);
    }

    fn on_decision(&mut self, _: Decision, action: ActionId) {
        let attempts = std::mem::take(&mut self.attempts);
        self.decisions.push(PlayedDecision {
            action,
            by_default: self.limit.is_some_and(|limit| attempts.len() >= limit),
            attempts,
        });
    }
}
