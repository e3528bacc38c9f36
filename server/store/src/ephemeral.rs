//! The journal of a game that a database stores when it ends. Until then its entries are encoded in
//! memory, which takes a small part of the space, and those of a long game in a file.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard};

use async_trait::async_trait;
use chefshat_proto::v1;
use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;
use tracing::{error, warn};

use super::decode_pool::MAX_CONCURRENT_RECORDS;
use super::form;
use super::{Journal, StoreError};
use chefshat_room::ids::GameId;
use chefshat_room::journal::{Entry, GameHeader};

/// Bytes of a block of the file. As many encoded entries of a game stay in memory.
pub(super) const BLOCK: usize = 64 * 1024;

/// The ids of games that are stored when they end, of records that are being imported, and of games
/// that are being created. Nothing else can take them meanwhile.
#[derive(Debug, Clone, Default)]
pub(super) struct Reservations(Arc<Mutex<BTreeSet<GameId>>>);

/// A reserved id, free again when this is dropped.
#[derive(Debug)]
pub(super) struct Reserved {
    all: Reservations,
    game: GameId,
}

impl Reservations {
    /// Reserves the id of a game, unless it is reserved.
    pub(super) fn take(&self, game: GameId) -> Option<Reserved> {
        self.lock().insert(game).then(|| Reserved {
            all: self.clone(),
            game,
        })
    }

    fn lock(&self) -> MutexGuard<'_, BTreeSet<GameId>> {
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
    fn store_finished(
        &self,
        header: &GameHeader,
        entries: Vec<u8>,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<Vec<u8>>,
    ) -> impl Future<Output = Result<(), StoreError>> + Send;
}

/// Where long games keep their entries until they end: one file without a name for all of them, in
/// blocks of [`BLOCK`] bytes.
#[derive(Clone)]
pub(super) struct Scratch(Arc<Blocks>);

struct Blocks {
    folder: PathBuf,
    /// Whether there is space besides what others need.
    has_space: Box<dyn Fn() -> bool + Send + Sync>,
    used: Mutex<Used>,
    /// Complete games in memory, on their way into the database.
    loaded: Semaphore,
}

#[derive(Default)]
struct Used {
    /// Created with the first block.
    file: Option<File>,
    free: Vec<u64>,
    /// Number of blocks of the file.
    count: u64,
}

impl Scratch {
    /// A file in a folder, or in that for temporary files if the folder cannot be written. Blocks
    /// are added while there is space.
    pub(super) fn new(
        folder: PathBuf,
        has_space: impl Fn() -> bool + Send + Sync + 'static,
    ) -> Self {
        Self(Arc::new(Blocks {
            folder,
            has_space: Box::new(has_space),
            used: Mutex::default(),
            loaded: Semaphore::new(MAX_CONCURRENT_RECORDS),
        }))
    }

    fn used(&self) -> MutexGuard<'_, Used> {
        (self.0.used.lock()).expect("no code that holds this lock can panic")
    }

    /// Writes one block; its number.
    fn write(&self, block: &[u8]) -> io::Result<u64> {
        let mut used = self.used();
        let Used { file, free, count } = &mut *used;
        let number = match free.last() {
            Some(number) => *number,
            None if (self.0.has_space)() => *count,
            None => return Err(io::ErrorKind::StorageFull.into()),
        };
        let file = match file {
            Some(file) => file,
            none => {
                let created = tempfile::tempfile_in(&self.0.folder);
                none.insert(created.or_else(|_| tempfile::tempfile())?)
            }
        };
        file.seek(SeekFrom::Start(number * BLOCK as u64))?;
        file.write_all(block)?;
        if free.pop().is_none() {
            *count += 1;
        }
        Ok(number)
    }

    fn read(&self, number: u64, block: &mut [u8]) -> io::Result<()> {
        let mut used = self.used();
        let file = used.file.as_mut().ok_or(io::ErrorKind::NotFound)?;
        file.seek(SeekFrom::Start(number * BLOCK as u64))?;
        file.read_exact(block)
    }

    /// Number of blocks that a game has.
    #[cfg(test)]
    pub(super) fn in_use(&self) -> u64 {
        let used = self.used();
        used.count - used.free.len() as u64
    }
}

/// The blocks of one game, free again when this is dropped.
struct Filed {
    scratch: Scratch,
    blocks: Mutex<Vec<u64>>,
}

impl Drop for Filed {
    fn drop(&mut self) {
        let mut used = self.scratch.used();
        used.free.append(&mut self.blocks());
        // The disk has the space back when no long game is left.
        if used.free.len() as u64 == used.count {
            *used = Used::default();
        }
    }
}

impl Filed {
    fn none(scratch: Scratch) -> Arc<Self> {
        let blocks = Mutex::default();
        Arc::new(Self { scratch, blocks })
    }

    fn blocks(&self) -> MutexGuard<'_, Vec<u64>> {
        (self.blocks.lock()).expect("no code that holds this lock can panic")
    }

    /// Moves whole blocks of encoded entries to the file. What it could not write stays.
    fn add(&self, encoded: &mut Vec<u8>) -> io::Result<()> {
        let mut written = 0;
        let outcome = encoded.chunks_exact(BLOCK).try_for_each(|block| {
            let number = self.scratch.write(block)?;
            self.blocks().push(number);
            written += BLOCK;
            Ok(())
        });
        encoded.drain(..written);
        outcome
    }

    /// All entries, with those that are not in the file.
    fn followed_by(&self, encoded: &[u8]) -> io::Result<Vec<u8>> {
        let blocks = self.blocks();
        let mut all = vec![0; blocks.len() * BLOCK];
        for (number, block) in blocks.iter().zip(all.chunks_exact_mut(BLOCK)) {
            self.scratch.read(*number, block)?;
        }
        all.extend_from_slice(encoded);
        Ok(all)
    }
}

/// The journal of a game that is stored by `whole`.
pub(super) struct EphemeralJournal<W> {
    header: Arc<GameHeader>,
    /// The first entries.
    filed: Arc<Filed>,
    /// The entries after them.
    encoded: Vec<u8>,
    /// The size at which they are moved to the file, bytes.
    most_in_memory: usize,
    whole: W,
}

impl<W> EphemeralJournal<W> {
    /// A journal that begins with these encoded entries.
    pub(super) fn new(
        header: Arc<GameHeader>,
        encoded: Vec<u8>,
        scratch: Scratch,
        whole: W,
    ) -> Self {
        Self {
            header,
            filed: Filed::none(scratch),
            encoded,
            most_in_memory: BLOCK,
            whole,
        }
    }

    /// Bytes of encoded entries in memory.
    #[cfg(test)]
    pub(super) fn in_memory(&self) -> usize {
        self.encoded.len()
    }

    /// Moves the entries in memory to the file. If it cannot be written, they stay in memory, and
    /// it is tried again when they are twice as many.
    async fn file_entries(&mut self) -> Result<(), StoreError> {
        let filed = Arc::clone(&self.filed);
        let mut encoded = std::mem::take(&mut self.encoded);
        let writing = spawn_blocking(move || {
            let written = filed.add(&mut encoded);
            (encoded, written)
        });
        let (encoded, written) = writing.await.map_err(failed)?;
        self.encoded = encoded;
        self.most_in_memory = BLOCK;
        if let Err(problem) = written {
            let (game, bytes) = (self.header.game_id, self.encoded.len());
            warn!(%game, bytes, %problem, "a long game that is stored when it ends stays in memory");
            self.most_in_memory = 2 * bytes;
        }
        Ok(())
    }
}

/// Works on all encoded entries of a game.
async fn with_all<T: Send + 'static>(
    filed: Arc<Filed>,
    encoded: Vec<u8>,
    work: impl FnOnce(Vec<u8>) -> T + Send + 'static,
) -> Result<T, StoreError> {
    if filed.blocks().is_empty() {
        return Ok(work(encoded));
    }
    let reading = spawn_blocking(move || filed.followed_by(&encoded).map(work));
    reading.await.map_err(failed)?.map_err(failed)
}

fn failed(problem: impl std::fmt::Display) -> StoreError {
    StoreError::Failed(format!("the file of an unfinished game: {problem}"))
}

#[async_trait]
impl<W: StoreFinished> Journal for EphemeralJournal<W> {
    fn append_now(&mut self, entries: &mut Vec<Entry>) -> bool {
        let has_room = self.encoded.len() < self.most_in_memory;
        if has_room {
            form::put_entries(entries, &mut self.encoded);
        }
        has_room
    }

    async fn append(&mut self, entries: &mut Vec<Entry>) -> Result<(), StoreError> {
        form::put_entries(entries, &mut self.encoded);
        if self.encoded.len() >= self.most_in_memory {
            self.file_entries().await?;
        }
        Ok(())
    }

    async fn entries(&mut self) -> Result<Vec<Entry>, StoreError> {
        let decode = |encoded: Vec<u8>| {
            let mut entries = Vec::new();
            form::read_entries(&encoded, &mut entries).map(|()| entries)
        };
        let (filed, encoded) = (Arc::clone(&self.filed), self.encoded.clone());
        let decoded = with_all(filed, encoded, decode).await?;
        decoded.map_err(|problem| StoreError::Failed(problem.to_string()))
    }

    async fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> Result<(), StoreError> {
        let scratch = self.filed.scratch.clone();
        let filed = std::mem::replace(&mut self.filed, Filed::none(scratch.clone()));
        let encoded = std::mem::take(&mut self.encoded);
        let signature = signature.as_ref().map(form::signature_to_bytes);
        let is_long = !filed.blocks().is_empty();
        let _loaded = if is_long {
            Some(scratch.0.loaded.acquire().await.map_err(failed)?)
        } else {
            None
        };
        let entries = with_all(filed, encoded, |all| all).await?;
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
}
