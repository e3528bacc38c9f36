//! `InstrumentService`: what instruments and the researcher add to the recording of a room.

use std::pin::Pin;
use std::sync::Arc;
use std::time::Duration;

use chefshat_engine::Seat;
use chefshat_proto::v1::{self, instrument_service_server::InstrumentService};
use chefshat_record::convert::check_label;
use chefshat_room::ids::{Token, UnitToken};
use chefshat_room::journal::Marked;
use futures::{Stream, stream};
use prost::Message as _;
use tokio::time::Instant;
use tonic::{Code, Request, Response, Status};

use super::access::opened;
use super::lookup::Lookup;
use super::status::{
    MARKER_REFUSED, Refusal, field, internal, invalid, owner_token_wrong, room_failed, room_gone,
    status, ticket_unknown,
};
use chefshat_admission::access::Caller;
use chefshat_admission::limits::Key;
use chefshat_hosting::room::{Handle, MarkRequest, MarkerFollower};
use chefshat_store::samples::SampleError;

/// The service.
#[derive(Debug, Clone)]
pub struct Instruments {
    lookup: Lookup,
}

impl Instruments {
    /// Creates the service for the rooms that callers reach.
    pub fn new(lookup: Lookup) -> Self {
        Self { lookup }
    }

    /// A room, and the secret of what may be its owner's token. The token of its study stands for
    /// that of the room.
    async fn find(
        &self,
        caller: Caller,
        room_id: &str,
        owner_token: &str,
    ) -> Result<(Handle, [u8; 32]), Status> {
        let caller = caller.showing(owner_token);
        let room = self.lookup.room(&caller, room_id).await?;
        let header = self.lookup.rooms().header(room.id());
        let is_study =
            |id| header.is_some_and(|it| it.study.as_ref().is_some_and(|of| of.study.unit() == id));
        let secret = match UnitToken::parse(owner_token) {
            Some(token) if token.subject == room.id().unit() => token.secret,
            Some(token) if is_study(token.subject) => {
                Token::of_tournament_room(room.id(), &token.hash()).secret
            }
            _ => return Err(owner_token_wrong()),
        };
        Ok((room, secret))
    }

    /// The room and seat of a ticket, and whether its game has started.
    async fn seat_of(&self, caller: &Caller, ticket: &str) -> Result<(Handle, Seat, bool), Status> {
        let ticket = Token::parse(ticket).ok_or_else(ticket_unknown)?;
        let finding = (self.lookup).room_of_ticket(caller, ticket.subject, ticket_unknown);
        let room = finding.await?;
        let seat = room.seat_of(ticket.secret).await.map_err(Refusal::from)?;
        let (seat, has_started) = seat.ok_or_else(ticket_unknown)?;
        Ok((room, seat, has_started))
    }

    /// The room and seat of an owner, and whether its game has started.
    async fn owned_seat(
        &self,
        caller: &Caller,
        owned: &v1::OwnedSeat,
    ) -> Result<(Handle, Seat, bool), Status> {
        let caller = caller.showing(&owned.owner_token);
        let room = self.lookup.room(&caller, &owned.room_id).await?;
        let header = self
            .lookup
            .rooms()
            .header(room.id())
            .ok_or_else(room_gone)?;
        if !self.lookup.is_owner_token(&owned.owner_token, &header) {
            return Err(owner_token_wrong());
        }
        let described = room.describe().await.map_err(Refusal::from)?;
        let number = usize::try_from(owned.seat).ok();
        let Some(number) = number.filter(|number| *number < described.seats.len()) else {
            let words = format!("the room has {} seats, from 0", described.seats.len());
            return Err(invalid("SAMPLES_REFUSED", "owned_seat.seat", words));
        };
        let has_started = room.has_started().await.map_err(Refusal::from)?;
        Ok((room, Seat::new(number), has_started))
    }
}

impl InstrumentService for Instruments {
    type FollowMarkersStream =
        Pin<Box<dyn Stream<Item = Result<v1::FollowMarkersResponse, Status>> + Send>>;

    async fn add_marker(
        &self,
        request: Request<v1::AddMarkerRequest>,
    ) -> Result<Response<v1::AddMarkerResponse>, Status> {
        let arrived = Instant::now();
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (room, secret) = self
            .find(caller, &request.room_id, &request.owner_token)
            .await?;
        check_label(&request.label).map_err(|problem| field(MARKER_REFUSED, &problem))?;
        let moment = match request.elapsed_us {
            Some(elapsed_us) => Duration::from_micros(elapsed_us),
            None => room.clock().at(arrived),
        };
        let marked = Marked {
            label: request.label,
            moment,
        };
        let rooms = self.lookup.rooms();
        (rooms.may_store(key, marked.label.len())).map_err(Refusal::from)?;
        let marker = room.mark(MarkRequest { secret, marked }).await;
        let marker = marker.map_err(room_failed(owner_token_wrong))?;
        Ok(Response::new(v1::AddMarkerResponse {
            marker: Some(marker),
        }))
    }

    async fn add_samples(
        &self,
        request: Request<v1::AddSamplesRequest>,
    ) -> Result<Response<v1::AddSamplesResponse>, Status> {
        let (caller, request) = opened(request);
        let key = Key::of_caller(&caller);
        let (room, seat, has_started) = match &request.owned_seat {
            Some(owned) => self.owned_seat(&caller, owned).await?,
            None => self.seat_of(&caller, &request.ticket).await?,
        };
        let rooms = self.lookup.rooms();
        let header = rooms.header(room.id()).ok_or_else(ticket_unknown)?;
        if !has_started {
            return Err(status(
                Code::FailedPrecondition,
                "GAME_NOT_STARTED",
                "the game has not started: until then the seat may change hands",
                [],
            ));
        }
        let chunk = request.chunk.unwrap_or_default();
        (rooms.may_store(key, chunk.encoded_len())).map_err(Refusal::from)?;
        let now = room.clock().now();
        let adding = Arc::clone(rooms.samples()).add(header.game_id, seat, chunk, now);
        let recorded = adding.await.map_err(samples_refused)?;
        Ok(Response::new(v1::AddSamplesResponse { recorded }))
    }

    async fn follow_markers(
        &self,
        request: Request<v1::FollowMarkersRequest>,
    ) -> Result<Response<Self::FollowMarkersStream>, Status> {
        let (caller, request) = opened(request);
        let (room, secret) = self
            .find(caller, &request.room_id, &request.owner_token)
            .await?;
        let from = request.from_number.saturating_sub(1);
        let from = usize::try_from(from).unwrap_or(usize::MAX);
        let following = room.follow_markers(secret, from).await;
        let following = following.map_err(room_failed(owner_token_wrong))?;
        Ok(Response::new(Box::pin(followed(following))))
    }
}

/// The messages of a stream that follows markers.
fn followed(
    follower: MarkerFollower,
) -> impl Stream<Item = Result<v1::FollowMarkersResponse, Status>> {
    stream::unfold(Some(follower), |follower| async move {
        let mut follower = follower?;
        match follower.next().await {
            Ok(Some(markers)) => {
                let response = v1::FollowMarkersResponse { markers };
                Some((Ok(response), Some(follower)))
            }
            Ok(None) => None,
            Err(_) => Some((Err(room_gone()), None)),
        }
    })
}

/// The status for refused samples.
fn samples_refused(error: SampleError) -> Status {
    let message = error.to_string();
    match error {
        SampleError::Malformed(problem) => field("SAMPLES_REFUSED", &problem),
        SampleError::Off => status(Code::FailedPrecondition, "SAMPLES_OFF", message, []),
        SampleError::Deleted => ticket_unknown(),
        SampleError::TooManyStreams | SampleError::TooMany => {
            status(Code::ResourceExhausted, "TOO_MANY_SAMPLES", message, [])
        }
        SampleError::Io(error) => {
            tracing::error!(%error, "samples cannot be written");
            internal()
        }
    }
}
