//! Webhooks: what happens on the server, as signed POST requests to an address of the operator's.
//! Events wait in a bounded queue and one task delivers them in order, so no room or tournament ever
//! waits. `settings` says where they go, `crate::post` sends
//! a single request.

mod settings;

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bytes::Bytes;
use chefshat_proto::v1;
use chefshat_room::ids::Id;
use chefshat_room::journal::GameHeader;
use hmac::{Hmac, KeyInit as _, Mac as _};
use serde_json::{Value, json};
use sha2::Sha256;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep, timeout_at};
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

pub use settings::{FIRST_PAUSE, WebhookSettings};

use crate::clock::since_epoch;
use crate::config::SERVER_VERSION;
use crate::limits::LogPace;
use crate::metrics::{Metrics, WebhookOutcome};
use crate::post::PostError;

/// Most events that wait for delivery. Further ones are dropped and counted.
pub const MAX_WAITING: usize = 1_024;
/// How often an event is sent before it is given up.
pub const MAX_ATTEMPTS: u32 = 10;
/// Longest pause between two attempts.
pub const MAX_PAUSE: Duration = Duration::from_secs(60);
/// How long a server that stops delivers what still waits.
const LAST_DELIVERIES: Duration = Duration::from_secs(4);
/// How long a receiver may take to answer.
pub const ANSWER_TIME: Duration = Duration::from_secs(10);
/// Lines of the log about failures in a minute.
const LINES_PER_MINUTE: u32 = 10;

/// Announces what happens; does nothing without an address. Cheap to clone.
#[derive(Debug, Clone, Default)]
pub struct Webhooks(Option<Arc<Queue>>);

#[derive(Debug)]
struct Queue {
    events: mpsc::Sender<Event>,
    /// Taken by the task that delivers.
    delivery: Mutex<Option<Delivery>>,
    metrics: Arc<Metrics>,
    pace: LogPace,
}

/// An event on its way.
#[derive(Debug)]
struct Event {
    /// The same for the same event, also if two servers announce it.
    id: String,
    body: Bytes,
}

/// What delivers events.
#[derive(Debug)]
struct Delivery {
    settings: WebhookSettings,
    waiting: mpsc::Receiver<Event>,
}

impl Webhooks {
    /// Prepares webhooks. [`Webhooks::deliver`] delivers them.
    pub fn new(settings: WebhookSettings, metrics: Arc<Metrics>) -> Self {
        let (events, waiting) = mpsc::channel(MAX_WAITING);
        let delivery = Delivery { settings, waiting };
        Self(Some(Arc::new(Queue {
            events,
            delivery: Mutex::new(Some(delivery)),
            metrics,
            pace: LogPace::new(LINES_PER_MINUTE),
        })))
    }

    /// Whether anything is announced.
    pub fn is_on(&self) -> bool {
        self.0.is_some()
    }

    /// Number of events that wait.
    pub fn waiting(&self) -> usize {
        (self.0.as_ref()).map_or(0, |queue| MAX_WAITING - queue.events.capacity())
    }

    /// A room was created.
    pub fn room_created(&self, header: &GameHeader) {
        self.announce("room.created", header.room_id, || of_game(header));
    }

    /// The game of a room has ended. `summary` as in lists of records; `None` if nothing was dealt.
    pub fn game_ended(&self, header: &GameHeader, summary: Option<&v1::RecordSummary>) {
        self.announce("game.ended", header.game_id, || {
            let mut data = of_game(header);
            data["record"] = json!(summary);
            data
        });
    }

    /// A tournament has started.
    pub fn tournament_started(&self, tournament: Id, name: &str, participants: usize) {
        self.announce("tournament.started", tournament, || {
            json!({
                "tournament_id": tournament.to_string(),
                "name": name,
                "participants": participants,
            })
        });
    }

    /// A tournament is over: finished, or closed before.
    pub fn tournament_ended(&self, tournament: Id, name: &str, finished: bool) {
        self.announce("tournament.ended", tournament, || {
            json!({
                "tournament_id": tournament.to_string(),
                "name": name,
                "finished": finished,
            })
        });
    }

    /// Queues an event, or drops it if too many wait.
    fn announce(&self, kind: &str, about: Id, data: impl FnOnce() -> Value) {
        let Some(queue) = &self.0 else {
            return;
        };
        let Ok(place) = queue.events.try_reserve() else {
            queue.metrics.webhook(WebhookOutcome::Dropped);
            if queue.pace.admits() {
                warn!(kind, "a webhook was dropped: {MAX_WAITING} wait already");
            }
            return;
        };
        let id = format!("{kind}:{about}");
        let body = json!({
            "id": id,
            "type": kind,
            "at_ms": u64::try_from(since_epoch().as_millis()).unwrap_or(u64::MAX),
            "server_version": SERVER_VERSION,
            "data": data(),
        });
        place.send(Event {
            id,
            body: body.to_string().into(),
        });
    }

    /// Delivers events until `closing`, then, for a short time, those that still wait.
    pub async fn deliver(self, closing: CancellationToken) {
        let Some(queue) = self.0 else {
            return;
        };
        let delivery = (queue
            .delivery
            .lock()
            .unwrap_or_else(PoisonError::into_inner))
        .take();
        let Some(mut delivery) = delivery else {
            return;
        };
        while let Some(event) = tokio::select! {
            event = delivery.waiting.recv() => event,
            () = closing.cancelled() => None,
        } {
            queue.deliver_one(&delivery, &event, &closing).await;
        }
        let until = Instant::now() + LAST_DELIVERIES;
        while let Ok(event) = delivery.waiting.try_recv() {
            let sent = timeout_at(until, delivery.send(&event)).await;
            let outcome = match sent {
                Ok(Ok(())) => WebhookOutcome::Delivered,
                _ => WebhookOutcome::Failed,
            };
            queue.metrics.webhook(outcome);
        }
    }
}

impl Queue {
    /// Sends an event until it is received, is given up, or the server stops.
    async fn deliver_one(&self, delivery: &Delivery, event: &Event, closing: &CancellationToken) {
        let mut pause = delivery.settings.first_pause;
        for attempt in 1..=MAX_ATTEMPTS {
            let problem = match delivery.send(event).await {
                Ok(()) => {
                    debug!(event = event.id, attempt, "a webhook was delivered");
                    self.metrics.webhook(WebhookOutcome::Delivered);
                    return;
                }
                Err(problem) => problem,
            };
            if self.pace.admits() {
                warn!(event = event.id, attempt, %problem, "a webhook was not received");
            }
            if attempt == MAX_ATTEMPTS || closing.is_cancelled() {
                break;
            }
            tokio::select! {
                () = sleep(pause) => {}
                // One more attempt.
                () = closing.cancelled() => {}
            }
            pause = (2 * pause).min(MAX_PAUSE);
        }
        self.metrics.webhook(WebhookOutcome::Failed);
        if self.pace.admits() {
            warn!(event = event.id, "a webhook was given up");
        }
    }
}

impl Delivery {
    async fn send(&self, event: &Event) -> Result<(), PostError> {
        let timestamp = since_epoch().as_secs();
        let signature = signature(&self.settings.secret, timestamp, &event.body);
        let headers = [
            ("chefshat-delivery", event.id.clone()),
            ("chefshat-signature", signature),
        ];
        let target = &self.settings.target;
        match target
            .post(event.body.clone(), headers, ANSWER_TIME, 0)
            .await
        {
            // Only the status matters.
            Ok(_) | Err(PostError::Body(_)) => Ok(()),
            Err(problem) => Err(problem),
        }
    }
}

/// The signature of a body at a time, seconds since the Unix epoch.
fn signature(secret: &[u8], timestamp: u64, body: &[u8]) -> String {
    let mut mac = Hmac::<Sha256>::new_from_slice(secret).expect("HMAC takes keys of any length");
    mac.update(format!("{timestamp}.").as_bytes());
    mac.update(body);
    let code = hex::encode(mac.finalize().into_bytes());
    format!("t={timestamp},v1={code}")
}

fn of_game(header: &GameHeader) -> Value {
    json!({
        "room_id": header.room_id.to_string(),
        "game_id": header.game_id.to_string(),
        "name": header.name,
        "created_at_ms": header.created_at_ms,
        "tournament_id": header.tournament.map(|game| game.tournament.to_string()),
    })
}

#[cfg(test)]
mod tests;
