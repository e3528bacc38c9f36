//! What is ready to be written to one stream. A room puts updates in, the stream takes out everything that is there as one message, so
//! that a client with many seats gets its batches by being busy. Bounded: a room is told when there is no more space, and goes on.

use std::pin::Pin;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::{Context, Poll};

use chefshat_proto::v1::{SeatUpdate, SpectatorServiceWatchResponse, seat_update::Update};
use futures::Stream;
use futures::task::AtomicWaker;
use tokio::sync::Notify;
use tokio::time::Instant;
use tonic::Status;

/// Most that may wait in an outbox, counted in updates and events.
pub const OUTBOX_CAPACITY: usize = 8_192;
/// Most that goes into one message, counted in updates and events. Bounds a message to well below the 4 MiB that gRPC clients accept.
pub const MESSAGE_CAPACITY: usize = 4_096;

/// Notes when a decision request was handed to the transport. Shared by the outbox that stamps and the room that reads.
#[derive(Debug)]
pub struct HandStamp {
    /// Moment zero of the stamp.
    epoch: Instant,
    /// Microseconds after `epoch`, plus one; 0 while the request has not been handed over.
    micros: AtomicU64,
}

impl HandStamp {
    /// A stamp that counts from `epoch`.
    pub fn new(epoch: Instant) -> Arc<Self> {
        Arc::new(Self {
            epoch,
            micros: AtomicU64::new(0),
        })
    }

    /// Forgets the last decision: a new one is about to be sent.
    pub fn clear(&self) {
        self.micros.store(0, Ordering::Release);
    }

    /// When the decision was handed over, since `epoch`.
    pub fn get(&self) -> Option<std::time::Duration> {
        let micros = self.micros.load(Ordering::Acquire).checked_sub(1)?;
        Some(std::time::Duration::from_micros(micros))
    }

    fn set(&self, now: Instant) {
        let micros = now.saturating_duration_since(self.epoch).as_micros();
        self.micros.store(
            u64::try_from(micros).unwrap_or(u64::MAX - 1) + 1,
            Ordering::Release,
        );
    }
}

/// Something that waits to hear that an outbox has space again.
pub trait OnSpace: Send + Sync {
    /// Called when the stream has taken something out.
    fn space(&self);
}

/// Something that can wait in an outbox.
pub trait Weigh {
    /// What it counts for: one, and one for each event in it.
    fn weight(&self) -> usize;
}

impl Weigh for SeatUpdate {
    fn weight(&self) -> usize {
        match &self.update {
            Some(Update::Events(batch)) => 1 + batch.events.len(),
            _ => 1,
        }
    }
}

impl Weigh for SpectatorServiceWatchResponse {
    fn weight(&self) -> usize {
        1 + self.events.len()
    }
}

/// The updates that wait for one stream.
pub struct Outbox<T> {
    waiting: Mutex<Waiting<T>>,
    waker: AtomicWaker,
    /// Notified when the client has gone away.
    gone: Notify,
}

struct Waiting<T> {
    updates: Vec<T>,
    weight: usize,
    stamps: Vec<Arc<HandStamp>>,
    wanting_space: Vec<Arc<dyn OnSpace>>,
    end: Option<Result<(), Status>>,
    abandoned: bool,
}

impl<T: Weigh> Outbox<T> {
    /// An empty outbox and the stream that empties it.
    pub fn new() -> (Arc<Self>, OutboxStream<T>) {
        let outbox = Arc::new(Self {
            waiting: Mutex::new(Waiting {
                updates: Vec::new(),
                weight: 0,
                stamps: Vec::new(),
                wanting_space: Vec::new(),
                end: None,
                abandoned: false,
            }),
            waker: AtomicWaker::new(),
            gone: Notify::new(),
        });
        (Arc::clone(&outbox), OutboxStream { outbox })
    }

    /// Puts updates in, in order; `stamp` is set when they are handed over. If the outbox is full, or would be, nothing is put in and
    /// `updates` is left as it was; `on_space` is called when it has space again.
    pub fn push(
        &self,
        updates: &mut Vec<T>,
        stamp: Option<&Arc<HandStamp>>,
        on_space: Option<&Arc<dyn OnSpace>>,
    ) -> bool {
        let weight = updates.iter().map(Weigh::weight).sum::<usize>();
        let mut waiting = self.lock();
        if waiting.abandoned {
            updates.clear();
            return true;
        }
        if waiting.weight > 0 && waiting.weight + weight > OUTBOX_CAPACITY {
            if let Some(on_space) = on_space {
                waiting.wanting_space.push(Arc::clone(on_space));
            }
            return false;
        }
        waiting.weight += weight;
        waiting.updates.append(updates);
        waiting.stamps.extend(stamp.cloned());
        drop(waiting);
        self.waker.wake();
        true
    }

    /// Ends the stream once everything that waits has been taken.
    pub fn end(&self, end: Result<(), Status>) {
        self.lock().end.get_or_insert(end);
        self.waker.wake();
    }

    /// Ends the stream now, with nothing more than this.
    pub fn cut(&self, status: Status) {
        let mut waiting = self.lock();
        waiting.updates = Vec::new();
        waiting.weight = 0;
        waiting.end = Some(Err(status));
        drop(waiting);
        self.waker.wake();
    }

    /// Waits until the client has gone away.
    pub async fn abandoned(&self) {
        loop {
            let gone = self.gone.notified();
            if self.is_abandoned() {
                return;
            }
            gone.await;
        }
    }

    /// Whether the client has gone away and nothing put in here will ever be read.
    pub fn is_abandoned(&self) -> bool {
        self.lock().abandoned
    }

    fn lock(&self) -> MutexGuard<'_, Waiting<T>> {
        self.waiting
            .lock()
            .expect("nothing that holds this lock can panic")
    }
}

impl<T> std::fmt::Debug for Outbox<T> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Outbox").finish_non_exhaustive()
    }
}

/// The stream that empties an outbox: all that is ready, at each poll.
#[derive(Debug)]
pub struct OutboxStream<T: Weigh> {
    outbox: Arc<Outbox<T>>,
}

impl<T: Weigh> Stream for OutboxStream<T> {
    type Item = Result<Vec<T>, Status>;

    fn poll_next(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.outbox.waker.register(context.waker());
        let mut waiting = self.outbox.lock();
        if waiting.updates.is_empty() {
            return match waiting.end.take() {
                None => Poll::Pending,
                Some(Ok(())) => {
                    waiting.end = Some(Ok(()));
                    Poll::Ready(None)
                }
                Some(Err(status)) => {
                    waiting.end = Some(Ok(()));
                    Poll::Ready(Some(Err(status)))
                }
            };
        }
        let updates = if waiting.weight <= MESSAGE_CAPACITY {
            waiting.weight = 0;
            std::mem::take(&mut waiting.updates)
        } else {
            let mut taken = 0;
            let count = waiting
                .updates
                .iter()
                .take_while(|update| {
                    taken += update.weight();
                    taken <= MESSAGE_CAPACITY
                })
                .count()
                .max(1);
            let rest = waiting.updates.split_off(count);
            let updates = std::mem::replace(&mut waiting.updates, rest);
            waiting.weight -= updates.iter().map(Weigh::weight).sum::<usize>();
            updates
        };
        // A decision that stays behind for the next message is stamped a little early; its agent has that much more time.
        if !waiting.stamps.is_empty() {
            let now = Instant::now();
            for stamp in waiting.stamps.drain(..) {
                stamp.set(now);
            }
        }
        let wanting_space = std::mem::take(&mut waiting.wanting_space);
        drop(waiting);
        for wanting in wanting_space {
            wanting.space();
        }
        Poll::Ready(Some(Ok(updates)))
    }
}

impl<T: Weigh> Drop for OutboxStream<T> {
    fn drop(&mut self) {
        let mut waiting = self.outbox.lock();
        waiting.abandoned = true;
        waiting.updates = Vec::new();
        waiting.weight = 0;
        waiting.stamps = Vec::new();
        waiting.wanting_space = Vec::new();
        drop(waiting);
        self.outbox.gone.notify_waiters();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use chefshat_proto::v1;
    use futures::{FutureExt as _, StreamExt as _};

    use super::*;

    fn update(handle: u32, events: usize) -> SeatUpdate {
        SeatUpdate {
            handle,
            update: Some(Update::Events(v1::EventBatch {
                events: vec![v1::GameEvent::default(); events],
            })),
        }
    }

    #[derive(Default)]
    struct Count(AtomicUsize);

    impl OnSpace for Count {
        fn space(&self) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn what_is_ready_goes_out_as_one_message() {
        let (outbox, mut stream) = Outbox::new();
        assert!(stream.next().now_or_never().is_none());
        for handle in 0..5 {
            assert!(outbox.push(&mut vec![update(handle, 2)], None, None));
        }
        let message = stream.next().now_or_never().flatten();
        let handles: Vec<u32> = message
            .expect("something is ready")
            .expect("no error")
            .iter()
            .map(|update| update.handle)
            .collect();
        assert_eq!(handles, [0, 1, 2, 3, 4]);
        outbox.end(Ok(()));
        assert!(stream.next().now_or_never().expect("ended").is_none());
    }

    #[test]
    fn a_full_outbox_refuses_and_says_when_it_has_space() {
        let (outbox, mut stream) = Outbox::new();
        let count = Arc::new(Count::default());
        let on_space: Arc<dyn OnSpace> = Arc::clone(&count) as _;
        let mut pushed = 0;
        let mut refused = loop {
            let mut updates = vec![update(pushed, 255)];
            if !outbox.push(&mut updates, None, Some(&on_space)) {
                break updates;
            }
            pushed += 1;
        };
        assert_eq!(refused.len(), 1, "nothing is lost");
        assert_eq!(usize::try_from(pushed), Ok(OUTBOX_CAPACITY / 256));
        let message = stream
            .next()
            .now_or_never()
            .flatten()
            .expect("ready")
            .expect("no error");
        assert_eq!(message.len(), MESSAGE_CAPACITY / 256);
        assert_eq!(count.0.load(Ordering::Relaxed), 1);
        assert!(outbox.push(&mut refused, None, Some(&on_space)));
        let rest: Vec<u32> = std::iter::from_fn(|| stream.next().now_or_never().flatten())
            .flat_map(|message| message.expect("no error"))
            .map(|update| update.handle)
            .collect();
        let expected: Vec<u32> = (u32::try_from(message.len()).expect("small")..=pushed).collect();
        assert_eq!(rest, expected, "in order, once");
    }

    #[test]
    fn a_cut_drops_what_waits_and_a_dropped_stream_takes_nothing_more() {
        let (outbox, mut stream) = Outbox::new();
        outbox.push(&mut vec![update(0, 1)], None, None);
        outbox.cut(Status::resource_exhausted("too slow"));
        let end = stream.next().now_or_never().flatten().expect("an end");
        assert_eq!(end.expect_err("cut").code(), tonic::Code::ResourceExhausted);
        drop(stream);
        assert!(outbox.is_abandoned());
        assert!(outbox.abandoned().now_or_never().is_some());
        let mut updates = vec![update(0, 1)];
        assert!(outbox.push(&mut updates, None, None));
        assert!(updates.is_empty());
    }
}
