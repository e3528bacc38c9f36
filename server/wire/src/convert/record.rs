//! Builds the record of a finished game by folding its journal: every decision and event, in order.

use std::sync::Arc;

use chefshat_engine::Viewer;
use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};
use chefshat_record::convert::{invalid_reward, seat_number};
use prost::Message as _;

use super::decision::mask_bytes;
use super::event::event_to_proto;
use super::labels::without_labels;
use super::marker::last_marker;
use super::mirrored::Mirrored as _;
use super::physical_record::physical_record_lines;
use super::room::state_to_proto;
use super::summary::{elapsed_ms, record_header};
use chefshat_record::convert::decision_kind;
use chefshat_room::Core;
use chefshat_room::journal::{Change, Decided, Entry, GameHeader};

/// All lines of the record of a game, from its header and its journal.
pub fn record_lines(header: &Arc<GameHeader>, journal: &[Entry]) -> Vec<v1::RecordLine> {
    let mut lines = Vec::with_capacity(journal.len() * 2);
    each_record_line(header, journal, |line| lines.push(line));
    lines
}

/// Passes the same lines on one by one: those of a long game take far more memory than its journal.
pub fn each_record_line(
    header: &Arc<GameHeader>,
    journal: &[Entry],
    mut take: impl FnMut(v1::RecordLine),
) {
    if header.is_physical() {
        return physical_record_lines(header, journal)
            .into_iter()
            .for_each(take);
    }
    let mut take = |mut line: Line| {
        if !header.wizards.is_empty() {
            by_wizard(header, &mut line);
        }
        take(v1::RecordLine { line: Some(line) });
    };
    // The first line says how the game ended.
    let mut ended = Core::new(without_labels(header));
    journal.iter().for_each(|entry| ended.refold(entry));
    take(Line::Header(Box::new(record_header(&ended))));
    drop(ended);
    let mut core = Core::new(without_labels(header));
    let mut attempts: Vec<u32> = Vec::new();
    let (mut decisions, mut hints) = (0, 0);
    for entry in journal {
        match &entry.change {
            Change::Attempted { action, .. } => attempts.push(*action),
            Change::Hinted(_) => hints += 1,
            Change::Decided(decided) => {
                decisions += 1;
                let record = v1::DecisionRecord {
                    hints: std::mem::take(&mut hints),
                    ..decision(&core, entry, decided, &std::mem::take(&mut attempts))
                };
                take(Line::Decision(record));
            }
            Change::Expressed {
                seat,
                record_only: true,
                expression,
            } => take(Line::PrivateExpression(v1::PrivateExpression {
                seat: seat_number(*seat),
                elapsed_ms: elapsed_ms(entry),
                expression: v1::Expression::decode(expression.as_ref()).ok(),
            })),
            _ => {}
        }
        let before = core.log().len();
        core.refold(entry);
        if let Change::Marked(_) = entry.change
            && let Some(marker) = last_marker(&core)
        {
            take(Line::Marker(marker));
        }
        (before..core.log().len())
            .filter_map(|position| event_to_proto(&core, position, Viewer::Everything))
            .for_each(|event| take(Line::Event(event)));
    }
    take(Line::Footer(v1::RecordFooter {
        state: state_to_proto(core.state()).into(),
        events: u64::try_from(core.log().len()).unwrap_or(u64::MAX),
        decisions,
        ..v1::RecordFooter::default()
    }));
}

/// Sets the source of an expression of a seat that a person plays as another kind. Others in the room
/// saw the source that the seat sent.
fn by_wizard(header: &GameHeader, line: &mut Line) {
    let (seat, expression) = match line {
        Line::PrivateExpression(private) => (private.seat, &mut private.expression),
        Line::Event(event) => match &mut event.kind {
            Some(Kind::ExpressionShown(shown)) => (shown.seat, &mut shown.expression),
            _ => return,
        },
        _ => return,
    };
    let is_wizard = usize::try_from(seat).is_ok_and(|seat| header.wizards.contains(&seat));
    if let Some(expression) = expression.as_mut().filter(|_| is_wizard) {
        expression.set_source(v1::ExpressionSource::Wizard);
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
        source: decided.source.to_proto().into(),
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
        hints: 0,
    }
}
