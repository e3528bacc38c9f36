//! Strict verification of Ed25519 signatures. RFC 8032 leaves open whether keys of small order are
//! accepted, and ring accepts them: for such a key, a signature of zeros fits one message in a few.
//! So they are refused here, as `verify_strict` of ed25519-dalek does, without another library. What
//! else is ambiguous ring refuses itself: a scalar that is not reduced, and an encoding of the point R
//! other than the one it computes.

use ring::signature::{ED25519, UnparsedPublicKey};

/// The order of the field, 2^255 - 19, from its lowest byte.
const FIELD: [u8; 32] = with_ends(0xed, 0xff, 0x7f);
/// The coordinates y of all eight points of small order, from their lowest bytes. The two points of
/// each have the same y, and differ in the highest bit.
const SMALL_ORDER: [[u8; 32]; 5] = [
    // Orders 4, 1 and 2.
    [0; 32],
    with_ends(1, 0, 0),
    with_ends(0xec, 0xff, 0x7f),
    // Order 8.
    [
        0x26, 0xe8, 0x95, 0x8f, 0xc2, 0xb2, 0x27, 0xb0, 0x45, 0xc3, 0xf4, 0x89, 0xf2, 0xef, 0x98,
        0xf0, 0xd5, 0xdf, 0xac, 0x05, 0xd3, 0xc6, 0x33, 0x39, 0xb1, 0x38, 0x02, 0x88, 0x6d, 0x53,
        0xfc, 0x05,
    ],
    [
        0xc7, 0x17, 0x6a, 0x70, 0x3d, 0x4d, 0xd8, 0x4f, 0xba, 0x3c, 0x0b, 0x76, 0x0d, 0x10, 0x67,
        0x0f, 0x2a, 0x20, 0x53, 0xfa, 0x2c, 0x39, 0xcc, 0xc6, 0x4e, 0xc7, 0xfd, 0x77, 0x92, 0xac,
        0x03, 0x7a,
    ],
];

const fn with_ends(first: u8, between: u8, last: u8) -> [u8; 32] {
    let mut bytes = [between; 32];
    bytes[0] = first;
    bytes[31] = last;
    bytes
}

/// Whether an encoding of a point is the only one of it, and its order is not small.
pub(super) fn is_point(bytes: &[u8; 32]) -> bool {
    let mut y = *bytes;
    // The sign of x.
    y[31] &= 0x7f;
    y.iter().rev().lt(FIELD.iter().rev()) && !SMALL_ORDER.contains(&y)
}

/// Whether a signature fits a message, the key, and its first half, the point R, included.
pub(super) fn verify(key: &[u8; 32], message: &[u8], signature: &[u8]) -> bool {
    let is_strict = |point: Option<&[u8; 32]>| point.is_some_and(is_point);
    is_strict(Some(key))
        && is_strict(signature.first_chunk())
        && UnparsedPublicKey::new(&ED25519, key)
            .verify(message, signature)
            .is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every encoding with a `y` of small order: both signs, and with the order of the field added
    /// where that has 255 bits.
    fn weak() -> Vec<[u8; 32]> {
        let above = [with_ends(0xed, 0xff, 0x7f), with_ends(0xee, 0xff, 0x7f)];
        let all = SMALL_ORDER.into_iter().chain(above);
        all.flat_map(|y| {
            let mut negative = y;
            negative[31] |= 0x80;
            [y, negative]
        })
        .collect()
    }

    #[test]
    fn what_anybody_can_sign_is_refused() {
        let mut believed = 0;
        for key in weak() {
            assert!(!is_point(&key), "{}", hex::encode(key));
            for point in weak() {
                let signature = [point, [0; 32]].concat();
                for message in 0..64_u8 {
                    let ring = UnparsedPublicKey::new(&ED25519, key);
                    believed += u32::from(ring.verify(&[message], &signature).is_ok());
                    assert!(!verify(&key, &[message], &signature));
                }
            }
        }
        assert!(believed > 0, "ring has become strict: this file can go");
    }

    #[test]
    fn a_second_encoding_of_a_point_is_refused() {
        for first in 0xed..=0xff {
            for last in [0x7f, 0xff] {
                assert!(!is_point(&with_ends(first, 0xff, last)), "{first:x}");
            }
        }
        // The base point, and the greatest y.
        for y in [with_ends(0x58, 0x66, 0x66), with_ends(0xeb, 0xff, 0x7f)] {
            assert!(is_point(&y));
        }
    }
}
