//! `TournamentService`: checks requests, forwards them to the tournament, and converts the results.

use std::sync::Arc;

use chefshat_proto::v1::{
    self, tournament_service_client::TournamentServiceClient,
    tournament_service_server::TournamentService,
};
use chefshat_record::convert::FieldProblem;
use chefshat_tournament::{BeginProblem, ByHandProblem, JoinProblem, SettingsProblem, State};
use prost::Message as _;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;
use tonic::transport::Channel;
use tonic::{Code, Request, Response, Status};

use super::access::{check, opened};
use super::fields::{checked_kind, checked_name, name_fingerprint, request_id};
use super::follow::{self, Responses, compute_failed, follow};
use super::forward::Gateway;
use super::limits::make_way;
use super::lists::{self, Listing, Part};
use super::new_room::{supported_policy, too_long};
use super::pages;
use super::recorded::Recorded;
use super::status::{
    Refusal, field, kind_not_admitted, not_created, request_id_used, shutting_down, status,
    ticket_unknown,
};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{COST_OF_TOURNAMENT, CallLimits, FairSemaphore, Key};
use chefshat_base::metrics::StreamKind;
use chefshat_base::tasks::{LongTask, named};
use chefshat_hosting::config::MAX_FOLLOWERS;
use chefshat_hosting::tournaments::{
    BeginRefusal, ByHand, ByHandRefusal, CreateError, Entry, JoinRefusal, Leaderboard, Newcomer,
    Stopped, TableProblem, TournamentHandle, Tournaments, Who,
};
use chefshat_room::ids::{
    RequestKey, SecretHash, Token, TournamentId, TournamentToken, normal_code, random_bytes,
};
use chefshat_room::journal::ParticipantKind;
use chefshat_room::policy::ABSENCE_TIME_IN_TOURNAMENTS;
use chefshat_store::StoreError;
use chefshat_wire::convert::{self, Mirrored as _};

/// Most updates for followers, and most results, that are computed at a time.
const MAX_CONCURRENT_RESULTS: usize = 2;
/// Most games of a tournament in one page.
const MAX_GAMES_PAGE: u32 = 500;
/// Most rows of a leaderboard.
const MAX_LEADERBOARD_LINES: u32 = 1_000;

/// Default page size of games, and default number of rows of a leaderboard.
const DEFAULT_LINES: u32 = 100;

/// The service.
#[derive(Debug, Clone)]
pub struct TournamentCalls {
    tournaments: Arc<Tournaments>,
    recorded: Recorded,
    leaderboard: Arc<Leaderboard>,
    calls: Arc<CallLimits>,
    followers: Arc<FairSemaphore>,
    /// Permits to compute updates for followers.
    update_permits: Arc<Semaphore>,
    /// Permits to compute results.
    result_permits: Arc<Semaphore>,
    /// Cancelled when all streams must end.
    closing: CancellationToken,
}

impl TournamentCalls {
    /// Creates the service for these tournaments; `closing` ends its streams.
    pub fn new(
        tournaments: Arc<Tournaments>,
        recorded: Recorded,
        calls: Arc<CallLimits>,
        closing: CancellationToken,
    ) -> Self {
        let shares = recorded.rooms().shares();
        Self {
            calls,
            tournaments,
            leaderboard: Arc::new(Leaderboard::new(Arc::clone(recorded.rooms()))),
            recorded,
            followers: FairSemaphore::new(MAX_FOLLOWERS, shares),
            update_permits: Arc::new(Semaphore::new(MAX_CONCURRENT_RESULTS)),
            result_permits: Arc::new(Semaphore::new(MAX_CONCURRENT_RESULTS)),
            closing,
        }
    }

    async fn find(&self, caller: &Caller, id: &str) -> Result<Arc<TournamentHandle>, Status> {
        self.recorded.lookup().tournament(caller, id).await
    }

    /// The tournament, with the ticket of a participant; without a ticket, the owner asks.
    async fn find_by_ticket_or_owner(
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

    /// The tournament with a join code; if an id is given too, it must match. Wrong codes are
    /// charged, those of unknown tournaments too: whether a tournament is private or unknown makes
    /// no difference.
    async fn find_by_code(
        &self,
        caller: &Caller,
        id: &str,
        join_code: &str,
    ) -> Result<Arc<TournamentHandle>, Status> {
        let key = Key::of_caller(caller);
        self.calls.may_try_code(key).map_err(Refusal::from)?;
        let lookup = self.recorded.lookup();
        let found = match id {
            "" => lookup.tournament_here(join_code, key).await?,
            id => match TournamentId::parse(id) {
                Some(id) => lookup.tournament_here(id, key).await?,
                None => None,
            },
        };
        let code = normal_code(join_code);
        let has_code = |handle: &Arc<TournamentHandle>| handle.join_code() == code;
        let Some(handle) = found.filter(has_code) else {
            self.calls.wrong_code(key);
            if !id.is_empty() {
                self.find(caller, id).await?;
            }
            return Err(status(
                Code::PermissionDenied,
                "JOIN_CODE_WRONG",
                "no tournament has this join code; ask its owner for it",
                [("field", "join_code")],
            ));
        };
        check(caller, |caller| caller.reaches_tournament(handle.id()))?;
        Ok(handle)
    }

    async fn find_owned(
        &self,
        caller: &Caller,
        id: &str,
        owner_token: &str,
    ) -> Result<Arc<TournamentHandle>, Status> {
        let handle = self.find(&caller.showing(owner_token), id).await?;
        if handle.is_owner(owner_token) {
            return Ok(handle);
        }
        Err(status(
            Code::PermissionDenied,
            "OWNER_TOKEN_WRONG",
            "this is not the owner token that CreateTournament returned for this tournament",
            [("field", "owner_token")],
        ))
    }
}

/// The tournaments that a caller finds.
struct TournamentList<'a> {
    service: &'a TournamentCalls,
    caller: &'a Caller,
    message: &'a v1::ListTournamentsRequest,
    /// The state of those that are listed.
    state: Option<State>,
}

impl Listing for TournamentList<'_> {
    type Entry = v1::Tournament;
    type Response = v1::ListTournamentsResponse;

    async fn here(&self, before: Option<u64>) -> Result<Part<v1::Tournament>, Status> {
        let size = pages::page_size(self.message.page_size);
        let service = self.service;
        let mut found = (service.tournaments).newest(before, self.state, size + 1);
        let more = found.len() > size;
        found.truncate(size);
        let rest = found.last().map(|(last, _)| *last).filter(|_| more);
        let lookup = service.recorded.lookup();
        let entries = (found.iter())
            .filter(|(_, handle)| lookup.lists_tournament(self.caller, handle))
            .map(|(number, handle)| (*number, handle.describe_briefly()))
            .collect();
        Ok(Part { entries, rest })
    }

    async fn there(
        &self,
        gateway: &Gateway,
        channel: Channel,
        page_token: String,
    ) -> Result<Response<v1::ListTournamentsResponse>, Status> {
        let request = v1::ListTournamentsRequest {
            page_token,
            ..self.message.clone()
        };
        let mut service = TournamentServiceClient::new(channel);
        service.list_tournaments(gateway.request(request)).await
    }

    fn page(response: v1::ListTournamentsResponse) -> (Vec<v1::Tournament>, String) {
        (response.tournaments, response.next_page_token)
    }

    fn response(
        tournaments: Vec<v1::Tournament>,
        next_page_token: String,
    ) -> v1::ListTournamentsResponse {
        v1::ListTournamentsResponse {
            tournaments,
            next_page_token,
        }
    }

    fn created_at_ms(tournament: &v1::Tournament) -> u64 {
        tournament.created_at_ms
    }

    fn id(tournament: &v1::Tournament) -> &str {
        &tournament.tournament_id
    }
}

impl TournamentService for TournamentCalls {
    type FollowTournamentStream = Responses<v1::FollowTournamentResponse>;

    async fn create_tournament(
        &self,
        request: Request<v1::CreateTournamentRequest>,
    ) -> Result<Response<v1::CreateTournamentResponse>, Status> {
        let gateway: Option<Gateway> = request.extensions().get().cloned();
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let settings = request.settings.unwrap_or_default();
        let request_key = request_id(&request.request_id, &caller)?
            .map(|id| RequestKey::new(id, &settings.encode_to_vec()));
        let name = checked_name("name", &settings.name, 1)?;
        let mut plan = convert::tournament_plan(&settings, random_bytes()).map_err(refused)?;
        convert::check_budget("filler", plan.core.filler).map_err(refused)?;
        for agent in &plan.built_in {
            convert::check_budget("built_in_agents", *agent).map_err(refused)?;
        }
        if let Some(problem) = too_long(&plan.rules) {
            return Err(refused_within("rules", problem));
        }
        let asked = settings.policy.unwrap_or_default();
        plan.policy.durability = supported_policy(&self.recorded, &asked)
            .map_err(|problem| refused_within("policy", problem))?
            .durability;
        convert::set_default_clock_of_models(&mut plan.policy, &asked);
        plan.policy
            .set_default_absence_times(ABSENCE_TIME_IN_TOURNAMENTS);
        let lookup = self.recorded.lookup();
        lookup
            .check_created_here(request_key, key, gateway.as_ref())
            .await?;
        self.calls.charge(key, COST_OF_TOURNAMENT);
        let created = self.tournaments.create(&name, plan, request_key, key).await;
        if matches!(&created, Err(CreateError::Store(StoreError::Taken(_)))) {
            // Another node has created it meanwhile.
            lookup.check_not_created_elsewhere(request_key, key).await?;
        }
        let (handle, owner) = created.map_err(|problem| not_created(problem, settings_refused))?;
        Ok(Response::new(v1::CreateTournamentResponse {
            tournament: Some(handle.describe()),
            join_code: handle.join_code().to_owned(),
            owner_token: owner.to_text(),
        }))
    }

    async fn get_tournament(
        &self,
        request: Request<v1::GetTournamentRequest>,
    ) -> Result<Response<v1::GetTournamentResponse>, Status> {
        let (caller, request) = opened(request);
        let id = &request.tournament_id;
        let handle = match request.join_code.as_str() {
            "" => self.find(&caller, id).await?,
            code => self.find_by_code(&caller, id, code).await?,
        };
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::GetTournamentResponse { tournament }))
    }

    async fn list_tournaments(
        &self,
        request: Request<v1::ListTournamentsRequest>,
    ) -> Result<Response<v1::ListTournamentsResponse>, Status> {
        let caller = Caller::of(request.extensions());
        let (_, extensions, message) = request.into_parts();
        let state = State::from_proto("state", message.state)
            .map_err(|problem| field("STATE_REFUSED", &problem))?;
        let listing = TournamentList {
            service: self,
            caller: &caller,
            message: &message,
            state,
        };
        let size = pages::page_size(message.page_size);
        lists::list(&listing, &extensions, &message.page_token, size).await
    }

    async fn join_tournament(
        &self,
        request: Request<v1::JoinTournamentRequest>,
    ) -> Result<Response<v1::JoinTournamentResponse>, Status> {
        let (caller, request) = opened(request);
        let kind = checked_kind(request.kind)?.unwrap_or(ParticipantKind::Agent);
        let (id, code) = (&request.tournament_id, &request.join_code);
        let handle = self.find_by_code(&caller, id, code).await?;
        let name = checked_name("name", &request.name, 1)?;
        if !handle.admits(kind) {
            return Err(kind_not_admitted());
        }
        let entry = Entry {
            name_fingerprint: name_fingerprint(&name, &request.name_key)?,
            name,
            kind,
            max_games: index(request.max_games.max(1)),
            stateless: request.stateless,
            at_table: false,
            request_id: request_id(&request.request_id, &caller)?,
        };
        let (participant, ticket) = handle.join(entry).await.map_err(join_refused)?;
        Ok(Response::new(v1::JoinTournamentResponse {
            tournament: Some(handle.describe()),
            participant: convert::number(participant),
            ticket: ticket.to_text(),
        }))
    }

    async fn add_table_participant(
        &self,
        request: Request<v1::AddTableParticipantRequest>,
    ) -> Result<Response<v1::AddTableParticipantResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        let kind = checked_kind(request.kind)?.unwrap_or(ParticipantKind::Human);
        let name = checked_name("name", &request.name, 1)?;
        let entry = Entry {
            name,
            name_fingerprint: String::new(),
            kind,
            max_games: 1,
            stateless: false,
            at_table: true,
            request_id: request_id(&request.request_id, &caller)?,
        };
        let (participant, _) = handle.join(entry).await.map_err(join_refused)?;
        Ok(Response::new(v1::AddTableParticipantResponse {
            tournament: Some(handle.describe()),
            participant: convert::number(participant),
        }))
    }

    async fn get_physical_table(
        &self,
        request: Request<v1::GetPhysicalTableRequest>,
    ) -> Result<Response<v1::GetPhysicalTableResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        let game = index(request.game);
        let owner = handle.physical_room(game).map_err(table_problem)?;
        // It is created after its id is committed.
        if self.recorded.rooms().get(owner.subject).is_none() {
            return Err(table_problem(TableProblem::NotStarted));
        }
        Ok(Response::new(v1::GetPhysicalTableResponse {
            room_id: owner.subject.to_string(),
            table_ticket: Token::of_table(&owner).to_text(),
            owner_token: owner.to_text(),
        }))
    }

    async fn start_tournament(
        &self,
        request: Request<v1::StartTournamentRequest>,
    ) -> Result<Response<v1::StartTournamentResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        handle.begin().await.map_err(|refusal| {
            let reason = match refusal {
                BeginRefusal::Rules(BeginProblem::TooFew { .. }) => "TOO_FEW_PARTICIPANTS",
                BeginRefusal::Rules(BeginProblem::Started) => "TOURNAMENT_STARTED",
                BeginRefusal::Stopped(problem) => return stopped(problem),
            };
            status(Code::FailedPrecondition, reason, refusal.to_string(), [])
        })?;
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::StartTournamentResponse { tournament }))
    }

    async fn close_tournament(
        &self,
        request: Request<v1::CloseTournamentRequest>,
    ) -> Result<Response<v1::CloseTournamentResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        handle.close().await.map_err(stopped)?;
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::CloseTournamentResponse { tournament }))
    }

    async fn withdraw_participant(
        &self,
        request: Request<v1::WithdrawParticipantRequest>,
    ) -> Result<Response<v1::WithdrawParticipantResponse>, Status> {
        let (caller, request) = opened(request);
        let id = &request.tournament_id;
        let (handle, by) = self
            .find_by_ticket_or_owner(&caller, id, &request.ticket, &request.owner_token)
            .await?;
        let who = by.map_or_else(|| Who::Number(index(request.participant)), Who::Ticket);
        let charged = Key::of_caller(&caller);
        let what = ByHand::Withdraw { who, charged };
        change(&handle, what).await?;
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::WithdrawParticipantResponse {
            tournament,
        }))
    }

    async fn remove_participant(
        &self,
        request: Request<v1::RemoveParticipantRequest>,
    ) -> Result<Response<v1::RemoveParticipantResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        let what = ByHand::Remove {
            participant: index(request.participant),
        };
        change(&handle, what).await?;
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::RemoveParticipantResponse { tournament }))
    }

    async fn replace_participant(
        &self,
        request: Request<v1::ReplaceParticipantRequest>,
    ) -> Result<Response<v1::ReplaceParticipantResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        let what = ByHand::Replace {
            participant: index(request.participant),
            by: newcomer(&handle, &caller, &request)?,
        };
        let ticket = change(&handle, what).await?;
        Ok(Response::new(v1::ReplaceParticipantResponse {
            tournament: Some(handle.describe()),
            ticket: ticket.map_or_else(String::new, |ticket| ticket.to_text()),
        }))
    }

    async fn pause_tournament(
        &self,
        request: Request<v1::PauseTournamentRequest>,
    ) -> Result<Response<v1::PauseTournamentResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        change(&handle, ByHand::SetPaused(true)).await?;
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::PauseTournamentResponse { tournament }))
    }

    async fn resume_tournament(
        &self,
        request: Request<v1::ResumeTournamentRequest>,
    ) -> Result<Response<v1::ResumeTournamentResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        change(&handle, ByHand::SetPaused(false)).await?;
        let tournament = Some(handle.describe());
        Ok(Response::new(v1::ResumeTournamentResponse { tournament }))
    }

    async fn postpone_game(
        &self,
        request: Request<v1::PostponeGameRequest>,
    ) -> Result<Response<v1::PostponeGameResponse>, Status> {
        let (caller, request) = opened(request);
        let id = &request.tournament_id;
        let (handle, by) = self
            .find_by_ticket_or_owner(&caller, id, &request.ticket, &request.owner_token)
            .await?;
        let game = index(request.game);
        change(&handle, ByHand::Postpone { game, by }).await?;
        let game = handle.game_now(game);
        Ok(Response::new(v1::PostponeGameResponse { game }))
    }

    async fn call_game(
        &self,
        request: Request<v1::CallGameRequest>,
    ) -> Result<Response<v1::CallGameResponse>, Status> {
        let (caller, request) = opened(request);
        let (id, owner) = (&request.tournament_id, &request.owner_token);
        let handle = self.find_owned(&caller, id, owner).await?;
        let game = index(request.game);
        change(&handle, ByHand::Recall { game }).await?;
        let game = handle.game_now(game);
        Ok(Response::new(v1::CallGameResponse { game }))
    }

    async fn follow_tournament(
        &self,
        request: Request<v1::FollowTournamentRequest>,
    ) -> Result<Response<Self::FollowTournamentStream>, Status> {
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let handle = self.find(&caller, &request.tournament_id).await?;
        let what = "too many streams that follow tournaments";
        let place = follow::place(&self.followers, key, what)?;
        let permits = Arc::clone(&self.update_permits);
        let counted = self.recorded.rooms().metrics().stream(StreamKind::Follow);
        let (response, following) =
            follow::stream(self.closing.clone(), move |sender| async move {
                let _held = (place, counted);
                follow(&handle, &permits, &sender).await
            });
        tokio::spawn(named(LongTask::FollowTournament, following));
        Ok(response)
    }

    async fn get_tournament_results(
        &self,
        request: Request<v1::GetTournamentResultsRequest>,
    ) -> Result<Response<v1::GetTournamentResultsResponse>, Status> {
        make_way(request.extensions());
        let (caller, request) = opened(request);
        let handle = self.find(&caller, &request.tournament_id).await?;
        let results = handle.results(&self.result_permits).await;
        let results = results.map_err(compute_failed)?.message.clone();
        Ok(Response::new(results))
    }

    async fn list_tournament_games(
        &self,
        request: Request<v1::ListTournamentGamesRequest>,
    ) -> Result<Response<v1::ListTournamentGamesResponse>, Status> {
        let (caller, request) = opened(request);
        let handle = self.find(&caller, &request.tournament_id).await?;
        let after = pages::last_shown(&request.page_token)?;
        let from = after.map_or(0, |after| usize::try_from(after).unwrap_or(usize::MAX));
        let size = pages::size_within(request.page_size, DEFAULT_LINES, MAX_GAMES_PAGE);
        let mut games = handle.games(from, size + 1);
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
        make_way(request.extensions());
        let request = request.into_inner();
        checked_kind(request.kind)?;
        let limit = pages::size_within(request.limit, DEFAULT_LINES, MAX_LEADERBOARD_LINES);
        let ratings = self.leaderboard.ratings().await.map_err(compute_failed)?;
        Ok(Response::new(convert::leaderboard(
            &ratings,
            request.kind(),
            request.min_games,
            limit,
        )))
    }
}

pub(super) fn stopped(_: Stopped) -> Status {
    shutting_down()
}

/// The status for an invalid setting.
fn refused(problem: FieldProblem) -> Status {
    let reason = match problem.field {
        "rules" => "RULE_SET_REFUSED",
        "policy" => "POLICY_REFUSED",
        _ => "SETTINGS_REFUSED",
    };
    field(reason, &problem)
}

/// The status for an invalid field within a setting.
fn refused_within(outer: &'static str, problem: FieldProblem) -> Status {
    refused(FieldProblem::new(outer, problem.to_string()))
}

fn settings_refused(problem: SettingsProblem) -> Status {
    refused(FieldProblem::new(problem.field, problem.problem))
}

fn join_refused(refusal: JoinRefusal) -> Status {
    match refusal {
        JoinRefusal::Rules(problem) => join_problem(problem),
        JoinRefusal::RequestIdUsed => request_id_used(&refusal.to_string()),
        JoinRefusal::Stopped(problem) => stopped(problem),
    }
}

fn table_problem(problem: TableProblem) -> Status {
    let (code, reason) = match problem {
        TableProblem::Unknown => (Code::NotFound, "GAME_UNKNOWN"),
        TableProblem::NotPhysical => (Code::FailedPrecondition, "GAME_NOT_PHYSICAL"),
        TableProblem::NotStarted => (Code::FailedPrecondition, "GAME_NOT_STARTED"),
        TableProblem::Over => (Code::FailedPrecondition, "GAME_OVER"),
    };
    status(code, reason, problem.to_string(), [("field", "game")])
}

fn join_problem(problem: JoinProblem) -> Status {
    let (code, reason) = match problem {
        JoinProblem::Full => (Code::ResourceExhausted, "TOURNAMENT_FULL"),
        JoinProblem::Started => (Code::FailedPrecondition, "TOURNAMENT_STARTED"),
        JoinProblem::NameTaken => (Code::FailedPrecondition, "NAME_TAKEN"),
        JoinProblem::NameReserved => (Code::FailedPrecondition, "NAME_RESERVED"),
        JoinProblem::NoTables => (Code::FailedPrecondition, "NO_PHYSICAL_TABLES"),
        JoinProblem::NotStateless => (Code::FailedPrecondition, "NOT_STATELESS"),
        JoinProblem::MaxGames => (Code::InvalidArgument, "MAX_GAMES_REFUSED"),
    };
    status(code, reason, problem.to_string(), [])
}

/// Who takes the place of a participant.
fn newcomer(
    handle: &TournamentHandle,
    caller: &Caller,
    request: &v1::ReplaceParticipantRequest,
) -> Result<Newcomer, Status> {
    let agent =
        convert::agent_from_proto("built_in_agent", &request.built_in_agent).map_err(refused)?;
    let shortest = usize::from(agent.is_none());
    let name = checked_name("name", &request.name, shortest)?;
    if let Some(agent) = agent {
        convert::check_budget("built_in_agent", agent).map_err(refused)?;
        if handle.read(|core| core.settings().physical_tables) > 0 {
            convert::check_real_cards("built_in_agent", agent).map_err(refused)?;
        }
        return Ok(Newcomer::BuiltIn {
            agent,
            name,
            request_id: request_id(&request.request_id, caller)?,
        });
    }
    let kind = checked_kind(request.kind)?;
    let is_at_table = handle.read(|core| {
        let former = core.participants().get(index(request.participant));
        former.is_some_and(|former| former.at_table)
    });
    if !is_at_table && kind.is_some_and(|kind| !handle.admits(kind)) {
        return Err(kind_not_admitted());
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
async fn change(
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
fn index(number: u32) -> usize {
    usize::try_from(number).unwrap_or(usize::MAX)
}
