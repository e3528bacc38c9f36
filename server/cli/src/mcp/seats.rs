//! The seats that the clients of this program have taken, by their handles. A handle stands for a
//! ticket in what a language model reads: it is worth nothing outside of this process.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use chefshat_client::{Client, v1};
use tokio::sync::OnceCell;

use super::seat::Seat;
use crate::CommandError;
use crate::connect::ServerArg;
use crate::language::live::Live;
use crate::narration::view::GameView;

/// Maximum number of seats at a time, those of games that are over included.
const MAX_SEATS: usize = 64;
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
    taken: Mutex<BTreeMap<String, Arc<Seat>>>,
}

impl Seats {
    pub(super) fn new(server: ServerArg, handles: Handles) -> Self {
        Self {
            server,
            client: OnceCell::new(),
            handles,
            taken: Mutex::default(),
        }
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
        self.follow(ticket, GameView::default(), None).await
    }

    /// Joins a room; returns the handle of the seat.
    ///
    /// # Errors
    /// The server does not answer or refuses; too many seats are taken.
    pub(super) async fn join(&self, request: v1::JoinRoomRequest) -> Result<String, CommandError> {
        self.check_space()?;
        let joined = self.client().await?.join(request).await?;
        let view = GameView::of_room(&joined.room.unwrap_or_default());
        self.follow(joined.ticket, view, Some(joined.seat)).await
    }

    async fn follow(
        &self,
        ticket: String,
        view: GameView,
        me: Option<u32>,
    ) -> Result<String, CommandError> {
        self.check_space()?;
        let seat = Seat::follow(self.client().await?, ticket, view, me);
        seat.attached().await?;
        let mut taken = self.taken();
        let handle = match self.handles {
            Handles::Counted => {
                let free = (1_usize..).map(|number| number.to_string());
                let mut free = free.filter(|handle| !taken.contains_key(handle));
                free.next().expect("there are more numbers than seats")
            }
            Handles::Random => hex::encode(rand::random::<[u8; HANDLE_BYTES]>()),
        };
        taken.insert(handle.clone(), seat);
        Ok(handle)
    }

    /// Removes a seat of a game that is over if there is no space.
    fn check_space(&self) -> Result<(), CommandError> {
        let mut taken = self.taken();
        if taken.len() < MAX_SEATS {
            return Ok(());
        }
        let over = taken.iter().find(|(_, seat)| seat.read(Live::is_over));
        let over = over.map(|(handle, _)| handle.clone());
        let handle = over.ok_or_else(|| format!("{MAX_SEATS} seats are taken; leave one"))?;
        taken.remove(&handle);
        Ok(())
    }

    /// A seat by its handle. Without one: the only seat that is taken, or whose game runs.
    ///
    /// # Errors
    /// There is none, or more than one.
    pub(super) fn get(&self, handle: Option<&str>) -> Result<Arc<Seat>, String> {
        let taken = self.taken();
        if let Some(handle) = handle {
            let seat = taken.get(handle).cloned();
            return seat.ok_or_else(|| {
                "There is no such table: join_room returns the handle of the seat.".to_owned()
            });
        }
        if self.must_be_named() {
            return Err("Give `table`, the handle that join_room returned.".to_owned());
        }
        let running = || taken.values().filter(|seat| !seat.read(Live::is_over));
        match (taken.len(), running().count()) {
            (0, _) => Err("You have no seat: call join_room.".to_owned()),
            (1, _) => Ok(taken.values().next().expect("there is one").clone()),
            (_, 1) => Ok(running().next().expect("there is one").clone()),
            _ => {
                let handles: Vec<&str> = taken.keys().map(String::as_str).collect();
                Err(format!("Give `table`, one of {}.", handles.join(", ")))
            }
        }
    }

    /// Forgets a seat.
    pub(super) fn forget(&self, seat: &Arc<Seat>) {
        self.taken().retain(|_, other| !Arc::ptr_eq(other, seat));
    }

    /// The seats with their handles, for a client that has them all; none where several clients may
    /// share this process.
    pub(super) fn listed(&self) -> Vec<(String, Arc<Seat>)> {
        match self.handles {
            Handles::Counted => self.taken().clone().into_iter().collect(),
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
        let seats = std::mem::take(&mut *self.taken());
        for seat in seats.into_values() {
            if let Err(error) = seat.leave().await {
                tracing::warn!("a seat was not given back: {error}");
            }
        }
    }

    fn taken(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Arc<Seat>>> {
        // A panic while the map was locked has left it whole: each change is one call.
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
