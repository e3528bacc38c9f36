//! Which rooms, tournaments and recorded games a caller reaches and finds in lists: by the scope of
//! its token, by their visibility, and by the secrets that it shows. What a caller does not reach
//! because it is private is answered exactly like what does not exist.

use std::collections::BTreeMap;
use std::sync::Arc;

use chefshat_proto::v1::{self, record_line::Line};
use tonic::Status;
use tracing::warn;

use super::access::check;
use super::forward::Gateway;
use super::status::{
    elsewhere, owner_unreachable, read_failed, room_gone, room_unknown, tournament_unknown,
};
use super::takeover::settled;
use chefshat_admission::access::{Caller, Relation, Role};
use chefshat_admission::limits::Key;
use chefshat_hosting::cluster::{Elsewhere, FoundBy, Location};
use chefshat_hosting::room::Handle;
use chefshat_hosting::rooms::Rooms;
use chefshat_hosting::tournaments::{TournamentHandle, Tournaments};
use chefshat_room::ids::{
    Id, RequestKey, RoomId, SecretHash, StudyId, Token, TournamentId, UnitId,
};
use chefshat_room::journal::{Change, Entry, GameHeader};
use chefshat_room::policy::Visibility;
use chefshat_store::{StoreError, StoredGame};

/// Decides what a caller reaches.
#[derive(Debug, Clone)]
pub struct Lookup {
    rooms: Arc<Rooms>,
    tournaments: Arc<Tournaments>,
}

/// How much of a record its reader sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RecordView {
    /// Everything.
    Whole,
    /// What the players saw.
    Players,
}

impl Lookup {
    /// Decides about these rooms and tournaments.
    pub fn new(rooms: Arc<Rooms>, tournaments: Arc<Tournaments>) -> Self {
        Self { rooms, tournaments }
    }

    /// The rooms.
    pub(super) fn rooms(&self) -> &Arc<Rooms> {
        &self.rooms
    }

    /// The room with this id or join code, if this node has it. If another node does, the error sends
    /// the request there.
    pub(super) async fn room_here(
        &self,
        found_by: impl Into<FoundBy>,
        caller: Key,
    ) -> Result<Option<Handle>, Status> {
        let found_by = found_by.into();
        match self.room_in_memory(&found_by) {
            Some(handle) if !handle.is_gone() => Ok(Some(handle)),
            stopped => {
                let is_known =
                    || stopped.is_some() || self.tournament_in_memory(&found_by).is_some();
                let owned = self
                    .check_not_elsewhere(&found_by, caller, is_known)
                    .await?;
                // What this node has stopped is about to be resumed.
                let stopped = stopped.filter(|_| owned);
                Ok(self.room_in_memory(&found_by).or(stopped))
            }
        }
    }

    /// The tournament with this id or join code, as [`Lookup::room_here`].
    pub(super) async fn tournament_here(
        &self,
        found_by: impl Into<FoundBy>,
        caller: Key,
    ) -> Result<Option<Arc<TournamentHandle>>, Status> {
        let found_by = found_by.into();
        if let Some(handle) = self.tournament_in_memory(&found_by).filter(answers) {
            return Ok(Some(handle));
        }
        let is_known = || self.room_in_memory(&found_by).is_some();
        self.check_not_elsewhere(&found_by, caller, is_known)
            .await?;
        Ok(self.tournament_in_memory(&found_by))
    }

    fn room_in_memory(&self, found_by: &FoundBy) -> Option<Handle> {
        match found_by {
            FoundBy::Id(id) => self.rooms.by_unit(*id),
            FoundBy::Code(code) => self.rooms.by_code(code),
            FoundBy::Game(game) => self.rooms.get(self.rooms.room_of(*game)?),
        }
    }

    fn tournament_in_memory(&self, found_by: &FoundBy) -> Option<Arc<TournamentHandle>> {
        match found_by {
            FoundBy::Id(id) => self.tournaments.by_unit(*id),
            FoundBy::Code(code) => self.tournaments.by_code(code),
            FoundBy::Game(_) => None,
        }
    }

    /// Whether a tournament of this node has a join code.
    pub(super) fn is_code_of_tournament(&self, join_code: &str) -> bool {
        self.tournaments.by_code(join_code).is_some()
    }

    /// Checks that no other node has created a room or tournament for this request before.
    pub(super) async fn check_not_created_elsewhere(
        &self,
        request: Option<RequestKey>,
        caller: Key,
    ) -> Result<(), Status> {
        let Some(request) = request.filter(|request| !self.has_created(*request)) else {
            return Ok(());
        };
        let found_by = FoundBy::Id(request.created_id());
        let checked = self.check_not_elsewhere(&found_by, caller, || false);
        checked.await.map(drop)
    }

    /// Sends a request for a room or tournament to the node that has created it before or, if it is new,
    /// is to create it. `gateway`: `None` if another node has sent it here.
    pub(super) async fn check_created_here(
        &self,
        request: Option<RequestKey>,
        caller: Key,
        gateway: Option<&Gateway>,
    ) -> Result<(), Status> {
        self.check_not_created_elsewhere(request, caller).await?;
        match request.is_some_and(|request| self.has_created(request)) {
            true => Ok(()),
            false => self.check_placed_here(gateway).await,
        }
    }

    fn has_created(&self, request: RequestKey) -> bool {
        let id = request.created_id();
        self.rooms.by_unit(id).is_some() || self.tournaments.by_unit(id).is_some()
    }

    /// Sends a request for something new to the node that is to create it. `gateway`: `None` if another
    /// node has sent it here.
    pub(super) async fn check_placed_here(&self, gateway: Option<&Gateway>) -> Result<(), Status> {
        let peer = match gateway {
            Some(_) => self.rooms.place().await,
            None => None,
        };
        peer.map_or(Ok(()), |peer| {
            let found_by = None;
            Err(elsewhere(Elsewhere { peer, found_by }))
        })
    }

    /// Checks that what is not in memory is not at another node. Returns whether this node owns it:
    /// then it is about to be resumed, if it is known here (`is_known`). What is over and whose node
    /// is gone is in memory afterwards.
    pub(super) async fn check_not_elsewhere(
        &self,
        found_by: &FoundBy,
        caller: Key,
        is_known: impl FnOnce() -> bool,
    ) -> Result<bool, Status> {
        match self.rooms.directory().locate(found_by, caller).await {
            Location::Nowhere => Ok(false),
            Location::Over(what) => {
                let shown = self.tournaments.show_ended(what).await;
                shown.map(|()| false).map_err(|error| {
                    warn!(%error, "what is over cannot be read");
                    owner_unreachable()
                })
            }
            Location::Here if is_known() => Ok(true),
            Location::Here | Location::Unknown => Err(owner_unreachable()),
            Location::Node(peer) => Err(elsewhere(Elsewhere {
                peer,
                found_by: Some(found_by.clone()),
            })),
        }
    }

    /// The room with an id from a message.
    pub(super) async fn room(&self, caller: &Caller, id: &str) -> Result<Handle, Status> {
        let id = Id::parse(id).ok_or_else(room_unknown)?;
        self.room_or(caller, id, room_unknown).await
    }

    /// The room with this id. If there is none, or the caller does not see it, `unknown` says so.
    pub(super) async fn room_or(
        &self,
        caller: &Caller,
        id: RoomId,
        unknown: impl Fn() -> Status,
    ) -> Result<Handle, Status> {
        let unknown = || match self.rooms.is_shutting_down() && caller.secrets.mention(id) {
            // A suspended room has taken the knowledge of its tickets with it.
            true => room_gone(),
            false => unknown(),
        };
        let found = self.room_here(id, Key::of_caller(caller)).await?;
        let handle = found.ok_or_else(unknown)?;
        // A node that has just stopped it is about to resume it, or another is.
        let header = self.rooms.header(id).ok_or_else(room_gone)?;
        if header.policy.visibility == Visibility::Private
            && self.standing_in_room(caller, &handle, &header).await == Relation::Stranger
        {
            // One that does not exist is looked for at other nodes: this takes as long, and fails as that
            // does. So for tournaments and studies.
            self.check_not_elsewhere(&FoundBy::from(id), Key::of_caller(caller), || true)
                .await?;
            return Err(unknown());
        }
        check(caller, |caller| reaches(caller, &header))?;
        Ok(handle)
    }

    /// Checks that the scope of a caller who has the join code of a room includes it.
    pub(super) fn check_joining(&self, caller: &Caller, room: RoomId) -> Result<(), Status> {
        let tournament = || self.rooms.header(room)?.tournament;
        check(caller, |caller| {
            caller.reaches_room(room, tournament().map(|game| game.tournament))
        })
    }

    /// The room of a ticket, which is still to be compared. A caller whose scope does not include a
    /// private room gets the answer for an unknown ticket, whatever the ticket. Waits while the room
    /// changes hands.
    pub(super) async fn room_of_ticket(
        &self,
        caller: &Caller,
        room: RoomId,
        unknown: impl Fn() -> Status,
    ) -> Result<Handle, Status> {
        let look = || self.look_for_ticket(caller, room.unit(), &unknown);
        settled(&self.rooms, look).await
    }

    /// As [`Lookup::room_of_ticket`], without waiting, for a ticket that may be of a tournament.
    pub(super) async fn look_for_ticket(
        &self,
        caller: &Caller,
        id: UnitId,
        unknown: impl Fn() -> Status,
    ) -> Result<Handle, Status> {
        let found = self
            .room_here(FoundBy::Id(id), Key::of_caller(caller))
            .await?;
        let handle = found.ok_or_else(&unknown)?;
        if caller.scope.is_some() {
            let header = self.rooms.header(handle.id()).ok_or_else(room_gone)?;
            check(caller, |caller| reaches(caller, &header)).map_err(|refused| {
                match header.policy.visibility {
                    Visibility::Private => unknown(),
                    Visibility::Public | Visibility::Unlisted => refused,
                }
            })?;
        }
        Ok(handle)
    }

    /// Whether the room or tournament of a ticket is in memory and runs, so that finding it takes no
    /// time.
    pub(super) fn has_in_memory(&self, id: UnitId) -> bool {
        (self.tournaments.by_unit(id)).is_some_and(|it| answers(&it))
            || self.rooms.by_unit(id).is_some_and(|room| !room.is_gone())
    }

    /// Whether a room is in the lists of a caller.
    pub(super) async fn lists_room(&self, caller: &Caller, handle: &Handle) -> bool {
        let Some(header) = self.rooms.header(handle.id()) else {
            return false;
        };
        reaches(caller, &header)
            && (header.policy.visibility == Visibility::Public
                || self.standing_in_room(caller, handle, &header).await > Relation::Stranger)
    }

    /// The tournament with an id from a message.
    pub(super) async fn tournament(
        &self,
        caller: &Caller,
        id: &str,
    ) -> Result<Arc<TournamentHandle>, Status> {
        let id = TournamentId::parse(id).ok_or_else(tournament_unknown)?;
        let handle = self.tournament_here(id, Key::of_caller(caller)).await?;
        let handle = handle.ok_or_else(tournament_unknown)?;
        if handle.visibility() == Visibility::Private
            && standing_in_tournament(caller, &handle) == Relation::Stranger
        {
            let found_by = FoundBy::from(id);
            self.check_not_elsewhere(&found_by, Key::of_caller(caller), || true)
                .await?;
            return Err(tournament_unknown());
        }
        check(caller, |caller| caller.reaches_tournament(handle.id()))?;
        Ok(handle)
    }

    /// Whether the scope of a caller includes the tournament of a ticket, which is still to be
    /// compared; as for rooms. `None` if this node does not have the tournament.
    pub(super) fn tournament_of_ticket(
        &self,
        caller: &Caller,
        id: UnitId,
        unknown: impl Fn() -> Status,
    ) -> Option<Result<(), Status>> {
        let tournament = self.tournaments.by_unit(id)?;
        let checked = check(caller, |it| it.reaches_tournament(tournament.id()));
        Some(checked.map_err(|refused| match tournament.visibility() {
            Visibility::Private => unknown(),
            Visibility::Public | Visibility::Unlisted => refused,
        }))
    }

    /// Whether a tournament is in the lists of a caller.
    pub(super) fn lists_tournament(&self, caller: &Caller, handle: &TournamentHandle) -> bool {
        caller.reaches_tournament(handle.id())
            && (handle.visibility() == Visibility::Public
                || standing_in_tournament(caller, handle) > Relation::Stranger)
    }

    /// Whether a caller may be one who sees a recorded game, by its summary alone. If not, the game is
    /// not read at all, so that the time of the answer does not show that it exists.
    pub(super) fn may_see_record(&self, caller: &Caller, summary: &v1::RecordSummary) -> bool {
        let is_private = summary.visibility() == v1::Visibility::Private;
        let ids = [&summary.room_id, &summary.tournament_id, &summary.study_id];
        let mut ids = ids.into_iter().filter_map(|id| UnitId::parse(id));
        let by_token = caller.relation() > Relation::Stranger
            && reaches_record(caller, &summary.room_id, &summary.tournament_id);
        !is_private || summary.added || by_token || ids.any(|id| caller.secrets.mention(id))
    }

    /// How much of a recorded game a caller sees. `unknown` answers for a game that it does not see.
    pub(super) fn recorded(
        &self,
        caller: &Caller,
        stored: &StoredGame,
        unknown: impl Fn() -> Status,
    ) -> Result<RecordView, Status> {
        let (visibility, relation, least) = match stored {
            StoredGame::Hosted(header, entries, _) => {
                let relation = self.relation_in_game(caller, header, entries);
                (header.policy.visibility, relation, least_to_read(header))
            }
            // Importing it made it public.
            StoredGame::Imported(_) => (Visibility::Public, Relation::Stranger, Relation::Stranger),
        };
        let is_private = visibility == Visibility::Private;
        if is_private && relation < least {
            return Err(unknown());
        }
        check(caller, |caller| match stored {
            StoredGame::Hosted(header, ..) => reaches(caller, header),
            StoredGame::Imported(lines) => {
                let header = lines.first().and_then(|line| match &line.line {
                    Some(Line::Header(header)) => Some(header),
                    _ => None,
                });
                header.is_some_and(|it| reaches_record(caller, &it.room_id, &it.tournament_id))
            }
        })?;
        let is_host = caller.role >= Role::Host && !is_private;
        Ok(match is_host || relation == Relation::Owner {
            true => RecordView::Whole,
            false => RecordView::Players,
        })
    }

    /// Whether a recorded game is in the lists of a caller, by its summary and the hash of its room's
    /// owner token alone. `None` if the game has to be read, for its tickets: never one of a study,
    /// which only the owner sees, so that no participant learns by time which games a filter finds.
    pub(super) fn lists_by_summary(
        &self,
        caller: &Caller,
        summary: &v1::RecordSummary,
        owner: Option<&SecretHash>,
    ) -> Option<bool> {
        if !reaches_record(caller, &summary.room_id, &summary.tournament_id) {
            return Some(false);
        }
        let is_public = summary.visibility() == v1::Visibility::Unspecified;
        if is_public || summary.added || caller.relation() > Relation::Stranger {
            return Some(true);
        }
        let tournament = TournamentId::parse(&summary.tournament_id);
        let kept = tournament.and_then(|id| self.tournaments.get(id));
        let relation = kept.as_ref().map(|it| it.relation(&caller.secrets));
        if relation > Some(Relation::Stranger) {
            return Some(true);
        }
        // The games of a tournament may outlast it.
        let forgotten = (tournament.filter(|_| kept.is_none())).map(TournamentId::unit);
        let study = StudyId::parse(&summary.study_id).map(StudyId::unit);
        let room = RoomId::parse(&summary.room_id);
        if let (Some(room), Some(owner)) = (room, owner) {
            let by_room = caller.secrets.relation(room, owner, std::iter::empty());
            let mut units = forgotten.into_iter().chain(study);
            if by_room == Relation::Owner
                || units.any(|unit| owns_unit_of(caller, unit, (room, owner)))
            {
                return Some(true);
            }
        }
        // Reading a game takes time: only those that a ticket may be of are read.
        let mut ids = room.map(RoomId::unit).into_iter().chain(forgotten);
        let may_take_part = study.is_none() && ids.any(|id| caller.secrets.mention(id));
        (!may_take_part).then_some(false)
    }

    /// Whether a recorded game that has to be read is in the lists of a caller.
    pub(super) async fn lists_by_game(
        &self,
        caller: &Caller,
        summary: &v1::RecordSummary,
    ) -> Result<bool, Status> {
        let Some(game) = Id::parse(&summary.game_id) else {
            return Ok(false);
        };
        let stored = match self.rooms.store().finished(game).await {
            // One that cannot be read ends no list of others.
            Err(error @ StoreError::Unreadable(_)) => {
                read_failed(error);
                return Ok(false);
            }
            stored => stored.map_err(read_failed)?,
        };
        Ok(match stored {
            Some(StoredGame::Hosted(header, entries, _)) => {
                self.relation_in_game(caller, &header, &entries) >= least_to_read(&header)
            }
            Some(StoredGame::Imported(_)) | None => false,
        })
    }

    async fn standing_in_room(
        &self,
        caller: &Caller,
        handle: &Handle,
        header: &GameHeader,
    ) -> Relation {
        let relation = self.relation_by_header(caller, header);
        if relation > Relation::Stranger {
            return relation;
        }
        let secrets: Vec<_> = (units_of(header))
            .flat_map(|id| caller.secrets.of_id(id))
            .map(|token| token.secret)
            .collect();
        match !secrets.is_empty() && handle.has_ticket(secrets).await.unwrap_or(false) {
            true => Relation::Participant,
            false => Relation::Stranger,
        }
    }

    fn relation_in_game(
        &self,
        caller: &Caller,
        header: &GameHeader,
        entries: &[Entry],
    ) -> Relation {
        let mut tickets = BTreeMap::new();
        for entry in entries {
            match &entry.change {
                Change::Seated { seat, participant } => {
                    tickets.insert(*seat, participant.ticket);
                }
                Change::Vacated(seat) => drop(tickets.remove(seat)),
                _ => {}
            }
        }
        let by_ticket = (units_of(header))
            .map(|id| (caller.secrets).relation(id, &header.owner, tickets.values().copied()));
        let relation = self.relation_by_header(caller, header);
        by_ticket.max().map_or(relation, |it| it.max(relation))
    }

    /// Whether a caller shows the owner token of a room, or of its tournament or study.
    pub(super) fn is_owner(&self, caller: &Caller, header: &GameHeader) -> bool {
        self.relation_by_header(&caller.by_secrets(), header) == Relation::Owner
    }

    /// Whether this is the owner token of a room, or of its tournament or study.
    pub(super) fn is_owner_token(&self, token: &str, header: &GameHeader) -> bool {
        self.is_owner(&Caller::default().showing(token), header)
    }

    /// Whether a caller shows a ticket or the owner token of a room.
    pub(super) async fn takes_part(&self, caller: &Caller, handle: &Handle) -> bool {
        let Some(header) = self.rooms.header(handle.id()) else {
            return false;
        };
        let caller = caller.by_secrets();
        self.standing_in_room(&caller, handle, &header).await > Relation::Stranger
    }

    /// What a caller is to a game by its token, and by what is known before the game starts.
    fn relation_by_header(&self, caller: &Caller, header: &GameHeader) -> Relation {
        let by_token = match reaches(caller, header) {
            true => caller.relation(),
            false => Relation::Stranger,
        };
        let secrets = &caller.secrets;
        let by_room = secrets.relation(header.room_id, &header.owner, header.table.into_iter());
        let by_owner_of =
            |id: UnitId| match owns_unit_of(caller, id, (header.room_id, &header.owner)) {
                true => Relation::Owner,
                false => Relation::Stranger,
            };
        let by_tournament = tournament_of(header).map(|id| match self.tournaments.get(id) {
            Some(tournament) => tournament.relation(secrets),
            // The server keeps the games of a tournament longer than the tournament.
            None => by_owner_of(id.unit()),
        });
        let by_study = header
            .study
            .as_ref()
            .map(|game| by_owner_of(game.study.unit()));
        by_token
            .max(by_room)
            .max(by_tournament.unwrap_or(Relation::Stranger))
            .max(by_study.unwrap_or(Relation::Stranger))
    }
}

/// Whether a tournament in memory answers calls: it runs here, or is over.
fn answers(tournament: &Arc<TournamentHandle>) -> bool {
    tournament.is_over() || !tournament.is_stopped()
}

/// Whether a caller shows the owner token of a tournament or a study, which stands for that of each
/// of its rooms. A room is given by its id and the hash of its owner token.
fn owns_unit_of(caller: &Caller, unit: UnitId, (room, owner): (RoomId, &SecretHash)) -> bool {
    caller.secrets.of_id(unit).any(|token| {
        let derived = Token::of_tournament_room(room, &token.hash());
        owner.is(&derived.hash())
    })
}

fn standing_in_tournament(caller: &Caller, tournament: &TournamentHandle) -> Relation {
    let by_token = match caller.reaches_tournament(tournament.id()) {
        true => caller.relation(),
        false => Relation::Stranger,
    };
    by_token.max(tournament.relation(&caller.secrets))
}

/// What a caller must be to a private game to read its record. That of a study names the condition.
fn least_to_read(header: &GameHeader) -> Relation {
    match header.study {
        Some(_) => Relation::Owner,
        None => Relation::Participant,
    }
}

fn tournament_of(header: &GameHeader) -> Option<TournamentId> {
    header.tournament.map(|game| game.tournament)
}

/// The room of a game and its tournament, of which its tickets are.
fn units_of(header: &GameHeader) -> impl Iterator<Item = UnitId> {
    let tournament = tournament_of(header).map(TournamentId::unit);
    [header.room_id.unit()].into_iter().chain(tournament)
}

/// Whether the scope of a caller includes a game.
fn reaches(caller: &Caller, header: &GameHeader) -> bool {
    caller.reaches_room(header.room_id, tournament_of(header))
}

/// Whether the scope of a caller includes the record of this room and tournament.
fn reaches_record(caller: &Caller, room: &str, tournament: &str) -> bool {
    match Id::parse(room) {
        Some(room) => caller.reaches_room(room, Id::parse(tournament)),
        None => caller.scope.is_none(),
    }
}
