//! Reading masks of legal actions: bit i%8 of byte i/8 is action i. An empty mask (if the seat
//! requested none) has no legal actions here; the server still enforces them.

use crate::{ActionId, v1};

/// The legal actions of a decision, ascending.
pub fn legal_actions(request: &v1::DecisionRequest) -> impl Iterator<Item = ActionId> + '_ {
    (0u32..)
        .zip(&request.action_mask)
        .flat_map(|(index, &byte)| {
            let mut rest = byte;
            std::iter::from_fn(move || {
                let bit = (rest != 0).then(|| rest.trailing_zeros())?;
                rest &= rest - 1;
                Some(ActionId(8 * index + bit))
            })
        })
}

/// The number of legal actions of a decision.
pub fn legal_count(request: &v1::DecisionRequest) -> usize {
    count_in(&request.action_mask)
}

/// The legal action number `n`, from 0, in ascending order; `None` if there are fewer.
pub fn nth_legal(request: &v1::DecisionRequest, n: usize) -> Option<ActionId> {
    nth_in(&request.action_mask, n)
}

/// The number of actions of a mask, for example of a row of [`v1::VectorBatch::action_masks`].
pub fn count_in(mask: &[u8]) -> usize {
    words(mask).map(|word| word.count_ones() as usize).sum()
}

/// The action number `n` of a mask, from 0, in ascending order; `None` if there are fewer.
pub fn nth_in(mask: &[u8], n: usize) -> Option<ActionId> {
    let mut left = n;
    for (index, word) in (0u32..).zip(words(mask)) {
        let ones = word.count_ones() as usize;
        if left < ones {
            let mut rest = word;
            for _ in 0..left {
                rest &= rest - 1;
            }
            return Some(ActionId(64 * index + rest.trailing_zeros()));
        }
        left -= ones;
    }
    None
}

/// A mask as 64-bit words, the last one padded with zeros.
fn words(mask: &[u8]) -> impl Iterator<Item = u64> + '_ {
    let (whole, rest) = mask.as_chunks::<8>();
    let mut last = [0; 8];
    last[..rest.len()].copy_from_slice(rest);
    let whole = whole.iter().map(|bytes| u64::from_le_bytes(*bytes));
    whole.chain((!rest.is_empty()).then(|| u64::from_le_bytes(last)))
}

/// Whether an action is legal in a decision.
pub fn is_legal(request: &v1::DecisionRequest, action: ActionId) -> bool {
    let byte = usize::try_from(action.0 / 8)
        .ok()
        .and_then(|index| request.action_mask.get(index));
    byte.is_some_and(|byte| byte >> (action.0 % 8) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_read_as_listed() {
        let table: [(&[u8], &[u32]); 6] = [
            (&[], &[]),
            (&[0, 0], &[]),
            (&[0b0000_0001], &[0]),
            (&[0b1000_0000, 0b0000_0001], &[7, 8]),
            (&[0, 0b1010_0000, 0, 0b0000_0110], &[13, 15, 25, 26]),
            (&[0xff], &[0, 1, 2, 3, 4, 5, 6, 7]),
        ];
        for (mask, expected) in table {
            let request = v1::DecisionRequest {
                action_mask: mask.to_vec(),
                ..Default::default()
            };
            let expected: Vec<ActionId> = expected.iter().copied().map(ActionId).collect();
            assert_eq!(legal_actions(&request).collect::<Vec<_>>(), expected);
            assert_eq!(legal_count(&request), expected.len());
            let nth: Vec<ActionId> = (0..).map_while(|n| nth_legal(&request, n)).collect();
            assert_eq!(nth, expected);
            for action in (0..40).map(ActionId).chain([ActionId(u32::MAX)]) {
                assert_eq!(is_legal(&request, action), expected.contains(&action));
            }
        }
    }
}
