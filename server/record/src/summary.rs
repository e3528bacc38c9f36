//! The summary of a record, as listings show it.

use chefshat_proto::v1::{self, game_event::Kind, record_line::Line};

use crate::replay::Replayed;

/// The summary of a verified record; `None` if nothing was dealt.
pub fn summary(lines: &[v1::RecordLine], replayed: &Replayed) -> Option<v1::RecordSummary> {
    let mut summary = v1::RecordSummary {
        state: replayed.state.into(),
        standings: replayed.standings.clone(),
        decisions: replayed.decisions,
        ..v1::RecordSummary::default()
    };
    for line in lines.iter().filter_map(|line| line.line.as_ref()) {
        match line {
            Line::Header(header) => {
                summary.game_id.clone_from(&header.game_id);
                summary.room_id.clone_from(&header.room_id);
                summary.room_name.clone_from(&header.room_name);
                summary.origin = header.origin;
                summary.created_at_ms = header.created_at_ms;
                summary.rules.clone_from(&header.rules);
                summary.seats.clone_from(&header.seats);
            }
            Line::Event(event) => {
                summary.ended_at_ms = summary.created_at_ms.saturating_add(event.elapsed_ms);
                match &event.kind {
                    Some(Kind::ShiftStarted(shift)) => summary.shifts = shift.shift,
                    Some(Kind::GameAborted(aborted)) => summary.abort_reason = aborted.reason,
                    _ => {}
                }
            }
            Line::Decision(decision) => summary.hinted |= decision.hints > 0,
            _ => {}
        }
    }
    (summary.shifts > 0).then_some(summary)
}
