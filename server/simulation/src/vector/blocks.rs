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

/// What a block of games fills within a step. Between steps it is empty, but keeps its memory.
#[derive(Debug, Default)]
pub(super) struct Buffers {
    waiting: Waiting,
    part: Option<Part>,
}

/// Runs `work` for every game, advances those for which it returns true, and writes the rows. `step` is the number of the step: each begins with another
/// game of each block, so that all advance, even if the limit is reached in every step.
pub(super) fn run(
    slots: &mut [Slot],
    setup: &VectorSetup,
    pool: Option<&Arc<ThreadPool>>,
    buffers: &mut Vec<Buffers>,
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
    buffers.resize_with(blocks, Buffers::default);
    let budget = MAX_WORK_PER_STEP / blocks as u64;
    // The others are appended to the first, which becomes the result.
    buffers[0].part = Some(Part::new(setup, games));
    let block = |(slots, buffers): (&mut [Slot], &mut Buffers)| {
        let Buffers { waiting, part } = buffers;
        let part = part.get_or_insert_with(|| Part::new(setup, slots.len()));
        part.budget = budget;
        let first = (step % slots.len() as u64) as usize;
        for place in (first..slots.len()).chain(0..first) {
            let slot = &mut slots[place];
            if work(slot, part) {
                slot.advance(place, setup, part, waiting);
            }
        }
        let network = |number| setup.network(number);
        waiting.take_all(network, |waiting, place, action| {
            slots[place].advance_with(action, place, setup, part, waiting);
        });
        part.batch.sort_by_game();
        for slot in slots {
            slot.write_row(setup, part);
        }
    };
    match pool {
        Some(pool) if games > threads_from => {
            let blocks = slots.par_chunks_mut(size).zip(&mut *buffers);
            pool.install(|| blocks.for_each(block));
        }
        _ => slots.chunks_mut(size).zip(&mut *buffers).for_each(block),
    }
    let mut parts = buffers.iter_mut();
    let whole = parts.next().and_then(|first| first.part.take());
    let mut whole = whole.expect("there is at least one game");
    parts
        .filter_map(|next| next.part.as_mut())
        .for_each(|next| whole.append(next));
    whole
}
