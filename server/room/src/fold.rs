//! Applies a change to the state and the log. The effect is the same for a new change and for one
//! read from a journal: nothing here reads a clock, a connection or a random generator.

use std::time::Duration;

use chefshat_engine::{ActionId, DecisionKind, Event, Game, Seat, Seed};

use super::{
    Answered, Core, LastAnswer, MAX_GAME_CHANGES, MAX_REPORTS, OpenDecision, Search, State, Verdict,
};
use crate::journal::{Change, Decided, Marker, Source};
use crate::log::{GameEvent, MAX_GAME_EVENTS, RoomEvent};

use crate::table::{PhysicalTable, RoomGame, micros};

impl Core {
    pub(super) fn fold(&mut self, at: Duration, change: &Change) {
        self.changes += 1;
        match change {
            Change::Seated { seat, participant } => {
                let state = &mut self.seats[seat.index()];
                state.participant = Some(participant.clone());
                state.bank_left = self.header.policy.bank_of(Some(participant.kind));
                state.joined_at = at;
                state.ever_attached = false;
                self.seatings += 1;
                self.log_presence(at, *seat, RoomEvent::Seated(*seat, participant.clone()));
            }
            Change::Vacated(seat) => {
                let state = &mut self.seats[seat.index()];
                state.participant = None;
                state.connection = None;
                state.away = false;
                state.entropy = Vec::new();
                self.log_presence(at, *seat, RoomEvent::Vacated(*seat));
            }
            Change::Started { entropy } => self.begin(at, entropy),
            Change::Disconnected { seat, with_node } => {
                self.seats[seat.index()].away = true;
                let event = RoomEvent::Disconnected {
                    seat: *seat,
                    with_node: *with_node,
                };
                self.log_presence(at, *seat, event);
            }
            Change::Returned(seat) => {
                let state = &mut self.seats[seat.index()];
                (state.away, state.substituted) = (false, false);
                self.log_presence(at, *seat, RoomEvent::Returned(*seat));
                if let Some(open) = &mut self.open
                    && open.decision.seat == *seat
                    && open.start.is_none()
                {
                    open.released = at.max(open.held_until.unwrap_or_default());
                }
            }
            Change::Substituted(seat) => {
                let state = &mut self.seats[seat.index()];
                state.substituted = true;
                state.ever_substituted = true;
                self.log_presence(at, *seat, RoomEvent::Substituted(*seat));
            }
            Change::Retired(seat) => {
                let state = &mut self.seats[seat.index()];
                state.retired = true;
                state.substituted = true;
                state.ever_substituted = true;
                self.log_presence(at, *seat, RoomEvent::Retired(*seat));
            }
            Change::Attempted { .. } => {
                if let Some(open) = &mut self.open {
                    open.attempts += 1;
                }
            }
            Change::Hinted(seat) => {
                self.seats[seat.index()].ever_hinted = true;
                if let Some(open) = &mut self.open {
                    open.hints += 1;
                }
            }
            Change::Decided(decided) => self.decide(at, decided),
            Change::Expressed {
                seat,
                record_only,
                expression,
            } => {
                self.seats[seat.index()].expressions += 1;
                if !record_only {
                    self.log
                        .push(at, RoomEvent::Expressed(*seat, expression.clone()));
                }
            }
            Change::Marked(marked) => self.markers.push(Marker {
                received: at,
                marked: (**marked).clone(),
            }),
            // A server that takes a room over says so without knowing whether its game was over.
            Change::ServerRestarted if self.state.is_over() => {}
            Change::ServerRestarted => self.restart(at),
            Change::Reported(reported) => self.fold_report(at, reported),
            Change::EndConfirmed => self.fold_confirmation(at),
            Change::Aborted(reason) => {
                self.state = State::Aborted(*reason);
                self.open = None;
                self.log.push(at, RoomEvent::GameAborted(*reason));
            }
        }
    }

    /// Logs that the participant of a seat came or went, or has a substitute. A built-in agent never
    /// does: of a seat of which nobody may know whether one plays there, the event would be the answer.
    fn log_presence(&mut self, at: Duration, seat: Seat, event: RoomEvent) {
        if !self.header.is_hidden(seat) {
            self.log.push(at, event);
        }
    }

    /// Disconnects all seats and gives the open decision its full time again.
    fn restart(&mut self, at: Duration) {
        self.restarted = Some(at);
        for state in &mut self.seats {
            if state.participant.is_none() {
                continue;
            }
            state.connection = None;
            state.lost_at = at;
            state.recalled = Some(at);
            match self.state {
                // Its ticket must be attached again within the same time as at first.
                State::Waiting => {
                    state.ever_attached = false;
                    state.joined_at = at;
                }
                _ => state.away = true,
            }
        }
        self.silent_since = self.silent_since.map(|_| at);
        let held_until = self.phase_ends_at();
        if let Some(open) = &mut self.open {
            open.reopen(at);
            open.hold(held_until);
        }
        self.log.push(at, RoomEvent::ServerRestarted);
    }

    fn begin(&mut self, at: Duration, entropy: &[Vec<u8>]) {
        self.entropy = entropy.to_vec();
        self.state = State::Playing;
        self.log.push(at, RoomEvent::GameStarted);
        self.log_before_deal = self.log.len();
        if self.header.is_physical() {
            self.begin_physical(at);
        } else {
            self.begin_dealt(at);
        }
        self.note_decision();
        self.open_next(at);
    }

    fn begin_dealt(&mut self, at: Duration) {
        let recorded = self.header.start.branch.as_ref();
        let seed = recorded
            .and_then(|branch| branch.taken_over.first())
            .map_or_else(|| self.seed_for(0), |part| part.seed);
        let mut events = std::mem::take(&mut self.events);
        let note = |event| events.push(event);
        let game = match &self.header.start.script {
            None => Game::new(self.header.rules, seed, note),
            Some(script) => Game::scripted(self.header.rules, seed, script, note)
                .expect("a script is checked before its room is created"),
        };
        self.game = Some(RoomGame::Dealt(Box::new(game)));
        self.reseed();
        self.note_silence(at, &events, true);
        self.events = events;
        self.log_events(at, Source::Agent, 0);
    }

    fn decide(&mut self, at: Duration, decided: &Decided) {
        let number = self.changes;
        // What is not published must not show later either: not in when the seat is substituted,
        // nor in how far delayed spectators see.
        let offered = self.open.as_ref().is_some_and(OpenDecision::is_silent);
        let has_choice = decided.source == Source::Agent
            && !self.header.is_physical()
            && self.legal_actions().len() > 1;
        let declined = offered && Some(decided.action) == self.default_action();
        // Neither does a gift of a built-in agent show before all gifts are given.
        let shows = !declined && !self.seems_automatic(decided.seat);
        let mut events = std::mem::take(&mut self.events);
        let game = self.game.as_mut();
        let ruling = match game.expect("a decision is taken in a game that has started") {
            RoomGame::Dealt(game) => {
                game.apply(decided.action, |event| events.push(event))
                    .expect("only legal actions become changes");
                None
            }
            RoomGame::Physical(table) => Some(table.decide(at, number, decided)),
        };
        if ruling.is_none() {
            self.note_silence(at, &events, shows);
        }
        self.events = events;
        let seat = &mut self.seats[decided.seat.index()];
        seat.bank_left = Duration::from_millis(decided.bank_left_ms.into());
        seat.annotation_bytes += decided.annotations.as_ref().map_or(0, |bytes| bytes.len());
        if has_choice {
            seat.choices.add(decided.by_fallback);
        }
        match decided.source {
            Source::Agent => {
                if !declined {
                    seat.timeouts = 0;
                }
                seat.last_answer = Some(LastAnswer {
                    decision_id: seat.decisions,
                    action: decided.action.index().into(),
                    answered: Answered {
                        verdict: Verdict::Accepted,
                        time: Duration::from_micros(decided.time_us),
                        annotations_dropped: false,
                    },
                });
            }
            Source::Timeout | Source::Disconnected => seat.timeouts += u32::from(!declined),
            Source::Invalid | Source::Substitute | Source::Recorded | Source::Table => {}
        }
        let taken = (decided.source, decided.time_us);
        match ruling {
            // What the table reported before and had to wait follows the decision.
            Some(ruling) => {
                self.fold_ruling(at, number, ruling, |seat| match seat == decided.seat {
                    true => taken,
                    false => (Source::Table, 0),
                })
            }
            None => self.log_events(at, decided.source, decided.time_us),
        }
        self.decisions += 1;
        if decided.source == Source::Recorded {
            self.reseed();
        }
        if !declined {
            self.note_decision();
        }
        self.open_next(at);
    }

    /// Sets the seed of the following Shifts.
    fn reseed(&mut self) {
        let seed = self.seed_for(self.decisions);
        if let Some(RoomGame::Dealt(game)) = &mut self.game {
            game.reseed(seed);
        }
    }

    /// The seed of a Shift that starts after this number of decisions: one taken over from a
    /// record, or the game's own.
    fn seed_for(&self, decisions: u64) -> Seed {
        let mut end = 0;
        self.header
            .start
            .branch
            .iter()
            .flat_map(|branch| &branch.taken_over)
            .find(|part| {
                end += u64::try_from(part.actions.len()).unwrap_or(u64::MAX);
                decisions < end
            })
            .map_or_else(
                || self.header.seed.game_seed(&self.entropy),
                |part| part.seed,
            )
    }

    /// Records how far delayed spectators may see after this decision.
    pub(super) fn note_decision(&mut self) {
        let delay = self.header.policy.spectator_delay_decisions;
        if delay > 0 {
            if self.log_after_decision.len() > delay {
                self.log_after_decision.pop_front();
            }
            self.log_after_decision
                .push_back(u32::try_from(self.log.len()).unwrap_or(u32::MAX));
        }
    }

    /// Moves the events of one action to the log, with their rewards.
    pub(super) fn log_events(&mut self, at: Duration, source: Source, time_us: u64) {
        let mut events = std::mem::take(&mut self.events);
        let mut rewards = Vec::new();
        if let Some(scheme) = self.header.policy.reward_scheme {
            scheme.of_events(&self.header.rules, &events, |seat, value, index| {
                rewards.push((index, (seat, value)));
            });
        }
        for (index, event) in events.drain(..).enumerate() {
            if matches!(event, Event::GameEnded { .. }) {
                self.state = State::Finished;
            }
            if matches!(event, Event::ShiftStarted { .. }) {
                self.shift_start = self.log.len();
            }
            let brought = rewards.iter().filter(|(bringer, _)| *bringer == index);
            self.log.push(
                at,
                RoomEvent::Game(GameEvent {
                    rewards: brought.map(|(_, reward)| *reward).collect(),
                    event,
                    source,
                    time_us,
                }),
            );
        }
        self.events = events;
    }

    /// Opens the next decision of the game, if there is one.
    pub(super) fn open_next(&mut self, at: Duration) {
        let is_over = |until: &Duration| *until > at && self.next_taken_over().is_none();
        let held_until = self.phase_ends_at().filter(is_over);
        self.open = self
            .game
            .as_ref()
            .and_then(RoomGame::decision)
            .map(|decision| {
                let seat = &mut self.seats[decision.seat.index()];
                seat.decisions += 1;
                let mut open = OpenDecision {
                    decision,
                    id: seat.decisions,
                    released: at,
                    announced: false,
                    held_until: None,
                    start: None,
                    recheck_at: Duration::ZERO,
                    paused_since: None,
                    absent: Duration::ZERO,
                    unbanked: Duration::ZERO,
                    attempts: 0,
                    search: Search::NotStarted,
                    hints: 0,
                    hint_runs: false,
                };
                open.hold(held_until);
                open
            });
    }

    /// Whether the log or the journal has reached its limit.
    pub(super) fn is_too_long(&self) -> bool {
        let reports = self.table().map_or(0, PhysicalTable::reports);
        self.log.len() >= MAX_GAME_EVENTS
            || self.changes >= MAX_GAME_CHANGES
            || reports >= MAX_REPORTS
    }

    /// The change that takes a decision.
    pub(super) fn decided(
        &self,
        seat: Seat,
        action: ActionId,
        source: Source,
        time: Duration,
        bank_left: Duration,
    ) -> Decided {
        Decided {
            seat,
            action,
            source,
            time_us: micros(time),
            bank_left_ms: u32::try_from(bank_left.as_millis()).unwrap_or(u32::MAX),
            annotations: None,
            by_fallback: false,
        }
    }

    /// Whether the open decision is a turn. Only turns are rewarded.
    pub fn open_is_turn(&self) -> bool {
        self.open
            .as_ref()
            .is_some_and(|open| open.decision.kind == DecisionKind::Turn)
    }
}
