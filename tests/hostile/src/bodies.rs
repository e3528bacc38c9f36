//! The messages of a call that cost the most for their length.

use bytes::{BufMut as _, Bytes, BytesMut};
use chefshat_proto::cost::{Cost, Filling, Method};
use prost::Message;

/// Length at which the ways to fill a message are compared, bytes.
const COMPARED_AT: usize = 2 * 1024;
/// Bytes before a message.
const PREFIX: usize = 5;

/// A message for a call, such as `RoomService/CreateRoom`, that takes the most memory once it is
/// decoded, with `valid` before it: framed, and of at most this many bytes.
pub(crate) fn worst(call: &str, valid: &impl Message, bytes: usize) -> Bytes {
    let method = Method::find(&format!("/chefshat.v1.{call}")).expect("a call of the protocol");
    let memory = |filling: &Filling| {
        let cost = method
            .request
            .cost(&filling.longest(COMPARED_AT), Cost::MAX);
        cost.map_or(0, |cost| cost.memory)
    };
    let worst = (Filling::all(method.request).into_iter())
        .max_by_key(memory)
        .expect("a request with fields");
    let mut message = valid.encode_to_vec();
    message.extend(worst.longest(bytes - message.len()));
    framed(&message)
}

/// As many copies of an encoded field as fit into a message of this many bytes: framed.
pub(crate) fn repeated(field: &[u8], bytes: usize) -> Bytes {
    framed(&field.repeat(bytes / field.len()))
}

/// An encoded message as gRPC frames it.
pub(crate) fn framed(message: &[u8]) -> Bytes {
    let mut framed = BytesMut::with_capacity(PREFIX + message.len());
    framed.put_u8(0);
    framed.put_u32(u32::try_from(message.len()).expect("a few MiB"));
    framed.put_slice(message);
    framed.freeze()
}

#[cfg(test)]
mod tests {
    use chefshat_proto::v1;

    use super::*;

    #[test]
    fn the_worst_message_takes_many_times_its_length() {
        for call in [
            "StudyService/CreateStudy",
            "ParticipationService/AnswerQuestionnaire",
            "VectorService/Run",
            "RoomService/CreateRoom",
        ] {
            let valid = v1::GetRecordRequest::default();
            let framed = worst(call, &valid, 64 * 1024);
            let method = Method::find(&format!("/chefshat.v1.{call}")).expect("a call");
            let cost = method
                .request
                .cost(&framed[PREFIX..], Cost::MAX)
                .expect("valid");
            assert!(framed.len() > 63 * 1024, "{call}");
            assert!(cost.memory > 20 * framed.len(), "{call}: {cost:?}");
        }
    }
}
