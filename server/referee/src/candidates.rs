//! The possible gifts of a pair with the cards that its two hands need in each case. Candidates are
//! produced lazily, because the first ones usually fit, and compared as packed counts, because
//! sometimes none does.

use chefshat_engine::ExchangePair;

use crate::counts::{Counts, JOKER, NOTHING, add};
use crate::gifts::{Gifts, possible_gifts};
use crate::puzzle::{Kept, OpeningCard, Puzzle};

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
pub(crate) struct Candidate {
    pub(crate) gifts: Gifts,
    pub(crate) opening: OpeningCard,
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
        let mut kinds = NOTHING;
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
    pub(crate) fn fits_beside(&self, other: &Candidate, room: &Counts) -> bool {
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
pub(crate) struct SearchBudget {
    pub(crate) left: usize,
    /// Whether more steps were requested than left.
    pub(crate) exhausted: bool,
}

impl SearchBudget {
    pub(crate) fn new(left: usize) -> Self {
        Self {
            left,
            exhausted: false,
        }
    }

    /// Uses steps; `None` if not enough are left.
    pub(crate) fn spend(&mut self, count: usize) -> Option<()> {
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
pub(crate) struct Candidates<'a> {
    puzzle: &'a Puzzle<'a>,
    pair: ExchangePair,
    room: Packed,
    unexplored: Box<dyn Iterator<Item = (Gifts, OpeningCard)>>,
    found: Vec<Candidate>,
}

impl<'a> Candidates<'a> {
    /// `room` contains the cards not certainly held outside the pair.
    pub(crate) fn new(puzzle: &'a Puzzle<'a>, pair: ExchangePair, room: &Counts) -> Self {
        let opens = [pair.chooser, pair.forced]
            .into_iter()
            .any(|seat| puzzle.tally.has_top(seat));
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
    pub(crate) fn get(&mut self, index: usize, budget: &mut SearchBudget) -> Option<Candidate> {
        while self.found.len() <= index {
            budget.spend(1)?;
            let (gifts, opening) = self.unexplored.next()?;
            let candidate = Candidate::new(self.puzzle, &self.pair, gifts, opening, self.room);
            self.found.extend(candidate);
        }
        self.found.get(index).copied()
    }
}
