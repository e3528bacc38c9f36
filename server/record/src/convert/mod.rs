//! Conversion between the engine's values and the protocol's messages.

mod events;
mod expression;
mod kind;
mod observation;
mod played;
mod rewards;
mod rules;
mod start;

pub use events::{
    By, event_from_proto, event_kind, final_table, seat_cards, seat_number, special_to_proto,
};
pub(crate) use expression::LAST_MS;
pub use expression::check_expression;
pub use kind::{has_real_cards, kind_from_name, kind_name};
pub use observation::{
    decision_kind, observation_from_proto, observation_to_proto, put_requirement,
};
pub use played::{MAX_RECORDED_ATTEMPTS, Played};
pub use rewards::{invalid_reward, with_rewards};
pub use rules::{
    FieldProblem, action_space, reward_scheme_from_proto, reward_scheme_to_proto, role_from_number,
    rules_from_proto, rules_to_proto,
};
pub(crate) use start::action_id;
pub use start::{cards_from_numbers, script_from_proto, script_to_proto, seat_from_number};
