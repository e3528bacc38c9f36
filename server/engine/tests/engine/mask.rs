//! Sets of actions and their bytes.

use chefshat_engine::{ActionId, Mask};
use proptest::prelude::*;

fn mask(indices: &[u16]) -> Mask {
    indices.iter().copied().map(ActionId::new).collect()
}

#[test]
fn bytes_have_the_lowest_bit_first() {
    let mask = mask(&[0, 9, 199]);
    let bytes = mask.to_bytes(214);
    assert_eq!(bytes.len(), 27);
    assert_eq!((bytes[0], bytes[1], bytes[24]), (0b1, 0b10, 0b1000_0000));
    assert_eq!(bytes.iter().map(|byte| byte.count_ones()).sum::<u32>(), 3);
    let mut buffer = [0xFF; 60];
    mask.write_bytes(&mut buffer);
    assert_eq!(buffer[..27], bytes[..]);
    assert!(buffer[27..].iter().all(|&byte| byte == 0));
    assert_eq!(Mask::from_bytes(&[0; 49]), None);
    assert_eq!(Mask::from_bytes(&[]), Some(Mask::EMPTY));
}

#[test]
fn actions_beyond_the_capacity_are_ignored() {
    assert_eq!(mask(&[383, 384, u16::MAX]), mask(&[383]));
    assert!(!mask(&[383]).contains(ActionId::new(384)));
    assert!(!mask(&[383]).contains(ActionId::new(u16::MAX)));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_mask_is_a_set(indices in prop::collection::btree_set(0u16..384, 0..200)) {
        let sorted: Vec<ActionId> = indices.iter().copied().map(ActionId::new).collect();
        let mask: Mask = sorted.iter().copied().collect();
        prop_assert_eq!(mask.len(), sorted.len());
        prop_assert_eq!(mask.is_empty(), sorted.is_empty());
        prop_assert_eq!(mask.iter().collect::<Vec<_>>(), sorted.clone());
        for (k, &action) in sorted.iter().enumerate() {
            prop_assert_eq!(mask.nth(k), Some(action));
        }
        prop_assert_eq!(mask.nth(sorted.len()), None);
        prop_assert_eq!(mask.nth(usize::MAX), None);
        for index in 0..400 {
            prop_assert_eq!(mask.contains(ActionId::new(index)), indices.contains(&index));
        }
        prop_assert_eq!(Mask::from_bytes(&mask.to_bytes(384)), Some(mask));
    }
}
