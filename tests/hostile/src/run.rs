//! One attack: a new server, the honest room in quiet, the attack beside it, and the time after.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use chefshat_tests::Launch;
use tokio::runtime::{Builder, Runtime};
use tokio::time::Instant;

use crate::attacks::{Act, Attack, Target};
use crate::error::HostileError;
use crate::gauge::{self, folder_bytes};
use crate::honest::{HonestRoom, SHORT};
use crate::options::Options;
use crate::probe;
use crate::report::Row;
use crate::tally::Tally;

/// How long a preparation may take.
const PREPARE_LIMIT: Duration = Duration::from_secs(120);
/// How long the last honest game may take to end once the attack is over.
const LAST_GAME_LIMIT: Duration = Duration::from_secs(60);
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
    server: &Path,
    attack: &'static Attack,
    options: &Options,
) -> Result<Row, HostileError> {
    let folder = tempfile::tempdir().map_err(HostileError::io("making a temporary folder"))?;
    let mut launch = Launch::new(folder.path())
        .binary(server)
        .flags(attack.flags);
    if let Some(descriptors) = attack.descriptors {
        let limited = format!("ulimit -n {descriptors}; exec \"$@\"");
        launch = launch.through(["sh", "-c", &limited, "sh"]);
    }
    let process = launch.start().await;
    let process = process.map_err(|ended| HostileError::Start(ended.said))?;
    let pid = process.id();
    let memory = || gauge::memory(pid).map_err(HostileError::io("reading the server's memory"));
    let url = launch.url();
    let address: SocketAddr = url["http://".len()..]
        .parse()
        .expect("the server printed it");
    let tally = Arc::new(Tally::default());
    let act = |act: Act, tally: &Arc<Tally>, time: Duration| {
        let target = Target {
            address,
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
    let honest = HonestRoom::start(url.clone(), SHORT);
    tokio::time::sleep(options.quiet).await;
    let quiet = honest.take();
    if quiet.latencies.is_empty() {
        return Err(HostileError::Quiet(honest.last_problem()));
    }
    let (before, disk_before) = (memory()?, folder_bytes(folder.path()));

    let until = Instant::now() + options.seconds;
    let probing = tokio::spawn(probe::run(attack.probe, url, until));
    let acting = act(attack.act, &tally, options.seconds);
    // It ends soon after its time; one that panicked counts what it did before.
    let _ = acting.await;
    let attacked = honest.take();
    let served = probing.await.unwrap_or_default();
    tokio::time::sleep(options.rest).await;
    let after = memory()?;
    let disk_after = folder_bytes(folder.path());
    let last = honest.finish(LAST_GAME_LIMIT).await;
    let ended = process.kill().await;
    Ok(Row::new(
        attack,
        (&quiet, &attacked, last.as_ref()),
        served,
        tally.counts(),
        [before.resident, after.peak, after.resident],
        disk_after.saturating_sub(disk_before),
        ended.said.lines().count(),
    ))
}
