//! What cannot be at a real table and is seen at once, so that it can be said in plain words: too many cards of a kind, a hand of the wrong
//! size, a gift of somebody who gives nothing.

use chefshat_engine::Cards;

use super::facts::{JOKER, add, contains, counts_of};
use super::gifts::size_of;
use super::puzzle::Puzzle;

impl Puzzle<'_> {
    /// What can be said in plain words when it is wrong.
    pub(super) fn check_simple(&self) -> Result<(), String> {
        let (rules, tally) = (self.rules, &self.tally);
        let hand = rules.hand_size();
        let mut dealt = [0u8; JOKER + 1];
        for (seat, cards) in tally.dealt.iter() {
            let Some(cards) = cards else { continue };
            if cards.len() != hand {
                return Err(format!(
                    "seat {seat} was dealt {} cards, but {hand} are dealt to each",
                    cards.len()
                ));
            }
            add(&mut dealt, &counts_of(*cards, rules.faces()));
        }
        let mut seen = [0u8; JOKER + 1];
        for (seat, counts) in tally.played.iter() {
            if size_of(counts) > hand {
                return Err(format!(
                    "seat {seat} has played {} cards, but {hand} were dealt to it",
                    size_of(counts)
                ));
            }
            if self.partner(seat).is_none() {
                let dealt = tally.dealt[seat];
                add(
                    &mut seen,
                    &dealt.map_or(*counts, |cards| counts_of(cards, rules.faces())),
                );
            }
        }
        // What was given away may be played by another seat: it would be counted twice.
        for pair in &self.pairs {
            add(&mut seen, &self.sure_of(pair));
        }
        let tellings = [("dealt to", &dealt), ("dealt to or played by", &seen)];
        for (what, counts) in tellings {
            if let Some(kind) = (0..=JOKER).find(|&kind| counts[kind] > self.deck[kind]) {
                let named = match kind {
                    JOKER => "jokers".to_owned(),
                    face => format!("cards of face {}", face + 1),
                };
                return Err(format!(
                    "too many {named} were {what} all seats together: {}, but the deck has {}",
                    counts[kind], self.deck[kind]
                ));
            }
        }
        for (seat, gift) in tally.given.iter() {
            if let (Some(gift), Some(hand)) = (gift, tally.dealt[seat])
                && !self.can_give(hand, *gift)
            {
                return Err(format!(
                    "seat {seat} cannot have given these cards of its hand (the Golden card is written G, and goes last of its face)"
                ));
            }
        }
        for seat in tally.given.seats() {
            if tally.given[seat].is_some() && self.partner(seat).is_none() {
                return Err(format!("seat {seat} gives no cards in this exchange"));
            }
            if let Some(cards) = tally.dealt[seat]
                && self.partner(seat).is_none()
                && !contains(&counts_of(cards, rules.faces()), &tally.played[seat])
            {
                return Err(format!("seat {seat} does not hold these cards"));
            }
        }
        if !self.golden.values().any(|may| *may) {
            return Err(
                "by what is told up to here nobody can have been dealt the Golden card (in hands and gifts it is written G)"
                    .into(),
            );
        }
        Ok(())
    }

    /// Whether a seat with this hand may give these cards: of the top face the Golden card last.
    fn can_give(&self, hand: Cards, gift: Cards) -> bool {
        let faces = self.rules.faces();
        let (hand_counts, gift_counts) = (counts_of(hand, faces), counts_of(gift, faces));
        let all_of_top = hand_counts[self.top] == gift_counts[self.top];
        let golden_goes = hand.has_golden() && all_of_top && gift_counts[self.top] > 0;
        contains(&hand_counts, &gift_counts) && gift.has_golden() == golden_goes
    }
}
