//! Sends a tournament to one follower. `tournaments` computes the messages, for all followers
//! together.

use std::sync::Arc;

use chefshat_proto::v1::{FollowTournamentResponse, TournamentState};
use tokio::sync::{Semaphore, mpsc, watch};
use tokio::time::{Instant, sleep_until};
use tokio_util::sync::CancellationToken;
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
        changed(&mut changes, handle.stopped(), sender).await?;
    }
}

/// Runs what sends a stream, until it ends or the server closes its streams, and tells the client why
/// it ends. What `sending` holds, such as a place among the followers, is given back before: the client
/// may not read.
pub(super) async fn run<M>(
    closing: CancellationToken,
    sender: mpsc::Sender<Result<M, Status>>,
    sending: impl Future<Output = Result<(), Status>>,
) {
    let sent = closing.run_until_cancelled(sending).await;
    end(
        &sender,
        sent.unwrap_or_else(|| Err(status::shutting_down())),
    )
    .await;
}

/// Ends a stream, with the reason if there is one. Waits until the client receives it or has gone.
pub(super) async fn end<M>(sender: &mpsc::Sender<Result<M, Status>>, sent: Result<(), Status>) {
    if let Err(status) = sent {
        // It fails only if the client has gone.
        let _ = sender.send(Err(status)).await;
    }
}

/// Waits for a change of what a task does, as long as there is a follower to send it to.
///
/// # Errors
/// The task has stopped: the follower can follow again, where the unit runs then. Or the follower has
/// gone: then the status is for nobody.
pub(super) async fn changed<C, M>(
    changes: &mut watch::Receiver<C>,
    stopped: impl Future<Output = ()>,
    sender: &mpsc::Sender<M>,
) -> Result<(), Status> {
    tokio::select! {
        biased;
        changed = changes.changed() => changed.map_err(|_| status::shutting_down()),
        () = stopped => Err(status::shutting_down()),
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
    use std::future::pending;
    use std::pin::pin;

    use futures::FutureExt as _;
    use tokio::sync::oneshot::error::TryRecvError;
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

    #[tokio::test(start_paused = true)]
    async fn a_client_that_does_not_read_holds_nothing_and_learns_why_its_stream_ends() {
        let (closing, (sender, mut receiver)) = (CancellationToken::new(), mpsc::channel(1));
        let (place, mut free) = tokio::sync::oneshot::channel::<()>();
        let sending = {
            let sender = sender.clone();
            async move {
                let _place = place;
                send(&sender, 1).await?;
                pending().await
            }
        };
        let running = tokio::spawn(run(closing.clone(), sender, sending));
        tokio::task::yield_now().await;
        assert!(
            free.try_recv()
                .is_err_and(|error| error == TryRecvError::Empty)
        );
        closing.cancel();
        free.await.expect_err("it is given back");
        assert_eq!(
            receiver.recv().await.expect("a message").expect("no error"),
            1
        );
        let ended = receiver.recv().await.expect("the reason");
        assert_eq!(
            ended.expect_err("it is incomplete").code(),
            Code::Unavailable
        );
        running.await.expect("no panic");
    }

    #[tokio::test(start_paused = true)]
    async fn a_follower_of_a_tournament_without_a_task_follows_again() {
        let handle = TournamentHandle::for_tests(4);
        let (sender, mut receiver) = mpsc::channel(1);
        let permits = Arc::new(Semaphore::new(1));
        let followed = follow(&handle, &permits, &sender).await;
        assert_eq!(followed.expect_err("it stops").code(), Code::Unavailable);
        let first = receiver.recv().await.expect("a message");
        let tournament = first.expect("no error").tournament.expect("a tournament");
        assert_eq!(tournament.participants.len(), 4);
    }

    #[tokio::test]
    async fn a_follower_waits_for_a_change_the_end_of_the_task_or_its_own_end() {
        let (count, mut changes) = watch::channel(0);
        let (sender, receiver) = mpsc::channel::<()>(1);
        count.send_replace(1);
        let last = changed(&mut changes, async {}, &sender).await;
        last.expect("what changed last is sent before");
        let stopped = changed(&mut changes, async {}, &sender).await;
        assert_eq!(stopped.expect_err("the end").code(), Code::Unavailable);
        let mut waiting = pin!(changed(&mut changes, pending(), &sender));
        assert!(waiting.as_mut().now_or_never().is_none());
        drop(receiver);
        assert_eq!(
            waiting.await.expect_err("it has gone").code(),
            Code::Cancelled
        );
    }
}
