//! The journal of a game that a database stores when it ends. Until then its entries are encoded in
//! memory, which takes a small part of the space, and those of a long game in a file.

use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard};

use chefshat_proto::v1;
use futures::FutureExt as _;
use futures::future::BoxFuture;
use tempfile::TempPath;
use tokio::sync::Semaphore;
use tokio::task::spawn_blocking;
use tracing::{error, warn};

use super::decode_pool::MAX_CONCURRENT_RECORDS;
use super::form;
use super::{Journal, StoreError};
use chefshat_room::ids::Id;
use chefshat_room::journal::{Entry, GameHeader};

/// Most encoded entries of a game that stay in memory, bytes, if its file can be written.
pub(super) const MAX_IN_MEMORY: usize = 64 * 1024;

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

/// Where long games keep their entries until they end: in a file each, which is open only while it is
/// written or read.
#[derive(Clone)]
pub(super) struct Scratch {
    folder: PathBuf,
    /// What the names of the files begin with.
    prefix: &'static str,
    /// Whether there is space besides what others need.
    has_space: Arc<dyn Fn() -> bool + Send + Sync>,
    /// Complete games in memory, on their way into the database.
    loaded: Arc<Semaphore>,
}

impl Scratch {
    /// Files in a folder, written while there is space.
    pub(super) fn new(
        folder: PathBuf,
        prefix: &'static str,
        has_space: impl Fn() -> bool + Send + Sync + 'static,
    ) -> Self {
        Self {
            folder,
            prefix,
            has_space: Arc::new(has_space),
            loaded: Arc::new(Semaphore::new(MAX_CONCURRENT_RECORDS)),
        }
    }

    /// Deletes the files that a process has left that was killed.
    pub(super) fn delete_left_over(&self) -> io::Result<()> {
        for entry in fs::read_dir(&self.folder)? {
            let entry = entry?;
            let name = entry.file_name();
            if name.as_encoded_bytes().starts_with(self.prefix.as_bytes()) {
                fs::remove_file(entry.path())?;
            }
        }
        Ok(())
    }

    /// Creates a file, deleted when the path is dropped.
    fn create(&self) -> io::Result<TempPath> {
        let named = tempfile::Builder::new()
            .prefix(self.prefix)
            .tempfile_in(&self.folder)?;
        Ok(named.into_temp_path())
    }
}

/// The journal of a game that is stored by `whole`.
pub(super) struct EphemeralJournal<W> {
    header: Arc<GameHeader>,
    scratch: Scratch,
    /// The first entries, in a file.
    filed: Filed,
    /// The entries after them.
    encoded: Vec<u8>,
    /// The size at which they are moved to the file, bytes.
    most_in_memory: usize,
    whole: W,
}

/// What of a journal is in its file.
#[derive(Debug, Clone, Default)]
struct Filed {
    file: Option<Arc<TempPath>>,
    bytes: u64,
}

impl Filed {
    /// Adds encoded entries. After an error it has what it had before.
    fn add(&mut self, encoded: &[u8], scratch: &Scratch) -> io::Result<()> {
        if !(scratch.has_space)() {
            return Err(io::ErrorKind::StorageFull.into());
        }
        let path = match &mut self.file {
            Some(path) => path,
            none => none.insert(Arc::new(scratch.create()?)),
        };
        let mut file = OpenOptions::new().write(true).open(&**path)?;
        file.seek(SeekFrom::Start(self.bytes))?;
        file.write_all(encoded)?;
        self.bytes += encoded.len() as u64;
        Ok(())
    }

    /// All entries, with those that are not in the file.
    fn followed_by(&self, encoded: &[u8]) -> io::Result<Vec<u8>> {
        let mut all = Vec::new();
        if let Some(path) = &self.file {
            File::open(&**path)?
                .take(self.bytes)
                .read_to_end(&mut all)?;
        }
        all.extend_from_slice(encoded);
        Ok(all)
    }

    /// Works on all entries, with those that are not in the file.
    async fn with_all<T: Send + 'static>(
        self,
        encoded: Vec<u8>,
        work: impl FnOnce(Vec<u8>) -> T + Send + 'static,
    ) -> Result<T, StoreError> {
        if self.file.is_none() {
            return Ok(work(encoded));
        }
        let reading = spawn_blocking(move || self.followed_by(&encoded).map(work));
        reading.await.map_err(failed)?.map_err(failed)
    }
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
            scratch,
            filed: Filed::default(),
            encoded,
            most_in_memory: MAX_IN_MEMORY,
            whole,
        }
    }

    /// Bytes of encoded entries in memory.
    #[cfg(test)]
    pub(super) fn in_memory(&self) -> usize {
        self.encoded.len()
    }

    /// Moves the entries in memory to the file. If it cannot be written, they stay in memory, and it
    /// is tried again when they are twice as many.
    async fn file_entries(&mut self) -> Result<(), StoreError> {
        let encoded = std::mem::take(&mut self.encoded);
        let (mut filed, scratch) = (self.filed.clone(), self.scratch.clone());
        let writing = spawn_blocking(move || {
            let written = filed.add(&encoded, &scratch);
            (filed, encoded, written)
        });
        let (filed, encoded, written) = writing.await.map_err(failed)?;
        self.filed = filed;
        self.most_in_memory = MAX_IN_MEMORY;
        if let Err(problem) = written {
            let (game, bytes) = (self.header.game_id, encoded.len());
            let folder = self.scratch.folder.display();
            warn!(%game, bytes, %problem, %folder, "a long game that is stored when it ends stays in memory");
            self.most_in_memory = 2 * bytes;
            self.encoded = encoded;
        }
        Ok(())
    }
}

fn failed(problem: impl std::fmt::Display) -> StoreError {
    StoreError::Failed(format!("the file of an unfinished game: {problem}"))
}

impl<W: StoreFinished> Journal for EphemeralJournal<W> {
    fn append_now(&mut self, entries: &mut Vec<Entry>) -> bool {
        let has_room = self.encoded.len() < self.most_in_memory;
        if has_room {
            form::put_entries(entries, &mut self.encoded);
        }
        has_room
    }

    fn append<'a>(
        &'a mut self,
        entries: &'a mut Vec<Entry>,
    ) -> BoxFuture<'a, Result<(), StoreError>> {
        form::put_entries(entries, &mut self.encoded);
        async move {
            if self.encoded.len() >= self.most_in_memory {
                self.file_entries().await?;
            }
            Ok(())
        }
        .boxed()
    }

    fn entries(&mut self) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>> {
        let decode = |encoded: Vec<u8>| {
            let mut entries = Vec::new();
            form::read_entries(&encoded, &mut entries).map(|()| entries)
        };
        async move {
            let (filed, encoded) = (self.filed.clone(), self.encoded.clone());
            let decoded = filed.with_all(encoded, decode).await?;
            decoded.map_err(|problem| StoreError::Failed(problem.to_string()))
        }
        .boxed()
    }

    fn finish(
        &mut self,
        summary: Option<Box<v1::RecordSummary>>,
        signature: Option<v1::RecordSignature>,
    ) -> BoxFuture<'_, Result<(), StoreError>> {
        let filed = std::mem::take(&mut self.filed);
        let encoded = std::mem::take(&mut self.encoded);
        let signature = signature.as_ref().map(form::signature_to_bytes);
        async move {
            let _loaded = match filed.file {
                Some(_) => Some(self.scratch.loaded.acquire().await.map_err(failed)?),
                None => None,
            };
            let entries = filed.with_all(encoded, |all| all).await?;
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
