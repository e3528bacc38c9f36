//! Checks the events of the room: seating, connections, substitution, expressions, and what was
//! reported from a physical table. They do not affect the game.

use chefshat_engine::limits::MAX_CONNECTION_EVENTS;
use chefshat_engine::{RuleSet, Seat};
use chefshat_proto::v1::{self, game_event::Kind};

use super::decision::SeatClock;
use super::difference::{difference, must_be};
use crate::convert::{check_expression, seat_from_number};

/// The seats of a recorded room after the events so far.
#[derive(Debug)]
pub(super) struct Seats {
    /// Name and kind of the participant, if seated by an event.
    occupants: Vec<Option<(String, i32)>>,
    clocks: Vec<SeatClock>,
    /// Whether its participant has left for good.
    retired: Vec<bool>,
    begun: bool,
    /// Events of lost and new connections, by seat. A server publishes at most
    /// [`MAX_CONNECTION_EVENTS`].
    connection_events: Vec<u32>,
}

/// As what a participant was shown: in the room it counts as this kind.
fn shown_kind(seat: &v1::Participant) -> i32 {
    match seat.shown_kind() {
        v1::ParticipantKind::Unspecified => seat.kind,
        shown => shown.into(),
    }
}

impl Seats {
    pub(super) fn new(header: &v1::RecordHeader) -> Self {
        let policy = header.policy.clone().unwrap_or_default();
        Self {
            occupants: vec![None; header.seats.len()],
            clocks: header
                .seats
                .iter()
                .map(|seat| {
                    let built_in = !seat.built_in_agent.is_empty();
                    // Clocks by kind do not apply to built-in agents.
                    let own = (policy.clocks.iter())
                        .find(|clock| !built_in && clock.kind == shown_kind(seat));
                    let decision_time_ms = own
                        .and_then(|clock| clock.decision_time_ms)
                        .unwrap_or(policy.decision_time_ms());
                    SeatClock {
                        decisions: 0,
                        decision_time_ms,
                        bank_ms: own
                            .and_then(|clock| clock.bank_ms)
                            .unwrap_or(policy.bank_ms()),
                        absence_ms: own
                            .and_then(|clock| clock.absence_time_ms)
                            .or(policy.absence_time_ms)
                            .map(|absence_ms| absence_ms.min(decision_time_ms)),
                        built_in,
                        at_table: seat.at_table,
                        substituted: false,
                        connected: None,
                        lost_at_ms: 0,
                        away_ms: 0,
                        absent: false,
                        absent_at_most: false,
                        timeouts: 0,
                        timeouts_at_most: 0,
                        annotation_bytes: 0,
                    }
                })
                .collect(),
            retired: vec![false; header.seats.len()],
            begun: false,
            connection_events: vec![0; header.seats.len()],
        }
    }

    fn connection_event(&mut self, seat: usize) {
        self.connection_events[seat] += 1;
        if self.connection_events[seat] >= MAX_CONNECTION_EVENTS {
            self.clocks[seat].connected = None;
        }
    }

    /// The longest time per decision of any seat that participants can take, milliseconds.
    pub(super) fn longest_decision_ms(&self) -> u32 {
        let times = self.clocks.iter().filter(|clock| !clock.built_in);
        times.map(|clock| clock.decision_time_ms).max().unwrap_or(0)
    }

    /// The shortest time per decision of any such seat, milliseconds.
    pub(super) fn shortest_decision_ms(&self) -> u32 {
        let times = self.clocks.iter().filter(|clock| !clock.built_in);
        times.map(|clock| clock.decision_time_ms).min().unwrap_or(0)
    }

    /// A decision was taken: what seats were away before it does not matter to the next one.
    pub(super) fn decided(&mut self, elapsed_ms: u64) {
        for clock in &mut self.clocks {
            clock.away_ms = 0;
            clock.lost_at_ms = clock.lost_at_ms.max(elapsed_ms);
        }
    }

    pub(super) fn clock(&mut self, seat: Seat) -> &mut SeatClock {
        &mut self.clocks[seat.index()]
    }

    /// Whether the game has started.
    pub(super) fn has_started(&self) -> bool {
        self.begun
    }

    /// Checks an event of the room; `false` if it is an event of the game.
    pub(super) fn take(
        &mut self,
        kind: &Kind,
        elapsed_ms: u64,
        header: &v1::RecordHeader,
    ) -> Result<bool, String> {
        match kind {
            Kind::Seated(seated) => {
                let seat = self.before_the_game("seated", seated.seat)?;
                if self.occupants[seat].is_some() {
                    return Err(format!("seat {seat} is taken already"));
                }
                self.occupants[seat] = Some((seated.name.clone(), seated.kind));
            }
            Kind::Vacated(vacated) => {
                let seat = self.before_the_game("vacated", vacated.seat)?;
                if self.occupants[seat].take().is_none() {
                    return Err(format!("seat {seat} is vacated, but it is free"));
                }
            }
            Kind::Disconnected(lost) => {
                let seat = self.of_an_agent("disconnected", lost.seat)?;
                self.clocks[seat].lose(elapsed_ms);
                self.connection_event(seat);
            }
            Kind::Returned(returned) => {
                let seat = self.of_an_agent("returned", returned.seat)?;
                if self.retired[seat] {
                    return Err(format!(
                        "seat {seat} returns, but its participant has left for good"
                    ));
                }
                let clock = &mut self.clocks[seat];
                clock.away_ms = clock.away_ms_at(elapsed_ms).unwrap_or(clock.away_ms);
                // A seat can take its decisions back from a substitute without attaching.
                let is_attached = !clock.substituted || clock.connected == Some(true);
                clock.connected = is_attached.then_some(true);
                clock.substituted = false;
                clock.timeouts = 0;
                self.connection_event(seat);
            }
            Kind::Substituted(substituted) => {
                let seat = self.of_an_agent("substituted", substituted.seat)?;
                let policy = header.policy.as_ref().map(|policy| &policy.substitute);
                let for_good = substituted.for_good;
                if for_good && !may_leave_for_good(header, substituted.seat) {
                    return Err(format!(
                        "seat {seat} is substituted for good, which only happens in a tournament, or in the group of a study"
                    ));
                }
                let already = match for_good {
                    true => self.retired[seat],
                    false => self.clocks[seat].substituted,
                };
                if !self.begun || already {
                    return Err(format!(
                        "seat {seat} is substituted, but {}",
                        if self.begun {
                            "it already is"
                        } else {
                            "the game has not started"
                        }
                    ));
                }
                if header.policy.as_ref().map(v1::RoomPolicy::abort)
                    == Some(v1::AbortPolicy::AnyLost)
                {
                    return Err(format!(
                        "seat {seat} is substituted, but by the policy the game is aborted instead"
                    ));
                }
                if policy != Some(&substituted.built_in_agent) {
                    return Err(must_be(
                        "substituted.builtInAgent",
                        substituted.built_in_agent.as_str(),
                        policy.map_or("", String::as_str),
                    ));
                }
                let late = self.clocks[seat].timeouts_at_most;
                let limit = (header.policy.as_ref()).map_or(0, v1::RoomPolicy::max_timeouts);
                let lost = late >= limit || self.clocks[seat].absent_at_most;
                // In a physical room a correction may have voided its timeouts, or what ended them.
                if !lost && !for_good && header.origin() != v1::GameOrigin::Physical {
                    return Err(format!(
                        "seat {seat} is substituted, but was late {late} times in a row of {limit}"
                    ));
                }
                // One absence gives one substitute.
                self.clocks[seat].absent_at_most = false;
                self.clocks[seat].substituted = true;
                self.retired[seat] = for_good;
            }
            Kind::ServerRestarted(_) => {
                for (clock, events) in self.clocks.iter_mut().zip(&self.connection_events) {
                    // Its return would not be among the events.
                    if *events < MAX_CONNECTION_EVENTS {
                        clock.lose(elapsed_ms);
                    }
                }
            }
            Kind::ExpressionShown(shown) => {
                self.seat("expressionShown", shown.seat)?;
                self.check_shown("expressionShown", shown.expression.as_ref(), false)?;
            }
            Kind::HandReported(reported) => {
                self.at_a_table(header)?;
                let hand = reported.hand.as_ref().ok_or("handReported has no hand")?;
                self.seat("handReported", hand.seat)?;
            }
            Kind::Violation(violation) => {
                self.at_a_table(header)?;
                if let Some(seat) = violation.seat {
                    self.seat("violation", seat)?;
                }
            }
            Kind::Correction(correction) => {
                self.at_a_table(header)?;
                if correction.first_void != 0 {
                    return Err(must_be("correction.firstVoid", correction.first_void, 0));
                }
            }
            Kind::TablePaused(_) => self.at_a_table(header)?,
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Checks that an event of a physical table can be in this record.
    fn at_a_table(&self, header: &v1::RecordHeader) -> Result<(), String> {
        match header.origin() {
            v1::GameOrigin::Physical if self.begun => Ok(()),
            v1::GameOrigin::Physical => Err("the game has not started".into()),
            _ => Err("only the game of a physical table has this event".into()),
        }
    }

    /// Checks an expression for the record only.
    pub(super) fn private(&self, private: &v1::PrivateExpression) -> Result<(), String> {
        self.seat("privateExpression", private.seat)?;
        self.check_shown("privateExpression", private.expression.as_ref(), true)
    }

    fn check_shown(
        &self,
        event: &str,
        expression: Option<&v1::Expression>,
        record_only: bool,
    ) -> Result<(), String> {
        let expression = expression.ok_or_else(|| format!("{event} has no expression"))?;
        check_expression(expression, self.clocks.len())
            .map_err(|problem| format!("{event}.expression.{problem}"))?;
        if expression.record_only == record_only {
            Ok(())
        } else {
            Err(must_be(
                &format!("{event}.expression.recordOnly"),
                expression.record_only,
                record_only,
            ))
        }
    }

    /// Checks the start of the game against the header.
    pub(super) fn begin(
        &mut self,
        started: &v1::GameStarted,
        header: &v1::RecordHeader,
        rules: &RuleSet,
    ) -> Result<(), String> {
        self.check_occupants(header)?;
        let mut expected = game_started(header, rules);
        for seat in &mut expected.seats {
            seat.kind = shown_kind(seat);
            seat.shown_kind = v1::ParticipantKind::Unspecified.into();
        }
        self.begun = true;
        // A game starts when every open seat is attached, also to a server that was restarted
        // before. Whether it is lost later is not recorded after too many events.
        for (clock, events) in self.clocks.iter_mut().zip(&self.connection_events) {
            clock.connected = (*events < MAX_CONNECTION_EVENTS).then_some(true);
        }
        match difference(started, &expected) {
            Some(problem) => Err(format!("gameStarted.{problem}, as in the header")),
            None => Ok(()),
        }
    }

    /// Checks the header against the state of the seats at the end.
    pub(super) fn end(&self, header: &v1::RecordHeader) -> Result<(), String> {
        if !self.begun {
            self.check_occupants(header)?;
        }
        for (index, (seat, clock)) in header.seats.iter().zip(&self.clocks).enumerate() {
            if seat.substituted != clock.substituted {
                return Err(format!(
                    "the header has seat {index} as {}substituted at the end, but it was{}",
                    if seat.substituted { "" } else { "not " },
                    if seat.substituted { " not" } else { "" },
                ));
            }
        }
        Ok(())
    }

    fn check_occupants(&self, header: &v1::RecordHeader) -> Result<(), String> {
        for (index, (seat, occupant)) in header.seats.iter().zip(&self.occupants).enumerate() {
            let stated = (seat.name.as_str(), shown_kind(seat));
            let sits = match occupant {
                Some((name, kind)) => (name.as_str(), *kind),
                None if self.clocks[index].built_in => stated,
                None => ("", 0),
            };
            if stated != sits {
                return Err(format!(
                    "the header has {:?} on seat {index}, but {}",
                    seat.name,
                    match sits {
                        ("", _) => "it is free".to_owned(),
                        (name, _) if name == seat.name =>
                            "its participant is of another kind".into(),
                        (name, _) => format!("the events have {name:?}"),
                    }
                ));
            }
        }
        Ok(())
    }

    fn before_the_game(&self, event: &str, seat: u32) -> Result<usize, String> {
        if self.begun {
            return Err(format!("`{event}` after the start of the game"));
        }
        self.of_an_agent(event, seat)
    }

    fn of_an_agent(&self, event: &str, seat: u32) -> Result<usize, String> {
        let seat = self.seat(event, seat)?;
        if self.clocks[seat].built_in {
            return Err(format!(
                "{event}.seat is {seat}, which is a built-in agent's"
            ));
        }
        Ok(seat)
    }

    fn seat(&self, event: &str, seat: u32) -> Result<usize, String> {
        seat_from_number(seat, self.clocks.len())
            .map(Seat::index)
            .ok_or_else(|| {
                format!(
                    "{event}.seat is {seat} and must be in 0..={}",
                    self.clocks.len() - 1
                )
            })
    }
}

/// The event that starts the game of a header.
pub(crate) fn game_started(header: &v1::RecordHeader, rules: &RuleSet) -> v1::GameStarted {
    v1::GameStarted {
        game_id: header.game_id.clone(),
        rules: header.rules.clone(),
        rules_version: header.rules_version,
        policy: header.policy.clone(),
        seats: header
            .seats
            .iter()
            .map(|seat| v1::Participant {
                connected: true,
                substituted: false,
                ..seat.clone()
            })
            .collect(),
        action_space: header.action_space.clone(),
        hand_size: rules.hand_size().into(),
        seed_commitment: header.seed_commitment.clone(),
    }
}

/// Whether the participant of a seat can leave a game that continues without it: in a tournament, and in
/// the group of a study.
fn may_leave_for_good(header: &v1::RecordHeader, seat: u32) -> bool {
    let study = header.study.as_ref().filter(|study| study.group > 0);
    let is_of_group = study.is_some_and(|study| {
        study.seat == seat || study.others.iter().any(|other| other.seat == seat)
    });
    !header.tournament_id.is_empty() || is_of_group
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEAT: u32 = 2;

    fn header() -> v1::RecordHeader {
        v1::RecordHeader {
            seats: vec![v1::Participant::default(); 4],
            policy: Some(v1::RoomPolicy {
                absence_time_ms: Some(400),
                max_timeouts: Some(3),
                substitute: "greedy".into(),
                ..v1::RoomPolicy::default()
            }),
            ..v1::RecordHeader::default()
        }
    }

    fn playing(header: &v1::RecordHeader) -> Seats {
        let mut seats = Seats::new(header);
        seats.begun = true;
        seats
    }

    fn substituted() -> Kind {
        Kind::Substituted(v1::Substituted {
            seat: SEAT,
            built_in_agent: "greedy".into(),
            for_good: false,
        })
    }

    #[test]
    fn one_absence_gives_one_substitute() {
        let header = header();
        let mut seats = playing(&header);
        seats.clocks[2].absent_at_most = true;
        let returned = Kind::Returned(v1::Returned { seat: SEAT });
        assert_eq!(seats.take(&substituted(), 1, &header), Ok(true));
        assert_eq!(seats.take(&returned, 2, &header), Ok(true));
        let again = seats.take(&substituted(), 3, &header);
        let problem = again.expect_err("it has not decided since");
        assert!(problem.contains("late 0 times in a row of 3"), "{problem}");
    }

    #[test]
    fn after_too_many_connection_events_a_restart_tells_nothing_of_a_seat() {
        let header = header();
        let mut seats = playing(&header);
        let restarted = Kind::ServerRestarted(v1::ServerRestarted::default());
        assert_eq!(seats.take(&restarted, 0, &header), Ok(true));
        assert_eq!(seats.clocks[2].connected, Some(false));
        for elapsed_ms in 0..u64::from(MAX_CONNECTION_EVENTS) {
            let kind = match elapsed_ms % 2 {
                0 => Kind::Disconnected(v1::Disconnected {
                    seat: SEAT,
                    ..v1::Disconnected::default()
                }),
                _ => Kind::Returned(v1::Returned { seat: SEAT }),
            };
            assert_eq!(seats.take(&kind, elapsed_ms, &header), Ok(true));
        }
        assert_eq!(seats.take(&restarted, 5_000, &header), Ok(true));
        assert_eq!(seats.clocks[2].connected, None, "it may be attached again");
        assert_eq!(seats.clocks[2].away_ms_at(6_000), None);
    }
}
