//! A tournament as a value: who takes part, who plays whom and when, who is waited for, what counts, how all stand. It moves by changes:
//! whoever holds a tournament asks it for the next one, keeps it, folds it, and can fold all of them again at any time. There is no clock,
//! no input or output, no thread here; rooms, connections and storage are the server's affair.
//!
//! ```
//! use chefshat_agents::AgentKind;
//! use chefshat_tournament::{Change, Deals, Ended, Entrant, EntrantKind, Format, SeatPlayed, Settings, State, Tournament};
//!
//! let mut tournament = Tournament::new(Settings {
//!     format: Format::Swiss,
//!     players: 4,
//!     points: vec![5, 3, 1, 0],
//!     rounds: Some(2),
//!     games_per_pairing: 1,
//!     deals: Deals::Independent,
//!     max_participants: 8,
//!     start_when_joined: None,
//!     no_show_ms: 60_000,
//!     max_calls: 2,
//!     max_parallel: 64,
//!     draw_seed: [7; 32],
//!     filler: AgentKind::Random,
//! })?;
//! for name in ["Ada", "Bo", "Cem", "Dia", "Eve"] {
//!     let kind = Some(AgentKind::Greedy);
//!     let joined = tournament.join(Entrant { name: name.to_owned(), kind: EntrantKind::Agent, built_in: kind, filler: false, stateless: true, max_games: 1 })?;
//!     tournament.fold(&joined);
//! }
//! for change in tournament.begin()? {
//!     tournament.fold(&change);
//! }
//! let mut now_ms = 0;
//! while let Some(change) = tournament.next(now_ms) {
//!     tournament.fold(&change);
//!     if let Change::Called { game, .. } = change {
//!         // Here a game would be played.
//!         let seats = (1..=4).map(|place| SeatPlayed { place, ..SeatPlayed::default() }).collect();
//!         let counted = tournament.ended(game, Ended::Played { shifts: 3, seats }).expect("it is being played");
//!         tournament.fold(&counted);
//!     }
//!     now_ms += 1;
//! }
//! assert_eq!(tournament.state(), State::Finished);
//! assert_eq!(tournament.standings().len(), 5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod calls;
mod chance;
mod change;
pub mod confidence;
mod course;
mod draw;
mod entry;
mod floor;
mod knockout;
mod rated;
pub mod ratings;
mod round_robin;
mod seats;
mod settings;
mod standings;
pub mod statistics;
mod swiss;

pub use change::{
    Change, Ended, Entrant, EntrantKind, Game, GameResult, GameState, SeatPlayed, SeatResult,
};
pub use confidence::{Neighbours, OrderConfidence, SURE, Scored, order_confidence};
pub use course::State;
pub use entry::{BeginProblem, JoinProblem};
pub use settings::{
    Deals, Format, MAX_GAMES, MAX_GAMES_AT_A_TIME, MAX_GAMES_PER_PAIRING, MAX_PARTICIPANTS,
    MAX_ROUNDS, MIN_PARTICIPANTS, Settings, SettingsProblem,
};
pub use standings::Standing;

use course::Course;
use draw::Drawing;
use floor::Floor;

/// A tournament. Two are equal if their changes have led them to the same course, whoever is present.
#[derive(Debug, Clone)]
pub struct Tournament {
    course: Course,
    floor: Floor,
    /// The rounds of a round robin, which are found together, until the last of them is drawn.
    plan: Option<Vec<Drawing>>,
}

impl PartialEq for Tournament {
    fn eq(&self, other: &Tournament) -> bool {
        self.course == other.course
    }
}

impl Tournament {
    /// A tournament that nobody has joined yet.
    ///
    /// # Errors
    /// If it cannot be held, with the field at fault.
    pub fn new(settings: Settings) -> Result<Tournament, SettingsProblem> {
        settings.check()?;
        Ok(Tournament {
            course: Course::new(settings),
            floor: Floor::default(),
            plan: None,
        })
    }

    /// Lets a change happen. It is not asked whether it follows; one that does not fit does nothing.
    pub fn fold(&mut self, change: &Change) {
        self.course.fold(change);
        self.floor.fold(&self.course, change);
    }

    /// Where it stands.
    pub fn state(&self) -> State {
        self.course.state
    }

    /// What it is to be.
    pub fn settings(&self) -> &Settings {
        &self.course.settings
    }

    /// Who takes part, by number.
    pub fn participants(&self) -> &[Entrant] {
        &self.course.participants
    }

    /// The first round that has games which are not over, else the last that was drawn; from 1, 0 before the first.
    pub fn round(&self) -> u32 {
        let waiting = self.course.games.iter().find(|game| !game.is_over());
        waiting.map_or(self.course.drawn, |game| game.round)
    }

    /// Rounds in all; 0 before it has begun.
    pub fn rounds(&self) -> u32 {
        self.course.rounds
    }

    /// The games that have been drawn, by number.
    pub fn games(&self) -> &[Game] {
        &self.course.games
    }

    /// Numbers of the games that have been called and not yet ended, in order.
    pub fn playing(&self) -> impl Iterator<Item = usize> {
        self.course.playing.iter().copied()
    }

    /// Games that have been counted or given up.
    pub fn games_over(&self) -> usize {
        self.course.over
    }

    /// Games in all; before it has begun, those it would have if it began now.
    pub fn games_expected(&self) -> usize {
        let joined = self.joined().max(MIN_PARTICIPANTS);
        self.course.settings.games_for(joined)
    }

    /// Whether what could tell this deal may be shown: all games that are dealt so are over.
    pub fn is_deal_open(&self, deal: u32) -> bool {
        self.course.deals.get(deal as usize) == Some(&0)
    }
}
