//! How rooms are created: their settings, the space that is reserved for them, and their first
//! commit. A request that is repeated gets the room that it created.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Duration;

use chefshat_agents::RecordedPlayer;
use chefshat_engine::{RULES_VERSION, RuleSet, Seat, SeedPlan};

use super::table::{CreateError, Entry};
use super::{CODES_TRIED, Rooms};
use crate::cluster::{Peer, UnitEvent};
use crate::room::{Handle, TaskContext, spawn_room};
use chefshat_admission::limits::{Key, Payer, Permit, Refused};
use chefshat_base::SERVER_VERSION;
use chefshat_base::clock::{RoomClock, since_epoch_ms};
use chefshat_base::tasks::short;
use chefshat_room::Core;
use chefshat_room::ids::{
    GameId, RequestKey, RoomId, RoomToken, Token, UnitId, join_code, random_bytes,
};
use chefshat_room::journal::{
    Fill, GameHeader, GameStart, SeatedParticipant, StudyGame, TournamentGame,
};
use chefshat_room::policy::{Durability, Policy};
use chefshat_store::StoreError;

/// When it is worth trying again to create a room.
const RETRY_ROOMS: Duration = Duration::from_secs(30);

/// The settings of a new room.
#[derive(Debug)]
pub struct NewRoom {
    /// Display name.
    pub name: String,
    /// The rules.
    pub rules: RuleSet,
    /// The policy.
    pub policy: Policy,
    /// What fills each seat.
    pub fills: Vec<Fill>,
    /// Open seats that a person plays as the kind that they are reserved for.
    pub wizards: BTreeSet<usize>,
    /// Display names of built-in agents, by seat, if set.
    pub display_names: BTreeMap<usize, String>,
    /// The recorded players of seats that replay one, by seat.
    pub recorded: BTreeMap<usize, Arc<RecordedPlayer>>,
    /// How its game starts.
    pub start: GameStart,
    /// The game seed, if its creator sets it.
    pub game_seed: Option<[u8; 32]>,
    /// Whether the cards are real.
    pub physical: bool,
    /// The participants seated from the start, if a tournament or study creates the room.
    pub seating: Option<Seating>,
    /// The request for it, if it can be repeated.
    pub request: Option<RequestKey>,
    /// Who is charged for it.
    pub charged: Key,
    /// The caller that creates it; `None` for a tournament or study.
    pub creator: Option<Payer>,
}

#[cfg(any(test, feature = "testing"))]
impl NewRoom {
    /// A room of the standard rules with four open seats, for tests.
    pub fn for_tests() -> Self {
        Self {
            name: "a room".into(),
            rules: chefshat_engine::RuleSetSpec::default()
                .validate()
                .expect("the standard"),
            policy: Policy::default(),
            fills: vec![Fill::Open { reserved_for: None }; 4],
            wizards: BTreeSet::new(),
            display_names: BTreeMap::new(),
            recorded: BTreeMap::new(),
            start: GameStart::default(),
            game_seed: None,
            physical: false,
            seating: None,
            request: None,
            charged: Key::Local,
            creator: None,
        }
    }
}

/// The part of a room's settings that a tournament or study decides.
#[derive(Debug)]
pub struct Seating {
    /// What its game is part of.
    pub part_of: PartOf,
    /// The room's owner token, with the id that the tournament or study has committed before.
    pub owner: RoomToken,
    /// The game's id.
    pub game_id: GameId,
    /// The participants on the open seats.
    pub participants: BTreeMap<usize, SeatedParticipant>,
    /// The server's part of the seed, if several games share the deals.
    pub server_seed: Option<[u8; 32]>,
}

/// What a game is part of.
#[derive(Debug, Clone)]
pub enum PartOf {
    /// A tournament, and perhaps a series.
    Tournament(TournamentGame),
    /// A study.
    Study(Arc<StudyGame>),
}

impl PartOf {
    /// What changes hands with it in a cluster.
    fn unit(&self) -> UnitId {
        match self {
            Self::Tournament(game) => game.tournament.unit(),
            Self::Study(game) => game.study.unit(),
        }
    }

    fn tournament(&self) -> Option<TournamentGame> {
        match self {
            Self::Tournament(game) => Some(*game),
            Self::Study(_) => None,
        }
    }

    fn study(&self) -> Option<&Arc<StudyGame>> {
        match self {
            Self::Tournament(_) => None,
            Self::Study(game) => Some(game),
        }
    }
}

/// A new room with its secrets.
#[derive(Debug)]
pub struct Created {
    /// The handle of the room.
    pub handle: Handle,
    /// The join code.
    pub join_code: String,
    /// The owner token.
    pub owner: RoomToken,
}

impl Rooms {
    /// Creates a room.
    ///
    /// # Errors
    /// There are too many rooms, the server shuts down or is a node that is not reached, or the store
    /// failed.
    pub async fn create(self: &Arc<Self>, new: NewRoom) -> Result<Created, CreateError> {
        let owner = match (&new.seating, &new.request) {
            (Some(seating), _) => seating.owner,
            (None, Some(request)) => request.owner(),
            (None, None) => Token::random(RoomId::random()),
        };
        let reservation = loop {
            // A repetition of a request whose room is still being created waits for it.
            let created = self.created.notified();
            match Reservation::of(self, owner, &new)? {
                Claim::Reserved(reservation) => break reservation,
                Claim::Created(created) => return Ok(created),
                Claim::InProgress => created.await,
            }
        };
        // An ephemeral game can be played without a disk.
        let durable = new.policy.durability == Durability::Durable;
        if durable && !self.context.store.has_space() {
            return Err(CreateError::DiskNearlyFull);
        }
        // Runs to completion even if the caller is cancelled: a half-created room would be stored
        // and belong to nobody.
        let creating = self
            .context
            .tracker
            .spawn(short("one room", reservation.create(new)));
        creating
            .await
            .map_err(|error| StoreError::Failed(format!("creating a room failed: {error}")))?
    }

    /// The node that something new is for, if it is not this one, which is full or much fuller.
    pub async fn place(&self) -> Option<Peer> {
        self.directory.place(self.load()).await
    }

    /// The refusal of one more room of a caller.
    fn too_many_of(&self, key: Key) -> Refused {
        Refused {
            reason: "TOO_MANY_ROOMS",
            what: "too many rooms of one client wait or play; close one, or try later",
            limit: self.places.share_of(key) as u64,
            retry_after: RETRY_ROOMS,
        }
    }

    fn is_durable(&self, header: &GameHeader) -> bool {
        self.context.store.outlives_server() && header.policy.durability == Durability::Durable
    }
}

/// The players at the physical table of a room.
fn at_table(header: &GameHeader) -> impl Iterator<Item = (Seat, SeatedParticipant)> {
    let fills = header.fills.iter().enumerate();
    fills.filter_map(|(seat, fill)| {
        let Fill::AtTable(kind) = *fill else {
            return None;
        };
        let participant = SeatedParticipant {
            name: header.display_names.get(&seat).cloned().unwrap_or_default(),
            name_fingerprint: String::new(),
            kind,
            // Nobody has it: nobody connects to this seat.
            ticket: Token::random(header.room_id).hash(),
        };
        Some((Seat::new(seat), participant))
    })
}

/// The outcome of a reservation.
enum Claim {
    /// There is space for it.
    Reserved(Reservation),
    /// The request has already created it.
    Created(Created),
    /// The request is just creating it.
    InProgress,
}

/// Space in the table for a room that is being created.
struct Reservation {
    rooms: Arc<Rooms>,
    owner: RoomToken,
    place: Option<Permit>,
}

impl Reservation {
    /// Reserves space for the room of this owner token.
    fn of(rooms: &Arc<Rooms>, owner: RoomToken, new: &NewRoom) -> Result<Claim, CreateError> {
        let charged = new.charged;
        let seating = new.seating.as_ref();
        let unit = seating.map_or(owner.subject.unit(), |seating| seating.part_of.unit());
        let mut table = rooms.lock();
        if let Some(entry) = table.get(owner.subject) {
            return match entry.header.owner.matches(&owner.secret) {
                true => Ok(Claim::Created(Created {
                    handle: entry.handle.clone(),
                    join_code: entry.header.join_code.clone(),
                    owner,
                })),
                false => Err(CreateError::RequestIdUsed),
            };
        }
        if table.in_creation.contains_key(&owner.subject) {
            return Ok(Claim::InProgress);
        }
        // First: closing a room of its own does not help a caller then.
        if table.shutting_down {
            return Err(CreateError::ShuttingDown);
        }
        if !rooms.is_reached() {
            return Err(CreateError::NotReached);
        }
        let place = rooms.places.try_take(charged);
        let place = place.ok_or_else(|| rooms.too_many_of(charged))?;
        table.reserve(owner.subject, unit, rooms.max_rooms)?;
        drop(table);
        Ok(Claim::Reserved(Self {
            rooms: Arc::clone(rooms),
            owner,
            place: Some(place),
        }))
    }

    async fn create(mut self, new: NewRoom) -> Result<Created, CreateError> {
        let rooms = &self.rooms;
        let seating = new.seating.as_ref();
        let server_seed = seating.and_then(|seating| seating.server_seed);
        let owner = self.owner;
        let room_id = owner.subject;
        // Before the commit, which takes time: the room's clock starts at `created_at_ms`.
        let clock = RoomClock::of_age(Duration::ZERO, &rooms.context.process_clock);
        let created_at_ms = since_epoch_ms();
        let mut header = Arc::new(GameHeader {
            room_id,
            game_id: seating.map_or_else(GameId::random, |seating| seating.game_id),
            name: new.name,
            rules: new.rules,
            policy: new.policy,
            rules_version: RULES_VERSION,
            server_version: SERVER_VERSION.into(),
            participant_removed: false,
            fills: new.fills,
            wizards: new.wizards,
            display_names: new.display_names,
            recorded: new.recorded,
            start: new.start,
            seed: match new.game_seed {
                Some(game_seed) => SeedPlan::Fixed { game_seed },
                None => SeedPlan::Committed {
                    server_seed: server_seed.unwrap_or_else(random_bytes),
                    nonce: random_bytes(),
                },
            },
            created_at_ms,
            join_code: join_code(),
            owner: owner.hash(),
            tournament: seating.and_then(|seating| seating.part_of.tournament()),
            study: seating.and_then(|seating| seating.part_of.study()).cloned(),
            table: new.physical.then(|| Token::of_table(&owner).hash()),
        });
        let participants = new.seating.map_or_else(BTreeMap::new, |it| it.participants);
        let store = &rooms.context.store;
        let mut codes_left = CODES_TRIED;
        let (core, mut journal) = loop {
            let mut core = Core::new(Arc::clone(&header));
            for (seat, participant) in at_table(&header) {
                core.seat(seat, participant);
            }
            for (seat, participant) in &participants {
                core.seat(Seat::new(*seat), participant.clone());
            }
            // The participants are committed with the room, so it never exists without them.
            let seated = std::mem::take(core.pending());
            match store.create(Arc::clone(&header), seated).await {
                Ok(journal) => break (core, journal),
                Err(StoreError::Taken(_)) if codes_left > 1 => {
                    codes_left -= 1;
                    Arc::make_mut(&mut header).join_code = join_code();
                }
                Err(error) => return Err(error.into()),
            }
        };
        // Checked and added under one lock, so that a shutdown in between cannot miss the room.
        if let Some(mut table) = Some(rooms.lock()).filter(|table| !table.shutting_down) {
            table.make_space(rooms.max_rooms);
            let context = TaskContext {
                owner: new.charged,
                creator: new.creator,
                ..rooms.context.clone()
            };
            let handle = spawn_room(core, clock, None, journal, context);
            let durable = rooms.is_durable(&header);
            if let Some(lease) = rooms.lease().filter(|_| header.unit() == room_id.unit()) {
                let ephemeral = !durable;
                lease.report(header.unit(), UnitEvent::Created { ephemeral });
            }
            table.enter(Entry {
                handle: handle.clone(),
                durable,
                header: Arc::clone(&header),
                over: false,
                end: None,
                suspended: false,
                listed: true,
                place: self.place.take(),
            });
            drop(table);
            rooms.context.webhooks.room_created(&header);
            return Ok(Created {
                handle,
                join_code: header.join_code.clone(),
                owner,
            });
        }
        // No client knows it: it must not be restored with the server.
        journal.finish(None, None).await?;
        Err(CreateError::ShuttingDown)
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        (self.rooms.lock().in_creation).remove(&self.owner.subject);
        self.rooms.created.notify_waiters();
    }
}
