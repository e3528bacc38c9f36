//! Carries the messages between a session and the server: opens the stream, opens it again when it breaks, gives up in the end. What
//! the messages mean is in `session`.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{Instant, sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::transport::Channel;
use tonic::{Status, Streaming};

use crate::backoff::{Backoff, Outage};
use crate::connection::MAX_RESPONSE_BYTES;
use crate::error::{PlayError, may_retry};
use crate::session::Session;
use crate::v1::{self, play_service_client::PlayServiceClient};
use crate::{Agent, Error};

/// Requests that may wait for the transport.
const REQUEST_QUEUE: usize = 64;
/// Time for the server to accept a stream.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);
/// Time for the server to end a stream that has been half-closed.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);

/// How a stream ended before its seats' games did.
struct Lost {
    status: Status,
    /// How long it had been open.
    held: Duration,
}

/// Plays until every seat of the session is settled.
pub(crate) async fn run<A: Agent>(
    channel: Channel,
    session: &mut Session<'_, A>,
    backoff: &Backoff,
) {
    let mut client = PlayServiceClient::new(channel).max_decoding_message_size(MAX_RESPONSE_BYTES);
    let mut outage = Outage::default();
    while !session.is_over() {
        let Err(lost) = converse(&mut client, session).await else {
            return;
        };
        session.disconnected();
        if !may_retry(lost.status.code()) {
            session.give_up(&PlayError::Refused(lost.status.into()));
            return;
        }
        if session.take_progress() || lost.held >= backoff.max {
            outage.over();
        }
        match outage.failed(backoff, Instant::now()) {
            Ok(delay) => {
                tracing::warn!(
                    "connection lost, trying again in {:.1} s: {}",
                    delay.as_secs_f32(),
                    lost.status
                );
                sleep(delay).await;
            }
            Err(outage) => {
                let last = Error::from(lost.status);
                session.give_up(&PlayError::ConnectionLost { outage, last });
            }
        }
    }
}

/// One stream, until the session is over or the stream breaks.
async fn converse<A: Agent>(
    client: &mut PlayServiceClient<Channel>,
    session: &mut Session<'_, A>,
) -> Result<(), Lost> {
    let attach = session.attach();
    // The attachments must all fit: nothing is read from the queue before the stream is open.
    let (requests, queue) = mpsc::channel(REQUEST_QUEUE.max(attach.len()));
    for request in attach {
        requests
            .try_send(request)
            .expect("the queue has room for all attachments");
    }
    let mut responses = open(client, queue).await.map_err(|status| Lost {
        status,
        held: Duration::ZERO,
    })?;
    let opened = Instant::now();
    let lost = |status| Lost {
        status,
        held: opened.elapsed(),
    };
    while !session.is_over() {
        let response = match responses.message().await {
            Ok(Some(response)) => response,
            Ok(None) => return Err(lost(Status::unavailable("the server ended the stream"))),
            Err(status) => return Err(lost(status)),
        };
        for request in session.receive(response) {
            if requests.send(request).await.is_err() {
                // The transport takes no more; the stream of responses says why.
                break;
            }
        }
    }
    drop(requests);
    // Leave in good order, but do not depend on it: everything has been said.
    let _ended = timeout(LEAVE_TIMEOUT, drain(responses)).await;
    Ok(())
}

async fn open(
    client: &mut PlayServiceClient<Channel>,
    queue: mpsc::Receiver<v1::PlayRequest>,
) -> Result<Streaming<v1::PlayResponse>, Status> {
    let call = client.play(ReceiverStream::new(queue));
    match timeout(OPEN_TIMEOUT, call).await {
        Ok(opened) => opened.map(tonic::Response::into_inner),
        Err(_elapsed) => Err(Status::unavailable(
            "the server did not accept the stream in time",
        )),
    }
}

async fn drain(mut responses: Streaming<v1::PlayResponse>) {
    while let Ok(Some(_)) = responses.message().await {}
}
