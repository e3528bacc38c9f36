//! One follower of a tournament: when it is told what. What it is told is worked out in `tournaments`, for all followers together.

use std::sync::Arc;

use chefshat_proto::v1::{FollowTournamentResponse, TournamentState};
use tokio::sync::{Semaphore, mpsc};
use tokio::time::{Instant, sleep_until, timeout};
use tonic::{Code, Status};

use super::status::{self, status};
use crate::config::{FOLLOW_INTERVAL, FOLLOW_SEND_TIMEOUT, HEARTBEAT};
use crate::tournaments::{NotWorkedOut, TournamentHandle};

type Sender = mpsc::Sender<Result<FollowTournamentResponse, Status>>;

/// Sends the tournament whenever it has changed, until it is over.
///
/// # Errors
/// The follower has gone away, or does not take in what it is told, or there is nothing to tell.
pub(super) async fn follow(
    hosted: &Arc<TournamentHandle>,
    permits: &Arc<Semaphore>,
    sender: &Sender,
) -> Result<(), Status> {
    let mut changes = hosted.changes();
    loop {
        changes.mark_unchanged();
        let told = hosted.told(permits).await.map_err(not_worked_out)?;
        let message = told.message.clone();
        drop(told);
        let over = is_over(&message);
        let sent = Instant::now();
        send(sender, message).await?;
        if over {
            return Ok(());
        }
        sleep_until(sent + FOLLOW_INTERVAL).await;
        while timeout(HEARTBEAT, changes.changed()).await.is_err() {
            send(sender, FollowTournamentResponse::default()).await?;
        }
    }
}

/// Tells a client why there is no more. It waits until that is taken or the client has gone away.
pub(super) async fn end(sender: &Sender, followed: Result<(), Status>) {
    if let Err(status) = followed {
        // A client that has gone away does not want to know.
        let _ = sender.send(Err(status)).await;
    }
}

/// What a client is told when something about a tournament could not be worked out.
pub(super) fn not_worked_out(problem: NotWorkedOut) -> Status {
    tracing::error!(%problem, "what was asked about tournaments was not worked out");
    status::internal()
}

fn is_over(message: &FollowTournamentResponse) -> bool {
    let state = message.tournament.as_ref().map(|it| it.state());
    matches!(
        state,
        Some(TournamentState::Finished | TournamentState::Closed)
    )
}

async fn send(sender: &Sender, message: FollowTournamentResponse) -> Result<(), Status> {
    let sent = sender.send_timeout(Ok(message), FOLLOW_SEND_TIMEOUT);
    sent.await.map_err(|_| {
        let seconds = FOLLOW_SEND_TIMEOUT.as_secs();
        status(
            Code::ResourceExhausted,
            "FOLLOWER_TOO_SLOW",
            format!("what was told was not taken in within {seconds} s; follow again"),
            [],
        )
    })
}

#[cfg(test)]
mod tests {
    use tonic_types::StatusExt as _;

    use crate::grpc::follow::*;

    #[tokio::test(start_paused = true)]
    async fn a_follower_that_takes_nothing_in_is_given_up() {
        let hosted = TournamentHandle::for_tests(4);
        let (sender, mut receiver) = mpsc::channel(1);
        let permits = Arc::new(Semaphore::new(1));
        // The first message goes into the channel, the heartbeat does not.
        let ended = follow(&hosted, &permits, &sender).await;
        let ended = ended.expect_err("it was not taken in");
        let info = ended.get_details_error_info().expect("it says why");
        assert_eq!(info.reason, "FOLLOWER_TOO_SLOW");
        let first = receiver.recv().await.expect("it was sent");
        let tournament = first.expect("no error").tournament.expect("a tournament");
        assert_eq!(tournament.participants.len(), 4);
    }
}
