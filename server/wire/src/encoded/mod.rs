//! The bodies of streamed responses, encoded when events happen. Public events are encoded once for
//! all seats and spectators. A body is a sequence of bytes: `PlayResponse` and
//! `PlayServiceWatchResponse` have their updates in field 1, `SpectatorServiceWatchResponse` has
//! its events.

mod decision;
mod field;
#[cfg(test)]
mod hidden_tests;
mod received;
#[cfg(test)]
mod silent_tests;

use std::marker::PhantomData;

use chefshat_proto::v1::{self, game_event::Kind, seat_update::Update};
use prost::Message;
use prost::bytes::{Buf, BufMut, Bytes};
use prost::encoding::{
    DecodeContext, WireType, encode_key, encode_varint, encoded_len_varint, key_len, skip_field,
};
use smallvec::SmallVec;
use tonic::codec::{BufferSettings, Codec};
use tonic_prost::{ProstCodec, ProstDecoder, ProstEncoder};

pub use decision::encode_decision;
use field::{put_message, put_number};
pub use received::Received;

/// The streaming services, with [`Updates`] as their responses.
pub mod service {
    #![allow(missing_docs, unreachable_pub, clippy::all, reason = "generated code")]
    include!("../../generated/chefshat.v1.rs");
}

/// Streams between nodes, with [`Updates`] as their responses.
pub mod peer {
    #![allow(missing_docs, unreachable_pub, clippy::all, reason = "generated code")]
    include!("../../generated/chefshat.peer.v1.rs");
}

/// Field of the updates in a response.
const RESPONSE_UPDATES: u32 = 1;
/// Field of a contested handle in the `PlayResponse` of a node.
const RESPONSE_CONTESTED: u32 = 2;
/// Typical size of a response: a few events and a decision request, bytes.
const USUAL_LENGTH: usize = 384;
/// Initial size of the buffers of a stream, bytes: two usual messages.
const BUFFER_SIZE: usize = 1_024;
/// Encoded bytes after which messages are written out before the next one is encoded.
const YIELD_THRESHOLD: usize = 32 * 1_024;
/// Usual number of updates sent together: a result, events, a decision request.
const USUAL_PARTS: usize = 4;
/// Fields of `SpectatorServiceWatchResponse`; its events have the field number [`BATCH_EVENTS`].
const SPECTATOR_ROOM: u32 = 2;
const SPECTATOR_SNAPSHOT: u32 = 3;
const SPECTATOR_AWAITED: u32 = 4;
/// Fields of `SeatUpdate`.
const UPDATE_HANDLE: u32 = 1;
const UPDATE_EVENTS: u32 = 3;
const UPDATE_DECISION: u32 = 4;
const UPDATE_RESULT: u32 = 5;
/// Field of the events in an `EventBatch`.
const BATCH_EVENTS: u32 = 1;

/// A codec with small buffers, for streams of small messages. Successive messages fill a buffer
/// from end to end: with many streams, the default of 8 KiB each does not fit the caches.
#[derive(Debug)]
pub struct SmallBuffers<T, U>(PhantomData<(T, U)>);

impl<T, U> Default for SmallBuffers<T, U> {
    fn default() -> Self {
        Self(PhantomData)
    }
}

impl<T, U> Codec for SmallBuffers<T, U>
where
    T: Message + Send + 'static,
    U: Message + Default + Send + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = ProstEncoder<T>;
    type Decoder = ProstDecoder<U>;

    fn encoder(&mut self) -> Self::Encoder {
        ProstCodec::<T, U>::raw_encoder(BufferSettings::new(BUFFER_SIZE, YIELD_THRESHOLD))
    }

    fn decoder(&mut self) -> Self::Decoder {
        ProstCodec::<T, U>::raw_decoder(BufferSettings::new(BUFFER_SIZE, YIELD_THRESHOLD))
    }
}

/// Encoded updates, in order: the body of a streamed response.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Updates {
    bytes: Vec<u8>,
    /// The end and weight of each update.
    parts: SmallVec<[Part; USUAL_PARTS]>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Part {
    end: usize,
    weight: usize,
}

impl Updates {
    /// Adds an update of any kind.
    pub fn add(&mut self, handle: u32, update: Update) {
        let weight = match &update {
            Update::Events(batch) => 1 + batch.events.len(),
            _ => 1,
        };
        let update = v1::SeatUpdate {
            handle,
            update: Some(update),
        };
        prost::encoding::message::encode(RESPONSE_UPDATES, &update, &mut self.bytes);
        self.end_part(weight);
    }

    /// Adds the result of an answer.
    pub fn add_result(&mut self, handle: u32, result: &v1::AnswerResult) {
        if self.bytes.capacity() == 0 {
            self.bytes.reserve(USUAL_LENGTH);
        }
        put_message(&mut self.bytes, RESPONSE_UPDATES, |out| {
            put_number(out, UPDATE_HANDLE, handle.into());
            put_message(out, UPDATE_RESULT, |out| put_result(out, result));
        });
        self.end_part(1);
    }

    /// Adds a batch of `count` events, encoded by [`Events`].
    pub fn add_events(&mut self, handle: u32, events: &[u8], count: usize) {
        self.add_encoded(handle, UPDATE_EVENTS, events);
        self.end_part(1 + count);
    }

    /// Adds a decision request, encoded by [`encode_decision`].
    pub fn add_decision(&mut self, handle: u32, decision: &[u8]) {
        self.add_encoded(handle, UPDATE_DECISION, decision);
        self.end_part(1);
    }

    /// Adds the question of a node whether the client's stream is open, so that this seat may be
    /// attached.
    pub fn add_contested(&mut self, handle: u32) {
        prost::encoding::uint32::encode(RESPONSE_CONTESTED, &handle, &mut self.bytes);
        self.end_part(1);
    }

    /// Adds the room to a response for a spectator.
    pub fn add_room(&mut self, room: &v1::Room) {
        prost::encoding::message::encode(SPECTATOR_ROOM, room, &mut self.bytes);
        self.end_part(1);
    }

    /// Adds a snapshot to a response for a spectator.
    pub fn add_snapshot(&mut self, snapshot: &v1::Snapshot) {
        prost::encoding::message::encode(SPECTATOR_SNAPSHOT, snapshot, &mut self.bytes);
        self.end_part(1);
    }

    /// Adds whom the game waits for to a response for a spectator.
    pub fn add_spectator_awaited(&mut self, awaited: &v1::Awaited) {
        prost::encoding::message::encode(SPECTATOR_AWAITED, awaited, &mut self.bytes);
        self.end_part(1);
    }

    /// Adds `count` events to a response for a spectator, encoded by [`Events`].
    pub fn add_spectator_events(&mut self, events: &[u8], count: usize) {
        self.bytes.extend_from_slice(events);
        self.end_part(1 + count);
    }

    fn add_encoded(&mut self, handle: u32, field: u32, content: &[u8]) {
        let handle_length = if handle == 0 {
            0
        } else {
            prost::encoding::uint32::encoded_len(UPDATE_HANDLE, &handle)
        };
        let update_length = handle_length + delimited_length(field, content.len());
        let length = delimited_length(RESPONSE_UPDATES, update_length);
        if self.bytes.capacity() - self.bytes.len() < length {
            self.bytes.reserve(length.max(USUAL_LENGTH));
        }
        start_delimited(&mut self.bytes, RESPONSE_UPDATES, update_length);
        if handle != 0 {
            prost::encoding::uint32::encode(UPDATE_HANDLE, &handle, &mut self.bytes);
        }
        start_delimited(&mut self.bytes, field, content.len());
        self.bytes.put_slice(content);
    }

    fn end_part(&mut self, weight: usize) {
        self.parts.push(Part {
            end: self.bytes.len(),
            weight,
        });
    }
}

impl Updates {
    /// Whether there is nothing.
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    /// Their weight, in updates and events.
    pub fn weight(&self) -> usize {
        self.parts.iter().map(|part| part.weight).sum()
    }

    /// Moves everything from `other` to the end of `self`.
    pub fn append(&mut self, other: &mut Self) {
        if self.is_empty() {
            std::mem::swap(self, other);
            return;
        }
        let before = self.bytes.len();
        self.bytes.append(&mut other.bytes);
        self.parts.extend(other.parts.drain(..).map(|part| Part {
            end: before + part.end,
            ..part
        }));
    }

    /// Takes updates from the front with a total weight of at most `most`, but at least one.
    pub fn take(&mut self, most: usize) -> Self {
        let mut weight = 0;
        let count = self
            .parts
            .iter()
            .take_while(|part| {
                weight += part.weight;
                weight <= most
            })
            .count()
            .max(1)
            .min(self.parts.len());
        let taken: SmallVec<[Part; USUAL_PARTS]> = self.parts.drain(..count).collect();
        let end = taken.last().map_or(0, |part| part.end);
        for part in &mut self.parts {
            part.end -= end;
        }
        let rest = self.bytes.split_off(end);
        Self {
            bytes: std::mem::replace(&mut self.bytes, rest),
            parts: taken,
        }
    }
}

/// A response is written as it is, and read only by another node, as updates for seats.
impl Message for Updates {
    fn encode_raw(&self, buffer: &mut impl BufMut) {
        buffer.put_slice(&self.bytes);
    }

    fn merge_field(
        &mut self,
        tag: u32,
        wire_type: WireType,
        buffer: &mut impl Buf,
        context: DecodeContext,
    ) -> Result<(), prost::DecodeError> {
        match tag {
            RESPONSE_UPDATES => {
                let mut update = Bytes::new();
                prost::encoding::bytes::merge(wire_type, &mut update, buffer, context)?;
                self.add_received(&update);
            }
            RESPONSE_CONTESTED => {
                let mut handle = 0;
                prost::encoding::uint32::merge(wire_type, &mut handle, buffer, context)?;
                self.add_contested(handle);
            }
            _ => skip_field(wire_type, tag, buffer, context)?,
        }
        Ok(())
    }

    fn encoded_len(&self) -> usize {
        self.bytes.len()
    }

    fn clear(&mut self) {
        *self = Self::default();
    }
}

/// Encoded events, in order from a first position on: the body of an `EventBatch`.
#[derive(Debug, Default)]
pub struct Events {
    first: usize,
    bytes: Vec<u8>,
    ends: Vec<u32>,
}

impl Events {
    /// No events yet; the next one has this position.
    pub fn starting_at(first: usize) -> Self {
        Self {
            first,
            ..Self::default()
        }
    }

    /// Position of the first event.
    pub fn first(&self) -> usize {
        self.first
    }

    /// Adds an event.
    pub fn add(&mut self, event: &v1::GameEvent) {
        put_event(&mut self.bytes, event);
        let end =
            u32::try_from(self.bytes.len()).expect("the events of a game are far below 4 GiB");
        self.ends.push(end);
    }

    /// Drops the events before a position that is not after the last one.
    pub fn drop_before(&mut self, position: usize) {
        let bytes = self.range(self.first, position).len();
        self.bytes.drain(..bytes);
        self.ends.drain(..position - self.first);
        let bytes = u32::try_from(bytes).expect("the ends fit u32");
        self.ends.iter_mut().for_each(|end| *end -= bytes);
        self.first = position;
    }

    /// The events between two positions, neither of which is before the first.
    pub fn range(&self, from: usize, to: usize) -> &[u8] {
        let start = |position: usize| {
            let end = (position - self.first)
                .checked_sub(1)
                .and_then(|before| self.ends.get(before));
            end.map_or(0, |end| usize::try_from(*end).expect("positions fit usize"))
        };
        &self.bytes[start(from)..start(to)]
    }

    /// The position after the last event.
    pub fn end(&self) -> usize {
        self.first + self.ends.len()
    }
}

/// Encodes one event into a batch. Plays and passes, by far the most frequent, are written
/// directly.
pub fn put_event(batch: &mut Vec<u8>, event: &v1::GameEvent) {
    let common = |out: &mut Vec<u8>| {
        put_number(out, 1, event.sequence);
        put_number(out, 2, event.elapsed_ms);
    };
    match &event.kind {
        Some(Kind::Play(play)) if event.rewards.is_empty() => {
            put_message(batch, BATCH_EVENTS, |out| {
                common(out);
                put_message(out, 13, |out| {
                    put_number(out, 1, play.seat.into());
                    put_number(out, 2, play.action.into());
                    put_number(out, 3, play.face.into());
                    put_number(out, 4, play.quantity.into());
                    put_number(out, 5, play.jokers.into());
                    put_number(out, 6, play.cards_left.into());
                    put_number(out, 7, enum_number(play.source));
                    put_number(out, 8, play.decision_time_us);
                });
            });
        }
        Some(Kind::Pass(pass)) if event.rewards.is_empty() => {
            put_message(batch, BATCH_EVENTS, |out| {
                common(out);
                put_message(out, 14, |out| {
                    put_number(out, 1, pass.seat.into());
                    put_number(out, 2, enum_number(pass.source));
                    put_number(out, 3, pass.decision_time_us);
                });
            });
        }
        _ => prost::encoding::message::encode(BATCH_EVENTS, event, batch),
    }
}

fn put_result(out: &mut Vec<u8>, result: &v1::AnswerResult) {
    if result.status() == v1::AnswerStatus::Invalid {
        return result.encode_raw(out);
    }
    put_number(out, 1, result.decision_id);
    put_number(out, 2, enum_number(result.status));
    put_number(out, 3, result.action.into());
    put_number(out, 4, result.decision_time_us);
    put_number(out, 8, result.annotations_dropped.into());
}

fn enum_number(value: i32) -> u64 {
    u64::try_from(value).expect("enums of the protocol are not negative")
}

fn delimited_length(field: u32, length: usize) -> usize {
    key_len(field) + encoded_len_varint(u64::try_from(length).expect("lengths fit u64")) + length
}

fn start_delimited(bytes: &mut Vec<u8>, field: u32, length: usize) {
    encode_key(field, WireType::LengthDelimited, bytes);
    encode_varint(u64::try_from(length).expect("lengths fit u64"), bytes);
}

#[cfg(test)]
mod tests {
    use crate::encoded::*;

    fn event(sequence: u64) -> v1::GameEvent {
        v1::GameEvent {
            sequence,
            elapsed_ms: 5,
            kind: Some(v1::game_event::Kind::Pass(v1::Pass {
                seat: 3,
                ..v1::Pass::default()
            })),
            ..v1::GameEvent::default()
        }
    }

    fn decoded(updates: &Updates) -> Vec<v1::SeatUpdate> {
        let response = v1::PlayResponse::decode(updates.encode_to_vec().as_slice());
        response.expect("a response").updates
    }

    #[test]
    fn dropped_events_leave_the_others_where_they_are() {
        let mut events = Events::starting_at(5);
        (1..=300).for_each(|number| events.add(&event(number)));
        let kept = events.range(100, 305).to_vec();
        events.drop_before(100);
        assert_eq!((events.first(), events.end()), (100, 305));
        assert_eq!(events.range(100, 305), kept);
        events.add(&event(301));
        assert_eq!(events.range(100, 305), kept);
        events.drop_before(306);
        assert_eq!((events.first(), events.end()), (306, 306));
    }

    #[test]
    fn messages_written_directly_are_those_of_prost() {
        let numbers = [0, 1, 127, 128, 300, 70_000];
        let large = [0, 1, 127, 128, 1 << 40];
        for (number, time) in numbers.iter().flat_map(|n| large.map(|time| (*n, time))) {
            let play = v1::Play {
                seat: number,
                action: number,
                face: number,
                quantity: number,
                jokers: number,
                cards_left: number,
                source: v1::DecisionSource::Timeout.into(),
                decision_time_us: time,
            };
            let pass = v1::Pass {
                seat: number,
                source: v1::DecisionSource::Agent.into(),
                decision_time_us: time,
            };
            for kind in [Kind::Play(play), Kind::Pass(pass)] {
                let event = v1::GameEvent {
                    sequence: time,
                    elapsed_ms: number.into(),
                    rewards: Vec::new(),
                    kind: Some(kind),
                };
                let (mut direct, mut prost) = (Vec::new(), Vec::new());
                put_event(&mut direct, &event);
                prost::encoding::message::encode(BATCH_EVENTS, &event, &mut prost);
                assert_eq!(direct, prost);
            }
            for status in [
                v1::AnswerStatus::Accepted,
                v1::AnswerStatus::Closed,
                v1::AnswerStatus::UnknownDecision,
                v1::AnswerStatus::Invalid,
            ] {
                let invalid = status == v1::AnswerStatus::Invalid;
                let result = v1::AnswerResult {
                    decision_id: time,
                    status: status.into(),
                    action: number,
                    decision_time_us: time,
                    detail: if invalid {
                        "no ".repeat(90)
                    } else {
                        String::new()
                    },
                    invalid_attempts_left: invalid.then_some(0),
                    reward: invalid.then_some(-1.0),
                    annotations_dropped: number == 1,
                };
                let mut updates = Updates::default();
                updates.add_result(number, &result);
                let mut prost = Updates::default();
                prost.add(number, Update::Result(result));
                assert_eq!(updates, prost);
            }
        }
    }

    #[test]
    fn parts_encoded_separately_equal_the_encoded_message() {
        let decision = v1::DecisionRequest {
            decision_id: 7,
            observation: Some(v1::Observation {
                hand: vec![1; 12],
                ..v1::Observation::default()
            }),
            action_mask: vec![255; 27],
            ..v1::DecisionRequest::default()
        };
        let mut events = Events::default();
        (1..=300).for_each(|number| events.add(&event(number)));
        for handle in [0, 1, 127, 128, 5000] {
            let mut updates = Updates::default();
            updates.add(handle, Update::Result(v1::AnswerResult::default()));
            updates.add_events(handle, events.range(10, 300), 290);
            updates.add_decision(handle, &decision.encode_to_vec());
            let expected = [
                Update::Result(v1::AnswerResult::default()),
                Update::Events(v1::EventBatch {
                    events: (11..=300).map(event).collect(),
                }),
                Update::Decision(decision.clone()),
            ]
            .map(|update| v1::SeatUpdate {
                handle,
                update: Some(update),
            });
            assert_eq!(decoded(&updates), expected);
            assert_eq!(updates.weight(), 1 + 291 + 1);
            assert_eq!(decoded(&updates).len(), 3);
        }
        let watch =
            v1::PlayServiceWatchResponse::decode(Updates::default().encode_to_vec().as_slice());
        assert!(watch.expect("an empty response").updates.is_empty());
    }

    #[test]
    fn updates_are_appended_and_taken_in_order() {
        let one = |handle| {
            let mut updates = Updates::default();
            updates.add_events(handle, &[], 9);
            updates
        };
        let mut updates = Updates::default();
        for handle in 0..6 {
            updates.append(&mut one(handle));
        }
        assert_eq!(updates.weight(), 60);
        let first = updates.take(35);
        assert_eq!((decoded(&first).len(), decoded(&updates).len()), (3, 3));
        let second = updates.take(1);
        assert_eq!(
            decoded(&second).len(),
            1,
            "at least one, whatever its weight"
        );
        let handles: Vec<u32> = [first, second, updates]
            .iter()
            .flat_map(decoded)
            .map(|update| update.handle)
            .collect();
        assert_eq!(handles, [0, 1, 2, 3, 4, 5]);
    }
}
