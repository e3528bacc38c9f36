//! The task of one unit: receives messages, lets the unit decide what follows, commits it, and only
//! then publishes it and acts on it.

use std::panic::AssertUnwindSafe;
use std::sync::Arc;

use futures::FutureExt as _;
use tokio::sync::mpsc;
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

use super::unit::Journaled;
use crate::cluster::UnitEvent;
use chefshat_store::StoreError;

/// Messages that are processed before their consequences are computed.
const MESSAGES_AT_A_TIME: usize = 64;

/// Stops the units of a server.
#[derive(Debug, Clone, Default)]
pub(super) struct Stop {
    /// Cancelled when no more games are begun or counted. Participants are still seated in running
    /// games.
    pub(super) no_more_games: CancellationToken,
    /// Cancelled when the tasks end.
    pub(super) end: CancellationToken,
}

/// Runs a unit until it is over or deleted, the server ends, or its store fails.
pub(super) async fn run<U: Journaled>(
    mut unit: U,
    mut inbox: mpsc::Receiver<U::Message>,
    stop: Stop,
) {
    // A panic must leave neither streams nor a node that waits for a unit that is gone. Nothing of its
    // state is used again.
    let running = AssertUnwindSafe(run_on(&mut unit, &mut inbox, stop));
    match running.catch_unwind().await {
        Ok(Ok(())) => {}
        Ok(Err(error)) => fail(&mut unit, &error),
        Err(_) => {
            error!(id = %unit.unit().id(), "the {} panicked and stops", U::KIND);
            report_stop(&unit);
            unit.end_streams();
        }
    }
    // Nothing can be sent any more, and what was sent before is given up.
    inbox.close();
    while let Ok(message) = inbox.try_recv() {
        unit.abandon(message);
    }
}

async fn run_on<U: Journaled>(
    unit: &mut U,
    inbox: &mut mpsc::Receiver<U::Message>,
    stop: Stop,
) -> Result<(), StoreError> {
    // It keeps one notification until it is waited for: no end of a game is missed.
    let games = Arc::clone(&unit.unit().games);
    let mut messages = Vec::new();
    loop {
        // What is deleted need not be committed before: on a full disk, the deletion that frees
        // space would wait for space.
        if unit.conclude(inbox).await? {
            return Ok(());
        }
        settle(unit, stop.no_more_games.is_cancelled()).await?;
        if unit.conclude(inbox).await? {
            return Ok(());
        }
        // Nothing that is due is done any more once the server stops.
        let is_stopping = stop.no_more_games.is_cancelled();
        let wake = unit.wake_at().filter(|_| !is_stopping);
        let alarm = sleep_until(wake.unwrap_or_else(Instant::now));
        tokio::select! {
            () = stop.end.cancelled() => {
                leave_streams(unit);
                return Ok(());
            }
            received = inbox.recv_many(&mut messages, MESSAGES_AT_A_TIME) => {
                if received == 0 {
                    return Ok(());
                }
                let mut received = std::mem::take(&mut messages).into_iter();
                while let Some(message) = received.next() {
                    if let Err(error) = unit.receive(message).await {
                        received.for_each(|message| unit.abandon(message));
                        return Err(error);
                    }
                }
            }
            () = games.notified() => {}
            () = alarm, if wake.is_some() => {}
        }
    }
}

/// Computes what follows, commits it and acts on it, until nothing follows. With `no_more_games` only
/// pending entries are committed.
async fn settle<U: Journaled>(unit: &mut U, no_more_games: bool) -> Result<(), StoreError> {
    loop {
        if !no_more_games {
            unit.follow().await?;
        }
        let entries = std::mem::take(&mut unit.unit_mut().pending);
        let has_entries = !entries.is_empty();
        if has_entries {
            unit.unit().append(&entries).await?;
            let core = unit.unit_mut();
            core.rows += 1;
            core.handle.publish(&entries);
            unit.announce(&entries);
        }
        unit.unit_mut().send_replies();
        if !no_more_games {
            unit.act().await?;
        }
        if !unit.unit().is_pending() {
            unit.delete().await?;
        }
        let core = unit.unit_mut();
        if std::mem::take(&mut core.has_changed) || has_entries {
            core.handle.notify();
        }
        if !has_entries && !core.is_pending() {
            return Ok(());
        }
    }
}

/// Handles a failure of the store: nothing uncommitted is published. The unit resumes from its journal
/// when the server is restarted, or at the node that owns it.
fn fail<U: Journaled>(unit: &mut U, error: &StoreError) {
    let (core, name) = (unit.unit(), U::KIND);
    let id = core.id();
    match (error, core.rooms.lease()) {
        (StoreError::Fenced(_) | StoreError::Lost(_), _) => {
            info!(%id, %error, "the {name} stops here")
        }
        (_, Some(_)) => warn!(%id, %error, "the {name} stops until it is resumed"),
        (_, None) => error!(%id, %error, "the store failed; the {name} stops"),
    }
    report_stop(unit);
    leave_streams(unit);
}

/// Ends the streams of a unit that stops here. Without a lease the whole server ends.
fn leave_streams<U: Journaled>(unit: &mut U) {
    if unit.unit().rooms.lease().is_some() {
        unit.end_streams();
    }
}

/// Tells the node that a unit has stopped by itself.
fn report_stop<U: Journaled>(unit: &U) {
    let core = unit.unit();
    if let Some(lease) = core.rooms.lease()
        && !core.handle.end.is_cancelled()
    {
        lease.report(core.id().unit(), UnitEvent::Stopped);
    }
}
