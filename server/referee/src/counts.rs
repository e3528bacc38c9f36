//! Counts of cards by kind. Unlike the engine's `Cards` they can exceed a deck, as stated facts
//! may.

use chefshat_engine::{Action, Cards, Face, RuleSet};

/// Cards by kind: index f-1 counts face f, [`JOKER`] the jokers.
pub type Counts = [u8; JOKER + 1];
/// The index of the jokers.
pub const JOKER: usize = chefshat_engine::MAX_FACES as usize;

/// No cards.
pub const NOTHING: Counts = [0; JOKER + 1];

/// Adds the cards of an action; saturates far above any deck.
pub(crate) fn add_action(counts: &mut Counts, cards: Action) {
    let (face, quantity, jokers) = match cards {
        Action::Play {
            face,
            quantity,
            jokers,
        } => (Some(face), quantity, jokers),
        Action::Give(face) => (Some(face), 1, 0),
        Action::LoneJoker | Action::GiveJoker => (None, 0, 1),
        Action::Pass | Action::Decline | Action::Declare => (None, 0, 0),
    };
    if let Some(face) = face {
        let count = &mut counts[index(face)];
        *count = count.saturating_add(quantity);
    }
    counts[JOKER] = counts[JOKER].saturating_add(jokers);
}

/// The cards of an action.
pub(crate) fn counts_of_action(action: Action) -> Counts {
    let mut counts = NOTHING;
    add_action(&mut counts, action);
    counts
}

/// The kind of a face.
pub fn index(face: Face) -> usize {
    usize::from(face.get()) - 1
}

/// Counts the cards by kind.
pub(crate) fn counts_of(cards: Cards, faces: u8) -> Counts {
    let mut counts = [0; JOKER + 1];
    for (slot, count) in counts.iter_mut().zip(cards.counts(faces)) {
        *slot = count;
    }
    counts[usize::from(faces)..JOKER].fill(0);
    counts[JOKER] = cards.jokers();
    counts
}

/// Cards of a deck by kind; `None` if no deck has them.
pub(crate) fn cards_of(rules: &RuleSet, counts: &Counts, golden: bool) -> Option<Cards> {
    let faces = rules.faces();
    let mut list = counts[..usize::from(faces)].to_vec();
    list.push(counts[JOKER]);
    Cards::from_counts(faces, &list, golden)
}

/// Whether `all` contains every card of `some`.
pub(crate) fn contains(all: &Counts, some: &Counts) -> bool {
    all.iter().zip(some).all(|(all, some)| all >= some)
}

/// Adds cards; saturates far above any deck.
pub(crate) fn add(sum: &mut Counts, more: &Counts) {
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum = sum.saturating_add(*more);
    }
}

/// Removes cards; `None` if some are missing.
pub(crate) fn take(from: &mut Counts, cards: &Counts) -> Option<()> {
    for (from, cards) in from.iter_mut().zip(cards) {
        *from = from.checked_sub(*cards)?;
    }
    Some(())
}

/// Raises each count to at least that of `least`.
pub(crate) fn at_least(counts: &mut Counts, least: &Counts) {
    for (count, least) in counts.iter_mut().zip(least) {
        *count = (*count).max(*least);
    }
}

/// The index of the highest kind.
pub(crate) fn highest(gift: &Counts) -> Option<usize> {
    gift.iter().rposition(|&count| count > 0)
}

/// The number of cards.
pub(crate) fn size_of(counts: &Counts) -> u8 {
    counts
        .iter()
        .fold(0, |sum: u8, count| sum.saturating_add(*count))
}
