//! Attaches rewards to events and invalid attempts. The engine defines the schemes.

use chefshat_engine::{DecisionKind, Event, RewardScheme, RuleSet, Seat};
use chefshat_proto::v1;

use super::seat_number;

/// The events of one action or deal, each with its rewards; none without a scheme.
pub fn with_rewards<'a>(
    events: &'a [Event],
    rules: &'a RuleSet,
    scheme: Option<RewardScheme>,
) -> impl Iterator<Item = (&'a Event, Vec<v1::SeatReward>)> {
    events.iter().enumerate().map(move |(position, event)| {
        let mut rewards = Vec::new();
        let give = |seat: Seat, value: f32, bringer: usize| {
            if bringer == position {
                rewards.push(v1::SeatReward {
                    seat: seat_number(seat),
                    value,
                });
            }
        };
        if let Some(scheme) = scheme {
            scheme.of_events(rules, events, give);
        }
        (event, rewards)
    })
}

/// The total reward of the invalid attempts at a decision. `None` without a scheme or attempts, or
/// if the decision is not a turn.
pub fn invalid_reward(
    scheme: Option<RewardScheme>,
    kind: DecisionKind,
    attempts: usize,
) -> Option<f32> {
    scheme
        .filter(|_| kind == DecisionKind::Turn && attempts > 0)
        .map(|scheme| (0..attempts).map(|_| scheme.invalid()).sum())
}
