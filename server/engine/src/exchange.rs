//! Who exchanges cards with whom, and how many (`docs/rules.md` §3.4). How a game asks for the
//! gifts is in `game::start`.

use crate::{ActionId, ActionSpace, Cards, RuleSet, Seat, SeatOrder};

/// With fewer players there is neither Sous-Chef nor Waiter.
const SOUS_CHEF_PLAYERS: usize = 4;

/// Two seats that exchange cards.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct ExchangePair {
    /// The Chef or the Sous-Chef: gives cards of its choice.
    pub chooser: Seat,
    /// The Dishwasher or the Waiter: gives its rarest ingredient cards.
    pub forced: Seat,
    /// How many cards each gives, 1 or 2; fewer if the forced giver holds fewer ingredient cards.
    pub size: u8,
}

impl ExchangePair {
    /// The pairs of a ranking, from Chef to Dishwasher: Chef and Dishwasher first.
    pub fn all(ranking: &SeatOrder) -> impl Iterator<Item = ExchangePair> {
        (0..2).map_while(|rank| ExchangePair::of_rank(ranking, rank))
    }

    /// The pair whose chooser has a rank, from 0 for the Chef; `None` if it exchanges nothing.
    pub(crate) fn of_rank(ranking: &SeatOrder, rank: usize) -> Option<ExchangePair> {
        let size = match rank {
            0 => 2,
            1 if ranking.len() >= SOUS_CHEF_PLAYERS => 1,
            _ => return None,
        };
        let seats = ranking.as_slice();
        Some(ExchangePair {
            chooser: *seats.get(rank)?,
            forced: *seats.iter().rev().nth(rank)?,
            size,
        })
    }

    /// Whether a seat is one of the two.
    pub fn has(&self, seat: Seat) -> bool {
        seat == self.chooser || seat == self.forced
    }

    /// How many cards each gives if the forced giver holds these. Jokers are never given without a
    /// choice.
    pub fn gifts(&self, forced_hand: Cards) -> u8 {
        self.size.min(forced_hand.faces_len())
    }

    /// The fewest cards each may have to give, whatever the forced giver was dealt.
    pub fn least_gifts(&self, rules: &RuleSet) -> u8 {
        self.size
            .min(rules.hand_size().saturating_sub(rules.jokers()))
    }
}

/// The default gift (§8.3): the highest plain face, else the Golden card, else a joker.
pub(crate) fn default_gift(hand: Cards, space: ActionSpace) -> ActionId {
    let mut plain = hand;
    if hand.has_golden() {
        plain.remove_counts(space.faces(), 1, 0);
    }
    match plain.highest().or(hand.highest()) {
        Some(face) => space.give(face).expect("a face of the deck"),
        None => space.give_joker(),
    }
}
