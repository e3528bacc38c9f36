//! Games are stepped in blocks, by one thread or by several. The blocks, and what each may do within
//! a step, do not depend on the threads, so neither do the results.

use std::sync::Arc;

use rayon::ThreadPool;
use rayon::prelude::*;

use super::part::Part;
use super::setup::VectorSetup;
use super::slot::Slot;

/// Games of a block.
const BLOCK: usize = 64;
/// Fewest games that are worth several threads, if their agents decide fast.
const MANY: usize = 256;
/// Maximum number of decisions and invalid attempts of built-in agents within one step, over all
/// games: about a second. Games not advanced have no row and continue with the next step.
const MAX_WORK_PER_STEP: u64 = 10_000_000;

/// Runs `work` for every game and writes the rows.
pub(super) fn run(
    slots: &mut [Slot],
    setup: &VectorSetup,
    pool: Option<&Arc<ThreadPool>>,
    work: impl Fn(&mut Slot, &mut Part) + Sync,
) -> Part {
    let games = slots.len();
    let budget = MAX_WORK_PER_STEP / games.div_ceil(BLOCK) as u64;
    let block = |(number, slots): (usize, &mut [Slot])| {
        // The others are appended to the first.
        let rows = if number == 0 { games } else { slots.len() };
        let mut part = Part::new(setup, rows, budget);
        for slot in slots {
            work(slot, &mut part);
            slot.write_row(&mut part);
        }
        part
    };
    let whole = match pool {
        Some(pool) if games > fewest_for_threads(setup) => {
            let blocks = slots.par_chunks_mut(BLOCK).enumerate().map(block);
            let parts: Vec<Part> = pool.install(|| blocks.collect());
            parts.into_iter().reduce(Part::append)
        }
        _ => {
            let blocks = slots.chunks_mut(BLOCK).enumerate().map(block);
            blocks.reduce(Part::append)
        }
    };
    whole.expect("there is at least one game")
}

/// The number of games up to which one thread is faster than several.
fn fewest_for_threads(setup: &VectorSetup) -> usize {
    match setup.has_slow_agents() {
        true => BLOCK,
        false => MANY,
    }
}
