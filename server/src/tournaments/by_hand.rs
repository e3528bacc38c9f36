//! Changes that participants and the organiser make by hand. `chefshat_tournament` decides whether
//! they are possible.

use chefshat_agents::NamedAgent;
use chefshat_tournament::{ByHandProblem, Entrant, MAX_GAMES_AT_A_TIME};

use super::handle::TournamentHandle;
use super::message::{ByHand, ByHandRefusal, Call, Message, Newcomer, Stopped};
use super::task::Task;
use crate::store::tournaments::TournamentEntry;
use chefshat_room::ids::Token;
use chefshat_room::journal::ParticipantKind;

impl TournamentHandle {
    /// Changes the tournament by hand. Returns the ticket of a new participant who connects.
    ///
    /// # Errors
    /// The server ends, or (inner result) the change is refused.
    pub async fn change_by_hand(
        &self,
        what: ByHand,
    ) -> Result<Result<Option<Token>, ByHandRefusal>, Stopped> {
        let over = match &what {
            ByHand::Withdraw { .. } | ByHand::Replace { .. } => ByHandProblem::Over,
            ByHand::SetPaused(_) | ByHand::Postpone { .. } | ByHand::Recall { .. } => {
                ByHandProblem::NotPlaying
            }
        };
        match self.ask(|reply| Message::ByHand(what, reply)).await {
            Err(Stopped) if self.is_over() => Ok(Err(over.into())),
            changed => changed,
        }
    }
}

impl Task {
    /// Makes a change by hand. Returns the ticket of a new participant who connects.
    pub(super) fn change_by_hand(&mut self, what: ByHand) -> Result<Option<Token>, ByHandRefusal> {
        let core = &self.state.core;
        match what {
            ByHand::Withdraw {
                participant,
                removed,
            } => {
                if let Some(change) = core.withdraw(participant, removed)? {
                    self.fold(change);
                    self.dismiss(participant);
                }
            }
            ByHand::Replace { participant, by } => return self.replace(participant, by),
            ByHand::SetPaused(paused) => {
                let change = core.set_paused(paused)?;
                self.fold_all(change.into_iter().collect());
            }
            ByHand::Postpone { game, by } => {
                let change = core.postpone(game, by)?;
                self.fold(change);
            }
            ByHand::Recall { game } => {
                let change = core.recall(game)?;
                self.fold(change);
            }
        }
        Ok(None)
    }

    fn replace(
        &mut self,
        participant: usize,
        by: Newcomer,
    ) -> Result<Option<Token>, ByHandRefusal> {
        let core = &self.state.core;
        let former = (core.participants().get(participant)).ok_or(ByHandProblem::NoParticipant)?;
        let (entrant, request_id) = match by {
            Newcomer::BuiltIn { agent, name } => {
                let name = match name.as_str() {
                    "" => self.name_of(agent, participant),
                    _ => name,
                };
                let entrant = Entrant {
                    name,
                    kind: ParticipantKind::Agent,
                    built_in: Some(agent),
                    filler: false,
                    stateless: true,
                    max_games: MAX_GAMES_AT_A_TIME,
                    at_table: false,
                };
                (entrant, None)
            }
            Newcomer::Somebody {
                name,
                kind,
                max_games,
                stateless,
                request_id,
            } => {
                let entrant = Entrant {
                    name,
                    kind: kind.unwrap_or(former.kind),
                    built_in: None,
                    filler: false,
                    stateless,
                    max_games,
                    at_table: former.at_table,
                };
                (entrant, request_id)
            }
        };
        let connects = entrant.built_in.is_none() && !entrant.at_table;
        let ticket = self.handle.ticket_with(request_id.as_ref());
        if let Some(known) = self.state.participant_of(&ticket.hash()) {
            let is_same = known == participant && core.participants()[known] == entrant;
            return match is_same {
                true => Ok(Some(ticket)),
                false => Err(ByHandRefusal::RequestIdUsed),
            };
        }
        let change = core.replace(participant, entrant)?;
        self.fold(change);
        self.dismiss(participant);
        if !connects {
            return Ok(None);
        }
        self.push(TournamentEntry::Ticket {
            participant,
            ticket: ticket.hash(),
        });
        Ok(Some(ticket))
    }

    /// A free name for a built-in agent.
    fn name_of(&self, agent: NamedAgent, place: usize) -> String {
        let core = &self.state.core;
        let numbered = (2..).map(|number| format!("{agent} {number}"));
        std::iter::once(agent.name())
            .chain(numbered)
            .find(|name| !core.is_name_taken(name, Some(place)))
            .expect("there are more numbers than participants")
    }

    /// Ends the stream of a participant who has left, once that is committed.
    fn dismiss(&mut self, participant: usize) {
        if let Some((_, connection)) = self.connections.remove(&participant) {
            self.replies.push(Box::new(move || {
                connection.call(Call::Over);
            }));
        }
        self.set_connection(participant, None);
    }
}
