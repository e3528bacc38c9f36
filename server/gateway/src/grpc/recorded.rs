//! Reads recorded games for the services, a few at a time and for callers in turns, on threads that
//! give way to those of rooms. The work itself holds its place, so a cancelled call does not make room
//! for another before its work has ended.

use std::sync::Arc;

use chefshat_proto::v1::{self, record_service_client::RecordServiceClient};
use rayon::ThreadPoolBuildError;
use tonic::{Code, Status};

use super::access::refused;
use super::forward::Gateway;
use super::lookup::{Lookup, RecordView};
use super::status::{self, is_elsewhere, is_refusal, owner_unreachable, series_open, status};
use chefshat_admission::access::{Caller, Refusal, Role};
use chefshat_admission::limits::{FairSemaphore, Key, Permit};
use chefshat_base::threads::{Priority, Threads};
use chefshat_hosting::cluster::{FoundBy, Peer};
use chefshat_hosting::config::MAX_PEER_MESSAGE_BYTES;
use chefshat_hosting::rooms::Rooms;
use chefshat_room::ids::{Id, SecretHash};
use chefshat_store::MAX_CONCURRENT_RECORDS;
use chefshat_store::StoreError;

/// The recorded games of a server.
#[derive(Debug, Clone)]
pub struct Recorded {
    lookup: Lookup,
    /// The role that is required to read records.
    required: Role,
    /// Limits how many records are assembled at a time, because they are large.
    places: Arc<FairSemaphore>,
    threads: Arc<Threads>,
}

impl Recorded {
    /// Creates a reader of the recorded games that callers with the role `required` reach.
    ///
    /// # Errors
    /// The operating system cannot start its threads.
    pub fn new(lookup: Lookup, required: Role) -> Result<Self, ThreadPoolBuildError> {
        let places = FairSemaphore::new(MAX_CONCURRENT_RECORDS, lookup.rooms().shares());
        let threads = Threads::new("records", MAX_CONCURRENT_RECORDS, Priority::Batches)?;
        Ok(Self {
            lookup,
            required,
            places,
            threads: Arc::new(threads),
        })
    }

    /// The rooms.
    pub(super) fn rooms(&self) -> &Arc<Rooms> {
        self.lookup.rooms()
    }

    /// What callers reach.
    pub(super) fn lookup(&self) -> &Lookup {
        &self.lookup
    }

    /// Runs `work` on the record of a finished game that a caller may read, with how much of it the
    /// caller sees.
    pub(super) async fn of_game<T: Send + 'static>(
        &self,
        caller: &Caller,
        game_id: &str,
        work: impl FnOnce(Vec<v1::RecordLine>, RecordView) -> T + Send + 'static,
    ) -> Result<T, Status> {
        Refusal::of_role(caller, self.required).map_err(refused)?;
        let unknown = || {
            status(
                Code::NotFound,
                "GAME_UNKNOWN",
                format!("the server has no game {game_id:?}; list its records to see which it has"),
                [("field", "game_id")],
            )
        };
        let game = Id::parse(game_id).ok_or_else(unknown)?;
        let room = self.rooms().room_of(game);
        // The same is read of a game that exists and of one that does not, until it is known that the
        // caller may see it.
        let summary = match self.rooms().store().summary(game).await {
            // Nothing says who else may know that it exists.
            Err(error @ StoreError::Unreadable(_)) if !caller.is_operator() => {
                status::read_failed(error);
                None
            }
            summary => summary.map_err(status::read_failed)?,
        };
        // The end of a game is stored a moment before its room says that it is over.
        if let Some(room) = room.filter(|_| summary.is_none()) {
            self.lookup.room_or(caller, room, unknown).await?;
            return Err(status(
                Code::FailedPrecondition,
                "GAME_RUNNING",
                "this game has not ended; its record is available afterwards",
                [("field", "game_id")],
            ));
        }
        let key = Key::of_caller(caller);
        let may_see = |it: &v1::RecordSummary| self.lookup.may_see_record(caller, it);
        let Some(summary) = summary.filter(may_see) else {
            // It may be running at another node.
            let found_by = FoundBy::Game(game);
            let running = self.lookup.check_not_elsewhere(&found_by, key, || false);
            return running.await.and(Err(unknown()));
        };
        let place = self.places.take(key).await;
        let stored = match self.rooms().store().finished(game).await {
            // Its header, which says who sees it, cannot be read.
            Err(error @ StoreError::Unreadable(_)) => {
                let status = status::read_failed(error);
                let by_summary = self.lookup.lists_by_summary(caller, &summary, None);
                return Err(match by_summary {
                    Some(true) => status,
                    _ => unknown(),
                });
            }
            stored => stored.map_err(status::read_failed)?,
        };
        let stored = stored.ok_or_else(unknown)?;
        // While its tournament runs, only the node that has it knows its tickets and which records
        // it withholds.
        if let Some(game) = stored.tournament()
            && let Err(elsewhere) = self.lookup.tournament_here(game.tournament, key).await
            && !self.rooms().directory().is_over(game.tournament).await
        {
            return Err(elsewhere);
        }
        let view = self.lookup.recorded(caller, &stored, unknown)?;
        if (stored.tournament()).is_some_and(|game| self.rooms().is_withheld(game)) {
            return Err(series_open());
        }
        let working = move || work(stored.lines().into_owned(), view);
        self.in_background(place, working).await
    }

    /// Whether a recorded game is in the lists of a caller.
    pub(super) async fn is_listed(
        &self,
        caller: &Caller,
        summary: &v1::RecordSummary,
        owner: Option<&SecretHash>,
    ) -> Result<bool, Status> {
        match self.lookup.lists_by_summary(caller, summary, owner) {
            Some(known) => Ok(known),
            None => {
                let _place = self.places.take(Key::of_caller(caller)).await;
                self.lookup.lists_by_game(caller, summary).await
            }
        }
    }

    /// The record of a finished game as `seen` makes it, for a call that cannot be sent to another
    /// node. If one runs the game's tournament, it is what that node shows the caller.
    pub(super) async fn lines(
        &self,
        caller: &Caller,
        gateway: Option<&Gateway>,
        game_id: &str,
        seen: impl FnOnce(Vec<v1::RecordLine>, RecordView) -> Vec<v1::RecordLine> + Send + 'static,
    ) -> Result<Vec<v1::RecordLine>, Status> {
        let here = self.of_game(caller, game_id, seen).await;
        let (Err(status), Some(gateway)) = (&here, gateway) else {
            return here;
        };
        let Some(elsewhere) = is_elsewhere(status) else {
            return here;
        };
        let lines = record_at(&elsewhere.peer, gateway, game_id).await;
        lines.map_err(|status| match is_refusal(&status) {
            true => status,
            false => {
                gateway.forget(elsewhere);
                owner_unreachable()
            }
        })
    }

    /// Runs work that needs as much memory as a record.
    pub(super) async fn with_place<T: Send + 'static>(
        &self,
        key: Key,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        self.in_background(self.places.take(key).await, work).await
    }

    /// Runs work that takes milliseconds on a thread. The place is free when it ends.
    async fn in_background<T: Send + 'static>(
        &self,
        place: Permit,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Status> {
        let working = self.threads.run(move || {
            let _place = place;
            work()
        });
        // It folds what is stored, so that a failure means that this cannot be read.
        let failed = || StoreError::Unreadable("work on a record was given up".to_owned());
        working.await.ok_or_else(|| status::read_failed(failed()))
    }
}

/// The record of a game, as another node shows it to the caller.
async fn record_at(
    peer: &Peer,
    gateway: &Gateway,
    game: &str,
) -> Result<Vec<v1::RecordLine>, Status> {
    let channel = gateway.peers().channel(peer);
    let mut service =
        RecordServiceClient::new(channel).max_decoding_message_size(MAX_PEER_MESSAGE_BYTES);
    let request = v1::GetRecordRequest {
        game_id: game.to_owned(),
    };
    let mut responses = (service.get_record(gateway.request(request)).await?).into_inner();
    let mut lines = Vec::new();
    while let Some(response) = responses.message().await? {
        lines.extend(response.lines);
    }
    Ok(lines)
}
