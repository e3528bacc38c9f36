//! Hands units over to other nodes: a node that releases one names the next owner, which listens
//! and claims it at once. Nothing depends on it, because what was missed is found as an orphan.

use std::time::Duration;

use sqlx::postgres::{PgConnectOptions, PgConnection, PgListener, PgPoolOptions};
use tokio::sync::mpsc;
use tokio::time::{sleep, timeout};
use tokio_util::sync::CancellationToken;
use tokio_util::task::AbortOnDropHandle;
use tracing::debug;

use crate::cluster::Epoch;
use chefshat_base::tasks::{self, LongTask};
use chefshat_room::ids::{Id, UnitId};

/// The channel of the database.
const CHANNEL: &str = "chefshat";
/// How long connecting may take.
const CONNECT_LIMIT: Duration = Duration::from_secs(5);
/// Pause before connecting again.
const PAUSE: Duration = Duration::from_secs(1);
/// A connection through which nothing has come for this long may be dead, and is replaced.
const RENEW_AFTER: Duration = Duration::from_secs(60);
/// Units that may wait to be claimed.
const WAITING: usize = 1_024;

/// Gives up a unit that a node owns at an epoch, removes its ephemeral rooms, and tells one of the
/// other nodes: `next` if it takes rooms, otherwise one at random, by the space that each has. Leases
/// expire after this number of milliseconds.
pub(super) async fn release(
    connection: &mut PgConnection,
    (unit, epoch): (UnitId, i64),
    (node, next): (i64, Option<i64>),
    expire_after: i64,
) -> sqlx::Result<()> {
    sqlx::query(
        "WITH ended AS (
             DELETE FROM owned
             WHERE unit = $1 AND epoch = $2 AND node = $3 AND NOT durable AND NOT over
         ), released AS (
             UPDATE owned SET node = NULL
             WHERE unit = $1 AND node = $3 AND (over OR durable AND epoch = $2) RETURNING over
         ), next AS (
             SELECT node FROM nodes
             WHERE node <> $3 AND NOT drain AND reached AND capacity > 0 AND beat_ms + $4 > clock_ms()
             ORDER BY node = coalesce($6, 0) DESC, -ln(1 - random()) / greatest(capacity - coalesce(rooms, capacity), 1) LIMIT 1
         )
         SELECT pg_notify($5, concat_ws(' ', next.node, encode($1, 'hex'), $2)) FROM next
         WHERE EXISTS (SELECT FROM released WHERE NOT over)",
    )
    .bind(unit.bytes().as_slice())
    .bind(epoch)
    .bind(node)
    .bind(expire_after)
    .bind(CHANNEL)
    .bind(next)
    .execute(connection)
    .await
    .map(drop)
}

/// A node, and a unit at an epoch that it is to claim.
type Named = (i64, UnitId, Epoch);

/// The units that are handed over to any node.
pub(super) struct Handed {
    received: mpsc::Receiver<Named>,
    _listening: AbortOnDropHandle<()>,
}

impl Handed {
    /// Listens on connections of its own, until `closing` is cancelled.
    pub(super) fn listen(options: PgConnectOptions, closing: CancellationToken) -> Self {
        let (sender, received) = mpsc::channel(WAITING);
        let listening = closing.run_until_cancelled_owned(listen(options, sender));
        Self {
            received,
            _listening: AbortOnDropHandle::new(tokio::spawn(tasks::named(
                LongTask::PostgresHandover,
                async move {
                    listening.await;
                },
            ))),
        }
    }

    /// Waits for the next one; `None` if the store is closed.
    pub(super) async fn next(&mut self) -> Option<Named> {
        self.received.recv().await
    }
}

async fn listen(options: PgConnectOptions, sender: mpsc::Sender<Named>) {
    loop {
        if let Err(error) = receive(&options, &sender).await {
            debug!(%error, "units that are handed over are found as orphans only");
        }
        sleep(PAUSE).await;
    }
}

/// Receives over a new connection until it is lost or may be dead.
async fn receive(options: &PgConnectOptions, sender: &mpsc::Sender<Named>) -> sqlx::Result<()> {
    let pool = PgPoolOptions::new()
        .max_connections(1)
        .acquire_timeout(CONNECT_LIMIT)
        .connect_lazy_with(options.clone());
    let connecting = async {
        let mut listener = PgListener::connect_with(&pool).await?;
        listener.eager_reconnect(false);
        listener.listen(CHANNEL).await?;
        Ok::<_, sqlx::Error>(listener)
    };
    let Ok(listener) = timeout(CONNECT_LIMIT, connecting).await else {
        return Ok(());
    };
    let mut listener = listener?;
    while let Ok(received) = timeout(RENEW_AFTER, listener.try_recv()).await {
        let Some(notification) = received? else {
            return Ok(());
        };
        // If too many wait, this one is found as an orphan.
        if let Some(named) = named(notification.payload()) {
            let _ = sender.try_send(named);
        }
    }
    Ok(())
}

fn named(payload: &str) -> Option<Named> {
    let mut parts = payload.split(' ');
    let (node, unit, epoch) = (parts.next()?, parts.next()?, parts.next()?);
    let epoch = Epoch(epoch.parse().ok()?);
    Some((node.parse().ok()?, Id::parse(unit)?, epoch))
}
