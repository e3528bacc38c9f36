//! Tables of a knockout. The first round is random, with fillers spread evenly. After that, the
//! first two of two neighbouring tables form one table, so that the two halves of the field meet in
//! the final. Those who have left advance only if nobody else can.

use super::chance::Chance;
use super::settings::KNOCKOUT_SEATS;
use super::standings::order_of_pairing;
use super::state::{Pairing, Pairings, TournamentState};

/// Participants of a table that advance.
const ADVANCING: usize = KNOCKOUT_SEATS / 2;

/// The tables of the next round.
pub(super) fn draw(state: &TournamentState, chance: &mut Chance) -> Pairings {
    let tables = if state.drawn == 0 {
        first_round(state, chance)
    } else {
        next_round(state)
    };
    Pairings {
        tables,
        byes: Vec::new(),
    }
}

fn first_round(state: &TournamentState, chance: &mut Chance) -> Vec<Vec<usize>> {
    let everybody = state.field.iter().copied();
    let (fillers, mut others): (Vec<usize>, Vec<usize>) =
        everybody.partition(|&who| state.participants[who].filler);
    chance.shuffle(&mut others);
    let count = state.field.len() / KNOCKOUT_SEATS;
    let mut tables = vec![Vec::with_capacity(KNOCKOUT_SEATS); count];
    for (turn, filler) in fillers.into_iter().enumerate() {
        tables[bit_reversed(turn % count, count)].push(filler);
    }
    let mut others = others.into_iter();
    for table in &mut tables {
        table.extend(others.by_ref().take(KNOCKOUT_SEATS - table.len()));
    }
    tables
}

/// Table for the n-th filler: the bits of n reversed, so that each half, quarter and so on gets as
/// many. The number of tables is a power of two.
fn bit_reversed(turn: usize, tables: usize) -> usize {
    let bits = tables.trailing_zeros();
    (0..bits).fold(0, |table, bit| table << 1 | (turn >> bit & 1))
}

fn next_round(state: &TournamentState) -> Vec<Vec<usize>> {
    let last: Vec<&Pairing> = state
        .pairings
        .iter()
        .filter(|pairing| pairing.round == state.drawn)
        .collect();
    let advancing = |pairing: &&Pairing| {
        let mut order = order_of_pairing(state, pairing);
        // Those who have left make room for the next.
        order.sort_by_key(|&who| state.withdrawn[who]);
        order.truncate(ADVANCING);
        order
    };
    last.chunks(2)
        .map(|neighbours| neighbours.iter().flat_map(advancing).collect())
        .collect()
}
