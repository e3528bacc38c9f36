//! Tickets of those who decide slowly, such as people and language models: updates come one by one,
//! and answers go their own way. Nothing decides on the task that receives, as an agent in `session`
//! does.

use std::collections::VecDeque;

use crate::backoff::Backoff;
use crate::client::Client;
use crate::error::{Error, PlayError};
use crate::options::Entropy;
use crate::run::PlayStream;
use crate::tickets::{PARTICIPANT, TicketEvent, Tickets, command, pack};
use crate::v1::act_request::Command;
use crate::v1::{self, seat_command, seat_update::Update};

impl Client {
    /// Follows a ticket: of a seat, or of a participant in a tournament, whose games bring more
    /// seats. The server counts it as connected, and sends its events at once. Connects when the
    /// first update is requested.
    pub fn follow_ticket(&self, ticket: impl Into<String>) -> TicketFollower {
        let mut tickets = Tickets::new(v1::EventDelivery::AtOnce, false);
        tickets.add_participant(ticket.into(), Entropy::Fresh.draw());
        TicketFollower {
            stream: PlayStream::new(self.channel(), Backoff::default()),
            tickets,
            ready: VecDeque::new(),
            detaching: Vec::new(),
            failure: None,
        }
    }

    /// [`follow_ticket`](Self::follow_ticket) for the ticket of a seat. Answer its decisions with
    /// [`Client::answer`].
    pub fn follow_seat(&self, ticket: impl Into<String>) -> SeatFollower {
        SeatFollower(self.follow_ticket(ticket))
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

/// What a [`TicketFollower`] returns. Games are named by their id.
#[derive(Debug, Clone)]
pub enum Followed {
    /// The ticket is a participant's, which is in its tournament. Sent again after each connection.
    Entered(v1::Entered),
    /// An update for the seat in a game. Every connection begins with [`Update::Attached`]; each
    /// event comes once and in order, a snapshot in place of those that the room of a long game no
    /// longer has, and an open decision again after each connection.
    Update(String, Box<Update>),
    /// The seat in a game of a tournament was lost before its end.
    Gone(String, PlayError),
    /// The connection was lost, with the reason; the next call restores it.
    Lost(Error),
}

/// Follows one ticket across lost connections; created by [`Client::follow_ticket`]. Dropping it
/// leaves its seats.
#[derive(Debug)]
pub struct TicketFollower {
    stream: PlayStream,
    /// The ticket, as a participant's, and its seats.
    tickets: Tickets,
    ready: VecDeque<Followed>,
    /// Commands of the current stream that wait to be sent.
    detaching: Vec<v1::SeatCommand>,
    /// Why no more updates will come after those in `ready`, unless everything is over.
    failure: Option<PlayError>,
}

impl TicketFollower {
    /// Replaces the default backoff.
    #[must_use]
    pub fn with_backoff(mut self, backoff: Backoff) -> Self {
        self.stream.set_backoff(backoff);
        self
    }

    /// The next update; `None` when the game or the tournament, with all its games, is over. Cancel
    /// safe: dropping the future loses nothing.
    ///
    /// # Errors
    /// See [`PlayError`]. After an error there are no more updates.
    pub async fn next(&mut self) -> Result<Option<Followed>, PlayError> {
        loop {
            if !self.detaching.is_empty() {
                // Nothing is sent if this is cancelled.
                self.stream.send(pack(self.detaching.clone())).await;
                self.detaching.clear();
            }
            if let Some(followed) = self.ready.pop_front() {
                return Ok(Some(followed));
            }
            if let Some(failure) = self.failure.take() {
                return Err(failure);
            }
            if self.tickets.is_empty() {
                return Ok(None);
            }
            match self.stream.next(|| self.tickets.attach()).await {
                Ok(response) => {
                    self.take(response);
                    self.detaching.extend(self.tickets.detach());
                }
                Err(broken) => {
                    self.tickets.disconnected();
                    self.detaching.clear();
                    match broken.of_seats() {
                        _ if self.tickets.is_empty() => {}
                        Ok(error) => self.ready.push_back(Followed::Lost(error)),
                        Err(error) => self.fail(error),
                    }
                }
            }
        }
    }

    /// Sends a command for the seat in a game. Without a connection it is dropped: the server sends
    /// an open decision again.
    pub async fn send(&self, game_id: &str, what: seat_command::Command) {
        if let Some(handle) = self.tickets.handle_in(game_id) {
            self.stream.send(pack(vec![command(handle, what)])).await;
        }
    }

    /// Leaves the seats after everything has been sent.
    pub async fn leave(self) {
        self.stream.leave().await;
    }

    fn take(&mut self, response: v1::PlayResponse) {
        for update in response.updates {
            let Some((number, event)) = self.tickets.take(update) else {
                continue;
            };
            let game = || self.tickets.game_id(number).to_owned();
            let followed = match event {
                TicketEvent::Entered(entered) => Followed::Entered(entered),
                TicketEvent::Attached(it) => {
                    Followed::Update(game(), Box::new(Update::Attached(it)))
                }
                TicketEvent::Update(update) => Followed::Update(game(), Box::new(update)),
                TicketEvent::Over(_, Ok(())) => continue,
                TicketEvent::Over(_, Err(error)) if number == PARTICIPANT => {
                    self.fail(error);
                    continue;
                }
                TicketEvent::Over(game, Err(error)) => Followed::Gone(game, error),
            };
            self.ready.push_back(followed);
        }
        if self.tickets.take_progress() {
            self.stream.progress();
        }
    }

    fn fail(&mut self, failure: PlayError) {
        self.tickets.clear();
        self.failure.get_or_insert(failure);
    }
}

/// Follows one seat across lost connections; created by [`Client::follow_seat`]. Dropping it leaves
/// the seat.
#[derive(Debug)]
pub struct SeatFollower(TicketFollower);

impl SeatFollower {
    /// Replaces the default backoff.
    #[must_use]
    pub fn with_backoff(self, backoff: Backoff) -> Self {
        Self(self.0.with_backoff(backoff))
    }

    /// The next update; `None` when the game is over. See [`Followed::Update`]. Cancel safe: dropping
    /// the future loses nothing.
    ///
    /// # Errors
    /// See [`PlayError`]. After an error there are no more updates.
    pub async fn next(&mut self) -> Result<Option<Update>, PlayError> {
        loop {
            match self.0.next().await? {
                Some(Followed::Update(_, update)) => return Ok(Some(*update)),
                Some(_) => {}
                None => return Ok(None),
            }
        }
    }
}
