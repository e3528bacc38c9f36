//! A server in this process, on a free port of the loopback interface.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{Client, Connection, RandomAgent};
use chefshat_proto::v1::{self, spectator_service_client::SpectatorServiceClient};
use chefshat_server::config::ServerConfig;
use chefshat_server::host::{Host, HostError};
use chefshat_server::serve::ServeError;
use chefshat_server::store::{MemoryStore, Store};
use tempfile::TempDir;
use tokio::task::JoinHandle;
use tonic::Streaming;
use tonic::transport::Channel;

use crate::patiently;

/// A server that runs until it is stopped or dropped.
#[derive(Debug)]
pub struct TestServer {
    /// Its address.
    pub address: SocketAddr,
    data: TempDir,
    host: Host,
}

impl TestServer {
    /// A server with a memory store and its own data folder.
    pub async fn start() -> Self {
        Self::with(|_| {}, Arc::new(MemoryStore::default())).await
    }

    /// A server configured by `configure`, with this store.
    pub async fn with(configure: impl FnOnce(&mut ServerConfig), store: Arc<dyn Store>) -> Self {
        let data = tempfile::tempdir().expect("a temporary folder");
        let mut config = ServerConfig {
            data_dir: Some(data.path().to_path_buf()),
            grace: Duration::ZERO,
            ..ServerConfig::default()
        };
        configure(&mut config);
        let host = Host::start(config, store).await.expect("a free port");
        Self {
            address: host.address(),
            data,
            host,
        }
    }

    /// Its URL.
    pub fn url(&self) -> String {
        self.host.url()
    }

    /// Its data folder.
    pub fn data_dir(&self) -> &Path {
        self.data.path()
    }

    /// A separate connection to the server.
    pub async fn channel(&self) -> Connection {
        let channel = Channel::from_shared(self.url())
            .expect("a URL")
            .connect()
            .await
            .expect("the server listens");
        Client::from_channel(channel).channel()
    }

    /// An SDK client with a separate connection.
    pub async fn client(&self) -> Client {
        Client::connect(&self.url())
            .await
            .expect("the server listens")
    }

    /// Requests a stop of the server.
    pub fn request_stop(&self) {
        self.host.request_stop();
    }

    /// Waits until the server has ended on its own.
    ///
    /// # Errors
    /// The reason why it ended.
    pub async fn ended(self) -> Result<(), ServeError> {
        match self.host.ended().await {
            Ok(()) => Ok(()),
            Err(HostError::Serve(error)) => Err(error),
            Err(HostError::BrokenOff(error)) => panic!("the server does not panic: {error}"),
        }
    }

    /// Stops the server and waits until it has ended; returns its data folder.
    pub async fn stop(self) -> TempDir {
        crate::patiently("the server to stop", self.host.stop())
            .await
            .expect("a clean end");
        self.data
    }
}

/// Rules for games of one Shift.
pub fn one_shift() -> v1::RuleSet {
    v1::RuleSet {
        stop: Some(v1::rule_set::Stop::TargetShifts(1)),
        ..v1::RuleSet::default()
    }
}

/// Creates a room with four open seats, this policy and these rules; returns the tickets in seat
/// order.
pub async fn room_of_four(
    client: &Client,
    rules: v1::RuleSet,
    policy: v1::RoomPolicy,
) -> (v1::CreateRoomResponse, Vec<String>) {
    let created = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(rules),
            policy: Some(policy),
            ..v1::CreateRoomRequest::default()
        })
        .await
        .expect("a new room");
    let mut tickets = Vec::new();
    for seat in 0..4 {
        let joined = client
            .join(v1::JoinRoomRequest {
                join_code: created.join_code.clone(),
                name: format!("agent {seat}"),
                seat: Some(seat),
                ..v1::JoinRoomRequest::default()
            })
            .await
            .expect("a free seat");
        tickets.push(joined.ticket);
    }
    (created, tickets)
}

/// A random agent of the SDK for each ticket, each with its own seed.
pub fn random_agents(tickets: Vec<String>) -> Vec<(String, RandomAgent)> {
    tickets
        .into_iter()
        .zip(0..)
        .map(|(ticket, seed)| (ticket, RandomAgent::new(seed)))
        .collect()
}

/// Plays a game to its end with random agents over one connection.
pub async fn play_out(server: &TestServer, tickets: Vec<String>) {
    let client = server.client().await;
    let playing = client.play_many(random_agents(tickets));
    for outcome in crate::patiently("the game to end", playing).await {
        outcome.expect("the game ended");
    }
}

/// A spectator that does not read: its window is small, so that unread data waits at the server,
/// not in this process.
pub async fn narrow_spectator(
    server: &TestServer,
    room_id: String,
) -> Streaming<v1::SpectatorServiceWatchResponse> {
    let channel = Channel::from_shared(server.url())
        .expect("a URL")
        .initial_stream_window_size(8 * 1024)
        .connect()
        .await
        .expect("the server listens");
    SpectatorServiceClient::new(channel)
        .watch(v1::SpectatorServiceWatchRequest {
            room_id,
            ..v1::SpectatorServiceWatchRequest::default()
        })
        .await
        .expect("a stream")
        .into_inner()
}

/// Watches a room until the task is aborted.
pub fn watched(client: &Client, room_id: &str) -> JoinHandle<()> {
    let mut spectator = client.spectate(room_id, 0);
    tokio::spawn(async move { while let Ok(Some(_)) = spectator.next().await {} })
}

/// Waits until a room has a number of spectators.
///
/// # Panics
/// It never has.
pub async fn until_watched_by(client: &Client, room_id: &str, spectators: usize) {
    let counting = async {
        let now = async || client.get_room(room_id).await.expect("a room").spectators;
        while usize::try_from(now().await) != Ok(spectators) {
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    };
    patiently(&format!("{spectators} spectators"), counting).await;
}
