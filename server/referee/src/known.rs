//! Which hands of a real table are known, because they were stated or follow from the facts, and
//! who may hold the Golden card. A hand, a gift or the golden opening reveals it; other plays do
//! not.

use chefshat_engine::{BySeat, Cards, Face, Seat};

use crate::counts::{Counts, size_of};
use crate::puzzle::{Kept, Puzzle};

/// What is known of all hands at one moment.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    /// Whether each hand is known, as counts.
    pub(crate) hands: BySeat<bool>,
    /// Of each seat, whether it is known that it holds the Golden card, or that it does not.
    pub(crate) golden: BySeat<bool>,
}

/// Which cards are known, by seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct KnownCards {
    /// The hand as dealt.
    pub(crate) dealt: BySeat<bool>,
    /// The hand after the exchange.
    pub(crate) held: BySeat<bool>,
    /// The gift.
    pub(crate) given: BySeat<bool>,
}

impl Puzzle<'_> {
    /// What is known of the hands as dealt and after the exchange, and whose gifts are known. Known
    /// hands are exact in the completed Shift.
    pub(crate) fn known(
        &self,
        dealt: &BySeat<Cards>,
        gifts: &BySeat<Counts>,
    ) -> (Known, Known, BySeat<bool>) {
        let known = self.known_cards();
        let (golden_dealt, golden_held) = self.golden_known(&known, dealt, gifts);
        (
            Known {
                hands: known.dealt,
                golden: golden_dealt,
            },
            Known {
                hands: known.held,
                golden: golden_held,
            },
            known.given,
        )
    }

    /// The cards known because they were stated, all played, or the only ones left.
    fn known_cards(&self) -> KnownCards {
        let (rules, tally) = (self.rules, &self.tally);
        let players = rules.players();
        let all_dealt = usize::from(rules.hand_size()) * players == usize::from(rules.deck_size());
        let mut known = KnownCards {
            dealt: tally.dealt.map(|hand| hand.is_some()),
            held: BySeat::from_fn(players, |seat| {
                tally.held[seat].is_some() || size_of(&tally.played[seat]) == rules.hand_size()
            }),
            given: BySeat::from_fn(players, |seat| {
                self.gives_to(seat).is_none() || tally.given[seat].is_some()
            }),
        };
        loop {
            let before = known;
            let KnownCards { dealt, held, given } = &mut known;
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

impl Puzzle<'_> {
    /// A seat that can be dealt the Golden card so that the opener holds it after the exchange.
    pub(crate) fn golden_dealt_to(
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
                let opens = tally.holder.is_none_or(|stated| holder == Some(stated));
                let as_held = (tally.held.iter()).all(|(seat, hand)| {
                    hand.is_none_or(|hand| hand.has_golden() == (holder == Some(seat)))
                });
                let as_given = tally.given[seat].is_none_or(|gift| gift.has_golden() == goes);
                (stays || goes) && opens && as_held && as_given
            })
    }

    /// Of each seat, whether it is known that it holds the Golden card or not, as dealt and after the
    /// exchange.
    pub(crate) fn golden_known(
        &self,
        known: &KnownCards,
        dealt: &BySeat<Cards>,
        gifts: &BySeat<Counts>,
    ) -> (BySeat<bool>, BySeat<bool>) {
        let tally = &self.tally;
        let top = Face::new(self.rules.faces());
        let dealt_top = |seat: Seat| top.map_or(0, |top| dealt[seat].count(top));
        let gave_none = |seat: Seat| known.given[seat] && gifts[seat][self.top] == 0;
        let from: Vec<Seat> = (dealt.seats())
            .filter(|&seat| {
                let had_none = known.dealt[seat] && dealt_top(seat) == 0;
                let kept_it = tally.holder.is_some_and(|holder| holder != seat) && gave_none(seat);
                self.golden[seat] && !had_none && !kept_it
            })
            .collect();
        // Whether the seat gave it away: all other cards of its face go first.
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
        let without = |seat: Seat| tally.held[seat].is_some_and(|hand| !hand.has_golden());
        holders.retain(|seat| !without(*seat));
        let certain = |possible: &[Seat]| {
            let only = possible.windows(2).all(|two| two[0] == two[1]);
            BySeat::from_fn(dealt.len(), |seat| only || !possible.contains(&seat))
        };
        let held = match tally.holder {
            Some(_) => BySeat::filled(dealt.len(), true),
            None => certain(&holders),
        };
        (certain(&from), held)
    }
}
