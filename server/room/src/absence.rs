//! Seats that are not connected while the game waits for them: how long it waits, what of that time
//! their banks pay for, and whom it waits for, as everybody may know.

use std::ops::Range;
use std::time::Duration;

use chefshat_engine::{Decision, DecisionKind, Event, Seat};

use super::limits::{
    MAX_GATEWAY_DELAY, MAX_SPECIAL_ACTION_TIME, MIN_PACE_OF_PHASE, SPECIAL_ACTION_PACES,
};
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
    /// Whether its absence ends the decision, because somebody waits.
    pub absence_counts: bool,
    /// When the decision was opened; in a silence, when that began.
    pub since: Duration,
    /// When its time is up, as things stand. `None` in a silence, which would show.
    pub until: Option<Duration>,
}

impl Awaited {
    /// The parts that are sent to subscribers when they change. In between, clocks count.
    pub fn key(&self) -> (Seat, u64, bool, bool) {
        (self.seat, self.decision, self.away, self.absence_counts)
    }
}

impl Core {
    /// Whom of the participants the game waits for, as everybody may know. In a silence, the answer
    /// depends only on what everybody has seen: not on which decision is open, nor since when. No
    /// seat whose participant is hidden: nobody sees that the game waits for a built-in agent.
    pub fn awaited_in_public(&self) -> Option<Awaited> {
        let awaited = self.awaited_in_sight();
        awaited.filter(|awaited| !self.header.is_hidden(awaited.seat))
    }

    fn awaited_in_sight(&self) -> Option<Awaited> {
        let waits = self.state == State::Playing && !self.is_paused();
        let open = self.open.as_ref().filter(|_| waits)?;
        if self.next_taken_over().is_some() {
            return None;
        }
        let shown = |decision: u64, seat: Seat, since, until| Awaited {
            seat,
            decision,
            away: self.seats[seat.index()].connection.is_none(),
            absence_counts: self.absence_counts(seat),
            since,
            until,
        };
        let Some(silent_since) = self.silent_since else {
            let open = self.awaited().filter(|open| !open.is_silent())?;
            let (since, until) = (open.released, self.ends_at(open, Duration::ZERO));
            return Some(shown(open.id, open.decision.seat, since, Some(until)));
        };
        let first = self.first_in_silence()?;
        let number = match first == open.decision {
            true => open.id,
            false => self.seats[first.seat.index()].decisions + 1,
        };
        Some(shown(number, first.seat, silent_since, None))
    }

    /// The first decision of a participant who is not hidden in a silence, if no special action is
    /// declared. Who gives is known from the roles.
    fn first_in_silence(&self) -> Option<Decision> {
        let Some(RoomGame::Dealt(game)) = &self.game else {
            return None;
        };
        let decision = game.decision()?;
        let is_shown = |decision: Decision| {
            decision.kind != DecisionKind::SpecialAction && !self.seems_automatic(decision.seat)
        };
        if is_shown(decision) {
            return Some(decision);
        }
        let (mut game, mut last) = (game.clone(), decision);
        while last.kind != DecisionKind::Turn {
            let mut news = false;
            let action = game.default_action()?;
            game.apply(action, |_| news = true).ok()?;
            // The first turn follows from the cards, so that nobody knows it before the exchange.
            last = game.decision().filter(|_| !news)?;
            if is_shown(last) {
                return Some(last);
            }
        }
        None
    }

    /// Notes whether what a decision, or the start of the game, brought is the start of a silence
    /// or its end. `shows`: whether everybody learns of the decision even if no event follows.
    pub(super) fn note_silence(&mut self, at: Duration, events: &[Event], shows: bool) {
        let rules = &self.header.rules;
        let offered = rules.special_actions() && rules.jokers() >= 2;
        let declared = |event: &Event| matches!(event, Event::SpecialActionDeclared { .. });
        match events.last() {
            Some(Event::RolesAssigned { .. }) if offered && !events.iter().any(declared) => {
                self.silent_since = Some(at);
            }
            None if !shows => {}
            _ => self.silent_since = None,
        }
    }

    /// When the phase of special actions that has begun ends, unless somebody declares one before.
    /// `None` if the phase has no fixed time: the pace is too short, or there is at most one
    /// participant, from whom only built-in agents could hide something. Where seats are hidden,
    /// nobody may know that.
    ///
    /// What the phase brings is asked for when it ends, so that nobody learns from the time whether
    /// somebody was offered a special action, and declined it or let it run out.
    pub(super) fn phase_ends_at(&self) -> Option<Duration> {
        let since = self.silent_since?;
        let open = self
            .all_seats()
            .filter(|seat| matches!(self.seats[seat.index()].fill, Fill::Open { .. }));
        let hides = self.header.hides_seats();
        let pace = self.pace();
        if pace < MIN_PACE_OF_PHASE || !(hides || open.count() >= 2) {
            return None;
        }
        let time = (SPECIAL_ACTION_PACES * pace).min(MAX_SPECIAL_ACTION_TIME);
        Some(since + time.min(self.longest_decision_time()?))
    }

    /// When the default is taken for a silent decision in a phase with a fixed time.
    pub(super) fn phase_ends_of(&self, open: &OpenDecision) -> Option<Duration> {
        self.phase_ends_at().filter(|_| open.is_silent())
    }

    /// When the clock of a decision starts, as far as it is known.
    pub(super) fn starts_at(&self, open: &OpenDecision) -> Duration {
        let recalled_until = self.recalled_until(open);
        let latest = recalled_until.map_or(open.released, |until| open.released.max(until));
        open.start.unwrap_or(latest)
    }

    /// When the default is taken for a decision, as things stand.
    pub(super) fn runs_out_at(&self, open: &OpenDecision) -> Duration {
        self.ends_at(open, self.grace(open))
    }

    /// How late an answer to a decision may arrive. To a silent one it is the same for all seats: it would
    /// show whether the seat is connected through another server.
    pub(super) fn grace(&self, open: &OpenDecision) -> Duration {
        match (open.is_silent(), self.expects_delays) {
            (false, _) => self.seats[open.decision.seat.index()].grace,
            (true, true) => MAX_GATEWAY_DELAY,
            (true, false) => Duration::ZERO,
        }
    }

    /// When the clock of a decision ends, as things stand, or so much `later`.
    fn ends_at(&self, open: &OpenDecision, later: Duration) -> Duration {
        if let Some(end) = self.phase_ends_of(open) {
            return end;
        }
        let seat = open.decision.seat;
        let own = self.starts_at(open) + self.time_allowed(open) + later;
        match self.absence(open) {
            Some(absence) if self.holds_others_up(seat) => own.min(absence.end),
            _ => own,
        }
    }

    /// Whether the absence of a seat would end a decision of it now.
    fn absence_counts(&self, seat: Seat) -> bool {
        let state = &self.seats[seat.index()];
        let kind = state.participant.as_ref().map(|it| it.kind);
        let time = self.header.policy.absence_time_of(kind);
        state.connection.is_none() && time.is_some() && self.holds_others_up(seat)
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

    /// Whether somebody waits for a seat that is away: the other games of its tournament, or
    /// another participant who is here. Hidden ones may be, for all that anybody knows.
    fn holds_others_up(&self, seat: Seat) -> bool {
        let mut others = self.all_seats().filter(|other| *other != seat);
        self.header.tournament.is_some()
            || (self.header.hides_seats() && self.header.is_of_study(seat))
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
