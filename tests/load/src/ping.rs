//! The load on the bare room: the same topology, streams and batching as `play`, with messages of
//! the sizes measured there.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::time::Duration;

use prost::Message as _;
use tokio::sync::mpsc;
use tokio::task::JoinSet;
use tokio_stream::wrappers::ReceiverStream;
use tonic::Streaming;
use tonic::transport::Endpoint;

use crate::bare::proto::{Batch, Item, bare_service_client::BareServiceClient};
use crate::error::LoadError;
use crate::options::SEATS;
use crate::pulse::{Latencies, Plan, Pulse, Window, latencies};

/// Capacity of a stream's request queue.
const REQUESTS: usize = 1_024;
/// Time limit for rooms to come to rest and streams to close.
const END_LIMIT: Duration = Duration::from_secs(30);
/// Interval of checks whether rooms have come to rest.
const GLANCE: Duration = Duration::from_millis(2);

/// Bytes of the game's messages per decision.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sizes {
    /// To the server.
    pub(crate) request: usize,
    /// From the server.
    pub(crate) response: usize,
}

/// The result of a segment on the bare room.
#[derive(Debug)]
pub(crate) struct Pinged {
    /// The window.
    pub(crate) window: Window,
    /// From sending an answer until the room's next observation arrives on any stream, nanoseconds.
    pub(crate) client_ns: Latencies,
    /// Answers in the complete segment.
    pub(crate) answers: u64,
}

/// Answers requests until the window has closed and every room has come to rest.
pub(crate) async fn segment(
    url: &str,
    server: u32,
    plan: &Plan,
    sizes: Sizes,
) -> Result<Pinged, LoadError> {
    let endpoint = Endpoint::from_shared(url.to_owned())?.tcp_nodelay(true);
    let pulse = Arc::new(Pulse::new(plan.rooms));
    let at_rest = Arc::new(AtomicUsize::new(0));
    let answer_bytes = body_bytes(0, sizes.request) as usize;
    let mut senders = Vec::with_capacity(plan.streams);
    let mut streams = JoinSet::new();
    for _ in 0..plan.streams {
        let (requests, waiting) = mpsc::channel(REQUESTS);
        let mut client = BareServiceClient::new(endpoint.connect().await?);
        let inbound = client
            .exchange(ReceiverStream::new(waiting))
            .await?
            .into_inner();
        let stream = Stream {
            requests: requests.downgrade(),
            pulse: Arc::clone(&pulse),
            at_rest: Arc::clone(&at_rest),
            answer_bytes,
            received: 0,
            answers: 0,
            client_ns: latencies(),
        };
        senders.push(requests);
        streams.spawn(stream.run(inbound));
    }
    let seats = u32::try_from(plan.rooms * SEATS).expect("rooms are bounded");
    for seat in 0..seats {
        let attach = Item {
            seat,
            body: Vec::new(),
            attach: body_bytes(seat, sizes.response),
        };
        let request = Batch {
            items: vec![attach],
        };
        // A stream that has ended reports its own error.
        let _ = senders[seat as usize % plan.streams].send(request).await;
    }

    let ended_early = || LoadError::Protocol("a bare stream ended early".into());
    let window = tokio::select! {
        window = pulse.measure(plan, Some(server)) => window?,
        _ = streams.join_next() => return Err(ended_early()),
    };
    pulse.stop();
    let resting = async {
        while at_rest.load(Relaxed) < plan.rooms {
            tokio::time::sleep(GLANCE).await;
        }
    };
    tokio::select! {
        () = tokio::time::sleep(END_LIMIT) => return Err(LoadError::Stuck("the bare rooms")),
        _ = streams.join_next() => return Err(ended_early()),
        () = resting => {}
    }
    drop(senders);
    let (mut received, mut answers, mut client_ns) = (0, 0, latencies());
    let closing = async {
        while let Some(stream) = streams.join_next().await {
            let stream = stream.expect("a stream's task does not panic")?;
            received += stream.received;
            answers += stream.answers;
            client_ns += stream.client_ns;
        }
        Ok::<_, LoadError>(())
    };
    tokio::time::timeout(END_LIMIT, closing)
        .await
        .map_err(|_| LoadError::Stuck("the bare streams"))??;
    // The last observation of each room is not answered.
    let expected = answers + plan.rooms as u64;
    if received != expected || answers != pulse.decisions() || window.decisions == 0 {
        return Err(LoadError::Count(format!(
            "observations {received} and {expected}, answers {answers} and {}, {} in the window",
            pulse.decisions(),
            window.decisions
        )));
    }
    Ok(Pinged {
        window,
        client_ns,
        answers,
    })
}

/// The length of a body for which a batch with one item of this seat has `bytes` bytes in total.
fn body_bytes(seat: u32, bytes: usize) -> u32 {
    let mut body = bytes;
    loop {
        let item = Item {
            seat,
            body: vec![0; body],
            attach: 0,
        };
        let batch = Batch { items: vec![item] };
        if body <= 1 || batch.encoded_len() <= bytes {
            return u32::try_from(body.max(1)).expect("messages are bounded");
        }
        body -= 1;
    }
}

/// One stream of seats.
struct Stream {
    /// Weak, so that the stream ends when the segment drops its sender.
    requests: mpsc::WeakSender<Batch>,
    pulse: Arc<Pulse>,
    at_rest: Arc<AtomicUsize>,
    answer_bytes: usize,
    received: u64,
    answers: u64,
    client_ns: Latencies,
}

impl Stream {
    async fn run(mut self, mut inbound: Streaming<Batch>) -> Result<Self, LoadError> {
        while let Some(batch) = inbound.message().await? {
            let mut items = Vec::with_capacity(batch.items.len());
            for observation in batch.items {
                let seat = observation.seat;
                let room = seat as usize / SEATS;
                self.received += 1;
                self.pulse.asked(room, &mut self.client_ns);
                if self.pulse.is_stopping() {
                    self.at_rest.fetch_add(1, Relaxed);
                    continue;
                }
                self.answers += 1;
                self.pulse.answer(room);
                items.push(Item {
                    seat,
                    body: vec![0; self.answer_bytes],
                    attach: 0,
                });
            }
            if items.is_empty() {
                continue;
            }
            if let Some(requests) = self.requests.upgrade() {
                // A stream that has ended reports its own error.
                let _ = requests.send(Batch { items }).await;
            }
        }
        Ok(self)
    }
}
