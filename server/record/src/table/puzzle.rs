//! The puzzle that a Shift of a real table is: which hands and gifts, made of the cards of one deck, fit everything that is told. Gifts are
//! chosen among the offers of the pairs that exchange cards (`offers`); what is then still missing in the hands is filled up with any cards that may be
//! there. What a seat may have kept and given is worked out here, who holds the Golden card in `golden`.

use chefshat_engine::{BySeat, Cards, ExchangePair, Opening, RuleSet, Seat, SeatOrder};

use super::complete::Plan;
use super::facts::{Counts, JOKER, Tally, add, at_least, contains, counts_of, take};
use super::gifts::{Gifts, highest, pairs, size_of};
use super::golden::golden_seats;
use super::offers::{Offer, Offers, Tries};

/// Filling hands up takes about as long as comparing so many pairs of offers.
const TRIES_OF_FILLING: usize = 20;
/// Cards of nobody.
const NOTHING: Counts = [0; JOKER + 1];

/// A Shift to be completed.
pub(super) struct Puzzle<'a> {
    pub(super) rules: &'a RuleSet,
    pub(super) tally: Tally,
    pub(super) pairs: Vec<ExchangePair>,
    pub(super) deck: Counts,
    /// Where cards of the top face are counted.
    pub(super) top: usize,
    /// Who may have been dealt the Golden card.
    pub(super) golden: BySeat<bool>,
}

/// Where the card comes from that makes the opener open: the Golden one, or any of the top face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Top {
    Kept,
    Received,
}

/// What a seat keeps of the cards it was dealt, as far as that is settled, and what may still be added.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Kept {
    pub(super) counts: Counts,
    /// Cards to add.
    pub(super) missing: u8,
    /// No card below this position may be added.
    pub(super) floor: usize,
    /// No card of the top face may be added.
    pub(super) no_top: bool,
}

impl<'a> Puzzle<'a> {
    pub(super) fn new(rules: &'a RuleSet, order: Option<SeatOrder>, tally: Tally) -> Self {
        let mut deck = [0; JOKER + 1];
        for (count, face) in deck.iter_mut().zip(1..=rules.faces()) {
            *count = face;
        }
        deck[JOKER] = rules.jokers();
        let pairs = pairs(rules, order, &tally);
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

    /// Finds cards that fit.
    ///
    /// # Errors
    /// Why there are none, or that none were found.
    pub(super) fn solve(&self, tries: &mut Tries) -> Result<Plan, String> {
        self.check_simple()?;
        self.search(tries).ok_or_else(|| {
            if tries.gave_up {
                "no deal and exchange was found that fits everything that is told up to here, but there are too many to look at all of \
                 them: tell more hands and gifts of this Shift, those of the seats that exchanged cards above all"
                    .to_owned()
            } else {
                "no deal of the deck and no exchange fits everything that is told up to here (the Golden card is written as one)"
                    .to_owned()
            }
        })
    }

    /// Finds gifts that fit together, and fills the hands up.
    fn search(&self, tries: &mut Tries) -> Option<Plan> {
        let pairs = if self.tally.exchanged {
            self.pairs.as_slice()
        } else {
            &[]
        };
        let mut room = self.deck;
        for seat in self.tally.dealt.seats() {
            if !pairs.iter().any(|pair| pair.has(seat)) {
                take(&mut room, &self.kept_alone(seat)?.counts)?;
            }
        }
        match *pairs {
            [first, second, ..] => {
                let (mut beside_first, mut beside_second) = (room, room);
                take(&mut beside_first, &self.sure_of(&second))?;
                take(&mut beside_second, &self.sure_of(&first))?;
                let mut first = Offers::new(self, first, &beside_first);
                let mut second = Offers::new(self, second, &beside_second);
                // Whether there is any is soon seen, and mostly the first ones fit together.
                first.get(0, tries)?;
                for number in 0.. {
                    let other = second.get(number, tries)?;
                    for number in 0.. {
                        let Some(one) = first.get(number, tries) else {
                            break;
                        };
                        tries.take(1)?;
                        if one.fits_beside(&other, &room) {
                            tries.take(TRIES_OF_FILLING)?;
                            if let Some(plan) = self.fill(&[one, other]) {
                                return Some(plan);
                            }
                        }
                    }
                }
                None
            }
            [only] => {
                let mut offers = Offers::new(self, only, &room);
                (0..)
                    .map_while(|number| offers.get(number, tries))
                    .find_map(|offer| self.fill(&[offer]))
            }
            [] => self.fill(&[]),
        }
    }

    /// Cards that the seats of a pair hold together for certain, before and after they exchange some.
    pub(super) fn sure_of(&self, pair: &ExchangePair) -> Counts {
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
            add(&mut held, &tally.played[seat]);
            if tally.opener == Some(seat) {
                held[self.top] = held[self.top].max(1);
            }
        }
        at_least(&mut dealt, &held);
        dealt
    }

    /// What the seats of a pair keep; `None` if that cannot be.
    pub(super) fn kept_by_pair(
        &self,
        pair: &ExchangePair,
        gifts: &Gifts,
        top: Top,
    ) -> Option<(Kept, Kept)> {
        let (given, received) = (&gifts.chosen, &gifts.forced);
        let mut chooser = self.kept(pair.chooser, given, received, None, top)?;
        let mut forced = self.kept(pair.forced, received, given, Some(gifts), top)?;
        if self.rules.opening() == Opening::Golden
            && let Some(opener) = self.tally.opener.filter(|opener| pair.has(*opener))
        {
            let (seat, giver) = match (top, opener == pair.chooser) {
                (Top::Kept, _) => (opener, None),
                (Top::Received, true) => (pair.forced, Some(&mut forced)),
                (Top::Received, false) => (pair.chooser, Some(&mut chooser)),
            };
            if !self.golden[seat] {
                return None;
            }
            // Whoever gives the Golden card has no other of its face left.
            if let Some(giver) = giver {
                giver.no_top = true;
                if giver.counts[self.top] > 0 {
                    return None;
                }
            }
        }
        Some((chooser, forced))
    }

    /// What a seat holds that exchanges nothing.
    fn kept_alone(&self, seat: Seat) -> Option<Kept> {
        self.kept(seat, &NOTHING, &NOTHING, None, Top::Kept)
    }

    /// What a seat keeps that gives and receives these cards; `forced` for one that gives without a choice. `None` if that cannot be.
    fn kept(
        &self,
        seat: Seat,
        given: &Counts,
        received: &Counts,
        forced: Option<&Gifts>,
        top: Top,
    ) -> Option<Kept> {
        let tally = &self.tally;
        let floor = match forced {
            None => 0,
            Some(gifts) if gifts.short => JOKER,
            Some(gifts) => highest(&gifts.forced)?,
        };
        let opens = tally.opener == Some(seat);
        let mut kept = Kept {
            floor,
            ..Kept::default()
        };
        match tally.dealt[seat] {
            Some(dealt) => {
                kept.counts = counts_of(dealt, self.rules.faces());
                take(&mut kept.counts, given)?;
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
                    for (count, told) in kept.counts.iter_mut().zip(&tally.gives[seat]) {
                        *count = (*count).max(*told);
                    }
                }
                if opens && top == Top::Kept {
                    kept.counts[self.top] = kept.counts[self.top].max(1);
                }
                let settled = size_of(&kept.counts).checked_add(size_of(given))?;
                kept.missing = self.rules.hand_size().checked_sub(settled)?;
            }
        }
        let mut held = kept.counts;
        add(&mut held, received);
        let has_top = match top {
            Top::Kept => kept.counts[self.top] > 0,
            Top::Received => received[self.top] > 0,
        };
        let fits = kept.counts[..floor.min(JOKER)]
            .iter()
            .all(|&count| count == 0)
            && contains(&held, &tally.played[seat])
            && (!opens || has_top);
        fits.then_some(kept)
    }

    /// Fills all hands up with the cards that are left of the deck. The offers are those of the pairs that exchange cards, in their order.
    fn fill(&self, offers: &[Offer]) -> Option<Plan> {
        let players = self.rules.players();
        let mut given = BySeat::filled(players, NOTHING);
        let mut kept: BySeat<Option<Kept>> = BySeat::filled(players, None);
        for (pair, offer) in self.pairs.iter().zip(offers) {
            let (chooser, forced) = self.kept_by_pair(pair, &offer.gifts, offer.top)?;
            (kept[pair.chooser], kept[pair.forced]) = (Some(chooser), Some(forced));
            given[pair.chooser] = offer.gifts.chosen;
            given[pair.forced] = offer.gifts.forced;
        }
        for seat in given.seats() {
            if kept[seat].is_none() {
                kept[seat] = Some(self.kept_alone(seat)?);
            }
        }
        let mut kept = kept.map(Option::unwrap_or_default);
        let mut left = self.deck;
        for seat in kept.seats() {
            take(&mut left, &given[seat])?;
            take(&mut left, &kept[seat].counts)?;
        }
        // Whoever may take the fewest kinds of cards takes first: those kinds suit everybody else as well.
        let mut seats: Vec<Seat> = kept.seats().collect();
        seats.sort_by_key(|&seat| std::cmp::Reverse(kept[seat].floor));
        for seat in seats {
            fill_up(&mut kept[seat], &mut left, self.top);
            if kept[seat].missing > 0 {
                return None;
            }
        }
        let golden = self.golden_dealt_to(&kept, &given)?;
        let dealt = BySeat::from_fn(players, |seat| {
            let mut counts = kept[seat].counts;
            add(&mut counts, &given[seat]);
            self.cards(&counts, seat == golden)
        });
        if dealt.values().any(Option::is_none) {
            return None;
        }
        let dealt = dealt.map(Option::unwrap_or_default);
        let (dealt_known, held_known) = self.known(&dealt, &given);
        Some(Plan {
            dealt,
            gifts: given,
            choosers: BySeat::from_fn(players, |seat| {
                self.pairs.iter().any(|pair| pair.chooser == seat)
            }),
            drawn: (self.rules.opening() == Opening::AnyTopFace)
                .then(|| self.tally.opener.unwrap_or(Seat::new(0))),
            dealt_known,
            held_known,
        })
    }

    /// With whom a seat has exchanged cards.
    pub(super) fn gives_to(&self, seat: Seat) -> Option<Seat> {
        self.partner(seat).filter(|_| self.tally.exchanged)
    }

    /// With whom a seat exchanges cards.
    pub(super) fn partner(&self, seat: Seat) -> Option<Seat> {
        self.pairs.iter().find_map(|pair| match seat {
            seat if seat == pair.chooser => Some(pair.forced),
            seat if seat == pair.forced => Some(pair.chooser),
            _ => None,
        })
    }

    fn cards(&self, counts: &Counts, golden: bool) -> Option<Cards> {
        let faces = self.rules.faces();
        let mut list = counts[..usize::from(faces)].to_vec();
        list.push(counts[JOKER]);
        Cards::from_counts(faces, &list, golden)
    }
}

/// Adds the highest faces that may be added, jokers last.
fn fill_up(kept: &mut Kept, left: &mut Counts, top: usize) {
    let highest = if kept.no_top { top } else { top + 1 };
    for kind in (kept.floor.min(highest)..highest).rev().chain([JOKER]) {
        let added = left[kind].min(kept.missing);
        left[kind] -= added;
        kept.counts[kind] += added;
        kept.missing -= added;
    }
}
