//! The attacks: each is one client without any right, at an address of its own, that does something
//! for the time of the attack and holds on to what it gets.

use std::net::SocketAddr;
use std::time::Duration;

use chefshat_client::Connection;
use chefshat_proto::v1::{
    self, record_service_client::RecordServiceClient, room_service_client::RoomServiceClient,
    rule_set::Stop, tournament_service_client::TournamentServiceClient,
};
use futures::future::BoxFuture;
use futures::{FutureExt as _, StreamExt as _, stream};
use rand::RngExt as _;
use tokio::time::{sleep_until, timeout_at};
use tonic::Status;

use crate::acts;
use crate::largest;
use crate::probe::Probe;
use crate::raw;
use crate::server::{PLAIN, Setup};
use crate::target::{ATTACKER, IN_FLIGHT, LONG, Target, newest_record, room};
use crate::webhooks::REFUSED;

/// An attack.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Attack {
    /// Its name on the command line.
    pub(crate) name: &'static str,
    /// What the attacker does.
    pub(crate) what: &'static str,
    /// What others want meanwhile.
    pub(crate) probe: Probe,
    /// What the server is started with.
    pub(crate) setup: Setup,
    /// What the server is filled with before the honest room starts.
    pub(crate) prepare: Option<Act>,
    /// The attack itself.
    pub(crate) act: Act,
}

/// Something an attacker does.
pub(crate) type Act = fn(Target) -> BoxFuture<'static, Result<(), Status>>;

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

async fn list_rooms(channel: Connection) -> Result<(), Status> {
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
        let channel = target.connection().await?;
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
    record_of(target, 50).boxed()
}

/// A record with enough decisions for their annotations to make it as large as is legal.
fn a_long_record(target: Target) -> BoxFuture<'static, Result<(), Status>> {
    record_of(target, 150).boxed()
}

async fn record_of(target: Target, shifts: u32) -> Result<(), Status> {
    let channel = target.connection().await?;
    RoomServiceClient::new(channel.clone())
        .create_room(room(true, target.count(shifts)))
        .await?;
    let mut records = RecordServiceClient::new(channel);
    loop {
        match newest_record(&mut records, "hostile").await {
            Ok(_) => return Ok(()),
            Err(_) => tokio::time::sleep(Duration::from_millis(50)).await,
        }
    }
}

/// Connections that send one byte and hold their socket.
async fn one_byte_connections(target: &Target, to: SocketAddr, connections: u32) {
    let opening = stream::iter(0..target.count(connections)).map(|_| async {
        target.tally.tried(1);
        match raw::connect(to, ATTACKER).await {
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
                setup: PLAIN,
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
        "fast-games",
        "251 rooms, 1,000 Shifts a game, whose agents answer at once",
        ListRooms,
        |target| acts::games(&target, 251, 0).await?
    ),
    attack!(
        "unread-games",
        "251 rooms, 1,000 Shifts a game, whose agents read a byte a second and never answer",
        ListRooms,
        |target| acts::unread_games(&target, 251).await?
    ),
    attack!(
        "list-rooms-stalled",
        "ListRooms with 100 rooms on 20 connections x 1,000 streams with windows of 0 and 1",
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
            let mut records = RecordServiceClient::new(target.connection().await?);
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
        setup: Setup { flags: &["--allow-import"], ..PLAIN }
    ),
    attack!(
        "one-byte-connections",
        "15,000 connections that send one byte",
        ListRooms,
        |target| one_byte_connections(&target, target.address, 15_000).await
    ),
    attack!(
        "few-descriptors",
        "1,000 connections that send one byte, to a server with 256 file descriptors",
        ListRooms,
        |target| one_byte_connections(&target, target.address, 1_000).await,
        setup: Setup { descriptors: Some(256), ..PLAIN }
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
    attack!(
        "study-elements",
        "CreateStudy of 1 MiB of the submessages that cost the most, 32 at once",
        CreateStudy,
        |target| {
            let valid = v1::CreateStudyRequest::default();
            acts::worst_messages(&target, "StudyService/CreateStudy", &valid).await
        }
    ),
    attack!(
        "answer-elements",
        "AnswerQuestionnaire of 1 MiB of the submessages that cost the most, 32 at once, by a participant",
        CreateStudy,
        |target| acts::worst_answers(&target).await?
    ),
    attack!(
        "vector-elements",
        "vector setups of 1 MiB of the submessages that cost the most, 32 at once",
        StartVector,
        |target| {
            let valid = v1::RunRequest::default();
            acts::worst_messages(&target, "VectorService/Run", &valid).await
        }
    ),
    attack!(
        "import-elements",
        "imports of 1.5 million decisions without content, two at once",
        ImportRecord,
        |target| acts::empty_decisions(&target).await,
        setup: Setup { flags: &["--allow-import"], ..PLAIN }
    ),
    attack!(
        "largest-studies",
        "the largest studies that are accepted, 32 at once",
        CreateStudy,
        |target| largest::studies(&target).await
    ),
    attack!(
        "largest-vectors",
        "32 vector streams of 4,096 games that begin with 5,000 listed hands",
        StartVector,
        |target| largest::vectors(&target).await?
    ),
    attack!(
        "largest-imports",
        "imports of records as large as their memory allows, 32 at once",
        ImportRecord,
        |target| largest::imports(&target).await?,
        setup: Setup { flags: &["--allow-import"], ..PLAIN },
        prepare: Some(a_long_record)
    ),
    attack!(
        "replay-pictures",
        "the picture of a long game 1,000 times over two connections",
        ReadRecord,
        |target| acts::replay_pictures(&target).await?,
        prepare: Some(a_record)
    ),
    attack!(
        "mcp-sessions",
        "sessions of MCP over HTTP as fast as possible; the memory is that of chefshat mcp",
        McpSession,
        |target| acts::mcp_sessions(&target).await,
        setup: Setup { mcp: true, ..PLAIN }
    ),
    attack!(
        "tls-hellos",
        "the same ClientHello on new connections as fast as possible",
        ListRooms,
        |target| acts::tls_hellos(&target).await,
        setup: Setup { tls: true, ..PLAIN }
    ),
    attack!(
        "evaluations",
        "analyses of 10 s by eight tokens, 16 at once each",
        Evaluate,
        |target| acts::evaluations(&target).await?,
        setup: Setup { tokens: 8, ..PLAIN },
        prepare: Some(a_record)
    ),
    attack!(
        "full-disk",
        "251 rooms with 4 KB of annotations for each decision on a disk of 110 MiB",
        ListRooms,
        |target| acts::games(&target, 251, acts::ANNOTATION_BYTES).await?,
        setup: Setup { disk_mib: Some(110), one_game: true, ..PLAIN }
    ),
    attack!(
        "samples",
        "samples of 16 seats as fast as possible on a disk of 256 MiB",
        ListRooms,
        |target| acts::samples(&target).await?,
        setup: Setup { disk_mib: Some(256), ..PLAIN }
    ),
    attack!(
        "unknown-tokens",
        "ListRooms with unknown tokens as fast as possible on 8 connections",
        ListRooms,
        |target| acts::unknown_tokens(&target).await,
        setup: Setup { tokens: 1, ..PLAIN }
    ),
    attack!(
        "refused-webhook",
        "one room whose events the receiver of webhooks refuses",
        Webhook,
        |target| {
            let call = |channel| async move {
                let request = v1::CreateRoomRequest { name: REFUSED.into(), ..room(false, 1) };
                RoomServiceClient::new(channel).create_room(request).await
            };
            target.call_all(1, 1, call).await
        },
        setup: Setup { webhooks: true, ..PLAIN }
    ),
    attack!(
        "long-stream",
        "seats of another node attached and detached on one stream as fast as possible",
        ListRooms,
        |target| acts::long_stream(&target).await?,
        setup: Setup { nodes: 2, ..PLAIN }
    ),
    attack!(
        "peer-connections",
        "1,000 connections to the listener for nodes, of a node with 256 file descriptors",
        ListRooms,
        |target| {
            let peers = target.peers.expect("it is a node");
            one_byte_connections(&target, peers, 1_000).await
        },
        setup: Setup { nodes: 1, descriptors: Some(256), ..PLAIN }
    ),
];
