//! The tables of a knockout. In the first round the draw decides, fillers spread as evenly as can be; then the first two of each table go
//! on, two neighbouring tables to one, so that the two halves of the field meet in the final.

use super::chance::Chance;
use super::course::{Course, Pairing};
use super::draw::Drawing;
use super::settings::KNOCKOUT_SEATS;
use super::standings::order_of_pairing;

/// How many of a table go on.
const ADVANCING: usize = KNOCKOUT_SEATS / 2;

/// The tables of the next round.
pub(super) fn draw(course: &Course, chance: &mut Chance) -> Drawing {
    let tables = if course.drawn == 0 {
        first_round(course, chance)
    } else {
        next_round(course)
    };
    Drawing {
        tables,
        byes: Vec::new(),
    }
}

fn first_round(course: &Course, chance: &mut Chance) -> Vec<Vec<usize>> {
    let everybody = 0..course.participants.len();
    let (fillers, mut others): (Vec<usize>, Vec<usize>) =
        everybody.partition(|&who| course.participants[who].filler);
    chance.shuffle(&mut others);
    let count = course.participants.len() / KNOCKOUT_SEATS;
    let mut tables = vec![Vec::with_capacity(KNOCKOUT_SEATS); count];
    for (turn, filler) in fillers.into_iter().enumerate() {
        tables[far_apart(turn % count, count)].push(filler);
    }
    let mut others = others.into_iter();
    for table in &mut tables {
        table.extend(others.by_ref().take(KNOCKOUT_SEATS - table.len()));
    }
    tables
}

/// The tables one after the other (their number is a power of two) so that each half, each quarter, … gets as many of them as its neighbour:
/// the bits of the turn, reversed.
fn far_apart(turn: usize, tables: usize) -> usize {
    let bits = tables.trailing_zeros();
    (0..bits).fold(0, |table, bit| table << 1 | (turn >> bit & 1))
}

fn next_round(course: &Course) -> Vec<Vec<usize>> {
    let last: Vec<&Pairing> = course
        .pairings
        .iter()
        .filter(|pairing| pairing.round == course.drawn)
        .collect();
    let advancing = |pairing: &&Pairing| {
        let mut order = order_of_pairing(course, pairing);
        order.truncate(ADVANCING);
        order
    };
    last.chunks(2)
        .map(|neighbours| neighbours.iter().flat_map(advancing).collect())
        .collect()
}
