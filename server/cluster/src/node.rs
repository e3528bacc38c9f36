//! What one node knows and wants: it beats, takes orphans over, hands everything over when it is drained, and serves nothing without
//! a lease. The caller does what it puts out, one transaction each, and brings the answers in, in any order; that no answer
//! came is brought in as well, once the caller has waited long enough.
//!
//! Each answer to a beat says which units the node owns according to the database. So if an answer is lost (to a claim or a
//! release), the node learns the truth with one of its next beats. A node whose lease has expired stops all that others can
//! take over; what nobody else has taken over meanwhile it serves again with its next beat.

use std::collections::{BTreeMap, BTreeSet};

use crate::{Epoch, Lease, LeaseTimes, NodeId};

/// What a node is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Phase {
    /// Serves and takes over.
    Serving,
    /// Hands over what it owns and takes nothing new.
    Draining,
    /// Owns nothing any more: drained, or forgotten by the database.
    Left,
}

/// The answer to a beat.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum BeatAnswer<K> {
    /// The lease is renewed. In the same transaction the node owned these.
    Renewed(Vec<(K, Epoch)>),
    /// The database does not know the node: it was away for long and has been removed.
    Unknown,
    /// No answer came.
    None,
}

/// The answer to a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum ClaimAnswer {
    /// The node owns it, at this epoch.
    Won(Epoch),
    /// It was no orphan any more.
    Lost,
    /// No answer came.
    None,
}

/// What happened.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Input<K> {
    /// Time has passed.
    Time,
    /// A beat that was sent at this time was answered.
    Beat {
        /// When it was sent, on the clock of this node.
        sent_ms: u64,
        /// The answer.
        answer: BeatAnswer<K>,
    },
    /// Orphans were found, or somebody said that there are some.
    Orphans(Vec<(K, Epoch)>),
    /// The claim of an orphan that was seen at this epoch was answered.
    Claimed(K, Epoch, ClaimAnswer),
    /// A unit was created here.
    Created {
        /// The unit.
        unit: K,
        /// Whether it cannot outlive its node, so that no other node can take it over.
        ephemeral: bool,
    },
    /// A write was refused at this epoch: another node owns the unit.
    Fenced(K, Epoch),
    /// A release at this epoch was answered; `false` if no answer came.
    Released(K, Epoch, bool),
    /// A unit is to be handed over to a node that is less full.
    HandOver(K),
    /// The node is to hand everything over and leave.
    Drain,
}

/// What the caller has to do.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Output<K> {
    /// Beat, and read in the same transaction what the node owns.
    Beat,
    /// Look for orphans.
    FindOrphans,
    /// Claim an orphan that was seen at this epoch.
    Claim(K, Epoch),
    /// Read its journals and run it.
    Serve(K, Epoch),
    /// Stop running it at once and publish nothing more.
    Stop(K),
    /// Publish nothing until `Resume`: the lease has ended.
    Suspend,
    /// The lease holds again, and the node still owns what still runs.
    Resume,
    /// Stop running it when its last writes are answered, then release it.
    Release(K, Epoch),
    /// Remove the node from the database, where it owns nothing.
    Leave,
}

/// A node.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Node<K> {
    id: NodeId,
    lease: Lease,
    phase: Phase,
    owned: BTreeMap<K, Epoch>,
    /// Those of `owned` that no other node can take over.
    ephemeral: BTreeSet<K>,
    /// Claims without an answer: the epochs at which the orphans were seen, and whether the lease has held since. Otherwise the
    /// answer may be older than a takeover by another node, and only the next beats tell who owns the unit.
    claiming: BTreeMap<K, (Epoch, bool)>,
    releasing: BTreeSet<K>,
    /// Those of `owned` that are handed over although the node stays.
    leaving: BTreeSet<K>,
    suspended: bool,
    /// When it may take over again after it has regained its lease. The database may have been away for all nodes: the first
    /// one to reach it again must not take everything from the others.
    claims_from_ms: u64,
    /// Whether a beat waits for its answer.
    beating: bool,
    beats_at_ms: u64,
    /// What changed hands since the last beat was sent: its answer may be older.
    changed: BTreeSet<K>,
}

impl<K: Ord + Copy> Node<K> {
    /// A node that has just joined: it has no lease until its first beat is committed.
    pub fn new(id: NodeId, times: LeaseTimes) -> Self {
        Self {
            id,
            lease: Lease::new(times),
            phase: Phase::Serving,
            owned: BTreeMap::new(),
            ephemeral: BTreeSet::new(),
            claiming: BTreeMap::new(),
            releasing: BTreeSet::new(),
            leaving: BTreeSet::new(),
            suspended: true,
            claims_from_ms: 0,
            beating: false,
            beats_at_ms: 0,
            changed: BTreeSet::new(),
        }
    }

    /// Its id.
    pub fn id(&self) -> NodeId {
        self.id
    }

    /// What it is doing.
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// Whether it may publish what is committed, and answer for its units.
    pub fn may_publish(&self, now_ms: u64) -> bool {
        !self.suspended && self.lease.holds(now_ms)
    }

    /// When it must have stopped publishing, on its own clock, unless a beat is committed before. The past if it may not publish.
    pub fn publishes_until_ms(&self) -> u64 {
        match self.suspended {
            true => 0,
            false => self.lease.ends_ms(),
        }
    }

    /// Whether it accepts new decisions for a unit.
    pub fn serves(&self, unit: K, now_ms: u64) -> bool {
        self.may_publish(now_ms)
            && self.owned.contains_key(&unit)
            && !self.releasing.contains(&unit)
    }

    /// Whether it may create a unit.
    pub fn may_create(&self, now_ms: u64) -> bool {
        self.phase == Phase::Serving && self.may_publish(now_ms)
    }

    /// Whether it may look for orphans and claim them.
    pub fn may_claim(&self, now_ms: u64) -> bool {
        self.may_create(now_ms) && now_ms >= self.claims_from_ms
    }

    /// The units that it owns, as far as it knows.
    pub fn owned(&self) -> impl Iterator<Item = (K, Epoch)> {
        self.owned.iter().map(|(id, epoch)| (*id, *epoch))
    }

    /// How many units it claims.
    pub fn claiming(&self) -> usize {
        self.claiming.len()
    }

    /// Whether it is about to hand a unit over although it stays.
    pub fn is_leaving(&self, unit: K) -> bool {
        self.leaving.contains(&unit)
    }

    /// When it wants to be woken with [`Input::Time`]; `None` if only answers matter. It has nothing
    /// due until then.
    pub fn wakes_at_ms(&self) -> Option<u64> {
        let beats = !self.beating && self.phase != Phase::Left;
        let beats_at_ms = beats.then_some(self.beats_at_ms);
        let has_claimable = self.owned.len() > self.ephemeral.len();
        let ends_ms = match (self.suspended, has_claimable) {
            (false, _) => Some(self.lease.ends_ms()),
            (true, true) => Some(self.expires_ms()),
            (true, false) => None,
        };
        beats_at_ms.into_iter().chain(ends_ms).min()
    }

    /// From when on others may take over what it owns, on its own clock.
    fn expires_ms(&self) -> u64 {
        self.lease.ends_ms() + self.lease.times().margin_ms()
    }

    /// Takes in what happened and returns what has to be done, in order.
    pub fn handle(&mut self, input: Input<K>, now_ms: u64) -> Vec<Output<K>> {
        let mut outputs = Vec::new();
        self.suspend_without_lease(now_ms, &mut outputs);
        if self.phase == Phase::Left {
            return outputs;
        }
        match input {
            Input::Time => {}
            Input::Beat { sent_ms, answer } => self.beaten(sent_ms, answer, now_ms, &mut outputs),
            Input::Orphans(orphans) => self.claim(orphans, now_ms, &mut outputs),
            Input::Claimed(id, seen, answer) => self.claimed(id, seen, answer, &mut outputs),
            Input::Created { unit, ephemeral } => {
                self.own(unit, Epoch::FIRST);
                if ephemeral {
                    self.ephemeral.insert(unit);
                }
            }
            Input::Fenced(id, epoch) => {
                if self.owned.get(&id) == Some(&epoch) {
                    self.disown(id);
                    outputs.push(Output::Stop(id));
                }
            }
            // An answer that comes late may be about an earlier epoch.
            Input::Released(id, epoch, is_answered) => {
                if self.owned.get(&id) == Some(&epoch) {
                    match is_answered {
                        true => self.disown(id),
                        // Whether it was released is in the answer to a later beat.
                        false => {
                            self.changed.insert(id);
                            self.releasing.remove(&id);
                        }
                    }
                }
            }
            // What no other node can take over stays.
            Input::HandOver(id) => {
                if self.owned.contains_key(&id) && !self.ephemeral.contains(&id) {
                    self.leaving.insert(id);
                }
            }
            Input::Drain => {
                self.phase = Phase::Draining;
                self.beats_at_ms = now_ms;
            }
        }
        self.release(&mut outputs);
        if self.phase == Phase::Draining {
            // The next beat says whether it may leave.
            if self.owns_nothing() && !self.changed.is_empty() {
                self.beats_at_ms = now_ms;
            }
        }
        if self.phase != Phase::Left && !self.beating && now_ms >= self.beats_at_ms {
            self.beating = true;
            self.beats_at_ms = now_ms + self.lease.times().beat_every_ms();
            self.changed.clear();
            outputs.push(Output::Beat);
        }
        outputs
    }

    fn suspend_without_lease(&mut self, now_ms: u64, outputs: &mut Vec<Output<K>>) {
        if !self.suspended && !self.lease.holds(now_ms) {
            self.suspended = true;
            (self.claiming.values_mut()).for_each(|(_, held)| *held = false);
            outputs.push(Output::Suspend);
        }
        if self.suspended && now_ms >= self.expires_ms() {
            self.stop_claimable(outputs);
        }
    }

    /// Stops what other nodes may have taken over.
    fn stop_claimable(&mut self, outputs: &mut Vec<Output<K>>) {
        let ephemeral = &self.ephemeral;
        let claimable = self.owned.keys().filter(|id| !ephemeral.contains(id));
        outputs.extend(claimable.copied().map(Output::Stop));
        self.owned.retain(|id, _| ephemeral.contains(id));
        self.releasing.retain(|id| ephemeral.contains(id));
        self.leaving.clear();
    }

    fn own(&mut self, id: K, epoch: Epoch) {
        self.owned.insert(id, epoch);
        self.changed.insert(id);
    }

    fn disown(&mut self, id: K) {
        self.forget(id);
        self.changed.insert(id);
    }

    fn forget(&mut self, id: K) {
        self.owned.remove(&id);
        self.ephemeral.remove(&id);
        self.releasing.remove(&id);
        self.leaving.remove(&id);
    }

    fn owns_nothing(&self) -> bool {
        self.owned.is_empty() && self.claiming.is_empty()
    }

    fn beaten(
        &mut self,
        sent_ms: u64,
        answer: BeatAnswer<K>,
        now_ms: u64,
        outputs: &mut Vec<Output<K>>,
    ) {
        self.beating = false;
        match answer {
            BeatAnswer::None => {}
            BeatAnswer::Unknown => {
                // Without the node, the database does not know its ephemeral units either.
                self.ephemeral.clear();
                self.stop_claimable(outputs);
                self.phase = Phase::Left;
            }
            BeatAnswer::Renewed(owned) => {
                let is_first = self.lease.ends_ms() == 0;
                self.lease.beaten(sent_ms);
                if self.lease.holds(now_ms) {
                    self.reconcile(&owned.into_iter().collect(), outputs);
                    if self.suspended {
                        self.suspended = false;
                        if !is_first {
                            self.claims_from_ms = now_ms + self.lease.times().serve_for_ms();
                        }
                        outputs.push(Output::Resume);
                    }
                    if self.may_claim(now_ms) {
                        outputs.push(Output::FindOrphans);
                    }
                    let nothing_left = self.owns_nothing() && self.changed.is_empty();
                    if self.phase == Phase::Draining && nothing_left {
                        self.phase = Phase::Left;
                        outputs.push(Output::Leave);
                    }
                }
            }
        }
    }

    /// Corrects what the node believes to own by what the database says, except for what has changed hands since.
    fn reconcile(&mut self, truth: &BTreeMap<K, Epoch>, outputs: &mut Vec<Output<K>>) {
        let lost: Vec<K> = (self.owned.iter())
            .filter(|(id, epoch)| truth.get(id) != Some(epoch) && !self.changed.contains(id))
            .map(|(id, _)| *id)
            .collect();
        for id in lost {
            self.forget(id);
            outputs.push(Output::Stop(id));
        }
        for (&id, &epoch) in truth {
            if self.changed.contains(&id) || self.owned.contains_key(&id) {
                continue;
            }
            // The answer to the claim says nothing more, and may come when the unit has been handed over.
            self.claiming.remove(&id);
            self.owned.insert(id, epoch);
            if self.phase == Phase::Serving {
                outputs.push(Output::Serve(id, epoch));
            }
        }
    }

    fn claim(&mut self, orphans: Vec<(K, Epoch)>, now_ms: u64, outputs: &mut Vec<Output<K>>) {
        if !self.may_claim(now_ms) {
            return;
        }
        for (id, seen) in orphans {
            if !self.owned.contains_key(&id) && !self.claiming.contains_key(&id) {
                self.claiming.insert(id, (seen, true));
                outputs.push(Output::Claim(id, seen));
            }
        }
    }

    fn claimed(&mut self, id: K, seen: Epoch, answer: ClaimAnswer, outputs: &mut Vec<Output<K>>) {
        // The answer to an earlier claim may come late: the unit may have been handed over and claimed again meanwhile.
        let Some(&(_, held)) = self.claiming.get(&id).filter(|claim| claim.0 == seen) else {
            return;
        };
        self.claiming.remove(&id);
        let ClaimAnswer::Won(epoch) = answer else {
            return;
        };
        if !held {
            return;
        }
        // The answer to a beat may have said it before.
        if self.owned.get(&id).is_some_and(|owned| *owned >= epoch) {
            return;
        }
        self.own(id, epoch);
        if self.phase == Phase::Serving {
            outputs.push(Output::Serve(id, epoch));
        }
    }

    /// Releases what leaves the node, again if no answer came: whatever runs of it has been stopped.
    fn release(&mut self, outputs: &mut Vec<Output<K>>) {
        let leaving: Vec<K> = match self.phase {
            Phase::Draining => self.owned.keys().copied().collect(),
            Phase::Serving | Phase::Left => self.leaving.iter().copied().collect(),
        };
        for id in leaving {
            if let Some(&epoch) = self.owned.get(&id).filter(|_| self.releasing.insert(id)) {
                outputs.push(Output::Release(id, epoch));
            }
        }
    }
}
