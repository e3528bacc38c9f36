//! The key that signs the records of a server, in its data directory, and signing a game when it
//! ends.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use chefshat_proto::v1;
use chefshat_record::atomic_file::{AtomicFile, WriteError};
use chefshat_record::outcome::{Gathering, Outcome};
use chefshat_record::signature::{PublicKey, SigningKey};
use futures::future::Either;
use tokio::sync::Semaphore;
use tracing::error;

use chefshat_admission::limits::{Background, Key};
use chefshat_room::journal::GameHeader;
use chefshat_store::MAX_CONCURRENT_RECORDS;
use chefshat_store::{Journal, StoreError};
use chefshat_wire::convert;

/// The file of the key in a data directory.
const FILE: &str = "signing-key";
/// Precedes the secret in the file, in hexadecimal digits.
const PREFIX: &str = "ed25519-secret:";

/// A key file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum KeyError {
    /// The file system failed.
    #[error("the key that signs records cannot be used: {0}: {1}")]
    Io(PathBuf, io::Error),
    /// The file has other contents.
    #[error(
        "{0} is not a key that signs records; restore it from a backup, or move it away: the server then creates another key"
    )]
    NotAKey(PathBuf),
    /// Others can read the file.
    #[error("{0} can be read by others, who could sign records with it; run chmod 600 on it")]
    Exposed(PathBuf),
}

/// The key of a data directory; `None` if it has none.
///
/// # Errors
/// The file cannot be used.
pub fn key_of(data_dir: &Path) -> Result<Option<SigningKey>, KeyError> {
    let path = data_dir.join(FILE);
    let failed = |error| KeyError::Io(path.clone(), error);
    let text = match fs::read_to_string(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) if error.kind() == io::ErrorKind::InvalidData => {
            return Err(KeyError::NotAKey(path));
        }
        text => text.map_err(failed)?,
    };
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let metadata = fs::metadata(&path).map_err(failed)?;
        if is_exposed(metadata.mode(), metadata.uid(), metadata.gid()) {
            return Err(KeyError::Exposed(path));
        }
    }
    let mut seed = [0; 32];
    let digits = text.trim_end().strip_prefix(PREFIX);
    match digits.map(|digits| hex::decode_to_slice(digits, &mut seed)) {
        Some(Ok(())) => Ok(Some(SigningKey::from_seed(&seed))),
        _ => Err(KeyError::NotAKey(path)),
    }
}

/// Whether others can read a file of this user and group. If it is root's, a group other than
/// root's may read it, as with PostgreSQL: Kubernetes mounts secrets so.
#[cfg(unix)]
fn is_exposed(mode: u32, user: u32, group: u32) -> bool {
    let readers = match (user, group) {
        (0, 1..) => 0o740,
        _ => 0o700,
    };
    mode & 0o777 & !readers != 0
}

/// The key of a data directory. Creates it, readable only by its owner, if there is none.
///
/// # Errors
/// The file cannot be used.
pub fn key_or_new(data_dir: &Path) -> Result<SigningKey, KeyError> {
    if let Some(key) = key_of(data_dir)? {
        return Ok(key);
    }
    let seed: [u8; 32] = rand::random();
    match create(&data_dir.join(FILE), &seed) {
        Ok(()) => Ok(SigningKey::from_seed(&seed)),
        // If there is a key now, another process was first.
        Err(error) => key_of(data_dir)?.ok_or(KeyError::Io(error.path, error.source)),
    }
}

/// Writes a new key file, unless there is one.
fn create(path: &Path, seed: &[u8; 32]) -> Result<(), WriteError> {
    let mut file = AtomicFile::create_private(path)?;
    file.write_all(format!("{PREFIX}{}\n", hex::encode(seed)).as_bytes())?;
    file.finish_new()
}

/// What the record of a game that has ended says.
#[derive(Debug, Default)]
pub struct ReadRecord {
    /// Its signature, if the server signs.
    pub signature: Option<v1::RecordSignature>,
    /// The outcome of a finished game of a tournament.
    pub outcome: Option<Outcome>,
}

/// Signs games that end, a few at a time. Those that nobody plays wait in the background, so that
/// they delay the end of no other.
#[derive(Clone)]
pub struct Signer {
    key: Option<Arc<SigningKey>>,
    permits: Arc<Semaphore>,
}

impl Signer {
    /// Signs with this key; without one it signs nothing.
    pub fn new(key: Option<Arc<SigningKey>>) -> Self {
        Self {
            key,
            permits: Arc::new(Semaphore::new(MAX_CONCURRENT_RECORDS)),
        }
    }

    /// Its key, if it signs.
    pub fn key(&self) -> Option<Arc<SigningKey>> {
        self.key.clone()
    }

    /// Its public key, if it signs.
    pub fn public(&self) -> Option<PublicKey> {
        self.key.as_ref().map(|key| key.public())
    }

    /// Reads the record of a game that has ended, in the background if given, charged to a caller.
    ///
    /// # Errors
    /// The journal cannot be read.
    pub async fn read(
        &self,
        header: Arc<GameHeader>,
        journal: &mut dyn Journal,
        background: Option<(&Background, Key)>,
    ) -> Result<ReadRecord, StoreError> {
        let (key, has_outcome) = (self.key.clone(), header.tournament.is_some());
        if key.is_none() && !has_outcome {
            return Ok(ReadRecord::default());
        }
        // Before the journal is read: a long one takes much memory.
        let _right = match background {
            Some((background, charged)) => Either::Left(background.slice(charged).await),
            // The semaphore is never closed; if it were, the record would merely not wait.
            None => Either::Right(self.permits.acquire().await.ok()),
        };
        let game = header.game_id;
        let entries = journal.entries().await?;
        let reading = move || {
            let mut gathering = Gathering::default();
            let mut each_line = |sign: &mut dyn FnMut(&v1::RecordLine)| {
                convert::each_record_line(&header, &entries, |line| {
                    sign(&line);
                    if has_outcome {
                        gathering.add(&line);
                    }
                });
            };
            let signature = match key {
                Some(key) => Some(key.sign_each(each_line)),
                None => {
                    each_line(&mut |_| {});
                    None
                }
            };
            ReadRecord {
                signature,
                outcome: gathering.outcome().ok(),
            }
        };
        let read = match background {
            Some((background, _)) => background.run(reading).await,
            None => tokio::task::spawn_blocking(reading).await.ok(),
        };
        if read.is_none() {
            error!(%game, "the record of a game could not be read; it has no signature");
        }
        Ok(read.unwrap_or_default())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt as _;

    use super::*;

    #[test]
    fn a_group_reads_only_keys_that_root_gives_to_it() {
        const ROOT: u32 = 0;
        const SERVER: u32 = 65_532;
        for (mode, user, group, exposed) in [
            (0o600, SERVER, SERVER, false),
            (0o640, SERVER, SERVER, true),
            (0o440, ROOT, SERVER, false),
            (0o460, ROOT, SERVER, true),
            (0o444, ROOT, SERVER, true),
            (0o440, ROOT, ROOT, true),
        ] {
            let found = is_exposed(mode, user, group);
            assert_eq!(found, exposed, "{mode:o} of {user}:{group}");
        }
    }

    #[test]
    fn all_who_create_a_key_at_once_have_the_same() {
        let folder = tempfile::tempdir().expect("a folder");
        for round in 0..20 {
            let folder = folder.path().join(round.to_string());
            fs::create_dir(&folder).expect("a folder");
            let keys = std::thread::scope(|scope| {
                let create = || key_or_new(&folder).expect("a key").public();
                let threads = [(); 8].map(|()| scope.spawn(create));
                threads.map(|it| it.join().expect("no panic"))
            });
            let kept = key_of(&folder).expect("readable").expect("a key").public();
            assert!(keys.iter().all(|key| *key == kept), "{keys:?}, {kept:?}");
        }
    }

    #[test]
    fn a_key_is_created_once_and_only_its_owner_can_read_it() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(key_of(folder.path()).expect("no file").is_none());
        let key = key_or_new(folder.path()).expect("a new key").public();
        assert_eq!(key_or_new(folder.path()).expect("the key").public(), key);
        let path = folder.path().join(FILE);
        let mode = fs::metadata(&path).expect("the file").permissions().mode();
        assert_eq!(mode & 0o777, 0o600);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("its owner");
        assert!(matches!(key_of(folder.path()), Err(KeyError::Exposed(_))));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).expect("its owner");
        for wrong in ["", "ed25519-secret:00", "\u{1}"] {
            fs::write(&path, wrong).expect("written");
            assert!(matches!(
                key_or_new(folder.path()),
                Err(KeyError::NotAKey(_))
            ));
        }
    }
}
