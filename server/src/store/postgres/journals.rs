//! The journals that rooms write to.

use std::sync::Arc;

use chefshat_proto::v1;
use futures::FutureExt as _;
use futures::future::{BoxFuture, ready};
use tracing::error;

use super::appends::Row;
use super::commands::Command;
use super::ends::{End, WholeGame};
use super::reader::Reader;
use super::values::Owned;
use super::writer::Queue;
use crate::store::form;
use crate::store::{Journal, Signed, StoreError};
use chefshat_room::journal::{Entry, GameHeader};

/// The journal of a game that survives its node.
pub(super) struct DurableJournal {
    pub(super) owned: Owned,
    /// The number of the game.
    pub(super) number: i64,
    /// Where the next row belongs.
    pub(super) position: i64,
    /// The row that was sent last, until it is committed. Another one may only follow it.
    pub(super) unanswered: Option<Arc<Row>>,
    pub(super) rows: Queue<Row>,
    pub(super) commands: Queue<Command>,
    pub(super) reader: Reader,
}

impl DurableJournal {
    /// Commits the row that was sent last, if its sender was cancelled or failed. Whether it was
    /// committed before makes no difference.
    async fn settle(&mut self) -> Result<(), StoreError> {
        if let Some(row) = &self.unanswered {
            self.rows.commit(Arc::clone(row)).await?;
            self.unanswered = None;
            self.position += 1;
        }
        Ok(())
    }
}

impl Journal for DurableJournal {
    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        async move {
            self.settle().await?;
            self.unanswered = Some(Arc::new(Row {
                room: self.owned.id,
                unit: self.owned.unit,
                epoch: self.owned.epoch,
                game: self.number,
                position: self.position,
                entries: encode(entries),
            }));
            self.settle().await
        }
        .boxed()
    }

    fn entries(&mut self) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        async move {
            self.settle().await?;
            self.reader.entries(self.number).await
        }
        .boxed()
    }

    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signed: Option<Signed>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        async move {
            self.settle().await?;
            let finish = Command::Finish {
                owned: self.owned,
                number: self.number,
                rows: self.position,
                end: end(summary, signed),
            };
            self.commands.commit(Arc::new(finish)).await.map(drop)
        }
        .boxed()
    }
}

/// The journal of a game that is stored when it ends. Until then its entries are in memory,
/// encoded, which takes a small part of the space.
pub(super) struct EphemeralJournal {
    pub(super) owned: Owned,
    pub(super) header: Arc<GameHeader>,
    pub(super) encoded: Vec<u8>,
    pub(super) commands: Queue<Command>,
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
        let entries = std::mem::take(&mut self.encoded);
        async move {
            let game = end(summary, signed).map(|end| {
                Box::new(WholeGame {
                    game_id: self.header.game_id,
                    header: form::header_to_bytes(&self.header),
                    entries,
                    end,
                })
            });
            let owned = self.owned;
            let whole = Command::Whole { owned, game };
            match self.commands.commit(Arc::new(whole)).await {
                // The game was played anyway; the record that was stored first stays.
                Err(StoreError::Taken(game)) => {
                    error!(%game, "another record has the id of this game; the game is not stored");
                    Ok(())
                }
                stored => stored.map(drop),
            }
        }
        .boxed()
    }
}

fn end(summary: Option<Box<v1::RecordSummary>>, signed: Option<Signed>) -> Option<End> {
    summary.map(|summary| End {
        summary,
        signature: signed.as_ref().map(form::signed_to_bytes),
    })
}

/// Encodes entries, and leaves `entries` empty.
pub(super) fn encode(entries: &mut Vec<Entry>) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(entries.len() * 32);
    put_all(entries, &mut bytes);
    bytes
}

fn put_all(entries: &mut Vec<Entry>, bytes: &mut Vec<u8>) {
    for entry in entries.drain(..) {
        form::put_entry(&entry, bytes);
    }
}
