//! Sets of action indices.

use std::fmt;

use crate::ActionId;

/// Words of a set.
pub(crate) const WORDS: usize = 6;

/// A set of up to 384 action indices, one bit each. It stores its length, so that a uniform choice
/// needs one look-up.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Default)]
pub struct Mask {
    words: [u64; WORDS],
    len: u16,
}

impl Mask {
    /// The empty set.
    pub const EMPTY: Mask = Mask {
        words: [0; WORDS],
        len: 0,
    };
    /// Number of indices that fit.
    pub const CAPACITY: u16 = 64 * WORDS as u16;

    /// The set of the given actions. Ignores those at or above [`Mask::CAPACITY`].
    pub fn from_actions(actions: impl IntoIterator<Item = ActionId>) -> Mask {
        let mut mask = Mask::EMPTY;
        for action in actions {
            if action.index() < Mask::CAPACITY && !mask.contains(action) {
                mask.insert(action);
            }
        }
        mask
    }

    /// Whether an action is in the set.
    pub fn contains(&self, action: ActionId) -> bool {
        let index = usize::from(action.index());
        self.words
            .get(index / 64)
            .is_some_and(|word| word >> (index % 64) & 1 == 1)
    }

    /// Number of actions in the set.
    pub fn len(&self) -> usize {
        usize::from(self.len)
    }

    /// Whether no action is in the set.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The actions, ascending.
    pub fn iter(&self) -> impl Iterator<Item = ActionId> + use<> {
        self.words
            .into_iter()
            .enumerate()
            .flat_map(|(index, mut word)| {
                std::iter::from_fn(move || {
                    let bit = (word != 0).then(|| word.trailing_zeros() as u16)?;
                    word &= word - 1;
                    Some(ActionId::new(64 * index as u16 + bit))
                })
            })
    }

    /// The action with `k` smaller ones in the set, or `None` if the set has no more than `k`.
    #[inline]
    pub fn nth(&self, k: usize) -> Option<ActionId> {
        if k >= self.len() {
            return None;
        }
        if self.len == 1 {
            // Mostly a pass. Nothing to count.
            return self.iter().next();
        }
        let mut left = k as u32;
        for (index, &word) in self.words.iter().enumerate() {
            let sums = byte_sums(word);
            let count = (sums >> 56) as u32;
            if left < count {
                return Some(ActionId::new(64 * index as u16 + select(word, sums, left)));
            }
            left -= count;
        }
        None
    }

    /// The set as words: bit i%64 of word i/64 is action i.
    pub fn words(&self) -> &[u64; WORDS] {
        &self.words
    }

    /// Fills a buffer: bit i%8 of byte i/8 is action i. A space of `size` actions needs
    /// `size.div_ceil(8)` bytes. Bytes beyond the capacity become 0.
    pub fn write_bytes(&self, out: &mut [u8]) {
        out.fill(0);
        for (chunk, word) in out.chunks_mut(8).zip(self.words) {
            let bytes = word.to_le_bytes();
            chunk.copy_from_slice(&bytes[..chunk.len()]);
        }
    }

    /// The set as `size.div_ceil(8)` bytes: bit i%8 of byte i/8 is action i.
    pub fn to_bytes(&self, size: u16) -> Vec<u8> {
        let mut bytes = vec![0; usize::from(size).div_ceil(8)];
        self.write_bytes(&mut bytes);
        bytes
    }

    /// Reads what [`Mask::to_bytes`] writes, or `None` if there are more than 48 bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Mask> {
        if bytes.len() > 8 * WORDS {
            return None;
        }
        let mut mask = Mask::EMPTY;
        for (index, &byte) in bytes.iter().enumerate() {
            mask.words[index / 8] |= u64::from(byte) << (8 * (index % 8));
        }
        mask.len = mask.words.iter().map(|word| word.count_ones() as u16).sum();
        Some(mask)
    }

    /// Adds an action that the set does not contain.
    pub(crate) fn insert(&mut self, action: ActionId) {
        let index = usize::from(action.index());
        debug_assert!(!self.contains(action));
        self.words[index / 64] |= 1 << (index % 64);
        self.len += 1;
    }

    /// Creates a set from its words, which contain `len` actions.
    pub(crate) const fn from_words(words: [u64; WORDS], len: u16) -> Mask {
        Mask { words, len }
    }
}

impl FromIterator<ActionId> for Mask {
    fn from_iter<I: IntoIterator<Item = ActionId>>(actions: I) -> Mask {
        Mask::from_actions(actions)
    }
}

impl fmt::Debug for Mask {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_set()
            .entries(self.iter().map(ActionId::index))
            .finish()
    }
}

const BYTE_ONES: u64 = 0x0101_0101_0101_0101;
const BYTE_TOPS: u64 = 0x8080_8080_8080_8080;

/// The number of set bits up to the end of each byte, byte by byte.
#[inline]
const fn byte_sums(word: u64) -> u64 {
    let pairs = word - (word >> 1 & 0x5555_5555_5555_5555);
    let fours = (pairs & 0x3333_3333_3333_3333) + (pairs >> 2 & 0x3333_3333_3333_3333);
    ((fours + (fours >> 4)) & 0x0F0F_0F0F_0F0F_0F0F).wrapping_mul(BYTE_ONES)
}

/// Index of the set bit with `k` set bits below it; the word has more than `k`. Branchless, because
/// a random choice would be mispredicted: all bytes are compared at once to find the byte, and a
/// table gives the bit.
#[inline]
fn select(word: u64, sums: u64, k: u32) -> u16 {
    let full_bytes = (((u64::from(k) * BYTE_ONES) | BYTE_TOPS) - sums) & BYTE_TOPS;
    let shift = ((full_bytes >> 7).wrapping_mul(BYTE_ONES) >> 56 << 3) as u32 & 63;
    let before = (sums << 8 >> shift) & 0xFF;
    let byte = (word >> shift & 0xFF) as usize;
    shift as u16 + u16::from(SELECT_IN_BYTE[(u64::from(k) - before) as usize & 7][byte])
}

/// By k and byte: the index of the set bit with k set bits below it.
static SELECT_IN_BYTE: [[u8; 256]; 8] = {
    let mut table = [[0; 256]; 8];
    let mut byte = 0;
    while byte < 256 {
        let (mut bit, mut k) = (0, 0);
        while bit < 8 {
            if byte >> bit & 1 == 1 {
                table[k][byte] = bit as u8;
                k += 1;
            }
            bit += 1;
        }
        byte += 1;
    }
    table
};
