//! What each seat did in a finished game, from the lines of its record as they stand: nothing is replayed, so whoever does not trust a
//! record replays it first. What a tournament or a rating makes of it is decided elsewhere.

use std::collections::BTreeSet;

use chefshat_proto::v1::{
    self, DecisionSource, GameOrigin, ParticipantKind, RoomState, game_event::Kind,
    record_line::Line,
};

/// Name of the built-in agent that plays a recorded player.
const REPLAY: &str = "replay";

/// What came of a finished game.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Identifies the game.
    pub game_id: String,
    /// The tournament it belonged to; empty if it belonged to none.
    pub tournament_id: String,
    /// Milliseconds since the Unix epoch when it ended.
    pub ended_at_ms: u64,
    /// Shifts played.
    pub shifts: u32,
    /// What each seat did; index = seat.
    pub seats: Vec<SeatOutcome>,
    /// Why it counts for no rating; `None` if it does. Whether a built-in agent sits in the seat of somebody who did not come is not seen
    /// here.
    pub unrated: Option<Unrated>,
}

impl Outcome {
    /// Whether it counts for ratings, as far as its record can tell.
    pub fn is_rated(&self) -> bool {
        self.unrated.is_none()
    }

    /// Who played, and the place of each, as a rating is told of a game.
    pub fn places(&self) -> Vec<(Identity, u32)> {
        let seats = self.seats.iter();
        seats.map(|seat| (seat.identity(), seat.place)).collect()
    }
}

/// What one seat did.
#[derive(Debug, Clone, PartialEq)]
pub struct SeatOutcome {
    /// Name it was shown by.
    pub name: String,
    /// What the participant was; a built-in agent is an agent.
    pub kind: ParticipantKind,
    /// Name of the built-in agent that filled the seat; `None` for all others.
    pub built_in: Option<String>,
    /// Place in the game, from 1.
    pub place: u32,
    /// Points in the game.
    pub points: u64,
    /// Whether a substitute played for it at any time.
    pub substituted: bool,
    /// Decisions that it took itself or lost to the clock or to invalid attempts: all but those of a substitute and those taken over from
    /// another record.
    pub decisions: u64,
    /// Invalid attempts at those, of every kind of decision.
    pub wrong_actions: u64,
    /// Those of them that were lost to the clock, connected or not.
    pub timeouts: u64,
    /// Measured time of the decisions it took itself, microseconds, in all.
    pub decision_time_us: u64,
    /// How many of those were measured; those of built-in agents are not.
    pub timed_decisions: u64,
    /// Performance score: the mean over the Shifts of 10 times its points by the number of pizzas.
    pub performance_score: f64,
}

/// Who a rating is of. Built-in agents go by the agent's name, not by the one they were shown by.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Identity {
    /// The name.
    pub name: String,
    /// What it is.
    pub kind: ParticipantKind,
    /// Whether it is a built-in agent.
    pub built_in: bool,
}

impl Identity {
    /// Who a rating of this seat's player is of.
    pub fn of(seat: &v1::Participant) -> Self {
        let built_in = !seat.built_in_agent.is_empty();
        let (name, kind) = match built_in {
            true => (&seat.built_in_agent, ParticipantKind::Agent),
            false => (&seat.name, seat.kind()),
        };
        Self {
            name: name.clone(),
            kind,
            built_in,
        }
    }
}

impl SeatOutcome {
    /// Who a rating is of.
    pub fn identity(&self) -> Identity {
        let (name, kind) = match &self.built_in {
            Some(agent) => (agent, ParticipantKind::Agent),
            None => (&self.name, self.kind),
        };
        Identity {
            name: name.clone(),
            kind,
            built_in: self.built_in.is_some(),
        }
    }
}

/// Why a finished game counts for no rating.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Unrated {
    /// Its deals were not the server's own.
    #[error("the deals did not come from a seed that the server committed to")]
    NotDealt,
    /// Somebody else played for a participant.
    #[error("a substitute played")]
    Substituted,
    /// A rating cannot say who of the two was better.
    #[error("a participant had more than one seat")]
    SameParticipant,
    /// It plays as another player in every game.
    #[error("a recorded player took part")]
    RecordedPlayer,
}

impl Unrated {
    /// In a word, for programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotDealt => "not_dealt",
            Self::Substituted => "substituted",
            Self::SameParticipant => "same_participant",
            Self::RecordedPlayer => "recorded_player",
        }
    }
}

/// Why a record tells no outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum OutcomeError {
    /// The game has no result.
    #[error("the game was not finished")]
    NotFinished,
    /// The record does not begin with its header.
    #[error("the record has no header")]
    NoHeader,
    /// The final table does not name every seat once, with the places from 1 on.
    #[error("the final table does not fit the seats")]
    Standings,
    /// A line names a seat that the game does not have, or leaves one out.
    #[error("line {0} does not fit the seats")]
    Seat(usize),
}

/// What came of the game of a record.
///
/// # Errors
/// If the game was not finished, or the lines do not go together.
pub fn outcome(lines: &[v1::RecordLine]) -> Result<Outcome, OutcomeError> {
    let Some(Line::Header(header)) = lines.first().and_then(|line| line.line.as_ref()) else {
        return Err(OutcomeError::NoHeader);
    };
    let mut gathered = Gathered {
        seats: header.seats.iter().map(SeatOutcome::of).collect(),
        shifts: 0,
        elapsed_ms: 0,
        standings: None,
    };
    for (number, line) in (1..).zip(lines) {
        gathered
            .line(line.line.as_ref())
            .ok_or(OutcomeError::Seat(number))?;
    }
    let footer = lines.last().and_then(|line| line.line.as_ref());
    let finished =
        matches!(footer, Some(Line::Footer(footer)) if footer.state() == RoomState::Finished);
    let Some(standings) = gathered.standings.filter(|_| finished) else {
        return Err(OutcomeError::NotFinished);
    };
    let mut seats = gathered.seats;
    place(&mut seats, standings).ok_or(OutcomeError::Standings)?;
    for seat in &mut seats {
        // Until now the sum.
        seat.performance_score /= f64::from(gathered.shifts.max(1));
    }
    Ok(Outcome {
        game_id: header.game_id.clone(),
        tournament_id: header.tournament_id.clone(),
        ended_at_ms: header.created_at_ms.saturating_add(gathered.elapsed_ms),
        shifts: gathered.shifts,
        unrated: unrated(header.origin(), &seats),
        seats,
    })
}

impl SeatOutcome {
    /// A seat that has done nothing yet.
    fn of(participant: &v1::Participant) -> Self {
        let built_in = &participant.built_in_agent;
        Self {
            name: participant.name.clone(),
            kind: participant.kind(),
            built_in: (!built_in.is_empty()).then(|| built_in.clone()),
            place: 0,
            points: 0,
            substituted: participant.substituted,
            decisions: 0,
            wrong_actions: 0,
            timeouts: 0,
            decision_time_us: 0,
            timed_decisions: 0,
            performance_score: 0.0,
        }
    }
}

/// What the lines came to so far.
struct Gathered<'a> {
    seats: Vec<SeatOutcome>,
    shifts: u32,
    elapsed_ms: u64,
    standings: Option<&'a [v1::Standing]>,
}

impl<'a> Gathered<'a> {
    /// Takes in a line; `None` if it does not fit the seats.
    fn line(&mut self, line: Option<&'a Line>) -> Option<()> {
        match line {
            Some(Line::Decision(decision)) => self.decision(decision),
            Some(Line::Event(event)) => {
                self.elapsed_ms = event.elapsed_ms;
                match &event.kind {
                    Some(Kind::Substituted(substituted)) => {
                        self.seat(substituted.seat)?.substituted = true;
                    }
                    Some(Kind::ShiftEnded(shift)) => self.shift(shift)?,
                    Some(Kind::GameEnded(ended)) => self.standings = Some(&ended.standings),
                    _ => {}
                }
                Some(())
            }
            _ => Some(()),
        }
    }

    fn decision(&mut self, decision: &v1::DecisionRecord) -> Option<()> {
        let seat = self.seat(decision.seat)?;
        let source = decision.source();
        match source {
            DecisionSource::Substitute => seat.substituted = true,
            DecisionSource::Recorded => {}
            _ => {
                seat.decisions += 1;
                let attempts = decision.invalid_attempts.len();
                seat.wrong_actions += u64::try_from(attempts).unwrap_or(u64::MAX);
            }
        }
        match source {
            DecisionSource::Timeout | DecisionSource::Disconnected => seat.timeouts += 1,
            DecisionSource::Agent if decision.decision_time_us > 0 => {
                let time = &mut seat.decision_time_us;
                *time = time.saturating_add(decision.decision_time_us);
                seat.timed_decisions += 1;
            }
            _ => {}
        }
        Some(())
    }

    fn shift(&mut self, shift: &v1::ShiftEnded) -> Option<()> {
        self.shifts += 1;
        if shift.shift_points.len() != self.seats.len() {
            return None;
        }
        let pizzas = f64::from(shift.pizzas.max(1));
        for (seat, points) in self.seats.iter_mut().zip(&shift.shift_points) {
            seat.performance_score += 10.0 * f64::from(*points) / pizzas;
        }
        Some(())
    }

    fn seat(&mut self, seat: u32) -> Option<&mut SeatOutcome> {
        self.seats.get_mut(usize::try_from(seat).ok()?)
    }
}

/// Gives the seats their places and points; `None` unless each has one of the places from 1 on.
fn place(seats: &mut [SeatOutcome], standings: &[v1::Standing]) -> Option<()> {
    let mut places = BTreeSet::new();
    for line in standings {
        let seat = seats.get_mut(usize::try_from(line.seat).ok()?)?;
        let place = usize::try_from(line.place).ok()?;
        let fits = seat.place == 0 && place >= 1 && places.insert(place);
        if !fits {
            return None;
        }
        (seat.place, seat.points) = (line.place, line.points);
    }
    let complete = places.len() == seats.len() && places.last() == Some(&seats.len());
    complete.then_some(())
}

fn unrated(origin: GameOrigin, seats: &[SeatOutcome]) -> Option<Unrated> {
    let known: BTreeSet<Identity> = seats.iter().map(SeatOutcome::identity).collect();
    if origin != GameOrigin::Dealt {
        Some(Unrated::NotDealt)
    } else if seats.iter().any(|seat| seat.substituted) {
        Some(Unrated::Substituted)
    } else if seats
        .iter()
        .any(|seat| seat.built_in.as_deref() == Some(REPLAY))
    {
        Some(Unrated::RecordedPlayer)
    } else if known.len() < seats.len() {
        Some(Unrated::SameParticipant)
    } else {
        None
    }
}
