//! The servers and the database around the core, as a model: what a server does with what its node puts out, what the
//! database does with a request, and what may happen in between.

mod property;

use std::collections::{BTreeMap, BTreeSet};

use chefshat_cluster::{
    BeatAnswer, ClaimAnswer, Created, Epoch, Input, LeaseTimes, Node, NodeId, Output, Phase,
    Tables, Written,
};
use stateright::{Model, Property};

/// The unit: a room, or a tournament that may create [`ROOM`].
pub(crate) const UNIT: u8 = 0;
/// The room of the tournament.
pub(crate) const ROOM: u8 = 1;

/// A mistake of the servers or the database around the core.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Fault {
    /// The database commits rows of any epoch.
    AppendWithoutEpoch,
    /// Claims do not raise the epoch, so that all writers have the present one.
    ClaimKeepsEpoch,
    /// The database ends items for writers of any epoch.
    FinishWithoutEpoch,
    /// The database ends items whose journals have other rows than the writer knows.
    FinishWithoutRows,
    /// The database creates items of a unit for creators of any epoch.
    CreationWithoutEpoch,
    /// Leases expire by the clocks of the nodes, of which the first is two behind.
    LocalClocks,
    /// A node counts its lease from receiving the answer to a beat.
    LeaseFromReceiving,
    /// Claims take over what an owner with a lease has.
    LeaseNotChecked,
    /// Decisions are published when they are sent to the database.
    PublishedEarly,
    /// Decisions are published without a lease once they are committed.
    PublishedWhileSuspended,
    /// An append without an answer counts as committed.
    UnknownIsCommitted,
}

/// What may happen, and how often.
#[derive(Clone, Copy)]
pub(crate) struct Bounds {
    pub(crate) until: u64,
    pub(crate) decisions: u8,
    pub(crate) lost: u8,
    pub(crate) crashes: u8,
    pub(crate) drains: u8,
    /// How often a node hands the unit over although it stays.
    pub(crate) handovers: u8,
    pub(crate) ends: u8,
    /// How often a room is created. With any, the unit is a tournament, whose own journal gets no row when it is taken over.
    pub(crate) creations: u8,
    /// Beats take time, and may get lost; otherwise a node sleeps, or they arrive at once.
    pub(crate) slow_beats: bool,
    pub(crate) removes: bool,
}

impl Bounds {
    /// Nothing happens.
    pub(crate) const NONE: Self = Self {
        until: 0,
        decisions: 0,
        lost: 0,
        crashes: 0,
        drains: 0,
        handovers: 0,
        ends: 0,
        creations: 0,
        slow_beats: false,
        removes: false,
    };
}

/// Two servers and a database.
pub(crate) struct Cluster {
    pub(crate) bounds: Bounds,
    pub(crate) fault: Option<Fault>,
}

/// What is written: the server that wrote it, and the number of a decision from 1; 0 is a creation or takeover.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(crate) struct Entry {
    pub(crate) server: usize,
    pub(crate) decision: u8,
}

/// A request on its way to the database; its sender may have given up on it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(crate) enum Request {
    Beat(u64),
    FindOrphans,
    Claim(Epoch),
    Release(Epoch),
    Create(Epoch),
    Append(u8, Epoch, u64, Entry),
    Finish(u8, Epoch, u64),
    Leave,
}

/// An answer on its way back.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub(crate) enum Answer {
    Beat(Option<Vec<(u8, Epoch)>>),
    Orphans(Vec<(u8, Epoch)>),
    Claimed(Option<Epoch>),
    Done,
    Created(Created),
    Written(Written),
}

/// An item that runs on a server.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Running {
    epoch: Epoch,
    /// Where the next row belongs.
    position: u64,
    /// The decision whose append is not answered.
    open: Option<Entry>,
    /// A committed decision that waits for a lease to be published.
    unpublished: Option<Entry>,
    ends: bool,
}

#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct Server {
    pub(crate) node: Node<u8>,
    pub(crate) running: BTreeMap<u8, Running>,
    /// The epoch to release once all its writes are answered.
    releases: Option<Epoch>,
    /// A room is being created. What is created is not given up, so that the server that resumes the unit finds it.
    creates: bool,
    /// Serving the unit at this epoch waits for that.
    serves_next: Option<Epoch>,
    pub(crate) left: bool,
}

#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) struct World {
    pub(crate) now: u64,
    pub(crate) tables: Tables<u8, Entry>,
    /// `None` is dead.
    pub(crate) servers: Vec<Option<Server>>,
    /// Requests with the server that sent them, and whether it still waits for the answer.
    pub(crate) requests: BTreeSet<(usize, Request, bool)>,
    pub(crate) answers: BTreeSet<(usize, Request, Answer)>,
    pub(crate) published: BTreeMap<(u8, u64), BTreeSet<(Epoch, Entry)>>,
    /// The server that claimed the unit at each epoch.
    pub(crate) owners: BTreeMap<Epoch, usize>,
    /// Something was published at an epoch that was not the present one.
    pub(crate) published_late: bool,
    /// The epoch at which each item was ended, and how many rows the server saw that did.
    pub(crate) ended: BTreeMap<u8, (Epoch, u64)>,
    decisions: u8,
    lost: u8,
    crashes: u8,
    drains: u8,
    handovers: u8,
    ends: u8,
    creations: u8,
}

#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub(crate) enum Transition {
    Tick,
    Wake(usize),
    Decide(usize, u8),
    End(usize, u8),
    Create(usize),
    Arrive(usize, Request, bool),
    Answered(usize, Request, Answer),
    /// The sender gives up; the request may still arrive.
    GivenUp(usize, Request),
    /// The request was carried out, but its answer is lost.
    AnswerLost(usize, Request, Answer),
    Crash(usize),
    Drain(usize),
    HandOver(usize),
}

impl Cluster {
    fn has(&self, fault: Fault) -> bool {
        self.fault == Some(fault)
    }

    /// Hands an input to the node of a server, which does what the node puts out.
    fn put_in(&self, world: &mut World, server: usize, input: Input<u8>) {
        let now = world.now;
        let Some(it) = &mut world.servers[server] else {
            return;
        };
        let is_time = input == Input::Time;
        let outputs = it.node.handle(input, now);
        // Otherwise its task would be woken again at once, and again.
        let wakes_at = it.node.wakes_at_ms();
        assert!(
            !is_time || wakes_at.is_none_or(|at| at > now),
            "still due at {now}"
        );
        for output in outputs {
            self.put_out(world, server, output);
        }
    }

    fn put_out(&self, world: &mut World, server: usize, output: Output<u8>) {
        let it = world.servers[server].as_mut().expect("it lives");
        match output {
            Output::Beat => self.send(world, server, Request::Beat(world.now)),
            Output::FindOrphans => self.send(world, server, Request::FindOrphans),
            Output::Claim(_, seen) => self.send(world, server, Request::Claim(seen)),
            // The journals are read at once: any other writer conflicts at the position or has another epoch.
            Output::Serve(_, epoch) if it.creates => it.serves_next = Some(epoch),
            Output::Serve(_, epoch) => it.serve(&world.tables, epoch),
            Output::Stop(_) => world.stop(server),
            Output::Suspend => {}
            Output::Resume => {
                let mut publish = Vec::new();
                for (id, running) in &mut it.running {
                    let entry = running.unpublished.take();
                    let (position, epoch) = (running.position, running.epoch);
                    publish.extend(entry.map(|entry| (*id, position - 1, epoch, entry)));
                }
                for (id, position, epoch, entry) in publish {
                    world.publish(id, position, epoch, entry);
                }
            }
            Output::Release(_, epoch) => {
                it.releases = Some(epoch);
                self.release_if_quiet(world, server);
            }
            Output::Leave => {
                it.left = true;
                self.send(world, server, Request::Leave);
            }
        }
    }

    /// Releases the unit if nothing of it waits for the database.
    fn release_if_quiet(&self, world: &mut World, server: usize) {
        let Some(it) = &mut world.servers[server] else {
            return;
        };
        let is_quiet = !it.creates && (it.running.values()).all(|it| it.open.is_none() && !it.ends);
        if let Some(epoch) = it.releases.take_if(|_| is_quiet) {
            it.running.clear();
            self.send(world, server, Request::Release(epoch));
        }
    }

    /// Sends a request. What only reads is answered at once: whatever it says may be old when it is used, as all that
    /// is done with it is checked again.
    fn send(&self, world: &mut World, server: usize, request: Request) {
        let at_once = match request {
            Request::FindOrphans | Request::Leave => true,
            Request::Beat(_) => !self.bounds.slow_beats,
            _ => false,
        };
        if at_once {
            let answer = self.carry_out(world, server, request);
            self.take_in(world, server, request, Some(answer));
        } else {
            world.requests.insert((server, request, true));
        }
    }

    /// The database carries a request out.
    fn carry_out(&self, world: &mut World, server: usize, request: Request) -> Answer {
        let node = NodeId(server as u64 + 1);
        let now = world.now;
        let takeover = Entry {
            server,
            decision: 0,
        };
        let tables = &mut world.tables;
        let any_epoch = self.has(Fault::ClaimKeepsEpoch);
        let present = |tables: &Tables<u8, Entry>, item, epoch| match tables.epoch(item) {
            Some(present) => present,
            None => epoch,
        };
        // Without takeovers that raise it, all nodes know the first epoch.
        let shown = |epoch| if any_epoch { Epoch::FIRST } else { epoch };
        match request {
            Request::Beat(_) => {
                let beat = match self.has(Fault::LocalClocks) && server == 0 {
                    true => now.saturating_sub(2),
                    false => now,
                };
                let known = tables.beat(node, beat);
                let owned = tables.owned_by(node).into_iter();
                Answer::Beat(known.then(|| owned.map(|(id, epoch)| (id, shown(epoch))).collect()))
            }
            Request::FindOrphans => {
                if self.bounds.removes {
                    tables.remove_expired(now);
                }
                match self.has(Fault::LeaseNotChecked) {
                    true => Answer::Orphans(tables.orphans(u64::MAX, 1)),
                    false => Answer::Orphans(tables.orphans(now, 1)),
                }
            }
            Request::Claim(seen) => {
                let now = match self.has(Fault::LeaseNotChecked) {
                    true => u64::MAX,
                    false => now,
                };
                let is_game = |item| item == ROOM || self.bounds.creations == 0;
                let restarted = |item| is_game(item).then_some(takeover);
                let claimed = tables.claim(UNIT, seen, node, now, restarted);
                world.owners.extend(claimed.map(|epoch| (epoch, server)));
                Answer::Claimed(claimed.map(shown))
            }
            Request::Release(epoch) => {
                let epoch = match any_epoch {
                    true => present(tables, UNIT, epoch),
                    false => epoch,
                };
                tables.release(UNIT, epoch);
                Answer::Done
            }
            Request::Create(epoch) => {
                let epoch = match any_epoch || self.has(Fault::CreationWithoutEpoch) {
                    true => present(tables, UNIT, epoch),
                    false => epoch,
                };
                Answer::Created(tables.create_in(UNIT, epoch, ROOM, takeover))
            }
            Request::Append(item, epoch, position, entry) => {
                let epoch = match any_epoch || self.has(Fault::AppendWithoutEpoch) {
                    true => present(tables, item, epoch),
                    false => epoch,
                };
                Answer::Written(tables.append(item, epoch, position, entry))
            }
            Request::Finish(item, epoch, rows) => {
                let checked = match any_epoch || self.has(Fault::FinishWithoutEpoch) {
                    true => present(tables, item, epoch),
                    false => epoch,
                };
                let counted = match self.has(Fault::FinishWithoutRows) {
                    true => tables.journal(item).len() as u64,
                    false => rows,
                };
                let written = tables.finish(item, checked, counted);
                if written == Written::Committed {
                    world.ended.entry(item).or_insert((epoch, rows));
                }
                Answer::Written(written)
            }
            Request::Leave => {
                tables.leave(node);
                Answer::Done
            }
        }
    }

    /// A server takes an answer in, or learns that none comes (`None`).
    fn take_in(&self, world: &mut World, server: usize, to: Request, answer: Option<Answer>) {
        let now = world.now;
        let Some(it) = &mut world.servers[server] else {
            return;
        };
        let input = match (to, answer) {
            (Request::Append(item, epoch, ..), answer) => {
                let running = it.running.get(&item);
                if running.is_none_or(|it| it.epoch != epoch) {
                    return;
                }
                match answer {
                    Some(Answer::Written(Written::Committed)) => {
                        return self.committed(world, server, item);
                    }
                    None if self.has(Fault::UnknownIsCommitted) => {
                        return self.committed(world, server, item);
                    }
                    Some(_) => Input::Fenced(UNIT, epoch),
                    // Doing so again changes nothing.
                    None => return self.send(world, server, to),
                }
            }
            (Request::Finish(item, epoch, _), answer) => {
                let running = it.running.get(&item);
                if running.is_none_or(|it| !it.ends || it.epoch != epoch) {
                    return;
                }
                match answer {
                    Some(Answer::Written(Written::Committed)) => {
                        // The answer to a beat says when all of the unit is over.
                        it.running.remove(&item);
                        return self.release_if_quiet(world, server);
                    }
                    Some(_) => Input::Fenced(UNIT, epoch),
                    // Doing so again changes nothing.
                    None => return self.send(world, server, to),
                }
            }
            (Request::Create(epoch), answer) => {
                if !std::mem::take(&mut it.creates) {
                    return;
                }
                if let Some(epoch) = it.serves_next.take_if(|_| answer.is_some()) {
                    return it.serve(&world.tables, epoch);
                }
                match answer {
                    // It was stopped meanwhile.
                    Some(_) if it.node.owned().all(|owned| owned != (UNIT, epoch)) => {
                        return self.release_if_quiet(world, server);
                    }
                    // It is taken if this is a repetition.
                    Some(Answer::Created(Created::Created | Created::Taken)) => {
                        it.running.insert(ROOM, Running::new(epoch, 1));
                        return self.release_if_quiet(world, server);
                    }
                    Some(_) => Input::Fenced(UNIT, epoch),
                    None => {
                        it.creates = true;
                        return self.send(world, server, to);
                    }
                }
            }
            (Request::Beat(sent_ms), answer) => Input::Beat {
                sent_ms: match self.has(Fault::LeaseFromReceiving) {
                    true => now,
                    false => sent_ms,
                },
                answer: match answer {
                    Some(Answer::Beat(Some(owned))) => BeatAnswer::Renewed(owned),
                    Some(_) => BeatAnswer::Unknown,
                    None => BeatAnswer::None,
                },
            },
            (Request::FindOrphans, Some(Answer::Orphans(orphans))) => Input::Orphans(orphans),
            (Request::Claim(seen), answer) => Input::Claimed(
                UNIT,
                seen,
                match answer {
                    Some(Answer::Claimed(Some(epoch))) => ClaimAnswer::Won(epoch),
                    Some(_) => ClaimAnswer::Lost,
                    None => ClaimAnswer::None,
                },
            ),
            (Request::Release(epoch), answer) => Input::Released(UNIT, epoch, answer.is_some()),
            _ => return,
        };
        self.put_in(world, server, input);
    }

    /// The open decision of an item is committed: it is published, or waits for a lease.
    fn committed(&self, world: &mut World, server: usize, item: u8) {
        let it = world.servers[server].as_mut().expect("it lives");
        let may_publish = it.node.may_publish(world.now);
        let running = it.running.get_mut(&item).expect("it runs");
        let entry = running.open.take().expect("an append is open");
        let (epoch, position) = (running.epoch, running.position);
        running.position += 1;
        if may_publish || self.has(Fault::PublishedWhileSuspended) {
            world.publish(item, position, epoch, entry);
        } else {
            running.unpublished = Some(entry);
        }
        self.release_if_quiet(world, server);
    }
}

impl Running {
    fn new(epoch: Epoch, position: u64) -> Self {
        Self {
            epoch,
            position,
            open: None,
            unpublished: None,
            ends: false,
        }
    }

    fn is_idle(&self) -> bool {
        self.open.is_none() && self.unpublished.is_none() && !self.ends
    }
}

impl Server {
    /// Reads the journals and runs the unit.
    fn serve(&mut self, tables: &Tables<u8, Entry>, epoch: Epoch) {
        self.running.clear();
        for item in tables.open_items(UNIT) {
            let rows = tables.journal(item).len() as u64;
            self.running.insert(item, Running::new(epoch, rows));
        }
    }
}

impl World {
    /// A server stops its unit at once, and does not wait for what it has sent.
    fn stop(&mut self, server: usize) {
        let it = self.servers[server].as_mut().expect("it lives");
        it.running.clear();
        (it.releases, it.serves_next) = (None, None);
        let is_write =
            |request: &Request| matches!(request, Request::Append(..) | Request::Finish(..));
        let given_up = |from: usize, request: &Request| from == server && is_write(request);
        (self.answers).retain(|(to, request, _)| !given_up(*to, request));
        let requests = std::mem::take(&mut self.requests).into_iter();
        self.requests = requests
            .map(|(from, request, awaited)| {
                let awaited = awaited && !given_up(from, &request);
                (from, request, awaited)
            })
            .collect();
    }

    fn publish(&mut self, item: u8, position: u64, epoch: Epoch, entry: Entry) {
        let rows = self.published.entry((item, position)).or_default();
        rows.insert((epoch, entry));
        let owner = self.tables.owner(item);
        self.published_late |= owner.is_some_and(|node| node.0 != entry.server as u64 + 1);
    }

    /// Whether the server runs the unit and accepts decisions.
    pub(crate) fn serves(&self, server: usize) -> bool {
        let it = self.servers[server].as_ref();
        it.is_some_and(|it| !it.running.is_empty() && it.node.serves(UNIT, self.now))
    }
}

impl Model for Cluster {
    type State = World;
    type Action = Transition;

    fn init_states(&self) -> Vec<World> {
        let times = LeaseTimes::new(1, 2, 3).expect("these are in order");
        let mut tables = Tables::new(times);
        let servers = (0..2).map(|_| {
            Some(Server {
                node: Node::new(tables.join(0), times),
                running: BTreeMap::new(),
                releases: None,
                creates: false,
                serves_next: None,
                left: false,
            })
        });
        let servers = servers.collect();
        let first = Entry {
            server: 0,
            decision: 0,
        };
        tables.create(UNIT, NodeId(1), first);
        vec![World {
            now: 0,
            tables,
            servers,
            requests: BTreeSet::new(),
            answers: BTreeSet::new(),
            published: BTreeMap::new(),
            owners: BTreeMap::from([(Epoch::FIRST, 0)]),
            published_late: false,
            ended: BTreeMap::new(),
            decisions: 0,
            lost: 0,
            crashes: 0,
            drains: 0,
            handovers: 0,
            ends: 0,
            creations: 0,
        }]
    }

    fn actions(&self, world: &World, actions: &mut Vec<Transition>) {
        let bounds = &self.bounds;
        if world.now < bounds.until {
            actions.push(Transition::Tick);
        }
        for (server, it) in world.servers.iter().enumerate() {
            let Some(it) = it.as_ref().filter(|it| !it.left) else {
                continue;
            };
            if (it.node.wakes_at_ms()).is_some_and(|at| at <= world.now) {
                actions.push(Transition::Wake(server));
            }
            if world.serves(server) {
                let idle = it.running.iter().filter(|(_, running)| running.is_idle());
                for (item, _) in idle {
                    if world.decisions < bounds.decisions {
                        actions.push(Transition::Decide(server, *item));
                    }
                    if world.ends < bounds.ends {
                        actions.push(Transition::End(server, *item));
                    }
                }
                let creates = it.creates || it.running.contains_key(&ROOM);
                if world.creations < bounds.creations && !creates {
                    actions.push(Transition::Create(server));
                }
            }
            if world.crashes < bounds.crashes {
                actions.push(Transition::Crash(server));
            }
            if world.drains < bounds.drains && it.node.phase() == Phase::Serving {
                actions.push(Transition::Drain(server));
            }
            if world.handovers < bounds.handovers && world.serves(server) {
                actions.push(Transition::HandOver(server));
            }
        }
        for &(server, request, awaited) in &world.requests {
            actions.push(Transition::Arrive(server, request, awaited));
            if awaited && world.lost < bounds.lost {
                actions.push(Transition::GivenUp(server, request));
            }
        }
        for (server, request, answer) in &world.answers {
            actions.push(Transition::Answered(*server, *request, answer.clone()));
            if world.lost < bounds.lost {
                actions.push(Transition::AnswerLost(*server, *request, answer.clone()));
            }
        }
    }

    fn next_state(&self, world: &World, transition: Transition) -> Option<World> {
        let mut next = world.clone();
        self.apply(&mut next, transition);
        Some(next)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        property::all(&self.bounds)
    }
}

impl Cluster {
    /// Changes the world.
    fn apply(&self, next: &mut World, transition: Transition) {
        match transition {
            Transition::Tick => next.now += 1,
            Transition::Wake(server) => self.put_in(next, server, Input::Time),
            Transition::Drain(server) => {
                next.drains += 1;
                self.put_in(next, server, Input::Drain);
            }
            Transition::HandOver(server) => {
                next.handovers += 1;
                self.put_in(next, server, Input::HandOver(UNIT));
            }
            Transition::Crash(server) => {
                next.crashes += 1;
                next.servers[server] = None;
                next.answers.retain(|(to, ..)| *to != server);
                let requests = std::mem::take(&mut next.requests).into_iter();
                next.requests = requests
                    .map(|(from, request, awaited)| (from, request, awaited && from != server))
                    .collect();
            }
            Transition::Decide(server, item) => {
                next.decisions += 1;
                let entry = Entry {
                    server,
                    decision: next.decisions,
                };
                let running = next.running(server, item);
                running.open = Some(entry);
                let (epoch, position) = (running.epoch, running.position);
                if self.has(Fault::PublishedEarly) {
                    next.publish(item, position, epoch, entry);
                }
                let append = Request::Append(item, epoch, position, entry);
                self.send(next, server, append);
            }
            Transition::End(server, item) => {
                next.ends += 1;
                let running = next.running(server, item);
                running.ends = true;
                let (epoch, rows) = (running.epoch, running.position);
                self.send(next, server, Request::Finish(item, epoch, rows));
            }
            Transition::Create(server) => {
                next.creations += 1;
                let epoch = next.running(server, UNIT).epoch;
                let it = next.servers[server].as_mut().expect("it lives");
                it.creates = true;
                self.send(next, server, Request::Create(epoch));
            }
            Transition::Arrive(server, request, awaited) => {
                next.requests.remove(&(server, request, awaited));
                let answer = self.carry_out(next, server, request);
                if awaited {
                    next.answers.insert((server, request, answer));
                }
            }
            Transition::GivenUp(server, request) => {
                next.lost += 1;
                next.requests.remove(&(server, request, true));
                next.requests.insert((server, request, false));
                self.take_in(next, server, request, None);
            }
            Transition::Answered(server, request, answer) => {
                next.answers.remove(&(server, request, answer.clone()));
                self.take_in(next, server, request, Some(answer));
            }
            Transition::AnswerLost(server, request, answer) => {
                next.lost += 1;
                next.answers.remove(&(server, request, answer));
                self.take_in(next, server, request, None);
            }
        }
    }
}

impl World {
    fn running(&mut self, server: usize, item: u8) -> &mut Running {
        let it = self.servers[server].as_mut().expect("it lives");
        it.running.get_mut(&item).expect("it runs")
    }
}
