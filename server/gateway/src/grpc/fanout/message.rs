//! The messages of a spectator's stream as another node has encoded them: where one ends, and what
//! in it is about the moment at which it was sent. Everything else is passed on as it is.

use bytes::{Buf as _, BufMut as _, Bytes, BytesMut};
use chefshat_proto::v1;
use prost::Message as _;
use prost::encoding::{DecodeContext, decode_key, skip_field};
use tokio::time::Duration;

use crate::grpc::heartbeats::PREFIX;

/// Longest message, bytes: as much as clients receive by default.
const MAX_LENGTH: usize = 4 * 1024 * 1024;
/// Fields of `SpectatorServiceWatchResponse`.
const ROOM: u32 = 2;
const AWAITED: u32 = 4;

/// Divides the data of a stream into messages. They are copied: received data are parts of the
/// buffers of a whole connection.
#[derive(Debug, Default)]
pub(super) struct Messages(BytesMut);

/// A message is longer than any of a spectator's stream.
#[derive(Debug)]
pub(super) struct TooLong;

impl Messages {
    pub(super) fn add(&mut self, data: &[u8]) {
        self.0.extend_from_slice(data);
    }

    /// The next message that is complete.
    pub(super) fn next(&mut self) -> Result<Option<Message>, TooLong> {
        loop {
            let Some(mut length) = self.0.get(1..PREFIX) else {
                return Ok(None);
            };
            let length = usize::try_from(length.get_u32()).unwrap_or(usize::MAX);
            if length > MAX_LENGTH {
                return Err(TooLong);
            }
            let Some(bytes) = self.0.get(..PREFIX + length) else {
                return Ok(None);
            };
            let message = (length > 0).then(|| Message::read(bytes));
            self.0.advance(PREFIX + length);
            if message.is_some() {
                return Ok(message);
            }
        }
    }
}

/// A message of a spectator's stream.
#[derive(Debug, Clone)]
pub(super) enum Message {
    /// Bytes that mean the same at any time, with their prefix.
    Lasting(Bytes),
    /// One with parts that are about the moment.
    OfTheMoment(Box<OfTheMoment>),
}

#[derive(Debug, Clone)]
pub(super) struct OfTheMoment {
    /// The other fields.
    lasting: Bytes,
    room: Option<v1::Room>,
    /// Whom the game waits for.
    awaited: Option<v1::Awaited>,
}

impl Message {
    fn read(bytes: &[u8]) -> Self {
        let is_compressed = bytes[0] != 0;
        let read = (!is_compressed).then(|| OfTheMoment::read(&bytes[PREFIX..]));
        match read.flatten() {
            Some(read) => Self::OfTheMoment(Box::new(read)),
            None => Self::Lasting(Bytes::copy_from_slice(bytes)),
        }
    }

    /// Bytes that it takes, about.
    pub(super) fn size(&self) -> usize {
        match self {
            Self::Lasting(bytes) => bytes.len(),
            Self::OfTheMoment(message) => {
                let room = message.room.as_ref().map_or(0, v1::Room::encoded_len);
                size_of::<OfTheMoment>() + message.lasting.len() + room
            }
        }
    }

    /// Whether it says whom the game waits for.
    pub(super) fn has_awaited(&self) -> bool {
        matches!(self, Self::OfTheMoment(it) if it.awaited.is_some())
    }

    /// The message for a spectator who receives it at this time after it was sent, with its prefix.
    /// `room`: the room as it is now, in place of that in the message. `awaits`: whether the game
    /// still waits for the same seat. `None` if nothing is left.
    pub(super) fn after(
        &self,
        age: Duration,
        room: Option<&v1::Room>,
        awaits: bool,
    ) -> Option<Bytes> {
        let message = match self {
            Self::Lasting(bytes) => return Some(bytes.clone()),
            Self::OfTheMoment(message) => message,
        };
        let age_ms = u32::try_from(age.as_millis()).unwrap_or(u32::MAX);
        let awaited = message.awaited.filter(|_| awaits).map(|it| match it.seat {
            None => it,
            Some(_) => v1::Awaited {
                waited_ms: it.waited_ms.saturating_add(age_ms),
                left_ms: it.left_ms.map(|left| left.saturating_sub(age_ms)),
                ..it
            },
        });
        let moment = v1::SpectatorServiceWatchResponse {
            room: (message.room.as_ref()).map(|former| room.unwrap_or(former).clone()),
            awaited: awaited.into_iter().collect(),
            ..v1::SpectatorServiceWatchResponse::default()
        };
        let length = message.lasting.len() + moment.encoded_len();
        if length == 0 {
            return None;
        }
        let mut out = BytesMut::with_capacity(PREFIX + length);
        out.put_u8(0);
        out.put_u32(u32::try_from(length).expect("at most MAX_LENGTH, and two short fields"));
        out.put_slice(&message.lasting);
        moment.encode(&mut out).expect("a buffer grows as needed");
        Some(out.freeze())
    }
}

impl OfTheMoment {
    /// Reads an encoded `SpectatorServiceWatchResponse`; `None` if nothing in it is of the moment, or
    /// it cannot be read.
    fn read(bytes: &[u8]) -> Option<Self> {
        let mut fields = bytes;
        let (mut lasting, mut moment) = (Vec::new(), Vec::new());
        while !fields.is_empty() {
            let start = fields;
            let (field, wire_type) = decode_key(&mut fields).ok()?;
            skip_field(wire_type, field, &mut fields, DecodeContext::default()).ok()?;
            let part = &start[..start.len() - fields.len()];
            match field {
                ROOM | AWAITED => moment.extend_from_slice(part),
                _ => lasting.extend_from_slice(part),
            }
        }
        if moment.is_empty() {
            return None;
        }
        let moment = v1::SpectatorServiceWatchResponse::decode(moment.as_slice()).ok()?;
        Some(Self {
            lasting: lasting.into(),
            room: moment.room,
            awaited: moment.awaited.last().copied(),
        })
    }
}
