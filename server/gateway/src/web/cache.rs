//! What was generated for a game, kept for a short time: it is generated once for all that ask at
//! the same time or soon after. Kept no longer, because a record may be deleted or lose a name; what
//! was made before a deletion on this server is not shown at all.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use chefshat_base::lock::Lock;
use chefshat_room::ids::GameId;
use tokio::sync::OnceCell;
use tokio::time::Instant;

/// How long a value is kept.
pub(super) const KEPT_FOR: Duration = Duration::from_secs(60);

/// A game, and the number of deletions on this server before its value is made.
pub(super) type Key = (GameId, u64);

/// Values by game.
#[derive(Debug)]
pub(super) struct Cache<T> {
    most: usize,
    entries: Lock<BTreeMap<Key, Entry<T>>>,
}

#[derive(Debug)]
struct Entry<T> {
    value: Arc<OnceCell<Made<T>>>,
    /// How many wait for the value.
    waiting: usize,
}

#[derive(Debug)]
struct Made<T> {
    at: Instant,
    value: T,
}

impl<T: Clone> Cache<T> {
    /// An empty cache that keeps this number of values.
    pub(super) fn new(most: usize) -> Self {
        Self {
            most,
            entries: Lock::default(),
        }
    }

    /// The value of a game, if it is kept.
    pub(super) fn find(&self, game: Key) -> Option<T> {
        let entries = self.entries.lock();
        let made = entries.get(&game)?.value.get()?;
        (made.at.elapsed() < KEPT_FOR).then(|| made.value.clone())
    }

    /// The value of a game. If it is neither kept nor being made, `make` makes it; a failure is not
    /// kept, and the next one that waits tries again.
    pub(super) async fn get<E>(
        &self,
        game: Key,
        make: impl Future<Output = Result<T, E>>,
    ) -> Result<T, E> {
        let making = async {
            let value = make.await?;
            let at = Instant::now();
            Ok(Made { at, value })
        };
        let flight = self.join(game);
        let made = flight.value.get_or_try_init(|| making).await?;
        Ok(made.value.clone())
    }

    fn join(&self, game: Key) -> Flight<'_, T> {
        let mut entries = self.entries.lock();
        entries.retain(|_, entry| {
            let is_old = |made: &Made<T>| made.at.elapsed() >= KEPT_FOR;
            entry.waiting > 0 || !entry.value.get().is_some_and(is_old)
        });
        let entry = entries.entry(game).or_insert_with(|| Entry {
            value: Arc::default(),
            waiting: 0,
        });
        entry.waiting += 1;
        let value = Arc::clone(&entry.value);
        let cache = self;
        Flight { cache, game, value }
    }

    /// One of those that wait for a value has it, or has given up.
    fn leave(&self, game: Key) {
        let mut entries = self.entries.lock();
        let Some(entry) = entries.get_mut(&game) else {
            return;
        };
        entry.waiting -= 1;
        if entry.waiting == 0 && !entry.value.initialized() {
            entries.remove(&game);
        }
        while entries.len() > self.most {
            let kept = entries.iter().filter(|(_, entry)| entry.waiting == 0);
            let oldest = kept.min_by_key(|(_, entry)| entry.value.get().map(|made| made.at));
            let Some(game) = oldest.map(|(game, _)| *game) else {
                return;
            };
            entries.remove(&game);
        }
    }
}

/// One that waits for a value.
struct Flight<'a, T: Clone> {
    cache: &'a Cache<T>,
    game: Key,
    value: Arc<OnceCell<Made<T>>>,
}

impl<T: Clone> Drop for Flight<'_, T> {
    fn drop(&mut self) {
        self.cache.leave(self.game);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use futures::FutureExt as _;
    use futures::future::{join_all, pending};

    use super::*;

    fn game(number: usize) -> Key {
        let id = GameId::parse(&format!("{number:032x}"));
        (id.expect("an id"), 0)
    }

    #[tokio::test(start_paused = true)]
    async fn nothing_is_shown_that_was_made_before_a_deletion() {
        let cache = Cache::new(2);
        let (id, _) = game(1);
        let before = cache.get((id, 0), pending::<Result<&str, ()>>());
        tokio::pin!(before);
        assert!(before.as_mut().now_or_never().is_none());
        // Nor that was being made, from a record with the name.
        let after = cache.get((id, 1), async { Ok::<_, ()>("P1") });
        assert_eq!(after.await, Ok("P1"));
        assert_eq!(cache.find((id, 0)), None);
        assert_eq!(cache.find((id, 1)), Some("P1"));
        assert_eq!(cache.find((id, 2)), None);
    }

    #[tokio::test(start_paused = true)]
    async fn a_value_is_made_once_for_all_that_ask_until_it_is_old() {
        let (cache, made) = (Cache::new(2), Cell::new(0));
        let make = || async {
            tokio::time::sleep(Duration::from_secs(1)).await;
            made.set(made.get() + 1);
            Ok::<_, ()>(made.get())
        };
        let all = join_all((0..1_000).map(|_| cache.get(game(1), make()))).await;
        assert!(all.iter().all(|value| *value == Ok(1)), "{made:?}");
        assert_eq!(cache.find(game(1)), Some(1));
        tokio::time::advance(KEPT_FOR).await;
        assert_eq!(cache.find(game(1)), None, "it is old");
        assert_eq!(cache.get(game(1), make()).await, Ok(2));
    }

    #[tokio::test(start_paused = true)]
    async fn only_the_newest_values_are_kept() {
        let cache = Cache::new(2);
        for number in 0..1_000 {
            let value = cache.get(game(number), async { Ok::<_, ()>(number) });
            assert_eq!(value.await, Ok(number));
            tokio::time::advance(Duration::from_millis(1)).await;
        }
        assert_eq!(cache.entries.lock().len(), 2);
        assert_eq!(cache.find(game(998)), Some(998));
        assert_eq!(cache.find(game(997)), None);
    }

    #[tokio::test]
    async fn failures_and_those_that_give_up_leave_nothing() {
        let cache = Cache::<()>::new(2);
        assert_eq!(cache.get(game(1), async { Err("no") }).await, Err("no"));
        {
            let mut first = Box::pin(cache.get(game(2), pending::<Result<(), ()>>()));
            let mut second = Box::pin(cache.get(game(2), async { Ok::<_, ()>(()) }));
            assert!(first.as_mut().now_or_never().is_none());
            assert!(
                second.as_mut().now_or_never().is_none(),
                "the first makes it"
            );
            drop(first);
            assert_eq!(second.await, Ok(()), "the next one makes it");
        }
        let given_up = cache.get(game(3), pending::<Result<(), ()>>());
        assert!(given_up.now_or_never().is_none());
        assert_eq!(cache.entries.lock().len(), 1);
    }
}
