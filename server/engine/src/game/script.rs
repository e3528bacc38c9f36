//! Games from given hands instead of a deal: for puzzles, experiments, determinization and tests.

use thiserror::Error;

use super::{Game, Stage};
use crate::deal::opening_leader;
use crate::{BySeat, Cards, Event, Opening, RuleSet, Seat, SeatOrder, Seed};

/// The start of a scripted game: a Shift with given hands. Later Shifts are dealt from the seed.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct Script {
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// The hands as dealt, before any exchange; one of them holds the Golden card.
    pub hands: BySeat<Cards>,
    /// The order of the last Shift, which gives the roles; `None` in the first Shift only.
    pub last_order: Option<SeatOrder>,
    /// Points of each seat so far.
    pub scores: BySeat<u32>,
    /// The drawn seat: required with [`Opening::AnyTopFace`], `None` with other openings.
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

/// Why hands or a script are refused.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum ScriptError {
    /// There is not one value for each seat.
    #[error("hands, scores and the last order must have one entry for each of the {0} seats")]
    Seats(usize),
    /// A hand has the wrong size.
    #[error("seat {seat} must hold {expected} cards")]
    HandSize {
        /// The seat.
        seat: Seat,
        /// Number of cards it must hold.
        expected: u8,
    },
    /// There are more cards of a kind than the deck has.
    #[error("the hands hold cards that are not left in the deck")]
    NotInDeck,
    /// The Golden card is missing or misplaced.
    #[error(
        "the Golden card must be in exactly one hand, among cards of the top face, unless it has been played"
    )]
    Golden,
    /// The Shift's number and the last order contradict each other.
    #[error(
        "the first Shift has number 1 and no last order; a later one needs the order of the Shift before"
    )]
    Shift,
    /// The game would have ended earlier.
    #[error("the game would have ended before this Shift")]
    Ended,
    /// The drawn seat is missing, unexpected or out of range.
    #[error("a seat of the game must be drawn for the opening with any top face, and for no other")]
    Drawn,
    /// Hidden cards can be replaced only while a turn is open.
    #[error("hands can be replaced only while a turn is open")]
    NotATurn,
    /// Another seat would take the Shift's first turn.
    #[error("with these hands another seat would take the Shift's first turn")]
    Leader,
}

impl Game {
    /// Starts a game with a scripted Shift.
    ///
    /// # Errors
    /// If no game with this rule set can have this state.
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

    /// The same game with other hands of the same sizes: a determinization. What was given in this
    /// Shift's exchange stays unchanged.
    ///
    /// # Errors
    /// If the cards are not left in the deck, or the game cannot have reached this state with these
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

/// Checks the sizes of hands, and that the deck has their cards beside those played.
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
