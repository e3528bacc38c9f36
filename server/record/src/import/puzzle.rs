//! The search that completes a Shift: which hands and gifts, from the cards of one deck, fit all
//! facts. Gifts come from the candidates of each pair (`gifts`); the hands are then filled with
//! any cards allowed.

use chefshat_engine::{BySeat, Cards, ExchangePair, Opening, RuleSet, Seat, SeatOrder};

use super::complete::Plan;
use super::facts::{Counts, JOKER, Tally, add, at_least, contains, counts_of, take};
use super::gifts::{Candidate, Candidates, Gifts, SearchBudget, highest, pairs, size_of};
use super::known::golden_seats;

/// Search steps charged for filling the hands.
const FILL_STEPS: usize = 20;
const NOTHING: Counts = [0; JOKER + 1];

/// A Shift to complete.
pub(super) struct Puzzle<'a> {
    pub(super) rules: &'a RuleSet,
    pub(super) tally: Tally,
    pub(super) pairs: Vec<ExchangePair>,
    pub(super) deck: Counts,
    /// The index of the top face.
    pub(super) top: usize,
    /// The seats that may have been dealt the Golden card.
    pub(super) golden: BySeat<bool>,
}

/// The origin of the card that makes a seat the opener: the Golden card, or any of the top face.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum OpeningCard {
    Kept,
    Received,
}

/// The dealt cards that a seat keeps, as far as determined, and what may be added.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Kept {
    pub(super) counts: Counts,
    /// The number of cards to add.
    pub(super) missing: u8,
    /// No kind below this index may be added.
    pub(super) floor: usize,
    /// Whether the top face may not be added.
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

    /// Finds hands and gifts that fit.
    ///
    /// # Errors
    /// Why none fit, or that the budget is exhausted.
    pub(super) fn solve(&self, budget: &mut SearchBudget) -> Result<Plan, String> {
        self.check_basic()?;
        self.search(budget).ok_or_else(|| {
            if budget.exhausted {
                "found no deal and exchange that fit everything stated up to here, but there are too many to try them all: state more hands \
                 and gifts of this Shift, especially of the seats that exchanged cards"
                    .to_owned()
            } else {
                "no deal and exchange fit everything stated up to here (is the Golden card written G?)"
                    .to_owned()
            }
        })
    }

    /// Finds gifts that fit together and fills the hands.
    fn search(&self, budget: &mut SearchBudget) -> Option<Plan> {
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
                take(&mut beside_first, &self.certain_cards(&second))?;
                take(&mut beside_second, &self.certain_cards(&first))?;
                let mut first = Candidates::new(self, first, &beside_first);
                let mut second = Candidates::new(self, second, &beside_second);
                // Without any candidate the search ends at once.
                first.get(0, budget)?;
                for index in 0.. {
                    let other = second.get(index, budget)?;
                    for index in 0.. {
                        let Some(one) = first.get(index, budget) else {
                            break;
                        };
                        budget.spend(1)?;
                        if one.fits_beside(&other, &room) {
                            budget.spend(FILL_STEPS)?;
                            if let Some(plan) = self.fill(&[one, other]) {
                                return Some(plan);
                            }
                        }
                    }
                }
                None
            }
            [only] => {
                let mut candidates = Candidates::new(self, only, &room);
                (0..)
                    .map_while(|index| candidates.get(index, budget))
                    .find_map(|candidate| self.fill(&[candidate]))
            }
            [] => self.fill(&[]),
        }
    }

    /// The cards a pair certainly holds together, before and after the exchange.
    pub(super) fn certain_cards(&self, pair: &ExchangePair) -> Counts {
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

    /// What the seats of a pair keep; `None` if the gifts do not fit the facts.
    pub(super) fn kept_by_pair(
        &self,
        pair: &ExchangePair,
        gifts: &Gifts,
        opening: OpeningCard,
    ) -> Option<(Kept, Kept)> {
        let (given, received) = (&gifts.chosen, &gifts.forced);
        let mut chooser = self.kept(pair.chooser, given, received, None, opening)?;
        let mut forced = self.kept(pair.forced, received, given, Some(gifts), opening)?;
        if self.rules.opening() == Opening::Golden
            && let Some(opener) = self.tally.opener.filter(|opener| pair.has(*opener))
        {
            let (seat, giver) = match (opening, opener == pair.chooser) {
                (OpeningCard::Kept, _) => (opener, None),
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
    fn kept_alone(&self, seat: Seat) -> Option<Kept> {
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
            && (!opens || has_top);
        fits.then_some(kept)
    }

    /// Fills all hands from the rest of the deck. `candidates` has one entry per pair, in order.
    fn fill(&self, candidates: &[Candidate]) -> Option<Plan> {
        let players = self.rules.players();
        let mut given = BySeat::filled(players, NOTHING);
        let mut kept: BySeat<Option<Kept>> = BySeat::filled(players, None);
        for (pair, candidate) in self.pairs.iter().zip(candidates) {
            let (chooser, forced) = self.kept_by_pair(pair, &candidate.gifts, candidate.opening)?;
            (kept[pair.chooser], kept[pair.forced]) = (Some(chooser), Some(forced));
            given[pair.chooser] = candidate.gifts.chosen;
            given[pair.forced] = candidate.gifts.forced;
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
        // The most restricted seat takes first: its kinds suit every other seat too.
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

    /// The partner of a seat in a completed exchange.
    pub(super) fn gives_to(&self, seat: Seat) -> Option<Seat> {
        self.partner(seat).filter(|_| self.tally.exchanged)
    }

    /// The partner of a seat in the exchange.
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

/// Adds the highest faces allowed, jokers last.
fn fill_up(kept: &mut Kept, left: &mut Counts, top: usize) {
    let highest = if kept.no_top { top } else { top + 1 };
    for kind in (kept.floor.min(highest)..highest).rev().chain([JOKER]) {
        let added = left[kind].min(kept.missing);
        left[kind] -= added;
        kept.counts[kind] += added;
        kept.missing -= added;
    }
}

impl Puzzle<'_> {
    /// Finds the contradictions that have a simple explanation: too many cards of a kind, a hand
    /// of the wrong size, a gift outside the exchange.
    pub(super) fn check_basic(&self) -> Result<(), String> {
        let (rules, tally) = (self.rules, &self.tally);
        let hand = rules.hand_size();
        let mut dealt = [0u8; JOKER + 1];
        for (seat, cards) in tally.dealt.iter() {
            let Some(cards) = cards else { continue };
            if cards.len() != hand {
                return Err(format!(
                    "seat {seat} was dealt {} cards, but every hand has {hand}",
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
        // A gift may be played by the receiver: count each pair as a whole.
        for pair in &self.pairs {
            add(&mut seen, &self.certain_cards(pair));
        }
        let totals = [("dealt to", &dealt), ("dealt to or played by", &seen)];
        for (what, counts) in totals {
            if let Some(kind) = (0..=JOKER).find(|&kind| counts[kind] > self.deck[kind]) {
                let named = match kind {
                    JOKER => "jokers".to_owned(),
                    face => format!("cards of face {}", face + 1),
                };
                return Err(format!(
                    "too many {named} were {what} the seats together: {}, but the deck has {}",
                    counts[kind], self.deck[kind]
                ));
            }
        }
        for (seat, gift) in tally.given.iter() {
            if let (Some(gift), Some(hand)) = (gift, tally.dealt[seat])
                && !self.can_give(hand, *gift)
            {
                return Err(format!(
                    "seat {seat} cannot have given these cards from its hand (the Golden card is written G and goes last of its face)"
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
                "by what is stated up to here, no seat can have been dealt the Golden card (written G in hands and gifts)"
                    .into(),
            );
        }
        Ok(())
    }

    /// Whether these cards can be given from this hand: of the top face, the Golden card last.
    fn can_give(&self, hand: Cards, gift: Cards) -> bool {
        let faces = self.rules.faces();
        let (hand_counts, gift_counts) = (counts_of(hand, faces), counts_of(gift, faces));
        let all_of_top = hand_counts[self.top] == gift_counts[self.top];
        let golden_goes = hand.has_golden() && all_of_top && gift_counts[self.top] > 0;
        contains(&hand_counts, &gift_counts) && gift.has_golden() == golden_goes
    }
}
