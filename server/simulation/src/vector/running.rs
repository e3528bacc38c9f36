//! A game being played, as a value: the engine's game with everything else that determines how it
//! continues. `slot` plays it.

use chefshat_engine::{
    ActionId, BySeat, Decision, Event, Game, Mask, MetricsRecorder, PlayedDecision, Seat, Seed,
};

use super::error::StateError;
use super::history::History;
use super::opponent::Opponent;
use super::terms::{Decisions, InvalidActions, Terms};
use chefshat_agents::{BuiltInAgent, agent_seed, is_wrong_action};

/// A game being played.
#[derive(Clone, Debug)]
pub(super) struct RunningGame {
    pub(super) seed: Seed,
    pub(super) game: Game,
    /// Agents by seat; empty if there are none. On the client's seats they take the decisions that
    /// the client does not. Networks are not among them: they have no state, and the setup has them.
    pub(super) agents: Box<[Option<BuiltInAgent>]>,
    /// Collects statistics of Shifts, if enabled.
    pub(super) recorder: Option<MetricsRecorder>,
    /// Rewards since each seat last decided.
    pub(super) rewards: BySeat<f32>,
    /// The decision open for the client.
    pub(super) open: Option<Open>,
    /// The events of the last decision.
    pub(super) events: Vec<Event>,
    /// Invalid attempts at the current decision, if records are enabled.
    pub(super) attempts: Vec<ActionId>,
    pub(super) decisions: Vec<PlayedDecision>,
    /// Number of decisions and attempts in `decisions`.
    pub(super) kept: u64,
    /// The actions of the Shift, if the setup asks for them.
    pub(super) history: Option<History>,
}

#[derive(Clone, Debug)]
pub(super) struct Open {
    pub(super) decision: Decision,
    pub(super) legal: Mask,
    pub(super) attempts: u32,
    /// The rewards shown in the row, until the client answers.
    pub(super) reward: f32,
}

impl Open {
    /// The open decision of a saved game.
    pub(super) fn resuming(
        game: &Game,
        terms: &Terms,
        attempts: u32,
        reward: f32,
    ) -> Result<Open, StateError> {
        let limit = match terms.invalid {
            InvalidActions::AskAgain { limit } => limit.map_or(u32::MAX, |limit| limit.get() - 1),
            InvalidActions::Error => 0,
        };
        let decision = game.decision().filter(|decision| {
            let asked = terms.decisions == Decisions::All || is_wrong_action(*decision);
            asked && terms.agents[decision.seat].is_none() && attempts <= limit
        });
        Ok(Open {
            decision: decision.ok_or(StateError::Malformed("the client has no such decision"))?,
            legal: game.legal_actions(),
            attempts,
            reward,
        })
    }
}

impl RunningGame {
    /// The built-in agents of a game with this seed, at its start.
    pub(super) fn agents(terms: &Terms, seed: Seed) -> Box<[Option<BuiltInAgent>]> {
        let others = match terms.decisions {
            Decisions::All | Decisions::Turns { others: None } => None,
            Decisions::Turns { others } => others,
        };
        let kind = |seat| match terms.agents.get(seat) {
            Some(Some(Opponent::BuiltIn(kind))) => Some(*kind),
            Some(Some(Opponent::Network(_))) => None,
            Some(None) | None => others,
        };
        let kinds = (0..terms.agents.len()).map(|index| (Seat::new(index), kind(Seat::new(index))));
        if kinds.clone().all(|(_, kind)| kind.is_none()) {
            return Box::default();
        }
        kinds
            .map(|(seat, kind)| kind.map(|kind| BuiltInAgent::new(kind, agent_seed(seed, seat))))
            .collect()
    }

    /// Replaces the agents by those of other terms. Seats with the same agent keep it as it is; another
    /// one begins here, from the game's seed. Rewards of a seat whose player changes begin with 0. If
    /// the open decision is no longer the client's, its attempts so far do not count.
    pub(super) fn reseat(&mut self, before: &Terms, here: &Terms) {
        let mut agents = RunningGame::agents(here, self.seed);
        for (seat, (agent, kept)) in agents.iter_mut().zip(&self.agents).enumerate() {
            if before.agents[Seat::new(seat)] == here.agents[Seat::new(seat)] {
                agent.clone_from(kept);
            }
        }
        self.agents = agents;
        for seat in here.agents.seats() {
            if before.agents[seat] != here.agents[seat] {
                self.rewards[seat] = 0.0;
            }
        }
        let is_theirs = |open: &mut Open| here.agents[open.decision.seat].is_some();
        self.open.take_if(is_theirs);
    }

    /// Deals later Shifts from another seed, from which agents choose at random as well.
    pub(super) fn reseed(&mut self, terms: &Terms, seed: Seed) {
        self.seed = seed;
        self.game.reseed(seed);
        self.agents = RunningGame::agents(terms, seed);
    }

    /// Keeps no decisions so far.
    pub(super) fn forget_decisions(&mut self) {
        self.attempts.clear();
        self.decisions.clear();
        self.kept = 0;
    }

    /// Whether the kept decisions lead from this start of the game to its state.
    pub(super) fn is_played_from(&self, mut game: Game) -> bool {
        let illegal = |game: &Game, attempts: &[ActionId]| {
            let legal = game.legal_actions();
            let size = game.rules().actions().size();
            (attempts.iter()).all(|attempt| !legal.contains(*attempt) && attempt.index() < size)
        };
        for taken in &self.decisions {
            let default = !taken.by_default
                || (game.default_action() == Some(taken.action) && !taken.attempts.is_empty());
            if !default
                || !illegal(&game, &taken.attempts)
                || game.apply(taken.action, |_| {}).is_err()
            {
                return false;
            }
        }
        game == self.game && illegal(&game, &self.attempts)
    }
}
