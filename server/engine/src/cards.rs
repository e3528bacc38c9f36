//! A multiset of cards, packed into one number. It has no order; [`crate::Deal`] has the order in
//! which cards were dealt.

use std::fmt;

use crate::{Action, Face, MAX_FACES};

/// Bits of one count.
const BITS: u32 = 4;
const JOKER_SHIFT: u32 = 60;
const JOKER_ONE: u64 = 1 << JOKER_SHIFT;
const GOLDEN: u64 = 1 << 62;
const FACE_BITS: u64 = JOKER_ONE - 1;
const LOW_NIBBLES: u64 = 0x0F0F_0F0F_0F0F_0F0F;
const BYTE_ONES: u64 = 0x0101_0101_0101_0101;

/// A multiset of cards: how many of each face, how many jokers, and whether one of the cards of the
/// top face is the Golden one.
///
/// Four bits for each face from face 1 in the lowest, jokers in bits 60 and 61, the Golden card's
/// flag in bit 62. The Golden card counts among the cards of its face.
#[derive(Copy, Clone, Eq, PartialEq, Default, Hash)]
pub struct Cards(u64);

impl Cards {
    /// No cards.
    pub const EMPTY: Cards = Cards(0);

    /// Creates cards from F+1 counts: faces 1..=F ascending, then jokers. If `golden`, one card of
    /// face F is the Golden card. `None` if there are not F+1 counts, a count exceeds every deck,
    /// or there is no card of face F to be golden.
    pub fn from_counts(faces: u8, counts: &[u8], golden: bool) -> Option<Cards> {
        if faces == 0 || faces > MAX_FACES || counts.len() != usize::from(faces) + 1 {
            return None;
        }
        let mut cards = Cards::EMPTY;
        for (number, &count) in (1..=faces).zip(counts) {
            if count > number {
                return None;
            }
            cards.add_face(Face::of(number), count);
        }
        let jokers = counts[usize::from(faces)];
        if jokers > crate::MAX_JOKERS || (golden && counts[usize::from(faces) - 1] == 0) {
            return None;
        }
        cards.add_jokers(jokers);
        if golden {
            cards.0 |= GOLDEN;
        }
        Some(cards)
    }

    /// The deck with this many faces and jokers.
    pub(crate) fn deck(faces: u8, jokers: u8) -> Cards {
        let mut cards = Cards(GOLDEN);
        (1..=faces).for_each(|number| cards.add_face(Face::of(number), number));
        cards.add_jokers(jokers);
        cards
    }

    /// Number of cards of a face, the Golden card included.
    pub const fn count(self, face: Face) -> u8 {
        self.count_of(face.get())
    }

    /// Number of cards of the face with this number, 1..=15.
    pub(crate) const fn count_of(self, number: u8) -> u8 {
        ((self.0 >> (BITS * (number as u32 - 1))) & 0xF) as u8
    }

    /// Number of jokers.
    pub const fn jokers(self) -> u8 {
        ((self.0 >> JOKER_SHIFT) & 0x3) as u8
    }

    /// Whether the Golden card is among them.
    pub const fn has_golden(self) -> bool {
        self.0 & GOLDEN != 0
    }

    /// Number of cards, jokers included.
    pub const fn len(self) -> u8 {
        self.faces_len() + self.jokers()
    }

    /// Number of ingredient cards, that is, of cards other than jokers.
    pub const fn faces_len(self) -> u8 {
        let faces = self.0 & FACE_BITS;
        let pairs = (faces & LOW_NIBBLES) + ((faces >> BITS) & LOW_NIBBLES);
        (pairs.wrapping_mul(BYTE_ONES) >> 56) as u8
    }

    /// Whether there are no cards.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The rarest face (the lowest number) among the cards, or `None` if there are only jokers.
    pub fn rarest(self) -> Option<Face> {
        let faces = self.0 & FACE_BITS;
        (faces != 0).then(|| Face::of((faces.trailing_zeros() / BITS) as u8 + 1))
    }

    /// The highest face among the cards, or `None` if there are only jokers.
    pub fn highest(self) -> Option<Face> {
        let faces = self.0 & FACE_BITS;
        (faces != 0).then(|| Face::of(((63 - faces.leading_zeros()) / BITS) as u8 + 1))
    }

    /// [`Cards::counts`] as an array, with zeros after the F+1 numbers.
    #[inline]
    pub fn count_array(self, faces: u8) -> [u8; MAX_FACES as usize + 1] {
        let cards = self.0 & FACE_BITS;
        let counts = u128::from(nibbles_to_bytes(cards as u32))
            | u128::from(nibbles_to_bytes((cards >> 32) as u32)) << 64;
        // One number instead of an array that is filled: the processor would wait for its bytes.
        (counts | u128::from(self.jokers()) << (8 * faces)).to_le_bytes()
    }

    /// The counts of a deck with this many faces: faces 1..=F ascending, then jokers, F+1 numbers.
    #[inline]
    pub fn counts(self, faces: u8) -> impl ExactSizeIterator<Item = u8> {
        self.count_array(faces)
            .into_iter()
            .take(usize::from(faces) + 1)
    }

    /// The cards ascending: faces by their number, then F+1 for each joker.
    pub fn ascending(self, faces: u8) -> impl Iterator<Item = u8> {
        self.counts(faces)
            .zip(1u8..)
            .flat_map(|(count, number)| std::iter::repeat_n(number, usize::from(count)))
    }

    /// Both multisets together. `None` if a count would exceed every deck or there would be two
    /// Golden cards.
    pub fn union(self, other: Cards) -> Option<Cards> {
        let mut sum = self;
        for number in 1..=MAX_FACES {
            if self.count_of(number) + other.count_of(number) > number {
                return None;
            }
        }
        if self.jokers() + other.jokers() > crate::MAX_JOKERS
            || (self.has_golden() && other.has_golden())
        {
            return None;
        }
        sum.add(other);
        Some(sum)
    }

    /// Whether these cards include all of `other`. Ignores which card is golden.
    pub fn contains(self, other: Cards) -> bool {
        self.jokers() >= other.jokers()
            && (1..=MAX_FACES).all(|number| self.count_of(number) >= other.count_of(number))
    }

    /// Whether a hand of these cards has those that an action plays or gives. True of actions that
    /// need no cards.
    #[inline]
    pub fn holds(self, action: Action) -> bool {
        match action {
            Action::Play {
                face,
                quantity,
                jokers,
            } => self.count(face) >= quantity && self.jokers() >= jokers,
            Action::LoneJoker | Action::GiveJoker => self.jokers() > 0,
            Action::Give(face) => self.count(face) > 0,
            Action::Pass | Action::Decline | Action::Declare => true,
        }
    }

    /// These cards without `n` cards of a face; the Golden card is removed last. `None` if there
    /// are fewer than `n`.
    pub fn without_face(self, face: Face, n: u8) -> Option<Cards> {
        let mut left = self;
        (self.count(face) >= n).then(|| {
            left.take_face(face, n);
            left
        })
    }

    /// These cards without `n` jokers. `None` if there are fewer than `n`.
    pub fn without_jokers(self, n: u8) -> Option<Cards> {
        (self.jokers() >= n).then(|| Cards(self.0 - u64::from(n) * JOKER_ONE))
    }

    pub(crate) fn add_face(&mut self, face: Face, n: u8) {
        self.0 += u64::from(n) << (BITS * u32::from(face.get() - 1));
    }

    pub(crate) fn add_jokers(&mut self, n: u8) {
        self.0 += u64::from(n) * JOKER_ONE;
    }

    /// Adds cards of the same deck, so the counts cannot overflow.
    pub(crate) fn add(&mut self, other: Cards) {
        debug_assert!(!(self.has_golden() && other.has_golden()));
        self.0 += other.0;
    }

    /// Removes cards that these are known to include. Does not change the Golden flag.
    pub(crate) fn remove_counts(&mut self, face: u8, n: u8, jokers: u8) {
        let counts = (u64::from(n) << (BITS * u32::from(face - 1))) + u64::from(jokers) * JOKER_ONE;
        self.0 -= counts;
    }

    /// Adds cards. Does not change the Golden flag.
    pub(crate) fn add_counts(&mut self, face: u8, n: u8, jokers: u8) {
        self.0 += (u64::from(n) << (BITS * u32::from(face - 1))) + u64::from(jokers) * JOKER_ONE;
    }

    pub(crate) fn set_golden(&mut self, golden: bool) {
        self.0 = if golden {
            self.0 | GOLDEN
        } else {
            self.0 & !GOLDEN
        };
    }

    /// Removes and returns `n` cards of a face, which are known to be present; the Golden card
    /// last.
    pub(crate) fn take_face(&mut self, face: Face, n: u8) -> Cards {
        let mut taken = Cards::EMPTY;
        // The Golden card has the top face of the deck, which is the highest face of every hand
        // that holds it.
        let golden_goes =
            self.has_golden() && self.highest() == Some(face) && self.count(face) == n;
        self.remove_counts(face.get(), n, 0);
        taken.add_face(face, n);
        if golden_goes {
            self.set_golden(false);
            taken.set_golden(true);
        }
        taken
    }

    /// Removes and returns a joker, which is known to be present.
    pub(crate) fn take_joker(&mut self) -> Cards {
        self.0 -= JOKER_ONE;
        Cards(JOKER_ONE)
    }

    /// Removes and returns the `n` rarest ingredient cards, or all if there are fewer.
    pub(crate) fn take_rarest(&mut self, n: u8) -> Cards {
        let mut taken = Cards::EMPTY;
        for _ in 0..n {
            if let Some(face) = self.rarest() {
                taken.add(self.take_face(face, 1));
            }
        }
        taken
    }

    /// The cards of the faces from `lowest` to `highest`, 1..=15; none if `highest` is 0. Without
    /// jokers and without the Golden card's flag.
    pub(crate) const fn between_faces(self, lowest: u8, highest: u8) -> Cards {
        let up_to = (1u64 << (BITS * highest as u32)) - 1;
        let below = (1u64 << (BITS * (lowest as u32 - 1))) - 1;
        Cards(self.0 & up_to & !below)
    }

    /// Whether any face has at least `need` cards (`need` >= 1). Only for cards without jokers.
    pub(crate) const fn has_face_with_at_least(self, need: u8) -> bool {
        if need > MAX_FACES {
            return false;
        }
        // Adding 16 - need to a count carries out of its four bits exactly if the count is at least
        // `need`.
        let carry = (16 - need as u64) * BYTE_ONES;
        let (even, odd) = (self.0 & LOW_NIBBLES, self.0 >> BITS & LOW_NIBBLES);
        ((even + carry) | (odd + carry)) & (BYTE_ONES << BITS) != 0
    }
}

/// The eight groups of four bits as bytes, from the lowest.
const fn nibbles_to_bytes(nibbles: u32) -> u64 {
    let mut bytes = nibbles as u64;
    bytes = (bytes | bytes << 16) & 0x0000_FFFF_0000_FFFF;
    bytes = (bytes | bytes << 8) & 0x00FF_00FF_00FF_00FF;
    (bytes | bytes << 4) & LOW_NIBBLES
}

/// What a card of a face adds to the packed number.
pub(crate) const fn packed_face(number: u8) -> u64 {
    1 << (BITS * (number as u32 - 1))
}

pub(crate) const PACKED_JOKER: u64 = JOKER_ONE;
pub(crate) const PACKED_GOLDEN_FLAG: u64 = GOLDEN;

impl Cards {
    /// Cards from a sum of packed cards of one deck.
    pub(crate) const fn from_packed(sum: u64) -> Cards {
        Cards(sum)
    }
}

impl fmt::Debug for Cards {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut list = f.debug_list();
        for number in 1..=MAX_FACES {
            (0..self.count_of(number)).for_each(|_| {
                list.entry(&number);
            });
        }
        (0..self.jokers()).for_each(|_| {
            list.entry(&format_args!("J"));
        });
        if self.has_golden() {
            list.entry(&format_args!("Golden"));
        }
        list.finish()
    }
}
