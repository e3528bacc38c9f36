//! The journal of a game that a database stores when it ends. Until then its entries are in memory,
//! encoded, which takes a small part of the space.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard};

use chefshat_proto::v1;
use futures::FutureExt as _;
use futures::future::{BoxFuture, ready};
use tracing::error;

use super::form;
use super::{Journal, StoreError};
use chefshat_room::ids::Id;
use chefshat_room::journal::{Entry, GameHeader};

/// The ids of games that are stored when they end, of records that are being imported, and of games
/// that are being created. Nothing else can take them meanwhile.
#[derive(Debug, Clone, Default)]
pub(super) struct Reservations(Arc<Mutex<BTreeSet<Id>>>);

/// A reserved id, free again when this is dropped.
#[derive(Debug)]
pub(super) struct Reserved {
    all: Reservations,
    game: Id,
}

impl Reservations {
    /// Reserves the id of a game, unless it is reserved.
    pub(super) fn take(&self, game: Id) -> Option<Reserved> {
        self.lock().insert(game).then(|| Reserved {
            all: self.clone(),
            game,
        })
    }

    fn lock(&self) -> MutexGuard<'_, BTreeSet<Id>> {
        (self.0.lock()).expect("no code that holds this lock can panic")
    }
}

impl Drop for Reserved {
    fn drop(&mut self) {
        self.all.lock().remove(&self.game);
    }
}

/// Stores one game when it has ended.
pub(super) trait StoreFinished: Send + Sync + 'static {
    /// Stores its header and encoded entries. A game without a summary has no record; only that it
    /// is over counts.
    fn store_finished<'a>(
        &'a self,
        header: &'a GameHeader,
        entries: Vec<u8>,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<Vec<u8>>,
    ) -> BoxFuture<'a, Result<(), StoreError>>;
}

/// The journal of a game that is stored by `whole`.
pub(super) struct EphemeralJournal<W> {
    header: Arc<GameHeader>,
    encoded: Vec<u8>,
    whole: W,
}

impl<W> EphemeralJournal<W> {
    /// A journal that begins with these encoded entries.
    pub(super) fn new(header: Arc<GameHeader>, encoded: Vec<u8>, whole: W) -> Self {
        Self {
            header,
            encoded,
            whole,
        }
    }
}

impl<W: StoreFinished> Journal for EphemeralJournal<W> {
    fn append_now(&mut self, entries: &mut Vec<Entry>) -> bool {
        form::put_entries(entries, &mut self.encoded);
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
        signature: Option<v1::RecordSignature>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        let entries = std::mem::take(&mut self.encoded);
        let signature = signature.as_ref().map(form::signature_to_bytes);
        async move {
            let stored = (self.whole).store_finished(&self.header, entries, summary, signature);
            match stored.await {
                // The game was played anyway; the record that was stored first stays.
                Err(StoreError::Taken(game)) => {
                    error!(%game, "another record has the id of this game; the game is not stored");
                    Ok(())
                }
                stored => stored,
            }
        }
        .boxed()
    }
}
