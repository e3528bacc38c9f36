//! The messages of the protocol with only the fields that a random agent needs; others are skipped.
//! The server is measured, so a client that decodes complete observations would only add its own
//! time. A test compares names and numbers with `chefshat.v1`.

use chefshat_proto::v1;
use prost::bytes::Buf as _;
use prost::{Message, Oneof};
use tonic::Status;
use tonic::codec::{Codec, DecodeBuf, Decoder};
use tonic_prost::{ProstDecoder, ProstEncoder};

/// Prost's codec for `PlayService.Play`, which also reports the size of each response.
#[derive(Debug, Default)]
pub(crate) struct PlayCodec;

impl Codec for PlayCodec {
    type Encode = v1::PlayRequest;
    type Decode = (usize, PlayResponse);
    type Encoder = ProstEncoder<v1::PlayRequest>;
    type Decoder = PlayDecoder;

    fn encoder(&mut self) -> Self::Encoder {
        ProstEncoder::default()
    }

    fn decoder(&mut self) -> Self::Decoder {
        PlayDecoder::default()
    }
}

/// Decodes responses and reports their sizes in bytes.
#[derive(Debug, Default)]
pub(crate) struct PlayDecoder(ProstDecoder<PlayResponse>);

impl Decoder for PlayDecoder {
    type Item = (usize, PlayResponse);
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<Self::Item>, Status> {
        let bytes = buffer.remaining();
        let response = self.0.decode(buffer)?;
        Ok(response.map(|response| (bytes, response)))
    }
}

/// `chefshat.v1.PlayResponse`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct PlayResponse {
    #[prost(message, repeated, tag = "1")]
    pub(crate) updates: Vec<SeatUpdate>,
}

/// `chefshat.v1.SeatUpdate`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct SeatUpdate {
    #[prost(uint32, tag = "1")]
    pub(crate) handle: u32,
    #[prost(oneof = "Update", tags = "2, 3, 4, 5, 7, 8")]
    pub(crate) update: Option<Update>,
}

/// Updates of a seat, except for snapshots, which are never requested here.
#[derive(Clone, PartialEq, Oneof)]
pub(crate) enum Update {
    #[prost(message, tag = "2")]
    Attached(Attached),
    #[prost(message, tag = "3")]
    Events(EventBatch),
    #[prost(message, tag = "4")]
    Decision(DecisionRequest),
    #[prost(message, tag = "5")]
    Result(AnswerResult),
    #[prost(message, tag = "7")]
    Detached(v1::Detached),
    #[prost(message, tag = "8")]
    Refused(v1::Refused),
}

/// `chefshat.v1.Attached`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Attached {
    #[prost(uint32, tag = "1")]
    pub(crate) request_id: u32,
}

/// `chefshat.v1.EventBatch`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct EventBatch {
    #[prost(message, repeated, tag = "1")]
    pub(crate) events: Vec<GameEvent>,
}

/// `chefshat.v1.GameEvent`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct GameEvent {
    #[prost(oneof = "Kind", tags = "13, 14, 17, 18, 19")]
    pub(crate) kind: Option<Kind>,
}

/// The kinds of events that are counted.
#[derive(Clone, PartialEq, Oneof)]
pub(crate) enum Kind {
    #[prost(message, tag = "13")]
    Play(Play),
    #[prost(message, tag = "14")]
    Pass(Pass),
    #[prost(message, tag = "17")]
    ShiftEnded(Nothing),
    #[prost(message, tag = "18")]
    GameEnded(Nothing),
    #[prost(message, tag = "19")]
    GameAborted(GameAborted),
}

/// A message whose contents are ignored.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Nothing {}

/// `chefshat.v1.Play`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Play {
    #[prost(enumeration = "v1::DecisionSource", tag = "7")]
    pub(crate) source: i32,
}

/// `chefshat.v1.Pass`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct Pass {
    #[prost(enumeration = "v1::DecisionSource", tag = "2")]
    pub(crate) source: i32,
}

/// `chefshat.v1.GameAborted`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct GameAborted {
    #[prost(enumeration = "v1::AbortReason", tag = "1")]
    pub(crate) reason: i32,
}

/// `chefshat.v1.DecisionRequest`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct DecisionRequest {
    #[prost(uint64, tag = "1")]
    pub(crate) decision_id: u64,
    #[prost(enumeration = "v1::DecisionKind", tag = "2")]
    pub(crate) kind: i32,
    #[prost(bytes = "vec", tag = "4")]
    pub(crate) action_mask: Vec<u8>,
}

/// `chefshat.v1.AnswerResult`.
#[derive(Clone, PartialEq, Message)]
pub(crate) struct AnswerResult {
    #[prost(enumeration = "v1::AnswerStatus", tag = "2")]
    pub(crate) status: i32,
    #[prost(uint64, tag = "4")]
    pub(crate) decision_time_us: u64,
    #[prost(string, tag = "5")]
    pub(crate) detail: String,
}

#[cfg(test)]
mod tests {
    use v1::{game_event, seat_update};

    use super::*;

    fn check(update: seat_update::Update, expected: Option<Update>) {
        let whole = v1::PlayResponse {
            updates: vec![v1::SeatUpdate {
                handle: 7,
                update: Some(update),
            }],
        };
        let read = PlayResponse::decode(whole.encode_to_vec().as_slice()).unwrap();
        let expected = SeatUpdate {
            handle: 7,
            update: expected,
        };
        assert_eq!(read.updates, [expected]);
    }

    #[test]
    fn messages_read_as_the_protocol_writes_them() {
        let attached = v1::Attached {
            request_id: 3,
            seat: 2,
            ..Default::default()
        };
        check(
            seat_update::Update::Attached(attached),
            Some(Update::Attached(Attached { request_id: 3 })),
        );
        let decision = v1::DecisionRequest {
            decision_id: 12,
            kind: v1::DecisionKind::Exchange.into(),
            observation: Some(v1::Observation {
                hand: vec![1, 2, 3],
                ..Default::default()
            }),
            action_mask: vec![0, 5],
            time_left_ms: 100,
            ..Default::default()
        };
        check(
            seat_update::Update::Decision(decision),
            Some(Update::Decision(DecisionRequest {
                decision_id: 12,
                kind: v1::DecisionKind::Exchange.into(),
                action_mask: vec![0, 5],
            })),
        );
        let result = v1::AnswerResult {
            decision_id: 12,
            status: v1::AnswerStatus::Invalid.into(),
            action: 8,
            decision_time_us: 55,
            detail: "no".into(),
            ..Default::default()
        };
        check(
            seat_update::Update::Result(result),
            Some(Update::Result(AnswerResult {
                status: v1::AnswerStatus::Invalid.into(),
                decision_time_us: 55,
                detail: "no".into(),
            })),
        );
        let detached = v1::Detached {
            reason: v1::DetachReason::GameOver.into(),
        };
        check(
            seat_update::Update::Detached(detached),
            Some(Update::Detached(detached)),
        );
        let refused = v1::Refused {
            reason: "WHY".into(),
            ..Default::default()
        };
        check(
            seat_update::Update::Refused(refused.clone()),
            Some(Update::Refused(refused)),
        );
        check(seat_update::Update::Snapshot(Box::default()), None);
    }

    #[test]
    fn events_read_as_the_protocol_writes_them() {
        let source = v1::DecisionSource::Timeout.into();
        let play = v1::Play {
            seat: 1,
            action: 9,
            source,
            decision_time_us: 4,
            ..Default::default()
        };
        let pass = v1::Pass {
            seat: 1,
            source,
            decision_time_us: 4,
        };
        let aborted = v1::GameAborted {
            reason: v1::AbortReason::TooLong.into(),
            reveal: None,
        };
        let table = [
            (
                game_event::Kind::Play(play),
                Some(Kind::Play(Play { source })),
            ),
            (
                game_event::Kind::Pass(pass),
                Some(Kind::Pass(Pass { source })),
            ),
            (
                game_event::Kind::ShiftEnded(Box::default()),
                Some(Kind::ShiftEnded(Nothing {})),
            ),
            (
                game_event::Kind::GameEnded(Box::default()),
                Some(Kind::GameEnded(Nothing {})),
            ),
            (
                game_event::Kind::GameAborted(Box::new(aborted)),
                Some(Kind::GameAborted(GameAborted {
                    reason: v1::AbortReason::TooLong.into(),
                })),
            ),
            (game_event::Kind::PizzaDone(v1::PizzaDone::default()), None),
        ];
        for (kind, expected) in table {
            let events = vec![v1::GameEvent {
                sequence: 3,
                kind: Some(kind),
                ..Default::default()
            }];
            check(
                seat_update::Update::Events(v1::EventBatch { events }),
                Some(Update::Events(EventBatch {
                    events: vec![GameEvent { kind: expected }],
                })),
            );
        }
    }
}
