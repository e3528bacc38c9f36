//! Webhooks: what happens on the server, as signed POST requests to an address of the operator's.
//! Events wait in a bounded queue and one task delivers them, so no room or tournament ever waits.
//! `delivery` decides which event is sent when, `settings` says where they go, `chefshat_base::post` sends
//! a single request.

mod delivery;
mod event;
mod settings;

use std::fmt;
use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_room::ids::{TournamentId, UnitId};
use chefshat_room::journal::GameHeader;
use serde_json::{Value, json};
use tokio::sync::{Semaphore, mpsc};
use tokio_util::sync::CancellationToken;
use tracing::warn;

use delivery::Delivery;
pub use delivery::{ANSWER_TIME, LAST_DELIVERIES, MAX_ATTEMPTS, MAX_HOLD_UP, MAX_PAUSE};
use event::{Event, Outcomes};
pub use settings::{FIRST_PAUSE, WebhookSettings};

use chefshat_base::SERVER_VERSION;
use chefshat_base::clock::since_epoch_ms;
use chefshat_base::lock::Lock;
use chefshat_base::metrics::{Metrics, WebhookOutcome};

/// Most events that wait for delivery, between attempts too. Further ones are dropped and counted.
pub const MAX_WAITING: usize = 1_024;

/// Announces what happens; does nothing without an address. Cheap to clone.
#[derive(Debug, Clone, Default)]
pub struct Webhooks(Option<Arc<Queue>>);

#[derive(Debug)]
struct Queue {
    events: mpsc::Sender<Event>,
    /// A permit for each event that is not settled.
    places: Arc<Semaphore>,
    /// Taken by the task that delivers.
    delivery: Lock<Option<Delivery>>,
    outcomes: Outcomes,
}

impl Webhooks {
    /// Prepares webhooks. [`Webhooks::deliver`] delivers them.
    pub fn new(settings: WebhookSettings, metrics: Arc<Metrics>) -> Self {
        // An event with a place always fits.
        let (events, waiting) = mpsc::channel(MAX_WAITING);
        let delivery = Delivery::new(settings, waiting);
        Self(Some(Arc::new(Queue {
            events,
            places: Arc::new(Semaphore::new(MAX_WAITING)),
            delivery: Lock::new(Some(delivery)),
            outcomes: Outcomes::new(metrics),
        })))
    }

    /// Whether anything is announced.
    pub fn is_on(&self) -> bool {
        self.0.is_some()
    }

    /// Number of events that are not settled.
    pub fn waiting(&self) -> usize {
        (self.0.as_ref()).map_or(0, |queue| MAX_WAITING - queue.places.available_permits())
    }

    /// A room was created.
    pub fn room_created(&self, header: &GameHeader) {
        let id = header.room_id;
        self.announce("room.created", id, id, || of_game(header));
    }

    /// The game of a room has ended. `summary` as in lists of records; `None` if nothing was dealt.
    pub fn game_ended(&self, header: &GameHeader, summary: Option<&v1::RecordSummary>) {
        self.announce("game.ended", header.game_id, header.room_id, || {
            let mut data = of_game(header);
            data["record"] = json!(summary);
            data
        });
    }

    /// A tournament has started.
    pub fn tournament_started(&self, tournament: TournamentId, name: &str, participants: usize) {
        self.announce("tournament.started", tournament, tournament, || {
            json!({
                "tournament_id": tournament.to_string(),
                "name": name,
                "participants": participants,
            })
        });
    }

    /// A tournament is over: finished, or closed before.
    pub fn tournament_ended(&self, tournament: TournamentId, name: &str, finished: bool) {
        self.announce("tournament.ended", tournament, tournament, || {
            json!({
                "tournament_id": tournament.to_string(),
                "name": name,
                "finished": finished,
            })
        });
    }

    /// Queues an event, or drops it if too many wait. `of`: what its id names.
    fn announce(
        &self,
        kind: &str,
        of: impl fmt::Display,
        about: impl Into<UnitId>,
        data: impl FnOnce() -> Value,
    ) {
        let Some(queue) = &self.0 else {
            return;
        };
        let Ok(place) = Arc::clone(&queue.places).try_acquire_owned() else {
            queue.outcomes.metrics.webhook(WebhookOutcome::Dropped);
            if queue.outcomes.pace.admits() {
                warn!(kind, "a webhook was dropped: {MAX_WAITING} wait already");
            }
            return;
        };
        let id = format!("{kind}:{of}");
        let body = json!({
            "id": id,
            "type": kind,
            "at_ms": since_epoch_ms(),
            "server_version": SERVER_VERSION,
            "data": data(),
        });
        // It fails only once nothing is delivered any more.
        let _ = queue.events.try_send(Event {
            about: about.into(),
            id,
            body: body.to_string().into(),
            _place: place,
        });
    }

    /// Delivers events until `closing`, then, for [`LAST_DELIVERIES`], those that still wait.
    pub async fn deliver(self, closing: CancellationToken) {
        let Some(queue) = self.0 else {
            return;
        };
        let delivery = queue.delivery.lock().take();
        if let Some(delivery) = delivery {
            delivery.run(&queue.outcomes, closing).await;
        }
    }
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
