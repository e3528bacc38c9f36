//! What TLS handshakes may take: they are costed before the server signs. Each address has a rate
//! of them, and one that fails or is abandoned costs it more; few are open at a time, for addresses
//! in turns; and a thread that gives way to all others computes them, so that rooms do not wait.

use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll, Wake, Waker};
use std::time::Duration;

use rayon::ThreadPoolBuildError;
use tokio::sync::Notify;
use tracing::warn;

use chefshat_admission::limits::{FairSemaphore, Key, LogPace, Permit, Rate, Shares};
use chefshat_base::metrics::Metrics;
use chefshat_base::threads::{Priority, Threads};

/// Handshakes of one address in a second.
pub const HANDSHAKES_PER_SECOND: u64 = 50;
/// Handshakes of one address at once.
pub const HANDSHAKES_AT_ONCE: u64 = 500;
/// Handshakes that one which fails or is abandoned counts as.
pub const COST_OF_FAILED: u64 = 10;
/// Most handshakes of all addresses at a time; others wait.
pub const MAX_HANDSHAKES: usize = 256;
/// Longest time that a handshake waits for its address's rate; beyond it, its connection is closed.
const PATIENCE: Duration = Duration::from_secs(5);

/// Admits handshakes and computes them.
#[derive(Debug)]
pub struct Handshakes {
    places: Arc<FairSemaphore>,
    rate: Rate,
    thread: Threads,
    metrics: Arc<Metrics>,
    logged: LogPace,
}

impl Handshakes {
    /// Starts the thread that computes.
    ///
    /// # Errors
    /// The operating system cannot start it.
    pub fn new(shares: Shares, metrics: Arc<Metrics>) -> Result<Arc<Self>, ThreadPoolBuildError> {
        Ok(Arc::new(Self {
            places: FairSemaphore::new(MAX_HANDSHAKES, shares),
            rate: Rate::new(HANDSHAKES_PER_SECOND, HANDSHAKES_AT_ONCE),
            thread: Threads::new("handshakes", 1, Priority::Searches)?,
            metrics,
            logged: LogPace::new(1),
        }))
    }

    /// Waits until an address may begin a handshake; `None` if it has begun too many.
    pub async fn admit(self: &Arc<Self>, key: Key) -> Option<Handshake> {
        // A proxy carries many callers.
        if key != Key::Proxies {
            let wait = self.rate.wait(key);
            if wait > PATIENCE {
                self.metrics.refused("TOO_MANY_HANDSHAKES");
                if self.logged.admits() {
                    warn!(
                        ?key,
                        "TLS handshakes are refused: too many from one address"
                    );
                }
                return None;
            }
            self.rate.charge(key, 1);
            if !wait.is_zero() {
                tokio::time::sleep(wait).await;
            }
        }
        let place = self.places.take(key).await;
        Some(Handshake {
            limits: Arc::clone(self),
            key,
            has_succeeded: false,
            _place: place,
        })
    }
}

/// A handshake that was admitted. It has failed unless [`Handshake::compute`] says otherwise.
#[derive(Debug)]
pub struct Handshake {
    limits: Arc<Handshakes>,
    key: Key,
    has_succeeded: bool,
    _place: Permit,
}

impl Handshake {
    /// Completes the future of a handshake. It is polled on the thread for that, and only waits on
    /// others.
    ///
    /// # Errors
    /// Those of the future; `None` if it panicked.
    pub async fn compute<T, E>(
        mut self,
        handshake: impl Future<Output = Result<T, E>> + Send + 'static,
    ) -> Option<Result<T, E>>
    where
        T: Send + 'static,
        E: Send + 'static,
    {
        let mut handshake: Pin<Box<dyn Future<Output = _> + Send>> = Box::pin(handshake);
        let woken = Arc::new(Woken(Notify::new()));
        loop {
            let waker = Waker::from(Arc::clone(&woken));
            let polling = self.limits.thread.run(move || {
                let polled = handshake.as_mut().poll(&mut Context::from_waker(&waker));
                (handshake, polled)
            });
            let (rest, polled) = polling.await?;
            if let Poll::Ready(result) = polled {
                self.has_succeeded = result.is_ok();
                return Some(result);
            }
            handshake = rest;
            woken.0.notified().await;
        }
    }
}

impl Drop for Handshake {
    fn drop(&mut self) {
        if !self.has_succeeded {
            self.limits.rate.charge(self.key, COST_OF_FAILED - 1);
        }
    }
}

/// Notified when the future of a handshake is to be polled again.
struct Woken(Notify);

impl Wake for Woken {
    fn wake(self: Arc<Self>) {
        self.0.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use std::future::{pending, ready};

    use futures::FutureExt as _;
    use futures::future::join_all;

    use super::*;

    const SHARES: Shares = Shares {
        local: 50,
        remote: 10,
    };

    fn key(last: u8) -> Key {
        Key::Address([192, 0, 2, last].into())
    }

    fn handshakes() -> Arc<Handshakes> {
        Handshakes::new(SHARES, Arc::default()).expect("a thread")
    }

    /// Handshakes of an address that may begin now.
    async fn admitted_now(limits: &Arc<Handshakes>, key: Key) -> Option<Handshake> {
        limits.admit(key).now_or_never().flatten()
    }

    #[tokio::test(start_paused = true)]
    async fn abandoned_handshakes_cost_their_address_more_and_others_nothing() {
        let limits = handshakes();
        let mut begun = 0;
        while let Some(handshake) = admitted_now(&limits, key(1)).await {
            drop(handshake);
            begun += 1;
            assert!(begun <= HANDSHAKES_AT_ONCE, "there is a limit");
        }
        assert_eq!(begun, HANDSHAKES_AT_ONCE / COST_OF_FAILED + 1);
        assert!(admitted_now(&limits, key(2)).await.is_some());
        // Those that begin at the same time wait for the rate, but only a bounded number.
        let is_admitted = async || limits.admit(key(1)).await.is_some();
        let waiting = join_all((0..1_000).map(|_| is_admitted())).await;
        let admitted = waiting.into_iter().filter(|admitted| *admitted).count();
        let most = HANDSHAKES_PER_SECOND * PATIENCE.as_secs() + 1;
        assert!((1..=most).contains(&(admitted as u64)), "{admitted}");
        // For a minute, an address that abandons all has a tenth of the rate.
        let mut begun = 0;
        for _ in 0..60 {
            tokio::time::advance(Duration::from_secs(1)).await;
            begun += u64::from(admitted_now(&limits, key(1)).await.is_some());
        }
        assert!(
            begun <= 60 * HANDSHAKES_PER_SECOND / COST_OF_FAILED,
            "{begun}"
        );
        tokio::time::advance(Duration::from_secs(120)).await;
        assert!(admitted_now(&limits, key(1)).await.is_some());
    }

    #[tokio::test(start_paused = true)]
    async fn completed_handshakes_of_a_site_are_admitted_as_they_come() {
        let limits = handshakes();
        for _ in 0..HANDSHAKES_AT_ONCE {
            let handshake = admitted_now(&limits, key(1)).await.expect("admitted");
            let done = handshake.compute(ready(Ok::<_, ()>(()))).await;
            assert_eq!(done, Some(Ok(())));
        }
    }

    #[tokio::test(start_paused = true)]
    async fn handshakes_that_stall_leave_places_to_other_addresses() {
        let limits = handshakes();
        let mut stalled = Vec::new();
        for _ in 0..1_000 {
            let admitting = limits.admit(key(1));
            stalled.push(Box::pin(async move {
                let handshake = admitting.await?;
                handshake.compute(pending::<Result<(), ()>>()).await
            }));
        }
        for handshake in &mut stalled {
            assert!(!matches!(handshake.now_or_never(), Some(Some(_))));
        }
        assert_eq!(limits.places.taken(), MAX_HANDSHAKES / 10);
        assert!(admitted_now(&limits, key(2)).await.is_some());
        drop(stalled);
        assert_eq!(limits.places.taken(), 0);
    }

    #[tokio::test]
    async fn a_handshake_runs_on_the_thread_that_gives_way() {
        let limits = handshakes();
        let handshake = admitted_now(&limits, key(1)).await.expect("admitted");
        let mut polls = 0;
        let names = std::future::poll_fn(move |context| {
            polls += 1;
            context.waker().wake_by_ref();
            let name = std::thread::current().name().map(str::to_owned);
            match polls {
                1_000 => Poll::Ready(Ok::<_, ()>(name)),
                _ => Poll::Pending,
            }
        });
        let name = handshake.compute(names).await;
        assert_eq!(name, Some(Ok(Some("handshakes-0".to_owned()))));
    }
}
