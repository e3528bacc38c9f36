//! The changes of a tournament and the values in them. `state` applies them; `calls` decides when
//! they follow.

use chefshat_agents::{NamedAgent, ParticipantKind};
use chefshat_engine::SeatStatistics;

/// A participant, or a candidate for joining.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entrant {
    /// Display name, unique in the tournament.
    pub name: String,
    /// The fingerprint of its name and key; empty if it has no key.
    pub name_fingerprint: String,
    /// The kind.
    pub kind: ParticipantKind,
    /// The built-in agent that plays. It is always present and plays any number of games at a time.
    pub built_in: Option<NamedAgent>,
    /// Whether it only fills tables up.
    pub filler: bool,
    /// Whether it declared that it remembers nothing between games.
    pub stateless: bool,
    /// Maximum number of games at a time, 1..=64.
    pub max_games: usize,
    /// Whether it plays at a physical table. Nobody connects for it: it is always present.
    pub at_table: bool,
}

/// Who had a place before somebody else took it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Former {
    /// The former participant.
    pub entrant: Entrant,
    /// Number of counted games of the place when it was replaced.
    pub games: u32,
}

/// A step of a tournament. Folding the same changes again restores the tournament.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// A participant joined. Its number is the count of those before it; the number of one that left
    /// is not used again.
    Joined(Entrant),
    /// A participant left, by itself or because its organiser removed it.
    Withdrawn {
        /// The participant.
        participant: usize,
        /// Whether the organiser removed it.
        removed: bool,
    },
    /// Somebody else took the place of a participant, with its results.
    Replaced {
        /// The participant.
        participant: usize,
        /// Who has the place from now on.
        by: Entrant,
    },
    /// No game is called until the tournament is resumed.
    Paused,
    /// Games are called again.
    Resumed,
    /// A game that is not being played was moved to the end of the queue.
    Postponed {
        /// The game.
        game: usize,
        /// The participant who asked for it; `None`: the organiser.
        by: Option<usize>,
    },
    /// A due or void game was moved to the front of the queue, with all its calls.
    Recalled {
        /// The game.
        game: usize,
    },
    /// The tournament began; joining is closed.
    Begun {
        /// Total number of rounds.
        rounds: u32,
    },
    /// A round was paired. Its games are appended to the list of games, table by table.
    Drawn {
        /// The round, from 1.
        round: u32,
        /// Participants by table, in the seat order of the pairing's first game.
        tables: Vec<Vec<usize>>,
        /// Participants with a bye.
        byes: Vec<usize>,
    },
    /// A game starts.
    Called {
        /// The game.
        game: usize,
        /// Participants who forfeit it; a filler takes their seats.
        forfeited: Vec<usize>,
    },
    /// A game could not start, or did not reach its end. It is queued again behind the others.
    Rescheduled {
        /// The game.
        game: usize,
        /// Participants who did not come; empty if there was another reason.
        missing: Vec<usize>,
        /// Whether it had not started although it was called, so nobody has seen its deal. `false`
        /// also if that is unknown.
        never_started: bool,
    },
    /// A game has a result.
    Counted {
        /// The game.
        game: usize,
        /// The result.
        result: GameResult,
    },
    /// A game was voided and does not count.
    Voided {
        /// The game.
        game: usize,
    },
    /// All games are counted or voided.
    Finished,
    /// Closed early: counted games stay, all others are voided.
    Closed,
}

/// The result of a game.
#[derive(Debug, Clone, PartialEq)]
pub struct GameResult {
    /// Shifts played.
    pub shifts: u32,
    /// By seat.
    pub seats: Vec<SeatResult>,
}

/// The result of a game for the participant of one seat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeatResult {
    /// The participant's number.
    pub participant: usize,
    /// Whether it forfeited.
    pub forfeited: bool,
    /// Tournament score of the game; 0 if it forfeited.
    pub score: u32,
    /// Its statistics. After a forfeit all zero, with a place behind those who played.
    pub statistics: SeatStatistics,
}

/// How a called game ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Ended {
    /// With a result.
    Played {
        /// Shifts played.
        shifts: u32,
        /// Statistics by seat.
        seats: Vec<SeatStatistics>,
    },
    /// The game never started.
    NeverStarted {
        /// Participants who did not come; empty if there was another reason.
        missing: Vec<usize>,
    },
    /// The game started but has no result.
    Aborted,
}

/// The state of a game.
#[derive(Debug, Clone, PartialEq)]
pub enum GameState {
    /// Waiting to be called.
    Due,
    /// Called and not ended.
    Playing,
    /// Counted with this result.
    Counted(GameResult),
    /// Given up.
    Void,
}

/// A game of a tournament.
#[derive(Debug, Clone, PartialEq)]
pub struct Game {
    /// Round, from 1.
    pub round: u32,
    /// Table of the round, from 1.
    pub table: u32,
    /// Number in the pairing, from 1.
    pub number: u32,
    /// Participants by seat.
    pub seats: Vec<usize>,
    /// Whether it needs a physical table: a participant plays at one.
    pub physical: bool,
    /// Games with the same number have the same deal; `None` is a deal of its own. After an abort
    /// under [`Deals::SameAtAllTables`](super::Deals) a game gets a new deal, because its
    /// participants have seen the old one.
    pub deal: Option<u32>,
    /// The state.
    pub state: GameState,
    /// Number of calls, including those without success.
    pub calls: u32,
    /// Participants who forfeited it.
    pub forfeited: Vec<usize>,
    /// Participants who did not come when it was last rescheduled.
    pub missing: Vec<usize>,
    /// Participants who withdrew or were replaced while it is or was being played. A substitute
    /// plays for them, and built-in agents play on.
    pub left: Vec<usize>,
    /// Participants who were replaced after its last call: of each, which of the former holders of its
    /// place (`Tournament::former`) was called.
    pub(super) former: Vec<(usize, usize)>,
    /// Participants who postponed it, as often as they did; `None`: the organiser.
    pub postponed: Vec<Option<usize>>,
    /// Participants who took the place of one that forfeited it while it is being played. If it is
    /// called again, they play.
    pub(super) forgiven: Vec<usize>,
    /// Whether participants may have seen its deal: it was called, and is not known to have never
    /// started.
    pub(super) dealt: bool,
    /// Position in the queue of due games.
    pub(super) turn: u64,
}

impl Game {
    /// Whether it is counted or void.
    pub fn is_over(&self) -> bool {
        matches!(self.state, GameState::Counted(_) | GameState::Void)
    }

    /// Whether a participant plays it: it has a seat, did not forfeit and has not left.
    pub fn is_played_by(&self, participant: usize) -> bool {
        let is_out = self.forfeited.contains(&participant) || self.left.contains(&participant);
        self.seats.contains(&participant) && !is_out
    }

    /// The result, if it is counted.
    pub fn result(&self) -> Option<&GameResult> {
        match &self.state {
            GameState::Counted(result) => Some(result),
            GameState::Due | GameState::Playing | GameState::Void => None,
        }
    }

    /// Whether it counts for ratings: it has a result, and every participant played it without a
    /// substitute and without hints.
    pub fn is_rated(&self) -> bool {
        self.result().is_some_and(|result| {
            let mut seats = result.seats.iter();
            seats.all(|seat| {
                let played = &seat.statistics;
                !seat.forfeited && !played.substituted && !played.hinted
            })
        })
    }
}
