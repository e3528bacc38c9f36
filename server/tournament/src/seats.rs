//! Which seats the participants of a table take: everybody each seat about equally often. For formats that draw round by round; those of a
//! round robin are spread over all rounds at once, in `round_robin`.

use super::chance::Chance;
use super::course::Course;

/// Orders the participants of each table so that their first games of pairings spread over the seats: of two neighbours or others who would
/// both rather have the other's seat, or one more than the other, the seats are exchanged. Draws decide the rest.
pub(super) fn spread(course: &Course, tables: &mut [Vec<usize>], chance: &mut Chance) {
    let seats = course.settings.players;
    let mut had = vec![0u32; course.participants.len() * seats];
    for pairing in &course.pairings {
        for (seat, who) in pairing.table.iter().enumerate() {
            had[who * seats + seat] += 1;
        }
    }
    for table in tables {
        chance.shuffle(table);
        let times = |who: usize, seat: usize| had[who * seats + seat];
        // Every exchange makes the sum smaller, so there is an end.
        while let Some((a, b)) = pairs(table.len()).find(|&(a, b)| {
            let now = times(table[a], a) + times(table[b], b);
            times(table[a], b) + times(table[b], a) < now
        }) {
            table.swap(a, b);
        }
    }
}

/// All pairs of numbers below `n`, the lower first.
fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |a| (a + 1..n).map(move |b| (a, b)))
}
