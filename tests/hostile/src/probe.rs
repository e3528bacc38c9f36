//! What others want from the server during an attack, besides the honest room: one call a second,
//! from another address than the attacker's.

use std::net::SocketAddr;
use std::time::Duration;

use chefshat_client::Connection;
use chefshat_proto::v1::{
    self, analysis_service_client::AnalysisServiceClient,
    record_service_client::RecordServiceClient, room_service_client::RoomServiceClient,
    study_service_client::StudyServiceClient, tournament_service_client::TournamentServiceClient,
    vector_service_client::VectorServiceClient,
};
use tokio::time::{Instant, sleep};
use tonic::{Code, Status};

use crate::acts;
use crate::honest::Access;
use crate::target::newest_record;
use crate::webhooks::Announced;

/// Time between two calls.
const INTERVAL: Duration = Duration::from_secs(1);
/// How long a call may take.
const LIMIT: Duration = Duration::from_secs(5);
/// Time of an analysis, milliseconds.
const ANALYSIS_MS: u32 = 1_000;
/// How often a probe looks whether a webhook has arrived.
const LOOK_AGAIN: Duration = Duration::from_millis(20);

/// The call.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Probe {
    /// Lists the rooms.
    ListRooms,
    /// Creates a tournament and closes it.
    CreateTournament,
    /// Starts games of its own.
    StartVector,
    /// Reads the newest record.
    ReadRecord,
    /// Imports a record that is no record: the server must say so at once.
    ImportRecord,
    /// Creates a study and deletes it.
    CreateStudy,
    /// Opens a session of MCP.
    McpSession,
    /// Asks for an analysis of a second.
    Evaluate,
    /// Creates a room, whose webhook must arrive.
    Webhook,
}

/// What a probe calls.
#[derive(Debug, Clone)]
pub(crate) struct Called {
    /// The server.
    pub(crate) access: Access,
    /// `chefshat mcp`, if it runs.
    pub(crate) mcp: Option<SocketAddr>,
    /// What the receiver of webhooks has heard of, if there is one.
    pub(crate) announced: Option<Announced>,
}

/// How many calls were served in time, and how many were tried.
#[derive(Debug, Clone, Copy, Default, serde::Serialize)]
pub(crate) struct Served {
    /// Served in time.
    pub(crate) served: u64,
    /// Tried.
    pub(crate) tried: u64,
}

/// Calls until a moment, each time over a new connection.
pub(crate) async fn run(probe: Probe, called: Called, until: Instant) -> Served {
    let mut count = Served::default();
    while Instant::now() < until {
        let next = Instant::now() + INTERVAL;
        count.tried += 1;
        let call = async {
            let connection = called.access.connect().await.ok()?.channel();
            call(probe, connection, &called).await.ok()
        };
        if let Ok(Some(())) = tokio::time::timeout(LIMIT, call).await {
            count.served += 1;
        }
        tokio::time::sleep_until(next).await;
    }
    count
}

async fn call(probe: Probe, channel: Connection, called: &Called) -> Result<(), Status> {
    match probe {
        Probe::ListRooms => {
            let request = v1::ListRoomsRequest::default();
            RoomServiceClient::new(channel).list_rooms(request).await?;
        }
        Probe::CreateTournament => {
            let mut service = TournamentServiceClient::new(channel);
            let request = v1::CreateTournamentRequest {
                settings: Some(v1::TournamentSettings {
                    name: "honest".into(),
                    format: v1::TournamentFormat::RoundRobin.into(),
                    ..v1::TournamentSettings::default()
                }),
                ..v1::CreateTournamentRequest::default()
            };
            let created = service.create_tournament(request).await?.into_inner();
            let request = v1::CloseTournamentRequest {
                tournament_id: (created.tournament.unwrap_or_default()).tournament_id,
                owner_token: created.owner_token,
            };
            service.close_tournament(request).await?;
        }
        Probe::StartVector => {
            let setup = v1::RunRequest {
                request: Some(v1::run_request::Request::Setup(Box::new(v1::VectorSetup {
                    games: 1,
                    seeds: Some(v1::vector_setup::Seeds::BaseSeed(1)),
                    reward_scheme: v1::RewardScheme::Paper.into(),
                    ..v1::VectorSetup::default()
                }))),
            };
            let mut service = VectorServiceClient::new(channel);
            let started = service.run(tokio_stream::iter([setup])).await?;
            started.into_inner().message().await?;
        }
        Probe::ReadRecord => {
            let mut service = RecordServiceClient::new(channel);
            let game_id = newest_record(&mut service, "hostile").await?;
            let request = v1::GetRecordRequest { game_id };
            let mut lines = service.get_record(request).await?.into_inner();
            while lines.message().await?.is_some() {}
        }
        Probe::ImportRecord => {
            let mut service = RecordServiceClient::new(channel);
            let nothing = v1::ImportRecordRequest::default();
            let imported = service.import_record(tokio_stream::iter([nothing])).await;
            match imported {
                Err(status) if status.code() != Code::InvalidArgument => return Err(status),
                _ => {}
            }
        }
        Probe::CreateStudy => {
            let mut service = StudyServiceClient::new(channel);
            let created = service.create_study(acts::study()).await?.into_inner();
            let request = v1::DeleteStudyRequest {
                study_id: created.study.unwrap_or_default().study_id,
                owner_token: created.owner_token,
                force: true,
            };
            service.delete_study(request).await?;
        }
        Probe::McpSession => {
            let status = match called.mcp {
                Some(address) => acts::initialize(address).await,
                None => None,
            };
            let is_ok = status.is_some_and(|status| status.starts_with("HTTP/1.1 200"));
            return is_ok
                .then_some(())
                .ok_or_else(|| Status::unavailable("no session"));
        }
        Probe::Evaluate => {
            let mut records = RecordServiceClient::new(channel.clone());
            let game_id = newest_record(&mut records, "hostile").await?;
            let mut service = AnalysisServiceClient::new(channel);
            let request = acts::evaluation(game_id, ANALYSIS_MS);
            let mut estimates = service.evaluate(request).await?.into_inner();
            while estimates.message().await?.is_some() {}
        }
        Probe::Webhook => {
            let request = v1::CreateRoomRequest {
                name: "announced".into(),
                ..v1::CreateRoomRequest::default()
            };
            let mut service = RoomServiceClient::new(channel);
            let created = service.create_room(request).await?.into_inner();
            let room_id = created.room.unwrap_or_default().room_id;
            let announced = called.announced.clone().unwrap_or_default();
            while !announced.has(&room_id) {
                sleep(LOOK_AGAIN).await;
            }
        }
    }
    Ok(())
}
