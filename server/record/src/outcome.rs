//! The outcome of a finished game: places, points and counts by seat, for tournaments and ratings.
//! Reads the lines as they are; verify untrusted records first.

use std::collections::BTreeSet;

use chefshat_engine::{OwnChoices, SeatStatistics};
use chefshat_proto::v1::{
    self, DecisionSource, GameOrigin, ParticipantKind, RoomState, game_event::Kind,
    record_line::Line,
};

/// The built-in agent that imitates a recorded player.
const REPLAY: &str = "replay";

/// The outcome of a finished game.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Identifies the game.
    pub game_id: String,
    /// Its tournament; empty if none.
    pub tournament_id: String,
    /// Milliseconds since the Unix epoch when it ended.
    pub ended_at_ms: u64,
    /// Shifts played.
    pub shifts: u32,
    /// The result of each seat, in order.
    pub seats: Vec<SeatOutcome>,
    /// Why the game is unrated; `None` if it is rated. Does not detect a built-in agent in the
    /// seat of a missing participant.
    pub unrated: Option<Unrated>,
}

impl Outcome {
    /// Whether the game is rated, as far as the record shows.
    pub fn is_rated(&self) -> bool {
        self.unrated.is_none()
    }

    /// The players with their places, for a rating.
    pub fn places(&self) -> Vec<(Identity, u32)> {
        let seats = self.seats.iter();
        let place = |seat: &SeatOutcome| u32::try_from(seat.statistics.place).unwrap_or(u32::MAX);
        seats.map(|seat| (seat.identity(), place(seat))).collect()
    }
}

/// The result of one seat.
#[derive(Debug, Clone, PartialEq)]
pub struct SeatOutcome {
    /// Displayed name.
    pub name: String,
    /// The fingerprint of the name and its key; empty without a key.
    pub name_fingerprint: String,
    /// Kind of participant; built-in agents are agents.
    pub kind: ParticipantKind,
    /// Name of the built-in agent; `None` for other participants.
    pub built_in: Option<String>,
    /// Result and statistics.
    pub statistics: SeatStatistics,
}

/// The identity a rating belongs to. Built-in agents are identified by the agent's name, not the
/// displayed one.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Identity {
    /// The name.
    pub name: String,
    /// Kind of participant.
    pub kind: ParticipantKind,
    /// Whether this is a built-in agent.
    pub built_in: bool,
    /// The fingerprint of the name and its key; empty without a key.
    pub name_fingerprint: String,
}

impl Identity {
    /// The identity of this seat's player.
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
            name_fingerprint: seat.name_fingerprint.clone(),
        }
    }
}

impl SeatOutcome {
    /// The identity of a participant.
    pub fn identity(&self) -> Identity {
        let (name, kind) = match &self.built_in {
            Some(agent) => (agent, ParticipantKind::Agent),
            None => (&self.name, self.kind),
        };
        Identity {
            name: name.clone(),
            kind,
            built_in: self.built_in.is_some(),
            name_fingerprint: self.name_fingerprint.clone(),
        }
    }
}

/// The key of annotations that says that another agent decided, the participant's fallback, and which.
pub const FALLBACK: &str = "fallback";

/// Whether annotations say that the participant's fallback decided.
pub fn is_by_fallback(annotations: &v1::Annotations) -> bool {
    annotations.extra.contains_key(FALLBACK)
}

/// What is left of annotations when the comments of a participant are deleted: that the fallback decided.
pub fn without_comments(annotations: &v1::Annotations) -> Option<v1::Annotations> {
    is_by_fallback(annotations).then(|| v1::Annotations {
        extra: [(FALLBACK.to_owned(), String::new())].into(),
        ..v1::Annotations::default()
    })
}

/// Whether more than one action was legal at a decision of a record.
pub fn has_choice(decision: &v1::DecisionRecord) -> bool {
    let ones = decision.action_mask.iter().map(|byte| byte.count_ones());
    ones.sum::<u32>() > 1
}

/// Counts a decision of a record if its participant had a choice.
pub(crate) fn add_choice(choices: &mut OwnChoices, decision: &v1::DecisionRecord) {
    if decision.source() == DecisionSource::Agent && has_choice(decision) {
        choices.add(decision.annotations.as_ref().is_some_and(is_by_fallback));
    }
}

/// Why a finished game is unrated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Unrated {
    /// The deals came from a given seed or hands or, for a leaderboard, from real cards; or the game
    /// was imported.
    #[error("the deals did not come from a seed committed by the server")]
    NotDealt,
    /// The game was private or unlisted.
    #[error("the game was not public")]
    NotPublic,
    /// A substitute played for a participant.
    #[error("a substitute played")]
    Substituted,
    /// The server suggested actions to a participant.
    #[error("a participant was given hints")]
    Hinted,
    /// One participant had several seats.
    #[error("a participant had more than one seat")]
    SameParticipant,
    /// A recorded player was imitated.
    #[error("a recorded player took part")]
    RecordedPlayer,
    /// A person played as another kind of participant.
    #[error("a person played as another kind of participant")]
    Wizard,
    /// The game has no result, and nobody is known to have broken it off.
    #[error("the game was not finished")]
    NotFinished,
}

impl Unrated {
    /// The reason as a word for programs.
    pub fn name(self) -> &'static str {
        match self {
            Self::NotDealt => "not_dealt",
            Self::NotPublic => "not_public",
            Self::Substituted => "substituted",
            Self::Hinted => "hinted",
            Self::SameParticipant => "same_participant",
            Self::RecordedPlayer => "recorded_player",
            Self::Wizard => "wizard",
            Self::NotFinished => "not_finished",
        }
    }
}

/// Why a record has no outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum OutcomeError {
    /// The game was aborted.
    #[error("the game was not finished")]
    NotFinished,
    /// The record does not begin with its header.
    #[error("the record has no header")]
    NoHeader,
    /// The final standings do not list every seat once with places from 1.
    #[error("the final standings do not match the seats")]
    Standings,
    /// A line has a wrong seat or a wrong number of seats.
    #[error("line {0} does not match the seats")]
    Seat(usize),
}

/// Reads the outcome of a record.
///
/// # Errors
/// The game was not finished, or the lines are inconsistent.
pub fn outcome(lines: &[v1::RecordLine]) -> Result<Outcome, OutcomeError> {
    let mut gathering = Gathering::default();
    for line in lines {
        gathering.add(line);
    }
    gathering.outcome()
}

/// Reads the outcome of a record line by line: the lines of a long game take much memory together.
#[derive(Debug, Default)]
pub struct Gathering {
    lines: usize,
    gathered: Option<Gathered>,
    problem: Option<OutcomeError>,
    /// Whether the last line says that the game was finished.
    finished: bool,
}

impl Gathering {
    /// Adds the next line.
    pub fn add(&mut self, line: &v1::RecordLine) {
        let line = line.line.as_ref();
        self.lines += 1;
        self.finished =
            matches!(line, Some(Line::Footer(footer)) if footer.state() == RoomState::Finished);
        match (&mut self.gathered, line) {
            (None, Some(Line::Header(header))) if self.lines == 1 => {
                self.gathered = Some(Gathered::of(header));
            }
            (Some(gathered), line) => {
                if gathered.line(line).is_none() {
                    self.problem.get_or_insert(OutcomeError::Seat(self.lines));
                }
            }
            (None, _) => {}
        }
    }

    /// The outcome, once all lines have been added.
    ///
    /// # Errors
    /// The game was not finished, or the lines are inconsistent.
    pub fn outcome(self) -> Result<Outcome, OutcomeError> {
        let mut gathered = self.gathered.ok_or(OutcomeError::NoHeader)?;
        if let Some(problem) = self.problem {
            return Err(problem);
        }
        let standings = gathered.standings.take().filter(|_| self.finished);
        let standings = standings.ok_or(OutcomeError::NotFinished)?;
        let mut seats = gathered.seats;
        place(&mut seats, &standings).ok_or(OutcomeError::Standings)?;
        for seat in &mut seats {
            // The sum until now.
            seat.statistics.performance_score /= f64::from(gathered.shifts.max(1));
        }
        let wizard = gathered.wizard.then_some(Unrated::Wizard);
        Ok(Outcome {
            game_id: gathered.game_id,
            tournament_id: gathered.tournament_id,
            ended_at_ms: gathered.created_at_ms.saturating_add(gathered.elapsed_ms),
            shifts: gathered.shifts,
            unrated: unrated(gathered.origin, &seats).or(wizard),
            seats,
        })
    }
}

impl SeatOutcome {
    /// A seat before its first decision.
    fn of(participant: &v1::Participant) -> Self {
        let built_in = &participant.built_in_agent;
        Self {
            name: participant.name.clone(),
            name_fingerprint: participant.name_fingerprint.clone(),
            kind: participant.kind(),
            built_in: (!built_in.is_empty()).then(|| built_in.clone()),
            statistics: SeatStatistics {
                substituted: participant.substituted,
                ..SeatStatistics::default()
            },
        }
    }
}

/// The header, and the totals of the lines so far.
#[derive(Debug)]
struct Gathered {
    game_id: String,
    tournament_id: String,
    created_at_ms: u64,
    origin: GameOrigin,
    /// Whether a person played as another kind of participant.
    wizard: bool,
    seats: Vec<SeatOutcome>,
    shifts: u32,
    elapsed_ms: u64,
    standings: Option<Vec<v1::Standing>>,
}

impl Gathered {
    fn of(header: &v1::RecordHeader) -> Self {
        let mut seats = header.seats.iter();
        Self {
            game_id: header.game_id.clone(),
            tournament_id: header.tournament_id.clone(),
            created_at_ms: header.created_at_ms,
            origin: header.origin(),
            wizard: seats.any(|seat| seat.shown_kind() != ParticipantKind::Unspecified),
            seats: header.seats.iter().map(SeatOutcome::of).collect(),
            shifts: 0,
            elapsed_ms: 0,
            standings: None,
        }
    }

    /// Adds a line; `None` if it does not match the seats.
    fn line(&mut self, line: Option<&Line>) -> Option<()> {
        match line {
            Some(Line::Decision(decision)) => self.decision(decision),
            Some(Line::Event(event)) => {
                self.elapsed_ms = event.elapsed_ms;
                match &event.kind {
                    Some(Kind::Substituted(substituted)) => {
                        self.seat(substituted.seat)?.statistics.substituted = true;
                    }
                    Some(Kind::ShiftEnded(shift)) => self.shift(shift)?,
                    Some(Kind::GameEnded(ended)) => {
                        self.standings = Some(ended.standings.clone());
                    }
                    _ => {}
                }
                Some(())
            }
            _ => Some(()),
        }
    }

    fn decision(&mut self, decision: &v1::DecisionRecord) -> Option<()> {
        let seat = &mut self.seat(decision.seat)?.statistics;
        seat.hinted |= decision.hints > 0;
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
            seat.statistics.performance_score += 10.0 * f64::from(*points) / pizzas;
        }
        Some(())
    }

    fn seat(&mut self, seat: u32) -> Option<&mut SeatOutcome> {
        self.seats.get_mut(usize::try_from(seat).ok()?)
    }
}

/// Sets places and points; `None` unless every seat gets one of the places from 1.
fn place(seats: &mut [SeatOutcome], standings: &[v1::Standing]) -> Option<()> {
    let mut places = BTreeSet::new();
    for line in standings {
        let seat = &mut seats.get_mut(usize::try_from(line.seat).ok()?)?.statistics;
        let place = usize::try_from(line.place).ok()?;
        let fits = seat.place == 0 && place >= 1 && places.insert(place);
        if !fits {
            return None;
        }
        (seat.place, seat.points) = (place, line.points);
    }
    let complete = places.len() == seats.len() && places.last() == Some(&seats.len());
    complete.then_some(())
}

fn unrated(origin: GameOrigin, seats: &[SeatOutcome]) -> Option<Unrated> {
    let known: BTreeSet<Identity> = seats.iter().map(SeatOutcome::identity).collect();
    if !matches!(origin, GameOrigin::Dealt | GameOrigin::Physical) {
        Some(Unrated::NotDealt)
    } else if seats.iter().any(|seat| seat.statistics.substituted) {
        Some(Unrated::Substituted)
    } else if seats.iter().any(|seat| seat.statistics.hinted) {
        Some(Unrated::Hinted)
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
