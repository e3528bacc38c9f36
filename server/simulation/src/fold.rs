//! Working through a row of independent items on all cores so that the outcome depends on the items alone. What the items are is known to
//! the callers.

use rayon::prelude::*;

/// Chunks whose results are held at a time.
const WAVE: u64 = 1024;

/// Folds the items 0..`count` on the threads of the rayon pool it is called in: `add` an item to what those just before it came to; `merge`
/// what later items came to. `chunk` items (at least 1) are added to one value by one thread. Which items are added to which value, and
/// the order of merging, depend on `count` and `chunk` alone, so that sums of fractions come out the same on any machine.
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
