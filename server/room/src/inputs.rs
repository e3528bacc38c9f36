//! Inputs of participants: join, attach, leave, retire, answer, express, return. Each input is
//! checked against the state; an invalid one is refused and changes nothing.

use std::time::Duration;

use chefshat_engine::{ActionError, Seat};

use super::answers::{Answer, Answered, ExpressError, Expression, JoinError, LeaveError, Verdict};
use super::{
    ConnectionId, Core, MAX_ANNOTATION_BYTES, MAX_ANNOTATION_BYTES_PER_GAME, MAX_CONNECTION_EVENTS,
    MAX_EXPRESSIONS_PER_SEAT, MAX_GATEWAY_DELAY, MAX_SEATINGS, OpenDecision, State,
};
use crate::journal::{AbortReason, Change, Fill, ParticipantKind, SeatedParticipant, Source};

impl Core {
    /// Takes a seat.
    ///
    /// # Errors
    /// No seat can be taken. The room is unchanged.
    pub fn join(
        &mut self,
        now: Duration,
        wanted: Option<u32>,
        participant: SeatedParticipant,
    ) -> Result<Seat, JoinError> {
        match self.state {
            State::Waiting => {}
            State::Playing => return Err(JoinError::GameStarted),
            State::Finished | State::Aborted(_) => return Err(JoinError::GameOver),
        }
        if self.seatings >= MAX_SEATINGS {
            return Err(JoinError::TooManySeatings);
        }
        let seat = match wanted {
            Some(number) => {
                let seat = self
                    .all_seats()
                    .find(|seat| u32::try_from(seat.index()) == Ok(number))
                    .ok_or(JoinError::NoSuchSeat)?;
                if !self.is_free(seat) {
                    return Err(JoinError::SeatTaken);
                }
                if !self.admits(seat, participant.kind) {
                    return Err(JoinError::KindNotAdmitted);
                }
                seat
            }
            None => {
                // A seat reserved for this kind comes first, so that seats open to all stay free
                // for others.
                let mut free: Vec<Seat> = self.all_seats().filter(|s| self.is_free(*s)).collect();
                if free.is_empty() {
                    return Err(JoinError::RoomFull);
                }
                free.retain(|seat| self.admits(*seat, participant.kind));
                *free
                    .iter()
                    .find(|seat| {
                        matches!(
                            self.seats[seat.index()].fill,
                            Fill::Open {
                                reserved_for: Some(_)
                            }
                        )
                    })
                    .or(free.first())
                    .ok_or(JoinError::KindNotAdmitted)?
            }
        };
        self.commit(
            now,
            Change::Seated {
                seat,
                participant: Box::new(participant),
            },
        );
        Ok(seat)
    }

    /// Frees a seat before the game starts.
    ///
    /// # Errors
    /// The game has started, or a study has assigned the seat.
    pub fn leave(&mut self, now: Duration, seat: Seat) -> Result<(), LeaveError> {
        match self.state {
            State::Waiting => {}
            State::Playing => return Err(LeaveError::GameStarted),
            State::Finished | State::Aborted(_) => return Err(LeaveError::GameOver),
        }
        if self.header.is_of_study(seat) {
            return Err(LeaveError::Assigned);
        }
        self.commit(now, Change::Vacated(seat));
        Ok(())
    }

    /// Seats a participant before the room is published.
    pub fn seat(&mut self, seat: Seat, participant: SeatedParticipant) {
        let participant = Box::new(participant);
        self.commit(Duration::ZERO, Change::Seated { seat, participant });
    }

    /// Attaches a connection to a seat and detaches an older one. `arrived`: when the request was
    /// read.
    pub fn attach(
        &mut self,
        now: Duration,
        seat: Seat,
        connection: ConnectionId,
        entropy: Vec<u8>,
        arrived: Duration,
        handed_before: Option<Duration>,
    ) {
        // A connection after the end of the game does not count as present at the end.
        if self.state.is_over() {
            return;
        }
        if self.awaited_from(seat).is_some() {
            self.settle_start(now, handed_before);
            self.end_absence(seat, arrived.min(now));
            self.restart_clock(now, seat);
            self.pause_clock(arrived);
        }
        let state = &mut self.seats[seat.index()];
        state.recalled = None;
        state.connection = Some(connection);
        state.grace = Duration::ZERO;
        state.ever_attached = true;
        // With a contribution to the seed this game would have other deals than the rest of its
        // series.
        let in_series = self.header.series().is_some();
        if self.state == State::Waiting && !in_series {
            state.entropy = entropy;
        }
        if state.away || state.substituted {
            self.returned(now, seat);
        }
        self.start_if_complete(now);
        self.advance(now);
    }

    /// Lets answers of a seat's connection arrive late, because another server measures their time.
    pub fn expect_delays(&mut self, seat: Seat) {
        self.seats[seat.index()].grace = MAX_GATEWAY_DELAY;
        self.expects_delays = true;
    }

    /// Records the loss of a connection. Does nothing if the seat has a newer one.
    pub fn lost(
        &mut self,
        now: Duration,
        seat: Seat,
        connection: ConnectionId,
        handed: Option<Duration>,
    ) {
        if self.is_held_by(seat, connection) {
            self.disconnect(now, seat, false, handed);
        }
    }

    fn disconnect(&mut self, now: Duration, seat: Seat, with_node: bool, handed: Option<Duration>) {
        let state = &mut self.seats[seat.index()];
        (state.connection, state.lost_at, state.grace) = (None, now, Duration::ZERO);
        if self.awaited_from(seat).is_some() {
            self.settle_start(now, handed);
        }
        let state = &mut self.seats[seat.index()];
        if state.connection_events < MAX_CONNECTION_EVENTS {
            state.connection_events += 1;
            self.commit(now, Change::Disconnected { seat, with_node });
        }
    }

    /// Whether a seat may lose this connection. After the end of a game, the list of those present at
    /// its end does not change.
    fn is_held_by(&self, seat: Seat, connection: ConnectionId) -> bool {
        self.seats[seat.index()].connection == Some(connection) && !self.state.is_over()
    }

    /// Records the loss of a connection together with the node that it was to. As after a restart, the
    /// clock of the seat's decision waits for it to return; not that of a silent one, which would show.
    pub fn lost_with_node(
        &mut self,
        now: Duration,
        seat: Seat,
        connection: ConnectionId,
        handed: Option<Duration>,
    ) {
        if !self.is_held_by(seat, connection) {
            return;
        }
        self.disconnect(now, seat, true, handed);
        self.seats[seat.index()].recalled = Some(now);
        if let Some(open) = &mut self.open
            && open.decision.seat == seat
            && !open.is_silent()
        {
            open.forget_start();
        }
    }

    /// Gives a substituted seat back to its agent.
    pub fn resume(&mut self, now: Duration, seat: Seat) {
        let state = &self.seats[seat.index()];
        if state.substituted && !state.retired {
            self.returned(now, seat);
        }
    }

    /// Gives up a seat whose participant has left the tournament or study. Its ticket ends, and a
    /// substitute plays from now on; while somebody decides about a special action, from then on,
    /// because the time of that decision would reveal whose it is. Its connection is lost. A game that
    /// has not started is aborted. Does nothing if nobody can join the seat. `handed`: as for
    /// [`Core::lost`].
    pub fn retire(&mut self, now: Duration, seat: Seat, handed: Option<Duration>) {
        let state = &self.seats[seat.index()];
        if !matches!(state.fill, Fill::Open { .. }) || state.retired {
            return;
        }
        if let Some(connection) = state.connection {
            self.lost(now, seat, connection, handed);
        }
        let state = &mut self.seats[seat.index()];
        match self.state {
            State::Waiting => self.abort(now, AbortReason::NeverStarted),
            State::Playing => {
                state.retiring = true;
                self.advance(now);
            }
            State::Finished | State::Aborted(_) => {}
        }
    }

    /// Accepts an expression of a seat, as an encoded message, which may be about a seat.
    ///
    /// # Errors
    /// The expression is refused.
    pub fn express(
        &mut self,
        now: Duration,
        seat: Seat,
        expression: Expression,
    ) -> Result<(), ExpressError> {
        if self.state.is_over() {
            return Err(ExpressError::GameOver);
        }
        let exists =
            |seat: u32| usize::try_from(seat).is_ok_and(|seat: usize| seat < self.seats.len());
        if expression.about.is_some_and(|seat| !exists(seat)) {
            return Err(ExpressError::NoSuchSeat);
        }
        let is_person = (self.standing(seat).participant)
            .is_some_and(|participant| participant.kind == ParticipantKind::Human);
        if expression.in_words && is_person && !self.header.policy.chat {
            return Err(ExpressError::ChatOff);
        }
        if self.seats[seat.index()].expressions >= MAX_EXPRESSIONS_PER_SEAT {
            return Err(ExpressError::TooMany);
        }
        self.commit(
            now,
            Change::Expressed {
                seat,
                record_only: expression.record_only,
                expression: expression.encoded,
            },
        );
        Ok(())
    }

    /// Processes an answer that was read at `arrived`. `handed`: when the transport received the
    /// decision request. The time that another server measured counts instead of what passed here.
    pub fn answer(
        &mut self,
        now: Duration,
        seat: Seat,
        answer: Answer,
        arrived: Duration,
        handed: Option<Duration>,
    ) -> Answered {
        if let Some(last) = &self.seats[seat.index()].last_answer
            && last.decision_id == answer.decision_id
        {
            return if last.action == answer.action {
                last.answered.clone()
            } else {
                Answered::closed(Verdict::Closed)
            };
        }
        let is_held = |open: &OpenDecision| {
            open.held_until.is_some() && (open.decision.seat, open.id) == (seat, answer.decision_id)
        };
        if answer.decision_id == 0
            || answer.decision_id > self.seats[seat.index()].decisions
            || self.open.as_ref().is_some_and(is_held)
        {
            return Answered::closed(Verdict::Unknown);
        }
        if (self.awaited_from(seat)).is_none_or(|open| open.id != answer.decision_id) {
            return Answered::closed(Verdict::Closed);
        }
        let read_here = arrived;
        let (handed, arrived) = match answer.measured {
            None => (handed, read_here),
            Some(time) => {
                // The report of the other server is missing, or was slower than the answer.
                let latest = read_here.saturating_sub(time);
                let handed = handed.map_or(latest, |handed| handed.min(latest));
                let earliest = read_here.saturating_sub(MAX_GATEWAY_DELAY);
                (Some(handed), (handed + time).max(earliest))
            }
        };
        self.settle_start(now, handed);
        let open = self.open.as_ref().expect("a decision is awaited");
        // The clock is paused while the seat waits for the server, as for the deadline.
        let paused_since = open.paused_since.into_iter().chain(self.paused_since());
        let thought_until = paused_since.fold(arrived, Duration::min);
        let time = thought_until.saturating_sub(self.starts_at(open));
        let attempts = open.attempts + 1;
        if time >= self.time_allowed(open) {
            // It arrived after the deadline, but before the timer fired.
            self.tick(now, handed);
            let is_open = |open: &OpenDecision| open.id == answer.decision_id;
            if self.awaited_from(seat).is_some_and(is_open) {
                self.time_out(now);
                self.advance(now);
            }
            return Answered {
                time,
                ..Answered::closed(Verdict::Closed)
            };
        }
        let answered = match self.refusal(answer.action) {
            Some(error) => self.invalid(now, seat, answer.action, arrived, time, attempts, &error),
            None => self.accept(now, seat, answer, time),
        };
        self.advance(now);
        answered
    }

    fn accept(&mut self, now: Duration, seat: Seat, input: Answer, time: Duration) -> Answered {
        let recorded_bytes = self.seats[seat.index()].annotation_bytes;
        let (annotations, annotations_dropped) = match input.annotations {
            Some(bytes)
                if bytes.len() > MAX_ANNOTATION_BYTES
                    || recorded_bytes + bytes.len() > MAX_ANNOTATION_BYTES_PER_GAME =>
            {
                (None, true)
            }
            annotations => (annotations, input.annotations_refused),
        };
        let open = self.open.as_ref().expect("a decision is open");
        let bank_left = self.bank_after(open, time);
        let mut decided = self.decided(
            seat,
            Self::action_from(input.action),
            Source::Agent,
            time,
            bank_left,
        );
        decided.by_fallback = input.by_fallback && annotations.is_some();
        decided.annotations = annotations;
        self.commit(now, Change::Decided(decided));
        let last = self.seats[seat.index()]
            .last_answer
            .as_mut()
            .expect("a decision by the agent has just been folded");
        last.answered.annotations_dropped = annotations_dropped;
        last.answered.clone()
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "a single caller, which has all of it"
    )]
    fn invalid(
        &mut self,
        now: Duration,
        seat: Seat,
        action: u32,
        arrived: Duration,
        time: Duration,
        attempts: u32,
        error: &ActionError,
    ) -> Answered {
        let limit = self.header.policy.max_invalid_attempts;
        let reward = self
            .header
            .policy
            .reward_scheme
            .filter(|_| self.open_is_turn())
            .map(|scheme| scheme.invalid());
        self.commit(now, Change::Attempted { seat, action });
        if attempts >= self.attempts_limit() {
            self.take_default(now, seat, Source::Invalid, time);
        } else {
            self.pause_clock(arrived);
        }
        Answered {
            verdict: Verdict::Invalid {
                detail: error.to_string(),
                attempts_left: limit.map(|limit| limit.saturating_sub(attempts)),
                reward,
            },
            time,
            annotations_dropped: false,
        }
    }

    /// Why an action is illegal now; `None` if it is legal.
    fn refusal(&self, action: u32) -> Option<ActionError> {
        let game = self.game().expect("a decision is open");
        game.check(Self::action_from(action)).err()
    }

    fn returned(&mut self, now: Duration, seat: Seat) {
        let state = &mut self.seats[seat.index()];
        if state.connection_events >= MAX_CONNECTION_EVENTS && !state.substituted {
            return;
        }
        state.connection_events += 1;
        if !self.state.is_over() {
            self.commit(now, Change::Returned(seat));
        }
    }

    fn start_if_complete(&mut self, now: Duration) {
        let complete = self.state == State::Waiting
            && self
                .seats
                .iter()
                .all(|seat| !matches!(seat.fill, Fill::Open { .. }) || seat.connection.is_some());
        if complete {
            let entropy = self
                .seats
                .iter_mut()
                .map(|seat| std::mem::take(&mut seat.entropy))
                .collect();
            self.commit(now, Change::Started { entropy });
        }
    }

    /// Starts the game of a room without open seats; [`Core::tick`] then plays it.
    pub fn begin_if_all_built_in(&mut self, now: Duration) {
        self.start_if_complete(now);
    }

    fn is_free(&self, seat: Seat) -> bool {
        let state = &self.seats[seat.index()];
        state.participant.is_none() && matches!(state.fill, Fill::Open { .. })
    }

    fn admits(&self, seat: Seat, kind: ParticipantKind) -> bool {
        match self.seats[seat.index()].fill {
            Fill::Open { reserved_for } => reserved_for.is_none_or(|wanted| wanted == kind),
            Fill::BuiltIn(_) | Fill::Replay(_) | Fill::AtTable(_) => false,
        }
    }
}
