//! What of the hands of a real table is known: not only where they were written down, but wherever they follow from what was.

use chefshat_engine::{BySeat, Cards, Seat};

use super::facts::Counts;
use super::gifts::size_of;
use super::puzzle::Puzzle;

/// What is known of all hands at a moment.
#[derive(Debug, Clone, Copy)]
pub(super) struct Known {
    /// Whose hands are, but for which of the cards of the top face is the Golden one.
    pub(super) hands: BySeat<bool>,
    /// Whether it is known who holds the Golden card.
    pub(super) golden: bool,
}

/// Whose cards are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Follows {
    /// The hand as dealt.
    pub(super) dealt: BySeat<bool>,
    /// The hand after the exchange.
    pub(super) held: BySeat<bool>,
    /// What it gave.
    pub(super) given: BySeat<bool>,
}

impl Puzzle<'_> {
    /// What is known of the hands as dealt, and after the exchange. What is known stands in the completed Shift as it was.
    pub(super) fn known(&self, dealt: &BySeat<Cards>, gifts: &BySeat<Counts>) -> (Known, Known) {
        let follows = self.follows();
        let (golden_dealt, golden_held) = self.golden_known(&follows, dealt, gifts);
        (
            Known {
                hands: follows.dealt,
                golden: golden_dealt,
            },
            Known {
                hands: follows.held,
                golden: golden_held,
            },
        )
    }

    /// Whose cards are known because they are told, because all were played, or because all others are known.
    fn follows(&self) -> Follows {
        let (rules, tally) = (self.rules, &self.tally);
        let players = rules.players();
        let all_dealt = usize::from(rules.hand_size()) * players == usize::from(rules.deck_size());
        let mut known = Follows {
            dealt: tally.dealt.map(|hand| hand.is_some()),
            held: tally
                .played
                .map(|counts| size_of(&counts) == rules.hand_size()),
            given: BySeat::from_fn(players, |seat| {
                self.gives_to(seat).is_none() || tally.given[seat].is_some()
            }),
        };
        loop {
            let before = known;
            let Follows { dealt, held, given } = &mut known;
            for seat in tally.dealt.seats() {
                let received = self.gives_to(seat).is_none_or(|partner| given[partner]);
                given[seat] |= dealt[seat] && (self.is_forced(seat) || (held[seat] && received));
                let gifts_known = given[seat] && received;
                held[seat] |= dealt[seat] && gifts_known;
                dealt[seat] |= held[seat] && gifts_known;
                for hands in [&mut *dealt, &mut *held] {
                    let others = hands.iter().all(|(other, known)| other == seat || *known);
                    hands[seat] |= all_dealt && others;
                }
            }
            if known == before {
                return known;
            }
        }
    }

    fn is_forced(&self, seat: Seat) -> bool {
        self.pairs.iter().any(|pair| pair.forced == seat)
    }
}
