//! Makes rooms, takes their seats and attaches them to the streams; when a room's game has ended it makes the next.

use std::sync::Arc;

use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient, rule_set::Stop, seat_command::Command,
};
use tokio::sync::{mpsc, oneshot};
use tonic::transport::Channel;

use crate::error::LoadError;
use crate::options::SEATS;
use crate::play::Slot;
use crate::pulse::{Plan, Pulse};

/// Nobody is late here: the clocks run, but never out.
const DECISION_TIME_MS: u32 = 3_600_000;

/// The senders of all streams.
type Senders = Vec<mpsc::Sender<v1::PlayRequest>>;

/// Makes the rooms of a segment.
pub(crate) struct Host {
    rooms: RoomServiceClient<Channel>,
    plan: Plan,
    senders: Senders,
    /// Rooms of seats whose game has ended, one message for each seat.
    ended: mpsc::UnboundedReceiver<usize>,
    games: u64,
}

impl Host {
    /// A host of rooms on a server.
    pub(crate) fn new(
        channel: Channel,
        plan: Plan,
        senders: Senders,
        ended: mpsc::UnboundedReceiver<usize>,
    ) -> Self {
        Self {
            rooms: RoomServiceClient::new(channel),
            plan,
            senders,
            ended,
            games: 0,
        }
    }

    /// Hosts until the segment stops and all games have ended. Gives back how many there were, and the senders.
    pub(crate) async fn run(
        mut self,
        pulse: Arc<Pulse>,
        ready: oneshot::Sender<()>,
    ) -> Result<(u64, Senders), LoadError> {
        for room in 0..self.plan.rooms {
            self.begin(room).await?;
        }
        // If nobody waits any more, the segment has failed and says why.
        let _ = ready.send(());
        let mut open = self.plan.rooms;
        let mut seats_done = vec![0; self.plan.rooms];
        while open > 0 {
            let room = self
                .ended
                .recv()
                .await
                .ok_or(LoadError::Stuck("a game whose streams are gone"))?;
            seats_done[room] += 1;
            if seats_done[room] < SEATS {
                continue;
            }
            seats_done[room] = 0;
            if pulse.is_stopping() {
                open -= 1;
            } else {
                pulse.begin(room);
                self.begin(room).await?;
            }
        }
        Ok((self.games, self.senders))
    }

    /// Makes a room and attaches its seats.
    async fn begin(&mut self, room: usize) -> Result<(), LoadError> {
        let rules = v1::RuleSet {
            stop: (self.plan.shifts > 0).then_some(Stop::TargetShifts(self.plan.shifts)),
            ..v1::RuleSet::default()
        };
        let policy = v1::RoomPolicy {
            decision_time_ms: Some(DECISION_TIME_MS),
            // Left open it is durable, where the server keeps games on disk.
            durability: match self.plan.durable {
                true => v1::Durability::Unspecified,
                false => v1::Durability::Ephemeral,
            }
            .into(),
            ..v1::RoomPolicy::default()
        };
        let created = self
            .rooms
            .create_room(v1::CreateRoomRequest {
                name: "load".into(),
                rules: Some(rules),
                policy: Some(policy),
                ..v1::CreateRoomRequest::default()
            })
            .await?
            .into_inner();
        self.games += 1;
        for seat in 0..SEATS {
            let joined = self
                .rooms
                .join_room(v1::JoinRoomRequest {
                    join_code: created.join_code.clone(),
                    name: "load".into(),
                    kind: v1::ParticipantKind::Agent.into(),
                    ..v1::JoinRoomRequest::default()
                })
                .await?
                .into_inner();
            let slot = Slot { room, seat };
            let attach = v1::Attach {
                ticket: joined.ticket,
                request_id: slot.request_id(),
                delivery: v1::EventDelivery::WithDecisions.into(),
                ..v1::Attach::default()
            };
            let stream = (room * SEATS + seat) % self.senders.len();
            let request = v1::PlayRequest {
                commands: vec![v1::SeatCommand {
                    handle: 0,
                    command: Some(Command::Attach(attach)),
                }],
            };
            // A stream that is gone has said why.
            let _ = self.senders[stream].send(request).await;
        }
        Ok(())
    }
}
