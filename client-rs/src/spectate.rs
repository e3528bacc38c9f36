//! Watching a room: its public events, each once and in order, across lost connections.

use std::collections::VecDeque;

use futures::Stream;
use tokio::time::Instant;
use tonic::{Status, Streaming};

use crate::backoff::{Backoff, Outage};
use crate::connection::{Connection, MAX_RESPONSE_BYTES};
use crate::error::Error;
use crate::v1::{self, spectator_service_client::SpectatorServiceClient};

/// What a spectator learns.
#[derive(Debug, Clone, PartialEq)]
pub enum Watched {
    /// An event of the game.
    Event(Box<v1::GameEvent>),
    /// The state of the game, in place of events that the room of a long game no longer has.
    Snapshot(Box<v1::Snapshot>),
    /// Whom the game waits for, after the events so far; nobody when a new connection begins, until
    /// the server says it.
    Awaited(v1::Awaited),
}

/// A spectator of one room, created by [`Client::spectate`](crate::Client::spectate).
#[derive(Debug)]
pub struct Spectator {
    client: SpectatorServiceClient<Connection>,
    room_id: String,
    next_event: u64,
    /// The first event that the latest connection has asked for.
    asked_from: u64,
    backoff: Backoff,
    outage: Outage,
    stream: Option<(Streaming<v1::SpectatorServiceWatchResponse>, Instant)>,
    ready: VecDeque<Watched>,
    /// The last [`Watched::Awaited`] had a seat.
    awaits: bool,
    room: Option<v1::Room>,
    ended: bool,
}

impl Spectator {
    pub(crate) fn new(channel: Connection, room_id: String, from_sequence: u64) -> Self {
        Self {
            client: SpectatorServiceClient::new(channel)
                .max_decoding_message_size(MAX_RESPONSE_BYTES),
            room_id,
            next_event: from_sequence,
            asked_from: from_sequence,
            backoff: Backoff::default(),
            outage: Outage::default(),
            stream: None,
            ready: VecDeque::new(),
            awaits: false,
            room: None,
            ended: false,
        }
    }

    /// Replaces the default backoff.
    #[must_use]
    pub fn with_backoff(mut self, backoff: Backoff) -> Self {
        self.backoff = backoff;
        self
    }

    /// The room when the latest connection was made; `None` before the first event.
    pub fn room(&self) -> Option<&v1::Room> {
        self.room.as_ref()
    }

    /// Number of the next event, for resuming in another process.
    pub fn next_sequence(&self) -> u64 {
        let first = self.ready.iter().find_map(|watched| match watched {
            Watched::Event(event) => Some(event.sequence),
            // What was asked for: another process needs the snapshot, too.
            Watched::Snapshot(_) => Some(self.asked_from),
            Watched::Awaited(_) => None,
        });
        first.unwrap_or(self.next_event).max(1)
    }

    /// The next event, or `None` when the game is over. Where numbers are missing, the room no
    /// longer has these events. Cancel safe: dropping the future loses no event.
    ///
    /// # Errors
    /// The server's refusal (`ROOM_UNKNOWN`, `SPECTATORS_NOT_ADMITTED`), or the last failure if the
    /// connection cannot be restored in time. After an error there are no more events.
    pub async fn next(&mut self) -> Result<Option<v1::GameEvent>, Error> {
        loop {
            match self.next_watched().await? {
                Some(Watched::Event(event)) => return Ok(Some(*event)),
                Some(Watched::Snapshot(_) | Watched::Awaited(_)) => {}
                None => return Ok(None),
            }
        }
    }

    /// The next event, a snapshot in place of events that are gone, or whom the game waits for when
    /// that changes; `None` when the game is over.
    /// Cancel safe, as [`Spectator::next`].
    ///
    /// # Errors
    /// As [`Spectator::next`].
    pub async fn next_watched(&mut self) -> Result<Option<Watched>, Error> {
        loop {
            if let Some(watched) = self.ready.pop_front() {
                return Ok(Some(watched));
            }
            if self.ended {
                return Ok(None);
            }
            match self.receive().await {
                Ok(Some(response)) => self.take(response),
                Ok(None) => self.ended = true,
                Err(status) => self.lost(status).await?,
            }
        }
    }

    /// Converts the spectator to a [`Stream`].
    pub fn into_stream(self) -> impl Stream<Item = Result<v1::GameEvent, Error>> + Send {
        futures::stream::try_unfold(self, |mut spectator| async {
            let event = spectator.next().await?;
            Ok(event.map(|event| (event, spectator)))
        })
    }

    async fn receive(&mut self) -> Result<Option<v1::SpectatorServiceWatchResponse>, Status> {
        if self.stream.is_none() {
            self.asked_from = self.next_event;
            let request = v1::SpectatorServiceWatchRequest {
                room_id: self.room_id.clone(),
                from_sequence: self.next_event,
                snapshot: false,
            };
            let stream = self.client.watch(request).await?.into_inner();
            self.stream = Some((stream, Instant::now()));
            if self.awaits {
                self.awaits = false;
                let nobody = v1::Awaited::default();
                self.ready.push_back(Watched::Awaited(nobody));
            }
        }
        match &mut self.stream {
            Some((stream, _)) => stream.message().await,
            None => Ok(None),
        }
    }

    fn take(&mut self, response: v1::SpectatorServiceWatchResponse) {
        if response.room.is_some() {
            self.room = response.room;
        }
        if let Some(snapshot) = response.snapshot {
            self.next_event = self.next_event.max(snapshot.next_sequence);
            self.ready.push_back(Watched::Snapshot(Box::new(snapshot)));
        }
        for event in response.events {
            if event.sequence >= self.next_event {
                self.next_event = event.sequence.saturating_add(1);
                self.outage.over();
                self.ready.push_back(Watched::Event(Box::new(event)));
            }
        }
        if let Some(awaited) = response.awaited.into_iter().last() {
            self.awaits = awaited.seat.is_some();
            self.ready.push_back(Watched::Awaited(awaited));
        }
    }

    async fn lost(&mut self, status: Status) -> Result<(), Error> {
        let opened = self.stream.take().map(|(_, opened)| opened);
        if opened.is_some_and(|opened| opened.elapsed() >= self.backoff.max) {
            self.outage.over();
        }
        let waited = self.outage.wait(&self.backoff, status).await;
        waited.inspect_err(|_| self.ended = true)
    }
}
