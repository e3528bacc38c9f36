//! Where the Golden card of a real table is: who may have been dealt it, and whether it is known who holds it. A hand, a gift or the opening
//! tells it; a play does not, because it counts as any other of its face.

use chefshat_engine::{BySeat, Cards, ExchangePair, Face, Opening, RuleSet, Seat};

use super::facts::{Counts, Tally, counts_of};
use super::known::Follows;
use super::puzzle::{Kept, Puzzle};

/// Who may have been dealt the Golden card, by the hands and gifts that are told and by who opened.
pub(super) fn golden_seats(
    rules: &RuleSet,
    tally: &Tally,
    pairs: &[ExchangePair],
    top: usize,
) -> BySeat<bool> {
    let faces = rules.faces();
    let told: u8 = tally
        .dealt
        .values()
        .flatten()
        .map(|hand| counts_of(*hand, faces)[top])
        .fold(0, u8::saturating_add);
    BySeat::from_fn(rules.players(), |seat| {
        let as_dealt = tally
            .dealt
            .iter()
            .all(|(other, hand)| hand.is_none_or(|hand| hand.has_golden() == (other == seat)));
        let as_given = tally
            .given
            .iter()
            .all(|(giver, gift)| giver == seat || gift.is_none_or(|gift| !gift.has_golden()));
        // All others of its face may be told of.
        let is_there = tally.dealt[seat].is_some() || told < rules.faces();
        let given = tally.given[seat].map(|gift| gift.has_golden());
        let as_opened = match tally.opener.filter(|_| rules.opening() == Opening::Golden) {
            None => true,
            Some(opener) if opener == seat => given != Some(true),
            Some(opener) => {
                let with_opener = |pair: &ExchangePair| pair.has(seat) && pair.has(opener);
                pairs.iter().any(with_opener) && given != Some(false)
            }
        };
        as_dealt && as_given && is_there && as_opened
    })
}

impl Puzzle<'_> {
    /// Who was dealt the Golden card, so that the opener holds it after the exchange.
    pub(super) fn golden_dealt_to(
        &self,
        kept: &BySeat<Kept>,
        given: &BySeat<Counts>,
    ) -> Option<Seat> {
        let tally = &self.tally;
        kept.seats()
            .filter(|&seat| self.golden[seat])
            .find(|&seat| {
                let stays = kept[seat].counts[self.top] > 0;
                let goes = !stays && given[seat][self.top] > 0;
                let holder = if stays {
                    Some(seat)
                } else {
                    self.partner(seat)
                };
                let opens = match tally.opener {
                    Some(opener) if self.rules.opening() == Opening::Golden => {
                        holder == Some(opener)
                    }
                    _ => true,
                };
                let as_given = tally.given[seat].is_none_or(|gift| gift.has_golden() == goes);
                (stays || goes) && opens && as_given
            })
    }

    /// Whether it is known who was dealt the Golden card, and who held it after the exchange.
    pub(super) fn golden_known(
        &self,
        known: &Follows,
        dealt: &BySeat<Cards>,
        gifts: &BySeat<Counts>,
    ) -> (bool, bool) {
        let tally = &self.tally;
        let top = Face::new(self.rules.faces());
        let dealt_top = |seat: Seat| top.map_or(0, |top| dealt[seat].count(top));
        let gave_none = |seat: Seat| known.given[seat] && gifts[seat][self.top] == 0;
        let opener = tally
            .opener
            .filter(|_| self.rules.opening() == Opening::Golden);
        let from: Vec<Seat> = (dealt.seats())
            .filter(|&seat| {
                let had_none = known.dealt[seat] && dealt_top(seat) == 0;
                let kept_it = opener.is_some_and(|opener| opener != seat) && gave_none(seat);
                self.golden[seat] && !had_none && !kept_it
            })
            .collect();
        // Whether the seat that was dealt it gave it away: all others of its face are given before it.
        let gave_it = |seat: Seat| match tally.given[seat] {
            Some(gift) => Some(gift.has_golden()),
            None if gave_none(seat) => Some(false),
            None if known.given[seat] && known.dealt[seat] => {
                Some(gifts[seat][self.top] == dealt_top(seat))
            }
            None => None,
        };
        let mut holders: Vec<Seat> = Vec::new();
        for &seat in &from {
            match (self.gives_to(seat), gave_it(seat)) {
                (Some(partner), Some(true)) => holders.push(partner),
                (Some(partner), None) => holders.extend([seat, partner]),
                (None, _) | (_, Some(false)) => holders.push(seat),
            }
        }
        let one_holder = holders.windows(2).all(|two| two[0] == two[1]);
        (from.len() == 1, opener.is_some() || one_holder)
    }
}
