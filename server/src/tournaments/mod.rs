//! The tournaments of a server: creates, finds and resumes them. `chefshat_tournament` decides
//! pairings and results; `task` runs one tournament.

mod by_hand;
mod ended;
mod games;
mod handle;
mod leaderboard;
mod message;
mod shared;
mod table;
mod task;
#[cfg(test)]
mod tests;
mod views;

use std::sync::{Arc, Mutex, MutexGuard};
use std::time::Duration;

use chefshat_record::convert::FieldProblem;
use chefshat_record::pseudonym::{Named, Pseudonym};
use chefshat_tournament::{Change, Entrant, ParticipantKind, SettingsProblem, State, Tournament};
use tokio::sync::{Mutex as AsyncMutex, Notify, mpsc, watch};
use tokio_util::task::TaskTracker;
use tracing::{error, info};

pub use handle::{TableProblem, TournamentHandle};
pub use leaderboard::{Leaderboard, finish};
pub use message::{
    ByHand, ByHandRefusal, Call, Connection, Entry, JoinRefusal, Newcomer, Stopped, Who,
};
pub use shared::ComputeError;

use crate::clock::since_epoch_ms;
use crate::cluster::News;
use crate::config::{MAX_START_AHEAD, MAX_TOURNAMENTS, TOURNAMENT_MAILBOX};
use crate::convert::{self, TournamentPlan};
use crate::limits::{Held, Key, Places, Refused};
use crate::rooms::{CODES_TRIED, Rooms};
use crate::store::StoreError;
use crate::store::tournaments::{StoredTournament, TournamentEntry, TournamentHeader};
use crate::tasks::{LongTask, named, short};
use chefshat_room::ids::{Id, RequestKey, Token, join_code, normal_code, random_bytes};
use handle::TournamentState;
use shared::Shared;
use table::Table;
use task::{Stop, Task};

/// When it is worth trying again to create a tournament.
const RETRY_TOURNAMENTS: Duration = Duration::from_secs(60);
/// Most rooms and tournaments that are over and are read at a time.
const READ_AT_ONCE: usize = 4;

/// Why a tournament was not created.
#[derive(Debug, thiserror::Error)]
pub enum CreateProblem {
    /// A setting is invalid.
    #[error(transparent)]
    Settings(#[from] SettingsProblem),
    /// The limit of tournaments is reached.
    #[error("the server has {0} tournaments that are not over; close one or try later")]
    TooMany(usize),
    /// Its creator has too many tournaments.
    #[error(transparent)]
    Refused(#[from] Refused),
    /// The request id was used for another tournament.
    #[error("this request id was used to create another tournament; draw a new one")]
    RequestIdUsed,
    /// The server is shutting down.
    #[error("the server is shutting down and accepts no new tournaments")]
    ShuttingDown,
    /// The disk has no space for more games.
    #[error("the server's disk is nearly full; the rest is reserved for running games")]
    DiskNearlyFull,
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// The tournaments of a server.
#[derive(Debug)]
pub struct Tournaments {
    rooms: Arc<Rooms>,
    tracker: TaskTracker,
    stop: Stop,
    table: Mutex<Table>,
    /// Notified when the creation of a tournament has ended.
    created: Notify,
    places: Arc<Places>,
    /// Locked while something that is over is read.
    reading: [AsyncMutex<()>; READ_AT_ONCE],
}

impl Tournaments {
    /// Creates an empty set. A shutdown waits for the tasks in `tracker`.
    pub fn new(rooms: Arc<Rooms>, tracker: TaskTracker) -> Arc<Self> {
        let places = Places::new(MAX_TOURNAMENTS, rooms.shares());
        Arc::new(Self {
            rooms,
            tracker,
            stop: Stop::default(),
            table: Mutex::default(),
            created: Notify::new(),
            places,
            reading: Default::default(),
        })
    }

    /// Creates a tournament. Returns it with its owner token.
    ///
    /// # Errors
    /// See [`CreateProblem`].
    pub async fn create(
        self: &Arc<Self>,
        name: &str,
        plan: TournamentPlan,
        request: Option<RequestKey>,
        charged: Key,
    ) -> Result<(Arc<TournamentHandle>, Token), CreateProblem> {
        let core = Tournament::new(plan.core.clone())?;
        if self.stop.no_more_games.is_cancelled() || self.rooms.is_shutting_down() {
            return Err(CreateProblem::ShuttingDown);
        }
        if !self.rooms.store().has_space() {
            return Err(CreateProblem::DiskNearlyFull);
        }
        let owner = request.map_or_else(|| Token::random(Id::random()), |key| key.owner());
        let reservation = loop {
            // A repetition of a request whose tournament is still being created waits for it.
            let created = self.created.notified();
            if let Some(handle) = self.get(owner.room) {
                return match handle.header.owner.matches(&owner.secret) {
                    true => Ok((handle, owner)),
                    false => Err(CreateProblem::RequestIdUsed),
                };
            }
            match Reservation::of(self, owner, charged)? {
                Some(reservation) => break reservation,
                None => created.await,
            }
        };
        check_start(plan.start_at_ms)?;
        // Runs to completion even if the caller is cancelled: a half-created tournament would be
        // stored and restored with the server.
        let creating = self.tracker.spawn(short(
            "one tournament",
            reservation.make(name.to_owned(), plan, core, charged),
        ));
        creating
            .await
            .map_err(|error| StoreError::Failed(format!("creating a tournament failed: {error}")))?
    }

    /// Resumes the tournaments of the store and returns how many are not over. The rooms must be
    /// restored already.
    ///
    /// # Errors
    /// The store failed.
    pub async fn restore(&self) -> Result<usize, StoreError> {
        let stored = self.rooms.store().tournaments(MAX_TOURNAMENTS).await?;
        let mut unfinished = 0;
        for stored in stored {
            unfinished += usize::from(self.resume(stored).await);
        }
        if unfinished > 0 {
            info!(tournaments = unfinished, "tournaments resumed");
        }
        Ok(unfinished)
    }

    /// Resumes a tournament, whose rooms must be restored already. Returns whether it is playing. One
    /// that cannot be resumed is logged and left unchanged.
    pub(crate) async fn resume(&self, stored: StoredTournament) -> bool {
        let id = stored.header.id;
        // A long one takes a while, and others are played meanwhile.
        let restoring = tokio::task::spawn_blocking(move || {
            restored(&stored).map(|(plan, state)| (stored, plan, state))
        });
        let restored = restoring.await;
        match restored.unwrap_or_else(|problem| Err(problem.to_string())) {
            // Another request has shown its end meanwhile.
            Ok(_) if self.get(id).is_some() => false,
            Ok((stored, plan, state)) => {
                let is_playing = state.core.state() == State::Playing;
                let charged = (Key::Tournament(id), None);
                self.start_task(stored.header, stored.rows, plan, state, charged);
                is_playing
            }
            Err(problem) => {
                // The deals it would withhold are unknown.
                self.rooms.withhold(id, true);
                error!(tournament = %id, %problem, "a tournament cannot be resumed; it is left unchanged");
                false
            }
        }
    }

    /// Whether this tournament runs here, or is being created.
    pub(crate) fn runs(&self, id: Id) -> bool {
        let table = self.lock();
        let running = |handle: &Arc<TournamentHandle>| !handle.mailbox.is_closed();
        table.get(id).is_some_and(running) || table.is_in_creation(id)
    }

    /// Makes the task of a tournament end without publishing anything more.
    pub(crate) fn fence(&self, id: Id) {
        if let Some(handle) = self.get(id) {
            handle.end.cancel();
        }
    }

    /// Ends the task of a tournament, and forgets it unless it is over: another node may have it. The
    /// records that it withholds stay withheld here.
    pub(crate) async fn stop_one(&self, id: Id) {
        loop {
            let created = self.created.notified();
            if !self.lock().is_in_creation(id) {
                break;
            }
            created.await;
        }
        let Some(handle) = self.get(id) else { return };
        handle.end.cancel();
        handle.mailbox.closed().await;
        if !handle.is_over() {
            self.lock().remove_id(id);
        }
    }

    /// Stops calling and counting games; those that end from here on count when the server is
    /// restarted.
    pub fn stop(&self) {
        self.stop.no_more_games.cancel();
    }

    /// Ends the tasks of all tournaments.
    pub fn end(&self) {
        self.stop.end.cancel();
    }

    /// The tournament with this id.
    pub fn get(&self, id: Id) -> Option<Arc<TournamentHandle>> {
        self.lock().get(id).cloned()
    }

    /// The tournament with this join code.
    pub fn by_code(&self, code: &str) -> Option<Arc<TournamentHandle>> {
        self.lock().by_code(&normal_code(code)).cloned()
    }

    /// Whether a tournament has announced a game with this id.
    pub fn has_announced(&self, game: Id) -> bool {
        let all: Vec<_> = (self.lock().earlier(None))
            .map(|(_, handle)| Arc::clone(handle))
            .collect();
        let announces = |handle: &Arc<TournamentHandle>| {
            (handle.committed().placed.values()).any(|(_, announced)| *announced == game)
        };
        all.iter().any(announces)
    }

    /// The newest `count` tournaments in this state, or in any; only those created before number
    /// `before`, if set. With their numbers, newest first.
    pub fn newest(
        &self,
        before: Option<u64>,
        state: Option<State>,
        count: usize,
    ) -> Vec<(u64, Arc<TournamentHandle>)> {
        let is_wanted = |handle: &TournamentHandle| {
            state.is_none_or(|state| handle.read(Tournament::state) == state)
        };
        // Read after the table is unlocked: each may be busy for a moment.
        let earlier: Vec<_> = (self.lock().earlier(before))
            .map(|(number, handle)| (number, Arc::clone(handle)))
            .collect();
        let wanted = (earlier.into_iter()).filter(|(_, handle)| is_wanted(handle));
        wanted.take(count).collect()
    }

    /// Whether a participant, other than a built-in agent, is in a tournament that is not over.
    pub fn is_playing(&self, who: &Named) -> bool {
        let is_meant =
            |it: &Entrant| it.built_in.is_none() && who.is(&it.name, &it.name_fingerprint);
        let all = self.newest(None, None, usize::MAX);
        all.iter().any(|(_, handle)| {
            !handle.is_over() && handle.read(|core| core.participants().iter().any(is_meant))
        })
    }

    /// Renames a participant in the tournaments in memory that are over. Returns in how many.
    pub async fn forget(&self, who: &Pseudonym) -> u64 {
        let mut count = 0;
        for (_, handle) in self.newest(None, None, usize::MAX) {
            if handle.is_over() && handle.forget(who) {
                handle.follower_update.clear().await;
                handle.results.clear().await;
                count += 1;
            }
        }
        count
    }

    /// Adds a tournament to the table and starts its task.
    fn start_task(
        &self,
        header: TournamentHeader,
        rows: u64,
        plan: TournamentPlan,
        state: TournamentState,
        (charged, place): (Key, Option<Held>),
    ) -> Arc<TournamentHandle> {
        let (mailbox, inbox) = mpsc::channel(TOURNAMENT_MAILBOX);
        let stop = Stop {
            end: self.stop.end.child_token(),
            ..self.stop.clone()
        };
        let handle = Arc::new(TournamentHandle {
            end: stop.end.clone(),
            header,
            plan,
            charged,
            committed: Mutex::new(state),
            mailbox,
            changes: watch::Sender::new(0),
            follower_update: Shared::default(),
            results: Shared::default(),
        });
        self.lock().enter(Arc::clone(&handle));
        // Before any client can request a record.
        let deals = handle.committed().deals();
        handle.withhold(&deals, &self.rooms);
        if handle.is_over() {
            handle.close_rooms(&self.rooms);
            return handle;
        }
        let task = Task::new(Arc::clone(&handle), Arc::clone(&self.rooms), rows, place);
        let running = named(LongTask::Tournament, task.run(inbox, stop));
        self.tracker.spawn(running);
        handle
    }

    fn lock(&self) -> MutexGuard<'_, Table> {
        (self.table.lock()).expect("no code that holds this lock can panic")
    }
}

/// Checks when a new tournament starts by itself.
fn check_start(at_ms: Option<u64>) -> Result<(), SettingsProblem> {
    let Some(at_ms) = at_ms else { return Ok(()) };
    let now_ms = since_epoch_ms();
    let latest = now_ms.saturating_add(millis(MAX_START_AHEAD));
    let problem = match at_ms {
        at_ms if at_ms <= now_ms => "this time has passed; choose a later one, or none",
        at_ms if at_ms > latest => "more than 366 days ahead; choose an earlier time",
        _ => return Ok(()),
    };
    Err(SettingsProblem {
        field: "start_at_ms",
        problem: problem.to_owned(),
    })
}

fn millis(duration: Duration) -> u64 {
    u64::try_from(duration.as_millis()).unwrap_or(u64::MAX)
}

/// Space in the table for a tournament that is being created.
struct Reservation {
    tournaments: Arc<Tournaments>,
    owner: Token,
    place: Option<Held>,
}

impl Reservation {
    /// Reserves space for the tournament of this owner token; `None` if it is being created or has
    /// just been.
    fn of(
        tournaments: &Arc<Tournaments>,
        owner: Token,
        charged: Key,
    ) -> Result<Option<Self>, CreateProblem> {
        let mut table = tournaments.lock();
        if table.is_in_creation(owner.room) || table.get(owner.room).is_some() {
            return Ok(None);
        }
        let place = tournaments.places.try_take(charged).ok_or(Refused {
            reason: "TOO_MANY_TOURNAMENTS",
            what: "too many tournaments that are not over; close one, or try later",
            limit: tournaments.places.share_of(charged) as u64,
            retry_after: RETRY_TOURNAMENTS,
        })?;
        if !table.reserve(owner.room) {
            return Err(CreateProblem::TooMany(MAX_TOURNAMENTS));
        }
        drop(table);
        let tournaments = Arc::clone(tournaments);
        Ok(Some(Self {
            tournaments,
            owner,
            place: Some(place),
        }))
    }

    async fn make(
        mut self,
        name: String,
        plan: TournamentPlan,
        core: Tournament,
        charged: Key,
    ) -> Result<(Arc<TournamentHandle>, Token), CreateProblem> {
        let place = self.place.take();
        let tournaments = &self.tournaments;
        let owner = self.owner;
        let mut header = TournamentHeader {
            id: owner.room,
            settings: convert::settings_to_proto(&name, &plan),
            created_at_ms: since_epoch_ms(),
            join_code: join_code(),
            owner: owner.hash(),
            deal_secret: random_bytes(),
        };
        let built_in = built_in(&plan).into_iter().map(Change::Joined);
        let entries: Vec<_> = built_in.map(TournamentEntry::Change).collect();
        let store = tournaments.rooms.store();
        let mut codes_left = CODES_TRIED;
        loop {
            let created = store.create_tournament(Arc::new(header.clone()), entries.clone());
            match created.await {
                Err(StoreError::Taken(_)) if codes_left > 1 => {
                    codes_left -= 1;
                    header.join_code = join_code();
                }
                created => break created?,
            }
        }
        let mut state = TournamentState::new(core);
        entries.iter().for_each(|entry| state.apply(entry));
        if let Some(lease) = tournaments.rooms.lease() {
            lease.report(header.id, News::Created { ephemeral: false });
        }
        let charged = (charged, place);
        let handle = tournaments.start_task(header, 1, plan, state, charged);
        Ok((handle, owner))
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        self.tournaments.lock().release(self.owner.room);
        self.tournaments.created.notify_waiters();
    }
}

/// The built-in participants of a tournament, named after their agents, numbered if there are
/// several of one.
fn built_in(plan: &TournamentPlan) -> Vec<Entrant> {
    let mut entrants: Vec<Entrant> = Vec::new();
    for kind in &plan.built_in {
        let same = |other: &&Entrant| other.built_in == Some(*kind);
        let before = entrants.iter().filter(same).count();
        let several = plan.built_in.iter().filter(|other| *other == kind).count() > 1;
        entrants.push(Entrant {
            name: match several {
                true => format!("{kind} {}", before + 1),
                false => kind.name(),
            },
            name_fingerprint: String::new(),
            kind: ParticipantKind::Agent,
            built_in: Some(*kind),
            filler: false,
            stateless: true,
            max_games: chefshat_tournament::MAX_GAMES_AT_A_TIME,
            at_table: false,
        });
    }
    entrants
}

/// Restores the state of a stored tournament.
pub(crate) fn restored(
    stored: &StoredTournament,
) -> Result<(TournamentPlan, TournamentState), String> {
    let plan = convert::tournament_plan(&stored.header.settings, [0; 32])
        .map_err(|problem: FieldProblem| problem.to_string())?;
    let core = Tournament::new(plan.core.clone()).map_err(|problem| problem.to_string())?;
    let mut state = TournamentState::new(core);
    stored.entries.iter().for_each(|entry| state.apply(entry));
    Ok((plan, state))
}
