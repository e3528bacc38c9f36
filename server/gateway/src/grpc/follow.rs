//! Streams that one task sends to one client: how they end, and what is sent to the followers of a
//! tournament. `tournaments` computes those messages, for all followers together.

use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1::{FollowTournamentResponse, TournamentState};
use futures::Stream;
use tokio::sync::{Semaphore, mpsc, watch};
use tokio::time::{Instant, sleep_until};
use tokio_stream::wrappers::ReceiverStream;
use tokio_util::sync::CancellationToken;
use tonic::{Code, Response, Status};

use super::status::{self, Refusal, reader_too_slow, status};
use chefshat_admission::limits::{FairSemaphore, Key, Permit, Refused};
use chefshat_hosting::config::{FOLLOW_INTERVAL, FOLLOW_SEND_TIMEOUT};
use chefshat_hosting::tournaments::{ComputeError, TournamentHandle};

/// The messages of a stream.
pub(super) type Responses<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;
/// What sends them.
pub(super) type Sender<T> = mpsc::Sender<Result<T, Status>>;

/// Sends the tournament whenever it changes, until it is over.
///
/// # Errors
/// The follower has gone, is too slow, or the message could not be computed.
pub(super) async fn follow(
    handle: &Arc<TournamentHandle>,
    permits: &Arc<Semaphore>,
    sender: &Sender<FollowTournamentResponse>,
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
        changed(&mut changes, handle.stopped()).await?;
    }
}

/// The stream that `sending` sends, and what runs that.
pub(super) fn stream<M, F>(
    closing: CancellationToken,
    sending: impl FnOnce(Sender<M>) -> F,
) -> (Response<Responses<M>>, impl Future<Output = ()>)
where
    M: Send + 'static,
    F: Future<Output = Result<(), Status>>,
{
    let (sender, receiver) = mpsc::channel(1);
    let sending = sending(sender.clone());
    let responses: Responses<M> = Box::pin(ReceiverStream::new(receiver));
    (Response::new(responses), run(closing, sender, sending))
}

/// Runs what sends a stream, until it ends, its client has gone, or the server closes its streams, and
/// tells the client why it ends. What `sending` holds, such as a place among the followers, is given
/// back before: the client may not read.
async fn run<M>(
    closing: CancellationToken,
    sender: Sender<M>,
    sending: impl Future<Output = Result<(), Status>>,
) {
    let sent = tokio::select! {
        sent = sending => sent,
        () = closing.cancelled() => Err(status::shutting_down()),
        () = sender.closed() => return,
    };
    if let Err(status) = sent {
        // It fails only if the client has gone.
        let _ = sender.send(Err(status)).await;
    }
}

/// Takes a place among the followers for a stream of `what`.
///
/// # Errors
/// The caller has too many.
pub(super) fn place(
    followers: &Arc<FairSemaphore>,
    key: Key,
    what: &'static str,
) -> Result<Permit, Status> {
    followers.try_take(key).ok_or_else(|| {
        let refused = Refused {
            reason: "TOO_MANY_FOLLOWERS",
            what,
            limit: followers.share_of(key) as u64,
            retry_after: FOLLOW_SEND_TIMEOUT,
        };
        Refusal::from(refused).into()
    })
}

/// Waits for a change of what a task does.
///
/// # Errors
/// The task has stopped: the follower can follow again, where the unit runs then.
pub(super) async fn changed<C>(
    changes: &mut watch::Receiver<C>,
    stopped: impl Future<Output = ()>,
) -> Result<(), Status> {
    tokio::select! {
        biased;
        changed = changes.changed() => changed.map_err(|_| status::shutting_down()),
        () = stopped => Err(status::shutting_down()),
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
pub(super) async fn send<M>(sender: &Sender<M>, message: M) -> Result<(), Status> {
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

/// Sends a part of `what`.
///
/// # Errors
/// It is not received within `limit`, or the client has gone.
pub(super) async fn send_part<M>(
    sender: &Sender<M>,
    part: M,
    what: &str,
    limit: Duration,
) -> Result<(), Status> {
    let sent = sender.send_timeout(Ok(part), limit).await;
    sent.map_err(|_| reader_too_slow(what, limit))
}

#[cfg(test)]
mod tests {
    use std::future::pending;
    use std::pin::pin;

    use futures::{FutureExt as _, StreamExt as _};
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
        let closing = CancellationToken::new();
        let (place, mut free) = tokio::sync::oneshot::channel::<()>();
        let (stream, running) = stream(closing.clone(), move |sender| async move {
            let _place = place;
            send(&sender, 1).await?;
            pending().await
        });
        let (mut stream, running) = (stream.into_inner(), tokio::spawn(running));
        tokio::task::yield_now().await;
        assert!(
            free.try_recv()
                .is_err_and(|error| error == TryRecvError::Empty)
        );
        closing.cancel();
        free.await.expect_err("it is given back");
        assert_eq!(
            stream.next().await.expect("a message").expect("no error"),
            1
        );
        let ended = stream.next().await.expect("the reason");
        assert_eq!(
            ended.expect_err("it is incomplete").code(),
            Code::Unavailable
        );
        running.await.expect("no panic");
    }

    #[tokio::test]
    async fn what_is_sent_to_nobody_ends() {
        let (place, free) = tokio::sync::oneshot::channel::<()>();
        let (stream, running) = stream::<(), _>(CancellationToken::new(), move |_| async move {
            let _place = place;
            pending().await
        });
        let mut running = pin!(running);
        assert!(running.as_mut().now_or_never().is_none());
        drop(stream);
        running.await;
        free.await.expect_err("it is given back");
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
    async fn a_follower_waits_for_a_change_or_the_end_of_the_task() {
        let (count, mut changes) = watch::channel(0);
        count.send_replace(1);
        let last = changed(&mut changes, async {}).await;
        last.expect("what changed last is sent before");
        let stopped = changed(&mut changes, async {}).await;
        assert_eq!(stopped.expect_err("the end").code(), Code::Unavailable);
        assert!(changed(&mut changes, pending()).now_or_never().is_none());
    }
}
