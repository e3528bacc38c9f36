//! Public, unlisted and private rooms and tournaments: who finds them and their records in lists,
//! who reaches them by their ids, and that what is private is answered exactly like what does not
//! exist. Every call is made for each visibility by each kind of caller: before the game, after its
//! end, and after a restart of the server.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Client, ConnectOptions, RandomAgent};
use chefshat_proto::v1::analysis_service_client::AnalysisServiceClient;
use chefshat_proto::v1::instrument_service_client::InstrumentServiceClient;
use chefshat_proto::v1::participation_service_client::ParticipationServiceClient;
use chefshat_proto::v1::play_service_client::PlayServiceClient;
use chefshat_proto::v1::record_service_client::RecordServiceClient;
use chefshat_proto::v1::room_service_client::RoomServiceClient;
use chefshat_proto::v1::server_service_client::ServerServiceClient;
use chefshat_proto::v1::spectator_service_client::SpectatorServiceClient;
use chefshat_proto::v1::study_service_client::StudyServiceClient;
use chefshat_proto::v1::table_service_client::TableServiceClient;
use chefshat_proto::v1::tournament_service_client::TournamentServiceClient;
use chefshat_proto::v1::vector_service_client::VectorServiceClient;
use chefshat_proto::v1::{
    self, Visibility, act_request, create_room_request::Start, record_line::Line, run_request,
    seat_command, seat_config, seat_update::Update, vector_setup,
};
use chefshat_room::ids::{RoomId, StudyId, Token, TournamentId, UnitId};
use chefshat_server::access::{
    AccessSettings, MAX_SECRETS, Mode, NewToken, Role, SECRET_HEADER, Scope, TokenFile,
};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::Host;
use chefshat_server::store::testing::{FailingStore, Read};
use chefshat_server::store::{SqliteStore, Store};
use chefshat_tests::{one_shift, patiently, random_agents, room_of_four};
use prost::Message as _;
use prost_types::field_descriptor_proto::Type;
use prost_types::{DescriptorProto, FileDescriptorSet};
use tempfile::TempDir;
use tokio_stream::iter;
use tonic::{Code, Request, Response, Status, Streaming};
use tonic_types::StatusExt as _;

use crate::studies::settings;

const VISIBILITIES: [Visibility; 3] = [
    Visibility::Public,
    Visibility::Unlisted,
    Visibility::Private,
];

/// The request id of a room that exists: other requests with it are refused, but only after the
/// records that they name were read.
const USED: [u8; 32] = [7; 32];

/// A server with a database, which can be restarted.
struct Server {
    folder: TempDir,
    settings: AccessSettings,
    host: Host,
}

impl Server {
    async fn start(settings: AccessSettings) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let host = host(folder.path(), &settings, ServerConfig::default().retention).await;
        Self {
            folder,
            settings,
            host,
        }
    }

    /// Ends the server and starts it again; rooms of games that ended longer than `retention` ago
    /// are gone.
    async fn restart(self, retention: Duration) -> Self {
        let Self {
            folder,
            settings,
            host: old,
        } = self;
        patiently("the server to stop", old.stop())
            .await
            .expect("a clean end");
        let host = host(folder.path(), &settings, retention).await;
        Self {
            folder,
            settings,
            host,
        }
    }

    fn token(&self, role: Role, scope: Option<Scope>) -> String {
        let created = TokenFile::of(self.folder.path()).create(NewToken {
            role,
            label: String::new(),
            lifetime: None,
            scope,
        });
        created.expect("the folder is writable").to_text()
    }

    /// A client with this token that shows these secrets.
    async fn client(&self, token: Option<&str>, secrets: &[&str]) -> Client {
        let options = ConnectOptions {
            token: token.map(str::to_owned),
            ca: None,
        };
        let connecting = Client::connect_with(self.host.url(), &options);
        let client = connecting.await.expect("the server listens");
        if token.is_some() {
            let known = async {
                let unknown =
                    |error: &chefshat_client::Error| error.reason() == Some("TOKEN_UNKNOWN");
                while (client.action_table(0).await).is_err_and(|error| unknown(&error)) {
                    tokio::time::sleep(Duration::from_millis(50)).await;
                }
            };
            patiently("the server to read the token", known).await;
        }
        client.with_secrets(secrets).expect("secrets")
    }
}

async fn host(folder: &Path, settings: &AccessSettings, retention: Duration) -> Host {
    let store = SqliteStore::open(folder).await.expect("a store");
    let config = ServerConfig {
        data_dir: Some(PathBuf::from(folder)),
        grace: Duration::ZERO,
        access: settings.clone(),
        retention,
        ..ServerConfig::default()
    };
    let host = Host::start(config, Arc::new(store)).await;
    host.expect("a free port")
}

fn mode(mode: Mode) -> AccessSettings {
    AccessSettings {
        mode: Some(mode),
        ..AccessSettings::default()
    }
}

/// The ids that calls are about.
#[derive(Debug, Clone)]
struct Ids {
    room: String,
    game: String,
    tournament: String,
}

impl Ids {
    fn unknown() -> Self {
        let [room, game, tournament] = [(); 3].map(|()| UnitId::random().to_string());
        Self {
            room,
            game,
            tournament,
        }
    }
}

/// A room with a tournament of the same visibility.
struct Subject {
    visibility: Visibility,
    ids: Ids,
    owners: [String; 2],
    tickets: Vec<String>,
    participant: String,
}

impl Subject {
    async fn new(host: &Client, visibility: Visibility) -> Self {
        let policy = v1::RoomPolicy {
            visibility: visibility.into(),
            ..v1::RoomPolicy::default()
        };
        let (created, tickets) = room_of_four(host, one_shift(), policy.clone()).await;
        let room = created.room.expect("a room");
        let settings = v1::TournamentSettings {
            name: "Coppa".into(),
            format: v1::TournamentFormat::RoundRobin.into(),
            rules: Some(one_shift()),
            rounds: 1,
            built_in_agents: vec!["random".into(); 3],
            policy: Some(policy),
            ..v1::TournamentSettings::default()
        };
        let tournament = host.create_tournament(settings).await;
        let tournament = tournament.expect("a tournament");
        let joined = host
            .join_tournament(v1::JoinTournamentRequest {
                join_code: tournament.join_code,
                name: "participant".into(),
                ..v1::JoinTournamentRequest::default()
            })
            .await
            .expect("joined");
        let described = tournament.tournament.expect("a tournament");
        assert_eq!(
            described
                .settings
                .and_then(|it| it.policy)
                .map(|it| it.visibility()),
            room.policy.map(|policy| policy.visibility()),
        );
        Self {
            visibility,
            ids: Ids {
                room: room.room_id,
                game: room.game_id,
                tournament: described.tournament_id,
            },
            owners: [created.owner_token, tournament.owner_token],
            tickets,
            participant: joined.ticket,
        }
    }

    /// Plays both to their ends. Returns the ids of the tournament's game.
    async fn play(&self, host: &Client) -> Ids {
        let [_, owner] = &self.owners;
        let tournament = &self.ids.tournament;
        let started = host.start_tournament(tournament, owner).await;
        started.expect("started");
        let agents = random_agents(self.tickets.clone());
        let playing = host.play_many(agents);
        for outcome in patiently("the game to end", playing).await {
            outcome.expect("the game ended");
        }
        let agent = |_: &v1::Attached| RandomAgent::new(1);
        let playing = host.play_tournament(&self.participant, agent);
        patiently("the tournament to end", playing)
            .await
            .expect("played");
        let owned = host.with_secrets([owner]).expect("a secret");
        let listed = owned
            .tournament_games(v1::ListTournamentGamesRequest {
                tournament_id: tournament.clone(),
                ..Default::default()
            })
            .await
            .expect("its games");
        let game = listed.games.first().expect("a game").clone();
        Ids {
            room: game.room_id,
            game: game.game_id,
            tournament: tournament.clone(),
        }
    }
}

/// Everybody who may ask about a subject, and whether they have shown that they belong to it.
async fn callers(
    server: &Server,
    subject: &Subject,
    other: &Subject,
) -> Vec<(&'static str, Client, bool)> {
    // Roles do not matter here: without a token all are hosts, or with one.
    let host = match server.settings.mode {
        Some(Mode::Tokens) => Some(server.token(Role::Host, None)),
        _ => None,
    };
    let host = host.as_deref();
    let admin = server.token(Role::Admin, None);
    let [room_owner, tournament_owner] = &subject.owners;
    let [room, _, tournament] = [
        &subject.ids.room,
        &subject.ids.game,
        &subject.ids.tournament,
    ]
    .map(|id| UnitId::parse(id).expect("an id"));
    let forged = [room, tournament].map(|id| Token::random(id).to_text());
    let (forged, others) = (forged.each_ref(), &other.tickets[0]);
    let ticket = &subject.tickets[2];
    vec![
        ("stranger", server.client(host, &[]).await, false),
        (
            "forged secrets",
            server.client(host, &forged.map(String::as_str)).await,
            false,
        ),
        (
            "another room's secrets",
            server
                .client(
                    host,
                    &[
                        others,
                        &other.owners[0],
                        &other.owners[1],
                        &other.participant,
                    ],
                )
                .await,
            false,
        ),
        (
            "tickets",
            server.client(host, &[ticket, &subject.participant]).await,
            true,
        ),
        (
            "owner",
            server.client(host, &[room_owner, tournament_owner]).await,
            true,
        ),
        ("admin", server.client(Some(&admin), &[]).await, true),
    ]
}

/// An answer without what differs from call to call.
#[derive(Debug, PartialEq, Eq)]
struct Answer {
    code: Code,
    message: String,
    reason: Option<String>,
    details: Vec<u8>,
    headers: BTreeMap<String, String>,
    /// What the call has read from the store, if that is counted.
    reads: Vec<Read>,
}

impl Answer {
    /// What does not depend on the game, as its length does.
    fn kind(&self) -> (Code, Option<&str>) {
        (self.code, self.reason.as_deref())
    }
}

/// What a call was answered, with the ids of the request left out.
fn answer<T>(result: Result<Response<T>, Status>, ids: &Ids) -> Answer {
    let status = result.err().unwrap_or_else(|| Status::ok(""));
    let without_ids = |bytes: &[u8]| {
        let mut text = bytes.to_vec();
        for id in [&ids.room, &ids.game, &ids.tournament] {
            let id = id.as_bytes();
            while let Some(at) = text.windows(id.len()).position(|part| part == id) {
                text[at..at + id.len()].fill(b'.');
            }
        }
        text
    };
    let headers = status.metadata().clone().into_headers();
    let headers = headers.iter().filter(|(name, _)| *name != "date");
    Answer {
        code: status.code(),
        reason: status.get_details_error_info().map(|info| info.reason),
        message: String::from_utf8(without_ids(status.message().as_bytes())).expect("a text"),
        details: without_ids(status.details()),
        headers: headers
            .map(|(name, value)| (name.to_string(), format!("{value:?}")))
            .collect(),
        reads: Vec::new(),
    }
}

/// A point beyond the end of a game: refused, but only after the record was read.
fn branch_point(ids: &Ids) -> v1::BranchPoint {
    v1::BranchPoint {
        game_id: ids.game.clone(),
        decisions: u64::MAX,
        same_deals: false,
    }
}

/// Every call that names something by its id, with the answers.
async fn asked(client: &Client, ids: &Ids) -> BTreeMap<&'static str, Answer> {
    asked_counting(client, ids, &Vec::new).await
}

/// As [`asked`]; `take_reads` says what was read from the store since it was called last.
async fn asked_counting(
    client: &Client,
    ids: &Ids,
    take_reads: &dyn Fn() -> Vec<Read>,
) -> BTreeMap<&'static str, Answer> {
    let mut rooms = RoomServiceClient::new(client.channel());
    let mut records = RecordServiceClient::new(client.channel());
    let mut tournaments = TournamentServiceClient::new(client.channel());
    let wrong = |id: &str| Token::random(UnitId::parse(id).expect("an id")).to_text();
    let mut answers = BTreeMap::new();
    let (room_id, tournament_id) = (&ids.room, &ids.tournament);
    macro_rules! ask {
        ($name:literal, $call:expr) => {
            take_reads();
            let called = patiently($name, $call).await;
            let reads = take_reads();
            let answer = Answer {
                reads,
                ..answer(called, ids)
            };
            assert!(answers.insert($name, answer).is_none(), $name);
        };
    }
    ask!(
        "GetRoom",
        rooms.get_room(v1::GetRoomRequest {
            room_id: room_id.clone(),
            ..Default::default()
        })
    );
    ask!(
        "RoomService/CloseRoom",
        rooms.close_room(v1::CloseRoomRequest {
            room_id: room_id.clone(),
            owner_token: wrong(room_id),
        })
    );
    ask!(
        "SetNextRoom",
        rooms.set_next_room(v1::SetNextRoomRequest {
            room_id: room_id.clone(),
            owner_token: wrong(room_id),
            join_code: "BCDF2345".into(),
            ticket: String::new(),
        })
    );
    let mut servers = ServerServiceClient::new(client.channel());
    ask!(
        "GetClock",
        servers.get_clock(v1::GetClockRequest {
            room_id: room_id.clone(),
        })
    );
    let mut instruments = InstrumentServiceClient::new(client.channel());
    ask!(
        "AddMarker",
        instruments.add_marker(v1::AddMarkerRequest {
            room_id: room_id.clone(),
            owner_token: wrong(room_id),
            label: "EEG on".into(),
            elapsed_us: None,
        })
    );
    ask!(
        "FollowMarkers",
        instruments.follow_markers(v1::FollowMarkersRequest {
            room_id: room_id.clone(),
            owner_token: wrong(room_id),
            from_number: 0,
        })
    );
    ask!(
        "AddSamples",
        instruments.add_samples(v1::AddSamplesRequest {
            owned_seat: None,
            ticket: wrong(room_id),
            chunk: Some(v1::SampleChunk::default()),
        })
    );
    ask!(
        "LeaveRoom",
        rooms.leave_room(v1::LeaveRoomRequest {
            ticket: wrong(room_id),
        })
    );
    let mut play = PlayServiceClient::new(client.channel());
    let act = |command| {
        let ticket = wrong(room_id);
        let request = v1::ActRequest { ticket, command };
        let mut play = play.clone();
        async move { play.act(request).await }
    };
    ask!(
        "Act",
        act(Some(act_request::Command::Answer(v1::Answer::default())))
    );
    ask!("Act, no command", act(None));
    let wizard = v1::Expression {
        source: v1::ExpressionSource::Wizard.into(),
        ..Default::default()
    };
    ask!(
        "Act, malformed expression",
        act(Some(act_request::Command::Express(wizard)))
    );
    let hint = v1::AskHint {
        request_id: vec![1],
        ..Default::default()
    };
    ask!(
        "Act, malformed hint",
        act(Some(act_request::Command::Hint(hint)))
    );
    ask!(
        "Act, hint",
        act(Some(act_request::Command::Hint(v1::AskHint::default())))
    );
    let attach = |id: &str| v1::Attach {
        ticket: wrong(id),
        ..Default::default()
    };
    let seats = vec![attach(room_id), attach(tournament_id)];
    let request = v1::PlayServiceWatchRequest { seats };
    ask!("PlayService/Watch", async {
        let watching = play.watch(request).await;
        refused(watching, 2).await
    });
    let commands = [attach(room_id), attach(tournament_id)].map(|attach| v1::SeatCommand {
        command: Some(seat_command::Command::Attach(attach)),
        ..Default::default()
    });
    let request = v1::PlayRequest {
        commands: commands.into(),
    };
    ask!("Play", async {
        let requests = tokio_stream::StreamExt::chain(iter([request]), tokio_stream::pending());
        let playing = play.play(requests).await;
        refused(playing, 2).await
    });
    let mut tables = TableServiceClient::new(client.channel());
    ask!(
        "Report",
        tables.report(v1::ReportRequest {
            table_ticket: wrong(room_id),
            ..Default::default()
        })
    );
    ask!(
        "TableService/Watch",
        tables.watch(v1::TableServiceWatchRequest {
            table_ticket: wrong(room_id),
        })
    );
    let mut spectators = SpectatorServiceClient::new(client.channel());
    ask!(
        "SpectatorService/Watch",
        spectators.watch(v1::SpectatorServiceWatchRequest {
            room_id: room_id.clone(),
            ..Default::default()
        })
    );
    ask!(
        "GetRecord",
        records.get_record(v1::GetRecordRequest {
            game_id: ids.game.clone(),
        })
    );
    ask!(
        "CreateRoom, branch",
        rooms.create_room(v1::CreateRoomRequest {
            start: Some(Start::Branch(branch_point(ids))),
            ..Default::default()
        })
    );
    let replayed = v1::SeatConfig {
        filled_by: Some(seat_config::FilledBy::Replay(v1::RecordedPlayer {
            game_id: ids.game.clone(),
            seat: 0,
        })),
        ..Default::default()
    };
    ask!(
        "CreateRoom, replay",
        rooms.create_room(v1::CreateRoomRequest {
            seats: vec![replayed; 4],
            request_id: USED.to_vec(),
            ..Default::default()
        })
    );
    ask!("Run, branch", run(client, ids));
    let mut analyses = AnalysisServiceClient::new(client.channel());
    let moment = v1::RecordedMoment {
        game_id: ids.game.clone(),
        decisions: u64::MAX,
    };
    ask!(
        "Evaluate",
        analyses.evaluate(v1::EvaluateRequest {
            position: Some(v1::evaluate_request::Position::Moment(moment.clone())),
            ..Default::default()
        })
    );
    ask!(
        "LegalActions",
        analyses.legal_actions(v1::LegalActionsRequest {
            moment: Some(moment),
        })
    );
    ask!(
        "GetTournament",
        tournaments.get_tournament(v1::GetTournamentRequest {
            tournament_id: tournament_id.clone(),
            ..Default::default()
        })
    );
    ask!(
        "FollowTournament",
        tournaments.follow_tournament(v1::FollowTournamentRequest {
            tournament_id: tournament_id.clone(),
        })
    );
    ask!(
        "GetTournamentResults",
        tournaments.get_tournament_results(v1::GetTournamentResultsRequest {
            tournament_id: tournament_id.clone(),
        })
    );
    ask!(
        "ListTournamentGames",
        tournaments.list_tournament_games(v1::ListTournamentGamesRequest {
            tournament_id: tournament_id.clone(),
            ..Default::default()
        })
    );
    ask!(
        "StartTournament",
        tournaments.start_tournament(v1::StartTournamentRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
        })
    );
    ask!(
        "TournamentService/CloseTournament",
        tournaments.close_tournament(v1::CloseTournamentRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
        })
    );
    ask!(
        "AddTableParticipant",
        tournaments.add_table_participant(v1::AddTableParticipantRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
            ..Default::default()
        })
    );
    ask!(
        "GetPhysicalTable",
        tournaments.get_physical_table(v1::GetPhysicalTableRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
            ..Default::default()
        })
    );
    ask!(
        "WithdrawParticipant",
        tournaments.withdraw_participant(v1::WithdrawParticipantRequest {
            tournament_id: tournament_id.clone(),
            ticket: wrong(tournament_id),
            ..Default::default()
        })
    );
    ask!(
        "RemoveParticipant",
        tournaments.remove_participant(v1::RemoveParticipantRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
            ..Default::default()
        })
    );
    ask!(
        "ReplaceParticipant",
        tournaments.replace_participant(v1::ReplaceParticipantRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
            ..Default::default()
        })
    );
    ask!(
        "PauseTournament",
        tournaments.pause_tournament(v1::PauseTournamentRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
        })
    );
    ask!(
        "ResumeTournament",
        tournaments.resume_tournament(v1::ResumeTournamentRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
        })
    );
    ask!(
        "PostponeGame",
        tournaments.postpone_game(v1::PostponeGameRequest {
            tournament_id: tournament_id.clone(),
            ticket: wrong(tournament_id),
            ..Default::default()
        })
    );
    ask!(
        "CallGame",
        tournaments.call_game(v1::CallGameRequest {
            tournament_id: tournament_id.clone(),
            owner_token: wrong(tournament_id),
            ..Default::default()
        })
    );
    answers
}

/// What a stream of seats is answered: the refusals of so many seats.
async fn refused<T: Seats>(
    answered: Result<Response<Streaming<T>>, Status>,
    seats: usize,
) -> Result<Response<()>, Status> {
    let mut responses = answered?.into_inner();
    let mut refusals = Vec::new();
    while refusals.len() < seats {
        let response = responses.message().await?;
        let updates = response.expect("the stream is open").updates();
        refusals.extend(
            (updates.into_iter()).filter_map(|update| match update.update {
                Some(Update::Refused(refused)) => Some((refused.reason, refused.message)),
                _ => None,
            }),
        );
    }
    Err(Status::unauthenticated(format!("{refusals:?}")))
}

/// A response of a stream of seats.
trait Seats {
    fn updates(self) -> Vec<v1::SeatUpdate>;
}

impl Seats for v1::PlayResponse {
    fn updates(self) -> Vec<v1::SeatUpdate> {
        self.updates
    }
}

impl Seats for v1::PlayServiceWatchResponse {
    fn updates(self) -> Vec<v1::SeatUpdate> {
        self.updates
    }
}

/// Starts a batch of games from a recorded one; the first message says whether that is allowed.
async fn run(client: &Client, ids: &Ids) -> Result<Response<()>, Status> {
    let setup = v1::VectorSetup {
        games: 1,
        start: Some(vector_setup::Start::Branch(branch_point(ids))),
        ..Default::default()
    };
    let request = v1::RunRequest {
        request: Some(run_request::Request::Setup(Box::new(setup))),
    };
    // The stream of requests stays open until the answer has come.
    let requests = tokio_stream::StreamExt::chain(iter([request]), tokio_stream::pending());
    let mut service = VectorServiceClient::new(client.channel());
    let mut responses = service.run(requests).await?.into_inner();
    responses.message().await?.expect("an answer");
    Ok(Response::new(()))
}

/// The calls that name something by its id, with a join code that is wrong.
async fn asked_with_codes(client: &Client, ids: &Ids) -> BTreeMap<&'static str, Answer> {
    let mut rooms = RoomServiceClient::new(client.channel());
    let mut tournaments = TournamentServiceClient::new(client.channel());
    let join_code = "BCDFGHJK".to_owned();
    let (room_id, tournament_id) = (ids.room.clone(), ids.tournament.clone());
    BTreeMap::from([
        (
            "GetRoom",
            answer(
                rooms
                    .get_room(v1::GetRoomRequest {
                        room_id: room_id.clone(),
                        join_code: join_code.clone(),
                    })
                    .await,
                ids,
            ),
        ),
        (
            "JoinRoom",
            answer(
                rooms
                    .join_room(v1::JoinRoomRequest {
                        room_id,
                        join_code: join_code.clone(),
                        ..Default::default()
                    })
                    .await,
                ids,
            ),
        ),
        (
            "GetTournament",
            answer(
                tournaments
                    .get_tournament(v1::GetTournamentRequest {
                        tournament_id: tournament_id.clone(),
                        join_code: join_code.clone(),
                    })
                    .await,
                ids,
            ),
        ),
        (
            "JoinTournament",
            answer(
                tournaments
                    .join_tournament(v1::JoinTournamentRequest {
                        tournament_id,
                        join_code,
                        ..Default::default()
                    })
                    .await,
                ids,
            ),
        ),
    ])
}

/// A request that uses [`USED`] for another room.
fn used() -> v1::CreateRoomRequest {
    v1::CreateRoomRequest {
        request_id: USED.to_vec(),
        ..Default::default()
    }
}

/// The ids that each list has.
async fn lists(client: &Client) -> BTreeMap<&'static str, BTreeSet<String>> {
    let rooms = client.list_rooms(v1::ListRoomsRequest::default()).await;
    let rooms = rooms.expect("a list").rooms.into_iter();
    let tournaments = client
        .list_tournaments(v1::ListTournamentsRequest::default())
        .await;
    let tournaments = tournaments.expect("a list").tournaments.into_iter();
    let records = client.list_records(v1::ListRecordsRequest::default()).await;
    let records = records.expect("a list").records.into_iter();
    let mut streamed = BTreeSet::new();
    let mut stream = RecordServiceClient::new(client.channel())
        .stream_records(v1::StreamRecordsRequest::default())
        .await
        .expect("a stream")
        .into_inner();
    while let Some(part) = stream.message().await.expect("no error") {
        streamed.extend(part.lines.into_iter().filter_map(|line| match line.line {
            Some(Line::Header(header)) => Some(header.game_id),
            _ => None,
        }));
    }
    BTreeMap::from([
        ("ListRooms", rooms.map(|it| it.room_id).collect()),
        (
            "ListTournaments",
            tournaments.map(|it| it.tournament_id).collect(),
        ),
        ("ListRecords", records.map(|it| it.game_id).collect()),
        ("StreamRecords", streamed),
    ])
}

/// Compares what every caller gets for every subject with what it gets for the public one, if it
/// sees the subject, or for what does not exist.
async fn check(server: &Server, subjects: &[Subject], ids_of: impl Fn(usize) -> Ids, when: &str) {
    let public_ids = ids_of(0);
    for (index, subject) in subjects.iter().enumerate() {
        let other = &subjects[(index + 1) % subjects.len()];
        for (name, client, belongs) in callers(server, subject, other).await {
            let who = format!("{name}, {:?}, {when}", subject.visibility);
            // Each token has request ids of its own. Those that may create no room are refused.
            let _ = client.create_room(used()).await;
            let ids = ids_of(index);
            let reached = belongs || subject.visibility != Visibility::Private;
            let twin = match reached {
                true => public_ids.clone(),
                false => Ids::unknown(),
            };
            let expected = asked(&client, &twin).await;
            for (call, answer) in asked(&client, &ids).await {
                let who = format!("{call}, {who}");
                match reached {
                    true => assert_eq!(answer.kind(), expected[call].kind(), "{who}"),
                    // To the byte.
                    false => assert_eq!(answer, expected[call], "{who}"),
                }
            }
            let is_listed = belongs || subject.visibility == Visibility::Public;
            for (list, found) in lists(&client).await {
                let has = |ids: &Ids| {
                    let ids = [&ids.room, &ids.game, &ids.tournament];
                    ids.iter().any(|id| found.contains(*id))
                };
                assert_eq!(has(&ids), is_listed && has(&public_ids), "{list}, {who}");
            }
        }
    }
}

async fn everything_for_everybody(mode: AccessSettings) {
    let server = Server::start(mode).await;
    let host = match server.settings.mode {
        Some(Mode::Tokens) => Some(server.token(Role::Host, None)),
        _ => None,
    };
    let client = server.client(host.as_deref(), &[]).await;
    client.create_room(used()).await.expect("a room");
    let mut subjects = Vec::new();
    for visibility in VISIBILITIES {
        subjects.push(Subject::new(&client, visibility).await);
    }
    let first = |index: usize| subjects[index].ids.clone();
    check(&server, &subjects, first, "before").await;

    let mut games = Vec::new();
    for subject in &subjects {
        games.push(subject.play(&client).await);
    }
    // The rooms and records of tournaments are those of their tournaments.
    let called = |index: usize| games[index].clone();
    // Without tokens fewer ask, and of the same: in short runs each is looked at in one state less.
    let whole = host.is_some() || std::env::var_os("CHEFSHAT_SLOW").is_some();
    if whole {
        check(&server, &subjects, first, "after the end").await;
    }
    check(&server, &subjects, called, "a tournament's game").await;

    let server = server.restart(ServerConfig::default().retention).await;
    check(&server, &subjects, first, "after a restart").await;
    if whole {
        check(&server, &subjects, called, "a tournament's game, restarted").await;
    }
    // Only the records are left of the rooms.
    let server = server.restart(Duration::ZERO).await;
    check(&server, &subjects, first, "without rooms").await;
    check(
        &server,
        &subjects,
        called,
        "a tournament's game, without rooms",
    )
    .await;
}

#[tokio::test]
async fn on_an_open_server_each_sees_what_is_public_or_theirs() {
    everything_for_everybody(mode(Mode::Open)).await;
}

#[tokio::test]
async fn with_tokens_each_sees_what_is_public_or_theirs() {
    everything_for_everybody(mode(Mode::Tokens)).await;
}

#[tokio::test]
async fn a_wrong_join_code_does_not_tell_whether_an_id_is_private_or_unknown() {
    let server = Server::start(mode(Mode::Open)).await;
    let client = server.client(None, &[]).await;
    let [public, private] = [
        Subject::new(&client, Visibility::Public).await,
        Subject::new(&client, Visibility::Private).await,
    ];
    let stranger = asked_with_codes(&client, &private.ids).await;
    assert_eq!(stranger, asked_with_codes(&client, &Ids::unknown()).await);
    let secrets = [&private.tickets[0], &private.participant];
    let own = client.with_secrets(secrets).expect("secrets");
    let known = asked_with_codes(&own, &private.ids).await;
    assert_eq!(known, asked_with_codes(&own, &public.ids).await);
    assert_ne!(known, stranger);
}

/// The calls that name something by an id or a secret and are not in [`asked`] or
/// [`asked_with_codes`], and why.
const ASKED_ELSEWHERE: [(&str, &str); 4] = [
    ("AdminService/CloseRoom", "operators see everything"),
    ("AdminService/CloseTournament", "operators see everything"),
    (
        "CreateStudy",
        "no seat of a study replays a recorded player",
    ),
    (
        "ImportRecord",
        "an id belongs to one game: a record with it is refused",
    ),
];

/// The calls about a study, whose ids and secrets nobody else may know.
const OF_STUDIES: [&str; 20] = [
    "AddStudyParticipants",
    "AnswerQuestionnaire",
    "CloseStudy",
    "ContinueStudy",
    "DeleteStudy",
    "DeleteStudyParticipant",
    "ExportStudy",
    "FollowParticipation",
    "FollowStudy",
    "GetStudy",
    "GetStudyPicture",
    "GiveConsent",
    "JoinStudy",
    "ListStudies",
    "ListStudyLinks",
    "OpenStudy",
    "RecordTraces",
    "RemoveStudyParticipant",
    "SaveAnswers",
    "WithdrawFromStudy",
];

/// The calls of the protocol whose request names something by an id or a secret: its method, with
/// the service if several have one of this name.
fn naming() -> BTreeSet<String> {
    let set = FileDescriptorSet::decode(chefshat_proto::DESCRIPTORS).expect("descriptors");
    let messages: BTreeMap<String, &DescriptorProto> = (set.file.iter())
        .flat_map(|file| {
            let named = |it| {
                (
                    format!(".{}.{}", file.package(), DescriptorProto::name(it)),
                    it,
                )
            };
            file.message_type.iter().map(named)
        })
        .collect();
    let services = || {
        let services = set.file.iter().flat_map(|file| &file.service);
        services.flat_map(|service| service.method.iter().map(move |it| (service, it)))
    };
    let is_unique = |name| {
        services()
            .filter(|(_, method)| method.name() == name)
            .count()
            == 1
    };
    services()
        .filter(|(_, method)| names_something(method.input_type(), &messages, &mut BTreeSet::new()))
        .map(|(service, method)| match is_unique(method.name()) {
            true => method.name().to_owned(),
            false => format!("{}/{}", service.name(), method.name()),
        })
        .collect()
}

fn names_something(
    message: &str,
    messages: &BTreeMap<String, &DescriptorProto>,
    seen: &mut BTreeSet<String>,
) -> bool {
    const WORDS: [&str; 7] = [
        "_id", "ticket", "token", "tokens", "code", "link", "session",
    ];
    // A place in a list, and what a request is recognised by.
    const OTHERS: [&str; 2] = ["page_token", "request_id"];
    let Some(descriptor) = messages.get(message) else {
        return false;
    };
    seen.insert(message.to_owned())
        && descriptor.field.iter().any(|field| {
            let name = field.name();
            let is_name = field.r#type() == Type::String
                && WORDS.iter().any(|word| name.ends_with(word))
                && !OTHERS.contains(&name);
            is_name || names_something(field.type_name(), messages, seen)
        })
}

fn check_same(answers: &BTreeMap<&str, Answer>, expected: &BTreeMap<&str, Answer>) {
    for (call, answer) in answers {
        assert_eq!(answer, &expected[call], "{call}");
    }
}

#[tokio::test]
async fn no_more_is_read_of_what_is_private_than_of_what_does_not_exist() {
    let store = Arc::new(FailingStore::after(u64::MAX));
    let config = ServerConfig {
        grace: Duration::ZERO,
        access: mode(Mode::Open),
        ..ServerConfig::default()
    };
    let host = Host::start(config, Arc::clone(&store) as Arc<dyn Store>).await;
    let host = host.expect("a free port");
    let client = Client::connect(host.url()).await.expect("it listens");
    let public = Subject::new(&client, Visibility::Public).await;
    let private = Subject::new(&client, Visibility::Private).await;
    let take_reads = || store.take_reads();
    let unknown = asked_counting(&client, &Ids::unknown(), &take_reads).await;

    // While they run, and when they have ended.
    let running = asked_counting(&client, &private.ids, &take_reads).await;
    check_same(&running, &unknown);
    let public_game = public.play(&client).await;
    let private_game = private.play(&client).await;
    for ids in [&private.ids, &private_game] {
        let hidden = asked_counting(&client, ids, &take_reads).await;
        check_same(&hidden, &unknown);
    }
    // The reads are counted: whoever may see a record reads it.
    for (client, ids) in [
        (&client, &public.ids),
        (&client, &public_game),
        (
            &client.with_secrets([&private.owners[0]]).expect("a secret"),
            &private.ids,
        ),
    ] {
        let shown = asked_counting(client, ids, &take_reads).await;
        for call in ["GetRecord", "LegalActions", "Evaluate", "Run, branch"] {
            assert_eq!(shown[call].reads, [Read::Summary, Read::Game], "{call}");
            assert_eq!(unknown[call].reads, [Read::Summary], "{call}");
        }
    }

    // No call is forgotten.
    let with_codes = asked_with_codes(&client, &Ids::unknown()).await;
    let asked = unknown.keys().chain(with_codes.keys());
    let elsewhere = ASKED_ELSEWHERE.iter().map(|(call, _)| call);
    let all: BTreeSet<String> = (asked.chain(elsewhere).chain(&OF_STUDIES))
        .filter_map(|name| name.split(", ").next().map(str::to_owned))
        .collect();
    assert_eq!(naming(), all);
}

/// The calls about a study with these, with the answers.
async fn asked_of_study(
    client: &Client,
    (study_id, link, session): (&str, &str, &str),
) -> BTreeMap<&'static str, Answer> {
    let mut owner = StudyServiceClient::new(client.channel());
    let mut participant = ParticipationServiceClient::new(client.channel());
    let ids = Ids {
        room: study_id.to_owned(),
        ..Ids::unknown()
    };
    let mut answers = BTreeMap::new();
    macro_rules! ask {
        ($name:literal, $service:ident.$call:ident($request:ident { $($field:ident: $value:expr),* })) => {
            #[allow(clippy::needless_update, reason = "some requests have more fields")]
            let request = v1::$request {
                $($field: $value.to_owned(),)*
                ..Default::default()
            };
            let called = patiently($name, $service.$call(request)).await;
            answers.insert($name, answer(called, &ids));
        };
    }
    macro_rules! ask_owner {
        ($name:literal, $call:ident, $request:ident) => {
            let owner_token = Token::random(StudyId::parse(study_id).expect("an id")).to_text();
            ask!(
                $name,
                owner.$call($request {
                    study_id: study_id,
                    owner_token: owner_token
                })
            );
        };
    }
    ask_owner!("GetStudy", get_study, GetStudyRequest);
    ask_owner!(
        "AddStudyParticipants",
        add_study_participants,
        AddStudyParticipantsRequest
    );
    ask_owner!("ListStudyLinks", list_study_links, ListStudyLinksRequest);
    ask_owner!("FollowStudy", follow_study, FollowStudyRequest);
    ask_owner!(
        "RemoveStudyParticipant",
        remove_study_participant,
        RemoveStudyParticipantRequest
    );
    ask_owner!("CloseStudy", close_study, CloseStudyRequest);
    ask_owner!("ExportStudy", export_study, ExportStudyRequest);
    ask_owner!(
        "DeleteStudyParticipant",
        delete_study_participant,
        DeleteStudyParticipantRequest
    );
    ask_owner!("DeleteStudy", delete_study, DeleteStudyRequest);
    ask!(
        "JoinStudy",
        participant.join_study(JoinStudyRequest { open_link: link })
    );
    ask!(
        "OpenStudy",
        participant.open_study(OpenStudyRequest { link: link })
    );
    ask!(
        "GetStudyPicture",
        participant.get_study_picture(GetStudyPictureRequest { link: link })
    );
    ask!(
        "WithdrawFromStudy",
        participant.withdraw_from_study(WithdrawFromStudyRequest { link: link })
    );
    ask!(
        "FollowParticipation",
        participant.follow_participation(FollowParticipationRequest { session: session })
    );
    ask!(
        "GiveConsent",
        participant.give_consent(GiveConsentRequest { session: session })
    );
    ask!(
        "AnswerQuestionnaire",
        participant.answer_questionnaire(AnswerQuestionnaireRequest { session: session })
    );
    ask!(
        "ContinueStudy",
        participant.continue_study(ContinueStudyRequest { session: session })
    );
    ask!(
        "RecordTraces",
        participant.record_traces(RecordTracesRequest { session: session })
    );
    ask!(
        "SaveAnswers",
        participant.save_answers(SaveAnswersRequest { session: session })
    );
    let request = v1::ListStudiesRequest {
        owner_tokens: vec![Token::random(StudyId::parse(study_id).expect("an id")).to_text()],
    };
    let mut listed = owner.list_studies(request).await.expect("a list");
    assert_eq!(std::mem::take(&mut listed.get_mut().studies), []);
    answers.insert("ListStudies", answer(Ok(listed), &ids));
    assert!(answers.keys().copied().eq(OF_STUDIES), "{answers:?}");
    answers
}

#[tokio::test]
async fn a_wrong_secret_of_a_study_is_answered_like_an_unknown_study() {
    let server = Server::start(mode(Mode::Open)).await;
    let client = server.client(None, &[]).await;
    let mut studies = StudyServiceClient::new(client.channel());
    let request = v1::CreateStudyRequest {
        settings: Some(settings()),
        ..Default::default()
    };
    let created = studies
        .create_study(request)
        .await
        .expect("valid")
        .into_inner();
    let study = created.study.expect("a study");
    let request = v1::AddStudyParticipantsRequest {
        study_id: study.study_id.clone(),
        owner_token: created.owner_token,
        count: 1,
        ..Default::default()
    };
    let added = studies
        .add_study_participants(request)
        .await
        .expect("added");
    let link = &added.into_inner().links[0].link;
    let mut participants = ParticipationServiceClient::new(client.channel());
    let request = v1::OpenStudyRequest {
        link: link.clone(),
        ..Default::default()
    };
    let opened = participants.open_study(request).await.expect("opened");
    let session = opened.into_inner().session;
    // The first characters name the study, the last ones are the secret.
    let with = |text: &str, at: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes[at] = if bytes[at] == b'A' { b'B' } else { b'A' };
        String::from_utf8(bytes).expect("ASCII")
    };
    let (middle, end) = (link.len() - 4, session.len() - 4);
    let wrong = (
        &*study.study_id,
        &*with(link, middle),
        &*with(&session, end),
    );
    let unknown = (
        &*StudyId::random().to_string(),
        &*with(link, 0),
        &*with(&session, 0),
    );
    let wrong = asked_of_study(&client, wrong).await;
    check_same(&wrong, &asked_of_study(&client, unknown).await);
    for (call, answer) in wrong {
        assert_eq!(answer.code == Code::Ok, call == "ListStudies", "{call}");
    }
}

#[tokio::test]
async fn a_join_code_shows_a_private_room_and_lets_join() {
    let server = Server::start(mode(Mode::Open)).await;
    let client = server.client(None, &[]).await;
    let created = client
        .create_room(v1::CreateRoomRequest {
            policy: Some(v1::RoomPolicy {
                visibility: Visibility::Private.into(),
                ..Default::default()
            }),
            ..Default::default()
        })
        .await
        .expect("a room");
    let id = created.room.expect("a room").room_id;
    let request = v1::GetRoomRequest {
        join_code: created.join_code.clone(),
        ..Default::default()
    };
    let mut service = RoomServiceClient::new(client.channel());
    let shown = service
        .get_room(request)
        .await
        .expect("shown")
        .into_inner()
        .room;
    assert_eq!(shown.expect("a room").room_id, id);
    let joined = client.join_with_code(&created.join_code, "guest");
    let ticket = joined.await.expect("joined").ticket;
    // The owner needs no header to close it, nor does a player to leave it.
    client.get_room(&id).await.expect_err("no secret");
    client.leave_room(&ticket).await.expect("left");
    // The ticket is invalid now.
    let before = client.with_secrets([&ticket]).expect("a secret");
    before.get_room(&id).await.expect_err("not any more");
    let closed = client.close_room(&id, &created.owner_token).await;
    closed.expect("closed");
}

#[tokio::test]
async fn a_token_for_a_private_room_shows_it() {
    let server = Server::start(mode(Mode::Tokens)).await;
    let host = server.token(Role::Host, None);
    let client = server.client(Some(&host), &[]).await;
    let private = Subject::new(&client, Visibility::Private).await;
    let other = Subject::new(&client, Visibility::Private).await;
    let room = RoomId::parse(&private.ids.room).expect("an id");
    let room = Scope::Room(room);
    let token = server.token(Role::Spectator, Some(room));
    let scoped = server.client(Some(&token), &[]).await;
    scoped.get_room(&private.ids.room).await.expect("its room");
    let rooms = scoped.list_rooms(v1::ListRoomsRequest::default()).await;
    assert_eq!(rooms.expect("a list").rooms.len(), 1);
    // Not even that another private room exists, whatever ticket for it is shown.
    let [hidden, unknown] = [other.ids.clone(), Ids::unknown()];
    let get = |ids: Ids| {
        let mut service = RoomServiceClient::new(scoped.channel());
        let request = v1::GetRoomRequest {
            room_id: ids.room.clone(),
            ..Default::default()
        };
        async move { answer(service.get_room(request).await, &ids) }
    };
    assert_eq!(get(hidden.clone()).await, get(unknown.clone()).await);
    let player = server.token(Role::Player, Some(room));
    let player = server.client(Some(&player), &[]).await;
    let leave = |ids: Ids| {
        let mut service = RoomServiceClient::new(player.channel());
        let ticket = Token::random(RoomId::parse(&ids.room).expect("an id")).to_text();
        async move {
            let request = v1::LeaveRoomRequest { ticket };
            answer(service.leave_room(request).await, &ids)
        }
    };
    assert_eq!(leave(hidden).await, leave(unknown).await);
    let tournament = TournamentId::parse(&private.ids.tournament).expect("an id");
    let tournament = Scope::Tournament(tournament);
    let token = server.token(Role::Spectator, Some(tournament));
    let scoped = server.client(Some(&token), &[]).await;
    let shown = scoped.tournament(&private.ids.tournament).await;
    shown.expect("its tournament");
}

#[tokio::test]
async fn a_record_is_whole_for_its_owner_and_as_players_saw_it_for_participants() {
    for mode in [mode(Mode::Open), mode(Mode::Tokens)] {
        let is_open = mode.mode == Some(Mode::Open);
        let server = Server::start(mode).await;
        let token = |role| (!is_open).then(|| server.token(role, None));
        let host = token(Role::Host);
        let client = server.client(host.as_deref(), &[]).await;
        let player = token(Role::Player);
        for visibility in VISIBILITIES {
            let subject = Subject::new(&client, visibility).await;
            let expression = v1::Expression {
                label: "secret".into(),
                record_only: true,
                ..Default::default()
            };
            let ticket = &subject.tickets[0];
            let expressed = client.express(ticket, expression).await;
            expressed.expect("expressed");
            subject.play(&client).await;
            let is_private = visibility == Visibility::Private;
            let cases = [
                (&player, ticket, is_open && !is_private),
                (&player, &subject.owners[0], true),
                (&host, ticket, !is_private),
                (&host, &subject.owners[0], true),
            ];
            for (token, secret, whole) in cases {
                let reader = server.client(token.as_deref(), &[secret]).await;
                let lines = reader.record(&subject.ids.game).await.expect("a record");
                let is_owner = secret == &subject.owners[0];
                let said = format!("{visibility:?}, open: {is_open}, owner: {is_owner}");
                assert_eq!(format!("{lines:?}").contains("secret"), whole, "{said}");
            }
        }
    }
}

#[tokio::test]
async fn who_may_not_read_records_cannot_branch_from_them() {
    let server = Server::start(AccessSettings {
        records: Role::Admin,
        ..mode(Mode::Tokens)
    })
    .await;
    let host = server.token(Role::Host, None);
    let client = server.client(Some(&host), &[]).await;
    let subject = Subject::new(&client, Visibility::Public).await;
    subject.play(&client).await;
    let of = |name: &'static str, answers: &BTreeMap<_, Answer>| answers[name].code;
    let refused = asked(&client, &subject.ids).await;
    let admin = server.token(Role::Admin, None);
    let admin = server.client(Some(&admin), &[]).await;
    let allowed = asked(&admin, &subject.ids).await;
    assert_eq!(of("GetRecord", &allowed), Code::Ok);
    for call in [
        "GetRecord",
        "CreateRoom, branch",
        "CreateRoom, replay",
        "Run, branch",
        "Evaluate",
        "LegalActions",
    ] {
        assert_eq!(of(call, &refused), Code::PermissionDenied, "{call}");
        assert_ne!(of(call, &allowed), Code::PermissionDenied, "{call}");
    }
}

#[tokio::test]
async fn games_that_are_not_public_are_not_rated() {
    let server = Server::start(mode(Mode::Open)).await;
    let client = server.client(None, &[]).await;
    for visibility in [Visibility::Unlisted, Visibility::Private] {
        Subject::new(&client, visibility).await.play(&client).await;
    }
    let board = client
        .leaderboard(v1::GetLeaderboardRequest::default())
        .await;
    assert_eq!(board.expect("a leaderboard").games, 0);
    let public = Subject::new(&client, Visibility::Public).await;
    public.play(&client).await;
    let rated = async {
        loop {
            let board = client
                .leaderboard(v1::GetLeaderboardRequest::default())
                .await;
            // The room's game: in the tournament one participant has several seats' names.
            if board.expect("a leaderboard").games > 0 {
                break;
            }
            tokio::time::sleep(Duration::from_millis(100)).await;
        }
    };
    patiently("the public game to be rated", rated).await;
}

#[tokio::test]
async fn malformed_secrets_are_refused() {
    let server = Server::start(mode(Mode::Open)).await;
    let client = server.client(None, &[]).await;
    let secret = Token::random(RoomId::random()).to_text();
    let ask = |values: Vec<&str>| {
        let mut request = Request::new(v1::GetServerInfoRequest {});
        for value in values {
            let value = value.parse().expect("a value");
            request.metadata_mut().append(SECRET_HEADER, value);
        }
        let mut service = v1::server_service_client::ServerServiceClient::new(client.channel());
        async move { service.get_server_info(request).await.map(drop) }
    };
    ask(vec![&secret; MAX_SECRETS]).await.expect("not too many");
    let joined = format!("{secret}, {secret}");
    ask(vec![&joined]).await.expect("as proxies join them");
    for wrong in [vec!["BCDF2345"], vec![&secret; MAX_SECRETS + 1]] {
        let status = ask(wrong).await.expect_err("refused");
        assert_eq!(status.code(), Code::InvalidArgument);
    }
}
