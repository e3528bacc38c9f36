//! How long finished games are kept: deletes the oldest with the files of their records, at an
//! operator's request or on a schedule, and gives their disk space back. The store decides which, and
//! only then are files deleted. A crash in between leaves nothing behind that the next run does not
//! delete.

use std::collections::BTreeSet;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use chefshat_record::atomic_file::{self, AtomicFile, WriteError};
use chefshat_record::jsonl;
use chefshat_room::ids::GameId;
use tokio::sync::Mutex;
use tokio::time::{MissedTickBehavior, interval};
use tracing::{error, info, warn};

use crate::config::{DELETION_PAUSE, GAMES_DELETED_AT_ONCE, KeepGames};
use crate::confirmed_time::ConfirmedTime;
use crate::rooms::Rooms;
use chefshat_base::clock::{TimeOfDay, millis, since_epoch_ms};
use chefshat_base::tasks::short;
use chefshat_store::samples::Undeleted;
use chefshat_store::{DiskUsage, Keep, StoreError};

/// Time between two runs of the schedule.
const INTERVAL: Duration = Duration::from_secs(600);

/// A file of the data directory with the ids of games whose deletion has begun, one a line. It is
/// deleted when none of their files is left.
const PRUNING: &str = "pruning";

/// Which games a setting keeps at a time of day; `None` if that is not confirmed yet and matters.
fn kept_at(setting: KeepGames, confirmed_ms: Option<u64>) -> Option<Keep> {
    Some(match setting {
        KeepGames::Newest(count) => Keep {
            newest: Some(count),
            ..Keep::default()
        },
        KeepGames::For(time) => Keep {
            ended_since_ms: Some(confirmed_ms?.saturating_sub(millis(time))),
            ..Keep::default()
        },
    })
}

/// What was deleted.
#[derive(Debug, Clone, Copy, Default)]
pub struct Pruned {
    /// Number of games.
    pub games: u64,
    /// Bytes that the database and the files take less.
    pub freed_bytes: u64,
}

/// How much is stored.
#[derive(Debug, Clone, Copy, Default)]
pub struct Usage {
    /// The disk of the store.
    pub disk: DiskUsage,
    /// Number of finished games.
    pub finished_games: u64,
    /// Bytes of the files of records.
    pub record_bytes: u64,
    /// Number of these files.
    pub record_files: u64,
}

/// Deletes finished games of a server.
#[derive(Debug, Clone)]
pub struct Retention {
    rooms: Arc<Rooms>,
    now: TimeOfDay,
    /// Locked by the run that deletes: each notes what it deletes in the same file.
    running: Arc<Mutex<()>>,
}

impl Retention {
    /// For the games of these rooms. Their store knows which of them tournaments and studies need.
    pub fn new(rooms: Arc<Rooms>) -> Self {
        Self {
            rooms,
            now: since_epoch_ms,
            running: Arc::default(),
        }
    }

    /// How much is stored.
    ///
    /// # Errors
    /// The store failed.
    pub async fn usage(&self) -> Result<Usage, StoreError> {
        let finished_games = self.rooms.store().finished_games().await?;
        let folder = self.rooms.record_writer().data_dir().map(jsonl::folder_of);
        let looking = tokio::task::spawn_blocking(move || folder.map(|it| size_of(&it)));
        let (record_bytes, record_files) = looking.await.ok().flatten().unwrap_or_default();
        Ok(Usage {
            disk: self.rooms.store().disk().unwrap_or_default(),
            finished_games,
            record_bytes,
            record_files,
        })
    }

    /// Deletes all finished games but those to keep, oldest first.
    ///
    /// # Errors
    /// The store failed. What was deleted until then stays deleted.
    pub async fn prune(&self, keep: Keep) -> Result<Pruned, StoreError> {
        let retention = self.clone();
        // Runs to completion even if the caller is cancelled: what it deletes must be counted.
        let pruning = tokio::spawn(short("one deletion", async move {
            let _running = retention.running.lock().await;
            retention.prune_alone(keep).await
        }));
        (pruning.await)
            .map_err(|error| StoreError::Failed(format!("deleting old games failed: {error}")))?
    }

    async fn prune_alone(&self, keep: Keep) -> Result<Pruned, StoreError> {
        let before = self.usage().await?;
        if let Err(error) = self.delete(self.left_over()).await {
            error!(%error, "completing an earlier deletion failed");
        }
        let deleted = self.delete_but(keep).await;
        // The leaderboard counts only what is left, also if some were deleted and then the store failed.
        if deleted != Ok(0) {
            self.rooms.count_forgotten();
        }
        let games = deleted?;
        let after = self.usage().await?;
        let bytes = |usage: &Usage| usage.disk.bytes + usage.record_bytes;
        let freed_bytes = bytes(&before).saturating_sub(bytes(&after));
        let pruned = Pruned { games, freed_bytes };
        if games > 0 {
            info!(
                games = pruned.games,
                freed_bytes = pruned.freed_bytes,
                "old games deleted"
            );
        }
        Ok(pruned)
    }

    /// Deletes all but those to keep. Returns how many it did.
    async fn delete_but(&self, keep: Keep) -> Result<u64, StoreError> {
        let (mut after, mut count) = (0, 0);
        loop {
            let store = self.rooms.store();
            let found = store.prunable(keep, after, GAMES_DELETED_AT_ONCE).await?;
            let Some((last, _)) = found.last() else {
                return Ok(count);
            };
            after = *last;
            let games: Vec<GameId> = found.into_iter().map(|(_, game)| game).collect();
            count += self.delete(games).await?;
            tokio::time::sleep(DELETION_PAUSE).await;
        }
    }

    /// Deletes those of these games that nothing needs, and their files. Returns how many it did. Files
    /// that the file system keeps are tried again by the next run.
    async fn delete(&self, games: Vec<GameId>) -> Result<u64, StoreError> {
        if games.is_empty() {
            return Ok(0);
        }
        let data_dir = self.rooms.record_writer().data_dir();
        let mut left: BTreeSet<GameId> = self.left_over().into_iter().collect();
        left.retain(|game| !games.contains(game));
        if let Some(data_dir) = data_dir {
            note(data_dir, left.iter().chain(&games));
        }
        let (deleted, mut undeleted) = self.rooms.prune_games(games).await?;
        let count = deleted.len() as u64;
        if let Some(data_dir) = data_dir {
            let folder = data_dir.to_path_buf();
            let deleting = move || {
                let removed = deleted.into_iter().map(|game| {
                    let path = jsonl::path_of(&folder, &game.to_string());
                    let failed = atomic_file::remove(&path).err();
                    failed.map(|error| (game, error))
                });
                removed.flatten().collect::<Undeleted>()
            };
            let records = tokio::task::spawn_blocking(deleting).await;
            undeleted.extend(records.map_err(|error| StoreError::Failed(error.to_string()))?);
            for (game, error) in &undeleted {
                warn!(%game, %error, "a file of a deleted game was not deleted; the next run tries again");
            }
            left.extend(undeleted.keys());
            note(data_dir, left.iter());
        }
        Ok(count)
    }

    /// The games whose deletion an earlier run began and may not have completed.
    fn left_over(&self) -> Vec<GameId> {
        let data_dir = self.rooms.record_writer().data_dir();
        let read = data_dir.and_then(|it| std::fs::read_to_string(it.join(PRUNING)).ok());
        let ids = read.unwrap_or_default();
        ids.lines().filter_map(GameId::parse).collect()
    }

    /// Deletes games on a schedule, until the future is dropped. A game goes by its age once that has
    /// been confirmed for an hour.
    pub async fn follow(self, keep: KeepGames) {
        let mut runs = interval(INTERVAL);
        runs.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut time = ConfirmedTime::default();
        loop {
            runs.tick().await;
            if let Some(keep) = kept_at(keep, time.look((self.now)()))
                && let Err(error) = self.prune(keep).await
            {
                error!(%error, "deleting old games failed");
            }
        }
    }
}

/// Notes the games whose deletion has begun.
fn note<'g>(data_dir: &Path, games: impl Iterator<Item = &'g GameId>) {
    let path = data_dir.join(PRUNING);
    let ids: Vec<String> = games.map(GameId::to_string).collect();
    let noted = match ids.is_empty() {
        true => atomic_file::remove(&path),
        false => write(&path, &ids.join("\n")).map_err(io::Error::other),
    };
    // A disk that is full must not prevent what frees space.
    if let Err(error) = noted {
        warn!(%error, "files of deleted games may be left behind");
    }
}

fn write(path: &Path, text: &str) -> Result<(), WriteError> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(text.as_bytes())?;
    file.finish()
}

/// Bytes and number of the files of a folder.
fn size_of(folder: &Path) -> (u64, u64) {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    files
        .filter_map(|file| file.metadata().ok())
        .filter(|about| about.is_file())
        .fold((0, 0), |(bytes, files), about| {
            (bytes + about.len(), files + 1)
        })
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;
    use std::sync::atomic::Ordering;

    use chefshat_record::samples;
    use chefshat_room::journal::{GameHeader, TournamentGame};
    use chefshat_room::policy::Durability;
    use futures::FutureExt as _;
    use tokio_util::task::TaskTracker;

    use super::*;
    use crate::config::ServerConfig;
    use chefshat_store::testing::{FailingStore, TypedUnits as _, cup, header, summary};
    use chefshat_store::{MemoryStore, Store};

    /// Stores games that are over.
    async fn finished(store: &dyn Store, games: impl IntoIterator<Item = u8>) {
        for game in games {
            let header = header(game, Durability::Durable);
            let created = store.create(Arc::clone(&header), Vec::new()).await;
            let mut journal = created.expect("a new game");
            let finished = journal.finish(Some(summary(&header)), None).await;
            finished.expect("committed");
        }
    }

    #[tokio::test(start_paused = true)]
    async fn deleted_games_are_counted_although_the_store_fails_or_the_caller_leaves() {
        let store = Arc::new(FailingStore::after(u64::MAX));
        // The newest is always kept.
        let count = GAMES_DELETED_AT_ONCE + 2;
        let count = u8::try_from(count).expect("few");
        finished(store.as_ref(), 1..=count).await;
        let rooms = Rooms::for_tests(Arc::clone(&store) as _);
        let retention = Retention::new(Arc::clone(&rooms));
        let newest = Keep {
            newest: Some(1),
            ..Keep::default()
        };
        store.prunes_left.store(1, Ordering::Relaxed);
        let pruned = retention.prune(newest).await;
        assert!(pruned.is_err(), "{pruned:?}");
        assert_eq!(store.finished_games().await, Ok(2));
        assert_eq!(rooms.forgotten(), 1);

        store.prunes_left.store(u64::MAX, Ordering::Relaxed);
        assert!(retention.prune(newest).now_or_never().is_none());
        let pruned = retention.prune(newest).await.expect("the rest");
        assert_eq!(pruned.games, 0, "the first run has deleted it");
        assert_eq!(store.finished_games().await, Ok(1));
        assert_eq!(rooms.forgotten(), 2);
    }

    std::thread_local! {
        /// The time of day of this thread, milliseconds.
        static NOW_MS: Cell<u64> = const { Cell::new(0) };
    }

    #[tokio::test(start_paused = true)]
    async fn a_clock_that_was_ahead_deletes_no_game() {
        const HOUR: Duration = Duration::from_secs(3_600);
        let (day, day_ms) = (24 * HOUR, 24 * 3_600 * 1_000);
        let store: Arc<dyn Store> = Arc::new(MemoryStore::default());
        finished(store.as_ref(), 1..=3).await;
        let rooms = Rooms::for_tests(Arc::clone(&store));
        let retention = Retention {
            now: || NOW_MS.get(),
            ..Retention::new(rooms)
        };
        NOW_MS.set(day_ms);
        let following = tokio::spawn(retention.follow(KeepGames::For(day)));
        let later = async |time| {
            tokio::time::sleep(time).await;
            store.finished_games().await
        };
        assert_eq!(later(3 * HOUR).await, Ok(3), "they are young");
        NOW_MS.set(365 * day_ms);
        assert_eq!(later(HOUR * 3 / 4).await, Ok(3));
        NOW_MS.set(day_ms);
        assert_eq!(later(3 * HOUR).await, Ok(3), "the clock was ahead");
        NOW_MS.set(3 * day_ms);
        assert_eq!(later(2 * HOUR).await, Ok(1), "the newest is always kept");
        following.abort();
    }

    /// What the store keeps, keeps its files, also if it was to be deleted; and what a server that ended
    /// in between has left is deleted by the next run.
    #[tokio::test]
    async fn only_the_files_of_deleted_games_are_deleted() {
        let folder = tempfile::tempdir().expect("a folder");
        let store: Arc<dyn Store> = Arc::new(MemoryStore::default());
        let created = store.create_tournament(Arc::new(cup(7)), Vec::new()).await;
        created.expect("committed");
        for (game, tournament) in [(1, Some(cup(7).id)), (2, None), (3, None)] {
            let header = Arc::new(GameHeader {
                tournament: tournament.map(|tournament| TournamentGame {
                    tournament,
                    series: None,
                }),
                ..GameHeader::clone(&header(game, Durability::Durable))
            });
            let created = store.create(Arc::clone(&header), Vec::new()).await;
            let mut journal = created.expect("a new game");
            let finished = journal.finish(Some(summary(&header)), None).await;
            finished.expect("committed");
            let written = store.mark_record_written(header.game_id).await;
            written.expect("committed");
        }
        let config = ServerConfig {
            data_dir: Some(folder.path().to_path_buf()),
            ..ServerConfig::default()
        };
        let rooms = Rooms::new(&config, Arc::clone(&store), TaskTracker::new()).expect("threads");
        let id = |game: u8| GameId::from_bytes([game; 16]).to_string();
        let files = |game: u8| {
            [
                jsonl::path_of(folder.path(), &id(game)),
                samples::path_of(folder.path(), &id(game), 0),
            ]
        };
        for path in (1..=4).flat_map(files) {
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
            std::fs::write(path, "{}").expect("written");
        }
        let left = |game: u8| files(game).iter().filter(|path| path.exists()).count();
        let retention = Retention::new(rooms);
        let deleted = retention
            .delete(vec![
                GameId::from_bytes([1; 16]),
                GameId::from_bytes([2; 16]),
            ])
            .await;
        assert_eq!(deleted, Ok(1));
        assert_eq!([1, 2, 3, 4].map(left), [2, 0, 2, 2]);

        let newest = Keep {
            newest: Some(1),
            ..Keep::default()
        };
        let pruning = folder.path().join("pruning");
        assert!(!pruning.exists());
        std::fs::write(&pruning, format!("{}\n{}", id(1), id(4))).expect("written");
        retention.prune(newest).await.expect("deleted");
        assert_eq!([1, 2, 3, 4].map(left), [2, 0, 2, 0]);
        assert!(!pruning.exists());

        // A folder with the name of a file cannot be removed as a file; the others are.
        let stuck = files(5);
        std::fs::create_dir_all(&stuck[0]).expect("created");
        for path in [&stuck[1], &files(6)[0]] {
            std::fs::write(path, "{}").expect("written");
        }
        std::fs::write(&pruning, format!("{}\n{}", id(5), id(6))).expect("written");
        retention.prune(newest).await.expect("what can be");
        assert_eq!([5, 6].map(left), [1, 0]);
        assert_eq!(std::fs::read_to_string(&pruning).expect("noted"), id(5));
        std::fs::remove_dir(&stuck[0]).expect("removed");
        retention.prune(newest).await.expect("the rest");
        assert!(!pruning.exists());
    }
}
