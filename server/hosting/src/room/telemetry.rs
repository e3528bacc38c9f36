//! What an operator sees of a room: its metrics, its span, and the spans of its decisions.

use std::sync::Arc;

use chefshat_engine::Seat;
use chefshat_room::journal::Change;
use chefshat_room::{Core, State};
use smallvec::SmallVec;
use tokio::time::Instant;
use tracing::{Span, debug, debug_span, info_span};

use chefshat_base::metrics::{Counted, Metrics, Outcome};

/// What has been counted and traced of a room.
pub(super) struct RoomTelemetry {
    /// Number of changes that the metrics include.
    counted_changes: u64,
    /// The state as which the room is counted.
    counted_state: (State, Counted),
    /// When the answers were read whose results are not published.
    answers_read: SmallVec<[Instant; 1]>,
    /// The span of the room.
    span: Span,
    /// The open decision and its span. One that is taken as soon as it is opened has none.
    traced: (Option<(Seat, u64)>, Span),
}

impl RoomTelemetry {
    /// Counts a room and opens its span. Its changes so far have been counted.
    pub(super) fn new(core: &Core, metrics: &Metrics) -> Self {
        let (state, header) = (core.state(), core.header());
        Self {
            counted_changes: core.changes(),
            counted_state: (state, metrics.room(state)),
            answers_read: SmallVec::new(),
            span: info_span!(parent: None, "room", room = %header.room_id, game = %header.game_id),
            traced: (None, Span::none()),
        }
    }

    /// The span of the room.
    pub(super) fn span(&self) -> &Span {
        &self.span
    }

    /// Notes that an answer was read at a time.
    pub(super) fn answer_read(&mut self, at: Instant) {
        self.answers_read.push(at);
    }

    /// Counts the changes that are not counted yet, which are the last ones pending.
    pub(super) fn count_changes(&mut self, core: &mut Core, metrics: &Metrics) {
        let new = core.changes() - self.counted_changes;
        self.counted_changes += new;
        let (open, span) = &mut self.traced;
        let header = Arc::clone(core.header());
        let pending = core.pending();
        let first = (pending.len()).saturating_sub(usize::try_from(new).unwrap_or(usize::MAX));
        for entry in &pending[first..] {
            match &entry.change {
                Change::Decided(decided) => {
                    let built_in = header.fills[decided.seat.index()].is_built_in();
                    let outcome = Outcome::of(decided.source, built_in);
                    metrics.decided(decided, outcome);
                    if open.take_if(|(seat, _)| *seat == decided.seat).is_some() {
                        let (outcome, thinking_us) = (outcome.label(), decided.time_us);
                        debug!(parent: &*span, outcome, thinking_us, "a decision was taken");
                        *span = Span::none();
                    }
                }
                Change::Attempted { .. } => metrics.invalid_answer(),
                _ => {}
            }
        }
    }

    /// Starts the span of the open decision.
    pub(super) fn trace_decision(&mut self, core: &Core) {
        let open = (core.open()).map(|open| (open.decision.seat, open.id));
        if open != self.traced.0 {
            let span = open.map_or_else(Span::none, |(seat, decision)| {
                let seat = seat.index();
                debug_span!(parent: &self.span, "decision", seat, decision)
            });
            self.traced = (open, span);
        }
    }

    /// Counts the answers that have been published, and a new state of the room.
    pub(super) fn count_published(&mut self, core: &Core, metrics: &Metrics) {
        if !self.answers_read.is_empty() {
            let now = Instant::now();
            for read in self.answers_read.drain(..) {
                metrics.answered(now - read);
            }
        }
        let state = core.state();
        if state != self.counted_state.0 {
            self.counted_state = (state, metrics.room(state));
        }
    }
}
