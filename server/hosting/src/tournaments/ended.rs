//! Shows what is over and in the memory of no node: the end of a room's game, or a tournament.

use super::Tournaments;
use chefshat_store::StoreError;
use chefshat_store::cluster::Subject;
use chefshat_store::units::UnitKey;

impl Tournaments {
    /// Brings a room or tournament that is over into memory, unless it is there. What cannot be shown
    /// is logged.
    ///
    /// # Errors
    /// The store failed.
    pub async fn show_ended(&self, what: Subject) -> Result<(), StoreError> {
        // Each id has one place, so nothing is read twice at a time.
        let id = match what {
            Subject::Room(id) => id.unit(),
            Subject::Unit(unit) => unit.id(),
        };
        let place = usize::from(id.bytes()[0]) % self.common.reading.len();
        let _reading = self.common.reading[place].lock().await;
        let directory = self.rooms.directory();
        match what {
            Subject::Room(id) => {
                let is_shown = self.rooms.get(id).is_some_and(|room| !room.is_gone());
                if !is_shown && let Some(game) = directory.ended_room(id).await? {
                    self.rooms.show_ended(game).await;
                }
            }
            // It is never over.
            Subject::Unit(UnitKey::Study(_)) => {}
            Subject::Unit(unit @ UnitKey::Tournament(id)) => {
                if self.get(id).is_none()
                    && let Some(stored) = self.rooms.store().unit(unit).await?
                {
                    self.resume(id, stored).await;
                }
            }
        }
        Ok(())
    }
}
