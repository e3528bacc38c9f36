//! Seats, cards and actions as the numbers of messages, and back.

use chefshat_engine::{ActionId, Cards, Seat};
use chefshat_proto::v1;

/// The number of a seat in messages.
pub fn seat_number(seat: Seat) -> u32 {
    u32::try_from(seat.index()).expect("a seat is below six")
}

/// The seat with a number; `None` if out of range.
pub fn seat_from_number(number: u32, players: usize) -> Option<Seat> {
    usize::try_from(number)
        .ok()
        .filter(|&index| index < players)
        .map(Seat::new)
}

/// Converts the cards of a seat.
pub fn seat_cards(seat: Seat, cards: Cards, faces: u8) -> v1::SeatCards {
    v1::SeatCards {
        seat: seat_number(seat),
        cards: ascending(cards, faces),
        golden: cards.has_golden(),
    }
}

/// Cards as numbers, ascending: faces 1..=F, F+1 for a joker.
pub(super) fn ascending(cards: Cards, faces: u8) -> Vec<u32> {
    cards.ascending(faces).map(u32::from).collect()
}

/// Reads cards in any order: faces 1..=F, F+1 for a joker; one card of face F is Golden if
/// `golden`. `None` if no deck with F faces contains them.
pub fn cards_from_numbers(numbers: &[u32], golden: bool, faces: u8) -> Option<Cards> {
    let mut counts = vec![0u8; usize::from(faces) + 1];
    for &number in numbers {
        let index = usize::try_from(number).ok()?.checked_sub(1)?;
        let count = counts.get_mut(index)?;
        *count = count.checked_add(1)?;
    }
    Cards::from_counts(faces, &counts, golden)
}

/// The action with an index; an index out of range gives an action that does not exist.
pub(crate) fn action_id(action: u32) -> ActionId {
    ActionId::new(u16::try_from(action).unwrap_or(u16::MAX))
}
