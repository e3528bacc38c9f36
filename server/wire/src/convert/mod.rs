//! Translation between rooms and the protocol: policies, seats, decisions, the log.
//! `chefshat-record` translates rule sets and the engine's events, which records share;
//! `chefshat-vector` vector environments.

mod agent;
mod decision;
mod event;
mod labels;
mod marker;
mod mirrored;
mod name;
mod physical_record;
mod players;
mod policy;
mod ratings;
mod record;
#[cfg(test)]
mod record_tests;
mod room;
mod snapshot;
mod standings;
mod start;
mod study;
#[cfg(test)]
mod study_tests;
mod study_view;
mod summary;
mod table;
mod tournament;

pub use agent::{
    MAX_SEARCH_BUDGET, MAX_SEARCH_ROLLOUTS, agent_from_proto, check_budget, check_real_cards,
};
pub use decision::{answer_from_proto, answer_result, express_refused, expression_from_proto};
pub use event::{event_to_proto, game_started};
pub use marker::marker_to_proto;
pub use mirrored::Mirrored;
pub use name::{MAX_NAME_CHARS, checked_name, name_fingerprint};
pub use players::recorded_player;
pub use policy::{
    millis, policy_from_proto, policy_to_proto, requested_policy, set_default_clock_of_models,
};
pub use ratings::{leaderboard, rating_to_proto};
pub use record::{each_record_line, record_lines};
pub use room::{
    awaited_to_proto, describe, describe_at, display_names_from_proto, fills_from_proto,
    participants, seats_to_proto, tournament_id, wizards_from_proto,
};
pub use snapshot::{next_sequence, snapshot};
pub use standings::{confidence_to_proto, standings_to_proto};
pub use start::{start_from_proto, start_to_proto};
pub use study::{
    ConditionPlan, MAX_HOSTED_SHIFTS, PARTICIPANT_KIND, StudyPlan, complete_settings,
    device_from_proto, device_to_proto, game_of, room_of, study_participant, study_plan,
    study_to_proto,
};
pub use study_view::{answers_from_proto, answers_to_proto, study_view};
pub use summary::summary;
pub use table::{Deck, report_response, report_to_proto, reported_from_proto, table_state};
pub use tournament::{
    TournamentPlan, is_rated, settings_to_proto, tournament_game, tournament_participants,
    tournament_plan,
};

/// Converts a count to the protocol's integer. All counts are bounded far below its limit.
pub fn number(value: usize) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}
