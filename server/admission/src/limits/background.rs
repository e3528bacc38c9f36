//! The games that nobody plays: those of built-in agents alone. They cost far more than the
//! request that starts them, and nobody waits for their decisions. So they are played on threads of
//! their own, which give way to all others, a slice at a time, the games of each caller in turns
//! with those of others, and no faster than a rate that bounds what they write to the disk.

use std::sync::Arc;
use std::time::Duration;

use rayon::ThreadPoolBuildError;

use super::{FairSemaphore, Key, Permit, Rate, Shares};
use chefshat_base::tasks::short;
use chefshat_base::threads::{Priority, Threads};

/// Games of built-in agents that are played at a time; others wait for their first decision.
pub const MAX_GAMES: usize = 32;
/// 1/N of the cores play them.
const CORES: usize = 4;
/// Longest time for which decisions may be made faster than the rate.
pub const BURST: Duration = Duration::from_secs(60);

/// Plays the games of built-in agents.
#[derive(Debug)]
pub struct Background {
    games: Arc<FairSemaphore>,
    slices: Arc<FairSemaphore>,
    rate: Arc<Rate>,
    threads: Threads,
}

/// The right to play one slice of a game.
#[derive(Debug)]
pub struct TimeSlice {
    /// The place of the game, kept until its end.
    pub game: Permit,
    slice: Permit,
}

impl Background {
    /// Starts the threads, which make at most this number of decisions in a second for long.
    ///
    /// # Errors
    /// The operating system cannot start the threads.
    pub fn new(shares: Shares, decisions_per_second: u64) -> Result<Self, ThreadPoolBuildError> {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = (cores / CORES).max(1);
        Ok(Self {
            games: FairSemaphore::new(MAX_GAMES, shares),
            // A caller alone may use all threads: those of others come next.
            slices: FairSemaphore::new(threads, Shares::ALL),
            rate: Arc::new(Rate::new(
                decisions_per_second,
                decisions_per_second.saturating_mul(BURST.as_secs()),
            )),
            threads: Threads::new("background", threads, Priority::Background)?,
        })
    }

    /// Waits for the next slice of a game, and before its first one for a place among the games
    /// that are played.
    pub async fn turn(self: Arc<Self>, key: Key, game: Option<Permit>) -> TimeSlice {
        let game = match game {
            Some(game) => game,
            None => self.games.take(key).await,
        };
        TimeSlice {
            game,
            slice: self.slices.take(key).await,
        }
    }

    /// Plays a slice: `work` returns what it was given and how many decisions it made. `None` if it
    /// panicked.
    pub async fn play<T: Send + 'static>(
        &self,
        turn: TimeSlice,
        work: impl FnOnce() -> (T, u64) + Send + 'static,
    ) -> Option<(T, Permit)> {
        let TimeSlice { game, slice } = turn;
        let (result, decisions) = self.run(work).await?;
        // All games share one rate, so it has one bucket.
        let all = Key::Local;
        self.rate.charge(all, decisions);
        let wait = self.rate.wait(all);
        if wait.is_zero() {
            drop(slice);
        } else {
            tokio::spawn(short("one pause", async move {
                tokio::time::sleep(wait).await;
                drop(slice);
            }));
        }
        Some((result, game))
    }

    /// Waits for the right to do other work of the same kind, such as writing the record of a long
    /// game. Kept until the work has ended.
    pub async fn slice(&self, key: Key) -> Permit {
        self.slices.take(key).await
    }

    /// Runs work on a thread of the pool. `None` if it panicked.
    pub async fn run<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Option<T> {
        self.threads.run(work).await
    }
}
