//! The numbering of actions: what each index means, and its text. The numbering depends on the
//! number of faces alone; what is legal is the game's affair.

use std::fmt;

use crate::patterns::{PLAYS, play_offset};
use crate::{Action, Face, MAX_FACES};

/// What an action means.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum Move {
    /// Play cards of one face, with jokers or without.
    Play {
        /// The face.
        face: Face,
        /// How many cards of it, 1..=face.
        quantity: u8,
        /// How many jokers go with them, 0..=2.
        jokers: u8,
    },
    /// Play one joker alone.
    LoneJoker,
    /// Pass.
    Pass,
    /// Give one card of a face in the exchange.
    Give(Face),
    /// Give one joker in the exchange.
    GiveJoker,
    /// Decline to declare a special action.
    Decline,
    /// Declare the special action.
    Declare,
}

impl fmt::Display for Move {
    /// The text of the action, for instance `C11;Q3;J1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Move::Play {
                face,
                quantity,
                jokers,
            } => write!(f, "C{face};Q{quantity};J{jokers}"),
            Move::LoneJoker => f.write_str("C0;Q0;J1"),
            Move::Pass => f.write_str("pass"),
            Move::Give(face) => write!(f, "give C{face}"),
            Move::GiveJoker => f.write_str("give J"),
            Move::Decline => f.write_str("decline"),
            Move::Declare => f.write_str("declare"),
        }
    }
}

/// The numbering of actions for a number of faces F. With T = 3F(F+1)/2 + 2 (standard 200) the
/// actions of a turn are 0..T, in the order of the paper's look-up table; exchange and special
/// action follow.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub struct ActionSpace {
    faces: u8,
}

impl ActionSpace {
    /// The numbering for so many faces, 4..=15, or `None`.
    pub const fn new(faces: u8) -> Option<ActionSpace> {
        if faces >= 4 && faces <= MAX_FACES {
            Some(ActionSpace { faces })
        } else {
            None
        }
    }

    /// The numbering for a number of faces that is known to be in range.
    pub(crate) const fn of(faces: u8) -> ActionSpace {
        ActionSpace { faces }
    }

    /// Number of faces F.
    pub const fn faces(self) -> u8 {
        self.faces
    }

    /// Number of plays of cards with a face.
    const fn plays(self) -> u16 {
        play_offset(self.faces + 1)
    }

    /// T: the actions of a turn are 0..T, the last of them passing.
    pub const fn turn_actions(self) -> u16 {
        self.plays() + 2
    }

    /// Number of actions in all.
    pub const fn size(self) -> u16 {
        self.turn_actions() + self.faces as u16 + 3
    }

    /// Name of the numbering, for instance `chefshat-11`.
    pub fn id(self) -> String {
        format!("chefshat-{}", self.faces)
    }

    /// Playing one joker alone.
    pub const fn lone_joker(self) -> Action {
        Action::new(self.plays())
    }

    /// Passing.
    pub const fn pass(self) -> Action {
        Action::new(self.plays() + 1)
    }

    /// Giving one card of a face, or `None` if the deck has no such face.
    pub const fn give(self, face: Face) -> Option<Action> {
        if face.get() <= self.faces {
            Some(Action::new(self.turn_actions() + face.get() as u16 - 1))
        } else {
            None
        }
    }

    /// Giving one joker.
    pub const fn give_joker(self) -> Action {
        Action::new(self.turn_actions() + self.faces as u16)
    }

    /// Declining the special action.
    pub const fn decline(self) -> Action {
        Action::new(self.turn_actions() + self.faces as u16 + 1)
    }

    /// Declaring the special action.
    pub const fn declare(self) -> Action {
        Action::new(self.turn_actions() + self.faces as u16 + 2)
    }

    /// What an action means, or `None` if there is no such action.
    #[inline]
    pub fn decode(self, action: Action) -> Option<Move> {
        let (index, plays) = (action.index(), self.plays());
        if index < plays {
            let [face, quantity, jokers] = PLAYS[usize::from(index)];
            return Some(Move::Play {
                face: Face::of(face),
                quantity,
                jokers,
            });
        }
        let faces = u16::from(self.faces);
        match index - plays {
            0 => Some(Move::LoneJoker),
            1 => Some(Move::Pass),
            rest if rest < 2 + faces => Some(Move::Give(Face::of((rest - 1) as u8))),
            rest if rest == 2 + faces => Some(Move::GiveJoker),
            rest if rest == 3 + faces => Some(Move::Decline),
            rest if rest == 4 + faces => Some(Move::Declare),
            _ => None,
        }
    }

    /// The number of a move, or `None` if no deck of this many faces has such a move.
    pub fn encode(self, meaning: Move) -> Option<Action> {
        match meaning {
            Move::Play {
                face,
                quantity,
                jokers,
            } => {
                let exists = face.get() <= self.faces
                    && (1..=face.get()).contains(&quantity)
                    && jokers <= crate::MAX_JOKERS;
                exists.then(|| {
                    Action::new(
                        play_offset(face.get()) + 3 * u16::from(quantity - 1) + u16::from(jokers),
                    )
                })
            }
            Move::LoneJoker => Some(self.lone_joker()),
            Move::Pass => Some(self.pass()),
            Move::Give(face) => self.give(face),
            Move::GiveJoker => Some(self.give_joker()),
            Move::Decline => Some(self.decline()),
            Move::Declare => Some(self.declare()),
        }
    }

    /// The text of an action, or `None` if there is no such action.
    pub fn text(self, action: Action) -> Option<String> {
        self.decode(action).map(|meaning| meaning.to_string())
    }

    /// The action with this text, or `None` if there is none. Only the exact text is understood.
    pub fn parse(self, text: &str) -> Option<Action> {
        let meaning = parse_move(text)?;
        // Writing it again refuses spellings like `C01;Q1;J0` that would be understood otherwise.
        (meaning.to_string() == text)
            .then(|| self.encode(meaning))
            .flatten()
    }

    /// All actions, ascending.
    pub fn iter(self) -> impl ExactSizeIterator<Item = Action> {
        (0..self.size()).map(Action::new)
    }
}

fn parse_move(text: &str) -> Option<Move> {
    match text {
        "C0;Q0;J1" => return Some(Move::LoneJoker),
        "pass" => return Some(Move::Pass),
        "give J" => return Some(Move::GiveJoker),
        "decline" => return Some(Move::Decline),
        "declare" => return Some(Move::Declare),
        _ => {}
    }
    if let Some(face) = text.strip_prefix("give C") {
        return Some(Move::Give(Face::new(face.parse().ok()?)?));
    }
    let mut parts = text.split(';');
    let face = Face::new(parts.next()?.strip_prefix('C')?.parse().ok()?)?;
    let quantity = parts.next()?.strip_prefix('Q')?.parse().ok()?;
    let jokers = parts.next()?.strip_prefix('J')?.parse().ok()?;
    parts.next().is_none().then_some(Move::Play {
        face,
        quantity,
        jokers,
    })
}
