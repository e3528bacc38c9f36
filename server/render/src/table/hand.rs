//! Card layout: hands in panels, plays on the board. Cards of one face form a stack; all move
//! together to fit the space.

use serde::Serialize;

use super::super::card::Card;
use super::super::scene::Hand;

/// Width of a card.
pub(crate) const CARD_WIDTH: f32 = 64.0;
/// Height of a card.
pub(crate) const CARD_HEIGHT: f32 = 92.0;
/// Margin of the cards in a panel.
pub(crate) const MARGIN: f32 = 14.0;
/// Distance from the last card of a stack to the next stack, at most.
const STEP: f32 = CARD_WIDTH + 8.0;
/// The same at least: the number in the corner stays visible.
const LEAST_STEP: f32 = 34.0;
/// Offset between the cards of a stack, at most.
const PEEK: f32 = 9.0;
/// The same at least.
const LEAST_PEEK: f32 = 2.0;
/// Offset between card backs, at most.
const BACK_STEP: f32 = 30.0;

/// The sprite of a card.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Sprite {
    Front(Card),
    Back,
    Unknown,
}

/// A sprite definition for the template.
#[derive(Serialize)]
pub(crate) struct SpriteDefinition {
    id: String,
    kind: &'static str,
    number: u8,
}

impl Sprite {
    /// The id of the sprite in the SVG.
    pub(crate) fn id(self) -> String {
        match self {
            Sprite::Front(Card::Face(face)) => format!("card-{face}"),
            Sprite::Front(Card::Golden(_)) => "card-golden".to_owned(),
            Sprite::Front(Card::Joker) => "card-joker".to_owned(),
            Sprite::Back => "card-back".to_owned(),
            Sprite::Unknown => "card-unknown".to_owned(),
        }
    }

    /// The values the template needs.
    pub(crate) fn definition(self) -> SpriteDefinition {
        let (kind, number) = match self {
            Sprite::Front(Card::Face(face)) => ("face", face),
            Sprite::Front(Card::Golden(face)) => ("golden", face),
            Sprite::Front(Card::Joker) => ("joker", 0),
            Sprite::Back => ("back", 0),
            Sprite::Unknown => ("unknown", 0),
        };
        SpriteDefinition {
            id: self.id(),
            kind,
            number,
        }
    }
}

/// A card with the position of its corner.
#[derive(Serialize)]
pub(crate) struct Placed {
    pub(crate) card: String,
    #[serde(skip)]
    pub(crate) sprite: Sprite,
    pub(crate) x: f32,
    pub(crate) y: f32,
}

impl Placed {
    fn new(sprite: Sprite, x: f32, y: f32) -> Self {
        Self {
            card: sprite.id(),
            sprite,
            x,
            y,
        }
    }
}

/// The number of cards in a stack.
#[derive(Serialize)]
pub(crate) struct Label {
    pub(crate) x: f32,
    pub(crate) text: String,
}

/// Lays out a hand, with a label below each stack of several cards.
pub(crate) fn lay_out(hand: &Hand, width: f32) -> (Vec<Placed>, Vec<Label>) {
    match hand {
        Hand::Open(cards) => open(cards, width),
        Hand::Hidden(count) => (closed(Sprite::Back, *count, width), Vec::new()),
        Hand::Unknown(count) => (closed(Sprite::Unknown, *count, width), Vec::new()),
    }
}

/// Stacks by face, the first card on top so that its number is visible.
fn open(cards: &[Card], width: f32) -> (Vec<Placed>, Vec<Label>) {
    let stacks: Vec<&[Card]> = cards
        .chunk_by(|left, right| left.face() == right.face())
        .collect();
    let steps = stacks.len().saturating_sub(1) as f32;
    let peeks = (cards.len() - stacks.len()) as f32;
    let space = width - CARD_WIDTH;
    // Reduce the distance between stacks first, then the offsets, then scale everything.
    let share = |space: f32, parts: f32, least: f32, most: f32| {
        if parts > 0.0 {
            (space / parts).clamp(least, most)
        } else {
            most
        }
    };
    let step = share(space - peeks * PEEK, steps, LEAST_STEP, STEP);
    let peek = share(space - steps * step, peeks, LEAST_PEEK, PEEK);
    let used = steps * step + peeks * peek;
    let shrink = if used > space { space / used } else { 1.0 };

    let (mut placed, mut labels) = (Vec::with_capacity(cards.len()), Vec::new());
    let mut left = 0.0;
    for stack in stacks {
        let behind = stack.len() as f32 - 1.0;
        for (depth, &card) in stack.iter().rev().enumerate() {
            let x = left + (behind - depth as f32) * peek * shrink;
            placed.push(Placed::new(Sprite::Front(card), x, 0.0));
        }
        if stack.len() > 1 {
            labels.push(Label {
                x: left + LEAST_STEP / 2.0,
                text: format!("×{}", stack.len()),
            });
        }
        left += (behind * peek + step) * shrink;
    }
    (placed, labels)
}

fn closed(sprite: Sprite, count: u8, width: f32) -> Vec<Placed> {
    let steps = f32::from(count.saturating_sub(1)).max(1.0);
    let step = ((width - CARD_WIDTH) / steps).min(BACK_STEP);
    (0..count)
        .map(|index| Placed::new(sprite, f32::from(index) * step, 0.0))
        .collect()
}

/// Lays out cards in rows around a centre; returns their scale too.
pub(crate) fn spread(
    cards: &[Card],
    per_row: usize,
    width: f32,
    middle: (f32, f32),
) -> (Vec<Placed>, f32) {
    /// The largest scale for one row and for two.
    const LARGEST: [f32; 2] = [1.45, 0.95];
    const SPACE: f32 = 8.0;
    let rows = cards.len().div_ceil(per_row).max(1);
    let columns = cards.len().div_ceil(rows).max(1);
    let scale = (width / (columns as f32 * (CARD_WIDTH + SPACE))).min(LARGEST[(rows - 1).min(1)]);
    let (step_x, step_y) = ((CARD_WIDTH + SPACE) * scale, (CARD_HEIGHT + SPACE) * scale);
    let placed = cards.chunks(columns).enumerate().flat_map(|(row, line)| {
        let left = middle.0 - (line.len() as f32 * step_x - SPACE * scale) / 2.0;
        let top = middle.1 - (rows as f32 * step_y - SPACE * scale) / 2.0 + row as f32 * step_y;
        line.iter().enumerate().map(move |(column, &card)| {
            Placed::new(Sprite::Front(card), left + column as f32 * step_x, top)
        })
    });
    (placed.collect(), scale)
}

#[cfg(test)]
mod tests {
    use crate::table::hand::*;

    /// A hand of `count` cards spread over `faces`.
    fn hand(faces: u8, count: usize) -> Hand {
        let deck = (1..=faces).flat_map(|face| vec![Card::Face(face); usize::from(face)]);
        let deck: Vec<Card> = deck.chain([Card::Joker; 2]).collect();
        let mut cards: Vec<Card> = (0..count)
            .map(|index| deck[index * deck.len() / count])
            .collect();
        cards.sort();
        Hand::Open(cards)
    }

    #[test]
    fn hands_fit_their_panels_and_show_every_number() {
        // Panel widths for six, four and two players without margins; hands of up to fifteen
        // faces.
        for (width, most) in [(380.0, 20), (592.0, 30), (1224.0, 61)] {
            for count in 1..=most {
                for faces in [4, 11, 15] {
                    for hand in [
                        hand(faces, count),
                        Hand::Hidden(u8::try_from(count).unwrap()),
                    ] {
                        let (placed, labels) = lay_out(&hand, width);
                        assert_eq!(placed.len(), count);
                        let right = placed.iter().map(|card| card.x).fold(0.0, f32::max);
                        assert!(right + CARD_WIDTH <= width + 0.01, "{hand:?}: {right}");
                        // The top cards of the stacks leave room for their numbers.
                        let mut fronts: Vec<f32> = Vec::new();
                        for (card, next) in placed.iter().zip(placed.iter().skip(1)) {
                            if card.sprite != next.sprite {
                                fronts.push(card.x);
                            }
                        }
                        fronts.extend(placed.last().map(|card| card.x));
                        for (front, next) in fronts.iter().zip(fronts.iter().skip(1)) {
                            assert!(next - front >= 19.0, "{hand:?}: {front} {next}");
                        }
                        assert!(labels.len() <= 16);
                    }
                }
            }
        }
    }

    #[test]
    fn plays_fit_the_board() {
        for count in 1..=17 {
            let (placed, scale) = spread(&vec![Card::Face(15); count], 9, 470.0, (640.0, 424.0));
            assert_eq!(placed.len(), count);
            for card in &placed {
                assert!((400.0..=880.0 - CARD_WIDTH * scale).contains(&card.x));
                assert!(
                    (320.0..=530.0 - CARD_HEIGHT * scale).contains(&card.y),
                    "{}",
                    card.y
                );
            }
        }
    }
}
