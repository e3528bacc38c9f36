//! Games from given hands instead of a deal: for puzzles, experiments, imagining what hidden cards
//! may be, and tests.

use thiserror::Error;

use super::{Game, Stage};
use crate::deal::opening_leader;
use crate::{BySeat, Cards, Event, Opening, RuleSet, Seat, SeatOrder, Seed};

/// Where a scripted game begins: a Shift with given hands. Later Shifts are dealt from the seed.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct Script {
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// The hands as dealt, before any exchange; one of them holds the Golden card.
    pub hands: BySeat<Cards>,
    /// The order of the Shift before, which gives the roles; `None` in the first Shift alone.
    pub last_order: Option<SeatOrder>,
    /// Points of each seat so far.
    pub scores: BySeat<u32>,
    /// The seat drawn for [`Opening::AnyTopFace`], which needs one; other openings have none.
    pub drawn: Option<Seat>,
}

impl Script {
    /// The first Shift of a game with these hands.
    pub fn first_shift(hands: BySeat<Cards>) -> Script {
        Script {
            shift: 1,
            hands,
            last_order: None,
            scores: BySeat::filled(hands.len(), 0),
            drawn: None,
        }
    }
}

/// Why hands or a script do not make a game.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum ScriptError {
    /// Not one value for each seat.
    #[error("hands, scores and the last order must have one entry for each of the {0} seats")]
    Seats(usize),
    /// A hand of the wrong size.
    #[error("seat {seat} must hold {expected} cards")]
    HandSize {
        /// The seat.
        seat: Seat,
        /// Cards it must hold.
        expected: u8,
    },
    /// More cards of a kind than the deck has.
    #[error("the hands hold cards that are not left in the deck")]
    NotInDeck,
    /// The Golden card is missing, or is not where it must be.
    #[error(
        "the Golden card must be in exactly one hand, among cards of the top face, unless it has been played"
    )]
    Golden,
    /// A Shift number without sense.
    #[error(
        "the first Shift has number 1 and no last order; a later one needs the order of the Shift before"
    )]
    Shift,
    /// The game would have ended before.
    #[error("the game would have ended before this Shift")]
    Ended,
    /// A drawn seat is missing or makes no sense.
    #[error("a seat of the game must be drawn for the opening with any top face, and for no other")]
    Drawn,
    /// Hidden cards can be replaced only while a turn is open.
    #[error("hands can be replaced only while a turn is open")]
    NotATurn,
    /// The Shift's first turn would belong to another seat.
    #[error("with these hands another seat would take the Shift's first turn")]
    Leader,
}

impl Game {
    /// A game that begins with a scripted Shift.
    ///
    /// # Errors
    /// If no game with this rule set can stand there.
    pub fn scripted(
        rules: RuleSet,
        seed: Seed,
        script: &Script,
        mut on_event: impl FnMut(Event),
    ) -> Result<Game, ScriptError> {
        let players = rules.players();
        let seats = [
            script.hands.len(),
            script.scores.len(),
            script.last_order.map_or(players, |order| order.len()),
        ];
        if seats != [players; 3] {
            return Err(ScriptError::Seats(players));
        }
        if script.shift == 0 || (script.shift == 1) != script.last_order.is_none() {
            return Err(ScriptError::Shift);
        }
        let needs_draw = rules.opening() == Opening::AnyTopFace;
        if script.drawn.is_some() != needs_draw
            || script.drawn.is_some_and(|seat| seat.index() >= players)
        {
            return Err(ScriptError::Drawn);
        }
        check_hands(
            &rules,
            &script.hands,
            &script.hands.map(|_| rules.hand_size()),
            Cards::EMPTY,
            true,
        )?;
        let mut game = Game::blank(rules, seed);
        game.scores = script.scores.map(u64::from);
        game.shift = script.shift - 1;
        if script.shift > 1 && game.is_decided() {
            return Err(ScriptError::Ended);
        }
        let ranking = script.last_order.unwrap_or(SeatOrder::EMPTY);
        game.start_shift(
            script.shift,
            script.hands,
            script.drawn,
            ranking,
            &mut on_event,
        );
        Ok(game)
    }

    /// The same game with other hands, each of its present size: one that hidden cards may make of
    /// it. What was given in this Shift's exchange is left as it was.
    ///
    /// # Errors
    /// If the cards are not left in the deck, or the game could not have come this far with these
    /// hands.
    pub fn with_hands(&self, hands: BySeat<Cards>) -> Result<Game, ScriptError> {
        if !self.is_turn() {
            return Err(ScriptError::NotATurn);
        }
        if hands.len() != self.rules.players() {
            return Err(ScriptError::Seats(self.rules.players()));
        }
        let golden_held = self.hands.values().any(|hand| hand.has_golden());
        check_hands(
            &self.rules,
            &hands,
            &self.cards_left,
            self.played,
            golden_held,
        )?;
        let first_turn = self.state.is_first_turn();
        if first_turn && self.stage != Stage::Turn(opening_leader(&self.rules, &hands, self.drawn))
        {
            return Err(ScriptError::Leader);
        }
        Ok(Game {
            hands,
            ..self.clone()
        })
    }
}

/// Checks that hands of these sizes can be held at the same time, beside what was played.
fn check_hands(
    rules: &RuleSet,
    hands: &BySeat<Cards>,
    sizes: &BySeat<u8>,
    played: Cards,
    golden_held: bool,
) -> Result<(), ScriptError> {
    let mut all = played;
    for (seat, &hand) in hands.iter() {
        if hand.len() != sizes[seat] {
            return Err(ScriptError::HandSize {
                seat,
                expected: sizes[seat],
            });
        }
        let top = crate::Face::of(rules.faces());
        if hand.has_golden() && (hand.count(top) == 0 || all.has_golden()) {
            return Err(ScriptError::Golden);
        }
        all = all.union(hand).ok_or(ScriptError::NotInDeck)?;
    }
    if !Cards::deck(rules.faces(), rules.jokers()).contains(all) {
        return Err(ScriptError::NotInDeck);
    }
    if all.has_golden() == golden_held {
        Ok(())
    } else {
        Err(ScriptError::Golden)
    }
}
