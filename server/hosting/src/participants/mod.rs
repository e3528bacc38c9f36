//! The data of a participant, known by its name and, if it has one, the fingerprint of its key:
//! exports and deletes what is stored about it. [`ParticipantData`] does so with a store and a data
//! directory; [`Participants`] also with what a running server has in memory.

mod data;
mod delete;
mod export;
mod files;
mod stored_studies;

use std::collections::BTreeSet;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

use chefshat_record::pseudonym::{Named, Pseudonym};
use tokio::sync::{Mutex, mpsc};
use tracing::info;

pub use data::{DataError, ParticipantData};
pub use delete::Deleted;
pub use files::Skipped;

use chefshat_room::ids::{GameId, StudyId};

use crate::rooms::Rooms;
use crate::studies::{NotDone, Studies};
use crate::tournaments::Tournaments;
use chefshat_store::{ForgetError, StoreError};

/// The studies of other nodes of a cluster.
pub trait StudiesElsewhere: Sync {
    /// Deletes the data of a participant of a study.
    fn delete_participant(
        &self,
        study: StudyId,
        number: u32,
    ) -> impl Future<Output = Result<(), DataError>> + Send;
}

/// The participants of a running server.
pub struct Participants {
    data: ParticipantData,
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
    studies: Arc<Studies>,
    /// Locked while one is deleted.
    deleting: Mutex<()>,
}

impl Participants {
    /// Those of these rooms, tournaments and studies.
    pub fn new(rooms: Arc<Rooms>, tournaments: Arc<Tournaments>, studies: Arc<Studies>) -> Self {
        let data_dir = rooms.record_writer().data_dir().map(PathBuf::from);
        Self {
            data: ParticipantData::new(Arc::clone(rooms.store()), data_dir)
                .signing_with(rooms.signer().key()),
            rooms,
            tournaments,
            studies,
            deleting: Mutex::default(),
        }
    }

    /// See [`ParticipantData::export`].
    ///
    /// # Errors
    /// As there.
    pub async fn export(
        &self,
        who: &Named,
        sender: &mpsc::Sender<String>,
    ) -> Result<Skipped, DataError> {
        self.data.export(who, sender).await
    }

    /// Deletes a participant's data from the store, the files and the memory of this server. Its
    /// participation in studies ends, with their games.
    ///
    /// # Errors
    /// A game or tournament with the name is not over, or the store or the folder of records
    /// failed.
    pub async fn delete(
        &self,
        who: &Named,
        elsewhere: &impl StudiesElsewhere,
    ) -> Result<Deleted, DataError> {
        let _deleting = self.deleting.lock().await;
        self.check(who).await?;
        let mut studies = 0;
        for (stored, number) in self.data.in_studies(who).await? {
            let id = stored.header.id;
            match self.studies.get(id).filter(|study| !study.is_stopped()) {
                Some(study) => {
                    // It needs no memory, and refuses only unknown participants, who have no data.
                    match study.withdraw(number, true).await {
                        Err(NotDone::Stopped(_)) => return Err(DataError::ShuttingDown),
                        Err(problem @ NotDone::Files) => {
                            return Err(io::Error::other(problem).into());
                        }
                        _ => {}
                    }
                }
                None => elsewhere.delete_participant(id, number).await?,
            }
            studies += 1;
        }
        // Samples of games that are over may still be on their way.
        let games = self.games_with(who).await;
        let refusing = self.rooms.samples().refuse(games).await;
        refusing.map_err(|error| StoreError::Failed(error.to_string()))?;
        // No record that was read before is written after.
        let writing = self.rooms.record_writer().pause().await;
        let mut deleted = self.data.delete_from_games(who).await?;
        drop(writing);
        let renamed = Pseudonym {
            of: who.clone(),
            pseudonym: deleted.pseudonym.clone(),
            key: None,
        };
        let renamed = self.tournaments.forget(&renamed).await;
        deleted.tournaments = deleted.tournaments.max(renamed);
        deleted.studies = studies;
        self.hide_rooms(who, &deleted.stored_games).await;
        self.rooms.count_forgotten();
        info!(
            games = deleted.games,
            tournaments = deleted.tournaments,
            studies,
            "the data of a participant were deleted"
        );
        Ok(deleted)
    }

    /// Refuses the deletion of a participant who plays here, when another node of the cluster is to
    /// delete it: only this one knows its ephemeral games.
    ///
    /// # Errors
    /// A game or tournament with the name is not over.
    pub async fn check(&self, who: &Named) -> Result<(), DataError> {
        if self.plays(who).await || self.plays_with_others(who) {
            return Err(ForgetError::GameRunning(who.name.clone()).into());
        }
        if self.tournaments.is_playing(who) {
            return Err(ForgetError::TournamentRunning(who.name.clone()).into());
        }
        Ok(())
    }

    /// Removes a participant from the memory of this node, after another one has put the pseudonym
    /// into the database.
    pub async fn forget_here(&self, who: &Pseudonym) {
        let _deleting = self.deleting.lock().await;
        self.tournaments.forget(who).await;
        self.hide_rooms(&who.of, &BTreeSet::new()).await;
        self.rooms.count_forgotten();
        info!("a participant that another node deleted is removed from memory");
    }

    /// Whether the participant has a seat in a room that is not over, other than those of studies.
    async fn plays(&self, who: &Named) -> bool {
        for room in self.rooms.all(false) {
            let header = self.rooms.header(room.id());
            let is_of_study = header.is_some_and(|header| header.study.is_some());
            if !is_of_study
                && let Ok(room) = room.describe().await
                && has_seat(&room, who)
            {
                return true;
            }
        }
        false
    }

    /// Whether the participant has a game of a study that others play, too: it is over before it can be
    /// deleted.
    fn plays_with_others(&self, who: &Named) -> bool {
        let studies = self.studies.earlier(None).into_iter();
        let mut studies = studies.map(|(_, study)| study);
        studies.any(|study| {
            study.read(|study| {
                let mut participants = study.participants().iter();
                participants.any(|(number, it)| {
                    who.is(&it.pseudonym, "") && study.plays_with_others(*number)
                })
            })
        })
    }

    /// The games that are over and whose rooms show the participant.
    async fn games_with(&self, who: &Named) -> Vec<GameId> {
        let mut games = Vec::new();
        for handle in self.rooms.all(true) {
            if let Some(header) = self.rooms.header(handle.id())
                && let Ok(room) = handle.describe().await
                && has_seat(&room, who)
            {
                games.push(header.game_id);
            }
        }
        games
    }

    /// Removes the rooms that are over and show the participant.
    async fn hide_rooms(&self, who: &Named, changed: &BTreeSet<GameId>) {
        for handle in self.rooms.all(true) {
            let header = self.rooms.header(handle.id());
            let is_changed = header.is_some_and(|it| changed.contains(&it.game_id));
            let shows = match handle.describe().await {
                Ok(room) => has_seat(&room, who),
                Err(_) => false,
            };
            if is_changed || shows {
                self.rooms.forget(handle.id());
            }
        }
    }
}

fn has_seat(room: &chefshat_proto::v1::Room, who: &Named) -> bool {
    room.seats.iter().any(|seat| who.is_at(seat))
}

impl std::fmt::Debug for Participants {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_struct("Participants")
            .finish_non_exhaustive()
    }
}
