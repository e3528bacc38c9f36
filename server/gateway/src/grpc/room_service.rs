//! `RoomService`: creates, lists, joins and closes rooms.

use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use chefshat_proto::v1::{
    self, room_service_client::RoomServiceClient, room_service_server::RoomService,
};
use chefshat_record::convert::seat_number;
use futures::{Stream, StreamExt as _};
use tokio::time::{Instant, timeout};
use tonic::transport::Channel;
use tonic::{Code, Request, Response, Status};

use super::access::opened;
use super::fields::{checked_kind, checked_name, name_fingerprint, request_id};
use super::forward::Gateway;
use super::limits::make_way;
use super::lists::{self, Listing, Part};
use super::lookup::Lookup;
use super::new_room::new_room;
use super::pages;
use super::recorded::Recorded;
use super::status::{self, Refusal, invalid, not_created, room_failed, room_gone, ticket_unknown};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::{COST_OF_BUILT_IN_GAME, COST_OF_ROOM, CallLimits, Key, Payer};
use chefshat_hosting::room::{Handle, JoinRequest};
use chefshat_hosting::rooms::{CreateError, Rooms};
use chefshat_room::ids::{CODE_LENGTH, RoomId, RoomToken, Token, normal_code};
use chefshat_room::journal::ParticipantKind;
use chefshat_store::StoreError;

/// Rooms examined for one page.
const ROOMS_LOOKED_AT: usize = 200;

/// Rooms that describe themselves at a time.
const ROOMS_ASKED: usize = 32;
/// How long the rooms of a page are waited for.
const LIST_PATIENCE: Duration = Duration::from_secs(2);
/// How long one is waited for when that is over.
const LEAST_PATIENCE: Duration = Duration::from_millis(100);

/// The service.
#[derive(Debug, Clone)]
pub struct RoomCalls {
    rooms: Arc<Rooms>,
    recorded: Recorded,
    calls: Arc<CallLimits>,
    /// Where clients reach this server directly; empty if it is the only one.
    endpoint: String,
}

impl RoomCalls {
    /// Creates the service for these rooms. New ones may branch from these recorded games. Clients
    /// reach this node of a cluster directly at `endpoint`.
    pub fn new(
        rooms: Arc<Rooms>,
        recorded: Recorded,
        calls: Arc<CallLimits>,
        endpoint: Option<&str>,
    ) -> Self {
        Self {
            rooms,
            recorded,
            calls,
            endpoint: endpoint.unwrap_or_default().to_owned(),
        }
    }

    fn lookup(&self) -> &Lookup {
        self.recorded.lookup()
    }

    /// The room with a join code; if an id is given too, it must match. Wrong codes are charged,
    /// those of unknown rooms too: whether a room is private or unknown makes no difference. That of
    /// a tournament is not: who has a code does not know what it belongs to, and asks for a room first.
    async fn find_by_code(
        &self,
        caller: &Caller,
        room_id: &str,
        join_code: &str,
    ) -> Result<Handle, Status> {
        let key = Key::of_caller(caller);
        let refused = |refused| Status::from(Refusal::from(refused));
        self.calls.may_try_code(key).map_err(refused)?;
        let found = match room_id {
            "" => self.lookup().room_here(join_code, key).await?,
            id => match RoomId::parse(id) {
                Some(id) => self.lookup().room_here(id, key).await?,
                None => None,
            },
        };
        let by_code = self.rooms.by_code(join_code);
        let has_code =
            |handle: &Handle| (by_code.as_ref()).is_some_and(|it| it.id() == handle.id());
        let Some(handle) = found.filter(has_code) else {
            if !self.lookup().is_code_of_tournament(join_code) {
                self.calls.wrong_code(key);
            }
            if !room_id.is_empty() {
                self.lookup().room(caller, room_id).await?;
            }
            return Err(status::join_code_wrong());
        };
        self.lookup().check_joining(caller, handle.id())?;
        Ok(handle)
    }

    /// Whether the room with a join code is on this server, and waits for players.
    async fn is_open(&self, join_code: &str) -> bool {
        match self.rooms.by_code(join_code) {
            Some(handle) => {
                (handle.describe().await).is_ok_and(|room| room.state() == v1::RoomState::Waiting)
            }
            None => false,
        }
    }
}

/// The rooms that a caller finds.
struct RoomList<'a> {
    lookup: &'a Lookup,
    caller: &'a Caller,
    message: &'a v1::ListRoomsRequest,
    /// Whether those whose games are over are listed, or the others.
    over: Option<bool>,
}

impl Listing for RoomList<'_> {
    type Entry = v1::Room;
    type Response = v1::ListRoomsResponse;

    async fn here(&self, before: Option<u64>) -> Result<Part<v1::Room>, Status> {
        let page_size = pages::page_size(self.message.page_size);
        // Rooms in other states are skipped, up to a limit for one page.
        let looked_at = (self.lookup.rooms()).newest(before, self.over, ROOMS_LOOKED_AT);
        let mut more = looked_at.len() == ROOMS_LOOKED_AT;
        let mut last = before;
        let began = Instant::now();
        // A room that waits for its commit is left out, so that it holds up no list. The first ones are
        // waited for longer.
        let describe = |handle: Handle| async move {
            let patience = LIST_PATIENCE.saturating_sub(began.elapsed());
            let described = async {
                match self.lookup.lists_room(self.caller, &handle).await {
                    true => handle.describe().await.ok(),
                    false => None,
                }
            };
            timeout(patience.max(LEAST_PATIENCE), described)
                .await
                .ok()
                .flatten()
        };
        let mut entries = Vec::new();
        let mut rooms = pin!(described(looked_at, describe));
        while let Some((number, room)) = rooms.next().await {
            if entries.len() == page_size {
                more = true;
                break;
            }
            last = Some(number);
            // A room that has just gone, or that the caller does not see, is not listed.
            if let Some(room) = room
                && (self.message.state == 0 || self.message.state == room.state)
            {
                entries.push((number, room));
            }
        }
        let rest = last.filter(|_| more);
        Ok(Part { entries, rest })
    }

    async fn there(
        &self,
        gateway: &Gateway,
        channel: Channel,
        page_token: String,
    ) -> Result<Response<v1::ListRoomsResponse>, Status> {
        let request = v1::ListRoomsRequest {
            page_token,
            ..self.message.clone()
        };
        let mut service = RoomServiceClient::new(channel);
        service.list_rooms(gateway.request(request)).await
    }

    fn page(response: v1::ListRoomsResponse) -> (Vec<v1::Room>, String) {
        (response.rooms, response.next_page_token)
    }

    fn response(rooms: Vec<v1::Room>, next_page_token: String) -> v1::ListRoomsResponse {
        v1::ListRoomsResponse {
            rooms,
            next_page_token,
        }
    }

    fn created_at_ms(room: &v1::Room) -> u64 {
        room.created_at_ms
    }

    fn id(room: &v1::Room) -> &str {
        &room.room_id
    }
}

/// Describes numbered rooms in order, [`ROOMS_ASKED`] of them at a time.
fn described<H, R, D: Future<Output = R>>(
    rooms: Vec<(u64, H)>,
    describe: impl Fn(H) -> D,
) -> impl Stream<Item = (u64, R)> {
    let asked = move |(number, handle)| {
        let described = describe(handle);
        async move { (number, described.await) }
    };
    futures::stream::iter(rooms)
        .map(asked)
        .buffered(ROOMS_ASKED)
}

impl RoomService for RoomCalls {
    async fn create_room(
        &self,
        request: Request<v1::CreateRoomRequest>,
    ) -> Result<Response<v1::CreateRoomResponse>, Status> {
        let gateway: Option<Gateway> = request.extensions().get().cloned();
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let reading = (&self.recorded, &caller, gateway.as_ref());
        let new = new_room(reading, request, key).await?;
        let request = new.request;
        // Another node would not ask for the recorded games that a request names.
        let is_recorded = !new.recorded.is_empty() || new.start.branch.is_some();
        let may_pass = gateway.as_ref().filter(|_| !is_recorded);
        self.lookup()
            .check_created_here(request, key, may_pass)
            .await?;
        let physical = new.physical;
        let built_in = new.fills.iter().all(|fill| fill.is_built_in());
        let cost = match built_in {
            true => COST_OF_BUILT_IN_GAME,
            false => COST_OF_ROOM,
        };
        self.calls.charge(key, cost);
        let created = self.rooms.create(new).await;
        if matches!(&created, Err(CreateError::Store(StoreError::Taken(_)))) {
            // Another node has created it meanwhile.
            self.lookup()
                .check_not_created_elsewhere(request, key)
                .await?;
        }
        let created = created.map_err(|error| not_created(error, |never| match never {}))?;
        let room = created.handle.describe().await.map_err(Refusal::from)?;
        Ok(Response::new(v1::CreateRoomResponse {
            room: Some(room),
            join_code: created.join_code,
            owner_token: created.owner.to_text(),
            table_ticket: match physical {
                true => Token::of_table(&created.owner).to_text(),
                false => String::new(),
            },
        }))
    }

    async fn get_room(
        &self,
        request: Request<v1::GetRoomRequest>,
    ) -> Result<Response<v1::GetRoomResponse>, Status> {
        // Who waits for a room that waits for its commit holds up no other calls.
        make_way(request.extensions());
        let (caller, request) = opened(request);
        let handle = match request.join_code.as_str() {
            "" => self.lookup().room(&caller, &request.room_id).await?,
            code => self.find_by_code(&caller, &request.room_id, code).await?,
        };
        let mut room = handle.describe().await.map_err(Refusal::from)?;
        let next_join_code = handle.next_join_code();
        if !next_join_code.is_empty() && self.lookup().takes_part(&caller, &handle).await {
            room.next_join_code = next_join_code;
        }
        Ok(Response::new(v1::GetRoomResponse { room: Some(room) }))
    }

    async fn list_rooms(
        &self,
        request: Request<v1::ListRoomsRequest>,
    ) -> Result<Response<v1::ListRoomsResponse>, Status> {
        let caller = Caller::of(request.extensions());
        let (_, extensions, message) = request.into_parts();
        // Who waits for a turn holds up no other calls.
        make_way(&extensions);
        let _turn = self.calls.list(Key::of_caller(&caller)).await;
        let over = match v1::RoomState::try_from(message.state) {
            Ok(v1::RoomState::Unspecified) => None,
            Ok(v1::RoomState::Waiting | v1::RoomState::Playing) => Some(false),
            Ok(v1::RoomState::Finished | v1::RoomState::Aborted) => Some(true),
            Err(_) => {
                let problem = "not a value of this enum";
                return Err(invalid("STATE_REFUSED", "state", problem));
            }
        };
        let listing = RoomList {
            lookup: self.lookup(),
            caller: &caller,
            message: &message,
            over,
        };
        let size = pages::page_size(message.page_size);
        lists::list(&listing, &extensions, &message.page_token, size).await
    }

    async fn join_room(
        &self,
        request: Request<v1::JoinRoomRequest>,
    ) -> Result<Response<v1::JoinRoomResponse>, Status> {
        let (caller, request) = opened(request);
        if self.rooms.is_shutting_down() {
            return Err(status::shutting_down());
        }
        let (id, code) = (&request.room_id, &request.join_code);
        let handle = self.find_by_code(&caller, id, code).await?;
        let kind = checked_kind(request.kind)?.unwrap_or(ParticipantKind::Agent);
        let name = checked_name("name", &request.name, 1)?;
        let request_id = request_id(&request.request_id, &caller)?;
        let name_fingerprint = name_fingerprint(&name, &request.name_key)?;
        let joined = handle
            .join(JoinRequest {
                name,
                name_fingerprint,
                kind,
                seat: request.seat,
                request_id,
                client: Some(Payer::of_caller(&caller)),
            })
            .await
            .map_err(room_failed(room_gone))?;
        Ok(Response::new(v1::JoinRoomResponse {
            room: Some(*joined.room),
            seat: seat_number(joined.seat),
            ticket: joined.ticket.to_text(),
            preferred_endpoint: self.endpoint.clone(),
        }))
    }

    async fn leave_room(
        &self,
        request: Request<v1::LeaveRoomRequest>,
    ) -> Result<Response<v1::LeaveRoomResponse>, Status> {
        let (caller, request) = opened(request);
        let ticket = RoomToken::parse(&request.ticket).ok_or_else(ticket_unknown)?;
        let lookup = self.lookup();
        let handle = lookup
            .room_of_ticket(&caller, ticket.subject, ticket_unknown)
            .await?;
        let left = handle.leave(ticket.secret).await;
        let room = left.map_err(room_failed(ticket_unknown))?;
        Ok(Response::new(v1::LeaveRoomResponse { room: Some(room) }))
    }

    async fn close_room(
        &self,
        request: Request<v1::CloseRoomRequest>,
    ) -> Result<Response<v1::CloseRoomResponse>, Status> {
        let (caller, request) = opened(request);
        let client = Payer::of_caller(&caller);
        let caller = caller.showing(&request.owner_token);
        let handle = self.lookup().room(&caller, &request.room_id).await?;
        let token = Token::parse(&request.owner_token)
            .filter(|token| token.subject == handle.id())
            .ok_or_else(status::owner_token_wrong)?;
        let room = handle
            .close(token.secret, client)
            .await
            .map_err(room_failed(status::owner_token_wrong))?;
        Ok(Response::new(v1::CloseRoomResponse { room: Some(room) }))
    }

    async fn set_next_room(
        &self,
        request: Request<v1::SetNextRoomRequest>,
    ) -> Result<Response<v1::SetNextRoomResponse>, Status> {
        let (caller, request) = opened(request);
        let caller = (caller.showing(&request.owner_token)).showing(&request.ticket);
        let handle = self.lookup().room(&caller, &request.room_id).await?;
        let header = self.rooms.header(handle.id());
        let is_owner = |header| (self.lookup()).is_owner_token(&request.owner_token, header);
        let is_owner = header.as_deref().is_some_and(is_owner);
        if !is_owner && request.ticket.is_empty() {
            return Err(status::owner_token_wrong());
        }
        let participant = Caller::default().showing(&request.ticket);
        if !is_owner && !self.lookup().takes_part(&participant, &handle).await {
            return Err(ticket_unknown());
        }
        let join_code = normal_code(&request.join_code);
        if join_code.len() != CODE_LENGTH {
            return Err(status::join_code_wrong());
        }
        loop {
            let earlier = handle.next_join_code();
            if !is_owner && earlier != join_code && self.is_open(&earlier).await {
                return Err(status::status(
                    Code::FailedPrecondition,
                    "NEXT_ROOM_SET",
                    "somebody else was faster: get the room, and join its next one",
                    [],
                ));
            }
            if handle.replace_next_join_code(&earlier, join_code.clone()) {
                return Ok(Response::new(v1::SetNextRoomResponse {}));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tokio::sync::Barrier;

    use super::*;

    #[tokio::test]
    async fn rooms_of_a_list_are_described_concurrently() {
        let rooms: Vec<_> = (0..64).map(|number| (number, ())).collect();
        // No call returns before this many have started.
        let barrier = Barrier::new(ROOMS_ASKED);
        let barrier = &barrier;
        let describe = |()| async move {
            barrier.wait().await;
        };
        let numbers: Vec<u64> = (described(rooms, describe).map(|(number, ())| number))
            .collect()
            .await;
        assert_eq!(numbers, (0..64).collect::<Vec<_>>());
    }
}
