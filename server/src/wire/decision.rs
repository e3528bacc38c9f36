//! Encodes decision requests directly from the engine's values. They are the most frequent message;
//! this avoids building a message tree for each. A test compares the bytes with the encoded
//! message.

use std::time::Duration;

use chefshat_engine::{Cards, Observation, Requirement, Viewer};
use prost::bytes::BufMut;
use prost::encoding::{WireType, encode_key, encode_varint};

use crate::convert::millis;
use chefshat_record::convert::decision_kind;
use chefshat_room::{Core, OpenDecision};

/// Encodes the open decision for its seat.
pub fn encode_decision(
    core: &Core,
    open: &OpenDecision,
    now: Duration,
    with_mask: bool,
    out: &mut Vec<u8>,
) {
    let observation = core
        .observe(Viewer::Seat(open.decision.seat))
        .expect("an open decision belongs to a game that has started");
    let (time_left, bank_left) = core.time_left(now);
    put_number(out, 1, open.id);
    put_number(out, 2, decision_kind(open.decision.kind) as u64);
    encode_key(3, WireType::LengthDelimited, out);
    let length_at = out.len();
    out.put_u8(0);
    put_observation(out, &observation);
    let length = out.len() - length_at - 1;
    // The length is known only now; it nearly always fits the byte reserved for it.
    if length < 0x80 {
        out[length_at] = u8::try_from(length).expect("seven bits");
    } else {
        out[length_at] = u8::try_from(length >> 7).expect("an observation is below 16 KiB");
        let low = u8::try_from(length & 0x7f).expect("seven bits");
        out.insert(length_at, low | 0x80);
    }
    if with_mask {
        let size = usize::from(core.header().rules.actions().size()).div_ceil(8);
        let mask = core.legal_actions();
        put_bytes(
            out,
            4,
            size,
            mask.words().iter().flat_map(|word| word.to_le_bytes()),
        );
    }
    put_number(out, 5, millis(time_left).into());
    put_number(out, 6, millis(bank_left).into());
    if let Some(left) = core.attempts_left() {
        encode_key(7, WireType::Varint, out);
        encode_varint(left.into(), out);
    }
    let requirement = core
        .requirement()
        .expect("an open decision belongs to a game that has not ended");
    put_requirement(out, requirement);
    let default = core
        .default_action()
        .expect("an open decision has a default");
    put_number(out, 11, default.index().into());
}

fn put_requirement(out: &mut Vec<u8>, requirement: Requirement) {
    let put_message = |out: &mut Vec<u8>, field, numbers: &[(u32, u8)]| {
        encode_key(field, WireType::LengthDelimited, out);
        let length_at = out.len();
        out.put_u8(0);
        for &(field, number) in numbers {
            put_number(out, field, number.into());
        }
        // A few small numbers, two bytes each.
        out[length_at] = u8::try_from(out.len() - length_at - 1).expect("seven bits");
    };
    match requirement {
        Requirement::Play(play) => put_message(
            out,
            8,
            &[
                (1, play.lowest_face),
                (2, play.highest_face),
                (3, play.fewest_cards),
                (4, play.golden_card.into()),
                (5, play.lone_joker.into()),
                (6, play.may_pass.into()),
            ],
        ),
        Requirement::Gift(gift) => put_message(
            out,
            9,
            &[
                (1, gift.number),
                // Never 0, so that a field that is set is never omitted.
                (2, gift.total.unwrap_or(0)),
                (
                    3,
                    u8::try_from(gift.receiver.index()).expect("a seat is below six"),
                ),
            ],
        ),
        Requirement::SpecialAction(special) => put_number(out, 10, special as u64),
    }
}

fn put_observation(out: &mut Vec<u8>, observation: &Observation) {
    let players = observation.points.len();
    let kinds = usize::from(observation.faces) + 1;
    let put_cards = |out: &mut Vec<u8>, field, cards: Cards| {
        put_bytes(out, field, kinds, cards.counts(observation.faces));
    };
    put_number(out, 1, observation.shift.into());
    put_number(out, 2, observation.pizza.into());
    put_cards(out, 3, observation.hand);
    put_number(out, 4, observation.hand.has_golden().into());
    put_number(out, 5, observation.board.face.into());
    put_number(out, 6, observation.board.size.into());
    put_number(out, 7, observation.board.jokers.into());
    put_bytes(out, 8, players, observation.cards_left.values().copied());
    put_bytes(
        out,
        9,
        players,
        observation.passed.values().map(|passed| u8::from(*passed)),
    );
    put_bytes(out, 10, players, observation.places.values().copied());
    put_bytes(
        out,
        11,
        players,
        observation
            .roles
            .values()
            .map(|role| role.map_or(0, |role| role as u8)),
    );
    let points = observation.points.as_slice();
    prost::encoding::uint64::encode_packed(12, points, out);
    put_cards(out, 13, observation.played);
    for (field, cards) in [(14, observation.gave), (15, observation.received)] {
        if !cards.is_empty() {
            put_cards(out, field, cards);
        }
    }
}

/// Writes a number, omitted when it is zero.
fn put_number(out: &mut Vec<u8>, field: u32, number: u64) {
    match u8::try_from(number) {
        Ok(0) => {}
        // The usual case: one byte for the key and one for the number.
        Ok(small @ 1..0x80) if field < 16 => {
            let key = u8::try_from(field << 3).expect("below 128");
            out.extend_from_slice(&[key, small]);
        }
        _ => {
            encode_key(field, WireType::Varint, out);
            encode_varint(number, out);
        }
    }
}

/// Writes the first `length` of some bytes.
fn put_bytes(out: &mut Vec<u8>, field: u32, length: usize, bytes: impl Iterator<Item = u8>) {
    encode_key(field, WireType::LengthDelimited, out);
    encode_varint(u64::try_from(length).expect("memory holds it"), out);
    let start = out.len();
    out.resize(start + length, 0);
    for (place, byte) in out[start..].iter_mut().zip(bytes) {
        *place = byte;
    }
}
