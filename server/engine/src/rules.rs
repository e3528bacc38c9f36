//! Rule sets (`docs/rules.md` §7): unvalidated ([`RuleSetSpec`]), and validated once ([`RuleSet`]).
//! The named presets are in `presets`.

use std::ops::RangeInclusive;

use thiserror::Error;

use crate::{ActionSpace, MAX_FACES, MAX_JOKERS, MAX_SEATS};

/// Allowed numbers of players.
const PLAYERS: RangeInclusive<u8> = 2..=MAX_SEATS as u8;
/// Allowed numbers of faces.
const FACES: RangeInclusive<u8> = 4..=MAX_FACES;
/// Fewest cards in a hand. The exchange needs them.
const MIN_HAND: u8 = 3;

/// When a game ends.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Stop {
    /// After the Shift in which a seat reaches this many points (>= 1).
    Points(u32),
    /// After this many Shifts (>= 1).
    Shifts(u32),
}

/// Who takes the first turn of a Shift, and what it must be (§3.5, §4.4, §7.3).
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum Opening {
    /// The holder of the Golden card, who must play it.
    Golden,
    /// The first seat from a drawn one that holds the top face, which must play that face. As in
    /// the reference implementation.
    AnyTopFace,
}

/// How long a pass counts (§4.5, §7.3).
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub enum PassScope {
    /// Until the next pizza.
    Pizza,
    /// For that turn only. As in the implementation behind the paper's tables.
    Turn,
}

/// A rule set that has not been validated: any values.
#[derive(Clone, Eq, PartialEq, Debug)]
pub struct RuleSetSpec {
    /// Number of players N, 2..=6.
    pub players: u8,
    /// Number of faces F, 4..=15.
    pub faces: u8,
    /// Number of jokers J, 0..=2.
    pub jokers: u8,
    /// When the game ends.
    pub stop: Stop,
    /// Points by place, N non-increasing numbers, the first >= 1. Empty: the default
    /// list for N.
    pub points: Vec<u32>,
    /// Whether cards are exchanged, from the second Shift on.
    pub exchange: bool,
    /// Whether a seat dealt two jokers may declare a special action, from the second Shift on.
    pub special_actions: bool,
    /// Who leads the first pizza of a Shift.
    pub opening: Opening,
    /// Whether the first turn of a Shift may be a pass.
    pub opening_pass: bool,
    /// How long a pass counts.
    pub pass_scope: PassScope,
    /// After this many consecutive pizzas without a play the next leader must play, >= 1 (§5.4).
    pub max_idle_pizzas: u32,
    /// A Shift that reaches this many turns is adjudicated, >= 1 (§5.4).
    pub max_turns: u32,
}

/// Why a rule set is refused: the field, and what to do.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
pub enum RuleSetError {
    /// The number of players is out of range.
    #[error("{0} players: choose 2 to 6")]
    Players(u8),
    /// The number of faces is out of range.
    #[error("{0} faces: choose 4 to 15")]
    Faces(u8),
    /// The number of jokers is out of range.
    #[error("{0} jokers: choose 0 to 2")]
    Jokers(u8),
    /// The deck is too small for the players.
    #[error(
        "{deck} cards among {players} players leave hands of {hand}: choose more faces or fewer players, so that a hand has at least 3 cards"
    )]
    SmallHands {
        /// Cards in the deck.
        deck: u8,
        /// Number of players.
        players: u8,
        /// Cards in each hand.
        hand: u8,
    },
    /// There is not one number of points for each place.
    #[error(
        "{given} numbers of points for {players} players: give one for each place, or none for the default points"
    )]
    PointsCount {
        /// Numbers given.
        given: usize,
        /// Numbers needed.
        players: u8,
    },
    /// A place gets more points than the place before it.
    #[error(
        "place {place} gets more points than the place before it: give the points best place first, never rising"
    )]
    PointsRise {
        /// The place at fault, from 1.
        place: usize,
    },
    /// The first place gets no points.
    #[error("the first place gets no points: give it at least 1")]
    PointsFirst,
    /// The target is 0 points.
    #[error("a target of 0 points: choose at least 1")]
    TargetPoints,
    /// The target is 0 Shifts.
    #[error("a target of 0 Shifts: choose at least 1")]
    TargetShifts,
    /// `max_idle_pizzas` is 0.
    #[error("max_idle_pizzas is 0: choose at least 1 (default 3)")]
    MaxIdlePizzas,
    /// `max_turns` is 0.
    #[error("max_turns is 0: choose at least 1 (default 10000)")]
    MaxTurns,
}

impl RuleSetError {
    /// The name of the field.
    pub fn field(&self) -> &'static str {
        match self {
            RuleSetError::Players(_) => "players",
            RuleSetError::Faces(_) | RuleSetError::SmallHands { .. } => "faces",
            RuleSetError::Jokers(_) => "jokers",
            RuleSetError::PointsCount { .. }
            | RuleSetError::PointsRise { .. }
            | RuleSetError::PointsFirst => "points",
            RuleSetError::TargetPoints => "target_points",
            RuleSetError::TargetShifts => "target_shifts",
            RuleSetError::MaxIdlePizzas => "max_idle_pizzas",
            RuleSetError::MaxTurns => "max_turns",
        }
    }
}

impl RuleSetSpec {
    /// Validates every field.
    ///
    /// # Errors
    /// The first field out of range, and why.
    pub fn validate(&self) -> Result<RuleSet, RuleSetError> {
        if !PLAYERS.contains(&self.players) {
            return Err(RuleSetError::Players(self.players));
        }
        if !FACES.contains(&self.faces) {
            return Err(RuleSetError::Faces(self.faces));
        }
        if self.jokers > MAX_JOKERS {
            return Err(RuleSetError::Jokers(self.jokers));
        }
        let (deck, players) = (
            self.faces * (self.faces + 1) / 2 + self.jokers,
            self.players,
        );
        let hand = deck / players;
        if hand < MIN_HAND {
            return Err(RuleSetError::SmallHands {
                deck,
                players,
                hand,
            });
        }
        match self.stop {
            Stop::Points(0) => return Err(RuleSetError::TargetPoints),
            Stop::Shifts(0) => return Err(RuleSetError::TargetShifts),
            Stop::Points(_) | Stop::Shifts(_) => {}
        }
        let points = self.checked_points()?;
        if self.max_idle_pizzas == 0 {
            return Err(RuleSetError::MaxIdlePizzas);
        }
        if self.max_turns == 0 {
            return Err(RuleSetError::MaxTurns);
        }
        Ok(RuleSet {
            stop: self.stop,
            points,
            max_idle_pizzas: self.max_idle_pizzas,
            max_turns: self.max_turns,
            players,
            faces: self.faces,
            jokers: self.jokers,
            hand,
            deck,
            exchange: self.exchange,
            special_actions: self.special_actions,
            opening: self.opening,
            opening_pass: self.opening_pass,
            pass_scope: self.pass_scope,
        })
    }

    /// The points by place, padded with zeros.
    fn checked_points(&self) -> Result<[u32; MAX_SEATS], RuleSetError> {
        let given = if self.points.is_empty() {
            default_points(self.players)
        } else {
            &self.points
        };
        if given.len() != usize::from(self.players) {
            return Err(RuleSetError::PointsCount {
                given: given.len(),
                players: self.players,
            });
        }
        if let Some(index) = given.windows(2).position(|pair| pair[0] < pair[1]) {
            return Err(RuleSetError::PointsRise { place: index + 2 });
        }
        if given[0] == 0 {
            return Err(RuleSetError::PointsFirst);
        }
        let mut points = [0; MAX_SEATS];
        points[..given.len()].copy_from_slice(given);
        Ok(points)
    }
}

/// The default points by place for a valid number of players (§5.1).
fn default_points(players: u8) -> &'static [u32] {
    match players {
        2 => &[5, 0],
        3 => &[5, 3, 0],
        5 => &[5, 3, 1, 1, 0],
        6 => &[5, 3, 1, 1, 1, 0],
        _ => &[5, 3, 1, 0],
    }
}

/// A validated rule set. Only [`RuleSetSpec::validate`] creates it.
#[derive(Copy, Clone, Eq, PartialEq, Debug)]
pub struct RuleSet {
    stop: Stop,
    points: [u32; MAX_SEATS],
    max_idle_pizzas: u32,
    max_turns: u32,
    players: u8,
    faces: u8,
    jokers: u8,
    hand: u8,
    deck: u8,
    exchange: bool,
    special_actions: bool,
    opening: Opening,
    opening_pass: bool,
    pass_scope: PassScope,
}

impl RuleSet {
    /// Number of players N, 2..=6.
    pub fn players(&self) -> usize {
        usize::from(self.players)
    }

    /// Number of faces F, 4..=15.
    pub fn faces(&self) -> u8 {
        self.faces
    }

    /// Number of jokers J, 0..=2.
    pub fn jokers(&self) -> u8 {
        self.jokers
    }

    /// When the game ends.
    pub fn stop(&self) -> Stop {
        self.stop
    }

    /// The same rules with another stop rule, whose number is at least 1.
    pub(crate) fn with_stop(self, stop: Stop) -> RuleSet {
        RuleSet { stop, ..self }
    }

    /// Points of a place, from 1; 0 for a place that does not exist.
    pub fn points(&self, place: u8) -> u32 {
        usize::from(place)
            .checked_sub(1)
            .and_then(|index| self.points.get(index))
            .copied()
            .unwrap_or(0)
    }

    /// Points by place, best first, N numbers.
    pub fn points_slice(&self) -> &[u32] {
        &self.points[..self.players()]
    }

    /// Whether cards are exchanged, from the second Shift on.
    pub fn exchange(&self) -> bool {
        self.exchange
    }

    /// Whether special actions may be declared.
    pub fn special_actions(&self) -> bool {
        self.special_actions
    }

    /// Who leads the first pizza of a Shift.
    pub fn opening(&self) -> Opening {
        self.opening
    }

    /// Whether the first turn of a Shift may be a pass.
    pub fn opening_pass(&self) -> bool {
        self.opening_pass
    }

    /// How long a pass counts.
    pub fn pass_scope(&self) -> PassScope {
        self.pass_scope
    }

    /// Consecutive pizzas without a play after which the next leader must play.
    pub fn max_idle_pizzas(&self) -> u32 {
        self.max_idle_pizzas
    }

    /// Turns after which a Shift is adjudicated.
    pub fn max_turns(&self) -> u32 {
        self.max_turns
    }

    /// Cards dealt to each hand H, 3..=61 (by default 17).
    pub fn hand_size(&self) -> u8 {
        self.hand
    }

    /// Cards in the deck, 10..=122 (by default 68).
    pub fn deck_size(&self) -> u8 {
        self.deck
    }

    /// The numbering of actions.
    pub fn actions(&self) -> ActionSpace {
        ActionSpace::of(self.faces)
    }

    /// The specification of this rule set, every field explicit.
    pub fn spec(&self) -> RuleSetSpec {
        RuleSetSpec {
            players: self.players,
            faces: self.faces,
            jokers: self.jokers,
            stop: self.stop,
            points: self.points_slice().to_vec(),
            exchange: self.exchange,
            special_actions: self.special_actions,
            opening: self.opening,
            opening_pass: self.opening_pass,
            pass_scope: self.pass_scope,
            max_idle_pizzas: self.max_idle_pizzas,
            max_turns: self.max_turns,
        }
    }
}
