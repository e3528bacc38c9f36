//! The games of a unit: their rooms, which it creates once their ids are committed, and their records.

use futures::StreamExt as _;
use tracing::error;

use super::unit::{Journaled, Unit};
use crate::rooms::{CreateError, NewRoom};
use chefshat_room::ids::GameId;
use chefshat_store::{StoreError, StoredGame};

/// Rooms of a unit that are created at a time.
pub(crate) const ROOMS_AT_ONCE: usize = 32;

/// The games that have a room now, and those whose id another game has. Other rooms are tried again.
pub(crate) struct CreatedRooms<G> {
    pub(crate) created: Vec<G>,
    pub(crate) taken: Vec<G>,
}

impl<U: Journaled> Unit<U> {
    /// Creates rooms for games, [`ROOMS_AT_ONCE`] of them at a time, and notes when to try again.
    ///
    /// # Errors
    /// The store failed.
    pub(crate) async fn create_rooms<G>(
        &mut self,
        wanted: Vec<(G, NewRoom)>,
    ) -> Result<CreatedRooms<G>, StoreError> {
        let rooms = &self.rooms;
        let creating =
            (wanted.into_iter()).map(|(game, new)| async { (game, rooms.create(new).await) });
        let creating = futures::stream::iter(creating).buffered(ROOMS_AT_ONCE);
        let rooms: Vec<_> = creating.collect().await;
        let (mut created, mut taken) = (Vec::new(), Vec::new());
        let id = self.id();
        for (game, room) in rooms {
            match room {
                Ok(_) => created.push(game),
                Err(CreateError::Store(StoreError::Taken(_))) => taken.push(game),
                Err(CreateError::Store(error)) => return Err(error),
                Err(error) => self.retry.again(U::KIND, id, &error),
            }
        }
        self.has_changed |= !created.is_empty();
        Ok(CreatedRooms { created, taken })
    }

    /// What `read` finds in the record of a game that has ended, if it has one; `unreadable` if this
    /// version cannot read it. Waits for its turn among long computations.
    ///
    /// # Errors
    /// The store failed.
    pub(crate) async fn read_record<T: Send + 'static>(
        &self,
        game: GameId,
        unreadable: T,
        read: impl FnOnce(StoredGame) -> Option<T> + Send + 'static,
    ) -> Result<Option<T>, StoreError> {
        let background = self.rooms.background();
        // Before it is read: the record of a long game takes much time and memory.
        let _slice = background.slice(self.handle.charged).await;
        let stored = match self.rooms.store().finished(game).await {
            Err(StoreError::Unreadable(problem)) => {
                error!(of = %U::KIND, id = %self.id(), %game, problem, "a game cannot be read, and counts as broken off");
                return Ok(Some(unreadable));
            }
            stored => stored?,
        };
        let Some(stored) = stored else {
            return Ok(None);
        };
        let found = background.run(move || read(stored)).await;
        Ok(found.unwrap_or_else(|| {
            error!(of = %U::KIND, id = %self.id(), %game, "reading a record failed; the game counts as broken off");
            Some(unreadable)
        }))
    }
}
