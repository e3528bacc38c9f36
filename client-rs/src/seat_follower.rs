//! A seat for those who decide slowly, such as people and language models: its updates come one by
//! one, and answers are calls of their own. Nothing decides on the task that receives, as an agent in
//! `run` does.

use std::collections::VecDeque;

use tokio::time::{Instant, sleep};
use tonic::{Status, Streaming};

use crate::backoff::{Backoff, Outage};
use crate::client::Client;
use crate::connection::{Connection, MAX_RESPONSE_BYTES};
use crate::error::{Error, PlayError, may_retry};
use crate::options::Entropy;
use crate::v1::act_request::Command;
use crate::v1::game_event::Kind;
use crate::v1::play_service_client::PlayServiceClient;
use crate::v1::{self, seat_update::Update};

impl Client {
    /// Follows a seat: the server counts it as connected, and sends its events at once. Answer its
    /// decisions with [`Client::answer`]. Connects when the first update is requested.
    pub fn follow_seat(&self, ticket: impl Into<String>) -> SeatFollower {
        SeatFollower {
            service: PlayServiceClient::new(self.channel())
                .max_decoding_message_size(MAX_RESPONSE_BYTES),
            ticket: ticket.into(),
            entropy: Entropy::Fresh.draw(),
            next_event: 1,
            backoff: Backoff::default(),
            outage: Outage::default(),
            stream: None,
            ready: VecDeque::new(),
            ended: false,
            over: false,
            failure: None,
        }
    }

    /// Answers a decision of a seat that is followed. If the response is lost, the call is repeated:
    /// the server acknowledges the same answer again.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `GAME_OVER`. An illegal or late answer is no error: see
    /// [`v1::AnswerResult::status`].
    pub async fn answer(
        &self,
        ticket: impl Into<String>,
        answer: v1::Answer,
    ) -> Result<v1::AnswerResult, Error> {
        let response = self.act(ticket.into(), Command::Answer(answer)).await?;
        response.result.ok_or_else(|| Error::incomplete("result"))
    }

    /// Takes a seat that is followed back from its substitute.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `GAME_OVER`.
    pub async fn resume_seat(&self, ticket: impl Into<String>) -> Result<(), Error> {
        let resume = Command::Resume(v1::ResumeSeat {});
        self.act(ticket.into(), resume).await.map(drop)
    }
}

/// Follows one seat across lost connections; created by [`Client::follow_seat`]. Dropping it leaves
/// the seat.
#[derive(Debug)]
pub struct SeatFollower {
    service: PlayServiceClient<Connection>,
    ticket: String,
    entropy: Vec<u8>,
    next_event: u64,
    backoff: Backoff,
    outage: Outage,
    stream: Option<(Streaming<v1::PlayServiceWatchResponse>, Instant)>,
    ready: VecDeque<Update>,
    /// The game has ended.
    ended: bool,
    /// No more updates will come, after those in `ready`.
    over: bool,
    /// Why, unless the game is over.
    failure: Option<PlayError>,
}

impl SeatFollower {
    /// Replaces the default backoff.
    #[must_use]
    pub fn with_backoff(mut self, backoff: Backoff) -> Self {
        self.backoff = backoff;
        self
    }

    /// The next update; `None` when the game is over. Every connection begins with
    /// [`Update::Attached`]; each event comes once and in order, a snapshot in place of those that
    /// the room of a long game no longer has, and an open decision again after each connection.
    /// Cancel safe: dropping the future loses nothing.
    ///
    /// # Errors
    /// See [`PlayError`]. After an error there are no more updates.
    pub async fn next(&mut self) -> Result<Option<Update>, PlayError> {
        loop {
            if let Some(update) = self.ready.pop_front() {
                return Ok(Some(update));
            }
            if let Some(failure) = self.failure.take() {
                return Err(failure);
            }
            if self.over {
                return Ok(None);
            }
            match self.receive().await {
                Ok(response) => {
                    for update in response.updates {
                        if let Some(update) = update.update {
                            self.take(update);
                        }
                    }
                }
                Err(status) => self.lost(status).await,
            }
        }
    }

    async fn receive(&mut self) -> Result<v1::PlayServiceWatchResponse, Status> {
        let (stream, _) = match &mut self.stream {
            Some(stream) => stream,
            none => {
                let attach = v1::Attach {
                    ticket: self.ticket.clone(),
                    from_sequence: self.next_event,
                    entropy: self.entropy.clone(),
                    delivery: v1::EventDelivery::AtOnce.into(),
                    ..v1::Attach::default()
                };
                let request = v1::PlayServiceWatchRequest {
                    seats: vec![attach],
                };
                let stream = self.service.watch(request).await?.into_inner();
                none.insert((stream, Instant::now()))
            }
        };
        let response = stream.message().await?;
        response.ok_or_else(|| Status::unavailable("the server ended the stream"))
    }

    fn take(&mut self, update: Update) {
        match update {
            Update::Events(mut batch) => {
                let next = self.next_event;
                batch.events.retain(|event| event.sequence >= next);
                let Some(last) = batch.events.last() else {
                    return;
                };
                self.next_event = last.sequence.saturating_add(1);
                self.outage.over();
                self.ended |= batch.events.iter().any(ends_game);
                self.ready.push_back(Update::Events(batch));
            }
            Update::Refused(refused) => {
                self.fail(PlayError::Refused(Error::refused(refused)));
            }
            Update::Detached(detached) => match detached.reason() {
                // The end of the stream follows; the seat is attached again on the next one.
                v1::DetachReason::ServerStopping => {}
                _ if self.ended => self.over = true,
                v1::DetachReason::GameOver => self.fail(PlayError::EndingUnknown),
                v1::DetachReason::Superseded => self.fail(PlayError::Superseded),
                _ => self.fail(PlayError::Detached),
            },
            update => {
                if let Update::Snapshot(snapshot) = &update {
                    self.next_event = self.next_event.max(snapshot.next_sequence);
                }
                self.ready.push_back(update);
            }
        }
    }

    fn fail(&mut self, failure: PlayError) {
        self.over = true;
        self.failure.get_or_insert(failure);
    }

    /// Waits before the next attempt, or gives up.
    async fn lost(&mut self, status: Status) {
        let opened = self.stream.take().map(|(_, opened)| opened);
        if self.ended {
            self.over = true;
            return;
        }
        if opened.is_some_and(|opened| opened.elapsed() >= self.backoff.max) {
            self.outage.over();
        }
        if !may_retry(status.code()) {
            return self.fail(PlayError::Refused(status.into()));
        }
        match self.outage.failed(&self.backoff, Instant::now()) {
            Ok(delay) => {
                tracing::info!(?delay, "connection lost: {status}");
                sleep(delay).await;
            }
            Err(outage) => {
                let last = Error::from(status);
                self.fail(PlayError::ConnectionLost { outage, last });
            }
        }
    }
}

fn ends_game(event: &v1::GameEvent) -> bool {
    matches!(event.kind, Some(Kind::GameEnded(_) | Kind::GameAborted(_)))
}
