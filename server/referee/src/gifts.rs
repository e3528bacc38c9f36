//! The possible gifts of an exchange at a real table: all gifts of a pair that fit the facts about
//! the pair. Whether they fit the hands is in `candidates`.

use chefshat_engine::{ExchangePair, RuleSet, Seat, SeatOrder, SpecialAction};

use crate::counts::{Counts, JOKER, NOTHING, contains, counts_of, highest, size_of};
use crate::facts::Tally;

/// The gifts of a pair.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gifts {
    pub(crate) chosen: Counts,
    pub(crate) forced: Counts,
    /// Whether the forced giver had no further ingredient cards.
    pub(crate) short: bool,
}

/// The pairs that exchange cards in a Shift, given the order of the last one and who declared a
/// special action; none in the first Shift.
pub(crate) fn pairs(
    rules: &RuleSet,
    order: Option<SeatOrder>,
    declared: Option<Seat>,
) -> Vec<ExchangePair> {
    let Some(mut ranking) = order.filter(|_| rules.exchange()) else {
        return Vec::new();
    };
    if let Some(seat) = declared {
        match SpecialAction::of_seat(seat, &ranking) {
            SpecialAction::FoodFight => ranking.reverse(),
            SpecialAction::DinnerIsServed => return Vec::new(),
        }
    }
    ExchangePair::all(&ranking).collect()
}

/// All gifts that fit the facts about the pair, those first that least restrict what the forced
/// giver keeps. `room` contains the cards not certainly held outside the pair.
pub(crate) fn possible_gifts(
    rules: &RuleSet,
    tally: &Tally,
    pair: &ExchangePair,
    room: &Counts,
) -> impl Iterator<Item = Gifts> + use<> {
    let faces = rules.faces();
    let gifts_of = |seat: Seat, size: u8, kinds: &[usize]| {
        let stated = tally.given[seat].map(|cards| counts_of(cards, faces));
        let hand = tally.dealt[seat].map(|cards| counts_of(cards, faces));
        let mut gifts = choices(stated, size, kinds);
        gifts.retain(|gift| {
            contains(room, gift)
                && hand.is_none_or(|hand| contains(&hand, gift))
                && (seat != pair.chooser || contains(gift, &tally.gives[seat]))
        });
        gifts
    };
    // A giver may be short of ingredient cards; the rest of its hand is then jokers.
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

fn kinds(faces: u8, jokers: bool) -> Vec<usize> {
    (0..usize::from(faces))
        .chain(jokers.then_some(JOKER))
        .collect()
}

/// The stated gift if it has this size, or else all gifts of one or two cards of these kinds.
fn choices(stated: Option<Counts>, size: u8, kinds: &[usize]) -> Vec<Counts> {
    if let Some(stated) = stated {
        return Vec::from_iter((size_of(&stated) == size).then_some(stated));
    }
    let one = |kind: usize| {
        let mut counts = NOTHING;
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
