//! `TournamentService`: what is asked is checked and handed to the tournament; what it shows of itself is put into messages.

use std::pin::Pin;
use std::sync::Arc;

use chefshat_proto::v1::{self, tournament_service_server::TournamentService};
use chefshat_record::convert::FieldProblem;
use chefshat_tournament::{BeginProblem, JoinProblem};
use futures::Stream;
use prost::Message as _;
use tokio::sync::{Semaphore, mpsc};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Request, Response, Status};

use super::follow::{end, follow, not_worked_out};
use super::new_room::{kept_policy, too_long};
use super::pages;
use super::recorded::Recorded;
use super::status::{
    disk_nearly_full, field, request_id, request_id_used, shutting_down, status, store_failed,
};
use crate::config::{MAX_FOLLOWERS, MAX_GAMES_PAGE, MAX_LEADERBOARD_LINES, MAX_RESULTS_IN_HAND};
use crate::convert;
use crate::tournaments::{
    CreateProblem, Entry, JoinRefusal, Leaderboard, Stopped, TournamentHandle, Tournaments,
};
use chefshat_room::ids::{Id, RequestKey, random_bytes};
use chefshat_room::journal::ParticipantKind;

/// Games of a page, and lines of a leaderboard, where a request does not say.
const STANDARD_LINES: u32 = 100;

/// The service.
#[derive(Debug, Clone)]
pub struct TournamentCalls {
    tournaments: Arc<Tournaments>,
    recorded: Recorded,
    leaderboard: Arc<Leaderboard>,
    followers: Arc<Semaphore>,
    /// Turns to work out what followers are told.
    telling: Arc<Semaphore>,
    /// Turns to work out results.
    summing_up: Arc<Semaphore>,
    /// Cancelled when all streams are to end.
    closing: CancellationToken,
}

impl TournamentCalls {
    /// The service for these tournaments; `closing` ends its streams.
    pub fn new(
        tournaments: Arc<Tournaments>,
        recorded: Recorded,
        closing: CancellationToken,
    ) -> Self {
        Self {
            tournaments,
            leaderboard: Arc::new(Leaderboard::new(Arc::clone(recorded.rooms()))),
            recorded,
            followers: Arc::new(Semaphore::new(MAX_FOLLOWERS)),
            telling: Arc::new(Semaphore::new(MAX_RESULTS_IN_HAND)),
            summing_up: Arc::new(Semaphore::new(MAX_RESULTS_IN_HAND)),
            closing,
        }
    }

    fn find(&self, id: &str) -> Result<Arc<TournamentHandle>, Status> {
        (Id::parse(id).and_then(|id| self.tournaments.get(id))).ok_or_else(unknown)
    }

    /// The tournament of a join code; where an id is given too, it must be this tournament's.
    fn find_by_code(&self, id: &str, join_code: &str) -> Result<Arc<TournamentHandle>, Status> {
        let hosted = match id {
            "" => self.tournaments.by_code(join_code),
            id => Some(self.find(id)?)
                .filter(|hosted| chefshat_room::ids::normal_code(join_code) == hosted.join_code()),
        };
        hosted.ok_or_else(|| {
            status(
                Code::PermissionDenied,
                "JOIN_CODE_WRONG",
                "no tournament here has this join code; ask its owner for it",
                [("field", "join_code")],
            )
        })
    }

    fn find_own(&self, id: &str, owner_token: &str) -> Result<Arc<TournamentHandle>, Status> {
        let hosted = self.find(id)?;
        if hosted.is_owner(owner_token) {
            return Ok(hosted);
        }
        Err(status(
            Code::PermissionDenied,
            "OWNER_TOKEN_WRONG",
            "this is not the owner token that CreateTournament gave for this tournament",
            [("field", "owner_token")],
        ))
    }
}

#[tonic::async_trait]
impl TournamentService for TournamentCalls {
    type FollowTournamentStream =
        Pin<Box<dyn Stream<Item = Result<v1::FollowTournamentResponse, Status>> + Send>>;

    async fn create_tournament(
        &self,
        request: Request<v1::CreateTournamentRequest>,
    ) -> Result<Response<v1::CreateTournamentResponse>, Status> {
        let request = request.into_inner();
        let settings = request.settings.unwrap_or_default();
        let request_key = request_id(&request.request_id)?
            .map(|id| RequestKey::new(id, &settings.encode_to_vec()));
        let name = convert::name_to_show("name", &settings.name, 1)
            .map_err(|problem| field("NAME_REFUSED", &problem))?;
        let mut plan = convert::tournament_plan(&settings, random_bytes())
            .map_err(|problem| refused(&problem))?;
        if let Some(problem) = too_long(&plan.rules) {
            return Err(refused_within("rules", &problem));
        }
        let asked = settings.policy.unwrap_or_default();
        plan.policy.durability = kept_policy(&self.recorded, &asked)
            .map_err(|problem| refused_within("policy", &problem))?
            .durability;
        let (hosted, owner) = self
            .tournaments
            .create(&name, plan, request_key)
            .await
            .map_err(not_made)?;
        Ok(Response::new(v1::CreateTournamentResponse {
            tournament: Some(hosted.describe()),
            join_code: hosted.join_code().to_owned(),
            owner_token: owner.word(),
        }))
    }

    async fn get_tournament(
        &self,
        request: Request<v1::GetTournamentRequest>,
    ) -> Result<Response<v1::GetTournamentResponse>, Status> {
        let request = request.into_inner();
        let hosted = match request.join_code.as_str() {
            "" => self.find(&request.tournament_id)?,
            code => self.find_by_code(&request.tournament_id, code)?,
        };
        let tournament = Some(hosted.describe());
        Ok(Response::new(v1::GetTournamentResponse { tournament }))
    }

    async fn list_tournaments(
        &self,
        request: Request<v1::ListTournamentsRequest>,
    ) -> Result<Response<v1::ListTournamentsResponse>, Status> {
        let request = request.into_inner();
        let before = pages::last_shown(&request.page_token)?;
        let size = pages::page_size(request.page_size);
        let state = convert::tournament_state_from_proto("state", request.state)
            .map_err(|problem| field("STATE_REFUSED", &problem))?;
        let mut found = self.tournaments.newest(before, state, size + 1);
        let more = found.len() > size;
        found.truncate(size);
        let next_page_token = match found.last() {
            Some((last, _)) if more => last.to_string(),
            _ => String::new(),
        };
        let tournaments = (found.iter())
            .map(|(_, hosted)| hosted.describe_briefly())
            .collect();
        Ok(Response::new(v1::ListTournamentsResponse {
            tournaments,
            next_page_token,
        }))
    }

    async fn join_tournament(
        &self,
        request: Request<v1::JoinTournamentRequest>,
    ) -> Result<Response<v1::JoinTournamentResponse>, Status> {
        let request = request.into_inner();
        let kind = convert::kind_from_proto("kind", request.kind)
            .map_err(|problem| field("KIND_REFUSED", &problem))?
            .unwrap_or(ParticipantKind::Agent);
        let hosted = self.find_by_code(&request.tournament_id, &request.join_code)?;
        let name = convert::name_to_show("name", &request.name, 1)
            .map_err(|problem| field("NAME_REFUSED", &problem))?;
        if !hosted.admits(kind) {
            return Err(status(
                Code::FailedPrecondition,
                "KIND_NOT_ADMITTED",
                "this tournament admits other kinds of participants",
                [("field", "kind")],
            ));
        }
        let entry = Entry {
            name,
            kind,
            max_games: usize::try_from(request.max_games.max(1)).unwrap_or(usize::MAX),
            stateless: request.stateless,
            request_id: request_id(&request.request_id)?,
        };
        let (participant, ticket) = hosted
            .join(entry)
            .await
            .map_err(stopped)?
            .map_err(not_joined)?;
        Ok(Response::new(v1::JoinTournamentResponse {
            tournament: Some(hosted.describe()),
            participant: convert::number(participant),
            ticket: ticket.word(),
        }))
    }

    async fn start_tournament(
        &self,
        request: Request<v1::StartTournamentRequest>,
    ) -> Result<Response<v1::StartTournamentResponse>, Status> {
        let request = request.into_inner();
        let hosted = self.find_own(&request.tournament_id, &request.owner_token)?;
        let begun = hosted.begin().await.map_err(stopped)?;
        begun.map_err(|problem| {
            let reason = match problem {
                BeginProblem::TooFew { .. } => "TOO_FEW_PARTICIPANTS",
                BeginProblem::Started => "TOURNAMENT_STARTED",
            };
            status(Code::FailedPrecondition, reason, problem.to_string(), [])
        })?;
        let tournament = Some(hosted.describe());
        Ok(Response::new(v1::StartTournamentResponse { tournament }))
    }

    async fn close_tournament(
        &self,
        request: Request<v1::CloseTournamentRequest>,
    ) -> Result<Response<v1::CloseTournamentResponse>, Status> {
        let request = request.into_inner();
        let hosted = self.find_own(&request.tournament_id, &request.owner_token)?;
        hosted.close().await.map_err(stopped)?;
        let tournament = Some(hosted.describe());
        Ok(Response::new(v1::CloseTournamentResponse { tournament }))
    }

    async fn follow_tournament(
        &self,
        request: Request<v1::FollowTournamentRequest>,
    ) -> Result<Response<Self::FollowTournamentStream>, Status> {
        let hosted = self.find(&request.into_inner().tournament_id)?;
        let place = Arc::clone(&self.followers).try_acquire_owned();
        let place = place.map_err(|_| {
            status(
                Code::ResourceExhausted,
                "TOO_MANY_FOLLOWERS",
                "the server's tournaments are followed by as many as it can take",
                [("max_followers", &MAX_FOLLOWERS.to_string())],
            )
        })?;
        let (sender, responses) = mpsc::channel(1);
        let (closing, permits) = (self.closing.clone(), Arc::clone(&self.telling));
        let following = async move {
            let followed = follow(&hosted, &permits, &sender).await;
            // One that takes nothing in keeps nobody from following.
            drop(place);
            end(&sender, followed).await;
        };
        tokio::spawn(closing.run_until_cancelled_owned(following));
        Ok(Response::new(Box::pin(ReceiverStream::new(responses))))
    }

    async fn get_tournament_results(
        &self,
        request: Request<v1::GetTournamentResultsRequest>,
    ) -> Result<Response<v1::GetTournamentResultsResponse>, Status> {
        let hosted = self.find(&request.into_inner().tournament_id)?;
        let results = hosted.results(&self.summing_up).await;
        let results = results.map_err(not_worked_out)?.message.clone();
        Ok(Response::new(results))
    }

    async fn list_tournament_games(
        &self,
        request: Request<v1::ListTournamentGamesRequest>,
    ) -> Result<Response<v1::ListTournamentGamesResponse>, Status> {
        let request = request.into_inner();
        let hosted = self.find(&request.tournament_id)?;
        let after = pages::last_shown(&request.page_token)?;
        let from = after.map_or(0, |after| usize::try_from(after).unwrap_or(usize::MAX));
        let size = match request.page_size {
            0 => STANDARD_LINES,
            size => size.min(MAX_GAMES_PAGE),
        };
        let size = usize::try_from(size).unwrap_or(usize::MAX);
        let mut games = hosted.games(from, size + 1);
        let more = games.len() > size;
        games.truncate(size);
        let next_page_token = match more {
            true => (from + size).to_string(),
            false => String::new(),
        };
        Ok(Response::new(v1::ListTournamentGamesResponse {
            games,
            next_page_token,
        }))
    }

    async fn get_leaderboard(
        &self,
        request: Request<v1::GetLeaderboardRequest>,
    ) -> Result<Response<v1::GetLeaderboardResponse>, Status> {
        let request = request.into_inner();
        convert::kind_from_proto("kind", request.kind)
            .map_err(|problem| field("KIND_REFUSED", &problem))?;
        let limit = match request.limit {
            0 => STANDARD_LINES,
            limit => limit.min(MAX_LEADERBOARD_LINES),
        };
        let ratings = self.leaderboard.ratings().await.map_err(not_worked_out)?;
        Ok(Response::new(convert::leaderboard(
            &ratings,
            request.kind(),
            request.min_games,
            usize::try_from(limit).unwrap_or(usize::MAX),
        )))
    }
}

fn unknown() -> Status {
    status(
        Code::NotFound,
        "TOURNAMENT_UNKNOWN",
        "there is no such tournament here",
        [("field", "tournament_id")],
    )
}

fn stopped(_: Stopped) -> Status {
    shutting_down()
}

/// A field of the settings that cannot be accepted.
fn refused(problem: &FieldProblem) -> Status {
    let reason = match problem.field {
        "rules" => "RULE_SET_REFUSED",
        "policy" => "POLICY_REFUSED",
        _ => "SETTINGS_REFUSED",
    };
    field(reason, problem)
}

/// The same, of a field within a field, which is named in words.
fn refused_within(outer: &'static str, problem: &FieldProblem) -> Status {
    refused(&FieldProblem::new(outer, problem.to_string()))
}

fn not_made(problem: CreateProblem) -> Status {
    match problem {
        CreateProblem::Settings(problem) => {
            refused(&FieldProblem::new(problem.field, problem.problem))
        }
        CreateProblem::TooMany(limit) => status(
            Code::ResourceExhausted,
            "TOO_MANY_TOURNAMENTS",
            problem.to_string(),
            [("max_tournaments", &limit.to_string())],
        ),
        CreateProblem::RequestIdUsed => request_id_used(&problem.to_string()),
        CreateProblem::ShuttingDown => shutting_down(),
        CreateProblem::DiskNearlyFull => disk_nearly_full(&problem.to_string()),
        CreateProblem::Store(error) => {
            tracing::error!(%error, "a tournament was not made");
            store_failed()
        }
    }
}

fn not_joined(refusal: JoinRefusal) -> Status {
    let problem = match refusal {
        JoinRefusal::Rules(problem) => problem,
        JoinRefusal::RequestIdUsed => return request_id_used(&refusal.to_string()),
    };
    let (code, reason) = match problem {
        JoinProblem::Full => (Code::ResourceExhausted, "TOURNAMENT_FULL"),
        JoinProblem::Started => (Code::FailedPrecondition, "TOURNAMENT_STARTED"),
        JoinProblem::NameTaken => (Code::FailedPrecondition, "NAME_TAKEN"),
        JoinProblem::NotStateless => (Code::FailedPrecondition, "NOT_STATELESS"),
        JoinProblem::MaxGames => (Code::InvalidArgument, "MAX_GAMES_REFUSED"),
    };
    status(code, reason, problem.to_string(), [])
}
