//! Decisions of agents that search, and hints for other seats. A search takes long, so the core
//! only says what to search and takes what was found as an input. The journal has the decision
//! alone: after a restart of the server, the open one is searched again.

use std::time::Duration;

use chefshat_agents::MonteCarlo;
use chefshat_engine::{Event, Mask, Observation, Seat, Viewer};

use super::{
    Core, HintError, MAX_HINTS, MAX_SEARCH_TIME, OpenDecision, SEARCH_PATIENCE,
    SEARCH_PATIENCE_UNATTENDED, Search, Searched, State,
};
use crate::journal::{Change, Fill};
use crate::log::RoomEvent;

/// What to search, from what the seat knows alone.
#[derive(Debug, Clone)]
pub struct SearchRequest {
    /// The seat.
    pub seat: Seat,
    /// Number of the decision, per seat, from 1.
    pub decision: u64,
    /// How to search.
    pub plays: MonteCarlo,
    /// What the seat sees.
    pub observation: Observation,
    /// The legal actions.
    pub legal: Mask,
    /// The events of the Shift, as the seat saw them.
    pub history: Vec<Event>,
    /// The seed of the agent, the same for all its decisions.
    pub seed: [u8; 32],
    /// Hints that the seat was given for the decision.
    pub hints: u32,
    /// How long it may wait for a thread.
    pub patience: Duration,
}

impl Core {
    /// Starts the search for the open decision, if it needs one that has not been started.
    /// [`Core::searched`] takes the result.
    pub fn start_search(&mut self) -> Option<SearchRequest> {
        let (open, plays) = self.to_be_searched()?;
        if open.search != Search::NotStarted {
            return None;
        }
        let request = self.search_request(open, plays);
        if let Some(open) = &mut self.open {
            open.search = Search::Running;
        }
        Some(request)
    }

    fn search_request(&self, open: &OpenDecision, plays: MonteCarlo) -> SearchRequest {
        let seat = open.decision.seat;
        let observation = self.observe(Viewer::Seat(seat));
        SearchRequest {
            seat,
            decision: open.id,
            plays,
            observation: observation.expect("a decision is open"),
            legal: self.legal_actions(),
            history: self.shift_seen_by(seat),
            seed: self.header.seed.agent_seed(seat.index()),
            hints: open.hints,
            patience: self.search_patience(),
        }
    }

    fn search_patience(&self) -> Duration {
        match self.is_unattended() {
            true => SEARCH_PATIENCE_UNATTENDED,
            false => SEARCH_PATIENCE,
        }
    }

    /// When the agent of the open decision takes it at the latest.
    pub(super) fn decided_at(&self, open: &OpenDecision) -> Duration {
        let search = self.search_patience() + MAX_SEARCH_TIME;
        let search = self.awaits_search().then_some(search);
        open.released + self.wait_of(open).max(search.unwrap_or_default())
    }

    /// Starts a hint for the open decision of a seat. [`Core::hinted`] or [`Core::hint_ended`] takes
    /// its end.
    ///
    /// # Errors
    /// There is no hint for it now.
    pub fn start_hint(
        &mut self,
        seat: Seat,
        decision: u64,
        plays: MonteCarlo,
    ) -> Result<SearchRequest, HintError> {
        if !self.header.policy.hints || self.header.is_physical() {
            return Err(HintError::Off);
        }
        let open = self.awaited_from(seat).filter(|open| open.id == decision);
        let open = open.ok_or(HintError::Closed)?;
        if open.hint_runs || open.hints >= MAX_HINTS {
            return Err(HintError::TooMany);
        }
        let request = self.search_request(open, plays);
        if let Some(open) = &mut self.open {
            open.hint_runs = true;
        }
        Ok(request)
    }

    /// Records that a hint is given now.
    ///
    /// # Errors
    /// Its decision is closed.
    pub fn hinted(&mut self, now: Duration, seat: Seat, decision: u64) -> Result<(), HintError> {
        self.hint_ended(seat, decision);
        let awaited = self
            .awaited_from(seat)
            .is_some_and(|open| open.id == decision);
        if !awaited {
            return Err(HintError::Closed);
        }
        self.commit(now, Change::Hinted(seat));
        Ok(())
    }

    /// Takes the end of a hint that could not be computed.
    pub fn hint_ended(&mut self, seat: Seat, decision: u64) {
        if let Some(open) = &mut self.open
            && (open.decision.seat, open.id) == (seat, decision)
        {
            open.hint_runs = false;
        }
    }

    /// Takes the end of a search. The decision is then due like that of any built-in agent. Does
    /// nothing if another decision is open.
    pub fn searched(&mut self, seat: Seat, decision: u64, mut searched: Searched) {
        let legal = self.legal_actions();
        searched.action = searched.action.filter(|action| legal.contains(*action));
        if let Some(open) = &mut self.open
            && (open.decision.seat, open.id) == (seat, decision)
        {
            open.search = Search::Ended(searched);
        }
    }

    /// Whether the open decision waits for the end of a search.
    pub fn awaits_search(&self) -> bool {
        self.to_be_searched()
            .is_some_and(|(open, _)| !matches!(open.search, Search::Ended(_)))
    }

    /// The open decision, if an agent that searches takes it. It takes a silent one at once:
    /// otherwise the time of the next event would reveal it.
    fn to_be_searched(&self) -> Option<(&OpenDecision, MonteCarlo)> {
        let runs = self.state == State::Playing && !self.header.is_physical();
        let open = self
            .open
            .as_ref()
            .filter(|open| runs && !open.is_silent())?;
        let plays = self.search_of(open.decision.seat)?;
        let searched = self.next_taken_over().is_none() && self.legal_actions().len() > 1;
        searched.then_some((open, plays))
    }

    /// How the built-in agent or substitute of a seat searches, if it does.
    fn search_of(&self, seat: Seat) -> Option<MonteCarlo> {
        let state = &self.seats[seat.index()];
        let agent = match state.fill {
            _ if state.substituted => self.header.policy.substitute,
            Fill::BuiltIn(agent) => agent,
            Fill::Replay(_) if !self.header.recorded.contains_key(&seat.index()) => {
                self.header.policy.substitute
            }
            Fill::Replay(_) | Fill::Open { .. } | Fill::AtTable(_) => return None,
        };
        agent.search()
    }

    /// The events of the Shift in progress, as a seat saw them.
    fn shift_seen_by(&self, seat: Seat) -> Vec<Event> {
        (self.log.since(self.shift_start))
            .filter_map(|entry| match &entry.event {
                RoomEvent::Game(game) => Some(game.event.seen_by(Viewer::Seat(seat))),
                _ => None,
            })
            .collect()
    }
}
