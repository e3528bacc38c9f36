//! The action table of a decision, after the paper's figure of possible actions: every action by
//! face, quantity and jokers, with its state for one hand. Drawn in `figure_svg`.

use chefshat_engine::{
    Action, ActionSpace, BySeat, Cards, DecisionKind, Face, Game, Mask, Requirement, Seat, Viewer,
};

use super::card::Card;
use super::chronicle::{Chronicle, Participant};
use super::scene::Scene;

/// The state of an action: whether the rules allow it now for some hand, and whether this hand has
/// its cards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Neither.
    Impossible,
    /// The hand has the cards, but the rules do not allow the action now.
    NotAllowed,
    /// The rules allow the action now, but the hand does not have the cards.
    NotInHand,
    /// Both.
    Legal,
}

/// The action table of an open decision.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name of the room or of the record.
    pub caption: String,
    /// The seat that decides.
    pub seat: Seat,
    /// Its participant.
    pub participant: Participant,
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Number of the pizza in its Shift, from 1; 0 before the Shift's first turn is open.
    pub pizza: u32,
    /// Number of faces F.
    pub faces: u8,
    /// Number of jokers in the deck.
    pub jokers: u8,
    /// The hand, ascending.
    pub hand: Vec<Card>,
    /// The cards on the board.
    pub board: Vec<Card>,
    /// What the rules require of the decision.
    pub requirement: Requirement,
    /// The plays by face, quantity (both from 1) and jokers (from 0).
    pub plays: Vec<Vec<Vec<State>>>,
    /// A lone joker, if the deck has jokers.
    pub lone_joker: Option<State>,
    /// Passing.
    pub pass: State,
    /// Gifts by face from 1, then a joker if the deck has any; empty except in an exchange.
    pub gives: Vec<State>,
    /// Declaring and declining; empty except for a special action.
    pub special: Vec<State>,
    /// The number of legal actions.
    pub legal: usize,
}

impl Figure {
    /// The action table of the open decision, showing the hand of its seat; `None` if the game is
    /// over.
    pub fn of(game: &Game, chronicle: &Chronicle) -> Option<Figure> {
        let decision = game.decision()?;
        let seat = decision.seat;
        let rules = game.rules();
        let (faces, jokers) = (rules.faces(), rules.jokers());
        let known = BySeat::filled(rules.players(), true);
        let scene = Scene::of(game, chronicle, Viewer::Seat(seat), &known);
        let table = Inputs {
            space: rules.actions(),
            hand: game.hands()[seat],
            legal: game.legal_actions(),
            requirement: game.requirement()?,
        };
        let plays = (1..=faces)
            .filter_map(Face::new)
            .map(|face| {
                (1..=face.get())
                    .map(|quantity| {
                        (0..=jokers)
                            .map(|jokers| {
                                table.state(Action::Play {
                                    face,
                                    quantity,
                                    jokers,
                                })
                            })
                            .collect()
                    })
                    .collect()
            })
            .collect();
        let gives = (1..=faces)
            .filter_map(Face::new)
            .map(Action::Give)
            .chain((jokers > 0).then_some(Action::GiveJoker))
            .map(|gift| table.state(gift));
        let special = [Action::Declare, Action::Decline];
        Some(Figure {
            caption: scene.caption,
            seat,
            participant: chronicle.participant(seat),
            shift: scene.shift,
            pizza: scene.pizza,
            faces,
            jokers,
            hand: Card::of_hand(table.hand, faces),
            board: scene.board,
            requirement: table.requirement,
            plays,
            lone_joker: (jokers > 0).then(|| table.state(Action::LoneJoker)),
            pass: table.state(Action::Pass),
            gives: if decision.kind == DecisionKind::Exchange {
                gives.collect()
            } else {
                Vec::new()
            },
            special: if decision.kind == DecisionKind::SpecialAction {
                special.map(|special| table.state(special)).to_vec()
            } else {
                Vec::new()
            },
            legal: table.legal.len(),
        })
    }
}

/// The inputs of the states.
struct Inputs {
    space: ActionSpace,
    hand: Cards,
    legal: Mask,
    requirement: Requirement,
}

impl Inputs {
    fn state(&self, action: Action) -> State {
        let legal = self
            .space
            .encode(action)
            .is_some_and(|id| self.legal.contains(id));
        match (legal, self.hand.holds(action), self.allows(action)) {
            (true, _, _) => State::Legal,
            (false, true, _) => State::NotAllowed,
            (false, false, true) => State::NotInHand,
            (false, false, false) => State::Impossible,
        }
    }

    /// Whether the rules allow the action now to a hand that has its cards.
    fn allows(&self, action: Action) -> bool {
        match (self.requirement, action) {
            (Requirement::Play(play), _) => play.allows(action),
            (Requirement::Gift(_), Action::Give(_) | Action::GiveJoker) => true,
            (Requirement::SpecialAction(_), Action::Declare | Action::Decline) => true,
            _ => false,
        }
    }
}
