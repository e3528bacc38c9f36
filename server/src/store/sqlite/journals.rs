//! The journals that rooms write to, and the queue of write commands.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use chefshat_proto::v1;
use futures::FutureExt as _;
use futures::future::{BoxFuture, ready};
use sqlx::sqlite::SqlitePool;
use tokio::sync::{mpsc, oneshot};
use tracing::error;

use super::rows;
use super::writer::{Pending, Row, WriteCommand};
use crate::store::codec::Codec;
use crate::store::form;
use crate::store::{Journal, Signed, StoreError};
use chefshat_room::journal::{Entry, GameHeader};

/// The queue of the writer.
#[derive(Clone)]
pub(super) struct WriteQueue {
    pub(super) queue: mpsc::Sender<Pending>,
    /// The number of the next row of the journal.
    pub(super) next_row: Arc<AtomicI64>,
}

impl WriteQueue {
    /// Takes the next row number of the journal.
    fn new_row(&self) -> i64 {
        self.next_row.fetch_add(1, Ordering::Relaxed)
    }

    /// The lowest number that a row can still get.
    fn first_row(&self) -> i64 {
        self.next_row.load(Ordering::Relaxed)
    }

    /// Number of commands in the queue.
    pub(super) fn depth(&self) -> usize {
        self.queue.max_capacity() - self.queue.capacity()
    }

    /// Sends a command and waits until it is committed.
    pub(super) async fn send(&self, command: WriteCommand) -> Result<(), StoreError> {
        let gone = || StoreError::Failed("the database is closed".into());
        let (reply, committed) = oneshot::channel();
        let command = self.queue.send((command, reply));
        command.await.map_err(|_| gone())?;
        committed.await.map_err(|_| gone())?
    }
}

/// The journal of a game that survives the server.
pub(super) struct DurableJournal {
    pub(super) number: i64,
    pub(super) position: i64,
    /// Its last row so far.
    pub(super) last_row: Option<i64>,
    pub(super) queue: WriteQueue,
    pub(super) readers: SqlitePool,
    pub(super) codec: Codec,
}

impl DurableJournal {
    /// Creates the game, with its first row if there are entries.
    pub(super) async fn begin(
        &mut self,
        header: &GameHeader,
        entries: &mut Vec<Entry>,
    ) -> Result<(), StoreError> {
        let first_row = self.queue.first_row();
        let first = (!entries.is_empty()).then(|| self.next_row(entries));
        let create = WriteCommand::Create {
            number: self.number,
            game_id: header.game_id,
            header: form::header_to_bytes(header),
            first_row,
            first,
        };
        self.queue.send(create).await
    }

    /// Its next row.
    fn next_row(&mut self, entries: &mut Vec<Entry>) -> Row {
        let number = self.queue.new_row();
        let row = Row {
            number,
            game: self.number,
            position: self.position,
            previous: self.last_row,
            entries: encode(entries),
        };
        self.position += 1;
        self.last_row = Some(number);
        row
    }
}

impl Journal for DurableJournal {
    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        let row = self.next_row(entries);
        self.queue.send(WriteCommand::Append(row)).boxed()
    }

    fn entries(&mut self) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        async move {
            let read = rows::journal(&self.readers, &self.codec, self.number, self.last_row);
            match read.await? {
                Ok(read) => Ok(read.entries),
                Err(problem) => Err(StoreError::Failed(format!(
                    "the journal of game number {} cannot be read back: {problem}",
                    self.number
                ))),
            }
        }
        .boxed()
    }

    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signed: Option<Signed>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        self.queue
            .send(WriteCommand::Finish {
                number: self.number,
                // Only an aborted game can end before the deal.
                state: v1::RoomState::Aborted.into(),
                last_row: self.last_row,
                summary,
                signature: signed.as_ref().map(form::signed_to_bytes),
            })
            .boxed()
    }
}

/// The journal of a game that is stored when it ends. Until then its entries are in memory,
/// encoded, which takes a small part of the space.
pub(super) struct EphemeralJournal {
    number: i64,
    header: Arc<GameHeader>,
    encoded: Vec<u8>,
    queue: WriteQueue,
}

impl EphemeralJournal {
    /// A journal that begins with these entries.
    pub(super) fn new(
        number: i64,
        header: Arc<GameHeader>,
        mut entries: Vec<Entry>,
        queue: WriteQueue,
    ) -> Self {
        Self {
            number,
            header,
            encoded: encode(&mut entries),
            queue,
        }
    }
}

impl Journal for EphemeralJournal {
    fn append_now(&mut self, entries: &mut Vec<Entry>) -> bool {
        put_all(entries, &mut self.encoded);
        true
    }

    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        self.append_now(entries);
        ready(Ok(())).boxed()
    }

    fn entries(&mut self) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        let mut entries = Vec::new();
        let read = form::read_entries(&self.encoded, &mut entries);
        let failed = |problem: form::Unreadable| StoreError::Failed(problem.to_string());
        ready(read.map(|()| entries).map_err(failed)).boxed()
    }

    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signed: Option<Signed>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        let Some(summary) = summary else {
            return ready(Ok(())).boxed();
        };
        let entries = std::mem::take(&mut self.encoded);
        async move {
            let game_id = self.header.game_id;
            let game = WriteCommand::Whole {
                number: self.number,
                game_id,
                header: form::header_to_bytes(&self.header),
                row: self.queue.new_row(),
                entries,
                summary,
                signature: signed.as_ref().map(form::signed_to_bytes),
            };
            match self.queue.send(game).await {
                // The game was played anyway; the record that was stored first stays.
                Err(StoreError::Taken(_)) => {
                    error!(game = %game_id, "another record has the id of this game; the game is not stored");
                    Ok(())
                }
                stored => stored,
            }
        }
        .boxed()
    }
}

fn encode(entries: &mut Vec<Entry>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(entries.len() * 32);
    put_all(entries, &mut bytes);
    bytes
}

fn put_all(entries: &mut Vec<Entry>, bytes: &mut Vec<u8>) {
    for entry in entries.drain(..) {
        form::put_entry(&entry, bytes);
    }
}
