//! The passing of time: deadlines and banks, default decisions, substitution, the decisions of
//! built-in agents, and seats that are not attached in time.

use std::time::Duration;

use chefshat_agents::BuiltInAgent;
use chefshat_engine::{ActionId, Seat, Viewer};

use super::{
    BUILT_IN_BUDGET, CONFIRMATION_TIME, Core, JOIN_HOLD, MAX_ANNOTATION_BYTES_PER_GAME,
    MAX_HANDOVER, MAX_IDLE, OpenDecision, RECALL_TIME, RECHECK_INTERVAL, REPLAY_COST, State,
};
use crate::journal::{AbortReason, Change, Fill, ParticipantKind, Source};
use crate::policy::AbortPolicy;

impl Core {
    /// When [`Core::tick`] must be called next; `None` when nothing depends on time.
    pub fn deadline(&self) -> Option<Duration> {
        match self.state {
            State::Waiting => {
                let hold = self.holds().map(|(_, until)| until).min();
                let given_up = self.waits_until();
                Some(hold.map_or(given_up, |hold| hold.min(given_up)))
            }
            State::Playing => {
                let decision = self.decision_deadline();
                let ends = decision.into_iter().chain(self.confirmed_at());
                ends.chain(self.idle_until()).min()
            }
            State::Finished | State::Aborted(_) => None,
        }
    }

    /// When something is due for the open decision.
    fn decision_deadline(&self) -> Option<Duration> {
        let open = self.open.as_ref().filter(|_| !self.is_paused())?;
        if self.next_taken_over().is_some() {
            return Some(open.released);
        }
        if let Some(until) = open.held_until {
            return Some(until);
        }
        let seat = open.decision.seat;
        Some(if self.is_automatic(seat) {
            self.decided_at(open)
        } else if let Some(end) = self.phase_ends_of(open) {
            end
        } else {
            self.runs_out_at(open).max(open.recheck_at)
        })
    }

    /// When the game of a physical table is aborted unless something is reported. A restart leaves
    /// its bridge time to return.
    fn idle_until(&self) -> Option<Duration> {
        let last = self.table()?.last_report();
        Some(last.max(self.restarted.unwrap_or_default()) + MAX_IDLE)
    }

    /// When the end of the game of a physical table counts as confirmed, unless something is
    /// reported. A restart leaves its bridge time to return.
    fn confirmed_at(&self) -> Option<Duration> {
        let waits = self.awaits_confirmation() && !self.is_paused();
        let table = self.table().filter(|_| waits)?;
        let last = table.last_report().max(table.awaited_since());
        Some(last.max(self.restarted.unwrap_or_default()) + CONFIRMATION_TIME)
    }

    /// Whether only answers of participants advance the game now: no built-in agent or substitute
    /// plays, and no decisions of a record are left to replay.
    pub fn awaits_participants_only(&self) -> bool {
        self.state == State::Playing
            && self.next_taken_over().is_none()
            && !self.all_seats().any(|seat| self.is_automatic(seat))
    }

    /// Whether nobody plays the game now: built-in agents and substitutes have all seats, or its
    /// decisions are taken over from a record.
    pub fn is_unattended(&self) -> bool {
        self.state == State::Playing
            && (self.next_taken_over().is_some()
                || self.all_seats().all(|seat| self.is_automatic(seat)))
    }

    /// Whether built-in agents have all seats from the start, so that no participant ever joins.
    pub fn is_built_in_only(&self) -> bool {
        self.seats.iter().all(|seat| seat.fill.is_built_in())
    }

    /// Does what is due at `now`. `handed`: when the transport received the request for the open
    /// decision.
    pub fn tick(&mut self, now: Duration, handed: Option<Duration>) {
        match self.state {
            State::Waiting => self.tick_waiting(now),
            State::Playing => self.tick_playing(now, handed),
            State::Finished | State::Aborted(_) => {}
        }
    }

    /// Closes the room for its owner, who also has these seats. The owner leaves the game with
    /// them, so that the record says who broke it off.
    pub fn close(&mut self, now: Duration, seats: impl IntoIterator<Item = Seat>) {
        if self.state == State::Playing {
            for seat in seats {
                if !self.seats[seat.index()].away {
                    let with_node = false;
                    self.commit(now, Change::Disconnected { seat, with_node });
                }
            }
        }
        self.abort(now, AbortReason::Closed);
    }

    /// Ends the game without a result, unless it is over. One that only waits for the confirmation of
    /// its end has a result.
    pub fn abort(&mut self, now: Duration, reason: AbortReason) {
        if self.awaits_confirmation() {
            self.commit(now, Change::EndConfirmed);
        } else if !self.state.is_over() {
            self.commit(now, Change::Aborted(reason));
        }
    }

    /// Takes the due decisions that need no answer: those taken over from a record, then those of
    /// built-in agents and substitutes. At most [`BUILT_IN_BUDGET`] at a time; [`Core::deadline`]
    /// then requests another tick.
    pub(super) fn advance(&mut self, now: Duration) {
        let mut budget = BUILT_IN_BUDGET;
        while budget > 0 {
            if self.state == State::Playing && self.is_too_long() {
                self.abort(now, AbortReason::TooLong);
            }
            self.retire_those_who_left(now);
            let runs = self.state == State::Playing && !self.is_paused();
            let Some(open) = self.open.as_ref().filter(|_| runs) else {
                return;
            };
            if let Some(action) = self.next_taken_over() {
                self.take_over(now, open.decision.seat, action);
                budget -= 1;
                continue;
            }
            if !self.is_automatic(open.decision.seat) || self.decided_at(open) > now {
                return;
            }
            budget = budget.saturating_sub(self.cost_of_open());
            self.decide_automatically(now);
        }
    }

    /// The next decision of the record that the game branches from; `None` when all are taken over.
    pub(super) fn next_taken_over(&self) -> Option<ActionId> {
        let branch = self.header.start.branch.as_ref()?;
        let mut index = usize::try_from(self.decisions).ok()?;
        for part in &branch.taken_over {
            if let Some(action) = part.actions.get(index) {
                return Some(*action);
            }
            index -= part.actions.len();
        }
        None
    }

    fn take_over(&mut self, now: Duration, seat: Seat, action: ActionId) {
        let bank_left = self.seats[seat.index()].bank_left;
        let decided = self.decided(seat, action, Source::Recorded, Duration::ZERO, bank_left);
        self.commit(now, Change::Decided(decided));
    }

    /// How long a built-in agent or substitute waits before it decides.
    pub fn pace(&self) -> Duration {
        let mut participants = self
            .seats
            .iter()
            .filter_map(|seat| seat.participant.as_ref());
        let with_people = participants.any(|it| it.kind == ParticipantKind::Human);
        self.header.policy.pace_of(with_people)
    }

    /// How long a built-in agent or substitute waits before it takes this decision. It takes a
    /// silent one at once: otherwise the time of the next event would reveal it.
    pub(super) fn wait_of(&self, open: &OpenDecision) -> Duration {
        match open.is_silent() {
            true => Duration::ZERO,
            false => self.pace(),
        }
    }

    /// Cost of the open decision of a built-in agent, in decisions.
    fn cost_of_open(&self) -> usize {
        let replayed = self.open.as_ref().is_some_and(|open| {
            matches!(self.seats[open.decision.seat.index()].fill, Fill::Replay(_))
        });
        if replayed { REPLAY_COST } else { 1 }
    }

    /// Time for a decision before the bank of its seat is used. A silent decision has the longest
    /// time of any seat that participants can take, for every seat.
    pub(super) fn decision_time(&self, open: &OpenDecision) -> Duration {
        let usual = self.usual_decision_time(open.decision.seat);
        match open.is_silent() {
            true => self.longest_decision_time().unwrap_or(usual),
            false => usual,
        }
    }

    /// The longest decision time of a seat that participants can take and that is not hidden: its
    /// time would tell whether and which participants have the hidden ones. Those of a study have the
    /// same time.
    pub(super) fn longest_decision_time(&self) -> Option<Duration> {
        (self.all_seats())
            .filter(|seat| matches!(self.seats[seat.index()].fill, Fill::Open { .. }))
            .filter(|seat| !self.header.is_hidden(*seat) || self.header.is_of_study(*seat))
            .map(|seat| self.usual_decision_time(seat))
            .max()
    }

    fn usual_decision_time(&self, seat: Seat) -> Duration {
        let participant = self.seats[seat.index()].participant.as_ref();
        let policy = &self.header.policy;
        policy.decision_time_of(participant.map(|participant| participant.kind))
    }

    /// Time a seat has for a decision, including its bank and absences that have ended. A silent
    /// decision does not use the bank, because what is left of it shows at the seat's later
    /// decisions.
    pub(super) fn time_allowed(&self, open: &OpenDecision) -> Duration {
        if let Some(end) = self.phase_ends_of(open) {
            return end.saturating_sub(open.start.unwrap_or(open.released));
        }
        let bank = match open.is_silent() {
            true => Duration::ZERO,
            false => self.seats[open.decision.seat.index()].bank_left,
        };
        self.decision_time(open) + bank + open.unbanked
    }

    /// The rest of a seat's bank after a decision, if it took `time`.
    pub(super) fn bank_after(&self, open: &OpenDecision, time: Duration) -> Duration {
        let bank_left = self.seats[open.decision.seat.index()].bank_left;
        if open.is_silent() {
            return bank_left;
        }
        let beyond = time.saturating_sub(self.decision_time(open));
        bank_left.saturating_sub(beyond.saturating_sub(self.unbanked(open, time)))
    }

    /// Time left for the open decision: before the bank is used, and in the bank.
    pub fn time_left(&self, now: Duration) -> (Duration, Duration) {
        let Some(open) = &self.open else {
            return (Duration::ZERO, Duration::ZERO);
        };
        if let Some(end) = self.phase_ends_of(open) {
            return (end.saturating_sub(now), Duration::ZERO);
        }
        let now = self.paused_since().map_or(now, |since| since.min(now));
        let used = now.saturating_sub(open.start.unwrap_or(now));
        let bank_left = match open.is_silent() {
            true => Duration::ZERO,
            false => self.bank_after(open, used),
        };
        (self.decision_time(open).saturating_sub(used), bank_left)
    }

    /// Determines when the clock of the open decision started. Once determined, it never changes.
    pub(super) fn settle_start(&mut self, now: Duration, handed: Option<Duration>) {
        let Some(seat) = self.open.as_ref().map(|open| open.decision.seat) else {
            return;
        };
        let connected = self.seats[seat.index()].connection.is_some();
        let recalled_until = (self.open.as_ref()).and_then(|open| self.recalled_until(open));
        let Some(open) = &mut self.open else { return };
        if open.start.is_some() {
            return;
        }
        let latest = open.released + MAX_HANDOVER;
        (open.start, open.recheck_at) = match (handed, connected, recalled_until) {
            (Some(handed), _, _) => (Some(handed.clamp(open.released, latest)), Duration::ZERO),
            (None, false, Some(until)) if now < until => (None, until),
            (None, false, Some(until)) => (Some(open.released.max(until)), Duration::ZERO),
            (None, false, None) => (Some(open.released), Duration::ZERO),
            (None, true, _) if now >= latest => (Some(latest), Duration::ZERO),
            (None, true, _) => (None, now + RECHECK_INTERVAL),
        };
    }

    /// Gives a seat that was away because of a server its full time for the open decision.
    pub(super) fn restart_clock(&mut self, now: Duration, seat: Seat) {
        let recalled = self.seats[seat.index()].recalled;
        if let Some(open) = &mut self.open
            && recalled.is_some()
            && open.start.is_none()
        {
            open.reopen(now);
        }
    }

    /// Pauses the clock of the open decision from `since` on, while its seat waits for the server.
    pub(super) fn pause_clock(&mut self, since: Duration) {
        if let Some(open) = &mut self.open {
            open.paused_since.get_or_insert(since);
        }
    }

    /// Until when the clock of a decision waits for its seat, which is away because of a server.
    /// Everybody knows of a restart, so that a silent decision waits too.
    pub(super) fn recalled_until(&self, open: &OpenDecision) -> Option<Duration> {
        let seat = open.decision.seat;
        self.seats[seat.index()]
            .recalled
            .filter(|_| !open.is_silent() || self.is_away_since_restart(seat))
            .map(|at| at + RECALL_TIME)
    }

    /// Whether a seat has not been attached since the server restarted.
    pub(super) fn is_away_since_restart(&self, seat: Seat) -> bool {
        let recalled = self.seats[seat.index()].recalled;
        recalled.is_some() && recalled == self.restarted
    }

    fn holds(&self) -> impl Iterator<Item = (Seat, Duration)> + '_ {
        self.all_seats().filter_map(|seat| {
            let state = &self.seats[seat.index()];
            // A participant of a tournament or study keeps its seat, whenever it arrives.
            let held = self.header.tournament.is_none()
                && !self.header.is_of_study(seat)
                && !state.ever_attached
                && matches!(state.fill, Fill::Open { .. });
            (state.participant.is_some() && held).then_some((seat, state.joined_at + JOIN_HOLD))
        })
    }

    /// When a room is closed because its seats are not all attached. A restart leaves them time to
    /// return.
    fn waits_until(&self) -> Duration {
        let after_restart = self.restarted.map_or(Duration::ZERO, |at| at + JOIN_HOLD);
        self.header.policy.waiting_time.max(after_restart)
    }

    fn tick_waiting(&mut self, now: Duration) {
        let expired: Vec<Seat> = self
            .holds()
            .filter(|(_, until)| *until <= now)
            .map(|(seat, _)| seat)
            .collect();
        for seat in expired {
            self.commit(now, Change::Vacated(seat));
        }
        if now >= self.waits_until() {
            self.abort(now, AbortReason::NeverStarted);
        }
    }

    fn tick_playing(&mut self, now: Duration, handed: Option<Duration>) {
        if self.idle_until().is_some_and(|until| until <= now) {
            return self.abort(now, AbortReason::ParticipantsLost);
        }
        if self.is_paused() {
            return;
        }
        if self.confirmed_at().is_some_and(|at| at <= now) {
            return self.commit(now, Change::EndConfirmed);
        }
        if self.next_taken_over().is_some() {
            return self.advance(now);
        }
        if let Some(open) = &mut self.open
            && let Some(until) = open.held_until
        {
            if until <= now {
                open.held_until = None;
                self.advance(now);
            }
            return;
        }
        self.settle_start(now, handed);
        if let Some(open) = &self.open {
            let seat = open.decision.seat;
            // The clock is paused while the seat waits for the server.
            let by = open.paused_since.map_or(now, |since| since.min(now));
            let late = match self.phase_ends_of(open) {
                Some(end) => end <= now,
                None => open.start.is_some() && self.runs_out_at(open) <= by,
            };
            if late && !self.is_automatic(seat) {
                self.time_out(now);
            }
        }
        self.advance(now);
    }

    /// Takes the default decision for a seat whose time is up. A seat that was away for its absence
    /// time or late too often gets a substitute, but never for a silent decision, which the
    /// substitution would reveal.
    pub(super) fn time_out(&mut self, now: Duration) {
        let Some(open) = &self.open else { return };
        let (seat, silent) = (open.decision.seat, open.is_silent());
        let absent = (self.absence(open)).is_some_and(|absence| absence.end <= now);
        let (started, grace) = (self.starts_at(open), self.grace(open));
        let time = now.saturating_sub(started);
        // The timer fires later by the grace; a late answer may come at any time before.
        let without_grace = time.saturating_sub(grace);
        let time = without_grace.max(time.min(self.time_allowed(open)));
        let source = if self.seats[seat.index()].connection.is_some() {
            Source::Timeout
        } else {
            Source::Disconnected
        };
        self.take_default(now, seat, source, time);
        let too_often = self.seats[seat.index()].timeouts >= self.header.policy.max_timeouts;
        if self.state == State::Playing && !silent && (absent || too_often) {
            self.lose(now, seat);
        }
    }

    /// Takes the default decision.
    pub(super) fn take_default(
        &mut self,
        now: Duration,
        seat: Seat,
        source: Source,
        time: Duration,
    ) {
        let action = self
            .default_action()
            .expect("an open decision has a default");
        let open = self.open.as_ref().expect("a decision is open");
        let bank_left = self.bank_after(open, time);
        let decided = self.decided(seat, action, source, time, bank_left);
        self.commit(now, Change::Decided(decided));
    }

    /// Substitutes a seat that is away or has been late too often, or aborts the game. Whether all
    /// are lost does not depend on who has hidden seats, but on the participants of a study.
    fn lose(&mut self, now: Duration, seat: Seat) {
        let others_lost = (self.all_seats())
            .filter(|other| *other != seat)
            .filter(|other| !self.header.is_hidden(*other) || self.header.is_of_study(*other))
            .map(|other| &self.seats[other.index()])
            .filter(|state| matches!(state.fill, Fill::Open { .. }))
            .all(|state| state.substituted);
        let abort = match self.header.policy.abort {
            AbortPolicy::AnyLost => true,
            AbortPolicy::AllLost => others_lost,
            AbortPolicy::Never => false,
        };
        if abort {
            self.abort(now, AbortReason::ParticipantsLost);
            return;
        }
        self.give_substitute(seat);
        self.commit(now, Change::Substituted(seat));
    }

    /// Substitutes the seats whose participants have left for good, unless that would reveal
    /// something.
    fn retire_those_who_left(&mut self, now: Duration) {
        let is_silent = |open: &OpenDecision| open.is_silent() || open.held_until.is_some();
        let is_silent = self.open.as_ref().is_some_and(is_silent);
        if self.state != State::Playing || is_silent {
            return;
        }
        for seat in self.all_seats() {
            let state = &mut self.seats[seat.index()];
            if std::mem::take(&mut state.retiring) {
                self.give_substitute(seat);
                self.commit(now, Change::Retired(seat));
            }
        }
    }

    /// Creates the agent that plays for a substituted seat.
    pub(super) fn give_substitute(&mut self, seat: Seat) {
        let substitute = self.header.policy.substitute;
        let seed = self.header.seed.agent_seed(seat.index());
        self.seats[seat.index()]
            .agent
            .get_or_insert_with(|| Box::new(BuiltInAgent::new(substitute.without_search(), seed)));
    }

    fn decide_automatically(&mut self, now: Duration) {
        let Some(open) = &self.open else { return };
        let seat = open.decision.seat;
        let attempts = open.attempts;
        let searched = open.search.found();
        let observation = self.observe(Viewer::Seat(seat));
        let observation = observation.expect("a decision is open");
        let legal = self.legal_actions();
        let state = &mut self.seats[seat.index()];
        let agent = state
            .agent
            .as_mut()
            .expect("an automatic seat has its agent");
        let action = (searched.action).unwrap_or_else(|| agent.decide(&observation, &legal));
        let bank_left = state.bank_left;
        let bytes_left = MAX_ANNOTATION_BYTES_PER_GAME.saturating_sub(state.annotation_bytes);
        if legal.contains(action) {
            let source = if state.substituted {
                Source::Substitute
            } else {
                Source::Agent
            };
            let mut decided = self.decided(seat, action, source, Duration::ZERO, bank_left);
            decided.annotations = (searched.annotations).filter(|it| it.len() <= bytes_left);
            self.commit(now, Change::Decided(decided));
        } else {
            self.commit(
                now,
                Change::Attempted {
                    seat,
                    action: action.index().into(),
                },
            );
            if attempts + 1 >= self.attempts_limit() {
                self.take_default(now, seat, Source::Invalid, Duration::ZERO);
            }
        }
    }
}
