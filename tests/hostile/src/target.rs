//! What an attack is aimed at, and the ways in which many attacks call, connect and hold on.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

use bytes::Bytes;
use chefshat_client::{Client, Connection};
use chefshat_proto::v1::{
    self, record_service_client::RecordServiceClient, rule_set::Stop, seat_config::FilledBy,
};
use futures::{StreamExt as _, stream};
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep, sleep_until, timeout_at};
use tonic::Status;

use crate::honest::{self, Access};
use crate::raw::{self, RawRequest};
use crate::tally::Tally;

/// The attacker's address.
pub(crate) const ATTACKER: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));
/// Calls that an attacker has in flight.
pub(crate) const IN_FLIGHT: usize = 64;
/// Shifts of a long game: the most that a server allows.
pub(crate) const LONG: u32 = 1_000;
/// Window of streams whose answers are read, bytes.
const READING_WINDOW: u32 = 1024 * 1024;
/// Pause before a connection that the server has closed is opened again.
const AGAIN_AFTER: Duration = Duration::from_millis(10);

/// What is attacked, and for how long.
#[derive(Debug, Clone)]
pub(crate) struct Target {
    /// The server.
    pub(crate) address: SocketAddr,
    /// How a client without a token reaches it.
    pub(crate) access: Access,
    /// The attacker's tokens, if the server requires one.
    pub(crate) tokens: Arc<[String]>,
    /// Where `chefshat mcp` listens, if the attack has it.
    pub(crate) mcp: Option<SocketAddr>,
    /// Where the server receives other nodes, if it is one.
    pub(crate) peers: Option<SocketAddr>,
    /// Another node of its cluster, if there is one.
    pub(crate) other_node: Option<Access>,
    /// The end of the attack. What was granted is held until then.
    pub(crate) until: Instant,
    /// All counts are divided by this.
    pub(crate) divide: u32,
    /// What comes of it.
    pub(crate) tally: Arc<Tally>,
}

impl Target {
    /// A count of the attack, divided as requested.
    pub(crate) fn count(&self, of: u32) -> u32 {
        (of / self.divide).max(1)
    }

    /// A client: with the first token, if there are some, else from the attacker's address.
    pub(crate) async fn client(&self) -> Result<Client, Status> {
        let connecting = async {
            match self.tokens.first() {
                Some(token) => self.with_token(token).connect().await.ok(),
                None => {
                    let channel = honest::channel(&self.access.url, Some(ATTACKER)).await;
                    channel.ok().map(Client::from_channel)
                }
            }
        };
        match timeout_at(self.until, connecting).await {
            Ok(Some(client)) => Ok(client),
            _ => {
                self.tally.lost();
                Err(Status::unavailable("no connection"))
            }
        }
    }

    /// The connection of such a client.
    pub(crate) async fn connection(&self) -> Result<Connection, Status> {
        Ok(self.client().await?.channel())
    }

    fn with_token(&self, token: &str) -> Access {
        Access {
            token: Some(token.to_owned()),
            ..self.access.clone()
        }
    }

    /// Makes calls one after another until the end of the attack, on each of several connections.
    pub(crate) async fn call_all<F, T>(
        &self,
        connections: u32,
        calls: u32,
        call: impl Fn(Connection) -> F + Clone + Send + Sync + 'static,
    ) where
        F: Future<Output = Result<T, Status>> + Send,
        T: Send,
    {
        let mut callers = JoinSet::new();
        for _ in 0..self.count(connections) {
            let (target, call) = (self.clone(), call.clone());
            callers.spawn(async move {
                let Ok(channel) = target.connection().await else {
                    return;
                };
                let calls = stream::iter(0..target.count(calls)).map(|_| {
                    let called = call(channel.clone());
                    target.tally.tried(1);
                    async {
                        target.tally.outcome(&called.await);
                    }
                });
                let all = calls.buffer_unordered(IN_FLIGHT).for_each(|()| async {});
                // Those that are still waited for at the end are neither granted nor refused.
                let _ = timeout_at(target.until, all).await;
            });
        }
        let _ = timeout_at(self.until, async {
            while callers.join_next().await.is_some() {}
        })
        .await;
        sleep_until(self.until).await;
    }

    /// Sends requests byte by byte until the end of the attack, on each of several connections, which
    /// are opened again when the server closes them. `request` makes the n-th of a connection.
    pub(crate) async fn send_all(
        &self,
        connections: u32,
        at_a_time: usize,
        requests: u32,
        request: impl Fn(u32) -> RawRequest + Clone + Send + Sync + 'static,
    ) {
        let mut callers = JoinSet::new();
        for _ in 0..self.count(connections) {
            let (target, request) = (self.clone(), request.clone());
            callers.spawn(async move {
                let mut next = 0..target.count(requests);
                while !next.is_empty() {
                    match raw::http2(target.address, ATTACKER, READING_WINDOW).await {
                        Ok(sender) => {
                            let broken = AtomicBool::new(false);
                            let calls = stream::iter(&mut next)
                                .take_while(|_| std::future::ready(!broken.load(Relaxed)))
                                .map(|number| {
                                    let call = raw::call(&sender, request(number), &target.tally);
                                    async {
                                        if !call.await {
                                            broken.store(true, Relaxed);
                                        }
                                    }
                                });
                            calls.buffer_unordered(at_a_time).collect::<()>().await;
                        }
                        Err(_) => target.tally.lost(),
                    }
                    sleep(AGAIN_AFTER).await;
                }
            });
        }
        let _ = timeout_at(self.until, async {
            while callers.join_next().await.is_some() {}
        })
        .await;
        sleep_until(self.until).await;
    }

    /// Opens many streams on many connections and holds them. Their windows stay closed on one half of
    /// the connections, and have one byte on the other: there a server begins to send each answer.
    pub(crate) async fn hold_streams(
        &self,
        connections: u32,
        streams: u32,
        method: &'static str,
        body: Option<Bytes>,
    ) {
        let mut opening = JoinSet::new();
        for number in 0..self.count(connections) {
            let (target, body) = (self.clone(), body.clone());
            opening.spawn(async move {
                let window = number % 2;
                let connected = raw::http2(target.address, ATTACKER, window);
                let Ok(Ok(sender)) = timeout_at(target.until, connected).await else {
                    return target.tally.lost();
                };
                let opened = (0..target.count(streams))
                    .map(|_| raw::open(&sender, method, body.clone(), &target.tally));
                let opened: Vec<_> = opened.map(|open| timeout_at(target.until, open)).collect();
                let _held = futures::future::join_all(opened).await;
                sleep_until(target.until).await;
            });
        }
        let _ = opening.join_all().await;
    }

    /// Floods the server with frames on several connections, which are opened again when the
    /// server closes them.
    pub(crate) async fn flood(&self, next: fn(u32) -> Vec<u8>) {
        let mut floods = JoinSet::new();
        for _ in 0..self.count(4) {
            let target = self.clone();
            floods.spawn(async move {
                let flooding = async {
                    loop {
                        raw::flood(target.address, ATTACKER, &target.tally, next).await;
                        sleep(AGAIN_AFTER).await;
                    }
                };
                let _ = timeout_at(target.until, flooding).await;
            });
        }
        floods.join_all().await;
    }
}

/// A room whose seats are all filled by this agent, or open.
pub(crate) fn room(built_in: bool, shifts: u32) -> v1::CreateRoomRequest {
    v1::CreateRoomRequest {
        name: "hostile".into(),
        rules: Some(v1::RuleSet {
            stop: Some(Stop::TargetShifts(shifts)),
            ..v1::RuleSet::default()
        }),
        seats: (0..4)
            .map(|_| v1::SeatConfig {
                filled_by: built_in.then(|| FilledBy::BuiltInAgent("random".into())),
                ..v1::SeatConfig::default()
            })
            .collect(),
        ..v1::CreateRoomRequest::default()
    }
}

/// The id of the newest recorded game of rooms with this name.
pub(crate) async fn newest_record(
    service: &mut RecordServiceClient<Connection>,
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
