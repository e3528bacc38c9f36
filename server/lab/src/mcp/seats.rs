//! The seats that the clients of this program have taken, by their handles. A handle stands for a
//! ticket in what a language model reads: it is worth nothing outside of this process.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use chefshat_client::{Client, v1};
use chefshat_record::atomic_file::{AtomicFile, WriteError};
use futures::future::join_all;
use tokio::sync::{OnceCell, OwnedSemaphorePermit, Semaphore, oneshot};
use tokio::time::{sleep, timeout};
use tokio_util::task::TaskTracker;

use super::seat::{ATTACH_TIMEOUT, Seat};
use crate::open_room::OpenRoom;
use chefshat_cli::connect::ServerArg;
use chefshat_cli::error::CommandError;
use chefshat_cli::language::live::Live;
use chefshat_cli::narration::view::GameView;

/// Maximum number of seats at a time, those of games that are over included.
const MAX_SEATS: usize = 64;
/// How long a new seat can still be given back because its client has gone. The end of a connection is
/// noticed a moment later than it happens, and nobody but its client ever hears of the seat.
const NOTICE: Duration = Duration::from_millis(100);
/// Bytes of a random handle.
const HANDLE_BYTES: usize = 8;

/// How seats are named.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Handles {
    /// 1, 2, …: one client has them all.
    Counted,
    /// At random, and always to be given: several clients may share this process, and none may guess
    /// the seat of another.
    Random,
}

/// All seats, and the connection to the server.
pub(super) struct Seats {
    server: ServerArg,
    client: OnceCell<Client>,
    handles: Handles,
    taken: Mutex<BTreeMap<String, Taken>>,
    places: Arc<Semaphore>,
    /// Seats that are being taken or given back, and rooms that are being created or closed.
    working: TaskTracker,
    /// The file that keeps the tickets of games that are not over, one in a line.
    tickets: Option<PathBuf>,
    /// Held while this program runs.
    lock: OnceLock<File>,
}

/// A seat and its place among [`MAX_SEATS`].
struct Taken {
    seat: Arc<Seat>,
    _place: OwnedSemaphorePermit,
}

/// A seat that was taken for a call which has not heard of it yet. Given back when dropped: nobody
/// else knows its handle.
struct Unclaimed {
    seats: Arc<Seats>,
    handle: Option<String>,
}

impl Unclaimed {
    fn claim(mut self) -> String {
        self.handle.take().expect("it is claimed once")
    }
}

impl Drop for Unclaimed {
    fn drop(&mut self) {
        let seat = (self.handle.take()).and_then(|handle| self.seats.taken().remove(&handle));
        if let Some(Taken { seat, .. }) = seat {
            self.seats.keep_tickets();
            self.seats.working.spawn(give_back(seat));
        }
    }
}

impl Seats {
    pub(super) fn new(server: ServerArg, handles: Handles, tickets: Option<PathBuf>) -> Arc<Self> {
        Arc::new(Self {
            tickets,
            lock: OnceLock::new(),
            server,
            client: OnceCell::new(),
            handles,
            taken: Mutex::default(),
            places: Arc::new(Semaphore::new(MAX_SEATS)),
            working: TaskTracker::new(),
        })
    }

    /// Whether each call has to name its table.
    pub(super) fn must_be_named(&self) -> bool {
        self.handles == Handles::Random
    }

    /// The connection to the server, made when it is first used.
    ///
    /// # Errors
    /// The server does not answer.
    pub(super) async fn client(&self) -> Result<&Client, CommandError> {
        self.client.get_or_try_init(|| self.server.connect()).await
    }

    /// Takes the seat of a ticket; returns its handle.
    ///
    /// # Errors
    /// The server does not answer or refuses the ticket; too many seats are taken.
    pub(super) async fn resume(&self, ticket: String) -> Result<String, CommandError> {
        let known = (self.taken().iter())
            .find(|(_, taken)| taken.seat.ticket() == ticket)
            .map(|(handle, _)| handle.clone());
        if let Some(handle) = known {
            return Ok(handle);
        }
        let place = self.place()?;
        let seat = Seat::follow(self.client().await?, ticket, GameView::default(), None);
        seat.attached().await?;
        let handle = self.insert(seat, place);
        self.keep_tickets();
        Ok(handle)
    }

    /// Takes the seats whose tickets the file keeps, but those of games that are over. The file is this
    /// program's as long as it runs.
    ///
    /// # Errors
    /// The file cannot be read or written, or is another program's; or the server does not answer, or
    /// refuses a ticket. The file is unchanged.
    pub(super) async fn resume_kept(&self) -> Result<(), CommandError> {
        let Some(file) = &self.tickets else {
            return Ok(());
        };
        let lock = lock(file)?;
        self.lock.set(lock).expect("this is called once");
        let kept = match std::fs::read_to_string(file) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => String::new(),
            kept => kept.map_err(|error| format!("{}: {error}", file.display()))?,
        };
        let mut seats = Vec::new();
        for ticket in kept.lines().map(str::trim).filter(|it| !it.is_empty()) {
            let (place, client) = (self.place()?, self.client().await?);
            let seat = Seat::follow(client, ticket.to_owned(), GameView::default(), None);
            match seat.attached().await {
                Ok(()) => seats.push((seat, place)),
                Err(refusal) if seat.read(|live| live.is_gone) => {
                    tracing::warn!("a seat is not resumed: {refusal}");
                }
                Err(error) => {
                    let file = file.display();
                    return Err(format!("a seat of {file} is not resumed: {error}").into());
                }
            }
        }
        for (seat, place) in seats {
            self.insert(seat, place);
        }
        Ok(self.write_tickets(file)?)
    }

    /// Writes the tickets to their file, if there is one.
    fn keep_tickets(&self) {
        if let Some(file) = &self.tickets
            && let Err(error) = self.write_tickets(file)
        {
            tracing::warn!("the tickets are not kept: {error}");
        }
    }

    fn write_tickets(&self, path: &Path) -> Result<(), WriteError> {
        let taken = self.taken();
        let seats = taken.values().map(|taken| &taken.seat);
        // A seat whose connection was given up, or that another program has, can be resumed.
        let is_over = |live: &Live| live.view.end.is_some() || live.is_gone;
        let tickets = seats.filter(|seat| !seat.read(is_over));
        let tickets: String = tickets.map(|seat| format!("{}\n", seat.ticket())).collect();
        let mut file = AtomicFile::create_private(path)?;
        file.write_all(tickets.as_bytes())?;
        file.finish()
    }

    /// Creates a room. It is closed unless it is left open, and also if nobody waits for it any more.
    ///
    /// # Errors
    /// The server does not answer or refuses.
    pub(super) async fn create(
        &self,
        request: v1::CreateRoomRequest,
    ) -> Result<(v1::CreateRoomResponse, OpenRoom), CommandError> {
        OpenRoom::create(self.client().await?, &self.working, request).await
    }

    /// Joins a room; returns the handle of the seat. If it fails after the seat was taken, or nobody
    /// waits for it any more, the seat is given back.
    ///
    /// # Errors
    /// The server does not answer or refuses; too many seats are taken.
    pub(super) async fn join(
        self: &Arc<Self>,
        request: v1::JoinRoomRequest,
    ) -> Result<String, CommandError> {
        let place = self.place()?;
        let (sender, joined) = oneshot::channel();
        let seats = Arc::clone(self);
        // The server may have given the seat away when this call is cancelled.
        self.working.spawn(async move {
            let joined = seats.take(request, place).await;
            let unclaimed = joined.map(|handle| Unclaimed {
                seats,
                handle: Some(handle),
            });
            // It fails only if nobody waits.
            let _ = sender.send(unclaimed);
        });
        let joined = joined.await.map_err(|_| "joining failed")?;
        sleep(NOTICE).await;
        joined.map(Unclaimed::claim)
    }

    async fn take(
        &self,
        request: v1::JoinRoomRequest,
        place: OwnedSemaphorePermit,
    ) -> Result<String, CommandError> {
        let client = self.client().await?;
        let joined = client.join(request).await?;
        let view = GameView::of_room(&joined.room.unwrap_or_default());
        let seat = Seat::follow(client, joined.ticket, view, Some(joined.seat));
        let handle = self.insert(Arc::clone(&seat), place);
        self.keep_tickets();
        if let Err(error) = seat.attached().await {
            self.forget(&seat);
            give_back(seat).await;
            return Err(error.into());
        }
        Ok(handle)
    }

    fn insert(&self, seat: Arc<Seat>, place: OwnedSemaphorePermit) -> String {
        let mut taken = self.taken();
        let handle = match self.handles {
            Handles::Counted => {
                let free = (1_usize..).map(|number| number.to_string());
                let mut free = free.filter(|handle| !taken.contains_key(handle));
                free.next().expect("there are more numbers than seats")
            }
            Handles::Random => hex::encode(rand::random::<[u8; HANDLE_BYTES]>()),
        };
        let _place = place;
        taken.insert(handle.clone(), Taken { seat, _place });
        handle
    }

    /// A place for a seat. Removes one of a game that is over if there is none.
    fn place(&self) -> Result<OwnedSemaphorePermit, CommandError> {
        let place = || Arc::clone(&self.places).try_acquire_owned().ok();
        if let Some(place) = place() {
            return Ok(place);
        }
        let mut taken = self.taken();
        let over = taken.iter().find(|(_, it)| it.seat.read(Live::is_over));
        if let Some(handle) = over.map(|(handle, _)| handle.clone()) {
            taken.remove(&handle);
        }
        Ok(place().ok_or_else(|| format!("{MAX_SEATS} seats are taken; leave one"))?)
    }

    /// A seat by its handle. Without one: the only seat that is taken, or whose game runs.
    ///
    /// # Errors
    /// There is none, or more than one.
    pub(super) fn get(&self, handle: Option<&str>) -> Result<Arc<Seat>, String> {
        let taken = self.taken();
        if let Some(handle) = handle {
            let seat = taken.get(handle).map(|it| Arc::clone(&it.seat));
            return seat.ok_or_else(|| {
                "There is no such table: join_room returns the handle of the seat.".to_owned()
            });
        }
        if self.must_be_named() {
            return Err("Give `table`, the handle that join_room returned.".to_owned());
        }
        let all = || taken.values().map(|it| &it.seat);
        let running = || all().filter(|seat| !seat.read(Live::is_over));
        match (taken.len(), running().count()) {
            (0, _) => Err("You have no seat: call join_room.".to_owned()),
            (1, _) => Ok(all().next().expect("there is one").clone()),
            (_, 1) => Ok(running().next().expect("there is one").clone()),
            _ => {
                let handles: Vec<&str> = taken.keys().map(String::as_str).collect();
                Err(format!("Give `table`, one of {}.", handles.join(", ")))
            }
        }
    }

    /// Forgets a seat.
    pub(super) fn forget(&self, seat: &Arc<Seat>) {
        (self.taken()).retain(|_, other| !Arc::ptr_eq(&other.seat, seat));
        self.keep_tickets();
    }

    /// The seats with their handles, for a client that has them all; none where several clients may
    /// share this process.
    pub(super) fn listed(&self) -> Vec<(String, Arc<Seat>)> {
        match self.handles {
            Handles::Counted => (self.taken().iter())
                .map(|(handle, it)| (handle.clone(), Arc::clone(&it.seat)))
                .collect(),
            Handles::Random => Vec::new(),
        }
    }

    /// A client that reads the record of a game. If a listed seat took part, it shows the ticket, with
    /// which a private game is read.
    ///
    /// # Errors
    /// The server does not answer.
    pub(super) async fn client_for(&self, game_id: &str) -> Result<Client, CommandError> {
        let took_part = |seat: &Arc<Seat>| seat.read(|live| live.view.game_id == game_id);
        let mut listed = self.listed().into_iter();
        match listed.find(|(_, seat)| took_part(seat)) {
            Some((_, seat)) => Ok(seat.client()?),
            None => Ok(self.client().await?.clone()),
        }
    }

    /// Gives back the seats of games that have not begun, when the program ends.
    pub(super) async fn leave_all(&self) {
        self.working.close();
        if timeout(ATTACH_TIMEOUT, self.working.wait()).await.is_err() {
            tracing::warn!("a seat may have been taken just now and not given back");
        }
        let seats = std::mem::take(&mut *self.taken());
        let giving_back = join_all(seats.into_values().map(|taken| give_back(taken.seat)));
        if timeout(ATTACH_TIMEOUT, giving_back).await.is_err() {
            tracing::warn!("the server does not answer: seats may not have been given back");
        }
    }

    fn taken(&self) -> MutexGuard<'_, BTreeMap<String, Taken>> {
        // A panic while the map was locked has left it whole: each change is one call.
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Locks a file of tickets, by a file beside it: the file itself is replaced.
fn lock(tickets: &Path) -> Result<File, CommandError> {
    let mut path = tickets.as_os_str().to_owned();
    path.push(".lock");
    let path = PathBuf::from(path);
    let open = || {
        let file = (File::options().write(true).create(true).truncate(false)).open(&path)?;
        file.try_lock().map(|()| file).map_err(io::Error::from)
    };
    open().map_err(|error| match error.kind() {
        io::ErrorKind::WouldBlock => {
            let tickets = tickets.display();
            format!(
                "another program has the seats of {tickets}: give each program a file of its own"
            )
            .into()
        }
        _ => format!("{}: {error}", path.display()).into(),
    })
}

/// Gives a seat back if its game has not begun, and follows it no longer.
async fn give_back(seat: Arc<Seat>) {
    if let Err(error) = seat.leave().await {
        tracing::warn!("a seat was not given back: {error}");
    }
}
