//! The summary of a record, as listings show it.

use std::collections::{BTreeMap, BTreeSet};

use chefshat_engine::OwnChoices;
use chefshat_proto::v1::{
    self, AbortReason, DecisionSource, GameOrigin, game_event::Kind, record_line::Line,
};

use crate::outcome::add_choice;
use crate::replay::Replayed;

/// The summary of a verified record; `None` if nothing was dealt.
pub fn summary(lines: &[v1::RecordLine], replayed: &Replayed) -> Option<v1::RecordSummary> {
    let mut summary = v1::RecordSummary {
        state: replayed.state.into(),
        standings: replayed.standings.clone(),
        decisions: replayed.decisions,
        ..v1::RecordSummary::default()
    };
    // The seats whose participants did not play to the end by themselves.
    let (mut forfeited, mut away, mut late) = (BTreeSet::new(), BTreeSet::new(), None);
    let mut choices: BTreeMap<u32, OwnChoices> = BTreeMap::new();
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
                summary.visibility = (header.policy.as_ref()).map_or(0, |policy| policy.visibility);
            }
            Line::Event(event) => {
                summary.ended_at_ms = summary.created_at_ms.saturating_add(event.elapsed_ms);
                match &event.kind {
                    Some(Kind::ShiftStarted(shift)) => summary.shifts = shift.shift,
                    Some(Kind::Disconnected(lost)) => drop(away.insert(lost.seat)),
                    Some(Kind::Returned(returned)) => drop(away.remove(&returned.seat)),
                    Some(Kind::ServerRestarted(_)) => away.clear(),
                    Some(Kind::Substituted(substituted)) => {
                        summary.substituted = true;
                        forfeited.insert(substituted.seat);
                    }
                    Some(Kind::GameAborted(aborted)) => {
                        summary.abort_reason = aborted.reason;
                        match aborted.reason() {
                            AbortReason::Closed => forfeited.append(&mut away),
                            AbortReason::ParticipantsLost => {
                                forfeited.append(&mut away);
                                forfeited.extend(late);
                            }
                            _ => {}
                        }
                    }
                    _ => {}
                }
            }
            Line::Decision(decision) => {
                let is_late = matches!(
                    decision.source(),
                    DecisionSource::Timeout | DecisionSource::Disconnected
                );
                late = is_late.then_some(decision.seat);
                add_choice(choices.entry(decision.seat).or_default(), decision);
                if decision.hints > 0 {
                    summary.hinted = true;
                    forfeited.insert(decision.seat);
                }
            }
            _ => {}
        }
    }
    // What is known of the decisions at a physical table may change later.
    if summary.origin() == GameOrigin::Physical {
        choices.clear();
    }
    let by_fallback = choices.iter().filter(|(_, choices)| !choices.are_own());
    forfeited.extend(by_fallback.map(|(seat, _)| *seat));
    for seat in &mut summary.seats {
        seat.substituted = forfeited.contains(&seat.seat);
    }
    (summary.shifts > 0).then_some(summary)
}
