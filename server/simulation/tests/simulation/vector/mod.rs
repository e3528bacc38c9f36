//! Vector environments. Shared here: setups, a policy, and reading columns.

mod episodes;
mod histories;
mod limits;
mod networks;
mod play;
mod starts;
mod states;

use chefshat_agents::AgentKind;
use chefshat_engine::{ActionId, Mask, RuleSet, RuleSetSpec};
use chefshat_simulation::vector::{Batch, PlayedGame, Seeds, VectorGames, VectorSetup};

fn rules() -> RuleSet {
    RuleSetSpec::default().validate().unwrap()
}

fn all_client(games: u32) -> VectorSetup {
    VectorSetup::new(rules(), games, &[None; 4], Seeds::Base(7)).unwrap()
}

fn against(agents: [AgentKind; 3], games: u32) -> VectorSetup {
    let agents = [None, Some(agents[0]), Some(agents[1]), Some(agents[2])];
    VectorSetup::new(rules(), games, &agents, Seeds::Base(7)).unwrap()
}

fn values<const N: usize, T>(column: &[u8], value: fn([u8; N]) -> T) -> Vec<T> {
    let (chunks, _) = column.as_chunks();
    chunks.iter().map(|bytes| value(*bytes)).collect()
}

fn u32s(column: &[u8]) -> Vec<u32> {
    values(column, u32::from_le_bytes)
}

fn u64s(column: &[u8]) -> Vec<u64> {
    values(column, u64::from_le_bytes)
}

fn f32s(column: &[u8]) -> Vec<f32> {
    values(column, f32::from_le_bytes)
}

fn masks(batch: &Batch) -> Vec<Mask> {
    let width = batch.masks.len() / (batch.rows as usize).max(1);
    batch
        .masks
        .chunks(width.max(1))
        .map(|bytes| Mask::from_bytes(bytes).unwrap())
        .collect()
}

/// A policy without a generator: which legal action depends on the step and the row.
fn some_action(mask: &Mask, step: u64, row: usize) -> ActionId {
    let number = (step.wrapping_mul(31) + row as u64 * 17 + 5).wrapping_mul(0x9e37_79b9) >> 16;
    mask.nth(number as usize % mask.len()).unwrap()
}

fn some_actions(batch: &Batch) -> Vec<ActionId> {
    (masks(batch).iter().enumerate())
        .map(|(row, mask)| some_action(mask, batch.step, row))
        .collect()
}

/// Plays until all games are over and calls back with every batch.
fn play_out(setup: VectorSetup, mut look: impl FnMut(&VectorGames, &Batch)) -> Vec<PlayedGame> {
    let (mut games, mut batch) = VectorGames::new(setup);
    let mut played = Vec::new();
    for _ in 0..100_000 {
        look(&games, &batch);
        played.append(&mut batch.played);
        if batch.done {
            return played;
        }
        batch = games.step(&some_actions(&batch)).unwrap();
    }
    panic!("the games do not end");
}
