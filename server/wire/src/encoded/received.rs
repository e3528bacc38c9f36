//! Updates that another node has encoded: a gateway passes them on as they are, and reads no more
//! of them than it must know of their seats.

use chefshat_proto::v1;
use prost::encoding::{WireType, decode_key, decode_varint};

use super::{
    BATCH_EVENTS, RESPONSE_CONTESTED, RESPONSE_UPDATES, UPDATE_DECISION, UPDATE_EVENTS,
    UPDATE_HANDLE, Updates, start_delimited,
};

/// Fields of `SeatUpdate`.
const UPDATE_ATTACHED: u32 = 2;
const UPDATE_DETACHED: u32 = 7;
const UPDATE_REFUSED: u32 = 8;
const UPDATE_ENTERED: u32 = 9;
/// Field of the number in a `DecisionRequest`.
const DECISION_ID: u32 = 1;

/// Field of the reason in a `Detached`.
const DETACHED_REASON: u32 = 1;
/// The reason if the server stops.
const STOPPING: u64 = v1::DetachReason::ServerStopping as u64;

/// What an update says about its seat.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// The seat or participant is attached.
    Attached,
    /// The seat or participant is detached.
    Detached {
        /// The node stops: what it has continues at another one.
        stops: bool,
    },
    /// A command was refused.
    Refused,
    /// This decision is open.
    Decision(u64),
    /// Another stream has the seat or participant. The client must not see this.
    Contested,
    /// Anything else.
    Other,
}

impl Updates {
    /// The handles of updates for seats, and what each says.
    pub fn received(&self) -> impl Iterator<Item = (u32, Received)> + '_ {
        let starts = std::iter::once(0).chain(self.parts.iter().map(|part| part.end));
        starts.zip(&self.parts).filter_map(|(start, part)| {
            Some(match Fields(&self.bytes[start..part.end]).next()? {
                (RESPONSE_CONTESTED, handle) => (handle.handle(), Received::Contested),
                (_, update) => read(update.bytes()),
            })
        })
    }

    /// The updates without the questions of another node.
    pub fn without_contested(&self) -> Self {
        let mut others = Self::default();
        let mut start = 0;
        for (part, (_, received)) in self.parts.iter().zip(self.received()) {
            if received != Received::Contested {
                others.bytes.extend(&self.bytes[start..part.end]);
                others.end_part(part.weight);
            }
            start = part.end;
        }
        others
    }

    /// Adds an encoded `SeatUpdate`.
    pub(super) fn add_received(&mut self, update: &[u8]) {
        start_delimited(&mut self.bytes, RESPONSE_UPDATES, update.len());
        self.bytes.extend_from_slice(update);
        let events = Fields(update)
            .filter(|(field, _)| *field == UPDATE_EVENTS)
            .flat_map(|(_, batch)| Fields(batch.bytes()))
            .filter(|(field, _)| *field == BATCH_EVENTS);
        let weight = 1 + events.count();
        self.end_part(weight);
    }
}

/// Reads the handle of an encoded `SeatUpdate` and what it says.
fn read(update: &[u8]) -> (u32, Received) {
    let (mut handle, mut received) = (0, Received::Other);
    for (field, value) in Fields(update) {
        match field {
            UPDATE_HANDLE => handle = value.handle(),
            UPDATE_ATTACHED | UPDATE_ENTERED => received = Received::Attached,
            UPDATE_DETACHED => {
                let mut fields = Fields(value.bytes());
                let reason = fields.find(|(field, _)| *field == DETACHED_REASON);
                let stops = reason.is_some_and(|(_, reason)| reason.number() == STOPPING);
                received = Received::Detached { stops };
            }
            UPDATE_REFUSED => received = Received::Refused,
            UPDATE_DECISION => {
                let mut fields = Fields(value.bytes());
                let id = fields.find(|(field, _)| *field == DECISION_ID);
                received = Received::Decision(id.map_or(0, |(_, id)| id.number()));
            }
            _ => {}
        }
    }
    (handle, received)
}

/// The value of a field.
#[derive(Clone, Copy)]
enum Value<'a> {
    Number(u64),
    Bytes(&'a [u8]),
}

impl<'a> Value<'a> {
    fn number(self) -> u64 {
        match self {
            Self::Number(number) => number,
            Self::Bytes(_) => 0,
        }
    }

    fn handle(self) -> u32 {
        u32::try_from(self.number()).unwrap_or_default()
    }

    fn bytes(self) -> &'a [u8] {
        match self {
            Self::Number(_) => &[],
            Self::Bytes(bytes) => bytes,
        }
    }
}

/// The numbers and values of the fields of an encoded message; ends where it cannot be read.
struct Fields<'a>(&'a [u8]);

impl<'a> Iterator for Fields<'a> {
    type Item = (u32, Value<'a>);

    fn next(&mut self) -> Option<Self::Item> {
        if self.0.is_empty() {
            return None;
        }
        let (field, wire_type) = decode_key(&mut self.0).ok()?;
        let take = |bytes: &mut &'a [u8], length: usize| {
            let (taken, rest) = bytes.split_at_checked(length)?;
            *bytes = rest;
            Some(taken)
        };
        let value = match wire_type {
            WireType::Varint => Value::Number(decode_varint(&mut self.0).ok()?),
            WireType::LengthDelimited => {
                let length = decode_varint(&mut self.0).ok()?;
                Value::Bytes(take(&mut self.0, usize::try_from(length).ok()?)?)
            }
            WireType::SixtyFourBit => Value::Bytes(take(&mut self.0, 8)?),
            WireType::ThirtyTwoBit => Value::Bytes(take(&mut self.0, 4)?),
            WireType::StartGroup | WireType::EndGroup => return None,
        };
        Some((field, value))
    }
}

#[cfg(test)]
mod tests {
    use chefshat_proto::v1::seat_update::Update;
    use prost::Message as _;

    use super::*;

    #[test]
    fn received_updates_are_passed_on_unchanged_and_say_what_they_are() {
        let events = v1::EventBatch {
            events: vec![v1::GameEvent::default(); 5],
        };
        let decision = v1::DecisionRequest {
            decision_id: 300,
            ..v1::DecisionRequest::default()
        };
        let sent = [
            (
                0,
                Update::Attached(v1::Attached::default()),
                Received::Attached,
            ),
            (
                7,
                Update::Entered(v1::Entered::default()),
                Received::Attached,
            ),
            (1 << 31, Update::Events(events), Received::Other),
            (3, Update::Decision(decision), Received::Decision(300)),
            (
                3,
                Update::Refused(v1::Refused::default()),
                Received::Refused,
            ),
            (
                3,
                Update::Detached(v1::Detached::default()),
                Received::Detached { stops: false },
            ),
            (
                4,
                Update::Detached(v1::Detached {
                    reason: v1::DetachReason::ServerStopping.into(),
                }),
                Received::Detached { stops: true },
            ),
        ];
        let mut updates = Updates::default();
        for (handle, update, _) in sent.clone() {
            updates.add(handle, update);
        }
        let without = updates.clone();
        updates.add_contested(0);
        updates.add_contested(1 << 31);
        let bytes = updates.encode_to_vec();
        let received = Updates::decode(bytes.as_slice()).expect("readable");
        assert_eq!(received, updates, "with the same weights");
        assert_eq!(received.without_contested(), without);
        let contested = [0, 1 << 31].map(|handle| (handle, Received::Contested));
        let expected: Vec<_> = (sent.into_iter())
            .map(|(handle, _, it)| (handle, it))
            .chain(contested)
            .collect();
        assert_eq!(received.received().collect::<Vec<_>>(), expected);
        // What cannot be read is no reason to panic.
        for end in 0..bytes.len() {
            if let Ok(updates) = Updates::decode(&bytes[..end]) {
                updates.received().for_each(drop);
            }
        }
        for byte in 0..=255u8 {
            let mut updates = Updates::default();
            updates.add_received(&[byte, byte, byte]);
            updates.received().for_each(drop);
        }
    }
}
