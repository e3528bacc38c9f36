//! The search that completes a Shift: which hands and gifts, from the cards of one deck, fit all
//! facts. Gifts come from the candidates of each pair; the hands are then filled with any cards
//! allowed.

use chefshat_engine::{BySeat, Cards, Opening, Seat};

use crate::candidates::{Candidate, Candidates, SearchBudget};
use crate::counts::{Counts, JOKER, NOTHING, add, cards_of, contains, counts_of, size_of, take};
use crate::known::Known;
use crate::puzzle::{Kept, Puzzle};

/// Search steps charged for filling the hands.
const FILL_STEPS: usize = 20;

/// A Shift the engine can play.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// The hands as dealt.
    pub(crate) dealt: BySeat<Cards>,
    /// The gift of each seat.
    pub(crate) gifts: BySeat<Counts>,
    /// Whether a seat chooses its gift.
    pub(crate) choosers: BySeat<bool>,
    /// The seat drawn at the deal, for the opening `any_top_face`.
    pub(crate) drawn: Option<Seat>,
    /// What is known of the hands as dealt.
    pub(crate) dealt_known: Known,
    /// What is known of the hands after the exchange.
    pub(crate) held_known: Known,
    /// Whether the gift of each seat is known.
    pub(crate) given_known: BySeat<bool>,
}

impl Puzzle<'_> {
    /// Finds hands and gifts that fit.
    ///
    /// # Errors
    /// Why none fit, or that the budget is exhausted.
    pub(crate) fn solve(&self, budget: &mut SearchBudget) -> Result<Plan, String> {
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
            cards_of(self.rules, &counts, seat == golden)
        });
        if dealt.values().any(Option::is_none) {
            return None;
        }
        let dealt = dealt.map(Option::unwrap_or_default);
        let (dealt_known, held_known, given_known) = self.known(&dealt, &given);
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
            given_known,
        })
    }

    /// Finds the contradictions that have a simple explanation: too many cards of a kind, a hand
    /// of the wrong size, a gift outside the exchange.
    fn check_basic(&self) -> Result<(), String> {
        let (rules, tally) = (self.rules, &self.tally);
        let hand = rules.hand_size();
        let mut dealt = NOTHING;
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
        for (seat, cards) in tally.held.iter() {
            if let Some(cards) = cards.filter(|cards| cards.len() != hand) {
                return Err(format!(
                    "seat {seat} had {} cards after the exchange, but every hand has {hand}",
                    cards.len()
                ));
            }
        }
        let mut seen = NOTHING;
        for (seat, counts) in tally.played.iter() {
            if size_of(counts) > hand {
                return Err(format!(
                    "seat {seat} has played {} cards, but {hand} were dealt to it",
                    size_of(counts)
                ));
            }
            if self.partner(seat).is_none() {
                let dealt = tally.dealt[seat].or(tally.held[seat]);
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
            if let Some(cards) =
                tally.held[seat].or(tally.dealt[seat].filter(|_| self.partner(seat).is_none()))
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
