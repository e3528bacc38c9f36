//! The look-up table of a decision, as in the paper's figure of possible actions: every action of a turn by face, quantity and jokers,
//! and what is to be said of it for one hand at one moment. A value; how it is drawn is in `figure_svg`.

use chefshat_engine::{
    Action, ActionSpace, BySeat, Cards, DecisionKind, Face, Game, Mask, Requirement, Seat, Viewer,
};

use super::chronicle::{Chronicle, Participant};
use super::scene::{Card, Scene};

/// What is to be said of an action: whether the rules allow it now, whatever the hand is, and whether the hand holds its cards, whatever
/// lies on the board.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// Neither.
    Impossible,
    /// The hand holds the cards, but the rules do not allow the action now.
    NotAllowed,
    /// The rules allow the action now, but the hand does not hold the cards.
    NotInHand,
    /// Both: it may be taken.
    Legal,
}

/// The look-up table of an open decision.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// Name of the room or of the record.
    pub caption: String,
    /// Whose decision it is.
    pub seat: Seat,
    /// Who sits there.
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
    /// The plays of each face, from face 1: of each quantity, from 1 to the face: without a joker, with one, and so on.
    pub plays: Vec<Vec<Vec<State>>>,
    /// A joker alone, where the deck has jokers.
    pub lone_joker: Option<State>,
    /// Passing.
    pub pass: State,
    /// Giving a card of each face, from face 1, then a joker where the deck has them; empty unless a card is to be given.
    pub gives: Vec<State>,
    /// Declaring and declining a special action; empty unless that is to be decided.
    pub special: Vec<State>,
    /// How many actions are legal.
    pub legal: usize,
}

impl Figure {
    /// The table of the decision that is open; `None` if the game has ended. It shows the hand of the seat that decides.
    pub fn of(game: &Game, chronicle: &Chronicle) -> Option<Figure> {
        let decision = game.decision()?;
        let seat = decision.seat;
        let rules = game.rules();
        let (faces, jokers) = (rules.faces(), rules.jokers());
        let known = BySeat::filled(rules.players(), true);
        let scene = Scene::of(game, chronicle, Viewer::Seat(seat), &known);
        let table = LookUp {
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
            hand: super::scene::cards(table.hand, faces),
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

/// What the states follow from.
struct LookUp {
    space: ActionSpace,
    hand: Cards,
    legal: Mask,
    requirement: Requirement,
}

impl LookUp {
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

    /// Whether the rules allow an action now to a hand that holds its cards.
    fn allows(&self, action: Action) -> bool {
        match (self.requirement, action) {
            (Requirement::Play(play), _) => play.allows(action),
            (Requirement::Gift(_), Action::Give(_) | Action::GiveJoker) => true,
            (Requirement::SpecialAction(_), Action::Declare | Action::Decline) => true,
            _ => false,
        }
    }
}
