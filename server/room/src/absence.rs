//! Seats that are not connected while the game waits for them: how long it waits, what of that time
//! their banks pay for, and whom it waits for, as everybody may know.

use std::ops::Range;
use std::time::Duration;

use chefshat_engine::{Decision, DecisionKind, Seat};

use super::{Core, OpenDecision, State};
use crate::journal::Fill;
use crate::table::RoomGame;

/// Whom the game waits for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Awaited {
    /// The seat whose decision is open.
    pub seat: Seat,
    /// Number of the decision, per seat, from 1.
    pub decision: u64,
    /// Whether the seat is not connected.
    pub away: bool,
    /// When the decision was opened.
    pub since: Duration,
    /// When the server decides for it, as things stand.
    pub until: Duration,
}

impl Core {
    /// Whom of the participants the game waits for, as everybody may know. A silent decision shows
    /// as the one that follows when it is declined.
    pub fn awaited_in_public(&self) -> Option<Awaited> {
        let waits = self.state == State::Playing && !self.is_paused();
        let open = self.awaited().filter(|_| waits)?;
        if !open.is_silent() {
            return Some(self.show(open));
        }
        let decision = self.decision_once_declined()?;
        let seat = &self.seats[decision.seat.index()];
        let next = OpenDecision {
            decision,
            id: seat.decisions + 1,
            start: None,
            ..open.clone()
        };
        (!self.is_automatic(decision.seat)).then(|| self.show(&next))
    }

    fn show(&self, open: &OpenDecision) -> Awaited {
        let seat = open.decision.seat;
        Awaited {
            seat,
            decision: open.id,
            away: self.seats[seat.index()].connection.is_none(),
            since: open.released,
            until: self.runs_out_at(open),
        }
    }

    /// The decision that follows if the open one, a silent one, is declined.
    fn decision_once_declined(&self) -> Option<Decision> {
        let Some(RoomGame::Dealt(game)) = &self.game else {
            return None;
        };
        let mut game = game.clone();
        game.apply(self.default_action()?, |_| {}).ok()?;
        (game.decision()).filter(|next| next.kind != DecisionKind::SpecialAction)
    }

    /// When the clock of a decision starts, as far as it is known.
    fn starts_at(&self, open: &OpenDecision) -> Duration {
        let recalled_until = self.recalled_until(open.decision.seat);
        let latest = recalled_until.map_or(open.released, |until| open.released.max(until));
        open.start.unwrap_or(latest)
    }

    /// When the default is taken for a decision, as things stand.
    pub(super) fn runs_out_at(&self, open: &OpenDecision) -> Duration {
        let seat = open.decision.seat;
        let own = self.starts_at(open) + self.time_allowed(open) + self.seats[seat.index()].grace;
        match self.absence(open) {
            Some(absence) if self.holds_others_up(seat) => own.min(absence.end),
            _ => own,
        }
    }

    /// The absence of a seat from its decision: since when, and how long the game waits for it.
    /// `None` if it is connected, and where an absence changes nothing: at silent decisions, which
    /// would show, and in games without an absence time.
    pub(super) fn absence(&self, open: &OpenDecision) -> Option<Range<Duration>> {
        let state = &self.seats[open.decision.seat.index()];
        if state.connection.is_some() || open.is_silent() {
            return None;
        }
        let kind = state.participant.as_ref().map(|it| it.kind);
        let time = self.header.policy.absence_time_of(kind)?;
        let since = state.lost_at.max(self.starts_at(open));
        Some(since..since + time.saturating_sub(open.absent))
    }

    /// Whether somebody waits for a seat that is away: the other games of its tournament, or another
    /// participant who is here.
    fn holds_others_up(&self, seat: Seat) -> bool {
        let mut others = self.all_seats().filter(|other| *other != seat);
        self.header.tournament.is_some()
            || others.any(|other| {
                let state = &self.seats[other.index()];
                match state.fill {
                    Fill::Open { .. } => state.connection.is_some() && !state.substituted,
                    Fill::AtTable(_) => true,
                    Fill::BuiltIn(_) | Fill::Replay(_) => false,
                }
            })
    }

    /// How much of the first `time` of a decision the bank does not pay for, although it is beyond
    /// the decision time, because the seat was not connected.
    pub(super) fn unbanked(&self, open: &OpenDecision, time: Duration) -> Duration {
        let now = self.starts_at(open) + time;
        open.unbanked + self.unbanked_now(open, now)
    }

    /// The same of the absence that has not ended.
    fn unbanked_now(&self, open: &OpenDecision, now: Duration) -> Duration {
        let banked_from = self.starts_at(open) + self.decision_time(open);
        let absence = self.absence(open);
        absence.map_or(Duration::ZERO, |absence| {
            now.saturating_sub(absence.start.max(banked_from))
        })
    }

    /// Counts the absence of a seat that returns to its open decision.
    pub(super) fn end_absence(&mut self, seat: Seat, now: Duration) {
        let Some(open) = self.awaited_from(seat) else {
            return;
        };
        let Some(absence) = self.absence(open) else {
            return;
        };
        let absent = now.saturating_sub(absence.start);
        let unbanked = self.unbanked_now(open, now);
        if let Some(open) = &mut self.open {
            open.absent += absent;
            open.unbanked += unbanked;
        }
    }
}
