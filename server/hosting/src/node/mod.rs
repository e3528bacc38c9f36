//! The task of a node: does what the core (`chefshat_cluster::Node`) puts out, and brings the
//! answers in. Requests to the database run beside each other; what is done with one unit is done
//! one after another: `keyed_queue` keeps their order, and `units` resumes and stops what the node owns.

mod keyed_queue;
#[cfg(test)]
mod tests;
mod units;

use std::collections::BTreeMap;
use std::panic::AssertUnwindSafe;
use std::sync::Arc;
use std::time::Duration;

use chefshat_base::metrics::StoreMetrics;
use chefshat_cluster::{BeatAnswer, ClaimAnswer, Input, Node, Output, Phase, surplus};
use futures::FutureExt as _;
use futures::future::pending;
use tokio::sync::{Semaphore, watch};
use tokio::task::{JoinHandle, JoinSet};
use tokio::time::{Instant, MissedTickBehavior, interval, sleep, sleep_until, timeout};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

pub use units::Hosted;

use crate::cluster::{NodeLease, UnitEvent};
use chefshat_base::clock::millis;
use chefshat_base::tasks::{LongTask, named, short};
use chefshat_room::ids::UnitId;
use chefshat_store::StoreError;
use chefshat_store::cluster::{ClusterStore, Epoch, Heartbeat, Load, NodeId, NodeInfo};
use keyed_queue::KeyedQueue;
use units::{Resumed, Units};

/// How long an answer of the database is awaited, except to a beat. After that, the next beat says
/// what happened.
const ANSWER_TIME: Duration = Duration::from_secs(4);
/// Time between two searches for units that nobody owns.
const FIND_INTERVAL: Duration = Duration::from_millis(500);
/// Time between two removals of what is over.
const TIDY_INTERVAL: Duration = Duration::from_secs(30);
/// Time between two comparisons of how full the nodes are.
const BALANCE_INTERVAL: Duration = Duration::from_secs(5);
/// Most units that are handed over after one comparison, so that most rooms always go on.
const MOVED_AT_ONCE: usize = 64;
/// How long a full node leaves orphans to others: longer than any needs to find and claim them.
const LEFT_TO_OTHERS: Duration = Duration::from_secs(3);
/// How long a unit that was handed over is left to its next owner, and to others: longer than that one
/// needs to claim it and to beat.
const LEFT_TO_NEXT: Duration = Duration::from_secs(5);
/// Most orphans that are looked for at a time, so that several nodes share them.
const ORPHANS_AT_ONCE: usize = 64;
/// Units that are handed over at a time: each is away only from its own last commit on.
const RELEASES_AT_ONCE: usize = 8;
/// How long a unit that this node could not resume is left to others, such as those of another version.
/// Then it tries again: the reason may have passed.
const LEFT_ALONE: Duration = Duration::from_mins(10);
/// Pause before a node that was removed from the database tries again to join.
const REJOIN_PAUSE: Duration = Duration::from_secs(1);

/// A server as a node of a cluster. Dropping it ends its task without handing anything over.
#[derive(Debug)]
pub struct ClusterNode {
    drain: CancellationToken,
    is_asked_to_drain: watch::Receiver<bool>,
    serves: watch::Receiver<bool>,
    task: JoinHandle<()>,
}

impl ClusterNode {
    /// Starts the task of a node that has joined. It takes nothing until it is reached
    /// ([`NodeLease::set_reached`]). When it is drained, ephemeral games may continue for `grace`.
    pub fn start(
        id: NodeId,
        info: NodeInfo,
        grace: Duration,
        store: Arc<dyn ClusterStore>,
        hosted: Hosted,
    ) -> Self {
        let drain = CancellationToken::new();
        let (asked, is_asked_to_drain) = watch::channel(false);
        let (serves, is_serving) = watch::channel(false);
        let lease = hosted.rooms.lease();
        let lease = Arc::clone(lease.expect("the rooms of a node have a lease"));
        lease.joined(id);
        let reached = lease.reached();
        let units = Units::new(Arc::clone(&store), hosted, grace);
        let task = Task {
            node: Node::new(id, store.lease()),
            orphans: BTreeMap::new(),
            info,
            store,
            lease,
            units: Arc::new(units),
            began: Instant::now(),
            running: BTreeMap::new(),
            left_alone: BTreeMap::new(),
            next_owners: BTreeMap::new(),
            nothing_to_run: BTreeMap::new(),
            queue: KeyedQueue::default(),
            answers: JoinSet::new(),
            releases: Arc::new(Semaphore::new(RELEASES_AT_ONCE)),
            search: Arc::new(Semaphore::new(1)),
            asked,
            serves,
            reached,
            leaves: false,
            was_suspended: false,
        };
        Self {
            task: tokio::spawn(named(LongTask::Node, task.run(drain.clone()))),
            drain,
            is_asked_to_drain,
            serves: is_serving,
        }
    }

    /// Completes when somebody asks the node, in the database, to hand over what it owns.
    pub async fn asked_to_drain(&self) {
        let mut asked = self.is_asked_to_drain.clone();
        if asked.wait_for(|asked| *asked).await.is_err() {
            pending().await
        }
    }

    /// Whether the node has a lease and has been reached since it joined, and each change of that.
    pub fn serves(&self) -> watch::Receiver<bool> {
        self.serves.clone()
    }

    /// Takes nothing over any more, hands everything over, and leaves the cluster. The rooms and
    /// tournaments must accept no new ones.
    pub async fn drain(&mut self) {
        self.drain.cancel();
        if let Err(problem) = (&mut self.task).await {
            error!(%problem, "the task of the node has failed");
        }
    }
}

impl Drop for ClusterNode {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// What a request to the database, or work with a unit, comes to.
enum Event {
    Answer(Input<UnitId>),
    /// Orphans were found.
    Found(Vec<(UnitId, Epoch)>),
    /// Claims of orphans, with the epochs at which they were seen, were answered.
    Claimed(Vec<(UnitId, Epoch, ClaimAnswer)>),
    /// This node is too full: these units are for others.
    TooFull(Vec<(UnitId, NodeId)>),
    /// A unit was released at this epoch because this node cannot resume it.
    GivenUp(UnitId, Epoch),
    /// A unit has nothing to run at this epoch.
    NothingToRun(UnitId, Epoch),
    /// A beat was answered, and the node was asked to hand over what it owns.
    AskedToDrain(Input<UnitId>),
    /// A unit was resumed or stopped, and nothing follows.
    Nothing,
    /// The node is removed from the database.
    Left,
}

struct Task {
    node: Node<UnitId>,
    /// Orphans that were found, and when first.
    orphans: BTreeMap<UnitId, Instant>,
    info: NodeInfo,
    store: Arc<dyn ClusterStore>,
    units: Arc<Units>,
    lease: Arc<NodeLease>,
    began: Instant,
    /// The epochs at which units are resumed here.
    running: BTreeMap<UnitId, Epoch>,
    /// Units that this node leaves to others, and until when: it could not resume them, or has handed
    /// them over at an epoch.
    left_alone: BTreeMap<UnitId, (Option<Epoch>, Instant)>,
    /// The next owners of units that are handed over because this node is too full.
    next_owners: BTreeMap<UnitId, NodeId>,
    /// Units that are this node's, at these epochs, and have nothing to run: ephemeral rooms that have
    /// stopped.
    nothing_to_run: BTreeMap<UnitId, Epoch>,
    queue: KeyedQueue,
    answers: JoinSet<Event>,
    releases: Arc<Semaphore>,
    /// Held by the search for orphans.
    search: Arc<Semaphore>,
    asked: watch::Sender<bool>,
    serves: watch::Sender<bool>,
    /// Whether it has been reached since it joined. Until then it takes nothing over.
    reached: watch::Receiver<bool>,
    /// Whether it is leaving by itself, after it has handed over everything.
    leaves: bool,
    /// Whether it has lost its lease and said so.
    was_suspended: bool,
}

impl Task {
    async fn run(mut self, drain: CancellationToken) {
        let mut finding = interval(FIND_INTERVAL);
        finding.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut tidying = interval(TIDY_INTERVAL);
        tidying.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut balancing = interval(BALANCE_INTERVAL);
        balancing.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let store = Arc::clone(&self.store);
        self.put_in(Input::Time);
        loop {
            let is_draining = self.node.phase() != Phase::Serving;
            let wakes_at = self.node.wakes_at_ms();
            let alarm = self.began + Duration::from_millis(wakes_at.unwrap_or_default());
            tokio::select! {
                Some(event) = self.answers.join_next() => match event {
                    Ok(Event::Answer(input)) => self.answered(input),
                    Ok(Event::Found(orphans)) => self.found(orphans),
                    Ok(Event::Claimed(claims)) => self.claimed(claims),
                    Ok(Event::TooFull(units)) => self.hand_over(units),
                    Ok(Event::GivenUp(unit, epoch)) => self.given_up(unit, epoch),
                    Ok(Event::NothingToRun(unit, epoch)) => {
                        self.nothing_to_run.insert(unit, epoch);
                    }
                    Ok(Event::AskedToDrain(input)) => {
                        self.asked.send_replace(true);
                        self.answered(input);
                    }
                    Ok(Event::Nothing) => {}
                    Ok(Event::Left) => return,
                    Err(problem) => error!(%problem, "work for the cluster has failed"),
                },
                news = self.lease.news() => {
                    for (unit, news) in news {
                        match news {
                            UnitEvent::Created { ephemeral } => {
                                self.put_in(Input::Created { unit, ephemeral });
                            }
                            UnitEvent::Stopped => self.has_stopped(unit),
                        }
                    }
                }
                () = sleep_until(alarm), if wakes_at.is_some() => self.put_in(Input::Time),
                orphan = store.handed_over() => {
                    let orphans = self.claimable(vec![orphan]);
                    self.put_in(Input::Orphans(orphans));
                }
                _ = finding.tick() => self.find_orphans(),
                _ = tidying.tick() => self.tidy(),
                _ = balancing.tick() => self.balance(),
                Ok(()) = self.reached.changed() => self.put_in(Input::Time),
                () = drain.cancelled(), if !is_draining => self.put_in(Input::Drain),
            }
            if self.node.phase() == Phase::Left && !self.leaves {
                // The database has removed it.
                let rejoined = drain.run_until_cancelled(self.rejoin()).await;
                if rejoined.is_none() {
                    // It owns nothing that it could hand over. What it has run stops.
                    while self.answers.join_next().await.is_some() {}
                    return;
                }
            }
        }
    }

    fn now_ms(&self) -> u64 {
        millis(self.began.elapsed())
    }

    fn put_in(&mut self, input: Input<UnitId>) {
        let now_ms = self.now_ms();
        let mut claims = Vec::new();
        for output in self.node.handle(input, now_ms) {
            match output {
                Output::Claim(unit, seen) => claims.push((unit, seen)),
                output => self.put_out(output),
            }
        }
        if !claims.is_empty() {
            self.claim(claims);
        }
        let until_ms = self.node.publishes_until_ms();
        self.lease.set(self.began + Duration::from_millis(until_ms));
        let has_lease = self.node.may_publish(now_ms);
        self.units.metrics().leased(has_lease);
        let is_reached = *self.reached.borrow();
        self.units.metrics().reached(is_reached);
        let serves = has_lease && is_reached;
        self.serves.send_if_modified(|known| {
            let is_new = *known != serves;
            *known = serves;
            is_new
        });
    }

    /// Takes the answer of the database to something.
    fn answered(&mut self, input: Input<UnitId>) {
        let is_beat = matches!(input, Input::Beat { .. });
        if let Input::Released(unit, epoch, true) = input
            && self.next_owners.remove(&unit).is_some()
        {
            self.units.metrics().handed_over();
            self.leave_alone(unit, Some(epoch), LEFT_TO_NEXT);
        }
        self.put_in(input);
        if is_beat && self.node.phase() == Phase::Serving {
            self.resume_missing();
        }
    }

    /// Compares what this node owns with what it runs. What it neither runs nor is about to, it resumes
    /// after its next beat: for example a room whose creation was answered after the end of the lease,
    /// when the rooms of the node had been stopped.
    fn resume_missing(&mut self) {
        let owned: BTreeMap<UnitId, Epoch> = self.node.owned().collect();
        (self.nothing_to_run).retain(|unit, epoch| owned.get(unit) == Some(epoch));
        for (unit, epoch) in owned {
            let is_missing = !self.nothing_to_run.contains_key(&unit)
                && self.queue.is_idle(unit)
                && !self.units.has(unit);
            if is_missing {
                info!(%unit, epoch = epoch.0, "it is this node's but does not run; it is resumed");
                self.running.remove(&unit);
                self.put_in(Input::Fenced(unit, epoch));
            }
        }
    }

    fn put_out(&mut self, output: Output<UnitId>) {
        let store = Arc::clone(&self.store);
        match output {
            Output::Beat => {
                self.queue.forget_ended();
                let sent_ms = self.now_ms();
                let heartbeat = Heartbeat {
                    reached: *self.reached.borrow(),
                    rooms: self.load().rooms,
                    drains: self.node.phase() != Phase::Serving,
                    unreachable: self.units.metrics().unreachable_peers(),
                    is_stalled: store.metrics().is_some_and(StoreMetrics::is_stalled),
                };
                // A beat without an answer must not take up the time of the next one, which the
                // lease may still wait for.
                let within = Duration::from_millis(store.lease().beat_every_ms());
                let beating = async move { beat(&*store, within, sent_ms, heartbeat).await };
                let answer = BeatAnswer::None;
                self.spawn(beating, Event::Answer(Input::Beat { sent_ms, answer }));
            }
            Output::FindOrphans => self.find_orphans(),
            Output::Claim(unit, seen) => self.claim(vec![(unit, seen)]),
            Output::Serve(unit, epoch) => {
                self.units.want(unit, epoch);
                // One of its rooms may stop before all are resumed.
                self.running.insert(unit, epoch);
                let units = Arc::clone(&self.units);
                let resuming = async move {
                    match units.resume(unit, epoch).await {
                        Resumed::Runs => Event::Nothing,
                        Resumed::Nothing => Event::NothingToRun(unit, epoch),
                        Resumed::Impossible => match units.give_up(unit, epoch).await {
                            true => Event::GivenUp(unit, epoch),
                            false => Event::Nothing,
                        },
                    }
                };
                // After the next beat it is missed, and resumed again.
                self.queue(unit, resuming, Event::Nothing);
            }
            Output::Stop(unit) => self.stop(unit),
            Output::Suspend => {
                self.was_suspended = true;
                warn!("the node has no lease; it publishes nothing until it has");
            }
            // Logged like the problem that it ends.
            Output::Resume => match std::mem::take(&mut self.was_suspended) {
                true => warn!("the node has a lease again"),
                false => info!("the node has a lease"),
            },
            Output::Release(unit, epoch) => {
                self.units.unwant(unit);
                let next = self.next_owners.get(&unit).copied();
                let (units, releases) = (Arc::clone(&self.units), Arc::clone(&self.releases));
                let releasing = async move {
                    units.until_ephemeral_over(unit).await;
                    let _permit = releases.acquire().await.expect("it is never closed");
                    let is_released = units.release(unit, epoch, next).await;
                    Event::Answer(Input::Released(unit, epoch, is_released))
                };
                let not_released = Event::Answer(Input::Released(unit, epoch, false));
                self.queue(unit, releasing, not_released);
            }
            Output::Leave => {
                self.leaves = true;
                let leaving = async move {
                    // If no answer comes, the node is removed when its lease has expired.
                    answer("leave", ANSWER_TIME, store.leave()).await;
                    Event::Left
                };
                self.spawn(leaving, Event::Left);
            }
        }
    }

    /// Claims units together.
    fn claim(&mut self, orphans: Vec<(UnitId, Epoch)>) {
        let store = Arc::clone(&self.store);
        let claims = orphans
            .iter()
            .map(|(unit, seen)| (*unit, *seen, ClaimAnswer::None));
        let mut claims: Vec<_> = claims.collect();
        let unanswered = Event::Claimed(claims.clone());
        let claiming = async move {
            let claimed = answer("claim", ANSWER_TIME, store.claim_all(orphans)).await;
            for ((.., answer), epoch) in claims.iter_mut().zip(claimed.into_iter().flatten()) {
                *answer = epoch.map_or(ClaimAnswer::Lost, ClaimAnswer::Won);
            }
            Event::Claimed(claims)
        };
        self.spawn(claiming, unanswered);
    }

    fn claimed(&mut self, claims: Vec<(UnitId, Epoch, ClaimAnswer)>) {
        let is_any_won = (claims.iter()).any(|(.., it)| matches!(it, ClaimAnswer::Won(_)));
        for (unit, seen, answer) in claims {
            self.put_in(Input::Claimed(unit, seen, answer));
        }
        if is_any_won {
            // There may be more than are looked for at a time.
            self.find_orphans();
        }
    }

    /// Takes orphans over. A full node first leaves them to others, and takes those that stay without
    /// an owner: games that are acknowledged come before its limit.
    fn found(&mut self, orphans: Vec<(UnitId, Epoch)>) {
        let mut orphans = self.claimable(orphans);
        let now = Instant::now();
        let earlier = std::mem::take(&mut self.orphans);
        let found = orphans.iter().map(|(unit, _)| *unit);
        self.orphans = found
            .map(|unit| (unit, earlier.get(&unit).copied().unwrap_or(now)))
            .collect();
        let Load { rooms, capacity } = self.load();
        let mut free = capacity.saturating_sub(rooms);
        let mut left_by_others = 0;
        orphans.retain(|(unit, _)| {
            let is_left = now - self.orphans[unit] >= LEFT_TO_OTHERS;
            let has_space = free > 0;
            free = free.saturating_sub(1);
            left_by_others += usize::from(is_left && !has_space);
            is_left || has_space
        });
        if left_by_others > 0 {
            warn!(
                units = left_by_others,
                rooms,
                capacity,
                "no other node takes these units over; this one does, though it is full"
            );
        }
        self.put_in(Input::Orphans(orphans));
    }

    /// Those of these orphans that the node may claim and does not leave to others.
    fn claimable(&self, mut orphans: Vec<(UnitId, Epoch)>) -> Vec<(UnitId, Epoch)> {
        let is_reached = *self.reached.borrow();
        orphans.retain(|(unit, seen)| is_reached && !self.leaves_alone(*unit, *seen));
        orphans
    }

    /// How full the node is, with what it is about to run.
    fn load(&self) -> Load {
        let Load { rooms, capacity } = self.units.load();
        let coming = self.node.claiming() + self.units.resuming();
        Load {
            rooms: rooms + coming as u64,
            capacity,
        }
    }

    fn leave_alone(&mut self, unit: UnitId, epoch: Option<Epoch>, time: Duration) {
        self.left_alone.insert(unit, (epoch, Instant::now() + time));
    }

    fn leaves_alone(&self, unit: UnitId, seen: Epoch) -> bool {
        let left = self.left_alone.get(&unit);
        left.is_some_and(|(epoch, _)| epoch.is_none_or(|epoch| epoch == seen))
    }

    /// Compares how full the nodes are.
    fn balance(&mut self) {
        if !self.may_hand_over() {
            return;
        }
        let (store, units) = (Arc::clone(&self.store), Arc::clone(&self.units));
        let (own, id, build) = (self.load(), self.node.id(), self.info.build.clone());
        let comparing = async move {
            let alive = answer("compare nodes", ANSWER_TIME, store.alive()).await;
            // Another version may not be able to resume what this one runs.
            let others = (alive.into_iter().flatten())
                .filter(|node| node.id != id && node.info.build == build);
            let others: Vec<_> = others
                .filter_map(|node| Some((node.id, node.load?)))
                .collect();
            let moves = surplus(own, &others);
            let chosen = timeout(ANSWER_TIME, units.to_hand_over(moves, MOVED_AT_ONCE)).await;
            chosen.map_or(Event::Nothing, Event::TooFull)
        };
        self.spawn(comparing, Event::Nothing);
    }

    /// Whether it may hand units over to others: not before those that have the last ones have said so.
    fn may_hand_over(&mut self) -> bool {
        let node = &self.node;
        self.next_owners.retain(|unit, _| node.is_leaving(*unit));
        let is_any_new = self.left_alone.values().any(|(epoch, _)| epoch.is_some());
        self.next_owners.is_empty()
            && !is_any_new
            && *self.reached.borrow()
            && node.may_claim(self.now_ms())
    }

    /// Hands units over to nodes that are less full.
    fn hand_over(&mut self, units: Vec<(UnitId, NodeId)>) {
        if units.is_empty() || !self.may_hand_over() {
            return;
        }
        info!(
            units = units.len(),
            "other nodes are less full; units are handed over to them"
        );
        for (unit, next) in units {
            self.next_owners.insert(unit, next);
            self.put_in(Input::HandOver(unit));
        }
    }

    fn given_up(&mut self, unit: UnitId, epoch: Epoch) {
        let minutes = LEFT_ALONE.as_secs() / 60;
        self.units.metrics().not_resumed();
        error!(%unit, minutes, "nothing of it can be resumed here; for some time it is left to other nodes");
        self.leave_alone(unit, None, LEFT_ALONE);
        self.running.remove(&unit);
        self.put_in(Input::Released(unit, epoch, true));
    }

    fn tidy(&mut self) {
        // After an outage of the database, other nodes get time to renew their leases.
        if !self.node.may_claim(self.now_ms()) {
            return;
        }
        let store = Arc::clone(&self.store);
        let tidying = async move {
            answer("tidy up", TIDY_INTERVAL, store.tidy()).await;
            Event::Nothing
        };
        self.spawn(tidying, Event::Nothing);
    }

    fn find_orphans(&mut self) {
        if !*self.reached.borrow() || !self.node.may_claim(self.now_ms()) {
            return;
        }
        // A database that is slow is asked once at a time.
        let Ok(search) = Arc::clone(&self.search).try_acquire_owned() else {
            return;
        };
        // Those that it leaves to others are found as well.
        let now = Instant::now();
        self.left_alone.retain(|_, (_, until)| now < *until);
        let count = ORPHANS_AT_ONCE + self.left_alone.len();
        let store = Arc::clone(&self.store);
        let finding = async move {
            let orphans = answer("look for orphans", ANSWER_TIME, store.orphans(count)).await;
            drop(search);
            orphans.map_or(Event::Nothing, Event::Found)
        };
        self.spawn(finding, Event::Nothing);
    }

    /// Stops a unit at once.
    fn stop(&mut self, unit: UnitId) {
        self.units.fence(unit);
        self.running.remove(&unit);
        let units = Arc::clone(&self.units);
        let stopping = async move {
            units.stop(unit).await;
            Event::Nothing
        };
        self.queue(unit, stopping, Event::Nothing);
    }

    /// Something of a unit has stopped by itself, so all of it stops. If the node still owns it, it
    /// resumes it after its next beat.
    fn has_stopped(&mut self, unit: UnitId) {
        // What was created here is at the first epoch.
        let epoch = self.running.get(&unit).copied().unwrap_or(Epoch::FIRST);
        self.stop(unit);
        self.put_in(Input::Fenced(unit, epoch));
    }

    /// Does something with a unit after what is done with it already.
    fn queue(
        &mut self,
        unit: UnitId,
        work: impl Future<Output = Event> + Send + 'static,
        if_it_panics: Event,
    ) {
        let mut turn = self.queue.take(unit);
        let in_turn = async move {
            turn.comes().await;
            work.await
        };
        self.spawn(in_turn, if_it_panics);
    }

    /// Starts work whose event comes in any case: the core keeps a mark for what it waits for, and
    /// without an answer it would wait forever.
    fn spawn(&mut self, work: impl Future<Output = Event> + Send + 'static, if_it_panics: Event) {
        self.answers.spawn(short(
            "one request to the database, within its time limit",
            async move {
                // Nothing that it leaves behind is used again, but by locks that say so.
                let worked = AssertUnwindSafe(work).catch_unwind().await;
                worked.unwrap_or_else(|_| {
                    error!("work for the cluster has failed");
                    if_it_panics
                })
            },
        ));
    }

    /// Joins as a new node: the database has removed this one, which was away for long.
    async fn rejoin(&mut self) {
        warn!("the node was removed from the database; it joins again");
        let id = loop {
            match self.store.join(self.info.clone()).await {
                Ok(id) => break id,
                Err(error) => {
                    warn!(%error, "joining failed; trying again");
                    sleep(REJOIN_PAUSE).await;
                }
            }
        };
        self.lease.joined(id);
        self.node = Node::new(id, self.store.lease());
        self.put_in(Input::Time);
    }
}

/// Beats, and reads what the node owns.
async fn beat(
    store: &dyn ClusterStore,
    within: Duration,
    sent_ms: u64,
    heartbeat: Heartbeat,
) -> Event {
    let (answer, drain) = match answer("beat", within, store.beat(heartbeat)).await {
        Some(Some(beat)) => (BeatAnswer::Renewed(beat.owned), beat.drain),
        Some(None) => (BeatAnswer::Unknown, false),
        None => (BeatAnswer::None, false),
    };
    let input = Input::Beat { sent_ms, answer };
    match drain {
        true => Event::AskedToDrain(input),
        false => Event::Answer(input),
    }
}

/// The answer of the database; `None` if it failed or none came in time.
async fn answer<T>(
    what: &str,
    within: Duration,
    asked: impl Future<Output = Result<T, StoreError>>,
) -> Option<T> {
    match timeout(within, asked).await {
        Ok(Ok(answer)) => Some(answer),
        Ok(Err(error)) => {
            warn!(what, %error, "the database did not do what the cluster needs");
            None
        }
        Err(_) => {
            warn!(what, "the database did not answer");
            None
        }
    }
}
