//! Tournaments as values: entry, pairings, calls of games, results and standings. A tournament
//! moves by changes: its owner asks for the next change, stores it and folds it. Folding the same
//! changes again gives the same tournament. There is no clock, IO or thread here; rooms,
//! connections and storage belong to the server.
//!
//! ```
//! use chefshat_agents::AgentKind;
//! use chefshat_tournament::{Change, Deals, Ended, Entrant, ParticipantKind, Format, SeatStatistics, Settings, State, Tournament};
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
//!     physical_tables: 0,
//!     draw_seed: [7; 32],
//!     filler: AgentKind::Random.into(),
//! })?;
//! for name in ["Ada", "Bo", "Cem", "Dia", "Eve"] {
//!     let kind = Some(AgentKind::Greedy.into());
//!     let joined = tournament.join(Entrant { name: name.to_owned(), name_fingerprint: String::new(), kind: ParticipantKind::Agent, built_in: kind, filler: false, stateless: true, max_games: 1, at_table: false })?;
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
//!         let seats = (1..=4).map(|place| SeatStatistics { place, ..SeatStatistics::default() }).collect();
//!         let counted = tournament.ended(game, Ended::Played { shifts: 3, seats }).expect("it is being played");
//!         tournament.fold(&counted);
//!     }
//!     now_ms += 1;
//! }
//! assert_eq!(tournament.state(), State::Finished);
//! assert_eq!(tournament.standings().len(), 5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod by_hand;
mod calls;
mod chance;
mod change;
pub mod confidence;
mod entry;
mod knockout;
mod pairing;
pub mod ratings;
mod round_robin;
mod scheduler;
mod seats;
mod settings;
mod standings;
mod state;
pub mod statistics;
mod swiss;
#[cfg(any(test, feature = "testing"))]
pub mod testing;

pub use by_hand::{
    ByHandProblem, Leaving, MAX_CHANGES_BY_HAND, MAX_EARLY_WITHDRAWALS, MAX_POSTPONEMENTS,
    MAX_REPLACEMENTS,
};
pub use change::{Change, Ended, Entrant, Former, Game, GameResult, GameState, SeatResult};
pub use chefshat_agents::ParticipantKind;
pub use chefshat_engine::SeatStatistics;
pub use confidence::{Neighbours, OrderConfidence, SURE, Scored, order_confidence};
pub use entry::{BeginProblem, JoinProblem};
pub use settings::{
    Deals, Format, MAX_GAMES, MAX_GAMES_AT_A_TIME, MAX_GAMES_PER_PAIRING, MAX_PARTICIPANTS,
    MAX_PHYSICAL_TABLES, MAX_ROUNDS, MIN_PARTICIPANTS, Settings, SettingsProblem,
};
pub use standings::Standing;
pub use state::State;

use scheduler::Scheduler;
use state::{Pairings, TournamentState};

/// A tournament. Two are equal if their changes have led to the same state; presence does not
/// matter.
#[derive(Debug, Clone)]
pub struct Tournament {
    state: TournamentState,
    scheduler: Scheduler,
    /// All rounds of a round robin, computed together and dropped when the last one is paired.
    plan: Option<Vec<Pairings>>,
}

impl PartialEq for Tournament {
    fn eq(&self, other: &Tournament) -> bool {
        self.state == other.state
    }
}

impl Tournament {
    /// A tournament without participants.
    ///
    /// # Errors
    /// Returns the first invalid setting.
    pub fn new(settings: Settings) -> Result<Tournament, SettingsProblem> {
        settings.check()?;
        Ok(Tournament {
            state: TournamentState::new(settings),
            scheduler: Scheduler::default(),
            plan: None,
        })
    }

    /// Applies a change. Does not check that the change follows; one that does not fit has no
    /// effect.
    pub fn fold(&mut self, change: &Change) {
        self.state.fold(change);
        self.scheduler.fold(&self.state, change);
    }

    /// The phase of the tournament.
    pub fn state(&self) -> State {
        self.state.phase
    }

    /// The settings.
    pub fn settings(&self) -> &Settings {
        &self.state.settings
    }

    /// Gives some participants, never built-in agents, another name, as if they had joined under
    /// it. Returns whether there were any.
    pub fn rename(&mut self, who: impl Fn(&Entrant) -> bool, to: &str) -> bool {
        let former = self.state.former.iter_mut().flatten();
        let former = former.map(|former| &mut former.entrant);
        let participants = self.state.participants.iter_mut().chain(former);
        let mut any = false;
        for entrant in participants.filter(|it| it.built_in.is_none() && who(it)) {
            to.clone_into(&mut entrant.name);
            entrant.name_fingerprint.clear();
            any = true;
        }
        any
    }

    /// The participants, by number.
    pub fn participants(&self) -> &[Entrant] {
        &self.state.participants
    }

    /// The first round with unfinished games, else the last round that was paired. From 1; 0 before
    /// the first.
    pub fn round(&self) -> u32 {
        let waiting = self.state.games.iter().find(|game| !game.is_over());
        waiting.map_or(self.state.drawn, |game| game.round)
    }

    /// Total number of rounds; 0 before the tournament begins.
    pub fn rounds(&self) -> u32 {
        self.state.rounds
    }

    /// All games of the rounds paired so far, by number.
    pub fn games(&self) -> &[Game] {
        &self.state.games
    }

    /// Numbers of the games that have been called and have not ended, ascending.
    pub fn playing(&self) -> impl Iterator<Item = usize> {
        self.state.playing.iter().copied()
    }

    /// Number of games that were counted or voided.
    pub fn games_over(&self) -> usize {
        self.state.over
    }

    /// Total number of games. Before the tournament begins: the number if it began now. In a Swiss
    /// tournament it shrinks when a round needs fewer tables, because participants have left.
    pub fn games_expected(&self) -> usize {
        let state = &self.state;
        let settings = &state.settings;
        if settings.format == Format::Swiss && state.drawn > 0 {
            let tables = state.field.len() / settings.players;
            let rounds = (state.rounds - state.drawn) as usize;
            return state.games.len() + rounds * tables * settings.games_of_pairing() as usize;
        }
        settings.games_for(self.joined().max(MIN_PARTICIPANTS))
    }

    /// Whether information about this deal may be published: all games with this deal are over.
    pub fn is_deal_open(&self, deal: u32) -> bool {
        self.state.deals.get(deal as usize) == Some(&0)
    }
}
