//! Every task that lives long sleeps while nothing is due for it: counted on a stopped clock, in a
//! server with something of everything, through its shutdown, and in a node of a cluster, through
//! its drain. Tasks that neither drives are listed, with the reason.

use std::collections::BTreeMap;
use std::sync::mpsc;
use std::time::Duration;

use futures::future::join as both;
use futures::{Stream, stream};
use tokio::io::{AsyncReadExt as _, DuplexStream};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio::time::{Instant, sleep, timeout};
use tonic::transport::{Channel, Endpoint};
use v1::participation_service_client::ParticipationServiceClient;
use v1::play_service_client::PlayServiceClient;
use v1::room_service_client::RoomServiceClient;
use v1::spectator_service_client::SpectatorServiceClient;
use v1::study_service_client::StudyServiceClient;
use v1::tournament_service_client::TournamentServiceClient;

use super::*;
use crate::access::{AccessSettings, Mode};
use crate::config::{KeepGames, longest_shutdown};
use crate::store::SqliteStore;
use crate::store::testing::{Database, FakeStore};
use crate::tasks::{LongTask, polls, short_polls};
use crate::tls::TlsFiles;
use crate::webhooks::WebhookSettings;

/// What the server runs in [`the_tasks_of_a_server_sleep_while_nothing_is_due`].
const OF_A_SERVER: [LongTask; 18] = [
    LongTask::Room,
    LongTask::Tournament,
    LongTask::Study,
    LongTask::ProcessClock,
    LongTask::Health,
    LongTask::Retention,
    LongTask::StudyDeletion,
    LongTask::Webhooks,
    LongTask::StalledConnections,
    LongTask::TokenFile,
    LongTask::SqliteWriter,
    LongTask::PlayReader,
    LongTask::PlayEnd,
    LongTask::Watch,
    LongTask::Spectate,
    LongTask::FollowTournament,
    LongTask::FollowStudy,
    LongTask::Participation,
];

/// What only the node runs in [`the_tasks_of_a_node_sleep_while_nothing_is_due`].
const OF_A_NODE: [LongTask; 4] = [
    LongTask::Node,
    LongTask::Joining,
    LongTask::Probing,
    LongTask::Certificates,
];

/// What neither runs.
const ELSEWHERE: [(LongTask, &str); 5] = [
    (
        LongTask::PostgresWriter,
        "needs PostgreSQL, which has a clock of its own",
    ),
    (
        LongTask::PostgresHandover,
        "needs PostgreSQL, which has a clock of its own",
    ),
    (LongTask::PeerStream, "needs the processes of two nodes"),
    (LongTask::SharedStream, "needs the processes of two nodes"),
    (LongTask::Sharing, "needs the processes of two nodes"),
];

/// For how long nothing happens.
const QUIET: Duration = Duration::from_secs(600);

/// A time that nothing exceeds in these tests, milliseconds.
const DAY_MS: u32 = 24 * 3_600 * 1_000;

/// After this time, a participant of the study who is away gives its place to others.
const DROPS_OUT_MS: u64 = 60_000;

/// Longer than a participant may be away.
const GRACE: Duration = Duration::from_secs(90);
/// When the database goes away, and how long joining may take.
const MINUTE: Duration = Duration::from_secs(60);

std::thread_local! {
    /// When the test of this thread began, on its stopped clock.
    static BEGAN: Instant = Instant::now();
}

/// A time of day that advances with the clock of the test.
fn stopped_clock() -> u64 {
    let passed = BEGAN.with(Instant::elapsed).as_millis();
    1_000_000 + u64::try_from(passed).expect("not that long")
}

/// Most polls of the tasks of a kind in a time in which nothing is due, or in which the server ends.
fn bound(task: LongTask, time: Duration) -> u64 {
    let per_minute = match task {
        // Ten times a second.
        LongTask::ProcessClock => 600,
        // They beat, and look for what nobody owns.
        LongTask::Node => 300,
        // Every second, on another thread.
        LongTask::TokenFile | LongTask::Certificates => 120,
        // Every 5 seconds.
        LongTask::StalledConnections | LongTask::Probing => 12,
        // At most heartbeats, every 15 seconds, and attempts to deliver.
        _ => 5,
    };
    FOR_EVENTS + per_minute * time.as_secs() / 60
}

/// Polls because of what happens: a stream ends, a participant goes, a game is suspended.
const FOR_EVENTS: u64 = 10;

/// Most polls of all short tasks in such a time: a node asks its database a few times in a second.
fn bound_of_short(time: Duration) -> u64 {
    20 * FOR_EVENTS + 4 * time.as_secs()
}

/// How often tasks have been polled.
struct Polls {
    long: BTreeMap<LongTask, u64>,
    short: u64,
    at: Instant,
}

impl Polls {
    fn now() -> Self {
        Self {
            long: polls(),
            short: short_polls(),
            at: Instant::now(),
        }
    }

    /// Checks how often tasks have been polled since.
    fn assert_few_since(&self, when: &str) {
        let time = self.at.elapsed();
        for (task, now) in polls() {
            let polled = now - self.long.get(&task).unwrap_or(&0);
            let most = bound(task, time);
            assert!(
                polled <= most,
                "{task:?} was polled {polled} times in {time:?}, of {most}: {when}"
            );
        }
        let (polled, most) = (short_polls() - self.short, bound_of_short(time));
        assert!(
            polled <= most,
            "short tasks were polled {polled} times in {time:?}, of {most}: {when}"
        );
    }
}

/// The clock stands still while this exists, also while the sockets of this machine are slow.
struct Still(#[expect(dead_code, reason = "its drop lets the clock run")] mpsc::Sender<()>);

impl Still {
    fn now() -> Self {
        let (held, ends) = mpsc::channel::<()>();
        tokio::task::spawn_blocking(move || ends.recv());
        Self(held)
    }
}

/// Reads a stream to its end, or to an error.
fn read<T: Send + 'static>(
    stream: impl Stream<Item = Result<T, tonic::Status>> + Send + 'static,
) -> JoinHandle<()> {
    tokio::spawn(
        stream
            .take_while(|read| futures::future::ready(read.is_ok()))
            .for_each(|_| async {}),
    )
}

fn built_in() -> v1::SeatConfig {
    v1::SeatConfig {
        filled_by: Some(v1::seat_config::FilledBy::BuiltInAgent("random".into())),
        ..v1::SeatConfig::default()
    }
}

/// A policy by which nobody is late.
fn patient() -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(DAY_MS),
        waiting_time_ms: Some(DAY_MS),
        absence_time_ms: Some(DAY_MS),
        spectators: Some(true),
        ..v1::RoomPolicy::default()
    }
}

/// A game that waits for its only participant, who plays, watches the seat and looks on.
async fn with_a_room(channel: &Channel) -> Vec<JoinHandle<()>> {
    let mut rooms = RoomServiceClient::new(channel.clone());
    let mut seats = vec![built_in(); 4];
    seats[0] = v1::SeatConfig::default();
    let room = rooms.create_room(v1::CreateRoomRequest {
        name: "room".into(),
        seats,
        policy: Some(patient()),
        ..v1::CreateRoomRequest::default()
    });
    let room = room.await.expect("a room").into_inner();
    let mut tickets = Vec::new();
    let joined = rooms.join_room(v1::JoinRoomRequest {
        join_code: room.join_code.clone(),
        name: "Ada".into(),
        ..v1::JoinRoomRequest::default()
    });
    tickets.push(joined.await.expect("a seat").into_inner().ticket);
    let attach = |ticket: &String| v1::Attach {
        ticket: ticket.clone(),
        request_id: 1,
        ..v1::Attach::default()
    };
    let mut plays = PlayServiceClient::new(channel.clone());
    // The seat attaches again on the other stream, so both are in the room.
    let commands = vec![v1::SeatCommand {
        handle: 1,
        command: Some(v1::seat_command::Command::Attach(attach(&tickets[0]))),
    }];
    let requests = futures::stream::iter([v1::PlayRequest { commands }]);
    let requests = requests.chain(futures::stream::pending());
    let playing = plays.play(requests).await.expect("a stream");
    let mut playing = playing.into_inner();
    playing
        .message()
        .await
        .expect("attached")
        .expect("a message");
    let seats = vec![attach(&tickets[0])];
    let watching = plays.watch(v1::PlayServiceWatchRequest { seats });
    let watching = watching.await.expect("a stream").into_inner();
    let room_id = room.room.expect("a room").room_id;
    let mut spectators = SpectatorServiceClient::new(channel.clone());
    let looking = spectators.watch(v1::SpectatorServiceWatchRequest {
        room_id,
        ..v1::SpectatorServiceWatchRequest::default()
    });
    let looking = looking.await.expect("a stream").into_inner();
    vec![read(playing), read(watching), read(looking)]
}

/// A tournament whose game waits for a participant.
async fn with_a_tournament(channel: &Channel) -> JoinHandle<()> {
    let mut tournaments = TournamentServiceClient::new(channel.clone());
    let cup = tournaments.create_tournament(v1::CreateTournamentRequest {
        settings: Some(v1::TournamentSettings {
            name: "cup".into(),
            format: v1::TournamentFormat::Swiss.into(),
            rounds: 1,
            built_in_agents: vec!["random".into(); 3],
            start_when_joined: 4,
            policy: Some(v1::RoomPolicy {
                waiting_time_ms: None,
                ..patient()
            }),
            no_show_time_ms: DAY_MS,
            ..v1::TournamentSettings::default()
        }),
        ..v1::CreateTournamentRequest::default()
    });
    let cup = cup.await.expect("a tournament").into_inner();
    let joined = tournaments.join_tournament(v1::JoinTournamentRequest {
        join_code: cup.join_code,
        name: "Bo".into(),
        ..v1::JoinTournamentRequest::default()
    });
    joined.await.expect("joined");
    let tournament_id = cup.tournament.expect("a tournament").tournament_id;
    let following = tournaments.follow_tournament(v1::FollowTournamentRequest { tournament_id });
    read(following.await.expect("a stream").into_inner())
}

/// A study whose participant has a game. Returns the stream of its owner, and that of the
/// participant.
async fn with_a_study(channel: &Channel) -> [JoinHandle<()>; 2] {
    use v1::study_stage::Stage;
    let mut studies = StudyServiceClient::new(channel.clone());
    let made = studies.create_study(v1::CreateStudyRequest {
        settings: Some(v1::StudySettings {
            name: "idle".into(),
            title: "A game of cards".into(),
            participants: 1,
            conditions: vec![v1::StudyCondition {
                id: "only".into(),
                seats: vec![built_in(); 3],
                policy: Some(v1::RoomPolicy {
                    spectators: None,
                    ..patient()
                }),
                ..v1::StudyCondition::default()
            }],
            stages: vec![v1::StudyStage {
                stage: Some(Stage::Games(v1::StudyGames { count: 1 })),
                ..v1::StudyStage::default()
            }],
            drop_out_after_ms: DROPS_OUT_MS,
            ..v1::StudySettings::default()
        }),
        ..v1::CreateStudyRequest::default()
    });
    let made = made.await.expect("a study").into_inner();
    let study_id = made.study.expect("a study").study_id;
    let added = studies.add_study_participants(v1::AddStudyParticipantsRequest {
        study_id: study_id.clone(),
        owner_token: made.owner_token.clone(),
        count: 1,
        ..v1::AddStudyParticipantsRequest::default()
    });
    let link = added
        .await
        .expect("a participant")
        .into_inner()
        .links
        .remove(0)
        .link;
    let following = studies.follow_study(v1::FollowStudyRequest {
        study_id,
        owner_token: made.owner_token,
    });
    let following = following.await.expect("a stream").into_inner();
    let mut own = ParticipationServiceClient::new(channel.clone());
    let opened = own
        .open_study(v1::OpenStudyRequest {
            link,
            ..Default::default()
        })
        .await;
    let session = opened.expect("a link").into_inner().session;
    let taking_part = own.follow_participation(v1::FollowParticipationRequest { session });
    let taking_part = taking_part.await.expect("a stream").into_inner();
    [read(following), read(taking_part)]
}

#[tokio::test(start_paused = true)]
async fn the_tasks_of_a_server_sleep_while_nothing_is_due() {
    let folder = tempfile::tempdir().expect("a folder");
    let still = Still::now();
    // Nobody receives them: each is tried again, with longer and longer pauses.
    let hook = "http://127.0.0.1:1/";
    let config = ServerConfig {
        data_dir: Some(folder.path().to_path_buf()),
        grace: GRACE,
        keep_games: Some(KeepGames::Newest(10)),
        webhooks: Some(WebhookSettings::new(hook, b"a secret", None).expect("an address")),
        access: AccessSettings {
            mode: Some(Mode::Open),
            ..AccessSettings::default()
        },
        ..ServerConfig::default()
    };
    let longest = longest_shutdown(config.grace);
    let store = SqliteStore::open_or_new(folder.path()).await;
    let store = Arc::new(store.expect("a new database"));
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("bound");
    let (stop, stopped) = oneshot::channel::<()>();
    let mut server = (Server::restored(config, Arc::clone(&store) as _).await).expect("readable");
    let (rooms, tracker) = (Arc::clone(&server.rooms), server.tracker.clone());
    server.studies = Studies::at(stopped_clock, rooms, tracker);
    let serving = tokio::spawn(server.serve(listener, async move {
        stopped.await.expect("the test stops it");
    }));
    let endpoint = Endpoint::new(format!("http://{address}")).expect("a URL");
    let channel = endpoint.connect().await.expect("it listens");
    let mut streams = with_a_room(&channel).await;
    streams.push(with_a_tournament(&channel).await);
    let [owner, participant] = with_a_study(&channel).await;
    streams.push(owner);
    drop(still);
    // What has just begun.
    sleep(Duration::from_secs(60)).await;
    // The disk has a clock of its own: what waits for it is committed before this.
    let still = Still::now();
    store.delete(Vec::new()).await.expect("committed");
    drop(still);

    let before = Polls::now();
    sleep(QUIET).await;
    before.assert_few_since("nothing happens");
    let driven: Vec<LongTask> = before.long.into_keys().collect();
    let mut wanted = OF_A_SERVER.to_vec();
    wanted.sort_unstable();
    assert_eq!(driven, wanted);
    assert!(
        streams.iter().all(|stream| !stream.is_finished()),
        "all are read"
    );

    let before = Polls::now();
    stop.send(()).expect("it serves");
    sleep(Duration::from_secs(1)).await;
    // A participant goes while the server ends: its place is due to others before the grace is over.
    participant.abort();
    let served = timeout(longest + Duration::from_secs(1), serving).await;
    let served = served.expect("it ends in time").expect("no panic");
    served.expect("nothing failed");
    before.assert_few_since("the server ends");
    for stream in streams {
        stream.await.expect("no panic");
    }
}

#[tokio::test(start_paused = true)]
async fn the_tasks_of_a_node_sleep_while_nothing_is_due() {
    let folder = tempfile::tempdir().expect("a folder");
    let made = rcgen::generate_simple_self_signed(["localhost".to_owned()]).expect("a name");
    let files = TlsFiles {
        certificate: folder.path().join("cert.pem"),
        key: folder.path().join("key.pem"),
        client_authority: None,
    };
    std::fs::write(&files.certificate, made.cert.pem()).expect("written");
    std::fs::write(&files.key, made.signing_key.serialize_pem()).expect("written");
    let database = Database::new();
    let store = FakeStore::new(&database);
    let shared: Arc<dyn ClusterStore> = Arc::clone(&store) as Arc<dyn ClusterStore>;
    let config = ServerConfig {
        tls: Some(files),
        ..ServerConfig::default()
    };
    let longest = longest_shutdown(config.grace);
    let node = Server::joined(config, shared, NodeInfo::default()).await;
    let node = node.expect("the database is there");
    let of_nodes = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let node = node.with_peers(PeerPort::new(of_nodes, None).expect("on this machine"));
    let rooms = Arc::clone(&node.rooms);
    let mut serves = node.node.as_ref().expect("a node").serves();
    let serving = tokio::spawn(node.serve_incoming(
        futures::stream::pending::<io::Result<tokio::io::DuplexStream>>(),
        std::future::pending(),
    ));
    serves.wait_for(|it| *it).await.expect("it runs");
    let room = rooms.create(crate::rooms::NewRoom::for_tests()).await;
    let room = room.expect("a room").handle.id();
    sleep(Duration::from_secs(60)).await;

    let before = Polls::now();
    sleep(QUIET).await;
    before.assert_few_since("nothing happens");
    for task in OF_A_NODE {
        assert!(before.long.contains_key(&task), "{task:?}");
    }

    // It hands its room over, although no other node is there, and leaves.
    let before = Polls::now();
    drop(rooms);
    database.ask_to_drain(store.node());
    let served = timeout(longest + Duration::from_secs(1), serving).await;
    let served = served.expect("it ends in time").expect("no panic");
    served.expect("nothing failed");
    before.assert_few_since("the node hands over");
    assert_eq!(database.owner(room), None);
}

#[test]
fn every_task_that_lives_long_is_driven() {
    let elsewhere = ELSEWHERE.iter().map(|(task, _)| *task);
    let mut driven: Vec<LongTask> = OF_A_SERVER
        .into_iter()
        .chain(OF_A_NODE)
        .chain(elsewhere)
        .collect();
    driven.sort_unstable();
    let mut all = LongTask::ALL.to_vec();
    all.sort_unstable();
    assert_eq!(
        driven, all,
        "drive a new task in these tests, or say why not"
    );
}

#[tokio::test(start_paused = true)]
async fn a_node_whose_database_is_away_ends_within_one_budget() {
    let database = Database::new();
    let store = FakeStore::new(&database);
    let shared: Arc<dyn ClusterStore> = Arc::clone(&store) as Arc<dyn ClusterStore>;
    let config = ServerConfig::default();
    let longest = longest_shutdown(config.grace);
    let info = NodeInfo::default();
    let node = timeout(MINUTE, Server::joined(config, shared, info)).await;
    let node = node.expect("in time").expect("the database is there");
    let (stop, stopped) = oneshot::channel::<()>();
    let serving = node.serve_incoming(stream::pending::<io::Result<DuplexStream>>(), async {
        stopped.await.expect("the test stops it");
    });
    let away = async {
        sleep(MINUTE).await;
        store.cut_off.send_replace(true);
        stop.send(()).expect("it serves");
    };
    let served = timeout(MINUTE + longest, both(serving, away)).await;
    let (served, ()) = served.expect("it ends in time");
    served.expect("only the database is away");
}

#[tokio::test]
async fn a_silent_connection_to_the_listener_for_nodes_is_closed() {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = listener.local_addr().expect("it listens");
    let database = Database::new();
    let shared: Arc<dyn ClusterStore> = FakeStore::new(&database);
    let config = ServerConfig {
        first_bytes_timeout: Duration::from_millis(10),
        ..ServerConfig::default()
    };
    let node = Server::joined(config, shared, NodeInfo::default()).await;
    let node = node.expect("the database is there");
    let node = node.with_peers(PeerPort::new(listener, None).expect("on this machine"));
    let nobody = stream::pending::<io::Result<DuplexStream>>();
    let serving = tokio::spawn(node.serve_incoming(nobody, std::future::pending()));
    let mut silent = TcpStream::connect(address).await.expect("it listens");
    let read = timeout(MINUTE, silent.read_to_end(&mut Vec::new())).await;
    // With or without an error.
    let _ = read.expect("it is closed");
    assert!(!serving.is_finished(), "the node serves others");
    serving.abort();
}
