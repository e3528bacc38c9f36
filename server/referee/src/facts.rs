//! The stated facts of a Shift at a real table: hands, gifts and turns, each with the number of what
//! stated it (a line of a record or transcript, or a report).

use chefshat_engine::{Action, BySeat, Cards, RuleSet, Seat};

use crate::counts::{Counts, NOTHING, add_action};

/// A stated fact.
#[derive(Debug, Clone, Copy)]
pub enum Fact {
    /// A hand as dealt.
    Hand(Seat, Cards),
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
}

/// Facts, added up.
#[derive(Debug, Clone)]
pub(crate) struct Tally {
    pub(crate) dealt: BySeat<Option<Cards>>,
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
}

impl Tally {
    pub(crate) fn of(rules: &RuleSet, facts: &[(usize, Fact)]) -> Self {
        let players = rules.players();
        let mut tally = Self {
            dealt: BySeat::filled(players, None),
            special: None,
            gives: BySeat::filled(players, NOTHING),
            given: BySeat::filled(players, None),
            exchanged: false,
            played: BySeat::filled(players, NOTHING),
            opener: None,
        };
        for (_, fact) in facts {
            match *fact {
                Fact::Hand(seat, cards) => tally.dealt[seat] = Some(cards),
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
        tally
    }
}
