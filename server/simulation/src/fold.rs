//! Folds independent items on all cores with a result that depends on the items alone.

use rayon::prelude::*;

/// Called from any thread with the number of items finished since its last call. Not generic: what
/// runs on all cores would be compiled again for each caller.
pub type Progress<'a> = &'a (dyn Fn(u64) + Sync);

/// Chunks whose results are in memory at a time.
const WAVE: u64 = 1024;

/// Folds the items 0..`count` on the current rayon pool: `add` adds an item to a value; `merge`
/// merges the value of later items into it. One thread adds `chunk` items (at least 1) to one
/// value. Grouping and order depend on `count` and `chunk` alone, so that sums of fractions are the
/// same on every machine.
pub(crate) fn fold_in_order<T: Send>(
    count: u64,
    chunk: u64,
    empty: impl Fn() -> T + Sync,
    add: impl Fn(&mut T, u64) + Sync,
    mut merge: impl FnMut(&mut T, T),
) -> T {
    let chunks = count.div_ceil(chunk);
    let mut all = empty();
    for first in (0..chunks).step_by(WAVE as usize) {
        let wave: Vec<T> = (first..chunks.min(first + WAVE))
            .into_par_iter()
            .map(|number| {
                let mut part = empty();
                let items = number * chunk..count.min(number.saturating_add(1) * chunk);
                items.for_each(|item| add(&mut part, item));
                part
            })
            .collect();
        wave.into_iter().for_each(|part| merge(&mut all, part));
    }
    all
}
