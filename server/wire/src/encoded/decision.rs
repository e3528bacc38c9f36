//! Encodes decision requests directly from the engine's values. They are the most frequent message;
//! this avoids building a message tree for each. A test compares the bytes with the encoded
//! message.

use std::time::Duration;

use chefshat_engine::{Cards, Observation, Requirement, Viewer};
use prost::encoding::{WireType, encode_key, encode_varint};

use super::field::{put_bytes, put_message, put_number};
use crate::convert::millis;
use chefshat_record::convert::{decision_kind, seat_number};
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
    put_message(out, 3, |out| put_observation(out, &observation));
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
        // Written even if it is 0.
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
    match requirement {
        Requirement::Play(play) => put_message(out, 8, |out| {
            put_number(out, 1, play.lowest_face.into());
            put_number(out, 2, play.highest_face.into());
            put_number(out, 3, play.fewest_cards.into());
            put_number(out, 4, play.golden_card.into());
            put_number(out, 5, play.lone_joker.into());
            put_number(out, 6, play.may_pass.into());
        }),
        Requirement::Gift(gift) => put_message(out, 9, |out| {
            put_number(out, 1, gift.number.into());
            // Never 0, so that a field that is set is never omitted.
            put_number(out, 2, gift.total.unwrap_or(0).into());
            put_number(out, 3, seat_number(gift.receiver).into());
        }),
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
    if let Some(owner) = observation.board_owner {
        // Written even if it is seat 0.
        encode_key(16, WireType::Varint, out);
        encode_varint(seat_number(owner).into(), out);
    }
}
