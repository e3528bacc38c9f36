//! Carries messages between a session and the server: opens the stream, reopens it when it breaks,
//! and finally gives up. `session` interprets the messages.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::{Instant, sleep, timeout};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Status, Streaming};

use crate::backoff::{Backoff, Outage};
use crate::connection::{Connection, MAX_RESPONSE_BYTES};
use crate::error::{PlayError, may_retry};
use crate::session::Session;
use crate::v1::{self, play_service_client::PlayServiceClient};
use crate::{Agent, Error};

/// Maximum number of requests waiting for the transport.
const REQUEST_QUEUE: usize = 64;
/// Time limit for the server to accept a stream.
const OPEN_TIMEOUT: Duration = Duration::from_secs(10);
/// Time limit for the server to end a half-closed stream.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);

/// A stream that ended before the games of its seats.
struct Lost {
    status: Status,
    /// How long the stream was open.
    held: Duration,
}

/// Plays until every seat of the session is settled.
pub(crate) async fn run<A: Agent>(
    channel: Connection,
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

/// Runs one stream, until the session is over or the stream breaks.
async fn converse<A: Agent>(
    client: &mut PlayServiceClient<Connection>,
    session: &mut Session<'_, A>,
) -> Result<(), Lost> {
    let attach = session.attach();
    // All attachments must fit: nothing is read from the queue before the stream is open.
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
                // The transport accepts no more requests; the response stream has the reason.
                break;
            }
        }
    }
    drop(requests);
    // Ends the stream cleanly, but does not depend on it: everything has been sent.
    let _ended = timeout(LEAVE_TIMEOUT, drain(responses)).await;
    Ok(())
}

async fn open(
    client: &mut PlayServiceClient<Connection>,
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
