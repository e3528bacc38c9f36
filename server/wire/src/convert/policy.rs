//! A room's policy as a message, and back, with its ranges checked.

use std::ops::RangeInclusive;
use std::time::Duration;

use chefshat_proto::v1;
use chefshat_record::convert::{FieldProblem, reward_scheme_from_proto, reward_scheme_to_proto};

use super::agent::agent_from_proto;
use super::mirrored::{Mirrored as _, kind_to_proto};
use chefshat_room::journal::ParticipantKind;
use chefshat_room::policy::{
    ABSENCE_TIME_OF_PEOPLE, AbortPolicy, Durability, KindClock, Policy, Visibility,
};
use chefshat_room::{Core, State};

/// A day, the longest time in a policy, milliseconds.
const DAY_MS: u32 = 86_400_000;

/// The policy of a request. Unset fields take their defaults.
///
/// # Errors
/// The first field that is out of its range.
pub fn requested_policy(message: &v1::RoomPolicy) -> Result<Policy, FieldProblem> {
    let mut policy = policy_from_proto(message)?;
    set_default_clock_of_models(&mut policy, message);
    policy.set_default_absence_times(ABSENCE_TIME_OF_PEOPLE);
    Ok(policy)
}

/// Gives language models their default times, unless the request sets times. What is stored keeps the
/// clocks that it has: earlier versions knew no models.
pub fn set_default_clock_of_models(policy: &mut Policy, request: &v1::RoomPolicy) {
    if !sets_times(request) {
        set_default_clock(&mut policy.clocks, KindClock::MODELS);
    }
}

/// A stored policy. Games of earlier servers have no absence time; other unset fields take their
/// defaults.
///
/// # Errors
/// The first field that is out of its range.
pub fn policy_from_proto(message: &v1::RoomPolicy) -> Result<Policy, FieldProblem> {
    let standard = Policy::default();
    let spectator_delay = in_range(
        "spectator_delay_decisions",
        message.spectator_delay_decisions,
        0..=10_000,
    )?
    .unwrap_or(0);
    let policy = Policy {
        decision_time: time("decision_time_ms", message.decision_time_ms, 10..=DAY_MS)?
            .unwrap_or(standard.decision_time),
        bank: time("bank_ms", message.bank_ms, 0..=DAY_MS)?.unwrap_or(standard.bank),
        max_invalid_attempts: match in_range(
            "max_invalid_attempts",
            message.max_invalid_attempts,
            0..=1000,
        )? {
            None => standard.max_invalid_attempts,
            Some(0) => None,
            Some(limit) => Some(limit),
        },
        max_timeouts: in_range("max_timeouts", message.max_timeouts, 1..=1000)?
            .unwrap_or(standard.max_timeouts),
        substitute: agent_from_proto("substitute", &message.substitute)?
            .unwrap_or(standard.substitute),
        abort: AbortPolicy::from_proto("abort", message.abort)?.unwrap_or(standard.abort),
        reward_scheme: v1::RewardScheme::try_from(message.reward_scheme)
            .map(reward_scheme_from_proto)
            .map_err(|_| FieldProblem::unknown("reward_scheme", message.reward_scheme))?,
        pace: time("pace_ms", message.pace_ms, 0..=60_000)?,
        waiting_time: time("waiting_time_ms", message.waiting_time_ms, 1_000..=DAY_MS)?
            .unwrap_or(standard.waiting_time),
        spectators: message.spectators.unwrap_or(standard.spectators),
        spectator_delay_decisions: usize::try_from(spectator_delay).unwrap_or(usize::MAX),
        spectators_see_hands: message
            .spectators_see_hands
            .unwrap_or(standard.spectators_see_hands),
        durability: Durability::from_proto("durability", message.durability)?
            .unwrap_or(standard.durability),
        clocks: clocks(message)?,
        one_seat_per_client: message.one_seat_per_client,
        visibility: Visibility::from_proto("visibility", message.visibility)?
            .unwrap_or(standard.visibility),
        hints: message.hints,
        chat: message.chat,
        absence_time: time("absence_time_ms", message.absence_time_ms, 0..=DAY_MS)?,
    };
    if policy.spectators_see_hands && policy.spectator_delay_decisions == 0 {
        return Err(FieldProblem::new(
            "spectators_see_hands",
            "spectators may see hands only with a spectator_delay_decisions of 1 or more",
        ));
    }
    Ok(policy)
}

/// A policy with every field set, except a pace that depends on the participants and the absence time
/// of a game that has none.
pub fn policy_to_proto(policy: &Policy) -> v1::RoomPolicy {
    v1::RoomPolicy {
        decision_time_ms: Some(millis(policy.decision_time)),
        bank_ms: Some(millis(policy.bank)),
        max_invalid_attempts: Some(policy.max_invalid_attempts.unwrap_or(0)),
        max_timeouts: Some(policy.max_timeouts),
        substitute: policy.substitute.name(),
        abort: policy.abort.to_proto().into(),
        reward_scheme: reward_scheme_to_proto(policy.reward_scheme).into(),
        pace_ms: policy.pace.map(millis),
        waiting_time_ms: Some(millis(policy.waiting_time)),
        spectators: Some(policy.spectators),
        spectator_delay_decisions: Some(
            u32::try_from(policy.spectator_delay_decisions).unwrap_or(u32::MAX),
        ),
        spectators_see_hands: Some(policy.spectators_see_hands),
        durability: policy.durability.to_proto().into(),
        clocks: (policy.clocks.iter())
            .map(|clock| v1::KindClock {
                kind: kind_to_proto(Some(clock.kind)),
                decision_time_ms: clock.decision_time.map(millis),
                bank_ms: clock.bank.map(millis),
                absence_time_ms: clock.absence_time.map(millis),
            })
            .collect(),
        one_seat_per_client: policy.one_seat_per_client,
        visibility: visibility_to_proto(policy.visibility).into(),
        hints: policy.hints,
        chat: policy.chat,
        absence_time_ms: policy.absence_time.map(millis),
    }
}

/// The policy of a room. A pace that depends on the participants is set once the game has started.
pub(super) fn policy_of(core: &Core) -> v1::RoomPolicy {
    let mut policy = policy_to_proto(&core.header().policy);
    if core.state() != State::Waiting {
        policy.pace_ms = Some(millis(core.pace()));
    }
    policy
}

/// As in responses and records. What is public has the same bytes as before there was a choice, so
/// that signatures of older records stay valid.
pub(super) fn visibility_to_proto(visibility: Visibility) -> v1::Visibility {
    match visibility {
        Visibility::Public => v1::Visibility::Unspecified,
        Visibility::Unlisted | Visibility::Private => visibility.to_proto(),
    }
}

/// Clocks for kinds of participants, each kind at most once. A time set for the room applies to
/// everybody, people included. [`Policy::set_default_absence_times`] completes them.
fn clocks(policy: &v1::RoomPolicy) -> Result<Vec<KindClock>, FieldProblem> {
    let mut clocks: Vec<KindClock> = Vec::new();
    for message in &policy.clocks {
        let kind = ParticipantKind::from_proto("clocks", message.kind)?
            .ok_or_else(|| FieldProblem::new("clocks", "set the kind of each clock"))?;
        if clocks.iter().any(|clock| clock.kind == kind) {
            return Err(FieldProblem::new("clocks", "a kind has two clocks"));
        }
        clocks.push(KindClock {
            kind,
            decision_time: time("clocks", message.decision_time_ms, 10..=DAY_MS)?,
            bank: time("clocks", message.bank_ms, 0..=DAY_MS)?,
            absence_time: time("clocks", message.absence_time_ms, 0..=DAY_MS)?,
        });
    }
    if !sets_times(policy) {
        set_default_clock(&mut clocks, KindClock::PEOPLE);
    }
    Ok(clocks)
}

/// Whether a policy sets times for everybody.
fn sets_times(policy: &v1::RoomPolicy) -> bool {
    policy.decision_time_ms.is_some() || policy.bank_ms.is_some()
}

/// Gives a kind its default times, unless its clock has times.
fn set_default_clock(clocks: &mut Vec<KindClock>, default: KindClock) {
    match clocks.iter_mut().find(|clock| clock.kind == default.kind) {
        None => clocks.push(KindClock {
            absence_time: None,
            ..default
        }),
        Some(clock) => {
            let absence_alone = clock.decision_time.is_none() && clock.bank.is_none();
            if absence_alone && clock.absence_time.is_some() {
                (clock.decision_time, clock.bank) = (default.decision_time, default.bank);
            }
        }
    }
}

/// Whole milliseconds, as messages count time.
pub fn millis(time: Duration) -> u32 {
    u32::try_from(time.as_millis()).unwrap_or(u32::MAX)
}

fn time(
    field: &'static str,
    value: Option<u32>,
    range: RangeInclusive<u32>,
) -> Result<Option<Duration>, FieldProblem> {
    Ok(in_range(field, value, range)?.map(|ms| Duration::from_millis(ms.into())))
}

fn in_range(
    field: &'static str,
    value: Option<u32>,
    range: RangeInclusive<u32>,
) -> Result<Option<u32>, FieldProblem> {
    match value {
        Some(value) if !range.contains(&value) => Err(FieldProblem::new(
            field,
            format!("{value} is not in {}..={}", range.start(), range.end()),
        )),
        value => Ok(value),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_and_language_models_have_more_time_by_default() {
        let policy = Policy::default();
        let times = |kind| {
            (
                policy.decision_time_of(Some(kind)),
                policy.bank_of(Some(kind)),
            )
        };
        for kind in [ParticipantKind::Human, ParticipantKind::Model] {
            let expected = (Duration::from_secs(60), Duration::from_secs(300));
            assert_eq!(times(kind), expected);
        }
        assert_eq!(
            times(ParticipantKind::Agent),
            (Duration::from_millis(10_000), Duration::from_millis(60_000))
        );
        let chosen = v1::RoomPolicy {
            decision_time_ms: Some(2000),
            ..v1::RoomPolicy::default()
        };
        let read =
            |message: v1::RoomPolicy| requested_policy(&message).expect("the policy is valid");
        let chosen = read(chosen);
        assert_eq!(read(v1::RoomPolicy::default()), policy);
        for policy in [&policy, &chosen] {
            assert_eq!(read(policy_to_proto(policy)), *policy);
        }
        assert_eq!(
            chosen.decision_time_of(Some(ParticipantKind::Human)),
            Duration::from_millis(2000)
        );
    }

    #[test]
    fn absence_times_that_are_not_chosen_have_their_defaults() {
        let clock_of =
            |kind: v1::ParticipantKind, decision_time_ms, absence_time_ms| v1::KindClock {
                kind: kind.into(),
                decision_time_ms,
                bank_ms: None,
                absence_time_ms,
            };
        let (human, robot) = (v1::ParticipantKind::Human, v1::ParticipantKind::Robot);
        // The decision time and absence time of the room, its clocks, and the decision and absence
        // times of people, robots, agents and models that follow.
        let cases = [
            (
                None,
                None,
                vec![],
                [
                    (60_000, 20_000),
                    (10_000, 10_000),
                    (10_000, 10_000),
                    (60_000, 60_000),
                ],
            ),
            (Some(5_000), None, vec![], [(5_000, 5_000); 4]),
            (
                Some(90_000),
                None,
                vec![],
                [
                    (90_000, 20_000),
                    (90_000, 90_000),
                    (90_000, 90_000),
                    (90_000, 90_000),
                ],
            ),
            (
                None,
                Some(3_000),
                vec![],
                [
                    (60_000, 3_000),
                    (10_000, 3_000),
                    (10_000, 3_000),
                    (60_000, 3_000),
                ],
            ),
            (
                None,
                None,
                vec![
                    clock_of(human, None, Some(7_000)),
                    clock_of(robot, Some(30_000), None),
                ],
                [
                    (60_000, 7_000),
                    (30_000, 30_000),
                    (10_000, 10_000),
                    (60_000, 60_000),
                ],
            ),
            (
                None,
                Some(0),
                vec![clock_of(human, Some(4_000), Some(50_000))],
                [(4_000, 4_000), (10_000, 0), (10_000, 0), (60_000, 0)],
            ),
        ];
        for (decision_time_ms, absence_time_ms, clocks, expected) in cases {
            let message = v1::RoomPolicy {
                decision_time_ms,
                absence_time_ms,
                clocks,
                ..v1::RoomPolicy::default()
            };
            let policy = requested_policy(&message).expect("the policy is valid");
            let times = [
                ParticipantKind::Human,
                ParticipantKind::Robot,
                ParticipantKind::Agent,
                ParticipantKind::Model,
            ]
            .map(|kind| {
                let absence = policy.absence_time_of(Some(kind)).expect("it has one");
                (millis(policy.decision_time_of(Some(kind))), millis(absence))
            });
            assert_eq!(times, expected, "{message:?}");
            let stored = policy_to_proto(&policy);
            assert_eq!(policy_from_proto(&stored), Ok(policy), "{message:?}");
        }
        let earlier = v1::RoomPolicy {
            absence_time_ms: None,
            clocks: Vec::new(),
            ..policy_to_proto(&Policy::default())
        };
        let policy = policy_from_proto(&earlier).expect("the policy is valid");
        assert_eq!(policy.absence_time_of(Some(ParticipantKind::Human)), None);
        let too_long = v1::RoomPolicy {
            absence_time_ms: Some(DAY_MS + 1),
            ..v1::RoomPolicy::default()
        };
        let problem = requested_policy(&too_long).expect_err("it is too long");
        assert_eq!(problem.field, "absence_time_ms");
    }

    #[test]
    fn games_without_a_room_are_recorded_with_the_policy_of_one() {
        let policy = Policy {
            max_invalid_attempts: Some(5),
            pace: Some(Duration::ZERO),
            clocks: Vec::new(),
            absence_time: None,
            ..Policy::default()
        };
        let recorded = chefshat_vector::simulation_policy(Some(5), None);
        assert_eq!(recorded, policy_to_proto(&policy));
    }
}
