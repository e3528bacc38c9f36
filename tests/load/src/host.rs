//! Creates rooms, joins their seats and attaches them to the streams. Follows each game that ends
//! with the next one.

use std::sync::Arc;

use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient, rule_set::Stop, seat_command::Command,
};
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use tokio::sync::{mpsc, oneshot};
use tonic::transport::Channel;

use crate::error::LoadError;
use crate::options::SEATS;
use crate::pulse::{Plan, Pulse};

/// Long enough that nobody is ever late: clocks run, but do not run out.
const DECISION_TIME_MS: u32 = 3_600_000;
/// Rooms created at a time.
const CREATED_AT_A_TIME: usize = 16;

/// The senders of all streams.
type Senders = Vec<mpsc::Sender<v1::PlayRequest>>;

/// What the streams report about a room, by its index.
#[derive(Debug, Clone, Copy)]
pub(crate) enum News {
    /// The game is over for one of its seats.
    Over(usize),
    /// Its open decision stays unanswered, because the segment stops.
    AtRest(usize),
}

/// A seat behind a handle: its room, and its number in the room in the order of joining.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slot {
    /// The room.
    pub(crate) room: usize,
    /// The seat, in the order of joining. The first counts the room's events.
    pub(crate) seat: usize,
}

impl Slot {
    /// As the request id of an attachment, which is never 0.
    pub(crate) fn request_id(self) -> u32 {
        u32::try_from(self.room * SEATS + self.seat + 1).expect("rooms are bounded")
    }

    /// The seat with this request id.
    pub(crate) fn from_request_id(id: u32) -> Option<Self> {
        let index = usize::try_from(id).ok()?.checked_sub(1)?;
        Some(Self {
            room: index / SEATS,
            seat: index % SEATS,
        })
    }
}

/// A room that is playing.
#[derive(Debug, Clone, Default)]
struct Open {
    id: String,
    owner_token: String,
}

/// Creates the rooms of a segment.
pub(crate) struct Host {
    rooms: RoomServiceClient<Channel>,
    plan: Plan,
    senders: Senders,
    news: mpsc::UnboundedReceiver<News>,
}

impl Host {
    /// A host of rooms on a server.
    pub(crate) fn new(
        channel: Channel,
        plan: Plan,
        senders: Senders,
        news: mpsc::UnboundedReceiver<News>,
    ) -> Self {
        Self {
            rooms: RoomServiceClient::new(channel),
            plan,
            senders,
            news,
        }
    }

    /// Hosts until the segment stops and all games have ended. Returns the number of games, and the
    /// senders.
    pub(crate) async fn run(
        mut self,
        pulse: Arc<Pulse>,
        ready: oneshot::Sender<()>,
    ) -> Result<(u64, Senders), LoadError> {
        let host = &self;
        let mut open: Vec<Open> = stream::iter(0..host.plan.rooms)
            .map(|room| host.begin(room))
            .buffered(CREATED_AT_A_TIME)
            .try_collect()
            .await?;
        let mut games = open.len() as u64;
        // A segment that has failed no longer waits; its error is reported there.
        let _ = ready.send(());
        let mut playing = open.len();
        let mut seats_over = vec![0; open.len()];
        while playing > 0 {
            let news = self.news.recv().await;
            match news.ok_or(LoadError::Stuck("a game without streams"))? {
                News::AtRest(room) => self.close(std::mem::take(&mut open[room])).await?,
                News::Over(room) => {
                    seats_over[room] += 1;
                    if seats_over[room] < SEATS {
                        continue;
                    }
                    seats_over[room] = 0;
                    if pulse.is_stopping() {
                        playing -= 1;
                    } else {
                        pulse.begin(room);
                        open[room] = self.begin(room).await?;
                        games += 1;
                    }
                }
            }
        }
        Ok((games, self.senders))
    }

    /// Creates a room and attaches its seats.
    async fn begin(&self, room: usize) -> Result<Open, LoadError> {
        let rules = v1::RuleSet {
            stop: (self.plan.shifts > 0).then_some(Stop::TargetShifts(self.plan.shifts)),
            ..v1::RuleSet::default()
        };
        let policy = v1::RoomPolicy {
            decision_time_ms: Some(DECISION_TIME_MS),
            // Unspecified means durable on a server with a database.
            durability: match self.plan.durable {
                true => v1::Durability::Unspecified,
                false => v1::Durability::Ephemeral,
            }
            .into(),
            ..v1::RoomPolicy::default()
        };
        let mut rooms = self.rooms.clone();
        let created = rooms
            .create_room(v1::CreateRoomRequest {
                name: "load".into(),
                rules: Some(rules),
                policy: Some(policy),
                ..v1::CreateRoomRequest::default()
            })
            .await?
            .into_inner();
        for seat in 0..SEATS {
            let joined = rooms
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
            // A stream that is gone reports its own error.
            let _ = self.senders[stream].send(request).await;
        }
        Ok(Open {
            id: created.room.map(|room| room.room_id).unwrap_or_default(),
            owner_token: created.owner_token,
        })
    }

    /// Closes a room, which aborts its game.
    async fn close(&self, open: Open) -> Result<(), LoadError> {
        let request = v1::CloseRoomRequest {
            room_id: open.id,
            owner_token: open.owner_token,
        };
        self.rooms.clone().close_room(request).await?;
        Ok(())
    }
}
