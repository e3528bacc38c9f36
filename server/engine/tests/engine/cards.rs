//! Cards as packed counts.

use chefshat_engine::{Cards, Face};

use crate::support::cards;

fn face(number: u8) -> Face {
    Face::new(number).unwrap()
}

#[test]
fn counts_lists_and_lengths() {
    let hand = cards(11, "1 3 3 11 G J J");
    assert_eq!(
        hand.counts(11).collect::<Vec<_>>(),
        [1, 0, 2, 0, 0, 0, 0, 0, 0, 0, 2, 2]
    );
    assert_eq!(
        hand.ascending(11).collect::<Vec<_>>(),
        [1, 3, 3, 11, 11, 12, 12]
    );
    assert_eq!(
        (
            hand.len(),
            hand.faces_len(),
            hand.jokers(),
            hand.count(face(11))
        ),
        (7, 5, 2, 2)
    );
    assert_eq!(
        (hand.rarest(), hand.highest()),
        (Some(face(1)), Some(face(11)))
    );
    assert!(hand.has_golden() && !hand.is_empty());
    assert_eq!(format!("{hand:?}"), "[1, 3, 3, 11, 11, J, J, Golden]");
    assert_eq!(cards(11, "J").rarest(), None);
    assert_eq!(cards(11, "J").highest(), None);
    assert_eq!((Cards::EMPTY.len(), Cards::EMPTY.is_empty()), (0, true));
}

#[test]
fn the_largest_deck_fits() {
    let counts: Vec<u8> = (1..=15).chain([2]).collect();
    let deck = Cards::from_counts(15, &counts, true).unwrap();
    assert_eq!((deck.len(), deck.faces_len()), (122, 120));
    assert_eq!(deck.counts(15).collect::<Vec<_>>(), counts);
    assert_eq!(deck.ascending(15).count(), 122);
}

#[test]
fn impossible_counts_are_refused() {
    assert_eq!(Cards::from_counts(4, &[2, 0, 0, 0, 0], false), None);
    assert_eq!(Cards::from_counts(4, &[0, 0, 0, 0, 3], false), None);
    assert_eq!(Cards::from_counts(4, &[0, 0, 0, 0, 0], true), None);
    assert_eq!(Cards::from_counts(4, &[0, 0, 0, 0], false), None);
    assert_eq!(Cards::from_counts(16, &[0; 17], false), None);
    assert_eq!(Cards::from_counts(0, &[0], false), None);
}

#[test]
fn taking_and_adding() {
    let hand = cards(4, "3 4 G J");
    assert_eq!(
        hand.without_face(face(4), 1),
        Some(cards(4, "3 G J")),
        "the Golden card goes last"
    );
    assert_eq!(hand.without_face(face(4), 2), Some(cards(4, "3 J")));
    assert_eq!(hand.without_face(face(4), 3), None);
    assert_eq!(hand.without_face(face(2), 1), None);
    assert_eq!(hand.without_jokers(1), Some(cards(4, "3 4 G")));
    assert_eq!(hand.without_jokers(2), None);
    assert_eq!(
        hand.union(cards(4, "3 3 J")),
        Some(cards(4, "3 3 3 4 G J J"))
    );
    assert_eq!(hand.union(cards(4, "3 3 3")), None, "four threes");
    assert_eq!(hand.union(cards(4, "J J")), None, "three jokers");
    assert_eq!(hand.union(cards(4, "G")), None, "two Golden cards");
    assert!(
        hand.contains(cards(4, "3 4 4"))
            && !hand.contains(cards(4, "3 3"))
            && !hand.contains(cards(4, "J J"))
    );
}
