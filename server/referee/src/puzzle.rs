//! A Shift to complete: its facts, and what follows from them for the hands when gifts are assumed.
//! The search for gifts and hands that fit is in `search`.

use chefshat_engine::{BySeat, Cards, ExchangePair, RuleSet, Seat, SeatOrder};

use crate::counts::{
    Counts, JOKER, NOTHING, add, at_least, contains, counts_of, highest, size_of, take,
};
use crate::facts::Tally;
use crate::gifts::{Gifts, pairs};

/// A Shift to complete.
pub(crate) struct Puzzle<'a> {
    pub(crate) rules: &'a RuleSet,
    pub(crate) tally: Tally,
    pub(crate) pairs: Vec<ExchangePair>,
    pub(crate) deck: Counts,
    /// The index of the top face.
    pub(crate) top: usize,
    /// The seats that may have been dealt the Golden card.
    pub(crate) golden: BySeat<bool>,
}

/// The origin of the card that makes a seat the opener: the Golden card, or any of the top face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum OpeningCard {
    Kept,
    Received,
}

/// The dealt cards that a seat keeps, as far as determined, and what may be added.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Kept {
    pub(crate) counts: Counts,
    /// The number of cards to add.
    pub(crate) missing: u8,
    /// No kind below this index may be added.
    pub(crate) floor: usize,
    /// Whether the top face may not be added.
    pub(crate) no_top: bool,
}

impl<'a> Puzzle<'a> {
    pub(crate) fn new(rules: &'a RuleSet, order: Option<SeatOrder>, tally: Tally) -> Self {
        let mut deck = NOTHING;
        for (count, face) in deck.iter_mut().zip(1..=rules.faces()) {
            *count = face;
        }
        deck[JOKER] = rules.jokers();
        let declared = tally
            .special
            .and_then(|(seat, declared)| declared.then_some(seat));
        let pairs = pairs(rules, order, declared);
        let top = usize::from(rules.faces()) - 1;
        Self {
            golden: golden_seats(rules, &tally, &pairs, top),
            rules,
            tally,
            pairs,
            deck,
            top,
        }
    }

    /// The cards a pair certainly holds together, before and after the exchange.
    pub(crate) fn certain_cards(&self, pair: &ExchangePair) -> Counts {
        let tally = &self.tally;
        let (mut dealt, mut held) = (NOTHING, NOTHING);
        for seat in [pair.chooser, pair.forced] {
            let faces = self.rules.faces();
            let mut hand = tally.dealt[seat].map_or(NOTHING, |hand| counts_of(hand, faces));
            let gift = tally.given[seat].map_or(NOTHING, |gift| counts_of(gift, faces));
            at_least(&mut hand, &gift);
            if tally.special.is_some_and(|(special, _)| special == seat) {
                hand[JOKER] = hand[JOKER].max(2);
            }
            add(&mut dealt, &hand);
            let mut after = tally.held[seat].map_or(NOTHING, |hand| counts_of(hand, faces));
            at_least(&mut after, &tally.played[seat]);
            add(&mut held, &after);
            if tally.has_top(seat) {
                held[self.top] = held[self.top].max(1);
            }
        }
        at_least(&mut dealt, &held);
        dealt
    }

    /// What the seats of a pair keep; `None` if the gifts do not fit the facts.
    pub(crate) fn kept_by_pair(
        &self,
        pair: &ExchangePair,
        gifts: &Gifts,
        opening: OpeningCard,
    ) -> Option<(Kept, Kept)> {
        let (given, received) = (&gifts.chosen, &gifts.forced);
        let mut chooser = self.kept(pair.chooser, given, received, None, opening)?;
        let mut forced = self.kept(pair.forced, received, given, Some(gifts), opening)?;
        if let Some(holder) = self.tally.holder.filter(|holder| pair.has(*holder)) {
            let (seat, giver) = match (opening, holder == pair.chooser) {
                (OpeningCard::Kept, _) => (holder, None),
                (OpeningCard::Received, true) => (pair.forced, Some(&mut forced)),
                (OpeningCard::Received, false) => (pair.chooser, Some(&mut chooser)),
            };
            if !self.golden[seat] {
                return None;
            }
            // The Golden card goes last of its face.
            if let Some(giver) = giver {
                giver.no_top = true;
                if giver.counts[self.top] > 0 {
                    return None;
                }
            }
        }
        Some((chooser, forced))
    }

    /// What a seat outside the exchange holds.
    pub(crate) fn kept_alone(&self, seat: Seat) -> Option<Kept> {
        self.kept(seat, &NOTHING, &NOTHING, None, OpeningCard::Kept)
    }

    /// What a seat keeps when it gives and receives these cards; `forced` for a forced giver.
    /// `None` if that does not fit the facts.
    fn kept(
        &self,
        seat: Seat,
        given: &Counts,
        received: &Counts,
        forced: Option<&Gifts>,
        opening: OpeningCard,
    ) -> Option<Kept> {
        let tally = &self.tally;
        let floor = match forced {
            None => 0,
            Some(gifts) if gifts.short => JOKER,
            Some(gifts) => highest(&gifts.forced)?,
        };
        let opens = tally.has_top(seat);
        let mut kept = Kept {
            floor,
            ..Kept::default()
        };
        match tally.dealt[seat] {
            Some(dealt) => {
                kept.counts = counts_of(dealt, self.rules.faces());
                take(&mut kept.counts, given)?;
            }
            None if let Some(hand) = tally.held[seat] => {
                kept.counts = counts_of(hand, self.rules.faces());
                take(&mut kept.counts, received)?;
            }
            None => {
                for (kind, count) in kept.counts.iter_mut().enumerate() {
                    *count = tally.played[seat][kind].saturating_sub(received[kind]);
                }
                if let Some((special, _)) = tally.special
                    && special == seat
                {
                    let jokers = 2u8.saturating_sub(given[JOKER]);
                    kept.counts[JOKER] = kept.counts[JOKER].max(jokers);
                }
                if !tally.exchanged {
                    for (count, stated) in kept.counts.iter_mut().zip(&tally.gives[seat]) {
                        *count = (*count).max(*stated);
                    }
                }
                if opens && opening == OpeningCard::Kept {
                    kept.counts[self.top] = kept.counts[self.top].max(1);
                }
                let determined = size_of(&kept.counts).checked_add(size_of(given))?;
                kept.missing = self.rules.hand_size().checked_sub(determined)?;
            }
        }
        // The Golden card goes last of its face.
        if tally.given[seat].is_some_and(Cards::has_golden) {
            kept.no_top = true;
            if kept.counts[self.top] > 0 {
                return None;
            }
        }
        let mut held = kept.counts;
        add(&mut held, received);
        let has_top = match opening {
            OpeningCard::Kept => kept.counts[self.top] > 0,
            OpeningCard::Received => received[self.top] > 0,
        };
        let fits = kept.counts[..floor.min(JOKER)]
            .iter()
            .all(|&count| count == 0)
            && contains(&held, &tally.played[seat])
            && (!opens || has_top)
            && tally.held[seat].is_none_or(|hand| counts_of(hand, self.rules.faces()) == held);
        fits.then_some(kept)
    }

    /// The partner of a seat in a completed exchange.
    pub(crate) fn gives_to(&self, seat: Seat) -> Option<Seat> {
        self.partner(seat).filter(|_| self.tally.exchanged)
    }

    /// The partner of a seat in the exchange.
    pub(crate) fn partner(&self, seat: Seat) -> Option<Seat> {
        self.pairs.iter().find_map(|pair| match seat {
            seat if seat == pair.chooser => Some(pair.forced),
            seat if seat == pair.forced => Some(pair.chooser),
            _ => None,
        })
    }
}

/// The seats that may have been dealt the Golden card, by the hands, gifts and opening stated.
fn golden_seats(
    rules: &RuleSet,
    tally: &Tally,
    pairs: &[ExchangePair],
    top: usize,
) -> BySeat<bool> {
    let faces = rules.faces();
    let stated: u8 = tally
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
        // All other cards of its face may be stated.
        let is_there = tally.dealt[seat].is_some() || stated < rules.faces();
        let given = tally.given[seat].map(|gift| gift.has_golden());
        let as_opened = match tally.holder {
            None => true,
            Some(holder) if holder == seat => given != Some(true),
            Some(holder) => {
                let with_holder = |pair: &ExchangePair| pair.has(seat) && pair.has(holder);
                pairs.iter().any(with_holder) && given != Some(false)
            }
        };
        as_dealt && as_given && is_there && as_opened
    })
}
