//! Waits while a room or tournament changes hands: its clients find it as soon as another node has
//! it, rather than after one of their pauses, which grow. A single server waits for nothing.

use std::collections::BTreeSet;
use std::time::Duration;

use tokio::time::{Instant, sleep, timeout};
use tonic::transport::Channel;
use tonic::{Code, Status};
use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_client::HealthClient;

use super::status::is_elsewhere;
use chefshat_admission::limits::Key;
use chefshat_hosting::cluster::{Directory, FoundBy, Location, Peer};
use chefshat_hosting::room::Handle;
use chefshat_hosting::rooms::Rooms;
use chefshat_room::ids::UnitId;

/// How long a client waits: as long as its longest pause, after which it begins with the shortest.
pub(super) const PATIENCE: Duration = Duration::from_secs(5);
/// Pauses between two looks.
const FIRST_PAUSE: Duration = Duration::from_millis(20);
const LONGEST_PAUSE: Duration = Duration::from_millis(250);
/// How long another node may take to answer.
const ANSWER_LIMIT: Duration = Duration::from_secs(1);

/// The pauses of one client.
pub(super) struct Pauses {
    began: Instant,
    next: Duration,
}

impl Pauses {
    pub(super) fn new() -> Self {
        Self {
            began: Instant::now(),
            next: FIRST_PAUSE,
        }
    }

    /// The time until the next look.
    pub(super) fn next(&mut self) -> Duration {
        let longer = LONGEST_PAUSE.min(self.next * 2);
        std::mem::replace(&mut self.next, longer)
    }

    /// Waits before the next look; `false` if the client has waited for long enough.
    async fn pause(&mut self) -> bool {
        if self.began.elapsed() >= PATIENCE {
            return false;
        }
        sleep(self.next()).await;
        true
    }
}

/// Whether clients wait here for what changes hands. Those of a node that is drained connect to
/// another one.
pub(super) fn waits(rooms: &Rooms) -> bool {
    rooms.lease().is_some() && !rooms.is_shutting_down()
}

/// Whether a room is about to be taken over or resumed.
pub(super) fn is_changing(found: &Result<Handle, Status>) -> bool {
    match found {
        Ok(room) => room.is_gone(),
        Err(status) => status.code() == Code::Unavailable && is_elsewhere(status).is_none(),
    }
}

/// Looks for a room until it is not about to be taken over or resumed.
pub(super) async fn settled<F>(rooms: &Rooms, look: impl Fn() -> F) -> Result<Handle, Status>
where
    F: Future<Output = Result<Handle, Status>>,
{
    let mut pauses = Pauses::new();
    loop {
        let found = look().await;
        if !(is_changing(&found) && waits(rooms) && pauses.pause().await) {
            return found;
        }
    }
}

/// Waits until another node has one of the rooms and tournaments of a peer, unless that answers.
pub(super) async fn awaited(
    directory: &dyn Directory,
    peer: &Peer,
    channel: Channel,
    ids: BTreeSet<UnitId>,
) {
    let mut health = HealthClient::new(channel);
    let mut pauses = Pauses::new();
    loop {
        let check = health.check(HealthCheckRequest::default());
        if let Ok(Ok(_)) = timeout(ANSWER_LIMIT, check).await {
            return;
        }
        for id in &ids {
            let found_by = FoundBy::Id(*id);
            directory.forget(&found_by);
            match directory.locate(&found_by, Key::Resumed).await {
                Location::Unknown => {}
                Location::Node(owner) if owner == *peer => {}
                _ => return,
            }
        }
        if !pauses.pause().await {
            return;
        }
    }
}
