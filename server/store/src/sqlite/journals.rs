//! The journals that rooms write to, and the queue of write commands.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use async_trait::async_trait;
use chefshat_proto::v1;
use sqlx::sqlite::SqlitePool;
use tokio::sync::{mpsc, oneshot};
use tracing::error;

use super::rows;
use super::space::{RunningGame, Space};
use super::writer::{Pending, Row, WriteCommand};
use crate::decode_pool::DecodePool;
use crate::ephemeral::{Reserved, StoreFinished};
use crate::form;
use crate::{Journal, StoreError};
use chefshat_room::journal::{Entry, GameHeader};

/// The queue of the writer.
#[derive(Clone)]
pub(super) struct WriteQueue {
    pub(super) queue: mpsc::Sender<Pending>,
    /// The number of the next row of the journal.
    pub(super) next_row: Arc<AtomicI64>,
    pub(super) space: Arc<Space>,
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
    /// Until the game is over.
    pub(super) running: Option<RunningGame>,
    /// Its last row so far.
    pub(super) last_row: Option<i64>,
    /// Whether it was stored by a version of an older encoding, and nothing was added since.
    pub(super) is_of_older_form: bool,
    pub(super) queue: WriteQueue,
    pub(super) readers: SqlitePool,
    pub(super) decoding: DecodePool,
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
            entries: form::entries_to_bytes(entries),
            raises_form: std::mem::take(&mut self.is_of_older_form),
        };
        self.position += 1;
        self.last_row = Some(number);
        row
    }
}

#[async_trait]
impl Journal for DurableJournal {
    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        let row = self.next_row(entries);
        self.queue.send(WriteCommand::Append(row)).await
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        let read = rows::journal(&self.readers, &self.decoding, self.number, self.last_row);
        match read.await? {
            Ok(read) => Ok(read.entries),
            Err(problem) => Err(StoreError::Failed(format!(
                "the journal of game number {} cannot be read back: {problem}",
                self.number
            ))),
        }
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        let finish = WriteCommand::Finish {
            number: self.number,
            // Only an aborted game can end before the deal.
            state: v1::RoomState::Aborted.into(),
            last_row: self.last_row,
            summary,
            signature: signature.as_ref().map(form::signature_to_bytes),
        };
        self.queue.send(finish).await?;
        self.running = None;
        Ok(())
    }
}

/// Where a game is stored when it ends.
pub(super) struct Whole {
    pub(super) _reserved: Reserved,
    pub(super) number: i64,
    pub(super) queue: WriteQueue,
    pub(super) _running: RunningGame,
}

impl StoreFinished for Whole {
    async fn store_finished(
        &self,
        header: &GameHeader,
        entries: Vec<u8>,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<Vec<u8>>,
    ) -> Result<(), StoreError> {
        let Some(summary) = summary else {
            return Ok(());
        };
        let is_single = header.tournament.is_none() && header.study.is_none();
        if is_single && self.queue.space.is_full() {
            // Such a game may be lost, so its players need not wait for the disk.
            error!(game = %header.game_id, "the disk is full: an ephemeral game is not stored");
            return Ok(());
        }
        let game = WriteCommand::Whole {
            number: self.number,
            game_id: header.game_id,
            header: form::header_to_bytes(header),
            row: self.queue.new_row(),
            entries,
            summary,
            signature,
        };
        self.queue.send(game).await
    }
}
