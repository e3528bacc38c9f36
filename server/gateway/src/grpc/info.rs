//! `ServerService`: the server's version, limits, action tables and clocks.

use std::collections::BTreeMap;
use std::time::Duration;

use chefshat_agents::{AgentKind, NamedAgent};
use chefshat_engine::{ActionId, ActionSpace, RULES_VERSION, RuleSetSpec};
use chefshat_proto::v1::{
    self, server_service_client::ServerServiceClient, server_service_server::ServerService,
};
use chefshat_record::convert::{action_space, rules_to_proto};
use chefshat_tournament::{MAX_GAMES, MAX_PARTICIPANTS};
use tonic::{Request, Response, Status};

use super::forward::Gateway;
use super::limits::make_way;
use super::lists;
use super::lookup::Lookup;
use super::status::{invalid, room_unknown};
use chefshat_admission::access::{Caller, MAX_MESSAGE_BYTES, MAX_VECTOR_MESSAGE_BYTES};
use chefshat_admission::limits::CallLimits;
use chefshat_base::SERVER_VERSION;
use chefshat_base::clock::since_epoch;
use chefshat_hosting::config::{
    MAX_ANALYSES, MAX_ANALYSIS_ROLLOUTS, MAX_ANALYSIS_TIME, MAX_FOLLOWERS, MAX_SEATS_PER_STREAM,
    MAX_SEATS_PER_WATCH, MAX_STREAMS_PER_CONNECTION, MAX_TOURNAMENTS,
    MAX_VECTOR_NETWORK_MULTIPLICATIONS, MAX_VECTOR_SEATS_IN_ALL, MAX_VECTOR_STREAMS, ServerConfig,
};
use chefshat_hosting::room::MAX_SPECTATORS;
use chefshat_vector::{Limits, MAX_BATCH_BYTES};
use chefshat_wire::convert;
use chefshat_wire::convert::MAX_HOSTED_SHIFTS;

/// Faces of the standard game.
const STANDARD_FACES: u32 = 11;

/// The service.
#[derive(Debug, Clone)]
pub struct Info {
    lookup: Lookup,
    limits: BTreeMap<String, u64>,
}

impl Info {
    /// Creates the service for the rooms that callers reach.
    pub fn new(lookup: Lookup, calls: &CallLimits, config: &ServerConfig) -> Self {
        let limits = [
            ("max_rooms", config.max_rooms),
            ("max_connections", config.max_connections),
            ("max_message_bytes", MAX_MESSAGE_BYTES),
            ("max_vector_message_bytes", MAX_VECTOR_MESSAGE_BYTES),
            ("max_vector_streams", MAX_VECTOR_STREAMS),
            ("max_vector_batch_bytes", MAX_BATCH_BYTES),
            ("max_vector_seats", Limits::OF_SERVER.seats_played as usize),
            ("max_vector_seats_in_all", MAX_VECTOR_SEATS_IN_ALL),
            ("max_vector_seeds", Limits::OF_SERVER.seeds),
            (
                "max_vector_recorded_games",
                Limits::OF_SERVER.recorded_games as usize,
            ),
            (
                "max_vector_network_multiplications",
                usize::try_from(MAX_VECTOR_NETWORK_MULTIPLICATIONS).unwrap_or(usize::MAX),
            ),
            ("max_analyses", MAX_ANALYSES),
            ("max_seats_per_stream", MAX_SEATS_PER_STREAM),
            ("max_seats_per_watch", MAX_SEATS_PER_WATCH),
            ("max_spectators_per_room", MAX_SPECTATORS),
            ("max_tournaments", MAX_TOURNAMENTS),
            ("max_tournament_participants", MAX_PARTICIPANTS),
            ("max_tournament_games", MAX_GAMES),
            ("max_followers", MAX_FOLLOWERS),
            (
                "max_streams_per_connection",
                usize::try_from(MAX_STREAMS_PER_CONNECTION).unwrap_or(usize::MAX),
            ),
            (
                "max_shifts",
                usize::try_from(MAX_HOSTED_SHIFTS).unwrap_or(usize::MAX),
            ),
        ]
        .into_iter()
        .map(|(name, limit)| (name, u64::try_from(limit).unwrap_or(u64::MAX)))
        .chain(calls.named())
        .chain([
            (
                "built_in_decisions_per_second",
                config.built_in_decisions_per_second,
            ),
            ("max_analysis_rollouts", MAX_ANALYSIS_ROLLOUTS),
            ("max_analysis_ms", MAX_ANALYSIS_TIME.as_millis() as u64),
            ("local_share_percent", config.shares.local.into()),
            ("caller_share_percent", config.shares.remote.into()),
        ])
        .map(|(name, limit)| (name.to_owned(), limit))
        .collect();
        Self { lookup, limits }
    }
}

impl ServerService for Info {
    async fn get_server_info(
        &self,
        request: Request<v1::GetServerInfoRequest>,
    ) -> Result<Response<v1::GetServerInfoResponse>, Status> {
        let mut open_rooms = convert::number(self.lookup.rooms().open_count());
        if let Some(gateway) = request.extensions().get::<Gateway>() {
            let ask = |channel| async move {
                let request = gateway.request(v1::GetServerInfoRequest {});
                ServerServiceClient::new(channel)
                    .get_server_info(request)
                    .await
            };
            // A node that cannot be reached holds up no other calls.
            make_way(request.extensions());
            let others = lists::of_others(gateway, ask).await;
            open_rooms += others.map(|info| info.open_rooms).sum::<u32>();
        }
        let presets = RuleSetSpec::PRESETS
            .iter()
            .map(|name| {
                let rules = RuleSetSpec::preset(name)
                    .and_then(|spec| spec.validate().ok())
                    .expect("every preset is a valid rule set");
                v1::RuleSet {
                    preset: (*name).to_owned(),
                    ..rules_to_proto(&rules)
                }
            })
            .collect();
        Ok(Response::new(v1::GetServerInfoResponse {
            server_version: SERVER_VERSION.into(),
            rules_version: RULES_VERSION,
            presets,
            built_in_agents: NamedAgent::NAMES.map(str::to_owned).to_vec(),
            quick_built_in_agents: (AgentKind::ALL.iter())
                .map(|kind| kind.name().to_owned())
                .collect(),
            limits: self.limits.clone(),
            open_rooms,
            shutting_down: self.lookup.rooms().is_shutting_down(),
            signing_key: (self.lookup.rooms().signing_key())
                .map_or_else(String::new, |key| key.to_string()),
        }))
    }

    async fn get_action_table(
        &self,
        request: Request<v1::GetActionTableRequest>,
    ) -> Result<Response<v1::GetActionTableResponse>, Status> {
        let faces = match request.into_inner().faces {
            0 => STANDARD_FACES,
            faces => faces,
        };
        let space = u8::try_from(faces)
            .ok()
            .and_then(ActionSpace::new)
            .ok_or_else(|| {
                let problem = format!("{faces} is not in 4..=15");
                invalid("FACES_OUT_OF_RANGE", "faces", problem)
            })?;
        Ok(Response::new(v1::GetActionTableResponse {
            action_space: Some(action_space(&space)),
            texts: (0..space.size())
                .filter_map(|index| space.text(ActionId::new(index)))
                .collect(),
        }))
    }

    async fn get_clock(
        &self,
        request: Request<v1::GetClockRequest>,
    ) -> Result<Response<v1::GetClockResponse>, Status> {
        let received_at = since_epoch();
        let received = tokio::time::Instant::now();
        let caller = Caller::of(request.extensions());
        let room_id = request.into_inner().room_id;
        let room = match room_id.as_str() {
            "" => None,
            id => {
                let handle = self.lookup.room(&caller, id).await?;
                let header = self.lookup.rooms().header(handle.id());
                Some((handle, header.ok_or_else(room_unknown)?))
            }
        };
        let sent = tokio::time::Instant::now();
        Ok(Response::new(v1::GetClockResponse {
            received_at_us: micros(received_at),
            // The time of day may have been set meanwhile.
            sent_at_us: micros(received_at + (sent - received)),
            room: room.map(|(handle, header)| v1::RoomClock {
                game_id: header.game_id.to_string(),
                created_at_ms: header.created_at_ms,
                received_us: micros(handle.clock().at(received)),
                sent_us: micros(handle.clock().at(sent)),
            }),
        }))
    }
}

fn micros(time: Duration) -> u64 {
    u64::try_from(time.as_micros()).unwrap_or(u64::MAX)
}
