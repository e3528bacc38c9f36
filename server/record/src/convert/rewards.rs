//! What a reward scheme gives, beside what brings it: the events of one action with their rewards, and what refused attempts cost. How much
//! that is, the engine says.

use chefshat_engine::{DecisionKind, Event, RewardScheme, RuleSet, Seat};
use chefshat_proto::v1;

use super::seat_number;

/// The events that one action (or a deal) brought, each with the rewards that it brings by the scheme; none where there is no scheme.
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

/// What the refused attempts at a decision bring its seat together. `None` where they bring nothing: there is no scheme, the decision is
/// no turn, or there were none.
pub fn invalid_reward(
    scheme: Option<RewardScheme>,
    kind: DecisionKind,
    attempts: usize,
) -> Option<f32> {
    scheme
        .filter(|_| kind == DecisionKind::Turn && attempts > 0)
        .map(|scheme| (0..attempts).map(|_| scheme.invalid()).sum())
}
