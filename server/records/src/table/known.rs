//! Whose hands at a real table are known: not only where they were written down, but wherever they follow from what was.

use chefshat_engine::{BySeat, Seat};

use super::complete::Puzzle;
use super::gifts::size_of;

impl Puzzle<'_> {
    /// Whose hands are known as dealt, and after the exchange: because they are told, because all their cards were played, or because
    /// all others are known.
    pub(super) fn known(&self) -> (BySeat<bool>, BySeat<bool>) {
        let (rules, tally) = (self.rules, &self.tally);
        let players = rules.players();
        let partners = BySeat::from_fn(players, |seat| {
            self.partner(seat).filter(|_| tally.exchanged)
        });
        let mut dealt = tally.dealt.map(|hand| hand.is_some());
        let mut held = tally
            .played
            .map(|counts| size_of(&counts) == rules.hand_size());
        let mut given = BySeat::from_fn(players, |seat| {
            partners[seat].is_none() || tally.given[seat].is_some()
        });
        let all_dealt = usize::from(rules.hand_size()) * players == usize::from(rules.deck_size());
        loop {
            let before = (dealt, held, given);
            for seat in dealt.seats() {
                let received = partners[seat].is_none_or(|partner| given[partner]);
                given[seat] |= dealt[seat] && (self.is_forced(seat) || (held[seat] && received));
                let gifts_known = given[seat] && received;
                held[seat] |= dealt[seat] && gifts_known;
                dealt[seat] |= held[seat] && gifts_known;
                for hands in [&mut dealt, &mut held] {
                    let others = hands.iter().all(|(other, known)| other == seat || *known);
                    hands[seat] |= all_dealt && others;
                }
            }
            if (dealt, held, given) == before {
                return (dealt, held);
            }
        }
    }

    fn is_forced(&self, seat: Seat) -> bool {
        self.pairs.iter().any(|pair| pair.forced == seat)
    }
}
