//! Conversion between the engine's values and the protocol's messages.

mod events;
mod expression;
mod kind;
mod marker;
mod numbers;
mod observation;
mod played;
mod rewards;
mod rules;
mod situation;
mod start;

pub use events::{By, event_from_proto, event_kind, final_table, special_to_proto};
pub(crate) use expression::LAST_MS;
pub use expression::check_expression;
pub use kind::{has_real_cards, kind_from_name, kind_name};
pub(crate) use marker::MAX_LABEL;
pub use marker::{check_label, check_marker};
pub(crate) use numbers::action_id;
pub use numbers::{cards_from_numbers, seat_cards, seat_from_number, seat_number};
pub use observation::{
    decision_kind, observation_from_proto, observation_to_proto, put_requirement,
};
pub use played::{MAX_RECORDED_ATTEMPTS, Played, plain_policy};
pub use rewards::{invalid_reward, with_rewards};
pub use rules::{
    FieldProblem, action_space, reward_scheme_from_proto, reward_scheme_to_proto, role_from_number,
    rules_from_proto, rules_to_proto,
};
pub use situation::situation_from_proto;
pub use start::{script_from_proto, script_to_proto};

/// Key of the annotation with the time that a decision was on the screen of a person, as the
/// person's device measured it, in whole milliseconds.
pub const PERSON_TIME_KEY: &str = "person_decision_time_ms";
