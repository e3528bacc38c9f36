//! The updates queued for one stream. Rooms push updates; the stream takes everything that is ready
//! as one message, so that a busy client with many seats receives batches. It is bounded: a
//! subscriber learns when there is no space, and again when there is.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::task::{Context, Poll};

use futures::Stream;
use futures::task::AtomicWaker;
use smallvec::SmallVec;
use tokio::sync::Notify;
use tokio::time::Instant;

use crate::encoded::Updates;
use chefshat_base::clock::RoomClock;
use chefshat_base::lock::Lock;
use chefshat_base::metrics::Queue;

/// Capacity of an outbox, counted in updates and events: one for each seat that a stream may have.
pub const OUTBOX_CAPACITY: usize = 4_096;
/// Capacity of a spectator's outbox. Small, because a room has many spectators: those that do not
/// read soon cost it nothing, and what they miss is in its log.
pub const SPECTATOR_CAPACITY: usize = 256;
/// Capacity of a message, counted in updates and events. It keeps messages well below the 4 MiB
/// that gRPC clients accept by default.
pub const MESSAGE_CAPACITY: usize = 2_048;

/// Notified when a decision request is handed to the transport.
pub trait OnHandover: Send + Sync {
    /// The transport has taken the request.
    fn handed_over(&self, now: Instant);
}

/// Records when a decision request was handed to the transport. Shared by the outbox, which sets
/// it, and the room, which reads it. For a seat whose client is connected to another node, that
/// node reports it, with the number of the decision.
#[derive(Debug)]
pub struct HandStamp {
    clock: RoomClock,
    /// Microseconds since the room was created, plus one; 0 while the request has not been handed
    /// over.
    micros: AtomicU64,
    /// The decision that another node has reported, whose time is in `micros`.
    reported: AtomicU64,
}

impl HandStamp {
    /// Creates a stamp that uses the clock of a room.
    pub fn new(clock: RoomClock) -> Arc<Self> {
        Arc::new(Self {
            clock,
            micros: AtomicU64::new(0),
            reported: AtomicU64::new(0),
        })
    }

    /// Clears the stamp before a new request is sent.
    pub fn clear(&self) {
        self.micros.store(0, Ordering::Release);
    }

    /// When the request was handed over, since the creation of the room.
    pub fn get(&self) -> Option<std::time::Duration> {
        let micros = self.micros.load(Ordering::Acquire).checked_sub(1)?;
        Some(std::time::Duration::from_micros(micros))
    }

    /// Another node has handed a decision request over.
    pub fn report(&self, decision_id: u64, now: Instant) {
        self.handed_over(now);
        // After its time: a room that sees the number reads this time.
        self.reported.store(decision_id, Ordering::Release);
    }

    /// When another node reported that it handed this request over.
    pub fn reported(&self, decision_id: u64) -> Option<std::time::Duration> {
        let reported = self.reported.load(Ordering::Acquire);
        self.get().filter(|_| reported == decision_id)
    }
}

impl OnHandover for HandStamp {
    fn handed_over(&self, now: Instant) {
        let micros = self.clock.at(now).as_micros();
        self.micros.store(
            u64::try_from(micros).unwrap_or(u64::MAX - 1) + 1,
            Ordering::Release,
        );
    }
}

/// A subscriber that waits for space in an outbox.
pub trait OnSpace: Send + Sync {
    /// Called when the stream has taken updates.
    fn space(&self);
}

/// Why the server ends a stream. `grpc` turns it into a status.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StreamEnd {
    /// Everything has been sent.
    Complete,
    /// The server is shutting down.
    ShuttingDown,
    /// The store failed, and the server is stopping.
    StoreFailed,
    /// A room on the stream is gone.
    RoomGone,
    /// A spectator did not keep up.
    SpectatorTooSlow,
    /// Calls to games of tournaments were not read.
    CallsNotTaken,
    /// Replies to the stream's own commands were not read.
    UpdatesNotTaken,
    /// The requests of the stream broke off or broke a rule; their reader has the reason.
    RequestsFailed,
}

/// The updates queued for one stream.
pub struct Outbox {
    capacity: usize,
    waiting: Lock<Waiting>,
    waker: AtomicWaker,
    /// Notified when the client has gone.
    gone: Notify,
    reading_stopped: AtomicBool,
    reader: AtomicWaker,
}

struct Waiting {
    updates: Updates,
    weight: usize,
    stamps: SmallVec<[Arc<dyn OnHandover>; 1]>,
    space_waiters: Vec<Arc<dyn OnSpace>>,
    /// The end of the stream, taken once.
    end: Option<StreamEnd>,
    ended: bool,
    abandoned: bool,
}

impl Queue for Outbox {
    /// The queued updates and events.
    fn depth(&self) -> usize {
        self.waiting.lock().weight
    }
}

impl Outbox {
    /// Creates an empty outbox and its stream.
    pub fn new() -> (Arc<Self>, OutboxStream) {
        Self::with_capacity(OUTBOX_CAPACITY)
    }

    /// Creates an empty outbox of this capacity, counted in updates and events, and its stream.
    pub fn with_capacity(capacity: usize) -> (Arc<Self>, OutboxStream) {
        let outbox = Arc::new(Self {
            capacity,
            waiting: Lock::new(Waiting {
                updates: Updates::default(),
                weight: 0,
                stamps: SmallVec::new(),
                space_waiters: Vec::new(),
                end: None,
                ended: false,
                abandoned: false,
            }),
            waker: AtomicWaker::new(),
            gone: Notify::new(),
            reading_stopped: AtomicBool::new(false),
            reader: AtomicWaker::new(),
        });
        (Arc::clone(&outbox), OutboxStream { outbox })
    }

    /// Queues updates; `stamps` are notified when they are handed over. If they do not fit, nothing
    /// is queued, `updates` is unchanged, and `on_space` is called when there is space again.
    pub fn push(
        &self,
        updates: &mut Updates,
        stamps: impl IntoIterator<Item = Arc<dyn OnHandover>>,
        on_space: Option<&Arc<dyn OnSpace>>,
    ) -> bool {
        let weight = updates.weight();
        let mut waiting = self.waiting.lock();
        if waiting.abandoned {
            *updates = Updates::default();
            return true;
        }
        if waiting.weight > 0 && waiting.weight + weight > self.capacity {
            // A subscriber that tries several times is notified once.
            if let Some(on_space) = on_space
                && !(waiting.space_waiters.iter()).any(|other| Arc::ptr_eq(other, on_space))
            {
                waiting.space_waiters.push(Arc::clone(on_space));
            }
            return false;
        }
        waiting.weight += weight;
        waiting.updates.append(updates);
        waiting.stamps.extend(stamps);
        drop(waiting);
        self.waker.wake();
        true
    }

    /// Queues the last updates of a subscriber, even if there is no space.
    pub fn push_last(&self, updates: &mut Updates) {
        let mut waiting = self.waiting.lock();
        if !waiting.abandoned {
            waiting.weight += updates.weight();
            waiting.updates.append(updates);
        }
        drop(waiting);
        self.waker.wake();
    }

    /// Ends the stream after everything queued has been taken. Only the first end counts.
    pub fn end(&self, end: StreamEnd) {
        let mut waiting = self.waiting.lock();
        if !waiting.ended {
            waiting.ended = true;
            waiting.end = Some(end);
        }
        drop(waiting);
        self.waker.wake();
    }

    /// Ends the stream now and drops everything queued.
    pub fn cut(&self, end: StreamEnd) {
        let mut waiting = self.waiting.lock();
        waiting.updates = Updates::default();
        waiting.weight = 0;
        waiting.ended = true;
        waiting.end = Some(end);
        drop(waiting);
        self.waker.wake();
    }

    /// Tells the reader of the stream's requests to stop.
    pub fn stop_reading(&self) {
        self.reading_stopped.store(true, Ordering::Release);
        self.reader.wake();
    }

    /// Whether the reader of the stream's requests must stop: it was asked to, or the client has
    /// gone. If not, its task is woken when it must. Takes no lock, because it is called for every
    /// message.
    pub fn poll_reading_stopped(&self, context: &Context<'_>) -> bool {
        if !self.reading_stopped.load(Ordering::Acquire) {
            self.reader.register(context.waker());
        }
        self.reading_stopped.load(Ordering::Acquire)
    }

    /// Waits until the client has gone.
    pub async fn abandoned(&self) {
        loop {
            let gone = self.gone.notified();
            if self.is_abandoned() {
                return;
            }
            gone.await;
        }
    }

    /// Whether updates still reach the client: it has not gone, and its stream has not been ended.
    pub fn is_open(&self) -> bool {
        let waiting = self.waiting.lock();
        !(waiting.ended || waiting.abandoned)
    }

    /// Whether the client has gone and nothing in here will be read.
    pub fn is_abandoned(&self) -> bool {
        self.waiting.lock().abandoned
    }
}

impl std::fmt::Debug for Outbox {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Outbox").finish_non_exhaustive()
    }
}

/// The stream of an outbox: each poll takes everything that is ready.
#[derive(Debug)]
pub struct OutboxStream {
    outbox: Arc<Outbox>,
}

impl Stream for OutboxStream {
    type Item = Result<Updates, StreamEnd>;

    fn poll_next(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.outbox.waker.register(context.waker());
        let mut waiting = self.outbox.waiting.lock();
        if waiting.updates.is_empty() {
            return match waiting.end.take() {
                None if waiting.ended => Poll::Ready(None),
                None => Poll::Pending,
                Some(StreamEnd::Complete) => Poll::Ready(None),
                Some(end) => Poll::Ready(Some(Err(end))),
            };
        }
        let updates = if waiting.weight <= MESSAGE_CAPACITY {
            waiting.weight = 0;
            std::mem::take(&mut waiting.updates)
        } else {
            let updates = waiting.updates.take(MESSAGE_CAPACITY);
            waiting.weight -= updates.weight();
            updates
        };
        // A decision that is left for the next message is stamped a little early; its agent gains
        // that time.
        if !waiting.stamps.is_empty() {
            let now = Instant::now();
            for stamp in waiting.stamps.drain(..) {
                stamp.handed_over(now);
            }
        }
        let space_waiters = std::mem::take(&mut waiting.space_waiters);
        drop(waiting);
        for waiter in space_waiters {
            waiter.space();
        }
        Poll::Ready(Some(Ok(updates)))
    }
}

impl Drop for OutboxStream {
    fn drop(&mut self) {
        let mut waiting = self.outbox.waiting.lock();
        waiting.abandoned = true;
        waiting.updates = Updates::default();
        waiting.weight = 0;
        waiting.stamps = SmallVec::new();
        waiting.space_waiters = Vec::new();
        drop(waiting);
        self.outbox.stop_reading();
        self.outbox.gone.notify_waiters();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use chefshat_proto::v1::PlayResponse;
    use futures::{FutureExt as _, StreamExt as _};
    use prost::Message as _;

    use super::*;

    /// An update that counts as one and `events` events, all for this handle.
    fn updates(handle: u32, events: usize) -> Updates {
        let mut updates = Updates::default();
        updates.add_events(handle, &[], events);
        updates
    }

    fn handles(updates: &Updates) -> Vec<u32> {
        let response = PlayResponse::decode(updates.encode_to_vec().as_slice());
        let updates = response.expect("a response").updates;
        updates.iter().map(|update| update.handle).collect()
    }

    #[derive(Default)]
    struct Count(AtomicUsize);

    impl OnSpace for Count {
        fn space(&self) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn ready_updates_leave_as_one_message() {
        let (outbox, mut stream) = Outbox::new();
        assert!(stream.next().now_or_never().is_none());
        for handle in 0..5 {
            assert!(outbox.push(&mut updates(handle, 2), None, None));
        }
        let message = stream.next().now_or_never().flatten();
        let message = message.expect("something is ready").expect("no error");
        assert_eq!(handles(&message), [0, 1, 2, 3, 4]);
        outbox.end(StreamEnd::Complete);
        assert!(stream.next().now_or_never().expect("ended").is_none());
        assert!(stream.next().now_or_never().expect("ended").is_none());
    }

    #[test]
    fn a_full_outbox_refuses_and_notifies_each_subscriber_once() {
        let (outbox, mut stream) = Outbox::new();
        let count = Arc::new(Count::default());
        let on_space: Arc<dyn OnSpace> = Arc::clone(&count) as _;
        let mut pushed = 0;
        let mut refused = loop {
            let mut more = updates(pushed, 255);
            if !outbox.push(&mut more, None, Some(&on_space)) {
                break more;
            }
            pushed += 1;
        };
        assert_eq!(handles(&refused), [pushed], "nothing is lost");
        for _ in 0..100 {
            assert!(!outbox.push(&mut refused, None, Some(&on_space)));
        }
        assert_eq!(outbox.waiting.lock().space_waiters.len(), 1);
        assert_eq!(usize::try_from(pushed), Ok(OUTBOX_CAPACITY / 256));
        let next = stream.next().now_or_never().flatten();
        let message = next.expect("ready").expect("no error");
        assert_eq!(handles(&message).len(), MESSAGE_CAPACITY / 256);
        assert_eq!(count.0.load(Ordering::Relaxed), 1);
        assert!(outbox.push(&mut refused, None, Some(&on_space)));
        let rest: Vec<u32> = std::iter::from_fn(|| stream.next().now_or_never().flatten())
            .flat_map(|message| handles(&message.expect("no error")))
            .collect();
        let taken = u32::try_from(MESSAGE_CAPACITY / 256).expect("small");
        let expected: Vec<u32> = (taken..=pushed).collect();
        assert_eq!(rest, expected, "in order, once");
    }

    #[test]
    fn cutting_drops_queued_updates_and_a_dropped_stream_takes_no_more() {
        let (outbox, mut stream) = Outbox::new();
        outbox.push(&mut updates(0, 1), None, None);
        outbox.cut(StreamEnd::SpectatorTooSlow);
        let end = stream.next().now_or_never().flatten().expect("an end");
        assert_eq!(end, Err(StreamEnd::SpectatorTooSlow));
        drop(stream);
        assert!(outbox.is_abandoned());
        assert!(outbox.abandoned().now_or_never().is_some());
        let mut more = updates(0, 1);
        assert!(outbox.push(&mut more, None, None));
        assert!(more.is_empty());
    }
}
