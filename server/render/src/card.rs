//! The cards that a picture shows.

use chefshat_engine::Cards;

/// A card.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Card {
    /// An ingredient, by its face, 1..=15.
    Face(u8),
    /// The Golden card, of this face.
    Golden(u8),
    /// A joker.
    Joker,
}

impl Card {
    /// The face; `None` for a joker.
    pub fn face(self) -> Option<u8> {
        match self {
            Card::Face(face) | Card::Golden(face) => Some(face),
            Card::Joker => None,
        }
    }

    /// The card without marking it as Golden.
    pub(super) fn plain(self) -> Card {
        self.face().map_or(Card::Joker, Card::Face)
    }

    /// The cards of a play.
    pub(super) fn of_play(face: u8, quantity: u8, jokers: u8, golden: bool) -> Vec<Card> {
        let mut cards = vec![Card::Face(face); usize::from(quantity)];
        if let (true, Some(first)) = (golden, cards.first_mut()) {
            *first = Card::Golden(face);
        }
        cards.extend(std::iter::repeat_n(Card::Joker, usize::from(jokers)));
        cards
    }

    /// Cards ascending, jokers at the end, the Golden card first of its face.
    pub(super) fn of_hand(cards: Cards, faces: u8) -> Vec<Card> {
        let plain = |number| {
            if number > faces {
                Card::Joker
            } else {
                Card::Face(number)
            }
        };
        let mut seen: Vec<Card> = cards.ascending(faces).map(plain).collect();
        if cards.has_golden()
            && let Some(first) = seen.iter().position(|&card| card == Card::Face(faces))
        {
            seen[first] = Card::Golden(faces);
        }
        seen
    }
}
