//! The space on the disk of a data directory: what running games may still need of it, and what
//! happens when there is none left. A full disk fails no commit: the commit waits, and with it all
//! that would follow from it, until there is space or the server stops. Deletions go first.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use tokio::time::{Instant, sleep};
use tokio_util::sync::CancellationToken;
use tracing::{error, info, warn};

use super::errors::is_full;

/// Disk space reserved for running games: new ones are refused when only this is left. On a small
/// disk this part of the reserve is a share of its size.
const MAX_RESERVE_BYTES: u64 = 64 * 1024 * 1024;
const RESERVE_SHARE: u64 = 50;
/// What is reserved for each running game besides: its journal and the file of its record, which
/// waits if it needs more. Decisions alone, with
/// their times, take about half of it in a long game of the standard rules. Annotations,
/// expressions, markers and samples are not in it: they are refused before the reserve is used.
pub(super) const BYTES_PER_GAME: u64 = 256 * 1024;
/// A disk with less space than this has none: an error of the disk then means that it is full.
const NO_SPACE_BYTES: u64 = 1024 * 1024;
/// How often a commit that found the disk full is tried again.
const RETRY: Duration = Duration::from_secs(1);
/// How often background work checks for space.
const LOOK_AGAIN: Duration = Duration::from_secs(5);
/// How often the operator is reminded of it.
const REMINDER: Duration = Duration::from_secs(60);
/// A file that only takes space: it is given up if the disk is full when the server starts, because
/// even reading a database needs some. Its name begins with that of the database, so no backup has it.
const BALLAST: &str = "games.sqlite3.reserve";
const BALLAST_BYTES: usize = 256 * 1024;

/// The file system of a data directory.
#[derive(Debug)]
pub(super) struct Disk {
    /// Its size.
    bytes: u64,
    /// What programs without privileges can still use of it.
    pub(super) free_bytes: u64,
}

impl Disk {
    /// The file system that contains a path.
    ///
    /// # Errors
    /// The system does not tell.
    pub(super) fn of(path: &Path) -> io::Result<Self> {
        #[cfg(unix)]
        {
            let disk = rustix::fs::statvfs(path)?;
            Ok(Self {
                bytes: disk.f_blocks * disk.f_frsize,
                free_bytes: disk.f_bavail * disk.f_frsize,
            })
        }
        #[cfg(not(unix))]
        {
            let disk = fs4::statvfs(path)?;
            Ok(Self {
                bytes: disk.total_space(),
                free_bytes: disk.available_space(),
            })
        }
    }
}

/// The space of a data directory.
#[derive(Debug)]
pub(super) struct Space {
    data_dir: PathBuf,
    /// Whether commits wait for space.
    is_full: AtomicBool,
    /// Games that may still write.
    games: AtomicUsize,
    stopping: CancellationToken,
}

/// A game that may still write, until it is dropped.
#[derive(Debug)]
pub(super) struct RunningGame(Arc<Space>);

impl Drop for RunningGame {
    fn drop(&mut self) {
        self.0.games.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Space {
    pub(super) fn new(data_dir: &Path) -> Arc<Self> {
        Arc::new(Self {
            data_dir: data_dir.to_path_buf(),
            is_full: AtomicBool::new(false),
            games: AtomicUsize::new(0),
            stopping: CancellationToken::new(),
        })
    }

    /// Counts a game that may still write.
    pub(super) fn game(self: &Arc<Self>) -> RunningGame {
        self.games.fetch_add(1, Ordering::Relaxed);
        RunningGame(Arc::clone(self))
    }

    /// Whether there is space besides the reserve for one more game, or for what no game needs.
    pub(super) fn has_some(&self) -> bool {
        if self.is_full() {
            return false;
        }
        match Disk::of(&self.data_dir) {
            Ok(disk) => {
                let games = self.games.load(Ordering::Relaxed) as u64;
                disk.free_bytes >= reserve(disk.bytes, games)
            }
            // If the free space is unknown, try.
            Err(_) => true,
        }
    }

    /// Waits until `has_some` is true; `false` if the server stops first.
    pub(super) async fn wait_for_some(&self) -> bool {
        while !self.has_some() {
            tokio::select! {
                () = sleep(LOOK_AGAIN) => {}
                () = self.stopping.cancelled() => return false,
            }
        }
        true
    }

    /// Whether an error of a commit means that the disk is full.
    pub(super) fn explains(&self, error: &sqlx::Error) -> bool {
        is_full(error, || {
            Disk::of(&self.data_dir).is_ok_and(|disk| disk.free_bytes < NO_SPACE_BYTES)
        })
    }

    /// Gives up the space that was kept for a start, until there is some again; `false` if there is
    /// none.
    pub(super) fn give_up_ballast(&self) -> bool {
        give_up_ballast(&self.data_dir)
    }

    /// Whether commits wait for space.
    pub(super) fn is_full(&self) -> bool {
        self.is_full.load(Ordering::Relaxed)
    }

    /// The server stops: nothing waits for space any more.
    pub(super) fn stop(&self) {
        self.stopping.cancel();
    }

    /// A commit has found the disk full. Waits until it is worth trying again; `false` if the server
    /// stops.
    pub(super) async fn wait(&self, since: Instant) -> bool {
        if !self.is_full.swap(true, Ordering::Relaxed) {
            error!(
                "the disk is full: free some space; games wait for it, nothing is lost, and durable games cannot be created"
            );
        } else if since.elapsed().as_secs() % REMINDER.as_secs() < RETRY.as_secs() {
            warn!(
                waiting_seconds = since.elapsed().as_secs(),
                "the disk is still full; free some space"
            );
        }
        tokio::select! {
            () = sleep(RETRY) => true,
            () = self.stopping.cancelled() => false,
        }
    }

    /// A commit has succeeded.
    pub(super) fn found(&self) {
        if self.is_full.swap(false, Ordering::Relaxed) {
            if self.has_some() {
                keep_ballast(&self.data_dir);
            }
            info!("there is space on the disk again; games continue");
        }
    }
}

/// What is reserved for this number of running games on a disk of this size, bytes.
fn reserve(size: u64, games: u64) -> u64 {
    MAX_RESERVE_BYTES.min(size / RESERVE_SHARE) + games.saturating_mul(BYTES_PER_GAME)
}

/// Makes sure that a later start finds some space.
pub(super) fn keep_ballast(data_dir: &Path) {
    let path = data_dir.join(BALLAST);
    if path
        .metadata()
        .is_ok_and(|file| file.len() >= BALLAST_BYTES as u64)
    {
        return;
    }
    // Without it the server runs as well.
    let _ = File::create(path).and_then(|mut file| file.write_all(&vec![0xff; BALLAST_BYTES]));
}

/// Gives up the space that was kept for a start; `false` if there is none.
pub(super) fn give_up_ballast(data_dir: &Path) -> bool {
    let path = data_dir.join(BALLAST);
    path.metadata().is_ok_and(|file| file.len() > 0) && std::fs::remove_file(path).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reserve_grows_with_what_runs() {
        const GIB: u64 = 1 << 30;
        assert_eq!(reserve(100 * GIB, 0), MAX_RESERVE_BYTES);
        assert_eq!(
            reserve(100 * GIB, 251),
            MAX_RESERVE_BYTES + 251 * BYTES_PER_GAME
        );
        assert_eq!(reserve(16 << 20, 0), (16 << 20) / RESERVE_SHARE);
    }

    #[test]
    fn a_game_is_counted_until_it_cannot_write_any_more() {
        let folder = tempfile::tempdir().expect("a folder");
        let space = Space::new(folder.path());
        let (one, other) = (space.game(), space.game());
        assert_eq!(space.games.load(Ordering::Relaxed), 2);
        drop(one);
        assert_eq!(space.games.load(Ordering::Relaxed), 1);
        drop(other);
        assert_eq!(space.games.load(Ordering::Relaxed), 0);
    }

    #[tokio::test(start_paused = true)]
    async fn a_full_disk_is_waited_for_until_the_server_stops() {
        let folder = tempfile::tempdir().expect("a folder");
        let space = Space::new(folder.path());
        let since = Instant::now();
        assert!(space.wait(since).await);
        assert!(space.is_full() && !space.has_some());
        let found = async {
            sleep(RETRY).await;
            space.found();
        };
        let (has_some, ()) = tokio::join!(space.wait_for_some(), found);
        assert!(has_some && !space.is_full());
        assert!(space.wait(since).await);
        space.stop();
        assert!(!space.wait(since).await && !space.wait_for_some().await);
    }

    #[test]
    fn the_ballast_is_given_up_once() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(!give_up_ballast(folder.path()));
        keep_ballast(folder.path());
        let size = || folder.path().join(BALLAST).metadata().map(|it| it.len());
        assert_eq!(size().expect("a file"), BALLAST_BYTES as u64);
        assert!(give_up_ballast(folder.path()));
        assert!(!give_up_ballast(folder.path()));
    }
}
