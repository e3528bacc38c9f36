//! Which seats the participants of a table take, so that everyone has each seat about equally
//! often. Formats that pair round by round balance each round against the earlier ones; a round
//! robin balances all rounds at once.

use super::chance::Chance;
use super::state::TournamentState;

/// Orders the participants of each table to balance the seats over all rounds: two participants
/// swap seats if that makes their use of the seats more even. Ties are random.
pub(super) fn spread_round(
    state: &TournamentState,
    tables: &mut [Vec<usize>],
    chance: &mut Chance,
) {
    let seats = state.settings.players;
    let mut had = vec![0u32; state.participants.len() * seats];
    for pairing in &state.pairings {
        for (seat, who) in pairing.table.iter().enumerate() {
            had[who * seats + seat] += 1;
        }
    }
    for table in tables {
        chance.shuffle(table);
        let times = |who: usize, seat: usize| had[who * seats + seat];
        // Every swap lowers the sum, so the loop terminates.
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

/// Orders the participants of all tables so that everyone has each seat equally often, or once more
/// than another.
///
/// Take two seats. Each table is an edge between the participants who have them. Edges can be
/// directed so that at every participant as many go out as come in, except for one where their
/// number is odd: walk along edges until none is left, directing each the way of the walk, starting
/// at participants with an odd number. This balances the two seats and leaves the others unchanged.
/// Repeated for every two seats that differ by more than one it terminates, because the sum of the
/// squares falls each time.
pub(super) fn spread_plan(mut tables: Vec<&mut Vec<usize>>, participants: usize, seats: usize) {
    loop {
        let mut is_even = true;
        for first in 0..seats {
            for second in first + 1..seats {
                if differ(&tables, participants, first, second) {
                    is_even = false;
                    even_out(&mut tables, participants, first, second);
                }
            }
        }
        if is_even {
            return;
        }
    }
}

/// Whether a participant has one of the two seats more than once more often than the other.
fn differ(tables: &[&mut Vec<usize>], participants: usize, first: usize, second: usize) -> bool {
    let mut balance = vec![0i64; participants];
    for table in tables {
        balance[table[first]] += 1;
        balance[table[second]] -= 1;
    }
    balance.iter().any(|more| more.abs() > 1)
}

/// Balances two seats.
fn even_out(tables: &mut [&mut Vec<usize>], participants: usize, first: usize, second: usize) {
    let mut edges: Vec<Vec<usize>> = vec![Vec::new(); participants];
    for (index, table) in tables.iter().enumerate() {
        edges[table[first]].push(index);
        edges[table[second]].push(index);
    }
    let mut is_directed = vec![false; tables.len()];
    // Walks from participants with an odd number of edges end at others like them; after that every
    // walk ends where it began.
    let odd: Vec<usize> = (0..participants)
        .filter(|&who| edges[who].len() % 2 == 1)
        .collect();
    for start in odd.into_iter().chain(0..participants) {
        let mut who = start;
        while let Some(edge) = edges[who].pop() {
            if std::mem::replace(&mut is_directed[edge], true) {
                continue;
            }
            if tables[edge][first] != who {
                tables[edge].swap(first, second);
            }
            who = tables[edge][second];
        }
    }
}
