//! What a record of a real table says before anything happens: its header.

use chefshat_engine::RULES_VERSION;
use chefshat_proto::v1;

use super::play::Beginning;
use super::transcript::Transcript;
use crate::convert::{action_space, rules_to_proto, seat_number};
use crate::jsonl::FORMAT_VERSION;

/// Milliseconds of a day: at a real table no clock runs, and the policy has the longest one.
const DAY_MS: u32 = 86_400_000;

/// The header of the record.
pub(super) fn header(told: &Transcript, beginning: &Beginning, game_id: &str) -> v1::RecordHeader {
    let later = (beginning.shift > 1).then(|| v1::ScriptedShift {
        shift: beginning.shift,
        last_order: beginning.last_order.map_or_else(Vec::new, |order| {
            order.as_slice().iter().copied().map(seat_number).collect()
        }),
        points: beginning.scores.values().copied().collect(),
        ..v1::ScriptedShift::default()
    });
    v1::RecordHeader {
        format_version: FORMAT_VERSION,
        game_id: game_id.to_owned(),
        // There was no room: an id of its own would name nothing.
        room_id: game_id.to_owned(),
        room_name: told.table.clone(),
        origin: v1::GameOrigin::Imported.into(),
        rules: Some(rules_to_proto(&told.rules)),
        rules_version: RULES_VERSION,
        policy: Some(policy(told.scheme)),
        seats: (0..)
            .zip(&told.players)
            .map(|(seat, player)| v1::Participant {
                seat,
                name: player.name.clone(),
                kind: player.kind.into(),
                ..v1::Participant::default()
            })
            .collect(),
        created_at_ms: told.began_ms,
        server_version: env!("CARGO_PKG_VERSION").into(),
        action_space: Some(action_space(&told.rules.actions())),
        start: later.map(|scripted| v1::GameStart {
            scripted: Some(scripted),
            ..v1::GameStart::default()
        }),
        ..v1::RecordHeader::default()
    }
}

/// A policy under which nobody is hurried: at a real table there is no clock and no substitute.
fn policy(scheme: v1::RewardScheme) -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(DAY_MS),
        bank_ms: Some(0),
        max_invalid_attempts: Some(0),
        max_timeouts: Some(1000),
        substitute: "random".into(),
        abort: v1::AbortPolicy::Never.into(),
        reward_scheme: scheme.into(),
        pace_ms: Some(0),
        waiting_time_ms: Some(DAY_MS),
        spectators: Some(true),
        spectator_delay_decisions: Some(0),
        spectators_see_hands: Some(false),
        durability: v1::Durability::Durable.into(),
        clocks: Vec::new(),
    }
}
