//! Shows what is over and in the memory of no node: the end of a room's game, or a tournament.

use super::Tournaments;
use chefshat_room::ids::Id;
use chefshat_store::StoreError;
use chefshat_store::cluster::Kind;
use chefshat_store::units::UnitKind;

impl Tournaments {
    /// Brings a room or tournament that is over into memory, unless it is there. What cannot be shown
    /// is logged.
    ///
    /// # Errors
    /// The store failed.
    pub async fn show_ended(&self, id: Id, kind: Kind) -> Result<(), StoreError> {
        // Each id has one place, so nothing is read twice at a time.
        let place = usize::from(id.0[0]) % self.common.reading.len();
        let _reading = self.common.reading[place].lock().await;
        let directory = self.rooms.directory();
        match kind {
            Kind::Room => {
                let is_shown = self.rooms.get(id).is_some_and(|room| !room.is_gone());
                if !is_shown && let Some(game) = directory.ended_room(id).await? {
                    self.rooms.show_ended(game).await;
                }
            }
            // It is never over.
            Kind::Study => {}
            Kind::Tournament => {
                let unit = UnitKind::Tournament.id(id);
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
