//! What happens to a tournament: who joins, what is drawn, which games are called, what comes of them. What follows from it is decided in
//! `course`; when it happens in `calls`.

use chefshat_agents::AgentKind;

/// What a participant is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum EntrantKind {
    /// A program.
    Agent,
    /// A person.
    Human,
    /// A robot.
    Robot,
}

/// Somebody who takes part, or wants to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entrant {
    /// Name to show; no two participants have the same.
    pub name: String,
    /// What it is.
    pub kind: EntrantKind,
    /// The built-in agent it is: always present, and as many games at a time as there are.
    pub built_in: Option<AgentKind>,
    /// Whether it only fills up tables.
    pub filler: bool,
    /// Whether it declared that it remembers nothing from one game to the next.
    pub stateless: bool,
    /// Games it can play at a time, 1..=64.
    pub max_games: usize,
}

/// A step of a tournament. Whoever keeps these can fold them again and has the tournament as it stood.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// Somebody joined; its number is how many joined before.
    Joined(Entrant),
    /// Nobody joins any more.
    Begun {
        /// Rounds in all.
        rounds: u32,
    },
    /// It is known who plays whom in a round. The games of its pairings follow those that were drawn before, table by table.
    Drawn {
        /// The round, from 1.
        round: u32,
        /// Participants by table, in the order of the seats of the pairing's first game.
        tables: Vec<Vec<usize>>,
        /// Participants who do not play in this round.
        byes: Vec<usize>,
    },
    /// A game is to be played now.
    Called {
        /// Which.
        game: usize,
        /// Its participants who do not play in it: a filler has their seats.
        forfeited: Vec<usize>,
    },
    /// A game could not begin, or not be played to its end. It waits again, after the others.
    Rescheduled {
        /// Which.
        game: usize,
        /// Those who did not come; empty if that was not the reason.
        missing: Vec<usize>,
    },
    /// A game has a result.
    Counted {
        /// Which.
        game: usize,
        /// The result.
        result: GameResult,
    },
    /// A game was given up; it counts for nobody.
    Voided {
        /// Which.
        game: usize,
    },
    /// All games have been played or given up.
    Finished,
    /// Closed before its end: what has been counted stays, the other games are given up.
    Closed,
}

/// What came of a game.
#[derive(Debug, Clone, PartialEq)]
pub struct GameResult {
    /// Shifts played.
    pub shifts: u32,
    /// By seat.
    pub seats: Vec<SeatResult>,
}

/// What came of a game for the participant of one seat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeatResult {
    /// Who.
    pub participant: usize,
    /// Did not come.
    pub forfeited: bool,
    /// What the game is worth to it; 0 if it forfeited.
    pub score: u32,
    /// What it did. Who forfeited did nothing, and has a place behind those who played.
    pub did: SeatPlayed,
}

/// What was done on one seat of a game.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SeatPlayed {
    /// Place in the game, from 1.
    pub place: usize,
    /// Points in the game.
    pub points: u64,
    /// A substitute took decisions.
    pub substituted: bool,
    /// Decisions taken by the participant itself, or lost.
    pub decisions: u64,
    /// Invalid actions.
    pub wrong_actions: u64,
    /// Decisions lost to the clock.
    pub timeouts: u64,
    /// Measured time of decisions, microseconds, in all.
    pub decision_time_us: u64,
    /// How many decisions were measured.
    pub timed_decisions: u64,
    /// Mean over the game's Shifts of 10 * points / pizzas.
    pub performance_score: f64,
}

/// How the playing of a called game ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Ended {
    /// With a result.
    Played {
        /// Shifts played.
        shifts: u32,
        /// By seat, whoever played there.
        seats: Vec<SeatPlayed>,
    },
    /// Not a card was dealt.
    NeverStarted {
        /// Participants who did not come; empty if that was not the reason.
        missing: Vec<usize>,
    },
    /// Cards were dealt, but there is no result.
    Aborted,
}

/// Where a game stands.
#[derive(Debug, Clone, PartialEq)]
pub enum GameState {
    /// It waits to be called.
    Due,
    /// It was called.
    Playing,
    /// It has a result, which counts.
    Counted(GameResult),
    /// It was given up.
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
    /// Participant of each seat.
    pub seats: Vec<usize>,
    /// Games with the same number are dealt alike; `None`: dealt anew. A game of [`Deals::SameAtAllTables`](super::Deals) that was aborted
    /// is dealt anew, since its participants have seen the deal.
    pub deal: Option<u32>,
    /// Where it stands.
    pub state: GameState,
    /// Times it was called, in vain or not.
    pub calls: u32,
    /// Participants who forfeited it.
    pub forfeited: Vec<usize>,
    /// Who did not come when it was last rescheduled.
    pub missing: Vec<usize>,
    /// Its turn among the games that are due.
    pub(super) turn: u64,
}

impl Game {
    /// Whether it has been counted or given up.
    pub fn is_over(&self) -> bool {
        matches!(self.state, GameState::Counted(_) | GameState::Void)
    }

    /// The result, once it is counted.
    pub fn result(&self) -> Option<&GameResult> {
        match &self.state {
            GameState::Counted(result) => Some(result),
            GameState::Due | GameState::Playing | GameState::Void => None,
        }
    }
}
