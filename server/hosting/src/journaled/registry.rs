//! All units of a kind on this server: creates each once, finds, stops and forgets them.

use std::sync::Arc;

use tokio::sync::Notify;
use tokio_util::task::TaskTracker;
use tracing::{error, info};

use super::actor::{self, Stop};
use super::table::Table;
use super::unit::{Handle, Journaled, New, Unit, UnitHeader as _};
use crate::cluster::UnitEvent;
use crate::rooms::{CreateError, Rooms};
use chefshat_admission::limits::{FairSemaphore, Key, Permit};
use chefshat_base::lock::Lock;
use chefshat_base::tasks::{named, short};
use chefshat_room::ids::{Id, RequestKey, Token, UnitId, normal_code};
use chefshat_store::units::{StoredKind as _, StoredUnit, UnitRow, UnitWrite};
use chefshat_store::{StoreError, units_of};

/// Why a unit of this kind was not created.
type Problem<U> = CreateError<<U as Journaled>::SettingsProblem>;

/// The owner token of what a request creates: repetitions have the same.
pub(crate) fn owner_of<T>(request: Option<RequestKey>) -> Token<T> {
    request.map_or_else(|| Token::random(Id::random()), |key| key.owner())
}

/// The units of a kind on a server.
pub struct Registry<U: Journaled> {
    pub(crate) rooms: Arc<Rooms>,
    pub(crate) tracker: TaskTracker,
    pub(crate) common: U::Common,
    stop: Stop,
    table: Lock<Table<U>>,
    /// Notified when the creation of a unit has ended.
    created: Notify,
    places: Arc<FairSemaphore>,
}

impl<U: Journaled> std::fmt::Debug for Registry<U> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}", U::KIND.plural())
    }
}

impl<U: Journaled> Registry<U> {
    /// Creates an empty set. A shutdown waits for the tasks in `tracker`.
    pub(crate) fn empty(rooms: Arc<Rooms>, tracker: TaskTracker, common: U::Common) -> Arc<Self> {
        let places = FairSemaphore::new(U::MOST, rooms.shares());
        Arc::new(Self {
            rooms,
            tracker,
            common,
            stop: Stop::default(),
            table: Lock::default(),
            created: Notify::new(),
            places,
        })
    }

    /// The rooms of its games.
    pub fn rooms(&self) -> &Arc<Rooms> {
        &self.rooms
    }

    /// Whether new units are accepted now.
    ///
    /// # Errors
    /// They are not.
    fn check_accepting(&self) -> Result<(), Problem<U>> {
        if self.stop.no_more_games.is_cancelled() || self.rooms.is_shutting_down() {
            return Err(CreateError::ShuttingDown);
        }
        if !self.rooms.is_reached() {
            return Err(CreateError::NotReached);
        }
        match self.rooms.store().has_space() {
            true => Ok(()),
            false => Err(CreateError::DiskNearlyFull),
        }
    }

    /// Creates a unit with `make`, which stores it, unless an earlier request with the same owner token
    /// has: then returns that one.
    ///
    /// # Errors
    /// Nothing new is accepted, the request id was used for another one, its creator has too many, or
    /// `make` failed.
    pub(crate) async fn create_once(
        self: &Arc<Self>,
        owner: Token<U::Kind>,
        charged: Key,
        make: impl Future<Output = Result<New<U>, Problem<U>>> + Send + 'static,
    ) -> Result<Arc<Handle<U>>, Problem<U>> {
        let reservation = loop {
            // A repetition of a request whose unit is still being created waits for it.
            let created = self.created.notified();
            if let Some(handle) = self.get(owner.subject) {
                return match handle.is_owner(&owner.to_text()) {
                    true => Ok(handle),
                    false => Err(CreateError::RequestIdUsed),
                };
            }
            match Reservation::of(self, owner.subject.unit(), charged)? {
                Some(reservation) => break reservation,
                None => created.await,
            }
        };
        // Runs to completion even if the caller is cancelled: a half-created unit would be stored
        // without running.
        let creating = self
            .tracker
            .spawn(short("one tournament or study", async move {
                let new = make.await?;
                Ok(reservation.start(new, charged))
            }));
        (creating.await).map_err(|error| {
            StoreError::Failed(format!("creating a {} failed: {error}", U::KIND))
        })?
    }

    /// Stores a new unit, with the entries that its journal begins with, if it begins with a row.
    ///
    /// # Errors
    /// The store failed, or has something with this id or join code.
    pub(crate) async fn store_new(
        &self,
        header: &U::Header,
        first: Option<&[U::Entry]>,
    ) -> Result<(), StoreError> {
        let first = first.map(|entries| UnitRow {
            position: 0,
            entries: U::row_to_bytes(entries),
            over: false,
        });
        let create = UnitWrite::Create {
            join_code: header.join_code().map(str::to_owned),
            header: U::header_to_bytes(header),
            first,
        };
        let unit = U::Kind::key(header.id());
        self.rooms.store().write_unit(unit, create).await
    }

    /// Resumes the units of the store, whose rooms must be restored already. Returns how many are not
    /// over. One that cannot be read is logged and left unchanged.
    ///
    /// # Errors
    /// The store cannot list them.
    pub async fn restore(&self) -> Result<usize, StoreError> {
        let store = self.rooms.store();
        let mut count = 0;
        for id in units_of::<U::Kind>(store.as_ref(), U::MOST).await? {
            match store.unit(U::Kind::key(id)).await {
                Ok(Some(stored)) => {
                    count += usize::from(self.resume(id, stored).await && self.runs(id.unit()));
                }
                Ok(None) => {}
                Err(problem) => self.leave_unchanged(id, &problem.to_string()),
            }
        }
        if count > 0 {
            info!(count, "{} resumed", U::KIND.plural());
        }
        Ok(count)
    }

    /// Resumes a unit, whose rooms must be restored already. Returns whether it is here; one that cannot
    /// be read is logged and left unchanged.
    pub(crate) async fn resume(&self, id: Id<U::Kind>, stored: StoredUnit) -> bool {
        // A long one takes a while, and others are played meanwhile.
        let folding = tokio::task::spawn_blocking(move || U::fold(id, &stored));
        match (folding.await).unwrap_or_else(|problem| Err(problem.to_string())) {
            // Another request has shown its end meanwhile, or it is running.
            Ok(_)
                if self
                    .get(id)
                    .is_some_and(|it| it.is_over() || !it.is_stopped()) =>
            {
                true
            }
            Ok(folded) => {
                // It counts among those of the server; who created it is unknown.
                let charged = U::key_of(id);
                let place = self.places.take_anyway(charged);
                let shared = U::share(&self.common, &folded);
                self.start(New { folded, shared }, charged, place);
                true
            }
            Err(problem) => {
                self.leave_unchanged(id, &problem);
                false
            }
        }
    }

    fn leave_unchanged(&self, id: Id<U::Kind>, problem: &str) {
        U::set_unreadable(id, &self.rooms);
        error!(%id, problem, "a {} cannot be resumed; it is left unchanged", U::KIND);
    }

    /// Adds a unit to the table and starts its task, unless it is over.
    fn start(&self, new: New<U>, charged: Key, place: Permit) -> Arc<Handle<U>> {
        let stop = Stop {
            end: self.stop.end.child_token(),
            ..self.stop.clone()
        };
        let rows = new.folded.rows;
        let (handle, inbox) = Handle::new(new, charged, stop.end.clone());
        U::enter(&handle, &self.rooms);
        self.table.lock().enter(Arc::clone(&handle));
        if !handle.is_over() {
            let unit = Unit::new(Arc::clone(&handle), Arc::clone(&self.rooms), rows, place);
            let running = actor::run(U::new(unit, &self.common), inbox, stop);
            self.tracker.spawn(named(U::TASK, running));
        }
        handle
    }

    /// Whether this unit runs here, or is being created.
    pub(crate) fn runs(&self, unit: UnitId) -> bool {
        let table = self.table.lock();
        let running = |handle: &Arc<Handle<U>>| !handle.is_stopped();
        table.get(unit).is_some_and(running) || table.is_in_creation(unit)
    }

    /// Makes the task of a unit end without publishing anything more.
    pub(crate) fn fence(&self, unit: UnitId) {
        if let Some(handle) = self.by_unit(unit) {
            handle.end.cancel();
        }
    }

    /// Ends the task of a unit, and forgets the unit unless it is over: another node may have it.
    pub async fn stop_one(&self, unit: UnitId) {
        loop {
            let created = self.created.notified();
            if !self.table.lock().is_in_creation(unit) {
                break;
            }
            created.await;
        }
        let Some(handle) = self.by_unit(unit) else {
            return;
        };
        handle.end.cancel();
        handle.mailbox.closed().await;
        if !handle.is_over() {
            self.forget_one(handle.id());
        }
    }

    /// Removes a unit from memory.
    pub(crate) fn forget_one(&self, id: Id<U::Kind>) {
        self.table.lock().remove_id(id.unit());
    }

    /// Stops beginning and counting games; those that end from here on count when the server is
    /// restarted.
    pub fn stop(&self) {
        self.stop.no_more_games.cancel();
    }

    /// Ends the tasks of all units.
    pub fn end(&self) {
        self.stop.end.cancel();
    }

    /// The unit with this id.
    pub fn get(&self, id: Id<U::Kind>) -> Option<Arc<Handle<U>>> {
        self.by_unit(id.unit())
    }

    /// The unit with this id, if it is of this kind.
    pub fn by_unit(&self, unit: UnitId) -> Option<Arc<Handle<U>>> {
        self.table.lock().get(unit).cloned()
    }

    /// The unit with this join code.
    pub fn by_code(&self, code: &str) -> Option<Arc<Handle<U>>> {
        self.table.lock().by_code(&normal_code(code)).cloned()
    }

    /// The units created before number `before`, or all; with their numbers, newest first.
    pub fn earlier(&self, before: Option<u64>) -> Vec<(u64, Arc<Handle<U>>)> {
        (self.table.lock().earlier(before))
            .map(|(number, handle)| (number, Arc::clone(handle)))
            .collect()
    }
}

/// A unit that is being created, and its place.
struct Reservation<U: Journaled> {
    registry: Arc<Registry<U>>,
    id: UnitId,
    place: Option<Permit>,
}

impl<U: Journaled> Reservation<U> {
    /// Reserves a place for a unit; `None` if it is being created or has just been.
    ///
    /// # Errors
    /// Nothing new is accepted, or its creator has too many.
    fn of(
        registry: &Arc<Registry<U>>,
        id: UnitId,
        charged: Key,
    ) -> Result<Option<Self>, Problem<U>> {
        let accepting = registry.check_accepting();
        let mut table = registry.table.lock();
        if table.is_in_creation(id) || table.get(id).is_some() {
            return Ok(None);
        }
        accepting?;
        let places = &registry.places;
        let place = places.try_take(charged);
        let place = place.ok_or_else(|| U::too_many(places.share_of(charged) as u64))?;
        table.reserve(id);
        drop(table);
        Ok(Some(Self {
            registry: Arc::clone(registry),
            id,
            place: Some(place),
        }))
    }

    /// Starts the unit, which is stored by now.
    fn start(mut self, new: New<U>, charged: Key) -> Arc<Handle<U>> {
        let place = self.place.take().expect("it is started once");
        if let Some(lease) = self.registry.rooms.lease() {
            lease.report(self.id, UnitEvent::Created { ephemeral: false });
        }
        self.registry.start(new, charged, place)
    }
}

impl<U: Journaled> Drop for Reservation<U> {
    fn drop(&mut self) {
        self.registry.table.lock().release(self.id);
        self.registry.created.notify_waiters();
    }
}
