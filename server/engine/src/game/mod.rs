//! A game as a value: its open decision, applying an action, and reading its state. The modules:
//! `start` (deal, special action, exchange),
//! `turn` (plays, passes, pizzas), `end` (places, points), `shift_state` (board and turn order),
//! `legal` (what is legal), `view` (what a seat may know), `script` (games from given hands),
//! `state` (the complete state as a value), `restore` (from a state to a game).

mod end;
mod error;
mod legal;
mod restore;
mod script;
mod shift_state;
mod start;
mod state;
mod turn;
mod view;

pub use error::{ActionError, Refusal};
pub use script::{Script, ScriptError};
pub use state::{GameState, Stage, StateError};

use crate::{
    Action, ActionId, BySeat, Cards, Deal, Decision, DecisionKind, Event, Role, RuleSet, Seat,
    SeatOrder, Seed, SpecialAction, Standings, Stop,
};
use shift_state::ShiftState;

/// A game in progress or ended. Has a fixed size and no heap memory, so a clone is a memory copy.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct Game {
    rules: RuleSet,
    seed: Seed,
    shift: u32,
    stage: Stage,
    state: ShiftState,
    hands: BySeat<Cards>,
    cards_left: BySeat<u8>,
    /// Without the Golden card's flag.
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
    /// The order of the last Shift that ended, which breaks ties.
    last_order: SeatOrder,
}

impl Game {
    /// Starts a game: deals the first Shift.
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

    /// The open decision, or `None` if the game has ended.
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

    /// Applies an action to the open decision. Reports the events in order, private fields included
    /// ([`Event::seen_by`]).
    ///
    /// # Errors
    /// If the action is not legal. The game stays unchanged and no event is reported.
    #[inline]
    pub fn apply(
        &mut self,
        id: ActionId,
        mut on_event: impl FnMut(Event),
    ) -> Result<(), ActionError> {
        let Some(action) = self.rules.actions().decode(id) else {
            return Err(self.wrong_kind(id));
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
            _ => return Err(self.wrong_kind(id)),
        }
        Ok(())
    }

    /// Checks an action without applying it: succeeds exactly when [`Game::apply`] does.
    ///
    /// # Errors
    /// If the action is not legal.
    pub fn check(&self, id: ActionId) -> Result<(), ActionError> {
        match (self.stage, self.rules.actions().decode(id)) {
            (
                Stage::Turn(seat),
                Some(turn @ (Action::Play { .. } | Action::LoneJoker | Action::Pass)),
            ) => self.check_turn(seat, turn),
            (Stage::Exchange { giver, .. }, Some(gift @ (Action::Give(_) | Action::GiveJoker))) => {
                self.check_gift(giver, gift)
            }
            (Stage::Special(_), Some(Action::Decline | Action::Declare)) => Ok(()),
            _ => Err(self.wrong_kind(id)),
        }
    }

    /// Deals all later Shifts from this seed, so that a branch can differ from the game it came
    /// from. The current Shift stays as it was dealt.
    pub fn reseed(&mut self, seed: Seed) {
        self.seed = seed;
    }

    /// A copy that ends with this Shift, whatever the rule set says. Its state after the Shift's
    /// last action is that of the end, which in this game the next deal overwrites.
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

    /// The seed of the deals to come, and of all earlier ones unless [`Game::reseed`] changed it.
    /// Secret until the game has ended.
    pub fn seed(&self) -> Seed {
        self.seed
    }

    /// Number of the current Shift, or of the last one if the game has ended, from 1.
    pub fn shift(&self) -> u32 {
        self.shift
    }

    /// Turns taken in this Shift.
    pub fn shift_turns(&self) -> u32 {
        self.state.turns
    }

    /// All hands, which are secret. A card given in the exchange is in no hand until the exchange
    /// is complete.
    pub fn hands(&self) -> &BySeat<Cards> {
        &self.hands
    }

    /// Cards played in this Shift, without the Golden card's flag.
    pub fn played(&self) -> Cards {
        self.played
    }

    /// Cards that each seat gave in this Shift's exchange, also before it is complete.
    pub fn gave(&self) -> &BySeat<Cards> {
        &self.gave
    }

    /// Cards that each seat received in this Shift's exchange.
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

    /// The final table, or `None` while the game is in progress.
    pub fn standings(&self) -> Option<Standings> {
        self.is_over().then(|| self.final_table())
    }
}
