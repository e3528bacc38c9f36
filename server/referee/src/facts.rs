//! The stated facts of a Shift at a real table: hands, gifts and turns, each with the number of what
//! stated it (a line of a record or transcript, or a report).

use chefshat_engine::{Action, BySeat, Cards, Opening, RuleSet, Seat};

use crate::counts::{Counts, NOTHING, add_action};

/// A stated fact.
#[derive(Debug, Clone, Copy)]
pub enum Fact {
    /// A hand as dealt.
    Hand(Seat, Cards),
    /// A hand after the exchange, before the first turn. Implies that the exchange is over.
    Held(Seat, Cards),
    /// A seat was dealt two jokers, and declared its special action or declined.
    Special {
        /// The seat.
        seat: Seat,
        /// Whether it declared.
        declared: bool,
    },
    /// A seat chose this card to give.
    Gives(Seat, Action),
    /// The complete gift of a seat, if known. Implies that the exchange is over.
    Given(Seat, Option<Cards>),
    /// A seat played or passed.
    Turn(Seat, Action),
}

/// The facts of one Shift, in order.
#[derive(Debug, Clone, Default)]
pub struct ShiftFacts {
    /// Each with its line, from 1.
    pub facts: Vec<(usize, Fact)>,
    /// A seat whose gift is awaited: its decision stays open although later gifts are stated.
    pub choosing: Option<Seat>,
    /// Whether nobody declares a special action any more.
    pub special_is_settled: bool,
}

/// Facts, added up.
#[derive(Debug, Clone)]
pub(crate) struct Tally {
    pub(crate) dealt: BySeat<Option<Cards>>,
    /// A hand after the exchange.
    pub(crate) held: BySeat<Option<Cards>>,
    /// The seat dealt two jokers, and whether it declared.
    pub(crate) special: Option<(Seat, bool)>,
    /// Cards the seat chose to give, as far as stated.
    pub(crate) gives: BySeat<Counts>,
    /// The complete gift of a seat.
    pub(crate) given: BySeat<Option<Cards>>,
    /// Whether the exchange, if any, is over.
    pub(crate) exchanged: bool,
    pub(crate) played: BySeat<Counts>,
    /// The seat that took the first turn.
    pub(crate) opener: Option<Seat>,
    /// The seat that holds the Golden card after the exchange, if stated: its hand, or the opening,
    /// says so.
    pub(crate) holder: Option<Seat>,
}

impl Tally {
    pub(crate) fn of(rules: &RuleSet, facts: &[(usize, Fact)]) -> Self {
        let players = rules.players();
        let mut tally = Self {
            dealt: BySeat::filled(players, None),
            held: BySeat::filled(players, None),
            special: None,
            gives: BySeat::filled(players, NOTHING),
            given: BySeat::filled(players, None),
            exchanged: false,
            played: BySeat::filled(players, NOTHING),
            opener: None,
            holder: None,
        };
        for (_, fact) in facts {
            match *fact {
                Fact::Hand(seat, cards) => tally.dealt[seat] = Some(cards),
                Fact::Held(seat, cards) => {
                    tally.held[seat] = Some(cards);
                    tally.exchanged = true;
                    if cards.has_golden() {
                        tally.holder = Some(seat);
                    }
                }
                Fact::Special { seat, declared } => tally.special = Some((seat, declared)),
                Fact::Gives(seat, gift) => add_action(&mut tally.gives[seat], gift),
                Fact::Given(seat, cards) => {
                    tally.given[seat] = cards;
                    tally.exchanged = true;
                }
                Fact::Turn(seat, turn) => {
                    add_action(&mut tally.played[seat], turn);
                    tally.opener.get_or_insert(seat);
                    tally.exchanged = true;
                }
            }
        }
        if rules.opening() == Opening::Golden {
            tally.holder = tally.opener.or(tally.holder);
        }
        tally
    }

    /// Whether a seat holds a card of the top face after the exchange, because it holds the Golden
    /// card or opened.
    pub(crate) fn has_top(&self, seat: Seat) -> bool {
        [self.opener, self.holder].contains(&Some(seat))
    }
}
