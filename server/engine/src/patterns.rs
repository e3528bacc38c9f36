//! The fast path of legal turns: tables computed at compile time, and the mask built from them.
//!
//! `game::legal` states the rules. Here [`turn_mask`] lists what they allow without asking
//! for every action: the plays of one face depend only on the number of its cards in the
//! hand, on the jokers and on the least size, so a table has the bits of all of them. The tests
//! `requirement` and `properties` compare the masks with the rules, action by action.

use crate::actions::play_offset;
use crate::mask::WORDS;
use crate::{Cards, Mask, PlayRequirement};

/// The largest play: fifteen cards and two jokers.
const MAX_SIZE: usize = 17;

/// The plays of one face that a hand allows: bit i is the i-th play of the face. The bits from
/// [`PATTERN_BITS`] on are their number.
#[derive(Copy, Clone)]
pub(crate) struct Pattern(u64);

/// A face has at most 3 * 15 plays.
const PATTERN_BITS: u32 = 48;

impl Pattern {
    pub(crate) const fn bits(self) -> u64 {
        self.0 & ((1 << PATTERN_BITS) - 1)
    }

    pub(crate) const fn len(self) -> u16 {
        (self.0 >> PATTERN_BITS) as u16
    }
}

/// The patterns for one number of jokers and one least size of the play, by the number of cards of
/// the face in the hand.
pub(crate) type Patterns = [Pattern; 16];

/// By jokers in the hand (0..=2) and least size of the play (0..=17).
pub(crate) static PATTERNS: [[Patterns; MAX_SIZE + 1]; 3] = {
    let mut table = [[[Pattern(0); 16]; MAX_SIZE + 1]; 3];
    let mut held = 0;
    while held <= 2 {
        let mut size = 0;
        while size <= MAX_SIZE {
            let mut count = 0;
            while count < 16 {
                table[held][size][count] = pattern(held, size, count);
                count += 1;
            }
            size += 1;
        }
        held += 1;
    }
    table
};

const fn pattern(held: usize, size: usize, count: usize) -> Pattern {
    let mut bits = 0u64;
    let mut quantity = 1;
    while quantity <= count {
        let mut jokers = 0;
        while jokers <= held {
            if quantity + jokers >= size {
                bits |= 1 << (3 * (quantity - 1) + jokers);
            }
            jokers += 1;
        }
        quantity += 1;
    }
    Pattern(bits | (bits.count_ones() as u64) << PATTERN_BITS)
}

/// The legal actions of a turn: what [`PlayRequirement::allows`] allows to this hand, without
/// asking it for each of up to 362 actions. The required faces are cut out of the packed hand; then
/// the number of cards of each face selects the plays of that face from a table.
#[inline]
pub(crate) fn turn_mask(faces: u8, required: &PlayRequirement, hand: Cards) -> Mask {
    let (jokers, size) = (hand.jokers(), required.fewest_cards);
    let lone_joker = required.lone_joker && jokers > 0;
    let cards = hand.between_faces(required.lowest_face, required.highest_face);
    // Most often no face has enough cards. Then no table is read.
    let cards = if cards.has_face_with_at_least(size.saturating_sub(jokers).max(1)) {
        cards
    } else {
        Cards::EMPTY
    };
    let patterns = &PATTERNS[usize::from(jokers)][usize::from(size)];
    let pass = required.may_pass;
    // One function for each number of faces: all positions in the mask are constants, and the words
    // stay in registers.
    match faces {
        4 => filled_mask::<4>(patterns, cards, lone_joker, pass),
        5 => filled_mask::<5>(patterns, cards, lone_joker, pass),
        6 => filled_mask::<6>(patterns, cards, lone_joker, pass),
        7 => filled_mask::<7>(patterns, cards, lone_joker, pass),
        8 => filled_mask::<8>(patterns, cards, lone_joker, pass),
        9 => filled_mask::<9>(patterns, cards, lone_joker, pass),
        10 => filled_mask::<10>(patterns, cards, lone_joker, pass),
        11 => filled_mask::<11>(patterns, cards, lone_joker, pass),
        12 => filled_mask::<12>(patterns, cards, lone_joker, pass),
        13 => filled_mask::<13>(patterns, cards, lone_joker, pass),
        14 => filled_mask::<14>(patterns, cards, lone_joker, pass),
        _ => filled_mask::<15>(patterns, cards, lone_joker, pass),
    }
}

fn filled_mask<const F: u8>(
    patterns: &Patterns,
    cards: Cards,
    lone_joker: bool,
    pass: bool,
) -> Mask {
    let mut set = Filling {
        words: [0; WORDS],
        len: 0,
    };
    // Often only passing is legal. Then no table is read.
    if !cards.is_empty() {
        macro_rules! insert_faces {
            ($($number:literal)*) => {
                $(if $number <= F {
                    set.insert_face::<$number>(patterns, cards);
                })*
            };
        }
        insert_faces!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);
    }
    set.insert(play_offset(F + 1), lone_joker);
    set.insert(play_offset(F + 1) + 1, pass);
    Mask::from_words(set.words, set.len)
}

/// A mask being filled.
struct Filling {
    words: [u64; WORDS],
    len: u16,
}

impl Filling {
    #[inline(always)]
    fn insert_face<const NUMBER: u8>(&mut self, patterns: &Patterns, cards: Cards) {
        let pattern = patterns[usize::from(cards.count_of(NUMBER))];
        let (index, shift) = const { place(play_offset(NUMBER)) };
        self.words[index] |= pattern.bits() << shift;
        // A face has three bits for each of its cards in the deck. They may continue in the next
        // word.
        if shift + 3 * u32::from(NUMBER) > 64 {
            self.words[index + 1] |= pattern.bits() >> (64 - shift);
        }
        // At most the number of plays, so it cannot overflow.
        self.len = self.len.wrapping_add(pattern.len());
    }

    #[inline(always)]
    fn insert(&mut self, action: u16, legal: bool) {
        let (index, shift) = place(action);
        self.words[index] |= u64::from(legal) << shift;
        self.len = self.len.wrapping_add(u16::from(legal));
    }
}

/// Word and bit of an action in a mask.
const fn place(index: u16) -> (usize, u32) {
    (index as usize / 64, index as u32 % 64)
}
