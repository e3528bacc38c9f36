//! Who can have been dealt which hidden cards: for each holder of hidden cards, how many of a kind
//! it may have been dealt, given what it played, gave and received (`docs/search.md`).
//!
//! Kinds of cards are numbered: faces 1..=F are 0..F, jokers are F. The Golden card is the last of
//! kind F-1 and distinguished from the others of its face.

use chefshat_engine::{Cards, Seat};

use crate::KnowledgeError;
use crate::knowledge::Knowledge;

/// The most kinds of cards: 15 faces and jokers.
pub(crate) const MAX_KINDS: usize = 16;
/// How many of each kind.
pub(crate) type Counts = [u8; MAX_KINDS];

/// Cards of one kind dealt to a holder.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub(crate) struct Dealt {
    /// Without the Golden card.
    pub(crate) plain: u8,
    pub(crate) golden: bool,
}

impl Dealt {
    pub(crate) fn total(self) -> u8 {
        self.plain + u8::from(self.golden)
    }
}

/// Cards, with the Golden one distinguished.
#[derive(Copy, Clone, Default, Debug)]
pub(crate) struct Known {
    pub(crate) counts: Counts,
    pub(crate) golden: bool,
}

impl Known {
    pub(crate) fn of(cards: Cards, faces: u8) -> Known {
        let mut counts = Counts::default();
        counts
            .iter_mut()
            .zip(cards.counts(faces))
            .for_each(|(count, held)| *count = held);
        Known {
            counts,
            golden: cards.has_golden(),
        }
    }

    /// The Golden card of a kind, if it is there.
    fn golden_of(&self, kind: usize, top: usize) -> bool {
        self.golden && kind == top
    }
}

/// What a seat must hold after the exchange.
#[derive(Copy, Clone, Default, Debug)]
pub(crate) struct After {
    /// At least what it played.
    pub(crate) played: Counts,
    /// Whether it holds the Golden card, if that is known.
    pub(crate) golden: Option<bool>,
    /// Whether it holds the top face, if that is assumed.
    pub(crate) has_top: Option<bool>,
}

impl After {
    /// Whether a seat may hold this many cards of a kind.
    fn allows(&self, kind: usize, top: usize, count: u8, golden: bool) -> bool {
        let as_opened = kind != top
            || (self.golden.is_none_or(|known| known == golden)
                && self.has_top.is_none_or(|known| known == (count > 0)));
        count >= self.played[kind] && as_opened
    }
}

/// The cards that a seat is known to have given.
#[derive(Copy, Clone, Debug)]
pub(crate) enum Gave {
    /// None.
    Nothing,
    /// Cards of its choice.
    Chosen(Known),
    /// Its rarest ingredient cards; all it had of them if `all`.
    Rarest { known: Known, all: bool },
}

/// A holder whose hand follows from the cards dealt to it, or the cards set aside.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Single {
    /// `None` for the cards set aside.
    pub(crate) seat: Option<Seat>,
    pub(crate) size: u8,
    /// Fewest and most jokers dealt to it.
    pub(crate) jokers: (u8, u8),
    pub(crate) gave: Gave,
    pub(crate) received: Known,
    pub(crate) after: After,
}

impl Single {
    /// Whether it may have been dealt these cards of a kind.
    pub(crate) fn allows(&self, kind: usize, faces: usize, dealt: Dealt) -> bool {
        let (top, total) = (faces - 1, dealt.total());
        if kind == faces && !(self.jokers.0..=self.jokers.1).contains(&total) {
            return false;
        }
        let gave = match &self.gave {
            Gave::Nothing => Known::default(),
            Gave::Chosen(known) | Gave::Rarest { known, .. } => *known,
        };
        let golden_given = gave.golden_of(kind, top);
        let plain_given = gave.counts[kind] - u8::from(golden_given);
        // The Golden card is given last of its face.
        let as_given = if golden_given {
            dealt.golden && dealt.plain == plain_given
        } else {
            dealt.plain >= plain_given
        };
        let rarest = match &self.gave {
            Gave::Rarest { known, all } if kind < faces => {
                let last = (0..faces).rev().find(|&face| known.counts[face] > 0);
                match last {
                    _ if *all => total == known.counts[kind],
                    Some(last) if kind < last => total == known.counts[kind],
                    _ => true,
                }
            }
            _ => true,
        };
        if !as_given || !rarest {
            return false;
        }
        let golden_received = self.received.golden_of(kind, top);
        let held = total - gave.counts[kind] + self.received.counts[kind];
        let golden_held = (dealt.golden && !golden_given) || golden_received;
        self.after.allows(kind, top, held, golden_held)
    }
}

/// Two seats that exchanged cards which the viewer did not see.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Pair {
    pub(crate) chooser: Seat,
    pub(crate) forced: Seat,
    /// Cards in each of the two hands.
    pub(crate) size: u8,
    /// Cards that each gave.
    pub(crate) count: u8,
    /// Fewest and most jokers dealt to the chooser and to the forced giver.
    pub(crate) jokers: [(u8, u8); 2],
    pub(crate) after: [After; 2],
}

impl Pair {
    /// Whether the two may have been dealt these cards of a kind, if the chooser gives `given` of
    /// them and the forced giver still has `due` of its rarest cards to give.
    pub(crate) fn allows(
        &self,
        kind: usize,
        faces: usize,
        [chooser, forced]: [Dealt; 2],
        given: u8,
        due: u8,
    ) -> bool {
        let top = faces - 1;
        if kind == faces {
            let fits = |dealt: Dealt, (fewest, most)| (fewest..=most).contains(&dealt.total());
            if !fits(chooser, self.jokers[0]) || !fits(forced, self.jokers[1]) {
                return false;
            }
        }
        let back = if kind < faces {
            due.min(forced.total())
        } else {
            0
        };
        // The Golden card is given last of its face.
        let golden_given = chooser.golden && given > chooser.plain;
        let golden_back = forced.golden && back > forced.plain;
        let chooser_golden = (chooser.golden && !golden_given) || golden_back;
        let forced_golden = (forced.golden && !golden_back) || golden_given;
        let chooser_holds = chooser.total() - given + back;
        let forced_holds = forced.total() - back + given;
        self.after[0].allows(kind, top, chooser_holds, chooser_golden)
            && self.after[1].allows(kind, top, forced_holds, forced_golden)
    }
}

/// Everybody who holds hidden cards of a deal.
#[derive(Clone, Debug)]
pub(crate) struct Holders {
    /// Number of faces F.
    pub(crate) faces: usize,
    /// The hidden cards.
    pub(crate) hidden: Known,
    pub(crate) pairs: Vec<Pair>,
    pub(crate) singles: Vec<Single>,
}

impl Holders {
    /// The holders as a seat knows them, if this seat was drawn for the opening; `None` if that is
    /// impossible.
    pub(crate) fn new(
        knowledge: &Knowledge,
        drawn: Option<Seat>,
    ) -> Result<Option<Holders>, KnowledgeError> {
        let rules = &knowledge.rules;
        let (faces, players, size) = (rules.faces(), rules.players(), rules.hand_size());
        let mut hidden = deck(faces, rules.jokers());
        let own = Known::of(knowledge.dealt, faces);
        for (count, held) in hidden.counts.iter_mut().zip(own.counts) {
            *count = count
                .checked_sub(held)
                .ok_or(KnowledgeError::Inconsistent)?;
        }
        hidden.golden = !own.golden;
        if hidden.golden && hidden.counts[usize::from(faces) - 1] == 0 {
            return Err(KnowledgeError::Inconsistent);
        }
        let Some(after) = after_exchange(knowledge, drawn)? else {
            return Ok(None);
        };
        let pairs = knowledge.pairs();
        let jokers = joker_bounds(knowledge);
        let mut holders = Holders {
            faces: usize::from(faces),
            hidden,
            pairs: Vec::new(),
            singles: Vec::new(),
        };
        let mut paired = Vec::new();
        for pair in &pairs {
            let gift = (knowledge.gifts.iter()).find(|gift| gift.giver == pair.forced);
            let Some(gift) = gift.filter(|_| !pair.has(knowledge.seat)) else {
                continue;
            };
            paired.extend([pair.chooser, pair.forced]);
            holders.pairs.push(Pair {
                chooser: pair.chooser,
                forced: pair.forced,
                size,
                count: gift.count,
                jokers: [pair.chooser, pair.forced].map(|seat| jokers[seat.index()]),
                after: [pair.chooser, pair.forced].map(|seat| after[seat.index()]),
            });
        }
        for seat in (0..players).map(Seat::new) {
            if seat == knowledge.seat || paired.contains(&seat) {
                continue;
            }
            let cards_of = |found: Option<&crate::knowledge::Gift>| {
                found
                    .and_then(|gift| gift.cards)
                    .map(|cards| Known::of(cards, faces))
            };
            let gave = cards_of((knowledge.gifts.iter()).find(|gift| gift.giver == seat));
            let received = cards_of((knowledge.gifts.iter()).find(|gift| gift.receiver == seat));
            let pair = pairs.iter().find(|pair| pair.has(seat));
            let gave = match (gave, pair) {
                (Some(known), Some(pair)) if pair.forced == seat => Gave::Rarest {
                    known,
                    all: known.counts.iter().sum::<u8>() < pair.size,
                },
                (Some(known), _) => Gave::Chosen(known),
                (None, _) => Gave::Nothing,
            };
            holders.singles.push(Single {
                seat: Some(seat),
                size,
                jokers: jokers[seat.index()],
                gave,
                received: received.unwrap_or_default(),
                after: after[seat.index()],
            });
        }
        let aside = rules.deck_size() - size * players as u8;
        if aside > 0 {
            holders.singles.push(Single {
                seat: None,
                size: aside,
                jokers: (0, rules.jokers()),
                gave: Gave::Nothing,
                received: Known::default(),
                // The Golden card is never set aside.
                after: After {
                    golden: Some(false),
                    ..After::default()
                },
            });
        }
        Ok(Some(holders))
    }

    /// The hidden cards of a kind.
    pub(crate) fn hidden_of(&self, kind: usize) -> Dealt {
        let golden = self.hidden.golden_of(kind, self.faces - 1);
        Dealt {
            plain: self.hidden.counts[kind] - u8::from(golden),
            golden,
        }
    }

    /// Number of kinds.
    pub(crate) fn kinds(&self) -> usize {
        self.faces + 1
    }
}

/// All cards of a deck.
fn deck(faces: u8, jokers: u8) -> Known {
    let mut counts = Counts::default();
    counts
        .iter_mut()
        .zip(1..=faces)
        .for_each(|(count, face)| *count = face);
    counts[usize::from(faces)] = jokers;
    Known {
        counts,
        golden: true,
    }
}

/// What each seat must hold after the exchange; `None` if the seat drawn cannot have been drawn.
fn after_exchange(
    knowledge: &Knowledge,
    drawn: Option<Seat>,
) -> Result<Option<Vec<After>>, KnowledgeError> {
    let rules = &knowledge.rules;
    let players = rules.players();
    let mut after = vec![After::default(); players];
    for (seat, action) in &knowledge.turns {
        let played = &mut after[seat.index()].played;
        match rules.actions().decode(*action) {
            Some(chefshat_engine::Action::Play {
                face,
                quantity,
                jokers,
            }) => {
                add(&mut played[usize::from(face.get()) - 1], quantity)?;
                add(&mut played[usize::from(rules.faces())], jokers)?;
            }
            Some(chefshat_engine::Action::LoneJoker) => {
                add(&mut played[usize::from(rules.faces())], 1)?;
            }
            Some(chefshat_engine::Action::Pass) => {}
            _ => return Err(KnowledgeError::Inconsistent),
        }
    }
    let Some(starter) = knowledge.starter() else {
        return Ok(Some(after));
    };
    if !knowledge.draws_starter() {
        for (seat, after) in after.iter_mut().enumerate() {
            after.golden = Some(seat == starter.index());
        }
        return Ok(Some(after));
    }
    // From the drawn seat to the starter, only the starter holds the top face.
    let drawn = drawn.map_or(starter.index(), Seat::index);
    let distance = (starter.index() + players - drawn) % players;
    for left in 0..distance {
        after[(drawn + left) % players].has_top = Some(false);
    }
    after[starter.index()].has_top = Some(true);
    let top = chefshat_engine::Face::new(rules.faces()).ok_or(KnowledgeError::Inconsistent)?;
    let seen = &knowledge.observation;
    let own_top = (knowledge.dealt.count(top) + seen.received.count(top))
        .saturating_sub(seen.gave.count(top));
    let own = after[knowledge.seat.index()];
    let possible = own.has_top.is_none_or(|has_top| has_top == (own_top > 0));
    Ok(possible.then_some(after))
}

fn add(count: &mut u8, more: u8) -> Result<(), KnowledgeError> {
    *count = count
        .checked_add(more)
        .ok_or(KnowledgeError::Inconsistent)?;
    Ok(())
}

/// Fewest and most jokers dealt to each seat.
fn joker_bounds(knowledge: &Knowledge) -> Vec<(u8, u8)> {
    let rules = &knowledge.rules;
    let (all, size) = (rules.jokers(), rules.hand_size());
    let mut bounds = vec![(0, all); rules.players()];
    if let Some(seat) = knowledge.declared {
        bounds[seat.index()] = (2, 2);
    }
    // How many gifts the Chef was asked for tells whether the Dishwasher is short of ingredients.
    let own_gifts = knowledge.observation.gave.len();
    let pairs = knowledge.pairs();
    if let Some(pair) = pairs
        .first()
        .filter(|_| knowledge.kind == chefshat_engine::DecisionKind::Exchange)
    {
        let bound = &mut bounds[pair.forced.index()];
        match knowledge.pending_gift() {
            Some((_, given)) if given < pair.size => *bound = (size - given, size - given),
            Some((_, given)) => bound.1 = bound.1.min(size - given),
            None => bound.1 = bound.1.min(size.saturating_sub(own_gifts + 1)),
        }
    }
    // So does the number of cards exchanged.
    for pair in &pairs {
        let gift = (knowledge.gifts.iter()).find(|gift| gift.giver == pair.forced);
        if let Some(gift) = gift {
            let (bound, most) = (&mut bounds[pair.forced.index()], size - gift.count);
            bound.1 = bound.1.min(most);
            if gift.count < pair.size {
                bound.0 = most;
            }
        }
    }
    bounds
}
