//! Carries messages between tickets and the server, on one `Play` stream at a time. `session`
//! interprets those of agents' seats, `ticket_follower` passes on those of others.

use std::time::Duration;

use tokio::sync::mpsc;
use tokio::time::timeout;
use tokio_stream::wrappers::ReceiverStream;

use crate::Agent;
use crate::backoff::Backoff;
use crate::connection::{Connection, MAX_RESPONSE_BYTES};
use crate::session::Session;
use crate::stream::{Broken, Reconnecting};
use crate::v1::{self, play_service_client::PlayServiceClient};

/// Maximum number of requests waiting for the transport.
const REQUEST_QUEUE: usize = 64;
/// Time limit for the server to end a half-closed stream.
const LEAVE_TIMEOUT: Duration = Duration::from_secs(1);

/// The `Play` stream of a process, across lost connections.
#[derive(Debug)]
pub(crate) struct PlayStream {
    service: PlayServiceClient<Connection>,
    responses: Reconnecting<v1::PlayResponse>,
    /// To the current stream.
    requests: Option<mpsc::Sender<v1::PlayRequest>>,
}

impl PlayStream {
    pub(crate) fn new(connection: Connection, backoff: Backoff) -> Self {
        Self {
            service: PlayServiceClient::new(connection)
                .max_decoding_message_size(MAX_RESPONSE_BYTES),
            responses: Reconnecting::new(backoff),
            requests: None,
        }
    }

    pub(crate) fn set_backoff(&mut self, backoff: Backoff) {
        self.responses.set_backoff(backoff);
    }

    /// The next response. A new stream begins with the requests of `attach`. Cancel safe.
    pub(crate) async fn next(
        &mut self,
        mut attach: impl FnMut() -> Vec<v1::PlayRequest>,
    ) -> Result<v1::PlayResponse, Broken> {
        let response = self.responses.next(|| {
            let attach = attach();
            // All attachments must fit: nothing is read from the queue before the stream is open.
            let (requests, queue) = mpsc::channel(REQUEST_QUEUE.max(attach.len()));
            for request in attach {
                requests
                    .try_send(request)
                    .expect("the queue has room for all attachments");
            }
            self.requests = Some(requests);
            let mut service = self.service.clone();
            async move { service.play(ReceiverStream::new(queue)).await }
        });
        let response = match response.await {
            Ok(Some(response)) => return Ok(response),
            Ok(None) => Err(self.responses.ended()),
            Err(broken) => Err(broken),
        };
        self.requests = None;
        response
    }

    /// Sends requests on the current stream, if there is one. If the transport accepts no more, the
    /// next response has the reason.
    pub(crate) async fn send(&self, all: Vec<v1::PlayRequest>) {
        if let Some(requests) = &self.requests {
            for request in all {
                let _ = requests.send(request).await;
            }
        }
    }

    /// Ends the outage: there was progress.
    pub(crate) fn progress(&mut self) {
        self.responses.progress();
    }

    /// Ends the stream cleanly, but does not depend on it: everything has been sent.
    pub(crate) async fn leave(self) {
        drop(self.requests);
        let _ended = timeout(LEAVE_TIMEOUT, self.responses.drain()).await;
    }
}

/// Plays until every seat of the session is settled.
pub(crate) async fn run<A: Agent>(
    connection: Connection,
    session: &mut Session<'_, A>,
    backoff: &Backoff,
) {
    let mut stream = PlayStream::new(connection, backoff.clone());
    while !session.is_over() {
        match stream.next(|| session.attach()).await {
            Ok(response) => {
                let requests = session.receive(response);
                if session.take_progress() {
                    stream.progress();
                }
                stream.send(requests).await;
            }
            Err(broken) => {
                session.disconnected();
                if let Err(error) = broken.of_seats() {
                    session.give_up(&error);
                }
            }
        }
    }
    stream.leave().await;
}
