//! One attack: a new server, the honest room in quiet, the attack beside it, and the time after. A
//! second honest room, the control, plays all the time on a server that nobody attacks: it shows how
//! much slower the machine alone becomes.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tokio::runtime::{Builder, Runtime};
use tokio::time::Instant;

use crate::attacks::{Act, Attack};
use crate::error::HostileError;
use crate::gauge::{self, Memory, Watched, folder_bytes};
use crate::honest::{Access, HonestRoom, SHORT, shifts_within};
use crate::options::Options;
use crate::probe::{self, Called};
use crate::report::{Burden, MEMORY_GROWTH, Phases, Row};
use crate::server::AttackedServer;
use crate::tally::Tally;
use crate::target::Target;

/// How long a preparation may take.
const PREPARE_LIMIT: Duration = Duration::from_secs(120);
/// How long the last honest game may take to end once the attack is over.
const LAST_GAME_LIMIT: Duration = Duration::from_secs(60);
/// How often the memory is looked at until it has been given back.
const LOOK_AGAIN: Duration = Duration::from_millis(250);
/// Threads of the attacker.
const ATTACKER_THREADS: usize = 2;

/// The threads of both sides.
pub(crate) struct Runtimes {
    honest: Runtime,
    attacker: Runtime,
}

impl Runtimes {
    /// Starts them.
    pub(crate) fn new() -> Result<Self, HostileError> {
        let honest = Builder::new_multi_thread().enable_all().build();
        let attacker = Builder::new_multi_thread()
            .worker_threads(ATTACKER_THREADS)
            .on_thread_start(gauge::give_way)
            .enable_all()
            .build();
        Ok(Self {
            honest: honest.map_err(HostileError::io("starting threads"))?,
            attacker: attacker.map_err(HostileError::io("starting threads"))?,
        })
    }

    /// Runs something on the honest threads.
    pub(crate) fn honest<T>(&self, work: impl Future<Output = T>) -> T {
        self.honest.block_on(work)
    }
}

/// Runs one attack.
pub(crate) fn run(
    runtimes: &Runtimes,
    server: &Path,
    attack: &'static Attack,
    options: &Options,
) -> Result<Row, HostileError> {
    runtimes.honest(attacked(&runtimes.attacker, server, attack, options))
}

async fn attacked(
    attacker: &Runtime,
    binary: &Path,
    attack: &'static Attack,
    options: &Options,
) -> Result<Row, HostileError> {
    let server = AttackedServer::start(binary, &attack.setup).await?;
    let spared = AttackedServer::start(binary, &attack.setup).await?;
    let watched = Watched::new(server.pid());
    let watched = watched.map_err(HostileError::io("reading the server's memory"))?;
    let tally = Arc::new(Tally::default());
    let act = |act: Act, tally: &Arc<Tally>, time: Duration| {
        let target = Target {
            address: server.address(),
            access: Access {
                token: None,
                ..server.access.clone()
            },
            tokens: server.tokens.clone().into(),
            mcp: server.mcp(),
            peers: server.peers,
            other_node: server.other_node(),
            until: Instant::now() + time,
            divide: options.divide,
            tally: Arc::clone(tally),
        };
        attacker.spawn(act(target))
    };

    if let Some(prepare) = attack.prepare {
        let preparing = act(prepare, &Arc::default(), PREPARE_LIMIT);
        let prepared = tokio::time::timeout(PREPARE_LIMIT, preparing).await;
        match prepared {
            Ok(Ok(Ok(()))) => {}
            other => return Err(HostileError::Prepare(format!("{other:?}"))),
        }
    }
    let shifts = if attack.setup.one_game {
        shifts_within(options.quiet + options.seconds)
    } else {
        SHORT
    };
    let honest = HonestRoom::start(server.access.clone(), shifts);
    let control = HonestRoom::start(spared.access.clone(), shifts);
    let quiet_begun = Instant::now();
    tokio::time::sleep(options.quiet).await;
    for room in [&honest, &control] {
        room.until_played(PREPARE_LIMIT).await;
    }
    let (quiet, quiet_time) = (honest.take(), quiet_begun.elapsed());
    let unplayed = [(&quiet, &honest), (&control.take(), &control)];
    let unplayed = (unplayed.into_iter()).find(|(noticed, _)| noticed.latencies.is_empty());
    if let Some((_, room)) = unplayed {
        return Err(HostileError::Quiet(room.last_problem()));
    }
    let (before, disk_before) = (watched.memory(), folder_bytes(&server.data()));

    let begun = Instant::now();
    let until = begun + options.seconds;
    let called = Called {
        access: server.access.clone(),
        mcp: server.mcp(),
        announced: (server.webhooks.as_ref()).map(|receiver| receiver.announced.clone()),
    };
    let probing = tokio::spawn(probe::run(attack.probe, called, until));
    let acting = act(attack.act, &tally, options.seconds);
    // It ends soon after its time; one that panicked counts what it did before.
    let acted = acting.await;
    if let Ok(Err(status)) = &acted {
        tally.outcome::<()>(&Err(status.clone()));
    }
    tokio::time::sleep_until(until).await;
    let (attacked, control_attacked) = (honest.take(), control.take());
    let attack_time = begun.elapsed();
    let served = probing.await.unwrap_or_default();
    let after = settled(&watched, before, options.rest).await;
    let is_alive = watched.is_alive();
    let disk = folder_bytes(&server.data()).saturating_sub(disk_before);
    let limit = match is_alive {
        true => LAST_GAME_LIMIT,
        false => Duration::ZERO,
    };
    let (last, _) = tokio::join!(honest.finish(limit), control.finish(LAST_GAME_LIMIT));
    let (log_lines, starts_again) = server.restart().await;
    Ok(Row::new(
        attack,
        Phases {
            quiet,
            quiet_time,
            attacked,
            control: control_attacked,
            attack_time,
            last,
        },
        served,
        tally.counts(),
        Burden {
            memory: [before.resident, after.peak, after.resident],
            disk,
            log_lines,
            is_alive,
            starts_again,
        },
    ))
}

/// Waits until memory has been given back, for `rest` at most. Returns the memory then.
async fn settled(watched: &Watched, before: Memory, rest: Duration) -> Memory {
    let until = Instant::now() + rest;
    loop {
        let memory = watched.memory();
        let is_back = memory.resident <= before.resident + MEMORY_GROWTH;
        if is_back || Instant::now() >= until || !watched.is_alive() {
            return memory;
        }
        tokio::time::sleep(LOOK_AGAIN).await;
    }
}
