//! Checks the header of a record, except for the seed commitment, which is checked at the reveal.

use std::collections::BTreeSet;
use std::ops::RangeInclusive;

use chefshat_engine::limits::MIN_PACE_OF_PHASE_MS;
use chefshat_engine::{RULES_VERSION, RewardScheme, RuleSet, Script};
use chefshat_proto::v1;
use chefshat_referee::StartState;

use super::difference::{difference, must_be};
use super::seed::Part;
use crate::convert::{
    LAST_MS, action_space, has_real_cards, reward_scheme_from_proto, rules_from_proto,
    rules_to_proto, script_from_proto,
};
use crate::jsonl::FORMAT_VERSION;
use crate::pseudonym::is_fingerprint;
use crate::stated::start_of_header;

const COMMITMENT_BYTES: usize = 32;
/// Milliseconds of a day, the longest time of a policy.
const DAY_MS: u32 = 86_400_000;

/// A checked header.
#[derive(Debug)]
pub(super) struct Setup {
    pub(super) game_id: [u8; 16],
    pub(super) rules: RuleSet,
    pub(super) scheme: Option<RewardScheme>,
    pub(super) origin: v1::GameOrigin,
    /// Invalid attempts per decision before the default decision; 0: unlimited.
    pub(super) max_invalid_attempts: u32,
    /// Whether special actions have a fixed time, which may be shorter than a decision time.
    pub(super) special_actions_have_phase: bool,
    /// Whether seats may ask for hints.
    pub(super) hints: bool,
    /// The first Shift, if its hands were given.
    pub(super) script: Option<Script>,
    /// The start of a game with real cards.
    pub(super) physical: Option<StartState>,
    /// The decisions taken over from the parent game.
    pub(super) taken_over: Vec<Part>,
}

/// Checks a header.
///
/// # Errors
/// The first wrong field.
pub(super) fn check(header: &v1::RecordHeader) -> Result<Setup, String> {
    if header.format_version != FORMAT_VERSION {
        return Err(format!(
            "the record has format version {}; this program reads version {FORMAT_VERSION}",
            header.format_version
        ));
    }
    if header.rules_version != RULES_VERSION {
        return Err(format!(
            "the game was played by version {} of the rules; this program has version {RULES_VERSION}",
            header.rules_version
        ));
    }
    let game_id = check_id("gameId", &header.game_id)?;
    check_id("roomId", &header.room_id)?;
    if header.created_at_ms > LAST_MS {
        return Err(format!(
            "createdAtMs is {}, after the year 9999",
            header.created_at_ms
        ));
    }
    let stated = header.rules.as_ref().ok_or("rules are missing")?;
    let rules = rules_from_proto(stated).map_err(|problem| format!("rules.{problem}"))?;
    within("rules", difference(stated, &rules_to_proto(&rules)))?;
    let space = header.action_space.clone().unwrap_or_default();
    within(
        "actionSpace",
        difference(&space, &action_space(&rules.actions())),
    )?;
    check_seats(&header.seats, rules.players())?;
    let policy = header.policy.as_ref().ok_or("policy is missing")?;
    check_policy(policy)?;
    let origin = v1::GameOrigin::try_from(header.origin)
        .ok()
        .filter(|origin| *origin != v1::GameOrigin::Unspecified)
        .ok_or("origin is missing or unknown")?;
    check_commitment(origin, header.seed_commitment.len())?;
    let scripted = header
        .start
        .as_ref()
        .and_then(|start| start.scripted.as_ref());
    let physical = has_real_cards(origin)
        .then(|| start_of_header(scripted, &rules))
        .transpose()
        .map_err(|problem| format!("start.scripted.{problem}"))?;
    let (script, taken_over) = check_start(origin, header.start.as_ref(), &rules)?;
    Ok(Setup {
        game_id,
        rules,
        scheme: reward_scheme_from_proto(policy.reward_scheme()),
        origin,
        max_invalid_attempts: policy.max_invalid_attempts(),
        special_actions_have_phase: policy.pace_ms() >= MIN_PACE_OF_PHASE_MS,
        hints: policy.hints,
        script,
        physical,
        taken_over,
    })
}

/// Decodes an id of 32 lower-case hexadecimal digits.
fn check_id(field: &str, id: &str) -> Result<[u8; 16], String> {
    let mut bytes = [0; 16];
    match hex::decode_to_slice(id, &mut bytes) {
        Ok(()) if hex::encode(bytes) == id => Ok(bytes),
        _ => Err(must_be(field, id, "32 hexadecimal digits (0-9, a-f)")),
    }
}

fn within(field: &str, problem: Option<String>) -> Result<(), String> {
    problem.map_or(Ok(()), |problem| Err(format!("{field}.{problem}")))
}

fn check_seats(seats: &[v1::Participant], players: usize) -> Result<(), String> {
    if seats.len() != players {
        return Err(format!(
            "there are {} seats, but the rule set has {players} players",
            seats.len()
        ));
    }
    for (index, (seat, number)) in seats.iter().zip(0u32..).enumerate() {
        if seat.seat != number {
            return Err(must_be(&format!("seats[{index}].seat"), seat.seat, number));
        }
        for (field, kind) in [
            ("kind", seat.kind),
            ("reservedFor", seat.reserved_for),
            ("shownKind", seat.shown_kind),
        ] {
            if v1::ParticipantKind::try_from(kind).is_err() {
                return Err(format!(
                    "seats[{index}].{field} is {kind}, which is not a kind of participant"
                ));
            }
        }
        let fingerprint = seat.name_fingerprint.as_str();
        let field = format!("seats[{index}].nameFingerprint");
        if !seat.built_in_agent.is_empty() && !fingerprint.is_empty() {
            return Err(must_be(&field, fingerprint, "empty for a built-in agent"));
        }
        if !is_fingerprint(fingerprint) {
            let what = "empty or 16 hexadecimal digits (0-9, a-f)";
            return Err(must_be(&field, fingerprint, what));
        }
    }
    Ok(())
}

fn check_policy(policy: &v1::RoomPolicy) -> Result<(), String> {
    let numbers: [(&str, Option<u32>, RangeInclusive<u32>); 7] = [
        ("decisionTimeMs", policy.decision_time_ms, 10..=DAY_MS),
        ("bankMs", policy.bank_ms, 0..=DAY_MS),
        ("maxInvalidAttempts", policy.max_invalid_attempts, 0..=1000),
        ("maxTimeouts", policy.max_timeouts, 1..=1000),
        ("paceMs", policy.pace_ms, 0..=60_000),
        ("waitingTimeMs", policy.waiting_time_ms, 1_000..=DAY_MS),
        (
            "spectatorDelayDecisions",
            policy.spectator_delay_decisions,
            0..=10_000,
        ),
    ];
    for (field, value, range) in numbers {
        if !value.is_some_and(|value| range.contains(&value)) {
            let found = value.map_or("absent".to_owned(), |value| value.to_string());
            return Err(format!(
                "policy.{field} is {found} and must be in {}..={}",
                range.start(),
                range.end()
            ));
        }
    }
    let mut kinds = BTreeSet::new();
    for clock in &policy.clocks {
        let times = [
            (clock.decision_time_ms, 10..=DAY_MS),
            (clock.bank_ms, 0..=DAY_MS),
            (clock.absence_time_ms, 0..=DAY_MS),
        ];
        let fits = (times.iter()).all(|(ms, range)| ms.is_none_or(|ms| range.contains(&ms)));
        let named = clock.kind() != v1::ParticipantKind::Unspecified;
        if !(fits && named && kinds.insert(clock.kind)) {
            return Err("policy.clocks has an invalid kind or time".into());
        }
    }
    let known = [
        (
            "absenceTimeMs",
            policy.absence_time_ms.is_none_or(|ms| ms <= DAY_MS),
        ),
        ("abort", v1::AbortPolicy::try_from(policy.abort).is_ok()),
        (
            "rewardScheme",
            v1::RewardScheme::try_from(policy.reward_scheme).is_ok(),
        ),
        (
            "durability",
            v1::Durability::try_from(policy.durability).is_ok(),
        ),
        ("substitute", !policy.substitute.is_empty()),
        ("spectators", policy.spectators.is_some()),
        ("spectatorsSeeHands", policy.spectators_see_hands.is_some()),
    ];
    match known.iter().find(|(_, known)| !known) {
        Some((field, _)) => Err(format!("policy.{field} is missing or invalid")),
        None => Ok(()),
    }
}

fn check_commitment(origin: v1::GameOrigin, bytes: usize) -> Result<(), String> {
    let (committed, fixed) = match origin {
        v1::GameOrigin::Dealt => (true, false),
        v1::GameOrigin::FixedSeed | v1::GameOrigin::Imported | v1::GameOrigin::Physical => {
            (false, true)
        }
        _ => (true, true),
    };
    match bytes {
        COMMITMENT_BYTES if committed => Ok(()),
        0 if fixed => Ok(()),
        _ => {
            let expected = match (committed, fixed) {
                (true, true) => "32 bytes or absent",
                (true, false) => "32 bytes",
                (false, _) => "absent",
            };
            Err(format!(
                "seedCommitment has {bytes} bytes; for {} it must be {expected}",
                origin.as_str_name()
            ))
        }
    }
}

fn check_start(
    origin: v1::GameOrigin,
    start: Option<&v1::GameStart>,
    rules: &RuleSet,
) -> Result<(Option<Script>, Vec<Part>), String> {
    use v1::GameOrigin::{Branched, Imported, Scripted};
    let nothing = v1::GameStart::default();
    let start = start.unwrap_or(&nothing);
    let needs = |field: &str, there: bool, needed: bool, allowed: bool| match (there, needed) {
        (false, true) => Err(format!(
            "start.{field} is missing, but origin is {}",
            origin.as_str_name()
        )),
        (true, false) if !allowed => Err(format!(
            "start.{field} is present, but origin is {}",
            origin.as_str_name()
        )),
        _ => Ok(()),
    };
    needs(
        "scripted",
        start.scripted.is_some(),
        origin == Scripted,
        matches!(origin, Branched | Imported),
    )?;
    needs(
        "branchedFrom",
        start.branched_from.is_some(),
        origin == Branched,
        false,
    )?;
    needs(
        "takenOver",
        !start.taken_over.is_empty(),
        origin == Branched,
        false,
    )?;
    let script = start
        .scripted
        .as_ref()
        .filter(|_| !has_real_cards(origin))
        .map(|script| script_from_proto(script, rules))
        .transpose()
        .map_err(|problem| format!("start.scripted.{problem}"))?;
    let parts = start
        .taken_over
        .iter()
        .map(|part| Part::new(part).ok_or("start.takenOver: a gameSeed does not have 32 bytes"))
        .collect::<Result<Vec<_>, _>>()?;
    if let Some(point) = &start.branched_from {
        check_id("start.branchedFrom.gameId", &point.game_id)?;
        let taken_over = parts
            .iter()
            .try_fold(0u64, |sum, part| sum.checked_add(part.decisions))
            .ok_or("start.takenOver has too many decisions")?;
        if point.decisions != taken_over {
            return Err(format!(
                "start.branchedFrom.decisions is {} and must be {taken_over}, the sum of start.takenOver",
                point.decisions
            ));
        }
    }
    Ok((script, parts))
}
