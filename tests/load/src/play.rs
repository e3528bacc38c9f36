//! The load on the game server: a minimal client. Each stream is a task that decodes the fields it
//! needs, picks a random set bit of each mask, and answers all updates of one response in one
//! request. `host` creates the rooms.

use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1::{self, seat_command::Command};
use prost::Message as _;
use rand::rngs::SmallRng;
use rand::{RngExt as _, SeedableRng as _};
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinSet;
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;
use tonic::codegen::http::uri::PathAndQuery;
use tonic::transport::{Channel, Endpoint};
use tonic::{Request, Streaming};

use crate::error::LoadError;
use crate::host::{Host, News, Slot};
use crate::pulse::{Latencies, Plan, Pulse, Window, latencies};
use crate::tally::{Counts, Traffic};
use crate::wire::{
    AnswerResult, DecisionRequest, EventBatch, Kind, PlayCodec, PlayResponse, Update,
};

/// A response and its size in bytes.
pub(crate) type Weighed = (usize, PlayResponse);

/// Capacity of a stream's request queue.
const REQUESTS: usize = 1_024;
/// Time limit for the last games to end and streams to close.
const END_LIMIT: Duration = Duration::from_secs(300);

/// The result of a segment on the game server.
#[derive(Debug)]
pub(crate) struct Played {
    /// The window.
    pub(crate) window: Window,
    /// Decision times measured by the server, microseconds: from handing a request to the transport
    /// until the answer has been read.
    pub(crate) server_us: Latencies,
    /// From sending an answer until the room's next decision arrives on any stream, nanoseconds.
    pub(crate) client_ns: Latencies,
    /// Counts of the complete segment, checked.
    pub(crate) counts: Counts,
    /// Sizes of its messages.
    pub(crate) traffic: Traffic,
}

/// Plays rooms on a server until the window has closed and every game has ended.
pub(crate) async fn segment(
    url: &str,
    server: Option<u32>,
    plan: &Plan,
) -> Result<Played, LoadError> {
    let endpoint = Endpoint::from_shared(url.to_owned())?.tcp_nodelay(true);
    let pulse = Arc::new(Pulse::new(plan.rooms));
    let (report, news) = mpsc::unbounded_channel();
    let mut senders = Vec::with_capacity(plan.streams);
    let mut streams = JoinSet::new();
    for number in 0..plan.streams {
        let (requests, mut waiting) = mpsc::channel(REQUESTS);
        let channel = endpoint.connect().await?;
        let stream = Stream {
            requests: requests.downgrade(),
            report: report.clone(),
            pulse: Arc::clone(&pulse),
            play_to_end: plan.play_to_end,
            slots: Vec::new(),
            random: SmallRng::seed_from_u64(plan.seed.wrapping_add(number as u64)),
            tally: Tally::default(),
        };
        senders.push(requests);
        streams.spawn(async move {
            // A server ends a stream that attaches nobody; thousands of rooms take a while.
            let Some(first) = waiting.recv().await else {
                return Ok(stream.tally);
            };
            let requests = tokio_stream::once(first).chain(ReceiverStream::new(waiting));
            stream.run(open(channel, requests).await?).await
        });
    }
    drop(report);
    let host = Host::new(endpoint.connect().await?, plan.clone(), senders, news);
    let (ready, all_rooms_made) = oneshot::channel();
    let mut host = tokio::spawn(host.run(Arc::clone(&pulse), ready));

    // A stream or host that ends early has failed.
    let measuring = async {
        // If the host fails, its error is reported.
        let _ = all_rooms_made.await;
        pulse.measure(plan, server).await
    };
    let window = tokio::select! {
        window = measuring => window?,
        early = streams.join_next() => return Err(early_end(early)),
        early = &mut host => return Err(early_end(Some(early))),
    };
    pulse.stop();
    let (games, senders) = tokio::select! {
        () = tokio::time::sleep(END_LIMIT) => return Err(LoadError::Stuck("the last games")),
        early = streams.join_next() => return Err(early_end(early)),
        hosted = &mut host => hosted.expect("the host does not panic")?,
    };
    // Half-closes the streams, whose tasks have no sender of their own.
    drop(senders);
    let mut sum = Tally::default();
    let closing = async {
        while let Some(stream) = streams.join_next().await {
            sum.add(stream.expect("a stream's task does not panic")?);
        }
        Ok::<_, LoadError>(())
    };
    tokio::time::timeout(END_LIMIT, closing)
        .await
        .map_err(|_| LoadError::Stuck("the streams"))??;
    sum.counts
        .check(games, pulse.decisions(), window.decisions, plan.play_to_end)?;
    Ok(Played {
        window,
        server_us: sum.server_us,
        client_ns: sum.client_ns,
        counts: sum.counts,
        traffic: sum.traffic,
    })
}

/// Opens a stream like a generated client, but decodes only the necessary fields.
pub(crate) async fn open(
    channel: Channel,
    requests: impl tokio_stream::Stream<Item = v1::PlayRequest> + Send + 'static,
) -> Result<Streaming<Weighed>, LoadError> {
    let mut client = tonic::client::Grpc::new(channel);
    client.ready().await?;
    let path = PathAndQuery::from_static("/chefshat.v1.PlayService/Play");
    Ok(client
        .streaming(Request::new(requests), path, PlayCodec)
        .await?
        .into_inner())
}

/// Why a task ended early.
fn early_end<T>(end: Option<Result<Result<T, LoadError>, tokio::task::JoinError>>) -> LoadError {
    match end {
        Some(Ok(Err(error))) => error,
        Some(Err(error)) => LoadError::Protocol(error.to_string()),
        _ => LoadError::Protocol("a stream ended in mid-game".into()),
    }
}

/// Counts of one stream or of all.
#[derive(Debug)]
struct Tally {
    counts: Counts,
    traffic: Traffic,
    server_us: Latencies,
    client_ns: Latencies,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            counts: Counts::default(),
            traffic: Traffic::default(),
            server_us: latencies(),
            client_ns: latencies(),
        }
    }
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.counts.add(&other.counts);
        self.traffic.add(&other.traffic);
        self.server_us += other.server_us;
        self.client_ns += other.client_ns;
    }
}

/// One stream of seats.
struct Stream {
    /// Weak, so that the stream ends when the segment drops its sender.
    requests: mpsc::WeakSender<v1::PlayRequest>,
    report: mpsc::UnboundedSender<News>,
    pulse: Arc<Pulse>,
    /// Whether decisions are answered after the window has closed.
    play_to_end: bool,
    /// Index = handle.
    slots: Vec<Option<Slot>>,
    random: SmallRng,
    tally: Tally,
}

impl Stream {
    async fn run(mut self, mut inbound: Streaming<Weighed>) -> Result<Tally, LoadError> {
        while let Some((bytes, response)) = inbound.message().await? {
            self.tally.traffic.received(bytes);
            let mut commands = Vec::with_capacity(response.updates.len());
            for update in response.updates {
                let handle = update.handle;
                if let Some(answer) = self.take(handle, update.update)? {
                    commands.push(v1::SeatCommand {
                        handle,
                        command: Some(Command::Answer(answer)),
                    });
                }
            }
            if commands.is_empty() {
                continue;
            }
            let request = v1::PlayRequest { commands };
            self.tally.traffic.sent(request.encoded_len());
            let requests = self
                .requests
                .upgrade()
                .ok_or_else(|| LoadError::Protocol("asked after the last game had ended".into()))?;
            // A stream that has ended reports its own error.
            let _ = requests.send(request).await;
        }
        Ok(self.tally)
    }

    /// Processes one update; returns the answer to a decision.
    fn take(
        &mut self,
        handle: u32,
        update: Option<Update>,
    ) -> Result<Option<v1::Answer>, LoadError> {
        if let Some(Update::Attached(attached)) = &update {
            let index = handle as usize;
            if index >= self.slots.len() {
                self.slots.resize(index + 1, None);
            }
            self.slots[index] = Slot::from_request_id(attached.request_id);
            return Ok(None);
        }
        if let Some(Update::Refused(refused)) = update {
            return Err(LoadError::Protocol(format!(
                "{}: {}",
                refused.reason, refused.message
            )));
        }
        let slot = self.slots.get(handle as usize).copied().flatten();
        let slot = slot
            .ok_or_else(|| LoadError::Protocol(format!("handle {handle} was never announced")))?;
        match update {
            Some(Update::Decision(_)) if self.rests() => {
                // A host that has ended has failed already.
                let _ = self.report.send(News::AtRest(slot.room));
            }
            Some(Update::Decision(decision)) => return self.decide(slot, &decision).map(Some),
            Some(Update::Result(result)) => self.acknowledge(&result)?,
            Some(Update::Events(batch)) => self.follow(slot, &batch)?,
            Some(Update::Detached(detached)) => {
                if detached.reason() != v1::DetachReason::GameOver {
                    let reason = detached.reason().as_str_name();
                    return Err(LoadError::Protocol(format!(
                        "a seat was detached: {reason}"
                    )));
                }
                self.slots[handle as usize] = None;
                self.tally.counts.detached += 1;
                // A host that has ended has failed already.
                let _ = self.report.send(News::Over(slot.room));
            }
            other => {
                return Err(LoadError::Protocol(format!("nobody asked for {other:?}")));
            }
        }
        Ok(None)
    }

    /// Whether decisions now stay unanswered until their rooms are closed.
    fn rests(&self) -> bool {
        !self.play_to_end && self.pulse.is_stopping()
    }

    fn decide(&mut self, slot: Slot, decision: &DecisionRequest) -> Result<v1::Answer, LoadError> {
        self.pulse.asked(slot.room, &mut self.tally.client_ns);
        let action = self
            .pick(&decision.action_mask)
            .ok_or_else(|| LoadError::Protocol("a decision without a legal action".into()))?;
        self.tally.counts.answers += 1;
        if decision.kind() == v1::DecisionKind::Turn {
            self.tally.counts.turn_answers += 1;
        }
        self.pulse.answer(slot.room);
        Ok(v1::Answer {
            decision_id: decision.decision_id,
            action,
            annotations: None,
        })
    }

    /// A random set bit, uniformly.
    fn pick(&mut self, mask: &[u8]) -> Option<u32> {
        let legal: u32 = mask.iter().map(|byte| byte.count_ones()).sum();
        let mut left = (legal > 0).then(|| self.random.random_range(0..legal))?;
        for (index, &byte) in (0u32..).zip(mask) {
            let ones = byte.count_ones();
            if left < ones {
                let mut rest = byte;
                for _ in 0..left {
                    rest &= rest - 1;
                }
                return Some(8 * index + rest.trailing_zeros());
            }
            left -= ones;
        }
        None
    }

    fn acknowledge(&mut self, result: &AnswerResult) -> Result<(), LoadError> {
        if result.status() != v1::AnswerStatus::Accepted {
            return Err(LoadError::Protocol(format!(
                "a legal answer met {result:?}"
            )));
        }
        self.tally.counts.accepted += 1;
        if self.pulse.is_open() {
            self.tally
                .server_us
                .saturating_record(result.decision_time_us);
        }
        Ok(())
    }

    /// Counts events of a room: most at its first seat, the end of the game at every seat.
    fn follow(&mut self, slot: Slot, batch: &EventBatch) -> Result<(), LoadError> {
        let first = slot.seat == 0;
        for event in &batch.events {
            let source = match &event.kind {
                Some(Kind::Play(play)) => play.source(),
                Some(Kind::Pass(pass)) => pass.source(),
                Some(Kind::ShiftEnded(_)) => {
                    self.tally.counts.shifts += u64::from(first);
                    continue;
                }
                Some(Kind::GameEnded(_)) => {
                    self.tally.counts.game_ends += 1;
                    continue;
                }
                Some(Kind::GameAborted(aborted))
                    if self.rests() && aborted.reason() == v1::AbortReason::Closed =>
                {
                    self.tally.counts.game_ends += 1;
                    continue;
                }
                Some(Kind::GameAborted(aborted)) => {
                    let reason = aborted.reason().as_str_name();
                    return Err(LoadError::Protocol(format!("a game was aborted: {reason}")));
                }
                _ => continue,
            };
            if source != v1::DecisionSource::Agent {
                return Err(LoadError::Protocol(format!(
                    "a turn was decided otherwise than by its agent: {}",
                    source.as_str_name()
                )));
            }
            self.tally.counts.turn_events += u64::from(first);
        }
        Ok(())
    }
}
