//! The deal: which cards each seat gets in a Shift, as a function of rule set, seed and Shift
//! number (`docs/rules.md` §3.1, §8.5). The shuffle is written out here, because records must
//! replay to the same cards on every machine; no library's shuffle may replace it.

use std::fmt;

use rand_chacha::ChaCha20Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use crate::cards::{PACKED_GOLDEN_FLAG, PACKED_JOKER, packed_face};
use crate::{BySeat, Cards, Face, MAX_FACES, Opening, RuleSet, Seat};

/// Cards of the largest deck.
const MAX_DECK: usize = 122;
/// Codes of cards: a face is its number; these two are the others.
const GOLDEN: u8 = 0;
const JOKER: u8 = MAX_FACES + 1;

/// The 32 bytes that determine all deals of a game. Secret until the game has ended.
#[derive(Copy, Clone, Eq, PartialEq)]
pub struct Seed(pub [u8; 32]);

impl fmt::Debug for Seed {
    /// Omits the bytes, so that no log reveals the hands of a running game.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Seed(..)")
    }
}

/// A dealt card.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Card {
    /// An ingredient card other than the Golden card.
    Plain(Face),
    /// The Golden card, of the top face.
    Golden,
    /// A joker.
    Joker,
}

/// The cards of one Shift in the order dealt.
#[derive(Copy, Clone)]
pub struct Deal {
    cards: [u8; MAX_DECK],
    rules: RuleSet,
    drawn: Option<Seat>,
}

impl Deal {
    /// Deals the Shift with this number, from 1.
    pub fn new(rules: &RuleSet, seed: Seed, shift: u32) -> Deal {
        let mut draws = Draws::new(seed, shift);
        let mut cards = ordered_deck(rules);
        let deck = usize::from(rules.deck_size());
        for last in (1..deck).rev() {
            cards.swap(last, draws.below(last as u32 + 1) as usize);
        }
        let dealt = rules.players() * usize::from(rules.hand_size());
        if let Some(aside) = cards[dealt..deck].iter().position(|&card| card == GOLDEN) {
            cards.swap(dealt + aside, draws.below(dealt as u32) as usize);
        }
        let drawn = match rules.opening() {
            Opening::Golden => None,
            Opening::AnyTopFace => Some(Seat::new(draws.below(rules.players() as u32) as usize)),
        };
        Deal {
            cards,
            rules: *rules,
            drawn,
        }
    }

    /// A seat's cards in the order dealt.
    ///
    /// # Panics
    /// If the rule set has no such seat.
    pub fn cards(&self, seat: Seat) -> impl ExactSizeIterator<Item = Card> {
        assert!(
            seat.index() < self.rules.players(),
            "the seat is one of the game's"
        );
        self.codes(seat).iter().map(|&code| match code {
            GOLDEN => Card::Golden,
            JOKER => Card::Joker,
            number => Card::Plain(Face::of(number)),
        })
    }

    /// All hands.
    pub fn hands(&self) -> BySeat<Cards> {
        let values = packed_values(self.rules.faces());
        BySeat::from_fn(self.rules.players(), |seat| {
            Cards::from_packed(
                self.codes(seat)
                    .iter()
                    .map(|&code| values[usize::from(code & 31)])
                    .sum(),
            )
        })
    }

    /// The seat drawn for the opening [`Opening::AnyTopFace`].
    pub fn drawn(&self) -> Option<Seat> {
        self.drawn
    }

    /// The seat that takes the Shift's first turn if no cards are exchanged.
    pub fn leader(&self) -> Seat {
        opening_leader(&self.rules, &self.hands(), self.drawn)
    }

    fn codes(&self, seat: Seat) -> &[u8] {
        let size = usize::from(self.rules.hand_size());
        &self.cards[seat.index() * size..(seat.index() + 1) * size]
    }
}

/// The seat that takes a Shift's first turn (§3.5): the holder of the Golden card, or with
/// [`Opening::AnyTopFace`] (§7.3) the first seat from the drawn one that holds the top face.
pub(crate) fn opening_leader(rules: &RuleSet, hands: &BySeat<Cards>, drawn: Option<Seat>) -> Seat {
    let (first, players) = (drawn.map_or(0, Seat::index), rules.players());
    (0..players)
        .map(|distance| Seat::new((first + distance) % players))
        .find(|&seat| match drawn {
            Some(_) => hands[seat].count(Face::of(rules.faces())) > 0,
            None => hands[seat].has_golden(),
        })
        .expect("the Golden card is always dealt to a seat")
}

/// The deck before it is shuffled: faces 1..=F ascending, the last card of face F the Golden card,
/// then the jokers.
fn ordered_deck(rules: &RuleSet) -> [u8; MAX_DECK] {
    let mut cards = [JOKER; MAX_DECK];
    let faces =
        (1..=rules.faces()).flat_map(|number| std::iter::repeat_n(number, usize::from(number)));
    let mut count = 0;
    for (slot, number) in cards.iter_mut().zip(faces) {
        *slot = number;
        count += 1;
    }
    cards[count - 1] = GOLDEN;
    cards
}

/// What a card adds to a packed hand, by code.
fn packed_values(faces: u8) -> [u64; 32] {
    let mut values = [0; 32];
    for number in 1..=faces {
        values[usize::from(number)] = packed_face(number);
    }
    values[usize::from(GOLDEN)] = packed_face(faces) + PACKED_GOLDEN_FLAG;
    values[usize::from(JOKER)] = PACKED_JOKER;
    values
}

/// Uniform numbers drawn from ChaCha20, keyed with the seed. The Shift's number is the stream.
struct Draws(ChaCha20Rng);

impl Draws {
    fn new(seed: Seed, shift: u32) -> Draws {
        let mut generator = ChaCha20Rng::from_seed(seed.0);
        generator.set_stream(u64::from(shift));
        Draws(generator)
    }

    /// A uniform number below `n`. Skips words at or above the largest multiple of `n`.
    fn below(&mut self, n: u32) -> u32 {
        let limit = (1u64 << 32) / u64::from(n) * u64::from(n);
        loop {
            let word = self.0.next_u32();
            if u64::from(word) < limit {
                return word % n;
            }
        }
    }
}
