//! Long computations that share a few threads, a slice at a time: addresses have equal shares of the
//! threads, and so have the tokens of an address within its share, however many computations each
//! has. A computation that could not end by its deadline is refused when it arrives instead of timing
//! out after it has waited. What is computed, and on which threads, is not known here.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::{Arc, MutexGuard};
use std::time::Duration;

use tokio::sync::oneshot;
use tokio::time::Instant;

use super::{Key, Payer};
use chefshat_base::lock::Lock;

/// Processor time after which a computation lets others continue.
pub const SLICE: Duration = Duration::from_millis(20);
/// How quickly the measured speed follows: each slice counts 1/N.
const SPEED_SMOOTHING: f64 = 16.0;
/// The lowest speed that is believed.
const MIN_SPEED: f64 = 0.05;
/// Shortest time after which a refused caller is advised to try again.
const MIN_RETRY: Duration = Duration::from_secs(1);

/// The computations that run or wait. Their number is bounded by what admits them: see
/// `MAX_ANALYSES`.
#[derive(Debug)]
pub struct WorkQueue {
    threads: usize,
    state: Lock<State>,
}

#[derive(Debug)]
struct State {
    /// In the order of their arrival.
    jobs: BTreeMap<u64, Job>,
    next: u64,
    /// Threads without a slice.
    free: usize,
    /// Slices that each address and each caller has.
    running: BTreeMap<Key, usize>,
    /// When each address and each caller with computations had its last slice, or came; and the next
    /// such number.
    turns: BTreeMap<Key, u64>,
    next_turn: u64,
    /// Those that wait for a slice, longest first.
    waiting: VecDeque<(Payer, oneshot::Sender<Slice>)>,
    /// Part of the time of the threads that is theirs; rooms take the rest.
    speed: f64,
}

#[derive(Debug, Clone, Copy)]
struct Job {
    payer: Payer,
    /// Processor time that it may still take.
    left: Duration,
    due: Option<Instant>,
}

impl State {
    /// Puts an address or a caller behind all others.
    fn take_turn(&mut self, key: Key) {
        self.turns.insert(key, self.next_turn);
        self.next_turn += 1;
    }
}

/// The place of a computation in the queue, until it is dropped.
#[derive(Debug)]
pub struct Queued {
    queue: Arc<WorkQueue>,
    number: u64,
    payer: Payer,
}

/// The right to compute on one thread.
#[derive(Debug)]
pub struct Slice {
    queue: Arc<WorkQueue>,
    payer: Payer,
}

impl WorkQueue {
    /// Creates the queue of this number of threads.
    pub fn new(threads: usize) -> Arc<Self> {
        Arc::new(Self {
            threads,
            state: Lock::new(State {
                jobs: BTreeMap::new(),
                next: 0,
                free: threads,
                running: BTreeMap::new(),
                turns: BTreeMap::new(),
                next_turn: 0,
                waiting: VecDeque::new(),
                speed: 1.0,
            }),
        })
    }

    /// Admits a computation that takes at most `work` of processor time. With a deadline, it takes at
    /// most the time until then.
    ///
    /// A caller's first computation is admitted if it can end by its deadline on an equal share of the
    /// threads; others cannot keep it out by what they have begun. What a caller adds to computations
    /// of its own must be in time even if one more caller arrives, and make no other one too late.
    ///
    /// # Errors
    /// It would end too late; returns when it is worth trying again.
    pub fn admit(
        self: &Arc<Self>,
        payer: Payer,
        work: Duration,
        due: Option<Instant>,
    ) -> Result<Queued, Duration> {
        let now = Instant::now();
        let work = due.map_or(work, |due| work.min(due.saturating_duration_since(now)));
        let mut state = self.state.lock();
        let job = Job {
            payer,
            left: work,
            due,
        };
        if let Some(late) = self.late_by(&state, job, now) {
            return Err(late.max(MIN_RETRY));
        }
        for key in payer.keys() {
            if !state.turns.contains_key(&key) {
                state.take_turn(key);
            }
        }
        let number = state.next;
        state.next += 1;
        state.jobs.insert(number, job);
        Ok(Queued {
            queue: Arc::clone(self),
            number,
            payer,
        })
    }

    /// By how much a new computation would end after its deadline, or make another one too late;
    /// `None` if it may be admitted.
    fn late_by(&self, state: &State, new: Job, now: Instant) -> Option<Duration> {
        let before: Vec<Job> = state.jobs.values().copied().collect();
        let with: Vec<Job> = before.iter().copied().chain([new]).collect();
        let late = |job: &Job, end: Duration| {
            let late = (now + end).saturating_duration_since(job.due?);
            (!late.is_zero()).then_some(late)
        };
        let ends = |jobs: &[Job], others| self.ends(jobs, others, state.speed);
        let is_first = before.iter().all(|job| job.payer.key != new.payer.key);
        let own_end = *ends(&with, usize::from(!is_first)).last()?;
        let own = late(&new, own_end);
        if is_first || own.is_some() {
            return own;
        }
        // What is later than this without the new one has lost its time to rooms or new callers.
        let given_up = 2 * SLICE * u32::try_from(with.len()).unwrap_or(u32::MAX);
        let (ends_before, ends_with) = (ends(&before, 0), ends(&with, 0));
        let delayed =
            (before.iter().zip(ends_before).zip(ends_with)).filter_map(|((job, before), with)| {
                match late(job, before) {
                    Some(late) if late > given_up => None,
                    _ => late(job, with),
                }
            });
        delayed.max()
    }

    /// When each of these computations ends, from now, if addresses have equal shares of the threads,
    /// their callers equal shares of these, and this number of further addresses computes all the
    /// time.
    fn ends(&self, jobs: &[Job], others: usize, speed: f64) -> Vec<Duration> {
        let mut left: Vec<f64> = jobs.iter().map(|job| job.left.as_secs_f64()).collect();
        let mut ends = vec![Duration::ZERO; jobs.len()];
        let mut passed = 0.0;
        let mut open: Vec<usize> = (0..jobs.len()).collect();
        while !open.is_empty() {
            let mut counts: BTreeMap<Key, BTreeMap<Key, usize>> = BTreeMap::new();
            for Payer { address, key } in open.iter().map(|job| jobs[*job].payer) {
                *counts.entry(address).or_default().entry(key).or_default() += 1;
            }
            let addresses = (counts.iter())
                .map(|(address, callers)| (callers.values().sum(), Some(*address)))
                .chain(std::iter::repeat_n((self.threads, None), others));
            let mut rates: BTreeMap<Key, f64> = BTreeMap::new();
            for (address, threads) in shared(self.threads as f64, addresses.collect()) {
                let callers = address.and_then(|address| counts.get(&address));
                let callers = callers.into_iter().flatten();
                let callers = callers.map(|(key, count)| (*count, *key)).collect();
                let shares = shared(threads, callers).into_iter();
                rates.extend(shares.map(|(key, threads)| (key, threads * speed)));
            }
            let of_caller = |job: usize| {
                let Payer { address, key } = jobs[job].payer;
                rates[&key] / counts[&address][&key] as f64
            };
            let time = |job: &usize| left[*job] / of_caller(*job);
            let next = open.iter().map(time).fold(f64::INFINITY, f64::min);
            passed += next;
            for &job in &open {
                left[job] -= next * of_caller(job);
            }
            open.retain(|&job| {
                let is_open = left[job] > 1e-9;
                if !is_open {
                    ends[job] =
                        Duration::from_secs_f64(passed) + self.round_of(jobs, jobs[job].payer);
                }
                is_open
            });
        }
        ends
    }

    /// The time in which each computation of a caller gets a slice: so much later than with equal
    /// shares it may end.
    fn round_of(&self, jobs: &[Job], payer: Payer) -> Duration {
        let payers = || jobs.iter().map(|job| job.payer);
        let addresses: BTreeSet<Key> = payers().map(|it| it.address).collect();
        let at_address = payers().filter(|it| it.address == payer.address);
        let callers: BTreeSet<Key> = at_address.map(|it| it.key).collect();
        let own = payers().filter(|it| *it == payer).count();
        let slices = (own * callers.len() * (addresses.len() + 1)).div_ceil(self.threads);
        SLICE * u32::try_from(slices).unwrap_or(u32::MAX)
    }

    /// Adds one that waits for a slice.
    fn wait(self: &Arc<Self>, payer: Payer, sender: oneshot::Sender<Slice>) {
        let mut state = self.state.lock();
        state.waiting.push_back((payer, sender));
        self.grant(state);
    }

    /// Gives free threads to those that wait: first to an address that has the fewest, and among these
    /// to the one whose last slice began longest ago; and in the same way to a caller at this address.
    fn grant(self: &Arc<Self>, mut state: MutexGuard<'_, State>) {
        // Each slice that nobody takes any more would come back here, one call within the other.
        state.waiting.retain(|(_, sender)| !sender.is_closed());
        let mut granted = Vec::new();
        while state.free > 0 {
            let rank = |key: Key| (state.running.get(&key), state.turns.get(&key));
            let waiting = state.waiting.iter().enumerate();
            let next = waiting
                .min_by_key(|(index, (payer, _))| (rank(payer.address), rank(payer.key), *index));
            let Some((index, _)) = next else { break };
            let Some((payer, sender)) = state.waiting.remove(index) else {
                break;
            };
            state.free -= 1;
            for key in payer.keys() {
                if state.turns.contains_key(&key) {
                    state.take_turn(key);
                }
                *state.running.entry(key).or_default() += 1;
            }
            let queue = Arc::clone(self);
            granted.push((sender, Slice { queue, payer }));
        }
        drop(state);
        for (sender, slice) in granted {
            // If it has just given up, the thread is free again here.
            let _ = sender.send(slice);
        }
    }
}

impl Queued {
    /// Waits for a slice. One that has just ended, if there is one, goes to the next one.
    pub async fn slice(&self, ended: Option<Slice>) -> Slice {
        let (sender, granted) = oneshot::channel();
        self.queue.wait(self.payer, sender);
        drop(ended);
        granted.await.expect("those that wait stay in the queue")
    }

    /// A slice has ended that took `own` of processor time while `passed` went by.
    pub fn computed(&self, own: Duration, passed: Duration) {
        let mut state = self.queue.state.lock();
        if let Some(job) = state.jobs.get_mut(&self.number) {
            job.left = job.left.saturating_sub(own);
        }
        if !passed.is_zero() {
            let speed = (own.as_secs_f64() / passed.as_secs_f64()).clamp(MIN_SPEED, 1.0);
            state.speed += (speed - state.speed) / SPEED_SMOOTHING;
        }
    }
}

impl Drop for Queued {
    fn drop(&mut self) {
        let mut state = self.queue.state.lock();
        state.jobs.remove(&self.number);
        for key in self.payer.keys() {
            if state
                .jobs
                .values()
                .all(|job| !job.payer.keys().any(|it| it == key))
            {
                state.turns.remove(&key);
            }
        }
        if state.jobs.is_empty() {
            // What was measured says nothing about the time when somebody comes again.
            state.speed = 1.0;
        }
    }
}

impl Drop for Slice {
    fn drop(&mut self) {
        let mut state = self.queue.state.lock();
        state.free += 1;
        for key in self.payer.keys() {
            if let Some(slices) = state.running.get_mut(&key) {
                *slices -= 1;
                if *slices == 0 {
                    state.running.remove(&key);
                }
            }
        }
        self.queue.grant(state);
    }
}

/// Shares threads equally among those that can use at most this number of them each.
fn shared<K: Ord>(mut threads: f64, mut wanted: Vec<(usize, K)>) -> Vec<(K, f64)> {
    // Those that can use least are satisfied first; what they leave is shared by the others.
    wanted.sort();
    let mut others = wanted.len();
    let shares = wanted.into_iter().map(|(most, key)| {
        let share = (threads / others as f64).min(most as f64);
        threads -= share;
        others -= 1;
        (key, share)
    });
    shares.collect()
}

#[cfg(test)]
mod tests {
    use futures::future::join_all;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;
    use crate::access::TokenId;

    /// A caller without a token.
    fn key(last: u8) -> Payer {
        let address = Key::Address([192, 0, 2, last].into());
        Payer {
            address,
            key: address,
        }
    }

    /// A caller with this token.
    fn with_token(last: u8, token: u8) -> Payer {
        let token: TokenId = format!("{token:08x}").parse().expect("a token id");
        Payer {
            key: Key::Token(token),
            ..key(last)
        }
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn within(time: Duration) -> Option<Instant> {
        Some(Instant::now() + time)
    }

    /// Computes until `work` is done, a slice at a time; returns when.
    async fn compute(queued: Queued, mut work: Duration) -> Instant {
        let mut slice = None;
        while !work.is_zero() {
            let running = queued.slice(slice.take()).await;
            let time = work.min(SLICE);
            tokio::time::sleep(time).await;
            queued.computed(time, time);
            work -= time;
            slice = Some(running);
        }
        Instant::now()
    }

    #[tokio::test(start_paused = true)]
    async fn callers_share_the_threads_equally_however_many_computations_each_has() {
        let queue = WorkQueue::new(1);
        let begun = Instant::now();
        let flood = (0..9).map(|_| (1, ms(2_000)));
        let all = flood.chain([(2, ms(1_000))]).map(|(caller, work)| {
            let queued = queue.admit(key(caller), work, None).expect("no deadline");
            compute(queued, work)
        });
        let ends = join_all(all).await;
        let lone = ends[9].duration_since(begun);
        assert!(lone <= ms(2_000) + 2 * SLICE, "{lone:?}");
        // Those of one caller share as well: they end together.
        let spread = ends[8].duration_since(ends[0]);
        assert!(spread <= 9 * SLICE, "{spread:?}");
        assert_eq!(ends[8].duration_since(begun), ms(19_000));
        assert!(queue.state.lock().jobs.is_empty() && queue.state.lock().running.is_empty());
    }

    #[tokio::test(start_paused = true)]
    async fn the_tokens_of_an_address_share_what_one_address_has() {
        let queue = WorkQueue::new(1);
        let begun = Instant::now();
        let second = ms(1_000);
        let eight = (0..8).map(|token| with_token(1, token));
        let all = eight.chain([with_token(2, 8)]).map(|payer| {
            let queued = queue.admit(payer, second, None).expect("no deadline");
            compute(queued, second)
        });
        let ends = join_all(all).await;
        let lone = ends[8].duration_since(begun);
        assert!(lone <= 2 * second + 2 * SLICE, "{lone:?}");
        let spread = ends[7].duration_since(ends[0]);
        assert!(spread <= 8 * SLICE, "{spread:?}");
        // They do not keep another address out, nor each other.
        let due = within(ms(2_500));
        let eight = (0..8).map(|token| queue.admit(with_token(1, token), second, due));
        let eight: Vec<_> = eight.collect();
        assert_eq!(eight.iter().filter(|queued| queued.is_ok()).count(), 2);
        let lone = queue.admit(with_token(2, 8), second, due);
        lone.expect("half of the thread");
        assert!(queue.state.lock().running.is_empty());
        drop(eight);
        assert!(queue.state.lock().turns.is_empty());
    }

    #[tokio::test(start_paused = true)]
    async fn with_a_thread_for_each_caller_none_waits_for_the_other() {
        let queue = WorkQueue::new(2);
        let begun = Instant::now();
        let all = [(1, 0), (1, 7), (1, 13), (2, 0)].map(|(caller, after)| {
            let queue = Arc::clone(&queue);
            async move {
                tokio::time::sleep(ms(after)).await;
                let queued = queue.admit(key(caller), ms(1_000), None);
                compute(queued.expect("no deadline"), ms(1_000)).await
            }
        });
        let ends = join_all(all).await;
        let lone = ends[3].duration_since(begun);
        assert!(lone <= ms(1_000) + 2 * SLICE, "{lone:?}");
    }

    #[tokio::test(start_paused = true)]
    async fn what_cannot_end_by_its_deadline_is_refused_and_a_flood_leaves_room_for_others() {
        let queue = WorkQueue::new(2);
        let (second, due) = (ms(1_000), within(ms(4_200)));
        // With another caller, the flood has one of the threads: four seconds of work.
        let flood: Vec<_> = std::iter::from_fn(|| queue.admit(key(1), second, due).ok()).collect();
        assert_eq!(flood.len(), 4);
        let retry = queue.admit(key(1), second, due).expect_err("too late");
        assert_eq!(retry, MIN_RETRY);
        let long = queue.admit(key(1), ms(20_000), None).expect("no deadline");
        drop(long);
        // Another caller is not held up by it, and holds it up no more than was expected.
        let lone = queue
            .admit(key(2), second, within(ms(1_200)))
            .expect("in time");
        let late = queue.admit(key(3), ms(5_000), within(ms(5_100)));
        let retry = late.expect_err("a third caller would make the flood late");
        assert!(retry >= MIN_RETRY);
        let ends = join_all(flood.into_iter().map(|queued| compute(queued, second)));
        let (ends, lone) = tokio::join!(ends, compute(lone, second));
        assert!(ends.iter().all(|end| Some(*end) <= due));
        assert!(lone <= due.expect("one") - ms(3_000));
    }

    #[tokio::test(start_paused = true)]
    async fn nobody_keeps_the_first_computation_of_another_caller_out() {
        let queue = WorkQueue::new(1);
        let flood: Vec<_> = (1..9)
            .map(|caller| queue.admit(key(caller), ms(1_000), within(ms(9_000))))
            .collect();
        assert!(flood.iter().all(Result::is_ok));
        // An equal share is a ninth of the thread.
        let most = queue.admit(key(9), ms(1_000), within(ms(8_500)));
        most.expect_err("it needs nine seconds");
        let quick = queue.admit(key(9), ms(100), within(ms(1_300)));
        quick.expect("in time, although the others have no slack");
    }

    #[tokio::test(start_paused = true)]
    async fn threads_that_rooms_leave_little_time_admit_less() {
        let queue = WorkQueue::new(1);
        let first = queue.admit(key(1), ms(10_000), None).expect("no deadline");
        for _ in 0..100 {
            first.computed(ms(5), SLICE);
        }
        let refused = queue.admit(key(2), ms(1_000), within(ms(4_000)));
        refused.expect_err("half of a quarter of a thread is 8 s");
        drop(first);
        let admitted = queue.admit(key(2), ms(1_000), within(ms(4_000)));
        admitted.expect("nothing is known about an idle machine");
    }

    /// Whatever callers add to what they have: everything that was admitted ends by its deadline.
    #[tokio::test(start_paused = true)]
    async fn what_was_admitted_ends_in_time() {
        let mut chance = ChaCha8Rng::seed_from_u64(15);
        let (mut admitted, mut refused) = (0, 0);
        for threads in [1, 2, 3] {
            let queue = WorkQueue::new(threads);
            let mut running = Vec::new();
            let patient = (1..5).map(|caller| queue.admit(key(caller), ms(100_000), None));
            let patient: Vec<_> = patient.map(|queued| queued.expect("no deadline")).collect();
            let patient = patient
                .into_iter()
                .map(|queued| compute(queued, ms(100_000)));
            running.extend(patient.map(|computing| {
                tokio::spawn(async {
                    computing.await;
                })
            }));
            for _ in 0..300 {
                tokio::time::sleep(ms(chance.random_range(0..600))).await;
                let work = ms(chance.random_range(1..3_000));
                let due = within(3 * work + ms(chance.random_range(0..9_000)));
                match queue.admit(key(chance.random_range(1..5)), work, due) {
                    Err(_) => refused += 1,
                    Ok(queued) => running.push(tokio::spawn(async move {
                        let end = compute(queued, work).await;
                        assert!(Some(end) <= due, "late by {:?}", end - due.expect("one"));
                    })),
                }
            }
            admitted += running.len() - 4;
            for end in running {
                end.await.expect("in time");
            }
        }
        assert!(admitted > 100 && refused > 100, "{admitted} and {refused}");
    }
}
