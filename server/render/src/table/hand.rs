//! Laying cards side by side: a hand in its panel, a play on the board. Cards of one face lie closer together than others, and all move
//! together as far as the space asks for.

use serde::Serialize;

use super::super::scene::{Card, Hand};

/// Width of a card.
pub(crate) const CARD_WIDTH: f32 = 64.0;
/// Height of a card.
pub(crate) const CARD_HEIGHT: f32 = 92.0;
/// Space beside the cards of a panel.
pub(crate) const MARGIN: f32 = 14.0;
/// From the last card of a stack to the next stack, where there is space.
const STEP: f32 = CARD_WIDTH + 8.0;
/// The same where there is little: the number in the corner stays to be read.
const LEAST_STEP: f32 = 34.0;
/// How far each card of a stack looks out from behind the one before it, where there is space.
const PEEK: f32 = 9.0;
/// The same where there is little.
const LEAST_PEEK: f32 = 2.0;
/// From one card back to the next, at most.
const BACK_STEP: f32 = 30.0;

/// What is drawn where a card lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Drawn {
    Front(Card),
    Back,
    Unknown,
}

/// A drawing as the template asks for it.
#[derive(Serialize)]
pub(crate) struct Drawing {
    id: String,
    kind: &'static str,
    number: u8,
}

impl Drawn {
    /// The name by which a picture refers to the drawing.
    pub(crate) fn id(self) -> String {
        match self {
            Drawn::Front(Card::Face(face)) => format!("card-{face}"),
            Drawn::Front(Card::Golden(_)) => "card-golden".to_owned(),
            Drawn::Front(Card::Joker) => "card-joker".to_owned(),
            Drawn::Back => "card-back".to_owned(),
            Drawn::Unknown => "card-unknown".to_owned(),
        }
    }

    /// What the template needs to draw it.
    pub(crate) fn drawing(self) -> Drawing {
        let (kind, number) = match self {
            Drawn::Front(Card::Face(face)) => ("face", face),
            Drawn::Front(Card::Golden(face)) => ("golden", face),
            Drawn::Front(Card::Joker) => ("joker", 0),
            Drawn::Back => ("back", 0),
            Drawn::Unknown => ("unknown", 0),
        };
        Drawing {
            id: self.id(),
            kind,
            number,
        }
    }
}

/// A card and where its corner is.
#[derive(Serialize)]
pub(crate) struct Placed {
    pub(crate) card: String,
    #[serde(skip)]
    pub(crate) drawn: Drawn,
    pub(crate) x: f32,
    pub(crate) y: f32,
}

impl Placed {
    fn new(drawn: Drawn, x: f32, y: f32) -> Self {
        Self {
            card: drawn.id(),
            drawn,
            x,
            y,
        }
    }
}

/// How many cards lie in a stack.
#[derive(Serialize)]
pub(crate) struct Label {
    pub(crate) x: f32,
    pub(crate) text: String,
}

/// The cards of a hand in so much space, and a label below each stack of more than one.
pub(crate) fn lay_out(hand: &Hand, width: f32) -> (Vec<Placed>, Vec<Label>) {
    match hand {
        Hand::Open(cards) => open(cards, width),
        Hand::Hidden(count) => (closed(Drawn::Back, *count, width), Vec::new()),
        Hand::Unknown(count) => (closed(Drawn::Unknown, *count, width), Vec::new()),
    }
}

/// Stacks of one face each: the first card lies on top, so that its number is whole, the others look out behind it.
fn open(cards: &[Card], width: f32) -> (Vec<Placed>, Vec<Label>) {
    let stacks: Vec<&[Card]> = cards
        .chunk_by(|left, right| left.face() == right.face())
        .collect();
    let steps = stacks.len().saturating_sub(1) as f32;
    let peeks = (cards.len() - stacks.len()) as f32;
    let space = width - CARD_WIDTH;
    // The space between stacks gives way first, then what looks out of them; where that is not enough, everything does.
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
            placed.push(Placed::new(Drawn::Front(card), x, 0.0));
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

fn closed(drawn: Drawn, count: u8, width: f32) -> Vec<Placed> {
    let steps = f32::from(count.saturating_sub(1)).max(1.0);
    let step = ((width - CARD_WIDTH) / steps).min(BACK_STEP);
    (0..count)
        .map(|index| Placed::new(drawn, f32::from(index) * step, 0.0))
        .collect()
}

/// Cards in rows around a middle, as large as the space allows; and how large that is.
pub(crate) fn spread(
    cards: &[Card],
    per_row: usize,
    width: f32,
    middle: (f32, f32),
) -> (Vec<Placed>, f32) {
    /// The largest that cards become, and the largest of two rows.
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
            Placed::new(Drawn::Front(card), left + column as f32 * step_x, top)
        })
    });
    (placed.collect(), scale)
}

#[cfg(test)]
mod tests {
    use crate::table::hand::*;

    /// Every hand that a rule set can deal: `stacks` faces with cards spread over them.
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
    fn every_hand_stays_in_its_panel_and_shows_every_number() {
        // Widths of the panels of six, four and two players, without their margins; hands as large as fifteen faces make them.
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
                        // The first cards of the stacks lie far enough from each other for their numbers.
                        let mut fronts: Vec<f32> = Vec::new();
                        for (card, next) in placed.iter().zip(placed.iter().skip(1)) {
                            if card.drawn != next.drawn {
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
    fn every_play_fits_the_board() {
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
