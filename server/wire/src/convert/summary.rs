//! The header and the summary of a record.

use chefshat_proto::v1;
use chefshat_record::convert::{action_space, rules_to_proto, seat_number};
use chefshat_record::jsonl::FORMAT_VERSION;
use chefshat_room::journal::{Entry, StudyGame};
use chefshat_room::{Core, PhysicalTable};

use super::event::standings;
use super::policy::{policy_of, visibility_to_proto};
use super::room::{
    aborted_because, recorded_participants, seed_commitment, series_id, state_to_proto,
    tournament_id,
};
use super::start::{origin, start_to_proto};

/// The header of a record.
pub(super) fn record_header(core: &Core) -> v1::RecordHeader {
    let header = core.header();
    v1::RecordHeader {
        format_version: FORMAT_VERSION,
        game_id: header.game_id.to_string(),
        room_id: header.room_id.to_string(),
        room_name: header.name.clone(),
        origin: origin(header).into(),
        rules: Some(rules_to_proto(&header.rules)),
        rules_version: header.rules_version,
        policy: Some(policy_of(core)),
        seats: recorded_participants(core),
        seed_commitment: seed_commitment(header),
        created_at_ms: header.created_at_ms,
        server_version: header.server_version.clone(),
        action_space: Some(action_space(&header.rules.actions())),
        start: start_to_proto(&header.start, header.rules.faces()),
        tournament_id: tournament_id(header),
        series_id: series_id(header),
        study: header.study.as_deref().map(study_record),
    }
}

fn study_record(game: &StudyGame) -> v1::StudyRecord {
    let mut members = game.members.iter().map(|member| v1::StudyRecordMember {
        number: member.number,
        participant: member.participant.clone(),
        session: member.session,
        seat: seat_number(member.seat),
    });
    let first = members.next().unwrap_or_default();
    v1::StudyRecord {
        study_id: game.study.to_string(),
        name: game.name.clone(),
        condition: game.condition.clone(),
        levels: (game.levels.iter())
            .map(|(factor, level)| v1::StudyLevel {
                factor: factor.clone(),
                level: level.clone(),
            })
            .collect(),
        number: first.number,
        participant: first.participant,
        session: first.session,
        step: game.step,
        practice: game.practice,
        seed_index: game.seed_index,
        seat: first.seat,
        attempt: game.attempt,
        group: game.group.unwrap_or(0),
        others: members.collect(),
    }
}

/// The summary of a record. The game ended with the last event.
pub fn summary(core: &Core) -> v1::RecordSummary {
    let header = core.header();
    let last = core.log().len().checked_sub(1);
    let ended_at_ms =
        (last.and_then(|last| core.log().get(last))).map_or(0, |entry| u64::from(entry.at_ms));
    v1::RecordSummary {
        game_id: header.game_id.to_string(),
        room_id: header.room_id.to_string(),
        room_name: header.name.clone(),
        state: state_to_proto(core.state()).into(),
        origin: origin(header).into(),
        created_at_ms: header.created_at_ms,
        ended_at_ms: header.created_at_ms.saturating_add(ended_at_ms),
        rules: Some(rules_to_proto(&header.rules)),
        seats: summarised_participants(core),
        standings: standings(core),
        shifts: core.game().map_or(0, |game| game.shift()),
        decisions: match core.table() {
            Some(table) => decisions_at_table(table),
            None => core.decisions(),
        },
        added: false,
        abort_reason: aborted_because(core.state()).into(),
        tournament_id: tournament_id(header),
        substituted: core.was_substituted(),
        hinted: core.was_hinted(),
        visibility: visibility_to_proto(header.policy.visibility).into(),
        study_id: (header.study.as_ref()).map_or_else(String::new, |game| game.study.to_string()),
    }
}

/// The seats with those marked whose participants did not play to the end by themselves, which
/// ratings count.
fn summarised_participants(core: &Core) -> Vec<v1::Participant> {
    let mut seats = recorded_participants(core);
    for (seat, shown) in core.all_seats().zip(&mut seats) {
        shown.substituted = core.has_forfeited(seat);
    }
    seats
}

/// Number of decisions of a game at a physical table, as its record has them.
fn decisions_at_table(table: &PhysicalTable) -> u64 {
    let shifts = table.referee().story();
    let decisions: usize = shifts.iter().map(|shift| shift.decisions.len()).sum();
    u64::try_from(decisions).unwrap_or(u64::MAX)
}

/// Time of an entry since the room was created, ms.
pub(super) fn elapsed_ms(entry: &Entry) -> u64 {
    u64::try_from(entry.at.as_millis()).unwrap_or(u64::MAX)
}
