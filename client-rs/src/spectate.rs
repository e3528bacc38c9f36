//! Watching a room: its public events, each once and in order, across lost connections.

use std::collections::VecDeque;

use futures::Stream;

use crate::backoff::Backoff;
use crate::connection::{Connection, MAX_RESPONSE_BYTES};
use crate::error::Error;
use crate::stream::{Broken, Reconnecting};
use crate::v1::{self, spectator_service_client::SpectatorServiceClient};

/// What a spectator learns.
#[derive(Debug, Clone, PartialEq)]
pub enum Watched {
    /// An event of the game.
    Event(Box<v1::GameEvent>),
    /// The state of the game, in place of events that the room of a long game no longer has.
    Snapshot(Box<v1::Snapshot>),
    /// Whom the game waits for, after the events so far; nobody once the connection is lost, until
    /// the server says it again.
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
    stream: Reconnecting<v1::SpectatorServiceWatchResponse>,
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
            stream: Reconnecting::new(Backoff::default()),
            ready: VecDeque::new(),
            awaits: false,
            room: None,
            ended: false,
        }
    }

    /// Replaces the default backoff.
    #[must_use]
    pub fn with_backoff(mut self, backoff: Backoff) -> Self {
        self.stream.set_backoff(backoff);
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
                Err(broken) => self.lost(broken)?,
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

    async fn receive(&mut self) -> Result<Option<v1::SpectatorServiceWatchResponse>, Broken> {
        let response = self.stream.next(|| {
            self.asked_from = self.next_event;
            let request = v1::SpectatorServiceWatchRequest {
                room_id: self.room_id.clone(),
                from_sequence: self.next_event,
                snapshot: false,
            };
            let mut client = self.client.clone();
            async move { client.watch(request).await }
        });
        response.await
    }

    fn take(&mut self, response: v1::SpectatorServiceWatchResponse) {
        if response.room.is_some() {
            self.room = response.room;
        }
        if let Some(snapshot) = response.snapshot {
            self.next_event = self.next_event.max(snapshot.next_sequence);
            self.stream.progress();
            self.ready.push_back(Watched::Snapshot(Box::new(snapshot)));
        }
        for event in response.events {
            if event.sequence >= self.next_event {
                self.next_event = event.sequence.saturating_add(1);
                self.stream.progress();
                self.ready.push_back(Watched::Event(Box::new(event)));
            }
        }
        if let Some(awaited) = response.awaited.into_iter().last() {
            self.awaits = awaited.seat.is_some();
            self.ready.push_back(Watched::Awaited(awaited));
        }
    }

    fn lost(&mut self, broken: Broken) -> Result<(), Error> {
        if std::mem::take(&mut self.awaits) {
            let nobody = v1::Awaited::default();
            self.ready.push_back(Watched::Awaited(nobody));
        }
        broken.or_again().inspect_err(|_| self.ended = true)
    }
}
