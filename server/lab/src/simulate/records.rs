//! Records of simulated games: replays each game of a batch, notes its decisions and writes its
//! record. `chefshat-record` decides the form.

use std::path::Path;

use chefshat_agents::DecisionNotes;
use chefshat_engine::BySeat;
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
    let limit = batch.max_invalid_attempts();
    let mut notes = DecisionNotes::new(limit);
    batch.play_game(index, &mut notes);
    let names: Vec<String> = batch.agents().values().map(|agent| agent.name()).collect();
    let played = Played {
        by: "simulate",
        rules: batch.rules(),
        agents: &BySeat::from_fn(names.len(), |seat| Some(names[seat.index()].as_str())),
        seed: batch.game_seed(index),
        scheme: batch.scheme(),
        policy: &simulation_policy(limit.map(|attempts| attempts.get()), batch.scheme()),
        decisions: notes.decisions(),
    };
    let path = folder.join(format!("{}.jsonl", played.game_id()));
    jsonl::write(&path, &played.record())
}
