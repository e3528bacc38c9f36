//! Builds the record of a finished game by folding its journal: every decision and event, in order.

use std::borrow::Cow;
use std::sync::Arc;

use chefshat_engine::Viewer;
use chefshat_proto::v1::{self, record_line::Line};
use chefshat_record::convert::{action_space, invalid_reward, rules_to_proto, seat_number};
use chefshat_record::jsonl::FORMAT_VERSION;
use prost::Message as _;

use super::decision::{mask_bytes, source_to_proto};
use super::event::{event_to_proto, standings};
use super::physical_record::{decisions_at_table, physical_record_lines};
use super::policy::policy_of;
use super::room::{
    aborted_because, participants, seed_commitment, series_id, state_to_proto, tournament_id,
};
use super::start::{origin, start_to_proto};
use crate::store::StoredGame;
use chefshat_record::convert::decision_kind;
use chefshat_room::Core;
use chefshat_room::journal::{Change, Decided, Entry, GameHeader};

/// All lines of the record of a game, from its header and its journal.
pub fn record_lines(header: &Arc<GameHeader>, journal: &[Entry]) -> Vec<v1::RecordLine> {
    if header.is_physical() {
        return physical_record_lines(header, journal);
    }
    let mut core = Core::new(Arc::clone(header));
    let mut body = Vec::with_capacity(journal.len() * 2);
    let mut attempts: Vec<u32> = Vec::new();
    let mut decisions = 0;
    for entry in journal {
        match &entry.change {
            Change::Attempted { action, .. } => attempts.push(*action),
            Change::Decided(decided) => {
                decisions += 1;
                let record = decision(&core, entry, decided, &std::mem::take(&mut attempts));
                body.push(Line::Decision(record));
            }
            Change::Expressed {
                seat,
                record_only: true,
                expression,
            } => body.push(Line::PrivateExpression(v1::PrivateExpression {
                seat: seat_number(*seat),
                elapsed_ms: elapsed_ms(entry),
                expression: v1::Expression::decode(expression.as_ref()).ok(),
            })),
            _ => {}
        }
        let before = core.log().len();
        core.refold(entry);
        body.extend(
            (before..core.log().len())
                .filter_map(|position| event_to_proto(&core, position, Viewer::Everything))
                .map(Line::Event),
        );
    }
    let footer = Line::Footer(v1::RecordFooter {
        state: state_to_proto(core.state()).into(),
        events: u64::try_from(core.log().len()).unwrap_or(u64::MAX),
        decisions,
    });
    std::iter::once(Line::Header(record_header(&core)))
        .chain(body)
        .chain(std::iter::once(footer))
        .map(|line| v1::RecordLine { line: Some(line) })
        .collect()
}

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
        seats: participants(core),
        seed_commitment: seed_commitment(header),
        created_at_ms: header.created_at_ms,
        server_version: env!("CARGO_PKG_VERSION").into(),
        action_space: Some(action_space(&header.rules.actions())),
        start: start_to_proto(&header.start, header.rules.faces()),
        tournament_id: tournament_id(header),
        series_id: series_id(header),
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
        seats: participants(core),
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
    }
}

/// All lines of the record of a stored game.
pub fn lines_of(stored: &StoredGame) -> Cow<'_, [v1::RecordLine]> {
    match stored {
        StoredGame::Hosted(header, journal) => Cow::Owned(record_lines(header, journal)),
        StoredGame::Imported(lines) => Cow::Borrowed(lines),
    }
}

/// A decision, with the state of the game before it.
fn decision(core: &Core, entry: &Entry, decided: &Decided, attempts: &[u32]) -> v1::DecisionRecord {
    let rules = &core.header().rules;
    let open = core.open();
    let scheme = core.header().policy.reward_scheme;
    v1::DecisionRecord {
        seat: seat_number(decided.seat),
        decision_id: open.map_or(0, |open| open.id),
        kind: open
            .map_or(v1::DecisionKind::Unspecified, |open| {
                decision_kind(open.decision.kind)
            })
            .into(),
        action: decided.action.index().into(),
        text: rules.actions().text(decided.action).unwrap_or_default(),
        source: source_to_proto(decided.source).into(),
        decision_time_us: decided.time_us,
        bank_left_ms: decided.bank_left_ms,
        invalid_attempts: attempts.to_vec(),
        annotations: decided
            .annotations
            .as_ref()
            .and_then(|bytes| v1::Annotations::decode(bytes.as_ref()).ok()),
        action_mask: mask_bytes(&core.legal_actions(), rules),
        invalid_reward: open
            .and_then(|open| invalid_reward(scheme, open.decision.kind, attempts.len())),
        elapsed_ms: elapsed_ms(entry),
    }
}

pub(super) fn elapsed_ms(entry: &Entry) -> u64 {
    u64::try_from(entry.at.as_millis()).unwrap_or(u64::MAX)
}
