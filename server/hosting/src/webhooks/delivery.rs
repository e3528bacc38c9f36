//! Which event is sent when. Events about one room or tournament are sent in order; others overtake
//! one that must be repeated. An event that the receiver refuses is not repeated.

use std::collections::{BTreeMap, VecDeque};
use std::time::Duration;

use bytes::Bytes;
use chefshat_room::ids::UnitId;
use hmac::{Hmac, KeyInit as _, Mac as _};
use http::StatusCode;
use sha2::Sha256;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until, timeout_at};
use tokio_util::sync::CancellationToken;
use tracing::{debug, warn};

use super::event::{Event, Outcomes};
use super::settings::WebhookSettings;
use chefshat_base::clock::since_epoch;
use chefshat_base::metrics::WebhookOutcome;
use chefshat_base::post::{Answer, PostError};

/// How often an event is sent before it is given up.
pub const MAX_ATTEMPTS: u32 = 10;
/// Longest pause between two attempts for one event.
pub const MAX_PAUSE: Duration = Duration::from_secs(60);
/// Longest time for which events that fail hold up the others.
pub const MAX_HOLD_UP: Duration = Duration::from_secs(10);
/// How long a server that stops delivers what still waits.
pub const LAST_DELIVERIES: Duration = Duration::from_secs(4);
/// How long a receiver may take to answer.
pub const ANSWER_TIME: Duration = Duration::from_secs(10);

/// What delivers events.
#[derive(Debug)]
pub(super) struct Delivery {
    settings: WebhookSettings,
    waiting: mpsc::Receiver<Event>,
    /// By room or tournament. None is empty.
    lines: BTreeMap<UnitId, Line>,
    /// Number of the next line.
    next_line: u64,
    /// When the next event may be sent: the receiver may be away.
    held_up_until: Option<Instant>,
    /// How long the next failure holds up.
    next_hold_up: Duration,
}

/// The events about one room or tournament, in order.
#[derive(Debug)]
struct Line {
    /// Older lines have lower numbers.
    number: u64,
    events: VecDeque<Event>,
    /// Failed attempts for the first event.
    attempts: u32,
    /// When the first event is sent again; `None`: it was not sent yet.
    again_at: Option<Instant>,
}

/// What became of an attempt.
enum Attempt {
    Received,
    /// Repeating it is pointless.
    Refused(PostError),
    /// It is repeated later.
    Failed(PostError),
}

impl Delivery {
    pub(super) fn new(settings: WebhookSettings, waiting: mpsc::Receiver<Event>) -> Self {
        Self {
            next_hold_up: settings.first_pause.min(MAX_HOLD_UP),
            settings,
            waiting,
            lines: BTreeMap::new(),
            next_line: 0,
            held_up_until: None,
        }
    }

    /// Delivers events until `closing`, then tries each that waits once more.
    pub(super) async fn run(mut self, outcomes: &Outcomes, closing: CancellationToken) {
        let is_closing = closing.clone();
        loop {
            while let Ok(event) = self.waiting.try_recv() {
                self.add(event);
            }
            let next = self.next();
            let at = next.map_or_else(Instant::now, |(_, at)| at);
            tokio::select! {
                biased;
                () = is_closing.cancelled() => break,
                event = self.waiting.recv() => match event {
                    Some(event) => self.add(event),
                    None => break,
                },
                () = sleep_until(at), if next.is_some() => {
                    let (about, _) = next.expect("an event waits");
                    self.attempt(about, outcomes, &closing).await;
                }
            }
        }
        self.finish(outcomes).await;
    }

    fn add(&mut self, event: Event) {
        let number = self.next_line;
        let line = self.lines.entry(event.about).or_insert_with(|| Line {
            number,
            events: VecDeque::new(),
            attempts: 0,
            again_at: None,
        });
        line.events.push_back(event);
        self.next_line += 1;
    }

    /// The line whose first event is sent next, and when. What was not sent yet comes before what
    /// failed, and among these the oldest.
    fn next(&self) -> Option<(UnitId, Instant)> {
        let now = Instant::now();
        let from = self.held_up_until.unwrap_or(now).max(now);
        let at = |line: &Line| line.again_at.unwrap_or(from).max(from);
        let lines = self.lines.iter();
        let key = |line: &Line| (at(line), line.again_at.is_some(), line.number);
        let (about, line) = lines.min_by_key(|(_, line)| key(line))?;
        Some((*about, at(line)))
    }

    /// Sends the first event of a line, and settles it unless it is to be repeated.
    async fn attempt(&mut self, about: UnitId, outcomes: &Outcomes, closing: &CancellationToken) {
        let event = &self.lines[&about].events[0];
        let id = event.id.clone();
        let sent = tokio::select! {
            sent = self.send(event) => sent,
            // It is tried once more with the others that wait.
            () = closing.cancelled() => return,
        };
        if let Attempt::Failed(problem) = sent {
            return self.failed(about, &problem, outcomes);
        }
        // The receiver is there.
        self.held_up_until = None;
        self.next_hold_up = self.settings.first_pause.min(MAX_HOLD_UP);
        match sent {
            Attempt::Refused(problem) => {
                if outcomes.pace.admits() {
                    warn!(event = id, %problem, "a webhook was refused, and is not repeated");
                }
                outcomes.metrics.webhook(WebhookOutcome::Refused);
            }
            _ => {
                debug!(event = id, "a webhook was delivered");
                outcomes.metrics.webhook(WebhookOutcome::Delivered);
            }
        }
        self.settle(about);
    }

    /// Sets when an event is sent again, or gives it up.
    fn failed(&mut self, about: UnitId, problem: &PostError, outcomes: &Outcomes) {
        let now = Instant::now();
        self.held_up_until = Some(now + self.next_hold_up);
        self.next_hold_up = (2 * self.next_hold_up).min(MAX_HOLD_UP);
        let line = self.lines.get_mut(&about).expect("its event was sent");
        line.attempts += 1;
        let (event, attempt) = (&line.events[0].id, line.attempts);
        if outcomes.pace.admits() {
            warn!(event, attempt, %problem, "a webhook was not received");
        }
        if attempt < MAX_ATTEMPTS {
            let pause = self.settings.first_pause * 2_u32.pow(attempt - 1);
            let asked = match problem {
                PostError::Status(answer) => answer.retry_after.unwrap_or_default(),
                _ => Duration::ZERO,
            };
            line.again_at = Some(now + pause.max(asked).min(MAX_PAUSE));
            return;
        }
        if outcomes.pace.admits() {
            warn!(event, "a webhook was given up");
        }
        outcomes.metrics.webhook(WebhookOutcome::Failed);
        self.settle(about);
    }

    /// Removes the first event of a line.
    fn settle(&mut self, about: UnitId) {
        let Some(line) = self.lines.get_mut(&about) else {
            return;
        };
        line.events.pop_front();
        (line.attempts, line.again_at) = (0, None);
        // Events about others that have waited as long come first.
        line.number = self.next_line;
        self.next_line += 1;
        if line.events.is_empty() {
            self.lines.remove(&about);
        }
    }

    /// Tries everything that waits once more, oldest lines first, while there is time.
    async fn finish(mut self, outcomes: &Outcomes) {
        let until = Instant::now() + LAST_DELIVERIES;
        while let Ok(event) = self.waiting.try_recv() {
            self.add(event);
        }
        let mut lines: Vec<Line> = std::mem::take(&mut self.lines).into_values().collect();
        lines.sort_by_key(|line| line.number);
        let mut lost = 0;
        for event in lines.into_iter().flat_map(|line| line.events) {
            let outcome = match timeout_at(until, self.send(&event)).await {
                Ok(Attempt::Received) => WebhookOutcome::Delivered,
                Ok(Attempt::Refused(_)) => WebhookOutcome::Refused,
                Ok(Attempt::Failed(_)) | Err(_) => WebhookOutcome::Failed,
            };
            lost += u32::from(outcome == WebhookOutcome::Failed);
            outcomes.metrics.webhook(outcome);
        }
        if lost > 0 {
            warn!(
                lost,
                "the receiver has not taken these webhooks before the server stopped; they are lost"
            );
        }
    }

    async fn send(&self, event: &Event) -> Attempt {
        let timestamp = since_epoch().as_secs();
        let signature = signature(&self.settings.secret, timestamp, &event.body);
        let headers = [
            ("chefshat-delivery", event.id.clone()),
            ("chefshat-signature", signature),
        ];
        let body: Bytes = event.body.clone();
        match self
            .settings
            .target
            .post(body, headers, ANSWER_TIME, 0)
            .await
        {
            // Only the status matters.
            Ok(_) | Err(PostError::Body(_)) => Attempt::Received,
            Err(PostError::Status(answer)) if refuses(&answer) => {
                Attempt::Refused(PostError::Status(answer))
            }
            Err(problem) => Attempt::Failed(problem),
        }
    }
}

/// Whether the same request would be answered alike: 4xx, except where the receiver asks for time.
fn refuses(answer: &Answer) -> bool {
    let later = [
        StatusCode::REQUEST_TIMEOUT,
        StatusCode::TOO_EARLY,
        StatusCode::TOO_MANY_REQUESTS,
    ];
    answer.status.is_client_error() && !later.contains(&answer.status)
}

/// The signature of a body at a time, seconds since the Unix epoch.
fn signature(secret: &[u8], timestamp: u64, body: &[u8]) -> String {
    let mut mac = Hmac::<Sha256>::new_from_slice(secret).expect("HMAC takes keys of any length");
    mac.update(format!("{timestamp}.").as_bytes());
    mac.update(body);
    let code = hex::encode(mac.finalize().into_bytes());
    format!("t={timestamp},v1={code}")
}
