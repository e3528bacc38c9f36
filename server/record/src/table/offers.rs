//! What a pair may have exchanged, as far as the pair alone decides it: each choice of gifts with the cards that its two hands then need.
//! Choices are listed one by one, because mostly the first ones fit, and those of two pairs are compared at the cost of a few additions,
//! because sometimes none does.

use chefshat_engine::ExchangePair;

use super::facts::{Counts, JOKER, add};
use super::gifts::{Gifts, candidates};
use super::puzzle::{Kept, Puzzle, Top};

/// Counts of all kinds in one number, a byte for each: sums and comparisons are made for all kinds at once. No count is above 127.
type Packed = u128;
/// One in each byte.
const ONES: Packed = u128::from_le_bytes([1; JOKER + 1]);
/// The highest bit of each byte.
const HIGH_BITS: Packed = ONES << 7;

fn packed(counts: &Counts) -> Packed {
    Packed::from_le_bytes(*counts)
}

/// Whether the one has at least as many of each kind as the other.
fn covers(all: Packed, some: Packed) -> bool {
    (all | HIGH_BITS).wrapping_sub(some) & HIGH_BITS == HIGH_BITS
}

/// How many cards these are; a deck has less than 256.
fn total(counts: Packed) -> u32 {
    (counts.wrapping_mul(ONES) >> (8 * JOKER)) as u32
}

/// Gifts of a pair, with what its hands need beside the other hands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Offer {
    pub(super) gifts: Gifts,
    pub(super) top: Top,
    /// All cards that the pair holds for certain.
    sure: Packed,
    chooser: Need,
    forced: Need,
}

/// Cards that a hand still needs.
#[derive(Debug, Clone, Copy)]
struct Need {
    /// A mask of the kinds they may be of.
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

    /// Both needs together, of hands one of which may hold every kind that the other may.
    fn with(self, other: Need) -> Need {
        Need {
            kinds: self.kinds | other.kinds,
            missing: self.missing + other.missing,
        }
    }
}

impl Offer {
    /// The cards of a pair, if these are left for it.
    fn new(
        puzzle: &Puzzle<'_>,
        pair: &ExchangePair,
        gifts: Gifts,
        top: Top,
        room: Packed,
    ) -> Option<Self> {
        let (chooser, forced) = puzzle.kept_by_pair(pair, &gifts, top)?;
        let mut sure = gifts.chosen;
        for counts in [&gifts.forced, &chooser.counts, &forced.counts] {
            add(&mut sure, counts);
        }
        // So that no byte overflows.
        if sure.iter().any(|count| count.leading_zeros() == 0) {
            return None;
        }
        let offer = Self {
            gifts,
            top,
            sure: packed(&sure),
            chooser: Need::of(&chooser, puzzle.top),
            forced: Need::of(&forced, puzzle.top),
        };
        offer.fits(room).then_some(offer)
    }

    /// Whether the hands of the pair can be made of these cards.
    fn fits(&self, room: Packed) -> bool {
        covers(room, self.sure) && {
            let left = room - self.sure;
            self.chooser.is_met(left) && self.forced.is_met(left)
        }
    }

    /// Whether the hands of both pairs can be made of these cards, which leave enough for everybody: only those who give without a choice
    /// and those who may not hold the top face cannot take any card.
    pub(super) fn fits_beside(&self, other: &Offer, room: &Counts) -> bool {
        let (sure, room) = (self.sure + other.sure, packed(room));
        covers(room, sure) && {
            let left = room - sure;
            let both = self.forced.with(other.forced);
            [self.chooser, self.forced, other.chooser, other.forced, both]
                .iter()
                .all(|need| need.is_met(left))
        }
    }
}

/// How much may still be looked at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tries {
    pub(super) left: usize,
    /// Whether more was asked for.
    pub(super) gave_up: bool,
}

impl Tries {
    pub(super) fn new(left: usize) -> Self {
        Self {
            left,
            gave_up: false,
        }
    }

    /// Takes some; `None` if there are not so many.
    pub(super) fn take(&mut self, count: usize) -> Option<()> {
        match self.left.checked_sub(count) {
            Some(left) => self.left = left,
            None => {
                self.gave_up = true;
                return None;
            }
        }
        Some(())
    }
}

/// The offers of a pair, found one after the other.
pub(super) struct Offers<'a> {
    puzzle: &'a Puzzle<'a>,
    pair: ExchangePair,
    room: Packed,
    open: Box<dyn Iterator<Item = (Gifts, Top)>>,
    found: Vec<Offer>,
}

impl<'a> Offers<'a> {
    /// The offers of a pair. `room` holds the cards that seats outside it do not hold for certain.
    pub(super) fn new(puzzle: &'a Puzzle<'a>, pair: ExchangePair, room: &Counts) -> Self {
        let opens = [pair.chooser, pair.forced]
            .into_iter()
            .any(|seat| puzzle.tally.opener == Some(seat));
        let ways: &[Top] = if opens {
            &[Top::Kept, Top::Received]
        } else {
            &[Top::Kept]
        };
        let gifts = candidates(puzzle.rules, &puzzle.tally, &pair, room);
        Self {
            puzzle,
            pair,
            room: packed(room),
            open: Box::new(gifts.flat_map(|gifts| ways.iter().map(move |top| (gifts, *top)))),
            found: Vec::new(),
        }
    }

    /// The offer with a number. Each gift looked at on the way costs one of `tries`; `None` if there is no such offer, or no try is left.
    pub(super) fn get(&mut self, number: usize, tries: &mut Tries) -> Option<Offer> {
        while self.found.len() <= number {
            tries.take(1)?;
            let (gifts, top) = self.open.next()?;
            let offer = Offer::new(self.puzzle, &self.pair, gifts, top, self.room);
            self.found.extend(offer);
        }
        self.found.get(number).copied()
    }
}
