//! Batches of offline games on all cores. The result depends on the batch alone, never on the
//! number of threads: every game has its own seed and agents, and results are folded in the order
//! of the games.

use std::num::NonZeroU32;

use chefshat_engine::{
    ActionId, BySeat, Decision, Event, MAX_SEATS, MetricsRecorder, RewardScheme, RuleSet, Seat,
    Seed, ShiftMetrics, Standings,
};
use thiserror::Error;

use crate::BatchTable;
use crate::Progress;
use crate::fold::fold_in_order;
use chefshat_agents::is_wrong_action;
use chefshat_agents::{BuiltInAgent, Listener, NamedAgent, agent_seed, game_seed, play_agents};
use chefshat_search::named_agent;

/// Games played by one thread at a time. Part of the result: it decides how rewards and scores are
/// grouped for summing.
const CHUNK: u64 = 32;

/// A number of games of built-in agents under one rule set.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct Batch {
    rules: RuleSet,
    agents: BySeat<NamedAgent>,
    games: u64,
    seed: u64,
    scheme: Option<RewardScheme>,
    max_invalid_attempts: Option<NonZeroU32>,
}

/// Why a batch is invalid.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum BatchError {
    /// The number of agents is not the number of seats.
    #[error("{given} agents for {players} players: give one for each seat")]
    Agents {
        /// Agents given.
        given: usize,
        /// Agents needed.
        players: usize,
    },
    /// No games.
    #[error("a batch of 0 games: play at least 1")]
    NoGames,
}

impl Batch {
    /// A batch of `games` games with `agents` by seat. `seed` determines all randomness. Without
    /// rewards and without a limit of invalid attempts.
    ///
    /// # Errors
    /// If there is not one agent for each seat, or `games` is 0.
    pub fn new(
        rules: RuleSet,
        agents: &[impl Into<NamedAgent> + Copy],
        games: u64,
        seed: u64,
    ) -> Result<Batch, BatchError> {
        let players = rules.players();
        let named: Vec<NamedAgent> = agents.iter().map(|&agent| agent.into()).collect();
        let agents = BySeat::from_slice(&named)
            .filter(|agents| agents.len() == players)
            .ok_or(BatchError::Agents {
                given: named.len(),
                players,
            })?;
        if games == 0 {
            return Err(BatchError::NoGames);
        }
        Ok(Batch {
            rules,
            agents,
            games,
            seed,
            scheme: None,
            max_invalid_attempts: None,
        })
    }

    /// Rewards turns by a scheme.
    pub fn with_rewards(self, scheme: RewardScheme) -> Batch {
        Batch {
            scheme: Some(scheme),
            ..self
        }
    }

    /// Takes the default decision after this many invalid attempts at one decision.
    pub fn with_max_invalid_attempts(self, attempts: NonZeroU32) -> Batch {
        Batch {
            max_invalid_attempts: Some(attempts),
            ..self
        }
    }

    /// The rule set.
    pub fn rules(&self) -> &RuleSet {
        &self.rules
    }

    /// The agents by seat.
    pub fn agents(&self) -> &BySeat<NamedAgent> {
        &self.agents
    }

    /// Number of games.
    pub fn games(&self) -> u64 {
        self.games
    }

    /// The seed of all randomness.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The reward scheme, if any.
    pub fn scheme(&self) -> Option<RewardScheme> {
        self.scheme
    }

    /// Invalid attempts after which the default decision is taken; `None` for no limit.
    pub fn max_invalid_attempts(&self) -> Option<NonZeroU32> {
        self.max_invalid_attempts
    }

    /// The seed of a game, by its index from 0.
    pub fn game_seed(&self, index: u64) -> Seed {
        game_seed(self.seed, index)
    }

    /// Plays one game, by its index from 0, exactly as within the batch.
    pub fn play_game(&self, index: u64, listener: &mut impl Listener) -> Standings {
        let seed = self.game_seed(index);
        // An array, because agents with their generators are not `Copy`.
        let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let agent = self.agents.get(seat).copied().unwrap_or_default();
            named_agent(agent, &self.rules, agent_seed(seed, seat))
        });
        let attempts = self.max_invalid_attempts;
        play_agents(self.rules, seed, attempts, &mut agents, listener)
    }

    /// Plays all games on the current rayon pool and returns the totals. `progress` is called from
    /// any thread with the number of games finished since its last call.
    pub fn run(&self, progress: Progress<'_>) -> BatchTable {
        self.fold(
            || BatchTable::empty(self.rules.players()),
            |table, index| {
                self.add_game(table, index);
                progress(1);
            },
            |table, chunk| table.merge(&chunk),
        )
    }

    /// Plays all games on the current rayon pool; returns how each ended, by its index. `progress`: as
    /// for [`Batch::run`].
    pub fn results(&self, progress: Progress<'_>) -> Vec<Standings> {
        let add = |results: &mut Vec<Standings>, index| {
            results.push(self.play_game(index, &mut Silent));
            progress(1);
        };
        self.fold(Vec::new, add, |results, part| results.extend(part))
    }

    /// Folds all games on the current rayon pool: `add` adds a game, by its index, to a value;
    /// `merge` merges the value of later games into it. Grouping and order depend on the number of
    /// games alone, so that sums of fractions are the same on every machine.
    pub fn fold<T: Send>(
        &self,
        empty: impl Fn() -> T + Sync,
        add: impl Fn(&mut T, u64) + Sync,
        merge: impl FnMut(&mut T, T),
    ) -> T {
        fold_in_order(self.games, CHUNK, empty, add, merge)
    }

    fn add_game(&self, table: &mut BatchTable, index: u64) {
        let mut adder = Adder {
            recorder: MetricsRecorder::new(self.rules, self.scheme),
            table,
            last_shift: None,
        };
        let standings = self.play_game(index, &mut adder);
        let last = adder.last_shift.expect("a game has at least one Shift");
        table.add_game_end(&standings, &last);
    }
}

/// Ignores all events.
pub(crate) struct Silent;

impl Listener for Silent {}

/// Adds a game to a table while it is played.
struct Adder<'t> {
    recorder: MetricsRecorder,
    table: &'t mut BatchTable,
    last_shift: Option<ShiftMetrics>,
}

impl Listener for Adder<'_> {
    fn on_event(&mut self, event: &Event) {
        if let Some(shift) = self.recorder.on_event(event) {
            self.table.add_shift(&shift);
            self.last_shift = Some(shift);
        }
    }

    fn on_decision(&mut self, _: Decision, _: ActionId) {
        self.table.decisions += 1;
    }

    fn on_invalid(&mut self, decision: Decision, _: ActionId) {
        if is_wrong_action(decision) {
            self.recorder.wrong(decision.seat);
        }
    }
}
