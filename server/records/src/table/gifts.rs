//! The gifts that an exchange at a real table may have consisted of, where nobody wrote them down: every choice is listed, and those that
//! cannot be are passed over. Who gives to whom is a matter of rank, as the rules have it; the engine has the last word when the completed
//! Shift is played.

use chefshat_engine::{RuleSet, Seat, SeatOrder};

use super::facts::{Counts, JOKER, Tally, counts_of};

/// Two seats that exchange cards.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    /// Gives what it chooses.
    pub(super) chooser: Seat,
    /// Gives its rarest ingredient cards.
    pub(super) forced: Seat,
    /// How many cards each gives.
    pub(super) size: u8,
}

/// What the seats of a pair gave each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gifts {
    pub(super) chosen: Counts,
    pub(super) forced: Counts,
    /// The forced giver had no more ingredient cards than it gave.
    pub(super) short: bool,
}

/// Who exchanges cards in a Shift, given the order of the Shift before.
pub(super) fn pairs(rules: &RuleSet, order: Option<SeatOrder>, tally: &Tally) -> Vec<Pair> {
    let Some(order) = order.filter(|_| rules.exchange()) else {
        return Vec::new();
    };
    let mut ranking = order.as_slice().to_vec();
    match tally.special {
        Some((seat, true)) if ranking.last() == Some(&seat) => ranking.reverse(),
        Some((_, true)) => return Vec::new(),
        _ => {}
    }
    let last = ranking.len() - 1;
    [(0, 2), (1, 1)]
        .into_iter()
        .take(if ranking.len() < 4 { 1 } else { 2 })
        .map(|(rank, size)| Pair {
            chooser: ranking[rank],
            forced: ranking[last - rank],
            size,
        })
        .collect()
}

/// Every pair of gifts that what is told of the pair leaves open, the rarest cards first.
pub(super) fn candidates(rules: &RuleSet, tally: &Tally, pair: &Pair) -> Vec<Gifts> {
    let faces = rules.faces();
    let whole = |seat: Seat| tally.given[seat].map(|cards| counts_of(cards, faces));
    let mut all = Vec::new();
    // A hand may hold fewer ingredient cards than its seat has to give: all others are then jokers.
    let least = rules
        .hand_size()
        .saturating_sub(rules.jokers())
        .min(pair.size);
    for size in (least.max(1)..=pair.size).rev() {
        let short = size < pair.size;
        let of_face = kinds(faces, false);
        let any = kinds(faces, true);
        for forced in choices(whole(pair.forced), size, &of_face) {
            for chosen in choices(whole(pair.chooser), size, &any) {
                let told = &tally.gives[pair.chooser];
                if chosen.iter().zip(told).all(|(chosen, told)| chosen >= told) {
                    all.push(Gifts {
                        chosen,
                        forced,
                        short,
                    });
                }
            }
        }
    }
    all
}

/// How many cards are counted.
pub(super) fn size_of(counts: &Counts) -> u8 {
    counts
        .iter()
        .fold(0, |sum: u8, count| sum.saturating_add(*count))
}

fn kinds(faces: u8, jokers: bool) -> Vec<usize> {
    (0..usize::from(faces))
        .chain(jokers.then_some(JOKER))
        .collect()
}

/// The gift that is told if it has this size, or all gifts of one or two cards of these kinds.
fn choices(told: Option<Counts>, size: u8, kinds: &[usize]) -> Vec<Counts> {
    if let Some(told) = told {
        return Vec::from_iter((size_of(&told) == size).then_some(told));
    }
    let one = |kind: usize| {
        let mut counts = [0; JOKER + 1];
        counts[kind] = 1;
        counts
    };
    if size == 1 {
        return kinds.iter().map(|kind| one(*kind)).collect();
    }
    let mut all = Vec::new();
    for (position, first) in kinds.iter().enumerate() {
        for second in &kinds[position..] {
            let mut counts = one(*first);
            counts[*second] += 1;
            all.push(counts);
        }
    }
    all
}
