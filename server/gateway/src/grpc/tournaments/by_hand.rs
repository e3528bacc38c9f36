//! What the calls share that change a tournament by hand: withdraw, remove, replace, pause, resume,
//! postpone, call again.

use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_tournament::ByHandProblem;
use tonic::{Code, Status};

use super::{TournamentCalls, join_problem, refused, stopped};
use crate::grpc::status::{field, request_id, request_id_used, status, ticket_unknown};
use chefshat_admission::access::Caller;
use chefshat_hosting::tournaments::{ByHand, ByHandRefusal, Newcomer, TournamentHandle};
use chefshat_room::ids::{SecretHash, Token, TournamentToken};
use chefshat_wire::convert;

impl TournamentCalls {
    /// The tournament, with the ticket of a participant; without a ticket, the owner asks.
    pub(super) async fn find_by_ticket_or_owner(
        &self,
        caller: &Caller,
        id: &str,
        ticket: &str,
        owner_token: &str,
    ) -> Result<(Arc<TournamentHandle>, Option<SecretHash>), Status> {
        if ticket.is_empty() {
            let handle = self.find_owned(caller, id, owner_token).await?;
            return Ok((handle, None));
        }
        let handle = self.find(&caller.showing(ticket), id).await?;
        let token = Token::parse(ticket).filter(|token| token.subject == handle.id());
        let token = token.filter(|token| handle.participant_of(&token.secret).is_some());
        let token = token.ok_or_else(ticket_unknown)?;
        // Whose it is then, is decided where the change is made.
        Ok((handle, Some(token.hash())))
    }
}

/// Who takes the place of a participant.
pub(super) fn newcomer(
    handle: &TournamentHandle,
    caller: &Caller,
    request: &v1::ReplaceParticipantRequest,
) -> Result<Newcomer, Status> {
    let agent = convert::agent_from_proto("built_in_agent", &request.built_in_agent)
        .map_err(|problem| refused(&problem))?;
    let shortest = usize::from(agent.is_none());
    let name = convert::checked_name("name", &request.name, shortest)
        .map_err(|problem| field("NAME_REFUSED", &problem))?;
    if let Some(agent) = agent {
        convert::check_budget("built_in_agent", agent).map_err(|problem| refused(&problem))?;
        if handle.read(|core| core.settings().physical_tables) > 0 {
            convert::check_real_cards("built_in_agent", agent)
                .map_err(|problem| refused(&problem))?;
        }
        return Ok(Newcomer::BuiltIn {
            agent,
            name,
            request_id: request_id(&request.request_id, caller)?,
        });
    }
    let kind = convert::kind_from_proto("kind", request.kind)
        .map_err(|problem| field("KIND_REFUSED", &problem))?;
    let is_at_table = handle.read(|core| {
        let former = core.participants().get(index(request.participant));
        former.is_some_and(|former| former.at_table)
    });
    if !is_at_table && kind.is_some_and(|kind| !handle.admits(kind)) {
        return Err(super::kind_not_admitted());
    }
    Ok(Newcomer::Somebody {
        name,
        kind,
        max_games: index(request.max_games.max(1)),
        stateless: request.stateless,
        request_id: request_id(&request.request_id, caller)?,
    })
}

/// Makes a change; returns the ticket of a participant who takes the place of another.
pub(super) async fn change(
    handle: &TournamentHandle,
    what: ByHand,
) -> Result<Option<TournamentToken>, Status> {
    let changed = handle.change_by_hand(what).await;
    changed.map_err(|refusal| match refusal {
        ByHandRefusal::Rules(problem) => by_hand_problem(problem),
        ByHandRefusal::RequestIdUsed => request_id_used(&refusal.to_string()),
        ByHandRefusal::TicketUnknown => ticket_unknown(),
        ByHandRefusal::Stopped(problem) => stopped(problem),
    })
}

fn by_hand_problem(problem: ByHandProblem) -> Status {
    let (code, reason) = match problem {
        ByHandProblem::Join(problem) => return join_problem(problem),
        ByHandProblem::NoParticipant => (Code::NotFound, "PARTICIPANT_UNKNOWN"),
        ByHandProblem::Filler => (Code::FailedPrecondition, "PARTICIPANT_IS_FILLER"),
        ByHandProblem::Over => (Code::FailedPrecondition, "TOURNAMENT_OVER"),
        ByHandProblem::NotPlaying => (Code::FailedPrecondition, "TOURNAMENT_NOT_PLAYING"),
        ByHandProblem::TooManyReplacements => (Code::FailedPrecondition, "REPLACED_TOO_OFTEN"),
        ByHandProblem::NoGame => (Code::NotFound, "GAME_UNKNOWN"),
        ByHandProblem::NotDue => (Code::FailedPrecondition, "GAME_NOT_DUE"),
        ByHandProblem::NotInGame => (Code::PermissionDenied, "NOT_IN_GAME"),
        ByHandProblem::PostponedTooOften(_) => (Code::FailedPrecondition, "POSTPONED_TOO_OFTEN"),
        ByHandProblem::NobodyLeft => (Code::FailedPrecondition, "NOBODY_LEFT"),
        ByHandProblem::TooMany(_) => (Code::ResourceExhausted, "TOO_MANY_CHANGES"),
    };
    status(code, reason, problem.to_string(), [])
}

/// A number of a message as an index; one too large finds nothing.
pub(super) fn index(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}
