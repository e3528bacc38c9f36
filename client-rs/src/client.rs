//! The client and its calls about servers, rooms, seats and records. `tournaments` adds calls about
//! tournaments, `vector` those about games stepped in batches, `table` those about physical tables.
//! A `Client` holds only a connection: it is cheap to clone, and calls may run in parallel.

use std::pin::pin;

use futures::{Stream, TryStreamExt as _};
use prost::Message as _;
use tonic::transport::Channel;
use tonic::{Status, Streaming};

use crate::connection::{self, ConnectOptions, Connection, MAX_RESPONSE_BYTES};
use crate::repeat::{identify, repeated};
use crate::session::Session;
use crate::v1::act_request::Command;
use crate::v1::instrument_service_client::InstrumentServiceClient;
use crate::v1::play_service_client::PlayServiceClient;
use crate::v1::record_service_client::RecordServiceClient;
use crate::v1::room_service_client::RoomServiceClient;
use crate::v1::server_service_client::ServerServiceClient;
use crate::{Agent, Error, Outcome, PlayError, PlayOptions, Spectator, run, v1};

/// Maximum size of a record, as of its file on disk, bytes.
const MAX_RECORD_BYTES: usize = 512 << 20;
/// Maximum number of lines of a record, as of its file on disk.
const MAX_RECORD_LINES: usize = 2_100_000;

/// A connection to a server, restored automatically when it is lost.
#[derive(Clone, Debug)]
pub struct Client {
    connection: Connection,
}

impl Client {
    /// Connects to a server at `https://host`, `http://host:port` or `host:port`, without a token:
    /// environment variables are not read ([`ConnectOptions::from_env`] does).
    ///
    /// # Errors
    /// `ADDRESS_REFUSED` for another scheme, or `http://` without a port; `CONNECT_FAILED` if no
    /// server answers within five seconds; `TLS_FAILED` if the server's certificate is not trusted
    /// or the server does not use TLS.
    pub async fn connect(url: impl AsRef<str>) -> Result<Self, Error> {
        Self::connect_with(url, &ConnectOptions::default()).await
    }

    /// [`connect`](Self::connect) with options.
    ///
    /// # Errors
    /// As [`connect`](Self::connect); `CA_REFUSED` if the file of certificate authorities cannot be
    /// used, `TOKEN_REFUSED` for a token with characters that no token has.
    pub async fn connect_with(
        url: impl AsRef<str>,
        options: &ConnectOptions,
    ) -> Result<Self, Error> {
        let connection = connection::connect(url.as_ref(), options).await?;
        Ok(Self { connection })
    }

    /// Uses an existing channel, without a token: over a Unix socket, on a simulated network.
    pub fn from_channel(channel: Channel) -> Self {
        let connection = Connection::without_token(channel);
        Self { connection }
    }

    /// A client on the same connection that shows these owner tokens and tickets with every call, at
    /// most 16. They show private rooms and tournaments, unlisted ones in lists, and their records.
    ///
    /// # Errors
    /// `SECRET_REFUSED` for a secret with characters that no secret has.
    pub fn with_secrets<S: AsRef<str>>(
        &self,
        secrets: impl IntoIterator<Item = S>,
    ) -> Result<Self, Error> {
        let connection = self.connection.with_secrets(secrets)?;
        Ok(Self { connection })
    }

    /// The connection, for calls of the protocol without a method here.
    pub fn channel(&self) -> Connection {
        self.connection.clone()
    }

    /// The server's version, limits and features.
    ///
    /// # Errors
    /// A failed connection.
    pub async fn server_info(&self) -> Result<v1::GetServerInfoResponse, Error> {
        let mut service = ServerServiceClient::new(self.channel());
        let response = service.get_server_info(v1::GetServerInfoRequest {}).await?;
        Ok(response.into_inner())
    }

    /// The texts of all actions for a number of faces, 4..=15; 0 means the default, 11.
    ///
    /// # Errors
    /// `FACES_OUT_OF_RANGE`.
    pub async fn action_table(&self, faces: u32) -> Result<v1::GetActionTableResponse, Error> {
        let service = ServerServiceClient::new(self.channel());
        let request = v1::GetActionTableRequest { faces };
        repeated(|| async { service.clone().get_action_table(request).await }).await
    }

    /// Creates a room. The response has the join code for its participants and the token that
    /// closes it. If the response is lost, the call is repeated and creates no second room.
    ///
    /// # Errors
    /// `RULE_SET_REFUSED`, `POLICY_REFUSED`, `SEATS_REFUSED`, `SEED_REFUSED` or `NAME_REFUSED`,
    /// with the offending field in the metadata; `TOO_MANY_ROOMS`; `SHUTTING_DOWN`.
    pub async fn create_room(
        &self,
        mut request: v1::CreateRoomRequest,
    ) -> Result<v1::CreateRoomResponse, Error> {
        let service = RoomServiceClient::new(self.channel());
        identify(&mut request.request_id);
        repeated(|| async { service.clone().create_room(request.clone()).await }).await
    }

    /// The public view of a room.
    ///
    /// # Errors
    /// `ROOM_UNKNOWN`.
    pub async fn get_room(&self, room_id: impl Into<String>) -> Result<v1::Room, Error> {
        let service = RoomServiceClient::new(self.channel());
        let request = v1::GetRoomRequest {
            room_id: room_id.into(),
            join_code: String::new(),
        };
        let response = repeated(|| async { service.clone().get_room(request.clone()).await });
        response
            .await?
            .room
            .ok_or_else(|| Error::incomplete("room"))
    }

    /// Gives up a seat before the game starts: the seat becomes free and the ticket invalid.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `GAME_STARTED` or `GAME_OVER`.
    pub async fn leave_room(&self, ticket: impl Into<String>) -> Result<v1::Room, Error> {
        let mut service = RoomServiceClient::new(self.channel());
        let request = v1::LeaveRoomRequest {
            ticket: ticket.into(),
        };
        let response = service.leave_room(request).await?.into_inner();
        response.room.ok_or_else(|| Error::incomplete("room"))
    }

    /// A page of the server's rooms, newest first.
    ///
    /// # Errors
    /// A failed connection, or an unknown page token.
    pub async fn list_rooms(
        &self,
        request: v1::ListRoomsRequest,
    ) -> Result<v1::ListRoomsResponse, Error> {
        let service = RoomServiceClient::new(self.channel());
        repeated(|| async { service.clone().list_rooms(request.clone()).await }).await
    }

    /// Takes a seat. The response has the ticket to play on it. If the response is lost, the call
    /// is repeated and takes no second seat.
    ///
    /// # Errors
    /// `JOIN_CODE_WRONG`, `ROOM_FULL`, `SEAT_TAKEN`, `KIND_NOT_ADMITTED`,
    /// `CLIENT_HAS_SEAT`, `GAME_STARTED`, `ROOM_UNKNOWN`.
    pub async fn join(
        &self,
        mut request: v1::JoinRoomRequest,
    ) -> Result<v1::JoinRoomResponse, Error> {
        let service = RoomServiceClient::new(self.channel());
        identify(&mut request.request_id);
        repeated(|| async { service.clone().join_room(request.clone()).await }).await
    }

    /// Takes the first free seat of the room with this join code, as an agent.
    ///
    /// # Errors
    /// As [`Client::join`].
    pub async fn join_with_code(
        &self,
        join_code: impl Into<String>,
        name: impl Into<String>,
    ) -> Result<v1::JoinRoomResponse, Error> {
        let (join_code, name) = (join_code.into(), name.into());
        self.join(v1::JoinRoomRequest {
            join_code,
            name,
            ..Default::default()
        })
        .await
    }

    /// Closes a room; a running game is aborted.
    ///
    /// # Errors
    /// `OWNER_TOKEN_WRONG`, `ROOM_UNKNOWN`.
    pub async fn close_room(
        &self,
        room_id: impl Into<String>,
        owner_token: impl Into<String>,
    ) -> Result<v1::Room, Error> {
        let mut service = RoomServiceClient::new(self.channel());
        let request = v1::CloseRoomRequest {
            room_id: room_id.into(),
            owner_token: owner_token.into(),
        };
        let response = service.close_room(request).await?.into_inner();
        response.room.ok_or_else(|| Error::incomplete("room"))
    }

    /// A page of the server's records, oldest first by default.
    ///
    /// # Errors
    /// A failed connection, or an unknown page token.
    pub async fn list_records(
        &self,
        request: v1::ListRecordsRequest,
    ) -> Result<v1::ListRecordsResponse, Error> {
        let service =
            RecordServiceClient::new(self.channel()).max_decoding_message_size(MAX_RESPONSE_BYTES);
        repeated(|| async { service.clone().list_records(request.clone()).await }).await
    }

    /// The record of a game that has ended, line by line.
    ///
    /// # Errors
    /// `GAME_UNKNOWN`, `GAME_RUNNING`; `RECORD_TOO_LARGE` if the server sends more than a record can
    /// have.
    pub async fn record(&self, game_id: impl Into<String>) -> Result<Vec<v1::RecordLine>, Error> {
        let parts = self.record_parts(game_id.into()).await?;
        lines_of(parts, MAX_RECORD_BYTES, MAX_RECORD_LINES).await
    }

    /// The header of the record of a game that has ended.
    ///
    /// # Errors
    /// `GAME_UNKNOWN`, `GAME_RUNNING`.
    pub async fn record_header(
        &self,
        game_id: impl Into<String>,
    ) -> Result<v1::RecordHeader, Error> {
        let mut parts = self.record_parts(game_id.into()).await?;
        let first = parts.message().await?.unwrap_or_default().lines.into_iter();
        match first.map(|line| line.line).next().flatten() {
            Some(v1::record_line::Line::Header(header)) => Ok(*header),
            _ => Err(Error::incomplete("header")),
        }
    }

    async fn record_parts(
        &self,
        game_id: String,
    ) -> Result<Streaming<v1::GetRecordResponse>, Error> {
        let service =
            RecordServiceClient::new(self.channel()).max_decoding_message_size(MAX_RESPONSE_BYTES);
        let request = v1::GetRecordRequest { game_id };
        repeated(|| async { service.clone().get_record(request.clone()).await }).await
    }

    /// Puts a marker into the record of a room. Nobody but the owner of the room learns of it.
    ///
    /// # Errors
    /// `MARKER_REFUSED`, `OWNER_TOKEN_WRONG`, `ROOM_UNKNOWN`, `GAME_OVER`, `TOO_MANY_MARKERS`.
    pub async fn add_marker(&self, request: v1::AddMarkerRequest) -> Result<v1::Marker, Error> {
        let mut service = InstrumentServiceClient::new(self.channel());
        let response = service.add_marker(request).await?.into_inner();
        response.marker.ok_or_else(|| Error::incomplete("marker"))
    }

    /// Records samples of a seat, such as thirty a second of affect, beside the game. Returns how many
    /// were new: a chunk can be sent again.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `SAMPLES_REFUSED`, `GAME_NOT_STARTED`, `SAMPLES_OFF`, `TOO_MANY_SAMPLES`,
    /// `DISK_NEARLY_FULL`.
    pub async fn add_samples(
        &self,
        ticket: impl Into<String>,
        chunk: v1::SampleChunk,
    ) -> Result<u32, Error> {
        let mut service = InstrumentServiceClient::new(self.channel());
        let request = v1::AddSamplesRequest {
            ticket: ticket.into(),
            chunk: Some(chunk),
            owned_seat: None,
        };
        Ok(service.add_samples(request).await?.into_inner().recorded)
    }

    /// Sends an expression of affect for a seat, at any time.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `EXPRESSION_REFUSED`, `GAME_OVER`.
    pub async fn express(
        &self,
        ticket: impl Into<String>,
        expression: v1::Expression,
    ) -> Result<(), Error> {
        let mut service = PlayServiceClient::new(self.channel());
        let request = v1::ActRequest {
            ticket: ticket.into(),
            command: Some(Command::Express(expression)),
        };
        service.act(request).await?;
        Ok(())
    }

    /// Asks for a hint for the open decision of the ticket's seat, where the room's policy allows
    /// hints. It takes about half a second of the seat's time.
    ///
    /// # Errors
    /// `TICKET_UNKNOWN`, `HINTS_OFF`, `DECISION_CLOSED`, `TOO_MANY_HINTS`.
    pub async fn hint(
        &self,
        ticket: impl Into<String>,
        decision_id: u64,
    ) -> Result<v1::Hint, Error> {
        let mut ask = v1::AskHint {
            decision_id,
            ..v1::AskHint::default()
        };
        identify(&mut ask.request_id);
        let response = self.act(ticket.into(), Command::Hint(ask)).await?;
        Ok(response.hint.unwrap_or_default())
    }

    /// Sends a command for one seat, again if its response is lost.
    pub(crate) async fn act(
        &self,
        ticket: String,
        command: Command,
    ) -> Result<v1::ActResponse, Error> {
        let request = v1::ActRequest {
            ticket,
            command: Some(command),
        };
        let service = PlayServiceClient::new(self.channel());
        repeated(|| async { service.clone().act(request.clone()).await }).await
    }

    /// Watches a room from an event number on; 0 and 1 are the first event. Connects when the first
    /// event is requested.
    pub fn spectate(&self, room_id: impl Into<String>, from_sequence: u64) -> Spectator {
        Spectator::new(self.channel(), room_id.into(), from_sequence)
    }

    /// Plays a seat until its game is over. Dropping the future leaves the seat.
    ///
    /// # Errors
    /// See [`PlayError`]. Lost connections are restored with the default
    /// [`Backoff`](crate::Backoff).
    pub async fn play(
        &self,
        ticket: impl Into<String>,
        agent: impl Agent,
    ) -> Result<Outcome, PlayError> {
        let options = PlayOptions::default();
        self.play_with(ticket, agent, &options).await
    }

    /// [`play`](Self::play) with options.
    ///
    /// # Errors
    /// See [`PlayError`].
    pub async fn play_with(
        &self,
        ticket: impl Into<String>,
        agent: impl Agent,
        options: &PlayOptions,
    ) -> Result<Outcome, PlayError> {
        let outcomes = self.play_many_with([(ticket.into(), agent)], options).await;
        let outcome = outcomes.into_iter().next();
        outcome.expect("there is an outcome for each seat")
    }

    /// Plays any number of seats, in any number of games, over one stream. Returns the outcomes
    /// when all games are over, in the order of the seats. For agents of different types use
    /// `Box<dyn Agent>`.
    pub async fn play_many<A: Agent>(
        &self,
        seats: impl IntoIterator<Item = (String, A)>,
    ) -> Vec<Result<Outcome, PlayError>> {
        let options = PlayOptions::default();
        self.play_many_with(seats, &options).await
    }

    /// [`play_many`](Self::play_many) with options.
    pub async fn play_many_with<A: Agent>(
        &self,
        seats: impl IntoIterator<Item = (String, A)>,
        options: &PlayOptions,
    ) -> Vec<Result<Outcome, PlayError>> {
        let mut session = Session::new(seats, options);
        run::run(self.channel(), &mut session, &options.backoff).await;
        session.into_outcomes()
    }
}

/// The lines of the parts of a record.
async fn lines_of(
    parts: impl Stream<Item = Result<v1::GetRecordResponse, Status>>,
    most_bytes: usize,
    most_lines: usize,
) -> Result<Vec<v1::RecordLine>, Error> {
    let mut parts = pin!(parts);
    let (mut lines, mut bytes) = (Vec::new(), 0);
    while let Some(part) = parts.try_next().await? {
        bytes += part.encoded_len();
        lines.extend(part.lines);
        if bytes > most_bytes || lines.len() > most_lines {
            return Err(Error::record_too_large());
        }
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use futures::StreamExt as _;

    use super::*;

    #[tokio::test]
    async fn a_record_without_an_end_is_refused() {
        let part = || v1::GetRecordResponse {
            lines: vec![v1::RecordLine::default(); 10],
        };
        let endless = || futures::stream::repeat_with(move || Ok(part()));
        let bytes = part().encoded_len();
        for (most_bytes, most_lines) in [(bytes * 5, usize::MAX), (usize::MAX, 50)] {
            let read = lines_of(endless().take(5), most_bytes, most_lines).await;
            assert_eq!(read.expect("it fits").len(), 50);
            let refused = lines_of(endless(), most_bytes, most_lines).await;
            let error = refused.expect_err("it has no end");
            assert_eq!(error.reason(), Some("RECORD_TOO_LARGE"));
        }
    }
}
