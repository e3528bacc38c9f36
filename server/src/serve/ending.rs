//! The end of a server: running games may finish, the others are suspended, and what is still written or
//! sent has its time. All steps share one budget.

use std::future::Future;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use tokio::task::JoinHandle;
use tokio::time::{Instant, timeout_at};
use tokio_util::sync::CancellationToken;
use tokio_util::task::TaskTracker;
use tonic_health::ServingStatus;
use tonic_health::server::HealthReporter;
use tracing::{info, warn};

use crate::config::{CLOSE_LIMIT, DRAIN_LIMIT, END_LIMIT, HAND_OVER_LIMIT, longest_shutdown};
use crate::node::ClusterNode;
use crate::rooms::Rooms;
use crate::store::Store;
use crate::studies::Studies;
use crate::tournaments::Tournaments;

/// What ends with a server.
pub(super) struct Ending {
    /// Closes the connections.
    pub(super) closing: CancellationToken,
    pub(super) store: Arc<dyn Store>,
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    studies: Arc<Studies>,
    /// How long running games may continue.
    grace: Duration,
    /// When the shutdown began.
    began: OnceLock<Instant>,
}

impl Ending {
    /// An end that gives running games this time.
    pub(super) fn new(
        store: &Arc<dyn Store>,
        rooms: &Arc<Rooms>,
        tournaments: &Arc<Tournaments>,
        studies: &Arc<Studies>,
        grace: Duration,
    ) -> Self {
        Self {
            closing: CancellationToken::new(),
            store: Arc::clone(store),
            rooms: Arc::clone(rooms),
            tournaments: Arc::clone(tournaments),
            studies: Arc::clone(studies),
            grace,
            began: OnceLock::new(),
        }
    }

    /// Waits until the end is requested. Then lets games end within the grace, suspends the others, or
    /// hands them over to other nodes, and closes the connections.
    pub(super) async fn begin(
        &self,
        requested: impl Future<Output = ()>,
        mut node: Option<&mut ClusterNode>,
        health: &HealthReporter,
        following: JoinHandle<Option<()>>,
    ) {
        match &node {
            None => requested.await,
            Some(node) => tokio::select! {
                () = requested => {}
                () = node.asked_to_drain() => info!("asked to hand over to the other nodes"),
            },
        }
        info!(
            grace_seconds = self.grace.as_secs(),
            open_rooms = self.rooms.open_count(),
            "shutting down: no new rooms; running games may finish"
        );
        following.abort();
        health
            .set_service_status("", ServingStatus::NotServing)
            .await;
        let began = *self.began.get_or_init(Instant::now);
        let games_end = began + self.grace.max(HAND_OVER_LIMIT) + END_LIMIT;
        if let Some(node) = &mut node {
            self.rooms.refuse_new();
            if timeout_at(games_end, node.drain()).await.is_err() {
                warn!(
                    "not everything was handed over; other nodes take it over when the lease expires"
                );
                self.rooms.fence_all();
            }
        }
        self.store.stop_waiting();
        // Games that end from here on count when the server is restarted.
        self.tournaments.stop();
        self.studies.stop();
        let grace_left = (began + self.grace).saturating_duration_since(Instant::now());
        let ended = timeout_at(games_end, self.rooms.shut_down(grace_left)).await;
        if ended.is_err() {
            warn!("not all games could be suspended in time; their journals are stored");
        }
        self.tournaments.end();
        self.studies.end();
        self.closing.cancel();
    }

    /// Waits for what is still to be written or sent, and closes the database.
    pub(super) async fn finish(self, tracker: &TaskTracker, is_node: bool) {
        self.tournaments.end();
        self.studies.end();
        drop((self.rooms, self.tournaments, self.studies));
        tracker.close();
        // The database may be away, for which a node does not wait.
        let began = self.began.get().copied().filter(|_| !is_node);
        let latest = began.map(|began| began + longest_shutdown(self.grace));
        let soonest = Instant::now() + DRAIN_LIMIT;
        let end = latest.map_or(soonest, |latest| soonest.max(latest - CLOSE_LIMIT));
        if timeout_at(end, tracker.wait()).await.is_err() {
            warn!("not everything that was to be written or sent has been");
        }
        let soonest = Instant::now() + CLOSE_LIMIT;
        let end = latest.map_or(soonest, |latest| soonest.max(latest));
        if timeout_at(end, self.store.close()).await.is_err() {
            warn!("the database was not closed in time; what was acknowledged is stored");
        }
    }
}
