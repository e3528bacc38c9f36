//! Batches of offline games on all cores. What comes out depends on the batch alone, never on the number of threads: every game has its own
//! seed and agents, and results are folded in the order of the games. What is added up is decided in `table`.

use std::num::NonZeroU32;

use chefshat_engine::{
    ActionId, BySeat, Decision, Event, MAX_SEATS, MetricsRecorder, RewardScheme, RuleSet, Seat,
    Seed, ShiftMetrics, Standings,
};
use thiserror::Error;

use crate::BatchTable;
use crate::fold::fold_in_order;
use chefshat_agents::is_wrong_action;
use chefshat_agents::{AgentKind, BuiltInAgent, Listener, agent_seed, game_seed, play};

/// Games that one thread plays at a time. Part of the result: it decides in which groups rewards and scores are summed.
const CHUNK: u64 = 32;

/// A number of games of built-in agents under one rule set.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct Batch {
    rules: RuleSet,
    agents: BySeat<AgentKind>,
    games: u64,
    seed: u64,
    scheme: Option<RewardScheme>,
    max_invalid_attempts: Option<NonZeroU32>,
}

/// Why a batch cannot be played.
#[derive(Copy, Clone, Eq, PartialEq, Debug, Error)]
pub enum BatchError {
    /// Not one agent for each seat.
    #[error("{given} agents for {players} players: name one for each seat")]
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
    /// A batch of `games` games, all chance in it drawn from `seed`; `agents` by seat. Without rewards, and without a limit of invalid
    /// attempts.
    ///
    /// # Errors
    /// If there is not one agent for each seat, or no game to play.
    pub fn new(
        rules: RuleSet,
        agents: &[AgentKind],
        games: u64,
        seed: u64,
    ) -> Result<Batch, BatchError> {
        let players = rules.players();
        let agents = BySeat::from_slice(agents)
            .filter(|agents| agents.len() == players)
            .ok_or(BatchError::Agents {
                given: agents.len(),
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

    /// The same batch, its turns rewarded by a scheme.
    pub fn with_rewards(self, scheme: RewardScheme) -> Batch {
        Batch {
            scheme: Some(scheme),
            ..self
        }
    }

    /// The same batch; after so many invalid attempts at one decision the default is taken.
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
    pub fn agents(&self) -> &BySeat<AgentKind> {
        &self.agents
    }

    /// Number of games.
    pub fn games(&self) -> u64 {
        self.games
    }

    /// The number that all chance is drawn from.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The scheme of rewards, if there is one.
    pub fn scheme(&self) -> Option<RewardScheme> {
        self.scheme
    }

    /// After how many invalid attempts the default decision is taken; `None` is never.
    pub fn max_invalid_attempts(&self) -> Option<NonZeroU32> {
        self.max_invalid_attempts
    }

    /// The seed of a game, by its index from 0.
    pub fn game_seed(&self, index: u64) -> Seed {
        game_seed(self.seed, index)
    }

    /// Plays one game, by its index from 0, exactly as it is played within the batch.
    pub fn play_game(&self, index: u64, listener: &mut impl Listener) -> Standings {
        let seed = self.game_seed(index);
        // An array, because agents with their generators are no values to copy by seat.
        let mut agents: [BuiltInAgent; MAX_SEATS] = std::array::from_fn(|index| {
            let seat = Seat::new(index);
            let kind = self.agents.get(seat).copied().unwrap_or_default();
            BuiltInAgent::new(kind, agent_seed(seed, seat))
        });
        play(
            self.rules,
            seed,
            self.max_invalid_attempts,
            |seat, observation, legal| agents[seat.index()].decide(observation, legal),
            listener,
        )
    }

    /// Plays all games, on the threads of the rayon pool it is called in, and adds them up. `progress` is called from any of those threads,
    /// with the number of games that have been finished since it was last called.
    pub fn run(&self, progress: impl Fn(u64) + Sync) -> BatchTable {
        self.fold(
            || BatchTable::empty(self.rules.players()),
            |table, index| {
                self.add_game(table, index);
                progress(1);
            },
            |table, chunk| table.merge(&chunk),
        )
    }

    /// Folds all games on the threads of the rayon pool it is called in: `add` a game, by its index, to what the games just before it came
    /// to; `merge` what later games came to. Which games are added to which value, and the order of merging, depend on the number of games
    /// alone, so that sums of fractions come out the same on any machine.
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
