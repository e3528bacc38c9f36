//! One run: the machines, the faults, and what must hold in the end.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use chefshat_client::{
    ActionId, Agent, Backoff, Client, Ending, Entropy, Outcome, PlayOptions, Spectator,
    legal_count, nth_legal, v1,
};
use chefshat_record::replay::replay;
use chefshat_server::config::ServerConfig;
use chefshat_server::serve::Server;
use chefshat_tests::Ledger;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use turmoil::{Builder, Sim};

use crate::disk::{Disk, DiskStore};
use crate::net::{self, SERVER};

/// Longest simulated time of a run.
const LONGEST: Duration = Duration::from_secs(3_600);
/// Simulated time of a step.
const TICK: Duration = Duration::from_millis(2);
/// Time during which faults begin.
const FAULTY: Duration = Duration::from_secs(5);

/// Delays that are the same in every run.
const BACKOFF: Backoff = Backoff {
    first: Duration::from_millis(100),
    max: Duration::from_secs(1),
    give_up_after: Duration::from_secs(1_800),
    jitter: false,
};

/// What a run did.
#[derive(Debug, Default)]
pub(crate) struct Run {
    pub(crate) acknowledged: usize,
    pub(crate) crashes: u32,
    pub(crate) partitions: u32,
    pub(crate) simulated: Duration,
    /// Everything that clients received, with simulated times, and the record.
    pub(crate) trace: String,
}

/// The trace of a run.
type Trace = Rc<RefCell<String>>;

fn note(trace: &Trace, who: &str, what: &dyn std::fmt::Debug) {
    let at = turmoil::elapsed().as_millis();
    writeln!(trace.borrow_mut(), "{at} {who} {what:?}").expect("a string grows");
}

/// An agent that chooses by its seed and the number of the decision.
struct Chooser {
    seed: u64,
}

impl Agent for Chooser {
    fn decide(&mut self, request: &v1::DecisionRequest) -> ActionId {
        let mut chance = ChaCha8Rng::seed_from_u64(self.seed ^ request.decision_id << 8);
        let legal = legal_count(request);
        nth_legal(request, chance.random_range(0..legal)).expect("a legal action")
    }
}

/// A fault and when it begins.
struct Fault {
    at: Duration,
    ends: Duration,
    kind: FaultKind,
}

#[derive(Clone, Copy)]
enum FaultKind {
    /// The server crashes and is started again.
    Crash,
    /// Nothing passes between a client and the server, and what was sent is lost.
    Partition(usize),
    /// Nothing passes between a client and the server, and arrives later.
    Hold(usize),
    /// Messages between a client and the server take this much longer.
    Slow(usize, Duration),
}

/// The names of the clients' machines.
const CLIENTS: [&str; 5] = ["agent0", "agent1", "agent2", "agent3", "spectator"];

/// The faults of a seed, by the time they begin.
fn faults(chance: &mut ChaCha8Rng) -> Vec<Fault> {
    let mut faults: Vec<Fault> = (0..chance.random_range(0..6))
        .map(|_| {
            let at = FAULTY.mul_f64(chance.random_range(0.0..1.0));
            let client = chance.random_range(0..CLIENTS.len());
            let (kind, longest) = match chance.random_range(0..4) {
                0 => (FaultKind::Crash, 3.0),
                1 => (FaultKind::Partition(client), 15.0),
                2 => (FaultKind::Hold(client), 4.0),
                _ => (FaultKind::Slow(client, latency(chance) * 10), 5.0),
            };
            let lasts = Duration::from_secs_f64(chance.random_range(0.05..longest));
            Fault {
                at,
                ends: at + lasts,
                kind,
            }
        })
        .collect();
    faults.sort_by_key(|fault| fault.at);
    faults
}

/// How long a message takes. Each connection has a latency of its own, which changes by faults
/// alone: a latency drawn for each message would depend on the order in which a crash drops the
/// tasks of the server, which the seed does not decide.
fn latency(chance: &mut ChaCha8Rng) -> Duration {
    Duration::from_millis(chance.random_range(1..60))
}

impl Fault {
    fn begin(&self, sim: &mut Sim<'_>, latencies: &[Duration]) {
        match self.kind {
            FaultKind::Crash => sim.crash(SERVER),
            FaultKind::Partition(client) => sim.partition(SERVER, CLIENTS[client]),
            FaultKind::Hold(client) => sim.hold(SERVER, CLIENTS[client]),
            FaultKind::Slow(client, more) => {
                sim.set_link_latency(SERVER, CLIENTS[client], latencies[client] + more);
            }
        }
    }

    fn end(&self, sim: &mut Sim<'_>, latencies: &[Duration]) {
        match self.kind {
            FaultKind::Crash => sim.bounce(SERVER),
            FaultKind::Partition(client) => sim.repair(SERVER, CLIENTS[client]),
            FaultKind::Hold(client) => sim.release(SERVER, CLIENTS[client]),
            FaultKind::Slow(client, _) => {
                sim.set_link_latency(SERVER, CLIENTS[client], latencies[client]);
            }
        }
    }
}

/// What the maker of the room passes to the others: room and tickets.
type Made = Rc<RefCell<Option<(String, Vec<String>)>>>;

async fn made(room: &Made) -> (String, Vec<String>) {
    loop {
        if let Some(made) = room.borrow().clone() {
            return made;
        }
        tokio::time::sleep(TICK).await;
    }
}

async fn make_room(client: &Client) -> Result<(String, Vec<String>), chefshat_client::Error> {
    let rules = v1::RuleSet {
        faces: Some(5),
        stop: Some(v1::rule_set::Stop::TargetShifts(2)),
        ..v1::RuleSet::default()
    };
    let policy = v1::RoomPolicy {
        decision_time_ms: Some(3_000),
        waiting_time_ms: Some(600_000),
        spectators: Some(true),
        ..v1::RoomPolicy::default()
    };
    let created = client
        .create_room(v1::CreateRoomRequest {
            rules: Some(rules),
            policy: Some(policy),
            game_seed: vec![7; 32],
            ..v1::CreateRoomRequest::default()
        })
        .await?;
    let mut tickets = Vec::new();
    for seat in 0..4 {
        let request = v1::JoinRoomRequest {
            join_code: created.join_code.clone(),
            name: format!("agent {seat}"),
            seat: Some(seat),
            ..v1::JoinRoomRequest::default()
        };
        tickets.push(client.join(request).await?.ticket);
    }
    Ok((created.room.unwrap_or_default().room_id, tickets))
}

/// Follows the game as a spectator: every event once, in order, to the end.
async fn watch(mut spectator: Spectator, trace: Trace) -> turmoil::Result {
    let mut sequence = 0;
    while let Some(event) = spectator.next().await? {
        sequence += 1;
        assert_eq!(
            event.sequence, sequence,
            "an event is missing or comes twice"
        );
        note(&trace, "spectator", &event.kind);
    }
    assert!(sequence > 0, "the spectator saw nothing");
    Ok(())
}

/// Simulates the run of a seed.
pub(crate) fn simulate(seed: u64) -> Run {
    let mut chance = ChaCha8Rng::seed_from_u64(seed);
    let mut sim = Builder::new()
        .rng_seed(seed)
        .simulation_duration(LONGEST)
        .tick_duration(TICK)
        .build();
    let disk = Disk::new(seed);
    let on_disk = Arc::clone(&disk);
    sim.host(SERVER, move || {
        let store = Arc::new(DiskStore::open(&on_disk));
        async move {
            let server = Server::restored(ServerConfig::default(), store).await?;
            let incoming = net::incoming().await?;
            server
                .serve_incoming(incoming, std::future::pending())
                .await?;
            Ok(())
        }
    });
    let trace = Trace::default();
    let ledger = Arc::new(Ledger::default());
    let room = Made::default();
    let outcomes: Rc<RefCell<Vec<Outcome>>> = Rc::default();
    for (seat, name) in CLIENTS[..4].iter().enumerate() {
        let (room, trace) = (Rc::clone(&room), Rc::clone(&trace));
        let (ledger, outcomes) = (Arc::clone(&ledger), Rc::clone(&outcomes));
        sim.client(*name, async move {
            let client = net::client();
            if seat == 0 {
                let new = make_room(&client).await?;
                *room.borrow_mut() = Some(new);
            }
            let (_, tickets) = made(&room).await;
            let options = PlayOptions {
                entropy: Entropy::None,
                backoff: BACKOFF,
                ..PlayOptions::default()
            };
            let agent = ledger.wrap(Chooser {
                seed: seed << 2 | seat as u64,
            });
            let outcome = (client.play_with(tickets[seat].clone(), agent, &options)).await?;
            note(&trace, name, &outcome.standings());
            outcomes.borrow_mut().push(outcome);
            Ok(())
        });
    }
    let (shown, watched) = (Rc::clone(&room), Rc::clone(&trace));
    sim.client(CLIENTS[4], async move {
        let (room_id, _) = made(&shown).await;
        let spectator = net::client().spectate(room_id, 1).with_backoff(BACKOFF);
        watch(spectator, watched).await
    });

    let latencies = CLIENTS.map(|_| latency(&mut chance));
    for (client, latency) in CLIENTS.iter().zip(latencies) {
        sim.set_link_latency(SERVER, *client, latency);
    }
    // The room is made on a good network.
    while room.borrow().is_none() {
        assert!(!sim.step().expect("the room is made"), "nobody plays");
    }
    let begin = sim.elapsed();
    let faults = faults(&mut chance);
    let mut due: Vec<(Duration, bool, usize)> = (faults.iter().enumerate())
        .flat_map(|(index, fault)| [(fault.at, true, index), (fault.ends, false, index)])
        .collect();
    due.sort();
    let mut run = Run::default();
    let mut down = 0;
    let mut due = due.into_iter().peekable();
    loop {
        while let Some((_, begins, index)) = due.next_if(|(at, ..)| *at <= sim.elapsed() - begin) {
            let fault = &faults[index];
            // Crashes that overlap are one.
            let is_crash = matches!(fault.kind, FaultKind::Crash);
            down += match (is_crash, begins) {
                (false, _) => 0,
                (true, true) => 1,
                (true, false) => -1,
            };
            match begins {
                true if is_crash && down > 1 => {}
                false if is_crash && down > 0 => {}
                true => {
                    fault.begin(&mut sim, &latencies);
                    run.crashes += u32::from(is_crash);
                    run.partitions += u32::from(matches!(fault.kind, FaultKind::Partition(_)));
                }
                false => fault.end(&mut sim, &latencies),
            }
        }
        if sim.step().unwrap_or_else(|error| panic!("{error}")) {
            break;
        }
    }
    run.simulated = sim.elapsed();
    drop(sim);
    check_end(&disk, &ledger, &outcomes.borrow(), &trace, &mut run);
    run.trace = trace.borrow().clone();
    run
}

/// What must hold in the end: one finished game, whose record verifies, contains what was
/// acknowledged, and agrees with what every client received.
fn check_end(disk: &Disk, ledger: &Ledger, outcomes: &[Outcome], trace: &Trace, run: &mut Run) {
    ledger.assert_nothing_unexpected();
    let finished = disk.finished();
    let [(header, journal)] = finished.as_slice() else {
        panic!("{} finished games", finished.len());
    };
    let stored = chefshat_server::store::StoredGame::Hosted(
        Arc::clone(header),
        journal.clone().into(),
        None,
    );
    let lines = stored.lines();
    replay(&lines).expect("the record verifies");
    run.acknowledged = ledger.assert_committed(&header.game_id.to_string(), &lines);
    assert_eq!(outcomes.len(), 4);
    for outcome in outcomes {
        assert!(matches!(outcome.ending, Ending::Finished(_)), "{outcome:?}");
        assert_eq!(outcome.standings(), outcomes[0].standings());
    }
    for line in lines.iter() {
        if let Some(v1::record_line::Line::Decision(decision)) = &line.line {
            writeln!(trace.borrow_mut(), "{decision:?}").expect("a string grows");
        }
    }
    let mut text = trace.borrow_mut();
    *text = text
        .replace(&header.game_id.to_string(), "GAME")
        .replace(&header.room_id.to_string(), "ROOM");
}
