//! The gifts that an exchange at a real table may have consisted of, where nobody wrote them down: every choice is listed, and those that
//! cannot be are passed over. Who gives to whom is a matter of rank, as the rules have it; the engine has the last word when the completed
//! Shift is played.

use chefshat_engine::{ExchangePair, RuleSet, Seat, SeatOrder, SpecialAction};

use super::facts::{Counts, JOKER, Tally, contains, counts_of};

/// What the seats of a pair gave each other.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gifts {
    pub(super) chosen: Counts,
    pub(super) forced: Counts,
    /// The forced giver had no more ingredient cards than it gave.
    pub(super) short: bool,
}

/// Who exchanges cards in a Shift, given the order of the Shift before.
pub(super) fn pairs(rules: &RuleSet, order: Option<SeatOrder>, tally: &Tally) -> Vec<ExchangePair> {
    let Some(mut ranking) = order.filter(|_| rules.exchange()) else {
        return Vec::new();
    };
    if let Some((seat, true)) = tally.special {
        match SpecialAction::of_seat(seat, &ranking) {
            SpecialAction::FoodFight => ranking.reverse(),
            SpecialAction::DinnerIsServed => return Vec::new(),
        }
    }
    ExchangePair::all(&ranking).collect()
}

/// Every pair of gifts that what is told of the pair leaves open, in the order in which they leave the forced giver the widest choice of
/// what it keeps. `room` holds the cards that seats outside the pair do not hold for certain.
pub(super) fn candidates(
    rules: &RuleSet,
    tally: &Tally,
    pair: &ExchangePair,
    room: &Counts,
) -> impl Iterator<Item = Gifts> + use<> {
    let faces = rules.faces();
    let gifts_of = |seat: Seat, size: u8, kinds: &[usize]| {
        let whole = tally.given[seat].map(|cards| counts_of(cards, faces));
        let hand = tally.dealt[seat].map(|cards| counts_of(cards, faces));
        let mut gifts = choices(whole, size, kinds);
        gifts.retain(|gift| {
            contains(room, gift)
                && hand.is_none_or(|hand| contains(&hand, gift))
                && (seat != pair.chooser || contains(gift, &tally.gives[seat]))
        });
        gifts
    };
    // A hand may hold fewer ingredient cards than its seat has to give: all others are then jokers.
    let least = pair.least_gifts(rules);
    let mut sizes = Vec::new();
    for size in (least.max(1)..=pair.size).rev() {
        let mut forced = gifts_of(pair.forced, size, &kinds(faces, false));
        forced.sort_by_key(highest);
        let chosen = gifts_of(pair.chooser, size, &kinds(faces, true));
        sizes.push((size < pair.size, forced, chosen));
    }
    sizes.into_iter().flat_map(|(short, forced, chosen)| {
        forced.into_iter().flat_map(move |forced| {
            chosen.clone().into_iter().map(move |chosen| Gifts {
                chosen,
                forced,
                short,
            })
        })
    })
}

/// Where the highest kind of a gift is counted.
pub(super) fn highest(gift: &Counts) -> Option<usize> {
    gift.iter().rposition(|&count| count > 0)
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
