//! Games are stepped in blocks, by one thread or by several. The blocks, and what each may do within
//! a step, do not depend on the threads, so neither do the results.

use std::sync::Arc;

use rayon::ThreadPool;
use rayon::prelude::*;

use super::part::Part;
use super::setup::VectorSetup;
use super::slot::Slot;
use super::waiting::Waiting;

/// Games of a block.
const BLOCK: usize = 64;
/// Games of a block if their agents take long.
const SLOW_BLOCK: usize = 32;
/// Fewest games that are worth several threads, if their agents decide fast.
const MANY: usize = 256;
/// Maximum number of decisions and invalid attempts of built-in agents within one step, over all
/// games: a few seconds of one thread at most. A decision of a network counts as several.
/// Games not advanced have no row and continue with the next step.
const MAX_WORK_PER_STEP: u64 = 10_000_000;

/// Runs `work` for every game, advances those for which it returns true, and writes the rows.
/// `waiting` has the buffers of the blocks. `step` is the number of the step: each begins with another
/// game of each block, so that all advance, even if the limit is reached in every step.
pub(super) fn run(
    slots: &mut [Slot],
    setup: &VectorSetup,
    pool: Option<&Arc<ThreadPool>>,
    waiting: &mut Vec<Waiting>,
    step: u64,
    work: impl Fn(&mut Slot, &mut Part) -> bool + Sync,
) -> Part {
    let games = slots.len();
    // Part of the result, so it does not depend on the threads.
    let (size, threads_from) = match setup.has_slow_agents() {
        true => (SLOW_BLOCK, SLOW_BLOCK),
        false => (BLOCK, MANY),
    };
    let blocks = games.div_ceil(size);
    waiting.resize_with(blocks, Waiting::default);
    let budget = MAX_WORK_PER_STEP / blocks as u64;
    let block = |(number, (slots, waiting)): (usize, (&mut [Slot], &mut Waiting))| {
        // The others are appended to the first.
        let rows = if number == 0 { games } else { slots.len() };
        let mut part = Part::new(setup, rows, budget);
        let first = (step % slots.len() as u64) as usize;
        for place in (first..slots.len()).chain(0..first) {
            let slot = &mut slots[place];
            if work(slot, &mut part) {
                slot.advance(place, setup, &mut part, waiting);
            }
        }
        let network = |number| setup.network(number);
        waiting.take_all(network, |waiting, place, action| {
            slots[place].advance_with(action, place, setup, &mut part, waiting);
        });
        part.batch.sort_by_game();
        for slot in slots {
            slot.write_row(setup, &mut part);
        }
        part
    };
    let whole = match pool {
        Some(pool) if games > threads_from => {
            let blocks = slots.par_chunks_mut(size).zip(waiting).enumerate();
            let parts: Vec<Part> = pool.install(|| blocks.map(block).collect());
            parts.into_iter().reduce(Part::append)
        }
        _ => {
            let blocks = slots.chunks_mut(size).zip(waiting).enumerate();
            blocks.map(block).reduce(Part::append)
        }
    };
    whole.expect("there is at least one game")
}
