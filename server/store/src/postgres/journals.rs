//! The journals that rooms write to.

use std::sync::Arc;

use async_trait::async_trait;
use chefshat_proto::v1;

use super::appends::Row;
use super::commands::Command;
use super::ends::{End, WholeGame};
use super::reader::Reader;
use super::values::Owned;
use super::writer::Queue;
use crate::ephemeral::StoreFinished;
use crate::form;
use crate::{Journal, StoreError};
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

#[async_trait]
impl Journal for DurableJournal {
    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        self.settle().await?;
        self.unanswered = Some(Arc::new(Row {
            owned: self.owned,
            game: self.number,
            position: self.position,
            entries: form::entries_to_bytes(entries),
        }));
        self.settle().await
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        self.settle().await?;
        self.reader.entries(self.number).await
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        self.settle().await?;
        let finish = Command::Finish {
            owned: self.owned,
            number: self.number,
            rows: self.position,
            end: end(summary, signature.as_ref().map(form::signature_to_bytes)),
        };
        self.commands.commit(Arc::new(finish)).await.map(drop)
    }
}

/// Where a game is stored when it ends.
pub(super) struct Whole {
    pub(super) owned: Owned,
    pub(super) commands: Queue<Command>,
}

impl StoreFinished for Whole {
    async fn store_finished(
        &self,
        header: &GameHeader,
        entries: Vec<u8>,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<Vec<u8>>,
    ) -> Result<(), StoreError> {
        let game = end(summary, signature).map(|end| {
            Box::new(WholeGame {
                game_id: header.game_id,
                header: form::header_to_bytes(header),
                entries,
                end,
            })
        });
        let owned = self.owned;
        let whole = Command::Whole { owned, game };
        self.commands.commit(Arc::new(whole)).await.map(drop)
    }
}

fn end(summary: Option<Box<v1::RecordSummary>>, signature: Option<Vec<u8>>) -> Option<End> {
    summary.map(|summary| End { summary, signature })
}
