//! What others want from the server during an attack, besides the honest room: one call a second,
//! from another address than the attacker's.

use std::time::Duration;

use chefshat_proto::v1::{
    self, record_service_client::RecordServiceClient, room_service_client::RoomServiceClient,
    tournament_service_client::TournamentServiceClient, vector_service_client::VectorServiceClient,
};
use tokio::time::Instant;
use tonic::transport::Channel;
use tonic::{Code, Status};

use crate::honest;

/// Time between two calls.
const INTERVAL: Duration = Duration::from_secs(1);
/// How long a call may take.
const LIMIT: Duration = Duration::from_secs(5);

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
pub(crate) async fn run(probe: Probe, url: String, until: Instant) -> Served {
    let mut count = Served::default();
    while Instant::now() < until {
        let next = Instant::now() + INTERVAL;
        count.tried += 1;
        let call = async {
            let channel = honest::channel(&url, None).await.ok()?;
            call(probe, channel).await.ok()
        };
        if let Ok(Some(())) = tokio::time::timeout(LIMIT, call).await {
            count.served += 1;
        }
        tokio::time::sleep_until(next).await;
    }
    count
}

async fn call(probe: Probe, channel: Channel) -> Result<(), Status> {
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
    }
    Ok(())
}

/// The id of the newest recorded game of rooms with this name.
pub(crate) async fn newest_record(
    service: &mut RecordServiceClient<Channel>,
    room_name: &str,
) -> Result<String, Status> {
    let request = v1::ListRecordsRequest {
        filter: Some(v1::RecordFilter {
            room_name: room_name.into(),
            ..v1::RecordFilter::default()
        }),
        page_size: 1,
        newest_first: true,
        ..v1::ListRecordsRequest::default()
    };
    let listed = service.list_records(request).await?.into_inner().records;
    let newest = listed.into_iter().next();
    newest
        .map(|summary| summary.game_id)
        .ok_or_else(|| Status::not_found("no record yet"))
}
