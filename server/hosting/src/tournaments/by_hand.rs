//! Changes that participants and the organiser make by hand. `chefshat_tournament` decides whether
//! they are possible.

use chefshat_agents::NamedAgent;
use chefshat_tournament::{ByHandProblem, Entrant, Leaving, State};

use super::handle::TournamentHandle;
use super::message::{ByHand, ByHandRefusal, Call, Message, Newcomer, Who};
use super::state::TournamentState;
use super::task::TournamentTask;
use crate::journaled::Stopped;
use chefshat_admission::limits::Key;
use chefshat_room::ids::{SecretHash, TournamentToken};
use chefshat_store::tournaments::TournamentEntry;

/// Most participants of one caller who withdraw from a tournament before it begins, so that nobody
/// fills its journal by joining and withdrawing.
pub(super) const MAX_EARLY_WITHDRAWALS_OF_CALLER: u32 = 20;

impl TournamentHandle {
    /// Changes the tournament by hand. Returns the ticket of a new participant who connects.
    ///
    /// # Errors
    /// See [`ByHandRefusal`].
    pub async fn change_by_hand(
        &self,
        what: ByHand,
    ) -> Result<Option<TournamentToken>, ByHandRefusal> {
        let over = match &what {
            // A repeated request is answered in every state of the tournament.
            ByHand::Replace { participant, by } => {
                if let Some(answer) = self.replaced_before(*participant, by) {
                    return answer;
                }
                ByHandProblem::Over
            }
            ByHand::Withdraw { .. } | ByHand::Remove { .. } => ByHandProblem::Over,
            ByHand::SetPaused(_) | ByHand::Postpone { .. } | ByHand::Recall { .. } => {
                ByHandProblem::NotPlaying
            }
        };
        match self.ask(|reply| Message::ByHand(what, reply)).await {
            Err(Stopped) if self.is_over() => Err(over.into()),
            changed => changed?,
        }
    }

    fn replaced_before(
        &self,
        participant: usize,
        by: &Newcomer,
    ) -> Option<Result<Option<TournamentToken>, ByHandRefusal>> {
        let ticket = self.ticket_with(Some(by.request_id()?));
        self.committed().replaced_before(participant, by, ticket)
    }
}

impl TournamentState {
    /// The answer to an earlier request with the same id; `None` if the request is new.
    fn replaced_before(
        &self,
        participant: usize,
        by: &Newcomer,
        ticket: TournamentToken,
    ) -> Option<Result<Option<TournamentToken>, ByHandRefusal>> {
        let known = self.participant_of(&ticket.hash())?;
        let has = &self.core.participants()[known];
        let mut asked = by.entrant(has);
        if asked.name.is_empty() {
            asked.name.clone_from(&has.name);
        }
        let former = self.core.former(known);
        Some(
            match known == participant && asked == *has && !former.is_empty() {
                true => Ok(connects(has).then_some(ticket)),
                false => Err(ByHandRefusal::RequestIdUsed),
            },
        )
    }
}

/// Whether a participant connects with a ticket.
fn connects(entrant: &Entrant) -> bool {
    entrant.built_in.is_none() && !entrant.at_table
}

impl TournamentTask {
    /// Makes a change by hand. Returns the ticket of a new participant who connects.
    pub(super) fn change_by_hand(
        &mut self,
        what: ByHand,
    ) -> Result<Option<TournamentToken>, ByHandRefusal> {
        match what {
            ByHand::Withdraw { who, charged } => self.withdraw(who, charged)?,
            ByHand::Remove { participant } => self.leave(participant, Leaving::Removed)?,
            ByHand::Replace { participant, by } => return self.replace(participant, &by),
            ByHand::SetPaused(paused) => {
                let change = self.unit.state.core.set_paused(paused)?;
                self.fold_all(change.into_iter().collect());
            }
            ByHand::Postpone { game, by } => {
                let by = by.map(|ticket| self.ticket_holder(&ticket)).transpose()?;
                let change = self.unit.state.core.postpone(game, by)?;
                self.fold(change);
            }
            ByHand::Recall { game } => {
                let change = self.unit.state.core.recall(game)?;
                self.fold(change);
            }
        }
        Ok(None)
    }

    /// The participant who has this ticket now.
    fn ticket_holder(&self, ticket: &SecretHash) -> Result<usize, ByHandRefusal> {
        (self.unit.state.participant_of(ticket)).ok_or(ByHandRefusal::TicketUnknown)
    }

    fn withdraw(&mut self, who: Who, charged: Key) -> Result<(), ByHandRefusal> {
        let participant = match who {
            Who::Number(participant) => return self.leave(participant, Leaving::ByOrganiser),
            Who::Ticket(ticket) => self.ticket_holder(&ticket)?,
        };
        if self.unit.state.core.state() != State::Open {
            return self.leave(participant, Leaving::Itself);
        }
        let times = self.left_early.get(&charged).copied().unwrap_or_default();
        if times >= MAX_EARLY_WITHDRAWALS_OF_CALLER {
            return Err(ByHandProblem::TooMany(MAX_EARLY_WITHDRAWALS_OF_CALLER).into());
        }
        self.leave(participant, Leaving::Itself)?;
        self.left_early.insert(charged, times + 1);
        Ok(())
    }

    /// A participant leaves; nothing changes if it has left.
    fn leave(&mut self, participant: usize, leaving: Leaving) -> Result<(), ByHandRefusal> {
        if let Some(change) = self.unit.state.core.withdraw(participant, leaving)? {
            self.fold(change);
            self.dismiss(participant);
        }
        Ok(())
    }

    fn replace(
        &mut self,
        participant: usize,
        by: &Newcomer,
    ) -> Result<Option<TournamentToken>, ByHandRefusal> {
        let ticket = self.unit.handle.ticket_with(by.request_id());
        if let Some(answer) = self.unit.state.replaced_before(participant, by, ticket) {
            return answer;
        }
        let core = &self.unit.state.core;
        let former = (core.participants().get(participant)).ok_or(ByHandProblem::NoParticipant)?;
        let mut entrant = by.entrant(former);
        if let (Newcomer::BuiltIn { agent, .. }, "") = (by, entrant.name.as_str()) {
            entrant.name = self.name_of(*agent, participant);
        }
        let connects = connects(&entrant);
        let change = core.replace(participant, entrant)?;
        self.fold(change);
        self.dismiss(participant);
        if connects || by.request_id().is_some() {
            // If it does not connect, the ticket identifies repetitions of the request.
            self.unit.push(TournamentEntry::Ticket {
                participant,
                ticket: ticket.hash(),
            });
        }
        Ok(connects.then_some(ticket))
    }

    /// A free name for a built-in agent.
    fn name_of(&self, agent: NamedAgent, place: usize) -> String {
        let core = &self.unit.state.core;
        let numbered = (2..).map(|number| format!("{agent} {number}"));
        std::iter::once(agent.name())
            .chain(numbered)
            .find(|name| !core.is_name_taken(name, Some(place)))
            .expect("there are more numbers than participants")
    }

    /// Ends the stream of a participant who has left, once that is committed.
    fn dismiss(&mut self, participant: usize) {
        if let Some((_, connection)) = self.connections.remove(&participant) {
            self.unit.after_commit(move || {
                connection.call(Call::Over);
            });
        }
        self.set_connection(participant, None);
    }
}
