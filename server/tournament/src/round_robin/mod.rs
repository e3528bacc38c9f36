//! The rounds of a round robin: everybody meets everybody, has each seat and sits out as often as everybody else, as far as numbers allow.
//!
//! With n participants and s seats, n a multiple of s or one more, the rounds are made of a *cycle*: one round such that, when all its
//! participants move on by one again and again, every two meet equally often; it is found by search (`cycle`). Rounds beyond whole cycles,
//! and fields of other sizes, are searched for as they are (`meetings`). Then the seats are spread (`seating`), which always comes
//! out even. Byes are given out evenly from the start and stay so.
//!
//! How even it gets at tables of four, in one round less than there are participants: with 4, 8, …, 32 participants any two meet three times;
//! with one participant more two or three times; with other numbers below 16, but for 6, they meet within one of each other; above,
//! nearly all do, and hardly anybody is two off. Nobody has a bye, or a seat, more than once more often than another.

mod cycle;
mod meetings;
mod seating;

use std::cmp::Reverse;

use super::chance::Chance;
use super::draw::Drawing;
use meetings::Meetings;

/// All rounds, for at least as many participants as there are seats.
pub(super) fn plan(
    participants: usize,
    seats: usize,
    rounds: u32,
    chance: &mut Chance,
) -> Vec<Drawing> {
    let rounds = rounds as usize;
    let mut plan = Vec::with_capacity(rounds);
    let cycle = cycle::find(participants, seats, chance);
    let length = cycle.rounds();
    // A cycle that lacks its last round is as even as it can be.
    let cycles = (rounds + 1) / length;
    plan.extend((0..rounds.min(cycles * length)).map(|round| cycle.round(round)));
    let searched = if cycle.is_equal() { plan.len() } else { 0 };
    add_rounds(&mut plan, participants, seats, rounds, chance);
    let mut meetings = Meetings::new(participants, seats, plan);
    meetings.even_out(searched, chance);
    let rounds = meetings.into_rounds();
    let mut names: Vec<usize> = (0..participants).collect();
    chance.shuffle(&mut names);
    let tables = participants / seats;
    let mut drawings: Vec<Drawing> = rounds
        .into_iter()
        .map(|round| {
            let named: Vec<usize> = round.into_iter().map(|number| names[number]).collect();
            let (seated, byes) = named.split_at(tables * seats);
            let mut byes = byes.to_vec();
            byes.sort_unstable();
            Drawing {
                tables: seated.chunks(seats).map(<[usize]>::to_vec).collect(),
                byes,
            }
        })
        .collect();
    let all = drawings.iter_mut().flat_map(|round| &mut round.tables);
    seating::spread(all.collect(), participants, seats);
    drawings
}

/// Adds rounds at random, with byes for those who have had the fewest, until there are so many.
fn add_rounds(
    plan: &mut Vec<Vec<usize>>,
    participants: usize,
    seats: usize,
    rounds: usize,
    chance: &mut Chance,
) {
    let seated = participants / seats * seats;
    let mut byes = vec![0; participants];
    for round in plan.iter() {
        round[seated..].iter().for_each(|&who| byes[who] += 1);
    }
    while plan.len() < rounds {
        let mut round: Vec<usize> = (0..participants).collect();
        chance.shuffle(&mut round);
        // Those with the fewest byes last: they sit out.
        round.sort_by_key(|&who| Reverse(byes[who]));
        round[seated..].iter().for_each(|&who| byes[who] += 1);
        chance.shuffle(&mut round[..seated]);
        plan.push(round);
    }
}
