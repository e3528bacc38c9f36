//! Policies as messages. A game without a room has one in its record, for its limits and rewards.

use std::time::Duration;

use chefshat_agents::{AgentKind, ParticipantKind};
use chefshat_engine::RewardScheme;
use chefshat_proto::v1;
use chefshat_record::convert::{FieldProblem, reward_scheme_to_proto};
use chefshat_room::policy::{AbortPolicy, Durability, Policy, Visibility};

/// The policy of a game without a room. Only its limits and rewards have a meaning.
pub fn simulation_policy(
    max_invalid_attempts: Option<u32>,
    reward_scheme: Option<RewardScheme>,
) -> v1::RoomPolicy {
    policy_to_proto(&Policy {
        max_invalid_attempts,
        reward_scheme,
        pace: Some(Duration::ZERO),
        clocks: Vec::new(),
        ..Policy::default()
    })
}

/// A policy with every field set, except a pace that depends on the participants.
pub fn policy_to_proto(policy: &Policy) -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(millis(policy.decision_time)),
        bank_ms: Some(millis(policy.bank)),
        max_invalid_attempts: Some(policy.max_invalid_attempts.unwrap_or(0)),
        max_timeouts: Some(policy.max_timeouts),
        substitute: policy.substitute.name().into(),
        abort: match policy.abort {
            AbortPolicy::AllLost => v1::AbortPolicy::AllLost,
            AbortPolicy::AnyLost => v1::AbortPolicy::AnyLost,
            AbortPolicy::Never => v1::AbortPolicy::Never,
        }
        .into(),
        reward_scheme: reward_scheme_to_proto(policy.reward_scheme).into(),
        pace_ms: policy.pace.map(millis),
        waiting_time_ms: Some(millis(policy.waiting_time)),
        spectators: Some(policy.spectators),
        spectator_delay_decisions: Some(
            u32::try_from(policy.spectator_delay_decisions).unwrap_or(u32::MAX),
        ),
        spectators_see_hands: Some(policy.spectators_see_hands),
        durability: match policy.durability {
            Durability::Durable => v1::Durability::Durable,
            Durability::Ephemeral => v1::Durability::Ephemeral,
        }
        .into(),
        clocks: (policy.clocks.iter())
            .map(|clock| v1::KindClock {
                kind: kind_to_proto(Some(clock.kind)),
                decision_time_ms: clock.decision_time.map(millis),
                bank_ms: clock.bank.map(millis),
            })
            .collect(),
        one_seat_per_client: policy.one_seat_per_client,
        visibility: visibility_to_proto(policy.visibility).into(),
    }
}

/// As in responses and records. What is public has the same bytes as before there was a choice, so
/// that signatures of older records stay valid.
pub fn visibility_to_proto(visibility: Visibility) -> v1::Visibility {
    match visibility {
        Visibility::Public => v1::Visibility::Unspecified,
        Visibility::Unlisted => v1::Visibility::Unlisted,
        Visibility::Private => v1::Visibility::Private,
    }
}

/// Whole milliseconds, as messages count time.
pub fn millis(time: Duration) -> u32 {
    u32::try_from(time.as_millis()).unwrap_or(u32::MAX)
}

/// Converts a kind to its number.
pub fn kind_to_proto(kind: Option<ParticipantKind>) -> i32 {
    match kind {
        None => v1::ParticipantKind::Unspecified,
        Some(ParticipantKind::Agent) => v1::ParticipantKind::Agent,
        Some(ParticipantKind::Human) => v1::ParticipantKind::Human,
        Some(ParticipantKind::Robot) => v1::ParticipantKind::Robot,
    }
    .into()
}

/// The built-in agent with this name; `None` for the empty name.
///
/// # Errors
/// There is no such agent.
pub fn agent_from_proto(
    field: &'static str,
    name: &str,
) -> Result<Option<AgentKind>, FieldProblem> {
    if name.is_empty() {
        return Ok(None);
    }
    AgentKind::from_name(name).map(Some).ok_or_else(|| {
        let known = AgentKind::ALL.map(AgentKind::name).join(", ");
        FieldProblem::new(
            field,
            format!("{name:?} is not a built-in agent; use one of {known}"),
        )
    })
}
