//! Sends a tournament to one follower. `tournaments` computes the messages, for all followers
//! together.

use std::sync::Arc;

use chefshat_proto::v1::{FollowTournamentResponse, TournamentState};
use tokio::sync::{Semaphore, mpsc, watch};
use tokio::time::{Instant, sleep_until};
use tonic::{Code, Status};

use super::status::{self, status};
use chefshat_hosting::config::{FOLLOW_INTERVAL, FOLLOW_SEND_TIMEOUT};
use chefshat_hosting::tournaments::{ComputeError, TournamentHandle};

type Sender = mpsc::Sender<Result<FollowTournamentResponse, Status>>;

/// Sends the tournament whenever it changes, until it is over.
///
/// # Errors
/// The follower has gone, is too slow, or the message could not be computed.
pub(super) async fn follow(
    handle: &Arc<TournamentHandle>,
    permits: &Arc<Semaphore>,
    sender: &Sender,
) -> Result<(), Status> {
    let mut changes = handle.changes();
    loop {
        changes.mark_unchanged();
        let update = handle
            .follower_update(permits)
            .await
            .map_err(compute_failed)?;
        let message = update.message.clone();
        drop(update);
        let over = is_over(&message);
        let sent = Instant::now();
        send(sender, message).await?;
        if over {
            return Ok(());
        }
        sleep_until(sent + FOLLOW_INTERVAL).await;
        changed(&mut changes, sender).await?;
    }
}

/// Ends a stream, with the reason if there is one. Waits until the client receives it or has gone.
pub(super) async fn end<M>(sender: &mpsc::Sender<Result<M, Status>>, followed: Result<(), Status>) {
    if let Err(status) = followed {
        // It fails only if the client has gone.
        let _ = sender.send(Err(status)).await;
    }
}

/// Waits for a change, as long as there is a follower to send it to.
///
/// # Errors
/// Nothing will change any more, or the follower has gone: then the status is for nobody.
pub(super) async fn changed<C, M>(
    changes: &mut watch::Receiver<C>,
    sender: &mpsc::Sender<M>,
) -> Result<(), Status> {
    tokio::select! {
        changed = changes.changed() => changed.map_err(|_| status::shutting_down()),
        () = sender.closed() => Err(Status::cancelled("the follower has gone")),
    }
}

/// The status for a client when something about a tournament could not be computed.
pub(super) fn compute_failed(problem: ComputeError) -> Status {
    tracing::error!(%problem, "a message about tournaments could not be computed");
    status::internal()
}

fn is_over(message: &FollowTournamentResponse) -> bool {
    let state = message.tournament.as_ref().map(|it| it.state());
    matches!(
        state,
        Some(TournamentState::Finished | TournamentState::Closed)
    )
}

/// Sends an update to a follower.
///
/// # Errors
/// It is not received in time, or the follower has gone.
pub(super) async fn send<M>(
    sender: &mpsc::Sender<Result<M, Status>>,
    message: M,
) -> Result<(), Status> {
    let sent = sender.send_timeout(Ok(message), FOLLOW_SEND_TIMEOUT);
    sent.await.map_err(|_| {
        let seconds = FOLLOW_SEND_TIMEOUT.as_secs();
        status(
            Code::ResourceExhausted,
            "FOLLOWER_TOO_SLOW",
            format!("an update was not received within {seconds} s; follow again"),
            [],
        )
    })
}

#[cfg(test)]
mod tests {
    use tonic_types::StatusExt as _;

    use crate::grpc::follow::*;

    #[tokio::test(start_paused = true)]
    async fn a_follower_that_does_not_read_is_dropped() {
        let (sender, mut receiver) = mpsc::channel(1);
        // The first message goes into the channel, the second does not.
        send(&sender, 1).await.expect("there is space");
        let ended = send(&sender, 2).await;
        let ended = ended.expect_err("the follower is too slow");
        let info = ended.get_details_error_info().expect("error info");
        assert_eq!(info.reason, "FOLLOWER_TOO_SLOW");
        let first = receiver.recv().await.expect("a message");
        assert_eq!(first.expect("no error"), 1);
    }

    #[tokio::test]
    async fn a_follower_that_has_gone_is_forgotten_while_nothing_changes() {
        let handle = TournamentHandle::for_tests(4);
        let (sender, mut receiver) = mpsc::channel(1);
        let following = tokio::spawn(async move {
            let permits = Arc::new(Semaphore::new(1));
            follow(&handle, &permits, &sender).await
        });
        let first = receiver.recv().await.expect("a message");
        let tournament = first.expect("no error").tournament.expect("a tournament");
        assert_eq!(tournament.participants.len(), 4);
        drop(receiver);
        following.await.unwrap().expect_err("nobody follows");
    }
}
