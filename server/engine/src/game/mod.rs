//! A game as a value: whose decision is open, taking a decision, and what can be asked of the
//! state. The parts of a Shift lie in the modules below: `start` (deal, special action, exchange),
//! `turn` (plays, passes, pizzas), `end` (places, points), `legal` (what is allowed), `view` (what
//! a seat may know), `script` (games from given hands).

mod end;
mod error;
mod legal;
mod script;
mod shift_state;
mod start;
mod turn;
mod view;

pub use error::{ActionError, Refusal};
pub(crate) use legal::default_gift;
pub use legal::{GiftRequirement, PlayRequirement, Requirement};
pub use script::{Script, ScriptError};

use crate::{
    Action, ActionId, BySeat, Cards, Deal, Event, Role, RuleSet, Seat, SeatOrder, Seed,
    SpecialAction, Standings, Stop,
};
use shift_state::ShiftState;

/// What kind of decision is open.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum DecisionKind {
    /// Play or pass.
    Turn,
    /// Give one card in the exchange.
    Exchange,
    /// Declare the special action or decline.
    SpecialAction,
}

/// The decision a game waits for.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct Decision {
    /// Whose decision it is.
    pub seat: Seat,
    /// What kind.
    pub kind: DecisionKind,
}

/// Where a game stands within a Shift.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
enum Stage {
    /// This seat was dealt two jokers.
    Special(Seat),
    /// This seat has to give a card; so many gifts of the Chef and of the Sous-Chef are still to
    /// come, this one included.
    Exchange {
        giver: Seat,
        chef_left: u8,
        sous_chef_left: u8,
    },
    /// This seat has to play or pass.
    Turn(Seat),
    /// The game has ended.
    Over,
}

/// A game being played, or played to its end. Fixed in size and without heap, so that a clone is a
/// copy of memory.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct Game {
    rules: RuleSet,
    seed: Seed,
    shift: u32,
    stage: Stage,
    state: ShiftState,
    hands: BySeat<Cards>,
    cards_left: BySeat<u8>,
    /// By face: the Golden card is not told apart.
    played: Cards,
    gave: BySeat<Cards>,
    received: BySeat<Cards>,
    scores: BySeat<u64>,
    /// The seats from Chef to Dishwasher; empty in the first Shift. A Food Fight reverses it.
    ranking: SeatOrder,
    roles: BySeat<Option<Role>>,
    special: Option<SpecialAction>,
    /// The seat drawn at the deal for the opening with any top face.
    drawn: Option<Seat>,
    /// The order of the last Shift that ended; breaks ties.
    last_order: SeatOrder,
}

impl Game {
    /// A new game: deals the first Shift.
    pub fn new(rules: RuleSet, seed: Seed, mut on_event: impl FnMut(Event)) -> Game {
        let mut game = Game::blank(rules, seed);
        let deal = Deal::new(&rules, seed, 1);
        game.start_shift(
            1,
            deal.hands(),
            deal.drawn(),
            SeatOrder::EMPTY,
            &mut on_event,
        );
        game
    }

    fn blank(rules: RuleSet, seed: Seed) -> Game {
        let players = rules.players();
        Game {
            rules,
            seed,
            shift: 0,
            stage: Stage::Over,
            state: ShiftState::new(players),
            hands: BySeat::filled(players, Cards::EMPTY),
            cards_left: BySeat::filled(players, 0),
            played: Cards::EMPTY,
            gave: BySeat::filled(players, Cards::EMPTY),
            received: BySeat::filled(players, Cards::EMPTY),
            scores: BySeat::filled(players, 0),
            ranking: SeatOrder::EMPTY,
            roles: BySeat::filled(players, None),
            special: None,
            drawn: None,
            last_order: SeatOrder::EMPTY,
        }
    }

    /// The decision that is open, or `None` if the game has ended.
    #[inline]
    pub fn decision(&self) -> Option<Decision> {
        match self.stage {
            Stage::Turn(seat) => Some(Decision {
                seat,
                kind: DecisionKind::Turn,
            }),
            Stage::Exchange { giver, .. } => Some(Decision {
                seat: giver,
                kind: DecisionKind::Exchange,
            }),
            Stage::Special(seat) => Some(Decision {
                seat,
                kind: DecisionKind::SpecialAction,
            }),
            Stage::Over => None,
        }
    }

    /// Takes the open decision. What happens is told in order, private fields included
    /// ([`Event::seen_by`]).
    ///
    /// # Errors
    /// If the action is not legal; the game is left as it was and nothing is told.
    #[inline]
    pub fn apply(
        &mut self,
        id: ActionId,
        mut on_event: impl FnMut(Event),
    ) -> Result<(), ActionError> {
        let Some(decision) = self.decision() else {
            return Err(ActionError::GameOver);
        };
        let space = self.rules.actions();
        let Some(action) = space.decode(id) else {
            return Err(ActionError::OutOfRange {
                action: id,
                size: space.size(),
            });
        };
        match (self.stage, action) {
            (
                Stage::Turn(seat),
                Action::Play {
                    face,
                    quantity,
                    jokers,
                },
            ) => {
                self.check_turn(seat, action)?;
                self.play_face(seat, id, face, quantity, jokers, &mut on_event);
            }
            (Stage::Turn(seat), Action::LoneJoker) => {
                self.check_turn(seat, action)?;
                self.play_lone_joker(seat, id, &mut on_event);
            }
            (Stage::Turn(seat), Action::Pass) => {
                self.check_turn(seat, action)?;
                self.pass(seat, &mut on_event);
            }
            (
                Stage::Exchange {
                    giver,
                    chef_left,
                    sous_chef_left,
                },
                Action::Give(_) | Action::GiveJoker,
            ) => {
                self.check_gift(giver, action)?;
                self.give(giver, action, chef_left, sous_chef_left, &mut on_event);
            }
            (Stage::Special(_), Action::Decline) => self.start_exchange(&mut on_event),
            (Stage::Special(seat), Action::Declare) => self.declare(seat, &mut on_event),
            _ => {
                return Err(ActionError::WrongKind {
                    attempted: action,
                    kind: decision.kind,
                });
            }
        }
        Ok(())
    }

    /// Lets this seed deal all later Shifts, so that a game can go on otherwise than the one it
    /// was branched from. The Shift being played stays as it was dealt.
    pub fn reseed(&mut self, seed: Seed) {
        self.seed = seed;
    }

    /// The same game, except that it ends with this Shift, whatever the rule set says: to look at how the
    /// Shift ends after an action, which here the deal of the next one wipes away.
    pub fn closing_copy(&self) -> Game {
        Game {
            rules: self.rules.with_stop(Stop::Shifts(self.shift)),
            ..self.clone()
        }
    }

    /// The rule set.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// The seed of the deals to come, and of all before unless [`Game::reseed`] changed it. Records
    /// need it; nobody may see it before the game has ended.
    pub fn seed(&self) -> Seed {
        self.seed
    }

    /// Number of the Shift being played, or of the last one if the game has ended, from 1.
    pub fn shift(&self) -> u32 {
        self.shift
    }

    /// Turns taken in this Shift.
    pub fn shift_turns(&self) -> u32 {
        self.state.turns
    }

    /// All hands, which no seat may see. A card given in the exchange is in nobody's hand until the
    /// exchange is complete.
    pub fn hands(&self) -> &BySeat<Cards> {
        &self.hands
    }

    /// Cards played in this Shift, by face: the Golden card is not told apart.
    pub fn played(&self) -> Cards {
        self.played
    }

    /// Cards given in this Shift's exchange by each seat, those of an exchange not yet complete
    /// included.
    pub fn gave(&self) -> &BySeat<Cards> {
        &self.gave
    }

    /// Cards received in this Shift's exchange by each seat.
    pub fn received(&self) -> &BySeat<Cards> {
        &self.received
    }

    /// Points of each seat so far.
    pub fn scores(&self) -> &BySeat<u64> {
        &self.scores
    }

    /// The role of each seat in this Shift; none in the first.
    pub fn roles(&self) -> &BySeat<Option<Role>> {
        &self.roles
    }

    /// Whether the game has ended.
    pub fn is_over(&self) -> bool {
        self.stage == Stage::Over
    }

    /// The final table, or `None` while the game is being played.
    pub fn standings(&self) -> Option<Standings> {
        self.is_over().then(|| self.final_table())
    }
}
