//! What games of one owner are asked for with, checked once. Who asks, and in which words, is decided elsewhere.

use std::num::{NonZeroU32, NonZeroU64};
use std::sync::Arc;

use chefshat_engine::{BySeat, Game, RewardScheme, RuleSet, Script, ScriptError, Seat, Seed};
use thiserror::Error;

use super::MAX_SEATS_PLAYED;
use chefshat_agents::{AgentKind, game_seed};

/// What an episode is.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub enum Episode {
    /// A Shift.
    #[default]
    Shift,
    /// A game.
    Game,
}

/// Which decisions of its seats the owner takes.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub enum Decisions {
    /// All.
    #[default]
    All,
    /// Turns alone.
    Turns {
        /// The agent that takes the others; without one the default decision is taken.
        others: Option<AgentKind>,
    },
}

/// What becomes of an illegal action of the owner. A limit of attempts holds for built-in agents, too.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Default)]
pub enum InvalidActions {
    /// The step is refused.
    #[default]
    Error,
    /// It is counted and rewarded as an invalid attempt, and asked again.
    AskAgain {
        /// Attempts after which the default decision is taken; `None`: never.
        limit: Option<NonZeroU32>,
    },
}

/// Where the seeds of the games come from.
#[derive(Clone, Eq, PartialEq, Debug)]
pub enum Seeds {
    /// Game i has seed i of this number ([`game_seed`]).
    Base(u64),
    /// Game i has the seed i modulo their number; not empty.
    List(Arc<[Seed]>),
}

impl Seeds {
    fn of(&self, index: u64) -> Seed {
        match self {
            Seeds::Base(base) => game_seed(*base, index),
            Seeds::List(seeds) => seeds[(index % seeds.len() as u64) as usize],
        }
    }
}

/// How each game begins.
#[derive(Clone, Debug, Default)]
pub enum Start {
    /// With a deal.
    #[default]
    Deal,
    /// With these hands.
    Script(Box<Script>),
    /// As this game stands.
    Point {
        /// The game.
        game: Box<Game>,
        /// Whether the seed it has deals its later Shifts, too, and not each game's own.
        same_deals: bool,
    },
}

/// What games of one owner are asked for with. Made by [`VectorSetup::new`] and changed by its `with_` methods.
#[derive(Clone, Debug)]
pub struct VectorSetup {
    rules: RuleSet,
    games: u32,
    agents: BySeat<Option<AgentKind>>,
    scheme: Option<RewardScheme>,
    episode: Episode,
    decisions: Decisions,
    skip_forced: bool,
    invalid: InvalidActions,
    total_games: Option<NonZeroU64>,
    seeds: Seeds,
    start: Start,
    statistics: bool,
    records: bool,
}

/// Why games cannot be played.
#[derive(Clone, Eq, PartialEq, Debug, Error)]
pub enum SetupError {
    /// Not one entry for each seat.
    #[error("{given} seats are filled, but {players} play")]
    Seats {
        /// Entries given.
        given: usize,
        /// Seats there are.
        players: usize,
    },
    /// No seat of the owner.
    #[error("the client plays no seat: give it at least one")]
    NoClient,
    /// No games, or too many.
    #[error(
        "{games} games with {seats} of the client's seats: play at least 1 game, and at most {MAX_SEATS_PLAYED} games times seats"
    )]
    Games {
        /// Games asked for.
        games: u32,
        /// Seats of the owner.
        seats: usize,
    },
    /// Fewer games in all than at a time.
    #[error("{total} games in all are fewer than the {games} that are played side by side")]
    Total {
        /// Games in all.
        total: u64,
        /// Games at a time.
        games: u32,
    },
    /// No seeds.
    #[error("the list of seeds is empty: give at least one")]
    NoSeeds,
    /// Hands that do not make a game.
    #[error("{0}")]
    Script(#[from] ScriptError),
}

impl VectorSetup {
    /// So many games side by side, `agents` on the seats that the owner does not play. Standard in all else: no rewards, an episode is a
    /// Shift, the owner takes all decisions, an illegal action is an error, games are followed by others without end.
    ///
    /// # Errors
    /// If the numbers of games or seats are out of range.
    pub fn new(
        rules: RuleSet,
        games: u32,
        agents: &[Option<AgentKind>],
        seeds: Seeds,
    ) -> Result<VectorSetup, SetupError> {
        let players = rules.players();
        let agents = BySeat::from_slice(agents)
            .filter(|agents| agents.len() == players)
            .ok_or(SetupError::Seats {
                given: agents.len(),
                players,
            })?;
        let seats = agents.values().filter(|agent| agent.is_none()).count();
        if seats == 0 {
            return Err(SetupError::NoClient);
        }
        let played = u64::from(games) * seats as u64;
        if !(1..=u64::from(MAX_SEATS_PLAYED)).contains(&played) {
            return Err(SetupError::Games { games, seats });
        }
        if matches!(&seeds, Seeds::List(list) if list.is_empty()) {
            return Err(SetupError::NoSeeds);
        }
        Ok(VectorSetup {
            rules,
            games,
            agents,
            scheme: None,
            episode: Episode::default(),
            decisions: Decisions::default(),
            skip_forced: false,
            invalid: InvalidActions::default(),
            total_games: None,
            seeds,
            start: Start::Deal,
            statistics: false,
            records: false,
        })
    }

    /// The same, turns rewarded by a scheme.
    pub fn with_rewards(self, scheme: Option<RewardScheme>) -> VectorSetup {
        VectorSetup { scheme, ..self }
    }

    /// The same with another episode.
    pub fn with_episode(self, episode: Episode) -> VectorSetup {
        VectorSetup { episode, ..self }
    }

    /// The same; the owner takes these decisions.
    pub fn with_decisions(self, decisions: Decisions) -> VectorSetup {
        VectorSetup { decisions, ..self }
    }

    /// The same; whether decisions with one legal action are taken without asking.
    pub fn with_skip_forced(self, skip_forced: bool) -> VectorSetup {
        VectorSetup {
            skip_forced,
            ..self
        }
    }

    /// The same with another rule for illegal actions.
    pub fn with_invalid_actions(self, invalid: InvalidActions) -> VectorSetup {
        VectorSetup { invalid, ..self }
    }

    /// The same; so many games are played in all.
    ///
    /// # Errors
    /// If they are fewer than are played side by side.
    pub fn with_total_games(self, total: Option<NonZeroU64>) -> Result<VectorSetup, SetupError> {
        match total {
            Some(total) if total.get() < u64::from(self.games) => Err(SetupError::Total {
                total: total.get(),
                games: self.games,
            }),
            total_games => Ok(VectorSetup {
                total_games,
                ..self
            }),
        }
    }

    /// The same with other seeds.
    pub fn with_seeds(self, seeds: Seeds) -> VectorSetup {
        VectorSetup { seeds, ..self }
    }

    /// The same, begun otherwise.
    ///
    /// # Errors
    /// If the hands do not make a game of the rule set.
    pub fn with_start(self, start: Start) -> Result<VectorSetup, SetupError> {
        if let Start::Script(script) = &start {
            Game::scripted(self.rules, Seed([0; 32]), script, |_| {})?;
        }
        Ok(VectorSetup { start, ..self })
    }

    /// The same; whether batches tell of the Shifts that ended.
    pub fn with_statistics(self, statistics: bool) -> VectorSetup {
        VectorSetup { statistics, ..self }
    }

    /// The same; whether the decisions of games are kept until they end.
    pub fn with_records(self, records: bool) -> VectorSetup {
        VectorSetup { records, ..self }
    }

    /// The rule set.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// Games side by side.
    pub fn games(&self) -> u32 {
        self.games
    }

    /// The built-in agents by seat; `None` where the owner plays.
    pub fn agents(&self) -> &BySeat<Option<AgentKind>> {
        &self.agents
    }

    /// The seats of the owner, ascending.
    pub fn client_seats(&self) -> impl Iterator<Item = Seat> + '_ {
        self.agents
            .iter()
            .filter(|(_, agent)| agent.is_none())
            .map(|(seat, _)| seat)
    }

    /// The scheme of rewards, if there is one.
    pub fn scheme(&self) -> Option<RewardScheme> {
        self.scheme
    }

    /// What an episode is.
    pub fn episode(&self) -> Episode {
        self.episode
    }

    /// Which decisions the owner takes.
    pub fn decisions(&self) -> Decisions {
        self.decisions
    }

    /// Whether decisions with one legal action are taken without asking.
    pub fn skip_forced(&self) -> bool {
        self.skip_forced
    }

    /// What becomes of an illegal action.
    pub fn invalid_actions(&self) -> InvalidActions {
        self.invalid
    }

    /// Invalid attempts at one decision after which the default is taken, by agents of any kind; the largest number where there is no
    /// limit.
    pub(super) fn max_invalid_attempts(&self) -> u32 {
        match self.invalid {
            InvalidActions::AskAgain { limit: Some(limit) } => limit.get(),
            InvalidActions::AskAgain { limit: None } | InvalidActions::Error => u32::MAX,
        }
    }

    /// Whether batches tell of the Shifts that ended.
    pub fn statistics(&self) -> bool {
        self.statistics
    }

    /// Whether decisions are kept for records.
    pub fn keeps_records(&self) -> bool {
        self.records
    }

    /// Where the seeds come from.
    pub fn seeds(&self) -> &Seeds {
        &self.seeds
    }

    /// Whether there is a game of this index.
    pub(super) fn has_game(&self, index: u64) -> bool {
        self.total_games.is_none_or(|total| index < total.get())
    }

    /// The seed of a game, by its index.
    pub fn game_seed(&self, index: u64) -> Seed {
        self.seeds.of(index)
    }

    /// A game of this seed at its beginning.
    pub(super) fn begin(&self, seed: Seed) -> Game {
        match &self.start {
            Start::Deal => Game::new(self.rules, seed, |_| {}),
            Start::Script(script) => Game::scripted(self.rules, seed, script, |_| {})
                .expect("the script has been checked with these rules"),
            Start::Point { game, same_deals } => {
                let mut game = Game::clone(game);
                if !same_deals {
                    game.reseed(seed);
                }
                game
            }
        }
    }
}
