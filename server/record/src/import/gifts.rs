//! The possible gifts of an exchange at a real table. Lists all gifts of a pair that fit the
//! facts, with the cards that its two hands need in each case. Candidates are produced lazily,
//! because the first ones usually fit, and compared as packed counts, because sometimes none does.

use chefshat_engine::{ExchangePair, RuleSet, Seat, SeatOrder, SpecialAction};

use super::facts::{Counts, JOKER, Tally, add, contains, counts_of};
use super::puzzle::{Kept, OpeningCard, Puzzle};

/// The gifts of a pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gifts {
    pub(super) chosen: Counts,
    pub(super) forced: Counts,
    /// Whether the forced giver had no further ingredient cards.
    pub(super) short: bool,
}

/// The pairs that exchange cards in a Shift, given the order of the last one.
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

/// All gifts that fit the facts about the pair, those first that least restrict what the forced
/// giver keeps. `room` contains the cards not certainly held outside the pair.
fn possible_gifts(
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

/// The index of the highest kind.
pub(super) fn highest(gift: &Counts) -> Option<usize> {
    gift.iter().rposition(|&count| count > 0)
}

/// The number of cards.
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

/// The stated gift if it has this size, or else all gifts of one or two cards of these kinds.
fn choices(stated: Option<Counts>, size: u8, kinds: &[usize]) -> Vec<Counts> {
    if let Some(stated) = stated {
        return Vec::from_iter((size_of(&stated) == size).then_some(stated));
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

/// Counts packed into one integer, a byte per kind, to add and compare them at once. No count
/// exceeds 127.
type Packed = u128;
const ONES: Packed = u128::from_le_bytes([1; JOKER + 1]);
const HIGH_BITS: Packed = ONES << 7;

fn packed(counts: &Counts) -> Packed {
    Packed::from_le_bytes(*counts)
}

/// Whether `all` has at least as many of each kind as `some`.
fn covers(all: Packed, some: Packed) -> bool {
    (all | HIGH_BITS).wrapping_sub(some) & HIGH_BITS == HIGH_BITS
}

/// The number of cards; a deck has fewer than 256.
fn total(counts: Packed) -> u32 {
    (counts.wrapping_mul(ONES) >> (8 * JOKER)) as u32
}

/// Possible gifts of a pair, with the cards its hands need.
#[derive(Debug, Clone, Copy)]
pub(super) struct Candidate {
    pub(super) gifts: Gifts,
    pub(super) opening: OpeningCard,
    /// The cards the pair certainly holds.
    certain: Packed,
    chooser: Need,
    forced: Need,
}

/// Further cards a hand needs.
#[derive(Debug, Clone, Copy)]
struct Need {
    /// Mask of the kinds allowed.
    kinds: Packed,
    missing: u32,
}

impl Need {
    fn of(kept: &Kept, top: usize) -> Self {
        let mut kinds: Counts = [0; JOKER + 1];
        kinds[kept.floor.min(JOKER)..].fill(u8::MAX);
        if kept.no_top {
            kinds[top] = 0;
        }
        Self {
            kinds: packed(&kinds),
            missing: kept.missing.into(),
        }
    }

    fn is_met(self, left: Packed) -> bool {
        self.missing <= total(left & self.kinds)
    }

    /// The sum of both needs; one mask must include the other.
    fn with(self, other: Need) -> Need {
        Need {
            kinds: self.kinds | other.kinds,
            missing: self.missing + other.missing,
        }
    }
}

impl Candidate {
    /// `None` if the gifts do not fit the facts or `room`.
    fn new(
        puzzle: &Puzzle<'_>,
        pair: &ExchangePair,
        gifts: Gifts,
        opening: OpeningCard,
        room: Packed,
    ) -> Option<Self> {
        let (chooser, forced) = puzzle.kept_by_pair(pair, &gifts, opening)?;
        let mut certain = gifts.chosen;
        for counts in [&gifts.forced, &chooser.counts, &forced.counts] {
            add(&mut certain, counts);
        }
        // Packed counts must not overflow.
        if certain.iter().any(|count| count.leading_zeros() == 0) {
            return None;
        }
        let candidate = Self {
            gifts,
            opening,
            certain: packed(&certain),
            chooser: Need::of(&chooser, puzzle.top),
            forced: Need::of(&forced, puzzle.top),
        };
        candidate.fits(room).then_some(candidate)
    }

    /// Whether `room` suffices for the hands of the pair.
    fn fits(&self, room: Packed) -> bool {
        covers(room, self.certain) && {
            let left = room - self.certain;
            self.chooser.is_met(left) && self.forced.is_met(left)
        }
    }

    /// Whether `room` suffices for both pairs. Only forced givers and seats without the top face
    /// restrict the kinds, so no other subset of hands can run short.
    pub(super) fn fits_beside(&self, other: &Candidate, room: &Counts) -> bool {
        let (certain, room) = (self.certain + other.certain, packed(room));
        covers(room, certain) && {
            let left = room - certain;
            let both = self.forced.with(other.forced);
            [self.chooser, self.forced, other.chooser, other.forced, both]
                .iter()
                .all(|need| need.is_met(left))
        }
    }
}

/// The search steps left.
#[derive(Debug, Clone, Copy)]
pub(super) struct SearchBudget {
    pub(super) left: usize,
    /// Whether more steps were requested than left.
    pub(super) exhausted: bool,
}

impl SearchBudget {
    pub(super) fn new(left: usize) -> Self {
        Self {
            left,
            exhausted: false,
        }
    }

    /// Uses steps; `None` if not enough are left.
    pub(super) fn spend(&mut self, count: usize) -> Option<()> {
        match self.left.checked_sub(count) {
            Some(left) => self.left = left,
            None => {
                self.exhausted = true;
                return None;
            }
        }
        Some(())
    }
}

/// The candidates of a pair, found lazily.
pub(super) struct Candidates<'a> {
    puzzle: &'a Puzzle<'a>,
    pair: ExchangePair,
    room: Packed,
    unexplored: Box<dyn Iterator<Item = (Gifts, OpeningCard)>>,
    found: Vec<Candidate>,
}

impl<'a> Candidates<'a> {
    /// `room` contains the cards not certainly held outside the pair.
    pub(super) fn new(puzzle: &'a Puzzle<'a>, pair: ExchangePair, room: &Counts) -> Self {
        let opens = [pair.chooser, pair.forced]
            .into_iter()
            .any(|seat| puzzle.tally.opener == Some(seat));
        let opening_cards: &[OpeningCard] = if opens {
            &[OpeningCard::Kept, OpeningCard::Received]
        } else {
            &[OpeningCard::Kept]
        };
        let gifts = possible_gifts(puzzle.rules, &puzzle.tally, &pair, room);
        Self {
            puzzle,
            pair,
            room: packed(room),
            unexplored: Box::new(
                gifts.flat_map(|gifts| opening_cards.iter().map(move |opening| (gifts, *opening))),
            ),
            found: Vec::new(),
        }
    }

    /// The candidate with this index; each gift examined costs a step. `None` if there is none or
    /// the budget is exhausted.
    pub(super) fn get(&mut self, index: usize, budget: &mut SearchBudget) -> Option<Candidate> {
        while self.found.len() <= index {
            budget.spend(1)?;
            let (gifts, opening) = self.unexplored.next()?;
            let candidate = Candidate::new(self.puzzle, &self.pair, gifts, opening, self.room);
            self.found.extend(candidate);
        }
        self.found.get(index).copied()
    }
}
