//! Reports of what happened at a physical table, and what the referee makes of them.

use chefshat_engine::{ActionId, Cards, DecisionKind, Event, Role, Seat};

use crate::counts::Counts;

/// Cards seen at the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SeenCards {
    /// Cards by kind; may exceed a deck.
    pub counts: Counts,
    /// Whether the Golden card is among them; `None` if that was not looked at.
    pub golden: Option<bool>,
}

/// Something that happened at a physical table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Report {
    /// A hand, as it is now, became known.
    Hand {
        /// The seat.
        seat: Seat,
        /// All its cards.
        cards: SeenCards,
    },
    /// Cards were laid on the board.
    Laid {
        /// The seat; `None`: the one whose turn it is.
        seat: Option<Seat>,
        /// The cards laid, without those that lay there before.
        cards: SeenCards,
    },
    /// A seat passed.
    Pass {
        /// The seat; `None`: the one whose turn it is.
        seat: Option<Seat>,
    },
    /// A seat took its pass back.
    PassWithdrawn {
        /// The seat.
        seat: Seat,
    },
    /// The board was cleared.
    Cleared,
    /// A special action was declared; `None`: nobody declares one.
    Special {
        /// The seat that declared.
        seat: Option<Seat>,
    },
    /// A seat gave its cards in the exchange.
    Gift {
        /// The seat that gave.
        seat: Seat,
        /// The cards, if known.
        cards: Option<SeenCards>,
    },
    /// A seat took the card of a role.
    Role {
        /// The seat.
        seat: Seat,
        /// The role.
        role: Role,
    },
    /// An earlier report was wrong.
    Correction {
        /// Its number.
        number: u64,
        /// What happened instead; `None`: nothing.
        instead: Option<Box<Report>>,
    },
    /// A bridge asks what lies on the table.
    Question(Question),
    /// The answer to a question.
    Answer {
        /// The question.
        id: String,
        /// Index of the right option; `None`: the question is withdrawn.
        option: Option<usize>,
    },
    /// The game is paused (`true`) or resumed.
    Pause(bool),
    /// The play that ended the game was read correctly.
    EndConfirmed,
}

impl Report {
    /// The seat that it is about, if it names one.
    pub fn seat(&self) -> Option<Seat> {
        match self {
            Self::Hand { seat, .. }
            | Self::PassWithdrawn { seat }
            | Self::Gift { seat, .. }
            | Self::Role { seat, .. } => Some(*seat),
            Self::Laid { seat, .. } | Self::Pass { seat } | Self::Special { seat } => *seat,
            Self::Question(question) => question.seat,
            Self::Cleared
            | Self::Correction { .. }
            | Self::Answer { .. }
            | Self::Pause(_)
            | Self::EndConfirmed => None,
        }
    }

    /// A report about a turn, with the seat it is about.
    pub(crate) fn with_seat(&self, seat: Seat) -> Self {
        match self {
            Self::Laid { cards, .. } => Self::Laid {
                seat: Some(seat),
                cards: *cards,
            },
            Self::Pass { .. } => Self::Pass { seat: Some(seat) },
            other => other.clone(),
        }
    }
}

/// A question about the table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Question {
    /// Identifies it in its room.
    pub id: String,
    /// For people.
    pub text: String,
    /// The possible answers.
    pub options: Vec<String>,
    /// The seat it concerns, if known.
    pub seat: Option<Seat>,
}

/// A verdict on a report.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Verdict {
    /// It counts.
    Accepted,
    /// It was known already.
    #[default]
    Known,
    /// The rules or the cards do not allow it.
    Violation(Violation),
    /// It waits for the answer to this question of the referee.
    Held {
        /// The question.
        question: String,
    },
}

/// The rule that something at the table breaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViolatedRule {
    /// It was not this seat's turn.
    Turn,
    /// The face is not lower than the one on the board.
    Face,
    /// Fewer cards than lie on the board.
    Size,
    /// Not cards of one face with jokers, or one joker alone.
    Form,
    /// Not the top face with the Golden card, which the opening requires.
    Opening,
    /// A pass where passing is not allowed.
    Pass,
    /// The cards cannot be there.
    Cards,
    /// A special action that is not possible.
    SpecialAction,
    /// A gift outside the exchange, or of wrong cards.
    Gift,
    /// A role other than the last Shift's order gives.
    Role,
    /// A remote seat decided something else.
    Decision,
    /// A correction that is not possible.
    Correction,
}

/// Something that the rules or the cards do not allow.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Violation {
    /// The seat, if known.
    pub seat: Option<Seat>,
    /// The rule.
    pub rule: ViolatedRule,
    /// For people at the table. May follow from hidden cards, and name cards of hands and gifts.
    pub text: String,
}

impl Violation {
    /// For everybody: names no cards of hands and gifts, nor who may declare a special action.
    /// `name`: of the seat.
    pub fn public_text(&self, name: Option<&str>) -> String {
        let name = name.unwrap_or("a player");
        match self.rule {
            ViolatedRule::Cards => {
                format!("The cards reported for {name} do not fit what is known.")
            }
            ViolatedRule::SpecialAction => {
                "The special action that was reported is not possible.".into()
            }
            ViolatedRule::Gift => format!("The gift reported for {name} is not possible."),
            ViolatedRule::Decision => {
                format!("What was reported for {name} was decided otherwise, or not yet.")
            }
            ViolatedRule::Correction => "A report cannot be corrected in this way.".into(),
            ViolatedRule::Turn
            | ViolatedRule::Face
            | ViolatedRule::Size
            | ViolatedRule::Form
            | ViolatedRule::Opening
            | ViolatedRule::Pass
            | ViolatedRule::Role => self.text.clone(),
        }
    }
}

/// What follows from a report or a decision. The events of the game contain only known cards.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Ruling {
    /// The verdict.
    pub verdict: Verdict,
    /// A hand that became known: the seat, its cards, and whether they are the hand as dealt.
    pub hand: Option<(Seat, Cards, bool)>,
    /// What is void, if something was corrected.
    pub corrected: Option<Corrected>,
    /// New events of the game.
    pub events: Vec<Event>,
    /// Violations found, among them that of the verdict.
    pub violations: Vec<(u64, Violation)>,
}

/// A correction.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Corrected {
    /// Number of the corrected report.
    pub number: u64,
    /// How many of the last events of the game are void.
    pub void_events: usize,
    /// Reports that no longer fit.
    pub void_reports: Vec<u64>,
    /// For people: "Bo laid two 6s, not two 9s".
    pub text: String,
}

/// What a physical table waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The hand of a remote seat.
    Hand(Seat),
    /// A special action, or the certainty that there is none. The seat, if only one can declare.
    Special(Option<Seat>),
    /// The gift of a seat.
    Gift(Seat),
    /// The seat that opens the Shift, which is not known.
    Opening,
    /// The turn of a seat.
    Turn(Seat),
    /// The answer to a question of the referee.
    Question,
    /// The confirmation of the play that ended the game.
    Confirmation,
    /// Nothing: the game is over.
    Over,
}

/// A decision of a remote seat that nobody has carried out at the table yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ToLay {
    /// The seat.
    pub seat: Seat,
    /// The kind of decision.
    pub kind: DecisionKind,
    /// The decision.
    pub action: ActionId,
    /// The cards, with the Golden card if it goes.
    pub cards: Cards,
    /// The receiver of a gift.
    pub receiver: Option<Seat>,
    /// Number of the Shift, from 1.
    pub shift: u32,
    /// Number of the pizza in the Shift, from 1; 0 if it is no turn.
    pub pizza: u32,
}
