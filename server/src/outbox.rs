//! What is ready to be written to one stream. A room puts updates in, the stream takes out everything that is there as one message, so
//! that a client with many seats gets its batches by being busy. Bounded: a room is told when there is no more space, and goes on.

use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::task::{Context, Poll};

use chefshat_proto::v1::SpectatorServiceWatchResponse;
use futures::Stream;
use futures::task::AtomicWaker;
use tokio::sync::Notify;
use tokio::time::Instant;
use tonic::Status;

use crate::room::RoomClock;

/// Most that may wait in an outbox, counted in updates and events.
pub const OUTBOX_CAPACITY: usize = 8_192;
/// Most that goes into one message, counted in updates and events. Bounds a message to well below the 4 MiB that gRPC clients accept.
pub const MESSAGE_CAPACITY: usize = 4_096;

/// Notes when a decision request was handed to the transport. Shared by the outbox that stamps and the room that reads.
#[derive(Debug)]
pub struct HandStamp {
    clock: RoomClock,
    /// Microseconds since the room was created, plus one; 0 while the request has not been handed over.
    micros: AtomicU64,
}

impl HandStamp {
    /// A stamp by the clock of a room.
    pub fn new(clock: RoomClock) -> Arc<Self> {
        Arc::new(Self {
            clock,
            micros: AtomicU64::new(0),
        })
    }

    /// Forgets the last decision: a new one is about to be sent.
    pub fn clear(&self) {
        self.micros.store(0, Ordering::Release);
    }

    /// When the decision was handed over, since the room was created.
    pub fn get(&self) -> Option<std::time::Duration> {
        let micros = self.micros.load(Ordering::Acquire).checked_sub(1)?;
        Some(std::time::Duration::from_micros(micros))
    }

    fn set(&self, now: Instant) {
        let micros = self.clock.at(now).as_micros();
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

/// What waits in an outbox: put together piece by piece, taken out as one message.
pub trait Pile: Default {
    /// Whether there is nothing.
    fn is_empty(&self) -> bool;
    /// What it counts for, in updates and events.
    fn weight(&self) -> usize;
    /// Moves everything from `other` to the end of this.
    fn append(&mut self, other: &mut Self);
    /// Takes from the beginning what counts for at most `most`, but at least one piece.
    fn take(&mut self, most: usize) -> Self;
}

impl Pile for Vec<SpectatorServiceWatchResponse> {
    fn is_empty(&self) -> bool {
        Vec::is_empty(self)
    }

    fn weight(&self) -> usize {
        self.iter().map(|piece| 1 + piece.events.len()).sum()
    }

    fn append(&mut self, other: &mut Self) {
        Vec::append(self, other);
    }

    fn take(&mut self, most: usize) -> Self {
        let mut weight = 0;
        let count = self
            .iter()
            .take_while(|piece| {
                weight += 1 + piece.events.len();
                weight <= most
            })
            .count()
            .max(1)
            .min(self.len());
        let rest = self.split_off(count);
        std::mem::replace(self, rest)
    }
}

/// The updates that wait for one stream.
pub struct Outbox<T> {
    waiting: Mutex<Waiting<T>>,
    waker: AtomicWaker,
    /// Notified when the client has gone away.
    gone: Notify,
    hung_up: AtomicBool,
    reader: AtomicWaker,
}

struct Waiting<T> {
    pile: T,
    weight: usize,
    stamps: Vec<Arc<HandStamp>>,
    wanting_space: Vec<Arc<dyn OnSpace>>,
    end: Option<Result<(), Status>>,
    abandoned: bool,
}

impl<T: Pile> Outbox<T> {
    /// An empty outbox and the stream that empties it.
    pub fn new() -> (Arc<Self>, OutboxStream<T>) {
        let outbox = Arc::new(Self {
            waiting: Mutex::new(Waiting {
                pile: T::default(),
                weight: 0,
                stamps: Vec::new(),
                wanting_space: Vec::new(),
                end: None,
                abandoned: false,
            }),
            waker: AtomicWaker::new(),
            gone: Notify::new(),
            hung_up: AtomicBool::new(false),
            reader: AtomicWaker::new(),
        });
        (Arc::clone(&outbox), OutboxStream { outbox })
    }

    /// Puts a pile in; `stamp` is set when it is handed over. If the outbox is full, or would be, nothing is put in and `pile` is left as
    /// it was; `on_space` is called when there is space again.
    pub fn push(
        &self,
        pile: &mut T,
        stamp: Option<&Arc<HandStamp>>,
        on_space: Option<&Arc<dyn OnSpace>>,
    ) -> bool {
        let weight = pile.weight();
        let mut waiting = self.lock();
        if waiting.abandoned {
            *pile = T::default();
            return true;
        }
        if waiting.weight > 0 && waiting.weight + weight > OUTBOX_CAPACITY {
            if let Some(on_space) = on_space {
                waiting.wanting_space.push(Arc::clone(on_space));
            }
            return false;
        }
        waiting.weight += weight;
        waiting.pile.append(pile);
        waiting.stamps.extend(stamp.cloned());
        drop(waiting);
        self.waker.wake();
        true
    }

    /// Puts in the last word of somebody, whether or not there is space.
    pub fn push_last(&self, pile: &mut T) {
        let mut waiting = self.lock();
        if !waiting.abandoned {
            waiting.weight += pile.weight();
            waiting.pile.append(pile);
        }
        drop(waiting);
        self.waker.wake();
    }

    /// Ends the stream once everything that waits has been taken.
    pub fn end(&self, end: Result<(), Status>) {
        self.lock().end.get_or_insert(end);
        self.waker.wake();
    }

    /// Ends the stream now, with nothing more than this.
    pub fn cut(&self, status: Status) {
        let mut waiting = self.lock();
        waiting.pile = T::default();
        waiting.weight = 0;
        waiting.end = Some(Err(status));
        drop(waiting);
        self.waker.wake();
    }

    /// Asks the reader of the stream's requests to stop.
    pub fn hang_up(&self) {
        self.hung_up.store(true, Ordering::Release);
        self.reader.wake();
    }

    /// Whether the reader of the stream's requests is to stop: it was asked to, or the client has gone away. If not, it is woken when it is.
    /// Costs no lock, because it is asked with every message.
    pub fn poll_hung_up(&self, context: &Context<'_>) -> bool {
        if !self.hung_up.load(Ordering::Acquire) {
            self.reader.register(context.waker());
        }
        self.hung_up.load(Ordering::Acquire)
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
pub struct OutboxStream<T: Pile> {
    outbox: Arc<Outbox<T>>,
}

impl<T: Pile> Stream for OutboxStream<T> {
    type Item = Result<T, Status>;

    fn poll_next(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        self.outbox.waker.register(context.waker());
        let mut waiting = self.outbox.lock();
        if waiting.pile.is_empty() {
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
        let pile = if waiting.weight <= MESSAGE_CAPACITY {
            waiting.weight = 0;
            std::mem::take(&mut waiting.pile)
        } else {
            let pile = waiting.pile.take(MESSAGE_CAPACITY);
            waiting.weight -= pile.weight();
            pile
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
        Poll::Ready(Some(Ok(pile)))
    }
}

impl<T: Pile> Drop for OutboxStream<T> {
    fn drop(&mut self) {
        let mut waiting = self.outbox.lock();
        waiting.abandoned = true;
        waiting.pile = T::default();
        waiting.weight = 0;
        waiting.stamps = Vec::new();
        waiting.wanting_space = Vec::new();
        drop(waiting);
        self.outbox.hang_up();
        self.outbox.gone.notify_waiters();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicUsize;

    use chefshat_proto::v1::GameEvent;
    use futures::{FutureExt as _, StreamExt as _};

    use crate::outbox::*;

    type Pieces = Vec<SpectatorServiceWatchResponse>;

    /// One piece with so many events, all of this number.
    fn piece(number: u64, events: usize) -> Pieces {
        let event = GameEvent {
            sequence: number,
            ..GameEvent::default()
        };
        vec![SpectatorServiceWatchResponse {
            events: vec![event; events],
            ..SpectatorServiceWatchResponse::default()
        }]
    }

    fn numbers(message: &Pieces) -> Vec<u64> {
        message
            .iter()
            .map(|piece| piece.events[0].sequence)
            .collect()
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
        let (outbox, mut stream) = Outbox::<Pieces>::new();
        assert!(stream.next().now_or_never().is_none());
        for number in 0..5 {
            assert!(outbox.push(&mut piece(number, 2), None, None));
        }
        let message = stream.next().now_or_never().flatten();
        let message = message.expect("something is ready").expect("no error");
        assert_eq!(numbers(&message), [0, 1, 2, 3, 4]);
        outbox.end(Ok(()));
        assert!(stream.next().now_or_never().expect("ended").is_none());
    }

    #[test]
    fn a_full_outbox_refuses_and_says_when_it_has_space() {
        let (outbox, mut stream) = Outbox::<Pieces>::new();
        let count = Arc::new(Count::default());
        let on_space: Arc<dyn OnSpace> = Arc::clone(&count) as _;
        let mut pushed = 0;
        let mut refused = loop {
            let mut pile = piece(pushed, 255);
            if !outbox.push(&mut pile, None, Some(&on_space)) {
                break pile;
            }
            pushed += 1;
        };
        assert_eq!(numbers(&refused), [pushed], "nothing is lost");
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
        let rest: Vec<u64> = std::iter::from_fn(|| stream.next().now_or_never().flatten())
            .flat_map(|message| numbers(&message.expect("no error")))
            .collect();
        let expected: Vec<u64> = (u64::try_from(message.len()).expect("small")..=pushed).collect();
        assert_eq!(rest, expected, "in order, once");
    }

    #[test]
    fn a_cut_drops_what_waits_and_a_dropped_stream_takes_nothing_more() {
        let (outbox, mut stream) = Outbox::<Pieces>::new();
        outbox.push(&mut piece(0, 1), None, None);
        outbox.cut(Status::resource_exhausted("too slow"));
        let end = stream.next().now_or_never().flatten().expect("an end");
        assert_eq!(end.expect_err("cut").code(), tonic::Code::ResourceExhausted);
        drop(stream);
        assert!(outbox.is_abandoned());
        assert!(outbox.abandoned().now_or_never().is_some());
        let mut pile = piece(0, 1);
        assert!(outbox.push(&mut pile, None, None));
        assert!(pile.is_empty());
    }
}
