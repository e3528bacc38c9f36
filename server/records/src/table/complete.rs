//! Completing a Shift of a real table: hands and gifts that nobody wrote down are filled in with cards that fit everything that is told, so
//! that the rule engine can play the Shift and judge it. The same facts are always completed in the same way. Which hands are not filled in
//! but known, because they are told or follow from what is told, is said beside them.

use chefshat_engine::{BySeat, Cards, Opening, RuleSet, Seat, SeatOrder};

use super::facts::{Counts, Fact, JOKER, Tally, counts_of};
use super::gifts::{Gifts, Pair, candidates, pairs, size_of};

/// Most combinations of gifts looked at. Where nothing is told the first ones fit; where much is told there are few.
const MAX_TRIES: usize = 2_000_000;

/// A Shift that can be played by the engine.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    /// The hands as dealt.
    pub(super) dealt: BySeat<Cards>,
    /// What each seat gives.
    pub(super) gifts: BySeat<Counts>,
    /// Who chooses what it gives.
    pub(super) choosers: BySeat<bool>,
    /// The seat drawn at the deal, for the opening that needs one.
    pub(super) drawn: Option<Seat>,
    /// Whose hand as dealt is known.
    pub(super) dealt_known: BySeat<bool>,
    /// Whose hand after the exchange is known.
    pub(super) held_known: BySeat<bool>,
}

/// A fact that cannot be, after those before it.
#[derive(Debug, Clone)]
pub(crate) struct Misfit {
    /// The line that tells it.
    pub(crate) line: usize,
    /// Why not.
    pub(crate) problem: String,
}

/// Completes a Shift from the longest run of facts that fits, and says which fact breaks it off, if one does.
pub(super) fn complete(
    rules: &RuleSet,
    order: Option<SeatOrder>,
    facts: &[(usize, Fact)],
) -> (Plan, Option<Misfit>) {
    let try_first =
        |count: usize| Puzzle::new(rules, order, Tally::of(rules, &facts[..count])).solve();
    let mut failure = match try_first(facts.len()) {
        Ok(plan) => return (plan, None),
        Err(problem) => problem,
    };
    // The facts are looked at again, fewer of them: what fits with more of them fits with fewer.
    let (mut fits, mut breaks) = (0, facts.len());
    while breaks - fits > 1 {
        let middle = fits + (breaks - fits) / 2;
        match try_first(middle) {
            Ok(_) => fits = middle,
            Err(problem) => (breaks, failure) = (middle, problem),
        }
    }
    let plan = try_first(fits).expect("nothing told leaves every deal open");
    let misfit = Misfit {
        line: facts[breaks - 1].0,
        problem: failure,
    };
    (plan, Some(misfit))
}

/// A Shift to be completed.
pub(super) struct Puzzle<'a> {
    pub(super) rules: &'a RuleSet,
    pub(super) tally: Tally,
    pub(super) pairs: Vec<Pair>,
    pub(super) deck: Counts,
    /// Where cards of the top face are counted.
    top: usize,
}

/// Where the top face comes from that the opener needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Top {
    Kept,
    Received,
}

/// What a seat keeps of the cards it was dealt, as far as that is settled, and what may still be added.
#[derive(Debug, Clone, Copy, Default)]
struct Kept {
    counts: Counts,
    /// Cards to add.
    missing: u8,
    /// No card below this position may be added.
    floor: usize,
    /// No card of the top face may be added.
    no_top: bool,
}

impl<'a> Puzzle<'a> {
    fn new(rules: &'a RuleSet, order: Option<SeatOrder>, tally: Tally) -> Self {
        let mut deck = [0; JOKER + 1];
        for (count, face) in deck.iter_mut().zip(1..=rules.faces()) {
            *count = face;
        }
        deck[JOKER] = rules.jokers();
        Self {
            rules,
            pairs: pairs(rules, order, &tally),
            tally,
            deck,
            top: usize::from(rules.faces()) - 1,
        }
    }

    fn solve(&self) -> Result<Plan, String> {
        self.check_simple()?;
        let choices: Vec<Vec<Gifts>> = if self.tally.exchanged {
            self.pairs
                .iter()
                .map(|pair| {
                    let mut gifts = candidates(self.rules, &self.tally, pair);
                    gifts.retain(|gifts| self.pair_fits(pair, gifts));
                    gifts
                })
                .collect()
        } else {
            Vec::new()
        };
        let combinations = choices
            .iter()
            .try_fold(1usize, |product, gifts| product.checked_mul(gifts.len()))
            .unwrap_or(usize::MAX);
        (0..combinations.min(MAX_TRIES))
            .find_map(|mut number| {
                let gifts: Vec<Gifts> = choices
                    .iter()
                    .map(|gifts| {
                        let chosen = gifts[number % gifts.len()];
                        number /= gifts.len();
                        chosen
                    })
                    .collect();
                self.fill(&gifts, Top::Kept)
                    .or_else(|| self.fill(&gifts, Top::Received))
            })
            .ok_or_else(|| {
                "no deal of the deck and no exchange fits everything that is told up to here (the Golden card is written as one)"
                    .to_owned()
            })
    }

    fn pair_fits(&self, pair: &Pair, gifts: &Gifts) -> bool {
        [Top::Kept, Top::Received].into_iter().any(|top| {
            self.kept(pair.chooser, &gifts.chosen, &gifts.forced, None, top)
                .zip(self.kept(pair.forced, &gifts.forced, &gifts.chosen, Some(gifts), top))
                .is_some_and(|(one, other)| {
                    let mut sum = gifts.chosen;
                    add(&mut sum, &gifts.forced);
                    add(&mut sum, &one.counts);
                    add(&mut sum, &other.counts);
                    contains(&self.deck, &sum)
                })
        })
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
            Some(gifts) => gifts.forced.iter().rposition(|&count| count > 0)?,
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

    /// Fills all hands up with the cards that are left of the deck.
    fn fill(&self, gifts: &[Gifts], top: Top) -> Option<Plan> {
        let players = self.rules.players();
        let mut given = BySeat::filled(players, [0; JOKER + 1]);
        let mut received = BySeat::filled(players, [0; JOKER + 1]);
        let mut forced: BySeat<Option<usize>> = BySeat::filled(players, None);
        for (number, (pair, gifts)) in self.pairs.iter().zip(gifts).enumerate() {
            (given[pair.chooser], received[pair.forced]) = (gifts.chosen, gifts.chosen);
            (given[pair.forced], received[pair.chooser]) = (gifts.forced, gifts.forced);
            forced[pair.forced] = Some(number);
        }
        let mut left = self.deck;
        let mut kept = BySeat::filled(players, Kept::default());
        for seat in kept.seats() {
            let gifts = forced[seat].map(|number| &gifts[number]);
            kept[seat] = self.kept(seat, &given[seat], &received[seat], gifts, top)?;
            take(&mut left, &given[seat])?;
            take(&mut left, &kept[seat].counts)?;
        }
        if let (Top::Received, Some(opener)) = (top, self.tally.opener) {
            let giver = self.partner(opener)?;
            kept[giver].no_top = true;
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
        let golden = self.golden(&kept, &given)?;
        let dealt = BySeat::from_fn(players, |seat| {
            let mut counts = kept[seat].counts;
            add(&mut counts, &given[seat]);
            Some(self.cards(&counts, seat == golden)).flatten()
        });
        if dealt.values().any(Option::is_none) {
            return None;
        }
        let (dealt_known, held_known) = self.known();
        Some(Plan {
            dealt: dealt.map(Option::unwrap_or_default),
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

    /// Who was dealt the Golden card, so that the opener holds it after the exchange.
    fn golden(&self, kept: &BySeat<Kept>, given: &BySeat<Counts>) -> Option<Seat> {
        let tally = &self.tally;
        kept.seats().find(|&seat| {
            let stays = kept[seat].counts[self.top] > 0;
            let goes = !stays && given[seat][self.top] > 0;
            let holder = if stays {
                Some(seat)
            } else {
                self.partner(seat)
            };
            let opens = match tally.opener {
                Some(opener) if self.rules.opening() == Opening::Golden => holder == Some(opener),
                _ => true,
            };
            let as_dealt = tally
                .dealt
                .iter()
                .all(|(other, hand)| hand.is_none_or(|hand| hand.has_golden() == (other == seat)));
            let as_given = tally.given.iter().all(|(giver, gift)| {
                gift.is_none_or(|gift| gift.has_golden() == (goes && giver == seat))
            });
            (stays || goes) && opens && as_dealt && as_given
        })
    }

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

pub(super) fn contains(all: &Counts, some: &Counts) -> bool {
    all.iter().zip(some).all(|(all, some)| all >= some)
}

pub(super) fn add(sum: &mut Counts, more: &Counts) {
    for (sum, more) in sum.iter_mut().zip(more) {
        *sum = sum.saturating_add(*more);
    }
}

/// Takes cards away; `None` if they are not there.
fn take(from: &mut Counts, cards: &Counts) -> Option<()> {
    for (from, cards) in from.iter_mut().zip(cards) {
        *from = from.checked_sub(*cards)?;
    }
    Some(())
}
