//! Actions, their indices and their texts (`docs/rules.md` §8.1). The numbering depends on the
//! number of faces alone. `game::legal` decides what is legal.

use std::fmt;

use crate::{ActionId, Face, MAX_FACES};

/// What a seat does at a decision: a play, a pass, a gift, or its answer to a special action.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub enum Action {
    /// Play cards of one face, with jokers or without.
    Play {
        /// The face.
        face: Face,
        /// Number of its cards, 1..=face.
        quantity: u8,
        /// Number of jokers, 0..=2.
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

impl fmt::Display for Action {
    /// The text of the action, for instance `C11;Q3;J1`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Action::Play {
                face,
                quantity,
                jokers,
            } => write!(f, "C{face};Q{quantity};J{jokers}"),
            Action::LoneJoker => f.write_str("C0;Q0;J1"),
            Action::Pass => f.write_str("pass"),
            Action::Give(face) => write!(f, "give C{face}"),
            Action::GiveJoker => f.write_str("give J"),
            Action::Decline => f.write_str("decline"),
            Action::Declare => f.write_str("declare"),
        }
    }
}

/// The numbering of actions for a number of faces F. With T = 3F(F+1)/2 + 2 (by default 200) the
/// actions of a turn are 0..T, in the order of the paper's look-up table. Gifts and the special
/// action follow.
#[derive(Copy, Clone, Eq, PartialEq, Hash, Debug)]
pub struct ActionSpace {
    faces: u8,
}

impl ActionSpace {
    /// The numbering for this many faces, or `None` unless there are 4..=15.
    pub const fn new(faces: u8) -> Option<ActionSpace> {
        if faces >= 4 && faces <= MAX_FACES {
            Some(ActionSpace { faces })
        } else {
            None
        }
    }

    /// The numbering for this many faces, which is known to be in range.
    pub(crate) const fn of(faces: u8) -> ActionSpace {
        ActionSpace { faces }
    }

    /// Number of faces F.
    pub const fn faces(self) -> u8 {
        self.faces
    }

    /// Number of plays other than the lone joker.
    const fn plays(self) -> u16 {
        play_offset(self.faces + 1)
    }

    /// T: the actions of a turn are 0..T, and T-1 is passing.
    pub const fn turn_actions(self) -> u16 {
        self.plays() + 2
    }

    /// Number of all actions.
    pub const fn size(self) -> u16 {
        self.turn_actions() + self.faces as u16 + 3
    }

    /// Name of the numbering, for instance `chefshat-11`.
    pub fn id(self) -> String {
        format!("chefshat-{}", self.faces)
    }

    /// The index of playing one joker alone.
    pub const fn lone_joker(self) -> ActionId {
        ActionId::new(self.plays())
    }

    /// The index of passing.
    pub const fn pass(self) -> ActionId {
        ActionId::new(self.plays() + 1)
    }

    /// The index of giving one card of a face, or `None` if the deck has no such face.
    pub const fn give(self, face: Face) -> Option<ActionId> {
        if face.get() <= self.faces {
            Some(ActionId::new(self.turn_actions() + face.get() as u16 - 1))
        } else {
            None
        }
    }

    /// The index of giving one joker.
    pub const fn give_joker(self) -> ActionId {
        ActionId::new(self.turn_actions() + self.faces as u16)
    }

    /// The index of declining the special action.
    pub const fn decline(self) -> ActionId {
        ActionId::new(self.turn_actions() + self.faces as u16 + 1)
    }

    /// The index of declaring the special action.
    pub const fn declare(self) -> ActionId {
        ActionId::new(self.turn_actions() + self.faces as u16 + 2)
    }

    /// The action with this index, or `None` if there is none.
    #[inline]
    pub fn decode(self, id: ActionId) -> Option<Action> {
        let (index, plays) = (id.index(), self.plays());
        if index < plays {
            let [face, quantity, jokers] = PLAYS[usize::from(index)];
            return Some(Action::Play {
                face: Face::of(face),
                quantity,
                jokers,
            });
        }
        let faces = u16::from(self.faces);
        match index - plays {
            0 => Some(Action::LoneJoker),
            1 => Some(Action::Pass),
            rest if rest < 2 + faces => Some(Action::Give(Face::of((rest - 1) as u8))),
            rest if rest == 2 + faces => Some(Action::GiveJoker),
            rest if rest == 3 + faces => Some(Action::Decline),
            rest if rest == 4 + faces => Some(Action::Declare),
            _ => None,
        }
    }

    /// The index of an action, or `None` if no deck of this many faces has such an action.
    pub fn encode(self, action: Action) -> Option<ActionId> {
        match action {
            Action::Play {
                face,
                quantity,
                jokers,
            } => {
                let exists = face.get() <= self.faces
                    && (1..=face.get()).contains(&quantity)
                    && jokers <= crate::MAX_JOKERS;
                exists.then(|| {
                    ActionId::new(
                        play_offset(face.get()) + 3 * u16::from(quantity - 1) + u16::from(jokers),
                    )
                })
            }
            Action::LoneJoker => Some(self.lone_joker()),
            Action::Pass => Some(self.pass()),
            Action::Give(face) => self.give(face),
            Action::GiveJoker => Some(self.give_joker()),
            Action::Decline => Some(self.decline()),
            Action::Declare => Some(self.declare()),
        }
    }

    /// The text of the action with this index, or `None` if there is none.
    pub fn text(self, id: ActionId) -> Option<String> {
        self.decode(id).map(|action| action.to_string())
    }

    /// The index of the action with this text, or `None` if there is none. Only the exact text
    /// counts.
    pub fn parse(self, text: &str) -> Option<ActionId> {
        let action = parse_action(text)?;
        // Comparing the text refuses spellings such as `C01;Q1;J0`.
        (action.to_string() == text)
            .then(|| self.encode(action))
            .flatten()
    }

    /// The indices of all actions, ascending.
    pub fn iter(self) -> impl ExactSizeIterator<Item = ActionId> {
        (0..self.size()).map(ActionId::new)
    }
}

fn parse_action(text: &str) -> Option<Action> {
    match text {
        "C0;Q0;J1" => return Some(Action::LoneJoker),
        "pass" => return Some(Action::Pass),
        "give J" => return Some(Action::GiveJoker),
        "decline" => return Some(Action::Decline),
        "declare" => return Some(Action::Declare),
        _ => {}
    }
    if let Some(face) = text.strip_prefix("give C") {
        return Some(Action::Give(Face::new(face.parse().ok()?)?));
    }
    let mut parts = text.split(';');
    let face = Face::new(parts.next()?.strip_prefix('C')?.parse().ok()?)?;
    let quantity = parts.next()?.strip_prefix('Q')?.parse().ok()?;
    let jokers = parts.next()?.strip_prefix('J')?.parse().ok()?;
    parts.next().is_none().then_some(Action::Play {
        face,
        quantity,
        jokers,
    })
}

/// Number of plays of cards with a face in the largest deck.
const MAX_PLAYS: usize = play_offset(MAX_FACES + 1) as usize;

/// Index of the first play of a face: 3f(f-1)/2.
pub(crate) const fn play_offset(face: u8) -> u16 {
    3 * (face as u16) * (face as u16 - 1) / 2
}

/// Face, quantity and jokers of each play, by index.
static PLAYS: [[u8; 3]; MAX_PLAYS] = {
    let mut table = [[0; 3]; MAX_PLAYS];
    let (mut face, mut index) = (1, 0);
    while face <= MAX_FACES {
        let mut quantity = 1;
        while quantity <= face {
            let mut jokers = 0;
            while jokers <= 2 {
                table[index] = [face, quantity, jokers];
                index += 1;
                jokers += 1;
            }
            quantity += 1;
        }
        face += 1;
    }
    table
};
